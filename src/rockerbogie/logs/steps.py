"""Steps of odometry, shared by batch and filter: motion of an interval, and the track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._kernels.jit.parallel import parallel_for
from .._kernels.odometry import layout as at
from .._kernels.odometry import motion as motion_kernel
from .._kernels.odometry import track as track_kernel
from ..arrays import Array
from ..motion.body_twist import SensorNoise
from ..rover.model import Rover
from .intervals import upright_angles

#: Standard deviation of the angle between a wheel's path and the plane through all six, without a map, rad.
UNKNOWN_SLOPE = 0.15
#: The same with a map.
MAPPED_SLOPE = 0.1
#: Iterations between contact angles and velocities.
ROUNDS = 4
#: Least speed of a hub whose direction is used, m/s; sine of the steepest path of a hub.
STANDING, STEEPEST = 1e-4, 0.8
#: A wheel's slip beyond this many standard deviations loses weight.
OUTLIER = 3.0
#: Slip along and across a wheel's path as a share of the speed, and the least slip, m/s.
ROLL_SHARE, SIDE_SHARE, LEAST_SLIP = 0.1, 0.1, 1e-4
#: Expected size of rates that are not measured, of a joint and of roll and pitch, per wheelbase travelled, rad; the least, rad/s.
PRIOR_JOINT, PRIOR_TILT, LEAST_RATE = 0.1, 0.03, 1e-4
#: Correlation length of a wheel's slip, m, and its greatest correlation time, s.
SLIP_LENGTH, SLIP_TIME = 0.5, 10.0
#: Error of a measured attitude (roll, pitch, yaw), rad, and slip common to all wheels, relative to the distance.
ATTITUDE_SIGMA, COMMON_SLIP = (0.01, 0.01, 0.02), 0.005
#: Wheels whose RMS slip against each other exceeds this share of their rim speed, over this share of the wheelbase, do not all
#: roll on terrain: the rover may be stuck (docs/odometry.md). The first is twice `ROLL_SHARE`, the usual slip of a wheel.
DOUBT, DOUBT_LENGTH = 0.2, 0.25
#: Error of the level start where no attitude is measured, rad. Error of the length, as a share of the way, without an
#: attitude and without suspension sensors: the wheels roll over rocks on a longer way than the body. Set from simulated drives.
START_TILT, NO_ATTITUDE, NO_SUSPENSION = 0.05, 0.02, 0.025


@dataclass(frozen=True, eq=False)
class IntervalMotion:
    """Motion of the body over n intervals."""

    motion: Array  # (n, 9) twist in the body frame, m/s and rad/s, and rates of rocker and bogies, rad/s
    covariance: Array  # (n, 9, 9) of the motion
    residual: Array  # (n, 6, 3) roll slip, side slip and lift of each contact, m/s
    contact_angle: Array  # (n, 6) rad
    normal: Array  # (n, 3) unit normal of the plane through the hubs, in the body frame
    rolling: Array  # (n, 2) RMS of unexpected roll slip and of rim speed over the six wheels, m/s


def weights_of(rover: Rover, slope: float, joint_error: float, soil: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Return the standard deviations of slip and rates as the kernels take them.

    Args:
        rover: gives the wheelbase.
        slope: standard deviation of the contact angles, rad.
        joint_error: error of the suspension's rates from its resolution, rad/s.
        soil: slip per unit of slope, along and across.

    Returns:
        (W_SIZE,).
    """
    usual = SensorNoise()
    w = np.zeros(at.W_SIZE)
    w[at.W_ROLL], w[at.W_SIDE], w[at.W_LIFT], w[at.W_LEAST] = ROLL_SHARE, SIDE_SHARE, slope, LEAST_SLIP
    w[at.W_JOINT_RATE] = np.hypot(usual.joint_rate, joint_error)
    w[at.W_GYRO], w[at.W_TILT_RATE] = usual.gyro, usual.inclinometer
    w[at.W_PRIOR_JOINT], w[at.W_PRIOR_TILT], w[at.W_PRIOR_LEAST] = PRIOR_JOINT, PRIOR_TILT, LEAST_RATE
    w[at.W_WHEELBASE], w[at.W_ROUNDS] = rover.wheelbase, ROUNDS
    w[at.W_STANDING], w[at.W_STEEPEST], w[at.W_OUTLIER] = STANDING, STEEPEST, OUTLIER
    w[at.W_SOIL : at.W_SOIL + 2] = soil
    return w


def track_noise(wheelbase: float, no_attitude: float, no_suspension: float) -> Array:
    """Return the noise of a track as the kernels take it.

    Args:
        wheelbase: of the rover, m.
        no_attitude: share of the way without a measured attitude, 0 to 1.
        no_suspension: share of the way without suspension sensors, 0 to 1.

    Returns:
        (N_SIZE,).
    """
    noise = np.empty(at.N_SIZE)
    noise[at.N_SLIP_LENGTH], noise[at.N_SLIP_TIME] = SLIP_LENGTH, SLIP_TIME
    noise[at.N_ATTITUDE : at.N_ATTITUDE + 3] = ATTITUDE_SIGMA
    noise[at.N_SHARED] = COMMON_SLIP**2 + no_attitude * NO_ATTITUDE**2 + no_suspension * NO_SUSPENSION**2
    # each wheel leaves the mean plane by its slope over the way on which slopes are alike; six of them carry the body, and the
    # height of the track is a difference of two such heights, at its end and at its start
    noise[at.N_HEIGHT] = 2.0 * (UNKNOWN_SLOPE * SLIP_LENGTH) ** 2 / 6.0
    noise[at.N_DOUBT_LENGTH], noise[at.N_DOUBT] = DOUBT_LENGTH * wheelbase, DOUBT
    return noise


