"""Minima of the gap inside a tread, over a part of one cubic cell.

The part is quartered until the Bézier ordinates of a quarter show that it stays above what is sought, or that the gap is
convex over it; Newton's method then finds its minimum.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.ground import META_DX, META_DY, surface
from ..model.tolerances import GAP_TIE, MIN_CONCAVITY, MIN_DECREASE
from ..model.wheel import AZ, COS, EX, EY, GAP, HALF, HX, HY, HZ, PATCH, RADIUS, SIN, TAN, VX, VY
from .cubic_parts import bounded_step, next_part
from .cubic_patch import (
    BOUNDS_SIZE,
    X_HIGH,
    X_LOW,
    XX_HIGH,
    XX_LOW,
    XY_HIGH,
    XY_LOW,
    Y_HIGH,
    Y_LOW,
    YY_HIGH,
    YY_LOW,
    bound_differences,
    bound_patch,
    lowest_over_valley,
)
from .minima import Minima, keep_lower_contact
from .rim_pieces import Part

Array = NDArray[np.float64]

FINEST = 20  # times a part is quartered
TREAD_END = 1e-14  # of the radius: T is not evaluated closer to its ends, where its slope is infinite

UNDECIDED, CLOSED, CONVEX = range(3)


@njit
def search_inside(
    grid: Array, meta: Array, w: Array, col: int, row: int, side: float, part: Part, found: Minima, count: int
) -> int:
    """List the local minima of f = T - h inside the tread, over a part of a cubic cell.

    Over (u, v) the tread's lower (side 1) or upper half (side -1) has the height
    T = z_hub + v tan τ - side sqrt(r² - u²) / cos τ. The part is quartered until each quarter lies under no tread, `_decide`
    closes it, or f is convex over it: Newton's method then finds its minimum. docs/bounds.md derives the bounds.

    Args:
        grid, meta: cubic terrain (ground.py).
        w: (WHEEL_SIZE,) wheel.
        col, row: the cell.
        side: 1 for the tread's lower half, -1 for its upper half.
        part: the part.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        count, with the minima kept.
    """
    lowest, keep, _ = found
    x0, x1, y0, y1 = part
    r, reach = w[RADIUS], w[HALF] * w[COS]
    vx, vy, ex, ey = w[VX], w[VY], w[EX], w[EY]
    lean = side * w[AZ]
    level, i, j = 0, 0, 0
    rx, ry = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    while True:
        x, y = x0 + (2 * i + 1) * rx, y0 + (2 * j + 1) * ry
        u, v = x * ex + y * ey, x * vx + y * vy
        ru, rv = rx * abs(ex) + ry * abs(ey), rx * abs(vx) + ry * abs(vy)
        q_far = math.sqrt(max(r * r - max(abs(u) - ru, 0.0) ** 2, 0.0))
        q_near = math.sqrt(max(r * r - (abs(u) + ru) ** 2, 0.0))
        low_s = v - rv - max(q_far * lean, q_near * lean)
        high_s = v + rv - min(q_far * lean, q_near * lean)
        split = False
        if abs(u) - ru < r and low_s < reach and high_s > -reach:
            verdict = _decide(grid, meta, w, side, col, row, x, y, rx, ry, lowest[SIN], max(lowest[GAP] - GAP_TIE, keep))
            kept = -1
            if verdict == CONVEX:
                kept = _convex_part(grid, meta, w, side, x, y, rx, ry, found, count)
            if kept >= 0:
                count = kept
            elif verdict != CLOSED and level < FINEST:
                split = True
            elif verdict != CLOSED and abs(u) < r:
                h = surface(grid, meta, w[HX] + x, w[HY] + y)[0]
                count = _keep_lower_inside(w, side, u, v, h, found, count)
        if split:
            level, i, j = level + 1, 2 * i, 2 * j
            rx, ry = 0.5 * rx, 0.5 * ry
            continue
        level, i, j, rx, ry = next_part(level, i, j, rx, ry)
        if level < 0:
            return count


@njit
def bound_part(
    grid: Array, meta: Array, w: Array, side: float, col: int, row: int, x: float, y: float, rx: float, ry: float,
    sine: float, limit: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Bound the gap of half a tread over a part of a cell, by Bézier ordinates.

    The lower half T is bounded by a parabola along u that touches it, with the least curvature of T over the part. Over a valley
    along the axle the bound is best at the valley's bottom: it touches T where the lowest contact so far lies, or as near to it
    as the part allows. The upper half is bounded by its height at the ends of the part.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; PATCH is filled with the ordinates of the height of a plane above the terrain.
        side: 1 for the tread's lower half, -1 for its upper half.
        col, row: the cell.
        x, y, rx, ry: middle and half sizes of the part, m from the hub.
        sine: sin φ of the lowest contact so far.
        limit: m; a bound below it may be lower than it need be.

    Returns:
        The bound, m, NaN over missing data; the plane's slope along u (that along v is tan τ); and a lower bound of T_uu, 1/m.
    """
    patch, r, ex, ey = w[PATCH : PATCH + BOUNDS_SIZE], w[RADIUS], w[EX], w[EY]
    dx, dy = meta[META_DX], meta[META_DY]
    u, v, ru = x * ex + y * ey, x * w[VX] + y * w[VY], rx * abs(ex) + ry * abs(ey)
    bowl = 0.0
    if side > 0.0:
        ut = min(max(min(max(r * sine, u - ru), u + ru), -0.98 * r), 0.98 * r)
        nearest = max(abs(u) - ru, 0.0)
        q, q_far = math.sqrt(r * r - ut * ut), math.sqrt(max(r * r - nearest * nearest, 0.0004 * r * r))
        slope, least_uu = ut / (q * w[COS]), r * r / (q_far * q_far * q_far * w[COS])
        if nearest <= 0.98 * r:
            bowl = 0.5 * least_uu
        plane = (slope + bowl * (u - ut)) * (u - ut) - q / w[COS]
        slope += 2.0 * bowl * (u - ut)
    else:
        q = math.sqrt(max(r * r - (abs(u) + ru) ** 2, 0.0))
        slope, plane = 0.0, q / w[COS]
        least_uu = -r * r / (q * q * q * w[COS]) if q > 0.0 else -math.inf
    wide, tall = 2.0 * rx, 2.0 * ry
    u0, v0 = (w[HX] + x - rx) / dx - col, (w[HY] + y - ry) / dy - row
    gx, gy = slope * ex + w[TAN] * w[VX], slope * ey + w[TAN] * w[VY]
    corner = w[HZ] + v * w[TAN] + plane - gx * rx - gy * ry
    low = bound_patch(grid, col, row, u0, u0 + wide / dx, v0, v0 + tall / dy, wide, tall, corner, gx, gy, patch)
    if bowl > 0.0:
        a, b = ex * rx, ey * ry
        near, far = min(patch[0], patch[15]) + bowl * (a + b) ** 2, min(patch[3], patch[12]) + bowl * (a - b) ** 2
        if min(near, far) >= limit:  # otherwise a corner of the part is too low
            low = lowest_over_valley(patch, bowl, a, b) + 0.0 * low
    return low, slope, least_uu


