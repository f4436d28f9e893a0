"""Minima of a rim's height above one cubic cell.

An arc of the rim is halved until bounds on the spline's second derivatives show that a piece stays above what is sought, or
that the height is convex along it; Newton's method then finds its minimum.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import META_DX, META_DY, META_MAX_CURVATURE, surface
from ..model.tolerances import GAP_TIE
from ..model.wheel import (
    AX,
    AY,
    AZ,
    COSINE,
    DERIVATIVES_OF_TREAD,
    EX,
    EY,
    GAP,
    HX,
    HY,
    HZ,
    PATCH,
    PLACE,
    RADIUS,
    SIN,
    UX,
    UY,
    UZ,
)
from .cubic_derivatives import DERIVATIVES_SIZE, XX, XY, YY, second_derivatives
from .cubic_patch import BOUNDS_SIZE
from .minima import Minima, keep_lower_contact

Array = NDArray[np.float64]


@njit
def search_arc(
    grid: Array, meta: Array, w: Array, i: int, j: int, s: float, low: float, high: float,
    found: Minima, count: int,
) -> int:  # fmt: skip
    """Find the local minima of a rim's height above the terrain on an arc in one cell.

    A piece of the arc is closed if bounds over its rectangle show that its height is monotonic, stays above what is sought, or is
    convex. Otherwise it is halved.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        i, j: column and row of the cell.
        s: m, position of the rim along the axle.
        low, high: rad, the arc's ends.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    lowest, keep, contacts = found
    unlisted = Minima(lowest, -math.inf, contacts)
    on_arc = w[DERIVATIVES_OF_TREAD : DERIVATIVES_OF_TREAD + DERIVATIVES_SIZE]
    a, b = low, high
    sa, ca = math.sin(a), math.cos(a)
    fa, ga, _, gx, gy = _along(grid, meta, w, sa, ca, s)
    while a < high:
        sb, cb = math.sin(b), math.cos(b)
        fb, gb, _, next_gx, next_gy = _along(grid, meta, w, sb, cb, s)
        length = b - a
        _derivatives_on_arc(grid, meta, w, i, j, s, length, sa, ca, sb, cb, on_arc)
        curvature = _least_curvature(w, on_arc, gx, gy, a, b, sa, ca, sb, cb)
        slack = 0.5 * max(-curvature, 0.0) * length
        down, up = ga - slack, gb + slack  # slopes of f made convex: its tangents at a and b bound it from below
        if down >= 0.0:  # the end of a piece is a minimum only if the arc ends there or is level
            count = keep_lower_contact(w, found if a == low or ga == 0.0 else unlisted, fa, sa, ca, s, count)
        elif up <= 0.0:
            count = keep_lower_contact(w, found if b == high or gb == 0.0 else unlisted, fb, sb, cb, s, count)
        elif fa + down * (fb - fa - up * length) / (down - up) < max(lowest[GAP] - GAP_TIE, keep):
            if curvature > 0.0:
                count = _convex_arc(grid, meta, w, s, a, b, ga, gb, found, count)
            elif length > 1e-7:
                b = 0.5 * (a + b)
                continue
            else:
                count = keep_lower_contact(w, found, fa, sa, ca, s, count)
                count = keep_lower_contact(w, found, fb, sb, cb, s, count)
        a, sa, ca, fa, ga, gx, gy = b, sb, cb, fb, gb, next_gx, next_gy
        b = min(a + 2.0 * length, high)
    return count


@njit
def _along(grid: Array, meta: Array, w: Array, sp: float, cp: float, s: float) -> tuple[float, float, float, float, float]:
    """Return the rim's height above the terrain, its derivatives by φ, and the terrain's slope.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        sp, cp: sin φ, cos φ.
        s: m, position of the rim along the axle.

    Returns:
        f, f', f'', m, and the slope along x and y.
    """
    r = w[RADIUS]
    x = s * w[AX] + r * (sp * w[EX] - cp * w[UX])
    y = s * w[AY] + r * (sp * w[EY] - cp * w[UY])
    z = w[HZ] + s * w[AZ] - r * cp * w[UZ]
    tx, ty, tz = r * (cp * w[EX] + sp * w[UX]), r * (cp * w[EY] + sp * w[UY]), r * sp * w[UZ]
    nx, ny, nz = r * (-sp * w[EX] + cp * w[UX]), r * (-sp * w[EY] + cp * w[UY]), r * cp * w[UZ]
    h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + x, w[HY] + y)
    curvature = nz - gx * nx - gy * ny - hxx * tx * tx - 2.0 * hxy * tx * ty - hyy * ty * ty
    return z - h, tz - gx * tx - gy * ty, curvature, gx, gy


@njit
def _least_curvature(
    w: Array, derivatives: Array, gx: float, gy: float, a: float, b: float, sa: float, ca: float, sb: float, cb: float
) -> float:
    """Return a lower bound of f'' of the rim's height over the cell on an arc, m.

    f'' / r = A cos φ + B sin φ - r h(t, t), with A, B from the slope, which changes along the arc by the second
    derivatives.

    Args:
        w: (WHEEL_SIZE,) wheel.
        derivatives: (DERIVATIVES_SIZE,) bounds on the second derivatives over the arc's rectangle.
        gx, gy: the terrain's slope at a.
        a, b: rad, the arc's ends.
        sa, ca, sb, cb: their sines and cosines.
    """
    r = w[RADIUS]
    top_cos = 1.0 if a <= 0.0 <= b or a <= math.pi <= b else max(abs(ca), abs(cb))
    tx, ty = abs(w[EX]) * top_cos + abs(w[UX]), abs(w[EY]) * top_cos + abs(w[UY])
    twist = max(abs(derivatives[XY]), abs(derivatives[XY + 1]))
    curved = max(derivatives[XX + 1], 0.0) * tx * tx + 2.0 * twist * tx * ty + max(derivatives[YY + 1], 0.0) * ty * ty
    by_x = max(abs(derivatives[XX]), abs(derivatives[XX + 1])) * tx + twist * ty
    by_y = max(abs(derivatives[YY]), abs(derivatives[YY + 1])) * ty + twist * tx
    even, odd = w[UZ] - gx * w[UX] - gy * w[UY], gx * w[EX] + gy * w[EY]
    ends = min(even * ca + odd * sa, even * cb + odd * sb)
    if not (ends > 0.0 and b - a < 3.0):
        ends = -math.sqrt(even * even + odd * odd)
    return r * (ends - r * (b - a) * (by_x + by_y)) - r * r * curved