def interval_motion(rover: Rover, weights: Array, reading: Array, climb: Array | None = None) -> IntervalMotion:
    """Solve for motion and contact angles of each interval.

    Args:
        rover: the rover.
        weights: of `weights_of`.
        reading: (n, R_SIZE) readings.
        climb: (n,) speed of the body off the plane of its wheels, m/s; `None` without a map.

    Returns:
        The motion of the n intervals.
    """
    n = len(reading)
    found = IntervalMotion(
        np.empty((n, 9)), np.empty((n, 9, 9)), np.empty((n, 6, 3)), np.empty((n, 6)), np.empty((n, 3)), np.empty((n, 2))
    )
    upward = np.full(1, np.nan) if climb is None else np.ascontiguousarray(climb)
    parallel_for(
        motion_kernel.motion_batch, n, rover.packed, rover.steers.copy(), weights, np.ascontiguousarray(reading), upward,
        found.motion, found.covariance, found.residual, found.contact_angle, found.normal, found.rolling,
    )  # fmt: skip
    return found


def new_track(start: tuple[float, float, float], attitude: Array, normal: Array) -> Array:
    """Return the state of a track at its start.

    Args:
        start: x, y, z, m.
        attitude: (3,) measured roll, pitch, yaw, rad; NaN where not measured.
        normal: (3,) of the hubs' plane in the body, which is taken to be level where roll and pitch are not measured.

    Returns:
        (T_SIZE,).
    """
    state = np.zeros(at.T_SIZE)
    tilted, headed = bool(np.isfinite(attitude[:2]).all()), bool(np.isfinite(attitude[2]))
    roll, pitch = attitude[:2] if tilted else upright_angles(normal[None])[0]
    rotation = np.empty((3, 3))
    track_kernel.rotation_of(float(roll), float(pitch), float(attitude[2]) if headed else 0.0, rotation)
    state[at.T_ROTATION : at.T_ROTATION + 9] = rotation.ravel()
    sigma = np.where([tilted, tilted, headed], ATTITUDE_SIGMA, (START_TILT, START_TILT, 0.0))  # the start defines the heading
    covariance = state[at.T_COVARIANCE : at.T_COVARIANCE + 36].reshape(6, 6)
    covariance[3:, 3:] = np.diag(sigma**2)
    state[at.T_START : at.T_START + 3] = start
    return state


def continue_track(
    state: Array, noise: Array, dt: Array, motion: IntervalMotion, attitude: Array, height: Array | None = None
) -> tuple[Array, Array, Array]:
    """Continue a track by n intervals.

    Args:
        state: (T_SIZE,), updated in place.
        noise: of `track_noise`.
        dt: (n,) s.
        motion: of the intervals.
        attitude: (n, 3) measured roll, pitch, yaw at their ends, rad; NaN where not measured.
        height: (n,) z at their ends by a map, m, NaN where not known; `None` without a map.

    Returns:
        Poses T_world_body (n, 4, 4), their covariance (n, 6, 6), and (n, 3) horizontal and three-dimensional length, m, and the
        slip share.
    """
    n = len(dt)
    T, P, lengths_slip = np.empty((n, 4, 4)), np.empty((n, 6, 6)), np.empty((n, 3))
    z = np.full(1, np.nan) if height is None else np.ascontiguousarray(height)
    measured = np.ascontiguousarray(attitude)
    track_kernel.track_batch(
        state, noise, dt, motion.motion, motion.covariance, motion.rolling, measured, z, T, P, lengths_slip, 0, n
    )
    return T, P, lengths_slip


def pose_of(state: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Return pose, covariance, lengths and slip share of a track.

    Args:
        state: (T_SIZE,).
        noise: of `track_noise`.

    Returns:
        T_world_body (4, 4), covariance (6, 6), and (3,) horizontal and three-dimensional length, m, and the slip share.
    """
    T, P, lengths_slip = np.empty((4, 4)), np.empty((6, 6)), np.empty(3)
    track_kernel.set_pose(state, noise, T, P, lengths_slip)
    return T, P, lengths_slip


def turns(attitude: Array) -> Array:
    """Return the rotation vectors between consecutive attitudes.

    Args:
        attitude: (n + 1, 3) roll, pitch, yaw, rad.

    Returns:
        (n, 3) axis times angle in the body frame, rad.
    """
    found = np.empty((len(attitude) - 1, 3))
    track_kernel.turns_batch(np.ascontiguousarray(attitude), found, 0, len(found))
    return found
