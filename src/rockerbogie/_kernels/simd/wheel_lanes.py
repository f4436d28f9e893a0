"""Wheels of one or two poses in the lanes of a second lane array.

A search for the contacts of wheel i takes the time of its slowest lane, and the six wheels are searched in turn. If one or two
lanes hold a pose, their wheels are copied to lanes of their own and searched at once, as wheel 0 of twelve poses. The wheels
must have the same radius and width. Lanes do not depend on each other, so the contacts are the same to the last bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.linkage import P_HALF, P_RADIUS
from .layout import BILINEAR, CONTACT, HOME, LANES, POSE, WHEEL

Array = NDArray[np.float64]

FEW = LANES // 6  # poses whose wheels have room in one lane array


@inlined
def few_poses(rover: Array, count: int) -> int:
    """Return the number of poses if their wheels can be searched at once, else 0.

    Args:
        rover: the packed rover.
        count: number of lanes in use.
    """
    for i in range(1, 6):
        if rover[P_RADIUS + i] != rover[P_RADIUS] or rover[P_HALF + i] != rover[P_HALF]:
            return 0
    return count if count <= FEW else 0


@njit
def gather_wheels(lanes: Array, wheels: Array, few: int) -> None:
    """Copy what a search needs of the wheels of `few` poses: one wheel to each lane.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels; the rows read are written here, for wheel 0. Spare lanes repeat the last wheel.
        few: number of poses, 1 to FEW.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, HOME (all), BILINEAR.col,
            BILINEAR.row, BILINEAR.rejected
    Writes: none
    """
    for l in range(LANES):
        n = min(l, 6 * few - 1)
        pose, k = n // 6, (n % 6) * LANES + n // 6
        for row in (POSE.x, POSE.y, POSE.q, POSE.active, HOME.col, HOME.row):
            wheels[row + l] = lanes[row + pose]
        for row in (WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz):
            wheels[row + l] = lanes[row + k]
        for row in (CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap):
            wheels[row + l] = lanes[row + k]
        for row in (BILINEAR.col, BILINEAR.row, BILINEAR.rejected):
            wheels[row + l] = lanes[row + k]


@njit
def return_contacts(lanes: Array, wheels: Array, few: int, spare: bool) -> None:
    """Copy the contacts found back to the poses.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels.
        few: number of poses, 1 to FEW.
        spare: True: spare lanes repeat the last pose. False: they keep the contacts of an earlier call, which are finite.

    Reads:  none
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    """
    count = LANES if spare else few
    for i in range(6):
        for l in range(count):
            n, k = 6 * min(l, few - 1) + i, i * LANES + l
            for row in (CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy):
                lanes[row + k] = wheels[row + n]
            for row in (CONTACT.gap, BILINEAR.col, BILINEAR.row, BILINEAR.rejected):
                lanes[row + k] = wheels[row + n]
