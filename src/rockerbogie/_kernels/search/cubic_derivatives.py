"""Bounds on the second derivatives of the spline over a rectangle of a cubic cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
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
