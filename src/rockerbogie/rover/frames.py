"""Frames of the wheels' axles and contacts in the body.

They are the D-H cascade of the paper's eqs 1-5, for any rocker-bogie.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._kernels.jit.parallel import parallel_for
from .._kernels.odometry.frames import wheel_frames_batch
from ..arrays import Array, flat, flat_steering, floats, once, spanned
from ..errors import RockerbogieError, expect
from .model import LOAD_ROVER, Rover
from .rotations import rotation_y

#: Steered poses that are checked at once, so that temporaries stay small.
RUN = 4096
#: Side of each wheel: 0 left, 1 right.
WHEEL_SIDE = np.array([0, 1, 0, 1, 0, 1])
#: True for the four wheels on a bogie.
ON_BOGIE = np.array([False, False, True, True, True, True])


def joint_angles(rover: Rover, rocker: ArrayLike, bogie: ArrayLike, steering: ArrayLike | None) -> tuple[Array, Array, Array]:
    """Return joint angles broadcast to one batch shape.

    Args:
        rover: the rover.
        rocker: (...) left rocker angle, rad.
        bogie: (..., 2) bogie angles, rad.
        steering: (..., 6) rad; None: straight ahead.

    Returns:
        Rocker (...), bogie (..., 2) and steering (..., 6), rad.

    Raises:
        RockerbogieError: a shape that does not fit, or steering on a wheel that does not steer.
    """
    try:
        q, b = floats(rocker), floats(bogie)
    except (TypeError, ValueError, OverflowError) as error:
        raise RockerbogieError(f"rocker and bogie must be angles, rad: {error}") from None
    if b.shape[-1:] != (2,):
        raise RockerbogieError(f"bogie has shape {b.shape}; its last axis must be 2 (left, right)")
    s = check_steering(rover, steering)
    shape = np.broadcast(q, b[..., 0], s[..., 0]).shape
    return spanned(q, shape), spanned(b, (*shape, 2)), spanned(s, (*shape, 6))


def check_steering(rover: Rover, steering: ArrayLike | None) -> Array:
    """Return steering angles as an array.

    Args:
        rover: the rover.
        steering: (..., 6) rad; None: straight ahead.

    Returns:
        (..., 6) rad.

    Raises:
        RockerbogieError: not a rover, another shape, not finite, or an angle of a wheel that does not steer.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    if steering is None:
        return np.zeros(6)
    try:
        s = floats(steering)
    except (TypeError, ValueError, OverflowError) as error:
        raise RockerbogieError(f"steering must be six angles for each pose, rad: {error}") from None
    if s.shape[-1:] != (6,):
        raise RockerbogieError(
            f"steering has shape {s.shape}; its last axis must be 6, one angle for each wheel (0 if it does not steer)"
        )
    angles, fixed = once(s).reshape(-1, 6), ~rover.steers
    weights = fixed.astype(float)
    for start in range(0, len(angles), RUN):
        part = angles[start : start + RUN]
        with np.errstate(invalid="ignore"):
            wrong = (np.abs(part) @ weights).any()  # one product finds both: NaN and inf stay NaN times 0
        if wrong:
            if not np.isfinite(part).all():
                raise RockerbogieError("steering holds an angle that is not finite")
            names = ", ".join(n for n, bad in zip(rover.wheel_names, fixed & part.any(axis=0), strict=True) if bad)
            raise RockerbogieError(f"wheel {names} of rover {rover.name!r} does not steer: give it 0")
    return s


def wheel_frames(rover: Rover, rocker: ArrayLike, bogie: ArrayLike, steering: ArrayLike | None = None) -> Array:
    """Return each wheel's axle frame in the body (eqs 2-4).

    Its x axis points forward, its y axis along the axle to the left.

    Args:
        rover: the rover.
        rocker: (...) left rocker angle, nose down positive, rad; the differential gives the right one.
        bogie: (..., 2) bogie angles to their rockers, left and right, rad.
        steering: (..., 6) about each wheel's own upright axis, left turn positive, rad.

    Returns:
        (..., 6, 4, 4) T_body_axle.

    Raises:
        RockerbogieError: a shape that does not fit, or steering on a wheel that does not steer.
    """
    q, b, psi = joint_angles(rover, rocker, bogie, steering)
    T = np.empty((*q.shape, 6, 4, 4))
    parallel_for(
        wheel_frames_batch, q.size, rover.packed, rover.steers.copy(), flat(q), flat(b, 2), flat_steering(psi), flat(T, 6, 4, 4)
    )
    return T


