"""Local minima of the gaps beside the first contacts: what may be further contacts."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.ground import Ground
from ..model.linkage import ROCKER, Z, right_rocker
from ..model.wheel import COSINE, GAP, HALF, PLACE, SIN, gap_at
from ..search.tread import least_gap
from ..search.workspace import Work
from ..statics.balance import EQUATIONS, NORMAL, SIDE, TRACTION, contact_columns
from .balance_residual import Law, Motion
from .further_state import MOST, WAYS, Further, rate_of
from .linear import copy_numbers
from .station import Station, link_column, place_contact, to_contacts, to_rates

Array = NDArray[np.float64]

BACK, RISE = 0.1, 1e-9  # share of the way to the first contact, and m by which the gap is larger there
LINE = 1e-3  # rad: ends of a line across the tread are apart by less
CLOSING = 1e-6  # of the reference speed: a contact that closes faster than its gap allows by this is added to the balance
STRAIGHT = 1e-6  # m: terrain that is convex by less between two contacts is straight


@njit
def is_apart(grid: Array, meta: Array, w: Array, first: Array, c: Array) -> bool:
    """Return True if a point of the tread is a contact of its own beside the first contact.

    The gap rises from it towards the first contact; or both are the ends of a line across the tread on straight terrain. Other
    points listed are the lowest of their cells only, to which the first contact moves as the wheel rolls.

    Args:
        grid, meta: terrain.
        w: (WHEEL_SIZE,) wheel.
        first, c: (CONTACT_SIZE,) the first contact and the point.
    """
    if gap_between(grid, meta, w, first, c, BACK) > c[GAP] + RISE:
        return True
    turned, across = abs(c[SIN] - first[SIN]) + abs(c[COSINE] - first[COSINE]), abs(c[PLACE] - first[PLACE])
    if turned > LINE or across < w[HALF]:
        return False
    return gap_between(grid, meta, w, first, c, 0.5) > 0.5 * (c[GAP] + first[GAP]) - STRAIGHT


@inlined
def gap_between(grid: Array, meta: Array, w: Array, first: Array, c: Array, share: float) -> float:
    """Return the gap at a point of the tread between two others, m.

    Args:
        grid, meta: terrain.
        w: (WHEEL_SIZE,) wheel.
        first, c: (CONTACT_SIZE,) the points.
        share: of the way from c to the first.
    """
    sine, cosine = c[SIN] + share * (first[SIN] - c[SIN]), c[COSINE] + share * (first[COSINE] - c[COSINE])
    size = math.sqrt(sine * sine + cosine * cosine)
    return gap_at(grid, meta, w, sine / size, cosine / size, c[PLACE] + share * (first[PLACE] - c[PLACE]))


@njit
def list_minima(ground: Ground, raised: Array, reach: float, work: Work, further: Further) -> int:
    """List the local minima of the gaps beside the first contacts.

    Args:
        ground: terrain.
        raised: (6,) gaps of the wheels, m; wheels off the ground have no further contact.
        reach: m, largest gap listed.
        work: as the settle of the pose left it.
        further: minima and listed are filled.

    Returns:
        The largest number of minima of a wheel.
    """
    grid, _, meta = ground
    most = 0
    for i in range(6):
        further.listed[i] = 0
        t, w = work.touch[i], work.wheels[i]
        if raised[i] > 0.0:
            continue
        _, count = least_gap(ground, w, t[SIN], t[COSINE], t[PLACE], True, t[GAP] + reach, work.lowest, work.contacts)
        for k in range(count):
            c = work.contacts[k]
            if is_apart(grid, meta, w, t, c):
                copy_numbers(c, further.minima[i, further.listed[i]])
                further.listed[i] += 1
        most = max(most, further.listed[i])
    return most


@njit
def take_level(ground: Ground, rover: Array, x: float, y: float, level: int, work: Work, s: Station, further: Further) -> None:
    """Fill the generalized forces of unit forces at one minimum of each wheel.

    Args:
        ground, rover: the packed terrain and rover.
        x, y: m, the body's origin from the map's first node.
        level: index of the minimum.
        work: as the settle of the pose left it.
        s: of the pose.
        further: minima are read; point, normal, columns and frame are filled.
    """
    grid, _, meta = ground
    for i in range(6):
        further.point[i, 0] = math.nan
        if level >= further.listed[i]:
            continue
        w, t = work.wheels[i], further.minima[i, level]
        place_contact(grid, meta, w, t[SIN], t[COSINE], t[PLACE], x, y, s.q[Z], further.point[i], further.normal[i])
    contact_columns(rover, s.q, work.axes, work.pivots, s.wheels, further.point, further.normal, further.columns, further.frame)


@njit
def fill_ways(s: Station, rover: Array, cy: float, sy: float, i: int, axes: Array, further: Further) -> None:
    """Fill the ways of a wheel's minimum from its columns.

    Args:
        s: of the pose.
        rover: (P_SIZE,) packed rover.
        cy, sy: cos and sin of yaw.
        i: wheel.
        axes: (3, 3) the body's directions.
        further: columns are read; trial is filled.
    """
    ways, column = further.trial, s.column
    to_rates(further.columns[i, NORMAL], axes, cy, sy, ways[0])
    to_rates(further.columns[i, TRACTION], axes, cy, sy, ways[1])
    to_rates(further.columns[i, SIDE], axes, cy, sy, ways[2])
    _, slope = right_rocker(rover, s.q[ROCKER])
    link_column(s, slope, i, axes, column)
    to_rates(column, axes, cy, sy, ways[3])
    for k in range(WAYS):
        to_contacts(s, ways[k])


@njit
def add_closing(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, levels: int, span: float, law: Law, work: Work,
    s: Station, m: Motion, further: Further,
) -> bool:  # fmt: skip
    """Add the contact of each wheel that closes fastest to the balance.

    It is added if its gap would vanish before the end of the step.

    Args:
        ground, rover: the packed terrain and rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        levels: largest number of minima of a wheel.
        span: duration of the next step, s.
        law: of the wheels.
        work, s, m: of the pose and its motion.
        further: minima are read; size, wheel, ways, gap and z are changed where a contact is added.

    Returns:
        True if a contact was added.
    """
    first = further.size[0]
    for i in range(6):
        further.room[i], further.slot[i] = -CLOSING * law.speed, -1
    for level in range(levels):
        take_level(ground, rover, x, y, level, work, s, further)
        for i in range(6):
            if level >= further.listed[i] or (further.slot[i] < 0 and further.size[0] == MOST):
                continue
            fill_ways(s, rover, cy, sy, i, work.axes, further)
            gap = max(further.minima[i, level, GAP] - work.touch[i, GAP], 0.0)
            room = rate_of(further.trial[0], m.y) + gap / span
            if room < further.room[i]:
                if further.slot[i] < 0:
                    further.slot[i] = further.size[0]
                    further.size[0] += 1
                e = further.slot[i]
                for k in range(WAYS):
                    copy_numbers(further.trial[k], further.ways[e, k])
                further.room[i], further.gap[e], further.wheel[e], further.z[EQUATIONS + e] = room, gap, i, 0.0
    return further.size[0] > first
