"""Eq. 9 for six wheels: what each rate of a wheel's chain gives to the body's twist. The algebra is in docs/jacobians.md."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import fused, inlined
from .linkage import P_HUB, P_KNEE, P_OFFSET, P_PIVOT, P_RADIUS, right_rocker
from .sincos import FAR, sincos

Array = NDArray[np.float64]

ROCKER, BOGIE_LEFT, BOGIE_RIGHT, STEERING, WHEEL, ROLL_SLIP, SIDE_SLIP, TURN_SLIP, CONTACT_ANGLE = range(9)

#: Angles of a pose that want a sine: both rockers, both bogies' links, steering and contact of six wheels.
ARM, HANG, TURN, TOUCH, ANGLES = 0, 2, 4, 10, 16
BLOCK = 2  # poses whose sines are taken together


@inlined
def _hinge(J: Array, k: int, i: int, column: int, x: float, z: float, rate: float) -> None:
    """A hinge along y at (x, ·, z): while its link holds still, the body turns the other way about it."""
    J[k, i, 0, column] = z * rate
    J[k, i, 2, column] = -x * rate
    J[k, i, 4, column] = -rate


@inlined
def _turn(J: Array, k: int, i: int, column: int, px: float, py: float, pz: float, ax: float, ay: float, az: float) -> None:
    """The body turns at unit rate about the axis a through p."""
    J[k, i, 0, column] = py * az - pz * ay
    J[k, i, 1, column] = pz * ax - px * az
    J[k, i, 2, column] = px * ay - py * ax
    J[k, i, 3, column], J[k, i, 4, column], J[k, i, 5, column] = ax, ay, az


@inlined
def _slide(J: Array, k: int, i: int, column: int, ax: float, ay: float, az: float) -> None:
    """The body goes along a."""
    J[k, i, 0, column], J[k, i, 1, column], J[k, i, 2, column] = ax, ay, az


@inlined
def _frame(
    T: Array, k: int, i: int, xx: float, xy: float, xz: float, yx: float, yy: float, yz: float,
    zx: float, zz: float, px: float, py: float, pz: float,
) -> None:  # fmt: skip
    """The axle's directions and place in the body; its z lies in the link's plane."""
    T[k, i, 0, 0], T[k, i, 0, 1], T[k, i, 0, 2], T[k, i, 0, 3] = xx, yx, zx, px
    T[k, i, 1, 0], T[k, i, 1, 1], T[k, i, 1, 2], T[k, i, 1, 3] = xy, yy, 0.0, py
    T[k, i, 2, 0], T[k, i, 2, 1], T[k, i, 2, 2], T[k, i, 2, 3] = xz, yz, zz, pz
    T[k, i, 3, 0], T[k, i, 3, 1], T[k, i, 3, 2], T[k, i, 3, 3] = 0.0, 0.0, 0.0, 1.0


@inlined
def _near_zero(angle: float) -> float:
    """The same angle, within what `sincos` takes."""
    return angle if not abs(angle) > FAR else math.atan2(math.sin(angle), math.cos(angle))


@fused
def wheel_jacobians_batch(
    rover: Array, steers: NDArray[np.bool_], rocker: Array, bogie: Array, steering: Array, contact: Array,
    J: Array, frames: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Fill J (n, 6, 6, 9) from rocker (n,), bogie (n, 2), steering (n, 6) or (1, 6) and contact angles (n, 6).

    Axes of J: pose, wheel, twist component, column. Frames (n, 6, 4, 4), axle to body, are filled too if there are any.
    The angles of a block of poses are laid side by side and their sines worked out together: one by one they were most
    of the time. A block's J is put together close by, where its zeros stay, and copied out whole.
    """
    angle, sine, cosine, slope = np.empty(ANGLES * BLOCK), np.empty(ANGLES * BLOCK), np.empty(ANGLES * BLOCK), np.empty(BLOCK)
    block, out = np.zeros((BLOCK, 6, 6, 9)), J.reshape(-1, 324)
    rows = block.reshape(-1, 324)
    for first in range(start, stop, BLOCK):
        count = min(BLOCK, stop - first)
        for lane in range(count):
            k, at = first + lane, ANGLES * lane
            right, slope[lane] = right_rocker(rover, rocker[k])
            angle[at + ARM], angle[at + ARM + 1] = _near_zero(rocker[k]), _near_zero(right)
            for side in range(2):
                angle[at + HANG + side] = _near_zero(angle[at + ARM + side] + bogie[k, side])
            for i in range(6):
                angle[at + TURN + i] = _near_zero(steering[k if steering.shape[0] > 1 else 0, i])
                angle[at + TOUCH + i] = _near_zero(contact[k, i])
        sincos(angle, ANGLES * count, sine, cosine)
        for lane in range(count):
            k, at = first + lane, ANGLES * lane
            for side in range(2):
                rate = 1.0 if side == 0 else slope[lane]
                px, py, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 1], rover[P_PIVOT + 3 * side + 2]
                dx, dy, dz = rover[P_KNEE + 3 * side], rover[P_KNEE + 3 * side + 1], rover[P_KNEE + 3 * side + 2]
                ca, sa = cosine[at + ARM + side], sine[at + ARM + side]
                kx, ky, kz = px + ca * dx + sa * dz, py + dy, pz - sa * dx + ca * dz
                cb, sb = cosine[at + HANG + side], sine[at + HANG + side]
                for group in range(3):
                    i = 2 * group + side
                    _hinge(block, lane, i, ROCKER, px, pz, rate)
                    if group == 0:
                        ox, oy, oz, cl, sl = px, py, pz, ca, sa
                    else:
                        _hinge(block, lane, i, BOGIE_LEFT + side, kx, kz, 1.0)
                        ox, oy, oz, cl, sl = kx, ky, kz, cb, sb
                    cs, ss = cosine[at + TURN + i], sine[at + TURN + i]
                    bx, by = rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1]
                    fx, fy, fz = rover[P_HUB + 3 * i] + bx, rover[P_HUB + 3 * i + 1] + by, rover[P_HUB + 3 * i + 2]
                    if steers[i]:  # about an axis upright in its link, through a point at the hub's height
                        _turn(block, lane, i, STEERING, ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz, -sl, 0.0, -cl)
                    fx, fy = fx - cs * bx + ss * by, fy - ss * bx - cs * by
                    hx, hy, hz = ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz
                    cd, sd = cosine[at + TOUCH + i], sine[at + TOUCH + i]
                    ax, ay, az = cs * cl, ss, -cs * sl  # the axle's frame: forward, along the axle, and up (sl, 0, cl)
                    yx, yy, yz = -ss * cl, cs, ss * sl
                    xx, xy, xz = cd * ax - sd * sl, cd * ay, cd * az - sd * cl
                    zx, zy, zz = sd * ax + cd * sl, sd * ay, sd * az + cd * cl
                    r = rover[P_RADIUS + i]
                    _slide(block, lane, i, WHEEL, r * xx, r * xy, r * xz)
                    _slide(block, lane, i, ROLL_SLIP, xx, xy, xz)
                    _slide(block, lane, i, SIDE_SLIP, yx, yy, yz)
                    _turn(block, lane, i, TURN_SLIP, hx, hy, hz, zx, zy, zz)  # the contact's normal goes through the hub
                    _turn(block, lane, i, CONTACT_ANGLE, hx, hy, hz, -yx, -yy, -yz)
                    if frames.shape[0] > 0:
                        _frame(frames, k, i, ax, ay, az, yx, yy, yz, sl, cl, hx, hy, hz)
        for lane in range(count):
            for e in range(324):
                out[first + lane, e] = rows[lane, e]
