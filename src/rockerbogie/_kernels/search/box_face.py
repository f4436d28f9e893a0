"""Points of a face of the body's box that are near the terrain.

Over bilinear terrain a face is lowest over a grid node, or at its edges. Over cubic terrain it may also have a minimum
inside a cell: the cell is quartered until Bézier ordinates (`cubic_patch`) decide a part: no point of it is to be listed, it
has no minimum, or the gap is convex over it within CLEARANCE_TIE. Newton's method then finds its minimum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.ground import META_CUBIC, META_DX, META_DY, Ground, surface
from ..model.tolerances import CLEARANCE_TIE, MIN_DECREASE, SMALLEST_PART
from .box_points import Sought, keep_lower_point, least_clearance, limit_of_part
from .cubic_parts import bounded_step, next_part
from .cubic_patch import bound_differences, bound_patch, monotonic, nearly_convex

Array = NDArray[np.float64]

SPLIT, MISSING = -2, -1  # returned in place of a count
STEEP = 1.0  # |slope along x| + |slope along y| of a face that is first compared with the slope of each cell


class Face(NamedTuple):
    """A lower face of the body's box. X and Y are an offset from the body's origin, m."""

    x: float  # m: the body's origin from the map's first node, and z from the datum
    y: float
    z: float
    c0: float  # m: the face's plane is at c0 + gx X + gy Y above the body's origin
    gx: float
    gy: float
    a0: float  # m: the plane's point over (X, Y) is at a0 + ax X + ay Y along one axis of the face
    ax: float
    ay: float
    b0: float  # m: and at b0 + bx X + by Y along the other
    bx: float
    by: float
    a_low: float  # m: ends of the face along both axes
    a_high: float
    b_low: float
    b_high: float
    mid_x: float  # m: centre of the face's bounding rectangle, as an offset
    mid_y: float
    far_x: float  # m: half sizes of that rectangle
    far_y: float


class Rectangle(NamedTuple):
    """A rectangle of the map, as offsets from the body's origin, m."""

    west: float
    east: float
    south: float
    north: float


class Quarter(NamedTuple):
    """A quarter of a rectangle, or a quarter of a quarter and so on."""

    from_x: float  # m: its low corner from the rectangle's
    from_y: float
    rx: float  # m: its half sizes
    ry: float


@inlined
def search_face(
    ground: Ground, patch: Array, face: Face, cells: tuple[int, int, int, int], extent: Rectangle,
    sought: Sought, near: Array, count: int,
) -> tuple[bool, int]:  # fmt: skip
    """List the points of a face that are near the terrain, over nodes and inside cells.

    Args:
        ground: terrain.
        patch: (BOUNDS_SIZE,) scratch.
        face: the face.
        cells: first and last column, first and last row of the cells under the box.
        extent: the box's bounding rectangle.
        sought: limits of the search.
        near, count: the list and its number of points.

    Returns:
        True if no data is missing under the face, and the new count.
    """
    grid, upper_bound, meta = ground
    half_x, half_y = 0.5 * meta[META_DX], 0.5 * meta[META_DY]
    i0, i1, j0, j1 = cells
    known = True
    for j in range(j0, j1 + 1):
        oy = (j + 0.5) * meta[META_DY] - face.y
        for i in range(i0, i1 + 1):
            ox = (i + 0.5) * meta[META_DX] - face.x
            if _is_beside(face, ox, oy, half_x, half_y):
                continue
            if max(abs(ox - face.mid_x) - half_x - face.far_x, abs(oy - face.mid_y) - half_y - face.far_y) > 0.0:
                continue
            part = Rectangle(
                max(ox - half_x, extent.west), min(ox + half_x, extent.east),
                max(oy - half_y, extent.south), min(oy + half_y, extent.north),
            )  # fmt: skip
            # beside missing data the upper bound of a known cell may be infinite
            if _room(upper_bound, meta, i, j, ox, oy, face, part) > least_clearance(near, count, sought.cap) + sought.seek:
                continue
            if meta[META_CUBIC] != 0.0:
                if abs(face.gx) + abs(face.gy) > STEEP and _is_steeper(grid, meta, i, j, face):
                    continue
                kept = _search_cubic_cell(grid, meta, patch, i, j, face, part, sought, near, count)
            else:
                kept = _search_nodes(grid, upper_bound, meta, i, j, ox, oy, face, sought, near, count)
            known &= kept >= 0
            count = max(kept, count)
    return known, count


@inlined
def _is_beside(face: Face, ox: float, oy: float, rx: float, ry: float) -> bool:
    """Return True if the face's plane over a rectangle lies outside the face.

    Args:
        face: the face.
        ox, oy: m, centre of the rectangle, as an offset from the body's origin.
        rx, ry: m, its half sizes; 0 for a point.
    """
    pa, pb = face.a0 + face.ax * ox + face.ay * oy, face.b0 + face.bx * ox + face.by * oy
    outside_a = max(face.a_low - pa, pa - face.a_high) > rx * abs(face.ax) + ry * abs(face.ay)
    return outside_a or max(face.b_low - pb, pb - face.b_high) > rx * abs(face.bx) + ry * abs(face.by)


