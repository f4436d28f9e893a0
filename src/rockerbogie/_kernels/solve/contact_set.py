"""All contacts and near contacts of a rover: of every wheel and of the body's box."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.linkage import P_BOX, P_RADIUS, Z, forward_kinematics, gap_jacobian_row
from ..model.wheel import COSINE, GAP, HX, HY, HZ, PLACE, RADIUS, SIN, contact_slope, tread_point
from ..search.body_box import box_over_ground
from ..search.box_points import N_GAP, N_GX, N_GY, N_X, N_Y, N_Z, NEAR_ROOM, NEAR_SIZE, least_clearance
from ..search.tread import FOUND, least_gap
from .site import Contacts, Site

Array = NDArray[np.float64]

NEAR = 0.05  # of the smallest wheel's radius: places whose gap exceeds a wheel's least by up to this are listed


@njit
def lowest_contacts(site: Site, q: Array, note: bool) -> tuple[int, float]:
    """Search the lowest tread point of each wheel.

    Missing data and the map's edge are passed over: only known terrain counts.

    Args:
        site: rover, position and terrain.
        q: (6,) pose.
        note: True to replace the contacts of work.touch, from which the search starts; False to leave them.

    Returns:
        FOUND, OFF or BLANK (part of a tread lies off the map or over missing data), and the lowest gap, m; inf if a wheel
        has no known terrain under it, or (code -1) lies on its side.
    """
    ground, rover, x, y, cy, sy, work = site
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
def list_wheel(site: Site, q: Array, i: int, kept: int, contacts: Contacts, count: int) -> int:
    """List the lowest contact of a wheel and those found beside it, without duplicates.

    Args:
        site: rover, position and terrain.
        q: (6,) pose at which the site's `work` was filled; work.touch[i] holds the lowest contact and its gap.
        i: wheel.
        kept: number of local minima in work.contacts.
        contacts: the list.
        count: number of contacts listed so far.

    Returns:
        The new number of contacts.
    """
    ground, rover, x, y, cy, sy, work = site
    gap, rows, owner = contacts
    grid, _, meta = ground
    w, minima = work.wheels[i], work.contacts
    low, sine, cosine, place = work.touch[i, GAP], work.touch[i, SIN], work.touch[i, COSINE], work.touch[i, PLACE]
    first = count
    for k in range(-1, kept):
        if k < 0:
            g, sp, cp, s = low, sine, cosine, place
        else:
            g, sp, cp, s = minima[k, GAP], minima[k, SIN], minima[k, COSINE], minima[k, PLACE]
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
def list_contacts(site: Site, q: Array, near: Array, points: int, contacts: Contacts) -> int:
    """List the near contacts of all wheels and of the body.

    Args:
        site: rover, position and terrain.
        q: (6,) pose of the last call of `lowest_contacts`.
        near: (n, NEAR_SIZE) points of the body's box near the terrain.
        points: their number.
        contacts: filled.

    Returns:
        Number of contacts listed.
    """
    ground, rover, _, _, cy, sy, work = site
    gap, rows, owner = contacts
    count, margin = 0, near_margin(rover)
    for i in range(6):
        t = work.touch[i]
        _, kept = least_gap(
            ground, work.wheels[i], t[SIN], t[COSINE], t[PLACE], True, t[GAP] + margin, work.lowest, work.contacts
        )
        count = list_wheel(site, q, i, kept, contacts, count)
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
def body_contacts(site: Site, q: Array, near: Array) -> tuple[int, int, float]:
    """List the points of the body's box near the terrain.

    Args:
        site: rover, position and terrain; its work.axes holds the body's directions.
        q: (6,) pose.
        near: (NEAR_ROOM, NEAR_SIZE) filled.

    Returns:
        FOUND, OFF or BLANK as `box_over_ground`, the number of points listed, and the lowest gap, m; inf if none is listed.
    """
    box = site.rover[P_BOX : P_BOX + 6]
    code, points = box_over_ground(site.ground, box, site.work.axes, site.x, site.y, q[Z], near_margin(site.rover), near)
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


@owning_njit
def touch_down(site: Site, q: Array, full: bool, contacts: Contacts) -> tuple[int, int]:
    """Shift q's z so that the rover just touches, and list its near contacts.

    Missing data and the map's edge are passed over: only known terrain is touched.

    Args:
        site: rover, position and terrain.
        q: (6,) pose; its z is changed.
        full: if False only z is changed.
        contacts: room for LISTED contacts; filled.

    Returns:
        FOUND, OFF or BLANK (part of a tread or of the box lies off the map or over missing data), and the number of
        contacts listed;
        -1 contacts if a wheel has no known terrain under it, or (code -1) lies on its side.
    """
    near = np.empty((NEAR_ROOM, NEAR_SIZE))
    coverage, least = lowest_contacts(site, q, full)
    if least == math.inf:
        return coverage, -1
    code, points, clearance = body_contacts(site, q, near)
    count = list_contacts(site, q, near, points, contacts) if full else 0
    shift_to_contact(q, contacts.gap, count, min(least, clearance))
    return max(coverage, code), count
