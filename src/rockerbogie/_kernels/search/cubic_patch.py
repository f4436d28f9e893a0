"""Bounds on the height of a plane above a rectangle of a cubic cell, from Bézier ordinates.

A polynomial patch and its derivatives lie within the range of their Bézier ordinates, and that range exceeds the true one by the
square of the rectangle's size. On terrain that is flat within the plane, the range is exact: a tie is decided at once.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import force_inlined, inlined, njit
from ..model.tolerances import GAP_TIE

Array = NDArray[np.float64]

SIXTH = 1.0 / 6.0
PATCH_SIZE = 16
# Differences of neighbouring ordinates, m: lowest and highest first ones along x and y, then second ones along x,
# mixed, and along y. With the rectangle as the unit square, f_u is 3 times, f_uu 6 times and f_uv 9 times the difference.
X_LOW, X_HIGH, Y_LOW, Y_HIGH, XX_LOW, XX_HIGH, XY_LOW, XY_HIGH, YY_LOW, YY_HIGH = range(PATCH_SIZE, PATCH_SIZE + 10)
BOUNDS_SIZE = PATCH_SIZE + 10


@force_inlined
def _polar(a: float, b: float, c: float) -> tuple[float, float, float, float]:
    """Return the weights of four B-spline coefficients in their piece's polar form at (a, b, c).

    Args:
        a, b, c: 0 to 1; three equal arguments give the piece itself.
    """
    once, twice, thrice = a + b + c, a * b + b * c + c * a, a * b * c
    w3 = SIXTH * thrice
    w1, w2 = SIXTH * (4.0 - 2.0 * twice) + 3.0 * w3, SIXTH * (1.0 + once + twice) - 3.0 * w3
    return SIXTH * (1.0 - once + twice) - w3, w1, w2, w3


@njit
def bound_patch(
    grid: Array, i: int, j: int, u0: float, u1: float, v0: float, v1: float, wide: float, tall: float,
    c: float, gx: float, gy: float, patch: Array,
) -> float:  # fmt: skip
    """Bound the height f of a plane above a rectangle of a cubic cell, and its derivatives.

    Args:
        grid: coefficients, m.
        i, j: column and row of the cell.
        u0, u1, v0, v1: 0 to 1, the rectangle in the cell.
        wide, tall: m, its size; positive.
        c, gx, gy: height of the plane above the datum at (u0, v0), m, and its slope.
        patch: (BOUNDS_SIZE,) filled with the ordinates, m, row by row, and with the bounds.

    Returns:
        The lowest ordinate, m: f is nowhere below it. NaN if a coefficient is missing.
    """
    x00, x01, x02, x03 = _polar(u0, u0, u0)
    x10, x11, x12, x13 = _polar(u0, u0, u1)
    x20, x21, x22, x23 = _polar(u0, u1, u1)
    x30, x31, x32, x33 = _polar(u1, u1, u1)
    base = grid[j + 1, i + 1]  # heights from a coefficient: rounding is then in proportion to the relief of the cell
    for m in range(4):
        row, k = j + m, 4 * m
        c0, c1, c2, c3 = grid[row, i] - base, grid[row, i + 1] - base, grid[row, i + 2] - base, grid[row, i + 3] - base
        patch[k] = x00 * c0 + x01 * c1 + x02 * c2 + x03 * c3
        patch[k + 1] = x10 * c0 + x11 * c1 + x12 * c2 + x13 * c3
        patch[k + 2] = x20 * c0 + x21 * c1 + x22 * c2 + x23 * c3
        patch[k + 3] = x30 * c0 + x31 * c1 + x32 * c2 + x33 * c3
    y00, y01, y02, y03 = _polar(v0, v0, v0)
    y10, y11, y12, y13 = _polar(v0, v0, v1)
    y20, y21, y22, y23 = _polar(v0, v1, v1)
    y30, y31, y32, y33 = _polar(v1, v1, v1)
    low, total = math.inf, 0.0
    step_x, step_y = gx * wide / 3.0, gy * tall / 3.0
    for n in range(4):
        c0, c1, c2, c3 = patch[n], patch[n + 4], patch[n + 8], patch[n + 12]
        at = c - base + n * step_x
        a0 = at - (y00 * c0 + y01 * c1 + y02 * c2 + y03 * c3)
        a1 = at + step_y - (y10 * c0 + y11 * c1 + y12 * c2 + y13 * c3)
        a2 = at + 2.0 * step_y - (y20 * c0 + y21 * c1 + y22 * c2 + y23 * c3)
        a3 = at + 3.0 * step_y - (y30 * c0 + y31 * c1 + y32 * c2 + y33 * c3)
        patch[n], patch[n + 4], patch[n + 8], patch[n + 12] = a0, a1, a2, a3
        low = min(low, min(min(a0, a1), min(a2, a3)))
        total += a0 + a1 + a2 + a3
    return low + 0.0 * total


@njit
def lowest_over_valley(patch: Array, bowl: float, a: float, b: float) -> float:
    """Return a lower bound of the height of a patch plus a parabolic valley, m.

    The mean slope of the patch is split off. What is left of the patch is bounded by its ordinates. The plane of that slope
    and the valley together are convex, and curved along one direction only: their minimum is on a side of the rectangle.

    Args:
        patch: (BOUNDS_SIZE,) ordinates, m.
        bowl: 1/m, positive; the valley is bowl (a x + b y)² on the rectangle |x| <= 1, |y| <= 1.
        a, b: m.
    """
    gx, gy = 0.25 * (patch[3] - patch[0] + patch[15] - patch[12]), 0.25 * (patch[12] - patch[0] + patch[15] - patch[3])
    third = gx / 3.0
    rest = low = math.inf
    for m in range(4):
        k = 4 * m
        ends, inner = min(patch[k] + gx, patch[k + 3] - gx), min(patch[k + 1] + third, patch[k + 2] - third)
        rest = min(rest, min(ends, inner) - gy * ((2 * m - 3) / 3.0))
    for side in range(4):
        along, across, slope, off = (a, b, gx, gy) if side < 2 else (b, a, gy, gx)
        end = 1.0 if side % 2 == 0 else -1.0
        t = -(0.5 * slope + bowl * along * across * end) / max(bowl * along * along, 1e-300)
        t = min(max(t, -1.0), 1.0)
        u = along * t + across * end
        low = min(low, bowl * u * u + slope * t + off * end)
    return rest + low


@njit
def bound_differences(patch: Array) -> None:
    """Compute the ranges of the differences of a patch that `bound_patch` has filled.

    Args:
        patch: (BOUNDS_SIZE,) ordinates, m; filled from X_LOW on.
    """
    x_low = y_low = xx_low = yy_low = xy_low = math.inf
    x_high = y_high = xx_high = yy_high = xy_high = -math.inf
    for m in range(4):
        k = 4 * m
        a, b, c = patch[k + 1] - patch[k], patch[k + 2] - patch[k + 1], patch[k + 3] - patch[k + 2]
        x_low, x_high = min(x_low, min(a, min(b, c))), max(x_high, max(a, max(b, c)))
        xx_low, xx_high = min(xx_low, min(b - a, c - b)), max(xx_high, max(b - a, c - b))
        if m < 3:
            d, e, f = patch[k + 5] - patch[k + 4] - a, patch[k + 6] - patch[k + 5] - b, patch[k + 7] - patch[k + 6] - c
            xy_low, xy_high = min(xy_low, min(d, min(e, f))), max(xy_high, max(d, max(e, f)))
        a, b, c = patch[m + 4] - patch[m], patch[m + 8] - patch[m + 4], patch[m + 12] - patch[m + 8]
        y_low, y_high = min(y_low, min(a, min(b, c))), max(y_high, max(a, max(b, c)))
        yy_low, yy_high = min(yy_low, min(b - a, c - b)), max(yy_high, max(b - a, c - b))
    patch[X_LOW], patch[X_HIGH], patch[Y_LOW], patch[Y_HIGH] = x_low, x_high, y_low, y_high
    patch[XX_LOW], patch[XX_HIGH], patch[YY_LOW], patch[YY_HIGH] = xx_low, xx_high, yy_low, yy_high
    patch[XY_LOW], patch[XY_HIGH] = xy_low, xy_high


@inlined
def monotonic(patch: Array) -> bool:
    """Return True if the height of a patch rises or falls along x or y: no minimum is inside.

    Args:
        patch: (BOUNDS_SIZE,) ordinates and differences, m. A difference within GAP_TIE of 0 has no sign.
    """
    return max(max(patch[X_LOW], -patch[X_HIGH]), max(patch[Y_LOW], -patch[Y_HIGH])) > GAP_TIE


@inlined
def nearly_convex(patch: Array, tie: float) -> bool:
    """Return True if every stationary point of a patch is its minimum, within `tie`.

    With the rectangle as the unit square, the height plus tie (u² + v²) / 2 is then convex. A convex function that is
    stationary at a point is nowhere lower, and the term added differs by at most `tie` in all.

    Args:
        patch: (BOUNDS_SIZE,) ordinates and differences, m.
        tie: m.
    """
    uu, vv, uv = 6.0 * patch[XX_LOW] + tie, 6.0 * patch[YY_LOW] + tie, 9.0 * max(-patch[XY_LOW], patch[XY_HIGH])
    return uu > 0.0 and vv > 0.0 and uu * vv > uv * uv