@njit
def _decide(
    grid: Array, meta: Array, w: Array, side: float, col: int, row: int, x: float, y: float, rx: float, ry: float,
    sine: float, limit: float,
) -> int:  # fmt: skip
    """Decide a part of a cell by the Bézier ordinates of the height of a plane above it.

    The terrain's derivatives are bounded in the grid's directions and in the wheel's. Beside a wall along the grid only the first
    are tight; on a valley along the wheel's axle, only the second.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; PATCH is scratch.
        side: 1 for the tread's lower half, -1 for its upper half.
        col, row: the cell.
        x, y, rx, ry: middle and half sizes of the part, m from the hub.
        sine: sin φ of the lowest contact so far.
        limit: m, minima of this gap or more are not sought.

    Returns:
        CLOSED: there is no minimum below `limit`. CONVEX: T - h is convex within `GAP_TIE` (`_convex_part`). UNDECIDED: neither
        is shown.
    """
    low, slope, least_uu = bound_part(grid, meta, w, side, col, row, x, y, rx, ry, sine, limit)
    if low >= limit:
        return CLOSED
    patch, ex, ey, vx, vy = w[PATCH : PATCH + BOUNDS_SIZE], w[EX], w[EY], w[VX], w[VY]
    bound_differences(patch)
    u, ru = x * ex + y * ey, rx * abs(ex) + ry * abs(ey)
    # T's slope along u less the plane's, at the ends of the part
    near, far = side * _bowl_slope(w, u - side * ru) - slope, side * _bowl_slope(w, u + side * ru) - slope
    wide, tall = 2.0 * rx, 2.0 * ry
    share_x, share_y = wide / 3.0, tall / 3.0
    rises = max(patch[X_LOW] + share_x * min(near * ex, far * ex), patch[Y_LOW] + share_y * min(near * ey, far * ey))
    falls = min(patch[X_HIGH] + share_x * max(near * ex, far * ex), patch[Y_HIGH] + share_y * max(near * ey, far * ey))
    if rises > GAP_TIE or falls < -GAP_TIE:
        return CLOSED
    v_low, v_high = _slope_range(vx / wide, vy / tall, patch)
    u_low, u_high = _slope_range(ex / wide, ey / tall, patch)
    if max(max(v_low, -v_high), max(u_low + near, -u_high - far)) * min(wide, tall) / 3.0 > GAP_TIE:
        return CLOSED
    a, b, c = 6.0 / (wide * wide), 9.0 / (wide * tall), 6.0 / (tall * tall)
    vv_low, vv_high = _curvature_range(a * vx * vx, 2.0 * b * vx * vy, c * vy * vy, patch)
    if vv_high < MIN_CONCAVITY:  # T is straight along v: the terrain must be concave
        return CLOSED
    uu_low, uu_high = _curvature_range(a * ex * ex, 2.0 * b * ex * ey, c * ey * ey, patch)
    if side < 0.0:  # T is concave along u: the terrain must be more so
        nearest = max(abs(u) - ru, 0.0)
        q = math.sqrt(max(w[RADIUS] * w[RADIUS] - nearest * nearest, 0.0))
        if uu_high * q * q * q * w[COS] < w[RADIUS] * w[RADIUS]:
            return CLOSED
    even_x, even_y, mixed = GAP_TIE / (wide * wide), GAP_TIE / (tall * tall), least_uu * ex * ey
    f_xx, f_yy = a * patch[XX_LOW] + least_uu * ex * ex + even_x, c * patch[YY_LOW] + least_uu * ey * ey + even_y
    most_xy = max(-b * patch[XY_LOW] - mixed, b * patch[XY_HIGH] + mixed)
    if f_xx > 0.0 and f_yy > 0.0 and f_xx * f_yy > most_xy * most_xy:
        return CONVEX
    uv_low, uv_high = _curvature_range(a * ex * vx, b * (ex * vy + ey * vx), c * ey * vy, patch)
    even, most_uv = min(even_x, even_y), max(-uv_low, uv_high)
    f_uu, f_vv = uu_low + least_uu + even, vv_low + even
    return CONVEX if f_uu > 0.0 and f_vv > 0.0 and f_uu * f_vv > most_uv * most_uv else UNDECIDED


