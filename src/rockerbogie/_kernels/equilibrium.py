"""The rover at rest: the least potential energy of its masses with no tread and no belly in the ground, joints in their stops.

Lifting the body by h opens every gap by exactly h. So a pose is made to just touch by one shift of z, and what is left is
to go down: a sequence of small quadratic programmes, each with every near contact of every wheel (not only the lowest),
the belly's near places, the stops and a trust region. Energy falls at every step taken, as it does for a rover let down.
The multipliers are the frictionless support forces over the rover's weight.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .contact import (
    BELLY_CONTACT,
    CONVERGED,
    JOINT_STOP,
    NO_DATA,
    NOT_CONVERGED,
    OFF_MAP,
    TIPPED,
    WHEEL_LIFTED,
    settle_contact,
    start_pose,
)  # fmt: skip
from .jit import njit
from .linkage import (
    P_BODY,
    P_BOGIE,
    P_BOX,
    P_ROCKER,
    P_STOPS,
    P_WHEEL,
    PITCH,
    ROCKER,
    ROLL,
    Z,
    right_rocker,
    slope_row,
    stand,
)  # fmt: skip
from .quadratic import invert, solve_qp
from .tread import BLANK, FOUND, ROOM, Ground, least_gap
from .underside import N_GAP, N_GX, N_GY, N_X, N_Y, N_Z, NEAR_ROOM, NEAR_SIZE, box_over_ground
from .wheel import (
    COSINE,
    GAP,
    HX,
    HY,
    HZ,
    PLACE,
    RADIUS,
    SIN,
    contact_slope,
    tread_point,
)
from .work import Work

Array = NDArray[np.float64]

TOUCH = 1e-6  # a gap below this is contact, m
MOST = 200  # programmes
NEAR = 0.04  # contacts whose gap exceeds a wheel's least by up to this join the programme, m
TRUST = 0.1  # first trust region, rad (and m)
WIDEST = 0.3
FALLEN = 1.3  # rad of roll or pitch beyond which the rover has tipped over
DONE = 1e-11  # a programme that promises less than this has arrived (m of the centre of mass)
ROWS = 6 * (ROOM + 1) + NEAR_ROOM
CONSTRAINTS = ROWS + 6 + 12

# What each pose reports beside q: forces of the wheels and the belly as shares of the weight, and flags.
R_FORCE = 0  # (6,)
R_BELLY = 6  # force on the belly
R_LIFTED = 7  # (6,) 1 where the wheel is in the air
R_STOP = 13  # (3,) -1 or +1 where rocker, left, right bogie lie on their low or high stop
R_SIZE = 16


@njit
def centre_of_mass(rover: Array, feet: Array, q: Array, cy: float, sy: float, axes: Array, knees: Array, slope: Array) -> float:
    """Height of the centre of mass over the body's origin, and its change (6,) per unit of each unknown."""
    row = np.empty(6)
    slope[:] = 0.0
    total = height = 0.0
    m, a, b, c = rover[P_BODY], rover[P_BODY + 1], rover[P_BODY + 2], rover[P_BODY + 3]
    px = axes[0, 0] * a + axes[1, 0] * b + axes[2, 0] * c
    py = axes[0, 1] * a + axes[1, 1] * b + axes[2, 1] * c
    pz = axes[0, 2] * a + axes[1, 2] * b + axes[2, 2] * c
    slope_row(rover, q, cy, sy, axes, knees, 0, px, py, pz, 0.0, 0.0, row)
    total += m
    height += m * pz
    for k in range(3):
        slope[k] += m * row[k]
    qr, _ = right_rocker(rover, q[ROCKER])
    for side in range(2):
        arm = q[ROCKER] if side == 0 else qr
        for part in range(5):  # rocker, bogie, and the three wheels of this side
            i = 2 * (part - 2) + side if part >= 2 else (side if part == 0 else 2 + side)
            at = P_ROCKER + 4 * side if part == 0 else (P_BOGIE + 4 * side if part == 1 else P_WHEEL + 4 * i)
            m, a, b, c = rover[at], rover[at + 1], rover[at + 2], rover[at + 3]
            if part >= 2:  # a wheel's mass hangs in its link as its hub does; steering turns its offset with it
                cs, sn = feet[i, 3], feet[i, 4]
                a, b = feet[i, 0] + cs * a - sn * b, feet[i, 1] + sn * a + cs * b
                c += feet[i, 2]
            angle = arm + q[4 + side] if i >= 2 else arm
            base = 2 + side if i >= 2 else side
            ct, st = math.cos(angle), math.sin(angle)
            px = (
                knees[base, 0]
                + (axes[0, 0] * ct - axes[2, 0] * st) * a
                + axes[1, 0] * b
                + (axes[0, 0] * st + axes[2, 0] * ct) * c
            )
            py = (
                knees[base, 1]
                + (axes[0, 1] * ct - axes[2, 1] * st) * a
                + axes[1, 1] * b
                + (axes[0, 1] * st + axes[2, 1] * ct) * c
            )
            pz = (
                knees[base, 2]
                + (axes[0, 2] * ct - axes[2, 2] * st) * a
                + axes[1, 2] * b
                + (axes[0, 2] * st + axes[2, 2] * ct) * c
            )
            slope_row(rover, q, cy, sy, axes, knees, i, px, py, pz, 0.0, 0.0, row)
            total += m
            height += m * pz
            for k in range(6):
                slope[k] += m * row[k]
    for k in range(6):
        slope[k] /= total
    return height / total


