"""Points of an edge of the body's box that are near the terrain.

The edge is divided at grid lines. Over bilinear terrain the gap's second derivative is constant along each piece. Over cubic
terrain a piece is halved until Bézier ordinates (`cubic_patch`) decide it: no point of it is to be listed, or the gap
is convex along it within CLEARANCE_TIE. The minimum is then found by false position.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.ground import META_CUBIC, META_DX, META_DY, META_NX, META_NY, Ground, surface
from ..model.tolerances import CLEARANCE_TIE, SMALLEST_PART
from .box_points import Sought, keep_lower_point, least_clearance, limit_of_part
from .cubic_patch import XX_LOW, XY_HIGH, XY_LOW, YY_LOW, bound_differences, bound_patch

Array = NDArray[np.float64]


class Edge(NamedTuple):
    """An edge of the body's box."""

    x: float  # m: the body's origin from the map's first node, and z from the datum
    y: float
    z: float
    sx: float  # m: the edge's start from the body's origin
    sy: float
    sz: float
    ex: float  # its direction, a unit vector
    ey: float
    ez: float
    length: float  # m


@inlined
def search_edge(ground: Ground, patch: Array, edge: Edge, sought: Sought, near: Array, count: int) -> int:
    """List the points of an edge of the box that are near the terrain, cell by cell.

    Args:
        ground: terrain.
        patch: (BOUNDS_SIZE,) scratch.
        edge: the edge.
        sought: limits of the search.
        near, count: the list and its number of points.

    Returns:
        The new count; -1 less that if a part of the edge lies over missing data.
    """
    grid, upper_bound, meta = ground
    x, y, z, sx, sy, sz, ex, ey, ez, length = edge
    dx, dy = meta[META_DX], meta[META_DY]
    t = 0.0
    known = True
    while t < length:
        # the piece up to the next grid line: its middle gives the cell that it is in
        following = length
        for axis in range(2):
            e, at, step = (ex, x + sx + t * ex, dx) if axis == 0 else (ey, y + sy + t * ey, dy)
            if abs(e) > 1e-12:
                g = at / step
                line = math.floor(g + 1e-9) + 1.0 if e > 0.0 else math.ceil(g - 1e-9) - 1.0
                following = min(following, t + (line * step - at) / e)
        if length - following < 1e-12 * length:
            following = length
        middle = 0.5 * (t + following)
        i = min(max(int(math.floor((x + sx + middle * ex) / dx)), 0), int(meta[META_NX]) - 2)
        j = min(max(int(math.floor((y + sy + middle * ey) / dy)), 0), int(meta[META_NY]) - 2)
        # over the upper bound the second derivative along the edge is constant
        r0, r1, r2, r3 = upper_bound[j, i], upper_bound[j, i + 1], upper_bound[j + 1, i], upper_bound[j + 1, i + 1]
        u, v = (x + sx + t * ex) / dx - i, (y + sy + t * ey) / dy - j
        du, dv = (following - t) * ex / dx, (following - t) * ey / dy
        twist = r0 - r1 - r2 + r3
        here = z + sz + t * ez - r0 - (r1 - r0) * u - (r2 - r0) * v - twist * u * v
        there = z + sz + following * ez - r0 - (r1 - r0) * (u + du) - (r2 - r0) * (v + dv) - twist * (u + du) * (v + dv)
        if min(here, there) + 0.25 * min(twist * du * dv, 0.0) > least_clearance(near, count, sought.cap) + sought.seek:
            t = following
            continue
        curvature = -2.0 * ex * ey * twist / (dx * dy)  # of bilinear terrain
        kept = _search_piece(grid, meta, patch, i, j, curvature, edge, t, following, sought, near, count)
        known &= kept >= 0
        count = max(kept, count)
        t = following
    return count if known else -1 - count


