"""Minima of the gap inside a tread, over a part of one cubic cell.

The part is quartered until bounds on the spline's derivatives show that a quarter stays above what is sought, or that
the gap is convex over it; Newton's method then finds its minimum.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.ground import META_DX, META_DY, surface
from ..model.tolerances import GAP_TIE, MIN_CONCAVITY, MIN_DECREASE
from ..model.wheel import AZ, COS, EX, EY, GAP, HALF, HX, HY, HZ, PATCH, RADIUS, TAN, VX, VY, keep_lower_contact
from .cubic_derivatives import XX, XXX, XXY, XY, XYY, YY, YYY
from .cubic_parts import bounded_step, next_part
from .cubic_patch import (
    BOUNDS_SIZE,
    X_HIGH,
    X_LOW,
    XX_LOW,
    XY_HIGH,
    XY_LOW,
    Y_HIGH,
    Y_LOW,
    YY_LOW,
    bound_differences,
    bound_patch,
)

Array = NDArray[np.float64]

FINEST = 20  # times a part is quartered

UNDECIDED, CLOSED, CONVEX = range(3)


@njit
def search_inside(
    grid: Array, meta: Array, w: Array, col: int, row: int, derivatives: Array, side: float,
    x0: float, x1: float, y0: float, y1: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """List the local minima of T - h inside the tread, over a part of a cubic cell.

    Over (u, v) the tread's lower (side 1) or upper half (side -1) has the height
    T = z_hub + v tan τ - side sqrt(r² - u²) / cos τ. A local minimum needs h_vv <= 0, and h_uu <= T_uu. The part is quartered
    until a quarter fails one of these conditions or that of the slope, lies under no tread, has a lower bound that is not below
    what is sought, or T - h is shown to be convex over it. Newton's method then finds its minimum. docs/bounds.md derives the
    bounds.

    Args:
        grid, meta: cubic terrain (ground.py).
        w: (WHEEL_SIZE,) wheel.
        col, row: the cell.
        derivatives: (DERIVATIVES_SIZE,) bounds on the cell's derivatives (`derivative_bounds`).
        side: 1 for the tread's lower half, -1 for its upper half.
        x0, x1, y0, y1: the part, m from the hub; it lies in one cell.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    r, half = w[RADIUS], w[HALF]
    vx, vy, ex, ey = w[VX], w[VY], w[EX], w[EY]
    lean = side * w[AZ]
    xx, xy, yy = vx * vx, 2.0 * vx * vy, vy * vy
    across = derivatives[XX] * xx + min(derivatives[XY] * xy, derivatives[XY + 1] * xy) + derivatives[YY] * yy
    if across > -MIN_CONCAVITY:
        return count
    if side < 0.0:  # T is concave along the wheel, by 1 / (r cos τ) at least: the ground must be more so
        wheelward = (
            derivatives[XX] * ex * ex
            + min(2.0 * derivatives[XY] * ex * ey, 2.0 * derivatives[XY + 1] * ex * ey)
            + derivatives[YY] * ey * ey
        )
        if wheelward * r * w[COS] > -1.0:
            return count
    level, i, j = 0, 0, 0
    rx, ry = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    while True:
        x, y = x0 + (2 * i + 1) * rx, y0 + (2 * j + 1) * ry
        u, v = x * ex + y * ey, x * vx + y * vy
        ru, rv = rx * abs(ex) + ry * abs(ey), rx * abs(vx) + ry * abs(vy)
        split = False
        q_far = math.sqrt(max(r * r - max(abs(u) - ru, 0.0) ** 2, 0.0))
        q_near = math.sqrt(max(r * r - (abs(u) + ru) ** 2, 0.0))
        low_s = v - rv - max(q_far * lean, q_near * lean)
        high_s = v + rv - min(q_far * lean, q_near * lean)
        if abs(u) - ru < r and low_s < half * w[COS] and high_s > -half * w[COS]:
            h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + x, w[HY] + y)
            dxx, dxy, dyy = (
                derivatives[XXX] * rx + derivatives[XXY] * ry,
                derivatives[XXY] * rx + derivatives[XYY] * ry,
                derivatives[XYY] * rx + derivatives[YYY] * ry,
            )
            h_vv, d_vv = hxx * xx + hxy * xy + hyy * yy, dxx * xx + dxy * abs(xy) + dyy * yy
            h_uv, d_uv = (
                hxx * ex * vx + hxy * (ex * vy + ey * vx) + hyy * ey * vy,
                dxx * abs(ex * vx) + dxy * abs(ex * vy + ey * vx) + dyy * abs(ey * vy),
            )
            h_uu, d_uu = (
                hxx * ex * ex + 2.0 * hxy * ex * ey + hyy * ey * ey,
                dxx * ex * ex + 2.0 * dxy * abs(ex * ey) + dyy * ey * ey,
            )
            h_u, h_v = gx * ex + gy * ey, gx * vx + gy * vy
            level_v = abs(w[TAN] - h_v) <= (abs(h_vv) + d_vv) * rv + (abs(h_uv) + d_uv) * ru
            if h_vv - d_vv < -MIN_CONCAVITY and level_v:
                rise = (abs(h_uu) + d_uu) * ru + (abs(h_uv) + d_uv) * rv
                if side > 0.0:
                    falls = _bowl_slope(w, u - ru) - h_u - rise <= 0.0 <= _bowl_slope(w, u + ru) - h_u + rise
                    ut = min(max(u, -0.98 * r), 0.98 * r)  # a tangent of T at ut lies nowhere above it
                    lu = _bowl_slope(w, ut)
                    low = lu * (u - ut) - math.sqrt(r * r - ut * ut) / w[COS]
                    t_uu = r * r / (q_far * q_far * q_far * w[COS])
                else:
                    falls = -_bowl_slope(w, u + ru) - h_u - rise <= 0.0 <= -_bowl_slope(w, u - ru) - h_u + rise
                    lu = 0.0
                    low = q_near / w[COS]
                    t_uu = -r * r / (q_near * q_near * q_near * w[COS]) if q_near > 0.0 else -math.inf
                plane = w[HZ] + v * w[TAN] + low
                slope_x, slope_y = lu * ex + w[TAN] * vx - gx, lu * ey + w[TAN] * vy - gy
                bent = 0.5 * max(hxx + dxx, 0.0) * rx * rx + (abs(hxy) + dxy) * rx * ry + 0.5 * max(hyy + dyy, 0.0) * ry * ry
                low += w[HZ] + v * w[TAN] - h - abs(slope_x) * rx - abs(slope_y) * ry - bent
                if falls and low < max(lowest[GAP] - GAP_TIE, keep):
                    f_uu, f_vv, f_uv = t_uu - h_uu - d_uu, -h_vv - d_vv, abs(h_uv) + d_uv
                    verdict, kept = CONVEX, -1
                    if not (f_uu > 0.0 and f_vv > 0.0 and f_uu * f_vv > f_uv * f_uv):
                        sought = max(lowest[GAP] - GAP_TIE, keep)
                        verdict = _by_patch(grid, meta, w, side, col, row, x, y, rx, ry, plane, lu, t_uu, sought)
                    if verdict == CONVEX:
                        kept = _convex_part(grid, meta, w, side, x, y, rx, ry, lowest, keep, contacts, count)
                    if kept >= 0:
                        count = kept
                    elif verdict != CLOSED and level < FINEST:
                        split = True
                    elif verdict != CLOSED and abs(u) < r:
                        count = _keep_lower_inside(w, side, u, v, h, lowest, keep, contacts, count)
        if split:
            level, i, j = level + 1, 2 * i, 2 * j
            rx, ry = 0.5 * rx, 0.5 * ry
            continue
        level, i, j, rx, ry = next_part(level, i, j, rx, ry)
        if level < 0:
            return count


