"""Contact lines, contacts of the body, and frictionless forces of settled poses."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._kernels.jit.parallel import parallel_for
from .._kernels.solve.forces import R_BELLY, R_FORCE
from .._kernels.statics.frictionless import line_support_batch
from .._kernels.statics.loads import belly_batch, span_batch
from .._kernels.statics.mechanism import BELLY
from ..arrays import Array, flat, flat_steering


def contact_lines(pose: Any, point: Array) -> Array:
    """Return half of the line along which each wheel touches the terrain over its whole width.

    Args:
        pose: `Pose` (...).
        point: (n, 6, 3) their contact points from the body's origin, m; NaN where a wheel is off the ground. Points on lines are
            moved to the middles.

    Returns:
        (n, 6, 3) m, or (1, 6, 3) if wheels have no width; 0: the contact is a point.
    """
    n = pose.status.size
    if not np.any(pose.rover.wheel_width):
        return np.zeros((1, 6, 3))
    span, q = np.empty((n, 6, 3)), np.ascontiguousarray(pose.q.reshape(n, 6))
    ground, rover = pose.terrain.packed, pose.rover.packed
    position = (flat(pose.x), flat(pose.y), flat(pose.yaw))
    parallel_for(span_batch, n, ground, rover, *position, flat_steering(pose.steering), q, point, span)
    return span


def belly_contacts(pose: Any) -> tuple[Array, Array]:
    """Return the contacts of the body's box.

    Args:
        pose: `Pose` (...).

    Returns:
        Points from the body's origin, m, and unit normals into the box, (n, BELLY, 3), NaN where there is no contact; (1, BELLY,
        3) in contact mode.
    """
    n = pose.status.size
    if pose.report is None:
        return np.full((1, BELLY, 3), np.nan), np.full((1, BELLY, 3), np.nan)
    wanted = np.ascontiguousarray(pose.report[..., R_BELLY] > 0.0).reshape(n)
    point, normal, q = np.empty((n, BELLY, 3)), np.empty((n, BELLY, 3)), np.ascontiguousarray(pose.q.reshape(n, 6))
    position = (flat(pose.x), flat(pose.y), flat(pose.yaw))
    parallel_for(belly_batch, n, pose.terrain.packed, pose.rover.packed, *position, q, wanted, point, normal)
    return point, normal


def frictionless_forces(pose: Any) -> tuple[Array, Array]:
    """Return the frictionless contact forces of poses in equilibrium.

    The force of a contact line acts at its middle.

    Args:
        pose: `Pose` (...), settled in equilibrium mode.

    Returns:
        Forces of the wheels (..., 6) and of the body (...), of the weight.
    """
    n = pose.status.size
    wheels = np.array(pose.report[..., R_FORCE : R_FORCE + 6]).reshape(n, 6)
    belly = np.array(pose.report[..., R_BELLY]).reshape(n)
    if np.any(pose.rover.wheel_width):
        point = flat(pose.contact_point, 6, 3) - np.stack([pose.x, pose.y, pose.z], axis=-1).reshape(n, 1, 3)
        normal, stops = flat(pose.contact_normal, 6, 3), np.ascontiguousarray(pose.joint_stop).reshape(n, 3)
        point[pose.wheel_lifted.reshape(n, 6)] = np.nan
        steering, q = flat_steering(pose.steering), np.ascontiguousarray(pose.q.reshape(n, 6))
        parallel_for(
            line_support_batch, n, pose.rover.packed, flat(pose.yaw), steering, q, point, normal, contact_lines(pose, point),
            stops, *belly_contacts(pose), wheels, belly,
        )  # fmt: skip
    return wheels.reshape(*pose.shape, 6), belly.reshape(pose.shape)
