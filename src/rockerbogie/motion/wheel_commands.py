"""Actuation kinematics: wheel rates and steering angles for a wanted twist on the terrain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .._kernels.jit.parallel import parallel_for
from .._kernels.odometry import commands as kernel
from .._kernels.odometry import layout as at
from ..arrays import Array, flat, spanned
from ..errors import RockerbogieError
from ..rover.frames import check_steering
from ..rover.model import Rover
from .jacobian import ContactState, batch_shape, contact_planes, reading

if TYPE_CHECKING:
    import xarray as xr

EDGE = 1e-6  # share of a step over which commands change from one rate to the next


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands to the motors, the motion they make, and the rest of the wanted motion."""

    wheel_rates: Array  # (..., 6) of each motor, forward positive, rad/s
    steering: Array  # (..., 6) rad
    twist: Array  # (..., 6) of the body, as the terrain constrains it, m/s and rad/s
    rocker_rate: Array  # (...) rad/s
    bogie_rates: Array  # (..., 2) rad/s
    speed_scale: Array  # (...) share of the wanted speed that the wheel rate limit allows, 0 to 1
    steering_short: Array  # (..., 6) wanted minus commanded steering, rad
    side_slip: Array  # (..., 6) remaining slip across the rolling direction, m/s
    turn_slip: Array  # (..., 6) turn slip about z of the contact frame, which no wheel avoids in a turn, rad/s


def wheel_commands(
    rover: Rover,
    pose: ContactState,
    twist: ArrayLike,
    *,
    steering: ArrayLike | None = None,
    steering_limit: ArrayLike = np.pi / 2,
    wheel_rate_limit: float = np.inf,
    near: ArrayLike | None = None,
) -> Commands:
    """Compute wheel rates and steering for a wanted twist, without roll slip.

    Of the twist, vx, vy and ωz are used; vz, ωx, ωy and the joint rates follow from the terrain, so that no wheel leaves it.
    Each wheel rate is that of its own contact: over a bump, the six differ.

    A wheel can roll forward or backward, so two steering angles half a turn apart serve. Without `near`, the one within a
    quarter turn of straight ahead is commanded; when the direction of travel passes 90 deg, it changes by half a turn. With
    `near`, the one nearest to the present angle is commanded if it is within `steering_limit`, else the other one.

    Args:
        rover: the pose's rover.
        pose: joint and contact angles, as for `wheel_jacobians`.
        twist: (..., 6) in the body frame, m/s and rad/s: from `straight`, `arc`, `crab`, `turn_in_place`, or any other.
        steering: (..., 6) fixed steering angles, rad. Default: each wheel that steers is turned to its rolling direction.
        steering_limit: largest angle to either side, a number or (6,), rad. Give more than π/2 for wheels that can turn further.
        wheel_rate_limit: largest motor rate, rad/s. All rates are reduced together, so the path does not change.
        near: (..., 6) present steering angles, rad.

    Returns:
        Commands, with batch axes from broadcasting pose, twist and steering. A pose that is NaN gives NaN rates and, if
        `steering` is not given, angles of 0 (with `near`: the present ones).

    Raises:
        RockerbogieError: a pose of another rover, a shape that does not fit, or a limit that is not above 0.
    """
    wanted = reading("twist", twist, 6)
    try:
        limit = np.broadcast_to(np.asarray(steering_limit, dtype=float), (6,))
    except (TypeError, ValueError):
        raise RockerbogieError(f"steering_limit is {steering_limit!r:.60}; give a number or six, rad") from None
    if not wheel_rate_limit > 0 or not (limit > 0).all():
        raise RockerbogieError(f"limits are {wheel_rate_limit} rad/s and {steering_limit!r} rad; give numbers above 0")
    limits = np.full((2, 6), np.inf)  # beyond which a wheel turns by half a turn, and of the command
    if steering is not None:
        given = check_steering(rover, steering)
    else:
        given = np.zeros(6) if near is None else np.where(rover.steers, reading("near", near, 6), 0.0)
        limits[0 if near is not None else 1 :] = limit
    planes = contact_planes(rover, pose)
    shape = batch_shape(pose=planes.shape, twist=wanted.shape[:-1], steering=given.shape[:-1])
    out = np.empty((*shape, at.C_SIZE))
    parallel_for(
        kernel.commands_batch, math.prod(shape), rover.packed, rover.steers.copy(),
        flat(planes.readings(shape, given), at.R_SIZE), *planes.flat(shape),
        flat(spanned(wanted[..., [0, 1, 5]], (*shape, 3)), 3), limits, steering is not None, flat(out, at.C_SIZE),
    )  # fmt: skip
    free, motion, rates = out[..., : at.C_MOTION], out[..., at.C_MOTION : at.C_RATE], out[..., at.C_RATE : at.C_SIDE_SLIP]
    side_slip, turn_slip = out[..., at.C_SIDE_SLIP : at.C_TURN_SLIP], out[..., at.C_TURN_SLIP :]
    fastest = np.abs(rates).max(axis=-1)
    scale = np.minimum(1.0, np.divide(wheel_rate_limit, fastest, out=np.full(fastest.shape, np.inf), where=fastest > 0))
    turn, each = np.clip(free, -limits[1], limits[1]), scale[..., None]
    twist_made, joints = motion[..., :6] * each, motion[..., 6:] * each
    return Commands(
        rates * each, turn, twist_made, joints[..., 0], joints[..., 1:], scale, free - turn, side_slip * each, turn_slip * each
    )  # fmt: skip


