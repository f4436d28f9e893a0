"""The minimum of the gap of a tread over one bilinear cell.

In a cell the terrain is h = c0 + c1 X + c2 Y + c3 X Y, X and Y from the hub. A minimum lies inside the cell, where a
twisted one is concave along the axle; on its edges, where bilinear terrain has its ridges; or on one of the tread's
rims.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import force_inlined, inlined, njit
from ..model.tolerances import CELL_MARGIN, GAP_TIE
from ..model.wheel import (
    AX,
    AY,
    AZ,
    CELL,
    COS,
    DERIVATIVES,
    ENDS,
    EX,
    EY,
    GAP,
    HALF,
    HZ,
    PLACE,
    PLANE,
    RADIUS,
    TAN,
    UX,
    UY,
    UZ,
    VX,
    VY,
    keep_lower_contact,
    tread_point,
)

Array = NDArray[np.float64]


@njit
def search_flat_cell(
    w: Array, a: float, b: float, d: float, e: float, x0: float, y0: float, dx: float, dy: float,
    far_x: float, far_y: float, follow: bool,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Find the local minima of the gap over a bilinear cell.

    PLANE must hold a plane that is nowhere above the tread.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL is filled.
        a, b, d, e: m, heights at the cell's corners: low and high x at low y, low and high x at high y.
        x0, y0: m, its low corner from the hub.
        dx, dy: m, its sizes.
        far_x, far_y: m, reach of the wheel from its hub.
        follow: True to search only the rim of the tracked contact, or the tread's inside.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    sx, sy, twist = (b - a) / dx, (d - a) / dy, (a - b - d + e) / (dx * dy)
    w[CELL + 3] = twist
    w[CELL + 1], w[CELL + 2] = sx - twist * y0, sy - twist * x0
    w[CELL] = a - sx * x0 - sy * y0 + twist * x0 * y0
    x1, y1 = x0 + dx, y0 + dy
    top = max(max(a, b), max(d, e))
    half = w[HALF]
    one_rim = half == 0.0 or (follow and abs(lowest[PLACE]) == half)
    if not one_rim:
        low = w[PLANE] + w[PLANE + 1] * x0 + w[PLANE + 2] * y0
        pa, pb, pd = low - a, low + w[PLANE + 1] * dx - b, low + w[PLANE + 2] * dy - d
        pe = low + w[PLANE + 1] * dx + w[PLANE + 2] * dy - e
        limit = max(lowest[GAP] - GAP_TIE, keep)
        if min(pa, pb) < limit and abs(y0) <= far_y:
            count = _edge(w, x0, y0, 1.0, 0.0, dx, a, sx, lowest, keep, contacts, count)
        if min(pa, pd) < limit and abs(x0) <= far_x:
            count = _edge(w, x0, y0, 0.0, 1.0, dy, a, sy, lowest, keep, contacts, count)
        if min(pd, pe) < limit and abs(y1) <= far_y:
            count = _edge(w, x0, y1, 1.0, 0.0, dx, d, (e - d) / dx, lowest, keep, contacts, count)
        if min(pb, pe) < limit and abs(x1) <= far_x:
            count = _edge(w, x1, y0, 0.0, 1.0, dy, b, (e - b) / dy, lowest, keep, contacts, count)
        count = _inside(w, x0, x1, y0, y1, lowest, keep, contacts, count)
        if follow:
            return count
        if w[HZ] - half * abs(w[AZ]) - top < max(lowest[GAP], keep):
            # terrain as high as the axle: the minimum may be on the tread's upper side, over a corner
            count = _inside_tread(w, -1.0, x0, y0, a, lowest, keep, contacts, count)
            count = _inside_tread(w, -1.0, x1, y0, b, lowest, keep, contacts, count)
            count = _inside_tread(w, -1.0, x0, y1, d, lowest, keep, contacts, count)
            count = _inside_tread(w, -1.0, x1, y1, e, lowest, keep, contacts, count)
    # a rim matters where it passes over the cell
    middle = (x0 + 0.5 * dx) * w[VX] + (y0 + 0.5 * dy) * w[VY]
    near = 0.5 * (dx * abs(w[VX]) + dy * abs(w[VY])) + w[RADIUS] * abs(w[AZ]) + CELL_MARGIN * (dx + dy)
    for side in range(1 if one_rim else 2):
        s = lowest[PLACE] if one_rim else (half if side == 0 else -half)
        if abs(s * w[COS] - middle) <= near:
            count = _rim(w, s, x0, x1, y0, y1, top, lowest, keep, contacts, count)
    return count


@njit
def rim_over_cell(
    w: Array, s: float, x0: float, x1: float, y0: float, y1: float, sign: float, ends: Array
) -> int:  # fmt: skip
    """Find the pieces of half a rim over a cell.

    Args:
        w: (WHEEL_SIZE,) wheel.
        s: m, position of the rim along the axle.
        x0, x1, y0, y1: m, the cell from the hub.
        sign: 1 for the rim's lower half, -1 for its upper half.
        ends: (HALVES + 2 n, 2) filled from row HALVES on with both ends (sin φ, cos φ) of each piece, φ growing.

    Returns:
        Number of pieces.
    """
    r = w[RADIUS]
    n = 1
    ends[0, 0], ends[0, 1] = -sign, 0.0
    for axis in range(2):
        a, k, shift = (w[EX], -w[UX], s * w[AX]) if axis == 0 else (w[EY], -w[UY], s * w[AY])
        reach = a * a + k * k
        for end in range(2):
            line = ((x0 if end == 0 else x1) if axis == 0 else (y0 if end == 0 else y1)) - shift
            line /= r  # a sin φ + k cos φ = line
            rest = reach - line * line
            if rest > 0.0:
                root = math.sqrt(rest)
                for branch in range(2):
                    cosine = (k * line + root * (a if branch == 0 else -a)) / reach
                    if cosine * sign > 0.0:
                        sine = (a * line - root * (k if branch == 0 else -k)) / reach
                        j = n
                        while j > 1 and (ends[j - 1, 0] - sine) * sign > 0.0:
                            ends[j, 0], ends[j, 1] = ends[j - 1, 0], ends[j - 1, 1]
                            j -= 1
                        ends[j, 0], ends[j, 1] = sine, cosine
                        n += 1
    ends[n, 0], ends[n, 1] = sign, 0.0
    # keep the pieces whose middle lies in the cell; a rim right on a grid line lies in both its cells, not in neither
    slack = CELL_MARGIN * (x1 - x0 + y1 - y0)
    pieces = 0
    ls, lc = ends[0, 0], ends[0, 1]
    for i in range(n):
        rs, rc = ends[i + 1, 0], ends[i + 1, 1]
        ms, mc = middle(ls, lc, rs, rc, sign)
        x, y, _ = tread_point(w, ms, mc, s)
        if x0 - slack <= x <= x1 + slack and y0 - slack <= y <= y1 + slack:
            at = HALVES + 2 * pieces
            ends[at, 0], ends[at, 1], ends[at + 1, 0], ends[at + 1, 1] = ls, lc, rs, rc
            pieces += 1
        ls, lc = rs, rc
    return pieces


HALVES = 10  # crossings of one half of a rim with four lines, and its two ends


@inlined
def ends_of(w: Array) -> Array:
    """Return the wheel's memory for `rim_over_cell`.

    It has room for HALVES crossings and for both ends of HALVES - 1 pieces.

    Args:
        w: (WHEEL_SIZE,) wheel.
    """
    return w[ENDS:DERIVATIVES].reshape(HALVES + 2 * (HALVES - 1), 2)


@njit
def middle(ls: float, lc: float, rs: float, rc: float, sign: float) -> tuple[float, float]:
    """Return the unit vector half way between two, which are at most half a turn apart.

    Args:
        ls, lc: sin φ, cos φ of the first.
        rs, rc: of the second.
        sign: cosine to return if they are opposite.
    """
    s, c = ls + rs, lc + rc
    size = math.sqrt(s * s + c * c)
    if size < 1e-9:
        return 0.0, sign
    return s / size, c / size


@force_inlined
def _rim(
    w: Array, s: float, x0: float, x1: float, y0: float, y1: float, top: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Find the local minima of a rim over a cell.

    Over u the rim's height above the terrain is convex where (e3 z) - grad h · (e3 xy) exceeds the largest effect of
    the twist. Its lower half then has one minimum over the cell's surface, and the part outside the cell is lowest
    where the rim crosses the cell's sides. Elsewhere a piece may have two minima: it is bounded and halved (`_arc`).

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the terrain.
        s: m, position of the rim along the axle.
        x0, x1, y0, y1: m, the cell from the hub.
        top: m, its highest corner.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    gx, gy = w[CELL + 1] + w[CELL + 3] * s * w[AY], w[CELL + 2] + w[CELL + 3] * s * w[AX]
    lean = abs(w[AZ])
    convex = w[UZ] - gx * w[UX] - gy * w[UY] > w[RADIUS] * (
        max(2.0 * w[CELL + 3] * w[EX] * w[EY], 0.0) + abs(w[CELL + 3]) * lean * (3.0 + lean)
    )
    if convex:
        kept = _convex_rim(w, s, x0, x1, y0, y1, lowest, keep, contacts, count)
        convex = kept >= 0
        count = max(count, kept)
    ends = ends_of(w)
    for half_turn in range(2):
        sign = 1.0 if half_turn == 0 else -1.0
        if convex and sign > 0.0:
            continue
        if sign < 0.0 and w[HZ] + s * w[AZ] - top >= max(lowest[GAP], keep):
            break  # the rim's upper half stays above this ground
        n = rim_over_cell(w, s, x0, x1, y0, y1, sign, ends)
        for i in range(n):
            at = HALVES + 2 * i
            low, high = math.atan2(ends[at, 0], ends[at, 1]), math.atan2(ends[at + 1, 0], ends[at + 1, 1])
            count = _arc(w, s, low, high if high >= low else high + 2.0 * math.pi, lowest, keep, contacts, count)
    return count


@force_inlined
def _convex_rim(
    w: Array, s: float, x0: float, x1: float, y0: float, y1: float, lowest: Array, keep: float, contacts: Array, count: int
) -> int:
    """Find the local minima of a rim's lower half over a cell where it is convex.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the terrain.
        s: m, position of the rim along the axle.
        x0, x1, y0, y1: m, the cell from the hub.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count; -1 if Newton's method does not converge.
    """
    r = w[RADIUS]
    # the minimum over the cell's surface continued: exact without twist, else the start of Newton's method
    x, y = s * w[AX], s * w[AY]
    gx, gy = w[CELL + 1] + w[CELL + 3] * y, w[CELL + 2] + w[CELL + 3] * x
    rise, level = gx * w[EX] + gy * w[EY], w[UZ] - gx * w[UX] - gy * w[UY]
    size = math.sqrt(rise * rise + level * level)
    sine, cosine = rise / size, abs(level) / size
    least = math.nan
    for _ in range(30):
        f, g, h = _along(w, s, sine, cosine)
        step = -g / h if h > 0.0 else math.copysign(0.5, -g)
        step = min(max(step, -0.5), 0.5)
        size = math.sqrt(1.0 + step * step)
        sine, cosine = (sine + cosine * step) / size, (cosine - sine * step) / size
        if abs(step) < 1e-5:  # what it leaves of the gap is its cube
            least = f + 0.5 * g * step
            break
        if cosine < 0.0:
            sine, cosine = math.copysign(1.0, sine), 0.0
    if math.isnan(least):
        return -1
    if least >= max(lowest[GAP] + GAP_TIE, keep):
        return count
    slack = CELL_MARGIN * (x1 - x0 + y1 - y0)
    x, y, _ = tread_point(w, sine, cosine, s)
    if x0 - slack <= x <= x1 + slack and y0 - slack <= y <= y1 + slack:
        return keep_lower_contact(w, lowest, least, sine, cosine, s, keep, contacts, count)
    # where it crosses the cell's sides, and does not fall further on the way in
    for axis in range(2):
        a, k, shift = (w[EX], -w[UX], s * w[AX]) if axis == 0 else (w[EY], -w[UY], s * w[AY])
        reach = a * a + k * k
        low, high = (y0, y1) if axis == 0 else (x0, x1)
        for end in range(2):
            line = (((x0 if end == 0 else x1) if axis == 0 else (y0 if end == 0 else y1)) - shift) / r
            rest = reach - line * line  # a sin φ + k cos φ = line
            if rest <= 0.0:
                continue
            root = math.sqrt(rest)
            for branch in range(2):
                cosine = (k * line + root * (a if branch == 0 else -a)) / reach
                sine = (a * line - root * (k if branch == 0 else -k)) / reach
                if cosine < 0.0:
                    continue
                x, y, _ = tread_point(w, sine, cosine, s)
                across = y if axis == 0 else x
                if low - slack <= across <= high + slack:
                    f, g, _ = _along(w, s, sine, cosine)
                    ahead = a * cosine - k * sine  # how the place across the side changes with φ
                    if (g if (ahead > 0.0) == (end == 0) else -g) >= 0.0:
                        count = keep_lower_contact(w, lowest, f, sine, cosine, s, keep, contacts, count)
    return count


@force_inlined
def _along(w: Array, s: float, sine: float, cosine: float) -> tuple[float, float, float]:
    """Return the rim's height above the cell's terrain and its first two derivatives by φ, m.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the terrain.
        s: m, position of the rim along the axle.
        sine, cosine: sin φ, cos φ.
    """
    r = w[RADIUS]
    tx, ty, tz = r * (cosine * w[EX] + sine * w[UX]), r * (cosine * w[EY] + sine * w[UY]), r * sine * w[UZ]
    nx, ny, nz = r * (-sine * w[EX] + cosine * w[UX]), r * (-sine * w[EY] + cosine * w[UY]), r * cosine * w[UZ]
    x, y, z = s * w[AX] - nx, s * w[AY] - ny, w[HZ] + s * w[AZ] - nz
    gx, gy = w[CELL + 1] + w[CELL + 3] * y, w[CELL + 2] + w[CELL + 3] * x
    return z - w[CELL] - w[CELL + 2] * y - gx * x, tz - gx * tx - gy * ty, nz - gx * nx - gy * ny - 2.0 * w[CELL + 3] * tx * ty


@njit
def _arc(w: Array, s: float, low: float, high: float, lowest: Array, keep: float, contacts: Array, count: int) -> int:
    """Find the local minima of the rim's height f above the cell's terrain on an arc.

    f is a trigonometric polynomial of degree 2: f'' is a sinusoid of φ plus one of 2 φ, and the sum of their minima is a lower
    bound. A piece is closed if f is proved monotonic on it, to stay above what is sought, or convex; else it is halved.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the cell's terrain.
        s: m, place of the rim along the axle.
        low, high: rad.
        lowest, keep, contacts, count: as `keep_lower_contact` takes them.

    Returns:
        count, with the minima kept.
    """
    r, c3 = w[RADIUS], w[CELL + 3]
    gx, gy = w[CELL + 1] + c3 * s * w[AY], w[CELL + 2] + c3 * s * w[AX]
    even, odd = r * (w[UZ] - gx * w[UX] - gy * w[UY]), r * (gx * w[EX] + gy * w[EY])
    even2, odd2 = w[UX] * w[UY] - w[EX] * w[EY], -(w[EX] * w[UY] + w[EY] * w[UX])
    even2, odd2 = 2.0 * c3 * r * r * even2, 2.0 * c3 * r * r * odd2
    a, b = low, high
    fa, ga, _ = _along(w, s, math.sin(a), math.cos(a))
    while a < high:
        fb, gb, _ = _along(w, s, math.sin(b), math.cos(b))
        length = b - a
        curvature = _least_of_wave(even, odd, a, b) + _least_of_wave(even2, odd2, 2.0 * a, 2.0 * b)
        slack = 0.5 * max(-curvature, 0.0) * length
        down, up = ga - slack, gb + slack  # slopes at a and b of f made convex: its tangents bound it from below
        if down >= 0.0:
            count = keep_lower_contact(w, lowest, fa, math.sin(a), math.cos(a), s, keep, contacts, count)
        elif up <= 0.0:
            count = keep_lower_contact(w, lowest, fb, math.sin(b), math.cos(b), s, keep, contacts, count)
        elif fa + down * (fb - fa - up * length) / (down - up) < max(lowest[GAP] - GAP_TIE, keep):
            if curvature > 0.0:
                count = _convex_arc(w, s, a, b, ga, gb, lowest, keep, contacts, count)
            elif length > 1e-7:
                b = 0.5 * (a + b)
                continue
            else:
                count = keep_lower_contact(w, lowest, fa, math.sin(a), math.cos(a), s, keep, contacts, count)
                count = keep_lower_contact(w, lowest, fb, math.sin(b), math.cos(b), s, keep, contacts, count)
        a, fa, ga = b, fb, gb
        b = min(a + 2.0 * length, high)
    return count


@inlined
def _least_of_wave(even: float, odd: float, a: float, b: float) -> float:
    """Return the minimum of even cos φ + odd sin φ on a <= φ <= b.

    Args:
        even, odd: amplitudes.
        a, b: rad.
    """
    trough = math.atan2(-odd, -even) - a
    trough -= 2.0 * math.pi * math.floor(trough / (2.0 * math.pi))
    if trough <= b - a:
        return -math.sqrt(even * even + odd * odd)
    return min(even * math.cos(a) + odd * math.sin(a), even * math.cos(b) + odd * math.sin(b))


@njit
def _convex_arc(
    w: Array, s: float, a: float, b: float, ga: float, gb: float, lowest: Array, keep: float, contacts: Array, count: int
) -> int:
    """Find the minimum of a convex arc that falls at a and rises at b.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the cell's terrain.
        s: m, place of the rim along the axle.
        a, b: rad, the arc.
        ga, gb: m/rad, slopes at a and b.
        lowest, keep, contacts, count: as `keep_lower_contact` takes them.

    Returns:
        count, with the minimum if it was kept.
    """
    t = a - ga * (b - a) / (gb - ga)
    f = math.inf
    for _ in range(80):
        f, g, h = _along(w, s, math.sin(t), math.cos(t))
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
def _edge(
    w: Array, x: float, y: float, ex: float, ey: float, length: float, h0: float, rise: float,
    lowest: Array, keep: float, contacts: Array, count: int,
) -> int:  # fmt: skip
    """Find the minimum of T - h inside the tread over a straight edge of the terrain.

    Args:
        w: (WHEEL_SIZE,) wheel.
        x, y: m, the edge's start from the hub.
        ex, ey: its direction.
        length: m.
        h0, rise: m and slope: the edge's height is h0 + rise t.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    r = w[RADIUS]
    u0 = x * w[EX] + y * w[EY]
    du, dv = ex * w[EX] + ey * w[EY], ex * w[VX] + ey * w[VY]
    if abs(du) > 1e-12:
        m = (rise - dv * w[TAN]) * w[COS] / du  # u / q where T runs along the edge as the ground does
        t = (r * m / math.sqrt(1.0 + m * m) - u0) / du
    else:
        t = length if rise > dv * w[TAN] else 0.0
    t = min(max(t, 0.0), length)
    return _inside_tread(w, 1.0, x + t * ex, y + t * ey, h0 + rise * t, lowest, keep, contacts, count)