@inlined
def _is_steeper(grid: Array, meta: Array, i: int, j: int, face: Face) -> bool:
    """Return True if a face is steeper than the terrain anywhere in a cubic cell.

    No minimum of the gap then lies inside the face. The slope of a spline lies between the differences of its neighbouring
    coefficients. Seen from above, the upright faces of a level box are thinner than most cells.

    Args:
        grid, meta: cubic terrain.
        i, j: column and row of the cell.
        face: the face.

    Returns:
        False also if the cell is missing.
    """
    rise_x, rise_y = abs(face.gx) * meta[META_DX], abs(face.gy) * meta[META_DY]
    right, up = (1, 0) if rise_x > rise_y else (0, 1)
    steepest, total = 0.0, 0.0
    for m in range(4):
        for n in range(3):
            row, col = (j + m, i + n) if right == 1 else (j + n, i + m)
            step = grid[row + up, col + right] - grid[row, col]
            steepest, total = max(steepest, abs(step)), total + step
    return steepest + 0.0 * total < max(rise_x, rise_y)


@inlined
def _room(upper_bound: Array, meta: Array, i: int, j: int, ox: float, oy: float, face: Face, part: Rectangle) -> float:
    """Return a lower bound of the gap between a face and a part of a cell, m.

    Args:
        upper_bound: (rows, cols) node heights of a bilinear surface above the terrain, m.
        meta: terrain.
        i, j: column and row of the cell.
        ox, oy: m, centre of the cell, as an offset from the body's origin.
        face: the face.
        part: the part of the cell.
    """
    r0, r1, r2, r3 = upper_bound[j, i], upper_bound[j, i + 1], upper_bound[j + 1, i], upper_bound[j + 1, i + 1]
    west, east, south, north = part
    u0, u1 = 0.5 + (west - ox) / meta[META_DX], 0.5 + (east - ox) / meta[META_DX]
    v0, v1 = 0.5 + (south - oy) / meta[META_DY], 0.5 + (north - oy) / meta[META_DY]
    twist = r0 - r1 - r2 + r3
    sw = r0 + (r1 - r0) * u0 + (r2 - r0) * v0 + twist * u0 * v0
    se = r0 + (r1 - r0) * u1 + (r2 - r0) * v0 + twist * u1 * v0
    nw = r0 + (r1 - r0) * u0 + (r2 - r0) * v1 + twist * u0 * v1
    ne = r0 + (r1 - r0) * u1 + (r2 - r0) * v1 + twist * u1 * v1
    gx, gy = face.gx, face.gy
    at_south = min(gx * west + gy * south - sw, gx * east + gy * south - se)
    at_north = min(gx * west + gy * north - nw, gx * east + gy * north - ne)
    return face.z + face.c0 + min(at_south, at_north)


@inlined
def _search_nodes(
    grid: Array, upper_bound: Array, meta: Array, i: int, j: int, ox: float, oy: float, face: Face,
    sought: Sought, near: Array, count: int,
) -> int:  # fmt: skip
    """List the low points of a face over the four nodes of a bilinear cell.

    Args:
        grid, upper_bound, meta: bilinear terrain.
        i, j: column and row of the cell.
        ox, oy: m, centre of the cell, as an offset from the body's origin.
        face: the face.
        sought: limits of the search.
        near, count: the list and its number of points.

    Returns:
        The new count; MISSING if a node is missing.
    """
    r0, r1, r2, r3 = upper_bound[j, i], upper_bound[j, i + 1], upper_bound[j + 1, i], upper_bound[j + 1, i + 1]
    if not math.isfinite(r0 + r1 + r2 + r3):
        return MISSING
    half_x, half_y = 0.5 * meta[META_DX], 0.5 * meta[META_DY]
    for corner in range(4):
        cx, cy = ox + (half_x if corner & 1 else -half_x), oy + (half_y if corner & 2 else -half_y)
        if not _is_beside(face, cx, cy, 0.0, 0.0):
            oz = face.c0 + face.gx * cx + face.gy * cy
            gap = face.z + oz - grid[j + (corner >> 1), i + (corner & 1)]
            if gap <= least_clearance(near, count, sought.cap) + sought.seek:
                count = keep_lower_point(near, count, sought.apart, gap, cx, cy, oz, face.gx, face.gy)
    return count