def commands_along(run: xr.Dataset, *, wheel_rate_limit: float = np.inf, steering_rate_limit: float = np.inf) -> xr.Dataset:
    """Compute commands over time for a run along a path.

    The rover slows down where a motor would exceed its largest rate.

    Args:
        run: from `drive`: `wheel_rate` and `steering` (time, wheel).
        wheel_rate_limit: largest rate of a wheel motor, rad/s.
        steering_rate_limit: largest rate of a steering motor, rad/s.

    Returns:
        Dataset with `wheel_rate` and `steering` (time, wheel) for `simulate(..., commands=...)`. Its time is stretched where a
        limit requires it; `speed_scale` (time) is the share of the run's speed that is left.

    Raises:
        RockerbogieError: a limit that is not above 0, or stations that did not settle, for which there are no commands.
    """
    import xarray as xr

    if not (wheel_rate_limit > 0 and steering_rate_limit > 0):
        raise RockerbogieError(f"limits are {wheel_rate_limit} and {steering_rate_limit} rad/s; give numbers above 0")
    time, rate, steering = (np.asarray(run[name], dtype=float) for name in ("time", "wheel_rate", "steering"))
    if not (np.isfinite(rate).all() and np.isfinite(steering).all()):
        k = int(np.argmin(np.isfinite(rate).all(axis=1)))
        raise RockerbogieError(f"the run did not settle at {time[k]:g} s, so there are no commands for it; choose another path")
    dt = np.diff(time)
    turned = 0.5 * (rate[1:] + rate[:-1]) * dt[:, None]
    swung = np.abs(np.diff(steering, axis=0)).max(axis=1)
    needed = np.maximum(np.abs(turned).max(axis=1) / wheel_rate_limit, swung / steering_rate_limit)
    lasts = np.maximum(dt, needed)
    later = time[0] + np.concatenate([[0.0], np.cumsum(lasts)])
    # Each step has a constant rate, from just after its start to just before its end.
    edges = np.stack([later[:-1] + EDGE * lasts, later[1:] - EDGE * lasts], axis=-1).ravel()
    turn = np.stack([np.interp(edges, later, column) for column in steering.T], axis=-1)
    return xr.Dataset(
        {
            "wheel_rate": (("time", "wheel"), np.repeat(turned / lasts[:, None], 2, axis=0), {"units": "rad/s"}),
            "steering": (("time", "wheel"), turn, {"units": "rad"}),
            "speed_scale": (
                "time",
                np.repeat(dt / lasts, 2),
                {"units": "1", "long_name": "share of the speed left"},
            ),
        },
        {"time": ("time", edges, {"units": "s"}), "wheel": run["wheel"]},
    )


def straight(speed: float) -> Array:
    """Return the twist of driving straight ahead.

    Args:
        speed: m/s.

    Returns:
        (6,) m/s and rad/s.
    """
    return np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])


def arc(rover: Rover, speed: float, radius: float) -> Array:
    """Return the twist along an arc (Ackermann).

    The turning centre lies abeam of the wheels that do not steer.

    Args:
        rover: the mechanism.
        speed: of the body's centre line abeam of the turning centre, m/s.
        radius: m, left positive.

    Returns:
        (6,) m/s and rad/s.

    Raises:
        RockerbogieError: the radius is 0 or not finite.
    """
    if not (np.isfinite(radius) and radius != 0):
        raise RockerbogieError(f"radius is {radius} m; give one that is finite and not 0 (left positive), or drive straight")
    rate = speed / radius
    return np.array([speed, -rate * turning_axis(rover), 0.0, 0.0, 0.0, rate])


def crab(speed: float, angle: float) -> Array:
    """Return the twist of driving at an angle without turning.

    Args:
        speed: m/s.
        angle: direction of travel, to the left of straight ahead, rad.

    Returns:
        (6,) m/s and rad/s.
    """
    return np.array([speed * np.cos(angle), speed * np.sin(angle), 0.0, 0.0, 0.0, 0.0])


def turn_in_place(rover: Rover, rate: float) -> Array:
    """Return the twist of turning about the middle of the wheels that do not steer.

    Args:
        rover: the mechanism.
        rate: rad/s, left positive.

    Returns:
        (6,) m/s and rad/s.
    """
    return np.array([0.0, -rate * turning_axis(rover), 0.0, 0.0, 0.0, rate])


def turning_axis(rover: Rover) -> float:
    """Return x of the turning centre with the least side slip.

    It is the mean over the wheels that do not steer.

    Args:
        rover: the mechanism; if all wheels steer, its middle wheels are used.

    Returns:
        x in the body frame, m.
    """
    fixed = ~rover.steers
    return float(rover.hubs[fixed if fixed.any() else slice(2, 4), 0].mean())