def contact_frames(rover: Rover, axle: ArrayLike, contact_angle: ArrayLike) -> Array:
    """Return contact frames (eq. 5).

    An axle frame is turned by δ about the axle, then moved a radius down.

    Args:
        rover: the rover.
        axle: (..., 6, 4, 4), from `wheel_frames`, in any base frame.
        contact_angle: (..., 6) δ, rad.

    Returns:
        (..., 6, 4, 4), in the same base frame.
    """
    delta = np.asarray(contact_angle, dtype=float)
    T = np.zeros((*delta.shape, 4, 4))
    T[..., :3, :3] = rotation_y(delta)
    T[..., :3, 3] = -rover.wheel_radius[:, None] * T[..., :3, 2]
    T[..., 3, 3] = 1.0
    return np.asarray(axle, dtype=float) @ T


@dataclass(frozen=True)
class DHRow:
    """A row of Table I, lengths in m, angles in rad.

    θ is `theta` plus the angle of `joint`, if there is one.
    """

    frame: str
    parent: str
    theta: float
    joint: str
    d: float
    a: float
    alpha: float


def dh_table(rover: Rover) -> list[DHRow]:
    """Return the rover's Denavit-Hartenberg table in the paper's form (Table I).

    It exists for any track, side and steering offset.

    `joint` names the angle that is added to theta: `rocker_left`, `bogie_right`, `steering_0` … or "". A steering axis
    that passes beside its hub needs one more frame (W) to turn the axle's x axis forward again.

    Args:
        rover: the rover.

    Returns:
        The rows, parents before children.

    Raises:
        RockerbogieError: rocker pivots that are not on one axis.
    """
    rows = [DHRow("D", "R", 0.0, "", float(rover.rocker_pivot[0, 2]), float(rover.rocker_pivot[0, 0]), -np.pi / 2)]
    if not np.allclose(rover.rocker_pivot[0, [0, 2]], rover.rocker_pivot[1, [0, 2]], atol=1e-12):
        raise RockerbogieError(
            f"rover {rover.name!r}: its rocker pivots are not on one axis, so that no single frame D holds both"
        )
    tilt = []
    for s, side in enumerate(("left", "right")):
        arm = rover.bogie_pivot[s] - rover.rocker_pivot[s]
        tilt.append(float(np.arctan2(-arm[2], arm[0])))
        rows.append(
            DHRow(
                f"B{s + 1}", "D", tilt[s], f"rocker_{side}", float(rover.bogie_pivot[s, 1]), float(np.hypot(arm[0], arm[2])), 0.0
            )
        )
    steer, axle = [], []
    for i in range(6):
        s, side = i % 2, ("left", "right")[i % 2]
        on_bogie = i >= 2
        origin = rover.bogie_pivot[s] if on_bogie else rover.rocker_pivot[s]
        post = rover.hubs[i, :2] + rover.steering_offset[i] - origin[:2]
        joint = f"bogie_{side}" if on_bogie else f"rocker_{side}"
        across = float(post[1]) if on_bogie else float(origin[1] + post[1])
        steer.append(
            DHRow(
                f"S{i + 1}",
                f"B{s + 1}" if on_bogie else "D",
                -tilt[s] if on_bogie else 0.0,
                joint,
                across,
                float(post[0]),
                np.pi / 2,
            )
        )
        back = -rover.steering_offset[i]
        turn = float(np.arctan2(back[1], back[0])) if back.any() else 0.0
        drop = float(rover.hubs[i, 2] - origin[2])
        axle.append(DHRow(f"A{i + 1}", f"S{i + 1}", turn, f"steering_{i}", drop, float(np.hypot(*back)), 0.0))
        if turn:
            axle.append(DHRow(f"W{i + 1}", f"A{i + 1}", -turn, "", 0.0, 0.0, 0.0))
    return rows + steer + axle
