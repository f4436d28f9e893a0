"""The least height of one wheel's tread over the ground, over the whole tread.

The ground's cells under the tread are bounded row by row: the tread's lower side T is convex, so it nowhere lies below
its tangent planes, and the ground nowhere above its `roof`. Only a cell where the two leave room for a lower gap than
the best so far is searched, exactly (`flat_cell`, `curved_cell`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .curved_cell import follow_smooth, search_curved_cell
from .flat_cell import HAIR, TIE, search_flat_cell
from .ground import META_BEND, META_CUBIC, META_DX, META_DY, META_NX, META_NY, on_map
from .jit import inlined, njit
from .wheel import (
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
)  # fmt: skip

Array = NDArray[np.float64]
Ground = tuple[Array, Array, Array]  # grid, roof, meta

ROOM = 12  # touching places kept of one wheel
FOUND, OFF, BLANK = 0, 1, 2
SMOOTH = 0.7  # ground whose bend times the wheel's radius is less touches a thin disc in one place only
LEAN = 0.5  # as long as the wheel leans by no more than this (sine)


@njit
def _bound_row(
    roof: Array, j: int, i: int, n: int, hub_x: float, y: float, dx: float, dy: float, w: Array, reach_u: float, reach_v: float,
) -> None:  # fmt: skip
    """bound[:n]: no gap over the cells i.. of row j is lower; inf beside the tread, nan where the ground is unknown.

    The greater of two bounds: by the tangent plane of T over the cell's middle, and by that at the best contact so far
    (`tangent_plane`), which is sharp where the ground is smooth.
    """
    level, plane_x, plane_y = w[PLANE], w[PLANE + 1], w[PLANE + 2]
    bound = w[BOUND:]
    r, ex, ey, vx, vy, tan, hub_z = w[RADIUS], w[EX], w[EY], w[VX], w[VY], w[TAN], w[HZ]
    over = 1.0 / w[COS]
    edge = 0.98 * r
    square = r * r
    half_x, half_y = 0.5 * dx, 0.5 * dy
    bx, by = plane_x * half_x, plane_y * half_y
    for k in range(n):
        x = (i + k + 0.5) * dx - hub_x
        u, v = x * ex + y * ey, x * vx + y * vy
        a, b, d, e = roof[j, i + k], roof[j, i + k + 1], roof[j + 1, i + k], roof[j + 1, i + k + 1]
        ut = min(max(u, -edge), edge)
        q = math.sqrt(square - ut * ut)
        slope = ut / q * over
        gx, gy = (slope * ex + tan * vx) * half_x, (slope * ey + tan * vy) * half_y
        first = hub_z - q * over + slope * (u - ut) + tan * v - max(max(a + gx + gy, b - gx + gy), max(d + gx - gy, e - gx - gy))
        second = level + plane_x * x + plane_y * y - max(max(a + bx + by, b - bx + by), max(d + bx - by, e - bx - by))
        low = max(first, second) + 0.0 * (a + b + d + e)
        bound[k] = low if abs(u) <= reach_u and abs(v) <= reach_v else math.inf


@inlined
def tangent_plane(w: Array, sine: float) -> None:
    """The plane that touches T at u = r sin φ: p0 + p1 X + p2 Y from the hub. T lies nowhere below it."""
    r = w[RADIUS]
    u = min(max(r * sine, -0.999 * r), 0.999 * r)
    q = math.sqrt(r * r - u * u)
    slope = u / (q * w[COS])
    w[PLANE] = w[HZ] - q / w[COS] - slope * u
    w[PLANE + 1], w[PLANE + 2] = slope * w[EX] + w[TAN] * w[VX], slope * w[EY] + w[TAN] * w[VY]


@njit
def _search_cell(
    ground: Ground, w: Array, i: int, j: int, out_x: float, out_y: float, follow: bool, keep: float,
    best: Array, found: Array, count: int,
) -> int:  # fmt: skip
    """Note the local minima over the cell (i, j); -1 if its ground is unknown."""
    grid, _, meta = ground
    dx, dy = meta[META_DX], meta[META_DY]
    x0, y0 = i * dx - w[HX], j * dy - w[HY]
    if meta[META_CUBIC] != 0.0:
        # a cell larger than the wheel is searched where the wheel is, and a little beyond: a rim that only just
        # reaches its own bounds would else be lost to rounding
        far_x, far_y = 1.001 * out_x, 1.001 * out_y
        return search_curved_cell(
            grid, meta, w, i, j, max(x0, -far_x), min(x0 + dx, far_x), max(y0, -far_y), min(y0 + dy, far_y),
            best, keep, found, count,
        )  # fmt: skip
    a, b, d, e = grid[j, i], grid[j, i + 1], grid[j + 1, i], grid[j + 1, i + 1]
    if math.isnan(a + b + d + e):
        return -1
    return search_flat_cell(w, a, b, d, e, x0, y0, dx, dy, follow, best, keep, found, count)


@njit
def least_gap(
    ground: Ground,
    w: Array,
    sine: float,
    cosine: float,
    s: float,
    whole: bool,
    keep: float,
    best: Array,
    found: Array,
) -> tuple[int, int]:
    """Search the whole tread of wheel `w`. (φ, s) is a first guess; it only saves time. Unless `whole`, only the guess's
    cell is searched, and there what is like it: a contact is followed so between steps, to be proved in the end.

    Fills `best` (PLACE_SIZE,) and `found` with the local minima of gap ≤ keep. Returns FOUND, OFF (the map ends under
    the tread) or BLANK (unknown ground under it), and how many were kept.
    """
    grid, roof, meta = ground
    r, half = w[RADIUS], w[HALF]
    dx, dy = meta[META_DX], meta[META_DY]
    out_x = half * abs(w[AX]) + r * math.sqrt(w[EX] * w[EX] + w[UX] * w[UX])
    out_y = half * abs(w[AY]) + r * math.sqrt(w[EY] * w[EY] + w[UY] * w[UY])
    if not (on_map(meta, w[HX] - out_x, w[HY] - out_y) and on_map(meta, w[HX] + out_x, w[HY] + out_y)):
        return OFF, 0
    smooth = half == 0.0 and keep < 0.0 and r * meta[META_BEND] < SMOOTH and abs(w[AZ]) < LEAN
    if smooth and follow_smooth(grid, meta, w, sine, cosine, best):
        return FOUND, 0
    best[GAP], best[SIN], best[COSINE], best[PLACE] = gap_at(grid, meta, w, sine, cosine, s), sine, cosine, s
    last_i, last_j = int(meta[META_NX]) - 2, int(meta[META_NY]) - 2
    i0, i1 = min(int(math.floor((w[HX] - out_x) / dx)), last_i), min(int(math.floor((w[HX] + out_x) / dx)), last_i)
    j0, j1 = min(int(math.floor((w[HY] - out_y) / dy)), last_j), min(int(math.floor((w[HY] + out_y) / dy)), last_j)
    hair = HAIR * (dx + dy)
    reach_u = r + 0.5 * (dx * abs(w[EX]) + dy * abs(w[EY])) + hair
    reach_v = half * w[COS] + r * abs(w[AZ]) + 0.5 * (dx * abs(w[VX]) + dy * abs(w[VY])) + hair
    count = 0
    tangent_plane(w, best[SIN])
    # the cell of the first guess comes first: what it yields bounds the others
    px, py, _ = tread_point(w, sine, cosine, s)
    wi = min(max(int(math.floor((w[HX] + px) / dx)), i0), i1)
    wj = min(max(int(math.floor((w[HY] + py) / dy)), j0), j1)
    count = _search_cell(ground, w, wi, wj, out_x, out_y, not whole, keep, best, found, count)
    if count < 0 or (not whole and math.isnan(best[GAP])):
        return BLANK, 0
    if not whole:
        return FOUND, count
    tangent_plane(w, best[SIN])
    for j in range(j0, j1 + 1):
        y = (j + 0.5) * dy - w[HY]
        for i in range(i0, i1 + 1, ROW):
            n = min(i1 - i + 1, ROW)
            _bound_row(roof, j, i, n, w[HX], y, dx, dy, w, reach_u, reach_v)
            for k in range(n):
                if not w[BOUND + k] >= max(best[GAP] - TIE, keep) and (j != wj or i + k != wi):
                    count = _search_cell(ground, w, i + k, j, out_x, out_y, False, keep, best, found, count)
                    if count < 0:
                        return BLANK, 0
    if math.isnan(best[GAP]):
        return BLANK, 0
    return FOUND, count


@njit
def patches(ground: Ground, w: Array, found: Array, count: int, keep: float) -> int:
    """How many separate places of the tread touch: two are one when the tread between them touches too."""
    grid, _, meta = ground
    n = 0
    for i in range(count):
        fresh = True
        for j in range(i):
            s, c = found[i, SIN] + found[j, SIN], found[i, COSINE] + found[j, COSINE]
            size = math.sqrt(s * s + c * c)
            apart = abs(found[i, SIN] - found[j, SIN]) * w[RADIUS] + abs(found[i, PLACE] - found[j, PLACE])
            if apart < 1e-4 * w[RADIUS]:
                fresh = False
            elif size > 0.0:
                place = 0.5 * (found[i, PLACE] + found[j, PLACE])
                fresh &= gap_at(grid, meta, w, s / size, c / size, place) > keep
        n += fresh
    return n
