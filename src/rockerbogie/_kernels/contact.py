"""Six wheels on the ground: the pose whose six gaps are zero."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .ground import surface
from .jit import njit
from .linkage import P_HUB, P_PIVOT, P_RADIUS, P_STOPS, ROCKER, Z, slope_row, stand
from .tread import BLANK, FOUND, OFF, SCRATCH, Ground, least_gap
from .wheel import COSINE, GAP, HX, HY, HZ, PLACE, PLACE_SIZE, RADIUS, SIN, WHEEL_SIZE, contact_slope, tread_point

Array = NDArray[np.float64]


@njit
def solve_linkage(a: Array, b: Array) -> bool:
    """Solve a x = b for the linkage's six equations (x in b): rows 0, 1 know no bogie angle, rows 2, 4 only the left
    one, rows 3, 5 only the right one, and z's coefficient is 1 in all. False where it is singular to rounding."""
    m, r = np.empty((3, 3)), np.empty(3)
    pivot = np.empty(2, np.int64)
    for side in range(2):
        p = 2 + side if abs(a[2 + side, 4 + side]) >= abs(a[4 + side, 4 + side]) else 4 + side
        o = 6 + 2 * side - p
        pivot[side] = p
        k = a[o, 4 + side] / a[p, 4 + side]
        z = 1.0 - k  # what is left of z's coefficient, taken out by row 0
        for j in range(3):
            m[1 + side, j] = a[o, 1 + j] - k * a[p, 1 + j] - z * a[0, 1 + j]
        r[1 + side] = b[o] - k * b[p] - z * b[0]
    for j in range(3):
        m[0, j] = a[1, 1 + j] - a[0, 1 + j]
    r[0] = b[1] - b[0]
    c0 = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
    c1 = m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]
    c2 = m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0]
    det = m[0, 0] * c0 + m[0, 1] * c1 + m[0, 2] * c2
    x1 = (r[0] * c0 + m[0, 1] * (m[1, 2] * r[2] - r[1] * m[2, 2]) + m[0, 2] * (r[1] * m[2, 1] - m[1, 1] * r[2])) / det
    x2 = (m[0, 0] * (r[1] * m[2, 2] - m[1, 2] * r[2]) + r[0] * c1 + m[0, 2] * (m[1, 0] * r[2] - r[1] * m[2, 0])) / det
    x3 = (m[0, 0] * (m[1, 1] * r[2] - r[1] * m[2, 1]) + m[0, 1] * (r[1] * m[2, 0] - m[1, 0] * r[2]) + r[0] * c2) / det
    x0 = b[0] - a[0, 1] * x1 - a[0, 2] * x2 - a[0, 3] * x3
    good = math.isfinite(x0)
    for side in range(2):
        p = pivot[side]
        bend = (b[p] - x0 - a[p, 1] * x1 - a[p, 2] * x2 - a[p, 3] * x3) / a[p, 4 + side]
        good &= math.isfinite(bend)
        r[side] = bend
    b[0], b[1], b[2], b[3], b[4], b[5] = x0, x1, x2, x3, r[0], r[1]
    return good


@njit
def stand_on_hubs(
    ground: Ground, rover: Array, feet: Array, x: float, y: float, cy: float, sy: float, q: Array,
    axes: Array, knees: Array, wheels: Array, a: Array, step: Array,
) -> None:  # fmt: skip
    """A first step, cheap: as if each wheel stood on the ground right under its hub, and that were level."""
    grid, _, meta = ground
    if not stand(rover, feet, x, y, cy, sy, q, axes, knees, wheels):
        return
    for i in range(6):
        w = wheels[i]
        h = surface(grid, meta, w[HX], w[HY])[0]
        slope_row(rover, q, cy, sy, axes, knees, i, w[HX] - x, w[HY] - y, w[HZ] - q[Z] - w[RADIUS], 0.0, 0.0, a[i])
        step[i] = h + w[RADIUS] - w[HZ]
    if solve_linkage(a, step):
        move(q, step)


@njit
def move(q: Array, step: Array) -> None:
    """Take a step, shortened where it would turn anything by more than `STRIDE`."""
    big = 0.0
    for k in range(1, 6):
        big = max(big, abs(step[k]))
    scale = min(1.0, STRIDE / big) if big > 0.0 else 1.0
    for k in range(6):
        q[k] += scale * step[k]


