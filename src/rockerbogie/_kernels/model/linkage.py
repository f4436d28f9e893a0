"""The packed rover and its forward kinematics.

The unknowns of a pose are q = (z, roll, pitch, ρ, β left, β right); x, y and yaw are given.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import force_inlined, inlined, njit
from .wheel import make_wheel

Array = NDArray[np.float64]

# The packed rover, one flat array. Links are given from their own pivot, in the body's directions at rest.
P_PIVOT = 0  # (2, 3) rocker pivots
P_BOGIE_PIVOT = 6  # (2, 3) bogie pivot from rocker pivot
P_HUB = 12  # (6, 3) hub from its rocker pivot (wheels 0, 1) or bogie pivot (2..5)
P_OFFSET = 30  # (6, 2) steering axis from hub
P_RADIUS = 42  # (6,)
P_HALF = 48  # (6,) half widths
P_STOPS = 54  # rocker low, high, bogie low, high
P_BOX = 58  # (2, 3) the body's box
P_BODY = 64  # mass, com
P_ROCKER = 68  # (2, 4) mass, com
P_BOGIE = 76  # (2, 4)
P_WHEEL = 84  # (6, 4) mass, com from the hub
P_ORDER = 108  # number of differential coefficients
P_DIFF = 109  # and they, 24 at most
P_SIZE = 133

Z, ROLL, PITCH, ROCKER, BOGIE_L, BOGIE_R = range(6)


@inlined
def right_rocker(rover: Array, rho: float) -> tuple[float, float]:
    """Return the right rocker's angle, which the differential sets, and its derivative.

    Args:
        rover: (P_SIZE,) packed rover.
        rho: rad, the left rocker's angle.

    Returns:
        Angle, rad, and its change per rad of rho.
    """
    n = int(rover[P_ORDER])
    value = slope = 0.0
    for k in range(n - 1, -1, -1):
        slope = slope * rho + value
        value = value * rho + rover[P_DIFF + k]
    return value, slope


@njit
def reach(rover: Array) -> float:
    """Return a distance from the body's origin, m, within which the rover is in every pose.

    Args:
        rover: (P_SIZE,) packed rover.
    """
    farthest = math.sqrt(
        max(abs(rover[P_BOX]), abs(rover[P_BOX + 3])) ** 2
        + max(abs(rover[P_BOX + 1]), abs(rover[P_BOX + 4])) ** 2
        + max(abs(rover[P_BOX + 2]), abs(rover[P_BOX + 5])) ** 2
    )
    for i in range(6):
        side = i % 2
        arm = _length(rover, P_PIVOT + 3 * side) + _length(rover, P_HUB + 3 * i)
        if i >= 2:
            arm += _length(rover, P_BOGIE_PIVOT + 3 * side)
        arm += 2.0 * math.hypot(rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1])
        farthest = max(farthest, arm + math.hypot(rover[P_RADIUS + i], rover[P_HALF + i]))
    return farthest


@inlined
def _length(rover: Array, at: int) -> float:
    """Return the length of a vector of the packed rover, m.

    Args:
        rover: (P_SIZE,) packed rover.
        at: offset of the vector (3,).
    """
    return math.sqrt(rover[at] ** 2 + rover[at + 1] ** 2 + rover[at + 2] ** 2)


@njit
def set_hub_offsets(rover: Array, steering: Array, hub_offsets: Array) -> None:
    """Compute the part of each wheel's position that steering alone sets.

    Args:
        rover: (P_SIZE,) packed rover.
        steering: (6,) rad.
        hub_offsets: (6, 5) filled with the hub from its pivot in the link (3), m, and cos and sin of the steering angle.
    """
    for i in range(6):
        c, s = math.cos(steering[i]), math.sin(steering[i])
        ox, oy = rover[P_OFFSET + 2 * i], rover[P_OFFSET + 2 * i + 1]
        hub_offsets[i, 0] = rover[P_HUB + 3 * i] + ox - (c * ox - s * oy)
        hub_offsets[i, 1] = rover[P_HUB + 3 * i + 1] + oy - (s * ox + c * oy)
        hub_offsets[i, 2] = rover[P_HUB + 3 * i + 2]
        hub_offsets[i, 3], hub_offsets[i, 4] = c, s


@njit
def body_axes(roll: float, pitch: float, cy: float, sy: float, axes: Array) -> None:
    """Compute the body's directions in the world.

    Args:
        roll, pitch: rad.
        cy, sy: cos and sin of yaw.
        axes: (3, 3) filled; rows are the body's x, y and z.
    """
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    axes[0, 0], axes[0, 1], axes[0, 2] = cy * cp, sy * cp, -sp
    axes[1, 0], axes[1, 1], axes[1, 2] = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr
    axes[2, 0], axes[2, 1], axes[2, 2] = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr


@njit
def forward_kinematics(
    rover: Array,
    hub_offsets: Array,
    x: float,
    y: float,
    cy: float,
    sy: float,
    q: Array,
    axes: Array,
    pivots: Array,
    wheels: Array,
) -> bool:
    """Compute the positions and directions of the linkage and its wheels.

    Args:
        rover: (P_SIZE,) packed rover.
        hub_offsets: (6, 5) of `set_hub_offsets`.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) z, m, and roll, pitch, rocker, bogies, rad.
        axes: (3, 3) filled with the body's directions, one a row.
        pivots: (4, 3) filled with the rocker pivots and the bogie pivots, left and right, m from the body's origin.
        wheels: (6, WHEEL_SIZE) filled; hubs in m from the map's first node and the datum.

    Returns:
        False if a wheel lies on its side (`make_wheel`).
    """
    body_axes(q[ROLL], q[PITCH], cy, sy, axes)
    qr, _ = right_rocker(rover, q[ROCKER])
    upright = True
    for side in range(2):
        arm = q[ROCKER] if side == 0 else qr
        px, py, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 1], rover[P_PIVOT + 3 * side + 2]
        kx, ky, kz = rover[P_BOGIE_PIVOT + 3 * side], rover[P_BOGIE_PIVOT + 3 * side + 1], rover[P_BOGIE_PIVOT + 3 * side + 2]
        for n in range(3):
            ca, sa = math.cos(arm), math.sin(arm)
            lx, lz = axes[0, n] * ca - axes[2, n] * sa, axes[0, n] * sa + axes[2, n] * ca
            pivots[side, n] = axes[0, n] * px + axes[1, n] * py + axes[2, n] * pz
            pivots[2 + side, n] = pivots[side, n] + lx * kx + axes[1, n] * ky + lz * kz
        for g in range(3):
            i = 2 * g + side
            angle = arm if g == 0 else arm + q[BOGIE_L + side]
            ct, st = math.cos(angle), math.sin(angle)
            base = side if g == 0 else 2 + side
            c, s = hub_offsets[i, 3], hub_offsets[i, 4]
            x_x, x_y, x_z = (
                axes[0, 0] * ct - axes[2, 0] * st,
                axes[0, 1] * ct - axes[2, 1] * st,
                axes[0, 2] * ct - axes[2, 2] * st,
            )
            z_x, z_y, z_z = (
                axes[0, 0] * st + axes[2, 0] * ct,
                axes[0, 1] * st + axes[2, 1] * ct,
                axes[0, 2] * st + axes[2, 2] * ct,
            )
            hx = pivots[base, 0] + x_x * hub_offsets[i, 0] + axes[1, 0] * hub_offsets[i, 1] + z_x * hub_offsets[i, 2]
            hy = pivots[base, 1] + x_y * hub_offsets[i, 0] + axes[1, 1] * hub_offsets[i, 1] + z_y * hub_offsets[i, 2]
            hz = pivots[base, 2] + x_z * hub_offsets[i, 0] + axes[1, 2] * hub_offsets[i, 1] + z_z * hub_offsets[i, 2]
            upright &= make_wheel(
                wheels[i], x + hx, y + hy, q[Z] + hz,
                axes[1, 0] * c - x_x * s, axes[1, 1] * c - x_y * s, axes[1, 2] * c - x_z * s,
                z_x, z_y, z_z, rover[P_RADIUS + i], rover[P_HALF + i],
            )  # fmt: skip
    return upright


@force_inlined
def gap_jacobian_row(
    rover: Array, q: Array, cy: float, sy: float, axes: Array, pivots: Array, i: int,
    px: float, py: float, pz: float, gx: float, gy: float, row: Array,
) -> None:  # fmt: skip
    """Compute the change of a wheel's gap per unit of each unknown.

    By the envelope theorem the motion of the contact on the tread adds nothing.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
        cy, sy: cos and sin of yaw.
        axes, pivots: of `forward_kinematics`.
        i: wheel.
        px, py, pz: m, the contact from the body's origin.
        gx, gy: slope; (-gx, -gy, 1) is normal to the contact.
        row: (6,) filled, m per m or rad.
    """
    side = i % 2
    row[Z] = 1.0
    # ω × p for ω = body x, the level y axis, body y
    ax, ay, az = axes[0, 0], axes[0, 1], axes[0, 2]
    row[ROLL] = -gx * (ay * pz - az * py) - gy * (az * px - ax * pz) + (ax * py - ay * px)
    row[PITCH] = -gx * (cy * pz) - gy * (sy * pz) - (sy * py + cy * px)
    ax, ay, az = axes[1, 0], axes[1, 1], axes[1, 2]
    dx, dy, dz = px - pivots[side, 0], py - pivots[side, 1], pz - pivots[side, 2]
    _, slope = right_rocker(rover, q[ROCKER])
    rate = 1.0 if side == 0 else slope
    row[ROCKER] = rate * (-gx * (ay * dz - az * dy) - gy * (az * dx - ax * dz) + (ax * dy - ay * dx))
    row[BOGIE_L] = row[BOGIE_R] = 0.0
    if i >= 2:
        dx, dy, dz = px - pivots[2 + side, 0], py - pivots[2 + side, 1], pz - pivots[2 + side, 2]
        row[BOGIE_L + side] = -gx * (ay * dz - az * dy) - gy * (az * dx - ax * dz) + (ax * dy - ay * dx)
