"""What each of `LANES` lanes is to look at next: the piece of ground whose bound is the lowest."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from .linkage import LANES, ROWS, rows

Array = NDArray[np.float64]

MOST, MOST_ROWS = 2048, 1 << 20  # bounds of a lane, numbers in a block: more than there are

# The lowest of a lane's bounds, and which of its pieces has it.
LOW, PIECE, BOUND_ROWS = rows(ROWS, (LANES,) * 2)


@inlined
def _lower(a: float, i: float, b: float, j: float) -> tuple[float, float]:
    """The lower of a and b with its number; a where they are alike."""
    return (b if b < a else a), (j if b < a else i)


@fma_njit
def lowest(lanes: Array, bounds: int, count: int) -> None:
    """LOW is the lowest of each lane's bounds in the `count` rows from `bounds` on, none of them nan, and PIECE which; of several
    the first. They are taken by eight, as each would wait for the one before: `fill_up` has to have been."""
    bounds, groups = min(max(bounds, 0), MOST_ROWS), min(max((count + 7) // 8, 0), MOST)
    lane_count = min(LANES, groups * LANES)  # LANES; a compiler that knows writes short loops out instead of fusing them
    for l in range(LANES):
        lanes[LOW + l], lanes[PIECE + l] = math.inf, 0.0
    for m in range(groups):
        at = bounds + 8 * m * LANES
        for l in range(lane_count):
            a, i = _lower(lanes[at + l], 0.0, lanes[at + LANES + l], 1.0)
            b, j = _lower(lanes[at + 2 * LANES + l], 2.0, lanes[at + 3 * LANES + l], 3.0)
            c, k = _lower(lanes[at + 4 * LANES + l], 4.0, lanes[at + 5 * LANES + l], 5.0)
            d, n = _lower(lanes[at + 6 * LANES + l], 6.0, lanes[at + 7 * LANES + l], 7.0)
            a, i = _lower(a, i, b, j)
            c, k = _lower(c, k, d, n)
            a, i = _lower(a, i, c, k)
            lanes[LOW + l], lanes[PIECE + l] = _lower(lanes[LOW + l], lanes[PIECE + l], a, 8.0 * m + i)


@fma_njit
def next_lowest(lanes: Array, bounds: int, count: int) -> None:
    """As `lowest`, when all that PIECE was is done with."""
    for l in range(LANES):
        lanes[np.uint64(bounds + l) + np.uint64(lanes[PIECE + l]) * np.uint64(LANES)] = math.inf
    lowest(lanes, bounds, count)


@fma_njit
def fill_up(lanes: Array, bounds: int, count: int) -> None:
    """The rows after the last, as `lowest` wants them."""
    for m in range(count, (count + 7) // 8 * 8):
        for l in range(LANES):
            lanes[bounds + m * LANES + l] = math.inf