@njit
def touch_down(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, full: bool, work: Work,
    gap: Array, rows: Array, owner: NDArray[np.int64],
) -> tuple[int, int]:  # fmt: skip
    """Shift q's z so that the rover just touches, and list its near contacts: gap (ROWS,), rows (ROWS, 6), owner (ROWS,)
    the wheel, or 6 for the belly. Only the shift when not `full`. Returns a code and how many."""
    best, found, axes, knees, wheels = work.best, work.found, work.axes, work.knees, work.wheels
    near = np.empty((NEAR_ROOM, NEAR_SIZE))
    grid, _, meta = ground
    if not stand(rover, work.feet, x, y, cy, sy, q, axes, knees, wheels):
        return -1, 0
    count = 0
    least = math.inf
    for i in range(6):
        w = wheels[i]
        code, kept = least_gap(ground, w, 0.0, 1.0, 0.0, True, -math.inf, best, work.none, work)
        if code != FOUND:
            return code, 0
        least = min(least, best[GAP])
        if not full:
            continue
        low = best[GAP]
        sine, cosine, place = best[SIN], best[COSINE], best[PLACE]
        code, kept = least_gap(ground, w, sine, cosine, place, True, low + NEAR, best, found, work)
        first = count
        for k in range(-1, kept):
            if k < 0:
                g, sp, cp, s = low, sine, cosine, place
            else:
                g, sp, cp, s = found[k, GAP], found[k, SIN], found[k, COSINE], found[k, PLACE]
                twin = (abs(sp - sine) + abs(cp - cosine)) * w[RADIUS] + abs(s - place) < 1e-6
                if twin:
                    continue
            px, py, pz = tread_point(w, sp, cp, s)
            gx, gy = contact_slope(grid, meta, w, sp, cp, s)
            slope_row(rover, q, cy, sy, axes, knees, i, w[HX] - x + px, w[HY] - y + py, w[HZ] - q[Z] + pz, gx, gy, rows[count])
            gap[count], owner[count] = g, i
            same = False
            for j in range(first, count):
                alike = abs(gap[j] - g)
                for e in range(6):
                    alike += abs(rows[j, e] - rows[count, e])
                same |= alike < 1e-9
            if not same:
                count += 1
    n = box_over_ground(grid, meta, rover[P_BOX : P_BOX + 6], axes, x, y, q[Z], NEAR, near)
    if n < 0:
        return BLANK, 0
    for k in range(n):
        least = min(least, near[k, N_GAP])
        if full:
            slope_row(
                rover,
                q,
                cy,
                sy,
                axes,
                knees,
                0,
                near[k, N_X],
                near[k, N_Y],
                near[k, N_Z],
                near[k, N_GX],
                near[k, N_GY],
                rows[count],
            )
            rows[count, 3:] = 0.0
            gap[count], owner[count] = near[k, N_GAP], 6
            count += 1
    q[Z] -= least
    for k in range(count):
        gap[k] -= least
    return FOUND, count


