"""Minima of a rim's height above one bilinear cell.

CELL of the wheel's array holds the terrain, h = c0 + c1 X + c2 Y + c3 X Y, X and Y from the hub.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import force_inlined, inlined, njit
from ..model.tolerances import CELL_MARGIN, GAP_TIE
from ..model.wheel import AX, AY, AZ, CELL, EX, EY, GAP, HZ, RADIUS, UX, UY, UZ, tread_point
from .minima import Minima, keep_lower_contact
from .rim_pieces import HALVES, ends_of, rim_over_cell

Array = NDArray[np.float64]


@force_inlined
def search_rim(
    w: Array, s: float, x0: float, x1: float, y0: float, y1: float, top: float,
    found: Minima, count: int,
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
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    lowest, keep, _ = found
    gx, gy = w[CELL + 1] + w[CELL + 3] * s * w[AY], w[CELL + 2] + w[CELL + 3] * s * w[AX]
    lean = abs(w[AZ])
    convex = w[UZ] - gx * w[UX] - gy * w[UY] > w[RADIUS] * (
        max(2.0 * w[CELL + 3] * w[EX] * w[EY], 0.0) + abs(w[CELL + 3]) * lean * (3.0 + lean)
    )
    if convex:
        kept = _convex_rim(w, s, x0, x1, y0, y1, found, count)
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
            count = _arc(w, s, low, high if high >= low else high + 2.0 * math.pi, found, count)
    return count


@force_inlined
def _convex_rim(w: Array, s: float, x0: float, x1: float, y0: float, y1: float, found: Minima, count: int) -> int:
    """Find the local minima of a rim's lower half over a cell where it is convex.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the terrain.
        s: m, position of the rim along the axle.
        x0, x1, y0, y1: m, the cell from the hub.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count; -1 if Newton's method does not converge.
    """
    lowest, keep, _ = found
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
        return keep_lower_contact(w, found, least, sine, cosine, s, count)
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
                        count = keep_lower_contact(w, found, f, sine, cosine, s, count)
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
def _arc(w: Array, s: float, low: float, high: float, found: Minima, count: int) -> int:
    """Find the local minima of the rim's height f above the cell's terrain on an arc.

    f is a trigonometric polynomial of degree 2: f'' is a sinusoid of φ plus one of 2 φ, and the sum of their minima is a lower
    bound. A piece is closed if f is shown to be monotonic on it, to stay above what is sought, or convex; else it is halved.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the cell's terrain.
        s: m, position of the rim along the axle.
        low, high: rad.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    lowest, keep, _ = found
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
            count = keep_lower_contact(w, found, fa, math.sin(a), math.cos(a), s, count)
        elif up <= 0.0:
            count = keep_lower_contact(w, found, fb, math.sin(b), math.cos(b), s, count)
        elif fa + down * (fb - fa - up * length) / (down - up) < max(lowest[GAP] - GAP_TIE, keep):
            if curvature > 0.0:
                count = _convex_arc(w, s, a, b, ga, gb, found, count)
            elif length > 1e-7:
                b = 0.5 * (a + b)
                continue
            else:
                count = keep_lower_contact(w, found, fa, math.sin(a), math.cos(a), s, count)
                count = keep_lower_contact(w, found, fb, math.sin(b), math.cos(b), s, count)
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
def _convex_arc(w: Array, s: float, a: float, b: float, ga: float, gb: float, found: Minima, count: int) -> int:
    """Find the minimum of a convex arc that falls at a and rises at b.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the cell's terrain.
        s: m, position of the rim along the axle.
        a, b: rad, the arc.
        ga, gb: m/rad, slopes at a and b.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count.
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
    return keep_lower_contact(w, found, f, math.sin(t), math.cos(t), s, count)
