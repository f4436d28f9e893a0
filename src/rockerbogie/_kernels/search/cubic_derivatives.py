"""Bounds on the derivatives of the spline over parts of its cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import META_DX, META_DY
from .cubic_patch import XX_HIGH, XY_HIGH, YY_HIGH, bound_differences, bound_patch

Array = NDArray[np.float64]

XX, XY, YY = 0, 2, 4  # lowest and highest second derivatives
DERIVATIVES_SIZE = 6
THINNEST = 1e-3  # of a cell: a rectangle is not made smaller along either axis, as differences are divided by its square


@njit
def second_derivatives(
    grid: Array, i: int, j: int, dx: float, dy: float, west: float, east: float, south: float, north: float,
    patch: Array, derivatives: Array,
) -> bool:  # fmt: skip
    """Bound the spline's second derivatives over the part of a rectangle that lies in a cell.

    Args:
        grid: coefficients, m.
        i, j: column and row of the cell.
        dx, dy: m, node spacing.
        west, east, south, north: m, sides of the rectangle from the cell's low corner.
        patch: (BOUNDS_SIZE,) scratch.
        derivatives: (DERIVATIVES_SIZE,) filled, 1/m.

    Returns:
        False if a coefficient is missing.
    """
    u0, v0 = min(max(west / dx, 0.0), 1.0 - THINNEST), min(max(south / dy, 0.0), 1.0 - THINNEST)
    u1, v1 = min(max(east / dx, u0 + THINNEST), 1.0), min(max(north / dy, v0 + THINNEST), 1.0)
    wide, tall = (u1 - u0) * dx, (v1 - v0) * dy
    low = bound_patch(grid, i, j, u0, u1, v0, v1, wide, tall, 0.0, 0.0, 0.0, patch)
    bound_differences(patch)
    for k in range(2):
        derivatives[XX + k] = -6.0 * patch[XX_HIGH - k] / (wide * wide)
        derivatives[XY + k] = -9.0 * patch[XY_HIGH - k] / (wide * tall)
        derivatives[YY + k] = -6.0 * patch[YY_HIGH - k] / (tall * tall)
    return low == low


@njit
def greatest_slope(grid: Array, meta: Array, i0: int, i1: int, j0: int, j1: int) -> float:
    """Return an upper bound of the slope of the spline over a block of cells.

    It follows from differences of neighbouring coefficients.

    Args:
        grid: coefficients, m.
        meta: (META_SIZE,) map header.
        i0, i1, j0, j1: first and last column, first and last row of the cells.

    Returns:
        m/m; NaN if a coefficient is missing.
    """
    along_x = along_y = total = 0.0
    for j in range(j0, j1 + 4):
        for i in range(i0, i1 + 4):
            c = grid[j, i]
            total += c
            if i < i1 + 3:
                along_x = max(along_x, abs(grid[j, i + 1] - c))
            if j < j1 + 3:
                along_y = max(along_y, abs(grid[j + 1, i] - c))
    along_x, along_y = along_x / meta[META_DX], along_y / meta[META_DY]
    return math.sqrt(along_x * along_x + along_y * along_y) + 0.0 * total
