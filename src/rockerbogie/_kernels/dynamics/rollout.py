"""Predicted drives: the motion integrated over time, one rover at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.ground import META_CUBIC, META_X, META_Y, Ground, borrow
from ..model.linkage import set_hub_offsets
from ..search.workspace import WORK_SIZE, Work, lay_out
from ..solve.newton import CONVERGED, NOT_CONVERGED
from .balance_residual import MOTION_SIZE, Motion, new_motion, reset_motion
from .drive_state import STATE_SIZE, Drive, State, any_free, keep, new_state, restore, set_on_ground, set_raised
from .evaluate import C_SIZE, C_STEERING, INACCURATE, NO_BALANCE, REACHED_END, evaluate
from .further_state import FURTHER_INTEGERS, FURTHER_SIZE, Further, new_further
from .record import R_LOSS, R_WORK, record
from .station import STATION_SIZE, Station, new_station

Array = NDArray[np.float64]

DEEPEST = 20  # halvings of a step: where a contact jumps, each halves the error only
LEAST_ERROR = 1e-9  # m by which the weight is lifted: smaller errors of a step's energy are those of the poses
MOST_PARTS = 32.0  # sum of the errors of a step's parts over the error allowed for each
COARSE = 0.01  # tolerance of a drive on soil, where none is given
RETRIES = 4  # halvings of a step without a solution, where no tolerance is given


@njit
def runge_kutta(
    ground: Ground, rover: Array, span: float, command: Array, drive: Drive, work: Work, s: Station, m: Motion, further: Further,
    state: State,
) -> int:  # fmt: skip
    """Advance one step from the station in `state.kept`, without evaluating its end.

    The method is that of Bogacki and Shampine (1989), of order 3, with stages at 0, 1/2 and 3/4 of the step. The motion jumps
    where a contact does, and of such a function these three give a closer mean than 0, 1/2 and 1 of the classical method.

    Args:
        ground, rover, command, drive, work, s, m, further: as for `evaluate`.
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
        code, _ = evaluate(ground, rover, True, cubic and stage == 0, span, command, drive, work, s, m, further, state)
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
    ground: Ground, rover: Array, span: float, command: Array, drive: Drive, work: Work, s: Station, m: Motion, further: Further,
    state: State,
) -> tuple[int, int, float]:  # fmt: skip
    """Land all wheels and evaluate the station again.

    A wheel off the ground for which no motion balances falls, and faster than the rover moves.

    Args:
        ground, rover, command, drive, work, s, m, further: as for `evaluate`.
        state: at the station; replaced.

    Returns:
        Code and number of Newton steps, as `evaluate`; m by which the centre of mass falls.
    """
    before = state.height[0]
    set_on_ground(state)
    code, steps = evaluate(ground, rover, True, True, span, command, drive, work, s, m, further, state)
    return code, steps, before - state.height[0]


@njit
def take_step(
    ground: Ground, rover: Array, span: float, command: Array, drive: Drive, work: Work, s: Station, m: Motion, further: Further,
    state: State,
) -> tuple[int, int, float]:  # fmt: skip
    """Advance one step from the station in `state.kept`, and evaluate its end.

    Args:
        ground, rover, span, command, drive, work, s, m, further, state: as for `runge_kutta`.

    Returns:
        CONVERGED, or the code of the stage without a solution; number of Newton steps at the end; m by which the centre of mass
        falls there when wheels land (`let_down`).
    """
    code = runge_kutta(ground, rover, span, command, drive, work, s, m, further, state)
    if code != CONVERGED:
        return code, 0, 0.0
    code, steps = evaluate(ground, rover, True, True, span, command, drive, work, s, m, further, state)
    if code == NO_BALANCE and any_free(state.free):
        return let_down(ground, rover, span, command, drive, work, s, m, further, state)
    return code, steps, 0.0


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
            weight by the step's length, and the drive ends if they add up; inf: a step without pose or
            motion is halved, at most `RETRIES` times, and on soil a step with an error above `COARSE` too.
        every: steps between records.
        out: (n, records, R_SIZE) filled; NaN after the end of a drive.
        ends: (n, 2) filled with the code of the end and the number of steps done.
        places: (n, 3) filled with x, y, yaw at which the drive ended: those of the pose without a solution, if there is one.
        start, stop: range of drives.
    """
    buffer, numbers, more = np.empty(WORK_SIZE), np.zeros(STATION_SIZE + MOTION_SIZE + STATE_SIZE), np.zeros(15, np.int64)
    extra, integers = np.zeros(FURTHER_SIZE), np.zeros(FURTHER_INTEGERS, np.int64)
    further = new_further(extra, integers)
    work, land, car, meta = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2])
    s, m = new_station(numbers, more), new_motion(numbers[STATION_SIZE:], more[6:])
    state, exact = new_state(numbers[STATION_SIZE + MOTION_SIZE :]), tolerance < math.inf
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
                code, steps = evaluate(land, car, steered, steered, span, command, drive, work, s, m, further, state)
                if code == NO_BALANCE and any_free(state.free):
                    code, steps, fall = let_down(land, car, span, command, drive, work, s, m, further, state)
                    lost -= s.weight[2] * fall
            if code == CONVERGED and (k % every == 0 or k == counts[c]):
                at = (k + every - 1) // every
                record(car, steps, s, m, state, meta, out[n, at])
                out[n, at, R_WORK], out[n, at, R_LOSS] = done, lost
            if code == CONVERGED and k < counts[c]:
                allowed = tolerance if exact else (COARSE if drive.soil else math.inf)
                depth, part, owed, worst = 0, 0, 0.0, max(allowed * span * references[c], LEAST_ERROR) * -s.weight[2]
                while part < 1 << DEEPEST:
                    share = span / (1 << depth)
                    keep(state, work, m)
                    code, steps, drop = take_step(land, car, share, command, drive, work, s, m, further, state)
                    if (code == NO_BALANCE or code == NOT_CONVERGED) and any_free(state.kept_free):
                        restore(state, work, m)
                        code, steps, fall = let_down(land, car, share, command, drive, work, s, m, further, state)
                        lost -= s.weight[2] * fall
                        if code != CONVERGED:
                            break
                        continue
                    gain = -s.weight[2] * (state.height[0] + drop - state.kept_height[0])
                    error = share / 9.0 * (state.total[3] - state.total[4]) - gain
                    if exact:
                        halve = depth < DEEPEST and (code != CONVERGED or not abs(error) <= worst)
                    else:  # a stage may lack a pose or a motion only because the step is long
                        lacks = code == NO_BALANCE or code == NOT_CONVERGED
                        halve = depth < RETRIES and (lacks or (code == CONVERGED and not abs(error) <= worst))
                    if halve:
                        restore(state, work, m)
                        depth += 1
                        if state.several[0] != 0.0:  # their closing rates depend on the step's length
                            evaluate(land, car, True, True, 0.5 * share, command, drive, work, s, m, further, state)
                        continue
                    owed += error
                    code = INACCURATE if exact and code == CONVERGED and abs(owed) > MOST_PARTS * worst else code
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
    more[0] = integers[0] = 0
    extra[0] = 0.0
