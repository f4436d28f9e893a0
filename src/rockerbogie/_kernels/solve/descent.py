"""First equilibrium by quasi-static descent: an overdamped flow of the potential energy.

With damping in proportion to inertia, R dq/dt = -(gradient of the height of the centre of mass), no gap negative,
joints within their limits. Each step is a small quadratic program, implicit in time: any length is stable while the
contacts hold.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.linkage import BOGIE_L, P_BODY, P_BOGIE, P_BOGIE_PIVOT, P_PIVOT, P_ROCKER, P_STOPS, P_WHEEL, PITCH, ROCKER, ROLL, Z
from ..model.mass import centre_of_mass
from ..model.wheel import COSINE, PLACE, SIN
from ..search.box_points import NEAR_ROOM, NEAR_SIZE
from ..search.tread import FOUND
from .contact_set import body_contacts, list_contacts, lowest_contacts, shift_to_contact
from .qp import solve_qp
from .site import Contacts, Program, Site
from .six_wheels import SixWheels, box_is_clear, leads_to

Array = NDArray[np.float64]

REACH = 0.05  # rad, the longest step
SHORTEST = 1e-4  # rad: a shorter step that does not decrease the energy as predicted is left to `equilibrium`
PACE, LONGEST = 0.1, 4.0  # time of the first step and the longest, in that of a fall by the rover's own radius of gyration
SLOW = 1e-3  # rad: a pose that moves less in the longest time is near equilibrium
STEPS = 200
SIX_WHEELS = -2  # code: the descent leads to the six-wheel equilibrium
FALLEN = 1.3  # rad of roll or pitch beyond which the rover has tipped over


@njit
def build_constraints(rover: Array, q: Array, contacts: Contacts, count: int, trust_radius: float, program: Program) -> int:
    """Write the constraints n_k·d ≥ b_k of a step d.

    They are contacts, joint limits and the trust region.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
        contacts: contacts and near contacts.
        count: number of contacts.
        trust_radius: largest change of an unknown; inf for none.
        program: its n and b are filled.

    Returns:
        Number of constraints.
    """
    gap, rows, _ = contacts
    n, b = program.n, program.b
    m = count
    for k in range(count):
        for j in range(6):
            n[k, j] = rows[k, j]
        b[k] = -gap[k]
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        for end in range(2):
            if math.isfinite(rover[at + end]):
                n[m] = 0.0
                sign = 1.0 if end == 0 else -1.0
                n[m, ROCKER + k] = sign
                b[m] = sign * (rover[at + end] - q[ROCKER + k])
                m += 1
    if trust_radius < math.inf:
        for k in range(6):
            for end in range(2):
                n[m] = 0.0
                n[m, k] = 1.0 if end == 0 else -1.0
                b[m] = -trust_radius
                m += 1
    return m


@njit
def damping_weights(rover: Array, hub_offsets: Array, out: Array) -> None:
    """Compute the damping of the six unknowns (z, roll, pitch, rocker, both bogies).

    The damping of an angle is the moment of inertia about its axis of the links that it moves, with all joints at 0,
    divided by the rover's mass.

    Args:
        rover: (P_SIZE,) packed rover.
        hub_offsets: (6, 5) of `linkage.set_hub_offsets`.
        out: (6,) filled: m² for the angles, 1 for z.
    """
    out[:] = 0.0
    total = rover[P_BODY]
    x, y, z = rover[P_BODY + 1], rover[P_BODY + 2], rover[P_BODY + 3]
    out[ROLL] += total * (y * y + z * z)
    out[PITCH] += total * (x * x + z * z)
    for side in range(2):
        pivot = rover[P_PIVOT + 3 * side : P_PIVOT + 3 * side + 3]
        bogie_pivot = rover[P_BOGIE_PIVOT + 3 * side : P_BOGIE_PIVOT + 3 * side + 3]
        for part in range(5):  # rocker, bogie, and the three wheels of this side
            i = 2 * (part - 2) + side
            at = P_ROCKER + 4 * side if part == 0 else (P_BOGIE + 4 * side if part == 1 else P_WHEEL + 4 * i)
            m, x, y, z = rover[at], rover[at + 1], rover[at + 2], rover[at + 3]
            if part >= 2:
                x, y, z = x + hub_offsets[i, 0], y + hub_offsets[i, 1], z + hub_offsets[i, 2]
            on_bogie = part == 1 or part >= 3
            if on_bogie:
                out[BOGIE_L + side] += m * (x * x + z * z)
                x, y, z = x + bogie_pivot[0], y + bogie_pivot[1], z + bogie_pivot[2]
            out[ROCKER] += m * (x * x + z * z)
            x, y, z = x + pivot[0], y + pivot[1], z + pivot[2]
            out[ROLL] += m * (y * y + z * z)
            out[PITCH] += m * (x * x + z * z)
            total += m
    for k in range(1, 6):
        out[k] = max(out[k], 1e-6 * out[PITCH]) / total
    out[Z] = 1.0


@njit
def start_level(rover: Array, q: Array) -> None:
    """Set the start of the descent: horizontal, with joints as straight as their limits allow.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) filled; z is 0.
    """
    q[:] = 0.0
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        q[ROCKER + k] = min(max(0.0, rover[at]), rover[at + 1])


@njit
def find_step(
    rover: Array, q: Array, slope: Array, contacts: Contacts, count: int, resist: Array, pace: float, program: Program
) -> tuple[float, float]:
    """Compute a step of the descent, implicit in time.

    It is shortened until no angle changes by more than `REACH`.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
        slope: (6,) gradient of the height of the centre of mass.
        contacts, count: contacts and near contacts.
        resist: (6,) damping of each unknown.
        pace: length of the step in time.
        program: scratch; its `inverse` is zero off the diagonal, its d is filled with the step.

    Returns:
        Largest change of an angle, rad, NaN if the program cannot be solved; length of the step in time.
    """
    n, b, inverse, d, force = program
    m = build_constraints(rover, q, contacts, count, math.inf, program)
    size = math.inf
    while size > REACH:
        for k in range(6):
            inverse[k, k] = pace / resist[k]
        if not solve_qp(inverse, slope, n, b, m, d, force):
            return math.nan, pace
        size = 0.0
        for k in range(1, 6):
            size = max(size, abs(d[k]))
        if size > REACH:
            pace *= 0.8 * REACH / size
    return size, pace


@owning_njit
def let_down(site: Site, q: Array, six: SixWheels, contacts: Contacts, program: Program) -> tuple[int, int]:
    """Compute a first equilibrium by quasi-static descent from above.

    The descent starts horizontal and with straight joints. It ends at the first pose from which it leads to the six-wheel
    equilibrium that is given.

    Args:
        site: rover, position and terrain.
        q: (6,) filled with a pose near the equilibrium.
        six: six-wheel equilibrium of this position; a share of 0 stands for none.
        contacts: filled with the near contacts there, as `touch_down` fills them.
        program: scratch.

    Returns:
        Code and number of contacts as `touch_down`; -1 contacts with code -1 if the rover tips over; SIX_WHEELS and 0
        contacts if the descent leads to the six-wheel equilibrium.
    """
    ground, rover, x, y, cy, sy, work = site
    hub_offsets, axes, pivots = work.hub_offsets, work.axes, work.pivots
    near = np.empty((NEAR_ROOM, NEAR_SIZE))
    slope, next_slope, trial, resist = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    program.inverse[:] = 0.0
    start_level(rover, trial)
    for i in range(6):
        work.touch[i, SIN], work.touch[i, COSINE], work.touch[i, PLACE] = 0.0, 1.0, 0.0
    damping_weights(rover, hub_offsets, resist)
    size_of_rover = math.sqrt(resist[PITCH])
    longest, pace = LONGEST * size_of_rover, PACE * size_of_rover
    height, predicted_decrease, size = math.inf, 0.0, 0.0
    code, count, points, above = FOUND, -1, 0, 0.0
    for _ in range(STEPS + 1):
        there, least = lowest_contacts(site, trial, True)
        if least < math.inf:
            centre = centre_of_mass(rover, hub_offsets, trial, cy, sy, axes, pivots, next_slope)
            if six.share[0] > 0.0 and there == FOUND and box_is_clear(ground, rover, axes, x, y, trial[Z] - least):
                fell = height - (trial[Z] - least) - centre
                if fell > 0.5 * predicted_decrease and leads_to(site, trial, next_slope, six):
                    return SIX_WHEELS, 0
            box, points, clearance = body_contacts(site, trial, near)
            there, least, above = max(there, box), min(least, clearance), trial[Z]
            trial[Z] -= least
            fell = height - trial[Z] - centre
        elif count < 0:
            return there, -1
        else:
            fell = -math.inf
        if not fell > 0.5 * predicted_decrease:  # it met terrain that the program did not have: take a shorter step
            if size < SHORTEST:
                break
            pace *= 0.25
        else:
            if max(abs(trial[ROLL]), abs(trial[PITCH])) > FALLEN:
                return -1, -1
            height = trial[Z] + centre if count < 0 else height - fell
            trial[Z] = above
            count = list_contacts(site, trial, near, points, contacts)
            code = there
            shift_to_contact(trial, contacts.gap, count, least)
            q[:], slope[:] = trial, next_slope
            if fell < math.inf and fell > 0.8 * predicted_decrease:
                pace = min(2.0 * pace, longest)
        size, pace = find_step(rover, q, slope, contacts, count, resist, pace, program)
        if math.isnan(size) or (pace >= longest and size < SLOW):
            break
        predicted_decrease = 0.0
        for k in range(6):
            predicted_decrease -= slope[k] * program.d[k]
            trial[k] = q[k] + program.d[k]
    return code, count