@njit
def _gap_on_edge(grid: Array, meta: Array, edge: Edge, t: float, inner: float) -> tuple[float, float, float, float]:
    """Return the gap of a point of an edge, its derivative along it, and the terrain's slope.

    The terrain is evaluated at `inner` and extended to t by its tangent there. At an end of a piece, which lies on a grid
    line, `inner` a little inside the piece selects the cell.

    Args:
        grid, meta: terrain.
        edge: the edge.
        t: m along the edge, the point.
        inner: m along the edge, where the terrain is evaluated.

    Returns:
        Gap, m, its derivative along the edge, and the slope of the terrain along x and y.
    """
    h, gx, gy, _, _, _ = surface(grid, meta, edge.x + edge.sx + inner * edge.ex, edge.y + edge.sy + inner * edge.ey)
    slope = edge.ez - gx * edge.ex - gy * edge.ey
    return edge.z + edge.sz + inner * edge.ez - h + slope * (t - inner), slope, gx, gy


@njit
def _search_piece(
    grid: Array, meta: Array, patch: Array, i: int, j: int, least_curvature: float, edge: Edge, start: float, stop: float,
    sought: Sought, near: Array, count: int,
) -> int:  # fmt: skip
    """List the low points of an edge's piece within one cell.

    A minimum at an end of the piece is one of the edge too, or the gap falls further in the next piece.

    Args:
        grid, meta: terrain.
        patch: (BOUNDS_SIZE,) scratch.
        i, j: column and row of the cell.
        least_curvature: 1/m, the gap's second derivative along the piece on bilinear terrain; not used on cubic terrain.
        edge: the edge.
        start, stop: m along the edge, the piece.
        sought: limits of the search.
        near, count: the list and its number of points.

    Returns:
        The new count; -1 if data is missing.
    """
    _, _, _, sx, sy, sz, ex, ey, ez, length = edge
    inset = 1e-9 * (stop - start)
    cubic = meta[META_CUBIC] != 0.0
    extent = abs(ex) + abs(ey)
    a, b = start, stop
    while a < stop:
        span = b - a
        middle = 0.5 * (a + b)
        low, limit = -math.inf, least_clearance(near, count, sought.cap) + sought.seek
        if cubic:
            limit = limit_of_part(near, count, sought, sx + middle * ex, sy + middle * ey, 0.5 * span * extent)
            low, least_curvature = _edge_bounds(grid, meta, patch, i, j, edge, a, b)
        if math.isnan(low + least_curvature):
            return -1
        if low > limit:
            a, b = b, min(b + 2.0 * span, stop)
            continue
        fa, ga, ax, ay = _gap_on_edge(grid, meta, edge, a, min(a + inset, stop))
        fb, gb, bx, by = _gap_on_edge(grid, meta, edge, b, b - inset)
        slack = 0.5 * max(-least_curvature, 0.0) * span
        down, up = ga - slack, gb + slack
        t, f, gx, gy = a, fa, ax, ay
        if down < 0.0 and up <= 0.0:
            t, f, gx, gy = b, fb, bx, by
        elif down < 0.0:
            if fa + down * (fb - fa - up * span) / (down - up) > limit:
                f = math.inf
            elif least_curvature * span * span > -CLEARANCE_TIE or span < SMALLEST_PART * length:
                t, f, gx, gy = _minimum_between(grid, meta, edge, a, b, ga, gb)
            else:
                b = middle
                continue
        if f <= limit:
            if t in (start, stop) and 0.0 < t < length:
                gx, gy = _across_line(grid, meta, edge, t, 1e-9 * length)
            count = keep_lower_point(near, count, sought.apart, f, sx + t * ex, sy + t * ey, sz + t * ez, gx, gy)
        a, b = b, min(b + 2.0 * span, stop)
    return count


