"""Predicted drives: the motion integrated over time, one rover at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.ground import META_CUBIC, META_X, META_Y, META_Z, Ground, borrow
from ..model.linkage import P_RADIUS, Z, set_hub_offsets
from ..model.mass import centre_of_mass
from ..search.workspace import WORK_SIZE, Work, lay_out
from ..solve.newton import CONVERGED, NOT_CONVERGED, beyond_stops, settle_contact
from .balance_residual import MOTION_SIZE, Law, Motion, new_motion, reset_motion
from .contact_law import FORCE, OVERLOAD, RIM, SINKAGE, TORQUE
from .drive_state import STATE_SIZE, Drive, State, any_free, keep, new_state, restore, set_on_ground, set_raised
from .equilibrium_motion import solve_limited
from .linear import copy_numbers
from .near import settle_near
from .station import FREE, STATION_SIZE, Station, balance_at, new_station, settled_rates

Array = NDArray[np.float64]

# Codes of a rollout's end, besides those of rockerbogie.Status
REACHED_END, NO_BALANCE, OVERLOADED, INACCURATE = 0, 100, 101, 102

# Columns of a command: constant over one step
C_TRACKS = 0  # 1: wheel rates are those of a planar twist at the pose; 0: wheel rates are given
C_VALUES = 1  # (6,) forward, left, yaw rate in the heading's axes, m/s and rad/s; or wheel rates, rad/s
C_STEERING = 7  # (6,) rad
C_SIZE = 13

# Columns of a record
R_X, R_Y, R_YAW = 0, 1, 2
R_Q = 3  # (6,)
R_RATE = 9  # (3,) of x, y and yaw, then (6,) of q
R_WHEEL = 18  # (6,) rad/s, and so on for blocks of six
R_COMMAND = 24
R_LOAD = 30  # N
R_TRACTION = 36
R_SIDE = 42
R_TORQUE = 48  # N m
R_ROLL_SLIP = 54  # m/s
R_SIDE_SLIP = 60
R_TURN = 66  # rad/s of the link about the axle
R_SINKAGE = 72  # m
R_WORK, R_LOSS, R_HEIGHT = 78, 79, 80  # J done by the motors, J dissipated, m of the centre of mass
R_STEPS = 81  # Newton steps of the balance
R_SCALE = 82  # slip scale of the friction law over the reference speed
R_SIZE = 83

DEEPEST = 20  # halvings of a step: where a contact jumps, each halves the error only
LEAST_ERROR = 1e-9  # m by which the weight is lifted: smaller errors of a step's energy are those of the poses
MOST_PARTS = 32.0  # sum of the errors of a step's parts over the error allowed for each
RETRIES = 4  # halvings of a step without a solution, where no tolerance is given


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
    ground: Ground, rover: Array, anew: bool, search: bool, command: Array, drive: Drive, work: Work, s: Station, m: Motion,
    state: State,
) -> tuple[int, int]:  # fmt: skip
    """Settle a pose and solve for its motion.

    Args:
        ground, rover: the packed terrain and rover.
        anew, search: as for `settle_near`; search also fills the height, checks joint limits and prepares a record.
        command: (C_SIZE,).
        drive: settings.
        work: contacts nearby; work.hub_offsets holds the steering.
        s, m: filled; m holds the solution nearby.
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
    if overload > 0.0:
        return OVERLOADED, steps
    state.power[0], state.power[1] = weight * done, weight * lost
    copy_numbers(m.y[:FREE], state.w)
    for i in range(6):
        state.rising[i] = m.y[FREE + i] / s.normal[i, 2]
    settled_rates(s, m.y, state.rates)
    return CONVERGED, steps


