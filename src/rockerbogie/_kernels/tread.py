"""The least height of one wheel's tread over the ground, over the whole tread.

The tread is the rim of radius r swept along the axle a over ±b. With τ the axle's tilt, e1 the level direction in the
wheel's plane and e3 its upward one, a point of it is

    hub + s a + u e1 - q e3,   u = r sin φ,  q = r cos φ,  |s| ≤ b,

and over a level place (u along e1, v along the axle's level direction) its lower half stands at

    T(u, v) = z_hub + v tan τ - sqrt(r² - u²) / cos τ,

a convex function. The ground's cells under the tread are looked at one by one: a cell whose ground stays below a
tangent plane of T by more than the best gap so far cannot hold the contact; in the others the least of T - h is found
exactly: inside the cell, on its edges (where bilinear ground has its ridges), and on the tread's two rims.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .ground import META_CUBIC, META_DX, META_DY, META_NX, META_NY, on_map, surface
from .jit import inlined, njit

Array = NDArray[np.float64]

# A wheel as the tread sees it, in one flat array: hub, axle, level and upward directions, sizes.
HX, HY, HZ, AX, AY, AZ, EX, EY, UX, UY, UZ, COS, TAN, RADIUS, HALF, VX, VY, ZX, ZY, ZZ = range(20)
WHEEL_SIZE = 20

# What a search leaves behind: gap, φ, s.
GAP, PHI, PLACE = range(3)
FOUND_SIZE = 3
ROOM = 12  # touching points kept of one wheel

FLAT = 0.05  # cos τ below which a wheel lies on its side: no contact is sought


@njit
def make_wheel(
    wheel: Array, x: float, y: float, z: float, ax: float, ay: float, az: float, zx: float, zy: float, zz: float, radius: float, half: float
) -> bool:
    """Fill `wheel` (WHEEL_SIZE,) from its hub, its axle and the axle frame's z; false when it lies on its side."""
    level = math.sqrt(ax * ax + ay * ay)
    if not level > FLAT:
        return False
    wheel[HX], wheel[HY], wheel[HZ] = x, y, z
    wheel[AX], wheel[AY], wheel[AZ] = ax, ay, az
    vx, vy = ax / level, ay / level
    wheel[VX], wheel[VY] = vx, vy
    wheel[EX], wheel[EY] = vy, -vx
    wheel[UX], wheel[UY], wheel[UZ] = -az * vx, -az * vy, level
    wheel[COS], wheel[TAN] = level, az / level
    wheel[ZX], wheel[ZY], wheel[ZZ] = zx, zy, zz
    wheel[RADIUS], wheel[HALF] = radius, half
    return True


@inlined
def rim_point(w: Array, phi: float, s: float) -> tuple[float, float, float]:
    """Offset from the hub of the tread's point (φ, s)."""
    u, q = w[RADIUS] * math.sin(phi), w[RADIUS] * math.cos(phi)
    return s * w[AX] + u * w[EX] - q * w[UX], s * w[AY] + u * w[EY] - q * w[UY], s * w[AZ] - q * w[UZ]


@njit
def gap_at(grid: Array, meta: Array, w: Array, phi: float, s: float) -> float:
    """Height of the tread's point (φ, s) over the ground."""
    x, y, z = rim_point(w, phi, s)
    return w[HZ] + z - surface(grid, meta, w[HX] + x, w[HY] + y)[0]


@inlined
def note(best: Array, gap: float, phi: float, s: float, keep: float, found: Array, count: int) -> int:
    """Hold (φ, s) as the best if it is, and keep it if it is below `keep`. Returns how many are kept."""
    if gap < best[GAP] - 1e-13:  # not for a rounding error: a width that touches whole is reported at its middle
        best[GAP], best[PHI], best[PLACE] = gap, phi, s
    if gap <= keep and count < found.shape[0]:
        found[count, GAP], found[count, PHI], found[count, PLACE] = gap, phi, s
        count += 1
    return count