@njit
def _search_cubic_cell(
    grid: Array, meta: Array, patch: Array, col: int, row: int, face: Face, part: Rectangle,
    sought: Sought, near: Array, count: int,
) -> int:  # fmt: skip
    """List the low points of a face over a part of a cubic cell.

    There the terrain is concave and parallel to the face. The part is quartered until each quarter is decided.

    Args:
        grid, meta: cubic terrain.
        patch: (BOUNDS_SIZE,) scratch.
        col, row: the cell.
        face: the face.
        part: the part of the cell.
        sought: limits of the search.
        near, count: the list and its number of points.

    Returns:
        The new count; MISSING if the cell is missing.
    """
    level, i, j = 0, 0, 0
    rx, ry = 0.5 * (part.east - part.west), 0.5 * (part.north - part.south)
    while level >= 0:
        quarter = Quarter(i * (2.0 * rx), j * (2.0 * ry), rx, ry)
        kept = count
        if level == 0 or not _is_beside(face, part.west + quarter.from_x + rx, part.south + quarter.from_y + ry, rx, ry):
            kept = _search_quarter(grid, meta, patch, col, row, face, part, quarter, sought, near, count)
        if kept == MISSING:
            return MISSING
        if kept == SPLIT:
            level, i, j = level + 1, 2 * i, 2 * j
            rx, ry = 0.5 * rx, 0.5 * ry
        else:
            count = kept
            level, i, j, rx, ry = next_part(level, i, j, rx, ry)
    return count


@njit
def _search_quarter(
    grid: Array, meta: Array, patch: Array, col: int, row: int, face: Face, part: Rectangle, quarter: Quarter,
    sought: Sought, near: Array, count: int,
) -> int:  # fmt: skip
    """List the lowest point of a quarter of a part of a cubic cell, or show that there is none.

    Args:
        grid, meta: cubic terrain.
        patch: (BOUNDS_SIZE,) scratch.
        col, row: the cell.
        face: the face.
        part: the part of the cell.
        quarter: the quarter of that part.
        sought: limits of the search.
        near, count: the list and its number of points.

    Returns:
        The new count; MISSING if the cell is missing; SPLIT if the quarter is not decided and must be quartered itself.
    """
    from_x, from_y, rx, ry = quarter
    wide, tall = 2.0 * rx, 2.0 * ry
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    u, v = (face.x + part.west) * over_x - col, (face.y + part.south) * over_y - row
    height = face.z + face.c0 + face.gx * (part.west + from_x) + face.gy * (part.south + from_y)
    low = bound_patch(
        grid, col, row, u + from_x * over_x, u + (from_x + wide) * over_x,
        v + from_y * over_y, v + (from_y + tall) * over_y, wide, tall, height, face.gx, face.gy, patch,
    )  # fmt: skip
    if math.isnan(low):
        return MISSING
    ox, oy = part.west + from_x + rx, part.south + from_y + ry
    limit = limit_of_part(near, count, sought, ox, oy, rx + ry)
    if low > limit:
        return count
    bound_differences(patch)
    if monotonic(patch):
        return count
    px, py, held = ox, oy, -1
    if nearly_convex(patch, CLEARANCE_TIE):
        even_x, even_y = CLEARANCE_TIE / max(wide * wide, 1e-300), CLEARANCE_TIE / max(tall * tall, 1e-300)
        px, py, held = _minimum_in_part(grid, meta, face, ox, oy, rx, ry, even_x, even_y)
    if held < 0 and rx >= SMALLEST_PART * (0.5 * (part.east - part.west)):
        return SPLIT
    if not _is_beside(face, px, py, 0.0, 0.0):
        oz = face.c0 + face.gx * px + face.gy * py
        gap = face.z + oz - surface(grid, meta, face.x + px, face.y + py)[0]
        if gap <= (limit if held <= 0 else min(limit, least_clearance(near, count, sought.cap))):
            count = keep_lower_point(near, count, sought.apart, gap, px, py, oz, face.gx, face.gy)
    return count


@njit
def _minimum_in_part(
    grid: Array, meta: Array, face: Face, xm: float, ym: float, rx: float, ry: float, even_x: float, even_y: float
) -> tuple[float, float, int]:
    """Find the minimum height of a face's plane above concave terrain, within a part of a cell.

    Args:
        grid, meta: cubic terrain.
        face: the face.
        xm, ym, rx, ry: m, middle and half sizes of the part, from the body's origin.
        even_x, even_y: 1/m, curvature added to the height's, for terrain that is level along a line.

    Returns:
        The position, m from the body's origin, and the number of its coordinates that are held at the part's sides; -1 if
        Newton's method did not converge.
    """
    a = b = 0.0
    for _ in range(30):
        _, hx, hy, hxx, hxy, hyy = surface(grid, meta, face.x + xm + a, face.y + ym + b)
        new_a, new_b, decrease, held = bounded_step(a, b, rx, ry, face.gx - hx, face.gy - hy, even_x - hxx, -hxy, even_y - hyy)
        if held < 0 or decrease < MIN_DECREASE:
            return xm + a, ym + b, held
        a, b = new_a, new_b
    return xm + a, ym + b, -1
