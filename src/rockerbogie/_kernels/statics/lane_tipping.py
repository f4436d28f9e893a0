"""Tip margins of a batch of poses, LANES at once.

The gravity directions (x, y, -1) that a pose can hold are a convex region H of the plane (x, y), and the tangent of the margin
is the radius of the largest disc about the origin in H. A ray gives the boundary point in one azimuth, by forces, and the
half-plane that bounds H there, by a virtual motion. The points' polygon lies in H, so its distance from the origin bounds the
margin from below; the half-planes bound it from above. Rays go to the nearest half-plane's normal, then across the polygon's
nearest edge, until both bounds agree (docs/stability.md).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..jit.vectors import LANES
from .lane_problem import (
    CENTRE_STEPS,
    is_central,
    load_contacts,
    new_block,
    set_problem,
    set_weight,
    start,
    touches_belly,
    vector,
)
from .lane_rows import BALANCE, BOUND, EQUATIONS, PROBLEM, RESULT, STATE, STATE_END, WHEEL
from .primal_dual import turn_step
from .tipping import STAYS, STEEPEST, WEDGED

Array = NDArray[np.float64]

SAVED = STATE_END - STATE.force  # rows of a central point
FIRST = 4  # rays along the body's axes
MOST = 64  # rays
RAY_STEPS = 30
POINT = 2e-5  # tangent: largest difference of a boundary point's bounds
BALANCED = 1e-7  # of the weight: residual of its forces
FAR = 6.0  # tangent at which a ray ends while no bound is known
MARGIN = 5e-5  # rad: largest difference of the margin's bounds
SAME = 1e-12  # 1 - cos of two azimuths that count as one
UNSOLVED, SOLVED = range(2)
X, Y = range(2)


@njit
def margin_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, stops: NDArray[np.int8],
    belly_point: Array, friction: float, margin: Array, bound: Array, direction: Array, stays: NDArray[np.bool_],
    slides: NDArray[np.bool_], status: NDArray[np.uint8], first: int, last: int,
) -> None:  # fmt: skip
    """Fill the tip margins of the poses that the lanes solve.

    Args:
        rover, yaw, steering, q, point, normal, stops, belly_point, friction: as for `loads.stability_batch`.
        margin, bound, direction, stays, slides: filled as by `loads.stability_batch` where solved.
        status: (n,) filled with SOLVED or UNSOLVED.
        first, last: range of poses.
    """
    t = new_block()
    lanes = t.lanes
    travel, saved = np.zeros((LANES, 2, EQUATIONS)), np.zeros((LANES, SAVED))
    corner, corners = np.zeros((LANES, MOST, 2)), np.zeros(LANES, np.int64)
    best, far = np.zeros(LANES), np.zeros(LANES)
    best_way, ray, met = np.zeros((LANES, 2)), np.zeros((LANES, 2)), np.zeros(LANES, np.bool_)
    k, busy = first, 0
    while True:
        for l in range(LANES):
            while t.pose[l] < 0 and k < last:
                status[k] = UNSOLVED
                row, at = k if belly_point.shape[0] > 1 else 0, k if steering.shape[0] > 1 else 0
                if not touches_belly(belly_point[row]) and load_contacts(
                    t, l, rover, yaw[k], steering[at], q[k], point[k], normal[k], stops[k]
                ):
                    for c in range(2):
                        set_weight(t, l, rover, 1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 0.0)
                        for n in range(len(BALANCE)):
                            travel[l, c, BALANCE[n]] = t.column[n] / t.mass[l]
                    set_weight(t, l, rover, 0.0, 0.0, 1.0)
                    set_problem(t, l, WEDGED, 1.0 / t.mass[l])
                    for n in range(EQUATIONS):
                        lanes[(PROBLEM.e + n) * LANES + l] = travel[l, 0, n]
                    t.pose[l], t.steps[l] = k, 0
                    start(t, l, friction, WEDGED)
                    corners[l], best[l], met[l], far[l] = 0, math.inf, True, FAR
                    busy += 1
                k += 1
        if busy == 0:
            break
        turn_step(lanes)
        for l in range(LANES):
            p = t.pose[l]
            if p < 0:
                continue
            t.steps[l] += 1
            done, shoot = t.steps[l] - t.first[l] >= RAY_STEPS, False
            if not t.on_path[l]:
                done = t.steps[l] >= CENTRE_STEPS
                if is_central(t, l):
                    for r in range(SAVED):
                        saved[l, r] = lanes[(STATE.force + r) * LANES + l]
                    t.on_path[l], done, shoot = True, False, True
                    _set(ray[l], math.cos(yaw[p]), math.sin(yaw[p]))
            else:
                tangent = lanes[STATE.theta * LANES + l]
                px, py, height = _bound(lanes, l, travel[l])
                ahead = px * ray[l, X] + py * ray[l, Y]
                short = lanes[RESULT.short * LANES + l] * (1.0 - lanes[RESULT.alpha * LANES + l])
                tight = short < BALANCED and abs(height / ahead - tangent) < POINT * (1.0 + tangent * tangent)
                if tight or (short < BALANCED and tangent > (4.0 * best[l] if 4.0 * best[l] < far[l] else far[l])):
                    corners[l] = _insert(corner[l], corners[l], ray[l, X] * tangent, ray[l, Y] * tangent)
                    size = math.hypot(px, py)
                    if tight and height / size < best[l] * (1.0 - 1e-9):
                        best[l] = height / size
                        _set(best_way[l], px / size, py / size)
                        met[l] = ahead > (1.0 - 1e-7) * size
                        direction[p] = math.atan2(py, px)
                        slides[p] = _stays(lanes, l, px, py, stays[p])
                    elif ray[l, X] * best_way[l, X] + ray[l, Y] * best_way[l, Y] > 1.0 - SAME:
                        met[l] = True
                    done, shoot = False, True
                    if corners[l] < FIRST:
                        _set(ray[l], -ray[l, Y], ray[l, X])
                    elif best[l] == math.inf and far[l] == FAR:
                        far[l], corners[l] = STEEPEST, 0
                    elif best[l] == math.inf and corners[l] < 2 * FIRST:
                        if corners[l] == FIRST:
                            _set(ray[l], (ray[l, X] - ray[l, Y]) * math.sqrt(0.5), (ray[l, X] + ray[l, Y]) * math.sqrt(0.5))
                        _set(ray[l], -ray[l, Y], ray[l, X])
                    else:
                        inner, wx, wy = _nearest_edge(corner[l], corners[l])
                        agree = best[l] == math.inf or inner >= (best[l] - MARGIN) / (1.0 + best[l] * MARGIN)
                        if not met[l]:
                            wx, wy = best_way[l, X], best_way[l, Y]
                        if agree or corners[l] == MOST or (wx == 0.0 and wy == 0.0):
                            margin[p], bound[p] = math.atan(best[l]), math.atan(min(inner, best[l]))
                            if best[l] == math.inf:
                                direction[p] = math.nan
                            status[p], done, shoot = SOLVED, True, False
                        _set(ray[l], wx, wy)
            if shoot:
                t.first[l] = t.steps[l]
                for r in range(SAVED):
                    lanes[(STATE.force + r) * LANES + l] = saved[l, r]
                lanes[PROBLEM.free * LANES + l] = 1.0
                for n in range(EQUATIONS):
                    lanes[(PROBLEM.e + n) * LANES + l] = ray[l, X] * travel[l, X, n] + ray[l, Y] * travel[l, Y, n]
            if done:
                t.pose[l] = -1
                busy -= 1


@njit
def _set(way: Array, x: float, y: float) -> None:
    """Set a direction.

    Args:
        way: (2,) filled.
        x, y: components.
    """
    way[X], way[Y] = x, y


@njit
def _bound(lanes: Array, l: int, travel: Array) -> tuple[float, float, float]:
    """Return the half-plane (x, y) · (px, py) <= height that the motion of a lane gives.

    Args:
        lanes: the lane array.
        l: lane.
        travel: (2, EQUATIONS) horizontal velocity of the centre of mass for each generalized velocity.
    """
    px = py = height = 0.0
    for n in range(EQUATIONS):
        v = lanes[(STATE.v + n) * LANES + l]
        px += travel[X, n] * v
        py += travel[Y, n] * v
        height += lanes[(PROBLEM.b + n) * LANES + l] * v
    return px, py, height


@njit
def _stays(lanes: Array, l: int, px: float, py: float, stays: NDArray[np.bool_]) -> bool:
    """Set which wheels stay in place in a lane's virtual motion.

    Args:
        lanes: the lane array.
        l: lane.
        px, py: horizontal velocity of the centre of mass.
        stays: (6,) filled.

    Returns:
        True if no wheel stays.
    """
    pz = 0.0
    for n in range(EQUATIONS - 1):
        pz += lanes[(PROBLEM.b + n) * LANES + l] * lanes[(STATE.v + n) * LANES + l]
    size = math.sqrt(px * px + py * py + pz * pz)
    more, none = lanes[(STATE.v + BOUND) * LANES + l], True
    for i in range(6):
        nx, ny, nz = vector(lanes, WHEEL.normal, i, l)
        ux, uy, uz = vector(lanes, STATE.speed, i, l)
        ux, uy, uz = ux - more * nx, uy - more * ny, uz - more * nz
        stays[i] = lanes[(WHEEL.on + i) * LANES + l] > 0.0 and math.sqrt(ux * ux + uy * uy + uz * uz) < STAYS * size
        none &= not stays[i]
    return none


@njit
def _insert(corner: Array, count: int, x: float, y: float) -> int:
    """Insert a corner into a polygon about the origin, counter-clockwise.

    Args:
        corner: (MOST, 2) corners, of which `count` are used; changed.
        count: number of corners; the first FIRST must come in order.
        x, y: the new corner.

    Returns:
        The new number of corners.
    """
    at = count
    for j in range(count if count >= FIRST else 0):
        n = j + 1 if j + 1 < count else 0
        if corner[j, X] * y - corner[j, Y] * x >= 0.0 and x * corner[n, Y] - y * corner[n, X] > 0.0:
            at = j + 1
            break
    for j in range(count, at, -1):
        corner[j, X], corner[j, Y] = corner[j - 1, X], corner[j - 1, Y]
    corner[at, X], corner[at, Y] = x, y
    return count + 1


@njit
def _nearest_edge(corner: Array, count: int) -> tuple[float, float, float]:
    """Return a polygon's distance from the origin inside it, and the way to the nearest edge.

    Args:
        corner: (MOST, 2) corners, counter-clockwise.
        count: number of corners.

    Returns:
        Distance, and unit vector to the foot; the vector is 0 if a corner is nearest.
    """
    nearest, wx, wy = math.inf, 0.0, 0.0
    for j in range(count):
        n = j + 1 if j + 1 < count else 0
        ax, ay, bx, by = corner[j, X], corner[j, Y], corner[n, X], corner[n, Y]
        ex, ey = bx - ax, by - ay
        square = ex * ex + ey * ey
        if square < 1e-20:
            continue
        if ax * by - ay * bx <= 0.0:  # half a turn or more
            nearest, wx, wy = 0.0, ey / math.sqrt(square), -ex / math.sqrt(square)
            continue
        share = min(max(-(ax * ex + ay * ey) / square, 0.0), 1.0)
        x, y = ax + share * ex, ay + share * ey
        distance = math.hypot(x, y)
        if distance < nearest:
            nearest, wx, wy = distance, 0.0, 0.0
            if 0.0 < share < 1.0:
                wx, wy = x / distance, y / distance
    return nearest, wx, wy
