"""Wheel Jacobians of eq. 9 for six wheels: docs/jacobians.md has the algebra."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, owning_fma_njit
from .linkage import P_BOGIE_PIVOT, P_HUB, P_OFFSET, P_PIVOT, P_RADIUS, right_rocker
from .sincos import FAR, sincos

Array = NDArray[np.float64]

Vector = tuple[float, float, float]
Slips = tuple[float, float, float, float]

#: Angles of a pose whose sines are computed: both rockers, both bogies' links, steering and contact of six wheels.
ARM, BOGIE, TURN, TOUCH, ANGLES = 0, 2, 4, 10, 16
BLOCK = 8  # poses whose sines are taken together


@inlined
def _row(J: Array, k: int, i: int, row: int, joints: tuple[float, float, float, float], wheel: float, slips: Slips) -> None:
    """Write one component of a wheel's twist, by `JACOBIAN_COLUMNS`.

    Args:
        J: (n, 6, 6, 9) Jacobians; 9 values are written.
        k, i, row: pose, wheel and twist component.
        joints: the component per unit of each rate of rocker, left and right bogie, and steering.
        wheel: the same of the wheel.
        slips: the same of roll, side and turn slip and of the contact angle.
    """
    rocker, left, right, steering = joints
    roll, side, turn, contact = slips
    J[k, i, row, 0], J[k, i, row, 1], J[k, i, row, 2], J[k, i, row, 3] = rocker, left, right, steering
    J[k, i, row, 4], J[k, i, row, 5], J[k, i, row, 6], J[k, i, row, 7], J[k, i, row, 8] = wheel, roll, side, turn, contact


@inlined
def _frame(T: Array, k: int, i: int, x: Vector, y: Vector, z: tuple[float, float], hub: Vector) -> None:
    """Write the axle frame of a wheel in the body.

    Args:
        T: (n, 6, 4, 4) frames; 16 values are written.
        k, i: pose and wheel.
        x, y: its x axis, and its y axis, along the axle.
        z: x and z of its z axis, which lies in the link's plane.
        hub: m, its origin.
    """
    T[k, i, 0, 0], T[k, i, 0, 1], T[k, i, 0, 2], T[k, i, 0, 3] = x[0], y[0], z[0], hub[0]
    T[k, i, 1, 0], T[k, i, 1, 1], T[k, i, 1, 2], T[k, i, 1, 3] = x[1], y[1], 0.0, hub[1]
    T[k, i, 2, 0], T[k, i, 2, 1], T[k, i, 2, 2], T[k, i, 2, 3] = x[2], y[2], z[1], hub[2]
    T[k, i, 3, 0], T[k, i, 3, 1], T[k, i, 3, 2], T[k, i, 3, 3] = 0.0, 0.0, 0.0, 1.0


@inlined
def _near_zero(angle: float) -> float:
    """Return the same angle within the range of `sincos`.

    Args:
        angle: rad.
    """
    return angle if not abs(angle) > FAR else math.atan2(math.sin(angle), math.cos(angle))


@owning_fma_njit
def wheel_jacobians_batch(
    rover: Array, steers: NDArray[np.bool_], rocker: Array, bogie: Array, steering: Array, contact: Array,
    J: Array, frames: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Compute wheel Jacobians and, if `frames` has room, wheel frames.

    A hinge along y at (x, ·, z) turns the body the other way: (z, 0, -x, 0, -1, 0). A slip is along an axis of the contact. A
    turn at unit rate about the axis a through the point p is (p × a, a). The normal passes through the hub. The sines of a
    block of poses are computed together, which is faster.

    Args:
        rover: (P_SIZE,) packed rover.
        steers: (6,) True for wheels that steer.
        rocker: (n,) rad, the left rocker's angle.
        bogie: (n, 2) rad.
        steering: (n, 6) or (1, 6) rad.
        contact: (n, 6) contact angles, rad.
        J: (n, 6, 6, 9) filled; axes: pose, wheel, twist component, column.
        frames: (n, 6, 4, 4) filled with T_body_axle, or (0, 6, 4, 4).
        start, stop: range of poses that this call computes.
    """
    angle, sine, cosine, slope = np.empty(ANGLES * BLOCK), np.empty(ANGLES * BLOCK), np.empty(ANGLES * BLOCK), np.empty(BLOCK)
    for first in range(start, stop, BLOCK):
        count = min(BLOCK, stop - first)
        for lane in range(count):
            k, at = first + lane, ANGLES * lane
            other, slope[lane] = right_rocker(rover, rocker[k])
            angle[at + ARM], angle[at + ARM + 1] = _near_zero(rocker[k]), _near_zero(other)
            for side in range(2):
                angle[at + BOGIE + side] = _near_zero(angle[at + ARM + side] + bogie[k, side])
            for i in range(6):
                angle[at + TURN + i] = _near_zero(steering[k if steering.shape[0] > 1 else 0, i])
                angle[at + TOUCH + i] = _near_zero(contact[k, i])
        sincos(angle, ANGLES * count, sine, cosine)
        for lane in range(count):
            k, at = first + lane, ANGLES * lane
            for side in range(2):
                rate = 1.0 if side == 0 else slope[lane]
                px, py, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 1], rover[P_PIVOT + 3 * side + 2]
                dx, dy, dz = (
                    rover[P_BOGIE_PIVOT + 3 * side],
                    rover[P_BOGIE_PIVOT + 3 * side + 1],
                    rover[P_BOGIE_PIVOT + 3 * side + 2],
                )
                ca, sa = cosine[at + ARM + side], sine[at + ARM + side]
                kx, ky, kz = px + ca * dx + sa * dz, py + dy, pz - sa * dx + ca * dz
                cb, sb = cosine[at + BOGIE + side], sine[at + BOGIE + side]
                for group in range(3):
                    i = 2 * group + side
                    if group == 0:
                        ox, oy, oz, cl, sl = px, py, pz, ca, sa
                        left, lx, lz, right, rx, rz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                    else:
                        ox, oy, oz, cl, sl = kx, ky, kz, cb, sb
                        left, right = 1.0 - side, 0.0 + side
                        lx, lz, rx, rz = left * kx, left * kz, right * kx, right * kz
                    cs, ss = cosine[at + TURN + i], sine[at + TURN + i]
                    bx, by = rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1]
                    fx, fy, fz = rover[P_HUB + 3 * i] + bx, rover[P_HUB + 3 * i + 1] + by, rover[P_HUB + 3 * i + 2]
                    # the steering axis, upright in its link, goes through the point s at the hub's height
                    sx, sy, sz = ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz
                    turns = 1.0 if steers[i] else 0.0
                    wx, wz = 0.0 - sl * turns, 0.0 - cl * turns
                    fx, fy = fx - cs * bx + ss * by, fy - ss * bx - cs * by
                    hx, hy, hz = ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz
                    cd, sd = cosine[at + TOUCH + i], sine[at + TOUCH + i]
                    ax, ay, az = cs * cl, ss, -cs * sl  # the axle's frame: forward, along the axle, and up (sl, 0, cl)
                    yx, yy, yz = -ss * cl, cs, ss * sl
                    xx, xy, xz = cd * ax - sd * sl, cd * ay, cd * az - sd * cl
                    zx, zy, zz = sd * ax + cd * sl, sd * ay, sd * az + cd * cl
                    r = rover[P_RADIUS + i]
                    tx, ty, tz = hy * zz - hz * zy, hz * zx - hx * zz, hx * zy - hy * zx  # h × z, and h × -y
                    ux, uy, uz = hz * yy - hy * yz, hx * yz - hz * yx, hy * yx - hx * yy
                    _row(J, k, i, 0, (pz * rate, lz, rz, sy * wz), r * xx, (xx, yx, tx, ux))
                    _row(J, k, i, 1, (0.0, 0.0, 0.0, sz * wx - sx * wz), r * xy, (xy, yy, ty, uy))
                    _row(J, k, i, 2, (-px * rate, 0.0 - lx, 0.0 - rx, -sy * wx), r * xz, (xz, yz, tz, uz))
                    _row(J, k, i, 3, (0.0, 0.0, 0.0, wx), 0.0, (0.0, 0.0, zx, -yx))
                    _row(J, k, i, 4, (-rate, 0.0 - left, 0.0 - right, 0.0), 0.0, (0.0, 0.0, zy, -yy))
                    _row(J, k, i, 5, (0.0, 0.0, 0.0, wz), 0.0, (0.0, 0.0, zz, -yz))
                    if frames.shape[0] > 0:
                        _frame(frames, k, i, (ax, ay, az), (yx, yy, yz), (sl, cl), (hx, hy, hz))
