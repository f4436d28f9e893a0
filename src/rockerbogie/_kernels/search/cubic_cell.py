"""The minimum of the gap of a tread over one cubic cell.

It lies inside the cell, or on one of the tread's rims. There may be several minima in a cell. Pieces of it are
halved until bounds on the spline's second and third derivatives show that a
piece stays above what is sought, or that the gap is convex over it; Newton's method then finds its minimum.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.ground import META_DX, META_DY, META_MAX_CURVATURE, surface
from ..model.tolerances import CELL_MARGIN, GAP_TIE, MIN_CONCAVITY, MIN_DECREASE
from ..model.wheel import (  # fmt: skip
    AX,
    AY,
    AZ,
    COS,
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
    VX,
    VY,
    keep_lower_contact,
)
from .bilinear_cell import HALVES, ends_of, rim_over_cell
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
)

Array = NDArray[np.float64]

# Bounds over one cubic cell: its second derivatives, lowest and highest, and the size of its third ones.
XX, XY, YY = 0, 2, 4
XXX, XXY, XYY, YYY = range(6, 10)
DERIVATIVES_SIZE = 10
FINEST = 20  # times a part is quartered
THINNEST = 1e-6  # of a cell: a rectangle around an arc is not made smaller along either axis

UNDECIDED, CLOSED, CONVEX = range(3)


@njit
def derivative_bounds(grid: Array, i: int, j: int, dx: float, dy: float, derivatives: Array) -> bool:
    """Compute bounds on the spline's derivatives over a cell: differences of its coefficients.

    Args:
        grid: coefficients, m.
        i, j: column and row of the cell.
        dx, dy: m, node spacing.
        derivatives: (DERIVATIVES_SIZE,) filled: lowest and highest second derivatives, 1/m, and largest third ones, 1/m².

    Returns:
        False if a coefficient is missing.
    """
    total = 0.0
    for k in range(3):
        derivatives[2 * k], derivatives[2 * k + 1] = math.inf, -math.inf
    derivatives[XXX:] = 0.0
    for m in range(4):
        for n in range(4):
            row, col = j + m, i + n
            c = grid[row, col]
            total += c
            if n < 2:
                second = c - 2.0 * grid[row, col + 1] + grid[row, col + 2]
                derivatives[XX], derivatives[XX + 1] = min(derivatives[XX], second), max(derivatives[XX + 1], second)
                if n == 0:
                    derivatives[XXX] = max(
                        derivatives[XXX], abs(grid[row, col + 3] - c + 3.0 * (grid[row, col + 1] - grid[row, col + 2]))
                    )
                if m < 3:
                    above = grid[row + 1, col] - 2.0 * grid[row + 1, col + 1] + grid[row + 1, col + 2]
                    derivatives[XXY] = max(derivatives[XXY], abs(above - second))
            if m < 2:
                second = c - 2.0 * grid[row + 1, col] + grid[row + 2, col]
                derivatives[YY], derivatives[YY + 1] = min(derivatives[YY], second), max(derivatives[YY + 1], second)
                if m == 0:
                    derivatives[YYY] = max(
                        derivatives[YYY], abs(grid[row + 3, col] - c + 3.0 * (grid[row + 1, col] - grid[row + 2, col]))
                    )
                if n < 3:
                    beside = grid[row, col + 1] - 2.0 * grid[row + 1, col + 1] + grid[row + 2, col + 1]
                    derivatives[XYY] = max(derivatives[XYY], abs(beside - second))
            if m < 3 and n < 3:
                twist = c - grid[row, col + 1] - grid[row + 1, col] + grid[row + 1, col + 1]
                derivatives[XY], derivatives[XY + 1] = min(derivatives[XY], twist), max(derivatives[XY + 1], twist)
    for k in range(2):
        derivatives[XX + k] /= dx * dx
        derivatives[XY + k] /= dx * dy
        derivatives[YY + k] /= dy * dy
    derivatives[XXX] /= dx * dx * dx
    derivatives[XXY] /= dx * dx * dy
    derivatives[XYY] /= dx * dy * dy
    derivatives[YYY] /= dy * dy * dy
    return math.isfinite(total)


@njit
def search_curved_cell(
    grid: Array, meta: Array, w: Array, i: int, j: int, x0: float, x1: float, y0: float, y1: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Find the local minima of the gap over a part of a cubic cell.

    Args:
        grid, meta: cubic terrain (ground.py).
        w: (WHEEL_SIZE,) wheel.
        i, j: column and row of the cell.
        x0, x1, y0, y1: m, the part from the hub.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count; -1 if the cell is missing.
    """
    derivatives, ends = w[DERIVATIVES : DERIVATIVES + DERIVATIVES_SIZE], ends_of(w)
    if not derivative_bounds(grid, i, j, meta[META_DX], meta[META_DY], derivatives):
        return -1
    half = w[HALF]
    if half > 0.0:
        count = _inside(grid, meta, w, i, j, derivatives, 1.0, x0, x1, y0, y1, lowest, keep, contacts, count)
        if not _upper_is_clear(grid, meta, w, -half if w[AZ] > 0.0 else half, i, j, max(lowest[GAP] - GAP_TIE, keep)):
            count = _inside(grid, meta, w, i, j, derivatives, -1.0, x0, x1, y0, y1, lowest, keep, contacts, count)
    across = 0.5 * (x0 + x1) * w[VX] + 0.5 * (y0 + y1) * w[VY]
    near = 0.5 * ((x1 - x0) * abs(w[VX]) + (y1 - y0) * abs(w[VY])) + w[RADIUS] * abs(w[AZ]) + CELL_MARGIN * (x1 - x0 + y1 - y0)
    for side in range(2 if half > 0.0 else 1):
        s = half if side == 0 else -half
        if abs(s * w[COS] - across) > near:
            continue
        for half_turn in range(2):
            sign = 1.0 if half_turn == 0 else -1.0
            if sign < 0.0 and _upper_is_clear(grid, meta, w, s, i, j, max(lowest[GAP], keep)):
                break
            n = rim_over_cell(w, s, x0, x1, y0, y1, sign, ends)
            for k in range(n):
                at = HALVES + 2 * k
                low = math.atan2(ends[at, 0], ends[at, 1])
                high = math.atan2(ends[at + 1, 0], ends[at + 1, 1])
                if high < low:
                    high += 2.0 * math.pi
                count = _arc(grid, meta, w, i, j, derivatives, s, low, high, lowest, keep, contacts, count)
    return count