@njit
def _inside_tread(
    w: Array, sign: float, x: float, y: float, h: float, lowest: Array, keep: float, contacts: Array, count: int
) -> int:
    """Keep the tread's point over a position, if there is one.

    Args:
        w: (WHEEL_SIZE,) wheel.
        sign: 1 for the tread's lower side, -1 for its upper side.
        x, y: m, the position from the hub.
        h: m, the terrain's height there.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    r = w[RADIUS]
    u, v = x * w[EX] + y * w[EY], x * w[VX] + y * w[VY]
    square = r * r - u * u
    if square > 0.0:
        q = sign * math.sqrt(square)
        s = (v - q * w[AZ]) / w[COS]
        if abs(s) <= w[HALF]:
            return keep_lower_contact(w, lowest, w[HZ] + v * w[TAN] - q / w[COS] - h, u / r, q / r, s, keep, contacts, count)
    return count


@njit
def _inside(w: Array, x0: float, x1: float, y0: float, y1: float, lowest: Array, keep: float, contacts: Array, count: int) -> int:
    """Find the minima of T - h inside a twisted cell.

    There are none unless the cell is concave along the axle: h_vv < 0.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the terrain.
        x0, x1, y0, y1: m, the cell from the hub.
        lowest, keep, contacts, count: as `wheel.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    hvv = 2.0 * w[CELL + 3] * w[VX] * w[VY]
    if not hvv < -1e-9:
        return count
    r = w[RADIUS]
    v0 = (w[TAN] - w[CELL + 1] * w[VX] - w[CELL + 2] * w[VY]) / hvv  # h_v = tan τ on the line v = v0 + v1 u
    v1 = -w[CELL + 3] * (w[EX] * w[VY] + w[EY] * w[VX]) / hvv
    px, mx = w[EX] + v1 * w[VX], v0 * w[VX]
    py, my = w[EY] + v1 * w[VY], v0 * w[VY]
    low, high = -0.9999999 * r, 0.9999999 * r  # where that line crosses the cell
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
    # along it T - h falls and rises by  u / (q cos τ) + k1 + 2 k2 u
    k1 = v1 * w[TAN] - w[CELL + 1] * px - w[CELL + 2] * py - w[CELL + 3] * (px * my + py * mx)
    k2 = -w[CELL + 3] * px * py
    # its slope r² / (q³ cos τ) + 2 k2 is least at u = 0; if it is negative there, minima lie beyond two turning points only
    fall, climb = high, high
    if 2.0 * k2 * r * w[COS] < -1.0:
        q = (-r * r / (2.0 * k2 * w[COS])) ** (1.0 / 3.0)
        turn = math.sqrt(max(r * r - q * q, 0.0))
        fall, climb = min(max(-turn, low), high), min(max(turn, low), high)
    for piece in range(2):
        a, b = (low, fall) if piece == 0 else (climb, high)
        if not a < b:
            continue
        ga = a / (math.sqrt(r * r - a * a) * w[COS]) + k1 + 2.0 * k2 * a
        gb = b / (math.sqrt(r * r - b * b) * w[COS]) + k1 + 2.0 * k2 * b
        if ga < 0.0 <= gb:
            left, right = a, b
            u = a - ga * (b - a) / (gb - ga)
            for _ in range(80):
                q = math.sqrt(r * r - u * u)
                g = u / (q * w[COS]) + k1 + 2.0 * k2 * u
                slope = r * r / (q * q * q * w[COS]) + 2.0 * k2
                if g < 0.0:
                    left = u
                else:
                    right = u
                new = u - g / slope if slope > 0.0 else math.nan
                if not (left <= new <= right):
                    new = 0.5 * (left + right)
                done = abs(new - u) < 1e-12 * r
                u = new
                if done:
                    break
            x, y = px * u + mx, py * u + my
            h = w[CELL] + w[CELL + 1] * x + w[CELL + 2] * y + w[CELL + 3] * x * y
            count = _inside_tread(w, 1.0, x, y, h, lowest, keep, contacts, count)
    return count
