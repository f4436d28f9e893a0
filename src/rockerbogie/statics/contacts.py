"""Contacts of settled poses as the kernels of statics take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import parallel_for
from .._kernels.statics import loads as kernel
from .._kernels.statics.mechanism import BELLY
from ..arrays import Array, flat, flat_steering
from ..errors import RockerbogieError, expect
from ..settling.pose import Pose


class PackedContacts(NamedTuple):
    """Arguments of the kernels, poses on one axis n."""

    rover: Array
    yaw: Array  # (n,) rad
    steering: Array  # (n, 6) or (1, 6) rad
    q: Array  # (n, 6)
    point: Array  # (n, 6, 3) from the body's origin, m; NaN where a wheel is off the ground
    normal: Array  # (n, 6, 3)
    stops: NDArray[np.int8]  # (n, 3)
    belly_point: Array  # (n, BELLY, 3) or (1, BELLY, 3), NaN where there is no contact
    belly_normal: Array


def pack_contacts(pose: Pose) -> PackedContacts:
    """Return the contacts of settled poses.

    Args:
        pose: (...) poses.

    Returns:
        Arguments of the kernels, the batch on one axis.

    Raises:
        RockerbogieError: not a pose, or a rover without mass.
    """
    expect(pose, Pose, "pose", "settle one with rockerbogie.settle(rover, terrain, x, y, yaw)")
    if not pose.rover.mass > 0.0:
        raise RockerbogieError(f"rover {pose.rover.name!r} has no mass: give its masses, loads are shares of its weight")
    n = pose.status.size
    origin = np.stack([pose.x, pose.y, pose.z], axis=-1)[..., None, :]
    point = flat(pose.contact_point - origin, 6, 3).copy()
    point[pose.wheel_lifted.reshape(n, 6)] = np.nan
    q = np.ascontiguousarray(pose.q.reshape(n, 6))
    belly_point = belly_normal = np.full((1, BELLY, 3), np.nan)
    if pose.report is not None:
        wanted = np.ascontiguousarray(pose.belly_support > 0.0).reshape(n)
        belly_point, belly_normal = np.empty((n, BELLY, 3)), np.empty((n, BELLY, 3))
        position = (flat(pose.x), flat(pose.y), flat(pose.yaw))
        parallel_for(
            kernel.belly_batch, n, pose.terrain.packed, pose.rover.packed, *position, q, wanted, belly_point, belly_normal
        )
    return PackedContacts(
        pose.rover.packed, flat(pose.yaw), flat_steering(pose.steering), q, point, flat(pose.contact_normal, 6, 3),
        np.ascontiguousarray(pose.joint_stop).reshape(n, 3), belly_point, belly_normal,
    )  # fmt: skip
