"""Convex polygon about the origin that grows by one corner at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit

Array = NDArray[np.float64]

ROOM = 66  # corners
X, Y, SURE = range(3)  # SURE: 1 if the corner is on the boundary of the region inside which the polygon grows


@njit
def less(tangent: float, angle: float) -> float:
    """Return the tangent of an angle that is smaller by a given angle.

    Args:
        tangent: of the larger angle.
        angle: rad.
    """
    return (tangent - angle) / (1.0 + tangent * angle)


@njit
def extend(corner: Array, count: int, x: float, y: float, sure: bool) -> int:
    """Extend a polygon to the convex hull of itself and a point.

    Args:
        corner: (ROOM, 3) corners, counter-clockwise, changed.
        count: number of corners, at least 3.
        x, y: the new corner.
        sure: its mark.

    Returns:
        The new number of corners.
    """
    at = _sector(corner, count, x, y) + 1
    n = at if at < count else 0
    ax, ay, bx, by = corner[at - 1, X], corner[at - 1, Y], corner[n, X], corner[n, Y]
    if count >= ROOM or (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0:
        return count
    for j in range(count, at, -1):
        corner[j] = corner[j - 1]
    corner[at, X], corner[at, Y], corner[at, SURE] = x, y, 1.0 if sure else 0.0
    count += 1
    for side in range(2):
        step = 1 if side == 0 else -1
        while count > 3:
            a, b = (at + step) % count, (at + 2 * step) % count
            ax, ay, bx, by = corner[a, X] - x, corner[a, Y] - y, corner[b, X] - x, corner[b, Y] - y
            convex = step * (ax * by - ay * bx) > 0.0
            if convex or step * (x * corner[b, Y] - y * corner[b, X]) <= 0.0:  # without a, the origin would be outside
                break
            for j in range(a, count - 1):
                corner[j] = corner[j + 1]
            count -= 1
            at -= 1 if a < at else 0
    return count


@njit
def _sector(corner: Array, count: int, x: float, y: float) -> int:
    """Return the corner after which a direction comes.

    Args:
        corner, count: as for `extend`.
        x, y: the direction.
    """
    for j in range(count):
        n = j + 1 if j + 1 < count else 0
        if corner[j, X] * y - corner[j, Y] * x >= 0.0 and x * corner[n, Y] - y * corner[n, X] > 0.0:
            return j
    return count - 1


@njit
def _foot(ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Find the point of a segment that is nearest to the origin.

    Args:
        ax, ay, bx, by: ends of the segment.

    Returns:
        Squared distance; where the foot is on the segment, 0 to 1.
    """
    ex, ey = bx - ax, by - ay
    square = ex * ex + ey * ey
    share = min(max(-(ax * ex + ay * ey) / square, 0.0), 1.0) if square > 1e-20 else 0.0
    x, y = ax + share * ex, ay + share * ey
    return x * x + y * y, share


@njit
def clear_about(corner: Array, count: int, x: float, y: float, distance: float) -> bool:
    """Return True if the edges about a direction are at least a distance away from the origin.

    These are the edge that the direction crosses and the two beside it.

    Args:
        corner, count: as for `extend`.
        x, y: the direction.
        distance: the distance.
    """
    j = _sector(corner, count, x, y)
    j = j - 1 if j > 0 else count - 1
    for _ in range(3):
        n = j + 1 if j + 1 < count else 0
        if _foot(corner[j, X], corner[j, Y], corner[n, X], corner[n, Y])[0] < distance * distance:
            return False
        j = n
    return True


@njit
def nearest_edge(corner: Array, count: int) -> tuple[float, float, float, bool]:
    """Return a polygon's distance from the origin inside it, and the way to the nearest edge.

    Args:
        corner, count: as for `extend`.

    Returns:
        Distance; unit vector to the foot; True if the foot is a corner with the mark SURE.
    """
    nearest, wx, wy, sure = math.inf, 0.0, 0.0, False
    for j in range(count):
        n = j + 1 if j + 1 < count else 0
        ax, ay, bx, by = corner[j, X], corner[j, Y], corner[n, X], corner[n, Y]
        if ax * by - ay * bx <= 0.0:  # half a turn or more
            size = math.hypot(bx - ax, by - ay)
            nearest, wx, wy, sure = 0.0, (by - ay) / size, (ax - bx) / size, False
            continue
        square, share = _foot(ax, ay, bx, by)
        if square < nearest * nearest:
            nearest = math.sqrt(square)
            wx, wy = (ax + share * (bx - ax)) / nearest, (ay + share * (by - ay)) / nearest
            sure = (share == 0.0 and corner[j, SURE] > 0.0) or (share == 1.0 and corner[n, SURE] > 0.0)
    return nearest, wx, wy, sure
