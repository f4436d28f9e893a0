"""Cells of the bilinear grid under each lane, and the lowest gap before a search."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..jit.raw_views import node_taker
from ..model.ground import META_DX, META_DY, META_NX, META_NY
from .layout import CELL, EDGE, HALF, HOME, LANES, LOWEST, POSE, in_use

Array = NDArray[np.float64]

#: Intrinsic that copies the heights at the corners of the cells of HALF lanes.
take_corners = node_taker(2, HALF)


@fma_njit
def set_home(lanes: Array, meta: Array) -> None:
    """Compute the cell under the body, moved onto the map.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.

    Reads:  POSE.x, POSE.y
    Writes: HOME (all)
    """
    over_x, over_y, last_x, last_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY], meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for l in range(in_use(lanes)):
        i, j = np.floor(lanes[POSE.x + l] * over_x), np.floor(lanes[POSE.y + l] * over_y)
        lanes[HOME.col + l], lanes[HOME.row + l] = min(max(i, 0.0), last_x), min(max(j, 0.0), last_y)


@fma_njit
def no_gap(lanes: Array) -> None:
    """Reset the lowest gap of a wheel: none found, all searched, contact under the hub.

    Args:
        lanes: the lane array (`layout`).

    Reads:  HOME (all)
    Writes: LOWEST (all)
    """
    for l in range(in_use(lanes)):
        lanes[LOWEST.gap + l] = lanes[LOWEST.doubt + l] = math.inf
        lanes[LOWEST.sine + l], lanes[LOWEST.cosine + l], lanes[LOWEST.offset + l], lanes[LOWEST.gx + l], lanes[LOWEST.gy + l] = (
            0.0,
            1.0,
            0.0,
            0.0,
            0.0,
        )
        lanes[LOWEST.col + l], lanes[LOWEST.row + l] = lanes[HOME.col + l], lanes[HOME.row + l]


@inlined
def _cell_of(lanes: Array, l: int) -> tuple[float, float]:
    """Return a lane's cell (CELL.col, CELL.row), or the cell under the body if an index is NaN.

    Args:
        lanes: the lane array (`layout`).
        l: lane.

    Reads:  CELL.col, CELL.row, HOME (all)
    Writes: none
    """
    i, j, home_x, home_y = lanes[CELL.col + l], lanes[CELL.row + l], lanes[HOME.col + l], lanes[HOME.row + l]
    return (i if i == i else home_x), (j if j == j else home_y)


@fma_njit
def corners(lanes: Array, grid: Array, meta: Array) -> None:
    """Copy the heights at the corners of the cells (CELL.col, CELL.row).

    Beyond the map's edge, the terrain has the height of the nearest point of the edge. A cell whose index is NaN becomes the
    cell under the body.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.

    Reads:  CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, HOME (all)
    Writes: CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11
    """
    if lanes[EDGE] != 0.0:
        _corners_near_edge(lanes, grid, meta)
        return
    last_x, last_y = meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for l in range(in_use(lanes)):
        i, j = _cell_of(lanes, l)
        i, j = (i if i > 0.0 else 0.0), (j if j > 0.0 else 0.0)
        lanes[CELL.col + l], lanes[CELL.row + l] = (i if i < last_x else last_x), (j if j < last_y else last_y)
    for first in range(0, in_use(lanes), HALF):
        take_corners(lanes, CELL.col + first, CELL.row + first, grid, CELL.h00 + first, LANES)


@fma_njit
def _corners_near_edge(lanes: Array, grid: Array, meta: Array) -> None:
    """Copy the heights at the corners of cells that may lie beyond the map's edge, as `corners`.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.

    Reads:  CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, HOME (all)
    Writes: CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11
    """
    last_x, last_y = meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for l in range(in_use(lanes)):
        i, j = _cell_of(lanes, l)
        lanes[CELL.col + l], lanes[CELL.row + l] = i, j
        i, j = (i if i > 0.0 else 0.0), (j if j > 0.0 else 0.0)
        # the nearest cell of the map, until its heights replace it
        lanes[CELL.h00 + l], lanes[CELL.h01 + l] = (i if i < last_x else last_x), (j if j < last_y else last_y)
    for first in range(0, in_use(lanes), HALF):
        take_corners(lanes, CELL.h00 + first, CELL.h01 + first, grid, CELL.h00 + first, LANES)
    for l in range(in_use(lanes)):
        i, j = lanes[CELL.col + l], lanes[CELL.row + l]
        a, b, c, d = lanes[CELL.h00 + l], lanes[CELL.h01 + l], lanes[CELL.h10 + l], lanes[CELL.h11 + l]
        a, b, c, d = (b if i > last_x else a), (a if i < 0.0 else b), (d if i > last_x else c), (c if i < 0.0 else d)
        lanes[CELL.h00 + l], lanes[CELL.h01 + l] = (c if j > last_y else a), (d if j > last_y else b)
        lanes[CELL.h10 + l], lanes[CELL.h11 + l] = (a if j < 0.0 else c), (b if j < 0.0 else d)
