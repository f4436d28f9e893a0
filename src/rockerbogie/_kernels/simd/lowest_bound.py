"""What each of `LANES` lanes is to look at next: the piece of ground whose bound is the lowest."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fused, inlined
from .linkage import LANES, ROWS, rows

Array = NDArray[np.float64]

MOST, MOST_ROWS = 2048, 1 << 20  # bounds of a lane, numbers in a block: more than there are

# The lowest of a lane's bounds, and which of its pieces has it.
LOW, PIECE, BOUND_ROWS = rows(ROWS, (LANES,) * 2)


@inlined
def _lower(a: float, i: float, b: float, j: float) -> tuple[float, float]:
    """The lower of a and b with its number; a where they are alike."""
    return (b if b < a else a), (j if b < a else i)


@fused
def lowest(S: Array, bounds: int, count: int) -> None:
    """LOW is the lowest of each lane's bounds in the `count` rows from `bounds` on, none of them nan, and PIECE which; of several
    the first. They are taken by eight, as each would wait for the one before: `fill_up` has to have been."""
    bounds, groups = min(max(bounds, 0), MOST_ROWS), min(max((count + 7) // 8, 0), MOST)
    lanes = min(LANES, groups * LANES)  # LANES; a compiler that knows writes short loops out instead of fusing them
    for l in range(LANES):
        S[LOW + l], S[PIECE + l] = math.inf, 0.0
    for m in range(groups):
        at = bounds + 8 * m * LANES
        for l in range(lanes):
            a, i = _lower(S[at + l], 0.0, S[at + LANES + l], 1.0)
            b, j = _lower(S[at + 2 * LANES + l], 2.0, S[at + 3 * LANES + l], 3.0)
            c, k = _lower(S[at + 4 * LANES + l], 4.0, S[at + 5 * LANES + l], 5.0)
            d, n = _lower(S[at + 6 * LANES + l], 6.0, S[at + 7 * LANES + l], 7.0)
            a, i = _lower(a, i, b, j)
            c, k = _lower(c, k, d, n)
            a, i = _lower(a, i, c, k)
            S[LOW + l], S[PIECE + l] = _lower(S[LOW + l], S[PIECE + l], a, 8.0 * m + i)


@fused
def next_lowest(S: Array, bounds: int, count: int) -> None:
    """As `lowest`, when all that PIECE was is done with."""
    for l in range(LANES):
        S[np.uint64(bounds + l) + np.uint64(S[PIECE + l]) * np.uint64(LANES)] = math.inf
    lowest(S, bounds, count)


@fused
def fill_up(S: Array, bounds: int, count: int) -> None:
    """The rows after the last, as `lowest` wants them."""
    for m in range(count, (count + 7) // 8 * 8):
        for l in range(LANES):
            S[bounds + m * LANES + l] = math.inf
