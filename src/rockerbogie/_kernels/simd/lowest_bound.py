"""Lowest of each lane's lower bounds: the piece of terrain to search next."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined
from .layout import BOUND, LANES, in_use

Array = NDArray[np.float64]

MOST, MOST_ROWS = 2048, 1 << 20  # limits above all numbers of bounds and all rows, for the compiler


@inlined
def _lower(a: float, i: float, b: float, j: float) -> tuple[float, float]:
    """Return the lower of two numbers and its index; the first if they are equal.

    Args:
        a: first number.
        i: its index.
        b: second number.
        j: its index.

    Returns:
        The lower number and its index.
    """
    return (b if b < a else a), (j if b < a else i)


@fma_njit
def lowest(lanes: Array, bounds: int, count: int) -> None:
    """Find each lane's lowest bound in a table, and the index of its piece.

    Of equal bounds the first counts. Bounds are compared in groups of 8, because each comparison of a running minimum waits
    for the one before. `pad_bounds` must have filled the last group.

    Args:
        lanes: the lane array (`layout`).
        bounds: row of the first bound; none is NaN.
        count: number of bounds of each lane.

    Reads:  bounds, BOUND (all)
    Writes: BOUND (all)
    """
    bounds, groups = min(max(bounds, 0), MOST_ROWS), min(max((count + 7) // 8, 0), MOST)
    for l in range(in_use(lanes)):
        lanes[BOUND.low + l], lanes[BOUND.piece + l] = math.inf, 0.0
    for m in range(groups):
        at = bounds + 8 * m * LANES
        for l in range(in_use(lanes)):
            a, i = _lower(lanes[at + l], 0.0, lanes[at + LANES + l], 1.0)
            b, j = _lower(lanes[at + 2 * LANES + l], 2.0, lanes[at + 3 * LANES + l], 3.0)
            c, k = _lower(lanes[at + 4 * LANES + l], 4.0, lanes[at + 5 * LANES + l], 5.0)
            d, n = _lower(lanes[at + 6 * LANES + l], 6.0, lanes[at + 7 * LANES + l], 7.0)
            a, i = _lower(a, i, b, j)
            c, k = _lower(c, k, d, n)
            a, i = _lower(a, i, c, k)
            lanes[BOUND.low + l], lanes[BOUND.piece + l] = _lower(lanes[BOUND.low + l], lanes[BOUND.piece + l], a, 8.0 * m + i)


@fma_njit
def next_lowest(lanes: Array, bounds: int, count: int) -> None:
    """Remove each lane's lowest bound from the table, and find the next one.

    A removed bound is infinite.

    Args:
        lanes: the lane array (`layout`).
        bounds: row of the first bound.
        count: number of bounds of each lane.

    Reads:  bounds, BOUND (all)
    Writes: bounds, BOUND (all)
    """
    for l in range(in_use(lanes)):
        lanes[np.uint64(bounds + l) + np.uint64(lanes[BOUND.piece + l]) * np.uint64(LANES)] = math.inf
    lowest(lanes, bounds, count)


@fma_njit
def pad_bounds(lanes: Array, bounds: int, count: int) -> None:
    """Fill the last group of 8 of a table of bounds with infinity.

    Args:
        lanes: the lane array (`layout`).
        bounds: row of the first bound.
        count: number of bounds of each lane.

    Reads:  none
    Writes: bounds
    """
    for m in range(count, (count + 7) // 8 * 8):
        for l in range(in_use(lanes)):
            lanes[bounds + m * LANES + l] = math.inf