@inlined
def _slope_range(a: float, b: float, patch: Array) -> tuple[float, float]:
    """Return the range of 3 (a f_x + b f_y) over a patch.

    f_x and f_y are its first differences.

    Args:
        a, b: 1/m.
        patch: (BOUNDS_SIZE,) ordinates and differences, m.
    """
    x0, x1, y0, y1 = 3.0 * a * patch[X_LOW], 3.0 * a * patch[X_HIGH], 3.0 * b * patch[Y_LOW], 3.0 * b * patch[Y_HIGH]
    return min(x0, x1) + min(y0, y1), max(x0, x1) + max(y0, y1)


@inlined
def _curvature_range(a: float, b: float, c: float, patch: Array) -> tuple[float, float]:
    """Return the range of a f_xx + b f_xy + c f_yy over a patch.

    f_xx, f_xy and f_yy are its second differences.

    Args:
        a, b, c: 1/m².
        patch: (BOUNDS_SIZE,) ordinates and differences, m.
    """
    xx0, xx1, xy0, xy1 = a * patch[XX_LOW], a * patch[XX_HIGH], b * patch[XY_LOW], b * patch[XY_HIGH]
    yy0, yy1 = c * patch[YY_LOW], c * patch[YY_HIGH]
    return min(xx0, xx1) + min(xy0, xy1) + min(yy0, yy1), max(xx0, xx1) + max(xy0, xy1) + max(yy0, yy1)


