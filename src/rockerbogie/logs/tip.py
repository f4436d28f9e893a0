"""Tip margin of a rover by its joint sensors and attitude, without a map."""

from __future__ import annotations

import numpy as np

from .._kernels.statics import loads as kernel
from .._kernels.statics.lane_tipping import MARGIN
from .._kernels.statics.mechanism import BELLY
from ..arrays import Array
from ..rover.frames import contact_frames, wheel_frames
from ..rover.model import Rover
from ..rover.rotations import euler_angles
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
    angles = np.concatenate([T.ravel(), [rocker], bogie, steering, contact_angle])
    if not (rover.mass > 0.0 and np.isfinite(angles).all()):
        return float("nan")
    R = T[:3, :3]
    roll, pitch, yaw = euler_angles(R)
    contact = contact_frames(rover, wheel_frames(rover, rocker, bogie, steering), contact_angle)[:, :3, 2:]
    normal, point = (contact.transpose(2, 0, 1) @ R.T)[:, None]
    q = np.array([[0.0, roll, pitch, rocker, bogie[0], bogie[1]]])
    margin, bound, direction = np.empty((3, 1))
    unwanted = np.empty(0)
    kernel.stability_batch(
        rover.packed, np.array([yaw]), steering[None], q, point, normal, NO_LINES, NO_STOPS, NO_BELLY, NO_BELLY, GRIP, MARGIN,
        margin, bound, direction, np.empty((1, 6), dtype=bool), np.empty(1, dtype=bool), unwanted, unwanted, 0, 1,
    )  # fmt: skip
    return float(margin[0])