@njit
def newton(
    ground: Ground, rover: Array, feet: Array, x: float, y: float, cy: float, sy: float, q: Array, touch: Array,
    axes: Array, knees: Array, wheels: Array, a: Array, step: Array, none: Array, scratch: Array,
) -> int:  # fmt: skip
    """Newton on the six gaps from q, each over the whole tread; touch (6, PLACE_SIZE) holds where they are.

    The contact is found anew at every step, so the gap's slope is that of the touching point alone (the envelope
    theorem), and the steps converge as fast as Newton's. FOUND, OFF, BLANK, or -1 where it does not settle.
    """
    grid, _, meta = ground
    whole = True
    for it in range(STEPS):
        if not stand(rover, feet, x, y, cy, sy, q, axes, knees, wheels):
            return -1
        worst = 0.0
        for i in range(6):
            t, w = touch[i], wheels[i]
            code, _ = least_gap(ground, w, t[SIN], t[COSINE], t[PLACE], whole, -math.inf, t, none, scratch)
            if code != FOUND:
                return code
            worst = max(worst, abs(t[GAP]))
        if worst < TOLERANCE:
            if whole:
                return FOUND
            whole = True  # settled on the contacts followed: is there a lower one anywhere on the treads?
            continue
        whole = it >= FOLLOW
        for i in range(6):
            t, w = touch[i], wheels[i]
            px, py, pz = tread_point(w, t[SIN], t[COSINE], t[PLACE])
            gx, gy = contact_slope(grid, meta, w, t[SIN], t[COSINE], t[PLACE])
            slope_row(rover, q, cy, sy, axes, knees, i, w[HX] - x + px, w[HY] - y + py, w[HZ] - q[Z] + pz, gx, gy, a[i])
            step[i] = -t[GAP]
        if not solve_linkage(a, step):
            return -1
        move(q, step)
    return -1


# Codes as rockerbogie.Status
CONVERGED, OFF_MAP, NO_DATA, JOINT_STOP, NOT_CONVERGED, WHEEL_LIFTED, BELLY_CONTACT, TIPPED = range(8)
TOLERANCE = 1e-10  # of every gap, m
STEPS = 18  # Newton needs three on smooth ground, five on rough; a cycle between two rocks shows by then
FOLLOW = 8  # steps in which contacts are followed; from then on they are sought anew each time
STARTS = 32
STRAYED = 3  # starts that may leave the known ground before the place itself is said to be off it
STRIDE = 0.3  # rad, the longest step
WIDEST = 1.4  # rad: a settled joint or attitude beyond this is the linkage folded over, not standing


@njit
def start_pose(ground: Ground, rover: Array, x: float, y: float, attempt: int, q: Array, touch: Array) -> None:
    """The pose to start from: level for the first attempt, then leaning and bent by a fixed low-discrepancy sequence."""
    grid, _, meta = ground
    for i in range(6):
        touch[i, GAP], touch[i, SIN], touch[i, COSINE], touch[i, PLACE] = 0.0, 0.0, 1.0, 0.0
    q[Z] = surface(grid, meta, x, y)[0] + rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    spread = 0.2 + 0.2 * (attempt % 3)
    share = 1.0
    for k in range(1, 6):
        share *= 0.8812714616335696  # powers of 1 / the root of t^6 = t + 1 fill five dimensions evenly
        part = 0.5 + attempt * share
        q[k] = 2.0 * spread * (part - math.floor(part) - 0.5)


@njit
def settle_contact(
    ground: Ground, rover: Array, feet: Array, x: float, y: float, cy: float, sy: float, q: Array, touch: Array
) -> int:
    """Fill q with the settled pose, nan when there is none; returns a status code.

    Newton from a level start. Where two contacts of a wheel take turns it may cycle; then it starts anew from another
    attitude: the first start that settles upright counts, so the answer never depends on anything but the pose asked for.
    """
    axes, knees, wheels = np.empty((3, 3)), np.empty((4, 3)), np.empty((6, WHEEL_SIZE))
    a, step, none, scratch = np.empty((6, 6)), np.empty(6), np.empty((0, PLACE_SIZE)), np.empty(SCRATCH)
    strayed = 0
    for attempt in range(STARTS):
        start_pose(ground, rover, x, y, attempt, q, touch)
        if attempt == 0:
            stand_on_hubs(ground, rover, feet, x, y, cy, sy, q, axes, knees, wheels, a, step)
        code = newton(ground, rover, feet, x, y, cy, sy, q, touch, axes, knees, wheels, a, step, none, scratch)
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
