"""Verification that a tracked contact is the global minimum, on smooth cubic terrain.

Along a rim the gap is convex where the terrain is less curved than the rim: there is one minimum. What remains is how
these minima m(s) vary over the width. m'' lies between bounds; from an end of the width or from inside, these may show
that m is nowhere lower. If they do not, the whole tread is searched.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.ground import META_DX, META_DY, META_NX, META_NY, Ground, surface
from ..model.tolerances import VERIFIED_DEPTH
from ..model.wheel import (
    AX,
    AY,
    AZ,
    DERIVATIVES,
    DERIVATIVES_OF_TREAD,
    EX,
    EY,
    GAP,
    HALF,
    HX,
    HY,
    HZ,
    RADIUS,
    UX,
    UY,
    UZ,
    gap_at,
    tread_point,
)
from .cubic_derivatives import DERIVATIVES_SIZE, XX, XXX, XXY, XY, XYY, YY, YYY, derivative_bounds
from .tread import FOUND, least_gap

Array = NDArray[np.float64]

CELLS = 16  # most cells under a wheel over which derivatives are bounded
PIECES = 12  # most pieces that a width is cut into

LEAST, LOWER, UNKNOWN = range(3)


@inlined
def is_least(ground: Ground, w: Array, sine: float, cosine: float, s: float, lowest: Array, none: Array) -> int:
    """Check that no point of the tread has a lower gap than a contact.

    Args:
        ground: terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine, s: the contact; its gap is 0.
        lowest: (CONTACT_SIZE,) filled with the lowest point if the tread was searched.
        none: (0, CONTACT_SIZE) empty list.

    Returns:
        LEAST if it is the minimum, LOWER if `lowest` holds a lower point, UNKNOWN if the tread is off the map or over
        missing data.
    """
    grid, _, meta = ground
    if _by_bounds(grid, meta, w, sine, cosine, s):
        return LEAST
    code, _ = least_gap(ground, w, sine, cosine, s, True, -math.inf, lowest, none)
    if code != FOUND:
        return UNKNOWN
    return LEAST if lowest[GAP] > -VERIFIED_DEPTH else LOWER


@njit
def _by_bounds(grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float) -> bool:
    """Check `is_least` by bounds on the terrain's derivatives under the wheel.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine, s: the contact.

    Returns:
        True if the bounds show it; False decides nothing.
    """
    r, half = w[RADIUS], w[HALF]
    dx, dy = meta[META_DX], meta[META_DY]
    out_x = half * abs(w[AX]) + r * math.sqrt(w[EX] * w[EX] + w[UX] * w[UX])
    out_y = half * abs(w[AY]) + r * math.sqrt(w[EY] * w[EY] + w[UY] * w[UY])
    i0, i1 = int(math.floor((w[HX] - out_x) / dx)), int(math.floor((w[HX] + out_x) / dx))
    j0, j1 = int(math.floor((w[HY] - out_y) / dy)), int(math.floor((w[HY] + out_y) / dy))
    if i0 < 0 or j0 < 0 or i1 > meta[META_NX] - 2.0 or j1 > meta[META_NY] - 2.0 or (i1 - i0 + 1) * (j1 - j0 + 1) > CELLS:
        return False
    derivatives, least = (
        w[DERIVATIVES : DERIVATIVES + DERIVATIVES_SIZE],
        w[DERIVATIVES_OF_TREAD : DERIVATIVES_OF_TREAD + DERIVATIVES_SIZE],
    )
    for k in range(3):
        least[2 * k], least[2 * k + 1] = math.inf, -math.inf
    least[XXX:] = 0.0
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            if not derivative_bounds(grid, i, j, dx, dy, derivatives):
                return False
            for k in range(3):
                least[2 * k], least[2 * k + 1] = (
                    min(least[2 * k], derivatives[2 * k]),
                    max(least[2 * k + 1], derivatives[2 * k + 1]),
                )
            for k in range(XXX, DERIVATIVES_SIZE):
                least[k] = max(least[k], derivatives[k])
    curvature = max(max(-least[XX], least[XX + 1]), max(-least[YY], least[YY + 1])) + max(-least[XY], least[XY + 1])
    x, y, _ = tread_point(w, sine, cosine, s)
    _, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + x, w[HY] + y)
    steep = abs(gx * w[UX] + gy * w[UY]) + 2.0 * curvature * (r + half) * abs(w[AZ])
    room = w[UZ] - steep - curvature * r * (1.0 + 0.5 * w[AZ] * w[AZ])
    if not (room > 0.0 and cosine > 0.0):
        return False
    if half == 0.0:
        return True
    # the ground's curvature along the axle: within its bounds over the cells, and as far from here as third derivatives allow
    xx, xy, yy = w[AX] * w[AX], 2.0 * w[AX] * w[AY], w[AY] * w[AY]
    follow = curvature * r / room  # how far φ turns, at most, for a step along the axle
    far_x, far_y = 2.0 * half * (abs(w[AX]) + follow), 2.0 * half * (abs(w[AY]) + follow)
    vary = (
        (least[XXX] * far_x + least[XXY] * far_y) * xx
        + (least[XXY] * far_x + least[XYY] * far_y) * abs(xy)
        + (least[XYY] * far_x + least[YYY] * far_y) * yy
    )
    here = hxx * xx + hxy * xy + hyy * yy
    high = min(least[XX + 1] * xx + max(least[XY] * xy, least[XY + 1] * xy) + least[YY + 1] * yy, here + vary)
    low = max(least[XX] * xx + min(least[XY] * xy, least[XY + 1] * xy) + least[YY] * yy, here - vary)
    along = w[AZ] - gx * w[AX] - gy * w[AY]  # m'
    fall, rise = high + curvature * follow, max(-low, 0.0)  # m'' is nowhere below -fall, nor above rise
    crest = -here - curvature * follow  # and not below this here
    if abs(s) < half:
        if not along * along <= VERIFIED_DEPTH * crest:
            return False
        reach = 2.0 * half * crest / vary if vary > 0.0 else math.inf  # m is convex as far as this
        gap = gap_at(grid, meta, w, sine, cosine, s)
        for way in (1.0, -1.0):
            left = half - way * s - reach
            if left > 0.0:
                place = s + way * reach
                there, along, sp, cp = _least_of_rim(grid, meta, w, sine, cosine, place)
                if not _is_clear(grid, meta, w, sp, cp, place, way, left, there, way * along, gap, fall, rise):
                    return False
        return True
    way = -1.0 if s > 0.0 else 1.0
    if fall < 0.0:  # m is convex over the whole width
        off = max(-way * along, 0.0)
        return off * off <= -2.0 * fall * VERIFIED_DEPTH
    gap = gap_at(grid, meta, w, sine, cosine, s)
    return _is_clear(grid, meta, w, sine, cosine, s, way, 2.0 * half, gap, way * along, gap, fall, rise)


@njit
def _is_clear(
    grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float, way: float, left: float,
    here: float, slope: float, gap: float, fall: float, rise: float,
) -> bool:  # fmt: skip
    """Check that the minima m of the rims are nowhere below a gap over a range of s.

    On each piece, m plus a parabola of curvature `fall` is convex, so its tangents at both ends bound it from below; m
    minus a parabola of curvature `rise` lies above its chord.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine, s: the rim's minimum to start from.
        way: 1 or -1, direction of s.
        left: m, length of the range.
        here: m, the rim's minimum at s.
        slope: its derivative along `way`.
        gap: m, the contact's gap.
        fall, rise: 1/m, bounds: -fall <= m'' <= rise.

    Returns:
        True if it holds within `VERIFIED_DEPTH`; False decides nothing.
    """
    low, fall = gap - VERIFIED_DEPTH, max(fall, 0.0)
    if not here >= low:
        return False
    piece = left
    for _ in range(PIECES):
        s_next = s + way * piece
        there, slope_next, sine_next, cosine_next = _least_of_rim(grid, meta, w, sine, cosine, s_next)
        slope_next *= way
        if not there >= low:
            return False
        down, up = slope - 0.5 * fall * piece, slope_next + 0.5 * fall * piece
        dip = max(0.5 * piece - (there - here) / (rise * piece), 0.0) if rise > 0.0 else 0.0
        above_tangents = down >= 0.0 or up <= 0.0 or here + down * (there - here - up * piece) / (down - up) >= low
        if above_tangents or here - 0.5 * rise * dip * dip >= low:
            left -= piece
            if left <= 0.0:
                return True
            s, here, slope, sine, cosine = s_next, there, slope_next, sine_next, cosine_next
            piece = left
        else:
            piece *= 0.5
    return False


@njit
def _least_of_rim(grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float) -> tuple[float, float, float, float]:
    """Find the minimum of the gap along a rim, by Newton's method; the gap must be convex there.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine: sin φ, cos φ to start from.
        s: m, position of the rim along the axle.

    Returns:
        The gap, m, its change per metre of s, and sin φ, cos φ; the gap is NaN if Newton's method does not converge.
    """
    r = w[RADIUS]
    for _ in range(20):
        tx, ty, tz = r * (cosine * w[EX] + sine * w[UX]), r * (cosine * w[EY] + sine * w[UY]), r * sine * w[UZ]
        nx, ny, nz = r * (-sine * w[EX] + cosine * w[UX]), r * (-sine * w[EY] + cosine * w[UY]), r * cosine * w[UZ]
        h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + s * w[AX] - nx, w[HY] + s * w[AY] - ny)
        bx, by = hxx * tx + hxy * ty, hxy * tx + hyy * ty
        slope = tz - gx * tx - gy * ty
        step = -slope / (nz - gx * nx - gy * ny - bx * tx - by * ty)
        if abs(step) < 1e-4:  # what is left of it changes neither by more than its square
            along = w[AZ] - (gx + step * bx) * w[AX] - (gy + step * by) * w[AY]
            return w[HZ] + s * w[AZ] - nz - h + 0.5 * slope * step, along, sine, cosine
        step = min(max(step, -0.5), 0.5)
        size = math.sqrt(1.0 + step * step)
        sine, cosine = (sine + cosine * step) / size, (cosine - sine * step) / size
    return math.nan, 0.0, sine, cosine
