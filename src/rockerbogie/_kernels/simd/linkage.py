"""The linkage of `LANES` poses at once: the loops a compiler turns into fused instructions.

All of a block's numbers lie in one flat array, in rows of a lane for each pose: S[ROW + lane], and S[ROW + k] with
k = wheel * LANES + lane for what there is one of for each wheel. Rows start at constants and the inner loops are over lanes
alone, which is what lets the compiler see that rows do not overlap.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..jit.raw_views import node_taker, unowned_view
from ..model.linkage import P_BOGIE_PIVOT, P_DIFF, P_ORDER, P_PIVOT
from ..model.sincos import sine_cosine
from ..model.tolerances import MAX_ROCKER_ANGLE, MAX_STEP_ANGLE

Array = NDArray[np.float64]

LANES = 16
ALL = 6 * LANES


def rows(start: int, sizes: tuple[int, ...]) -> list[int]:
    """Where rows of these sizes start, one after another."""
    return [start + sum(sizes[:n]) for n in range(len(sizes) + 1)]


# A pose: its place from the map's first node, heading, the six unknowns (linkage.Z ...) and their step, whether it is still
# sought (1 or 0), the greatest part of the last step, the body's axes, the right rocker's angle and its rate to the left's.
X, Y, CY, SY, Q, STEP, ACTIVE, WORST, AXES, RIGHT, RATE, _wheels = rows(
    0, (*[LANES] * 4, 6 * LANES, 6 * LANES, LANES, LANES, 9 * LANES, LANES, LANES)
)
# A wheel: its foot (linkage.stand_feet); cos and sin of its link's angle to the body, where in the body (x, z) that is
# pivoted, and the rate of its rocker; hub from the body's origin; its axle: z, level direction and level length.
FX, FY, FZ, FC, FS, LC, LS, BX, BZ, BR, OX, OY, OZ, AZ, VX, VY, UZ, _touch = rows(_wheels, (ALL,) * 17)
# Where it touches: sin φ, cos φ, s; that place from the hub, the contact's slope, the gap, and the gap's change with roll,
# pitch, rocker and bogie.
SINE, COSINE, PLACE, TX, TY, TZ, GX, GY, GAP, BY_ROLL, BY_PITCH, BY_ROCKER, BY_BOGIE, ROWS = rows(_touch, (ALL,) * 13)


LINE = 8  # numbers that the processor fetches together


@inlined
def line_up(buffer: Array) -> Array:
    """A `unowned_view` view of a buffer from where rows begin on such a line: one that lies across two is fetched twice. The
    buffer has
    `LINE` numbers more than the rows."""
    return unowned_view(buffer[(-buffer.ctypes.data % (8 * LINE)) // 8 :])


#: Heights at the corners of a cell, and the 16 coefficients of one, for every lane.
take_corners, take_patch = node_taker(2, LANES), node_taker(4, LANES)


@fma_njit
def head(lanes: Array) -> None:
    """cos and sin of the heading, for the heading itself in CY."""
    for l in range(LANES):
        sine, cosine = sine_cosine(lanes[CY + l])
        lanes[CY + l], lanes[SY + l] = cosine, sine


@fma_njit
def place_body(lanes: Array, rover: Array) -> None:
    """The body's axes, and the angle and pivot of every wheel's link."""
    for l in range(LANES):
        sr, cr = sine_cosine(lanes[Q + LANES + l])
        sp, cp = sine_cosine(lanes[Q + 2 * LANES + l])
        cy, sy = lanes[CY + l], lanes[SY + l]
        lanes[AXES + l], lanes[AXES + LANES + l], lanes[AXES + 2 * LANES + l] = cy * cp, sy * cp, -sp
        lanes[AXES + 3 * LANES + l], lanes[AXES + 4 * LANES + l] = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr
        lanes[AXES + 5 * LANES + l] = cp * sr
        lanes[AXES + 6 * LANES + l], lanes[AXES + 7 * LANES + l] = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr
        lanes[AXES + 8 * LANES + l] = cp * cr
        lanes[RIGHT + l] = lanes[RATE + l] = 0.0
    for k in range(int(rover[P_ORDER]) - 1, -1, -1):
        c = rover[P_DIFF + k]
        for l in range(LANES):
            rho = min(max(lanes[Q + 3 * LANES + l], -MAX_ROCKER_ANGLE), MAX_ROCKER_ANGLE)  # beyond, a polynomial would run away
            lanes[RATE + l] = lanes[RATE + l] * rho + lanes[RIGHT + l]
            lanes[RIGHT + l] = lanes[RIGHT + l] * rho + c
    kx, kz, px, pz = rover[P_BOGIE_PIVOT], rover[P_BOGIE_PIVOT + 2], rover[P_PIVOT], rover[P_PIVOT + 2]
    for l in range(LANES):
        angle = lanes[Q + 3 * LANES + l]
        s, c = sine_cosine(angle)
        lanes[LC + l], lanes[LS + l], lanes[BX + l], lanes[BZ + l], lanes[BR + l] = c, s, px, pz, 1.0
        x, z = px + c * kx + s * kz, pz - s * kx + c * kz
        s, c = sine_cosine(angle + lanes[Q + 4 * LANES + l])
        lanes[LC + 2 * LANES + l], lanes[LS + 2 * LANES + l], lanes[BX + 2 * LANES + l], lanes[BZ + 2 * LANES + l] = c, s, x, z
        lanes[LC + 4 * LANES + l], lanes[LS + 4 * LANES + l], lanes[BX + 4 * LANES + l], lanes[BZ + 4 * LANES + l] = c, s, x, z
        lanes[BR + 2 * LANES + l] = lanes[BR + 4 * LANES + l] = 1.0
    kx, kz, px, pz = rover[P_BOGIE_PIVOT + 3], rover[P_BOGIE_PIVOT + 5], rover[P_PIVOT + 3], rover[P_PIVOT + 5]
    for l in range(LANES):
        angle, rate = lanes[RIGHT + l], lanes[RATE + l]
        s, c = sine_cosine(angle)
        lanes[LC + LANES + l], lanes[LS + LANES + l], lanes[BX + LANES + l], lanes[BZ + LANES + l], lanes[BR + LANES + l] = (
            c,
            s,
            px,
            pz,
            rate,
        )
        x, z = px + c * kx + s * kz, pz - s * kx + c * kz
        s, c = sine_cosine(angle + lanes[Q + 5 * LANES + l])
        lanes[LC + 3 * LANES + l], lanes[LS + 3 * LANES + l], lanes[BX + 3 * LANES + l], lanes[BZ + 3 * LANES + l] = c, s, x, z
        lanes[LC + 5 * LANES + l], lanes[LS + 5 * LANES + l], lanes[BX + 5 * LANES + l], lanes[BZ + 5 * LANES + l] = c, s, x, z
        lanes[BR + 3 * LANES + l] = lanes[BR + 5 * LANES + l] = rate


@fma_njit
def place_wheels(lanes: Array, rover: Array) -> None:
    """Hub and axle of every wheel."""
    for i in range(6):
        side = i % 2
        py = rover[P_PIVOT + 3 * side + 1] + (rover[P_BOGIE_PIVOT + 3 * side + 1] if i > 1 else 0.0)
        for l in range(LANES):
            k = i * LANES + l
            c, s, fx, fz = lanes[LC + k], lanes[LS + k], lanes[FX + k], lanes[FZ + k]
            bx, by, bz = lanes[BX + k] + c * fx + s * fz, py + lanes[FY + k], lanes[BZ + k] - s * fx + c * fz
            xx, xy, xz = lanes[AXES + l], lanes[AXES + LANES + l], lanes[AXES + 2 * LANES + l]
            yx, yy, yz = lanes[AXES + 3 * LANES + l], lanes[AXES + 4 * LANES + l], lanes[AXES + 5 * LANES + l]
            zx, zy, zz = lanes[AXES + 6 * LANES + l], lanes[AXES + 7 * LANES + l], lanes[AXES + 8 * LANES + l]
            ox, oy, oz = xx * bx + yx * by + zx * bz, xy * bx + yy * by + zy * bz, xz * bx + yz * by + zz * bz
            lanes[OX + k], lanes[OY + k], lanes[OZ + k] = ox, oy, oz
            turn, tx, tz = lanes[FC + k], -lanes[FS + k] * c, lanes[FS + k] * s  # the axle in the body
            ax, ay, az = xx * tx + yx * turn + zx * tz, xy * tx + yy * turn + zy * tz, xz * tx + yz * turn + zz * tz
            level = math.sqrt(ax * ax + ay * ay)
            over = 1.0 / level
            lanes[AZ + k], lanes[VX + k], lanes[VY + k], lanes[UZ + k] = az, ax * over, ay * over, level


@fma_njit
def gap_jacobian(lanes: Array, rover: Array) -> None:
    """How every gap changes with the unknowns (`linkage.slope_row`)."""
    for i in range(6):
        side = i % 2
        px, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 2]
        for l in range(LANES):
            k = i * LANES + l
            gx, gy = lanes[GX + k], lanes[GY + k]
            wx, wy, wz = lanes[OX + k] + lanes[TX + k], lanes[OY + k] + lanes[TY + k], lanes[OZ + k] + lanes[TZ + k]
            xx, xy, xz = lanes[AXES + l], lanes[AXES + LANES + l], lanes[AXES + 2 * LANES + l]
            zx, zy, zz = lanes[AXES + 6 * LANES + l], lanes[AXES + 7 * LANES + l], lanes[AXES + 8 * LANES + l]
            cy, sy = lanes[CY + l], lanes[SY + l]
            lanes[BY_ROLL + k] = (xx * wy - xy * wx) - gx * (xy * wz - xz * wy) - gy * (xz * wx - xx * wz)
            lanes[BY_PITCH + k] = -gx * (cy * wz) - gy * (sy * wz) - (sy * wy + cy * wx)
            # x and z of the normal and of the place, in the body
            nx, nz = xz - gx * xx - gy * xy, zz - gx * zx - gy * zy
            bx, bz = xx * wx + xy * wy + xz * wz, zx * wx + zy * wy + zz * wz
            lanes[BY_ROCKER + k] = lanes[BR + k] * (nx * (bz - pz) - nz * (bx - px))
            lanes[BY_BOGIE + k] = nx * (bz - lanes[BZ + k]) - nz * (bx - lanes[BX + k])


@fma_njit
def solve_step(lanes: Array) -> None:
    """Fill STEP: Newton's step of all lanes. As `newton.solve_linkage`, whose words explain it; nan where singular."""
    for l in range(LANES):
        # wheels 0, 1 know no bogie
        a1, a2, a3, a = lanes[BY_ROLL + l], lanes[BY_PITCH + l], lanes[BY_ROCKER + l], -lanes[GAP + l]
        p1, p2, p3, p = (
            lanes[BY_ROLL + LANES + l] - a1,
            lanes[BY_PITCH + LANES + l] - a2,
            lanes[BY_ROCKER + LANES + l] - a3,
            -lanes[GAP + LANES + l] - a,
        )
        # left: wheels 2, 4, the one that the bogie moves more first
        m4, o4 = lanes[BY_BOGIE + 2 * LANES + l], lanes[BY_BOGIE + 4 * LANES + l]
        swap = abs(o4) > abs(m4)
        m1, o1 = lanes[BY_ROLL + 2 * LANES + l], lanes[BY_ROLL + 4 * LANES + l]
        m2, o2 = lanes[BY_PITCH + 2 * LANES + l], lanes[BY_PITCH + 4 * LANES + l]
        m3, o3 = lanes[BY_ROCKER + 2 * LANES + l], lanes[BY_ROCKER + 4 * LANES + l]
        m, o = -lanes[GAP + 2 * LANES + l], -lanes[GAP + 4 * LANES + l]
        l1, l2, l3, l4, lb = (
            o1 if swap else m1, o2 if swap else m2, o3 if swap else m3, o4 if swap else m4, o if swap else m,
        )  # fmt: skip
        k = (m4 if swap else o4) / l4
        z = 1.0 - k
        q1 = (m1 if swap else o1) - k * l1 - z * a1
        q2 = (m2 if swap else o2) - k * l2 - z * a2
        q3 = (m3 if swap else o3) - k * l3 - z * a3
        q = (m if swap else o) - k * lb - z * a
        # right: wheels 3, 5
        m4, o4 = lanes[BY_BOGIE + 3 * LANES + l], lanes[BY_BOGIE + 5 * LANES + l]
        swap = abs(o4) > abs(m4)
        m1, o1 = lanes[BY_ROLL + 3 * LANES + l], lanes[BY_ROLL + 5 * LANES + l]
        m2, o2 = lanes[BY_PITCH + 3 * LANES + l], lanes[BY_PITCH + 5 * LANES + l]
        m3, o3 = lanes[BY_ROCKER + 3 * LANES + l], lanes[BY_ROCKER + 5 * LANES + l]
        m, o = -lanes[GAP + 3 * LANES + l], -lanes[GAP + 5 * LANES + l]
        e1, e2, e3, e4, eb = (
            o1 if swap else m1, o2 if swap else m2, o3 if swap else m3, o4 if swap else m4, o if swap else m,
        )  # fmt: skip
        k = (m4 if swap else o4) / e4
        z = 1.0 - k
        r1 = (m1 if swap else o1) - k * e1 - z * a1
        r2 = (m2 if swap else o2) - k * e2 - z * a2
        r3 = (m3 if swap else o3) - k * e3 - z * a3
        r = (m if swap else o) - k * eb - z * a
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
        lanes[STEP + l], lanes[STEP + LANES + l] = z, roll
        lanes[STEP + 2 * LANES + l], lanes[STEP + 3 * LANES + l] = pitch, rocker
        lanes[STEP + 4 * LANES + l] = (lb - z - l1 * roll - l2 * pitch - l3 * rocker) / l4
        lanes[STEP + 5 * LANES + l] = (eb - z - e1 * roll - e2 * pitch - e3 * rocker) / e4


