"""Contacts of settled poses as the kernels of statics take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels.simd.bilinear_touch import TOUCH_RISE
from .._kernels.statics.loads import FLUSH
from ..arrays import Array, flat, flat_steering
from ..errors import RockerbogieError, expect
from ..settling.engines import NO_TOUCH
from ..settling.line_support import belly_contacts, contact_lines
from ..settling.pose import Pose

#: Rise of a gap along a tread's width above which `span_batch` finds no line, m: its limit, with room for rounding.
NEARLY_FLUSH = 2.0 * FLUSH


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


def pack_contacts(pose: Pose, touch: Array = NO_TOUCH) -> PackedContacts:
    """Return the contacts of settled poses.

    Args:
        pose: (...) poses.
        touch: (n, 6, TOUCH_SIZE) contacts of `settle_with_contacts`, which may differ from `Pose.contacts` by rounding. Those
            that are NaN are taken from there; by default, all are.

    Returns:
        Arguments of the kernels, the batch on one axis.

    Raises:
        RockerbogieError: not a pose, or a rover without mass.
    """
    expect(pose, Pose, "pose", "settle one with rockerbogie.settle(rover, terrain, x, y, yaw)")
    if not pose.rover.mass > 0.0:
        raise RockerbogieError(f"rover {pose.rover.name!r} has no mass: give its masses, loads are shares of its weight")
    n = pose.status.size
    if np.isnan(touch).all():
        point, normal = _points_from_origin(pose), flat(pose.contact_normal, 6, 3)
        span = contact_lines(pose, point)
    else:
        point, normal, span = _kept_contacts(pose, touch)
    q, steering = np.ascontiguousarray(pose.q.reshape(n, 6)), flat_steering(pose.steering)
    return PackedContacts(
        pose.rover.packed, flat(pose.yaw), steering, q, point, normal, span, np.ascontiguousarray(pose.joint_stop).reshape(n, 3),
        *belly_contacts(pose),
    )  # fmt: skip


def _points_from_origin(pose: Pose) -> Array:
    """Return contact points from the body's origin, (n, 6, 3) m; NaN off the ground."""
    origin = np.stack([pose.x, pose.y, pose.z], axis=-1).reshape(-1, 1, 3)
    point = flat(pose.contact_point, 6, 3) - origin
    point[pose.wheel_lifted.reshape(-1, 6)] = np.nan
    return point


def _kept_contacts(pose: Pose, touch: Array) -> tuple[Array, Array, Array]:
    """Return points, normals and lines of the contacts of six-wheel poses from `touch`."""
    point, normal = np.ascontiguousarray(touch[..., :3]), np.ascontiguousarray(touch[..., 3:6])
    lost = np.isnan(touch[:, 0, 0])
    if lost.any():
        few = _some(pose, lost)
        point[lost], normal[lost] = _points_from_origin(few), few.contact_normal
    long = lost | (touch[..., TOUCH_RISE].min(axis=1) < NEARLY_FLUSH)
    if not (long.any() and pose.rover.wheel_width.any()):
        return point, normal, np.zeros((1, 6, 3))
    span, middle = np.zeros_like(point), point[long]
    span[long] = contact_lines(_some(pose, long), middle)
    point[long] = middle
    return point, normal, span


def _some(pose: Pose, where: NDArray[np.bool_]) -> Pose:
    """Return those poses (m,) of contact mode that a mask (n,) selects."""
    at, steering = where.reshape(pose.shape), flat_steering(pose.steering)
    turn = steering[where] if len(steering) > 1 else np.broadcast_to(steering, (int(where.sum()), 6))
    return Pose(pose.rover, pose.terrain, pose.x[at], pose.y[at], pose.yaw[at], turn, pose.q[at], pose.status[at])