@njit
def runge_kutta(
    ground: Ground, rover: Array, span: float, command: Array, drive: Drive, work: Work, s: Station, m: Motion, state: State
) -> int:
    """Advance one step from the station in `state.kept`, without evaluating its end.

    The method is that of Bogacki and Shampine (1989), of order 3, with stages at 0, 1/2 and 3/4 of the step. The motion jumps
    where a contact does, and of such a function these three give a closer mean than 0, 1/2 and 1 of the classical method.

    Args:
        ground, rover, command, drive, work, s, m: as for `evaluate`.
        span: duration of the step, s.
        state: at the station on entry; replaced: `place` by the end, `q` by a pose near it, `total` by the sums of w and power.

    Returns:
        CONVERGED, or the code of the stage without a solution; `place` is then that stage's.
    """
    total, cubic = state.total, ground[2][META_CUBIC] != 0.0
    for j in range(3):
        total[j] = 2.0 * state.w[j]
    for j in range(2):
        total[3 + j] = 2.0 * state.power[j]
    for i in range(6):
        total[5 + i] = 2.0 * state.rising[i]
    for stage in range(2):
        share, ahead, weight = (0.5, 0.5, 3.0) if stage == 0 else (0.75, 0.25, 4.0)
        for j in range(3):
            state.place[j] = state.kept_place[j] + share * span * state.w[j]
        for i in range(6):
            state.raised[i] = max(state.kept_raised[i] + share * span * state.rising[i], 0.0)
        for j in range(6):  # from the pose before, by its rates
            state.q[j] += ahead * span * state.rates[j]
        code, _ = evaluate(ground, rover, True, cubic and stage == 0, command, drive, work, s, m, state)
        if code != CONVERGED:
            return code
        for j in range(3):
            total[j] += weight * state.w[j]
        for j in range(2):
            total[3 + j] += weight * state.power[j]
        for i in range(6):
            total[5 + i] += weight * state.rising[i]
    for i in range(6):
        set_raised(state, i, state.kept_raised[i] + span / 9.0 * total[5 + i])
    for j in range(3):
        state.place[j] = state.kept_place[j] + span / 9.0 * total[j]
    for j in range(6):
        state.q[j] += 0.25 * span * state.rates[j]
    return CONVERGED


@njit
def let_down(
    ground: Ground, rover: Array, command: Array, drive: Drive, work: Work, s: Station, m: Motion, state: State
) -> tuple[int, int, float]:
    """Land all wheels and evaluate the station again.

    A wheel off the ground for which no motion balances falls, and faster than the rover moves.

    Args:
        ground, rover, command, drive, work, s, m: as for `evaluate`.
        state: at the station; replaced.

    Returns:
        Code and number of Newton steps, as `evaluate`; m by which the centre of mass falls.
    """
    before = state.height[0]
    set_on_ground(state)
    code, steps = evaluate(ground, rover, True, True, command, drive, work, s, m, state)
    return code, steps, before - state.height[0]


@njit
def take_step(
    ground: Ground, rover: Array, span: float, command: Array, drive: Drive, work: Work, s: Station, m: Motion, state: State
) -> tuple[int, int, float]:
    """Advance one step from the station in `state.kept`, and evaluate its end.

    Args:
        ground, rover, span, command, drive, work, s, m, state: as for `runge_kutta`.

    Returns:
        CONVERGED, or the code of the stage without a solution; number of Newton steps at the end; m by which the centre of mass
        falls there when wheels land (`let_down`).
    """
    code = runge_kutta(ground, rover, span, command, drive, work, s, m, state)
    if code != CONVERGED:
        return code, 0, 0.0
    code, steps = evaluate(ground, rover, True, True, command, drive, work, s, m, state)
    if code == NO_BALANCE and any_free(state.free):
        return let_down(ground, rover, command, drive, work, s, m, state)
    return code, steps, 0.0


