"""Bridging of missing data under one rover, so that a search can pass over it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit, specialize_on_ground
from ..jit.raw_views import window
from .ground import META_CUBIC, META_DX, META_DY, META_NX, META_NY, CubicGround, Ground, LinearGround

Array = NDArray[np.float64]


@njit
def cells_around(ground: Ground, x: float, y: float, reach: float) -> tuple[int, int, int, int]:
    """Return the range of cells within a distance of a point along both axes.

    Args:
        ground: terrain.
        x, y: m, the point from the map's first node.
        reach: m, the distance.

    Returns:
        First column, one past the last, first row, one past the last; empty (0, 0, 0, 0) if no cell of the map is that near.
    """
    meta = ground.meta
    low_i, high_i = math.floor((x - reach) / meta[META_DX]), math.floor((x + reach) / meta[META_DX])
    low_j, high_j = math.floor((y - reach) / meta[META_DY]), math.floor((y + reach) / meta[META_DY])
    if not (high_i >= 0.0 and low_i <= meta[META_NX] - 2.0 and high_j >= 0.0 and low_j <= meta[META_NY] - 2.0):
        return 0, 0, 0, 0
    i0, i1 = int(max(low_i, 0.0)), int(min(high_i, meta[META_NX] - 2.0)) + 1
    j0, j1 = int(max(low_j, 0.0)), int(min(high_j, meta[META_NY] - 2.0)) + 1
    return i0, i1, j0, j1


@owning_njit
def bridged_grid(ground: Ground, i0: int, i1: int, j0: int, j1: int) -> tuple[Array, int]:
    """Return a copy of the grid values of some cells, with missing values replaced.

    A missing value becomes that of the nearest known one in its row, or, if the row has none, in its column after that; 0 (the
    datum) if there is none at all. Cells without missing data are unchanged. The copy depends on these cells alone, so a
    window of a map gives the same as the whole map.

    Args:
        ground: terrain.
        i0, i1, j0, j1: first column, one past the last, first row and one past the last of the cells.

    Returns:
        Values (j1 - j0 + r, i1 - i0 + r), m, nodes of bilinear terrain with r = 1 or coefficients of cubic terrain with r = 3,
        and the number of values that were missing.
    """
    ring = 3 if ground.meta[META_CUBIC] != 0.0 else 1  # values that a cell has beyond its first, along each axis
    rows, cols = j1 - j0 + ring, i1 - i0 + ring
    z = np.empty((rows, cols))
    missing = 0
    for j in range(rows):
        for i in range(cols):
            z[j, i] = ground.grid[j0 + j, i0 + i]
            missing += math.isnan(z[j, i])
    if missing > 0:
        for j in range(rows):
            _fill_from_nearest(z[j])
        for i in range(cols):
            _fill_from_nearest(z[:, i])
        for j in range(rows):
            for i in range(cols):
                if math.isnan(z[j, i]):
                    z[j, i] = 0.0
    return z, missing


@njit
def _fill_from_nearest(line: Array) -> None:
    """Replace each NaN of a line by its nearest known value, the earlier if two tie.

    Args:
        line: (n,) values; changed, unless all of them are NaN.
    """
    n = line.shape[0]
    last = -1  # index of the last known value
    for k in range(n + 1):
        if k < n and math.isnan(line[k]):
            continue
        if k < n or last >= 0:
            for m in range(last + 1, k):
                nearer_to_last = last >= 0 and (k == n or m - last <= k - m)
                line[m] = line[last] if nearer_to_last else line[k]
        last = k


def with_grid(ground: Ground, grid: Array, row: int, col: int) -> Ground:
    """Return packed terrain that reads its heights from a small patch around one cell.

    The result holds a view of `grid`, so `grid` must exist as long as the result is used. Only cells whose nodes or
    coefficients are in the patch may be read.

    Args:
        ground: packed terrain; its upper bound and header are used.
        grid: (rows, cols) the patch: node heights (bilinear) or spline coefficients (cubic), m.
        row, col: the cell of the map whose first node or coefficient is grid[0, 0].

    Returns:
        Packed terrain of the same kind, with rows and columns numbered as those of `ground`.
    """
    return _with_grid_of(type(ground))(ground, grid, row, col)


@specialize_on_ground(with_grid)
def _with_grid_of(kind: type) -> Any:
    """Return `with_grid` for one kind of terrain.

    Args:
        kind: CubicGround or LinearGround.
    """

    def on_cubic(ground: Ground, grid: Array, row: int, col: int) -> Ground:
        """Return cubic terrain with another grid.

        Args:
            ground, grid, row, col: as `with_grid` takes them.
        """
        # The upper bound is infinite beside missing data and otherwise that of the known cells: it holds for this grid.
        return CubicGround(window(grid, row, col), ground.upper_bound, ground.meta)

    def on_linear(ground: Ground, grid: Array, row: int, col: int) -> Ground:
        """Return bilinear terrain with another grid.

        Args:
            ground, grid, row, col: as `with_grid` takes them.
        """
        return LinearGround(window(grid, row, col), window(grid, row, col), ground.meta)

    return on_cubic if kind is CubicGround else on_linear
