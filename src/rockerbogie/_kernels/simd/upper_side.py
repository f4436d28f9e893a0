"""Whether what the search of `LANES` wheels leaves out clears the ground: treads' upper sides, and the ends of their rims' lower
halves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit
from ..model.ground import META_DX, META_DY
from .linkage import LANES
from .rim_search import DOUBT, NONE, A, B
from .tread_search import AXLE_Z, CLEAR, CLEAR_ALL, COS, FITS, HEIGHTS, MAX_SLOPE_SQUARED, RISE_X, RISE_Y, ROOM, SIDE

Array = NDArray[np.float64]


@fma_njit
def clear_above(lanes: Array) -> float:
    """How many lanes might be nearer the ground with what the search leaves out, a tread's upper side and the ends of its rims'
    lower halves; CLEAR is 0 for these and 1 for others, if the ground is nowhere steeper than the square root of
    MAX_SLOPE_SQUARED.

    Then it is less steep than the way up to those places. From a point of the lower side straight up the wheel that rises uz
    over |az|; around a rim from where it turns back, cos φ = |B| / sqrt(A² + B²), at least uz sin φ over sqrt(cos² φ + az²).
    """
    for l in range(LANES):
        a2, b2, az, uz = lanes[A + l] * lanes[A + l], lanes[B + l] * lanes[B + l], lanes[AXLE_Z + l], lanes[COS + l]
        lanes[CLEAR + l] = 1.0 if lanes[MAX_SLOPE_SQUARED + l] * (b2 + az * az * (a2 + b2)) <= uz * uz * a2 else 0.0
    lane_count = 0.0
    for l in range(LANES):
        lane_count += 1.0 - lanes[CLEAR + l]
    return lane_count


@fma_njit
def clear_here(lanes: Array, meta: Array, columns: int, lines: int) -> None:
    """DOUBT where all of the ground, and that between HEIGHTS, is too steep for `clear_above`, or where it has holes."""
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    over_x, over_y = 1.0 / (meta[META_DX] * meta[META_DX]), 1.0 / (meta[META_DY] * meta[META_DY])
    for l in range(LANES):
        lanes[RISE_X + l] = lanes[RISE_Y + l] = 0.0
    for m in range(lines - 1):
        for n in range(columns - 1):
            at = HEIGHTS + min(m * columns + n, ROOM - 1) * LANES
            right, above = at + LANES, HEIGHTS + min((m + 1) * columns + n, ROOM - 1) * LANES
            beyond = above + LANES
            for l in range(LANES):
                a, b, d, e, most_x, most_y = (
                    lanes[at + l],
                    lanes[right + l],
                    lanes[above + l],
                    lanes[beyond + l],
                    lanes[RISE_X + l],
                    lanes[RISE_Y + l],
                )
                hole = 0.0 * (a + b + d + e + most_x)  # nan in one, or before; max would lose it
                lanes[RISE_X + l] = max(most_x, max(abs(b - a), abs(e - d))) + hole
                lanes[RISE_Y + l] = max(most_y, max(abs(d - a), abs(e - b)))
    for l in range(LANES):
        lanes[MAX_SLOPE_SQUARED + l] = (
            lanes[RISE_X + l] * lanes[RISE_X + l] * over_x + lanes[RISE_Y + l] * lanes[RISE_Y + l] * over_y
        )
        lanes[CLEAR_ALL + l] = lanes[CLEAR + l]
    clear_above(lanes)
    for l in range(LANES):
        doubt = lanes[DOUBT + l]
        lanes[DOUBT + l] = doubt if (lanes[CLEAR_ALL + l] > 0.0) | (lanes[CLEAR + l] * lanes[FITS + l] > 0.0) else NONE
