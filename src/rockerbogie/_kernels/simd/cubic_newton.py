"""Wheels on smooth cubic ground, `LANES` poses at once.

Where ground bends less than a rim does, a rim touches it in one place only, which Newton finds from anywhere; so pose and
contacts are sought together. One step moves each contact over its tread by what slope and curvature of the ground tell,
and the pose by the six gaps and their slopes at the moved contacts: both converge quadratically. This module proves nothing:
`search.verify_minimum` verifies each tread.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..model.ground import META_DX, META_DY, META_MAX_CURVATURE, META_NX, META_NY
from ..model.linkage import P_BOGIE_PIVOT, P_HALF, P_HUB, P_PIVOT, P_RADIUS
from ..model.tolerances import FINAL_GAP
from ..search.tread import SMOOTH
from ..solve.newton import WIDEST
from .linkage import (
    ACTIVE,
    ALL,
    AZ,
    COSINE,
    CY,
    GAP,
    GX,
    GY,
    LANES,
    OX,
    OY,
    OZ,
    PLACE,
    ROWS,
    SINE,
    SY,
    TX,
    TY,
    TZ,
    UZ,
    VX,
    VY,
    WORST,
    Q,
    X,
    Y,
    gap_jacobian,
    place_body,
    place_wheels,
    rows,
    solve_step,
    take_patch,
    take_step,
)

Array = NDArray[np.float64]

# A wheel: its contact's place in a cell, the cell, its 16 coefficients, height and curvature there; how far the contact has
# turned in the last step, and 1 if it is where this does not hold.
U, V, COL, ROW, COEF, H, HXX, HXY, HYY, TURN, ASTRAY, SOUND, SMOOTH_ROWS = rows(ROWS, (*[ALL] * 4, 16 * ALL, *[ALL] * 6, LANES))

LEAN = 0.5  # sine of the greatest lean of a wheel
SMALL = 2e-6  # m and rad: a last step where nothing is known of the ground, and gaps are looked at once more
ROLLED = 4e-4  # rad: a contact's last turn, which enters by its cube
STEPS = 12


@fma_njit
def touching_points(lanes: Array, rover: Array) -> None:
    """The touching place of every tread, from its hub (`wheel.tread_point`)."""
    for i in range(6):
        radius = rover[P_RADIUS + i]
        for l in range(LANES):
            k = i * LANES + l
            u, q, s = radius * lanes[SINE + k], radius * lanes[COSINE + k], lanes[PLACE + k]
            vx, vy, az, uz = lanes[VX + k], lanes[VY + k], lanes[AZ + k], lanes[UZ + k]
            along = s * uz + q * az
            lanes[TX + k], lanes[TY + k], lanes[TZ + k] = u * vy + along * vx, along * vy - u * vx, s * az - q * uz


@fma_njit
def gather(lanes: Array, grid: Array, meta: Array, wheels: int) -> None:
    """The cells under the touching places, and their coefficients."""
    over_x, over_y, last_x, last_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY], meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for w in range(wheels):
        for l in range(LANES):
            k = w * LANES + l
            x, y = lanes[OX + k] + lanes[TX + k], lanes[OY + k] + lanes[TY + k]
            u, v = (
                (lanes[X + l] + (x if x == x else 0.0)) * over_x,
                (lanes[Y + l] + (y if y == y else 0.0)) * over_y,
            )  # nan is nowhere
            i, j = np.floor(u), np.floor(v)
            i, j = (i if i > 0.0 else 0.0), (j if j > 0.0 else 0.0)
            i, j = (i if i < last_x else last_x), (j if j < last_y else last_y)
            lanes[U + k], lanes[V + k], lanes[COL + k], lanes[ROW + k] = u - i, v - j, i, j
        take_patch(lanes, COL + w * LANES, ROW + w * LANES, grid, COEF + w * LANES, ALL)


@inlined
def _row(
    lanes: Array, at: int, w0: float, w1: float, w2: float, w3: float, s0: float, s1: float, s2: float, s3: float,
    c0: float, c1: float, c2: float, c3: float,
) -> tuple[float, float, float]:  # fmt: skip
    """A row of four coefficients by the weights of height, slope and curvature along it."""
    g0, g1, g2, g3 = lanes[at], lanes[at + ALL], lanes[at + 2 * ALL], lanes[at + 3 * ALL]
    return (
        w0 * g0 + w1 * g1 + w2 * g2 + w3 * g3,
        s0 * g0 + s1 * g1 + s2 * g2 + s3 * g3,
        c0 * g0 + c1 * g1 + c2 * g2 + c3 * g3,
    )


@fma_njit
def splines(lanes: Array, meta: Array, wheels: int) -> None:
    """Height, slope and curvature of the ground at the touching places (`ground.surface`)."""
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for w in range(wheels):
        for l in range(LANES):
            k = w * LANES + l
            u, v = lanes[U + k], lanes[V + k]
            p, q = 1.0 - u, 1.0 - v
            w0, w3 = p * p * p * (1 / 6), u * u * u * (1 / 6)
            w1 = (u * u * (3.0 * u - 6.0) + 4.0) * (1 / 6)
            w2 = 1.0 - w0 - w1 - w3
            s0, s3, s1 = -0.5 * p * p, 0.5 * u * u, u * (1.5 * u - 2.0)
            s2 = -s0 - s1 - s3
            c1, c2 = 3.0 * u - 2.0, 1.0 - 3.0 * u
            y0, y3 = q * q * q * (1 / 6), v * v * v * (1 / 6)
            y1 = (v * v * (3.0 * v - 6.0) + 4.0) * (1 / 6)
            y2 = 1.0 - y0 - y1 - y3
            t0, t3, t1 = -0.5 * q * q, 0.5 * v * v, v * (1.5 * v - 2.0)
            t2 = -t0 - t1 - t3
            d1, d2 = 3.0 * v - 2.0, 1.0 - 3.0 * v
            a, b, c = _row(lanes, COEF + k, w0, w1, w2, w3, s0, s1, s2, s3, p, c1, c2, u)
            h, hx, hxx, hy, hxy, hyy = y0 * a, y0 * b, y0 * c, t0 * a, t0 * b, q * a
            a, b, c = _row(lanes, COEF + 4 * ALL + k, w0, w1, w2, w3, s0, s1, s2, s3, p, c1, c2, u)
            h, hx, hxx, hy, hxy, hyy = h + y1 * a, hx + y1 * b, hxx + y1 * c, hy + t1 * a, hxy + t1 * b, hyy + d1 * a
            a, b, c = _row(lanes, COEF + 8 * ALL + k, w0, w1, w2, w3, s0, s1, s2, s3, p, c1, c2, u)
            h, hx, hxx, hy, hxy, hyy = h + y2 * a, hx + y2 * b, hxx + y2 * c, hy + t2 * a, hxy + t2 * b, hyy + d2 * a
            a, b, c = _row(lanes, COEF + 12 * ALL + k, w0, w1, w2, w3, s0, s1, s2, s3, p, c1, c2, u)
            h, hx, hxx, hy, hxy, hyy = h + y3 * a, hx + y3 * b, hxx + y3 * c, hy + t3 * a, hxy + t3 * b, hyy + v * a
            lanes[H + k], lanes[GX + k], lanes[GY + k] = h, hx * over_x, hy * over_y
            lanes[HXX + k], lanes[HXY + k], lanes[HYY + k] = hxx * over_x * over_x, hxy * over_x * over_y, hyy * over_y * over_y


@fma_njit
def roll_contacts(lanes: Array, rover: Array, meta: Array) -> None:
    """Move every contact over its tread by Newton's step, held within the width, and the gap and its slope with it."""
    end_x, end_y = (meta[META_NX] - 1.0) * meta[META_DX], (meta[META_NY] - 1.0) * meta[META_DY]
    for i in range(6):
        radius, half = rover[P_RADIUS + i], rover[P_HALF + i]
        reach = radius + half
        # a thin disc that is not proved afterwards must meet the condition of `follow_smooth`; others always do
        sharp = radius * meta[META_MAX_CURVATURE] if (half == 0.0) & (radius * meta[META_MAX_CURVATURE] < SMOOTH) else -math.inf
        for l in range(LANES):
            k = i * LANES + l
            s, c, place = lanes[SINE + k], lanes[COSINE + k], lanes[PLACE + k]
            vx, vy, az, uz = lanes[VX + k], lanes[VY + k], lanes[AZ + k], lanes[UZ + k]
            ax, ay = uz * vx, uz * vy
            tx, ty, tz = radius * (c * vy - s * az * vx), -radius * (c * vx + s * az * vy), radius * s * uz
            px, py, pz = lanes[TX + k], lanes[TY + k], lanes[TZ + k]
            gx, gy, hxx, hxy, hyy = lanes[GX + k], lanes[GY + k], lanes[HXX + k], lanes[HXY + k], lanes[HYY + k]
            bx, by, cx, cy = hxx * tx + hxy * ty, hxy * tx + hyy * ty, hxx * ax + hxy * ay, hxy * ax + hyy * ay
            by_turn, by_place = tz - gx * tx - gy * ty, az - gx * ax - gy * ay  # the gap's slopes over the tread
            # what turns is the point from the rim's middle
            curvature = gx * (px - place * ax) + gy * (py - place * ay) - (pz - place * az) - bx * tx - by * ty
            twist, ridge = -(bx * ax + by * ay), -(cx * ax + cy * ay)
            over = 1.0 / curvature
            crest = ridge - twist * twist * over  # how the gap bends along the axle while φ follows
            inside, outward = (twist * by_turn * over - by_place) / crest, -math.copysign(reach, by_place)
            shift = min(max(place + (inside if crest > 0.0 else outward), -half), half) - place
            turn = min(max(-(by_turn + twist * shift) * over, -0.3), 0.3)
            square = (s * s + c * c) * (1.0 + turn * turn)
            size = 1.5 - 0.5 * square  # Newton for 1 / sqrt(square), thrice: 0.13 rad before the last turn leaves 1e-15 of it
            size *= 1.5 - 0.5 * square * size * size
            size *= 1.5 - 0.5 * square * size * size
            lanes[GAP + k] = (
                lanes[Q + l] + lanes[OZ + k] + pz - lanes[H + k]
                + turn * (by_turn + 0.5 * curvature * turn + twist * shift) + shift * (by_place + 0.5 * ridge * shift)
            )  # fmt: skip
            lanes[TX + k], lanes[TY + k], lanes[TZ + k] = (
                px + turn * tx + shift * ax,
                py + turn * ty + shift * ay,
                pz + turn * tz + shift * az,
            )
            lanes[GX + k], lanes[GY + k] = gx + turn * bx + shift * cx, gy + turn * by + shift * cy
            live = lanes[ACTIVE + l]
            sine, cosine = (s + c * turn) * size, (c - s * turn) * size
            lanes[SINE + k], lanes[COSINE + k] = sine if live > 0.0 else s, cosine if live > 0.0 else c
            lanes[PLACE + k] = place + live * shift
            lanes[TURN + k] = abs(turn) + abs(shift) / reach
            x, y = lanes[X + l] + lanes[OX + k], lanes[Y + l] + lanes[OY + k]
            good = (
                (curvature > 0.0) & (c > 0.0) & (abs(az) < LEAN) & (uz + az * (gx * vx + gy * vy) > sharp * (1.0 + 2.0 * abs(az)))
            )
            good &= (x > reach) & (x < end_x - reach) & (y > reach) & (y < end_y - reach)
            lanes[ASTRAY + k] = live * (0.0 if good else 1.0) + (1.0 - live) * lanes[ASTRAY + k]


