"""Slip kinematics: how each wheel slips, where the body's motion is known from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..rover.model import Rover
from .jacobian import ContactState, batch_shape, contact_rows, ground_rates, reading

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Slip:
    """How the treads move over the ground. `roll` > 0: the wheel goes further than it rolls; `side` to its left."""

    roll: Array  # (..., 6) along the wheel's way, m/s
    side: Array  # (..., 6) across it, m/s
    turn: Array  # (..., 6) about eq. 6's z, in the wheel's plane off the ground, rad/s
    lift: Array  # (..., 6) off the ground, m/s: what of the motion given no contact allows
    ratio: Array  # (..., 6) as terramechanics has it, see `slip_ratio`
    angle: Array  # (..., 6) between the wheel's plane and the way it goes, rad


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
    """Each wheel's slip from the body's true motion (visual odometry, a simulation) and the sensors.

    Args:
        pose: joint and contact angles, as for `wheel_jacobians`.
        twist: (..., 6) of the body in its own frame, m/s and rad/s.
        wheel_rates: (..., 6) of each motor, wheel against its link, forward positive, rad/s.
        rocker_rate, bogie_rates: (...) and (..., 2) rad/s. Not given, those that keep the wheels on the ground.
        steering_rates: (..., 6) rad/s; not given, the wheels hold their steering.
        steering: (..., 6) rad; default the pose's own.

    Raises:
        RockerbogieError: a shape that does not fit, or a reading that is infinite.
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
    drive = r * (spin + motion[..., 4])  # what the rim lays down: the wheel's turn against the ground, not its link
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
    """(rω − v) / rω for a wheel that drives, (rω − v) / v for one that is dragged: 1 spins on the spot, −1 is locked.

    Args:
        drive: (...) rω, the wheel's turn against the ground times its radius, m/s.
        travel: (...) v of its hub along the wheel's way, m/s. Both at rest give nan.
    """
    d, v = np.broadcast_arrays(np.asarray(drive, dtype=float), np.asarray(travel, dtype=float))
    base = np.where((np.abs(d) >= np.abs(v)) | (d * v < 0), d, v)
    return np.asarray(np.divide(d - v, base, out=np.full(d.shape, np.nan), where=base != 0))
