"""List of the points of the body's box that are near the terrain."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.tolerances import GAP_TIE

Array = NDArray[np.float64]

# A point of the box near the terrain: gap, offset from the body's origin in the world, and (gx, gy) with (-gx, -gy, 1) normal
# to the contact.
N_GAP, N_X, N_Y, N_Z, N_GX, N_GY = range(6)
NEAR_SIZE = 6
NEAR_ROOM = 12


class Sought(NamedTuple):
    """Limits of the points that a search of the box lists."""

    cap: float  # m: upper bound of the clearance
    seek: float  # m: a point is listed if its gap is at most the lowest so far, or `cap`, plus this
    apart: float  # m: points closer than this, |x| + |y|, are one neighbourhood


@njit
def keep_lower_point(
    near: Array, count: int, apart: float, gap: float, x: float, y: float, z: float, gx: float, gy: float
) -> int:
    """List a point of the box if it is the lowest of its neighbourhood.

    Args:
        near: (n, NEAR_SIZE) the list; a row is written.
        count: number of points listed.
        apart: m, points closer than this are one neighbourhood.
        gap: m, the point's gap.
        x, y, z: m, the point from the body's origin.
        gx, gy: slope of the contact.

    Returns:
        The new count.
    """
    spot = -1
    for k in range(count):
        if abs(near[k, N_X] - x) + abs(near[k, N_Y] - y) < apart:
            if near[k, N_GAP] <= gap:
                return count
            spot = k
            break
    if spot < 0:
        if count < near.shape[0]:
            spot = count
            count += 1
        else:
            spot = 0
            for k in range(1, count):
                if near[k, N_GAP] > near[spot, N_GAP]:
                    spot = k
            if near[spot, N_GAP] <= gap:
                return count
    near[spot, N_GAP], near[spot, N_X], near[spot, N_Y], near[spot, N_Z] = gap, x, y, z
    near[spot, N_GX], near[spot, N_GY] = gx, gy
    return count


@njit
def least_clearance(near: Array, count: int, cap: float = math.inf) -> float:
    """Return the lowest gap of a list, m, at most `cap`.

    Args:
        near: (n, NEAR_SIZE) the list.
        count: number of points listed.
        cap: m.
    """
    low = cap
    for k in range(count):
        low = min(low, near[k, N_GAP])
    return low


@njit
def limit_of_part(near: Array, count: int, sought: Sought, x: float, y: float, reach: float) -> float:
    """Return the gap, m, below which the points of a part would be listed.

    A part that lies wholly in the neighbourhood of a listed point must be lower than that one by GAP_TIE, and, if the list
    is full, lower than the highest.

    Args:
        near, count: the list and its number of points.
        sought: limits of the search.
        x, y: m, middle of the part from the body's origin.
        reach: m, the largest |x| + |y| from there to a point of the part.
    """
    low, high, own = sought.cap, -math.inf, math.inf
    for k in range(count):
        gap = near[k, N_GAP]
        low, high = min(low, gap), max(high, gap)
        if abs(near[k, N_X] - x) + abs(near[k, N_Y] - y) + reach < sought.apart:
            own = min(own, gap)
    limit = min(low + sought.seek, own - GAP_TIE)
    return min(limit, high) if count == near.shape[0] else limit
