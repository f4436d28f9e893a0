"""Contacts and clearance of the body's box: its lower faces, and their edges and corners.

The box's lower side is convex and made of plane faces. Over bilinear terrain its minimum gap is over a grid node, or on
one of its edges, piece by piece between grid lines. Over cubic terrain a face may also have a minimum inside a cell: parts
of the cell are quartered, and of an edge halved, until Bézier ordinates (`cubic_patch`) decide: a part is nowhere lower
than the points listed, or has no minimum, or the gap is convex over it within CLEARANCE_TIE. Newton's method then finds its
minimum.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import META_CUBIC, META_DX, META_DY, META_NX, META_NY, Ground, on_map, surface
from ..model.tolerances import CLEARANCE_TIE, GAP_TIE, MIN_DECREASE, SMALLEST_PART
from .cubic_cell import bounded_step
from .cubic_patch import (
    BOUNDS_SIZE,
    XX_LOW,
    XY_HIGH,
    XY_LOW,
    YY_LOW,
    bound_differences,
    bound_patch,
    monotonic,
    nearly_convex,
)
from .tread import BLANK, FOUND, OFF

Array = NDArray[np.float64]

# A place where the box is near the ground: gap, offset from the body's origin in the world, and (gx, gy) with
# (-gx, -gy, 1) normal to the contact.
N_GAP, N_X, N_Y, N_Z, N_GX, N_GY = range(6)
NEAR_SIZE = 6
NEAR_ROOM = 12
APART = 0.1  # places closer than this share of the box's length are one


@njit
def _keep_lower_point(
    near: Array, count: int, apart: float, gap: float, x: float, y: float, z: float, gx: float, gy: float
) -> int:
    """List a point of the box if it is the lowest of its neighbourhood.

    Args:
        near: (n, NEAR_SIZE) the list.
        count: number of points listed.
        apart: m, points closer than this are one neighbourhood.
        gap: m, the point's gap.
        x, y, z: m, the point from the body's origin.
        gx, gy: slope of the contact.

    Returns:
        The new count.
    """
    spot = -1
    for k in range(count):
        if abs(near[k, N_X] - x) + abs(near[k, N_Y] - y) < apart:
            if near[k, N_GAP] <= gap:
                return count
            spot = k
            break
    if spot < 0:
        if count < near.shape[0]:
            spot = count
            count += 1
        else:
            spot = 0
            for k in range(1, count):
                if near[k, N_GAP] > near[spot, N_GAP]:
                    spot = k
            if near[spot, N_GAP] <= gap:
                return count
    near[spot, N_GAP], near[spot, N_X], near[spot, N_Y], near[spot, N_Z] = gap, x, y, z
    near[spot, N_GX], near[spot, N_GY] = gx, gy
    return count


@njit
def least_clearance(near: Array, count: int, cap: float = math.inf) -> float:
    """Return the lowest gap of a list, m, at most `cap`.

    Args:
        near: (n, NEAR_SIZE) the list.
        count: number of points listed.
        cap: m.
    """
    low = cap
    for k in range(count):
        low = min(low, near[k, N_GAP])
    return low


@njit
def _sought(near: Array, count: int, cap: float, seek: float, apart: float, x: float, y: float, reach: float) -> float:
    """Return the gap, m, below which the points of a part would be listed.

    A part that lies wholly in the neighbourhood of a listed point must be lower than that one by GAP_TIE, and, if the list
    is full, lower than the highest.

    Args:
        near, count: the list and how many it holds.
        cap, seek: m: what is sought is lower than the lowest point so far, or `cap`, plus `seek`.
        apart: m, points closer than this are one neighbourhood.
        x, y: m, middle of the part from the body's origin.
        reach: m, the largest |x| + |y| from there to a point of the part.
    """
    low, high, own = cap, -math.inf, math.inf
    for k in range(count):
        gap = near[k, N_GAP]
        low, high = min(low, gap), max(high, gap)
        if abs(near[k, N_X] - x) + abs(near[k, N_Y] - y) + reach < apart:
            own = min(own, gap)
    limit = min(low + seek, own - GAP_TIE)
    return min(limit, high) if count == near.shape[0] else limit


@njit
def box_over_ground(
    ground: Ground, box: Array, axes: Array, x: float, y: float, z: float, margin: float, near: Array
) -> tuple[int, int]:
    """List the lowest point of the body's box, and others up to `margin` higher.

    Args:
        ground: terrain.
        box: (6,) low and high corner in the body's frame, m.
        axes: (3, 3) the body's directions in the world, one a row.
        x, y, z: m, the body's origin from the map's first node and the datum.
        margin: m; 0 for the lowest place alone, within CLEARANCE_TIE.
        near: (n, NEAR_SIZE) filled with the places.

    Returns:
        FOUND, OFF (the map ends under the box; nothing is listed) or BLANK (missing data under it; places over known cells are
        listed), and how many places are listed.
    """
    grid, upper_bound, meta = ground
    patch = np.empty(BOUNDS_SIZE)
    low = np.empty(3)  # the box's lower corner in each of its own directions
    high = np.empty(3)
    size = 0.0
    for k in range(3):
        low[k] = box[k] if axes[k, 2] > 0.0 else box[3 + k]
        high[k] = box[3 + k] if axes[k, 2] > 0.0 else box[k]
        size = max(size, box[3 + k] - box[k])
    apart = APART * size
    dx, dy = meta[META_DX], meta[META_DY]
    x_min = y_min = math.inf
    x_max = y_max = -math.inf
    for corner in range(8):
        a = box[0] if corner & 1 else box[3]
        b = box[1] if corner & 2 else box[4]
        c = box[2] if corner & 4 else box[5]
        ox = axes[0, 0] * a + axes[1, 0] * b + axes[2, 0] * c
        oy = axes[0, 1] * a + axes[1, 1] * b + axes[2, 1] * c
        x_min, x_max, y_min, y_max = min(x_min, ox), max(x_max, ox), min(y_min, oy), max(y_max, oy)
    if not (on_map(meta, x + x_min, y + y_min) and on_map(meta, x + x_max, y + y_max)):
        return OFF, 0
    code, count = FOUND, 0
    # upper bound of the clearance: the gap at five points of the lowest face; higher parts are skipped
    down = 0
    for k in range(1, 3):
        if abs(axes[k, 2]) > abs(axes[down, 2]):
            down = k
    a, b = (down + 1) % 3, (down + 2) % 3
    cap, cap_x, cap_y, cap_z = math.inf, 0.0, 0.0, 0.0
    for place in range(5):
        pa = 0.5 * (box[a] + box[3 + a]) if place == 4 else (box[a] if place & 1 else box[3 + a])
        pb = 0.5 * (box[b] + box[3 + b]) if place == 4 else (box[b] if place & 2 else box[3 + b])
        ox = axes[a, 0] * pa + axes[b, 0] * pb + axes[down, 0] * low[down]
        oy = axes[a, 1] * pa + axes[b, 1] * pb + axes[down, 1] * low[down]
        oz = axes[a, 2] * pa + axes[b, 2] * pb + axes[down, 2] * low[down]
        gap = z + oz - surface(grid, meta, x + ox, y + oy)[0]
        if gap < cap:
            cap, cap_x, cap_y, cap_z = gap, ox, oy, oz
    # ties are listed; for the lowest point alone, a point lower by less than CLEARANCE_TIE is not sought
    seek = margin + CLEARANCE_TIE if margin > 0.0 else -CLEARANCE_TIE
    for face in range(3):  # the edges' direction; three of them are on the lower side
        a, b = (face + 1) % 3, (face + 2) % 3
        for end in range(3):
            pa = low[a] if end != 1 else high[a]
            pb = low[b] if end != 2 else high[b]
            sx = axes[a, 0] * pa + axes[b, 0] * pb + axes[face, 0] * box[face]
            sy = axes[a, 1] * pa + axes[b, 1] * pb + axes[face, 1] * box[face]
            sz = axes[a, 2] * pa + axes[b, 2] * pb + axes[face, 2] * box[face]
            kept = _edge(
                ground, patch, x, y, z, sx, sy, sz, axes[face, 0], axes[face, 1], axes[face, 2], box[3 + face] - box[face],
                cap, seek, apart, near, count,
            )  # fmt: skip
            if kept < 0:
                code, kept = BLANK, -1 - kept
            count = kept
    last_i, last_j = int(meta[META_NX]) - 2, int(meta[META_NY]) - 2
    i0, i1 = min(int(math.floor((x + x_min) / dx)), last_i), min(int(math.floor((x + x_max) / dx)), last_i)
    j0, j1 = min(int(math.floor((y + y_min) / dy)), last_j), min(int(math.floor((y + y_max) / dy)), last_j)
    half_x, half_y = 0.5 * dx, 0.5 * dy
    for face in range(3):
        nz = axes[face, 2]
        if abs(nz) < 1e-6:
            continue
        a, b = (face + 1) % 3, (face + 2) % 3
        # over the offset (X, Y) from the body's origin the face's plane stands at c0 + gx X + gy Y, and is at (pa, pb) of the box
        c0, gx, gy = low[face] / nz, -axes[face, 0] / nz, -axes[face, 1] / nz
        ax, ay = axes[a, 0] + axes[a, 2] * gx, axes[a, 1] + axes[a, 2] * gy
        bx, by = axes[b, 0] + axes[b, 2] * gx, axes[b, 1] + axes[b, 2] * gy
        reach_a, reach_b = half_x * abs(ax) + half_y * abs(ay), half_x * abs(bx) + half_y * abs(by)
        # the level rectangle around the face
        long_a, long_b = 0.5 * (box[3 + a] - box[a]), 0.5 * (box[3 + b] - box[b])
        far_x = abs(axes[a, 0]) * long_a + abs(axes[b, 0]) * long_b
        far_y = abs(axes[a, 1]) * long_a + abs(axes[b, 1]) * long_b
        mid_a, mid_b = box[a] + long_a, box[b] + long_b
        mid_x = axes[face, 0] * low[face] + axes[a, 0] * mid_a + axes[b, 0] * mid_b
        mid_y = axes[face, 1] * low[face] + axes[a, 1] * mid_a + axes[b, 1] * mid_b
        for j in range(j0, j1 + 1):
            oy = (j + 0.5) * dy - y
            for i in range(i0, i1 + 1):
                ox = (i + 0.5) * dx - x
                pa, pb = axes[a, 2] * c0 + ax * ox + ay * oy, axes[b, 2] * c0 + bx * ox + by * oy
                outside_a = max(box[a] - pa, pa - box[3 + a]) > reach_a
                if outside_a or max(box[b] - pb, pb - box[3 + b]) > reach_b:
                    continue
                if max(abs(ox - mid_x) - half_x - far_x, abs(oy - mid_y) - half_y - far_y) > 0.0:
                    continue
                r0, r1, r2, r3 = upper_bound[j, i], upper_bound[j, i + 1], upper_bound[j + 1, i], upper_bound[j + 1, i + 1]
                # the cell as far as it lies under the box
                west, east = max(ox - half_x, x_min), min(ox + half_x, x_max)
                south, north = max(oy - half_y, y_min), min(oy + half_y, y_max)
                u0, u1 = 0.5 + (west - ox) / dx, 0.5 + (east - ox) / dx
                v0, v1 = 0.5 + (south - oy) / dy, 0.5 + (north - oy) / dy
                twist = r0 - r1 - r2 + r3
                sw = r0 + (r1 - r0) * u0 + (r2 - r0) * v0 + twist * u0 * v0
                se = r0 + (r1 - r0) * u1 + (r2 - r0) * v0 + twist * u1 * v0
                nw = r0 + (r1 - r0) * u0 + (r2 - r0) * v1 + twist * u0 * v1
                ne = r0 + (r1 - r0) * u1 + (r2 - r0) * v1 + twist * u1 * v1
                room = (
                    z
                    + c0
                    + min(
                        min(gx * west + gy * south - sw, gx * east + gy * south - se),
                        min(gx * west + gy * north - nw, gx * east + gy * north - ne),
                    )
                )
                # beside missing data the upper bound of a known cell may be infinite
                if room > least_clearance(near, count, cap) + seek:
                    continue
                if meta[META_CUBIC] != 0.0:
                    kept = _face_over_cell(
                        grid, meta, patch, i, j, x, y, z, west, east, south, north, c0, gx, gy, box, a, b,
                        axes[a, 2] * c0, ax, ay, axes[b, 2] * c0, bx, by, cap, seek, apart, near, count,
                    )  # fmt: skip
                    if kept < 0:
                        code, kept = BLANK, count
                    count = kept
                    continue
                if not math.isfinite(r0 + r1 + r2 + r3):
                    code = BLANK
                    continue
                for corner in range(4):
                    cx, cy = ox + (half_x if corner & 1 else -half_x), oy + (half_y if corner & 2 else -half_y)
                    pa, pb = axes[a, 2] * c0 + ax * cx + ay * cy, axes[b, 2] * c0 + bx * cx + by * cy
                    if box[a] <= pa <= box[3 + a] and box[b] <= pb <= box[3 + b]:
                        oz = c0 + gx * cx + gy * cy
                        gap = z + oz - grid[j + (corner >> 1), i + (corner & 1)]
                        if gap <= least_clearance(near, count, cap) + seek:
                            count = _keep_lower_point(near, count, apart, gap, cx, cy, oz, gx, gy)
    if count == 0 and cap < math.inf:
        count = _keep_lower_point(
            near, 0, apart, cap, cap_x, cap_y, cap_z, -axes[down, 0] / axes[down, 2], -axes[down, 1] / axes[down, 2]
        )
    return code, count


@njit
def _edge(
    ground: Ground, patch: Array, x: float, y: float, z: float, sx: float, sy: float, sz: float,
    ex: float, ey: float, ez: float, length: float, cap: float, seek: float, apart: float, near: Array, count: int,
) -> int:  # fmt: skip
    """List where an edge of the box is near the terrain, cell by cell.

    Args:
        ground: terrain.
        patch: (BOUNDS_SIZE,) scratch.
        x, y, z: m, the body's origin.
        sx, sy, sz: m, the edge's start from there.
        ex, ey, ez: its direction.
        length: m.
        cap, seek: m: what is sought is lower than the lowest place so far, or `cap`, plus `seek`.
        apart: m, distance within which places are one.
        near, count: the list and how many it holds.

    Returns:
        How many the list holds; -1 less that if a part of the edge lies over missing data.
    """
    grid, upper_bound, meta = ground
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
        if min(here, there) + 0.25 * min(twist * du * dv, 0.0) > least_clearance(near, count, cap) + seek:
            t = following
            continue
        least_bend = -2.0 * ex * ey * twist / (dx * dy)  # of bilinear terrain
        kept = _piece(
            grid, meta, patch, i, j, least_bend, x, y, z, sx, sy, sz, ex, ey, ez, t, following, length, cap, seek, apart,
            near, count,
        )  # fmt: skip
        known &= kept >= 0
        count = max(kept, count)
        t = following
    return count if known else -1 - count


@njit
def _on_edge(
    grid: Array, meta: Array, x: float, y: float, z: float, sx: float, sy: float, sz: float, ex: float, ey: float, ez: float,
    t: float, inner: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Evaluate an edge of the box over the cell that holds the point at `inner`, extended to t.

    Args:
        grid, meta: terrain.
        x, y, z: m, the body's origin.
        sx, sy, sz: m, the edge's start from there.
        ex, ey, ez: its direction.
        t, inner: m along the edge.

    Returns:
        Height above the terrain at t, m, its change along the edge, and the terrain's slope along x and y.
    """
    h, gx, gy, _, _, _ = surface(grid, meta, x + sx + inner * ex, y + sy + inner * ey)
    slope = ez - gx * ex - gy * ey
    return z + sz + inner * ez - h + slope * (t - inner), slope, gx, gy


