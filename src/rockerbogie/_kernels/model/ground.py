"""Height, slope and curvature of a height field at a point.

A packed ground is (`grid`, `meta`). For linear ground `grid` holds the nodes; for cubic ground the coefficients of the
C2 tensor-product B-spline through them, one ring wider than the map. nan marks ground that is not known: it spreads
to every cell whose surface leans on it. Positions are from the map's first node, heights from `META_Z`.

A ground may be a window: part of a map, whose `META_ROW`, `META_COL` say which. Positions and indices stay the map's, so
that what is worked out in a window is what the whole map gives, to the last bit. The loops over a batch borrow it by
`borrow`; whoever calls them sees to it that nothing they read lies outside the window.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, specialize_on_ground
from ..jit.raw_views import unowned_view, window

# META_MAX_CURVATURE: no second derivative of the ground along any level direction is greater; inf where it has ridges or holes.
# META_STEEP: bilinear ground is nowhere steeper; inf where that is not known.
# META_ROW, META_COL: the node that the arrays begin at, 0 where they hold the whole map.
META_X, META_Y, META_Z, META_DX, META_DY, META_NX, META_NY, META_CUBIC, META_MAX_CURVATURE, META_ROW, META_COL, META_STEEP = (
    range(12)
)
META_SIZE = 12

Array = NDArray[np.float64]


class CubicGround(NamedTuple):
    """Ground of two kinds has two types, so that kernels are compiled for one of them without the other's code."""

    grid: Array
    upper_bound: Array
    meta: Array


class LinearGround(NamedTuple):
    """As `CubicGround`."""

    grid: Array
    upper_bound: Array
    meta: Array


Ground = CubicGround | LinearGround


def borrow(ground: Ground) -> Ground:
    """The ground's arrays by the map's indices, not counted as references to them."""
    return _loan_of(type(ground))(ground)


@specialize_on_ground(borrow)
def _loan_of(kind: type) -> Any:
    def lend(ground: Ground) -> Ground:
        row, col = int(ground.meta[META_ROW]), int(ground.meta[META_COL])
        return kind(window(ground.grid, row, col), window(ground.upper_bound, row, col), unowned_view(ground.meta))

    return lend


@inlined
def cell_of(position: float, step: float, nodes: float) -> tuple[int, float]:
    """Cell index and place in it (0..1) of a position from the first node; the last node belongs to the last cell."""
    g = position / step
    i = min(max(math.floor(g), 0.0), nodes - 2.0)
    return int(i), g - i


@inlined
def on_map(meta: Array, x: float, y: float) -> bool:
    """Whether a position lies on the map, its rim included."""
    return 0.0 <= x <= (meta[META_NX] - 1.0) * meta[META_DX] and 0.0 <= y <= (meta[META_NY] - 1.0) * meta[META_DY]


@inlined
def onto(position: float, step: float, nodes: float) -> float:
    """A position from the first node, put back on the rim where no more than rounding (1e-6 of a cell) took it off."""
    end, slack = (nodes - 1.0) * step, 1e-6 * step
    if -slack < position < 0.0:
        return 0.0
    if end < position < end + slack:
        return end
    return position


@njit
def surface(grid: Array, meta: Array, x: float, y: float) -> tuple[float, float, float, float, float, float]:
    """h, h_x, h_y, h_xx, h_xy, h_yy at (x, y) from the first node. Outside, the rim cell's surface goes on."""
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
    """Fill out (n, 3) with h, h_x, h_y at world points (n,), items start..stop; nan off the map."""
    grid, _, meta = borrow(ground)
    for k in range(start, stop):
        px = onto(x[k] - meta[META_X], meta[META_DX], meta[META_NX])
        py = onto(y[k] - meta[META_Y], meta[META_DY], meta[META_NY])
        if on_map(meta, px, py):
            h, hx, hy, _, _, _ = surface(grid, meta, px, py)
            out[k, 0], out[k, 1], out[k, 2] = h + meta[META_Z], hx, hy
        else:
            out[k, 0] = out[k, 1] = out[k, 2] = math.nan