@njit
def contact_motion(s: Station, m: Motion, i: int) -> tuple[float, float, float]:
    """Return a contact's velocity forward and to the left, m/s, and its link's rate.

    The rate is that about the axle, rad/s.

    Args:
        s, m: pose and motion.
        i: wheel.
    """
    ut = us = turn = 0.0
    for k in range(9):
        ut += s.ways[i, 0, k] * m.y[k]
        us += s.ways[i, 1, k] * m.y[k]
        turn += s.ways[i, 2, k] * m.y[k]
    return ut, us, turn


@njit
def record(rover: Array, steps: int, s: Station, m: Motion, state: State, meta: Array, out: Array) -> None:
    """Fill a record of a station; energies are filled by the caller.

    Args:
        rover: (P_SIZE,) packed rover.
        steps: Newton steps of the balance.
        s, m, state: of the station.
        meta: map header.
        out: (R_SIZE,) filled.
    """
    out[R_X], out[R_Y], out[R_YAW] = state.place[0] + meta[META_X], state.place[1] + meta[META_Y], state.place[2]
    copy_numbers(state.q, out[R_Q : R_Q + 6])
    out[R_Q + Z] += meta[META_Z]
    for k in range(FREE):
        out[R_RATE + k] = m.y[k]
    copy_numbers(state.rates, out[R_RATE + FREE : R_RATE + 9])
    weight = -s.weight[2]
    out[R_HEIGHT] = state.height[0] + meta[META_Z]
    for i in range(6):
        f, radius = m.force[i], rover[P_RADIUS + i]
        ut, us, turn = contact_motion(s, m, i)
        out[R_WHEEL + i], out[R_COMMAND + i] = f[RIM] / radius, state.rim[i] / radius
        out[R_LOAD + i], out[R_TRACTION + i], out[R_SIDE + i] = weight * m.load[i], weight * f[FORCE], weight * f[FORCE + 1]
        out[R_TORQUE + i], out[R_SINKAGE + i] = weight * f[TORQUE], f[SINKAGE]
        out[R_ROLL_SLIP + i], out[R_SIDE_SLIP + i], out[R_TURN + i] = ut - f[RIM], us, turn
    out[R_STEPS], out[R_SCALE] = steps, m.scale[0]