@njit
def _rim_slope_bilinear(w: Array, c: Array, phi: float, s: float) -> tuple[float, float, float]:
    """f, f', f'' along the rim at φ over the bilinear cell c0 + c1 X + c2 Y + c3 X Y (X, Y from the hub)."""
    r = w[RADIUS]
    sp, cp = math.sin(phi), math.cos(phi)
    x = s * w[AX] + r * (sp * w[EX] - cp * w[UX])
    y = s * w[AY] + r * (sp * w[EY] - cp * w[UY])
    z = w[HZ] + s * w[AZ] - r * cp * w[UZ]
    tx, ty, tz = r * (cp * w[EX] + sp * w[UX]), r * (cp * w[EY] + sp * w[UY]), r * sp * w[UZ]
    nx, ny, nz = r * (-sp * w[EX] + cp * w[UX]), r * (-sp * w[EY] + cp * w[UY]), r * cp * w[UZ]
    gx, gy = c[1] + c[3] * y, c[2] + c[3] * x
    f = z - c[0] - c[1] * x - c[2] * y - c[3] * x * y
    return f, tz - gx * tx - gy * ty, nz - gx * nx - gy * ny - 2.0 * c[3] * tx * ty


@njit
def _rim_slope_cubic(grid: Array, meta: Array, w: Array, phi: float, s: float) -> tuple[float, float, float]:
    """f, f', f'' along the rim at φ over cubic ground."""
    r = w[RADIUS]
    sp, cp = math.sin(phi), math.cos(phi)
    x = s * w[AX] + r * (sp * w[EX] - cp * w[UX])
    y = s * w[AY] + r * (sp * w[EY] - cp * w[UY])
    z = w[HZ] + s * w[AZ] - r * cp * w[UZ]
    tx, ty, tz = r * (cp * w[EX] + sp * w[UX]), r * (cp * w[EY] + sp * w[UY]), r * sp * w[UZ]
    nx, ny, nz = r * (-sp * w[EX] + cp * w[UX]), r * (-sp * w[EY] + cp * w[UY]), r * cp * w[UZ]
    h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + x, w[HY] + y)
    return (
        z - h,
        tz - gx * tx - gy * ty,
        nz - gx * nx - gy * ny - hxx * tx * tx - 2.0 * hxy * tx * ty - hyy * ty * ty,
    )


@inlined
def _slope(grid: Array, meta: Array, w: Array, c: Array, phi: float, s: float) -> tuple[float, float, float]:
    if meta[META_CUBIC] == 0.0:
        return _rim_slope_bilinear(w, c, phi, s)
    return _rim_slope_cubic(grid, meta, w, phi, s)


@njit
def _least_on_arc(
    grid: Array, meta: Array, w: Array, c: Array, s: float, low: float, high: float, pieces: int,
    best: Array, keep: float, found: Array, count: int,
) -> int:  # fmt: skip
    """Every local minimum of the rim's height over the ground on low ≤ φ ≤ high, which lies in one cell."""
    a = low
    fa, ga, _ = _slope(grid, meta, w, c, a, s)
    if ga >= 0.0:
        count = note(best, fa, a, s, keep, found, count)
    for k in range(pieces):
        b = low + (high - low) * (k + 1) / pieces if k + 1 < pieces else high
        fb, gb, _ = _slope(grid, meta, w, c, b, s)
        if ga < 0.0 and gb >= 0.0:  # nought at b too: the next piece would not see a fall
            left, right = a, b
            t = a - ga * (b - a) / (gb - ga)
            for _ in range(60):
                f, g, h = _slope(grid, meta, w, c, t, s)
                if g < 0.0:
                    left = t
                else:
                    right = t
                step = -g / h if h > 0.0 else math.nan
                new = t + step
                if not (left <= new <= right):
                    new = 0.5 * (left + right)
                if abs(new - t) < 1e-9 or right - left < 1e-14:
                    # the slope is nought here to first order: one more step is below rounding
                    f, g, h = _slope(grid, meta, w, c, new, s)
                    t = new
                    break
                t = new
            count = note(best, f, t, s, keep, found, count)
        a, fa, ga = b, fb, gb
    if ga <= 0.0:
        count = note(best, fa, a, s, keep, found, count)
    return count


