"""Linkage of `LANES` poses at once: wheel positions, gap derivatives and Newton steps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..jit.raw_views import unowned_view
from ..model.linkage import P_BOGIE_PIVOT, P_DIFF, P_ORDER, P_PIVOT
from ..model.sincos import sine_cosine
from ..model.tolerances import MAX_ROCKER_ANGLE, MAX_STEP_ANGLE
from .layout import CONTACT, LANES, LINE, POSE, WHEEL, in_use

Array = NDArray[np.float64]


@inlined
def line_up(buffer: Array) -> Array:
    """Return an unowned view of a buffer from its first cache-line boundary to its end.

    The processor fetches a row twice if it lies across two lines.

    Args:
        buffer: (size + LINE,) memory for a lane array.

    Returns:
        (size or more,) the view; the buffer must outlive it.
    """
    return unowned_view(buffer[(-buffer.ctypes.data % (8 * LINE)) // 8 :])


@fma_njit
def set_heading(lanes: Array) -> None:
    """Compute cos and sin of the heading.

    Args:
        lanes: the lane array (`layout`).

    Reads:  POSE.yaw
    Writes: POSE.cy, POSE.sy
    """
    for l in range(in_use(lanes)):
        sine, cosine = sine_cosine(lanes[POSE.yaw + l])
        lanes[POSE.cy + l], lanes[POSE.sy + l] = cosine, sine


@fma_njit
def place_body(lanes: Array, rover: Array) -> None:
    """Compute the body's axes, and the angle and pivot of every wheel's link.

    The rocker angle is limited to MAX_ROCKER_ANGLE in the differential's polynomial, which diverges beyond.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.

    Reads:  POSE.cy, POSE.sy, POSE.q, POSE.right, POSE.rate
    Writes: POSE.axes, POSE.right, POSE.rate, WHEEL.lc, WHEEL.ls, WHEEL.bx, WHEEL.bz, WHEEL.br
    """
    for l in range(in_use(lanes)):
        sr, cr = sine_cosine(lanes[POSE.q + LANES + l])
        sp, cp = sine_cosine(lanes[POSE.q + 2 * LANES + l])
        cy, sy = lanes[POSE.cy + l], lanes[POSE.sy + l]
        lanes[POSE.axes + l], lanes[POSE.axes + LANES + l], lanes[POSE.axes + 2 * LANES + l] = cy * cp, sy * cp, -sp
        lanes[POSE.axes + 3 * LANES + l], lanes[POSE.axes + 4 * LANES + l] = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr
        lanes[POSE.axes + 5 * LANES + l] = cp * sr
        lanes[POSE.axes + 6 * LANES + l], lanes[POSE.axes + 7 * LANES + l] = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr
        lanes[POSE.axes + 8 * LANES + l] = cp * cr
        lanes[POSE.right + l] = lanes[POSE.rate + l] = 0.0
    for k in range(int(rover[P_ORDER]) - 1, -1, -1):
        c = rover[P_DIFF + k]
        for l in range(in_use(lanes)):
            rho = min(max(lanes[POSE.q + 3 * LANES + l], -MAX_ROCKER_ANGLE), MAX_ROCKER_ANGLE)
            lanes[POSE.rate + l] = lanes[POSE.rate + l] * rho + lanes[POSE.right + l]
            lanes[POSE.right + l] = lanes[POSE.right + l] * rho + c
    bogie, rocker = (rover[P_BOGIE_PIVOT], rover[P_BOGIE_PIVOT + 2]), (rover[P_PIVOT], rover[P_PIVOT + 2])
    for l in range(in_use(lanes)):
        _place_side(lanes, l, 0, rocker, bogie, lanes[POSE.q + 3 * LANES + l], 1.0)
    bogie, rocker = (rover[P_BOGIE_PIVOT + 3], rover[P_BOGIE_PIVOT + 5]), (rover[P_PIVOT + 3], rover[P_PIVOT + 5])
    for l in range(in_use(lanes)):
        _place_side(lanes, l, 1, rocker, bogie, lanes[POSE.right + l], lanes[POSE.rate + l])


@inlined
def _place_side(
    lanes: Array, l: int, side: int, rocker: tuple[float, float], bogie: tuple[float, float], angle: float, rate: float
) -> None:
    """Compute angle and pivot of the links of one side's wheels.

    Args:
        lanes: the lane array (`layout`).
        l: lane.
        side: 0 left, 1 right.
        rocker: x and z of the rocker pivot in the body, m.
        bogie: x and z of the bogie pivot from the rocker pivot, in the rocker, m.
        angle: the side's rocker angle, rad.
        rate: its derivative by the left one.

    Reads:  POSE.q
    Writes: WHEEL.lc, WHEEL.ls, WHEEL.bx, WHEEL.bz, WHEEL.br
    """
    px, pz = rocker
    kx, kz = bogie
    near, middle, other = side * LANES + l, (2 + side) * LANES + l, (4 + side) * LANES + l
    s, c = sine_cosine(angle)
    lanes[WHEEL.lc + near], lanes[WHEEL.ls + near] = c, s
    lanes[WHEEL.bx + near], lanes[WHEEL.bz + near], lanes[WHEEL.br + near] = px, pz, rate
    x, z = px + c * kx + s * kz, pz - s * kx + c * kz
    s, c = sine_cosine(angle + lanes[POSE.q + (4 + side) * LANES + l])
    lanes[WHEEL.lc + middle], lanes[WHEEL.ls + middle], lanes[WHEEL.bx + middle], lanes[WHEEL.bz + middle] = c, s, x, z
    lanes[WHEEL.lc + other], lanes[WHEEL.ls + other], lanes[WHEEL.bx + other], lanes[WHEEL.bz + other] = c, s, x, z
    lanes[WHEEL.br + middle] = lanes[WHEEL.br + other] = rate


@fma_njit
def place_wheels(lanes: Array, rover: Array) -> None:
    """Compute hub and axle of every wheel.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.

    Reads:  POSE.axes, WHEEL.fx, WHEEL.fy, WHEEL.fz, WHEEL.fc, WHEEL.fs, WHEEL.lc, WHEEL.ls, WHEEL.bx, WHEEL.bz
    Writes: WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz
    """
    for i in range(6):
        side = i % 2
        py = rover[P_PIVOT + 3 * side + 1] + (rover[P_BOGIE_PIVOT + 3 * side + 1] if i > 1 else 0.0)
        for l in range(in_use(lanes)):
            k = i * LANES + l
            c, s, fx, fz = lanes[WHEEL.lc + k], lanes[WHEEL.ls + k], lanes[WHEEL.fx + k], lanes[WHEEL.fz + k]
            bx, by, bz = lanes[WHEEL.bx + k] + c * fx + s * fz, py + lanes[WHEEL.fy + k], lanes[WHEEL.bz + k] - s * fx + c * fz
            xx, xy, xz = lanes[POSE.axes + l], lanes[POSE.axes + LANES + l], lanes[POSE.axes + 2 * LANES + l]
            yx, yy, yz = lanes[POSE.axes + 3 * LANES + l], lanes[POSE.axes + 4 * LANES + l], lanes[POSE.axes + 5 * LANES + l]
            zx, zy, zz = lanes[POSE.axes + 6 * LANES + l], lanes[POSE.axes + 7 * LANES + l], lanes[POSE.axes + 8 * LANES + l]
            ox, oy, oz = xx * bx + yx * by + zx * bz, xy * bx + yy * by + zy * bz, xz * bx + yz * by + zz * bz
            lanes[WHEEL.ox + k], lanes[WHEEL.oy + k], lanes[WHEEL.oz + k] = ox, oy, oz
            turn, tx, tz = lanes[WHEEL.fc + k], -lanes[WHEEL.fs + k] * c, lanes[WHEEL.fs + k] * s  # the axle in the body
            ax, ay, az = xx * tx + yx * turn + zx * tz, xy * tx + yy * turn + zy * tz, xz * tx + yz * turn + zz * tz
            level = math.sqrt(ax * ax + ay * ay)
            over = 1.0 / level
            lanes[WHEEL.az + k], lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.uz + k] = az, ax * over, ay * over, level


@fma_njit
def gap_jacobian(lanes: Array, rover: Array) -> None:
    """Compute the derivatives of every gap by the unknowns.

    They are those of `model.linkage.gap_jacobian_row`.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.

    Reads:  POSE.cy, POSE.sy, POSE.axes, WHEEL.bx, WHEEL.bz, WHEEL.br, WHEEL.ox, WHEEL.oy, WHEEL.oz, CONTACT.tx, CONTACT.ty,
            CONTACT.tz, CONTACT.gx, CONTACT.gy
    Writes: CONTACT.by_roll, CONTACT.by_pitch, CONTACT.by_rocker, CONTACT.by_bogie
    """
    for i in range(6):
        side = i % 2
        px, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 2]
        for l in range(in_use(lanes)):
            k = i * LANES + l
            gx, gy = lanes[CONTACT.gx + k], lanes[CONTACT.gy + k]
            wx, wy, wz = (
                lanes[WHEEL.ox + k] + lanes[CONTACT.tx + k],
                lanes[WHEEL.oy + k] + lanes[CONTACT.ty + k],
                lanes[WHEEL.oz + k] + lanes[CONTACT.tz + k],
            )
            xx, xy, xz = lanes[POSE.axes + l], lanes[POSE.axes + LANES + l], lanes[POSE.axes + 2 * LANES + l]
            zx, zy, zz = lanes[POSE.axes + 6 * LANES + l], lanes[POSE.axes + 7 * LANES + l], lanes[POSE.axes + 8 * LANES + l]
            cy, sy = lanes[POSE.cy + l], lanes[POSE.sy + l]
            lanes[CONTACT.by_roll + k] = (xx * wy - xy * wx) - gx * (xy * wz - xz * wy) - gy * (xz * wx - xx * wz)
            lanes[CONTACT.by_pitch + k] = -gx * (cy * wz) - gy * (sy * wz) - (sy * wy + cy * wx)
            # x and z of the normal and of the contact, in the body
            nx, nz = xz - gx * xx - gy * xy, zz - gx * zx - gy * zy
            bx, bz = xx * wx + xy * wy + xz * wz, zx * wx + zy * wy + zz * wz
            lanes[CONTACT.by_rocker + k] = lanes[WHEEL.br + k] * (nx * (bz - pz) - nz * (bx - px))
            lanes[CONTACT.by_bogie + k] = nx * (bz - lanes[WHEEL.bz + k]) - nz * (bx - lanes[WHEEL.bx + k])


@inlined
def _eliminate_bogie(
    lanes: Array, l: int, side: int, a1: float, a2: float, a3: float, a: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Eliminate z and the bogie angle from the equations of the two wheels of a bogie.

    An equation reads z + c1 roll + c2 pitch + c3 rocker + c4 bogie = right-hand side. The wheel with the larger
    |c4| is the pivot.

    Args:
        lanes: the lane array (`layout`).
        l: lane.
        side: 0 left, 1 right.
        a1, a2, a3, a: c1 to c3 and right-hand side of wheel 0, which has no bogie.

    Returns:
        c1 to c4 and right-hand side of the pivot's equation; c1 to c3 and right-hand side of the other, without z and bogie.

    Reads:  CONTACT.gap, CONTACT.by_roll, CONTACT.by_pitch, CONTACT.by_rocker, CONTACT.by_bogie
    Writes: none
    """
    middle, other = (2 + side) * LANES + l, (4 + side) * LANES + l
    m1, m2, m3 = lanes[CONTACT.by_roll + middle], lanes[CONTACT.by_pitch + middle], lanes[CONTACT.by_rocker + middle]
    m4, m = lanes[CONTACT.by_bogie + middle], -lanes[CONTACT.gap + middle]
    o1, o2, o3 = lanes[CONTACT.by_roll + other], lanes[CONTACT.by_pitch + other], lanes[CONTACT.by_rocker + other]
    o4, o = lanes[CONTACT.by_bogie + other], -lanes[CONTACT.gap + other]
    swap = abs(o4) > abs(m4)
    l1, l2, l3, l4, lb = (
        o1 if swap else m1, o2 if swap else m2, o3 if swap else m3, o4 if swap else m4, o if swap else m,
    )  # fmt: skip
    k = (m4 if swap else o4) / l4
    z = 1.0 - k
    q1 = (m1 if swap else o1) - k * l1 - z * a1
    q2 = (m2 if swap else o2) - k * l2 - z * a2
    q3 = (m3 if swap else o3) - k * l3 - z * a3
    q = (m if swap else o) - k * lb - z * a
    return l1, l2, l3, l4, lb, q1, q2, q3, q