@owning_njit
def predict_batch(
    ground: Ground, rover: Array, start_at: Array, commands: Array, command_of: NDArray[np.int64], counts: NDArray[np.int64],
    span: float, references: Array, friction: Array, tables: Array, table_of: NDArray[np.int64], gravity: float, torque: Array,
    tolerance: float, every: int, out: Array, ends: NDArray[np.int64], places: Array,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Predict drives by a Runge-Kutta method of order 3, commands constant over a step.

    Args:
        ground, rover: the packed terrain and rover.
        start_at: (n, 3) x, y, yaw at the start, m and rad.
        commands: (c, steps, C_SIZE).
        command_of: (n,) row of `commands` of each drive.
        counts: (c,) number of steps of each row.
        span: duration of a step, s.
        references: (c,) fastest commanded rim speed, m/s.
        friction: (n,) coefficients; on soil, of the start of a solve.
        tables: (m, size) tables of wheels on soil.
        table_of: (n, 6) table of each wheel; -1 on rigid terrain.
        gravity: m/s².
        torque: (6,) torque limits, N m; inf without a limit.
        tolerance: a step is halved while the error of its energy balance exceeds this share of the work that lifts the rover's
            weight by the step's length, and the drive ends if they add up; inf: only a step without pose or motion is halved.
        every: steps between records.
        out: (n, records, R_SIZE) filled; NaN after the end of a drive.
        ends: (n, 2) filled with the code of the end and the number of steps done.
        places: (n, 3) filled with x, y, yaw at which the drive ended: those of the pose without a solution, if there is one.
        start, stop: range of drives.
    """
    buffer, numbers, more = np.empty(WORK_SIZE), np.zeros(STATION_SIZE + MOTION_SIZE + STATE_SIZE), np.zeros(15, np.int64)
    work, land, car, meta = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2])
    s, m = new_station(numbers, more), new_motion(numbers[STATION_SIZE:], more[6:])
    state = new_state(numbers[STATION_SIZE + MOTION_SIZE :])
    all_commands, laws, limits = unowned_view(commands), unowned_view(tables), unowned_view(torque)
    for n in range(start, stop):
        c = command_of[n]
        drive = Drive(friction[n], table_of[n, 0] >= 0, laws, unowned_view(table_of)[n], gravity, limits, references[c])
        state.place[0], state.place[1], state.place[2] = (
            start_at[n, 0] - meta[META_X],
            start_at[n, 1] - meta[META_Y],
            start_at[n, 2],
        )
        reset_motion(m)
        state.q[:] = math.nan
        set_on_ground(state)
        done = lost = 0.0
        out[n] = math.nan
        ends[n, 0], ends[n, 1] = REACHED_END, counts[c]
        code, steps = CONVERGED, 0
        for k in range(counts[c] + 1):
            command = all_commands[c, min(k, counts[c] - 1)]
            fresh = steered = k == 0
            if k > 0 and k < counts[c]:
                for j in range(C_SIZE):
                    fresh |= command[j] != all_commands[c, k - 1, j]
                    steered |= j >= C_STEERING and command[j] != all_commands[c, k - 1, j]
            if fresh:
                set_hub_offsets(car, command[C_STEERING:], work.hub_offsets)
                code, steps = evaluate(land, car, steered, steered, command, drive, work, s, m, state)
                if code == NO_BALANCE and any_free(state.free):
                    code, steps, fall = let_down(land, car, command, drive, work, s, m, state)
                    lost -= s.weight[2] * fall
            if code == CONVERGED and (k % every == 0 or k == counts[c]):
                at = (k + every - 1) // every
                record(car, steps, s, m, state, meta, out[n, at])
                out[n, at, R_WORK], out[n, at, R_LOSS] = done, lost
            if code == CONVERGED and k < counts[c]:
                depth, part, owed, worst = 0, 0, 0.0, max(tolerance * span * references[c], LEAST_ERROR) * -s.weight[2]
                while part < 1 << DEEPEST:
                    share = span / (1 << depth)
                    keep(state, work, m)
                    code, steps, drop = take_step(land, car, share, command, drive, work, s, m, state)
                    if (code == NO_BALANCE or code == NOT_CONVERGED) and any_free(state.kept_free):
                        restore(state, work, m)
                        code, steps, fall = let_down(land, car, command, drive, work, s, m, state)
                        lost -= s.weight[2] * fall
                        if code != CONVERGED:
                            break
                        continue
                    gain = -s.weight[2] * (state.height[0] + drop - state.kept_height[0])
                    error = share / 9.0 * (state.total[3] - state.total[4]) - gain
                    if worst < math.inf:
                        halve = depth < DEEPEST and (code != CONVERGED or not abs(error) <= worst)
                    else:  # a stage may lack a pose or a motion only because the step is long
                        halve = depth < RETRIES and (code == NO_BALANCE or code == NOT_CONVERGED)
                    if halve:
                        restore(state, work, m)
                        depth += 1
                        continue
                    owed += error
                    code = INACCURATE if code == CONVERGED and abs(owed) > MOST_PARTS * worst else code
                    if code != CONVERGED:
                        break
                    done += share / 9.0 * state.total[3]
                    lost += share / 9.0 * state.total[4] - s.weight[2] * drop
                    part += 1 << (DEEPEST - depth)
                    while depth > 0 and part % (1 << (DEEPEST - depth + 1)) == 0:
                        depth -= 1
            if code != CONVERGED:
                ends[n, 0], ends[n, 1] = code, k
                break
        places[n, 0], places[n, 1] = state.place[0] + meta[META_X], state.place[1] + meta[META_Y]
        places[n, 2] = state.place[2]
    buffer[0] = numbers[0] = 0.0  # keep the buffers alive: the work arrays are unowned views of them
    more[0] = 0
