"""Terrain evaluation for the verification of gaps, independent of the kernels that settle.

Only the layout of the data is shared with them: the indices `META_*`, and the grid, which holds the nodes of bilinear
terrain, or the coefficients of a C2 tensor-product cubic B-spline with one ring around the map. Positions are measured
from the map's first node, heights from `META_Z`, both in m. `docs/verification.md` derives every bound used here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.ground import META_COL, META_CUBIC, META_DX, META_DY, META_NX, META_NY, META_ROW

Array = NDArray[np.float64]

#: A point this close to a known cell counts as lying over it, m.
BORDER = 1e-9
# Row of the curvature array: middle and half range of h_xx, h_xy, h_yy.
MXX, DXX, MXY, DXY, MYY, DYY = range(6)
CURVATURE_SIZE = 6


class Field(NamedTuple):
    """Terrain as the verification reads it.

    Cells are numbered over the whole map; the window has cells first to last.
    """

    grid: Array
    cubic: bool
    dx: float
    dy: float
    first_col: int
    last_col: int
    first_row: int
    last_row: int
    width: float
    depth: float


class Cells(NamedTuple):
    """Range of cells: first and last column, first and last row."""

    i0: int
    i1: int
    j0: int
    j1: int


@owning_njit
def make_field(grid: Array, meta: Array) -> Field:
    """Return the terrain's grid with its spacing and the range of cells it holds.

    Args:
        grid: (rows, cols) nodes, or (rows + 2, cols + 2) B-spline coefficients, m.
        meta: (META_SIZE,) map header.

    Returns:
        Field; width and depth are the map's size along x and y, m.
    """
    cubic = meta[META_CUBIC] != 0.0
    ring = 3 if cubic else 1
    row, col = int(meta[META_ROW]), int(meta[META_COL])
    dx, dy = meta[META_DX], meta[META_DY]
    return Field(
        grid, cubic, dx, dy, col, col + grid.shape[1] - ring - 1, row, row + grid.shape[0] - ring - 1,
        (meta[META_NX] - 1.0) * dx, (meta[META_NY] - 1.0) * dy,
    )  # fmt: skip


@njit
def cell_index(position: float, step: float, first: int, last: int) -> int:
    """Return the index of the cell that holds a position, limited to first..last.

    Args:
        position: from the map's first node, m.
        step: node spacing, m.
        first: the lowest index allowed.
        last: the highest index allowed.

    Returns:
        Cell index.
    """
    g = math.floor(position / step)
    return int(min(max(g, float(first)), float(last)))


@njit
def cell_known(field: Field, i: int, j: int) -> bool:
    """Return True if cell (column i, row j) has no missing data; False outside the window.

    Args:
        field: the terrain.
        i: column of the cell.
        j: row of the cell.

    Returns:
        True if all 4 nodes (bilinear) or all 16 coefficients (cubic) are finite.
    """
    if i < field.first_col or i > field.last_col or j < field.first_row or j > field.last_row:
        return False
    size = 4 if field.cubic else 2
    for m in range(size):
        for n in range(size):
            if not math.isfinite(field.grid[j - field.first_row + m, i - field.first_col + n]):
                return False
    return True


@njit
def surface_in_cell(field: Field, i: int, j: int, x: float, y: float) -> tuple[float, float, float, float, float, float]:
    """Evaluate the polynomial of one cell, continued beyond the cell.

    Args:
        field: the terrain.
        i: column of the cell.
        j: row of the cell.
        x: position, m.
        y: position, m.

    Returns:
        h (m), h_x, h_y (-), h_xx, h_xy, h_yy (1/m).
    """
    grid, dx, dy = field.grid, field.dx, field.dy
    u, v = x / dx - i, y / dy - j
    col, row = i - field.first_col, j - field.first_row
    if not field.cubic:
        a, east = grid[row, col], grid[row, col + 1] - grid[row, col]
        north, twist = grid[row + 1, col] - a, grid[row + 1, col + 1] - grid[row + 1, col] - east
        return (
            a + u * east + v * (north + u * twist), (east + v * twist) / dx, (north + u * twist) / dy,
            0.0, twist / (dx * dy), 0.0,
        )  # fmt: skip
    # Differences of a row's coefficients: c(u) = k0 + k1 u + k2 u^2 / 2 + k3 u^3 / 6 in each row, then the same along y.
    f0 = f1 = f2 = f3 = fx0 = fx1 = fx2 = fx3 = fxx0 = fxx1 = fxx2 = fxx3 = 0.0
    for m in range(4):
        a, b, c, d = grid[row + m, col], grid[row + m, col + 1], grid[row + m, col + 2], grid[row + m, col + 3]
        k0, k1, k2, k3 = (a + 4.0 * b + c) / 6.0, (c - a) / 2.0, a - 2.0 * b + c, (d - a) + 3.0 * (b - c)
        value = k0 + u * (k1 + u * (k2 / 2.0 + u * k3 / 6.0))
        slope, curvature = k1 + u * (k2 + u * k3 / 2.0), k2 + u * k3
        if m == 0:
            f0, fx0, fxx0 = value, slope, curvature
        elif m == 1:
            f1, fx1, fxx1 = value, slope, curvature
        elif m == 2:
            f2, fx2, fxx2 = value, slope, curvature
        else:
            f3, fx3, fxx3 = value, slope, curvature
    k1, k2, k3 = (f2 - f0) / 2.0, f0 - 2.0 * f1 + f2, (f3 - f0) + 3.0 * (f1 - f2)
    h = (f0 + 4.0 * f1 + f2) / 6.0 + v * (k1 + v * (k2 / 2.0 + v * k3 / 6.0))
    hy, hyy = k1 + v * (k2 + v * k3 / 2.0), k2 + v * k3
    k1, k2, k3 = (fx2 - fx0) / 2.0, fx0 - 2.0 * fx1 + fx2, (fx3 - fx0) + 3.0 * (fx1 - fx2)
    hx = (fx0 + 4.0 * fx1 + fx2) / 6.0 + v * (k1 + v * (k2 / 2.0 + v * k3 / 6.0))
    hxy = k1 + v * (k2 + v * k3 / 2.0)
    k1, k2, k3 = (fxx2 - fxx0) / 2.0, fxx0 - 2.0 * fxx1 + fxx2, (fxx3 - fxx0) + 3.0 * (fxx1 - fxx2)
    hxx = (fxx0 + 4.0 * fxx1 + fxx2) / 6.0 + v * (k1 + v * (k2 / 2.0 + v * k3 / 6.0))
    return h, hx / dx, hy / dy, hxx / (dx * dx), hxy / (dx * dy), hyy / (dy * dy)


@njit
def cell_at(field: Field, x: float, y: float, missing: bool) -> tuple[int, int, bool]:
    """Return a known cell that holds a point or lies within 2 `BORDER` of it.

    Args:
        field: the terrain.
        x: position, m.
        y: position, m.
        missing: True if data may be missing near here.

    Returns:
        Column, row, and False if no such cell is known.
    """
    i = cell_index(x, field.dx, field.first_col, field.last_col)
    j = cell_index(y, field.dy, field.first_row, field.last_row)
    if not missing or cell_known(field, i, j):
        return i, j, True
    for side in range(4):
        px = x + (2.0 * BORDER if side % 2 else -2.0 * BORDER)
        py = y + (2.0 * BORDER if side // 2 else -2.0 * BORDER)
        k = cell_index(px, field.dx, field.first_col, field.last_col)
        m = cell_index(py, field.dy, field.first_row, field.last_row)
        if cell_known(field, k, m):
            return k, m, True
    return i, j, False


@njit
def survey(field: Field, i0: int, i1: int, j0: int, j1: int) -> tuple[bool, float, float]:
    """Scan the data under cells i0..i1, j0..j1 of the window.

    Args:
        field: the terrain.
        i0: first column.
        i1: last column.
        j0: first row.
        j1: last row.

    Returns:
        True if data are missing; the largest |node| or |coefficient|, m; a bound of |h_x| + |h_y|.
    """
    grid, more = field.grid, 3 if field.cubic else 1
    missing, highest, rise_x, rise_y = False, 0.0, 0.0, 0.0
    for m in range(j0 - field.first_row, j1 - field.first_row + more + 1):
        for n in range(i0 - field.first_col, i1 - field.first_col + more + 1):
            value = grid[m, n]
            if not math.isfinite(value):
                missing = True
                continue
            highest = max(highest, abs(value))
            if n > i0 - field.first_col:
                rise = abs(value - grid[m, n - 1])
                if rise > rise_x:
                    rise_x = rise
            if m > j0 - field.first_row:
                rise = abs(value - grid[m - 1, n])
                if rise > rise_y:
                    rise_y = rise
    return missing, highest, rise_x / field.dx + rise_y / field.dy


@njit
def height_above_plane(field: Field, cells: Cells, x: float, y: float, h: float, hx: float, hy: float) -> tuple[float, float]:
    """Bound the terrain over some cells from above, by a plane and by a horizontal plane.

    Args:
        field: the terrain.
        cells: the cells.
        x: a point of the plane, m.
        y: the same.
        h: the plane's height at (x, y), m.
        hx: the plane's slope along x.
        hy: the same along y.

    Returns:
        a with h(x', y') <= h + hx (x' - x) + hy (y' - y) + a over the known cells, and b with h(x', y') <= b, both m.
    """
    grid = field.grid
    i0, i1, j0, j1 = cells
    more, ring = (3, 1) if field.cubic else (1, 0)
    above, top = -math.inf, -math.inf
    for m in range(j0, j1 + more + 1):
        level = h + hy * ((m - ring) * field.dy - y)
        for n in range(i0, i1 + more + 1):
            value = grid[m - field.first_row, n - field.first_col]
            if value > top:
                top = value
            value -= level + hx * ((n - ring) * field.dx - x)
            if value > above:
                above = value
    return above, top


@njit
def bound_curvature(field: Field, cells: Cells, rx: float, ry: float, middle: tuple[float, float, float], out: Array) -> None:
    """Write ranges of h_xx, h_xy, h_yy of cubic terrain over a rectangle.

    Each range is the intersection of two: the extremes of the coefficients' second differences, and the value at the
    rectangle's middle plus or minus the largest third differences times the half sides.

    Args:
        field: cubic terrain.
        cells: cells that hold the rectangle.
        rx: half side of the rectangle along x, m.
        ry: half side along y, m.
        middle: h_xx, h_xy, h_yy at the rectangle's middle, 1/m.
        out: (CURVATURE_SIZE,) receives the middle and half range of each, 1/m.
    """
    c, dx, dy = field.grid, field.dx, field.dy
    i0, i1, j0, j1 = cells
    hxx, hxy, hyy = middle
    a0, a1, b0, b1 = i0 - field.first_col, i1 - field.first_col, j0 - field.first_row, j1 - field.first_row
    lxx = lxy = lyy = math.inf
    uxx = uxy = uyy = -math.inf
    xxx = xxy = xyy = yyy = 0.0
    for m in range(b0, b1 + 4):
        for n in range(a0, a1 + 2):
            d = (c[m, n] - c[m, n + 1]) - (c[m, n + 1] - c[m, n + 2])
            if d < lxx:
                lxx = d
            if d > uxx:
                uxx = d
            if m < b1 + 3:
                e = abs((c[m + 1, n] - c[m + 1, n + 1]) - (c[m + 1, n + 1] - c[m + 1, n + 2]) - d)
                if e > xxy:
                    xxy = e
            if n < a1 + 1:
                e = abs((c[m, n + 1] - c[m, n + 2]) - (c[m, n + 2] - c[m, n + 3]) - d)
                if e > xxx:
                    xxx = e
    for m in range(b0, b1 + 2):
        for n in range(a0, a1 + 4):
            d = (c[m, n] - c[m + 1, n]) - (c[m + 1, n] - c[m + 2, n])
            if d < lyy:
                lyy = d
            if d > uyy:
                uyy = d
            if n < a1 + 3:
                e = abs((c[m, n + 1] - c[m + 1, n + 1]) - (c[m + 1, n + 1] - c[m + 2, n + 1]) - d)
                if e > xyy:
                    xyy = e
            if m < b1 + 1:
                e = abs((c[m + 1, n] - c[m + 2, n]) - (c[m + 2, n] - c[m + 3, n]) - d)
                if e > yyy:
                    yyy = e
    for m in range(b0, b1 + 3):
        for n in range(a0, a1 + 3):
            d = (c[m, n] - c[m, n + 1]) - (c[m + 1, n] - c[m + 1, n + 1])
            if d < lxy:
                lxy = d
            if d > uxy:
                uxy = d
    u, v, xx, xy, yy = rx / dx, ry / dy, dx * dx, dx * dy, dy * dy
    spread_range(out, MXX, lxx / xx, uxx / xx, hxx, (xxx * u + xxy * v) / xx)
    spread_range(out, MXY, lxy / xy, uxy / xy, hxy, (xxy * u + xyy * v) / xy)
    spread_range(out, MYY, lyy / yy, uyy / yy, hyy, (xyy * u + yyy * v) / yy)


@njit
def spread_range(out: Array, at: int, low: float, high: float, value: float, change: float) -> None:
    """Write the middle and half of [low, high] intersected with value ± change.

    Args:
        out: filled with them at indices `at` and `at` + 1.
        at: index.
        low: lower end.
        high: upper end.
        value: middle of the second range.
        change: half of the second range.
    """
    low, high = max(low, value - change), min(high, value + change)
    out[at], out[at + 1] = 0.5 * (low + high), max(0.5 * (high - low), 0.0)