@njit
def settle_equilibrium(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, report: Array, work: Work
) -> int:
    """Fill q (6,) with the pose at rest and report (R_SIZE,); nan when there is none. Returns a status code."""
    feet, axes, knees = work.feet, work.axes, work.knees
    gap, rows, owner = np.empty(ROWS), np.empty((ROWS, 6)), np.empty(ROWS, np.int64)
    n, b, force = np.empty((CONSTRAINTS, 6)), np.empty(CONSTRAINTS), np.zeros(CONSTRAINTS)
    slope, trial, d = np.empty(6), np.empty(6), np.empty(6)
    bend, inverse, copy = np.zeros((6, 6)), np.empty((6, 6)), np.empty((6, 6))
    old_pull, pull, moved = np.empty(6), np.empty(6), np.empty(6)
    report[:] = math.nan
    # where six wheels touch within the stops, that is where to begin: most often it is the answer
    code = settle_contact(ground, rover, x, y, cy, sy, q, work)
    if code == OFF_MAP or code == NO_DATA:
        return code
    if code != CONVERGED:
        start_pose(ground, rover, x, y, 0, q, work.touch)
    code, count = touch_down(ground, rover, x, y, cy, sy, q, True, work, gap, rows, owner)
    if code != FOUND:
        q[:] = math.nan
        return NO_DATA if code == BLANK else (OFF_MAP if code > 0 else TIPPED)
    height = q[Z] + centre_of_mass(rover, feet, q, cy, sy, axes, knees, slope)
    for k in range(6):
        bend[k, k] = 0.5
    trust = TRUST
    settled = False
    for _ in range(MOST):
        m = count
        for k in range(count):
            for j in range(6):
                n[k, j] = rows[k, j]
            b[k] = -gap[k]
        for k in range(3):
            at = P_STOPS if k == 0 else P_STOPS + 2
            for end in range(2):
                if math.isfinite(rover[at + end]):
                    n[m] = 0.0
                    sign = 1.0 if end == 0 else -1.0
                    n[m, ROCKER + k] = sign
                    b[m] = sign * (rover[at + end] - q[ROCKER + k])
                    m += 1
        for k in range(6):
            for end in range(2):
                n[m] = 0.0
                n[m, k] = 1.0 if end == 0 else -1.0
                b[m] = -trust
                m += 1
        copy[:] = bend
        if not (invert(copy, inverse) and solve_qp(inverse, slope, n, b, m, d, force)):
            for i in range(6):  # the curvature learnt is spoilt: forget it
                for j in range(6):
                    bend[i, j] = 0.5 if i == j else 0.0
            trust *= 0.25
            if trust < 1e-9:
                break
            continue
        promise = 0.0
        size = 0.0
        for k in range(6):
            promise -= slope[k] * d[k]
            size = max(size, abs(d[k]))
        if promise < DONE and size < 1e-6:
            settled = True
            break
        for k in range(6):
            trial[k] = q[k] + d[k]
        low_before = height
        for k in range(6):  # the force each constraint bears pulls on the pose: what the curvature is learnt from
            old_pull[k] = slope[k]
            for j in range(count):
                old_pull[k] -= force[j] * rows[j, k]
        code, _ = touch_down(ground, rover, x, y, cy, sy, trial, False, work, gap, rows, owner)
        if code == FOUND:
            new = trial[Z] + centre_of_mass(rover, feet, trial, cy, sy, axes, knees, pull)
        if code != FOUND or not new < low_before - 1e-4 * promise + 1e-15:
            trust = 0.25 * min(trust, size)
            if trust < 1e-10:
                settled = promise < 1e-8
                break
            # the pose stands as it was: list its contacts anew
            code, count = touch_down(ground, rover, x, y, cy, sy, q, True, work, gap, rows, owner)
            height = q[Z] + centre_of_mass(rover, feet, q, cy, sy, axes, knees, slope)
            continue
        if low_before - new > 0.5 * promise and size > 0.9 * trust:
            trust = min(2.0 * trust, WIDEST)
        bearing = np.zeros(7)
        for j in range(count):
            bearing[owner[j]] += force[j]
        for k in range(6):
            moved[k] = trial[k] - q[k]
            q[k] = trial[k]
        if max(abs(q[ROLL]), abs(q[PITCH])) > FALLEN:
            q[:] = math.nan
            return TIPPED
        code, count = touch_down(ground, rover, x, y, cy, sy, q, True, work, gap, rows, owner)
        height = q[Z] + centre_of_mass(rover, feet, q, cy, sy, axes, knees, slope)
        for k in range(6):
            pull[k] = slope[k]
        for i in range(7):  # each bearer's lowest contact carries its force on
            first = -1
            for j in range(count):
                if owner[j] == i and (first < 0 or gap[j] < gap[first]):
                    first = j
            if first >= 0:
                for k in range(6):
                    pull[k] -= bearing[i] * rows[first, k]
        learn(bend, moved, pull, old_pull)
    if not settled:
        q[:] = math.nan
        return NOT_CONVERGED
    return judge(rover, q, gap, owner, force, count, report)