@inlined
def _bowl_slope(w: Array, u: float) -> float:
    """Return T_u of the tread's lower half at u; infinite at the tread's ends.

    Args:
        w: (WHEEL_SIZE,) wheel.
        u: m from the hub along e1.

    Returns:
        Slope; the upper half's is its negative.
    """
    room = (w[RADIUS] - u) * (w[RADIUS] + u)
    return u / (math.sqrt(room) * w[COS]) if room > 0.0 else math.copysign(math.inf, u)


@njit
def _convex_part(
    grid: Array, meta: Array, w: Array, side: float, xm: float, ym: float, rx: float, ry: float,
    found: Minima, count: int,
) -> int:  # fmt: skip
    """Find the minimum of f = T - h over a part where it is convex.

    With the part as the unit square, f + `GAP_TIE` (u² + v²) / 2 is convex. A point where f is stationary is then its minimum
    within `GAP_TIE`: terrain that is level along a line is one part, not a row of ever smaller ones.

    Newton's method with the part's sides as bounds: a coordinate is held at its side while the function falls outwards there. A
    minimum held at a side is not listed: it belongs to the part beyond, or to an edge of the search. It can still be
    the lowest point: if the minimum lies on the border of two parts, rounding may hold it in both.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        side: 1 for the tread's lower half, -1 for its upper half.
        xm, ym, rx, ry: middle and half sizes of the part, m from the hub.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        count, or -1 if Newton did not converge: the part is to be quartered.
    """
    lowest, keep, contacts = found
    unlisted = Minima(lowest, -math.inf, contacts)
    r, ex, ey = w[RADIUS], w[EX], w[EY]
    even_x, even_y = 0.25 * GAP_TIE / (rx * rx), 0.25 * GAP_TIE / (ry * ry)
    rim = r * (1.0 - TREAD_END)
    um, ru = xm * ex + ym * ey, rx * abs(ex) + ry * abs(ey)
    low_u, high_u = max(um - ru, -rim), min(um + ru, rim)
    a = b = 0.0  # from the middle of the part
    if abs(um) > rim:  # the middle lies beyond the tread: begin at its end, towards the corner that is farthest inside
        share = math.copysign(min((abs(um) - rim) / ru, 1.0), um)
        a, b = -math.copysign(rx, ex) * share, -math.copysign(ry, ey) * share
    for _ in range(30):
        x, y = xm + a, ym + b
        u, v = min(max(x * ex + y * ey, -rim), rim), x * w[VX] + y * w[VY]
        h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + x, w[HY] + y)
        q = math.sqrt((r - u) * (r + u))
        t_u, t_uu = side * u / (q * w[COS]), side * r * r / (q * q * q * w[COS])
        if side > 0.0:
            t_uu = _secant_curvature(w, u, t_u, t_uu, gx * ex + gy * ey, low_u, high_u)
        fx, fy = t_u * ex + w[TAN] * w[VX] - gx, t_u * ey + w[TAN] * w[VY] - gy
        fxx, fyy, fxy = t_uu * ex * ex - hxx + even_x, t_uu * ey * ey - hyy + even_y, t_uu * ex * ey - hxy
        # the tangent plane at (x, y) is a lower bound on the part
        low = w[HZ] + v * w[TAN] - side * q / w[COS] - h - fx * a - fy * b - abs(fx) * rx - abs(fy) * ry
        if low >= max(lowest[GAP] - GAP_TIE, keep):
            return count
        new_a, new_b, decrease, held = bounded_step(a, b, rx, ry, fx, fy, fxx, fxy, fyy)
        if held < 0:
            return -1
        if decrease < MIN_DECREASE and held == 0 and abs(new_a) < rx and abs(new_b) < ry:  # the last step leaves its square
            u, v = (xm + new_a) * ex + (ym + new_b) * ey, (xm + new_a) * w[VX] + (ym + new_b) * w[VY]
            if abs(u) <= rim:
                h = surface(grid, meta, w[HX] + xm + new_a, w[HY] + ym + new_b)[0]
                return _keep_lower_inside(w, side, u, v, h, found, count)
        if decrease < MIN_DECREASE:
            # held at a side by a slope that may be rounding: no minimum to list, but a point of the tread all the same
            return _keep_lower_inside(w, side, u, v, h, found if held == 0 else unlisted, count)
        new_u = (xm + new_a) * ex + (ym + new_b) * ey
        if abs(new_u) > rim:  # beyond the tread's end: go where T is 10 times as steep
            end = math.copysign(max(math.sqrt(r * r - 0.01 * q * q), abs(u)), new_u)
            share = (min(max(end, -rim), rim) - u) / (new_u - u)
            new_a, new_b = a + share * (new_a - a), b + share * (new_b - b)
        a, b = new_a, new_b
    return -1