@inlined
def _wrap(phi: float) -> float:
    if phi > math.pi:
        return phi - 2.0 * math.pi
    if phi < -math.pi:
        return phi + 2.0 * math.pi
    return phi


@njit
def _rim_in_cell(
    grid: Array, meta: Array, w: Array, c: Array, s: float, x0: float, x1: float, y0: float, y1: float, top: float,
    pieces: int, cuts: Array, best: Array, keep: float, found: Array, count: int,
) -> int:  # fmt: skip
    """Local minima of the rim at s inside the cell x0..x1, y0..y1 (offsets from the hub)."""
    r = w[RADIUS]
    n = 0
    for axis in range(2):
        a = w[EX] if axis == 0 else w[EY]
        b = -w[UX] if axis == 0 else -w[UY]
        shift = s * (w[AX] if axis == 0 else w[AY])
        reach = math.sqrt(a * a + b * b)
        if reach < 1e-12:
            continue
        middle = math.atan2(a, b)
        for end in range(2):
            line = (x0 if end == 0 else x1) if axis == 0 else (y0 if end == 0 else y1)
            cosine = (line - shift) / (r * reach)
            if abs(cosine) < 1.0:
                spread = math.acos(cosine)
                cuts[n], cuts[n + 1] = _wrap(middle - spread), _wrap(middle + spread)
                n += 2
    half_pi = 0.5 * math.pi
    cuts[n], cuts[n + 1] = -half_pi, half_pi
    n += 2
    for i in range(1, n):
        value = cuts[i]
        j = i - 1
        while j >= 0 and cuts[j] > value:
            cuts[j + 1] = cuts[j]
            j -= 1
        cuts[j + 1] = value
    upper = w[HZ] - w[HALF] * abs(w[AZ]) - top < max(best[GAP], keep)  # could the rim's upper half reach this ground?
    for i in range(n):
        low = cuts[i]
        high = cuts[i + 1] if i + 1 < n else cuts[0] + 2.0 * math.pi
        if high - low < 1e-15:
            continue
        mid = 0.5 * (low + high)
        lower = -half_pi < mid < half_pi
        if not (lower or upper):
            continue
        x, y, _ = rim_point(w, mid, s)
        if x0 <= x <= x1 and y0 <= y <= y1:
            count = _least_on_arc(grid, meta, w, c, s, low, high, pieces if lower else 4, best, keep, found, count)
    return count


@njit
def _edge_in_cell(
    w: Array, x: float, y: float, ex: float, ey: float, length: float, h0: float, rise: float,
    best: Array, keep: float, found: Array, count: int,
) -> int:  # fmt: skip
    """Least of T - h on a straight ground edge from (x, y) along (ex, ey), its height h0 + rise t, inside the tread."""
    r = w[RADIUS]
    u0, v0 = x * w[EX] + y * w[EY], x * w[VX] + y * w[VY]
    du, dv = ex * w[EX] + ey * w[EY], ex * w[VX] + ey * w[VY]
    if abs(du) > 1e-12:
        m = (rise - dv * w[TAN]) * w[COS] / du  # u / q where T runs along the edge as the ground does
        t = (r * m / math.sqrt(1.0 + m * m) - u0) / du
    else:
        t = length if rise > dv * w[TAN] else 0.0
    t = min(max(t, 0.0), length)
    u, v = u0 + t * du, v0 + t * dv
    if abs(u) < r:
        q = math.sqrt(r * r - u * u)
        s = (v + q * w[UX] * w[VX] + q * w[UY] * w[VY]) / w[COS]
        if abs(s) <= w[HALF]:
            gap = w[HZ] + v * w[TAN] - q / w[COS] - h0 - rise * t
            count = note(best, gap, math.atan2(u, q), s, keep, found, count)
    return count


