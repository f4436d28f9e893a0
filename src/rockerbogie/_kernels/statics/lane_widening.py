"""Least friction coefficients by bisection, for poses in which the path to them is lost.

Close to tipping over, the forces that hold have almost no interior. For a coefficient μ, the cones are widened until some forces
lie in them: the least w with |F_t| ≤ μ (F_n + w) is a problem that always has an interior, and its sign decides. With
F' = F + w n and θ = -w it is the problem of `turn_step`, e being the generalized force of unit normal forces at all wheels.
Forces that hold bound the least coefficient from above, motions in which gravity works bound it from below.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.vectors import LANES
from .balance import EQUATIONS as BALANCE_EQUATIONS
from .lane_friction import UNSOLVED, WIDEST, friction_used, set_balance, store_forces
from .lane_problem import (
    AFTER,
    ANY,
    CAPACITY,
    COUNT,
    NEXT,
    Block,
    block_view,
    has_lines,
    is_central,
    new_block,
    start,
    take_pose,
    vector,
)
from .lane_proof import is_proved, proved
from .lane_rows import (
    BOGIE_LEFT,
    BOGIE_RIGHT,
    BOUND,
    CONTACTS,
    EQUATIONS,
    OX,
    OY,
    OZ,
    PROBLEM,
    RESULT,
    ROCKER_RATE,
    STATE,
    VECTORS,
    VX,
    VY,
    VZ,
    WHEEL,
    WHEELS,
)
from .primal_dual import balance_step, turn_step
from .tipping import WEDGED

Array = NDArray[np.float64]

WIDENED = 1.0  # of the weight: w at the start
STEPS = 80
CENTRING = 30  # steps of these to the central point, at most
BALANCED = 1e-9  # of the weight: residual of forces that hold; `balance_step` removes it
DECIDED = 1e-12  # largest difference of the bounds of w at which its sign stays open
ROUNDS = 80
CLOSE = 3.0  # of `gap`: difference of the bounds of μ at which bisection ends
HOLDS, FAILS, OPEN = range(3)


@owning_njit
def widen_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array,
    stops: NDArray[np.int8], belly_point: Array, field: Array, drawbar: Array, gap: float,
    force: Array, torque: Array, required: Array, bound: Array, limit: Array, belly: Array, status: NDArray[np.uint8],
    solved: int, unheld: int, first: int, last: int,
) -> None:  # fmt: skip
    """Fill the contact forces of least friction of the poses that `friction_batch` has left.

    Args:
        rover, yaw, steering, q, point, normal, span, stops, belly_point, field, drawbar, gap: as for `loads.loads_batch`.
        force, torque, required, bound, limit, belly: filled as by `loads.loads_batch` where solved.
        status: (n,) poses with UNSOLVED are solved; filled with `solved` or `unheld`, or left.
        solved, unheld: status of a pose that is solved, and of one that no coefficient up to WIDEST holds.
        first, last: range of poses.
    """
    block, l = new_block(rover, first, WHEELS), 0
    t = block_view(block)
    best, v = np.empty(VECTORS + 4), np.empty(BALANCE_EQUATIONS)
    for k in range(first, last):
        if status[k] != UNSOLVED:
            continue
        t.queue[AFTER], t.queue[NEXT], t.queue[COUNT] = k, 0, 0
        t.queue[CAPACITY] = CONTACTS if has_lines(span, k) else WHEELS
        if take_pose(t, l, rover, yaw, steering, q, point, normal, span, stops, belly_point, ANY, k, k + 1) < 0:
            continue
        mu, guess = WIDEST, set_balance(t, l, field, drawbar)
        _set_widening(t, l)
        low = below = 0.0
        high = math.inf
        for n in range(ROUNDS):
            outcome, before = _decide(t, l, mu), high
            if outcome == HOLDS:
                high = _keep_forces(t, l, high, best)
                if not high < before:  # rounding
                    break
            elif outcome == FAILS:
                low = max(low, mu)
                for j in range(BALANCE_EQUATIONS):
                    v[j] = t.lanes[(STATE.v + j) * LANES + l]
                below = max(below, proved(t, l, v))
                low = max(low, below)
            if outcome == OPEN or low >= WIDEST or high - low < CLOSE * gap:
                break
            if n == 0 and guess < high:
                mu = guess
            else:
                mu = 0.5 * (low + high) if high < 2.0 * low + 0.1 else math.sqrt(max(low, 0.01 * high) * high)
        if low >= WIDEST:
            status[k], required[k] = unheld, math.inf
            force[k] = torque[k] = limit[k] = belly[k] = bound[k] = math.nan
        elif is_proved(high, below, gap):
            for r in range(VECTORS):
                t.lanes[(RESULT.force + r) * LANES + l] = best[r]
            for j in range(4):
                t.lanes[(RESULT.y + j) * LANES + l] = best[VECTORS + j]
            store_forces(t, l, field, below, force, torque, required, bound, limit, belly)
            status[k] = solved
        t.pose[l] = -1
    block.lanes[0] = 0.0  # keep the owner alive: `t` holds unowned views of it


@njit
def _set_widening(t: Block, l: int) -> None:
    """Set e to the generalized force of unit normal forces at all wheels.

    The sum of normal forces is bounded.

    Args:
        t: work arrays.
        l: lane.
    """
    lanes = t.lanes
    for n in range(EQUATIONS):
        lanes[(PROBLEM.e + n) * LANES + l] = 0.0
    for i in range(t.queue[CAPACITY]):
        if lanes[(WHEEL.on + i) * LANES + l] == 0.0:
            continue
        nx, ny, nz = vector(lanes, WHEEL.normal, i, l)
        px, py, pz = vector(lanes, WHEEL.point, i, l)
        rx, ry, rz = vector(lanes, WHEEL.rocker, i, l)
        bx, by, bz = vector(lanes, WHEEL.bogie, i, l)
        bogie = BOGIE_LEFT if i % 2 == 0 else BOGIE_RIGHT
        lanes[(PROBLEM.e + bogie) * LANES + l] += bx * nx + by * ny + bz * nz
        lanes[(PROBLEM.e + ROCKER_RATE) * LANES + l] += rx * nx + ry * ny + rz * nz
        lanes[(PROBLEM.e + VX) * LANES + l] += nx
        lanes[(PROBLEM.e + VY) * LANES + l] += ny
        lanes[(PROBLEM.e + VZ) * LANES + l] += nz
        lanes[(PROBLEM.e + OX) * LANES + l] += py * nz - pz * ny
        lanes[(PROBLEM.e + OY) * LANES + l] += pz * nx - px * nz
        lanes[(PROBLEM.e + OZ) * LANES + l] += px * ny - py * nx
    lanes[(PROBLEM.b + BOUND) * LANES + l] = WEDGED
    lanes[(PROBLEM.limit + 3) * LANES + l] = 1.0


@njit
def _decide(t: Block, l: int, mu: float) -> int:
    """Decide if a friction coefficient holds a lane's pose.

    Args:
        t: work arrays; forces (widened) or virtual motion of the last step decide.
        l: lane.
        mu: friction coefficient.

    Returns:
        HOLDS, FAILS, or OPEN if neither is certain.
    """
    lanes = t.lanes
    start(t, l, mu, WEDGED)
    lanes[STATE.theta * LANES + l] = -WIDENED
    for r in range(VECTORS):
        lanes[(STATE.force + r) * LANES + l] += WIDENED * lanes[(WHEEL.normal + r) * LANES + l]
    for step in range(STEPS):
        turn_step(lanes, t.queue[CAPACITY])
        if not t.on_path[l]:
            if is_central(t, l):
                t.on_path[l], lanes[PROBLEM.free * LANES + l] = True, 1.0
            elif step >= CENTRING:
                return OPEN
            continue
        found, height, ahead = lanes[STATE.theta * LANES + l], 0.0, 0.0
        for n in range(EQUATIONS):
            v = lanes[(STATE.v + n) * LANES + l]
            height += lanes[(PROBLEM.b + n) * LANES + l] * v
            ahead += lanes[(PROBLEM.e + n) * LANES + l] * v
        if height < 0.0 and ahead > 0.0:
            return FAILS
        balanced = lanes[RESULT.short * LANES + l] * (1.0 - lanes[RESULT.alpha * LANES + l]) < BALANCED
        if found >= 0.0 and balanced:
            return HOLDS
        if not abs(height / ahead - found) > DECIDED:
            return OPEN
    return OPEN


@njit
def _keep_forces(t: Block, l: int, high: float, best: Array) -> float:
    """Keep forces that hold, balanced exactly, if they use less friction than the best ones.

    Args:
        t: work arrays.
        l: lane.
        high: friction coefficient that the best forces use.
        best: (VECTORS + 4,) the best contact forces, and forces LIMITS; replaced by better ones.

    Returns:
        The friction coefficient that the best forces use now.
    """
    lanes = t.lanes
    theta = lanes[STATE.theta * LANES + l]
    for r in range(VECTORS):
        lanes[(STATE.force + r) * LANES + l] += theta * lanes[(WHEEL.normal + r) * LANES + l]
    balance_step(lanes, t.queue[CAPACITY])
    used = friction_used(t, l)
    if not used < high:
        return high
    for r in range(VECTORS):
        best[r] = lanes[(RESULT.force + r) * LANES + l]
    for j in range(4):
        best[VECTORS + j] = lanes[(RESULT.y + j) * LANES + l]
    return used
