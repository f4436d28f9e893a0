"""Poses of SIMD lanes whose treads reach beyond the map's edge."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import META_DX, META_DY, META_NX, META_NY, near_map
from ..model.linkage import P_HALF, P_RADIUS
from .bilinear_settle import BEYOND, FAILED, SETTLED
from .layout import BILINEAR, EDGE, LANES, POSE, WHEEL, in_use

Array = NDArray[np.float64]

#: Distance of a tread from the edge, m, below which the scalar engine decides: poses of both engines differ by less.
EDGE_TIE = 1e-8


@njit
def mark_near_edge(lanes: Array, meta: Array, far: float) -> None:
    """Set the block's flag `EDGE` if a rover may reach the map's edge.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.
        far: m, the rover's reach.

    Reads:  POSE.x, POSE.y
    Writes: none
    """
    lanes[EDGE] = 0.0
    for l in range(in_use(lanes)):
        lanes[EDGE] += 0.0 if near_map(meta, lanes[POSE.x + l], lanes[POSE.y + l], -far) else 1.0


@njit
def find_beyond(lanes: Array, meta: Array, rover: Array, count: int) -> None:
    """Change the state of settled lanes whose treads reach beyond the map's edge to BEYOND.

    The state becomes FAILED where rounding decides that.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.
        rover: the packed rover.
        count: number of lanes in use, from the first.

    Reads:  POSE.x, POSE.y, WHEEL.ox, WHEEL.oy, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, BILINEAR.fate
    Writes: BILINEAR.fate
    """
    last_x, last_y = (meta[META_NX] - 1.0) * meta[META_DX], (meta[META_NY] - 1.0) * meta[META_DY]
    for l in range(count if lanes[EDGE] != 0.0 else 0):
        if lanes[BILINEAR.fate + l] != SETTLED:
            continue
        px, py, room = lanes[POSE.x + l], lanes[POSE.y + l], math.inf
        for i in range(6):
            k, radius, half = i * LANES + l, rover[P_RADIUS + i], rover[P_HALF + i]
            vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
            x, y = px + lanes[WHEEL.ox + k], py + lanes[WHEEL.oy + k]
            # half the size of the box around the wheel, as `solve.newton.wheel_extent`
            far_x = half * abs(uz * vx) + radius * math.sqrt(vy * vy + az * az * vx * vx)
            far_y = half * abs(uz * vy) + radius * math.sqrt(vx * vx + az * az * vy * vy)
            room = min(room, min(min(x, last_x - x) - far_x, min(y, last_y - y) - far_y))
        if room < EDGE_TIE:
            lanes[BILINEAR.fate + l] = BEYOND if room < -EDGE_TIE else FAILED