@njit
def _inside_bilinear(
    w: Array, c: Array, x0: float, x1: float, y0: float, y1: float, best: Array, keep: float, found: Array, count: int
) -> int:
    """Least of T - h inside a twisted bilinear cell: along the axle the ground must be hollow from above, h_vv < 0."""
    hvv = 2.0 * c[3] * w[VX] * w[VY]
    if not hvv < -1e-9:
        return count
    r = w[RADIUS]
    v0 = (w[TAN] - c[1] * w[VX] - c[2] * w[VY]) / hvv  # h_v = tan τ on the line v = v0 + v1 u
    v1 = -c[3] * (w[EX] * w[VY] + w[EY] * w[VX]) / hvv
    px, mx = w[EX] + v1 * w[VX], v0 * w[VX]
    py, my = w[EY] + v1 * w[VY], v0 * w[VY]
    low, high = -r, r  # where that line crosses the cell
    for axis in range(2):
        p, m = (px, mx) if axis == 0 else (py, my)
        e0, e1 = (x0, x1) if axis == 0 else (y0, y1)
        if abs(p) < 1e-12:
            if m < e0 or m > e1:
                return count
        else:
            ta, tb = (e0 - m) / p, (e1 - m) / p
            low, high = max(low, min(ta, tb)), min(high, max(ta, tb))
    if low >= high:
        return count
    k1 = v1 * w[TAN] - c[1] * px - c[2] * py - c[3] * (px * my + py * mx)
    k2 = -c[3] * px * py
    pieces = 1 if k2 * r > -0.25 else 4
    edge = 0.9999999
    a = math.asin(max(low / r, -edge))
    end = math.asin(min(high / r, edge))
    start, whole = a, end - a
    ga = math.tan(a) / w[COS] + k1 + 2.0 * k2 * r * math.sin(a)
    for k in range(pieces):
        b = start + whole * (k + 1) / pieces
        gb = math.tan(b) / w[COS] + k1 + 2.0 * k2 * r * math.sin(b)
        if ga < 0.0 <= gb:
            left, right = a, b
            t = 0.5 * (a + b)
            for _ in range(60):
                cosine = math.cos(t)
                g = math.tan(t) / w[COS] + k1 + 2.0 * k2 * r * math.sin(t)
                h = 1.0 / (w[COS] * cosine * cosine) + 2.0 * k2 * r * cosine
                if g < 0.0:
                    left = t
                else:
                    right = t
                new = t - g / h if h > 0.0 else math.nan
                if not (left <= new <= right):
                    new = 0.5 * (left + right)
                done = abs(new - t) < 1e-12 or right - left < 1e-14
                t = new
                if done:
                    break
            u, q = r * math.sin(t), r * math.cos(t)
            v = v0 + v1 * u
            s = (v - q * w[AZ]) / w[COS]
            if abs(s) <= w[HALF]:
                x, y = px * u + mx, py * u + my
                gap = w[HZ] + v * w[TAN] - q / w[COS] - c[0] - c[1] * x - c[2] * y - c[3] * x * y
                count = note(best, gap, t, s, keep, found, count)
        a, ga = b, gb
    return count


