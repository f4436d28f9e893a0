"""Contacts of settled poses as the kernels of statics take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels.batch.contacts import contacts_batch
from .._kernels.jit.parallel import parallel_for
from .._kernels.simd.bilinear_touch import touch_linear
from ..arrays import Array, flat, flat_steering
from ..errors import RockerbogieError, expect
from ..settling.line_support import belly_contacts, contact_lines
from ..settling.pose import TOUCHING, Pose


class PackedContacts(NamedTuple):
    """Arguments of the kernels, poses on one axis n."""

    rover: Array
    yaw: Array  # (n,) rad
    steering: Array  # (n, 6) or (1, 6) rad
    q: Array  # (n, 6)
    point: Array  # (n, 6, 3) from the body's origin, m; NaN where a wheel is off the ground
    normal: Array  # (n, 6, 3)
    span: Array  # (n, 6, 3) or (1, 6, 3) half of the line along which a wheel touches, m; 0: the contact is a point
    stops: NDArray[np.int8]  # (n, 3)
    belly_point: Array  # (n, BELLY, 3) or (1, BELLY, 3), NaN where there is no contact
    belly_normal: Array


def pack_contacts(pose: Pose, fast: bool = False) -> PackedContacts:
    """Return the contacts of settled poses.

    Args:
        pose: (...) poses.
        fast: True: contacts of six-wheel poses on bilinear terrain come from the lanes of `touch_linear`. They take a quarter of
            the time of `Pose.contacts`, and may differ from them by rounding.

    Returns:
        Arguments of the kernels, the batch on one axis.

    Raises:
        RockerbogieError: not a pose, or a rover without mass.
    """
    expect(pose, Pose, "pose", "settle one with rockerbogie.settle(rover, terrain, x, y, yaw)")
    if not pose.rover.mass > 0.0:
        raise RockerbogieError(f"rover {pose.rover.name!r} has no mass: give its masses, loads are shares of its weight")
    n = pose.status.size
    origin = np.stack([pose.x, pose.y, pose.z], axis=-1).reshape(n, 1, 3)
    if fast and pose.report is None and pose.terrain.interpolation == "linear":
        point, normal = _lane_contacts(pose)
    else:
        point, normal = flat(pose.contact_point, 6, 3), flat(pose.contact_normal, 6, 3)
    point = point - origin
    point[pose.wheel_lifted.reshape(n, 6)] = np.nan
    q, steering = np.ascontiguousarray(pose.q.reshape(n, 6)), flat_steering(pose.steering)
    return PackedContacts(
        pose.rover.packed, flat(pose.yaw), steering, q, point, normal, contact_lines(pose, point),
        np.ascontiguousarray(pose.joint_stop).reshape(n, 3), *belly_contacts(pose),
    )  # fmt: skip


def _lane_contacts(pose: Pose) -> tuple[Array, Array]:
    """Return contact points and normals (n, 6, 3) of six-wheel poses on bilinear terrain."""
    n = pose.status.size
    steering, q = flat_steering(pose.steering), np.ascontiguousarray(pose.q.reshape(n, 6))
    position = (flat(pose.x), flat(pose.y), flat(pose.yaw))
    point, normal, found = np.empty((n, 6, 3)), np.empty((n, 6, 3)), np.empty(n, dtype=bool)
    ground, rover = pose.terrain.packed, pose.rover.packed
    parallel_for(touch_linear, n, ground, rover, *position, steering, q, TOUCHING, point, normal, found)
    left = np.flatnonzero(~found)
    if left.size:
        m = left.size
        turned = steering if len(steering) == 1 else steering[left]
        points, normals, count = np.empty((m, 6, 3)), np.empty((m, 6, 3)), np.empty((m, 6), dtype=np.int64)
        parallel_for(
            contacts_batch, m, ground, rover, *(values[left] for values in position), turned, q[left], TOUCHING,
            np.empty((m, 6)), np.empty((m, 6)), points, normals, count,
        )  # fmt: skip
        point[left], normal[left] = points, normals
    return point, normal