@fma_njit
def take_step(lanes: Array) -> None:
    """Move the live lanes by STEP, shortened where it would turn anything by more than `MAX_STEP_ANGLE`; WORST is its
    greatest part.
    A step that is not finite is not taken, and is infinite."""
    for l in range(LANES):
        z, roll, pitch = lanes[STEP + l], lanes[STEP + LANES + l], lanes[STEP + 2 * LANES + l]
        rocker, left, right = lanes[STEP + 3 * LANES + l], lanes[STEP + 4 * LANES + l], lanes[STEP + 5 * LANES + l]
        total = abs(z) + abs(roll) + abs(pitch) + abs(rocker) + abs(left) + abs(right)
        finite = total < math.inf
        big = max(max(abs(roll), abs(pitch)), max(abs(rocker), max(abs(left), abs(right))))
        lanes[WORST + l] = max(big, abs(z)) if finite else math.inf
        scale = lanes[ACTIVE + l] * MAX_STEP_ANGLE / max(big, MAX_STEP_ANGLE)
        lanes[Q + l] += scale * z if finite else 0.0
        lanes[Q + LANES + l] += scale * roll if finite else 0.0
        lanes[Q + 2 * LANES + l] += scale * pitch if finite else 0.0
        lanes[Q + 3 * LANES + l] += scale * rocker if finite else 0.0
        lanes[Q + 4 * LANES + l] += scale * left if finite else 0.0
        lanes[Q + 5 * LANES + l] += scale * right if finite else 0.0