@njit
def _piece(
    grid: Array, meta: Array, patch: Array, i: int, j: int, least_bend: float, x: float, y: float, z: float,
    sx: float, sy: float, sz: float, ex: float, ey: float, ez: float, start: float, stop: float, length: float,
    cap: float, seek: float, apart: float, near: Array, count: int,
) -> int:  # fmt: skip
    """List the low points of an edge's piece within one cell.

    A minimum at an end of the piece is one of the edge too, or the gap falls further in the next piece.

    Args:
        grid, meta: terrain.
        patch: (BOUNDS_SIZE,) scratch.
        i, j: column and row of the cell.
        least_bend: 1/m, the gap's second derivative along the piece on bilinear terrain.
        x, y, z: m, the body's origin.
        sx, sy, sz: m, the edge's start from there.
        ex, ey, ez: its direction.
        start, stop: m, the piece.
        length: m, the edge.
        cap, seek, apart, near, count: as `_edge` takes them.

    Returns:
        The new count; -1 if data is missing.
    """
    inset = 1e-9 * (stop - start)
    cubic = meta[META_CUBIC] != 0.0
    extent = abs(ex) + abs(ey)
    a, b = start, stop
    while a < stop:
        span = b - a
        middle = 0.5 * (a + b)
        low, limit = -math.inf, least_clearance(near, count, cap) + seek
        if cubic:
            limit = _sought(near, count, cap, seek, apart, sx + middle * ex, sy + middle * ey, 0.5 * span * extent)
            low, least_bend = _edge_bounds(grid, meta, patch, i, j, x, y, z, sx, sy, sz, ex, ey, ez, a, b)
        if math.isnan(low + least_bend):
            return -1
        if low > limit:
            a, b = b, min(b + 2.0 * span, stop)
            continue
        fa, ga, ax, ay = _on_edge(grid, meta, x, y, z, sx, sy, sz, ex, ey, ez, a, min(a + inset, stop))
        fb, gb, bx, by = _on_edge(grid, meta, x, y, z, sx, sy, sz, ex, ey, ez, b, b - inset)
        slack = 0.5 * max(-least_bend, 0.0) * span
        down, up = ga - slack, gb + slack
        t, f, gx, gy = a, fa, ax, ay
        if down < 0.0 and up <= 0.0:
            t, f, gx, gy = b, fb, bx, by
        elif down < 0.0:
            if fa + down * (fb - fa - up * span) / (down - up) > limit:
                f = math.inf
            elif least_bend * span * span > -CLEARANCE_TIE or span < SMALLEST_PART * length:
                left, right = a, b
                for _ in range(60):
                    t = 0.5 * (left + right) if gb == ga else left - ga * (right - left) / (gb - ga)
                    if not left < t < right:
                        t = 0.5 * (left + right)
                    f, g, gx, gy = _on_edge(grid, meta, x, y, z, sx, sy, sz, ex, ey, ez, t, t)
                    if abs(g) < 1e-10 or right - left < 1e-12 * length:
                        break
                    if g < 0.0:
                        left, ga = t, g
                        gb *= 0.5  # Illinois: the end that stays counts for less
                    else:
                        right, gb = t, g
                        ga *= 0.5
            else:
                b = middle
                continue
        if f <= limit:
            if t in (start, stop) and 0.0 < t < length:
                gx, gy = _across_line(grid, meta, x, y, sx, sy, ex, ey, ez, t, 1e-9 * length)
            count = _keep_lower_point(near, count, apart, f, sx + t * ex, sy + t * ey, sz + t * ez, gx, gy)
        a, b = b, min(b + 2.0 * span, stop)
    return count


