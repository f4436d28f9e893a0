"""Contact points and normals of settled poses on bilinear terrain, `LANES` at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, njit
from ..jit.raw_views import unowned_view
from ..model.ground import META_DX, META_DY, META_X, META_Y, META_Z, Ground, borrow
from ..model.linkage import P_HALF, P_RADIUS, Z
from ..search.workspace import WORK_SIZE, lay_out
from .bilinear_contacts import terrain_at_spots
from .bilinear_settle import search, too_fine
from .cells import set_home
from .cubic_settle import load
from .layout import BILINEAR, BILINEAR_SIZE, CELL, CONTACT, LANES, POSE, SPOT, TWO_BLOCKS, WHEEL, in_use
from .linkage import line_up, place_body, place_wheels
from .wheel_lanes import few_poses

Array = NDArray[np.float64]

FLUSH = 1e-9  # m: a tread whose gaps along its width differ less touches along its whole width
STEP = 1e-8  # of the radius: distance of the points beside a contact whose slopes are compared
EVEN = 1e-6  # difference of these slopes, along the rim, below which the terrain is smooth


@fma_njit
def _sample(lanes: Array, rover: Array, i: int, share: float, along: float) -> None:
    """Compute a point near the contact of wheel i.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        i: wheel.
        share: its position on the axle, of the contact's.
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
        sine, cosine, s = lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], share * lanes[CONTACT.offset + k]
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
def touch_linear(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, q: Array, close: float,
    point: Array, normal: Array, found: NDArray[np.bool_],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Compute the contacts of settled poses, as `batch.contacts` to rounding.

    Args:
        ground, rover: the packed terrain, which is bilinear, and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        q: (n, 6) poses.
        close: m, largest gap of a contact.
        point, normal: (n, 6, 3) filled, in the world.
        found: (n,) filled with False where a wheel is not in contact with its lower side, or the search could not decide.
        start, stop: range of poses that this call computes.
    """
    buffer, block, spare = np.empty(WORK_SIZE), np.empty(TWO_BLOCKS), np.empty(5 * LANES)
    which = np.empty(LANES, np.int64)
    work, land, car, meta = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2])
    lanes = line_up(block)
    wheels = lanes[BILINEAR_SIZE:]
    first = stop if too_fine(meta, car) else start
    for k in range(start, stop):
        found[k] = False
    while first < stop:
        count = min(LANES, stop - first)
        for l in range(count):
            which[l] = first + l
        load(lanes, car, meta, x, y, yaw, steering, which, count, first == start, work)
        for l in range(in_use(lanes)):
            k = first + min(l, count - 1)
            lanes[POSE.active + l] = 1.0
            for n in range(6):
                lanes[POSE.q + n * LANES + l] = q[k, n] - (meta[META_Z] if n == Z else 0.0)
                lanes[CONTACT.sine + n * LANES + l] = 0.0
        set_home(lanes, meta)
        place_body(lanes, car)
        place_wheels(lanes, car)
        search(lanes, wheels, land[0], meta, car, False, few_poses(car, count))
        for l in range(count):
            good = not math.isnan(q[first + l, Z])
            for i in range(6):
                k = i * LANES + l
                good &= abs(lanes[CONTACT.gap + k]) < close and lanes[BILINEAR.rejected + k] == 0.0
            found[first + l] = good
        for i in range(6):
            _refine(lanes, land[0], meta, car, i, spare)
            for l in range(count):
                p, k = first + l, i * LANES + l
                gx, gy = lanes[CONTACT.gx + k], lanes[CONTACT.gy + k]
                size = math.sqrt(1.0 + gx * gx + gy * gy)
                normal[p, i, 0], normal[p, i, 1], normal[p, i, 2] = -gx / size, -gy / size, 1.0 / size
                point[p, i, 0] = lanes[SPOT.x + l] + meta[META_X]
                point[p, i, 1] = lanes[SPOT.y + l] + meta[META_Y]
                point[p, i, 2] = lanes[SPOT.z + l] + meta[META_Z]
        first += count
    buffer[0] = block[0] = 0.0  # keep the buffers alive: `work`, `lanes` and `wheels` are unowned views of them


@njit
def _refine(lanes: Array, grid: Array, meta: Array, rover: Array, i: int, spare: Array) -> None:
    """Refine a contact as `batch.contacts` does.

    A contact along the whole width moves to its middle, and slopes at ridges are computed.

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
    if half > 0.0:
        for n in range(2):
            _sample(lanes, rover, i, -1.0 + n, 0.0)
            terrain_at_spots(lanes, grid, meta)
            for l in range(in_use(lanes)):
                gap = lanes[SPOT.z + l] - lanes[SPOT.h + l]
                spare[l] = gap if n == 0 else max(spare[l], gap)
    for side in range(2):
        _sample(lanes, rover, i, 1.0, STEP * (2.0 * side - 1.0))
        terrain_at_spots(lanes, grid, meta)
        _slopes(lanes, meta)
        for l in range(in_use(lanes)):
            spare[(1 + 2 * side) * LANES + l], spare[(2 + 2 * side) * LANES + l] = lanes[SPOT.z + l], lanes[SPOT.h + l]
    for l in range(in_use(lanes)):
        k = i * LANES + l
        vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
        sine, cosine, offset = lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], lanes[CONTACT.offset + k]
        if half > 0.0 and abs(offset) == half and spare[l] <= lanes[CONTACT.gap + k] + FLUSH:
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
    _sample(lanes, rover, i, 1.0, 0.0)
