"""Points of treads on bilinear terrain: samples, and the contact stored for a wheel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit
from ..model.ground import META_DX, META_DY
from ..model.linkage import P_RADIUS
from ..model.tolerances import GAP_TIE
from .cells import corners
from .layout import BILINEAR, CELL, CONTACT, LANES, LOWEST, POSE, SPOT, WHEEL, in_use

Array = NDArray[np.float64]


@fma_njit
def sample_tread(lanes: Array, rover: Array, i: int, sine: float, cosine: float, s: float) -> None:
    """Compute one point of each tread of wheel i.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.
        sine: sin φ.
        cosine: cos φ.
        s: position along the axle, m.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz
    Writes: SPOT.x, SPOT.y, SPOT.z
    """
    i = min(max(i, 0), 5)
    u, q = rover[P_RADIUS + i] * sine, rover[P_RADIUS + i] * cosine
    for l in range(in_use(lanes)):
        k = i * LANES + l
        vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
        along = s * uz + q * az
        lanes[SPOT.x + l], lanes[SPOT.y + l] = (
            lanes[POSE.x + l] + lanes[WHEEL.ox + k] + u * vy + along * vx,
            lanes[POSE.y + l] + lanes[WHEEL.oy + k] + along * vy - u * vx,
        )
        lanes[SPOT.z + l] = lanes[POSE.q + l] + lanes[WHEEL.oz + k] + s * az - q * uz


@fma_njit
def terrain_at_spots(lanes: Array, grid: Array, meta: Array) -> None:
    """Compute the height of the terrain at (SPOT.x, SPOT.y).

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.

    Reads:  CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, HOME (all), SPOT.x, SPOT.y
    Writes: CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, SPOT.h
    """
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(in_use(lanes)):
        lanes[CELL.col + l], lanes[CELL.row + l] = np.floor(lanes[SPOT.x + l] * over_x), np.floor(lanes[SPOT.y + l] * over_y)
    corners(lanes, grid, meta)
    for l in range(in_use(lanes)):
        u, v = lanes[SPOT.x + l] * over_x - lanes[CELL.col + l], lanes[SPOT.y + l] * over_y - lanes[CELL.row + l]
        low, high = (
            lanes[CELL.h00 + l] + u * (lanes[CELL.h01 + l] - lanes[CELL.h00 + l]),
            lanes[CELL.h10 + l] + u * (lanes[CELL.h11 + l] - lanes[CELL.h10 + l]),
        )
        lanes[SPOT.h + l] = low + v * (high - low)


@fma_njit
def store_contact(lanes: Array, rover: Array, i: int, width: float, least: float) -> None:
    """Store the contact found for wheel i, in lanes whose POSE.active is at least `least`.

    Nearer to the tread's middle than `width`, the contact's slope is the tread's, else the terrain's.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: index of the wheel.
        width: distance from the middle, m.
        least: 0: all lanes. 1: active lanes.

    Reads:  POSE.active, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx,
            CONTACT.gy, CONTACT.gap, LOWEST (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    """
    i = min(max(i, 0), 5)
    radius = rover[P_RADIUS + i]
    for l in range(in_use(lanes)):
        k = i * LANES + l
        sine, cosine, offset, gap, kept = (
            lanes[LOWEST.sine + l],
            lanes[LOWEST.cosine + l],
            lanes[LOWEST.offset + l],
            lanes[LOWEST.gap + l],
            lanes[POSE.active + l] < least,
        )
        was_sine, was_cosine, was_offset, was_gap, was_gx, was_gy, was_col, was_row, was_rejected = (
            lanes[CONTACT.sine + k],
            lanes[CONTACT.cosine + k],
            lanes[CONTACT.offset + k],
            lanes[CONTACT.gap + k],
            lanes[CONTACT.gx + k],
            lanes[CONTACT.gy + k],
            lanes[BILINEAR.col + k],
            lanes[BILINEAR.row + k],
            lanes[BILINEAR.rejected + k],
        )
        col, row, gx, gy = lanes[LOWEST.col + l], lanes[LOWEST.row + l], lanes[LOWEST.gx + l], lanes[LOWEST.gy + l]
        vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
        steep, tilt, inside = sine / (cosine * uz), az / uz, abs(offset) < width
        gx, gy = (steep * vy + tilt * vx if inside else gx), (tilt * vy - steep * vx if inside else gy)
        rejected = 0.0 if (lanes[LOWEST.doubt + l] >= gap - GAP_TIE) & (abs(gap) < math.inf) else 1.0
        sine, cosine, offset = (was_sine if kept else sine), (was_cosine if kept else cosine), (was_offset if kept else offset)
        lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], lanes[CONTACT.offset + k], lanes[CONTACT.gap + k] = (
            sine,
            cosine,
            offset,
            (was_gap if kept else gap),
        )
        lanes[CONTACT.gx + k], lanes[CONTACT.gy + k] = (was_gx if kept else gx), (was_gy if kept else gy)
        lanes[BILINEAR.col + k], lanes[BILINEAR.row + k], lanes[BILINEAR.rejected + k] = (
            (was_col if kept else col),
            (was_row if kept else row),
            (was_rejected if kept else rejected),
        )
        u, q = radius * sine, radius * cosine
        along = offset * uz + q * az
        lanes[CONTACT.tx + k], lanes[CONTACT.ty + k], lanes[CONTACT.tz + k] = (
            u * vy + along * vx,
            along * vy - u * vx,
            offset * az - q * uz,
        )
