"""Drivers of the simulated rover: closed loop along a path, or recorded commands open loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..motion.command_table import read_commands
from ..motion.drive import ackermann
from ..motion.path import Path
from ..rover.model import Rover
from ..rover.rotations import wrap_angle
from .motors import GRAVITY
from .rigid_body import Rig

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: Function of the time, s, and the rig that returns commands: wheel rates (6,), rad/s, and steering (6,), rad.
Driver = Callable[[float, Rig], tuple[Array, Array]]

#: Gains of the path controller for a wheelbase L: speed per distance behind, 1/s; curvature per heading error, 1/L, and per
#: distance aside, 1/L².
ALONG_GAIN, YAW_GAIN, ACROSS_GAIN = 1.0, 4.0, 2.0
#: Limits of the path controller: speed in units of the nominal speed; added curvature in units of 1/L.
MOST_SPEED, MOST_CURVATURE = 2.0, 2.0
#: Load sharing: a wheel whose torque exceeds the mean of the six by m g r / 6 runs slower by this rim speed, m/s, but by no more
#: than this share of its rate.
SHARING_SPEED, MOST_SHARING = 0.02, 0.1


def path_driver(rover: Rover, path: Path, plan: xr.Dataset, load_sharing: bool) -> Driver:
    """Return a driver along a path.

    It commands the wheel rates of a planned run, corrected by the rover's position and heading.
    Wheels that do not steer roll without side slip only about a centre abeam of them. If they are not abeam of the body's
    reference point, the body of a turning rover points a little inward of the path, and the driver lets it.

    Args:
        rover: the rover.
        path: the path.
        plan: run of `drive` along the path; its `wheel_rate` over `distance` and its speed are used.
        load_sharing: slow down wheels whose torque exceeds the mean of the six and speed up the others. Six wheels whose rates
            do not agree exactly would otherwise work against each other up to the friction limit.

    Returns:
        The driver.
    """
    speed = float(plan.attrs["speed"])
    planned = np.nan_to_num(plan["wheel_rate"].to_numpy(), nan=speed / float(rover.wheel_radius.mean()))
    planned_at = plan["distance"].to_numpy()
    size = rover.wheelbase
    fixed = 0.0 if rover.steers.all() else float(rover.hubs[~rover.steers, 0].mean())

    def drive_along(time: float, rig: Rig) -> tuple[Array, Array]:
        x, y, yaw = rig.heading
        due = min(speed * time, path.length)
        at = path.sample(due)
        c, s = np.cos(at.course), np.sin(at.course)
        ahead, across = c * (x - at.x) + s * (y - at.y), c * (y - at.y) - s * (x - at.x)
        inward = np.arctan(at.curvature * fixed)
        off = wrap_angle(yaw - at.yaw - inward)
        v = np.clip(speed - ALONG_GAIN * ahead, 0.0, MOST_SPEED * speed)
        turn = -np.clip(YAW_GAIN * off / size + ACROSS_GAIN * across / size**2, -MOST_CURVATURE / size, MOST_CURVATURE / size)
        angle = ackermann(rover, at.curvature + turn, at.course - at.yaw - inward)
        rate = np.array([np.interp(due + ahead, planned_at, column) for column in planned.T])
        swing = np.sin(angle) * rover.hubs[:, 0] - np.cos(angle) * rover.hubs[:, 1]  # of each hub along its heading, per radian
        rate = v * (rate / speed + turn * swing / rover.wheel_radius)
        return rate + (_sharing(rover, rig.wheel_torque, rate) if load_sharing else 0.0), angle

    return drive_along


def _sharing(rover: Rover, torque: Array, rate: Array) -> Array:
    """Return the changes of the wheel rates that make the torques more equal.

    Args:
        rover: gives the scale of torque, m g r / 6.
        torque: (6,) N·m.
        rate: (6,) commanded rates, rad/s.

    Returns:
        (6,) rad/s.
    """
    radius = rover.wheel_radius
    change = (torque.mean() - torque) / (rover.mass * GRAVITY * radius / 6) * SHARING_SPEED / radius
    most = MOST_SHARING * np.abs(rate)
    return np.asarray(np.clip(change, -most, most))


def command_driver(rover: Rover, commands: xr.Dataset) -> tuple[Driver, float, float]:
    """Return a driver that plays recorded commands.

    Args:
        rover: the rover.
        commands: `wheel_rate`, rad/s, and `steering`, rad, over (time, wheel); linear in between.

    Returns:
        The driver, the duration of the commands, s, and the largest distance they can move the rover, m.

    Raises:
        RockerbogieError: commands of another rover, missing variables, wrong shapes, or times that do not increase.
    """
    time, rate, angle = read_commands(rover, commands)

    def play(now: float, rig: Rig) -> tuple[Array, Array]:
        rates, angles = (np.array([np.interp(now, time, column) for column in table.T]) for table in (rate, angle))
        return rates, angles

    travel = float(np.trapezoid(np.abs(rate * rover.wheel_radius).max(axis=1), time))
    return play, float(time[-1]), travel
