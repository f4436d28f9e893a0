"""Navigation kinematics: the body's twist from the sensors on board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import RockerbogieError
from ..rover.model import Rover
from .jacobian import ContactState, batch_shape, contact_rows, reading

Array = NDArray[np.float64]

UNKNOWNS = 9  # twist, rocker rate, bogie rates


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
    readings: dict[str, tuple[Array, Array]] = {}
    noise = noise or SensorNoise()
    if rocker_rate is not None:
        readings["rocker_rate"] = _direct(reading("rocker_rate", rocker_rate)[..., None], [6], noise.joint_rate)
    if bogie_rates is not None:
        readings["bogie_rates"] = _direct(reading("bogie_rates", bogie_rates, 2), [7, 8], noise.joint_rate)
    if gyro is not None:
        readings["gyro"] = _direct(reading("gyro", gyro, 3), [3, 4, 5], noise.gyro)
    if inclinometer_rates is not None:
        readings["inclinometer_rates"] = _leaning(pose, reading("inclinometer_rates", inclinometer_rates, 2), noise.inclinometer)
    turned = np.zeros(6) if steering_rates is None else reading("steering_rates", steering_rates, 6)
    rolled = np.full(6, np.nan)
    if wheel_rates is not None:
        rolled = rover.wheel_radius * reading("wheel_rates", wheel_rates, 6)
    slip = np.zeros((6, 3)) if expected_slip is None else reading("expected_slip", expected_slip, 6, 3)
    rows = contact_rows(rover, pose, steering)
    given = {"steering_rates": turned.shape[:-1], "wheel_rates": rolled.shape[:-1], "expected_slip": slip.shape[:-2]}
    given |= {name: value.shape[:-1] for name, (_, value) in readings.items()}
    batch_shape(pose=rows.shape[:-3], **given)
    equations = [
        _equations(rows[..., 0, :], rolled + slip[..., 0], turned, noise.roll_slip),
        _equations(rows[..., 1, :], slip[..., 1], turned, noise.side_slip),
        _equations(rows[..., 2, :], slip[..., 2], turned, noise.lift),
        *readings.values(),
        *(_prior_equations(pose, readings, prior) if prior is not None else ()),
    ]
    shape = np.broadcast_shapes(rows.shape[:-3], turned.shape[:-1], *(value.shape[:-1] for _, value in equations))
    A = np.concatenate([np.broadcast_to(a, (*shape, *a.shape[-2:])) for a, _ in equations], axis=-2)
    b = np.concatenate([np.broadcast_to(v, (*shape, v.shape[-1])) for _, v in equations], axis=-1)
    x, covariance = _least_squares(A, b)
    # Unknowns that are not determined are NaN, and so is every contact that depends on them.
    contact = np.einsum("...ijk,...k->...ij", rows[..., :3, :9], x) + rows[..., :3, 9] * turned[..., None]
    contact[..., 0] -= rolled
    return Motion(x[..., :6], covariance[..., :6, :6], x[..., 6], x[..., 7:], contact)


def _equations(row: Array, value: Array, steering_rates: Array, sigma: ArrayLike) -> tuple[Array, Array]:
    """Return the whitened equations row · unknowns = value; a NaN value removes its equation."""
    weight = 1.0 / np.asarray(sigma, dtype=float)
    right = value - row[..., 9] * steering_rates
    known = np.isfinite(right) & np.isfinite(row).all(axis=-1)
    weight = np.where(known, weight, 0.0)
    return weight[..., None] * np.where(known[..., None], row[..., :UNKNOWNS], 0.0), weight * np.where(known, right, 0.0)


def _direct(value: Array, columns: list[int], sigma: ArrayLike) -> tuple[Array, Array]:
    """Return the whitened equations of sensors that measure the unknowns of `columns`."""
    row = np.eye(UNKNOWNS + 1)[columns]
    return _equations(np.broadcast_to(row, (*value.shape[:-1], *row.shape)), value, np.zeros(1), sigma)


def _prior_equations(pose: ContactState, readings: dict[str, tuple[Array, Array]], prior: RatePrior) -> list[tuple[Array, Array]]:
    """Return whitened equations `rate = 0` of the unknowns that no reading measures."""
    found = []
    for columns, sigma in (([6], prior.joint), ([7, 8], prior.joint), ([3, 4], prior.tilt)):
        width = np.asarray(sigma, dtype=float)[..., None]
        seen = np.zeros((), dtype=bool)
        for rows, _ in readings.values():
            seen = seen | (np.abs(rows[..., columns]) > 0).any(axis=(-1, -2))
        if seen.all():
            continue
        value = np.where(seen, np.nan, np.zeros(width.shape[:-1]))[..., None]
        value = np.broadcast_to(value, (*value.shape[:-1], len(columns)))
        if columns == [3, 4] and hasattr(pose, "pitch") and not callable(getattr(pose, "roll", len)):
            found.append(_leaning(pose, value, width))
        else:
            found.append(_direct(value, columns, width))
    return found


def _leaning(pose: ContactState, rates: Array, sigma: ArrayLike) -> tuple[Array, Array]:
    """Return the whitened equations of roll and pitch rate by angular velocity (eq. 10)."""
    if not (hasattr(pose, "roll") and hasattr(pose, "pitch")) or callable(pose.roll):  # a Dataset's roll is its method
        raise RockerbogieError("inclinometer_rates need the attitude: give a pose that has roll and pitch")
    roll, pitch = np.asarray(pose.roll, dtype=float), np.asarray(pose.pitch, dtype=float)
    row = np.zeros((*np.broadcast_shapes(roll.shape, pitch.shape), 2, UNKNOWNS + 1))
    row[..., 0, 3] = 1.0
    row[..., 0, 4], row[..., 0, 5] = np.sin(roll) * np.tan(pitch), np.cos(roll) * np.tan(pitch)
    row[..., 1, 4], row[..., 1, 5] = np.cos(roll), -np.sin(roll)
    return _equations(row, rates, np.zeros(1), sigma)


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
