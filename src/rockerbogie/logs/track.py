"""Track of odometry as a Dataset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..rover.model import Rover
from ..rover.rotations import euler_angles
from .readings import Readings
from .steps import IntervalMotion, continue_track, new_track, pose_of, track_noise

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

TWIST, POSE = ("vx", "vy", "vz", "wx", "wy", "wz"), ("x", "y", "z", "about_x", "about_y", "about_z")


@dataclass(frozen=True, eq=False)
class Track:
    """Poses at n + 1 times."""

    T: Array  # (n + 1, 4, 4) T_world_body
    covariance: Array  # (n + 1, 6, 6) of position and rotation about fixed axes, m² and rad²
    lengths_slip: Array  # (n + 1, 3) horizontal and three-dimensional length of the path, m, and slip share


def integrate(
    rover: Rover, s: Readings, motion: IntervalMotion, start: tuple[float, float, float], z: Array | None = None
) -> Track:
    """Integrate twists to poses: one screw per interval.

    Attitude in the log replaces the integrated one: all of it, or roll and pitch.

    Args:
        rover: the rover.
        s: readings, with n intervals.
        motion: of the n intervals.
        start: x, y, z of the first pose, m; with a map, its height is the map's.
        z: (n + 1,) heights by a map, m, NaN where not known; `None` without a map.

    Returns:
        The track, with heights of the map.
    """
    if z is not None and np.isfinite(z).any():
        start = (start[0], start[1], float(z[np.isfinite(z)][0]))
    noise = track_noise(rover.wheelbase, float(s.lean is None), float(not s.has_suspension))
    state = new_track(start, s.attitude[0], motion.normal[0])
    first = pose_of(state, noise)
    later = continue_track(state, noise, np.diff(s.time), motion, s.attitude[1:], None if z is None else z[1:])
    T, covariance, lengths_slip = (np.concatenate([a[None], b]) for a, b in zip(first, later, strict=True))
    if z is not None:
        T[:, 2, 3] = z
    return Track(T, covariance, lengths_slip)


def track_dataset(rover: Rover, s: Readings, track: Track, motion: IntervalMotion) -> xr.Dataset:
    """Return the Dataset of a track.

    Args:
        rover: the rover.
        s: readings, with n intervals.
        track: its poses.
        motion: of the n intervals.

    Returns:
        Dataset over `time`, as documented in `odometry`. Values of an interval are at its end.
    """
    import xarray as xr

    def late(values: Array) -> Array:
        """Return values of intervals at their ends; NaN at the start."""
        return np.concatenate([np.full((1, *values.shape[1:]), np.nan), values])

    p = track.T[:, :3, 3]
    roll, pitch, yaw = euler_angles(track.T[:, :3, :3])
    values: dict[str, tuple[tuple[str, ...], Any, str, str]] = {
        "x": (("time",), p[:, 0], "m", "x of the body's reference point"),
        "y": (("time",), p[:, 1], "m", "y of the body's reference point"),
        "z": (("time",), p[:, 2], "m", "height of the body's reference point"),
        "roll": (("time",), roll, "rad", "roll of the body, left side up positive"),
        "pitch": (("time",), pitch, "rad", "pitch of the body, nose down positive"),
        "yaw": (("time",), np.unwrap(yaw), "rad", "yaw of the body from +x"),
        "twist": (("time", "component"), late(motion.motion[:, :6]), "m/s, rad/s", "velocity of the body in its own frame"),
        "contact_angle": (("time", "wheel"), late(motion.contact_angle), "rad", "contact angle on the rim"),
        "roll_slip": (("time", "wheel"), late(motion.residual[..., 0]), "m/s", "slip along the wheel's path"),
        "side_slip": (("time", "wheel"), late(motion.residual[..., 1]), "m/s", "slip across the wheel's path, to its left"),
        "slip_share": (
            ("time",), track.lengths_slip[:, 2], "1", "RMS slip of the wheels against each other, as a share of their rim speed",
        ),
        "twist_covariance": (
            ("time", "component", "component_column"), late(motion.covariance[:, :6, :6]), "(m/s, rad/s)²", "covariance of twist",
        ),
        "pose_covariance": (
            ("time", "pose_component", "pose_component_column"), track.covariance, "(m, rad)²",
            "covariance of position and of rotation about fixed axes",
        ),
    }  # fmt: skip
    coords = {
        "time": ("time", s.time, {"units": "s", "long_name": "time"}),
        "distance": ("time", track.lengths_slip[:, 0], {"units": "m", "long_name": "horizontal distance along the path"}),
        "distance_3d": ("time", track.lengths_slip[:, 1], {"units": "m", "long_name": "length of the path in three dimensions"}),
        "wheel": list(rover.wheel_names),
        "component": list(TWIST),
        "component_column": list(TWIST),
        "pose_component": list(POSE),
        "pose_component_column": list(POSE),
    }
    data = {name: (dims, array, {"units": units, "long_name": text}) for name, (dims, array, units, text) in values.items()}
    return xr.Dataset(data, coords, {"rover": rover.name, "source": "rockerbogie odometry"})
