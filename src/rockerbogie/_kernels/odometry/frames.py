"""Axle frames and contact planes of six wheels, for batches of poses."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from ..model.linkage import BOGIE_L, P_RADIUS, PITCH, ROCKER, ROLL, Z, body_axes
from .layout import R_BOGIE, R_ROCKER, R_SIZE, R_STEERING
from .motion import ASIDE, AXLE, FORWARD, HUB, UP, set_wheels

Array = NDArray[np.float64]


@owning_njit
def wheel_frames_batch(
    rover: Array, steers: NDArray[np.bool_], rocker: Array, bogie: Array, steering: Array, T: Array, start: int, stop: int
) -> None:
    """Compute the axle frames of six wheels in the body.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        rocker: (n,) rad, the left rocker's angle.
        bogie: (n, 2) rad.
        steering: (n, 6) or (1, 6) rad.
        T: (n, 6, 4, 4) filled with T_body_axle.
        start, stop: range of poses that this call computes.
    """
    reading, frame, joint = np.zeros(R_SIZE), np.empty((6, 12)), np.empty((6, 4, 6))
    for k in range(start, stop):
        reading[R_ROCKER], reading[R_BOGIE], reading[R_BOGIE + 1] = rocker[k], bogie[k, 0], bogie[k, 1]
        reading[R_STEERING : R_STEERING + 6] = steering[k if steering.shape[0] > 1 else 0]
        set_wheels(rover, steers, reading, frame, joint)
        for i in range(6):
            for n in range(3):
                T[k, i, n, 0], T[k, i, n, 1] = frame[i, FORWARD + n], frame[i, AXLE + n]
                T[k, i, n, 2], T[k, i, n, 3] = frame[i, UP + n], frame[i, HUB + n]
            T[k, i, 3, 0], T[k, i, 3, 1], T[k, i, 3, 2], T[k, i, 3, 3] = 0.0, 0.0, 0.0, 1.0


@owning_njit
def rim_contacts(
    rover: Array, steers: NDArray[np.bool_], T: Array, joints: Array, contact: Array, q: Array, normal: Array, point: Array
) -> float:
    """Compute the contacts in the middle of six rims, at given contact angles.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        T: (4, 4) T_world_body.
        joints: (9,) steering, rocker and bogie angles, rad.
        contact: (6,) contact angles, rad.
        q: (6,) filled with 0 for z, and roll, pitch, rocker, bogies, rad.
        normal: (6, 3) filled with contact normals in the world.
        point: (6, 3) filled with contact points from the body's reference point, in the world's axes, m.

    Returns:
        Yaw, rad.
    """
    reading, frame, joint = np.zeros(R_SIZE), np.empty((6, 12)), np.empty((6, 4, 6))
    reading[R_STEERING : R_STEERING + 6] = joints[:6]
    reading[R_ROCKER : R_ROCKER + 3] = joints[6:]
    set_wheels(rover, steers, reading, frame, joint)
    q[Z], q[ROLL], q[PITCH] = 0.0, math.atan2(T[2, 1], T[2, 2]), -math.asin(min(max(T[2, 0], -1.0), 1.0))
    q[ROCKER : ROCKER + 3] = joints[6:]
    for i in range(6):
        c, s, r = math.cos(contact[i]), math.sin(contact[i]), rover[P_RADIUS + i]
        for n in range(3):
            normal[i, n] = point[i, n] = 0.0
        for k in range(3):
            up = s * frame[i, FORWARD + k] + c * frame[i, UP + k]
            place = frame[i, HUB + k] - r * up
            for n in range(3):
                normal[i, n] += T[n, k] * up
                point[i, n] += T[n, k] * place
    return math.atan2(T[1, 0], T[0, 0])


@owning_njit
def contact_planes_batch(
    rover: Array, steers: NDArray[np.bool_], x: Array, y: Array, yaw: Array, q: Array, steering: Array, normal: Array,
    point: Array, planes: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Compute contact normals in the body, and positions of the contacts along the axles.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        x, y, yaw: (n,) m, rad.
        q: (n, 6) z, m, and roll, pitch, rocker, bogies, rad.
        steering: (n, 6) or (1, 6) rad.
        normal: (n, 6, 3) contact normals in the world.
        point: (n, 6, 3) contact points in the world, m.
        planes: (n, 6, 4) filled with the normal, and the distance of the contact from the rim's middle along the axle, m.
        start, stop: range of poses that this call computes.
    """
    reading, frame, joint, axes = np.zeros(R_SIZE), np.empty((6, 12)), np.empty((6, 4, 6)), np.empty((3, 3))
    for k in range(start, stop):
        reading[R_ROCKER], reading[R_BOGIE], reading[R_BOGIE + 1] = q[k, ROCKER], q[k, BOGIE_L], q[k, BOGIE_L + 1]
        reading[R_STEERING : R_STEERING + 6] = steering[k if steering.shape[0] > 1 else 0]
        set_wheels(rover, steers, reading, frame, joint)
        body_axes(q[k, ROLL], q[k, PITCH], math.cos(yaw[k]), math.sin(yaw[k]), axes)
        for i in range(6):
            px, py, pz = point[k, i, 0] - x[k], point[k, i, 1] - y[k], point[k, i, 2] - q[k, Z]
            aside = 0.0
            for n in range(3):
                a, b, c = axes[n, 0], axes[n, 1], axes[n, 2]
                planes[k, i, n] = a * normal[k, i, 0] + b * normal[k, i, 1] + c * normal[k, i, 2]
                aside += (a * px + b * py + c * pz - frame[i, HUB + n]) * frame[i, AXLE + n]
            planes[k, i, ASIDE] = aside