@njit
def _inside_cubic(
    grid: Array, meta: Array, w: Array, x0: float, x1: float, y0: float, y1: float,
    best: Array, keep: float, found: Array, count: int,
) -> int:  # fmt: skip
    """Least of the tread over cubic ground inside a cell: Newton in (φ, s) from the best of nine places."""
    r, half = w[RADIUS], w[HALF]
    low = math.inf
    phi = s = 0.0
    for i in range(3):
        for j in range(3):
            x, y = x0 + (x1 - x0) * 0.5 * i, y0 + (y1 - y0) * 0.5 * j
            u = min(max(x * w[EX] + y * w[EY], -0.99 * r), 0.99 * r)
            q = math.sqrt(r * r - u * u)
            place = min(max((x * w[VX] + y * w[VY] - q * w[AZ]) / w[COS], -half), half)
            angle = math.atan2(u, q)
            f = gap_at(grid, meta, w, angle, place)
            if f < low:
                low, phi, s = f, angle, place
    margin_x, margin_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    for _ in range(30):
        sp, cp = math.sin(phi), math.cos(phi)
        x = s * w[AX] + r * (sp * w[EX] - cp * w[UX])
        y = s * w[AY] + r * (sp * w[EY] - cp * w[UY])
        if not (x0 - margin_x <= x <= x1 + margin_x and y0 - margin_y <= y <= y1 + margin_y and abs(s) <= half):
            return count  # it leads out of the cell or over the rim: sought there
        tx, ty, tz = r * (cp * w[EX] + sp * w[UX]), r * (cp * w[EY] + sp * w[UY]), r * sp * w[UZ]
        nx, ny, nz = r * (-sp * w[EX] + cp * w[UX]), r * (-sp * w[EY] + cp * w[UY]), r * cp * w[UZ]
        h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + x, w[HY] + y)
        f = w[HZ] + s * w[AZ] - r * cp * w[UZ] - h
        g1 = tz - gx * tx - gy * ty
        g2 = w[AZ] - gx * w[AX] - gy * w[AY]
        a11 = nz - gx * nx - gy * ny - hxx * tx * tx - 2.0 * hxy * tx * ty - hyy * ty * ty
        a12 = -hxx * tx * w[AX] - hxy * (tx * w[AY] + ty * w[AX]) - hyy * ty * w[AY]
        a22 = -hxx * w[AX] * w[AX] - 2.0 * hxy * w[AX] * w[AY] - hyy * w[AY] * w[AY]
        det = a11 * a22 - a12 * a12
        if not (a11 > 0.0 and det > 1e-12 * a11 * a11):
            return count  # not hollow in both directions: the least is on a rim
        d1, d2 = (a12 * g2 - a22 * g1) / det, (a12 * g1 - a11 * g2) / det
        limit = max(abs(d1) * r, abs(d2)) / (0.5 * max(x1 - x0, y1 - y0))
        if limit > 1.0:
            d1, d2 = d1 / limit, d2 / limit
        phi += d1
        s += d2
        if abs(d1) * r + abs(d2) < 1e-10:
            return note(best, f, phi, s, keep, found, count)
    return count


@njit
def _cell_bezier_excess(grid: Array, i: int, j: int, x0: float, y0: float, dx: float, dy: float, l0: float, lx: float, ly: float) -> float:
    """Greatest Bézier ordinate of (cubic cell - plane l0 + lx x + ly y): no point of the cell stands higher over the plane."""
    highest = -math.inf
    total = 0.0
    rows = np.empty((4, 4))
    for m in range(4):
        c0, c1, c2, c3 = grid[j + m, i], grid[j + m, i + 1], grid[j + m, i + 2], grid[j + m, i + 3]
        total += c0 + c1 + c2 + c3
        rows[m, 0] = (c0 + 4.0 * c1 + c2) / 6.0
        rows[m, 1] = (2.0 * c1 + c2) / 3.0
        rows[m, 2] = (c1 + 2.0 * c2) / 3.0
        rows[m, 3] = (c1 + 4.0 * c2 + c3) / 6.0
    for k in range(4):
        r0, r1, r2, r3 = rows[0, k], rows[1, k], rows[2, k], rows[3, k]
        x = l0 + lx * (x0 + dx * k / 3.0) + ly * y0
        e = max(
            max((r0 + 4.0 * r1 + r2) / 6.0 - x, (2.0 * r1 + r2) / 3.0 - x - ly * dy / 3.0),
            max((r1 + 2.0 * r2) / 3.0 - x - ly * dy * 2.0 / 3.0, (r1 + 4.0 * r2 + r3) / 6.0 - x - ly * dy),
        )
        highest = max(highest, e)
    return highest + 0.0 * total  # nan if any coefficient is


FOUND, OFF, BLANK = 0, 1, 2