@njit
def _derivatives_on_arc(
    grid: Array, meta: Array, w: Array, i: int, j: int, s: float, length: float, sa: float, ca: float, sb: float, cb: float,
    derivatives: Array,
) -> None:  # fmt: skip
    """Bound the spline's second derivatives over the part of a cell around an arc.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; PATCH is scratch.
        i, j: column and row of the cell.
        s: m, position of the rim along the axle.
        length: rad, the arc.
        sa, ca, sb, cb: sin φ and cos φ of its ends.
        derivatives: (DERIVATIVES_SIZE,) filled with the lowest and highest second derivatives, 1/m, as `second_derivatives`
            fills them.
    """
    patch = w[PATCH : PATCH + BOUNDS_SIZE]
    dx, dy, r = meta[META_DX], meta[META_DY], w[RADIUS]
    bulge = 0.125 * r * length * length  # no point of the arc is farther from its chord
    x, y = w[HX] + s * w[AX] - i * dx, w[HY] + s * w[AY] - j * dy
    xa, xb = x + r * (sa * w[EX] - ca * w[UX]), x + r * (sb * w[EX] - cb * w[UX])
    ya, yb = y + r * (sa * w[EY] - ca * w[UY]), y + r * (sb * w[EY] - cb * w[UY])
    west, east, south, north = min(xa, xb) - bulge, max(xa, xb) + bulge, min(ya, yb) - bulge, max(ya, yb) + bulge
    second_derivatives(grid, i, j, dx, dy, west, east, south, north, patch, derivatives)


@njit
def _convex_arc(
    grid: Array, meta: Array, w: Array, s: float, a: float, b: float, ga: float, gb: float,
    found: Minima, count: int,
) -> int:  # fmt: skip
    """Find the minimum of a convex arc that falls at a and rises at b.

    Newton's method is used, with bisection.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        s: m, position of the rim along the axle.
        a, b: rad, the arc's ends.
        ga, gb: m/rad, its slopes there.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    t = a - ga * (b - a) / (gb - ga)
    f = math.inf
    for _ in range(60):
        f, g, h, _, _ = _along(grid, meta, w, math.sin(t), math.cos(t), s)
        if g < 0.0:
            a = t
        else:
            b = t
        new = t - g / h if h > 0.0 else math.nan
        if not (a <= new <= b):
            new = 0.5 * (a + b)
        done = abs(new - t) < 1e-9 or b - a < 1e-14
        t = new
        if done:
            break
    return keep_lower_contact(w, found, f, math.sin(t), math.cos(t), s, count)


@njit
def follow_smooth(grid: Array, meta: Array, w: Array, sine: float, cosine: float, lowest: Array) -> bool:
    """Find the smallest gap of a thin disc on terrain less curved than it, by Newton's method.

    The rim has one local minimum, in its lower half, if e3z - grad h · e3xy > r B at each of its points, B the greatest curvature
    of the map (docs/design.md). Around the rim grad h · e3xy changes by at most 2 r B |az|: the slope at the contact decides.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel of half width 0.
        sine, cosine: sin φ, cos φ to start from.
        lowest: (CONTACT_SIZE,) filled with gap, sin φ, cos φ and s = 0.

    Returns:
        False if the condition does not hold or Newton does not converge: search instead.
    """
    r = w[RADIUS]
    sharp = r * meta[META_MAX_CURVATURE]
    for _ in range(20):
        tx, ty, tz = r * (cosine * w[EX] + sine * w[UX]), r * (cosine * w[EY] + sine * w[UY]), r * sine * w[UZ]
        nx, ny, nz = r * (-sine * w[EX] + cosine * w[UX]), r * (-sine * w[EY] + cosine * w[UY]), r * cosine * w[UZ]
        h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] - nx, w[HY] - ny)
        slope = tz - gx * tx - gy * ty
        curvature = nz - gx * nx - gy * ny - hxx * tx * tx - 2.0 * hxy * tx * ty - hyy * ty * ty
        if not curvature > 0.0:
            return False
        step = -slope / curvature
        if abs(step) < 1e-6:  # what it would add to the gap is below rounding
            lowest[GAP] = w[HZ] - nz - h + 0.5 * slope * step
            size = math.sqrt(1.0 + step * step)
            lowest[SIN], lowest[COSINE], lowest[PLACE] = (sine + cosine * step) / size, (cosine - sine * step) / size, 0.0
            return cosine > 0.0 and w[UZ] - gx * w[UX] - gy * w[UY] > sharp * (1.0 + 2.0 * abs(w[AZ]))
        step = min(max(step, -0.5), 0.5)
        size = math.sqrt(1.0 + step * step)
        sine, cosine = (sine + cosine * step) / size, (cosine - sine * step) / size
    return False