@fma_njit
def start(lanes: Array, grid: Array, meta: Array, rover: Array) -> None:
    """Stand on the tangent plane of the ground under the body."""
    height = rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    for l in range(LANES):
        lanes[OX + l] = lanes[OY + l] = lanes[TX + l] = lanes[TY + l] = 0.0
    gather(lanes, grid, meta, 1)
    splines(lanes, meta, 1)
    for l in range(LANES):
        gx, gy, cy, sy = lanes[GX + l], lanes[GY + l], lanes[CY + l], lanes[SY + l]
        ahead, aside = gx * cy + gy * sy, gy * cy - gx * sy
        steep = math.sqrt(1.0 + ahead * ahead + aside * aside)
        lean = aside / steep
        lanes[Q + l] = lanes[H + l] + height * steep
        lanes[Q + LANES + l] = lean + lean * lean * lean * (1 / 6)
        lanes[Q + 2 * LANES + l] = -ahead / (1.0 + 0.3 * ahead * ahead)
        lanes[Q + 3 * LANES + l] = lanes[Q + 4 * LANES + l] = lanes[Q + 5 * LANES + l] = 0.0
        size = 1.0 / math.sqrt(1.0 + ahead * ahead)
        lanes[H + l], lanes[HXX + l] = ahead * size, size
    for i in range(6):
        for l in range(LANES):
            k = i * LANES + l
            lanes[SINE + k], lanes[COSINE + k], lanes[PLACE + k], lanes[ASTRAY + k] = lanes[H + l], lanes[HXX + l], 0.0, 0.0