@njit
def least_gap(
    grid: Array, meta: Array, w: Array, phi: float, s: float, keep: float, best: Array, found: Array, cuts: Array
) -> tuple[int, int]:
    """Search the whole tread of wheel `w`. (φ, s) is a first guess; it only saves time.

    Fills `best` (gap, φ, s) and `found` with the local minima of gap ≤ keep. Returns FOUND, OFF (the map ends under
    the tread) or BLANK (unknown ground under it), and how many were kept.
    """
    r, half = w[RADIUS], w[HALF]
    dx, dy = meta[META_DX], meta[META_DY]
    cubic = meta[META_CUBIC] != 0.0
    out_x = half * abs(w[AX]) + r * math.sqrt(w[EX] * w[EX] + w[UX] * w[UX])
    out_y = half * abs(w[AY]) + r * math.sqrt(w[EY] * w[EY] + w[UY] * w[UY])
    if not (on_map(meta, w[HX] - out_x, w[HY] - out_y) and on_map(meta, w[HX] + out_x, w[HY] + out_y)):
        return OFF, 0
    count = 0
    best[GAP], best[PHI], best[PLACE] = gap_at(grid, meta, w, phi, s), phi, s
    i0, i1 = int(math.floor((w[HX] - out_x) / dx)), int(math.floor((w[HX] + out_x) / dx))
    j0, j1 = int(math.floor((w[HY] - out_y) / dy)), int(math.floor((w[HY] + out_y) / dy))
    i1, j1 = min(i1, int(meta[META_NX]) - 2), min(j1, int(meta[META_NY]) - 2)
    wide = half * w[COS] + r * abs(w[AZ])  # the tread's level half width
    near_u = 0.5 * (dx * abs(w[EX]) + dy * abs(w[EY]))
    near_v = 0.5 * (dx * abs(w[VX]) + dy * abs(w[VY]))
    c = np.empty(4)
    for j in range(j0, j1 + 1):
        y0 = j * dy - w[HY]
        for i in range(i0, i1 + 1):
            x0 = i * dx - w[HX]
            xm, ym = x0 + 0.5 * dx, y0 + 0.5 * dy
            um, vm = xm * w[EX] + ym * w[EY], xm * w[VX] + ym * w[VY]
            if abs(um) > r + near_u or abs(vm) > wide + near_v:
                continue
            # the tangent plane of T over the cell's middle: l0 + lx x + ly y
            ut = min(max(um, -0.98 * r), 0.98 * r)
            q = math.sqrt(r * r - ut * ut)
            lu = ut / (q * w[COS])
            l0 = w[HZ] - q / w[COS] - lu * ut
            lx, ly = lu * w[EX] + w[TAN] * w[VX], lu * w[EY] + w[TAN] * w[VY]
            limit = max(best[GAP], keep)
            if cubic:
                excess = _cell_bezier_excess(grid, i, j, x0, y0, dx, dy, l0, lx, ly)
                if -excess >= limit:
                    continue
                if math.isnan(excess):
                    return BLANK, 0
                top = math.inf
                pieces = 2
            else:
                a, b, d, e = grid[j, i], grid[j, i + 1], grid[j + 1, i], grid[j + 1, i + 1]
                p = l0 + lx * x0 + ly * y0
                excess = max(max(a - p, b - p - lx * dx), max(d - p - ly * dy, e - p - lx * dx - ly * dy))
                if math.isnan(a + b + d + e):
                    return BLANK, 0
                if -excess >= limit:
                    continue
                top = max(max(a, b), max(d, e))
                sx, sy, twist = (b - a) / dx, (d - a) / dy, (a - b - d + e) / (dx * dy)
                c[3] = twist
                c[1], c[2] = sx - twist * y0, sy - twist * x0
                c[0] = a - sx * x0 - sy * y0 + twist * x0 * y0
                pieces = 1 if abs(twist) * r < 0.5 else 4
            x1, y1 = x0 + dx, y0 + dy
            if half > 0.0:
                # the middle first: where the whole width touches, the contact is reported there
                count = _rim_in_cell(grid, meta, w, c, 0.0, x0, x1, y0, y1, top, pieces, cuts, best, keep, found, count)
                if cubic:
                    count = _inside_cubic(grid, meta, w, x0, x1, y0, y1, best, keep, found, count)
                else:
                    count = _edge_in_cell(w, x0, y0, 1.0, 0.0, dx, a, sx, best, keep, found, count)
                    count = _edge_in_cell(w, x0, y0, 0.0, 1.0, dy, a, sy, best, keep, found, count)
                    count = _edge_in_cell(w, x0, y1, 1.0, 0.0, dx, d, (e - d) / dx, best, keep, found, count)
                    count = _edge_in_cell(w, x1, y0, 0.0, 1.0, dy, b, (e - b) / dy, best, keep, found, count)
                    count = _inside_bilinear(w, c, x0, x1, y0, y1, best, keep, found, count)
                count = _rim_in_cell(grid, meta, w, c, half, x0, x1, y0, y1, top, pieces, cuts, best, keep, found, count)
            count = _rim_in_cell(grid, meta, w, c, -half, x0, x1, y0, y1, top, pieces, cuts, best, keep, found, count)
    if math.isnan(best[GAP]):
        return BLANK, 0
    return FOUND, count


