"""C2 cubic spline through a grid of heights: coefficients, upper bound, curvature bound.

A node's coefficient depends on the whole map, by a factor of 0.27 less per node of distance. Here it is computed from a
margin around its tile; nodes beyond the margin would change it by less than 1e-20 of their height. Tiles have fixed
positions on the map. So a window that is read by itself gets bit-identical coefficients to those of the whole map.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TILE = 256  # nodes a side
MARGIN = 40  # nodes around a tile from which its coefficients are computed
BRIDGE = 32  # nodes: distance over which heights are extended into missing data
STRIP = 64  # rows computed at once, so that they stay in the processor's cache


def nodes_needed(start: int, stop: int, count: int) -> tuple[int, int]:
    """Return the nodes that the coefficients of a window depend on, along one axis.

    Args:
        start: first node of the window.
        stop: one past its last node.
        count: nodes of the map along the axis.

    Returns:
        First and one past the last node.
    """
    tiles = list(_tiles(start, stop, count))
    return max(tiles[0][0] - MARGIN - BRIDGE, 0), min(tiles[-1][1] + MARGIN + BRIDGE, count)


def coefficients(z: Array, first: tuple[int, int], shape: tuple[int, int], rows: tuple[int, int], cols: tuple[int, int]) -> Array:
    """Compute the B-spline coefficients of a window and of a ring of one node around it.

    Nodes without data are bridged, so that the spline exists, and their coefficients are then set to NaN. So every cell that
    depends on missing data is NaN. The influence of a bridge on further cells falls by a factor of 0.27 per cell.

    Args:
        z: heights from node `first` on, m; at least those of `nodes_needed`. NaN is missing data.
        first: row and column of z[0, 0] in the map.
        shape: rows, cols of the whole map.
        rows: first, one past the last of the window.
        cols: the same.

    Returns:
        (rows + 2, cols + 2) coefficients, m; NaN at nodes without data.
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
    """Yield the tiles of an axis that hold nodes start..stop and one more on either side."""
    for begin in range(max(start - 1, 0) // TILE * TILE, min(stop + 1, count), TILE):
        yield begin, min(begin + TILE, count)


def _along(z: Array, first: int, count: int, start: int, stop: int) -> Array:
    """Compute coefficients along axis 0, tile by tile.

    Args:
        z: heights from node `first` on, without NaN.
        first: index of z[0] in the map.
        count: nodes of the map along the axis.
        start: first node of the window.
        stop: one past its last.

    Returns:
        (stop - start + 2, z.shape[1]): nodes start - 1 to stop, both included.
    """
    c = np.empty((stop - start + 2, z.shape[1]))
    for begin, end in _tiles(start, stop, count):
        low, high = max(begin - MARGIN, 0), min(end + MARGIN, count)
        block = _not_a_knot(z[low - first : high - first])  # of the nodes low - 1..high
        begin, end = (begin if begin > 0 else -1), (end if end < count else count + 1)
        begin, end = max(begin, start - 1), min(end, stop + 1)
        c[begin - start + 1 : end - start + 1] = block[begin - low + 1 : end - low + 1]
    return c


def _not_a_knot(z: Array) -> Array:
    """Solve (c[i-1] + 4 c[i] + c[i+1]) / 6 = z[i] along axis 0 with not-a-knot ends.

    The third derivative is continuous at the first and the last inner node. This condition and the three equations around
    such a node give its coefficient directly; the equations between the two nodes are a tridiagonal system. All operations
    are element by element, so the numbers of a column do not depend on its neighbours.

    Args:
        z: (n, m) heights, n >= 4.

    Returns:
        (n + 2, m) coefficients: one more row at either end.
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
    for edge, inner, past in ((0, 1, 0), (-1, -2, -1)):
        node[edge] = 6.0 * z[inner] - 4.0 * node[inner] - node[2 if edge == 0 else -3]
        c[past] = 6.0 * z[edge] - 4.0 * node[edge] - node[inner]
    return c


def bridge(z: Array) -> Array:
    """Return heights with missing data filled from near nodes.

    A node takes the height of the nearest node with data in its row, then in its column, within `BRIDGE` nodes. So it depends
    only on nodes within `BRIDGE` rows and columns.

    Args:
        z: (rows, cols) m; NaN is missing data.

    Returns:
        (rows, cols) m; NaN where no node with data is near enough.
    """
    out = z.copy()
    for axis in (1, 0):
        lines = out if axis == 1 else out.T
        gaps = np.flatnonzero(np.isnan(lines).any(axis=1))
        for start in range(0, gaps.size, TILE):  # to limit memory
            at = gaps[start : start + TILE]
            filled, near = _nearest(lines[at], ~np.isnan(lines[at]), 1)
            lines[at] = np.where(near, filled, np.nan)
    return out


def _bridged(z: Array, known: NDArray[np.bool_]) -> Array:
    """Return heights with missing data filled from near nodes, so that the spline exists.

    A node takes the height of the nearest node with data in its row, then in its column, within `BRIDGE` nodes; otherwise 0,
    as a jump at that distance has no influence.
    """
    for axis in (1, 0):
        z, known = _nearest(z, known, axis)
    return np.where(known, z, 0.0)


def _nearest(z: Array, known: NDArray[np.bool_], axis: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return heights with missing data filled along an axis, and the mask of filled nodes.

    A node takes the height of the nearest node with data along the axis, within `BRIDGE` nodes.
    """
    count = z.shape[axis]
    at = np.expand_dims(np.arange(count), 1 - axis)
    before = np.maximum.accumulate(np.where(known, at, -count), axis=axis)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(known, at, 2 * count), axis), axis=axis), axis)
    chosen = np.where(at - before <= after - at, before, after)
    near = np.abs(chosen - at) <= BRIDGE
    return np.take_along_axis(z, np.clip(chosen, 0, count - 1), axis), near


def greatest_differences(c: Array) -> tuple[float, float, float]:
    """Return the greatest absolute second differences of the coefficients.

    Args:
        c: (rows, cols) coefficients, m.

    Returns:
        Along x, along y and mixed, m; NaN where data is missing.
    """
    xx = float(np.abs(np.diff(c, 2, axis=1)).max())
    yy = float(np.abs(np.diff(c, 2, axis=0)).max())
    xy = float(np.abs(np.diff(np.diff(c, axis=0), axis=1)).max())
    return xx, yy, xy


def greatest_curvature(differences: tuple[float, float, float], step: tuple[float, float]) -> float:
    """Return an upper bound of the spline's absolute second derivative along any direction.

    The second derivatives of a cubic spline lie within the second differences of its coefficients.

    Args:
        differences: of `greatest_differences`, m.
        step: dx, dy, m.

    Returns:
        1/m; inf where data is missing.
    """
    xx, yy, xy = differences
    bound = max(xx / step[0] ** 2, yy / step[1] ** 2) + xy / (step[0] * step[1])
    return bound if math.isfinite(bound) else math.inf


def upper_bound(c: Array) -> Array:
    """Return node heights whose bilinear surface the spline never exceeds.

    The spline in a cell lies below its Bézier ordinates. The corners of the cell are raised by the greatest excess of these
    over the bilinear surface through the corners.

    Args:
        c: (rows + 2, cols + 2) coefficients with a ring around them, m.

    Returns:
        (rows, cols) m; inf around cells without data.
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
    """Return each cell's greatest excess of its Bézier ordinates over its bilinear surface.

    Args:
        c: (rows + 3, cols + 3) coefficients around (rows, cols) cells, m.

    Returns:
        (rows, cols) m; inf for cells without data.
    """
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
