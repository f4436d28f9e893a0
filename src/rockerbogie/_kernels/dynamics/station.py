"""The balance of a rover at one pose, in the rates of its position, heading and contacts.

Of the nine generalized velocities, x, y and yaw rates w are free. The other six follow from the lift rates of the six contacts
(0 while a wheel stays on the terrain). In these coordinates (w, lift rates) a unit normal force is a unit vector.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.ground import Ground
from ..model.linkage import ROCKER, Z, right_rocker
from ..model.wheel import AX, AY, AZ, COSINE, GAP, HALF, HX, HY, HZ, PLACE, SIN, contact_slope, gap_at, tread_point
from ..search.workspace import Work
from ..statics.balance import EQUATIONS, NORMAL, SIDE, TRACTION, contact_columns, weight_column
from .linear import copy_numbers, decompose, solve, solve_transposed

Array = NDArray[np.float64]

FREE = 3  # rates of x, y and yaw
FLUSH = 1e-9  # m: a tread whose edge and middle are closer to the terrain than this is in contact over its width


class Station(NamedTuple):
    """Work arrays of one pose."""

    q: Array  # (6,) pose with the body's origin at height 0
    wheels: Array  # (6, HALF + 1) wheels with the body's origin at (0, 0, 0)
    point: Array  # (6, 3) contact points from the body's origin, m
    normal: Array  # (6, 3) unit normals into the wheel
    columns: Array  # (6, 3, 9) generalized forces of unit normal force, traction and side force
    frame: Array  # (6, 3, 3) directions of the three, one a row
    weight: Array  # (9,) generalized force of gravity, N and N m
    lift: Array  # (6, 6) lift rate of each contact by the rates of z, roll, pitch, rocker and bogies; then its factors
    order: NDArray[np.int64]  # (6,) row exchanges of `lift`
    drift: Array  # (6, 3) lift rate of each contact by w
    ways: Array  # (6, 3, 9) velocity of each contact by (w, lift rates): forward, to the left, and the link's rate about the
    # axle; also the generalized forces of unit traction, side force and torque about the axle
    pull: Array  # (9,) generalized force of gravity over the weight
    column: Array  # (9,) scratch


STATION_SIZE = 6 + 6 * (HALF + 1) + 18 + 18 + 18 * EQUATIONS + 54 + EQUATIONS + 36 + 6 * FREE + 18 * EQUATIONS + 2 * EQUATIONS


@owning_njit
def new_station(buffer: Array, order: NDArray[np.int64]) -> Station:
    """Return work arrays as unowned views into a buffer.

    Args:
        buffer: (STATION_SIZE,) memory; the caller must keep it alive.
        order: (6,) memory, the same.
    """
    b, n = unowned_view(buffer), 0
    q = b[n : n + 6]
    n += 6
    wheels = b[n : n + 6 * (HALF + 1)].reshape(6, HALF + 1)
    n += 6 * (HALF + 1)
    point = b[n : n + 18].reshape(6, 3)
    n += 18
    normal = b[n : n + 18].reshape(6, 3)
    n += 18
    columns = b[n : n + 18 * EQUATIONS].reshape(6, 3, EQUATIONS)
    n += 18 * EQUATIONS
    frame = b[n : n + 54].reshape(6, 3, 3)
    n += 54
    weight = b[n : n + EQUATIONS]
    n += EQUATIONS
    lift = b[n : n + 36].reshape(6, 6)
    n += 36
    drift = b[n : n + 6 * FREE].reshape(6, FREE)
    n += 6 * FREE
    ways = b[n : n + 18 * EQUATIONS].reshape(6, 3, EQUATIONS)
    n += 18 * EQUATIONS
    pull = b[n : n + EQUATIONS]
    n += EQUATIONS
    column = b[n : n + EQUATIONS]
    return Station(q, wheels, point, normal, columns, frame, weight, lift, unowned_view(order), drift, ways, pull, column)


@njit
def place_contact(
    grid: Array, meta: Array, w: Array, sine: float, cosine: float, place: float, x: float, y: float, z: float,
    point: Array, normal: Array,
) -> None:  # fmt: skip
    """Fill the place and the normal of a contact.

    Args:
        grid, meta: terrain.
        w: (WHEEL_SIZE,) wheel.
        sine, cosine, place: the contact.
        x, y, z: m, the body's origin from the map's first node and the datum.
        point: (3,) filled, m from the body's origin.
        normal: (3,) filled with the unit normal into the wheel.
    """
    ox, oy, oz = tread_point(w, sine, cosine, place)
    point[0], point[1], point[2] = w[HX] + ox - x, w[HY] + oy - y, w[HZ] + oz - z
    gx, gy = contact_slope(grid, meta, w, sine, cosine, place)
    size = math.sqrt(1.0 + gx * gx + gy * gy)
    normal[0], normal[1], normal[2] = -gx / size, -gy / size, 1.0 / size


@njit
def take_contacts(ground: Ground, x: float, y: float, z: float, raised: Array, work: Work, s: Station) -> None:
    """Fill contact points and normals from the contacts of a settled pose.

    If a tread is in contact over its width, its middle is the contact. The contact of a wheel off the ground is the point of its
    tread that is nearest to the ground.

    Args:
        ground: terrain.
        x, y, z: m, the body's origin from the map's first node and the datum.
        raised: (6,) gaps, m.
        work: `touch` and `wheels` are those of the pose, wheels lowered by `raised`.
        s: work arrays; wheels, point and normal are filled.
    """
    grid, _, meta = ground
    for i in range(6):
        w, t = work.wheels[i], work.touch[i]
        place = t[PLACE]
        if place != 0.0 and abs(place) == w[HALF]:
            far = gap_at(grid, meta, w, t[SIN], t[COSINE], -place)
            if max(far, gap_at(grid, meta, w, t[SIN], t[COSINE], 0.0)) <= t[GAP] + FLUSH:
                place = 0.0
        copy_numbers(w[: HALF + 1], s.wheels[i])
        s.wheels[i, HZ] += raised[i]
        place_contact(grid, meta, s.wheels[i], t[SIN], t[COSINE], place, x, y, z, s.point[i], s.normal[i])


@njit
def to_rates(c: Array, axes: Array, cy: float, sy: float, out: Array) -> None:
    """Return a generalized force in the coordinates of the pose.

    They are x, y, yaw, z, roll, pitch, rocker and bogies.

    Args:
        c: (9,) force, moment about the body's origin in the world, left rocker, bogies.
        axes: (3, 3) the body's directions.
        cy, sy: cos and sin of yaw.
        out: (9,) filled.
    """
    out[0], out[1], out[2], out[3] = c[0], c[1], c[5], c[2]
    out[4] = axes[0, 0] * c[3] + axes[0, 1] * c[4] + axes[0, 2] * c[5]
    out[5] = -sy * c[3] + cy * c[4]
    out[6], out[7], out[8] = c[6], c[7], c[8]


@njit
def to_contacts(s: Station, out: Array) -> None:
    """Replace a generalized force in x, y, yaw, z, … by that in (w, lift rates).

    Args:
        s: `lift` holds the factors.
        out: (9,) in the coordinates of `to_rates`; replaced.
    """
    solve_transposed(s.lift, s.order, out[FREE:])
    for k in range(FREE):
        for i in range(6):
            out[k] -= s.drift[i, k] * out[FREE + i]


@inlined
def link_column(s: Station, slope: float, i: int, axes: Array, column: Array) -> None:
    """Fill the generalized force of a unit torque about a wheel's axle on its link.

    Args:
        s: of the pose.
        slope: derivative of the right rocker angle with respect to the left one.
        i: wheel.
        axes: (3, 3) the body's directions.
        column: (9,) filled.
    """
    ax, ay, az = s.wheels[i, AX], s.wheels[i, AY], s.wheels[i, AZ]
    turn = axes[1, 0] * ax + axes[1, 1] * ay + axes[1, 2] * az
    column[:] = 0.0
    column[3], column[4], column[5] = ax, ay, az
    column[6] = turn * (1.0 if i % 2 == 0 else slope)
    if i >= 2:
        column[7 + i % 2] = turn


@njit
def balance_at(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, raised: Array, gravity: float,
    couples: bool, work: Work, s: Station,
) -> float:  # fmt: skip
    """Fill the balance equations of a settled pose.

    Args:
        ground, rover: the packed terrain and rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) pose, z from the datum.
        raised: (6,) gaps of its wheels, m.
        gravity: m/s².
        couples: True to fill the third row of `ways` too.
        work: as the settle of this pose left it.
        s: work arrays, filled.

    Returns:
        The rover's weight, N; 0 if the contacts do not determine the pose.
    """
    take_contacts(ground, x, y, q[Z], raised, work, s)
    copy_numbers(q, s.q)
    contact_columns(rover, q, work.axes, work.pivots, s.wheels, s.point, s.normal, s.columns, s.frame)
    weight = gravity * weight_column(rover, work.hub_offsets, q, work.axes, work.pivots, 0.0, 0.0, -gravity, s.weight)
    column, axes = s.column, work.axes
    for i in range(6):
        to_rates(s.columns[i, NORMAL], axes, cy, sy, column)
        copy_numbers(column[:FREE], s.drift[i])
        copy_numbers(column[FREE:], s.lift[i])
    if not decompose(s.lift, s.order):
        return 0.0
    _, slope = right_rocker(rover, q[ROCKER])
    for i in range(6):
        to_rates(s.columns[i, TRACTION], axes, cy, sy, s.ways[i, 0])
        to_contacts(s, s.ways[i, 0])
        to_rates(s.columns[i, SIDE], axes, cy, sy, s.ways[i, 1])
        to_contacts(s, s.ways[i, 1])
        if not couples:
            continue
        link_column(s, slope, i, axes, column)
        to_rates(column, axes, cy, sy, s.ways[i, 2])
        to_contacts(s, s.ways[i, 2])
    to_rates(s.weight, axes, cy, sy, s.pull)
    for k in range(EQUATIONS):
        s.pull[k] /= weight
    to_contacts(s, s.pull)
    return weight if math.isfinite(s.pull[0]) else 0.0


@njit
def settled_rates(s: Station, y: Array, rates: Array) -> None:
    """Fill the rates of z, roll, pitch, rocker and bogies.

    Args:
        s: of the pose.
        y: (9,) w and lift rates.
        rates: (6,) filled, per second.
    """
    for i in range(6):
        rates[i] = y[FREE + i] - s.drift[i, 0] * y[0] - s.drift[i, 1] * y[1] - s.drift[i, 2] * y[2]
    solve(s.lift, s.order, rates)
