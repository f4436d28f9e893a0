"""Tip margins of a batch of poses, LANES at once.

The gravity directions (x, y, -1) that a pose can hold are a convex region H of the plane (x, y), and the tangent of the margin
is the radius of the largest disc about the origin in H. Each step along a ray gives a point of H, by forces, and a half-plane
that contains H, by a virtual motion. The convex hull of the points lies in H, so its distance from the origin bounds the margin
from below; the nearest half-plane bounds it from above. Rays go along the body's axes, to the nearest half-plane's normal and
across the hull's nearest edge, until both bounds agree. Each step also finds how far forces hold along the last half-plane, to
both sides: two more points (docs/stability.md).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..jit.vectors import LANES
from .lane_problem import (
    CENTRE_STEPS,
    LINES,
    POINTS,
    block_view,
    has_lines,
    is_central,
    new_block,
    set_force,
    start,
    take_pose,
)
from .lane_rays import (
    CENTRAL,
    X,
    Y,
    bounds,
    keep_ray,
    load_states,
    new_rays,
    next_ray,
    ray_ends,
    rays_view,
    shoot_ray,
    start_rays,
    store_states,
)
from .lane_rows import CONTACTS, LINK, PROBLEM, RAY, WHEELS
from .primal_dual import turn_step
from .tipping import WEDGED, force_angle, set_corners

Array = NDArray[np.float64]

RAY_STEPS = 30
MARGIN = 5e-5  # rad: largest difference of the margin's bounds, by default
UNSOLVED, SOLVED = range(2)


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


@owning_njit
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
    rays = new_rays()
    s = rays_view(rays)
    busy = 0
    while True:
        for l in range(LANES):
            if t.pose[l] < 0:
                k = take_pose(t, l, rover, yaw, steering, q, point, normal, span, stops, belly_point, kind, first, last)
                if k >= 0:
                    set_force(t, l, PROBLEM.b, 0.0, 0.0, 1.0, WEDGED)
                    set_force(t, l, PROBLEM.e, 1.0, 0.0, 0.0, 0.0)
                    start(t, l, friction, WEDGED)
                    start_rays(lanes, s, l)
                    busy += 1
                    if angle.size > 0:
                        x, y, z = _centre(lanes, l)
                        set_corners(point[k], span[k if span.shape[0] > 1 else 0], corner)
                        angle[k], energy[k] = force_angle(corner, x, y, z)
        if busy == 0:
            break
        turn_step(lanes, room)
        bounds(lanes)
        store = load = False
        for l in range(LANES):
            p = t.pose[l]
            if p < 0:
                continue
            t.steps[l] += 1
            done, shoot = t.steps[l] - t.first[l] >= RAY_STEPS, False
            if not t.on_path[l]:
                done = t.steps[l] >= CENTRE_STEPS
                if is_central(t, l):
                    t.on_path[l], done, shoot, store = True, False, True, True
                    lanes[RAY.store * LANES + l] = CENTRAL
                    s.ray[l, X], s.ray[l, Y] = math.cos(yaw[p]), math.sin(yaw[p])
            elif ray_ends(t, s, l, tolerance, direction, stays, slides):
                store |= keep_ray(lanes, s, l)
                solved, inner = next_ray(s, l, tolerance)
                done, shoot = solved, not solved
                if solved:
                    margin[p], bound[p] = math.atan(s.best[l]), math.atan(min(inner, s.best[l]))
                    if s.best[l] == math.inf:
                        direction[p] = math.nan
                    status[p] = SOLVED
            if shoot:
                t.first[l], load = t.steps[l], True
                shoot_ray(lanes, s, l)
            if done:
                t.pose[l] = -1
                busy -= 1
        if store:
            store_states(lanes, room)
        if load:
            load_states(lanes, room)
    block.lanes[0] = rays.best[0] = 0.0  # keep the owners alive: `t` and `s` hold unowned views of them


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
