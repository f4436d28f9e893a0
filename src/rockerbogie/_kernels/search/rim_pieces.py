"""Pieces of a rim of a tread over one cell, of either interpolation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.tolerances import CELL_MARGIN
from ..model.wheel import (
    AX,
    AY,
    DERIVATIVES,
    ENDS,
    EX,
    EY,
    RADIUS,
    UX,
    UY,
    tread_point,
)

Array = NDArray[np.float64]


class Part(NamedTuple):
    """A part of a cell, m from the wheel's hub."""

    x0: float
    x1: float
    y0: float
    y1: float


HALVES = 10  # crossings of one half of a rim with four lines, and its two ends


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
