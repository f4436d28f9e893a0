"""Tip margins of a batch of poses, LANES at once.

The gravity directions (x, y, -1) that a pose can hold are a convex region H of the plane (x, y), and the tangent of the margin
is the radius of the largest disc about the origin in H. Each step along a ray gives a point of H, by forces, and a half-plane
that contains H, by a virtual motion. The convex hull of the points lies in H, so its distance from the origin bounds the margin
from below; the nearest half-plane bounds it from above. Rays go along the body's axes, to the nearest half-plane's normal and
across the hull's nearest edge, until both bounds agree. Each step also finds how far forces hold to both sides of its ray: two
more points (docs/stability.md).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..jit.raw_views import unowned_view
from ..jit.vectors import LANES, on_lanes, root, where
from .cone_scaling import Vector
from .lane_problem import (
    CAPACITY,
    CENTRE_STEPS,
    LINES,
    POINTS,
    Block,
    block_view,
    has_lines,
    is_central,
    new_block,
    set_force,
    start,
    take_pose,
    vector,
)
from .lane_rows import (
    BOGIE_LEFT,
    BOGIE_RIGHT,
    BOUND,
    CONTACTS,
    EQUATIONS,
    LINK,
    OX,
    OY,
    OZ,
    PROBLEM,
    RAY,
    RESULT,
    ROCKER_RATE,
    STATE,
    STATE_END,
    VX,
    VY,
    VZ,
    WHEEL,
    WHEELS,
)
from .polygon import ROOM, clear_about, extend, less, nearest_edge
from .primal_dual import turn_step
from .tipping import STAYS, STEEPEST, WEDGED, force_angle, set_corners

Array = NDArray[np.float64]

SAVED = STATE_END - STATE.force  # rows of a central point
FIRST = 4  # rays along the body's axes
MOST = 64  # rays
RAY_STEPS = 30
MARGIN = 5e-5  # rad: largest difference of the margin's bounds, by default
POINT = 0.4  # of it: largest difference of a ray's bounds at its end, as a tangent
COARSE = 0.15  # of the tangent: that difference at the end of the first rays
GOOD = 0.3  # of the tangent: from this difference on, half-planes are taken
BALANCED = 1e-7  # of the weight: residual of a point's forces
FAR = 6.0  # tangent at which a ray ends while no bound is known
SAME = 2e-5  # 1 - cos of two azimuths that count as one
SMALL = 1e-9  # tangent
UNSOLVED, SOLVED = range(2)
X, Y = range(2)


def _bounds(rows: Any) -> None:
    """Compute the bounds of each ray's end after a step.

    Args:
        rows: rows of the lane array (`lane_rows`); the results of RAY are filled.
    """
    v, centre = [rows[STATE.v + k] for k in range(EQUATIONS)], _three(rows, LINK.centre)
    motion = Vector(v[VX], v[VY], v[VZ]) + Vector(v[OX], v[OY], v[OZ]).cross(centre)
    for rate, at in ((BOGIE_LEFT, LINK.bogie_left), (BOGIE_RIGHT, LINK.bogie_right), (ROCKER_RATE, LINK.rocker)):
        motion = motion + _three(rows, at) * v[rate]
    tangent, one = rows[STATE.theta], motion.x * 0.0 + 1.0
    height, ahead = motion.z + WEDGED * v[BOUND], motion.x * rows[RAY.x] + motion.y * rows[RAY.y]
    gap = height / ahead - tangent
    balanced = rows[RESULT.short] * (1.0 - rows[RESULT.alpha]) < BALANCED
    news = balanced & (ahead > 0.0) & ((gap < GOOD * tangent) | (tangent > rows[RAY.far]))
    rows[RAY.px], rows[RAY.py], rows[RAY.pz] = motion.parts
    rows[RAY.size] = root(motion.x * motion.x + motion.y * motion.y)
    rows[RAY.height], rows[RAY.ahead], rows[RAY.gap] = height, ahead, gap
    rows[RAY.news] = where(news, one, 0.0)


def _three(rows: Any, at: int) -> Vector:
    """Return three consecutive rows as a vector.

    Args:
        rows: rows of the lane array.
        at: the first row.
    """
    return Vector(rows[at], rows[at + 1], rows[at + 2])


bounds = on_lanes(_bounds)


class Rays(NamedTuple):
    """Rays of each lane, and what they have found."""

    saved: Array  # (LANES, SAVED) central point from which rays start
    ray: Array  # (LANES, 2) unit vector
    aimed: NDArray[np.bool_]  # (LANES,) the ray goes to the normal of the nearest half-plane
    shots: NDArray[np.int64]  # (LANES,) number of rays
    corner: Array  # (LANES, ROOM, 3) corners of the hull, counter-clockwise, and SURE
    corners: NDArray[np.int64]  # (LANES,) their number
    best: Array  # (LANES,) distance of the nearest half-plane
    way: Array  # (LANES, 2) its normal
    met: NDArray[np.bool_]  # (LANES,) a ray has met it at its normal
    far: Array  # (LANES,) tangent at which a ray ends while no half-plane is known


@njit
def margin_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array,
    stops: NDArray[np.int8], belly_point: Array, friction: float, tolerance: float, margin: Array, bound: Array, direction: Array,
    stays: NDArray[np.bool_], slides: NDArray[np.bool_], angle: Array, energy: Array, status: NDArray[np.uint8],
    first: int, last: int,
) -> None:  # fmt: skip
    """Fill the tip margins of the poses that the lanes solve.

    Args:
        rover, yaw, steering, q, point, normal, span, stops, belly_point, friction, tolerance: as for `loads.stability_batch`.
        margin, bound, direction, stays, slides: filled as by `loads.stability_batch` where solved.
        angle, energy: filled as by `loads.stability_batch` where the lanes have loaded the pose; (0,): not wanted.
        status: (n,) filled with SOLVED or UNSOLVED.
        first, last: range of poses.
    """
    status[first:last] = UNSOLVED
    lines = 0
    for k in range(first, last):
        lines += has_lines(span, k)
    for kind in (POINTS, LINES):
        if lines == (last - first if kind == POINTS else 0):
            continue
        _solve(
            rover, yaw, steering, q, point, normal, span, stops, belly_point, friction, tolerance,
            margin, bound, direction, stays, slides, angle, energy, status, kind, first, last,
        )  # fmt: skip


@njit
def _solve(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array,
    stops: NDArray[np.int8], belly_point: Array, friction: float, tolerance: float, margin: Array, bound: Array, direction: Array,
    stays: NDArray[np.bool_], slides: NDArray[np.bool_], angle: Array, energy: Array, status: NDArray[np.uint8],
    kind: int, first: int, last: int,
) -> None:  # fmt: skip
    """Fill the tip margins of the poses of one kind that the lanes solve.

    Args:
        rover, yaw, steering, q, point, normal, span, stops, belly_point, friction, tolerance: as for `margin_batch`.
        margin, bound, direction, stays, slides, angle, energy, status: as for `margin_batch`; items of the range are written.
        kind: POINTS or LINES.
        first, last: range of poses.
    """
    room = WHEELS if kind == POINTS else CONTACTS
    block, corner = new_block(rover, first, room), np.empty((CONTACTS, 3))
    t = block_view(block)
    lanes = t.lanes
    rays = Rays(
        np.zeros((LANES, SAVED)), np.zeros((LANES, 2)), np.zeros(LANES, np.bool_), np.zeros(LANES, np.int64),
        np.zeros((LANES, ROOM, 3)), np.zeros(LANES, np.int64), np.zeros(LANES), np.zeros((LANES, 2)),
        np.zeros(LANES, np.bool_), np.zeros(LANES),
    )  # fmt: skip
    s = _rays_view(rays)
    busy = 0
    while True:
        for l in range(LANES):
            if t.pose[l] < 0:
                k = take_pose(t, l, rover, yaw, steering, q, point, normal, span, stops, belly_point, kind, first, last)
                if k >= 0:
                    set_force(t, l, PROBLEM.b, 0.0, 0.0, 1.0, WEDGED)
                    set_force(t, l, PROBLEM.e, 1.0, 0.0, 0.0, 0.0)
                    start(t, l, friction, WEDGED)
                    s.shots[l], s.best[l], s.far[l] = 0, math.inf, FAR
                    _start_hull(s, l)
                    s.met[l], s.aimed[l] = True, False
                    lanes[RAY.far * LANES + l] = FAR
                    busy += 1
                    if angle.size > 0:
                        x, y, z = _centre(lanes, l)
                        set_corners(point[k], span[k if span.shape[0] > 1 else 0], corner)
                        angle[k], energy[k] = force_angle(corner, x, y, z)
        if busy == 0:
            break
        turn_step(lanes, room)
        bounds(lanes)
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
                        s.saved[l, r] = lanes[(STATE.force + r) * LANES + l]
                    t.on_path[l], done, shoot = True, False, True
                    s.ray[l, X], s.ray[l, Y] = math.cos(yaw[p]), math.sin(yaw[p])
            elif _ray_ends(t, s, l, tolerance, direction, stays, slides):
                solved, inner = _next_ray(s, l, tolerance)
                done, shoot = solved, not solved
                if solved:
                    margin[p], bound[p] = math.atan(s.best[l]), math.atan(min(inner, s.best[l]))
                    if s.best[l] == math.inf:
                        direction[p] = math.nan
                    status[p] = SOLVED
            if shoot:
                t.first[l] = t.steps[l]
                for r in range(SAVED):
                    lanes[(STATE.force + r) * LANES + l] = s.saved[l, r]
                lanes[PROBLEM.free * LANES + l] = 1.0
                lanes[RAY.x * LANES + l], lanes[RAY.y * LANES + l] = s.ray[l, X], s.ray[l, Y]
                lanes[RAY.far * LANES + l] = min(4.0 * s.best[l], s.far[l])
                set_force(t, l, PROBLEM.e, s.ray[l, X], s.ray[l, Y], 0.0, 0.0)
            if done:
                t.pose[l] = -1
                busy -= 1
    block.lanes[0] = rays.best[0] = 0.0  # keep the owners alive: `t` and `s` hold unowned views of them


@inlined
def _rays_view(s: Rays) -> Rays:
    """Return unowned views of rays: passing them on counts no references.

    Args:
        s: rays, which must outlive the views.
    """
    return Rays(
        unowned_view(s.saved), unowned_view(s.ray), unowned_view(s.aimed), unowned_view(s.shots), unowned_view(s.corner),
        unowned_view(s.corners), unowned_view(s.best), unowned_view(s.way), unowned_view(s.met), unowned_view(s.far),
    )  # fmt: skip


@inlined
def _ray_ends(
    t: Block, s: Rays, l: int, tolerance: float, direction: Array, stays: NDArray[np.bool_], slides: NDArray[np.bool_]
) -> bool:
    """Take point and half-plane of a lane's last step; return True if its ray need not go on.

    Args:
        t: work arrays.
        s: rays; the hull and the nearest half-plane are changed.
        l: lane.
        tolerance: largest difference of the margin's bounds, rad.
        direction, stays, slides: as for `margin_batch`; written for the nearest half-plane.
    """
    lanes, p, best = t.lanes, t.pose[l], s.best[l]
    if lanes[RAY.news * LANES + l] == 0.0:
        return False
    tangent, gap = lanes[STATE.theta * LANES + l], lanes[RAY.gap * LANES + l]
    px, py, size = lanes[RAY.px * LANES + l], lanes[RAY.py * LANES + l], lanes[RAY.size * LANES + l]
    distance = lanes[RAY.height * LANES + l] / size
    tight = abs(gap) < POINT * tolerance * (1.0 + tangent * tangent)
    if gap < GOOD * tangent:
        if distance < best * (1.0 - 1e-9):
            s.best[l], s.way[l, X], s.way[l, Y], s.met[l] = distance, px / size, py / size, False
            lanes[RAY.far * LANES + l] = min(4.0 * distance, s.far[l])
        if tight and distance < best + tolerance * (1.0 + best * best):
            direction[p] = math.atan2(py, px)
            slides[p] = _stays(lanes, t.queue[CAPACITY], l, px, py, lanes[RAY.pz * LANES + l], stays[p])
    if tight and s.ray[l, X] * s.way[l, X] + s.ray[l, Y] * s.way[l, Y] > 1.0 - SAME:
        s.met[l] = True
    ends = tight or tangent > lanes[RAY.far * LANES + l]
    x, y = s.ray[l, X] * tangent, s.ray[l, Y] * tangent
    if s.shots[l] < FIRST:
        ends |= gap < COARSE * tangent
    if ends or (s.shots[l] >= FIRST and not s.aimed[l]):
        _add_points(lanes, s, l, x, y, tight)
    if s.shots[l] >= FIRST and not s.aimed[l] and not ends:
        ends = clear_about(s.corner[l], s.corners[l], x, y, less(s.best[l], tolerance))
    if ends:
        s.shots[l] += 1
    return ends


@inlined
def _start_hull(s: Rays, l: int) -> None:
    """Start a lane's hull with a small square: the origin is inside the region.

    Args:
        s: rays, changed.
        l: lane.
    """
    for j in range(4):
        s.corner[l, j, 0] = SMALL if j in (0, 3) else -SMALL
        s.corner[l, j, 1] = SMALL if j < 2 else -SMALL
        s.corner[l, j, 2] = 0.0
    s.corners[l] = 4


@inlined
def _add_points(lanes: Array, s: Rays, l: int, x: float, y: float, tight: bool) -> None:
    """Add the points that a step has found to a lane's hull.

    Args:
        lanes: the lane array.
        s: rays, changed.
        l: lane.
        x, y: point on the ray.
        tight: True if it is on the boundary of the region.
    """
    rx, ry, start = s.ray[l, X], s.ray[l, Y], lanes[RAY.start * LANES + l]
    left, right = lanes[RAY.left * LANES + l], lanes[RAY.right * LANES + l]
    if left > 0.0:
        s.corners[l] = extend(s.corner[l], s.corners[l], rx * start - ry * left, ry * start + rx * left, False)
    if right > 0.0:
        s.corners[l] = extend(s.corner[l], s.corners[l], rx * start + ry * right, ry * start - rx * right, False)
    s.corners[l] = extend(s.corner[l], s.corners[l], x, y, tight)


@inlined
def _next_ray(s: Rays, l: int, tolerance: float) -> tuple[bool, float]:
    """Choose the next ray of a lane.

    Args:
        s: rays, changed.
        l: lane.
        tolerance: largest difference of the margin's bounds, rad.

    Returns:
        True if no more rays are needed, and the hull's distance from the origin.
    """
    rx, ry = s.ray[l, X], s.ray[l, Y]
    unbounded = s.best[l] == math.inf
    if s.shots[l] >= FIRST and unbounded and s.far[l] == FAR:
        s.far[l], s.shots[l] = STEEPEST, 0
        _start_hull(s, l)
        return False, 0.0
    if s.shots[l] < FIRST or (unbounded and s.shots[l] < 3 * FIRST):
        if s.shots[l] == 2 * FIRST:
            rx, ry = (rx - ry) * math.sqrt(0.5), (rx + ry) * math.sqrt(0.5)
        s.ray[l, X], s.ray[l, Y] = -ry, rx
        return False, 0.0
    inner, wx, wy, sure = nearest_edge(s.corner[l], s.corners[l])
    s.aimed[l] = not s.met[l]
    if s.aimed[l]:
        wx, wy = s.way[l, X], s.way[l, Y]
    s.ray[l, X], s.ray[l, Y] = wx, wy
    return unbounded or inner >= less(s.best[l], tolerance) or s.shots[l] >= MOST or (sure and s.met[l]), inner


@inlined
def _centre(lanes: Array, l: int) -> tuple[float, float, float]:
    """Return the centre of mass from the body's origin, m.

    Args:
        lanes: the lane array.
        l: lane.
    """
    reach = lanes[LINK.reach * LANES + l]
    return (
        reach * lanes[LINK.centre * LANES + l],
        reach * lanes[(LINK.centre + 1) * LANES + l],
        reach * lanes[(LINK.centre + 2) * LANES + l],
    )


@njit
def _stays(lanes: Array, room: int, l: int, px: float, py: float, pz: float, stays: NDArray[np.bool_]) -> bool:
    """Set which wheels stay in place in a lane's virtual motion.

    Args:
        lanes: the lane array.
        room: number of contacts of a pose.
        l: lane.
        px, py, pz: velocity of the centre of mass.
        stays: (6,) filled.

    Returns:
        True if no wheel stays.
    """
    size = math.sqrt(px * px + py * py + pz * pz)
    more, none = lanes[(STATE.v + BOUND) * LANES + l], True
    stays[:] = False
    for i in range(room):
        nx, ny, nz = vector(lanes, WHEEL.normal, i, l)
        ux, uy, uz = vector(lanes, STATE.speed, i, l)
        ux, uy, uz = ux - more * nx, uy - more * ny, uz - more * nz
        stay = lanes[(WHEEL.on + i) * LANES + l] > 0.0 and math.sqrt(ux * ux + uy * uy + uz * uz) < STAYS * size
        stays[i % WHEELS] |= stay
        none &= not stay
    return none
