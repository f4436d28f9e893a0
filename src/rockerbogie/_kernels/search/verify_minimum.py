"""Verification that a tracked contact is the global minimum, on smooth cubic terrain.

Along a rim the gap is convex where the terrain is less curved than the rim: there is one minimum. What remains is how
these minima m(s) vary over the width. m'' lies between bounds; from an end of the width or from inside, these may show
that m is nowhere lower. If they do not, the whole tread is searched.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, specialize_on_ground
from ..model.ground import META_DX, META_DY, META_NX, META_NY, CubicGround, Ground, surface
from ..model.tolerances import VERIFIED_DEPTH
from ..model.wheel import (
    AX,
    AY,
    AZ,
    COSINE,
    DERIVATIVES,
    DERIVATIVES_OF_TREAD,
    EX,
    EY,
    GAP,
    HALF,
    HX,
    HY,
    HZ,
    PLACE,
    RADIUS,
    SIN,
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
    if _by_bounds(grid, meta, w, sine, cosine, s, -VERIFIED_DEPTH):
        return LEAST
    code, _ = least_gap(ground, w, sine, cosine, s, True, -math.inf, lowest, none)
    if code != FOUND:
        return UNKNOWN
    return LEAST if lowest[GAP] > -VERIFIED_DEPTH else LOWER


@njit
def least_gap_by_bounds(
    ground: Ground, w: Array, sine: float, cosine: float, keep: float, lowest: Array, contacts: Array
) -> tuple[int, int]:
    """Find the smallest gap of a whole tread.

    On smooth cubic terrain, bounds may take the place of a search.

    Args:
        ground: terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine: sin φ, cos φ to start from.
        keep: m, list local minima of gap <= keep; -inf for none.
        lowest: (CONTACT_SIZE,) filled with the lowest point, within `VERIFIED_DEPTH`.
        contacts: (n, CONTACT_SIZE) filled with the local minima listed; 0 are listed if `lowest` is shown to be the only one.

    Returns:
        FOUND, OFF or BLANK, and the number of minima listed, as `tread.least_gap`.
    """
    # not inlined into its callers: in one, code compiled by numba 0.68 then wrote to another array than the source says
    if _shown_on_rims(ground, w, sine, cosine, keep, lowest):
        return FOUND, 0
    return least_gap(ground, w, sine, cosine, 0.0, True, keep, lowest, contacts)


def _shown_on_rims(ground: Ground, w: Array, sine: float, cosine: float, keep: float, lowest: Array) -> bool:
    """Find the lowest point of a tread by its rims, where bounds show it (`_least_of_rims`).

    Args:
        ground, w, sine, cosine, keep, lowest: as `_least_of_rims` takes them.

    Returns:
        False if it is not shown, as always on bilinear terrain.
    """
    return _shown_of(type(ground))(ground, w, sine, cosine, keep, lowest)


def _never(ground: Ground, w: Array, sine: float, cosine: float, keep: float, lowest: Array) -> bool:
    """Return False: bilinear terrain is not smooth.

    Args:
        ground, w, sine, cosine, keep, lowest: as `_least_of_rims` takes them.
    """
    return False


def _try_rims(ground: Ground, w: Array, sine: float, cosine: float, keep: float, lowest: Array) -> bool:
    """Call `_least_of_rims`.

    Args:
        ground, w, sine, cosine, keep, lowest: as `_least_of_rims` takes them.
    """
    return _least_of_rims(ground, w, sine, cosine, keep, lowest)


@specialize_on_ground(_shown_on_rims)
def _shown_of(kind: type) -> Any:
    """Return `_shown_on_rims` for one kind of terrain.

    Args:
        kind: CubicGround or LinearGround.
    """
    return _try_rims if kind is CubicGround else _never


@njit
def _least_of_rims(ground: Ground, w: Array, sine: float, cosine: float, keep: float, lowest: Array) -> bool:
    """Find the lower minimum on a tread's two rims, if it is shown to be the lowest point.

    Args:
        ground: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine: sin φ, cos φ to start from.
        keep: m; no other local minimum may have a gap up to this. -inf: any may.
        lowest: (CONTACT_SIZE,) filled.

    Returns:
        False, with nothing to use in `lowest`, if it is not shown.
    """
    grid, _, meta = ground
    if not 0 < _cells_under(meta, w)[4] <= CELLS:
        return False
    half, higher = w[HALF], math.inf
    lowest[GAP] = math.inf
    for k in range(2 if half > 0.0 else 1):
        s = half - 2.0 * half * k
        gap, _, sp, cp = _least_of_rim(grid, meta, w, sine, cosine, s)
        if not gap < math.inf:
            return False
        if gap < lowest[GAP]:
            higher = lowest[GAP]
            lowest[GAP], lowest[SIN], lowest[COSINE], lowest[PLACE] = gap, sp, cp, s
        else:
            higher = gap
    margin = max(keep - lowest[GAP], -VERIFIED_DEPTH)
    if higher < lowest[GAP] + margin:
        return False
    return _by_bounds(grid, meta, w, lowest[SIN], lowest[COSINE], lowest[PLACE], margin)


@inlined
def _cells_under(meta: Array, w: Array) -> tuple[int, int, int, int, int]:
    """Return the first and last columns and rows of the cells under a wheel, and their number.

    The number is 0 if a cell is off the map.

    Args:
        meta: (META_SIZE,) map header.
        w: (WHEEL_SIZE,) wheel.
    """
    r, half, dx, dy = w[RADIUS], w[HALF], meta[META_DX], meta[META_DY]
    out_x = half * abs(w[AX]) + r * math.sqrt(w[EX] * w[EX] + w[UX] * w[UX])
    out_y = half * abs(w[AY]) + r * math.sqrt(w[EY] * w[EY] + w[UY] * w[UY])
    i0, i1 = int(math.floor((w[HX] - out_x) / dx)), int(math.floor((w[HX] + out_x) / dx))
    j0, j1 = int(math.floor((w[HY] - out_y) / dy)), int(math.floor((w[HY] + out_y) / dy))
    outside = i0 < 0 or j0 < 0 or i1 > meta[META_NX] - 2.0 or j1 > meta[META_NY] - 2.0
    return i0, i1, j0, j1, 0 if outside else (i1 - i0 + 1) * (j1 - j0 + 1)


@njit
def _by_bounds(grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float, margin: float) -> bool:
    """Check by bounds on derivatives that a contact is the lowest point of the tread.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine, s: the contact.
        margin: m. -VERIFIED_DEPTH: no point is lower by more than that. Otherwise the contact lies on a rim, and every other
            local minimum is higher by this, 0 or more.

    Returns:
        True if the bounds show it; False decides nothing.
    """
    r, half, dx, dy = w[RADIUS], w[HALF], meta[META_DX], meta[META_DY]
    i0, i1, j0, j1, cells = _cells_under(meta, w)
    if not 0 < cells <= CELLS:
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
            if max(max(-least[XX], least[XX + 1]), max(-least[YY], least[YY + 1])) * r > 1.0:
                return False  # the terrain is as sharp as the rim: `room` below would be negative
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
                if not _is_clear(grid, meta, w, sp, cp, place, way, left, there, way * along, gap - VERIFIED_DEPTH, fall, rise):
                    return False
        return True
    way = -1.0 if s > 0.0 else 1.0
    if fall < 0.0:  # m is convex over the whole width
        off = max(-way * along, 0.0)
        return off * off <= -2.0 * fall * VERIFIED_DEPTH
    gap, left, slope = gap_at(grid, meta, w, sine, cosine, s), 2.0 * half, way * along
    here = gap
    if margin >= 0.0:  # m increases as far as this
        rises = min(0.9 * slope / fall if fall > 0.0 else math.inf, left)
        if not rises > 0.0:
            return False
        s, left = s + way * rises, left - rises
        here, slope, sine, cosine = _least_of_rim(grid, meta, w, sine, cosine, s)
        slope *= way
        if left <= 0.0:
            return here >= gap
    return _is_clear(grid, meta, w, sine, cosine, s, way, left, here, slope, gap + margin, fall, rise)


@njit
def _is_clear(
    grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float, way: float, left: float,
    here: float, slope: float, low: float, fall: float, rise: float,
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
        low: m, the gap.
        fall, rise: 1/m, bounds: -fall <= m'' <= rise.

    Returns:
        True if it holds; False decides nothing.
    """
    fall = max(fall, 0.0)
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
        step = min(max(step, -0.5), 0.5)
        size = math.sqrt(1.0 + step * step)
        sine, cosine = (sine + cosine * step) / size, (cosine - sine * step) / size
        if abs(step) < 1e-4:  # what is left of it changes neither by more than its square
            along = w[AZ] - (gx + step * bx) * w[AX] - (gy + step * by) * w[AY]
            return w[HZ] + s * w[AZ] - nz - h + 0.5 * slope * step, along, sine, cosine
    return math.nan, 0.0, sine, cosine
