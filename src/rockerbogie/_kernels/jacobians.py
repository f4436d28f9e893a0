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


@njit
def wheel_jacobians_batch(
    rover: Array, rocker: Array, bogie: Array, steering: Array, contact: Array, J: Array, start: int, stop: int
) -> None:
    """Fill J (n, 6, 6, 9), given as zeros, from rocker (n,), bogie (n, 2), steering, contact angles (n, 6); items start..stop.

    Axes of J: pose, wheel, twist component, column. It is indexed whole: a view of a part is counted atomically, and
    that costs more than the part.
    """
    for k in range(start, stop):
        qr, slope = right_rocker(rover, rocker[k])
        for side in range(2):
            arm = rocker[k] if side == 0 else qr
            rate = 1.0 if side == 0 else slope
            px, py, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 1], rover[P_PIVOT + 3 * side + 2]
            dx, dy, dz = rover[P_KNEE + 3 * side], rover[P_KNEE + 3 * side + 1], rover[P_KNEE + 3 * side + 2]
            ca, sa = math.cos(arm), math.sin(arm)
            kx, ky, kz = px + ca * dx + sa * dz, py + dy, pz - sa * dx + ca * dz
            hang = arm + bogie[k, side]
            cb, sb = math.cos(hang), math.sin(hang)
            for group in range(3):
                i = 2 * group + side
                _hinge(J, k, i, ROCKER, px, pz, rate)
                if group == 0:
                    ox, oy, oz, cl, sl = px, py, pz, ca, sa
                else:
                    _hinge(J, k, i, BOGIE_LEFT + side, kx, kz, 1.0)
                    ox, oy, oz, cl, sl = kx, ky, kz, cb, sb
                turn = steering[k, i]
                cs, ss = (1.0, 0.0) if turn == 0.0 else (math.cos(turn), math.sin(turn))
                bx, by = rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1]
                fx, fy, fz = rover[P_HUB + 3 * i] + bx, rover[P_HUB + 3 * i + 1] + by, rover[P_HUB + 3 * i + 2]
                # the steering axis, upright in its link, through a point at the hub's height; then the hub itself
                _turn(J, k, i, STEERING, ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz, -sl, 0.0, -cl)
                fx, fy = fx - cs * bx + ss * by, fy - ss * bx - cs * by
                hx, hy, hz = ox + cl * fx + sl * fz, oy + fy, oz - sl * fx + cl * fz
                cd, sd = math.cos(contact[k, i]), math.sin(contact[k, i])
                yx, yy, yz = -ss * cl, cs, ss * sl
                xx, xy, xz = cd * cs * cl - sd * sl, cd * ss, -cd * cs * sl - sd * cl
                zx, zy, zz = sd * cs * cl + cd * sl, sd * ss, -sd * cs * sl + cd * cl
                r = rover[P_RADIUS + i]
                _slide(J, k, i, WHEEL, r * xx, r * xy, r * xz)
                _slide(J, k, i, ROLL_SLIP, xx, xy, xz)
                _slide(J, k, i, SIDE_SLIP, yx, yy, yz)
                _turn(J, k, i, TURN_SLIP, hx - r * zx, hy - r * zy, hz - r * zz, zx, zy, zz)
                _turn(J, k, i, CONTACT_ANGLE, hx, hy, hz, -yx, -yy, -yz)
