"""Verification that a tracked contact is the global minimum, on smooth cubic terrain.

Along a rim the gap is convex where the terrain is less curved than the rim: there is one minimum. What remains is how
these minima m(s) vary over the width. m'' lies between bounds, from Bézier ordinates of the terrain under the tread or under a
piece of its width; these may show that m is nowhere lower than at the contact. If they do not, the whole tread is searched.
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
    PATCH,
    PLACE,
    RADIUS,
    SIN,
    TAN,
    UX,
    UY,
    UZ,
    gap_at,
    tread_point,
)
from .cubic_derivatives import DERIVATIVES_SIZE, XX, XY, YY, second_derivatives
from .cubic_patch import BOUNDS_SIZE
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
    return LEAST if lowest[GAP] > -2.0 * VERIFIED_DEPTH else LOWER  # the contact's own gap may be that deep


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


@njit
def _bound_derivatives(grid: Array, meta: Array, w: Array, west: float, east: float, south: float, north: float) -> bool:
    """Bound the second derivatives of the terrain over a rectangle under a wheel.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; DERIVATIVES_OF_TREAD is filled, 1/m. DERIVATIVES and PATCH are scratch.
        west, east, south, north: m from the map's first node.

    Returns:
        False if the rectangle is not on the map, lies on more than `CELLS` cells or on a missing one, or if the terrain is as
        sharp as the rim.
    """
    dx, dy = meta[META_DX], meta[META_DY]
    i0, i1, j0, j1 = (
        int(math.floor(west / dx)),
        int(math.floor(east / dx)),
        int(math.floor(south / dy)),
        int(math.floor(north / dy)),
    )
    if i0 < 0 or j0 < 0 or i1 > meta[META_NX] - 2.0 or j1 > meta[META_NY] - 2.0 or (i1 - i0 + 1) * (j1 - j0 + 1) > CELLS:
        return False
    patch = w[PATCH : PATCH + BOUNDS_SIZE]
    one, every = (
        w[DERIVATIVES : DERIVATIVES + DERIVATIVES_SIZE],
        w[DERIVATIVES_OF_TREAD : DERIVATIVES_OF_TREAD + DERIVATIVES_SIZE],
    )
    for k in range(3):
        every[2 * k], every[2 * k + 1] = math.inf, -math.inf
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            x, y = i * dx, j * dy
            if not second_derivatives(grid, i, j, dx, dy, west - x, east - x, south - y, north - y, patch, one):
                return False
            for k in range(3):
                every[2 * k], every[2 * k + 1] = min(every[2 * k], one[2 * k]), max(every[2 * k + 1], one[2 * k + 1])
            if max(max(-every[XX], every[XX + 1]), max(-every[YY], every[YY + 1])) * w[RADIUS] > 1.0:
                return False
    return True


@njit
def _range_of(w: Array, xx: float, xy: float, yy: float) -> tuple[float, float]:
    """Return the lowest and the highest value of a sum of second derivatives.

    It is xx h_xx + xy h_xy + yy h_yy, with the bounds in DERIVATIVES_OF_TREAD.

    Args:
        w: (WHEEL_SIZE,) wheel.
        xx, xy, yy: weights.
    """
    low = high = 0.0
    for k, weight in enumerate((xx, xy, yy)):
        a, b = weight * w[DERIVATIVES_OF_TREAD + 2 * k], weight * w[DERIVATIVES_OF_TREAD + 2 * k + 1]
        low, high = low + min(a, b), high + max(a, b)
    return low, high


@njit
def _along_axle(w: Array, room: float) -> tuple[float, float, float]:
    """Return bounds on how the minima m of the rims vary along the axle.

    They follow from DERIVATIVES_OF_TREAD.

    Args:
        w: (WHEEL_SIZE,) wheel.
        room: lower bound of the gap's second derivative along a rim at its minimum, over r.

    Returns:
        fall and rise, 1/m: -fall <= m'' <= rise, rise >= 0; and how far the minimum moves along the rim, m per m of the axle.
    """
    ax, ay, ex, ey = w[AX], w[AY], w[EX], w[EY]
    low, high = _range_of(w, ax * ax, 2.0 * ax * ay, ay * ay)
    less, more = _range_of(w, ax * ex, ax * ey + ay * ex, ay * ey)
    twist = max(-less, more) + abs(w[TAN]) * max(-low, high)
    follow = twist * w[RADIUS] / room
    return high + twist * follow, max(-low, 0.0), follow


@njit
def _by_bounds(grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float, margin: float) -> bool:
    """Check by bounds on derivatives that a contact is the lowest point of the tread.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; its scratch is written.
        sine, cosine, s: the contact.
        margin: m. -VERIFIED_DEPTH: no point is lower by more than that. Otherwise the contact lies on a rim, and every other
            local minimum is higher by this, 0 or more.

    Returns:
        True if the bounds show it; False decides nothing.
    """
    r, half = w[RADIUS], w[HALF]
    out_x = half * abs(w[AX]) + r * math.sqrt(w[EX] * w[EX] + w[UX] * w[UX])
    out_y = half * abs(w[AY]) + r * math.sqrt(w[EY] * w[EY] + w[UY] * w[UY])
    if not _bound_derivatives(grid, meta, w, w[HX] - out_x, w[HX] + out_x, w[HY] - out_y, w[HY] + out_y):
        return False
    at = DERIVATIVES_OF_TREAD
    curvature = max(max(-w[at + XX], w[at + XX + 1]), max(-w[at + YY], w[at + YY + 1])) + max(-w[at + XY], w[at + XY + 1])
    x, y, _ = tread_point(w, sine, cosine, s)
    _, gx, gy, _, _, _ = surface(grid, meta, w[HX] + x, w[HY] + y)
    steep = abs(gx * w[UX] + gy * w[UY]) + 2.0 * curvature * (r + half) * abs(w[AZ])
    room = w[UZ] - steep - curvature * r * (1.0 + 0.5 * w[AZ] * w[AZ])
    if not (room > 0.0 and cosine > 0.0):
        return False
    if half == 0.0:
        return True
    fall, _, follow = _along_axle(w, room)
    slope = w[AZ] - gx * w[AX] - gy * w[AY]  # m'
    gap = gap_at(grid, meta, w, sine, cosine, s)
    if abs(s) < half:
        for way in (1.0, -1.0):
            if not _is_clear(grid, meta, w, sine, cosine, s, way, half - way * s, gap, way * slope, gap + margin, room, follow):
                return False
        return True
    way, left = -1.0 if s > 0.0 else 1.0, 2.0 * half
    slope, here = way * slope, gap
    if slope > 0.0 and slope > fall * (left if margin >= 0.0 else half):
        return True  # m increases up to the other rim, or is higher there and between
    if margin >= 0.0:
        if not slope > 0.0:
            return False
        rises = 0.9 * slope / fall  # m increases as far as this
        s, left = s + way * rises, left - rises
        here, slope, sine, cosine = _least_of_rim(grid, meta, w, sine, cosine, s)
        slope *= way
    return _is_clear(grid, meta, w, sine, cosine, s, way, left, here, slope, gap + margin, room, follow)


@njit
def _is_clear(
    grid: Array, meta: Array, w: Array, sine: float, cosine: float, s: float, way: float, left: float,
    here: float, slope: float, low: float, room: float, follow: float,
) -> bool:  # fmt: skip
    """Check that the minima m of the rims are nowhere below a gap over a range of s.

    On each piece, m'' is bounded over the terrain under it. m lies above parabolas through its ends with the slopes there. If it
    is not convex, m plus a parabola is, so its tangents at both ends bound it from below; m minus a parabola lies above its
    chord. Where this does not suffice, the piece is halved.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; its scratch is written.
        sine, cosine, s: the rim's minimum to start from.
        way: 1 or -1, direction of s.
        left: m, length of the range.
        here: m, the rim's minimum at s.
        slope: its derivative along `way`.
        low: m, the gap.
        room, follow: as `_along_axle` takes and returns them for the whole tread.

    Returns:
        True if it holds; False decides nothing.
    """
    if not here >= low:
        return False
    piece = left
    for _ in range(PIECES):
        x, y, _ = tread_point(w, sine, cosine, s)
        x, y, to_x, to_y, pad = w[HX] + x, w[HY] + y, way * piece * w[AX], way * piece * w[AY], follow * piece
        west, east, south, north = x + min(to_x, 0.0), x + max(to_x, 0.0), y + min(to_y, 0.0), y + max(to_y, 0.0)
        if not _bound_derivatives(grid, meta, w, west - pad, east + pad, south - pad, north + pad):
            return False
        fall, rise, _ = _along_axle(w, room)
        clear = slope >= 0.5 * fall * piece if slope >= 0.0 else slope * slope <= -2.0 * fall * (here - low)
        if clear and piece >= left:
            return True
        s_next = s + way * piece
        there, slope_next, sine_next, cosine_next = _least_of_rim(grid, meta, w, sine, cosine, s_next)
        slope_next *= way
        if not there >= low:
            return False
        if not clear:
            fall = max(fall, 0.0)
            down, up = slope - 0.5 * fall * piece, slope_next + 0.5 * fall * piece
            dip = max(0.5 * piece - (there - here) / (rise * piece), 0.0) if rise > 0.0 else 0.0
            clear = down >= 0.0 or up <= 0.0 or here + down * (there - here - up * piece) / (down - up) >= low
            clear |= here - 0.5 * rise * dip * dip >= low
        if clear:
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
