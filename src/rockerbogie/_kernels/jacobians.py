"""Eq. 9 for six wheels: what each rate of a wheel's chain gives to the body's twist. The algebra is in docs/jacobians.md."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import inlined, njit
from .linkage import P_HUB, P_KNEE, P_OFFSET, P_PIVOT, P_RADIUS, right_rocker

Array = NDArray[np.float64]

ROCKER, BOGIE_LEFT, BOGIE_RIGHT, STEERING, WHEEL, ROLL_SLIP, SIDE_SLIP, TURN_SLIP, CONTACT_ANGLE = range(9)


@inlined
def _hinge(J: Array, column: int, x: float, z: float, rate: float) -> None:
    """A hinge along y at (x, ·, z): while its link holds still, the body turns the other way about it."""
    J[0, column] = z * rate
    J[2, column] = -x * rate
    J[4, column] = -rate


@inlined
def _turn(J: Array, column: int, px: float, py: float, pz: float, ax: float, ay: float, az: float) -> None:
    """The body turns at unit rate about the axis a through p."""
    J[0, column] = py * az - pz * ay
    J[1, column] = pz * ax - px * az
    J[2, column] = px * ay - py * ax
    J[3, column], J[4, column], J[5, column] = ax, ay, az


@njit
def wheel_jacobians(rover: Array, rocker: float, bogie: Array, steering: Array, contact: Array, J: Array) -> None:
    """Fill J (6, 6, 9), given as zeros: wheel, twist component, column. bogie (2,), steering and contact angles (6,)."""
    qr, slope = right_rocker(rover, rocker)
    for side in range(2):
        arm = rocker if side == 0 else qr
        rate = 1.0 if side == 0 else slope
        px, py, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 1], rover[P_PIVOT + 3 * side + 2]
        dx, dy, dz = rover[P_KNEE + 3 * side], rover[P_KNEE + 3 * side + 1], rover[P_KNEE + 3 * side + 2]
        ca, sa = math.cos(arm), math.sin(arm)
        kx, ky, kz = px + ca * dx + sa * dz, py + dy, pz - sa * dx + ca * dz
        cb, sb = math.cos(arm + bogie[side]), math.sin(arm + bogie[side])
        for group in range(3):
            i = 2 * group + side
            W = J[i]
            _hinge(W, ROCKER, px, pz, rate)
            if group == 0:
                ox, oy, oz, cl, sl = px, py, pz, ca, sa
            else:
                _hinge(W, BOGIE_LEFT + side, kx, kz, 1.0)
                ox, oy, oz, cl, sl = kx, ky, kz, cb, sb
            cs, ss = (1.0, 0.0) if steering[i] == 0.0 else (math.cos(steering[i]), math.sin(steering[i]))
            bx, by = rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1]
            fx, fy, fz = rover[P_HUB + 3 * i] + bx, rover[P_HUB + 3 * i + 1] + by, rover[P_HUB + 3 * i + 2]
            # the steering axis, upright in its link, through a point at the hub's height; then the hub itself
            _turn(W, STEERING, ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz, -sl, 0.0, -cl)
            fx, fy = fx - cs * bx + ss * by, fy - ss * bx - cs * by
            hx, hy, hz = ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz
            cd, sd = math.cos(contact[i]), math.sin(contact[i])
            yx, yy, yz = -ss * cl, cs, ss * sl
            xx, xy, xz = cd * cs * cl - sd * sl, cd * ss, -cd * cs * sl - sd * cl
            zx, zy, zz = sd * cs * cl + cd * sl, sd * ss, -sd * cs * sl + cd * cl
            r = rover[P_RADIUS + i]
            W[0, WHEEL], W[1, WHEEL], W[2, WHEEL] = r * xx, r * xy, r * xz
            W[0, ROLL_SLIP], W[1, ROLL_SLIP], W[2, ROLL_SLIP] = xx, xy, xz
            W[0, SIDE_SLIP], W[1, SIDE_SLIP], W[2, SIDE_SLIP] = yx, yy, yz
            _turn(W, TURN_SLIP, hx - r * zx, hy - r * zy, hz - r * zz, zx, zy, zz)
            _turn(W, CONTACT_ANGLE, hx, hy, hz, -yx, -yy, -yz)


@njit
def wheel_jacobians_batch(
    rover: Array, rocker: Array, bogie: Array, steering: Array, contact: Array, J: Array, start: int, stop: int
) -> None:
    """Fill J (n, 6, 6, 9), given as zeros, from rocker (n,), bogie (n, 2), steering, contact angles (n, 6); items start..stop."""
    for k in range(start, stop):
        wheel_jacobians(rover, rocker[k], bogie[k], steering[k], contact[k], J[k])
