"""Contact mode: the pose with six zero gaps, by Newton's method."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..model.ground import META_CUBIC, META_DX, META_DY, META_MAX_CURVATURE, META_NX, META_NY, META_STEEP, Ground, surface
from ..model.linkage import (
    BOGIE_L,
    BOGIE_R,
    P_BOX,
    P_HUB,
    P_PIVOT,
    P_RADIUS,
    P_STOPS,
    ROCKER,
    Z,
    forward_kinematics,
    gap_jacobian_row,
    reach,
)
from ..model.tolerances import CONVERGED_GAP, MAX_ANGLE, MAX_STEP_ANGLE, SEARCH_GAP
from ..model.wheel import (
    AX,
    AY,
    COSINE,
    EX,
    EY,
    GAP,
    HALF,
    HX,
    HY,
    HZ,
    PLACE,
    RADIUS,
    SIN,
    UX,
    UY,
    contact_slope,
    tread_point,
)
from ..search.body_box import box_over_ground
from ..search.box_points import NEAR_ROOM, NEAR_SIZE
from ..search.tread import BLANK, FOUND, OFF, least_gap
from ..search.workspace import Work

Array = NDArray[np.float64]


@njit
def _without_bogie(a: Array, b: Array, side: int) -> tuple[float, float, float, float]:
    """Eliminate one side's bogie angle and z from its two bogie rows; z by row 0.

    Args:
        a: (6, 6) rows of the gaps.
        b: (6,) right side.
        side: 0 left, 1 right.

    Returns:
        Coefficients of roll, pitch and rocker, and the right side.
    """
    p, o = _pivot(a, side)
    k = a[o, 4 + side] / a[p, 4 + side]
    z = 1.0 - k  # what is left of z's coefficient
    return (
        a[o, 1] - k * a[p, 1] - z * a[0, 1],
        a[o, 2] - k * a[p, 2] - z * a[0, 2],
        a[o, 3] - k * a[p, 3] - z * a[0, 3],
        b[o] - k * b[p] - z * b[0],
    )


@inlined
def _pivot(a: Array, side: int) -> tuple[int, int]:
    """Return a side's two bogie rows, the pivot row first.

    The pivot row has the larger coefficient of the bogie angle.

    Args:
        a: (6, 6) rows of the gaps.
        side: 0 left, 1 right.
    """
    middle, other = 2 + side, 4 + side
    if abs(a[middle, 4 + side]) >= abs(a[other, 4 + side]):
        return middle, other
    return other, middle


@njit
def solve_linkage(a: Array, b: Array) -> bool:
    """Solve the linkage's six linear equations a x = b.

    Rows 0 and 1 have no bogie angle, rows 2 and 4 only the left one, rows 3 and 5 only the right one; z's coefficient is
    1 in all.

    Args:
        a: (6, 6) rows of the gaps.
        b: (6,) right side; replaced by x.

    Returns:
        False if the equations are singular to rounding; b is then not finite.
    """
    p1, p2, p3, p = a[1, 1] - a[0, 1], a[1, 2] - a[0, 2], a[1, 3] - a[0, 3], b[1] - b[0]
    q1, q2, q3, q = _without_bogie(a, b, 0)
    r1, r2, r3, r = _without_bogie(a, b, 1)
    # x = (p Q×R + q R×P + r P×Q) / P·Q×R
    u1, u2, u3 = q2 * r3 - q3 * r2, q3 * r1 - q1 * r3, q1 * r2 - q2 * r1
    v1, v2, v3 = r2 * p3 - r3 * p2, r3 * p1 - r1 * p3, r1 * p2 - r2 * p1
    w1, w2, w3 = p2 * q3 - p3 * q2, p3 * q1 - p1 * q3, p1 * q2 - p2 * q1
    det = p1 * u1 + p2 * u2 + p3 * u3
    roll = (p * u1 + q * v1 + r * w1) / det
    pitch = (p * u2 + q * v2 + r * w2) / det
    rocker = (p * u3 + q * v3 + r * w3) / det
    z = b[0] - a[0, 1] * roll - a[0, 2] * pitch - a[0, 3] * rocker
    m, _ = _pivot(a, 0)
    left = (b[m] - z - a[m, 1] * roll - a[m, 2] * pitch - a[m, 3] * rocker) / a[m, BOGIE_L]
    m, _ = _pivot(a, 1)
    right = (b[m] - z - a[m, 1] * roll - a[m, 2] * pitch - a[m, 3] * rocker) / a[m, BOGIE_R]
    b[0], b[1], b[2], b[3], b[4], b[5] = z, roll, pitch, rocker, left, right
    return math.isfinite(z + left + right)


@njit
def stand_on_hubs(ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, work: Work) -> None:
    """Move q by one Newton step, as if each wheel touched horizontal terrain under its hub.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) pose; replaced. It stays as it is if a wheel lies on its side or the equations are singular.
        work: scratch; work.hub_offsets holds the steering.
    """
    grid, _, meta = ground
    wheels, rows, step = work.wheels, work.rows, work.step
    if not forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, work.axes, work.pivots, wheels):
        return
    for i in range(6):
        w = wheels[i]
        h = surface(grid, meta, w[HX], w[HY])[0]
        low = w[HZ] - w[RADIUS]
        gap_jacobian_row(rover, q, cy, sy, work.axes, work.pivots, i, w[HX] - x, w[HY] - y, low - q[Z], 0.0, 0.0, rows[i])
        step[i] = h - low
    if solve_linkage(rows, step):
        move(q, step)


@njit
def move(q: Array, step: Array) -> None:
    """Add a step to a pose, shortened if an angle of it exceeds `MAX_STEP_ANGLE`.

    Args:
        q: (6,) pose; replaced.
        step: (6,) m and rad.
    """
    big = 0.0
    for k in range(1, 6):
        big = max(big, abs(step[k]))
    scale = min(1.0, MAX_STEP_ANGLE / big) if big > 0.0 else 1.0
    for k in range(6):
        q[k] += scale * step[k]


@inlined
def wheel_extent(w: Array) -> tuple[float, float]:
    """Return half the size of the box around a wheel, along x and y, m.

    Args:
        w: (WHEEL_SIZE,) wheel.
    """
    return (
        w[HALF] * abs(w[AX]) + w[RADIUS] * math.sqrt(w[EX] * w[EX] + w[UX] * w[UX]),
        w[HALF] * abs(w[AY]) + w[RADIUS] * math.sqrt(w[EY] * w[EY] + w[UY] * w[UY]),
    )


@njit
def a_wheel_is_off(meta: Array, wheels: Array) -> bool:
    """Return True if the box around a wheel lies wholly beyond the map's edge.

    `least_gap` finds the same, after the search of the wheels before it.

    Args:
        meta: the map header.
        wheels: (6, WHEEL_SIZE) wheels.
    """
    last_x, last_y = (meta[META_NX] - 1.0) * meta[META_DX], (meta[META_NY] - 1.0) * meta[META_DY]
    for i in range(6):
        x, y = wheels[i, HX], wheels[i, HY]
        far_x, far_y = wheel_extent(wheels[i])
        if x + far_x < 0.0 or x - far_x > last_x or y + far_y < 0.0 or y - far_y > last_y:
            return True
    return False


@njit
def newton(ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, work: Work) -> int:
    """Solve for six zero gaps by Newton's method from q, each gap over the whole tread.

    The contact is searched again at every step. By the envelope theorem the gap's derivative is that of the contact
    alone, and convergence is quadratic. Missing data and the map's edge are passed over on the way: only the pose found
    must have known terrain under its treads.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) start on entry, pose on return.
        work: scratch; work.hub_offsets holds the steering, work.touch the contacts.

    Returns:
        FOUND; OFF or BLANK if a wheel had no known terrain at all under it; these plus FOUND_OVER if a pose was found
        that has a tread over the map's edge or missing data; -1 if Newton's method did not converge; LOST_OFF if a
        tread was over the map's edge at its last step; FAR_AWAY if a wheel stays farther from cubic terrain than twice
        the rover's reach, as beside a wall that is higher than the rover.
    """
    grid, _, meta = ground
    axes, pivots, wheels, rows, step, touch = work.axes, work.pivots, work.wheels, work.rows, work.step, work.touch
    whole, over_edge = True, False
    # without missing data no earlier wheel can lie over it, and a wheel off the map decides
    complete = math.isfinite(meta[META_MAX_CURVATURE if meta[META_CUBIC] != 0.0 else META_STEEP])
    for it in range(STEPS):
        if not forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, axes, pivots, wheels):
            return -1
        if complete and a_wheel_is_off(meta, wheels):
            return OFF
        worst = 0.0
        coverage = FOUND
        for i in range(6):
            t = touch[i]
            code, _ = least_gap(ground, wheels[i], t[SIN], t[COSINE], t[PLACE], whole, -math.inf, t, work.none)
            if code != FOUND:
                if not whole:
                    code, _ = least_gap(ground, wheels[i], t[SIN], t[COSINE], t[PLACE], True, -math.inf, t, work.none)
                if t[GAP] == math.inf:
                    return code
                coverage = code if code != FOUND else coverage
            worst = max(worst, abs(t[GAP]))
        if it >= FAR_STEPS and coverage == FOUND and meta[META_CUBIC] != 0.0 and worst > FAR * reach(rover):
            return FAR_AWAY
        if worst < CONVERGED_GAP:
            if whole:
                return coverage if coverage == FOUND else coverage + FOUND_OVER
            whole = True  # converged on the tracked contacts: search the whole treads for a lower one
            continue
        whole = it >= FOLLOWED or worst < SEARCH_GAP
        for i in range(6):
            t, w = touch[i], wheels[i]
            px, py, pz = tread_point(w, t[SIN], t[COSINE], t[PLACE])
            gx, gy = contact_slope(grid, meta, w, t[SIN], t[COSINE], t[PLACE])
            gap_jacobian_row(
                rover, q, cy, sy, axes, pivots, i, w[HX] - x + px, w[HY] - y + py, w[HZ] - q[Z] + pz, gx, gy, rows[i]
            )
            step[i] = -t[GAP]
        if not solve_linkage(rows, step):
            return -1
        move(q, step)
        over_edge = coverage == OFF
    return LOST_OFF if over_edge else -1


# Codes as rockerbogie.Status
CONVERGED, OFF_MAP, NO_DATA, JOINT_STOP, NOT_CONVERGED, WHEEL_LIFTED, BELLY_CONTACT, TIPPED = range(8)
STEPS = 18  # Newton steps of one start: 3 suffice on smooth terrain, 5 on rough; a cycle shows by then
FOLLOWED = 8  # steps with tracked contacts; the later ones search the whole tread
STARTS = 32
STRAYED = 8  # starts that put a wheel wholly off the known terrain before the search ends
FOUND_OVER = 8  # added to OFF or BLANK
LOST_OFF = -2  # code of a search that cycles with a tread over the map's edge
FAR_AWAY = -3  # code of a search that ends far from the terrain
FAR = 2.0  # times the rover's reach: a start is abandoned if a gap is larger after FAR_STEPS steps
FAR_STEPS = 4
FAR_STARTS = 2  # starts that are abandoned before the search ends
EDGE_STARTS = 3  # starts that may lead to a pose across the map's edge, or cycle there, before the status is OFF_MAP


@njit
def start_pose(ground: Ground, rover: Array, x: float, y: float, attempt: int, q: Array, touch: Array) -> None:
    """Set a start pose.

    The first is horizontal; the others are tilted by a fixed low-discrepancy sequence.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        attempt: index of the attempt, from 0.
        q: (6,) filled.
        touch: (6, CONTACT_SIZE) filled with contacts below the hubs.
    """
    grid, _, meta = ground
    for i in range(6):
        touch[i, GAP], touch[i, SIN], touch[i, COSINE], touch[i, PLACE] = 0.0, 0.0, 1.0, 0.0
    height = surface(grid, meta, x, y)[0]
    if math.isnan(height):
        height = 0.0  # missing data under the body alone: start at the datum
    q[Z] = height + rover[P_RADIUS] - rover[P_HUB + 2] - rover[P_PIVOT + 2]
    spread = 0.2 + 0.2 * (attempt % 3)
    share = 1.0
    for k in range(1, 6):
        share *= 0.8812714616335696  # powers of 1 / the root of t^6 = t + 1 fill five dimensions evenly
        part = 0.5 + attempt * share
        q[k] = 2.0 * spread * (part - math.floor(part) - 0.5)


@njit
def settle_contact(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, first: int, q: Array, work: Work
) -> tuple[int, int]:
    """Find a pose whose six gaps are zero, by Newton's method from a fixed sequence of starts.

    The first start is horizontal. If the contacts of a wheel alternate, Newton's method may cycle; the next start then
    has another attitude. The first start that leads to an upright pose over known terrain counts: the answer depends on the
    arguments alone.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        first: start of the sequence to begin with, 0 to STARTS - 1.
        q: (6,) filled with the pose, NaN if none is found.
        work: scratch; work.hub_offsets holds the steering.

    Returns:
        Status code, CONVERGED, JOINT_STOP, NOT_CONVERGED, OFF_MAP or NO_DATA; the start that led to the pose, STARTS if none did.
    """
    strayed, edges, far, over = 0, 0, 0, FOUND
    for attempt in range(first, STARTS):
        start_pose(ground, rover, x, y, attempt, q, work.touch)
        if attempt == 0:
            stand_on_hubs(ground, rover, x, y, cy, sy, q, work)
        code = newton(ground, rover, x, y, cy, sy, q, work)
        if code == OFF or code == BLANK:
            strayed, over = strayed + 1, code
            if strayed == STRAYED:
                break
        elif code == FAR_AWAY:
            far += 1
            if far == FAR_STARTS:
                break
        elif code > FOUND_OVER or code == LOST_OFF:
            over = OFF if code == LOST_OFF else code - FOUND_OVER
            edges += over == OFF
            if edges == EDGE_STARTS:
                break
        elif code == FOUND and max(max(abs(q[1]), abs(q[2])), max(abs(q[3]), max(abs(q[4]), abs(q[5])))) < MAX_ANGLE:
            return (JOINT_STOP if beyond_stops(rover, q) else CONVERGED), attempt
    q[:] = math.nan
    return (NOT_CONVERGED if over == FOUND else (OFF_MAP if over == OFF else NO_DATA)), STARTS


@njit
def beyond_stops(rover: Array, q: Array) -> bool:
    """Return True if a joint is beyond its limit.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
    """
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        if not rover[at] <= q[ROCKER + k] <= rover[at + 1]:
            return True
    return False


@owning_njit
def covered(ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, with_box: bool, work: Work) -> bool:
    """Return True if all treads of a pose lie over known terrain, and the box if it matters.

    Args:
        ground: terrain.
        rover: packed rover (linkage.py).
        x, y: m, the body's reference point from the map's first node.
        cy, sy: cos and sin of the heading.
        q: (6,) pose.
        with_box: True if the body's box matters.
        work: scratch; work.hub_offsets holds the steering.
    """
    if not forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, work.axes, work.pivots, work.wheels):
        return False
    for i in range(6):
        code, _ = least_gap(ground, work.wheels[i], 0.0, 1.0, 0.0, True, -math.inf, work.lowest, work.none)
        if code != FOUND:
            return False
    if not with_box:
        return True
    near = np.empty((NEAR_ROOM, NEAR_SIZE))
    code, _ = box_over_ground(ground, rover[P_BOX : P_BOX + 6], work.axes, x, y, q[Z], 0.0, near)
    return code == FOUND
