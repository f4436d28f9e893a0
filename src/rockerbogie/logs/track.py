"""Track of odometry: integration of twists on SE(3), covariance, and Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..motion.body_twist import Motion
from ..rotations import body_transform, euler_angles
from ..rover.model import Rover
from .intervals import rotation, rotation_vector, screw
from .readings import Readings

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Correlation length of a wheel's slip, m, and its greatest correlation time, s.
SLIP_LENGTH, SLIP_TIME = 0.5, 10.0
#: Error of a measured attitude (roll, pitch, yaw), rad, and slip common to all wheels, relative to the distance.
ATTITUDE_SIGMA, COMMON_SLIP = (0.01, 0.01, 0.02), 0.005
#: Error of the level start where no attitude is measured, rad. Error of the length, as a share of the way, without an
#: attitude and without suspension sensors: the wheels roll over rocks on a longer way than the body. Set from simulated drives.
START_TILT, NO_ATTITUDE, NO_SUSPENSION = 0.05, 0.02, 0.025

TWIST, POSE = ("vx", "vy", "vz", "wx", "wy", "wz"), ("x", "y", "z", "about_x", "about_y", "about_z")


def integrate(s: Readings, twist: Array, start: tuple[float, ...], level: tuple[float, float]) -> Array:
    """Integrate twists to poses: one screw per interval.

    Attitude in the log replaces the integrated one: all of it, or roll and pitch.

    Args:
        s: readings, with n intervals.
        twist: (n, 6) of the body in its own frame, m/s and rad/s.
        start: x, y, z of the first pose, m.
        level: roll and pitch of the first pose, rad, if the log has none.

    Returns:
        (n + 1, 4, 4) T_world_body.
    """
    n = len(twist)
    dt = np.diff(s.time)
    roll, pitch = s.lean[0] if s.lean is not None else level
    T = np.tile(np.eye(4), (n + 1, 1, 1))
    T[0] = body_transform(start[0], start[1], start[2], roll, pitch, 0.0 if s.yaw is None else s.yaw[0])
    turn = rotation(twist[:, 3:] * dt[:, None])
    if s.lean is not None and s.yaw is not None:
        T[:, :3, :3] = body_transform(0, 0, 0, s.lean[:, 0], s.lean[:, 1], s.yaw)[:, :3, :3]
    else:
        for k in range(n):
            R = T[k, :3, :3] @ turn[k]
            if s.lean is not None:
                R = body_transform(0, 0, 0, s.lean[k + 1, 0], s.lean[k + 1, 1], np.arctan2(R[1, 0], R[0, 0]))[:3, :3]
            T[k + 1, :3, :3] = R
    phi = rotation_vector(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3])
    moved = screw(phi, twist[:, :3] * dt[:, None])
    T[1:, :3, 3] = T[0, :3, 3] + np.cumsum(np.einsum("nij,nj->ni", T[:-1, :3, :3], moved), axis=0)
    return T


def pose_covariance(rover: Rover, s: Readings, T: Array, motion: Motion) -> Array:
    """Return the covariance of position and rotation along the track, to first order.

    Errors of the twist are correlated over `SLIP_LENGTH`; a measured attitude has a constant error `ATTITUDE_SIGMA`; all
    wheels share a slip of `COMMON_SLIP`. Without an attitude or suspension sensors, the start and the length are uncertain too.

    Args:
        s: readings, with n intervals.
        T: (n + 1, 4, 4) poses.
        motion: of `body_twist`, with its covariance.

    Returns:
        (n + 1, 6, 6) m² and rad²; rotation about fixed axes.
    """
    n, dt = len(motion.twist), np.diff(s.time)
    speed = np.linalg.norm(motion.twist[:, :3], axis=1)
    alike = np.clip(SLIP_LENGTH / np.maximum(speed, 1e-9), dt, np.maximum(dt, SLIP_TIME))
    turn = np.zeros((n, 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = T[:-1, :3, :3]
    Q = (
        turn
        @ np.clip(np.nan_to_num(motion.covariance, posinf=1.0), -1.0, 1.0)
        @ np.swapaxes(turn, 1, 2)
        * (dt * alike)[:, None, None]
    )
    measured = np.array([s.lean is not None, s.lean is not None, s.yaw is not None])
    fixed = np.concatenate([np.ones(3), ~measured])
    Q *= fixed[:, None] * fixed
    P = np.zeros((n + 1, 6, 6))
    start = np.where(measured, ATTITUDE_SIGMA, (START_TILT, START_TILT, 0.0))  # the start defines the heading
    P[0, 3:, 3:] = np.diag(start**2)
    step = np.diff(T[:, :3, 3], axis=0)
    F = np.tile(np.eye(6), (n, 1, 1))
    F[:, 0, 4], F[:, 0, 5], F[:, 1, 5] = step[:, 2], -step[:, 1], step[:, 0]  # -[step]x
    F[:, 1, 3], F[:, 2, 3], F[:, 2, 4] = -step[:, 2], step[:, 1], -step[:, 0]
    for k in range(n):
        P[k + 1] = F[k] @ P[k] @ F[k].T + Q[k]
    moved = T[:, :3, 3] - T[0, :3, 3]
    joints = "rocker_rate" in s.measured and "bogie_rates" in s.measured
    shared = COMMON_SLIP**2 + (0.0 if s.lean is not None else NO_ATTITUDE**2) + (0.0 if joints else NO_SUSPENSION**2)
    P[:, :3, :3] += shared * moved[:, :, None] * moved[:, None, :]
    return P


def path_length(T: Array, axes: int = 3) -> Array:
    """Return the length of the path from its start, as arcs between poses.

    Args:
        T: (n + 1, 4, 4) poses.
        axes: 3, or 2 for the horizontal length.

    Returns:
        (n + 1,) m.
    """
    chord = np.linalg.norm(np.diff(T[:, :axes, 3], axis=0), axis=1)
    half = 0.5 * np.linalg.norm(rotation_vector(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3]), axis=1)
    arc = chord / np.sinc(np.minimum(half, 0.5 * np.pi) / np.pi)
    return np.concatenate([[0.0], np.cumsum(arc)])


def track_dataset(rover: Rover, s: Readings, T: Array, motion: Motion, contact_angle: Array) -> xr.Dataset:
    """Return the Dataset of a track.

    Args:
        rover: the rover.
        s: readings, with n intervals.
        T: (n + 1, 4, 4) poses.
        motion: of `body_twist`.
        contact_angle: (n, 6) rad.

    Returns:
        Dataset over `time`, as documented in `odometry`. Values of an interval are at its end.
    """
    import xarray as xr

    def late(values: Array) -> Array:
        """Return values of intervals at their ends; NaN at the start."""
        return np.concatenate([np.full((1, *values.shape[1:]), np.nan), values])

    p = T[:, :3, 3]
    roll, pitch, yaw = euler_angles(T[:, :3, :3])
    values: dict[str, tuple[tuple[str, ...], Any, str, str]] = {
        "x": (("time",), p[:, 0], "m", "x of the body's reference point"),
        "y": (("time",), p[:, 1], "m", "y of the body's reference point"),
        "z": (("time",), p[:, 2], "m", "height of the body's reference point"),
        "roll": (("time",), roll, "rad", "roll of the body, left side up positive"),
        "pitch": (("time",), pitch, "rad", "pitch of the body, nose down positive"),
        "yaw": (("time",), np.unwrap(yaw), "rad", "yaw of the body from +x"),
        "twist": (("time", "component"), late(motion.twist), "m/s, rad/s", "velocity of the body in its own frame"),
        "contact_angle": (("time", "wheel"), late(contact_angle), "rad", "contact angle on the rim"),
        "roll_slip": (("time", "wheel"), late(motion.residual[..., 0]), "m/s", "slip along the wheel's path"),
        "side_slip": (("time", "wheel"), late(motion.residual[..., 1]), "m/s", "slip across the wheel's path, to its left"),
        "twist_covariance": (
            ("time", "component", "component_column"), late(motion.covariance), "(m/s, rad/s)²", "covariance of twist",
        ),
        "pose_covariance": (
            ("time", "pose_component", "pose_component_column"), pose_covariance(rover, s, T, motion), "(m, rad)²",
            "covariance of position and of rotation about fixed axes",
        ),
    }  # fmt: skip
    coords = {
        "time": ("time", s.time, {"units": "s", "long_name": "time"}),
        "distance": ("time", path_length(T, 2), {"units": "m", "long_name": "horizontal distance along the path"}),
        "distance_3d": ("time", path_length(T), {"units": "m", "long_name": "length of the path in three dimensions"}),
        "wheel": list(rover.wheel_names),
        "component": list(TWIST),
        "component_column": list(TWIST),
        "pose_component": list(POSE),
        "pose_component_column": list(POSE),
    }
    data = {name: (dims, array, {"units": units, "long_name": text}) for name, (dims, array, units, text) in values.items()}
    return xr.Dataset(data, coords, {"rover": rover.name, "source": "rockerbogie odometry"})
