"""All contacts and near contacts of a rover: of every wheel and of the body's box."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import Ground
from ..model.linkage import P_BOX, P_RADIUS, Z, forward_kinematics, gap_jacobian_row
from ..model.wheel import COSINE, GAP, HX, HY, HZ, PLACE, RADIUS, SIN, contact_slope, tread_point
from ..search.body_box import box_over_ground
from ..search.box_points import N_GAP, N_GX, N_GY, N_X, N_Y, N_Z, NEAR_ROOM, NEAR_SIZE, least_clearance
from ..search.tread import FOUND, ROOM, least_gap
from ..search.workspace import Work

Array = NDArray[np.float64]

NEAR = 0.05  # of the smallest wheel's radius: places whose gap exceeds a wheel's least by up to this are listed
LISTED = 6 * (ROOM + 1) + NEAR_ROOM  # how many there may be


@njit
def lowest_contacts(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, note: bool, work: Work
) -> tuple[int, float]:
    """Search the lowest tread point of each wheel.

    Missing data and the map's edge are passed over: only known terrain counts.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) pose.
        note: True to replace the contacts of work.touch, False to leave them.
        work: scratch; work.touch holds the contacts to start from, work.hub_offsets the steering.

    Returns:
        FOUND, OFF or BLANK (part of a tread lies off the map or over missing data), and the lowest gap, m; inf if a wheel
        has no known terrain under it, or (code -1) lies on its side.
    """
    if not forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, work.axes, work.pivots, work.wheels):
        return -1, math.inf
    coverage, least, lowest = FOUND, math.inf, work.lowest
    for i in range(6):
        t = work.touch[i]
        code, _ = least_gap(ground, work.wheels[i], t[SIN], t[COSINE], t[PLACE], True, -math.inf, lowest, work.none)
        if lowest[GAP] == math.inf:
            return code, math.inf
        coverage, least = max(coverage, code), min(least, lowest[GAP])
        if note:
            t[GAP], t[SIN], t[COSINE], t[PLACE] = lowest[GAP], lowest[SIN], lowest[COSINE], lowest[PLACE]
    return coverage, least


@njit
def near_margin(rover: Array) -> float:
    """Return the largest height of a listed contact above the lowest of its wheel or body, m.

    Args:
        rover: (P_SIZE,) packed rover.
    """
    margin = math.inf
    for i in range(6):
        margin = min(margin, NEAR * rover[P_RADIUS + i])
    return margin


@njit
def list_wheel(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, i: int, kept: int, work: Work,
    gap: Array, rows: Array, owner: NDArray[np.int64], count: int,
) -> int:  # fmt: skip
    """List the lowest contact of a wheel and those found beside it, without duplicates.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) pose at which `work` was filled.
        i: wheel.
        kept: number of local minima in work.contacts.
        work: scratch; work.touch[i] holds the lowest contact and its gap.
        gap, rows, owner: lists as of `touch_down`.
        count: number of contacts listed so far.

    Returns:
        The new number of contacts.
    """
    grid, _, meta = ground
    w, contacts = work.wheels[i], work.contacts
    low, sine, cosine, place = work.touch[i, GAP], work.touch[i, SIN], work.touch[i, COSINE], work.touch[i, PLACE]
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
            rover, q, cy, sy, work.axes, work.pivots, i, w[HX] - x + px, w[HY] - y + py, w[HZ] - q[Z] + pz, gx, gy, rows[count]
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
    return count


@njit
def list_contacts(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, near: Array, points: int, work: Work,
    gap: Array, rows: Array, owner: NDArray[np.int64],
) -> int:  # fmt: skip
    """List the near contacts of all wheels and of the body.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) pose of the last call of `lowest_contacts`.
        near: (n, NEAR_SIZE) points of the body's box near the terrain.
        points: their number.
        work: scratch as `lowest_contacts` left it.
        gap, rows, owner: filled as `touch_down` fills them.

    Returns:
        Number of contacts listed.
    """
    count, margin = 0, near_margin(rover)
    for i in range(6):
        t = work.touch[i]
        _, kept = least_gap(
            ground, work.wheels[i], t[SIN], t[COSINE], t[PLACE], True, t[GAP] + margin, work.lowest, work.contacts
        )
        count = list_wheel(ground, rover, x, y, cy, sy, q, i, kept, work, gap, rows, owner, count)
    for k in range(points):
        gap_jacobian_row(
            rover, q, cy, sy, work.axes, work.pivots, 0, near[k, N_X], near[k, N_Y], near[k, N_Z], near[k, N_GX], near[k, N_GY],
            rows[count],
        )  # fmt: skip
        rows[count, 3:] = 0.0
        gap[count], owner[count] = near[k, N_GAP], 6
        count += 1
    return count


@njit
def body_contacts(ground: Ground, rover: Array, x: float, y: float, q: Array, work: Work, near: Array) -> tuple[int, int, float]:
    """List the points of the body's box near the terrain.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        q: (6,) pose.
        work: scratch; work.axes holds the body's directions.
        near: (NEAR_ROOM, NEAR_SIZE) filled.

    Returns:
        FOUND, OFF or BLANK as `box_over_ground`, the number of points listed, and the lowest gap, m; inf if none is listed.
    """
    code, points = box_over_ground(ground, rover[P_BOX : P_BOX + 6], work.axes, x, y, q[Z], near_margin(rover), near)
    return code, points, least_clearance(near, points)


@njit
def shift_to_contact(q: Array, gap: Array, count: int, least: float) -> None:
    """Lower z and all gaps by the lowest gap.

    Args:
        q: (6,) pose; z is changed.
        gap: (count,) gaps, m; changed.
        count: number of contacts.
        least: lowest gap, m.
    """
    q[Z] -= least
    for k in range(count):
        gap[k] -= least


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
    near = np.empty((NEAR_ROOM, NEAR_SIZE))
    coverage, least = lowest_contacts(ground, rover, x, y, cy, sy, q, full, work)
    if least == math.inf:
        return coverage, -1
    code, points, clearance = body_contacts(ground, rover, x, y, q, work, near)
    count = list_contacts(ground, rover, x, y, cy, sy, q, near, points, work, gap, rows, owner) if full else 0
    shift_to_contact(q, gap, count, min(least, clearance))
    return max(coverage, code), count
