"""Rotations and Euler angles: R = Rz(yaw) Ry(pitch) Rx(roll), right-handed, in radians."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array

Angle = TypeVar("Angle", float, Array)


def wrap_angle(angle: Angle) -> Angle:
    """Return the angle in [-π, π) that differs by whole turns.

    Args:
        angle: (...) rad.

    Returns:
        (...) rad; a float for a float.
    """
    return (angle + np.pi) % (2 * np.pi) - np.pi


def rotation_x(angle: ArrayLike) -> Array:
    """Return the rotation matrix about x.

    Args:
        angle: (...) rad, positive is left side up.

    Returns:
        (..., 3, 3).
    """
    return _rotation(angle, 1, 2)


def rotation_y(angle: ArrayLike) -> Array:
    """Return the rotation matrix about y.

    Args:
        angle: (...) rad, positive is nose down.

    Returns:
        (..., 3, 3).
    """
    return _rotation(angle, 2, 0)


def rotation_z(angle: ArrayLike) -> Array:
    """Return the rotation matrix about z.

    Args:
        angle: (...) rad, positive is a left turn.

    Returns:
        (..., 3, 3).
    """
    return _rotation(angle, 0, 1)


def _rotation(angle: ArrayLike, i: int, j: int) -> Array:
    """Return the rotation (..., 3, 3) by an angle (...), rad, that turns axis i towards axis j."""
    a = np.asarray(angle, dtype=float)
    R = np.zeros((*a.shape, 3, 3))
    k = 3 - i - j
    R[..., k, k] = 1.0
    R[..., i, i] = R[..., j, j] = np.cos(a)
    R[..., j, i] = np.sin(a)
    R[..., i, j] = -R[..., j, i]
    return R


def body_transform(x: ArrayLike, y: ArrayLike, z: ArrayLike, roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Array:
    """Return T_world_body = Rz(yaw) Ry(pitch) Rx(roll) at (x, y, z).

    This is eq. 10 with the paper's signs corrected.

    Args:
        x, y, z: (...) position of the body's reference point, m.
        roll, pitch, yaw: (...) rad; all six broadcast together.

    Returns:
        (..., 4, 4).
    """
    parts = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (x, y, z, roll, pitch, yaw)))
    T = np.zeros((*parts[0].shape, 4, 4))
    T[..., :3, :3] = rotation_z(parts[5]) @ rotation_y(parts[4]) @ rotation_x(parts[3])
    T[..., :3, 3] = np.stack(parts[:3], axis=-1)
    T[..., 3, 3] = 1.0
    return T


def euler_angles(R: Array) -> tuple[Array, Array, Array]:
    """Return roll, pitch and yaw of rotation matrices R = Rz(yaw) Ry(pitch) Rx(roll).

    Args:
        R: (..., 3, 3) body to world.

    Returns:
        Roll, pitch and yaw (...), rad; roll and yaw in [-π, π], pitch in [-π/2, π/2].
    """
    roll, yaw = np.arctan2(R[..., 2, 1], R[..., 2, 2]), np.arctan2(R[..., 1, 0], R[..., 0, 0])
    return roll, -np.arcsin(np.clip(R[..., 2, 0], -1, 1)), yaw


def quaternion_angles(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a unit quaternion.

    Args:
        w, x, y, z: body to world, scalar first; its length is not checked.

    Returns:
        Roll, pitch and yaw, rad.
    """
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x**2 + y**2))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))
    return float(roll), float(pitch), float(yaw)
