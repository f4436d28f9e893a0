"""The minimum of the gap of a tread over one bilinear cell.

In a cell the terrain is h = c0 + c1 X + c2 Y + c3 X Y, X and Y from the hub. A minimum lies inside the cell, where a
twisted one is concave along the axle; on its edges, where bilinear terrain has its ridges; or on one of the tread's
rims (`bilinear_rim`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.tolerances import CELL_MARGIN, GAP_TIE
from ..model.wheel import AZ, CELL, COS, EX, EY, GAP, HALF, HZ, PLACE, PLANE, RADIUS, TAN, VX, VY
from .bilinear_rim import search_rim
from .minima import Minima, keep_lower_contact

Array = NDArray[np.float64]


class FlatCell(NamedTuple):
    """A bilinear cell. All values are in m."""

    a: float  # heights at its corners: low x and y
    b: float  # high x, low y
    d: float  # low x, high y
    e: float  # high x and y
    x0: float  # its low corner from the wheel's hub
    y0: float
    dx: float  # its sizes
    dy: float


@njit
def search_flat_cell(w: Array, cell: FlatCell, far_x: float, far_y: float, follow: bool, found: Minima, count: int) -> int:
    """Find the local minima of the gap over a bilinear cell.

    PLANE must hold a plane that is nowhere above the tread.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL is filled.
        cell: the cell.
        far_x, far_y: m, reach of the wheel from its hub.
        follow: True to search only the rim of the tracked contact, or the tread's inside.
        found, count: as `minima.keep_lower_contact` takes them.

    Returns:
        The new count.
    """
    a, b, d, e, x0, y0, dx, dy = cell
    lowest, keep, _ = found
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
            count = _edge(w, x0, y0, 1.0, 0.0, dx, a, sx, found, count)
        if min(pa, pd) < limit and abs(x0) <= far_x:
            count = _edge(w, x0, y0, 0.0, 1.0, dy, a, sy, found, count)
        if min(pd, pe) < limit and abs(y1) <= far_y:
            count = _edge(w, x0, y1, 1.0, 0.0, dx, d, (e - d) / dx, found, count)
        if min(pb, pe) < limit and abs(x1) <= far_x:
            count = _edge(w, x1, y0, 0.0, 1.0, dy, b, (e - b) / dy, found, count)
        count = _inside(w, x0, x1, y0, y1, found, count)
        if follow:
            return count
        if w[HZ] - half * abs(w[AZ]) - top < max(lowest[GAP], keep):
            # terrain as high as the axle: the minimum may be on the tread's upper side, over a corner
            count = _inside_tread(w, -1.0, x0, y0, a, found, count)
            count = _inside_tread(w, -1.0, x1, y0, b, found, count)
            count = _inside_tread(w, -1.0, x0, y1, d, found, count)
            count = _inside_tread(w, -1.0, x1, y1, e, found, count)
    # a rim matters where it passes over the cell
    middle = (x0 + 0.5 * dx) * w[VX] + (y0 + 0.5 * dy) * w[VY]
    near = 0.5 * (dx * abs(w[VX]) + dy * abs(w[VY])) + w[RADIUS] * abs(w[AZ]) + CELL_MARGIN * (dx + dy)
    for side in range(1 if one_rim else 2):
        s = lowest[PLACE] if one_rim else (half if side == 0 else -half)
        if abs(s * w[COS] - middle) <= near:
            count = search_rim(w, s, x0, x1, y0, y1, top, found, count)
    return count


@njit
def _edge(
    w: Array, x: float, y: float, ex: float, ey: float, length: float, h0: float, rise: float,
    found: Minima, count: int,
) -> int:  # fmt: skip
    """Find the minimum of T - h inside the tread over a straight edge of the terrain.

    Args:
        w: (WHEEL_SIZE,) wheel.
        x, y: m, the edge's start from the hub.
        ex, ey: its direction.
        length: m.
        h0, rise: m and slope: the edge's height is h0 + rise t.
        found, count: as `minima.keep_lower_contact` takes them.

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
    return _inside_tread(w, 1.0, x + t * ex, y + t * ey, h0 + rise * t, found, count)


@njit
def _inside_tread(w: Array, sign: float, x: float, y: float, h: float, found: Minima, count: int) -> int:
    """Keep the tread's point over a position, if there is one.

    Args:
        w: (WHEEL_SIZE,) wheel.
        sign: 1 for the tread's lower side, -1 for its upper side.
        x, y: m, the position from the hub.
        h: m, the terrain's height there.
        found, count: as `minima.keep_lower_contact` takes them.

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
            return keep_lower_contact(w, found, w[HZ] + v * w[TAN] - q / w[COS] - h, u / r, q / r, s, count)
    return count


@njit
def _inside(w: Array, x0: float, x1: float, y0: float, y1: float, found: Minima, count: int) -> int:
    """Find the minima of T - h inside a twisted cell.

    There are none unless the cell is concave along the axle: h_vv < 0.

    Args:
        w: (WHEEL_SIZE,) wheel; CELL holds the terrain.
        x0, x1, y0, y1: m, the cell from the hub.
        found, count: as `minima.keep_lower_contact` takes them.

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
            count = _inside_tread(w, 1.0, x, y, h, found, count)
    return count
