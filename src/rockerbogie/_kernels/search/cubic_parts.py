"""Parts of a cubic cell that is quartered: their order, and Newton's step inside one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined
from ..model.tolerances import MIN_DECREASE

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
def _room(x: float, step: float, bound: float) -> float:
    """Return the share of a step, at most 1, that stays within |x| <= bound.

    Args:
        x: m, the point.
        step: m.
        bound: m.
    """
    if step == 0.0:
        return 1.0
    return min(1.0, (bound - x if step > 0.0 else bound + x) / abs(step))


@inlined
def bounded_step(
    x: float, y: float, rx: float, ry: float, fx: float, fy: float, fxx: float, fxy: float, fyy: float
) -> tuple[float, float, float, int]:
    """Move by Newton's step to the minimum of a function that is convex on |x| <= rx, |y| <= ry.

    The step ends at the first side that it reaches: in a narrow valley it stays in the valley. From a side that it would cross,
    it leads along the side. The slope alone would not tell: a rounding error across a valley may exceed the slope along it.

    Args:
        x, y: m, the point.
        rx, ry: m, the bounds.
        fx, fy, fxx, fxy, fyy: gradient and Hessian there.

    Returns:
        The next point, m; twice the decrease that the whole step predicts, m; and the number of coordinates held at a side, -1
        if the Hessian is not positive.
    """
    det = fxx * fyy - fxy * fxy
    if not (det > 0.0 and fxx > 0.0):
        return x, y, 0.0, -1
    step_x, step_y, held = (fxy * fy - fyy * fx) / det, (fxy * fx - fxx * fy) / det, 0
    room_x, room_y = _room(x, step_x, rx), _room(y, step_y, ry)
    if min(room_x, room_y) <= 0.0:
        held, side_first, corner = 1, room_x <= 0.0, max(room_x, room_y) <= 0.0
        for turn in range(2):  # along y if the step crosses a side of x; in a corner, along the other side too
            along_y = side_first == (turn == 0)
            step_x, step_y = (0.0, -fy / fyy) if along_y else (-fx / fxx, 0.0)
            room_x, room_y = _room(x, step_x, rx), _room(y, step_y, ry)
            if min(room_x, room_y) > 0.0 and not (corner and abs(fx * step_x + fy * step_y) < MIN_DECREASE):
                break
        if min(room_x, room_y) <= 0.0:
            return x, y, 0.0, 2
    share = min(room_x, room_y)
    new_x = math.copysign(rx, step_x) if room_x == share < 1.0 else x + share * step_x
    new_y = math.copysign(ry, step_y) if room_y == share < 1.0 else y + share * step_y
    return new_x, new_y, abs(fx * step_x + fy * step_y), held
