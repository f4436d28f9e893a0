"""Wheels of a few poses in the lanes of a second lane array.

A search for the contacts of wheel i takes the time of its slowest lane, and the six wheels are searched in turn. If few lanes
hold a pose, their wheels are copied to lanes of their own and searched in fewer parts, each as wheel 0 of `LANES` poses. The
wheels must have the same radius and width. Lanes do not depend on each other, so the contacts are the same to the last bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.linkage import P_HALF, P_RADIUS
from .layout import BILINEAR, CONTACT, EDGE, HALF, HOME, LANES, POSE, WHEEL, WIDTH, in_use

Array = NDArray[np.float64]

FEW = 5 * LANES // 6  # poses whose wheels have room in five lane arrays


@inlined
def few_poses(rover: Array, count: int) -> int:
    """Return the number of poses if their wheels fill fewer than six lane arrays, else 0.

    Args:
        rover: the packed rover.
        count: number of lanes in use.
    """
    for i in range(1, 6):
        if rover[P_RADIUS + i] != rover[P_RADIUS] or rover[P_HALF + i] != rover[P_HALF]:
            return 0
    return count if count <= FEW else 0


@inlined
def parts_of(few: int) -> int:
    """Return the number of lane arrays that the wheels of some poses fill.

    Args:
        few: number of poses, 0 to FEW.
    """
    return (6 * few + LANES - 1) // LANES


@njit
def gather_wheels(lanes: Array, wheels: Array, few: int, part: int) -> None:
    """Copy what a search needs of the wheels of `few` poses: one wheel to each lane.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels; the rows read are written here, for wheel 0. Spare lanes repeat the last wheel.
        few: number of poses, 1 to FEW.
        part: part of their wheels, from 0. Wheel i of pose p is number i few + p; a part has LANES of them.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap, HOME (all), BILINEAR.col,
            BILINEAR.row, BILINEAR.rejected
    Writes: none
    """
    first = part * LANES
    count = min(6 * few - first, LANES)
    wheels[WIDTH], wheels[EDGE] = HALF if count <= HALF else LANES, lanes[EDGE]
    i, pose = first // few, first % few
    for l in range(in_use(wheels)):
        k = i * LANES + pose
        for row in (POSE.x, POSE.y, POSE.q, POSE.active, HOME.col, HOME.row):
            wheels[row + l] = lanes[row + pose]
        for row in (WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz):
            wheels[row + l] = lanes[row + k]
        for row in (CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.gx, CONTACT.gy, CONTACT.gap):
            wheels[row + l] = lanes[row + k]
        for row in (BILINEAR.col, BILINEAR.row, BILINEAR.rejected):
            wheels[row + l] = lanes[row + k]
        if l + 1 < count:
            i, pose = (i, pose + 1) if pose + 1 < few else (i + 1, 0)


@njit
def return_contacts(lanes: Array, wheels: Array, few: int, part: int, spare: bool) -> None:
    """Copy the contacts found back to the poses.

    Args:
        lanes: the lane array (`layout`).
        wheels: lane array of the wheels.
        few: number of poses, 1 to FEW.
        part: part of their wheels, as `gather_wheels` numbers them.
        spare: True: spare lanes repeat the last pose. False: they keep the contacts of an earlier call, which are finite.

    Reads:  none
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, BILINEAR.col, BILINEAR.row, BILINEAR.rejected
    """
    first = part * LANES
    i, pose = first // few, first % few
    for l in range(min(6 * few - first, LANES)):
        last = in_use(lanes) if spare and pose == few - 1 else pose + 1
        for k in range(i * LANES + pose, i * LANES + last):
            for row in (CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy):
                lanes[row + k] = wheels[row + l]
            for row in (CONTACT.gap, BILINEAR.col, BILINEAR.row, BILINEAR.rejected):
                lanes[row + k] = wheels[row + l]
        i, pose = (i, pose + 1) if pose + 1 < few else (i + 1, 0)
