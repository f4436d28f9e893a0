"""The C2 cubic spline through a grid of heights: its B-spline coefficients, a roof over it, how much it bends.

A node's coefficient leans on all the map, by 0.27 less for each node further off. Here it leans on a margin around its
tile, and tiles lie fixed on the map: so a part of a map, read by itself, gets the very numbers that the whole map has, and
both are the spline to the last digit, as what lies beyond the margin weighs less than 1e-20.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TILE = 256  # nodes a side
MARGIN = 40  # nodes around a tile that its coefficients are worked out from
BRIDGE = 32  # nodes: how far into unknown ground the known ground's heights are carried
STRIP = 64  # rows worked on at once, so that they stay in the processor's cache


def nodes_needed(start: int, stop: int, count: int) -> tuple[int, int]:
    """The first and one past the last node, of `count` along an axis, that the coefficients of nodes start..stop need."""
    tiles = list(_tiles(start, stop, count))
    return max(tiles[0][0] - MARGIN - BRIDGE, 0), min(tiles[-1][1] + MARGIN + BRIDGE, count)


def coefficients(z: Array, first: tuple[int, int], shape: tuple[int, int], rows: tuple[int, int], cols: tuple[int, int]) -> Array:
    """Coefficients of the nodes rows × cols (first, one past the last) and of a ring around them; nan where unknown.

    Unknown nodes (nan) are bridged, so that the spline exists; their coefficients are then struck out again, which makes
    every cell that leans on one unknown. What a bridge leaks further in dies off by 0.27 a cell.

    Args:
        z: heights from node `first` on, at least what `nodes_needed` asks for.
        shape: of the whole map.
    """
    known = np.isfinite(z)
    c = _along(z if known.all() else _bridged(z, known), first[0], shape[0], *rows)
    c = _along(np.ascontiguousarray(c.T), first[1], shape[1], *cols).T.copy()
    ring = [(max(start - 1, 0), min(stop + 1, count)) for (start, stop), count in zip((rows, cols), shape, strict=True)]
    (r0, r1), (c0, c1) = ring
    struck = ~known[r0 - first[0] : r1 - first[0], c0 - first[1] : c1 - first[1]]
    c[r0 - rows[0] + 1 : r1 - rows[0] + 1, c0 - cols[0] + 1 : c1 - cols[0] + 1][struck] = np.nan
    return c


def _tiles(start: int, stop: int, count: int) -> Iterator[tuple[int, int]]:
    """The tiles of an axis that hold nodes start..stop and one more on either side."""
    for begin in range(max(start - 1, 0) // TILE * TILE, min(stop + 1, count), TILE):
        yield begin, min(begin + TILE, count)


def _along(z: Array, first: int, count: int, start: int, stop: int) -> Array:
    """Coefficients of the nodes start - 1..stop (both included) along axis 0, tile by tile; z begins at node `first`."""
    c = np.empty((stop - start + 2, z.shape[1]))
    for begin, end in _tiles(start, stop, count):
        low, high = max(begin - MARGIN, 0), min(end + MARGIN, count)
        block = _not_a_knot(z[low - first : high - first])  # of the nodes low - 1..high
        begin, end = (begin if begin > 0 else -1), (end if end < count else count + 1)
        begin, end = max(begin, start - 1), min(end, stop + 1)
        c[begin - start + 1 : end - start + 1] = block[begin - low + 1 : end - low + 1]
    return c


def _not_a_knot(z: Array) -> Array:
    """Solve (c[i-1] + 4 c[i] + c[i+1]) / 6 = z[i] down axis 0, the third derivative continuous at the first and last inner
    node; c has a row more at either end.

    That continuity and the three equations about an inner node give its coefficient at once; between the two of them the
    rest is a tridiagonal system. All of it goes element by element: a column's numbers do not depend on its neighbours.
    """
    n = len(z)
    c = np.empty((n + 2, z.shape[1]))
    node = c[1:-1]
    node[2:-2] = z[2:-2]
    node[2:-2] *= 6.0
    node[1] = (8.0 * z[1] - z[0] - z[2]) / 6.0
    node[-2] = (8.0 * z[-2] - z[-1] - z[-3]) / 6.0
    weight = [0.0]
    for k in range(2, n - 2):
        weight.append(1.0 / (4.0 - weight[-1]))
        node[k] -= node[k - 1]
        node[k] *= weight[-1]
    carried = np.empty(z.shape[1])
    for k in range(n - 3, 1, -1):
        np.multiply(node[k + 1], weight[k - 1], out=carried)
        node[k] -= carried
    for rim, inner, past in ((0, 1, 0), (-1, -2, -1)):
        node[rim] = 6.0 * z[inner] - 4.0 * node[inner] - node[2 if rim == 0 else -3]
        c[past] = 6.0 * z[rim] - 4.0 * node[rim] - node[inner]
    return c


def _bridged(z: Array, known: NDArray[np.bool_]) -> Array:
    """Heights with unknown nodes bridged: by the nearest in their row, then in their column, within `BRIDGE`; 0 beyond,
    where a jump no longer matters."""
    for axis in (1, 0):
        z, known = _nearest(z, known, axis)
    return np.where(known, z, 0.0)


def _nearest(z: Array, known: NDArray[np.bool_], axis: int) -> tuple[Array, NDArray[np.bool_]]:
    """Unknown nodes take the height of the nearest known one along the axis, if it is no further than `BRIDGE`."""
    count = z.shape[axis]
    at = np.expand_dims(np.arange(count), 1 - axis)
    before = np.maximum.accumulate(np.where(known, at, -count), axis=axis)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(known, at, 2 * count), axis), axis=axis), axis)
    chosen = np.where(at - before <= after - at, before, after)
    near = np.abs(chosen - at) <= BRIDGE
    return np.take_along_axis(z, np.clip(chosen, 0, count - 1), axis), near


def greatest_differences(c: Array) -> tuple[float, float, float]:
    """The greatest second differences of the coefficients along x, along y and mixed; nan where ground is missing."""
    xx = float(np.abs(np.diff(c, 2, axis=1)).max())
    yy = float(np.abs(np.diff(c, 2, axis=0)).max())
    xy = float(np.abs(np.diff(np.diff(c, axis=0), axis=1)).max())
    return xx, yy, xy


def greatest_curvature(differences: tuple[float, float, float], step: tuple[float, float]) -> float:
    """A bound on the spline's second derivative along any direction: those of a spline lie within the second differences
    of its coefficients. inf where ground is missing."""
    xx, yy, xy = differences
    bound = max(xx / step[0] ** 2, yy / step[1] ** 2) + xy / (step[0] * step[1])
    return bound if math.isfinite(bound) else math.inf


def upper_bound(c: Array) -> Array:
    """Node heights (rows, cols) whose bilinear surface the spline of coefficients c (rows + 2, cols + 2) nowhere rises over.

    A cell's spline lies under its Bézier ordinates; by what these exceed the plane-like surface through the cell's
    corners, its corners are lifted. inf around cells that are not known.
    """
    rows, cols = c.shape[0] - 3, c.shape[1] - 3  # cells
    lift = np.zeros((rows + 1, cols + 1))
    for top in range(0, rows, STRIP):
        bottom = min(top + STRIP, rows)
        bulge = _bulge(c[top : bottom + 3])
        for i in (0, 1):
            for j in (0, 1):
                part = lift[top + i : bottom + i, j : cols + j]
                np.maximum(part, bulge, out=part)
    across = (c[:, :-2] + 4.0 * c[:, 1:-1] + c[:, 2:]) / 6.0
    node = (across[:-2] + 4.0 * across[1:-1] + across[2:]) / 6.0
    node[np.isnan(node)] = 0.0
    return np.asarray(node + lift)


def _bulge(c: Array) -> Array:
    """How far each cell's Bézier ordinates exceed the bilinear surface through its corners; inf where it is unknown."""
    bezier = np.array([[1, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6
    rows, cols = c.shape[0] - 3, c.shape[1] - 3
    across = [sum(w * c[:, n : n + cols] for n, w in enumerate(weights)) for weights in bezier]

    def ordinate(k: int, m: int) -> Array:
        return np.asarray(sum(w * across[m][n : n + rows] for n, w in enumerate(bezier[k])))

    a, b, d, e = ordinate(0, 0), ordinate(0, 3), ordinate(3, 0), ordinate(3, 3)
    bulge = np.zeros((rows, cols))
    for k in range(4):
        for m in range(4):
            u, v = m / 3, k / 3
            bulge = np.maximum(bulge, ordinate(k, m) - ((a * (1 - u) + b * u) * (1 - v) + (d * (1 - u) + e * u) * v))
    bulge[np.isnan(bulge)] = np.inf
    return bulge