@njit
def contact_slope(grid: Array, meta: Array, w: Array, phi: float, s: float) -> tuple[float, float]:
    """(gx, gy) with (-gx, -gy, 1) normal to the contact at (φ, s): the gap's slope under small motions of the wheel.

    Inside the tread that is the tread's own normal; on a rim it is the ground's, and on a ridge of the ground the one
    between its two sides' that is square to the rim.
    """
    if abs(s) < w[HALF] and math.cos(phi) > 1e-6:
        sp, cp = math.sin(phi), math.cos(phi)
        nx, ny, nz = -sp * w[EX] + cp * w[UX], -sp * w[EY] + cp * w[UY], cp * w[UZ]
        return -nx / nz, -ny / nz
    step = 1e-8
    x, y, _ = rim_point(w, phi - step, s)
    _, ax, ay, _, _, _ = surface(grid, meta, w[HX] + x, w[HY] + y)
    x, y, _ = rim_point(w, phi + step, s)
    _, bx, by, _, _, _ = surface(grid, meta, w[HX] + x, w[HY] + y)
    sp, cp = math.sin(phi), math.cos(phi)
    tx, ty, tz = cp * w[EX] + sp * w[UX], cp * w[EY] + sp * w[UY], sp * w[UZ]
    ga, gb = tz - ax * tx - ay * ty, tz - bx * tx - by * ty
    part = ga / (ga - gb) if abs(ga - gb) > 1e-6 else 0.5
    part = min(max(part, 0.0), 1.0)
    return ax + part * (bx - ax), ay + part * (by - ay)


@njit
def contact_angle(w: Array, phi: float, s: float) -> float:
    """The paper's δ (eq. 5) of the tread's point (φ, s): from straight below the axle in the link, nose-down positive."""
    px, py, pz = rim_point(w, phi, s)
    px, py, pz = px - s * w[AX], py - s * w[AY], pz - s * w[AZ]
    # the axle frame's z, and x = y × z
    zx, zy, zz = w[ZX], w[ZY], w[ZZ]
    xx, xy, xz = w[AY] * zz - w[AZ] * zy, w[AZ] * zx - w[AX] * zz, w[AX] * zy - w[AY] * zx
    return math.atan2(-(px * xx + py * xy + pz * xz), -(px * zx + py * zy + pz * zz))


@njit
def patches(grid: Array, meta: Array, w: Array, found: Array, count: int, keep: float) -> int:
    """How many separate places of the tread touch: two are one when the tread between them touches too."""
    n = 0
    for i in range(count):
        fresh = True
        for j in range(i):
            a, b = found[i, PHI] - found[j, PHI], found[i, PLACE] - found[j, PLACE]
            close = abs(a) * w[RADIUS] + abs(b) < 1e-4 * w[RADIUS]
            if close or gap_at(grid, meta, w, found[i, PHI] - 0.5 * a, found[i, PLACE] - 0.5 * b) <= keep:
                fresh = False
        n += fresh
    return n
