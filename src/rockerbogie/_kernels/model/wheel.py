"""One wheel's tread as a surface, and the array that describes a wheel.

The tread is the rim of radius r swept along the axle a over ±b. With τ the axle's tilt, e1 the horizontal direction in
the wheel's plane and e3 its upward one, a point of it is

    hub + s a + u e1 - q e3,   (u, q) = r (sin φ, cos φ),  |s| ≤ b,

and over a horizontal position (u along e1, v along the axle's horizontal direction) its lower half has the height

    T(u, v) = z_hub + v tan τ - sqrt(r² - u²) / cos τ,   where  v = s cos τ + q sin τ.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from .ground import META_CUBIC, surface
from .tolerances import MIN_COS_TILT

Array = NDArray[np.float64]

# A wheel in one flat array: hub, axle, e1, e3, cos τ, tan τ, radius, half width,
# the axle's horizontal direction, the axle frame's z.
HX, HY, HZ, AX, AY, AZ, EX, EY, UX, UY, UZ, COS, TAN, RADIUS, HALF, VX, VY, ZX, ZY, ZZ = range(20)
# Scratch of its search: a cell's surface, a plane below the tread, crossings of a rim with a cell, bounds on the derivatives of a
# cell and of the cells under the tread, lower bounds of a row of cells, cells to search (bound, column and row of each). One
# array is passed faster than many.
CELL, PLANE, ENDS, DERIVATIVES, DERIVATIVES_OF_TREAD, PATCH, BOUND = 20, 24, 28, 84, 90, 96, 122
ROW = 64  # cells bounded at once
OPEN = BOUND + ROW
WHEEL_SIZE = OPEN + 3 * 2 * ROW

# A point of the tread: its gap to the ground, sin φ, cos φ, s.
GAP, SIN, COSINE, PLACE = range(4)
CONTACT_SIZE = 4


@njit
def make_wheel(
    wheel: Array,
    x: float,
    y: float,
    z: float,
    ax: float,
    ay: float,
    az: float,
    zx: float,
    zy: float,
    zz: float,
    radius: float,
    half: float,
) -> bool:
    """Fill a wheel's array from its hub and directions.

    Args:
        wheel: (WHEEL_SIZE,) filled.
        x, y, z: m, the hub.
        ax, ay, az: the axle's direction.
        zx, zy, zz: the axle frame's z.
        radius, half: m, radius and half width.

    Returns:
        False, with nothing written, if the wheel lies on its side: cos τ at most `MIN_COS_TILT`.
    """
    level = math.sqrt(ax * ax + ay * ay)
    if not level > MIN_COS_TILT:
        return False
    vx, vy = ax / level, ay / level
    wheel[HX], wheel[HY], wheel[HZ] = x, y, z
    wheel[AX], wheel[AY], wheel[AZ] = ax, ay, az
    wheel[VX], wheel[VY] = vx, vy
    wheel[EX], wheel[EY] = vy, -vx
    wheel[UX], wheel[UY], wheel[UZ] = -az * vx, -az * vy, level
    wheel[COS], wheel[TAN] = level, az / level
    wheel[ZX], wheel[ZY], wheel[ZZ] = zx, zy, zz
    wheel[RADIUS], wheel[HALF] = radius, half
    return True


@inlined
def tread_point(w: Array, sine: float, cosine: float, s: float) -> tuple[float, float, float]:
    """Return the offset of a tread point from the hub, m.

    Args:
        w: (WHEEL_SIZE,) wheel.
        sine, cosine: sin φ, cos φ.
        s: m along the axle.
    """
    u, q = w[RADIUS] * sine, w[RADIUS] * cosine
    return s * w[AX] + u * w[EX] - q * w[UX], s * w[AY] + u * w[EY] - q * w[UY], s * w[AZ] - q * w[UZ]


@njit
def covers(w: Array, x0: float, x1: float, y0: float, y1: float) -> bool:
    """Return True if a point of the tread lies over the inside of a level rectangle.

    Over (u, v) the tread's two halves are |u| <= r, |v - a q| <= b cos τ with q = sqrt(r² - u²) and a = ±az. The rectangle is
    convex, so v - a q takes every value between its extremes on the rectangle's part in |u| <= r, and these lie on its sides.

    Args:
        w: (WHEEL_SIZE,) wheel.
        x0, x1, y0, y1: the rectangle, m from the hub.
    """
    r, reach = w[RADIUS], w[HALF] * w[COS]
    for half in range(2):
        lean = w[AZ] if half == 0 else -w[AZ]
        sign, lean = math.copysign(1.0, lean), abs(lean)
        low, high = math.inf, -math.inf
        for side in range(4):
            px, py = (x1 if side == 1 or side == 2 else x0), (y1 if side >= 2 else y0)
            qx, qy = (x1 if side <= 1 else x0), (y1 if side == 1 or side == 2 else y0)
            u0, v0 = px * w[EX] + py * w[EY], sign * (px * w[VX] + py * w[VY])
            du, dv = qx * w[EX] + qy * w[EY] - u0, sign * (qx * w[VX] + qy * w[VY]) - v0
            first, last = 0.0, 1.0
            if abs(du) > 1e-12 * r:
                ta, tb = (-r - u0) / du, (r - u0) / du
                first, last = max(first, min(ta, tb)), min(last, max(ta, tb))
            elif abs(u0) > r:
                continue
            if first > last:
                continue
            stationary = first
            if lean * abs(du) > 1e-12 * r:
                m = -dv / (lean * du)
                stationary = min(max((r * m / math.sqrt(1.0 + m * m) - u0) / du, first), last)
            for k in range(3):
                t = first if k == 0 else (last if k == 1 else stationary)
                u = u0 + t * du
                f = v0 + t * dv - lean * math.sqrt(max(r * r - u * u, 0.0))
                low, high = min(low, f), max(high, f)
        if low <= reach and high >= -reach:
            return True
    return False


@njit
def gap_at(grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float) -> float:
    """Return the height of a tread point above the terrain, m; NaN over missing data.

    Args:
        grid, meta: terrain (ground.py).
        w: (WHEEL_SIZE,) wheel.
        sine, cosine: sin φ, cos φ.
        s: m along the axle.
    """
    x, y, z = tread_point(w, sine, cosine, s)
    return w[HZ] + z - surface(grid, meta, w[HX] + x, w[HY] + y)[0]


@njit
def contact_slope(grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float) -> tuple[float, float]:
    """Return (gx, gy) with (-gx, -gy, 1) normal to a contact.

    It is the slope of the gap under small motions of the wheel. Inside the tread it is the tread's slope, on a rim the
    terrain's. On a ridge of bilinear terrain it is the one between the two
    sides' slopes that is perpendicular to the rim.

    Args:
        grid, meta: terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine, s: the contact.
    """
    if abs(s) < w[HALF] and cosine > 1e-6:
        nx, ny, nz = -sine * w[EX] + cosine * w[UX], -sine * w[EY] + cosine * w[UY], cosine * w[UZ]
        return -nx / nz, -ny / nz
    x, y, _ = tread_point(w, sine, cosine, s)
    if meta[META_CUBIC] != 0.0:
        _, ax, ay, _, _, _ = surface(grid, meta, w[HX] + x, w[HY] + y)
        return ax, ay
    tx, ty, tz = cosine * w[EX] + sine * w[UX], cosine * w[EY] + sine * w[UY], sine * w[UZ]
    step = 1e-8 * w[RADIUS]
    _, ax, ay, _, _, _ = surface(grid, meta, w[HX] + x - step * tx, w[HY] + y - step * ty)
    _, bx, by, _, _, _ = surface(grid, meta, w[HX] + x + step * tx, w[HY] + y + step * ty)
    ga, gb = tz - ax * tx - ay * ty, tz - bx * tx - by * ty
    part = ga / (ga - gb) if abs(ga - gb) > 1e-6 else 0.5
    part = min(max(part, 0.0), 1.0)
    return ax + part * (bx - ax), ay + part * (by - ay)


@njit
def contact_angle(w: Array, sine: float, cosine: float, s: float) -> float:
    """Return the paper's contact angle δ (eq. 5), rad.

    It is measured from straight below the axle in the link, nose-down positive.

    Args:
        w: (WHEEL_SIZE,) wheel.
        sine, cosine, s: the contact.
    """
    px, py, pz = tread_point(w, sine, cosine, s)
    px, py, pz = px - s * w[AX], py - s * w[AY], pz - s * w[AZ]
    # the axle frame's z, and x = y × z
    zx, zy, zz = w[ZX], w[ZY], w[ZZ]
    xx, xy, xz = w[AY] * zz - w[AZ] * zy, w[AZ] * zx - w[AX] * zz, w[AX] * zy - w[AY] * zx
    return math.atan2(-(px * xx + py * xy + pz * xz), -(px * zx + py * zy + pz * zz))
