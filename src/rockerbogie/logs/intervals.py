"""Values between the rows of a log, and rotations and screws over an interval."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def middle(values: Array) -> Array:
    """Return values midway between rows.

    Args:
        values: (n + 1, ...).

    Returns:
        (n, ...) means of consecutive rows.
    """
    return 0.5 * (values[1:] + values[:-1])


def rotation_vector(R: Array) -> Array:
    """Return the rotation vectors of rotations.

    Args:
        R: (n, 3, 3).

    Returns:
        (n, 3) axis times angle, rad.
    """
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def rotation(vector: Array) -> Array:
    """Return the rotations of rotation vectors.

    Args:
        vector: (n, 3) axis times angle, rad.

    Returns:
        (n, 3, 3).
    """
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def screw(phi: Array, rho: Array) -> Array:
    """Return the displacement by a constant twist in unit time, V(phi) rho on SE(3).

    Args:
        phi: (n, 3) rotation vector, rad.
        rho: (n, 3) velocity in the moving frame times the time, m.

    Returns:
        (n, 3) displacement in the frame at the start, m.
    """
    angle = np.linalg.norm(phi, axis=1, keepdims=True)
    small = angle < 1e-6
    a = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1 - np.cos(a)) / a**2)
    second = np.where(small, 1 / 6, (a - np.sin(a)) / a**3)
    once = np.cross(phi, rho)
    return np.asarray(rho + first * once + second * np.cross(phi, once))


def upright_angles(normal: Array) -> Array:
    """Return the roll and pitch at which normals in the body are vertical.

    Args:
        normal: (n, 3) unit vectors in the body frame.

    Returns:
        (n, 2) roll and pitch, rad.
    """
    return np.stack([np.arctan2(normal[:, 1], normal[:, 2]), -np.arcsin(np.clip(normal[:, 0], -1, 1))], axis=-1)
