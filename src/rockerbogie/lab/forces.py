"""Contact points, normals and forces of a pose as arrows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..settling.pose import Pose
from ..statics.force_vectors import axle_directions, force_vectors
from ..statics.loads import LoadStatus, WheelLoads

#: Distance of the arrows from the outer side of a wheel, in wheel radii.
BESIDE = 0.2


class Arrows(NamedTuple):
    """Arrows of the wheels in contact."""

    points: Array  # (k, 3) contacts in the world, moved to the outer side of their wheels, m
    normals: Array  # (k, 3) unit vectors
    forces: Array  # (k, 3) N, on the wheel; NaN if the forces are not known


def contact_arrows(pose: Pose, loads: WheelLoads) -> Arrows:
    """Return contact points, normals and forces of the wheels in contact.

    Points are moved along the axles to the outer sides of the wheels, where they can be seen.

    Args:
        pose: one pose, shape ().
        loads: its contact forces.

    Returns:
        The arrows of k wheels; k is 0 without a pose.
    """
    points, normals = pose.contact_point, pose.contact_normal
    held = (pose.contact_count > 0) & np.isfinite(points).all(axis=-1) & ~pose.wheel_lifted
    forces = np.full((6, 3), np.nan)
    if int(loads.status) == LoadStatus.BALANCED:
        forces = force_vectors(pose, loads)
    half = np.array([1.0, -1.0] * 3) * (np.asarray(pose.rover.wheel_width) / 2 + BESIDE * pose.rover.wheel_radius)
    outer = points + half[:, None] * axle_directions(pose)
    return Arrows(outer[held], normals[held], forces[held])
