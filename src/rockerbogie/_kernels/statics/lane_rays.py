"""Rays of the search for tip margins, their bounds and what they find (`lane_tipping`)."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..jit.raw_views import unowned_view
from ..jit.vectors import LANES, on_lanes, root, where
from .cone_scaling import Vector
from .lane_problem import CAPACITY, Block, vector
from .lane_rows import (
    BOGIE_LEFT,
    BOGIE_RIGHT,
    BOUND,
    CENTRAL_STATE,
    CONTACTS,
    EQUATIONS,
    KEPT_STATE,
    LINK,
    OX,
    OY,
    OZ,
    PROBLEM,
    RAY,
    RESULT,
    ROCKER_RATE,
    STATE,
    VX,
    VY,
    VZ,
    WHEEL,
    WHEELS,
    StateRows,
)
from .polygon import ROOM, clear_about, extend, less, nearest_edge
from .primal_dual import gravity_force
from .tipping import STAYS, STEEPEST, WEDGED

Array = NDArray[np.float64]

FIRST = 4  # rays along the body's axes
MOST = 64  # rays
POINT = 0.4  # of the tolerance: largest difference of a ray's bounds at its end, as a tangent
COARSE = 0.22  # of the tangent: that difference at the end of the first rays
GOOD = 0.3  # of the tangent: from this difference on, half-planes are taken
BALANCED = 1e-7  # of the weight: residual of a point's forces
FAR = 6.0  # tangent at which a ray ends while no bound is known
SAME = 2e-5  # 1 - cos of two azimuths that count as one
ALONG = 0.7  # smallest cos of the angle between a first ray and the half-plane's normal at which that ray goes on
SMALL = 1e-9  # tangent
X, Y = range(2)
NOT, CENTRAL, KEPT = 0.0, 1.0, 2.0  # values of RAY.store and RAY.load


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


def _state_rows(contacts: int) -> list[int]:
    """Return the numbers of the rows of a state, counted from its first one.

    Args:
        contacts: number of contacts, WHEELS or CONTACTS.
    """
    rows, start = [], 0
    for size in StateRows._field_defaults.values():
        rows += [start + r for r in range(size) if size != 3 * CONTACTS or r % CONTACTS < contacts]
        start += size
    return rows


def _store(rows: Any, contacts: int) -> None:
    """Store the states of the lanes that RAY.store selects.

    Args:
        rows: rows of the lane array; CENTRAL_STATE and KEPT_STATE are changed.
        contacts: number of contacts, WHEELS or CONTACTS.
    """
    flag = rows[RAY.store]
    central, kept = (flag > NOT) & (flag < KEPT), flag > CENTRAL
    for r in _state_rows(contacts):
        state = rows[STATE.force + r]
        rows[CENTRAL_STATE.force + r] = where(central, state, rows[CENTRAL_STATE.force + r])
        rows[KEPT_STATE.force + r] = where(kept, state, rows[KEPT_STATE.force + r])
    rows[RAY.store] = flag * NOT


def _load(rows: Any, contacts: int) -> None:
    """Start rays in the lanes that RAY.load selects, from stored states.

    Args:
        rows: rows of the lane array; STATE, PROBLEM.e and PROBLEM.free are changed.
        contacts: number of contacts, WHEELS or CONTACTS.
    """
    any_state, kept = rows[RAY.load] > NOT, rows[RAY.load] > CENTRAL
    for r in _state_rows(contacts):
        stored = where(kept, rows[KEPT_STATE.force + r], rows[CENTRAL_STATE.force + r])
        rows[STATE.force + r] = where(any_state, stored, rows[STATE.force + r])
    for k, e in enumerate(gravity_force(rows, rows[RAY.x], rows[RAY.y])):
        rows[PROBLEM.e + k] = where(any_state, e, rows[PROBLEM.e + k])
    rows[PROBLEM.free] = where(any_state, 1.0, rows[PROBLEM.free])
    rows[RAY.load] = rows[RAY.load] * NOT


bounds = on_lanes(_bounds)
_store_six, _store_twelve = on_lanes(partial(_store, contacts=WHEELS)), on_lanes(partial(_store, contacts=CONTACTS))
_load_six, _load_twelve = on_lanes(partial(_load, contacts=WHEELS)), on_lanes(partial(_load, contacts=CONTACTS))


@njit
def store_states(lanes: Array, contacts: int) -> None:
    """Store the states of the lanes that RAY.store selects.

    Args:
        lanes: the lane array, changed.
        contacts: number of contacts, WHEELS or CONTACTS.
    """
    if contacts == WHEELS:
        _store_six(lanes)
    else:
        _store_twelve(lanes)


@njit
def load_states(lanes: Array, contacts: int) -> None:
    """Start rays in the lanes that RAY.load selects, from stored states.

    Args:
        lanes: the lane array, changed.
        contacts: number of contacts, WHEELS or CONTACTS.
    """
    if contacts == WHEELS:
        _load_six(lanes)
    else:
        _load_twelve(lanes)


class Rays(NamedTuple):
    """Rays of each lane, and what they have found."""

    ray: Array  # (LANES, 2) unit vector
    aimed: NDArray[np.bool_]  # (LANES,) the ray goes to the normal of the nearest half-plane
    shots: NDArray[np.int64]  # (LANES,) number of rays
    corner: Array  # (LANES, ROOM, 3) corners of the hull, counter-clockwise, and SURE
    corners: NDArray[np.int64]  # (LANES,) their number
    best: Array  # (LANES,) distance of the nearest half-plane
    way: Array  # (LANES, 2) its normal
    met: NDArray[np.bool_]  # (LANES,) a ray has ended on it
    told: NDArray[np.bool_]  # (LANES,) direction and wheels are those of a ray's end
    far: Array  # (LANES,) tangent at which a ray ends while no half-plane is known
    kept: Array  # (LANES, 2) the first ray whose end is stored in KEPT_STATE
    kept_best: Array  # (LANES,) `best` at its end; inf: none is stored


@owning_njit
def new_rays() -> Rays:
    """Return rays of idle lanes."""
    return Rays(
        np.zeros((LANES, 2)), np.zeros(LANES, np.bool_), np.zeros(LANES, np.int64), np.zeros((LANES, ROOM, 3)),
        np.zeros(LANES, np.int64), np.zeros(LANES), np.zeros((LANES, 2)), np.zeros(LANES, np.bool_),
        np.zeros(LANES, np.bool_), np.zeros(LANES), np.zeros((LANES, 2)), np.zeros(LANES),
    )  # fmt: skip


@inlined
def start_rays(lanes: Array, s: Rays, l: int) -> None:
    """Start the search of a lane.

    Args:
        lanes: the lane array; RAY.far is changed.
        s: rays, changed.
        l: lane.
    """
    s.shots[l], s.best[l], s.far[l], s.kept_best[l] = 0, math.inf, FAR, math.inf
    s.met[l], s.told[l], s.aimed[l] = True, False, False
    start_hull(s, l)
    lanes[RAY.far * LANES + l] = FAR


@inlined
def keep_ray(lanes: Array, s: Rays, l: int) -> bool:
    """Mark the end of a first ray to be stored if it has found the nearest half-plane.

    Args:
        lanes: the lane array; RAY.store is changed.
        s: rays, changed.
        l: lane.

    Returns:
        True if the state is to be stored.
    """
    if s.shots[l] > FIRST or not s.best[l] < s.kept_best[l]:
        return False
    s.kept_best[l], s.kept[l, X], s.kept[l, Y] = s.best[l], s.ray[l, X], s.ray[l, Y]
    lanes[RAY.store * LANES + l] = KEPT
    return True


@inlined
def shoot_ray(lanes: Array, s: Rays, l: int) -> None:
    """Choose the start of a lane's next ray.

    The first ray to the nearest half-plane's normal goes on along the one that has found it, if the angle between them is small.

    Args:
        lanes: the lane array; RAY is changed.
        s: rays, changed.
        l: lane.
    """
    nx, ny, lanes[RAY.load * LANES + l] = s.ray[l, X], s.ray[l, Y], CENTRAL
    if s.aimed[l] and s.shots[l] == FIRST and s.kept[l, X] * nx + s.kept[l, Y] * ny > ALONG:
        s.ray[l, X], s.ray[l, Y], lanes[RAY.load * LANES + l] = s.kept[l, X], s.kept[l, Y], KEPT
    lanes[RAY.x * LANES + l], lanes[RAY.y * LANES + l] = s.ray[l, X], s.ray[l, Y]
    lanes[RAY.px * LANES + l], lanes[RAY.py * LANES + l], lanes[RAY.size * LANES + l] = nx, ny, 1.0
    lanes[RAY.far * LANES + l] = min(4.0 * s.best[l], s.far[l])


@inlined
def rays_view(s: Rays) -> Rays:
    """Return unowned views of rays: passing them on counts no references.

    Args:
        s: rays, which must outlive the views.
    """
    return Rays(
        unowned_view(s.ray), unowned_view(s.aimed), unowned_view(s.shots), unowned_view(s.corner), unowned_view(s.corners),
        unowned_view(s.best), unowned_view(s.way), unowned_view(s.met), unowned_view(s.told), unowned_view(s.far),
        unowned_view(s.kept), unowned_view(s.kept_best),
    )  # fmt: skip


@inlined
def ray_ends(
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
        if distance < best + tolerance * (1.0 + best * best) if tight else distance < best and not s.told[l]:
            s.told[l] |= tight
            direction[p] = math.atan2(py, px)
            slides[p] = _stays(lanes, t.queue[CAPACITY], l, px, py, lanes[RAY.pz * LANES + l], stays[p])
        if tight and distance < s.best[l] * (1.0 + 1e-9):
            s.met[l] = True
    if tight and s.ray[l, X] * s.way[l, X] + s.ray[l, Y] * s.way[l, Y] > 1.0 - SAME:
        s.met[l] = True
    ends = tight or tangent > lanes[RAY.far * LANES + l]
    x, y = s.ray[l, X] * tangent, s.ray[l, Y] * tangent
    if s.shots[l] < FIRST:
        ends |= gap < COARSE * tangent
    if ends or (s.shots[l] >= FIRST and not s.aimed[l]):
        _add_points(lanes, s, l, x, y, tight)
    if s.shots[l] >= FIRST and not s.aimed[l] and not ends:
        ends = clear_about(s.corner, l, s.corners[l], x, y, less(s.best[l], tolerance))
    if ends:
        s.shots[l] += 1
    return ends


@inlined
def start_hull(s: Rays, l: int) -> None:
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
    start, sx, sy = lanes[RAY.start * LANES + l], lanes[RAY.sx * LANES + l], lanes[RAY.sy * LANES + l]
    px, py = s.ray[l, X] * start, s.ray[l, Y] * start
    left, right = lanes[RAY.left * LANES + l], lanes[RAY.right * LANES + l]
    if left > 0.0:
        s.corners[l] = extend(s.corner, l, s.corners[l], px - sy * left, py + sx * left, False)
    if right > 0.0:
        s.corners[l] = extend(s.corner, l, s.corners[l], px + sy * right, py - sx * right, False)
    s.corners[l] = extend(s.corner, l, s.corners[l], x, y, tight)


@inlined
def next_ray(s: Rays, l: int, tolerance: float) -> tuple[bool, float]:
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
        start_hull(s, l)
        return False, 0.0
    if s.shots[l] < FIRST or (unbounded and s.shots[l] < 3 * FIRST):
        if s.shots[l] == 2 * FIRST:
            rx, ry = (rx - ry) * math.sqrt(0.5), (rx + ry) * math.sqrt(0.5)
        s.ray[l, X], s.ray[l, Y] = -ry, rx
        return False, 0.0
    inner, wx, wy, sure = nearest_edge(s.corner, l, s.corners[l])
    s.aimed[l] = not s.met[l]
    if s.aimed[l]:
        wx, wy = s.way[l, X], s.way[l, Y]
    s.ray[l, X], s.ray[l, Y] = wx, wy
    return unbounded or inner >= less(s.best[l], tolerance) or s.shots[l] >= MOST or (sure and s.met[l]), inner


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
