"""Tip margin of a rover by its joint sensors and attitude, without a map."""

from __future__ import annotations

import numpy as np

from .._kernels.odometry.frames import rim_contacts
from .._kernels.statics import loads as kernel
from .._kernels.statics.lane_tipping import MARGIN
from .._kernels.statics.mechanism import BELLY
from ..arrays import Array
from ..rover.model import Rover
from ..statics.stability import GRIP

NO_BELLY = np.full((1, BELLY, 3), np.nan)
NO_LINES = np.zeros((1, 6, 3))
NO_STOPS = np.zeros((1, 3), dtype=np.int8)


def tip_margin(rover: Rover, T: Array, rocker: float, bogie: Array, steering: Array, contact_angle: Array) -> float:
    """Compute the tip margin of one pose whose six wheels are in contact with the terrain.

    Args:
        rover: the rover.
        T: (4, 4) T_world_body; roll and pitch are used.
        rocker: rad.
        bogie: (2,) rad.
        steering: (6,) rad.
        contact_angle: (6,) rad.

    Returns:
        Tip margin as of `stability`, rad; NaN if the rover has no mass, or an angle is NaN.
    """
    joints = np.concatenate([steering, [rocker], bogie])
    if not (rover.mass > 0.0 and np.isfinite(T).all() and np.isfinite(joints).all() and np.isfinite(contact_angle).all()):
        return float("nan")
    q, normal, point, yaw = np.empty((1, 6)), np.empty((1, 6, 3)), np.empty((1, 6, 3)), np.empty(1)
    yaw[0] = rim_contacts(rover.packed, rover.steers, T, joints, contact_angle, q[0], normal[0], point[0])
    margin, bound, direction = np.empty((3, 1))
    unwanted = np.empty(0)
    kernel.stability_batch(
        rover.packed, yaw, steering[None], q, point, normal, NO_LINES, NO_STOPS, NO_BELLY, NO_BELLY, GRIP, MARGIN,
        margin, bound, direction, np.empty((1, 6), dtype=bool), np.empty(1, dtype=bool), unwanted, unwanted, 0, 1,
    )  # fmt: skip
    return float(margin[0])