@njit
def _by_patch(
    grid: Array, meta: Array, w: Array, side: float, col: int, row: int, x: float, y: float, rx: float, ry: float,
    plane: float, slope: float, least_uu: float, limit: float,
) -> int:  # fmt: skip
    """Decide a part by the Bézier ordinates of the height of a plane above it.

    The plane is nowhere above T. The terrain's derivatives are bounded in the grid's directions: beside a wall along the grid
    one of the second derivatives is large and uncertain, and the others are 0. In the wheel's directions all three are large
    and uncertain.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; PATCH is scratch.
        side: 1 for the tread's lower half, -1 for its upper half.
        col, row: the cell.
        x, y, rx, ry: middle and half sizes of the part, m from the hub.
        plane: m, height of the plane over the middle.
        slope: its slope along u; that along v is tan τ.
        least_uu: 1/m, lower bound of T_uu over the part.
        limit: m, minima of this gap or more are not sought.

    Returns:
        CLOSED: there is no minimum below `limit`. CONVEX: T - h is convex. UNDECIDED: neither is shown.
    """
    patch, ex, ey = w[PATCH : PATCH + BOUNDS_SIZE], w[EX], w[EY]
    dx, dy = meta[META_DX], meta[META_DY]
    wide, tall = 2.0 * rx, 2.0 * ry
    u0, v0 = (w[HX] + x - rx) / dx - col, (w[HY] + y - ry) / dy - row
    gx, gy = slope * ex + w[TAN] * w[VX], slope * ey + w[TAN] * w[VY]
    corner = plane - gx * rx - gy * ry
    if bound_patch(grid, col, row, u0, u0 + wide / dx, v0, v0 + tall / dy, wide, tall, corner, gx, gy, patch) >= limit:
        return CLOSED
    bound_differences(patch)
    u, ru = x * ex + y * ey, rx * abs(ex) + ry * abs(ey)
    # T's slope along u less the plane's, at the ends of the part
    near, far = side * _bowl_slope(w, u - side * ru) - slope, side * _bowl_slope(w, u + side * ru) - slope
    share_x, share_y = wide / 3.0, tall / 3.0
    rises = max(patch[X_LOW] + share_x * min(near * ex, far * ex), patch[Y_LOW] + share_y * min(near * ey, far * ey))
    falls = min(patch[X_HIGH] + share_x * max(near * ex, far * ex), patch[Y_HIGH] + share_y * max(near * ey, far * ey))
    if rises > GAP_TIE or falls < -GAP_TIE:
        return CLOSED
    f_xx, f_yy = (
        6.0 * patch[XX_LOW] / (wide * wide) + least_uu * ex * ex,
        6.0 * patch[YY_LOW] / (tall * tall) + least_uu * ey * ey,
    )
    mixed, over = least_uu * ex * ey, 9.0 / (wide * tall)
    most_xy = max(-patch[XY_LOW] * over - mixed, patch[XY_HIGH] * over + mixed)
    return CONVEX if f_xx > 0.0 and f_yy > 0.0 and f_xx * f_yy > most_xy * most_xy else UNDECIDED


