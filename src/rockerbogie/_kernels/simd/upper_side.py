"""Whether what the search of `LANES` wheels leaves out clears the ground: treads' upper sides, and the ends of their rims' lower
halves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fused
from ..model.ground import META_DX, META_DY
from .linkage import LANES
from .rim_search import DOUBT, NONE, A, B
from .tread_search import AXLE_Z, CLEAR, CLEAR_ALL, COS, FITS, HEIGHTS, RISE_X, RISE_Y, ROOM, SIDE, STEEP

Array = NDArray[np.float64]


@fused
def clear_above(S: Array) -> float:
    """How many lanes might be nearer the ground with what the search leaves out, a tread's upper side and the ends of its rims'
    lower halves; CLEAR is 0 for these and 1 for others, if the ground is nowhere steeper than the square root of STEEP.

    Then it is less steep than the way up to those places. From a point of the lower side straight up the wheel that rises uz
    over |az|; around a rim from where it turns back, cos φ = |B| / sqrt(A² + B²), at least uz sin φ over sqrt(cos² φ + az²).
    """
    for l in range(LANES):
        a2, b2, az, uz = S[A + l] * S[A + l], S[B + l] * S[B + l], S[AXLE_Z + l], S[COS + l]
        S[CLEAR + l] = 1.0 if S[STEEP + l] * (b2 + az * az * (a2 + b2)) <= uz * uz * a2 else 0.0
    lanes = 0.0
    for l in range(LANES):
        lanes += 1.0 - S[CLEAR + l]
    return lanes


@fused
def clear_here(S: Array, meta: Array, columns: int, lines: int) -> None:
    """DOUBT where all of the ground, and that between HEIGHTS, is too steep for `clear_above`, or where it has holes."""
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    over_x, over_y = 1.0 / (meta[META_DX] * meta[META_DX]), 1.0 / (meta[META_DY] * meta[META_DY])
    for l in range(LANES):
        S[RISE_X + l] = S[RISE_Y + l] = 0.0
    for m in range(lines - 1):
        for n in range(columns - 1):
            at = HEIGHTS + min(m * columns + n, ROOM - 1) * LANES
            right, above = at + LANES, HEIGHTS + min((m + 1) * columns + n, ROOM - 1) * LANES
            beyond = above + LANES
            for l in range(LANES):
                a, b, d, e, most_x, most_y = S[at + l], S[right + l], S[above + l], S[beyond + l], S[RISE_X + l], S[RISE_Y + l]
                hole = 0.0 * (a + b + d + e + most_x)  # nan in one, or before; max would lose it
                S[RISE_X + l] = max(most_x, max(abs(b - a), abs(e - d))) + hole
                S[RISE_Y + l] = max(most_y, max(abs(d - a), abs(e - b)))
    for l in range(LANES):
        S[STEEP + l] = S[RISE_X + l] * S[RISE_X + l] * over_x + S[RISE_Y + l] * S[RISE_Y + l] * over_y
        S[CLEAR_ALL + l] = S[CLEAR + l]
    clear_above(S)
    for l in range(LANES):
        doubt = S[DOUBT + l]
        S[DOUBT + l] = doubt if (S[CLEAR_ALL + l] > 0.0) | (S[CLEAR + l] * S[FITS + l] > 0.0) else NONE
