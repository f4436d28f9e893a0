"""The pose and the motion of a predicted drive at one station."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import Ground
from ..model.linkage import P_RADIUS, Z
from ..model.mass import centre_of_mass
from ..search.workspace import Work
from ..solve.newton import CONVERGED, NOT_CONVERGED, beyond_stops, settle_contact
from .balance_residual import Law, Motion
from .contact_law import FORCE, OVERLOAD, RIM, ROW, SINKAGE, TORQUE
from .drive_state import Drive, State, any_free, set_on_ground
from .equilibrium_motion import SMOOTHING, solve_limited
from .further_contacts import add_contacts
from .further_state import Further, rate_of
from .linear import copy_numbers
from .near import settle_near
from .record import contact_motion
from .station import FREE, Station, balance_at, settled_rates

Array = NDArray[np.float64]

# Codes of a rollout's end, besides those of rockerbogie.Status
REACHED_END, NO_BALANCE, OVERLOADED, INACCURATE = 0, 100, 101, 102

# Columns of a command: constant over one step
C_TRACKS = 0  # 1: wheel rates are those of a planar twist at the pose; 0: wheel rates are given
C_VALUES = 1  # (6,) forward, left, yaw rate in the heading's axes, m/s and rad/s; or wheel rates, rad/s
C_STEERING = 7  # (6,) rad
C_SIZE = 13


@njit
def command_rims(s: Station, rover: Array, command: Array, cy: float, sy: float, rim: Array) -> float:
    """Fill the commanded rim speeds of a pose.

    Args:
        s: of the pose.
        rover: (P_SIZE,) packed rover.
        command: (C_SIZE,).
        cy, sy: cos and sin of yaw.
        rim: (6,) filled, m/s.

    Returns:
        The fastest, m/s.
    """
    fastest = 0.0
    if command[C_TRACKS] != 0.0:
        forward, left, turn = command[C_VALUES], command[C_VALUES + 1], command[C_VALUES + 2]
        vx, vy = cy * forward - sy * left, sy * forward + cy * left
        for i in range(6):
            rim[i] = s.ways[i, 0, 0] * vx + s.ways[i, 0, 1] * vy + s.ways[i, 0, 2] * turn
    else:
        for i in range(6):
            rim[i] = rover[P_RADIUS + i] * command[C_VALUES + i]
    for i in range(6):
        fastest = max(fastest, abs(rim[i]))
    return fastest


@njit
def evaluate(
    ground: Ground, rover: Array, anew: bool, search: bool, span: float, command: Array, drive: Drive, work: Work, s: Station,
    m: Motion, further: Further, state: State,
) -> tuple[int, int]:  # fmt: skip
    """Settle a pose and solve for its motion.

    Args:
        ground, rover: the packed terrain and rover.
        anew, search: as for `settle_near`; search also fills the height, checks joint limits and prepares a record.
        span: duration of the next step, s.
        command: (C_SIZE,).
        drive: settings.
        work: contacts nearby; work.hub_offsets holds the steering.
        s, m, further: filled; m holds the solution nearby.
        state: `place` is the station; q is a pose nearby, replaced; the others but `kept` and `total` are filled.

    Returns:
        CONVERGED, another status code, NO_BALANCE or OVERLOADED; number of Newton steps of the balance.
    """
    x, y, cy, sy = state.place[0], state.place[1], math.cos(state.place[2]), math.sin(state.place[2])
    if math.isnan(state.q[Z]) or not settle_near(ground, rover, x, y, cy, sy, state.q, anew, search, state.raised, work):
        if any_free(state.free):
            return NOT_CONVERGED, 0
        set_on_ground(state)
        code, _ = settle_contact(ground, rover, x, y, cy, sy, 0, state.q, work)
        if math.isnan(state.q[Z]):
            return code, 0
    if search:
        if beyond_stops(rover, state.q):
            return 3, 0
        height = centre_of_mass(rover, work.hub_offsets, state.q, cy, sy, work.axes, work.pivots, state.slope)
        state.height[0] = state.q[Z] + height
    weight = balance_at(ground, rover, x, y, cy, sy, state.q, state.raised, drive.gravity, drive.soil or search, work, s)
    if weight == 0.0:
        return NO_BALANCE, 0
    for i in range(6):
        state.limit[i] = drive.torque[i] / weight
    fastest = command_rims(s, rover, command, cy, sy, state.rim)
    soil = drive.soil and fastest > 0.0  # parked wheels have no direction of slip: friction holds them
    if fastest == 0.0:
        fastest = drive.reference
    law = Law(drive.friction, soil, drive.tables, drive.table_of, weight, state.rim, state.limit, fastest, state.free)
    steps = solve_limited(s, rover, law, m)
    if steps < 0:
        return NO_BALANCE, 0
    further.size[0] = 0
    if soil:
        more = add_contacts(ground, rover, x, y, cy, sy, span, law, state.raised, work, s, m, further)
        if more < 0:
            further.size[0] = 0
            solve_limited(s, rover, law, m)
        steps += max(more, 0)
    done = lost = overload = 0.0
    for i in range(6):
        f = m.force[i]
        ut, us, turn = contact_motion(s, m, i)
        motor = f[TORQUE] * f[RIM] / rover[P_RADIUS + i]
        done += motor
        lost += motor - f[FORCE] * ut - f[FORCE + 1] * us
        if soil:
            lost -= f[FORCE + 2] * turn
            overload = max(overload, f[OVERLOAD])
    state.several[0] = 1.0 if further.size[0] > 0 else 0.0
    for j in range(further.size[0]):
        f, ways = further.force[j], further.ways[j]
        motor = f[TORQUE] * f[RIM] / rover[P_RADIUS + further.wheel[j]]
        done += motor
        lost += motor
        for c in range(3):
            lost -= f[FORCE + c] * rate_of(ways[1 + c], m.y)
        overload = max(overload, f[OVERLOAD])
    if overload > 0.0:
        return OVERLOADED, steps
    state.power[0], state.power[1] = weight * done, weight * lost
    copy_numbers(m.y[:FREE], state.w)
    for i in range(6):
        state.rising[i] = m.y[FREE + i] / s.normal[i, 2]
    for j in range(further.size[0]):
        if further.load[j] > SMOOTHING:
            i = further.wheel[j]
            state.rising[i] = 0.0
            m.load[i] += further.load[j]
            for c in range(ROW):
                m.force[i, c] += further.force[j, c] if c != RIM and c != SINKAGE else 0.0
    settled_rates(s, m.y, state.rates)
    return CONVERGED, steps
