"""How wheels and joints move the body: the paper's eqs 6-9, derived in docs/jacobians.md."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._kernels import jacobians as kernel
from .errors import RockerbogieError
from .frames import check_steering, joint_angles
from .rover import Rover

Array = NDArray[np.float64]

#: Columns of eq. 9's Jacobian, each a rate: rad/s, and m/s for the two slips along the ground.
JACOBIAN_COLUMNS = (
    "rocker",
    "bogie_left",
    "bogie_right",
    "steering",
    "wheel",
    "roll_slip",
    "side_slip",
    "turn_slip",
    "contact_angle",
)
#: Columns of the whole rover's system: the suspension's rates, then each other rate wheel by wheel.
SYSTEM_COLUMNS = JACOBIAN_COLUMNS[:3] + tuple(f"{name}_{i}" for name in JACOBIAN_COLUMNS[3:] for i in range(6))


class Stance(Protocol):
    """What motion needs to know of a pose. `rockerbogie.Pose` is one."""

    @property
    def rocker(self) -> Array:
        """(...) left rocker angle, rad."""

    @property
    def bogie(self) -> Array:
        """(..., 2) bogie angles, left and right, rad."""

    @property
    def contact_angle(self) -> Array:
        """(..., 6) δ, rad."""


def stance_angles(rover: Rover, pose: Stance, steering: ArrayLike | None) -> tuple[Array, Array, Array, Array]:
    """Rocker (...), bogie (..., 2), steering and contact angles (..., 6), broadcast together, rad.

    Steering that is not given is the pose's own, or straight ahead where it has none.
    """
    if steering is None:
        steering = getattr(pose, "steering", None)
    q, b, s = joint_angles(rover, pose.rocker, pose.bogie, check_steering(rover, steering))
    delta = np.asarray(pose.contact_angle, dtype=float)
    if delta.shape[-1:] != (6,):
        raise RockerbogieError(f"contact_angle has shape {delta.shape}; its last axis must be 6, one angle a wheel")
    shape = np.broadcast_shapes(q.shape, delta.shape[:-1])
    wide = (*shape, 6)
    return np.broadcast_to(q, shape), np.broadcast_to(b, (*shape, 2)), np.broadcast_to(s, wide), np.broadcast_to(delta, wide)


def wheel_jacobians(rover: Rover, pose: Stance, steering: ArrayLike | None = None) -> Array:
    """J (..., 6, 6, 9) of eq. 9: body twist = J[i] · rates, for each wheel i.

    Rows are the twist (vx, vy, vz, ωx, ωy, ωz) of the body against the ground, in the body frame, m/s and rad/s.
    Columns are `JACOBIAN_COLUMNS`. `wheel` is eq. 6's θ̇: how fast the wheel rolls off its rim, forward positive; a motor
    that turns at ω to its link rolls ω − contact_angle's rate. A wheel that does not steer has zeros under `steering`;
    through the differential, `rocker` (the left one's rate) moves the right wheels by its derivative.

    Args:
        pose: rocker (...), bogie (..., 2), contact_angle (..., 6), rad: a `Pose`, or anything that has them.
        steering: (..., 6) rad; default the pose's own.

    Raises:
        RockerbogieError: a shape that does not fit, or steering on a wheel that does not steer.
    """
    q, b, s, delta = stance_angles(rover, pose, steering)
    J = np.zeros((q.size, 6, 6, 9))
    flat = (np.ascontiguousarray(a.reshape(q.size, *a.shape[q.ndim :])) for a in (q, b, s, delta))
    kernel.wheel_jacobians_batch(rover.packed, *flat, J)
    J[:, ~rover.steers, :, kernel.STEERING] = 0.0
    return J.reshape(*q.shape, 6, 6, 9)


def system_jacobian(rover: Rover, pose: Stance, steering: ArrayLike | None = None) -> Array:
    """S (..., 36, 39): the six of eq. 9 stacked, (I, I, I, I, I, I)ᵀ · twist = S · rates.

    Columns are `SYSTEM_COLUMNS`; the suspension's three rates are shared, the other six belong to one wheel each.
    """
    J = wheel_jacobians(rover, pose, steering)
    S = np.zeros((*J.shape[:-3], 36, 39))
    for i in range(6):
        rows = slice(6 * i, 6 * i + 6)
        S[..., rows, :3] = J[..., i, :, :3]
        S[..., rows, 3 + i :: 6] = J[..., i, :, 3:]
    return S