@njit
def _edge_bounds(
    grid: Array, meta: Array, patch: Array, i: int, j: int, x: float, y: float, z: float, sx: float, sy: float, sz: float,
    ex: float, ey: float, ez: float, a: float, b: float,
) -> tuple[float, float]:  # fmt: skip
    """Bound the height of a piece of an edge above a cubic cell.

    The piece is a diagonal of its rectangle in the cell, and lies in a plane that is horizontal across it. A vertical edge
    has no such plane, and no minimum between its ends.

    Args:
        grid, meta: cubic terrain.
        patch: (BOUNDS_SIZE,) scratch.
        i, j: column and row of the cell.
        x, y, z: m, the body's origin.
        sx, sy, sz: m, the edge's start from there.
        ex, ey, ez: its direction.
        a, b: m, the piece.

    Returns:
        Lower bounds of the gap, m, and of its second derivative along the edge, 1/m.
    """
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
def _across_line(
    grid: Array, meta: Array, x: float, y: float, sx: float, sy: float, ex: float, ey: float, ez: float, t: float, step: float
) -> tuple[float, float]:
    """Return the slope of the contact where an edge of the box crosses a grid line.

    It lies between the slopes of the terrain's two sides: the one for which the gap is stationary along the edge, or the
    nearer end.

    Args:
        grid, meta: terrain.
        x, y: m, the body's origin.
        sx, sy: m, the edge's start from there.
        ex, ey, ez: its direction.
        t: m along the edge.
        step: m, distance at which the sides are evaluated.
    """
    _, ax, ay, _, _, _ = surface(grid, meta, x + sx + (t - step) * ex, y + sy + (t - step) * ey)
    _, bx, by, _, _, _ = surface(grid, meta, x + sx + (t + step) * ex, y + sy + (t + step) * ey)
    ga, gb = ez - ax * ex - ay * ey, ez - bx * ex - by * ey
    part = ga / (ga - gb) if abs(ga - gb) > 1e-9 else 0.5
    part = min(max(part, 0.0), 1.0)
    return ax + part * (bx - ax), ay + part * (by - ay)


