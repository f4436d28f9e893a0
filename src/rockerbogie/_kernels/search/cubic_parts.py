"""Parts of a cubic cell that is quartered: their order, and Newton's step inside one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined

Array = NDArray[np.float64]


@inlined
def next_part(level: int, i: int, j: int, rx: float, ry: float) -> tuple[int, int, int, float, float]:
    """Return the part to examine after one that is decided.

    A rectangle is quartered again and again; part (i, j) of level n is one of 4ⁿ. The quarters of a part are taken along x
    first. After the last one follows the neighbour of the part that they form.

    Args:
        level: number of times that the rectangle is quartered.
        i, j: index of the part along x and y.
        rx, ry: m, half sizes of the part.

    Returns:
        level, i, j, rx and ry of the next part; level -1 if all are decided.
    """
    while level > 0 and i % 2 == 1 and j % 2 == 1:  # the last quarter: return to the part it belongs to
        level, i, j = level - 1, i // 2, j // 2
        rx, ry = 2.0 * rx, 2.0 * ry
    if level == 0:
        return -1, i, j, rx, ry
    if i % 2 == 0:
        return level, i + 1, j, rx, ry
    return level, i - 1, j + 1, rx, ry


@inlined
def bounded_step(
    x: float, y: float, rx: float, ry: float, fx: float, fy: float, fxx: float, fxy: float, fyy: float
) -> tuple[float, float, int]:
    """Return Newton's step to the minimum of a function that is convex on |x| <= rx, |y| <= ry.

    A coordinate at its bound stays there while the function falls outwards.

    Args:
        x, y: m, the point.
        rx, ry: m, the bounds.
        fx, fy, fxx, fxy, fyy: gradient and Hessian there.

    Returns:
        The step in x and y, not bounded, and how many coordinates are held at a bound; -1 if the Hessian is not positive.
    """
    hold_x = (x >= rx and fx <= 0.0) or (x <= -rx and fx >= 0.0)
    hold_y = (y >= ry and fy <= 0.0) or (y <= -ry and fy >= 0.0)
    det = fxx * fyy - fxy * fxy
    if not (det > 0.0 and fxx > 0.0):
        return 0.0, 0.0, -1
    if hold_x and hold_y:
        return 0.0, 0.0, 2
    if hold_x:
        return 0.0, -fy / fyy, 1
    if hold_y:
        return -fx / fxx, 0.0, 1
    return (fxy * fy - fyy * fx) / det, (fxy * fx - fxx * fy) / det, 0
