"""Contact forces of a pose in world axes."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..settling.pose import Pose
from .loads import WheelLoads


def axle_directions(pose: Pose) -> Array:
    """Return the directions of the axles, to the left, in world axes.

    Args:
        pose: one pose, shape ().

    Returns:
        (6, 3) unit vectors.
    """
    return np.asarray(np.einsum("ij,kj->ki", pose.T_world_body[:3, :3], pose.axle_frames[:, :3, 1]))


def force_vectors(pose: Pose, loads: WheelLoads) -> Array:
    """Return the contact force on each wheel in world axes.

    Args:
        pose: one pose, shape ().
        loads: its contact forces.

    Returns:
        (6, 3) N: normal force, traction along the wheel's heading and side force to its left.
    """
    normal = pose.contact_normal
    along = np.cross(axle_directions(pose), normal)
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-300)
    side = np.cross(normal, along)
    parts = ((loads.normal, normal), (loads.traction, along), (loads.side, side))
    return np.asarray(np.nan_to_num(sum(size[:, None] * way for size, way in parts)))