@njit
def _upper_is_clear(grid: Array, meta: Array, w: Array, s: float, i: int, j: int, limit: float) -> bool:
    """Return True if a rim's upper half stays above a cell.

    No spline exceeds its largest coefficient.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        s: m, position of the rim along the axle.
        i, j: column and row of the cell.
        limit: m, the gap that it must have.
    """
    top = -math.inf
    for m in range(4):
        for n in range(4):
            top = max(top, grid[j + m, i + n])
    return w[HZ] + s * w[AZ] - top >= limit


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
        derivatives: (DERIVATIVES_SIZE,) bounds on the cell's derivatives (`derivative_bounds`).
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
def _arc(
    grid: Array, meta: Array, w: Array, i: int, j: int, derivatives: Array, s: float, low: float, high: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Find the local minima of a rim's height above the terrain on an arc in one cell.

    A piece of the arc is closed if its height is shown to be monotonic, to stay above what is sought, or to be convex. If
    bounds over the cell do not show it, those over the piece's rectangle are tried; else the piece is halved.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        i, j: column and row of the cell.
        derivatives: (DERIVATIVES_SIZE,) bounds on the cell's derivatives (`derivative_bounds`).
        s: m, position of the rim along the axle.
        low, high: rad, the arc's ends.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    a, b = low, high
    sa, ca = math.sin(a), math.cos(a)
    fa, ga, _, gx, gy = _along(grid, meta, w, sa, ca, s)
    while a < high:
        sb, cb = math.sin(b), math.cos(b)
        fb, gb, _, next_gx, next_gy = _along(grid, meta, w, sb, cb, s)
        length = b - a
        curvature = _least_curvature(w, derivatives, gx, gy, a, b, sa, ca, sb, cb)
        local = False
        while True:
            slack = 0.5 * max(-curvature, 0.0) * length
            down, up = ga - slack, gb + slack  # slopes of f made convex: its tangents at a and b bound it from below
            if local or curvature > 0.0 or down >= 0.0 or up <= 0.0 or length <= 1e-7:
                break
            if fa + down * (fb - fa - up * length) / (down - up) >= max(lowest[GAP] - GAP_TIE, keep):
                break
            local = True
            on_arc = _derivatives_on_arc(grid, meta, w, i, j, s, length, sa, ca, sb, cb)
            curvature = max(curvature, _least_curvature(w, on_arc, gx, gy, a, b, sa, ca, sb, cb))
        if down >= 0.0:
            count = keep_lower_contact(w, lowest, fa, sa, ca, s, keep, contacts, count)
        elif up <= 0.0:
            count = keep_lower_contact(w, lowest, fb, sb, cb, s, keep, contacts, count)
        elif fa + down * (fb - fa - up * length) / (down - up) < max(lowest[GAP] - GAP_TIE, keep):
            if curvature > 0.0:
                count = _convex_arc(grid, meta, w, s, a, b, ga, gb, lowest, keep, contacts, count)
            elif length > 1e-7:
                b = 0.5 * (a + b)
                continue
            else:
                count = keep_lower_contact(w, lowest, fa, sa, ca, s, keep, contacts, count)
                count = keep_lower_contact(w, lowest, fb, sb, cb, s, keep, contacts, count)
        a, sa, ca, fa, ga, gx, gy = b, sb, cb, fb, gb, next_gx, next_gy
        b = min(a + 2.0 * length, high)
    return count


@njit
def _derivatives_on_arc(
    grid: Array, meta: Array, w: Array, i: int, j: int, s: float, length: float, sa: float, ca: float, sb: float, cb: float
) -> Array:
    """Bound the spline's second derivatives over the part of a cell around an arc.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel; DERIVATIVES_OF_TREAD and PATCH are scratch.
        i, j: column and row of the cell.
        s: m, position of the rim along the axle.
        length: rad, the arc.
        sa, ca, sb, cb: sin φ and cos φ of its ends.

    Returns:
        (DERIVATIVES_SIZE,) lowest and highest second derivatives, 1/m, as `derivative_bounds` fills them.
    """
    derivatives, patch = w[DERIVATIVES_OF_TREAD : DERIVATIVES_OF_TREAD + DERIVATIVES_SIZE], w[PATCH : PATCH + BOUNDS_SIZE]
    dx, dy, r = meta[META_DX], meta[META_DY], w[RADIUS]
    bulge = 0.125 * r * length * length  # no point of the arc is farther from its chord
    x, y = w[HX] + s * w[AX] - i * dx, w[HY] + s * w[AY] - j * dy
    xa, xb = x + r * (sa * w[EX] - ca * w[UX]), x + r * (sb * w[EX] - cb * w[UX])
    ya, yb = y + r * (sa * w[EY] - ca * w[UY]), y + r * (sb * w[EY] - cb * w[UY])
    u0, v0 = min(max((min(xa, xb) - bulge) / dx, 0.0), 1.0 - THINNEST), min(max((min(ya, yb) - bulge) / dy, 0.0), 1.0 - THINNEST)
    u1, v1 = min(max((max(xa, xb) + bulge) / dx, u0 + THINNEST), 1.0), min(max((max(ya, yb) + bulge) / dy, v0 + THINNEST), 1.0)
    wide, tall = (u1 - u0) * dx, (v1 - v0) * dy
    bound_patch(grid, i, j, u0, u1, v0, v1, wide, tall, 0.0, 0.0, 0.0, patch)
    bound_differences(patch)
    for k in range(2):
        derivatives[XX + k] = -6.0 * patch[XX_HIGH - k] / (wide * wide)
        derivatives[XY + k] = -9.0 * patch[XY_HIGH - k] / (wide * tall)
        derivatives[YY + k] = -6.0 * patch[YY_HIGH - k] / (tall * tall)
    return derivatives


@njit
def _convex_arc(
    grid: Array, meta: Array, w: Array, s: float, a: float, b: float, ga: float, gb: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Find the minimum of a convex arc that falls at a and rises at b.

    Newton's method is used, with bisection.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        s: m, position of the rim along the axle.
        a, b: rad, the arc's ends.
        ga, gb: m/rad, its slopes there.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

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
    return keep_lower_contact(w, lowest, f, math.sin(t), math.cos(t), s, keep, contacts, count)


@njit
def _inside(
    grid: Array, meta: Array, w: Array, col: int, row: int, derivatives: Array, side: float,
    x0: float, x1: float, y0: float, y1: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Note the local minima of T - h inside the tread, over a part of a cubic cell.

    Over (u, v) the tread's lower (side 1) or upper half (side -1) stands at T = z_hub + v tan τ - side sqrt(r² - u²) / cos τ. A
    local minimum needs h_vv <= 0, and h_uu <= T_uu. The part is quartered until a quarter fails one of the necessary conditions
    (curvature, slope), lies under no tread, has a lower bound that is not below what is sought, or until T - h is proved convex
    over it: then Newton finds the one minimum. docs/bounds.md derives the bounds.

    Args:
        grid, meta: cubic terrain (ground.py).
        w: (WHEEL_SIZE,) wheel.
        col, row: the cell.
        derivatives: (DERIVATIVES_SIZE,) bounds on the cell's derivatives (`derivative_bounds`).
        side: 1 for the tread's lower half, -1 for its upper half.
        x0, x1, y0, y1: the part, m from the hub; it lies in one cell.
        lowest, keep, contacts, count: as `keep_lower_contact` takes them.

    Returns:
        count, with the minima kept.
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
        while level > 0 and i % 2 == 1 and j % 2 == 1:  # the last quarter: return to the part it belongs to
            level, i, j = level - 1, i // 2, j // 2
            rx, ry = 2.0 * rx, 2.0 * ry
        if level == 0:
            return count
        if i % 2 == 0:
            i += 1
        else:
            i, j = i - 1, j + 1


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
        lowest, keep, contacts, count: as `keep_lower_contact` takes them.

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
def bounded_step(
    x: float, y: float, rx: float, ry: float, fx: float, fy: float, fxx: float, fxy: float, fyy: float
) -> tuple[float, float, int]:
    """Return Newton's step to the minimum of a function that is convex on |x| <= rx, |y| <= ry.

    A coordinate at its bound stays there while the function falls outwards.

    Args:
        x, y: m, the point.
        rx, ry: m, the bounds.
        fx, fy, fxx, fxy, fyy: gradient and Hessian there.

    Returns:
        The step in x and y, not bounded, and how many coordinates are held at a bound; -1 if the Hessian is not positive.
    """
    hold_x = (x >= rx and fx <= 0.0) or (x <= -rx and fx >= 0.0)
    hold_y = (y >= ry and fy <= 0.0) or (y <= -ry and fy >= 0.0)
    det = fxx * fyy - fxy * fxy
    if not (det > 0.0 and fxx > 0.0):
        return 0.0, 0.0, -1
    if hold_x and hold_y:
        return 0.0, 0.0, 2
    if hold_x:
        return 0.0, -fy / fyy, 1
    if hold_y:
        return -fx / fxx, 0.0, 1
    return (fxy * fy - fyy * fx) / det, (fxy * fx - fxx * fy) / det, 0


@inlined
def _keep_lower_inside(
    w: Array, side: float, u: float, v: float, h: float, lowest: Array, keep: float, contacts: Array, count: int
) -> int:
    """Note the tread's point over (u, v), if there is one.

    Args:
        w: (WHEEL_SIZE,) wheel.
        side: 1 for the tread's lower half, -1 for its upper half.
        u, v: m from the hub along e1 and the axle's level direction.
        h: height of the terrain there, m.
        lowest, keep, contacts, count: as `keep_lower_contact` takes them.

    Returns:
        count, with the point if it was kept.
    """
    r = w[RADIUS]
    q = side * math.sqrt(r * r - u * u)
    s = (v - q * w[AZ]) / w[COS]
    if abs(s) <= w[HALF]:
        count = keep_lower_contact(w, lowest, w[HZ] + v * w[TAN] - q / w[COS] - h, u / r, q / r, s, keep, contacts, count)
    return count


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
