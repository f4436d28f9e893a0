"""Treads of `LANES` wheels in their own coordinates, and the grid nodes under them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, njit
from ..model.ground import META_DX, META_DY, META_NX, META_NY, META_STEEP
from ..model.linkage import P_HALF, P_RADIUS
from ..model.tolerances import GAP_TIE
from .layout import CONTACT, HOME, LANES, NODES, POSE, ROOM, SIDE, TREAD, WHEEL, in_use

Array = NDArray[np.float64]

TINY = 1e-14  # m: keeps inverses finite along an edge parallel to the axle, where both ends are equally low


@fma_njit
def set_treads(lanes: Array, rover: Array, meta: Array, i: int) -> None:
    """Compute the tread of wheel i in its coordinates (u, v).

    The parabolas that bound it and the range of nodes under it are included.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        meta: the map header.
        i: index of the wheel.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.sine
    Writes: TREAD.zh, TREAD.cos, TREAD.tan, TREAD.over, TREAD.az, TREAD.u0, TREAD.v0, TREAD.u_x, TREAD.u_y, TREAD.v_x,
            TREAD.v_y, TREAD.over_x, TREAD.over_y, TREAD.aside_x, TREAD.aside_y, TREAD.v_low, TREAD.v_high, TREAD.p_0,
            TREAD.p_uu, TREAD.p_x, TREAD.p_y, TREAD.b_0, TREAD.b_uu, TREAD.b_x, TREAD.b_y, TREAD.col_0, TREAD.row_0,
            TREAD.col_1, TREAD.row_1, TREAD.det, TREAD.half, TREAD.max_slope_squared
    """
    i = min(max(i, 0), 5)
    radius, half = rover[P_RADIUS + i], rover[P_HALF + i]
    dx, dy = meta[META_DX], meta[META_DY]
    for l in range(in_use(lanes)):
        k = i * LANES + l
        vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
        x, y = lanes[POSE.x + l] + lanes[WHEEL.ox + k], lanes[POSE.y + l] + lanes[WHEEL.oy + k]
        over = 1.0 / uz
        sine = min(max(lanes[CONTACT.sine + k], -0.999), 0.999)
        cosine = math.sqrt(1.0 - sine * sine)
        lanes[TREAD.zh + l], lanes[TREAD.cos + l], lanes[TREAD.tan + l], lanes[TREAD.over + l], lanes[TREAD.az + l] = (
            lanes[POSE.q + l] + lanes[WHEEL.oz + k],
            uz,
            az * over,
            over,
            az,
        )
        lanes[TREAD.u0 + l], lanes[TREAD.v0 + l] = y * vx - x * vy, -x * vx - y * vy
        lanes[TREAD.u_x + l], lanes[TREAD.u_y + l], lanes[TREAD.v_x + l], lanes[TREAD.v_y + l] = (
            vy * dx,
            -vx * dy,
            vx * dx,
            vy * dy,
        )
        lanes[TREAD.over_x + l], lanes[TREAD.over_y + l] = 1.0 / (vy * dx + TINY), 1.0 / (TINY - vx * dy)
        lanes[TREAD.aside_x + l], lanes[TREAD.aside_y + l] = 1.0 / (vx * dx + TINY), 1.0 / (vy * dy + TINY)
        lanes[TREAD.v_low + l], lanes[TREAD.v_high + l] = (
            min(radius * az, 0.0) - half * uz - GAP_TIE,
            max(radius * az, 0.0) + half * uz + GAP_TIE,
        )
        lanes[TREAD.det + l], lanes[TREAD.half + l], lanes[TREAD.max_slope_squared + l] = (
            dx * dy,
            half,
            meta[META_STEEP] * meta[META_STEEP],
        )
        touching, bottom = 0.5 * over / (radius * cosine), 0.5 * over / radius
        lanes[TREAD.p_0 + l], lanes[TREAD.p_uu + l] = (
            lanes[POSE.q + l] + lanes[WHEEL.oz + k] - touching * radius * radius * (1.0 + cosine * cosine),
            touching,
        )
        lanes[TREAD.b_0 + l], lanes[TREAD.b_uu + l] = lanes[POSE.q + l] + lanes[WHEEL.oz + k] - radius * over, bottom
        lanes[TREAD.p_x + l], lanes[TREAD.p_y + l] = (
            0.5 / (touching * vy * vy * dx * dx + TINY),
            0.5 / (touching * vx * vx * dy * dy + TINY),
        )
        lanes[TREAD.b_x + l], lanes[TREAD.b_y + l] = (
            0.5 / (bottom * vy * vy * dx * dx + TINY),
            0.5 / (bottom * vx * vx * dy * dy + TINY),
        )
        far_x = half * abs(uz * vx) + radius * math.sqrt(vy * vy + az * az * vx * vx)
        far_y = half * abs(uz * vy) + radius * math.sqrt(vx * vx + az * az * vy * vy)
        lanes[TREAD.col_0 + l], lanes[TREAD.col_1 + l] = (
            np.floor((x - far_x) / dx),
            np.floor((x + far_x) / dx) + 1.0,
        )
        lanes[TREAD.row_0 + l], lanes[TREAD.row_1 + l] = (
            np.floor((y - far_y) / dy),
            np.floor((y + far_y) / dy) + 1.0,
        )


@njit
def nodes_under(lanes: Array) -> tuple[int, int]:
    """Count the grid nodes under the wheels, and mark the lanes that have room for them.

    Args:
        lanes: the lane array (`layout`).

    Returns:
        Numbers of nodes along x and y under the widest of the wheels that fit.

    Reads:  TREAD.col_0, TREAD.row_0, TREAD.col_1, TREAD.row_1, TREAD.fits
    Writes: TREAD.fits
    """
    columns = lines = 0
    for l in range(in_use(lanes)):
        nx, ny = lanes[TREAD.col_1 + l] - lanes[TREAD.col_0 + l] + 1.0, lanes[TREAD.row_1 + l] - lanes[TREAD.row_0 + l] + 1.0
        lanes[TREAD.fits + l] = 1.0 if nx <= SIDE and ny <= SIDE else 0.0
        if lanes[TREAD.fits + l] > 0.0:
            columns, lines = max(columns, int(nx)), max(lines, int(ny))
    return columns, lines


@fma_njit
def take_heights(lanes: Array, grid: Array, meta: Array, columns: int, lines: int) -> None:
    """Copy the heights of the nodes under the wheels, row by row.

    Lanes with fewer nodes repeat their last one. Beyond the map's edge, a node has the height of the nearest node on the map.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        columns: number of nodes along x under the widest of the wheels.
        lines: number of nodes along y under the widest of the wheels.

    Reads:  HOME (all), TREAD.col_0, TREAD.row_0, TREAD.col_1, TREAD.row_1, TREAD.node_col, TREAD.node_row, TREAD.node_height
    Writes: TREAD.node_col, TREAD.node_row, TREAD.node_height, NODES.height
    """
    columns, lines, last_x, last_y = (
        min(max(columns, 0), SIDE),
        min(max(lines, 0), SIDE),
        meta[META_NX] - 1.0,
        meta[META_NY] - 1.0,
    )
    for m in range(lines):
        for n in range(columns):
            at = NODES.height + min(m * columns + n, ROOM - 1) * LANES
            for l in range(in_use(lanes)):
                column, row = (
                    max(min(min(lanes[TREAD.col_0 + l] + n, lanes[TREAD.col_1 + l]), last_x), 0.0),
                    max(min(min(lanes[TREAD.row_0 + l] + m, lanes[TREAD.row_1 + l]), last_y), 0.0),
                )
                home_x, home_y = lanes[HOME.col + l], lanes[HOME.row + l]
                lanes[TREAD.node_col + l], lanes[TREAD.node_row + l] = (
                    (column if column == column else home_x),
                    (row if row == row else home_y),
                )
            for l in range(in_use(lanes)):
                lanes[TREAD.node_height + l] = grid[np.uint64(lanes[TREAD.node_row + l]), np.uint64(lanes[TREAD.node_col + l])]
            for l in range(in_use(lanes)):
                lanes[at + l] = lanes[TREAD.node_height + l]
