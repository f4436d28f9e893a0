"""Newton's method for `LANES` poses at once on cubic terrain, in pose and contacts together.

Where the terrain curves less than a rim, the rim touches it at one point only, and Newton's method finds that point from any
start. Each step moves every contact by the terrain's slope and second derivatives, and the pose by the six gaps and their
derivatives at the moved contacts: both converge quadratically. Nothing is verified here: see `search.verify_minimum`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from ..jit.raw_views import node_taker
from ..model.ground import META_DX, META_DY, META_MAX_CURVATURE, META_NX, META_NY
from ..model.linkage import P_BOGIE_PIVOT, P_HALF, P_HUB, P_PIVOT, P_RADIUS
from ..model.tolerances import FINAL_GAP, MAX_ANGLE
from ..search.tread import SMOOTH
from .layout import ALL, CONTACT, CUBIC, HALF, LANES, POSE, WHEEL, in_use
from .linkage import gap_jacobian, place_body, place_wheels, solve_step, take_step

Array = NDArray[np.float64]

Weights = tuple[float, float, float, float]

MAX_TILT_SINE = 0.5  # sine of the largest tilt of a wheel
SMALL = 2e-6  # m and rad: last step where gaps are checked afterwards
ROLLED = 4e-4  # rad: last movement of a contact, whose cube enters the gap
STEPS = 12  # Newton steps, at most

#: Intrinsic that copies the 16 spline coefficients of the cells of HALF lanes.
take_patch = node_taker(4, HALF)


@fma_njit
def touching_points(lanes: Array, rover: Array) -> None:
    """Compute the contact point of every tread from its hub (as `model.wheel.tread_point`).

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.

    Reads:  WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.sine, CONTACT.cosine, CONTACT.offset
    Writes: CONTACT.tx, CONTACT.ty, CONTACT.tz
    """
    for i in range(6):
        radius = rover[P_RADIUS + i]
        for l in range(in_use(lanes)):
            k = i * LANES + l
            u, q, s = radius * lanes[CONTACT.sine + k], radius * lanes[CONTACT.cosine + k], lanes[CONTACT.offset + k]
            vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
            along = s * uz + q * az
            lanes[CONTACT.tx + k], lanes[CONTACT.ty + k], lanes[CONTACT.tz + k] = (
                u * vy + along * vx,
                along * vy - u * vx,
                s * az - q * uz,
            )


@fma_njit
def gather(lanes: Array, grid: Array, meta: Array, wheels: int) -> None:
    """Find the cells under the contact points, and copy their spline coefficients.

    A NaN offset from the body counts as 0.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        wheels: number of wheels, from the first.

    Reads:  POSE.x, POSE.y, WHEEL.ox, WHEEL.oy, CONTACT.tx, CONTACT.ty, CUBIC.col, CUBIC.row
    Writes: CUBIC.u, CUBIC.v, CUBIC.col, CUBIC.row, CUBIC.coef
    """
    over_x, over_y, last_x, last_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY], meta[META_NX] - 2.0, meta[META_NY] - 2.0
    for w in range(wheels):
        for l in range(in_use(lanes)):
            k = w * LANES + l
            x, y = lanes[WHEEL.ox + k] + lanes[CONTACT.tx + k], lanes[WHEEL.oy + k] + lanes[CONTACT.ty + k]
            u, v = (
                (lanes[POSE.x + l] + (x if x == x else 0.0)) * over_x,
                (lanes[POSE.y + l] + (y if y == y else 0.0)) * over_y,
            )  # nan is nowhere
            i, j = np.floor(u), np.floor(v)
            i, j = (i if i > 0.0 else 0.0), (j if j > 0.0 else 0.0)
            i, j = (i if i < last_x else last_x), (j if j < last_y else last_y)
            lanes[CUBIC.u + k], lanes[CUBIC.v + k], lanes[CUBIC.col + k], lanes[CUBIC.row + k] = u - i, v - j, i, j
        for first in range(w * LANES, w * LANES + in_use(lanes), HALF):
            take_patch(lanes, CUBIC.col + first, CUBIC.row + first, grid, CUBIC.coef + first, ALL)


@inlined
def _row(lanes: Array, at: int, height: Weights, slope: Weights, curvature: Weights) -> tuple[float, float, float]:
    """Return one row of coefficients weighted for height, slope and curvature.

    Args:
        lanes: the lane array (`layout`).
        at: index of the row's first coefficient.
        height, slope, curvature: weights of the height, of its first and of its second derivative.

    Returns:
        Height, first and second derivative along x, of this row.

    Reads:  at
    Writes: none
    """
    w0, w1, w2, w3 = height
    s0, s1, s2, s3 = slope
    c0, c1, c2, c3 = curvature
    g0, g1, g2, g3 = lanes[at], lanes[at + ALL], lanes[at + 2 * ALL], lanes[at + 3 * ALL]
    return (
        w0 * g0 + w1 * g1 + w2 * g2 + w3 * g3,
        s0 * g0 + s1 * g1 + s2 * g2 + s3 * g3,
        c0 * g0 + c1 * g1 + c2 * g2 + c3 * g3,
    )


@fma_njit
def splines(lanes: Array, meta: Array, wheels: int) -> None:
    """Evaluate the terrain at the contact points (as `model.ground.surface`).

    Height, slope and second derivatives are computed.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.
        wheels: number of wheels, from the first.

    Reads:  CUBIC.u, CUBIC.v, CUBIC.coef
    Writes: CONTACT.gx, CONTACT.gy, CUBIC.h, CUBIC.hxx, CUBIC.hxy, CUBIC.hyy
    """
    over_x, over_y = 1.0 / meta[META_DX], 1.0 / meta[META_DY]
    for w in range(wheels):
        for l in range(in_use(lanes)):
            k = w * LANES + l
            u, v = lanes[CUBIC.u + k], lanes[CUBIC.v + k]
            p, q = 1.0 - u, 1.0 - v
            w0, w3 = p * p * p * (1 / 6), u * u * u * (1 / 6)
            w1 = (u * u * (3.0 * u - 6.0) + 4.0) * (1 / 6)
            w2 = 1.0 - w0 - w1 - w3
            s0, s3, s1 = -0.5 * p * p, 0.5 * u * u, u * (1.5 * u - 2.0)
            s2 = -s0 - s1 - s3
            c1, c2 = 3.0 * u - 2.0, 1.0 - 3.0 * u
            weights, slopes, curvatures = (w0, w1, w2, w3), (s0, s1, s2, s3), (p, c1, c2, u)
            y0, y3 = q * q * q * (1 / 6), v * v * v * (1 / 6)
            y1 = (v * v * (3.0 * v - 6.0) + 4.0) * (1 / 6)
            y2 = 1.0 - y0 - y1 - y3
            t0, t3, t1 = -0.5 * q * q, 0.5 * v * v, v * (1.5 * v - 2.0)
            t2 = -t0 - t1 - t3
            d1, d2 = 3.0 * v - 2.0, 1.0 - 3.0 * v
            a, b, c = _row(lanes, CUBIC.coef + k, weights, slopes, curvatures)
            h, hx, hxx, hy, hxy, hyy = y0 * a, y0 * b, y0 * c, t0 * a, t0 * b, q * a
            a, b, c = _row(lanes, CUBIC.coef + 4 * ALL + k, weights, slopes, curvatures)
            h, hx, hxx, hy, hxy, hyy = h + y1 * a, hx + y1 * b, hxx + y1 * c, hy + t1 * a, hxy + t1 * b, hyy + d1 * a
            a, b, c = _row(lanes, CUBIC.coef + 8 * ALL + k, weights, slopes, curvatures)
            h, hx, hxx, hy, hxy, hyy = h + y2 * a, hx + y2 * b, hxx + y2 * c, hy + t2 * a, hxy + t2 * b, hyy + d2 * a
            a, b, c = _row(lanes, CUBIC.coef + 12 * ALL + k, weights, slopes, curvatures)
            h, hx, hxx, hy, hxy, hyy = h + y3 * a, hx + y3 * b, hxx + y3 * c, hy + t3 * a, hxy + t3 * b, hyy + v * a
            lanes[CUBIC.h + k], lanes[CONTACT.gx + k], lanes[CONTACT.gy + k] = h, hx * over_x, hy * over_y
            lanes[CUBIC.hxx + k], lanes[CUBIC.hxy + k], lanes[CUBIC.hyy + k] = (
                hxx * over_x * over_x,
                hxy * over_x * over_y,
                hyy * over_y * over_y,
            )


@fma_njit
def roll_contacts(lanes: Array, rover: Array, meta: Array, along: float) -> None:
    """Move every contact by one Newton step, and update gap and slope there.

    The contact stays within the width of the tread. The step in (φ, offset) uses the terrain's slope and second derivatives
    at the old contact. If the gap is not convex along the axle, the contact moves to the end of the tread with the lower
    gap. A disc that is not verified afterwards must also meet the condition of `search.cubic_cell.follow_smooth`. In the
    first step contacts do not move along the axle: the first guess often tilts a wheel towards the wrong end.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        meta: the map header.
        along: 1.0; 0.0 in the first step.

    Reads:  POSE.x, POSE.y, POSE.q, POSE.active, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz,
            CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CUBIC.h, CUBIC.hxx, CUBIC.hxy, CUBIC.hyy, CUBIC.rejected
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy,
            CONTACT.gap, CUBIC.turn, CUBIC.rejected
    """
    end_x, end_y = (meta[META_NX] - 1.0) * meta[META_DX], (meta[META_NY] - 1.0) * meta[META_DY]
    for i in range(6):
        radius, half = rover[P_RADIUS + i], rover[P_HALF + i]
        reach = radius + half
        # a disc that is not verified afterwards must meet the condition of `follow_smooth`
        sharp = radius * meta[META_MAX_CURVATURE] if (half == 0.0) & (radius * meta[META_MAX_CURVATURE] < SMOOTH) else -math.inf
        for l in range(in_use(lanes)):
            k = i * LANES + l
            s, c, offset = lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], lanes[CONTACT.offset + k]
            vx, vy, az, uz = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
            ax, ay = uz * vx, uz * vy
            tx, ty, tz = radius * (c * vy - s * az * vx), -radius * (c * vx + s * az * vy), radius * s * uz
            px, py, pz = lanes[CONTACT.tx + k], lanes[CONTACT.ty + k], lanes[CONTACT.tz + k]
            gx, gy, hxx, hxy, hyy = (
                lanes[CONTACT.gx + k],
                lanes[CONTACT.gy + k],
                lanes[CUBIC.hxx + k],
                lanes[CUBIC.hxy + k],
                lanes[CUBIC.hyy + k],
            )
            bx, by, cx, cy = hxx * tx + hxy * ty, hxy * tx + hyy * ty, hxx * ax + hxy * ay, hxy * ax + hyy * ay
            by_turn, by_offset = tz - gx * tx - gy * ty, az - gx * ax - gy * ay  # derivatives of the gap over the tread
            # the point turns about the rim's middle
            curvature = gx * (px - offset * ax) + gy * (py - offset * ay) - (pz - offset * az) - bx * tx - by * ty
            twist, ridge = -(bx * ax + by * ay), -(cx * ax + cy * ay)
            over = 1.0 / curvature
            crest = ridge - twist * twist * over  # second derivative of the gap along the axle, φ being optimal
            inside, outward = (twist * by_turn * over - by_offset) / crest, -math.copysign(reach, by_offset)
            wanted = min(max(offset + (inside if crest > 0.0 else outward), -half), half) - offset
            shift = along * wanted
            turn = min(max(-(by_turn + twist * shift) * over, -0.3), 0.3)
            square = (s * s + c * c) * (1.0 + turn * turn)
            size = 1.5 - 0.5 * square  # 1 / sqrt(square) by three Newton steps: 0.13 rad before the last one leaves 1e-15
            size *= 1.5 - 0.5 * square * size * size
            size *= 1.5 - 0.5 * square * size * size
            lanes[CONTACT.gap + k] = (
                lanes[POSE.q + l]
                + lanes[WHEEL.oz + k]
                + pz
                - lanes[CUBIC.h + k]
                + turn * (by_turn + 0.5 * curvature * turn + twist * shift)
                + shift * (by_offset + 0.5 * ridge * shift)
            )
            lanes[CONTACT.tx + k], lanes[CONTACT.ty + k], lanes[CONTACT.tz + k] = (
                px + turn * tx + shift * ax,
                py + turn * ty + shift * ay,
                pz + turn * tz + shift * az,
            )
            lanes[CONTACT.gx + k], lanes[CONTACT.gy + k] = gx + turn * bx + shift * cx, gy + turn * by + shift * cy
            live = lanes[POSE.active + l]
            sine, cosine = (s + c * turn) * size, (c - s * turn) * size
            lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k] = sine if live > 0.0 else s, cosine if live > 0.0 else c
            lanes[CONTACT.offset + k] = offset + live * shift
            lanes[CUBIC.turn + k] = abs(turn) + abs(wanted) / reach
            x, y = lanes[POSE.x + l] + lanes[WHEEL.ox + k], lanes[POSE.y + l] + lanes[WHEEL.oy + k]
            good = (
                (curvature > 0.0)
                & (c > 0.0)
                & (abs(az) < MAX_TILT_SINE)
                & (uz + az * (gx * vx + gy * vy) > sharp * (1.0 + 2.0 * abs(az)))
            )
            good &= (x > reach) & (x < end_x - reach) & (y > reach) & (y < end_y - reach)
            lanes[CUBIC.rejected + k] = live * (0.0 if good else 1.0) + (1.0 - live) * lanes[CUBIC.rejected + k]


@fma_njit
def start(lanes: Array, grid: Array, meta: Array, rover: Array) -> None:
    """Set the poses on the tangent plane of the terrain under the body.

    Each contact starts at the lowest point of its rim.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.

    Reads:  POSE.x, POSE.y, POSE.cy, POSE.sy, WHEEL.ox, WHEEL.oy, CONTACT.tx, CONTACT.ty, CONTACT.gx, CONTACT.gy, CUBIC.u,
            CUBIC.v, CUBIC.col, CUBIC.row, CUBIC.coef, CUBIC.h, CUBIC.first_sine, CUBIC.first_cosine
    Writes: POSE.q, WHEEL.ox, WHEEL.oy, CONTACT.sine, CONTACT.cosine, CONTACT.offset, CONTACT.tx, CONTACT.ty, CONTACT.gx,
            CONTACT.gy, CUBIC.u, CUBIC.v, CUBIC.col, CUBIC.row, CUBIC.coef, CUBIC.h, CUBIC.hxx, CUBIC.hxy, CUBIC.hyy,
            CUBIC.rejected, CUBIC.first_sine, CUBIC.first_cosine
    """
    height = rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    for l in range(in_use(lanes)):
        lanes[WHEEL.ox + l] = lanes[WHEEL.oy + l] = lanes[CONTACT.tx + l] = lanes[CONTACT.ty + l] = 0.0
    gather(lanes, grid, meta, 1)
    splines(lanes, meta, 1)
    for l in range(in_use(lanes)):
        gx, gy, cy, sy = lanes[CONTACT.gx + l], lanes[CONTACT.gy + l], lanes[POSE.cy + l], lanes[POSE.sy + l]
        ahead, aside = gx * cy + gy * sy, gy * cy - gx * sy
        steep = math.sqrt(1.0 + ahead * ahead + aside * aside)
        tilt = aside / steep
        lanes[POSE.q + l] = lanes[CUBIC.h + l] + height * steep
        lanes[POSE.q + LANES + l] = tilt + tilt * tilt * tilt * (1 / 6)
        lanes[POSE.q + 2 * LANES + l] = -ahead / (1.0 + 0.3 * ahead * ahead)
        lanes[POSE.q + 3 * LANES + l] = lanes[POSE.q + 4 * LANES + l] = lanes[POSE.q + 5 * LANES + l] = 0.0
        size = 1.0 / math.sqrt(1.0 + ahead * ahead)
        lanes[CUBIC.first_sine + l], lanes[CUBIC.first_cosine + l] = ahead * size, size
    for i in range(6):
        for l in range(in_use(lanes)):
            k = i * LANES + l
            lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k] = lanes[CUBIC.first_sine + l], lanes[CUBIC.first_cosine + l]
            lanes[CONTACT.offset + k] = lanes[CUBIC.rejected + k] = 0.0


@inlined
def guaranteed_step(meta: Array, rover: Array) -> float:
    """Return the largest last step that leaves every gap within FINAL_GAP.

    Such a step exists where each wheel can touch at one point only. That holds for discs without width on a map whose
    curvature κ is everywhere below 1 / r. Newton leaves half the second derivative of a gap times the step squared. A wheel
    at distance L from the body's reference point moves by L times an angle, and its turning adds as much again. A rim of
    radius r rolls over curvature κ as a point over κ / (1 − κ r), which adds that times L². Four angles may add up.

    Args:
        meta: the map header.
        rover: the packed rover.

    Returns:
        The step (m and rad); 0 on other maps and for wheels with width.
    """
    far = curvature = 0.0
    for i in range(6):
        if rover[P_HALF + i] > 0.0 or not rover[P_RADIUS + i] * meta[META_MAX_CURVATURE] < SMOOTH:
            return 0.0
        reach = rover[P_RADIUS + i]
        for n in range(3):
            side = 3 * (i % 2) + n
            bogie = rover[P_BOGIE_PIVOT + side] if i > 1 else 0.0
            reach += abs(rover[P_PIVOT + side]) + abs(bogie) + abs(rover[P_HUB + 3 * i + n])
        far, curvature = (
            max(far, reach),
            max(curvature, meta[META_MAX_CURVATURE] / (1.0 - rover[P_RADIUS + i] * meta[META_MAX_CURVATURE])),
        )
    return math.sqrt(FINAL_GAP / (8.0 * far * (1.0 + curvature * far)))


@fma_njit
def iterate(lanes: Array, grid: Array, meta: Array, rover: Array, small: float) -> None:
    """Take Newton steps on the active lanes until their steps are small.

    Lanes that stay active have not converged.

    Args:
        lanes: the lane array (`layout`).
        grid: node heights (bilinear) or spline coefficients (cubic), m.
        meta: the map header.
        rover: the packed rover.
        small: size of the last step, m and rad.

    Reads:  POSE.x, POSE.y, POSE.cy, POSE.sy, POSE.q, POSE.step, POSE.active, POSE.worst, POSE.axes, POSE.right, POSE.rate,
            WHEEL (all), CONTACT (all), CUBIC.u, CUBIC.v, CUBIC.col, CUBIC.row, CUBIC.coef, CUBIC.h, CUBIC.hxx, CUBIC.hxy,
            CUBIC.hyy, CUBIC.turn, CUBIC.rejected
    Writes: POSE.q, POSE.step, POSE.active, POSE.worst, POSE.axes, POSE.right, POSE.rate, WHEEL.lc, WHEEL.ls, WHEEL.bx,
            WHEEL.bz, WHEEL.br, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT (all),
            CUBIC.u, CUBIC.v, CUBIC.col, CUBIC.row, CUBIC.coef, CUBIC.h, CUBIC.hxx, CUBIC.hxy, CUBIC.hyy, CUBIC.turn,
            CUBIC.rejected
    """
    for n in range(STEPS):
        place_body(lanes, rover)
        place_wheels(lanes, rover)
        touching_points(lanes, rover)
        gather(lanes, grid, meta, 6)
        splines(lanes, meta, 6)
        roll_contacts(lanes, rover, meta, 0.0 if n == 0 else 1.0)
        gap_jacobian(lanes, rover)
        solve_step(lanes)
        take_step(lanes)
        live = 0.0
        for l in range(in_use(lanes)):
            turn = max(
                max(lanes[CUBIC.turn + l], max(lanes[CUBIC.turn + LANES + l], lanes[CUBIC.turn + 2 * LANES + l])),
                max(lanes[CUBIC.turn + 3 * LANES + l], max(lanes[CUBIC.turn + 4 * LANES + l], lanes[CUBIC.turn + 5 * LANES + l])),
            )
            lanes[POSE.active + l] = 0.0 if (lanes[POSE.worst + l] < small) & (turn < ROLLED) else lanes[POSE.active + l]
        for l in range(in_use(lanes)):
            live += lanes[POSE.active + l]
        if live == 0.0:
            break


@fma_njit
def check_converged(lanes: Array) -> None:
    """Mark the lanes that have converged and in which the method is valid.

    No angle may exceed MAX_ANGLE.

    Args:
        lanes: the lane array (`layout`).

    Reads:  POSE.q, POSE.active, CUBIC.rejected
    Writes: CUBIC.sound
    """
    for l in range(in_use(lanes)):
        widest = max(
            max(abs(lanes[POSE.q + LANES + l]), max(abs(lanes[POSE.q + 2 * LANES + l]), abs(lanes[POSE.q + 3 * LANES + l]))),
            max(abs(lanes[POSE.q + 4 * LANES + l]), abs(lanes[POSE.q + 5 * LANES + l])),
        )
        rejected = (
            lanes[POSE.active + l]
            + lanes[CUBIC.rejected + l]
            + lanes[CUBIC.rejected + LANES + l]
            + lanes[CUBIC.rejected + 2 * LANES + l]
        )
        rejected += (
            lanes[CUBIC.rejected + 3 * LANES + l] + lanes[CUBIC.rejected + 4 * LANES + l] + lanes[CUBIC.rejected + 5 * LANES + l]
        )
        lanes[CUBIC.sound + l] = 1.0 if (rejected == 0.0) & (widest < MAX_ANGLE) else 0.0