@inlined
def sure_step(meta: Array, rover: Array) -> float:
    """A step (m, rad) so small that it leaves no gap beyond `FINAL_GAP`, where every wheel can touch in one place alone: discs
    without width on a map that nowhere bends as they do. Elsewhere 0.

    What Newton leaves of a gap is half its second derivative times the step's square. A wheel L from the body's origin moves by
    L times an angle, and its turning by as much again; ground of bend κ, over which a rim of radius r rolls as a point would
    over ground of bend κ / (1 - κ r), adds that times L². Four angles may add up.
    """
    far = curvature = 0.0
    for i in range(6):
        if rover[P_HALF + i] > 0.0 or not rover[P_RADIUS + i] * meta[META_MAX_CURVATURE] < SMOOTH:
            return 0.0
        reach = rover[P_RADIUS + i]
        for n in range(3):
            side = 3 * (i % 2) + n
            knee = rover[P_BOGIE_PIVOT + side] if i > 1 else 0.0
            reach += abs(rover[P_PIVOT + side]) + abs(knee) + abs(rover[P_HUB + 3 * i + n])
        far, curvature = (
            max(far, reach),
            max(curvature, meta[META_MAX_CURVATURE] / (1.0 - rover[P_RADIUS + i] * meta[META_MAX_CURVATURE])),
        )
    return math.sqrt(FINAL_GAP / (8.0 * far * (1.0 + curvature * far)))