@njit
def _minimum_between(
    grid: Array, meta: Array, edge: Edge, left: float, right: float, slope_left: float, slope_right: float
) -> tuple[float, float, float, float]:
    """Find a stationary point of the gap on a part of an edge, by the Illinois method.

    Args:
        grid, meta: terrain.
        edge: the edge.
        left, right: m along the edge, the part.
        slope_left, slope_right: derivatives of the gap at the part's ends.

    Returns:
        Position, m along the edge, gap, m, and the terrain's slope along x and y.
    """
    t, f, gx, gy = left, math.inf, 0.0, 0.0
    for _ in range(60):
        change = slope_right - slope_left
        t = 0.5 * (left + right) if change == 0.0 else left - slope_left * (right - left) / change
        if not left < t < right:
            t = 0.5 * (left + right)
        f, g, gx, gy = _gap_on_edge(grid, meta, edge, t, t)
        if abs(g) < 1e-10 or right - left < 1e-12 * edge.length:
            break
        if g < 0.0:
            left, slope_left = t, g
            slope_right *= 0.5  # Illinois: the end that stays counts for less
        else:
            right, slope_right = t, g
            slope_left *= 0.5
    return t, f, gx, gy


@njit
def _edge_bounds(grid: Array, meta: Array, patch: Array, i: int, j: int, edge: Edge, a: float, b: float) -> tuple[float, float]:
    """Bound the height of a piece of an edge above a cubic cell.

    The piece is a diagonal of its rectangle in the cell, and lies in a plane that is horizontal across it. A vertical edge
    has no such plane, and no minimum between its ends.

    Args:
        grid, meta: cubic terrain.
        patch: (BOUNDS_SIZE,) scratch.
        i, j: column and row of the cell.
        edge: the edge.
        a, b: m along the edge, the piece.

    Returns:
        Lower bounds of the gap, m, and of its second derivative along the edge, 1/m.
    """
    x, y, z, sx, sy, sz, ex, ey, ez, _ = edge
    level = ex * ex + ey * ey
    if level < 1e-18:
        return -math.inf, 0.0
    wide, tall = abs(ex) * (b - a), abs(ey) * (b - a)
    from_x, from_y = min(a * ex, b * ex) + sx, min(a * ey, b * ey) + sy
    u, v = (x + from_x) / meta[META_DX] - i, (y + from_y) / meta[META_DY] - j
    slope = ez / level
    height = z + sz + slope * ((from_x - sx) * ex + (from_y - sy) * ey)
    low = bound_patch(
        grid, i, j, u, u + wide / meta[META_DX], v, v + tall / meta[META_DY], wide, tall, height, slope * ex, slope * ey, patch
    )
    bound_differences(patch)
    mixed = patch[XY_LOW] if ex * ey > 0.0 else -patch[XY_HIGH]
    return low, (6.0 * patch[XX_LOW] + 18.0 * mixed + 6.0 * patch[YY_LOW]) / ((b - a) * (b - a))


@njit
def _across_line(grid: Array, meta: Array, edge: Edge, t: float, step: float) -> tuple[float, float]:
    """Return the slope of the contact where an edge of the box crosses a grid line.

    It lies between the slopes of the terrain's two sides: the one for which the gap is stationary along the edge, or the
    nearer end.

    Args:
        grid, meta: terrain.
        edge: the edge.
        t: m along the edge.
        step: m, distance at which the sides are evaluated.
    """
    x, y, ex, ey, ez = edge.x + edge.sx, edge.y + edge.sy, edge.ex, edge.ey, edge.ez
    _, ax, ay, _, _, _ = surface(grid, meta, x + (t - step) * ex, y + (t - step) * ey)
    _, bx, by, _, _, _ = surface(grid, meta, x + (t + step) * ex, y + (t + step) * ey)
    ga, gb = ez - ax * ex - ay * ey, ez - bx * ex - by * ey
    part = ga / (ga - gb) if abs(ga - gb) > 1e-9 else 0.5
    part = min(max(part, 0.0), 1.0)
    return ax + part * (bx - ax), ay + part * (by - ay)
