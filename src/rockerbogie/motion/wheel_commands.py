"""Actuation kinematics: wheel rates and steering for a wanted motion, as the ground asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import RockerbogieError
from ..rover.model import Rover
from .jacobian import ContactState, contact_rows

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

ITERATIONS = 12  # of the steering; each leaves a tenth of the error or less
EDGE = 1e-6  # share of a step within which commands go over from one rate to the next


@dataclass(frozen=True, eq=False)
class Commands:
    """What to send to the motors, what motion it makes, and what of the wanted one was given up."""

    wheel_rates: Array  # (..., 6) of each motor, forward positive, rad/s
    steering: Array  # (..., 6) rad
    twist: Array  # (..., 6) of the body, as the ground lets it move, m/s and rad/s
    rocker_rate: Array  # (...) rad/s
    bogie_rates: Array  # (..., 2) rad/s
    speed_scale: Array  # (...) share of the wanted speed that the wheel rate's limit left, 0 to 1
    steering_short: Array  # (..., 6) wanted less commanded steering, rad
    side_slip: Array  # (..., 6) slip across the wheel's way that remains, m/s
    turn_slip: Array  # (..., 6) and about the upright of its plane, which no wheel escapes in a turn, rad/s


def wheel_commands(
    rover: Rover,
    pose: ContactState,
    twist: ArrayLike,
    *,
    steering: ArrayLike | None = None,
    steering_limit: ArrayLike = np.pi / 2,
    wheel_rate_limit: float = np.inf,
) -> Commands:
    """Wheel rates and steering that move the body at a wanted twist with no rolling slip and the least side slip.

    Of the twist, vx, vy and ωz are wanted; vz, ωx, ωy and the joints' rates follow from the ground, so that no wheel
    leaves it. Each wheel then turns as fast as its own way over the ground asks: over a bump, unequally.

    Args:
        pose: joint and contact angles, as for `wheel_jacobians`.
        twist: (..., 6) in the body frame, m/s and rad/s: `straight`, `arc`, `crab`, `turn_in_place`, or one's own.
        steering: (..., 6) set angles, rad. Not given, every wheel that steers is turned along its way.
        steering_limit: the largest angle either way, a number or (6,), rad.
        wheel_rate_limit: the fastest a motor turns, rad/s. All slow down together, so the way stays the same.

    Raises:
        RockerbogieError: a shape that does not fit, or a limit that is not above 0.
    """
    wanted = np.asarray(twist, dtype=float)
    if wanted.shape[-1:] != (6,):
        raise RockerbogieError(f"twist has shape {wanted.shape}; its last axis must be 6: vx, vy, vz, wx, wy, wz")
    if not wheel_rate_limit > 0 or not (np.asarray(steering_limit) > 0).all():
        raise RockerbogieError(f"limits are {wheel_rate_limit} rad/s and {steering_limit!r} rad; give numbers above 0")
    if steering is None:
        free = _steer(rover, pose, wanted)
        turn = np.clip(free, -np.asarray(steering_limit), steering_limit)
    else:
        turn = free = np.asarray(steering, dtype=float)
    rows = contact_rows(rover, pose, turn)
    motion = _on_the_ground(rows, wanted)
    slip = np.einsum("...ijk,...k->...ij", rows[..., :9], motion)
    rates = slip[..., 0] / rover.wheel_radius
    fastest = np.abs(rates).max(axis=-1)
    scale = np.minimum(1.0, np.divide(wheel_rate_limit, fastest, out=np.full(fastest.shape, np.inf), where=fastest > 0))
    motion, slip, rates = motion * scale[..., None], slip * scale[..., None, None], rates * scale[..., None]
    turn, free = np.broadcast_to(turn, rates.shape), np.broadcast_to(free, rates.shape)
    return Commands(
        rates, turn, motion[..., :6], motion[..., 6], motion[..., 7:], scale, free - turn, slip[..., 1], slip[..., 3]
    )  # fmt: skip


def commands_along(run: xr.Dataset, *, wheel_rate_limit: float = np.inf, steering_rate_limit: float = np.inf) -> xr.Dataset:
    """Commands to send over time for a run along a path, no motor ever faster than it can: the rover slows down instead.

    Args:
        run: from `drive`: `wheel_rate` and `steering` (time, wheel).
        wheel_rate_limit, steering_rate_limit: the fastest a wheel's and a steering motor turn, rad/s.

    Returns:
        Dataset with `wheel_rate` and `steering` (time, wheel) for `simulate(..., commands=...)`, over a time that is stretched
        where a limit asks for it, and `speed_scale` (time): the share of the run's own speed that is left.

    Raises:
        RockerbogieError: a limit that is not above 0, or stations that did not settle: there are no commands for them.
    """
    import xarray as xr

    if not (wheel_rate_limit > 0 and steering_rate_limit > 0):
        raise RockerbogieError(f"limits are {wheel_rate_limit} and {steering_rate_limit} rad/s; give numbers above 0")
    time, rate, steering = (np.asarray(run[name], dtype=float) for name in ("time", "wheel_rate", "steering"))
    if not (np.isfinite(rate).all() and np.isfinite(steering).all()):
        k = int(np.argmin(np.isfinite(rate).all(axis=1)))
        raise RockerbogieError(f"the run did not settle at {time[k]:g} s: no commands can be given there; take another path")
    dt = np.diff(time)
    turned = 0.5 * (rate[1:] + rate[:-1]) * dt[:, None]
    swung = np.abs(np.diff(steering, axis=0)).max(axis=1)
    needed = np.maximum(np.abs(turned).max(axis=1) / wheel_rate_limit, swung / steering_rate_limit)
    lasts = np.maximum(dt, needed)
    later = time[0] + np.concatenate([[0.0], np.cumsum(lasts)])
    # each step of the run at its own steady rate, from just after its start to just before its end
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
    """Twist (6,) straight ahead at `speed`, m/s."""
    return np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])


def arc(rover: Rover, speed: float, radius: float) -> Array:
    """Twist (6,) along an arc (Ackermann): turning centre abeam of the wheels that do not steer, `radius` m to the left.

    `speed`, m/s, is that of the body's middle line abeam of the turning centre.
    """
    if not (np.isfinite(radius) and radius != 0):
        raise RockerbogieError(f"radius is {radius} m; give one that is finite and not 0 (left positive), or drive straight")
    rate = speed / radius
    return np.array([speed, -rate * turning_axis(rover), 0.0, 0.0, 0.0, rate])


def crab(speed: float, angle: float) -> Array:
    """Twist (6,) at `speed`, m/s, without turning, `angle` rad to the left of straight ahead."""
    return np.array([speed * np.cos(angle), speed * np.sin(angle), 0.0, 0.0, 0.0, 0.0])


def turn_in_place(rover: Rover, rate: float) -> Array:
    """Twist (6,) turning at `rate`, rad/s, about the middle of the wheels that do not steer."""
    return np.array([0.0, -rate * turning_axis(rover), 0.0, 0.0, 0.0, rate])


def turning_axis(rover: Rover) -> float:
    """x of the line abeam on which the rover turns with the least side slip: that of the wheels that do not steer, m."""
    fixed = ~rover.steers
    return float(rover.hubs[fixed if fixed.any() else slice(2, 4), 0].mean())


def _on_the_ground(rows: Array, wanted: Array) -> Array:
    """Motion (..., 9) with the wanted vx, vy, ωz and no lift at any wheel."""
    lift = rows[..., 2, :9]
    given, found = [0, 1, 5], [2, 3, 4, 6, 7, 8]
    right = -np.einsum("...ij,...j->...i", lift[..., given], wanted[..., given])
    motion = np.empty((*right.shape[:-1], 9))
    motion[..., given] = wanted[..., given]
    motion[..., found] = np.linalg.solve(lift[..., found], right[..., None])[..., 0]
    return motion


def _steer(rover: Rover, pose: ContactState, wanted: Array) -> Array:
    """Steering (..., 6) at which no steered wheel slips sideways; a wheel that stands still keeps straight ahead."""
    turn = np.zeros(6)
    for _ in range(ITERATIONS):
        rows = contact_rows(rover, pose, turn)
        going = np.einsum("...ijk,...k->...ij", rows[..., :2, :9], _on_the_ground(rows, wanted))
        still = np.hypot(going[..., 0], going[..., 1]) < 1e-12
        ahead = np.where(going[..., 0] < 0, -1.0, 1.0)  # rolling backwards does as well as turning about
        change = np.where(rover.steers & ~still, np.arctan2(ahead * going[..., 1], ahead * going[..., 0]), 0.0)
        turn = turn + change
        if np.nanmax(np.abs(change), initial=0.0) < 1e-13:
            break
    return np.where(np.isfinite(turn), turn, 0.0)
