"""Height, slope and curvature of a height field at a point.

A packed terrain has `grid`, `upper_bound` and `meta`. On bilinear terrain `grid` holds the nodes. On cubic terrain it holds the
coefficients of the C2 tensor-product B-spline through them, one ring wider than the map. NaN marks missing data: each cell that
uses a NaN is missing. Positions are from the map's first node, heights from META_Z.

A terrain may be a window, the part of a map that META_ROW and META_COL give. Positions and indices stay the map's, so that a
result in a window is bit-identical to that of the map. The batch loops use `borrow`; their callers ensure that no index lies
outside the window.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, specialize_on_ground
from ..jit.raw_views import unowned_view, window

# META_MAX_CURVATURE: bound on the second derivative along any horizontal direction, 1/m; inf on bilinear terrain, and if data is
# missing.
# META_STEEP: bound on the slope of bilinear terrain; inf if data is missing, and on cubic terrain.
# META_ROW, META_COL: node at which the arrays begin; 0 if they hold the whole map.
META_X, META_Y, META_Z, META_DX, META_DY, META_NX, META_NY, META_CUBIC, META_MAX_CURVATURE, META_ROW, META_COL, META_STEEP = (
    range(12)
)
META_SIZE = 12

Array = NDArray[np.float64]


class CubicGround(NamedTuple):
    """Packed cubic terrain.

    Each kind of terrain has its own type, so that kernels are compiled without the other kind's code.
    """

    grid: Array
    upper_bound: Array
    meta: Array


class LinearGround(NamedTuple):
    """Packed bilinear terrain, with the fields of `CubicGround`."""

    grid: Array
    upper_bound: Array
    meta: Array


Ground = CubicGround | LinearGround


def borrow(ground: Ground) -> Ground:
    """Return the terrain's arrays as unowned views, indexed as the map's.

    Args:
        ground: terrain; it must outlive the result.
    """
    return _borrow_of(type(ground))(ground)


@specialize_on_ground(borrow)
def _borrow_of(kind: type) -> Any:
    """Return `borrow` for one kind of terrain.

    Args:
        kind: CubicGround or LinearGround.
    """

    def lend(ground: Ground) -> Ground:
        """Return the terrain's arrays as unowned views.

        Args:
            ground: terrain.
        """
        row, col = int(ground.meta[META_ROW]), int(ground.meta[META_COL])
        return kind(window(ground.grid, row, col), window(ground.upper_bound, row, col), unowned_view(ground.meta))

    return lend


@inlined
def cell_of(position: float, step: float, nodes: float) -> tuple[int, float]:
    """Return the cell of a position along an axis; the last node belongs to the last cell.

    Args:
        position: m from the first node.
        step: m, node spacing.
        nodes: number of nodes.

    Returns:
        Index of the cell and the position in it, 0 to 1 on the map.
    """
    g = position / step
    i = min(max(math.floor(g), 0.0), nodes - 2.0)
    return int(i), g - i


@inlined
def on_map(meta: Array, x: float, y: float) -> bool:
    """Return True if a position lies on the map, its edge included.

    Args:
        meta: (META_SIZE,) map header.
        x, y: m from the first node.
    """
    return 0.0 <= x <= (meta[META_NX] - 1.0) * meta[META_DX] and 0.0 <= y <= (meta[META_NY] - 1.0) * meta[META_DY]


@inlined
def near_map(meta: Array, x: float, y: float, far: float) -> bool:
    """Return True if a position lies on the map, or near it along each axis.

    Args:
        meta: (META_SIZE,) map header.
        x, y: m from the first node.
        far: m, the largest distance from the map.
    """
    last_x, last_y = (meta[META_NX] - 1.0) * meta[META_DX], (meta[META_NY] - 1.0) * meta[META_DY]
    return -far <= x <= last_x + far and -far <= y <= last_y + far


@inlined
def onto(position: float, step: float, nodes: float) -> float:
    """Return a position, moved to the edge of the map if it is off it by at most 1e-6 of a cell.

    Args:
        position: m from the first node.
        step: m, node spacing.
        nodes: number of nodes.
    """
    end, slack = (nodes - 1.0) * step, 1e-6 * step
    if -slack < position < 0.0:
        return 0.0
    if end < position < end + slack:
        return end
    return position


@njit
def surface(grid: Array, meta: Array, x: float, y: float) -> tuple[float, float, float, float, float, float]:
    """Compute height, slope and curvature at a point.

    Off the map the nearest cell's polynomial is continued.

    Args:
        grid: nodes or coefficients, m.
        meta: (META_SIZE,) map header.
        x, y: m from the first node.

    Returns:
        h, m above the datum, h_x, h_y, and h_xx, h_xy, h_yy, 1/m; NaN over missing data.
    """
    dx, dy = meta[META_DX], meta[META_DY]
    i, u = cell_of(x, dx, meta[META_NX])
    j, v = cell_of(y, dy, meta[META_NY])
    if meta[META_CUBIC] == 0.0:
        a, b, c, d = grid[j, i], grid[j, i + 1], grid[j + 1, i], grid[j + 1, i + 1]
        twist = a - b - c + d
        h = a + (b - a) * u + (c - a) * v + twist * u * v
        return h, (b - a + twist * v) / dx, (c - a + twist * u) / dy, 0.0, twist / (dx * dy), 0.0
    p, q = 1.0 - u, 1.0 - v
    w0, w3 = p * p * p / 6.0, u * u * u / 6.0
    w1 = (u * u * (3.0 * u - 6.0) + 4.0) / 6.0
    w2 = 1.0 - w0 - w1 - w3
    s0, s3 = -p * p / 2.0, u * u / 2.0
    s1 = u * (1.5 * u - 2.0)
    s2 = -s0 - s1 - s3
    c0, c1, c2, c3 = p, 3.0 * u - 2.0, 1.0 - 3.0 * u, u
    h0 = h1 = h2 = 0.0
    k0 = k1 = 0.0
    l0 = 0.0
    for m in range(4):
        if m == 0:
            wy, sy, cy = q * q * q / 6.0, -q * q / 2.0, q
        elif m == 1:
            wy, sy, cy = (v * v * (3.0 * v - 6.0) + 4.0) / 6.0, v * (1.5 * v - 2.0), 3.0 * v - 2.0
        elif m == 2:
            wy, sy, cy = (q * q * (3.0 * q - 6.0) + 4.0) / 6.0, -q * (1.5 * q - 2.0), 1.0 - 3.0 * v
        else:
            wy, sy, cy = v * v * v / 6.0, v * v / 2.0, v
        g0, g1, g2, g3 = grid[j + m, i], grid[j + m, i + 1], grid[j + m, i + 2], grid[j + m, i + 3]
        row = w0 * g0 + w1 * g1 + w2 * g2 + w3 * g3
        slope = s0 * g0 + s1 * g1 + s2 * g2 + s3 * g3
        curvature = c0 * g0 + c1 * g1 + c2 * g2 + c3 * g3
        h0 += wy * row
        h1 += wy * slope
        h2 += wy * curvature
        k0 += sy * row
        k1 += sy * slope
        l0 += cy * row
    return h0, h1 / dx, k0 / dy, h2 / (dx * dx), k1 / (dx * dy), l0 / (dy * dy)


@njit
def surface_batch(
    ground: Ground,
    x: Array,
    y: Array,
    out: Array,
    start: int,
    stop: int,
) -> None:
    """Compute height and slope at world points.

    Args:
        ground: terrain.
        x, y: (n,) m, in the world.
        out: (n, 3) filled with h, m, h_x and h_y; NaN off the map and over missing data.
        start, stop: range of points that this call computes.
    """
    grid, _, meta = borrow(ground)
    for k in range(start, stop):
        px = onto(x[k] - meta[META_X], meta[META_DX], meta[META_NX])
        py = onto(y[k] - meta[META_Y], meta[META_DY], meta[META_NY])
        if on_map(meta, px, py):
            h, hx, hy, _, _, _ = surface(grid, meta, px, py)
            out[k, 0], out[k, 1], out[k, 2] = h + meta[META_Z], hx, hy
        else:
            out[k, 0] = out[k, 1] = out[k, 2] = math.nan
