"""Navigation kinematics: the body's twist from the sensors on board."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from .._kernels.jit.parallel import parallel_for
from .._kernels.odometry import layout as at
from .._kernels.odometry import twist as kernel
from ..arrays import Array, flat, spanned
from ..errors import RockerbogieError
from ..rover.frames import check_steering
from ..rover.model import Rover
from ..settling.pose import Pose
from .jacobian import ContactState, batch_shape, contact_planes, reading

UNKNOWNS = 9  # twist, rocker rate, bogie rates
#: Columns of readings that each argument fills, and the lengths of its last axes.
SENSORS: dict[str, tuple[int | slice, tuple[int, ...]]] = {
    "wheel_rates": (slice(at.R_WHEEL, at.R_WHEEL + 6), (6,)),
    "steering_rates": (slice(at.R_STEERING_RATE, at.R_STEERING_RATE + 6), (6,)),
    "rocker_rate": (at.R_ROCKER_RATE, ()),
    "bogie_rates": (slice(at.R_BOGIE_RATE, at.R_BOGIE_RATE + 2), (2,)),
    "gyro": (slice(at.R_GYRO, at.R_GYRO + 3), (3,)),
    "inclinometer_rates": (slice(at.R_TILT_RATE, at.R_TILT_RATE + 2), (2,)),
}
_NO_SLIP = np.zeros((6, 3))


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of the readings: numbers or arrays that broadcast with the reading."""

    roll_slip: ArrayLike = 5e-3  # m/s
    side_slip: ArrayLike = 5e-3  # m/s
    lift: ArrayLike = 1e-3  # m/s: uncertainty of the contact angle times the speed
    joint_rate: ArrayLike = 1e-3  # rad/s, rocker and bogies
    gyro: ArrayLike = 1e-4  # rad/s
    inclinometer: ArrayLike = 1e-2  # rad/s


#: Old name of `SensorNoise`.
Noise = SensorNoise


@dataclass(frozen=True)
class RatePrior:
    """Standard deviations of unmeasured rates about 0: numbers or arrays (...)."""

    joint: ArrayLike = np.inf  # rad/s, rocker and bogies
    tilt: ArrayLike = np.inf  # rad/s, rates of roll and pitch; ωx and ωy if the pose has neither


