"""The nine balance equations of the mechanism, and the contribution of each contact to them.

Generalized velocities are (V, Ω, ρ', βL', βR'): velocity of the body's origin and angular velocity, both in world axes, and
the rates of the left rocker and of both bogies. By virtual power, the forces on the mechanism balance if and only if their
power is zero for every generalized velocity, motors and brakes holding the wheels still (docs/forces.md).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.linkage import P_BODY, P_BOGIE, P_ROCKER, P_WHEEL, ROCKER, right_rocker
from ..model.wheel import AX, AY, AZ, HX, HY, HZ

Array = NDArray[np.float64]

EQUATIONS = 9  # force (3), moment about the body's origin (3), left rocker, left bogie, right bogie
NORMAL, TRACTION, SIDE = range(3)


@njit
def force_column(
    rate: float, on_bogie: bool, side: int, axes: Array, pivots: Array,
    px: float, py: float, pz: float, fx: float, fy: float, fz: float, column: Array,
) -> None:  # fmt: skip
    """Add the generalized force of a force on one side's links to a column.

    Args:
        rate: derivative of this side's rocker angle with respect to the left one; 0 for a force on the body.
        on_bogie: True if the force acts on the bogie or its wheels.
        side: 0 left, 1 right.
        axes: (3, 3) the body's x, y, z directions in the world, one a row.
        pivots: (4, 3) both rocker pivots, then both bogie pivots, from the body's origin, m.
        px, py, pz: point of action from the body's origin, m.
        fx, fy, fz: the force, N.
        column: (9,) generalized force, N and N m; changed.
    """
    column[0] += fx
    column[1] += fy
    column[2] += fz
    column[3] += py * fz - pz * fy
    column[4] += pz * fx - px * fz
    column[5] += px * fy - py * fx
    ax, ay, az = axes[1, 0], axes[1, 1], axes[1, 2]
    if rate != 0.0:
        dx, dy, dz = px - pivots[side, 0], py - pivots[side, 1], pz - pivots[side, 2]
        column[6] += rate * (ax * (dy * fz - dz * fy) + ay * (dz * fx - dx * fz) + az * (dx * fy - dy * fx))
    if on_bogie:
        dx, dy, dz = px - pivots[2 + side, 0], py - pivots[2 + side, 1], pz - pivots[2 + side, 2]
        column[7 + side] += ax * (dy * fz - dz * fy) + ay * (dz * fx - dx * fz) + az * (dx * fy - dy * fx)


@njit
def contact_columns(
    rover: Array, q: Array, axes: Array, pivots: Array, wheels: Array, point: Array, normal: Array, columns: Array, frame: Array
) -> None:
    """Fill the generalized forces of unit forces at the six contacts.

    Args:
        rover: (P_SIZE,) the packed rover.
        q: (6,) pose: z, roll, pitch, rocker, both bogies.
        axes: (3, 3) the body's directions in the world, one a row.
        pivots: (4, 3) rocker pivots, then bogie pivots, from the body's origin, m.
        wheels: (6, WHEEL_SIZE) wheels with the body's origin at (0, 0, 0).
        point: (6, 3) contact points from the body's origin, m; NaN where there is none.
        normal: (6, 3) unit normals from the terrain into the wheel.
        columns: (6, 3, 9) filled: unit normal force, traction and side force; 0 where there is no contact.
        frame: (6, 3, 3) filled with the directions of the three, one a row.
    """
    columns[:] = frame[:] = 0.0
    _, slope = right_rocker(rover, q[ROCKER])
    for i in range(6):
        if math.isnan(point[i, 0]):
            continue
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        ax, ay, az = wheels[i, AX], wheels[i, AY], wheels[i, AZ]
        tx, ty, tz = ay * nz - az * ny, az * nx - ax * nz, ax * ny - ay * nx
        size = math.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx / size, ty / size, tz / size
        frame[i, 0, 0], frame[i, 0, 1], frame[i, 0, 2] = nx, ny, nz
        frame[i, 1, 0], frame[i, 1, 1], frame[i, 1, 2] = tx, ty, tz
        frame[i, 2, 0], frame[i, 2, 1], frame[i, 2, 2] = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        rate = 1.0 if i % 2 == 0 else slope
        for c in range(3):
            force_column(
                rate, i >= 2, i % 2, axes, pivots, point[i, 0], point[i, 1], point[i, 2],
                frame[i, c, 0], frame[i, c, 1], frame[i, c, 2], columns[i, c],
            )  # fmt: skip


@njit
def weight_column(
    rover: Array, hub_offsets: Array, q: Array, axes: Array, pivots: Array, gx: float, gy: float, gz: float, column: Array
) -> float:
    """Fill the generalized force of gravity on all links.

    Args:
        rover: (P_SIZE,) the packed rover.
        hub_offsets: (6, 5) as `linkage.set_hub_offsets` fills them.
        q: (6,) pose: z, roll, pitch, rocker, both bogies.
        axes, pivots: as for `contact_columns`.
        gx, gy, gz: gravity less the rover's acceleration, m/s².
        column: (9,) filled, N and N m.

    Returns:
        The rover's mass, kg.
    """
    column[:] = 0.0
    other, slope = right_rocker(rover, q[ROCKER])
    m, a, b, c = rover[P_BODY], rover[P_BODY + 1], rover[P_BODY + 2], rover[P_BODY + 3]
    px = axes[0, 0] * a + axes[1, 0] * b + axes[2, 0] * c
    py = axes[0, 1] * a + axes[1, 1] * b + axes[2, 1] * c
    pz = axes[0, 2] * a + axes[1, 2] * b + axes[2, 2] * c
    force_column(0.0, False, 0, axes, pivots, px, py, pz, m * gx, m * gy, m * gz, column)
    mass = m
    for side in range(2):
        rate = 1.0 if side == 0 else slope
        arm = q[ROCKER] if side == 0 else other
        for part in range(5):  # rocker, bogie, then the three wheels of this side
            i = 2 * (part - 2) + side
            on_bogie = part == 1 or part >= 3
            at = P_ROCKER + 4 * side if part == 0 else (P_BOGIE + 4 * side if part == 1 else P_WHEEL + 4 * i)
            m, a, b, c = rover[at], rover[at + 1], rover[at + 2], rover[at + 3]
            if part >= 2:
                cs, sn = hub_offsets[i, 3], hub_offsets[i, 4]
                a, b = hub_offsets[i, 0] + cs * a - sn * b, hub_offsets[i, 1] + sn * a + cs * b
                c += hub_offsets[i, 2]
            angle = arm + q[4 + side] if on_bogie else arm
            base = 2 + side if on_bogie else side
            ct, st = math.cos(angle), math.sin(angle)
            u, w = ct * a + st * c, ct * c - st * a  # along the body's x and z
            px = pivots[base, 0] + axes[0, 0] * u + axes[1, 0] * b + axes[2, 0] * w
            py = pivots[base, 1] + axes[0, 1] * u + axes[1, 1] * b + axes[2, 1] * w
            pz = pivots[base, 2] + axes[0, 2] * u + axes[1, 2] * b + axes[2, 2] * w
            force_column(rate, on_bogie, side, axes, pivots, px, py, pz, m * gx, m * gy, m * gz, column)
            mass += m
    return mass


@njit
def axle_torque(wheel: Array, point: Array, fx: float, fy: float, fz: float) -> float:
    """Return the motor torque that holds a wheel against its contact force, N m.

    Args:
        wheel: (WHEEL_SIZE,) the wheel with the body's origin at (0, 0, 0).
        point: (3,) contact point from the body's origin, m.
        fx, fy, fz: contact force on the wheel, N.
    """
    dx, dy, dz = point[0] - wheel[HX], point[1] - wheel[HY], point[2] - wheel[HZ]
    return -(wheel[AX] * (dy * fz - dz * fy) + wheel[AY] * (dz * fx - dx * fz) + wheel[AZ] * (dx * fy - dy * fx))
