"""Settling from a nearby pose: tracked contacts, and searches of whole treads."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import META_CUBIC, Ground
from ..model.linkage import Z, forward_kinematics, gap_jacobian_row
from ..model.tolerances import CONVERGED_GAP, MAX_ANGLE
from ..model.wheel import COSINE, GAP, HX, HY, HZ, PLACE, SIN, contact_slope, tread_point
from ..search.tread import FOUND, least_gap
from ..search.verify_minimum import LOWER, UNKNOWN, is_least
from ..search.workspace import Work
from ..solve.newton import move, solve_linkage
from .linear import copy_numbers
from .track import track_contact

Array = NDArray[np.float64]

TRACKED = 6  # Newton steps with tracked contacts; 2 or 3 suffice near the pose
PATIENCE = 3  # the same on bilinear terrain, where a contact is tracked in its cell alone, before a whole search
SEARCHES = 5  # whole searches before the search from afar takes over
TRACKED_GAP = 1e-8  # m: a gap at the end of a solve whose treads are not searched


@njit
def settle_near(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, anew: bool, search: bool, raised: Array,
    work: Work,
) -> bool:  # fmt: skip
    """Solve for six gaps by Newton's method from a pose nearby.

    Contacts are searched with each wheel lowered by the gap that it is to have.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) start, replaced by the pose.
        anew: True if contacts may have left their cells: on bilinear terrain, whole treads are searched first.
        search: True to search the whole treads at the end; False to rely on the tracked contacts.
        raised: (6,) gaps of the pose, m.
        work: work.touch holds the contacts near the pose, work.hub_offsets the steering; touch, wheels, axes and pivots are
            left at the pose, wheels lowered by `raised`.

    Returns:
        False if no pose was found, or if a tread lies over the map's edge or missing data.
    """
    grid, _, meta = ground
    axes, pivots, wheels, rows, step, touch = work.axes, work.pivots, work.wheels, work.rows, work.step, work.touch
    cubic = meta[META_CUBIC] != 0.0
    whole, steps, searches = anew and not cubic, 0, 0
    most = CONVERGED_GAP if search else TRACKED_GAP
    while steps <= TRACKED and searches < SEARCHES:
        if not forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, axes, pivots, wheels):
            return False
        for i in range(6):
            wheels[i, HZ] -= raised[i]
        worst = 0.0
        for i in range(6):
            t = touch[i]
            if not cubic:
                code, _ = least_gap(ground, wheels[i], t[SIN], t[COSINE], t[PLACE], whole, -math.inf, t, work.none)
                if code != FOUND:
                    return False
            elif not track_contact(grid, meta, wheels[i], t):
                return False
            worst = max(worst, abs(t[GAP]))
        searches += whole
        if worst < most:
            if cubic and search:
                searches += 1
                code = 0
                for i in range(6):
                    t = touch[i]
                    found = is_least(ground, wheels[i], t[SIN], t[COSINE], t[PLACE], work.lowest, work.none)
                    if found == UNKNOWN:
                        return False
                    if found == LOWER:
                        copy_numbers(work.lowest, t)
                        code = LOWER
                if code == LOWER:
                    steps = 0
                    continue
            if whole or cubic or not search:
                return max(max(abs(q[1]), abs(q[2])), max(abs(q[3]), max(abs(q[4]), abs(q[5])))) < MAX_ANGLE
            whole = True
            continue
        steps = 0 if whole else steps + 1
        whole = not cubic and steps > PATIENCE
        for i in range(6):
            t, w = touch[i], wheels[i]
            px, py, pz = tread_point(w, t[SIN], t[COSINE], t[PLACE])
            gx, gy = contact_slope(grid, meta, w, t[SIN], t[COSINE], t[PLACE])
            gap_jacobian_row(
                rover, q, cy, sy, axes, pivots, i, w[HX] - x + px, w[HY] - y + py, w[HZ] + raised[i] - q[Z] + pz, gx, gy, rows[i]
            )
            step[i] = -t[GAP]
        if not solve_linkage(rows, step):
            return False
        move(q, step)
    return False