_NOISE, _PRIOR = SensorNoise(), RatePrior()


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of the body from its sensors.

    Components that the sensors do not determine are NaN, with infinite covariance.
    """

    twist: Array  # (..., 6) vx, vy, vz, ωx, ωy, ωz in the body frame, m/s and rad/s
    covariance: Array  # (..., 6, 6) of the twist
    rocker_rate: Array  # (...) rad/s
    bogie_rates: Array  # (..., 2) rad/s
    residual: Array  # (..., 6, 3) roll slip, side slip and lift of each contact, m/s; expected ones included


def body_twist(
    rover: Rover,
    pose: ContactState,
    *,
    wheel_rates: ArrayLike | None = None,
    rocker_rate: ArrayLike | None = None,
    bogie_rates: ArrayLike | None = None,
    steering_rates: ArrayLike | None = None,
    gyro: ArrayLike | None = None,
    inclinometer_rates: ArrayLike | None = None,
    steering: ArrayLike | None = None,
    expected_slip: ArrayLike | None = None,
    noise: SensorNoise | None = None,
    prior: RatePrior | None = None,
) -> Motion:
    """Compute the body's twist from any of its sensors by weighted least squares.

    The equations are the contacts of six wheels and the sensors' own.

    Each wheel gives three equations: its tread does not slip along or across, and does not leave the terrain. Rates that are
    not measured are unknowns beside the twist. NaN marks a missing reading.

    Args:
        rover: the pose's rover.
        pose: joint and contact angles, as for `wheel_jacobians`.
        wheel_rates: (..., 6) of each motor, wheel relative to its link, forward positive, rad/s.
        rocker_rate, bogie_rates: (...) of the left rocker and (..., 2), rad/s.
        steering_rates: (..., 6) rad/s; default 0.
        gyro: (..., 3) angular velocity in the body frame, rad/s.
        inclinometer_rates: (..., 2) rates of roll and pitch, rad/s; needs a pose that has `roll` and `pitch`.
        steering: (..., 6) rad; default: the pose's own.
        expected_slip: (..., 6, 3) roll slip, side slip and lift of each wheel, from a soil model or a terrain slope, m/s;
            default 0.
        noise: standard deviations of the readings.
        prior: expected size of rates without a reading: of joints, and of roll and pitch without gyro and inclinometer.
            Default: no prior.

    Returns:
        Motion, with batch axes from broadcasting all arguments.

    Raises:
        RockerbogieError: a pose of another rover, a reading whose shape does not fit, or that is infinite.
    """
    values = {
        "wheel_rates": wheel_rates, "steering_rates": steering_rates, "rocker_rate": rocker_rate, "bogie_rates": bogie_rates,
        "gyro": gyro, "inclinometer_rates": inclinometer_rates,
    }  # fmt: skip
    given = {name: reading(name, value, *SENSORS[name][1]) for name, value in values.items() if value is not None}
    slip = _NO_SLIP if expected_slip is None else reading("expected_slip", expected_slip, 6, 3)
    planes = contact_planes(rover, pose)
    turn = planes.steering if steering is None else check_steering(rover, steering)
    tilt = _attitude(pose)
    if tilt is None and inclinometer_rates is not None:
        raise RockerbogieError("inclinometer_rates need the attitude: give a pose that has roll and pitch")
    sigma = _deviations(noise or _NOISE, prior or _PRIOR)
    shapes = {name: value.shape[: value.ndim - len(SENSORS[name][1])] for name, value in given.items()}
    shape = batch_shape(
        pose=planes.shape, **shapes, expected_slip=slip.shape[:-2], steering=turn.shape[:-1], noise=sigma.shape[:-1],
        attitude=() if tilt is None else tilt.shape[:-1],
    )  # fmt: skip
    readings = planes.readings(shape, turn)
    for name, value in given.items():
        readings[..., SENSORS[name][0]] = value
    if tilt is not None:
        readings[..., at.R_TILT : at.R_TILT + 2] = tilt
    n = math.prod(shape)
    A, rows, is_open = np.empty((n, at.E_SIZE, UNKNOWNS + 1)), np.empty((n, 6, 4, UNKNOWNS + 1)), np.empty(n, dtype=np.bool_)
    x, covariance, residual = np.empty((n, UNKNOWNS)), np.empty((n, UNKNOWNS, UNKNOWNS)), np.empty((n, 6, 3))
    parallel_for(
        kernel.twist_batch, n, rover.packed, rover.steers.copy(), flat(readings, at.R_SIZE), *planes.flat(shape),
        steering is not None, tilt is not None, _shared(slip, shape, 6, 3), _shared(sigma, shape, at.E_SIZE),
        A, is_open, x, covariance, rows, residual,
    )  # fmt: skip
    if np.count_nonzero(is_open):  # sensors that do not determine the whole motion
        x[is_open], covariance[is_open] = _least_squares(A[is_open, :, :UNKNOWNS], A[is_open, :, UNKNOWNS])
        # Unknowns that are not determined are NaN, and so is every contact that depends on them.
        residual[is_open] += (rows[is_open, :, :3, :UNKNOWNS] @ x[is_open, None, :, None])[..., 0]
    x, covariance = x.reshape(*shape, UNKNOWNS), covariance.reshape(*shape, UNKNOWNS, UNKNOWNS)
    return Motion(x[..., :6], covariance[..., :6, :6], x[..., 6], x[..., 7:], residual.reshape(*shape, 6, 3))


def _shared(array: Array, shape: tuple[int, ...], *tail: int) -> Array:
    """Return an array as (n, *tail), as `flat`; or (1, *tail) if it has no batch axes."""
    return flat(array if array.ndim == len(tail) else spanned(array, (*shape, *tail)), *tail)


def _deviations(noise: SensorNoise, prior: RatePrior) -> Array:
    """Return the standard deviations (..., E_SIZE) of all equations of a twist."""
    sigmas = (
        noise.roll_slip, noise.side_slip, noise.lift, noise.joint_rate, noise.gyro, noise.inclinometer, prior.joint, prior.tilt
    )  # fmt: skip
    return _row_of_numbers(*sigmas) if {*map(type, sigmas)} == {float} else _row(*sigmas)


def _row(
    roll: ArrayLike, side: ArrayLike, lift: ArrayLike, joint: ArrayLike, gyro: ArrayLike, inclinometer: ArrayLike,
    prior_joint: ArrayLike, prior_tilt: ArrayLike,
) -> Array:  # fmt: skip
    """Return standard deviations as the columns (..., E_SIZE) that kernels take, or raise."""
    parts = (
        (at.E_ALONG, 6, roll), (at.E_ACROSS, 6, side), (at.E_OFF, 6, lift), (at.E_JOINT, 1, joint), (at.E_JOINT + 1, 2, joint),
        (at.E_GYRO, 3, gyro), (at.E_TILT, 2, inclinometer),
        (at.E_PRIOR_JOINT, 3, np.asarray(prior_joint)[..., None]), (at.E_PRIOR_TILT, 2, np.asarray(prior_tilt)[..., None]),
    )  # fmt: skip
    shape: tuple[int, ...] = ()
    for _, size, sigma in parts:
        if not (np.asarray(sigma, dtype=float) > 0).all() or np.shape(sigma)[-1:] not in ((), (1,), (size,)):
            raise RockerbogieError(f"a standard deviation of {sigma!r:.60} is not above 0, or does not fit {size} readings")
        shape = np.broadcast_shapes(shape, np.shape(sigma)[:-1])
    row = np.empty((*shape, at.E_SIZE))
    for first, size, sigma in parts:
        row[..., first : first + size] = sigma
    return row


#: `_row` for numbers: callers give the same ones in every call.
_row_of_numbers: Callable[..., Array] = lru_cache(maxsize=16)(_row)


def _attitude(pose: ContactState) -> Array | None:
    """Return roll and pitch (..., 2) of a pose, rad, or None if it has none."""
    if isinstance(pose, Pose):
        return pose.q[..., 1:3]
    if not (hasattr(pose, "roll") and hasattr(pose, "pitch")) or callable(pose.roll):  # a Dataset's roll is its method
        return None
    roll, pitch = np.asarray(pose.roll, dtype=float), np.asarray(pose.pitch, dtype=float)
    return np.stack(np.broadcast_arrays(roll, pitch), axis=-1)


def _least_squares(A: Array, b: Array) -> tuple[Array, Array]:
    """Return x (..., 9) of least |A x − b| and its covariance.

    Undetermined elements are NaN, with infinite covariance.
    """
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    seen = s > 1e-9 * s[..., :1]
    inverse = np.where(seen, 1.0 / np.where(seen, s, 1.0), 0.0)
    V = np.swapaxes(Vt, -1, -2)
    x = np.einsum("...ij,...j->...i", V * inverse[..., None, :], np.einsum("...ji,...j->...i", U, b))
    covariance = (V * inverse[..., None, :] ** 2) @ Vt
    open_ = (V**2 * ~seen[..., None, :]).sum(axis=-1) > 1e-12
    x[open_] = np.nan
    covariance[open_[..., :, None] | open_[..., None, :]] = np.inf
    return x, covariance
