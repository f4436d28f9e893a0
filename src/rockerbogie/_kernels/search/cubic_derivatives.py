"""Bounds on the derivatives of the spline over one cubic cell."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit

Array = NDArray[np.float64]

# Bounds over one cell: its second derivatives, lowest and highest, and the size of its third ones.
XX, XY, YY = 0, 2, 4
XXX, XXY, XYY, YYY = range(6, 10)
DERIVATIVES_SIZE = 10


@njit
def derivative_bounds(grid: Array, i: int, j: int, dx: float, dy: float, derivatives: Array) -> bool:
    """Compute bounds on the spline's derivatives over a cell: differences of its coefficients.

    Args:
        grid: coefficients, m.
        i, j: column and row of the cell.
        dx, dy: m, node spacing.
        derivatives: (DERIVATIVES_SIZE,) filled: lowest and highest second derivatives, 1/m, and largest third ones, 1/m².

    Returns:
        False if a coefficient is missing.
    """
    total = 0.0
    for k in range(3):
        derivatives[2 * k], derivatives[2 * k + 1] = math.inf, -math.inf
    derivatives[XXX:] = 0.0
    for m in range(4):
        for n in range(4):
            row, col = j + m, i + n
            c = grid[row, col]
            total += c
            if n < 2:
                second = c - 2.0 * grid[row, col + 1] + grid[row, col + 2]
                derivatives[XX], derivatives[XX + 1] = min(derivatives[XX], second), max(derivatives[XX + 1], second)
                if n == 0:
                    derivatives[XXX] = max(
                        derivatives[XXX], abs(grid[row, col + 3] - c + 3.0 * (grid[row, col + 1] - grid[row, col + 2]))
                    )
                if m < 3:
                    above = grid[row + 1, col] - 2.0 * grid[row + 1, col + 1] + grid[row + 1, col + 2]
                    derivatives[XXY] = max(derivatives[XXY], abs(above - second))
            if m < 2:
                second = c - 2.0 * grid[row + 1, col] + grid[row + 2, col]
                derivatives[YY], derivatives[YY + 1] = min(derivatives[YY], second), max(derivatives[YY + 1], second)
                if m == 0:
                    derivatives[YYY] = max(
                        derivatives[YYY], abs(grid[row + 3, col] - c + 3.0 * (grid[row + 1, col] - grid[row + 2, col]))
                    )
                if n < 3:
                    beside = grid[row, col + 1] - 2.0 * grid[row + 1, col + 1] + grid[row + 2, col + 1]
                    derivatives[XYY] = max(derivatives[XYY], abs(beside - second))
            if m < 3 and n < 3:
                twist = c - grid[row, col + 1] - grid[row + 1, col] + grid[row + 1, col + 1]
                derivatives[XY], derivatives[XY + 1] = min(derivatives[XY], twist), max(derivatives[XY + 1], twist)
    for k in range(2):
        derivatives[XX + k] /= dx * dx
        derivatives[XY + k] /= dx * dy
        derivatives[YY + k] /= dy * dy
    derivatives[XXX] /= dx * dx * dx
    derivatives[XXY] /= dx * dx * dy
    derivatives[XYY] /= dx * dy * dy
    derivatives[YYY] /= dy * dy * dy
    return math.isfinite(total)
