"""The minimum of the gap of a tread over one cubic cell.

It lies inside the tread (`cubic_tread`), or on one of its rims (`cubic_rim`). There may be several minima in a cell.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.tolerances import CELL_MARGIN, GAP_TIE
from ..model.wheel import AZ, COS, GAP, HALF, HZ, RADIUS, SIN, VX, VY
from .cubic_rim import search_arc
from .cubic_tread import bound_part, search_inside
from .minima import Minima
from .rim_pieces import HALVES, Part, ends_of, rim_over_cell

Array = NDArray[np.float64]


@njit
def search_curved_cell(grid: Array, meta: Array, w: Array, i: int, j: int, part: Part, found: Minima, count: int) -> int:
    """Find the local minima of the gap over a part of a cubic cell.

    Args:
        grid, meta: cubic terrain (ground.py).
        w: (WHEEL_SIZE,) wheel.
        i, j: column and row of the cell.
        part: the part.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count; -1 if the cell is missing.
    """
    lowest, keep, _ = found
    x0, x1, y0, y1 = part
    ends = ends_of(w)
    x, y, rx, ry, limit = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0), max(lowest[GAP] - GAP_TIE, keep)
    low, _, _ = bound_part(grid, meta, w, 1.0, i, j, x, y, rx, ry, lowest[SIN], limit)
    if math.isnan(low):
        return -1
    if low >= limit:
        return count
    half = w[HALF]
    if half > 0.0:
        count = search_inside(grid, meta, w, i, j, 1.0, part, found, count)
        if not _upper_is_clear(grid, meta, w, -half if w[AZ] > 0.0 else half, i, j, max(lowest[GAP] - GAP_TIE, keep)):
            count = search_inside(grid, meta, w, i, j, -1.0, part, found, count)
    across = x * w[VX] + y * w[VY]
    near = rx * abs(w[VX]) + ry * abs(w[VY]) + w[RADIUS] * abs(w[AZ]) + CELL_MARGIN * (x1 - x0 + y1 - y0)
    for side in range(2 if half > 0.0 else 1):
        s = half if side == 0 else -half
        if abs(s * w[COS] - across) > near:
            continue
        for half_turn in range(2):
            sign = 1.0 if half_turn == 0 else -1.0
            if sign < 0.0 and _upper_is_clear(grid, meta, w, s, i, j, max(lowest[GAP], keep)):
                break
            n = rim_over_cell(w, s, x0, x1, y0, y1, sign, ends)
            for k in range(n):
                at = HALVES + 2 * k
                low = math.atan2(ends[at, 0], ends[at, 1])
                high = math.atan2(ends[at + 1, 0], ends[at + 1, 1])
                if high < low:
                    high += 2.0 * math.pi
                count = search_arc(grid, meta, w, i, j, s, low, high, found, count)
    return count


@njit
def _upper_is_clear(grid: Array, meta: Array, w: Array, s: float, i: int, j: int, limit: float) -> bool:
    """Return True if a rim's upper half stays above a cell.

    No spline exceeds its largest coefficient.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        s: m, position of the rim along the axle.
        i, j: column and row of the cell.
        limit: m, the gap that it must have.
    """
    top = -math.inf
    for m in range(4):
        for n in range(4):
            top = max(top, grid[j + m, i + n])
    return w[HZ] + s * w[AZ] - top >= limit
