"""Least friction coefficients of a batch of poses, LANES at once.

Each lane goes through one pose after another: to the central point of a friction coefficient that is large enough, and from there
along the central path to the least one. A path that is lost starts again at another coefficient.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
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
from .lane_rows import BALANCE, CONTACTS, EQUATIONS, LIMITS, LINK, PROBLEM, RESULT, STATE, VECTORS, WHEEL, WHEELS
from .primal_dual import balance_step, friction_step

Array = NDArray[np.float64]

GAP = 1e-8  # power of all forces at the end, by default: the error of μ is about this
STEPS = 60  # for one pose
LOST = 1e-3  # share of a step below which the path is lost
WIDEST = 64.0  # largest friction coefficient tried
STEEP, ABOVE = 1.3, 0.05  # first friction coefficient: STEEP times the contacts' mean slope, and ABOVE
LEAST_COSINE = 0.05  # of a contact's slope in it
PROOF = 1.5  # of the power v·b: work that the proof takes from the motion
LAST = 1e-3  # of that power: the search ends without a proof
PROVED = 100.0  # of that power: largest gap between the least friction found, or 1, and its bound
ROUNDING = 1e-9  # taken from a proved coefficient, for the rounding of velocities and power
UNSOLVED = 255


@njit
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
    low, high, began = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    status[first:last] = UNSOLVED
    busy = 0
    while True:
        for l in range(LANES):
            if t.pose[l] < 0:
                k = take_pose(t, l, rover, yaw, steering, q, point, normal, span, stops, belly_point, ANY, first, last)
                if k >= 0:
                    low[l], high[l], began[l] = 0.0, WIDEST, set_balance(t, l, field, drawbar)
                    start(t, l, began[l], 0.0)
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
                done = _finish(t, l, field, gap, force, torque, required, bound, limit, belly, status, solved)
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


@njit
def _shifted_motion(t: Block, l: int, v: Array) -> None:
    """Fill v with the motion of the last step, shifted so that gravity works in it.

    The shift costs the contacts least of what they can spare.

    Args:
        t: work arrays.
        l: lane.
        v: (9,) filled.
    """
    lanes = t.lanes
    work, size = 0.0, 0.0
    for n in range(BALANCE_EQUATIONS):
        b = lanes[(PROBLEM.b + n) * LANES + l]
        work += b * lanes[(STATE.v + n) * LANES + l]
        size += b * lanes[(RESULT.proof + n) * LANES + l]
    shift = PROOF * max(work, 0.0) / size
    for n in range(BALANCE_EQUATIONS):
        v[n] = lanes[(STATE.v + n) * LANES + l] - shift * lanes[(RESULT.proof + n) * LANES + l]


@njit
def proved(t: Block, l: int, v: Array) -> float:
    """Return the friction coefficient that a motion proves too small, or 0 (docs/forces.md).

    Args:
        t: work arrays.
        l: lane.
        v: (9,) virtual motion.
    """
    lanes, work = t.lanes, 0.0
    for n in range(BALANCE_EQUATIONS):
        work += v[n] * lanes[(PROBLEM.b + n) * LANES + l]
    good = work < 0.0
    for j in range(3):
        if lanes[(PROBLEM.limit + j) * LANES + l] > 0.0:
            good &= lanes[(PROBLEM.sign + j) * LANES + l] * v[LIMITS[j]] >= 0.0
    least, p, u = math.inf, np.empty(3), np.empty(3)
    for i in range(t.queue[CAPACITY]):
        if lanes[(WHEEL.on + i) * LANES + l] == 0.0:
            continue
        bogie, half = v[i % 2] if i % WHEELS > 1 else 0.0, t.line[l, :, i % WHEELS]
        long = t.queue[CAPACITY] == WHEELS and (half[0, 0] != 0.0 or half[0, 1] != 0.0)
        for end in range(2 if long else 1):  # both ends of a line that counts at its middle
            s, along = (2.0 * end - 1.0) if long else 0.0, 0.0
            for c in range(3):
                p[c] = lanes[(WHEEL.point + CONTACTS * c + i) * LANES + l] + s * half[0, c]
            for c in range(3):
                a, b = (c + 1) % 3, (c + 2) % 3
                u[c] = v[BALANCE[c]]
                u[c] += v[BALANCE[6]] * (lanes[(WHEEL.rocker + CONTACTS * c + i) * LANES + l] + s * half[1, c])
                u[c] += bogie * (lanes[(WHEEL.bogie + CONTACTS * c + i) * LANES + l] + s * half[2, c])
                u[c] += v[BALANCE[3 + a]] * p[b] - v[BALANCE[3 + b]] * p[a]
                along += u[c] * lanes[(WHEEL.normal + CONTACTS * c + i) * LANES + l]
            good &= along >= 0.0
            across = math.sqrt(max(u[0] ** 2 + u[1] ** 2 + u[2] ** 2 - along * along, 0.0))
            least = min(least, along / across)
    return least if good and least > 0.0 else 0.0


@njit
def _finish(
    t: Block, l: int, field: Array, gap: float,
    force: Array, torque: Array, required: Array, bound: Array, limit: Array, belly: Array, status: NDArray[np.uint8],
    solved: int,
) -> bool:  # fmt: skip
    """Write the results of a lane's pose if its friction coefficient is proved minimal.

    Args:
        t: work arrays; if a first proof holds, the balanced forces of all lanes are written.
        l: lane.
        field, gap: as for `friction_batch`.
        force, torque, required, bound, limit, belly: as for `friction_batch`; the pose's items are written if it is proved.
        status: as for `friction_batch`; the pose's item is replaced by `solved` if it is proved.
        solved: status of a proved pose.

    Returns:
        True if it is proved.
    """
    v = np.empty(BALANCE_EQUATIONS)
    _shifted_motion(t, l, v)
    below = proved(t, l, v)
    if not is_proved(t.lanes[STATE.mu * LANES + l], below, gap):
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
def is_proved(mu: float, below: float, gap: float) -> bool:
    """Return True if a friction coefficient is proved minimal.

    Args:
        mu: the coefficient.
        below: coefficient proved too small.
        gap: as for `friction_batch`.
    """
    return mu - below < PROVED * gap * max(1.0, mu)


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
