"""Contacts of settled lanes on bilinear terrain: points, normals, contact lines."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, njit
from ..model.ground import META_DX, META_DY
from ..model.linkage import P_HALF, P_RADIUS
from .bilinear_contacts import terrain_at_spots
from .bilinear_settle import SETTLED
from .layout import BILINEAR, CELL, CONTACT, LANES, POSE, SPOT, WHEEL, in_use

Array = NDArray[np.float64]

FLUSH = 1e-9  # m: a tread whose gaps along its width differ less touches along its whole width
STEP = 1e-8  # of the radius: distance of the points beside a contact whose slopes are compared
EVEN = 1e-6  # difference of these slopes, along the rim, below which the terrain is smooth

# Columns of a contact: 3 for its point from the body's origin, m, 3 for its unit normal, and the largest excess of a gap at the
# middle or the ends of the tread's width over the contact's, m
TOUCH_RISE, TOUCH_SIZE = 6, 7


@fma_njit
def _sample(lanes: Array, rover: Array, i: int, share: float, side: float, along: float) -> None:
    """Compute a point near the contact of wheel i.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: wheel.
        share: 1: its position on the axle is counted from the contact. 0: from the tread's middle.
        side: that position, m.
        along: distance from there along the rim, of the radius.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.sine,
            CONTACT.cosine, CONTACT.offset
    Writes: SPOT.x, SPOT.y, SPOT.z
    """
    i = min(max(i, 0), 5)
    r = rover[P_RADIUS + i]
    for l in range(in_use(lanes)):
        k = i * LANES + l
        vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
        sine, cosine, s = lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], share * lanes[CONTACT.offset + k] + side
        u, q = r * (sine + along * cosine), r * (cosine - along * sine)
        across = s * uz + q * az
        lanes[SPOT.x + l] = lanes[POSE.x + l] + lanes[WHEEL.ox + k] + u * vy + across * vx
        lanes[SPOT.y + l] = lanes[POSE.y + l] + lanes[WHEEL.oy + k] + across * vy - u * vx
        lanes[SPOT.z + l] = lanes[POSE.q + l] + lanes[WHEEL.oz + k] + s * az - q * uz


@fma_njit
def _slopes(lanes: Array, meta: Array) -> None:
    """Replace SPOT.z and SPOT.h by the terrain's slopes along x and y.

    The cells are those of `terrain_at_spots`.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.

    Reads:  CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, SPOT.x, SPOT.y
    Writes: SPOT.z, SPOT.h
    """
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for l in range(in_use(lanes)):
        u, v = lanes[SPOT.x + l] * over_x - lanes[CELL.col + l], lanes[SPOT.y + l] * over_y - lanes[CELL.row + l]
        a, b, c, d = lanes[CELL.h00 + l], lanes[CELL.h01 + l], lanes[CELL.h10 + l], lanes[CELL.h11 + l]
        twist = a - b - c + d
        lanes[SPOT.z + l], lanes[SPOT.h + l] = (b - a + twist * v) * over_x, (c - a + twist * u) * over_y


@njit
def store_contacts(
    lanes: Array, grid: Array, meta: Array, rover: Array, which: NDArray[np.int64], count: int, spare: Array, touch: Array
) -> None:
    """Store the contacts of the lanes that are settled, refined as those of `batch.contacts`.

    Args:
        lanes: the lane array (`layout`), after a search at the lanes' poses.
        grid: node heights, m.
        meta: the map header.
        rover: the packed rover.
        which: (LANES,) poses of the lanes.
        count: number of lanes in use, from the first.
        spare: (5 LANES,) scratch memory.
        touch: (n, 6, TOUCH_SIZE) filled for the poses that are settled.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.sine,
            CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, CELL.col, CELL.row, CELL.h00, CELL.h01,
            CELL.h10, CELL.h11, HOME (all), BILINEAR.fate, SPOT (all)
    Writes: CONTACT.offset, CONTACT.gx, CONTACT.gy, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, SPOT (all)
    """
    for i in range(6):
        _refine(lanes, grid, meta, rover, i, spare)
        for l in range(count):
            p, k = which[l], i * LANES + l
            if lanes[BILINEAR.fate + l] != SETTLED:
                continue
            gx, gy = lanes[CONTACT.gx + k], lanes[CONTACT.gy + k]
            size = math.sqrt(1.0 + gx * gx + gy * gy)
            touch[p, i, 0], touch[p, i, 1] = lanes[SPOT.x + l] - lanes[POSE.x + l], lanes[SPOT.y + l] - lanes[POSE.y + l]
            touch[p, i, 2] = lanes[SPOT.z + l] - lanes[POSE.q + l]
            touch[p, i, 3], touch[p, i, 4], touch[p, i, 5] = -gx / size, -gy / size, 1.0 / size
            touch[p, i, TOUCH_RISE] = spare[l]


@njit
def _refine(lanes: Array, grid: Array, meta: Array, rover: Array, i: int, spare: Array) -> None:
    """Refine a contact as `batch.contacts` does.

    A contact along the whole width moves to its middle, and slopes at ridges are computed. `spare` then begins with the
    largest excess of a gap at the middle or the ends of the tread's width over the contact's, m.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights, m.
        meta: the map header.
        rover: the packed rover.
        i: wheel.
        spare: (5 LANES,) scratch memory.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.sine,
            CONTACT.cosine, CONTACT.offset, CONTACT.gap, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, HOME (all),
            SPOT (all)
    Writes: CONTACT.offset, CONTACT.gx, CONTACT.gy, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, SPOT (all)
    """
    half = rover[P_HALF + i]
    for n in range(3 if half > 0.0 else 1):
        _sample(lanes, rover, i, 0.0, half * (n - 1.0), 0.0)
        terrain_at_spots(lanes, grid, meta)
        for l in range(in_use(lanes)):
            rise = lanes[SPOT.z + l] - lanes[SPOT.h + l] - lanes[CONTACT.gap + i * LANES + l]
            spare[l] = rise if n == 0 else max(spare[l], rise)
    for side in range(2):
        _sample(lanes, rover, i, 1.0, 0.0, STEP * (2.0 * side - 1.0))
        terrain_at_spots(lanes, grid, meta)
        _slopes(lanes, meta)
        for l in range(in_use(lanes)):
            spare[(1 + 2 * side) * LANES + l], spare[(2 + 2 * side) * LANES + l] = lanes[SPOT.z + l], lanes[SPOT.h + l]
    for l in range(in_use(lanes)):
        k = i * LANES + l
        vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
        sine, cosine, offset = lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], lanes[CONTACT.offset + k]
        if half > 0.0 and abs(offset) == half and spare[l] <= FLUSH:
            offset = lanes[CONTACT.offset + k] = 0.0
        if abs(offset) < half:
            steep, tilt = sine / (cosine * uz), az / uz
            lanes[CONTACT.gx + k], lanes[CONTACT.gy + k] = steep * vy + tilt * vx, tilt * vy - steep * vx
            continue
        ax, ay, bx, by = spare[LANES + l], spare[2 * LANES + l], spare[3 * LANES + l], spare[4 * LANES + l]
        # unit vector along the rim
        tx, ty, tz = cosine * vy - sine * az * vx, -cosine * vx - sine * az * vy, sine * uz
        before, after = tz - ax * tx - ay * ty, tz - bx * tx - by * ty
        part = before / (before - after) if abs(before - after) > EVEN else 0.5
        part = min(max(part, 0.0), 1.0)
        lanes[CONTACT.gx + k], lanes[CONTACT.gy + k] = ax + part * (bx - ax), ay + part * (by - ay)
    _sample(lanes, rover, i, 1.0, 0.0, 0.0)