@fma_njit
def solve_step(lanes: Array) -> None:
    """Compute the Newton step of q (as `solve.newton.solve_linkage`).

    The step is NaN where the Jacobian is singular. Wheels 0 and 1 do not depend on the bogies. With wheel 0's equation, z
    is eliminated from wheel 1's; each side's bogie and z are eliminated from its other two wheels'. Three equations in
    roll, pitch and rocker remain, solved by Cramer's rule.

    Args:
        lanes: the lane array (`layout`).

    Reads:  CONTACT.gap, CONTACT.by_roll, CONTACT.by_pitch, CONTACT.by_rocker, CONTACT.by_bogie
    Writes: POSE.step
    """
    for l in range(in_use(lanes)):
        a1, a2, a3, a = (
            lanes[CONTACT.by_roll + l],
            lanes[CONTACT.by_pitch + l],
            lanes[CONTACT.by_rocker + l],
            -lanes[CONTACT.gap + l],
        )
        p1, p2, p3, p = (
            lanes[CONTACT.by_roll + LANES + l] - a1,
            lanes[CONTACT.by_pitch + LANES + l] - a2,
            lanes[CONTACT.by_rocker + LANES + l] - a3,
            -lanes[CONTACT.gap + LANES + l] - a,
        )
        l1, l2, l3, l4, lb, q1, q2, q3, q = _eliminate_bogie(lanes, l, 0, a1, a2, a3, a)
        e1, e2, e3, e4, eb, r1, r2, r3, r = _eliminate_bogie(lanes, l, 1, a1, a2, a3, a)
        u1, u2, u3 = q2 * r3 - q3 * r2, q3 * r1 - q1 * r3, q1 * r2 - q2 * r1
        v1, v2, v3 = r2 * p3 - r3 * p2, r3 * p1 - r1 * p3, r1 * p2 - r2 * p1
        w1, w2, w3 = p2 * q3 - p3 * q2, p3 * q1 - p1 * q3, p1 * q2 - p2 * q1
        over = 1.0 / (p1 * u1 + p2 * u2 + p3 * u3)
        roll, pitch, rocker = (
            (p * u1 + q * v1 + r * w1) * over,
            (p * u2 + q * v2 + r * w2) * over,
            (p * u3 + q * v3 + r * w3) * over,
        )
        z = a - a1 * roll - a2 * pitch - a3 * rocker
        lanes[POSE.step + l], lanes[POSE.step + LANES + l] = z, roll
        lanes[POSE.step + 2 * LANES + l], lanes[POSE.step + 3 * LANES + l] = pitch, rocker
        lanes[POSE.step + 4 * LANES + l] = (lb - z - l1 * roll - l2 * pitch - l3 * rocker) / l4
        lanes[POSE.step + 5 * LANES + l] = (eb - z - e1 * roll - e2 * pitch - e3 * rocker) / e4