@inlined
def _bowl_slope(w: Array, u: float) -> float:
    """Return T_u of the tread's lower half at u; infinite at the tread's ends.

    Args:
        w: (WHEEL_SIZE,) wheel.
        u: m from the hub along e1.

    Returns:
        Slope; the upper half's is its negative.
    """
    room = w[RADIUS] * w[RADIUS] - u * u
    return u / (math.sqrt(room) * w[COS]) if room > 0.0 else math.copysign(math.inf, u)


@njit
def _convex_part(
    grid: Array, meta: Array, w: Array, side: float, xm: float, ym: float, rx: float, ry: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Find the minimum of T - h over a part where it is convex.

    Newton's method with the part's sides as bounds: a coordinate is held at its side while the function falls outwards there. A
    minimum held at a side is not listed: it belongs to the part beyond, or to an edge of the search. It can still be
    the lowest point: if the minimum lies on the border of two parts, rounding may hold it in both.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        side: 1 for the tread's lower half, -1 for its upper half.
        xm, ym, rx, ry: middle and half sizes of the part, m from the hub.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        count, or -1 if Newton did not converge: the part is to be quartered.
    """
    r = w[RADIUS]
    x, y = xm, ym
    rim = 0.999999 * r
    for _ in range(30):
        u, v = x * w[EX] + y * w[EY], x * w[VX] + y * w[VY]
        if abs(u) > rim:  # the middle of the part lies beyond the tread: begin on it
            u = math.copysign(rim, u)
            x, y = u * w[EX] + v * w[VX], u * w[EY] + v * w[VY]
        h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + x, w[HY] + y)
        q = math.sqrt(r * r - u * u)
        t_u, t_uu = side * u / (q * w[COS]), side * r * r / (q * q * q * w[COS])
        fx, fy = t_u * w[EX] + w[TAN] * w[VX] - gx, t_u * w[EY] + w[TAN] * w[VY] - gy
        fxx, fxy, fyy = t_uu * w[EX] * w[EX] - hxx, t_uu * w[EX] * w[EY] - hxy, t_uu * w[EY] * w[EY] - hyy
        # the tangent plane at (x, y) is a lower bound on the part
        low = w[HZ] + v * w[TAN] - side * q / w[COS] - h + fx * (xm - x) + fy * (ym - y) - abs(fx) * rx - abs(fy) * ry
        if low >= max(lowest[GAP] - GAP_TIE, keep):
            return count
        step_x, step_y, held = bounded_step(x - xm, y - ym, rx, ry, fx, fy, fxx, fxy, fyy)
        if held < 0:
            return -1
        if abs(fx * step_x + fy * step_y) < MIN_DECREASE:
            # held at a side by a slope that may be rounding: no minimum to list, but a point of the tread all the same
            return _keep_lower_inside(w, side, u, v, h, lowest, keep if held == 0 else -math.inf, contacts, count)
        new_x, new_y = min(max(x + step_x, xm - rx), xm + rx), min(max(y + step_y, ym - ry), ym + ry)
        new_u = new_x * w[EX] + new_y * w[EY]
        if abs(new_u) > rim:  # towards the tread's end no more than half of what is left
            share = (0.5 * (math.copysign(r, new_u) + u) - u) / (new_u - u)
            new_x, new_y = x + share * (new_x - x), y + share * (new_y - y)
        x, y = new_x, new_y
    return -1


@inlined
def _keep_lower_inside(
    w: Array, side: float, u: float, v: float, h: float, lowest: Array, keep: float, contacts: Array, count: int
) -> int:
    """Keep the tread's point over (u, v), if there is one.

    Args:
        w: (WHEEL_SIZE,) wheel.
        side: 1 for the tread's lower half, -1 for its upper half.
        u, v: m from the hub along e1 and the axle's horizontal direction; |u| is less than the radius.
        h: m, the terrain's height there.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    r = w[RADIUS]
    q = side * math.sqrt(r * r - u * u)
    s = (v - q * w[AZ]) / w[COS]
    if abs(s) <= w[HALF]:
        count = keep_lower_contact(w, lowest, w[HZ] + v * w[TAN] - q / w[COS] - h, u / r, q / r, s, keep, contacts, count)
    return count