@njit
def learn(bend: Array, moved: Array, pull: Array, old_pull: Array) -> None:
    """Powell's damped BFGS update of the curvature from how the pull changed along the way."""
    bs = np.empty(6)
    sbs = sy = 0.0
    for i in range(6):
        bs[i] = 0.0
        for j in range(6):
            bs[i] += bend[i, j] * moved[j]
    for i in range(6):
        sbs += moved[i] * bs[i]
        sy += moved[i] * (pull[i] - old_pull[i])
    if not sbs > 1e-24:
        return
    share = 1.0 if sy >= 0.2 * sbs else 0.8 * sbs / (sbs - sy)
    y = np.empty(6)
    sy = 0.0
    for i in range(6):
        y[i] = share * (pull[i] - old_pull[i]) + (1.0 - share) * bs[i]
        sy += moved[i] * y[i]
    for i in range(6):
        for j in range(6):
            bend[i, j] += y[i] * y[j] / sy - bs[i] * bs[j] / sbs
    for i in range(6):
        bend[i, i] += 1e-6


@njit
def judge(rover: Array, q: Array, gap: Array, owner: NDArray[np.int64], force: Array, count: int, report: Array) -> int:
    """Forces and flags of a pose at rest, and its status."""
    report[:] = 0.0
    for i in range(6):
        report[R_LIFTED + i] = 1.0
    belly = False
    for k in range(count):
        report[R_FORCE + owner[k]] += force[k]
        if gap[k] <= TOUCH:
            if owner[k] < 6:
                report[R_LIFTED + owner[k]] = 0.0
            else:
                belly = True
    stopped = False
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        if q[ROCKER + k] <= rover[at] + 1e-9:
            report[R_STOP + k] = -1.0
        elif q[ROCKER + k] >= rover[at + 1] - 1e-9:
            report[R_STOP + k] = 1.0
        stopped |= report[R_STOP + k] != 0.0
    lifted = False
    for i in range(6):
        lifted |= report[R_LIFTED + i] != 0.0
    if belly:
        return BELLY_CONTACT
    if lifted:
        return WHEEL_LIFTED
    return JOINT_STOP if stopped else CONVERGED
