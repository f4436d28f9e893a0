"""Reasons for which predicted drives end."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..._kernels.dynamics import evaluate as kernel
from ...arrays import Array
from ...rover.model import Rover
from ...settling.settle import settle
from ...settling.status import Status
from ...statics.loads import LoadStatus, wheel_loads
from ...terrain.heightfield import Terrain


class DriveEnd(IntEnum):
    """Reason for which a predicted drive ends, one code a drive (uint8)."""

    REACHED_END = 0  # all commands were driven
    OFF_MAP = 1
    NO_DATA = 2
    JOINT_LIMIT = 3  # a joint is at its limit: a wheel would leave the terrain
    NO_POSE = 4  # no pose with six wheels in contact was found
    TIPS = 5  # no friction holds the rover
    SLIDES = 6  # the rover needs more friction than there is
    STALLS = 7  # the motors are too weak
    OVERLOADS = 8  # the soil cannot carry a wheel
    NOT_BALANCED = 9  # no motion at which the forces balance was found
    INACCURATE = 10  # the energy balance misses the tolerance: contacts jump back and forth


TEXT = {
    DriveEnd.REACHED_END: "all commands were driven",
    DriveEnd.OFF_MAP: "a wheel would leave the map",
    DriveEnd.NO_DATA: "a wheel would drive over missing data",
    DriveEnd.JOINT_LIMIT: "a joint is at its limit, so that a wheel would leave the terrain",
    DriveEnd.NO_POSE: "no pose with six wheels in contact was found",
    DriveEnd.TIPS: "no friction holds the rover here: it tips over",
    DriveEnd.SLIDES: "the rover slides: it needs more friction here than there is",
    DriveEnd.STALLS: "the motors are too weak: no motion within their torque limits balances the rover",
    DriveEnd.OVERLOADS: "the soil cannot carry a wheel's load",
    DriveEnd.NOT_BALANCED: "no motion was found at which the wheel forces balance",
    DriveEnd.INACCURATE: "the energies do not balance within the tolerance: contacts jump back and forth",
}
_OF_STATUS = {
    Status.OFF_MAP: DriveEnd.OFF_MAP,
    Status.NO_DATA: DriveEnd.NO_DATA,
    Status.JOINT_STOP: DriveEnd.JOINT_LIMIT,
    Status.NOT_CONVERGED: DriveEnd.NO_POSE,
}
#: End -> status of the stations that were not reached.
STATUS_AFTER = {
    DriveEnd.OFF_MAP: Status.OFF_MAP,
    DriveEnd.NO_DATA: Status.NO_DATA,
    DriveEnd.JOINT_LIMIT: Status.JOINT_STOP,
    DriveEnd.TIPS: Status.TIPPED,
}


def drive_ends(
    rover: Rover, terrain: Terrain, codes: NDArray[np.int64], places: Array, steering: Array, friction: Array, limited: bool
) -> NDArray[np.uint8]:
    """Return the reason for which each drive ended.

    Where no balance was found, the least friction coefficient that holds the rover there decides.

    Args:
        rover, terrain: of the drives.
        codes: (n,) codes of the kernel.
        places: (n, 3) x, y, yaw at which each drive ended.
        steering: (n, 6) rad.
        friction: (n,) coefficients; NaN on soil.
        limited: True if the motors' torque is limited.

    Returns:
        (n,) `DriveEnd`.
    """
    ends = np.full(codes.shape, DriveEnd.REACHED_END, dtype=np.uint8)
    for status, end in _OF_STATUS.items():
        ends[codes == status] = end
    ends[codes == kernel.OVERLOADED] = DriveEnd.OVERLOADS
    ends[codes == kernel.INACCURATE] = DriveEnd.INACCURATE
    left = np.flatnonzero(codes == kernel.NO_BALANCE)
    if left.size == 0:
        return ends
    pose = settle(rover, terrain, *places[left].T, steering=steering[left])
    loads = wheel_loads(pose)
    found = np.full(left.size, DriveEnd.STALLS if limited else DriveEnd.NOT_BALANCED, dtype=np.uint8)
    found[loads.required_friction > friction[left]] = DriveEnd.SLIDES
    found[loads.status == LoadStatus.NOT_HELD] = DriveEnd.TIPS
    ends[left] = found
    return ends