@fma_njit
def take_step(lanes: Array) -> None:
    """Move the active lanes by their step.

    A step is scaled so that no angle changes by more than MAX_STEP_ANGLE. A step that is not finite is not taken.

    Args:
        lanes: the lane array (`layout`).

    Reads:  POSE.q, POSE.step, POSE.active
    Writes: POSE.q, POSE.worst
    """
    for l in range(in_use(lanes)):
        z, roll, pitch = lanes[POSE.step + l], lanes[POSE.step + LANES + l], lanes[POSE.step + 2 * LANES + l]
        rocker, left, right = lanes[POSE.step + 3 * LANES + l], lanes[POSE.step + 4 * LANES + l], lanes[POSE.step + 5 * LANES + l]
        total = abs(z) + abs(roll) + abs(pitch) + abs(rocker) + abs(left) + abs(right)
        finite = total < math.inf
        big = max(max(abs(roll), abs(pitch)), max(abs(rocker), max(abs(left), abs(right))))
        lanes[POSE.worst + l] = max(big, abs(z)) if finite else math.inf
        scale = lanes[POSE.active + l] * MAX_STEP_ANGLE / max(big, MAX_STEP_ANGLE)
        lanes[POSE.q + l] += scale * z if finite else 0.0
        lanes[POSE.q + LANES + l] += scale * roll if finite else 0.0
        lanes[POSE.q + 2 * LANES + l] += scale * pitch if finite else 0.0
        lanes[POSE.q + 3 * LANES + l] += scale * rocker if finite else 0.0
        lanes[POSE.q + 4 * LANES + l] += scale * left if finite else 0.0
        lanes[POSE.q + 5 * LANES + l] += scale * right if finite else 0.0
