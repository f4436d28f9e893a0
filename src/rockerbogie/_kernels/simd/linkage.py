"""The linkage of `LANES` poses at once: the loops a compiler turns into fused instructions.

All of a block's numbers lie in one flat array, in rows of a lane for each pose: S[ROW + lane], and S[ROW + k] with
k = wheel * LANES + lane for what there is one of for each wheel. Rows start at constants and the inner loops are over lanes
alone, which is what lets the compiler see that rows do not overlap.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fused, inlined
from ..jit.raw_views import bare, node_taker
from ..model.linkage import P_DIFF, P_KNEE, P_ORDER, P_PIVOT
from ..model.sincos import sine_cosine

Array = NDArray[np.float64]

LANES = 16
ALL = 6 * LANES


def rows(start: int, sizes: tuple[int, ...]) -> list[int]:
    """Where rows of these sizes start, one after another."""
    return [start + sum(sizes[:n]) for n in range(len(sizes) + 1)]


# A pose: its place from the map's first node, heading, the six unknowns (linkage.Z ...) and their step, whether it is still
# sought (1 or 0), the greatest part of the last step, the body's axes, the right rocker's angle and its rate to the left's.
X, Y, CY, SY, Q, STEP, LIVE, WORST, AXES, RIGHT, RATE, _wheels = rows(
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
    """A `bare` view of a buffer from where rows begin on such a line: one that lies across two is fetched twice. The buffer has
    `LINE` numbers more than the rows."""
    return bare(buffer[(-buffer.ctypes.data % (8 * LINE)) // 8 :])


#: Heights at the corners of a cell, and the 16 coefficients of one, for every lane.
take_corners, take_patch = node_taker(2, LANES), node_taker(4, LANES)


@fused
def head(S: Array) -> None:
    """cos and sin of the heading, for the heading itself in CY."""
    for l in range(LANES):
        sine, cosine = sine_cosine(S[CY + l])
        S[CY + l], S[SY + l] = cosine, sine


@fused
def place_body(S: Array, rover: Array) -> None:
    """The body's axes, and the angle and pivot of every wheel's link."""
    for l in range(LANES):
        sr, cr = sine_cosine(S[Q + LANES + l])
        sp, cp = sine_cosine(S[Q + 2 * LANES + l])
        cy, sy = S[CY + l], S[SY + l]
        S[AXES + l], S[AXES + LANES + l], S[AXES + 2 * LANES + l] = cy * cp, sy * cp, -sp
        S[AXES + 3 * LANES + l], S[AXES + 4 * LANES + l] = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr
        S[AXES + 5 * LANES + l] = cp * sr
        S[AXES + 6 * LANES + l], S[AXES + 7 * LANES + l] = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr
        S[AXES + 8 * LANES + l] = cp * cr
        S[RIGHT + l] = S[RATE + l] = 0.0
    for k in range(int(rover[P_ORDER]) - 1, -1, -1):
        c = rover[P_DIFF + k]
        for l in range(LANES):
            rho = min(max(S[Q + 3 * LANES + l], -FOLDED), FOLDED)  # beyond, a polynomial would run away
            S[RATE + l] = S[RATE + l] * rho + S[RIGHT + l]
            S[RIGHT + l] = S[RIGHT + l] * rho + c
    kx, kz, px, pz = rover[P_KNEE], rover[P_KNEE + 2], rover[P_PIVOT], rover[P_PIVOT + 2]
    for l in range(LANES):
        angle = S[Q + 3 * LANES + l]
        s, c = sine_cosine(angle)
        S[LC + l], S[LS + l], S[BX + l], S[BZ + l], S[BR + l] = c, s, px, pz, 1.0
        x, z = px + c * kx + s * kz, pz - s * kx + c * kz
        s, c = sine_cosine(angle + S[Q + 4 * LANES + l])
        S[LC + 2 * LANES + l], S[LS + 2 * LANES + l], S[BX + 2 * LANES + l], S[BZ + 2 * LANES + l] = c, s, x, z
        S[LC + 4 * LANES + l], S[LS + 4 * LANES + l], S[BX + 4 * LANES + l], S[BZ + 4 * LANES + l] = c, s, x, z
        S[BR + 2 * LANES + l] = S[BR + 4 * LANES + l] = 1.0
    kx, kz, px, pz = rover[P_KNEE + 3], rover[P_KNEE + 5], rover[P_PIVOT + 3], rover[P_PIVOT + 5]
    for l in range(LANES):
        angle, rate = S[RIGHT + l], S[RATE + l]
        s, c = sine_cosine(angle)
        S[LC + LANES + l], S[LS + LANES + l], S[BX + LANES + l], S[BZ + LANES + l], S[BR + LANES + l] = c, s, px, pz, rate
        x, z = px + c * kx + s * kz, pz - s * kx + c * kz
        s, c = sine_cosine(angle + S[Q + 5 * LANES + l])
        S[LC + 3 * LANES + l], S[LS + 3 * LANES + l], S[BX + 3 * LANES + l], S[BZ + 3 * LANES + l] = c, s, x, z
        S[LC + 5 * LANES + l], S[LS + 5 * LANES + l], S[BX + 5 * LANES + l], S[BZ + 5 * LANES + l] = c, s, x, z
        S[BR + 3 * LANES + l] = S[BR + 5 * LANES + l] = rate


@fused
def place_wheels(S: Array, rover: Array) -> None:
    """Hub and axle of every wheel."""
    for i in range(6):
        side = i % 2
        py = rover[P_PIVOT + 3 * side + 1] + (rover[P_KNEE + 3 * side + 1] if i > 1 else 0.0)
        for l in range(LANES):
            k = i * LANES + l
            c, s, fx, fz = S[LC + k], S[LS + k], S[FX + k], S[FZ + k]
            bx, by, bz = S[BX + k] + c * fx + s * fz, py + S[FY + k], S[BZ + k] - s * fx + c * fz
            xx, xy, xz = S[AXES + l], S[AXES + LANES + l], S[AXES + 2 * LANES + l]
            yx, yy, yz = S[AXES + 3 * LANES + l], S[AXES + 4 * LANES + l], S[AXES + 5 * LANES + l]
            zx, zy, zz = S[AXES + 6 * LANES + l], S[AXES + 7 * LANES + l], S[AXES + 8 * LANES + l]
            ox, oy, oz = xx * bx + yx * by + zx * bz, xy * bx + yy * by + zy * bz, xz * bx + yz * by + zz * bz
            S[OX + k], S[OY + k], S[OZ + k] = ox, oy, oz
            turn, tx, tz = S[FC + k], -S[FS + k] * c, S[FS + k] * s  # the axle in the body
            ax, ay, az = xx * tx + yx * turn + zx * tz, xy * tx + yy * turn + zy * tz, xz * tx + yz * turn + zz * tz
            level = math.sqrt(ax * ax + ay * ay)
            over = 1.0 / level
            S[AZ + k], S[VX + k], S[VY + k], S[UZ + k] = az, ax * over, ay * over, level


@fused
def slopes(S: Array, rover: Array) -> None:
    """How every gap changes with the unknowns (`linkage.slope_row`)."""
    for i in range(6):
        side = i % 2
        px, pz = rover[P_PIVOT + 3 * side], rover[P_PIVOT + 3 * side + 2]
        for l in range(LANES):
            k = i * LANES + l
            gx, gy = S[GX + k], S[GY + k]
            wx, wy, wz = S[OX + k] + S[TX + k], S[OY + k] + S[TY + k], S[OZ + k] + S[TZ + k]
            xx, xy, xz = S[AXES + l], S[AXES + LANES + l], S[AXES + 2 * LANES + l]
            zx, zy, zz = S[AXES + 6 * LANES + l], S[AXES + 7 * LANES + l], S[AXES + 8 * LANES + l]
            cy, sy = S[CY + l], S[SY + l]
            S[BY_ROLL + k] = (xx * wy - xy * wx) - gx * (xy * wz - xz * wy) - gy * (xz * wx - xx * wz)
            S[BY_PITCH + k] = -gx * (cy * wz) - gy * (sy * wz) - (sy * wy + cy * wx)
            # x and z of the normal and of the place, in the body
            nx, nz = xz - gx * xx - gy * xy, zz - gx * zx - gy * zy
            bx, bz = xx * wx + xy * wy + xz * wz, zx * wx + zy * wy + zz * wz
            S[BY_ROCKER + k] = S[BR + k] * (nx * (bz - pz) - nz * (bx - px))
            S[BY_BOGIE + k] = nx * (bz - S[BZ + k]) - nz * (bx - S[BX + k])


@fused
def solve_step(S: Array) -> None:
    """Fill STEP: Newton's step of all lanes. As `newton.solve_linkage`, whose words explain it; nan where singular."""
    for l in range(LANES):
        # wheels 0, 1 know no bogie
        a1, a2, a3, a = S[BY_ROLL + l], S[BY_PITCH + l], S[BY_ROCKER + l], -S[GAP + l]
        p1, p2, p3, p = (
            S[BY_ROLL + LANES + l] - a1,
            S[BY_PITCH + LANES + l] - a2,
            S[BY_ROCKER + LANES + l] - a3,
            -S[GAP + LANES + l] - a,
        )
        # left: wheels 2, 4, the one that the bogie moves more first
        m4, o4 = S[BY_BOGIE + 2 * LANES + l], S[BY_BOGIE + 4 * LANES + l]
        swap = abs(o4) > abs(m4)
        m1, o1 = S[BY_ROLL + 2 * LANES + l], S[BY_ROLL + 4 * LANES + l]
        m2, o2 = S[BY_PITCH + 2 * LANES + l], S[BY_PITCH + 4 * LANES + l]
        m3, o3 = S[BY_ROCKER + 2 * LANES + l], S[BY_ROCKER + 4 * LANES + l]
        m, o = -S[GAP + 2 * LANES + l], -S[GAP + 4 * LANES + l]
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
        m4, o4 = S[BY_BOGIE + 3 * LANES + l], S[BY_BOGIE + 5 * LANES + l]
        swap = abs(o4) > abs(m4)
        m1, o1 = S[BY_ROLL + 3 * LANES + l], S[BY_ROLL + 5 * LANES + l]
        m2, o2 = S[BY_PITCH + 3 * LANES + l], S[BY_PITCH + 5 * LANES + l]
        m3, o3 = S[BY_ROCKER + 3 * LANES + l], S[BY_ROCKER + 5 * LANES + l]
        m, o = -S[GAP + 3 * LANES + l], -S[GAP + 5 * LANES + l]
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
        S[STEP + l], S[STEP + LANES + l] = z, roll
        S[STEP + 2 * LANES + l], S[STEP + 3 * LANES + l] = pitch, rocker
        S[STEP + 4 * LANES + l] = (lb - z - l1 * roll - l2 * pitch - l3 * rocker) / l4
        S[STEP + 5 * LANES + l] = (eb - z - e1 * roll - e2 * pitch - e3 * rocker) / e4


