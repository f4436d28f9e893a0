"""The global minimum of the gap of one wheel, over its whole tread.

The terrain's cells under the tread are bounded row by row: the tread's lower side T is convex, so it is nowhere below
its tangent planes, and the terrain nowhere above its `upper_bound`. A cell is searched (`bilinear_cell`,
`cubic_cell`) only if the bound is below the lowest gap so far.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, specialize_on_ground
from ..model.ground import META_DX, META_DY, META_MAX_CURVATURE, META_NX, META_NY, CubicGround, Ground, on_map
from ..model.tolerances import CELL_MARGIN, GAP_TIE
from ..model.wheel import (  # fmt: skip
    AX,
    AY,
    AZ,
    BOUND,
    COS,
    COSINE,
    EX,
    EY,
    GAP,
    HALF,
    HX,
    HY,
    HZ,
    OPEN,
    PLACE,
    PLANE,
    RADIUS,
    ROW,
    SIN,
    TAN,
    UX,
    UY,
    VX,
    VY,
    gap_at,
    tread_point,
)
from .bilinear_cell import FlatCell, search_flat_cell
from .cells_under import cells_within, columns_under, covers_cell
from .cubic_cell import search_curved_cell
from .cubic_rim import follow_smooth
from .minima import Minima
from .rim_pieces import Part

Array = NDArray[np.float64]

ROOM = 12  # local minima of the gap kept of one wheel
FOUND, OFF, BLANK = 0, 1, 2
SMOOTH = 0.7  # curvature of the map times wheel radius: below this a thin disc is followed by Newton (`follow_smooth`)


@njit
def _bound_row(
    upper_bound: Array, j: int, i: int, n: int, dx: float, dy: float, far_x: float, far_y: float, w: Array
) -> None:  # fmt: skip
    """Fill BOUND with lower bounds of the gap over cells of a row, within the wheel's reach.

    Each is the greater of two: by the tangent plane of T over the middle, and by that at the best contact so far
    (`tangent_plane`) plus what T rises above it, which is tight on smooth terrain.

    Args:
        upper_bound: (rows, cols) node heights of a bilinear surface above the terrain, m.
        j, i, n: row, first column and number of the cells.
        dx, dy: m, node spacing.
        far_x, far_y: m, reach of the wheel from its hub.
        w: (WHEEL_SIZE,) wheel; BOUND is filled: m, inf beside the tread, NaN over missing data.
    """
    level, plane_x, plane_y = w[PLANE], w[PLANE + 1], w[PLANE + 2]
    bound = w[BOUND:]
    r, ex, ey, vx, vy, tan, hub_z, hub_x = w[RADIUS], w[EX], w[EY], w[VX], w[VY], w[TAN], w[HZ], w[HX]
    over, over_x, over_y = 1.0 / w[COS], 1.0 / dx, 1.0 / dy
    edge = 0.98 * r
    square = r * r
    margin = CELL_MARGIN * (dx + dy)
    reach_u, reach_v = r + margin, w[HALF] * w[COS] + r * abs(w[AZ]) + margin
    touch = w[PLANE + 3]
    touch_q = math.sqrt(square - touch * touch)
    touch_slope = touch / touch_q * over
    low_y = j * dy - w[HY]
    y0, y1 = max(low_y, -far_y), min(low_y + dy, far_y)
    v0, v1 = (y0 - low_y) * over_y, (y1 - low_y) * over_y
    y, half_y = 0.5 * (y0 + y1), 0.5 * (y1 - y0)
    by = plane_y * half_y
    for k in range(n):
        low_x = (i + k) * dx - hub_x
        x0, x1 = max(low_x, -far_x), min(low_x + dx, far_x)
        u0, u1 = (x0 - low_x) * over_x, (x1 - low_x) * over_x
        x, half_x = 0.5 * (x0 + x1), 0.5 * (x1 - x0)
        left, right = upper_bound[j, i + k], upper_bound[j, i + k + 1]
        up_left, up_right = upper_bound[j + 1, i + k] - left, upper_bound[j + 1, i + k + 1] - right
        a, b, d, e = left + v0 * up_left, right + v0 * up_right, left + v1 * up_left, right + v1 * up_right
        a, b, d, e = a + u0 * (b - a), a + u1 * (b - a), d + u0 * (e - d), d + u1 * (e - d)
        u, v = x * ex + y * ey, x * vx + y * vy
        ut = min(max(u, -edge), edge)
        q = math.sqrt(square - ut * ut)
        slope = ut / q * over
        gx, gy = (slope * ex + tan * vx) * half_x, (slope * ey + tan * vy) * half_y
        first = hub_z - q * over + slope * (u - ut) + tan * v - max(max(a + gx + gy, b - gx + gy), max(d + gx - gy, e - gx - gy))
        bx = plane_x * half_x
        second = level + plane_x * x + plane_y * y - max(max(a + bx + by, b - bx + by), max(d + bx - by, e - bx - by))
        reach_here = half_x * abs(ex) + half_y * abs(ey)
        ut = min(max(min(max(touch, u - reach_here), u + reach_here), -r), r)  # T is lowest above the plane here
        second += (touch_q - math.sqrt(square - ut * ut)) * over - touch_slope * (ut - touch)
        low = max(first, second) + 0.0 * (a + b + d + e)
        beside = abs(u) > reach_u + reach_here or abs(v) > reach_v + half_x * abs(vx) + half_y * abs(vy)
        bound[k] = math.inf if beside else low


@inlined
def tangent_plane(w: Array, sine: float) -> None:
    """Fill PLANE with the tangent plane of T at u = r sin φ.

    It is p0 + p1 X + p2 Y, X and Y from the hub. T is nowhere below it. PLANE + 3 holds u.

    Args:
        w: (WHEEL_SIZE,) wheel; PLANE is written.
        sine: sin φ, limited to ±0.999.
    """
    r = w[RADIUS]
    u = min(max(r * sine, -0.999 * r), 0.999 * r)
    q = math.sqrt(r * r - u * u)
    slope = u / (q * w[COS])
    w[PLANE + 3] = u
    w[PLANE] = w[HZ] - q / w[COS] - slope * u
    w[PLANE + 1], w[PLANE + 2] = slope * w[EX] + w[TAN] * w[VX], slope * w[EY] + w[TAN] * w[VY]


def _search_curved(
    ground: Ground, w: Array, i: int, j: int, far_x: float, far_y: float, follow: bool, found: Minima, count: int
) -> int:
    """Search a cell of cubic terrain for local minima of the gap, as `_search_cell`.

    Args:
        ground, w, i, j, far_x, far_y, follow, found, count: as `_search_cell` takes them.

    Returns:
        The new count; -1 if the cell is missing.
    """
    grid, _, meta = ground
    dx, dy = meta[META_DX], meta[META_DY]
    x0, y0 = i * dx - w[HX], j * dy - w[HY]
    part = Part(max(x0, -far_x), min(x0 + dx, far_x), max(y0, -far_y), min(y0 + dy, far_y))
    return search_curved_cell(grid, meta, w, i, j, part, found, count)


def _search_flat(
    ground: Ground, w: Array, i: int, j: int, far_x: float, far_y: float, follow: bool, found: Minima, count: int
) -> int:
    """Search a cell of bilinear terrain for local minima of the gap, as `_search_cell`.

    Args:
        ground, w, i, j, far_x, far_y, follow, found, count: as `_search_cell` takes them.

    Returns:
        The new count; -1 if the cell is missing.
    """
    grid, _, meta = ground
    dx, dy = meta[META_DX], meta[META_DY]
    a, b, d, e = grid[j, i], grid[j, i + 1], grid[j + 1, i], grid[j + 1, i + 1]
    if math.isnan(a + b + d + e):
        return -1
    cell = FlatCell(a, b, d, e, i * dx - w[HX], j * dy - w[HY], dx, dy)
    return search_flat_cell(w, cell, far_x, far_y, follow, found, count)


def _search_cell(
    ground: Ground, w: Array, i: int, j: int, far_x: float, far_y: float, follow: bool, found: Minima, count: int
) -> int:
    """Find the local minima of the gap over a cell.

    Args:
        ground: terrain.
        w: (WHEEL_SIZE,) wheel.
        i, j: column and row of the cell.
        far_x, far_y: m, reach of the wheel from its hub.
        follow: True to search only the rim of the tracked contact, or the tread's inside.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count; -1 if the cell is missing.
    """
    return _search_of(type(ground))(ground, w, i, j, far_x, far_y, follow, found, count)


@specialize_on_ground(_search_cell)
def _search_of(kind: type) -> Any:
    """Return `_search_cell` for one kind of terrain.

    Args:
        kind: CubicGround or LinearGround.
    """
    return _search_curved if kind is CubicGround else _search_flat


@inlined
def _search_open(
    ground: Ground, w: Array, far_x: float, far_y: float, follow: bool, opened: int, found: Minima, count: int
) -> tuple[int, bool]:  # fmt: skip
    """Search the cells listed in OPEN whose bounds are below the lowest gap, lowest bound first.

    If local minima are listed too, the cells keep their order.

    Args:
        ground, far_x, far_y, follow, found, count: as `_search_cell` takes them.
        w: (WHEEL_SIZE,) wheel; its scratch is written.
        opened: number of cells.

    Returns:
        The new count of minima; True if a missing cell lies under the tread.
    """
    dx, dy = ground[2][META_DX], ground[2][META_DY]
    lowest, keep, _ = found
    missing, ordered = False, keep == -math.inf
    for n in range(opened):
        least, at = w[OPEN + 3 * n], OPEN + 3 * n
        if ordered:
            for k in range(n + 1, opened):
                if w[OPEN + 3 * k] < least:
                    least, at = w[OPEN + 3 * k], OPEN + 3 * k
        if least >= max(lowest[GAP] - GAP_TIE, keep):
            if ordered:
                break
            continue
        i, j = int(w[at + 1]), int(w[at + 2])
        w[at], w[at + 1], w[at + 2] = w[OPEN + 3 * n], w[OPEN + 3 * n + 1], w[OPEN + 3 * n + 2]
        kept = _search_cell(ground, w, i, j, far_x, far_y, follow, found, count)
        if kept >= 0:
            count = kept
        elif covers_cell(w, i, j, dx, dy):
            missing = True
    return count, missing


@njit
def least_gap(
    ground: Ground,
    w: Array,
    sine: float,
    cosine: float,
    s: float,
    whole: bool,
    keep: float,
    lowest: Array,
    contacts: Array,
) -> tuple[int, int]:
    """Search the whole tread of a wheel for its smallest gap, or track a contact in its cell.

    A cell of missing data counts only if a point of the tread lies over its inside. The search then continues over the
    known cells, so that a solver can pass over missing data on its way.

    Args:
        ground: terrain.
        w: (WHEEL_SIZE,) wheel; its scratch is written.
        sine, cosine, s: a first guess, which only saves time.
        whole: True to search the whole tread; False for the guess's cell only and, there, the same part of the tread.
        keep: m, list local minima of gap <= keep.
        lowest: (CONTACT_SIZE,) filled with the lowest point; its gap is infinite if no known cell lies under the tread.
        contacts: (n, CONTACT_SIZE) filled with the local minima listed.

    Returns:
        FOUND, OFF (the map ends under the tread) or BLANK (missing data under it), and the number of minima listed.
    """
    grid, upper_bound, meta = ground
    r, half = w[RADIUS], w[HALF]
    dx, dy = meta[META_DX], meta[META_DY]
    out_x = half * abs(w[AX]) + r * math.sqrt(w[EX] * w[EX] + w[UX] * w[UX])
    out_y = half * abs(w[AY]) + r * math.sqrt(w[EY] * w[EY] + w[UY] * w[UY])
    code = FOUND
    if not (on_map(meta, w[HX] - out_x, w[HY] - out_y) and on_map(meta, w[HX] + out_x, w[HY] + out_y)):
        code = OFF
        if not (abs(w[HX]) < math.inf and abs(w[HY]) < math.inf):
            lowest[GAP] = math.inf
            return OFF, 0
    smooth = half == 0.0 and keep < 0.0 and r * meta[META_MAX_CURVATURE] < SMOOTH
    if smooth and code == FOUND and follow_smooth(grid, meta, w, sine, cosine, lowest):
        return FOUND, 0
    found = Minima(lowest, keep, contacts)
    # a tracked contact is searched in its cell alone
    lowest[GAP] = gap_at(grid, meta, w, sine, cosine, s) if whole else math.inf
    lowest[SIN], lowest[COSINE], lowest[PLACE] = sine, cosine, s
    if math.isnan(lowest[GAP]) or code == OFF:
        lowest[GAP] = math.inf
    i0, j0, i1, j1 = 0, 0, int(meta[META_NX]) - 2, int(meta[META_NY]) - 2
    if whole:
        i0, i1 = cells_within(w[HX] - out_x, w[HX] + out_x, dx, i1)
        j0, j1 = cells_within(w[HY] - out_y, w[HY] + out_y, dy, j1)
        if i0 > i1 or j0 > j1:
            lowest[GAP] = math.inf
            return OFF, 0
    # cells are searched slightly beyond the wheel's reach: rounding could otherwise lose a rim that ends at it
    far_x, far_y = 1.001 * out_x, 1.001 * out_y
    # the cell of the first guess comes first: its minimum bounds the others
    tangent_plane(w, sine)
    px, py, _ = tread_point(w, sine, cosine, s)
    wi = min(max(int(math.floor((w[HX] + px) / dx)), i0), i1)
    wj = min(max(int(math.floor((w[HY] + py) / dy)), j0), j1)
    w[OPEN], w[OPEN + 1], w[OPEN + 2] = -math.inf, wi, wj
    opened, count, first = 1, 0, True
    j, i, last = j0 - 1, 0, -1
    while True:
        if first or opened > ROW or j > j1:
            count, missing = _search_open(ground, w, far_x, far_y, not whole, opened, found, count)
            opened = 0
            if missing and code == FOUND:
                code = BLANK
            if j > j1 or not whole:
                break
            if first:
                first = False
                tangent_plane(w, lowest[SIN])
        if i > last:
            j += 1
            if j <= j1:
                i, last = columns_under(w, j, dx, dy, i0, i1)
            continue
        n = min(last - i + 1, ROW)
        _bound_row(upper_bound, j, i, n, dx, dy, far_x, far_y, w)
        limit = max(lowest[GAP] - GAP_TIE, keep)
        for k in range(n):
            low, at = w[BOUND + k], OPEN + 3 * opened
            if not low >= limit and (j != wj or i + k != wi):
                w[at], w[at + 1], w[at + 2] = low if low == low else -math.inf, i + k, j
                opened += 1
        i += n
    if lowest[GAP] == math.inf and not whole:
        lowest[GAP] = gap_at(grid, meta, w, sine, cosine, s)
        if math.isnan(lowest[GAP]):
            lowest[GAP] = math.inf
    if lowest[GAP] == math.inf and code == FOUND:
        code = BLANK
    return code, count