@njit
def _face_over_cell(
    grid: Array, meta: Array, patch: Array, col: int, row: int, x: float, y: float, z: float,
    west: float, east: float, south: float, north: float, c0: float, gx: float, gy: float, box: Array, a: int, b: int,
    a0: float, ax: float, ay: float, b0: float, bx: float, by: float,
    cap: float, seek: float, apart: float, near: Array, count: int,
) -> int:  # fmt: skip
    """List the low points of a face over a part of a cubic cell.

    There the terrain is concave and parallel to the face.

    Args:
        grid, meta: cubic terrain.
        patch: (BOUNDS_SIZE,) scratch.
        col, row: the cell.
        x, y, z: m, the body's origin.
        west, east, south, north: m, the part from the body's origin.
        c0, gx, gy: the face's plane c0 + gx X + gy Y, from the body's origin.
        box: (6,) low and high corner in the body's frame, m.
        a, b: the face's two axes of the body.
        a0, ax, ay: the box coordinate along a is a0 + ax X + ay Y.
        b0, bx, by: the one along b.
        cap, seek, apart, near, count: as `_edge` takes them.

    Returns:
        The new count; -1 if the cell is missing.
    """
    half_x, half_y = 0.5 * (east - west), 0.5 * (north - south)
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    u, v = (x + west) * over_x - col, (y + south) * over_y - row
    level, i, j = 0, 0, 0
    rx, ry = half_x, half_y
    while True:
        wide, tall = 2.0 * rx, 2.0 * ry
        from_x, from_y = i * wide, j * tall
        ox, oy = west + from_x + rx, south + from_y + ry
        split = False
        pa, pb = a0 + ax * ox + ay * oy, b0 + bx * ox + by * oy
        outside_a = max(box[a] - pa, pa - box[3 + a]) > rx * abs(ax) + ry * abs(ay)
        if level == 0 or not (outside_a or max(box[b] - pb, pb - box[3 + b]) > rx * abs(bx) + ry * abs(by)):
            height = z + c0 + gx * (west + from_x) + gy * (south + from_y)
            low = bound_patch(
                grid, col, row, u + from_x * over_x, u + (from_x + wide) * over_x,
                v + from_y * over_y, v + (from_y + tall) * over_y, wide, tall, height, gx, gy, patch,
            )  # fmt: skip
            if math.isnan(low):
                return -1
            limit = _sought(near, count, cap, seek, apart, ox, oy, rx + ry)
            if low <= limit:
                bound_differences(patch)
                if not monotonic(patch):
                    px, py, held = ox, oy, -1
                    if nearly_convex(patch, CLEARANCE_TIE):
                        even_x, even_y = CLEARANCE_TIE / max(wide * wide, 1e-300), CLEARANCE_TIE / max(tall * tall, 1e-300)
                        px, py, held = _hill(grid, meta, x, y, gx, gy, ox, oy, rx, ry, even_x, even_y)
                    if held < 0 and rx >= SMALLEST_PART * half_x:
                        split = True
                    else:
                        pa, pb = a0 + ax * px + ay * py, b0 + bx * px + by * py
                        if box[a] <= pa <= box[3 + a] and box[b] <= pb <= box[3 + b]:
                            oz = c0 + gx * px + gy * py
                            gap = z + oz - surface(grid, meta, x + px, y + py)[0]
                            if gap <= (limit if held <= 0 else min(limit, least_clearance(near, count, cap))):
                                count = _keep_lower_point(near, count, apart, gap, px, py, oz, gx, gy)
        if split:
            level, i, j = level + 1, 2 * i, 2 * j
            rx, ry = 0.5 * rx, 0.5 * ry
            continue
        while level > 0 and i % 2 == 1 and j % 2 == 1:  # the last quarter: return to the part it belongs to
            level, i, j = level - 1, i // 2, j // 2
            rx, ry = 2.0 * rx, 2.0 * ry
        if level == 0:
            return count
        if i % 2 == 0:
            i += 1
        else:
            i, j = i - 1, j + 1


