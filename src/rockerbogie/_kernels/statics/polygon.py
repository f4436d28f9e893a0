"""Convex polygon about the origin that grows by one corner at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit

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
def extend(corner: Array, l: int, count: int, x: float, y: float, sure: bool) -> int:
    """Extend a polygon to the convex hull of itself and a point.

    Args:
        corner: (LANES, ROOM, 3) corners of the polygons of all lanes, counter-clockwise; those of lane `l` are changed.
        l: lane.
        count: number of corners, at least 3.
        x, y: the new corner.
        sure: its mark.

    Returns:
        The new number of corners.
    """
    at = _sector(corner, l, count, x, y) + 1
    n = at if at < count else 0
    ax, ay, bx, by = corner[l, at - 1, X], corner[l, at - 1, Y], corner[l, n, X], corner[l, n, Y]
    if count >= ROOM or (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0:
        return count
    for j in range(count, at, -1):
        corner[l, j, X], corner[l, j, Y] = corner[l, j - 1, X], corner[l, j - 1, Y]
        corner[l, j, SURE] = corner[l, j - 1, SURE]
    corner[l, at, X], corner[l, at, Y], corner[l, at, SURE] = x, y, 1.0 if sure else 0.0
    count += 1
    for side in range(2):
        step = 1 if side == 0 else -1
        while count > 3:
            a, b = _around(at + step, count), _around(at + 2 * step, count)
            ax, ay, bx, by = corner[l, a, X] - x, corner[l, a, Y] - y, corner[l, b, X] - x, corner[l, b, Y] - y
            convex = step * (ax * by - ay * bx) > 0.0
            if convex or step * (x * corner[l, b, Y] - y * corner[l, b, X]) <= 0.0:  # without a, the origin would be outside
                break
            for j in range(a, count - 1):
                corner[l, j, X], corner[l, j, Y] = corner[l, j + 1, X], corner[l, j + 1, Y]
                corner[l, j, SURE] = corner[l, j + 1, SURE]
            count -= 1
            at -= 1 if a < at else 0
    return count


@inlined
def _around(j: int, count: int) -> int:
    """Return the number of a corner, counted on from the last one to the first.

    Args:
        j: -count to 2 count - 1.
        count: number of corners.
    """
    return j - count if j >= count else (j + count if j < 0 else j)


@njit
def _sector(corner: Array, l: int, count: int, x: float, y: float) -> int:
    """Return the corner after which a direction comes.

    Args:
        corner, l, count: as for `extend`.
        x, y: the direction.
    """
    before = corner[l, 0, X] * y - corner[l, 0, Y] * x
    for j in range(count - 1):
        after = corner[l, j + 1, X] * y - corner[l, j + 1, Y] * x
        if before >= 0.0 and after < 0.0:
            return j
        before = after
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
def clear_about(corner: Array, l: int, count: int, x: float, y: float, distance: float) -> bool:
    """Return True if the edges about a direction are at least a distance away from the origin.

    These are the edge that the direction crosses and the two beside it.

    Args:
        corner, l, count: as for `extend`.
        x, y: the direction.
        distance: the distance.
    """
    j = _sector(corner, l, count, x, y)
    j = j - 1 if j > 0 else count - 1
    for _ in range(3):
        n = j + 1 if j + 1 < count else 0
        if _foot(corner[l, j, X], corner[l, j, Y], corner[l, n, X], corner[l, n, Y])[0] < distance * distance:
            return False
        j = n
    return True


@njit
def nearest_edge(corner: Array, l: int, count: int) -> tuple[float, float, float, bool]:
    """Return a polygon's distance from the origin inside it, and the way to the nearest edge.

    Args:
        corner, l, count: as for `extend`.

    Returns:
        Distance; unit vector to the foot; True if the foot is a corner with the mark SURE.
    """
    nearest, wx, wy, sure = math.inf, 0.0, 0.0, False
    for j in range(count):
        n = j + 1 if j + 1 < count else 0
        ax, ay, bx, by = corner[l, j, X], corner[l, j, Y], corner[l, n, X], corner[l, n, Y]
        ex, ey, across = bx - ax, by - ay, ax * by - ay * bx
        if across <= 0.0:  # half a turn or more
            size = math.hypot(ex, ey)
            nearest, wx, wy, sure = 0.0, ey / size, -ex / size, False
            continue
        if across * across >= nearest * nearest * (ex * ex + ey * ey):  # the edge's line is farther away
            continue
        square, share = _foot(ax, ay, bx, by)
        if square < nearest * nearest:
            nearest = math.sqrt(square)
            wx, wy = (ax + share * ex) / nearest, (ay + share * ey) / nearest
            sure = (share == 0.0 and corner[l, j, SURE] > 0.0) or (share == 1.0 and corner[l, n, SURE] > 0.0)
    return nearest, wx, wy, sure
