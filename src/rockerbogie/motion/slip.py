"""Slip kinematics: slip of each wheel from the body's twist and the wheel rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..rover.model import Rover
from .jacobian import ContactState, batch_shape, contact_rows, ground_rates, reading


@dataclass(frozen=True, eq=False)
class Slip:
    """Slip of the treads over the terrain.

    `roll` > 0: the wheel travels further than it rolls; `side` > 0: to its left.
    """

    roll: Array  # (..., 6) along the rolling direction, m/s
    side: Array  # (..., 6) across it, m/s
    turn: Array  # (..., 6) about z of the contact frame (eq. 6), rad/s
    lift: Array  # (..., 6) away from the terrain, m/s: the part of the given motion that contact forbids
    ratio: Array  # (..., 6) slip ratio of terramechanics, see `slip_ratio`
    angle: Array  # (..., 6) between the wheel's plane and its direction of travel, rad


def wheel_slip(
    rover: Rover,
    pose: ContactState,
    twist: ArrayLike,
    wheel_rates: ArrayLike,
    *,
    rocker_rate: ArrayLike | None = None,
    bogie_rates: ArrayLike | None = None,
    steering_rates: ArrayLike | None = None,
    steering: ArrayLike | None = None,
) -> Slip:
    """Compute each wheel's slip from the body's true twist and the wheel rates.

    The true twist comes from visual odometry or a simulation, say.

    Args:
        rover: the pose's rover.
        pose: joint and contact angles, as for `wheel_jacobians`.
        twist: (..., 6) of the body in its own frame, m/s and rad/s.
        wheel_rates: (..., 6) of each motor, wheel relative to its link, forward positive, rad/s.
        rocker_rate, bogie_rates: (...) and (..., 2) rad/s. Default: those that keep the wheels on the terrain.
        steering_rates: (..., 6) rad/s; default 0.
        steering: (..., 6) rad; default: the pose's own.

    Returns:
        Slip, with batch axes from broadcasting all arguments; NaN for poses or readings that are NaN.

    Raises:
        RockerbogieError: a pose of another rover, a shape that does not fit, or a reading that is infinite.
    """
    rows = contact_rows(rover, pose, steering)
    u, spin = reading("twist", twist, 6), reading("wheel_rates", wheel_rates, 6)
    turned = np.zeros(6) if steering_rates is None else reading("steering_rates", steering_rates, 6)
    rocker = None if rocker_rate is None else reading("rocker_rate", rocker_rate)
    bogies = None if bogie_rates is None else reading("bogie_rates", bogie_rates, 2)
    given = {"twist": u, "wheel_rates": spin, "steering_rates": turned, "bogie_rates": bogies}
    shapes = {name: value.shape[:-1] for name, value in given.items() if value is not None}
    shape = batch_shape(pose=rows.shape[:-3], rocker_rate=() if rocker is None else rocker.shape, **shapes)
    joints = ground_rates(rows, u, turned)
    rocker = joints[..., 0] if rocker is None else rocker
    bogies = joints[..., 1:] if bogies is None else bogies
    joints = np.concatenate([np.broadcast_to(rocker, shape)[..., None], np.broadcast_to(bogies, (*shape, 2))], axis=-1)
    motion = np.einsum("...ijk,...k->...ij", rows[..., :6], u) + np.einsum("...ijk,...k->...ij", rows[..., 6:9], joints)
    motion = motion + rows[..., 9] * turned[..., None]
    r = rover.wheel_radius
    roll = motion[..., 0] - r * spin
    drive = r * (spin + motion[..., 4])  # speed of the rim: the wheel's rate relative to the terrain, not to its link
    along = drive + roll
    return Slip(
        roll,
        motion[..., 1],
        motion[..., 3],
        motion[..., 2],
        slip_ratio(drive, along),
        np.arctan2(motion[..., 1], np.abs(along)),
    )


def slip_ratio(drive: ArrayLike, travel: ArrayLike) -> Array:
    """Return the slip ratio: (rω − v) / rω for a driving wheel, (rω − v) / v for a dragged one.

    Args:
        drive: (...) rω, the wheel's rate relative to the terrain times its radius, m/s.
        travel: (...) v of its hub along the rolling direction, m/s.

    Returns:
        (...) from −1 (locked wheel) to 1 (spinning on the spot); NaN if both speeds are 0.
    """
    d, v = np.broadcast_arrays(np.asarray(drive, dtype=float), np.asarray(travel, dtype=float))
    base = np.where((np.abs(d) >= np.abs(v)) | (d * v < 0), d, v)
    return np.asarray(np.divide(d - v, base, out=np.full(d.shape, np.nan), where=base != 0))