@njit
def _hill(
    grid: Array, meta: Array, x: float, y: float, gx: float, gy: float, xm: float, ym: float, rx: float, ry: float,
    even_x: float, even_y: float,
) -> tuple[float, float, int]:  # fmt: skip
    """Find the minimum height of a plane above concave terrain, within a part of a cell.

    Args:
        grid, meta: cubic terrain.
        x, y: m, the body's origin from the map's first node.
        gx, gy: slope of the plane.
        xm, ym, rx, ry: m, middle and half sizes of the part, from the body's origin.
        even_x, even_y: 1/m, curvature added to the height's, for terrain that is level along a line.

    Returns:
        The place, m from the body's origin, and how many of its coordinates are held at the part's sides; -1 if Newton did not
        converge.
    """
    ox, oy = xm, ym
    for _ in range(30):
        _, hx, hy, hxx, hxy, hyy = surface(grid, meta, x + ox, y + oy)
        fx, fy = gx - hx, gy - hy
        step_x, step_y, held = bounded_step(ox - xm, oy - ym, rx, ry, fx, fy, even_x - hxx, -hxy, even_y - hyy)
        if held < 0 or abs(fx * step_x + fy * step_y) < MIN_DECREASE:
            return ox, oy, held
        ox, oy = min(max(ox + step_x, xm - rx), xm + rx), min(max(oy + step_y, ym - ry), ym + ry)
    return ox, oy, -1
