"""Check that what the search of `LANES` wheels leaves out clears the terrain.

These are the upper sides of treads, and the ends of the lower halves of their rims.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit
from ..model.ground import META_DX, META_DY
from .layout import LANES, LOWEST, NODES, RIM, ROOM, SIDE, TREAD, in_use
from .rim_bounds import NONE

Array = NDArray[np.float64]


@fma_njit
def clear_above(lanes: Array) -> float:
    """Mark the lanes in which only the lower side of a tread can touch terrain of limited slope.

    The search leaves out the upper side of a tread and the ends of its rims' lower halves. They clear terrain that is less
    steep than the way up to them: from the lower side straight up the wheel, uz over |az|; around a rim from where it turns
    back, at cos φ = |b| / sqrt(a² + b²), at least uz sin φ over sqrt(cos² φ + az²).

    Args:
        lanes: the lane array (`layout`).

    Returns:
        Number of lanes that are not clear.

    Reads:  RIM.a, RIM.b, TREAD.cos, TREAD.az, TREAD.max_slope_squared, TREAD.clear
    Writes: TREAD.clear
    """
    for l in range(in_use(lanes)):
        a2, b2, az, uz = (
            lanes[RIM.a + l] * lanes[RIM.a + l],
            lanes[RIM.b + l] * lanes[RIM.b + l],
            lanes[TREAD.az + l],
            lanes[TREAD.cos + l],
        )
        lanes[TREAD.clear + l] = 1.0 if lanes[TREAD.max_slope_squared + l] * (b2 + az * az * (a2 + b2)) <= uz * uz * a2 else 0.0
    lane_count = 0.0
    for l in range(in_use(lanes)):
        lane_count += 1.0 - lanes[TREAD.clear + l]
    return lane_count


@fma_njit
def clear_here(lanes: Array, meta: Array, columns: int, lines: int) -> None:
    """Set LOWEST.doubt to NONE where the terrain under the wheel may touch its upper side.

    That is where it is too steep for `clear_above`, or where data is missing.

    Args:
        lanes: the lane array (`layout`).
        meta: the map header.
        columns: number of nodes along x under the widest of the wheels.
        lines: number of nodes along y under the widest of the wheels.

    Reads:  RIM.a, RIM.b, LOWEST.doubt, TREAD.cos, TREAD.az, TREAD.max_slope_squared, TREAD.clear, TREAD.fits, TREAD.rise_x,
            TREAD.rise_y, TREAD.clear_all, NODES.height
    Writes: LOWEST.doubt, TREAD.max_slope_squared, TREAD.clear, TREAD.rise_x, TREAD.rise_y, TREAD.clear_all
    """
    columns, lines = min(max(columns, 0), SIDE), min(max(lines, 0), SIDE)
    over_x, over_y = 1.0 / (meta[META_DX] * meta[META_DX]), 1.0 / (meta[META_DY] * meta[META_DY])
    for l in range(in_use(lanes)):
        lanes[TREAD.rise_x + l] = lanes[TREAD.rise_y + l] = 0.0
    for m in range(lines - 1):
        for n in range(columns - 1):
            at = NODES.height + min(m * columns + n, ROOM - 1) * LANES
            right, above = at + LANES, NODES.height + min((m + 1) * columns + n, ROOM - 1) * LANES
            beyond = above + LANES
            for l in range(in_use(lanes)):
                a, b, d, e, most_x, most_y = (
                    lanes[at + l],
                    lanes[right + l],
                    lanes[above + l],
                    lanes[beyond + l],
                    lanes[TREAD.rise_x + l],
                    lanes[TREAD.rise_y + l],
                )
                missing = 0.0 * (a + b + d + e + most_x)  # NaN if one is NaN; max would lose it
                lanes[TREAD.rise_x + l] = max(most_x, max(abs(b - a), abs(e - d))) + missing
                lanes[TREAD.rise_y + l] = max(most_y, max(abs(d - a), abs(e - b)))
    for l in range(in_use(lanes)):
        lanes[TREAD.max_slope_squared + l] = (
            lanes[TREAD.rise_x + l] * lanes[TREAD.rise_x + l] * over_x
            + lanes[TREAD.rise_y + l] * lanes[TREAD.rise_y + l] * over_y
        )
        lanes[TREAD.clear_all + l] = lanes[TREAD.clear + l]
    clear_above(lanes)
    for l in range(in_use(lanes)):
        doubt = lanes[LOWEST.doubt + l]
        lanes[LOWEST.doubt + l] = (
            doubt if (lanes[TREAD.clear_all + l] > 0.0) | (lanes[TREAD.clear + l] * lanes[TREAD.fits + l] > 0.0) else NONE
        )