@fma_njit
def settle(lanes: Array, grid: Array, meta: Array, rover: Array, small: float) -> None:
    """Newton on the live lanes from where they are, until a step is no greater than `small`. Those that stay live have not
    settled; where ASTRAY is 1, a contact or its wheel is where this does not hold."""
    for _ in range(STEPS):
        place_body(lanes, rover)
        place_wheels(lanes, rover)
        touching_points(lanes, rover)
        gather(lanes, grid, meta, 6)
        splines(lanes, meta, 6)
        roll_contacts(lanes, rover, meta)
        gap_jacobian(lanes, rover)
        solve_step(lanes)
        take_step(lanes)
        live = 0.0
        for l in range(LANES):
            turn = max(
                max(lanes[TURN + l], max(lanes[TURN + LANES + l], lanes[TURN + 2 * LANES + l])),
                max(lanes[TURN + 3 * LANES + l], max(lanes[TURN + 4 * LANES + l], lanes[TURN + 5 * LANES + l])),
            )
            lanes[ACTIVE + l] = 0.0 if (lanes[WORST + l] < small) & (turn < ROLLED) else lanes[ACTIVE + l]
        for l in range(LANES):
            live += lanes[ACTIVE + l]
        if live == 0.0:
            break


@fma_njit
def standing(lanes: Array) -> None:
    """SOUND: 1 for lanes that have settled where this holds, with nothing folded over; else 0."""
    for l in range(LANES):
        widest = max(
            max(abs(lanes[Q + LANES + l]), max(abs(lanes[Q + 2 * LANES + l]), abs(lanes[Q + 3 * LANES + l]))),
            max(abs(lanes[Q + 4 * LANES + l]), abs(lanes[Q + 5 * LANES + l])),
        )
        astray = lanes[ACTIVE + l] + lanes[ASTRAY + l] + lanes[ASTRAY + LANES + l] + lanes[ASTRAY + 2 * LANES + l]
        astray += lanes[ASTRAY + 3 * LANES + l] + lanes[ASTRAY + 4 * LANES + l] + lanes[ASTRAY + 5 * LANES + l]
        lanes[SOUND + l] = 1.0 if (astray == 0.0) & (widest < WIDEST) else 0.0
