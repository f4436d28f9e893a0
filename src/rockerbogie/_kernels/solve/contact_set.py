"""All contacts and near contacts of a rover: of every wheel and of the body's box."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import Ground
from ..model.linkage import P_BOX, P_RADIUS, Z, forward_kinematics, gap_jacobian_row
from ..model.wheel import COSINE, GAP, HX, HY, HZ, PLACE, RADIUS, SIN, contact_slope, tread_point
from ..search.body_box import N_GAP, N_GX, N_GY, N_X, N_Y, N_Z, NEAR_ROOM, NEAR_SIZE, box_over_ground
from ..search.tread import FOUND, ROOM, least_gap
from ..search.workspace import Work

Array = NDArray[np.float64]

NEAR = 0.05  # of the smallest wheel's radius: places whose gap exceeds a wheel's least by up to this are listed
LISTED = 6 * (ROOM + 1) + NEAR_ROOM  # how many there may be


@njit
def touch_down(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, full: bool, work: Work,
    gap: Array, rows: Array, owner: NDArray[np.int64],
) -> tuple[int, int]:  # fmt: skip
    """Shift q's z so that the rover just touches, and list its near contacts.

    Missing data and the map's edge are passed over: only known terrain is touched.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) pose; its z is changed.
        full: if False only z is changed.
        work: scratch; work.touch holds the contacts to start from, work.hub_offsets the steering.
        gap: (LISTED,) filled with gaps, m.
        rows: (LISTED, 6) filled with the change of each gap per unit of each unknown.
        owner: (LISTED,) filled with the wheel, or 6 for the body.

    Returns:
        FOUND, OFF or BLANK (part of a tread or of the box lies off the map or over missing data), and the number of
        contacts listed;
        -1 contacts if a wheel has no known terrain under it, or (code -1) lies on its side.
    """
    lowest, contacts, axes, pivots, wheels = work.lowest, work.contacts, work.axes, work.pivots, work.wheels
    near = np.empty((NEAR_ROOM, NEAR_SIZE))
    grid, _, meta = ground
    if not forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, axes, pivots, wheels):
        return -1, -1
    coverage, count = FOUND, 0
    least = margin = math.inf
    for i in range(6):
        margin = min(margin, NEAR * rover[P_RADIUS + i])
    for i in range(6):
        w = wheels[i]
        t = work.touch[i]
        code, kept = least_gap(ground, w, t[SIN], t[COSINE], t[PLACE], True, -math.inf, lowest, work.none)
        if lowest[GAP] == math.inf:
            return code, -1
        coverage = max(coverage, code)
        least = min(least, lowest[GAP])
        if not full:
            continue
        low = lowest[GAP]
        sine, cosine, place = lowest[SIN], lowest[COSINE], lowest[PLACE]
        t[SIN], t[COSINE], t[PLACE] = sine, cosine, place
        code, kept = least_gap(ground, w, sine, cosine, place, True, low + margin, lowest, contacts)
        first = count
        for k in range(-1, kept):
            if k < 0:
                g, sp, cp, s = low, sine, cosine, place
            else:
                g, sp, cp, s = contacts[k, GAP], contacts[k, SIN], contacts[k, COSINE], contacts[k, PLACE]
                twin = (abs(sp - sine) + abs(cp - cosine)) * w[RADIUS] + abs(s - place) < 1e-6
                if twin:
                    continue
            px, py, pz = tread_point(w, sp, cp, s)
            gx, gy = contact_slope(grid, meta, w, sp, cp, s)
            gap_jacobian_row(
                rover, q, cy, sy, axes, pivots, i, w[HX] - x + px, w[HY] - y + py, w[HZ] - q[Z] + pz, gx, gy, rows[count]
            )
            gap[count], owner[count] = g, i
            same = False
            for j in range(first, count):
                alike = abs(gap[j] - g)
                for e in range(6):
                    alike += abs(rows[j, e] - rows[count, e])
                same |= alike < 1e-9
            if not same:
                count += 1
    code, n = box_over_ground(ground, rover[P_BOX : P_BOX + 6], axes, x, y, q[Z], margin, near)
    coverage = max(coverage, code)
    for k in range(n):
        least = min(least, near[k, N_GAP])
        if full:
            gap_jacobian_row(
                rover,
                q,
                cy,
                sy,
                axes,
                pivots,
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
    return coverage, count
