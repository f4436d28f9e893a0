"""Values between the rows of a log, and attitudes of a plane."""

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


def upright_angles(normal: Array) -> Array:
    """Return the roll and pitch at which normals in the body are vertical.

    Args:
        normal: (n, 3) unit vectors in the body frame.

    Returns:
        (n, 2) roll and pitch, rad.
    """
    return np.stack([np.arctan2(normal[:, 1], normal[:, 2]), -np.arcsin(np.clip(normal[:, 0], -1, 1))], axis=-1)
