"""Navigation kinematics: the body's twist from the sensors on board."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

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
_STILL = np.zeros(3)


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
    noise, prior, rate = noise or SensorNoise(), prior or RatePrior(), np.zeros(2)
    unmeasured = np.full(3, np.nan)
    wheels = rover.wheel_radius * (np.full(6, np.nan) if wheel_rates is None else reading("wheel_rates", wheel_rates, 6))
    slip = np.zeros((6, 3)) if expected_slip is None else reading("expected_slip", expected_slip, 6, 3)
    rocker = unmeasured[:1] if rocker_rate is None else reading("rocker_rate", rocker_rate)[..., None]
    bogies = unmeasured[:2] if bogie_rates is None else reading("bogie_rates", bogie_rates, 2)
    angular = unmeasured if gyro is None else reading("gyro", gyro, 3)
    tilting = unmeasured[:2] if inclinometer_rates is None else reading("inclinometer_rates", inclinometer_rates, 2)
    turned = np.zeros(6) if steering_rates is None else reading("steering_rates", steering_rates, 6)
    planes = contact_planes(rover, pose)
    turn = planes.steering if steering is None else check_steering(rover, steering)
    tilt = _attitude(pose)
    if tilt is None and inclinometer_rates is not None:
        raise RockerbogieError("inclinometer_rates need the attitude: give a pose that has roll and pitch")
    if tilt is not None:  # without an attitude, its rates say nothing
        unknown = np.isnan(tilt)
        if unknown.any():
            lost = unknown.any(axis=-1, keepdims=True)
            tilting, rate = np.where(lost, np.nan, tilting), np.where(lost, np.nan, rate)
    given = {"wheel_rates": wheels, "rocker_rate": rocker, "bogie_rates": bogies, "gyro": angular, "inclinometer_rates": tilting}
    shapes = {name: value.shape[:-1] for name, value in (given | {"steering_rates": turned, "steering": turn}).items()}
    shape = batch_shape(pose=planes.shape, expected_slip=slip.shape[:-2], **shapes)
    parts: list[tuple[int, int, Array, Any]] = [
        (at.E_ALONG, 6, wheels + slip[..., 0], noise.roll_slip),
        (at.E_ACROSS, 6, slip[..., 1], noise.side_slip),
        (at.E_OFF, 6, slip[..., 2], noise.lift),
        (at.E_JOINT, 1, rocker, noise.joint_rate),
        (at.E_JOINT + 1, 2, bogies, noise.joint_rate),
        (at.E_GYRO, 3, angular, noise.gyro),
        (at.E_TILT, 2, tilting, noise.inclinometer),
        (at.E_PRIOR_JOINT, 3, _STILL, prior.joint if isinstance(prior.joint, float) else np.asarray(prior.joint)[..., None]),
        (at.E_PRIOR_TILT, 2, rate, prior.tilt if isinstance(prior.tilt, float) else np.asarray(prior.tilt)[..., None]),
    ]
    for _, size, _, sigma in parts:
        if isinstance(sigma, float) and sigma > 0.0:  # a number fits every shape
            continue
        if not (np.asarray(sigma, dtype=float) > 0).all() or np.shape(sigma)[-1:] not in ((), (1,), (size,)):
            raise RockerbogieError(f"a standard deviation of {sigma!r:.60} is not above 0, or does not fit {size} readings")
        shape = np.broadcast_shapes(shape, np.broadcast_shapes(np.shape(sigma), (size,))[:-1])
    values, sigmas = np.empty((*shape, at.E_SIZE)), np.empty((*shape, at.E_SIZE))
    for first, size, value, sigma in parts:
        values[..., first : first + size] = value
        sigmas[..., first : first + size] = sigma
    readings = planes.readings(shape, turn)
    readings[..., at.R_STEERING_RATE : at.R_STEERING_RATE + 6] = turned
    n = math.prod(shape)
    A, counts, rows = np.empty((n, at.E_SIZE, UNKNOWNS + 1)), np.empty(n, dtype=np.int64), np.empty((*shape, 6, 4, UNKNOWNS + 1))
    x, covariance = np.empty((n, UNKNOWNS)), np.empty((n, UNKNOWNS, UNKNOWNS))
    tilts = np.full((n, 2), np.nan) if tilt is None else flat(spanned(tilt, (*shape, 2)), 2)
    parallel_for(
        kernel.twist_batch, n, rover.packed, rover.steers.copy(), flat(readings, at.R_SIZE), *planes.flat(shape),
        steering is not None, tilts, flat(values, at.E_SIZE), flat(sigmas, at.E_SIZE),
        A, counts, x, covariance, flat(rows, 6, 4, UNKNOWNS + 1),
    )  # fmt: skip
    open_ = counts < 0
    if open_.any():  # sensors that do not determine the whole motion
        x[open_], covariance[open_] = _least_squares(A[open_, :, :UNKNOWNS], A[open_, :, UNKNOWNS])
    x, covariance = x.reshape(*shape, UNKNOWNS), covariance.reshape(*shape, UNKNOWNS, UNKNOWNS)
    # Unknowns that are not determined are NaN, and so is every contact that depends on them.
    contact = (rows[..., :3, :UNKNOWNS] @ x[..., None, :, None])[..., 0] + rows[..., :3, UNKNOWNS] * turned[..., None]
    contact[..., 0] -= wheels
    return Motion(x[..., :6], covariance[..., :6, :6], x[..., 6], x[..., 7:], contact)


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
