"""Least friction coefficients of a batch of poses, LANES at once.

Each lane goes through one pose after another: to the central point of a friction coefficient that is large enough, and from there
along the central path to the least one. A path that is lost starts again at another coefficient.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.vectors import LANES
from .balance import EQUATIONS as BALANCE_EQUATIONS
from .lane_problem import (
    ANY,
    CAPACITY,
    CENTRE,
    CENTRE_STEPS,
    Block,
    block_view,
    is_central,
    new_block,
    power,
    set_force,
    start,
    take_pose,
    vector,
)
from .lane_proof import is_proved, proved, shifted_motion, wide_bound
from .lane_rows import BALANCE, CONTACTS, EQUATIONS, LINK, PROBLEM, RESULT, STATE, VECTORS, WHEEL, WHEELS
from .primal_dual import balance_step, friction_step

Array = NDArray[np.float64]

GAP = 1e-8  # power of all forces at the end, by default: the error of μ is about this
STEPS = 60  # for one pose
LOST = 1e-3  # share of a step below which the path is lost
WIDEST = 64.0  # largest friction coefficient tried
STEEP, ABOVE = 1.3, 0.05  # first friction coefficient: STEEP times the contacts' mean slope, and ABOVE
LEAST_COSINE = 0.05  # of a contact's slope in it
LAST = 1e-3  # of that power: the search ends without a proof
ROUNDING = 1e-9  # taken from a proved coefficient, for the rounding of velocities and power
UNSOLVED = 255


@owning_njit
def friction_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array,
    stops: NDArray[np.int8], belly_point: Array, field: Array, drawbar: Array, gap: float,
    force: Array, torque: Array, required: Array, bound: Array, limit: Array, belly: Array, status: NDArray[np.uint8],
    solved: int, first: int, last: int,
) -> None:  # fmt: skip
    """Fill the contact forces of least friction of each pose that the lanes solve.

    A contact line counts at its middle. A pose is left if forces elsewhere on its lines might need less friction.

    Args:
        rover, yaw, steering, q, point, normal, span, stops, belly_point, field, drawbar, gap: as for `loads.loads_batch`.
        force, torque, required, bound, limit, belly: filled as by `loads.loads_batch` where solved.
        status: (n,) filled with `solved`, or UNSOLVED.
        solved: status of a pose that is solved.
        first, last: range of poses.
    """
    block = new_block(rover, first, WHEELS)
    t = block_view(block)
    lanes = t.lanes
    low, high, began, known = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    status[first:last] = UNSOLVED
    busy = 0
    while True:
        for l in range(LANES):
            if t.pose[l] < 0:
                k = take_pose(t, l, rover, yaw, steering, q, point, normal, span, stops, belly_point, ANY, first, last)
                if k >= 0:
                    low[l], high[l], began[l] = 0.0, WIDEST, set_balance(t, l, field, drawbar)
                    start(t, l, began[l], 0.0)
                    known[l] = 0.0
                    busy += 1
        if busy == 0:
            break
        friction_step(lanes)
        for l in range(LANES):
            if t.pose[l] < 0:
                continue
            t.steps[l] += 1
            done, lost = t.steps[l] >= STEPS, False
            if not t.on_path[l]:
                if is_central(t, l):
                    _free(t, l)
                elif t.steps[l] - t.first[l] >= CENTRE_STEPS:
                    low[l], lost = began[l], True
            elif lanes[RESULT.gap * LANES + l] < gap:
                done = _finish(t, l, field, gap, force, torque, required, bound, limit, belly, status, solved, known)
                done |= lanes[RESULT.gap * LANES + l] < LAST * gap
            elif not lanes[RESULT.bowed * LANES + l] > 0.0 or not lanes[RESULT.alpha * LANES + l] > LOST:
                high[l], lost = began[l], True
            if lost and not done:
                began[l] = 2.0 * low[l] if high[l] == WIDEST else low[l] + 0.6 * (high[l] - low[l])
                done = began[l] >= WIDEST
                start(t, l, began[l], 0.0)
            if done:
                t.pose[l] = -1
                busy -= 1
    block.lanes[0] = 0.0  # keep the owner alive: `t` holds unowned views of it


@njit
def set_balance(t: Block, l: int, field: Array, drawbar: Array) -> float:
    """Set the forces to balance in a lane.

    Args:
        t: work arrays.
        l: lane.
        field, drawbar: as for `friction_batch`.

    Returns:
        Friction coefficient to start from.
    """
    lanes, k = t.lanes, t.pose[l]
    row = k if field.shape[0] > 1 else 0
    gx, gy, gz = field[row, 0], field[row, 1], field[row, 2]
    g = math.sqrt(gx * gx + gy * gy + gz * gz)
    gx, gy, gz = gx / g, gy / g, gz / g
    set_force(t, l, PROBLEM.b, -gx, -gy, -gz, 0.0)
    pull = drawbar[k if drawbar.shape[0] > 1 else 0] / (t.mass * g)
    for n in range(3):
        lanes[(PROBLEM.b + BALANCE[n]) * LANES + l] += pull * lanes[(LINK.forward + n) * LANES + l]
    lanes[(PROBLEM.limit + 3) * LANES + l] = 0.0
    slope = 0.0
    for i in range(t.queue[CAPACITY]):
        if lanes[(WHEEL.on + i) * LANES + l] > 0.0:
            nx, ny, nz = vector(lanes, WHEEL.normal, i, l)
            cosine = -(gx * nx + gy * ny + gz * nz)
            slope += math.sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, LEAST_COSINE)
    return STEEP * slope / t.contacts[l] + ABOVE


@njit
def _free(t: Block, l: int) -> None:
    """Start the path from a central point, with the motion's size that fits the multiplier of μ.

    Args:
        t: work arrays.
        l: lane.
    """
    lanes = t.lanes
    mu, slid = lanes[STATE.mu * LANES + l], 0.0
    for i in range(WHEELS):
        if lanes[(WHEEL.on + i) * LANES + l] > 0.0:
            total, along = power(lanes, i, l)
            slid += (total - along) / mu
    size = 1.0 / max(CENTRE / mu - slid, 1e-3)
    for r in range(VECTORS):
        if lanes[(WHEEL.on + r % CONTACTS) * LANES + l] > 0.0:
            lanes[(STATE.speed + r) * LANES + l] *= size
    for r in range(EQUATIONS):
        lanes[(STATE.v + r) * LANES + l] *= size
    for j in range(3):
        lanes[(STATE.w + j) * LANES + l] *= size
    lanes[STATE.price * LANES + l] = CENTRE * size / mu
    lanes[PROBLEM.free * LANES + l], t.on_path[l] = 1.0, True


@owning_njit
def _finish(
    t: Block, l: int, field: Array, gap: float,
    force: Array, torque: Array, required: Array, bound: Array, limit: Array, belly: Array, status: NDArray[np.uint8],
    solved: int, low: Array,
) -> bool:  # fmt: skip
    """Write the results of a lane's pose if its friction coefficient is proved minimal.

    Args:
        t: work arrays; if a first proof holds, the balanced forces of all lanes are written.
        l: lane.
        field, gap: as for `friction_batch`.
        force, torque, required, bound, limit, belly: as for `friction_batch`; the pose's items are written if it is proved.
        status: as for `friction_batch`; the pose's item is replaced by `solved` if it is proved.
        solved: status of a proved pose.
        low: (LANES,) friction coefficients proved too small; the lane's is replaced by a larger one. The last step counts it.

    Returns:
        True if it is proved.
    """
    lanes, v = t.lanes, np.empty(BALANCE_EQUATIONS)
    shifted_motion(t, l, v)
    below = proved(t, l, v)
    if not is_proved(lanes[STATE.mu * LANES + l], below, gap):
        low[l] = max(low[l], wide_bound(t, l, gap))
        if not lanes[RESULT.gap * LANES + l] < LAST * gap:
            return False
        below = max(below, low[l])
        if not is_proved(lanes[STATE.mu * LANES + l], below, gap):
            return False
    balance_step(t.lanes, WHEELS)
    if not is_proved(friction_used(t, l), below, gap):  # a wheel that carries almost nothing may use more friction by rounding
        return False
    store_forces(t, l, field, below, force, torque, required, bound, limit, belly)
    status[t.pose[l]] = solved
    return True


@njit
def friction_used(t: Block, l: int) -> float:
    """Return the friction coefficient that a lane's balanced forces use.

    It is infinite if a wheel pulls.

    Args:
        t: work arrays.
        l: lane.
    """
    lanes, used = t.lanes, 0.0
    for i in range(t.queue[CAPACITY]):
        if lanes[(WHEEL.on + i) * LANES + l] > 0.0:
            fx, fy, fz = vector(lanes, RESULT.force, i, l)
            nx, ny, nz = vector(lanes, WHEEL.normal, i, l)
            n = fx * nx + fy * ny + fz * nz
            used = max(used, math.sqrt(max(fx * fx + fy * fy + fz * fz - n * n, 0.0)) / n if n > 0.0 else math.inf)
    return used


@njit
def store_forces(
    t: Block, l: int, field: Array, below: float, force: Array, torque: Array, required: Array, bound: Array, limit: Array,
    belly: Array,
) -> None:  # fmt: skip
    """Fill the results of a lane from its balanced forces.

    Args:
        t: work arrays.
        l: lane.
        below: coefficient proved too small.
        field: as for `friction_batch`.
        force, torque, required, bound, limit, belly: as for `friction_batch`; the pose's items are written.
    """
    lanes, k = t.lanes, t.pose[l]
    row = k if field.shape[0] > 1 else 0
    weight = t.mass * math.sqrt(field[row, 0] ** 2 + field[row, 1] ** 2 + field[row, 2] ** 2)
    moment = weight * lanes[LINK.reach * LANES + l]
    used = 0.0
    force[k] = torque[k] = limit[k] = belly[k] = 0.0
    for i in range(t.queue[CAPACITY]):
        if lanes[(WHEEL.on + i) * LANES + l] == 0.0:
            continue
        wheel = i % WHEELS
        fx, fy, fz = vector(lanes, RESULT.force, i, l)
        nx, ny, nz = vector(lanes, WHEEL.normal, i, l)
        tx, ty, tz = vector(lanes, WHEEL.heading, i, l)
        ax, ay, az = vector(lanes, WHEEL.turn, i, l)
        n, along = nx * fx + ny * fy + nz * fz, tx * fx + ty * fy + tz * fz
        side = (ny * tz - nz * ty) * fx + (nz * tx - nx * tz) * fy + (nx * ty - ny * tx) * fz
        used = max(used, math.sqrt(along * along + side * side) / n)
        for c, part in enumerate((n, along, side)):
            force[k, wheel, c] += part * weight
        torque[k, wheel] += (ax * fx + ay * fy + az * fz) * moment
    for j in range(3):
        if lanes[(PROBLEM.limit + j) * LANES + l] > 0.0:
            push = lanes[(RESULT.y + j) * LANES + l] * lanes[(PROBLEM.sign + j) * LANES + l]
            limit[k, j] = push * moment
    required[k], bound[k] = used, max(min(below, used) - ROUNDING, 0.0)