FOLDED = 1.6  # rad: no linkage stands so far from rest
STRIDE = 0.3  # rad, the longest step


@fused
def take_step(S: Array) -> None:
    """Move the live lanes by STEP, shortened where it would turn anything by more than `STRIDE`; WORST is its greatest part.
    A step that is not finite is not taken, and is infinite."""
    for l in range(LANES):
        z, roll, pitch = S[STEP + l], S[STEP + LANES + l], S[STEP + 2 * LANES + l]
        rocker, left, right = S[STEP + 3 * LANES + l], S[STEP + 4 * LANES + l], S[STEP + 5 * LANES + l]
        total = abs(z) + abs(roll) + abs(pitch) + abs(rocker) + abs(left) + abs(right)
        finite = total < math.inf
        big = max(max(abs(roll), abs(pitch)), max(abs(rocker), max(abs(left), abs(right))))
        S[WORST + l] = max(big, abs(z)) if finite else math.inf
        scale = S[LIVE + l] * STRIDE / max(big, STRIDE)
        S[Q + l] += scale * z if finite else 0.0
        S[Q + LANES + l] += scale * roll if finite else 0.0
        S[Q + 2 * LANES + l] += scale * pitch if finite else 0.0
        S[Q + 3 * LANES + l] += scale * rocker if finite else 0.0
        S[Q + 4 * LANES + l] += scale * left if finite else 0.0
        S[Q + 5 * LANES + l] += scale * right if finite else 0.0
