"""Cells of the grid under the tread of a wheel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.tolerances import CELL_MARGIN
from ..model.wheel import AZ, COS, EX, EY, HALF, HX, HY, RADIUS, VX, VY, covers

Array = NDArray[np.float64]

LANES = 4  # cells that a SIMD register holds


@inlined
def cells_within(low: float, high: float, step: float, last: int) -> tuple[int, int]:
    """Return the first and last cell of an axis that an interval reaches.

    The first is greater if it reaches none.

    Args:
        low, high: m from the map's first node.
        step: m, node spacing.
        last: index of the axis's last cell.
    """
    if high < 0.0 or low > (last + 1) * step:
        return last + 1, last
    return int(min(max(math.floor(low / step), 0.0), last)), int(min(math.floor(high / step), last))


@inlined
def columns_under(w: Array, j: int, dx: float, dy: float, i0: int, i1: int) -> tuple[int, int]:
    """Return the first and last cell of a row that reach under the tread.

    Their number is rounded up to whole SIMD registers, as a part of one takes longer than a whole one.

    Args:
        w: (WHEEL_SIZE,) wheel.
        j: row.
        dx, dy: m, node spacing.
        i0, i1: first and last column to return.

    Returns:
        The first and last column; the first is greater if none reaches under the tread.
    """
    half_y, margin = 0.5 * dy, CELL_MARGIN * (dx + dy)
    y = j * dy + half_y - w[HY]
    low, high = -math.inf, math.inf
    for axis in range(2):  # the tread lies in a strip along its direction of travel, and in one along its axle
        if axis == 0:
            px, py, reach = w[EX], w[EY], w[RADIUS] + margin
        else:
            px, py, reach = w[VX], w[VY], w[HALF] * w[COS] + w[RADIUS] * abs(w[AZ]) + margin
        over = 1.0 / math.copysign(max(abs(px), 1e-12), px)
        middle, around = -y * py * over, (reach + half_y * abs(py)) * abs(over)
        low, high = max(low, middle - around), min(high, middle + around)
    low, high = (w[HX] + low) / dx, (w[HX] + high) / dx
    first, last = int(min(max(math.floor(low), i0), i1 + 1)), int(min(max(math.floor(high), i0 - 1), i1))
    filled = (last - first + LANES) // LANES * LANES
    first = max(min(first, i1 + 1 - filled), i0)
    return first, min(first + filled - 1, i1)


@njit
def covers_cell(w: Array, i: int, j: int, dx: float, dy: float) -> bool:
    """Return True if a point of the tread lies over the inside of cell (i, j).

    Args:
        w: (WHEEL_SIZE,) wheel.
        i, j: column and row of the cell.
        dx, dy: m, node spacing.
    """
    slack_x, slack_y = 1e-9 * dx, 1e-9 * dy
    x0, y0 = i * dx - w[HX], j * dy - w[HY]
    return covers(w, x0 + slack_x, x0 + dx - slack_x, y0 + slack_y, y0 + dy - slack_y)
