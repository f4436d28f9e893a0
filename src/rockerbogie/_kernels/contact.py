"""Six wheels on the ground: the pose whose six gaps are zero."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .ground import surface
from .jit import njit
from .linkage import P_HUB, P_PIVOT, P_RADIUS, P_STOPS, ROCKER, Z, slope_row, stand
from .tread import (
    BLANK,
    FOUND,
    FOUND_SIZE,
    GAP,
    HX,
    HY,
    HZ,
    OFF,
    PHI,
    PLACE,
    WHEEL_SIZE,
    contact_slope,
    least_gap,
    rim_point,
)  # fmt: skip

Array = NDArray[np.float64]


@njit
def solve6(a: Array, b: Array) -> float:
    """Solve a x = b in place (x in b), partial pivoting; returns the least pivot over the greatest."""
    low, high = math.inf, 0.0
    for k in range(6):
        p = k
        for i in range(k + 1, 6):
            if abs(a[i, k]) > abs(a[p, k]):
                p = i
        if p != k:
            for j in range(k, 6):
                a[k, j], a[p, j] = a[p, j], a[k, j]
            b[k], b[p] = b[p], b[k]
        pivot = a[k, k]
        low, high = min(low, abs(pivot)), max(high, abs(pivot))
        if pivot == 0.0:
            return 0.0
        for i in range(k + 1, 6):
            f = a[i, k] / pivot
            if f != 0.0:
                for j in range(k + 1, 6):
                    a[i, j] -= f * a[k, j]
                b[i] -= f * b[k]
    for k in range(5, -1, -1):
        t = b[k]
        for j in range(k + 1, 6):
            t -= a[k, j] * b[j]
        b[k] = t / a[k, k]
    return low / high


@njit
def gaps(
    grid: Array, meta: Array, rover: Array, feet: Array, x: float, y: float, cy: float, sy: float, q: Array,
    axes: Array, knees: Array, wheels: Array, touch: Array, cuts: Array, none: Array,
) -> int:  # fmt: skip
    """touch (6, 3): gap, φ, s of each wheel at q, over its whole tread. FOUND, OFF, BLANK, or -1 on its side."""
    if not stand(rover, feet, x, y, cy, sy, q, axes, knees, wheels):
        return -1
    for i in range(6):
        code, _ = least_gap(grid, meta, wheels[i], touch[i, PHI], touch[i, PLACE], -math.inf, touch[i], none, cuts)
        if code != FOUND:
            return code
    return FOUND


@njit
def newton(
    grid: Array, meta: Array, rover: Array, feet: Array, x: float, y: float, cy: float, sy: float, q: Array,
    tolerance: float, most: int, touch: Array,
) -> tuple[int, int]:  # fmt: skip
    axes, knees, wheels = np.empty((3, 3)), np.empty((4, 3)), np.empty((6, WHEEL_SIZE))
    cuts, none = np.empty(12), np.empty((0, FOUND_SIZE))
    a, step = np.empty((6, 6)), np.empty(6)
    for it in range(most):
        code = gaps(grid, meta, rover, feet, x, y, cy, sy, q, axes, knees, wheels, touch, cuts, none)
        if code != FOUND:
            return code, it
        worst = 0.0
        for i in range(6):
            worst = max(worst, abs(touch[i, GAP]))
        if worst < tolerance:
            return FOUND, it
        for i in range(6):
            px, py, pz = rim_point(wheels[i], touch[i, PHI], touch[i, PLACE])
            gx, gy = contact_slope(grid, meta, wheels[i], touch[i, PHI], touch[i, PLACE])
            slope_row(
                rover,
                q,
                cy,
                sy,
                axes,
                knees,
                i,
                wheels[i, HX] - x + px,
                wheels[i, HY] - y + py,
                wheels[i, HZ] - q[Z] + pz,
                gx,
                gy,
                a[i],
            )
            step[i] = -touch[i, GAP]
        solve6(a, step)
        big = 0.0
        for k in range(1, 6):
            big = max(big, abs(step[k]))
        if not big < 1e6:
            return 9, it
        scale = min(1.0, 0.3 / big)
        for k in range(6):
            q[k] += scale * step[k]
    return 9, most


# Codes as rockerbogie.Status
CONVERGED, OFF_MAP, NO_DATA, JOINT_STOP, NOT_CONVERGED, WHEEL_LIFTED, BELLY_CONTACT, TIPPED = range(8)
TOLERANCE = 1e-10  # of every gap, m
STEPS = 15  # Newton needs three on smooth ground, five on rough; a cycle between two rocks shows by then
STARTS = 32
STRAYED = 3  # starts that may leave the known ground before the place itself is said to be off it
WIDEST = 1.4  # rad: a settled joint or attitude beyond this is the linkage folded over, not standing


@njit
def start_pose(grid: Array, meta: Array, rover: Array, x: float, y: float, attempt: int, q: Array, touch: Array) -> None:
    """The pose to start from: level for the first attempt, then leaning and bent by a fixed low-discrepancy sequence."""
    touch[:] = 0.0
    q[Z] = surface(grid, meta, x, y)[0] + rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    spread = 0.2 + 0.2 * (attempt % 3)
    share = 1.0
    for k in range(1, 6):
        share *= 0.8812714616335696  # powers of 1 / the root of t^6 = t + 1 fill five dimensions evenly
        part = 0.5 + attempt * share
        q[k] = 2.0 * spread * (part - math.floor(part) - 0.5)


@njit
def settle_contact(
    grid: Array, meta: Array, rover: Array, feet: Array, x: float, y: float, cy: float, sy: float, q: Array, touch: Array
) -> int:
    """Fill q with the settled pose, nan when there is none; returns a status code.

    Newton from a level start. Where two contacts of a wheel take turns it may cycle; then it starts anew from another
    attitude: the first start that settles upright counts, so the answer never depends on anything but the pose asked for.
    """
    strayed = 0
    for attempt in range(STARTS):
        start_pose(grid, meta, rover, x, y, attempt, q, touch)
        code, _ = newton(grid, meta, rover, feet, x, y, cy, sy, q, TOLERANCE, STEPS, touch)
        if code == OFF or code == BLANK:
            strayed += 1
            if strayed == STRAYED:
                q[:] = math.nan
                return OFF_MAP if code == OFF else NO_DATA
        elif code == FOUND and max(max(abs(q[1]), abs(q[2])), max(abs(q[3]), max(abs(q[4]), abs(q[5])))) < WIDEST:
            return JOINT_STOP if beyond_stops(rover, q) else CONVERGED
    q[:] = math.nan
    return NOT_CONVERGED


@njit
def beyond_stops(rover: Array, q: Array) -> bool:
    """Whether a joint stands beyond its stop."""
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        if not rover[at] <= q[ROCKER + k] <= rover[at + 1]:
            return True
    return False