@inlined
def _secant_curvature(w: Array, u: float, t_u: float, t_uu: float, slope: float, low: float, high: float) -> float:
    """Return the curvature of T along u with which Newton's step is exact over a plane.

    T_u is infinite at the tread's ends, and steps with T_uu would not converge there. The secant of T_u between u and the point
    where T is as steep as the terrain leads to that point. It tends to T_uu at the minimum.

    Args:
        w: (WHEEL_SIZE,) wheel.
        u: m from the hub along e1.
        t_u, t_uu: T_u and T_uu of the tread's lower half, 1/m.
        slope: the terrain's slope along u.
        low, high: m, range of u. The secant's other end is limited to it, so that the secant is at least the least T_uu there.

    Returns:
        Curvature, 1/m.
    """
    tan = slope * w[COS]
    other = min(max(w[RADIUS] * tan / math.sqrt(1.0 + tan * tan), low), high)
    if abs(other - u) <= 1e-6 * (w[RADIUS] - abs(u)):
        return t_uu
    return (_bowl_slope(w, other) - t_u) / (other - u)


@inlined
def _keep_lower_inside(w: Array, side: float, u: float, v: float, h: float, found: Minima, count: int) -> int:
    """Keep the tread's point over (u, v), if there is one.

    Args:
        w: (WHEEL_SIZE,) wheel.
        side: 1 for the tread's lower half, -1 for its upper half.
        u, v: m from the hub along e1 and the axle's horizontal direction; |u| is less than the radius.
        h: m, the terrain's height there.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    r = w[RADIUS]
    q = side * math.sqrt(r * r - u * u)
    s = (v - q * w[AZ]) / w[COS]
    if abs(s) <= w[HALF]:
        count = keep_lower_contact(w, found, w[HZ] + v * w[TAN] - q / w[COS] - h, u / r, q / r, s, count)
    return count
