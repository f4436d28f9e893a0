"""Six-wheel equilibrium: the pose of contact mode, if the descent from above leads to it.

The pose of contact mode is an equilibrium if the six contact forces that balance the weight are positive, no joint is at
its limit and the body is off the ground. The descent leads to it from another pose if two conditions hold between them:

- The terrain under each wheel is nearly a plane: the planes tangent to its contacts at either pose have nearly the same slope and
  predict its gap at the other. With a pose halfway between the two, half the error is allowed on either side of it.
- The six forces that would balance the weight with these contacts are positive at both poses. In an equilibrium with a wheel off
  the ground, the force of that wheel would be 0.

The conditions are tests at single poses, not a proof: `tests/settling/test_engines.py` compares with the full descent.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.ground import META_DX, META_DY, META_NX, META_NY, Ground, on_map
from ..model.linkage import P_BOX, P_HALF, P_RADIUS, P_STOPS, ROCKER, Z, forward_kinematics, gap_jacobian_row
from ..model.mass import centre_of_mass
from ..model.tolerances import CONTACT_GAP, LIMIT_MARGIN
from ..model.wheel import AX, AY, AZ, COSINE, GAP, HX, HY, HZ, PLACE, SIN, contact_slope, tread_point
from ..search.body_box import box_over_ground
from ..search.box_points import NEAR_ROOM, NEAR_SIZE, least_clearance
from ..search.tread import FOUND
from ..search.verify_minimum import least_gap_by_bounds
from .contact_set import list_wheel
from .newton import solve_linkage
from .site import Contacts, Site

Array = NDArray[np.float64]

FARTHEST = 0.5  # rad: the descent is not cut short if an angle differs by more
LEAST_SHARE = 0.08  # of the weight: the smallest force of a wheel, at both poses
FLATNESS = 1.0  # of the smallest share times the radius: largest error of a gap that a tangent plane predicts
TURN = 3.0  # of the smallest share: largest change of a contact's slope

# A wheel and its contact: hub, axle, contact point on the terrain, slope there, and the gap.
W_X, W_Y, W_Z, W_AX, W_AY, W_AZ, W_PX, W_PY, W_PZ, W_GX, W_GY, W_GAP = range(12)
W_SIZE = 12


class SixWheels(NamedTuple):
    """Six-wheel equilibrium that a descent may lead to, and scratch for other poses."""

    q: Array  # (6,)
    wheels: Array  # (6, W_SIZE)
    share: Array  # (1,) smallest force of a wheel divided by the weight; 0 if there is no such equilibrium
    here: Array  # (6, W_SIZE) wheels of the pose that is compared
    midway: Array  # (6, W_SIZE) wheels of the pose halfway
    rows: Array  # (6, 6) change of each gap there per unit of each unknown


SIX_SIZE = 6 + 3 * 6 * W_SIZE + 1 + 36


@owning_njit
def lay_out_six(buffer: Array) -> SixWheels:
    """Return views into a buffer, with a share of 0.

    Args:
        buffer: (SIX_SIZE,) memory; the caller must keep it alive.
    """
    b, size = unowned_view(buffer), 6 * W_SIZE
    wheels = b[43 : 43 + 3 * size].reshape(3, 6, W_SIZE)
    b[42] = 0.0
    return SixWheels(b[:6], wheels[0], b[42:43], wheels[1], wheels[2], b[6:42].reshape(6, 6))


@njit
def describe_wheels(site: Site, q: Array, wheels: Array, rows: Array) -> None:
    """Write the wheels of a pose, the planes at their contacts, and the changes of their gaps.

    Args:
        site: rover, position and terrain.
        q: (6,) pose; work.wheels and work.touch of the site hold its wheels and their lowest contacts.
        wheels: (6, W_SIZE) filled.
        rows: (6, 6) filled.
    """
    ground, rover, x, y, cy, sy, work = site
    grid, _, meta = ground
    for i in range(6):
        w, t, out = work.wheels[i], work.touch[i], wheels[i]
        px, py, pz = tread_point(w, t[SIN], t[COSINE], t[PLACE])
        gx, gy = contact_slope(grid, meta, w, t[SIN], t[COSINE], t[PLACE])
        out[W_X], out[W_Y], out[W_Z] = w[HX], w[HY], w[HZ]
        out[W_AX], out[W_AY], out[W_AZ] = w[AX], w[AY], w[AZ]
        out[W_PX], out[W_PY], out[W_PZ] = w[HX] + px, w[HY] + py, w[HZ] + pz - t[GAP]
        out[W_GX], out[W_GY], out[W_GAP] = gx, gy, t[GAP]
        gap_jacobian_row(
            rover, q, cy, sy, work.axes, work.pivots, i, w[HX] - x + px, w[HY] - y + py, w[HZ] - q[Z] + pz, gx, gy, rows[i]
        )


@inlined
def gap_over_plane(wheel: Array, plane: Array, radius: float, half: float) -> float:
    """Return the gap of a wheel over a plane, m.

    Args:
        wheel: (W_SIZE,) hub and axle.
        plane: (W_SIZE,) contact point and slope.
        radius, half: m, radius and half width of the wheel.
    """
    gx, gy = plane[W_GX], plane[W_GY]
    along = wheel[W_AZ] - gx * wheel[W_AX] - gy * wheel[W_AY]
    height = wheel[W_Z] - plane[W_PZ] - gx * (wheel[W_X] - plane[W_PX]) - gy * (wheel[W_Y] - plane[W_PY])
    return height - radius * math.sqrt(max(1.0 + gx * gx + gy * gy - along * along, 0.0)) - half * abs(along)


@owning_njit
def wheel_shares(rows: Array, slope: Array, share: Array) -> float:
    """Compute the forces of six contacts, one a wheel, that balance the weight.

    Args:
        rows: (6, 6) change of each gap per unit of each unknown.
        slope: (6,) gradient of the height of the centre of mass.
        share: (6,) filled with the forces divided by the weight.

    Returns:
        The smallest of them; NaN if one of them is NaN, because the equations are singular.
    """
    a, b = np.empty((6, 6)), share
    for i in range(6):
        b[i] = slope[i]
        for j in range(6):
            a[i, j] = rows[j, i]
    for k in range(6):
        pivot = k
        for i in range(k + 1, 6):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, 6):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            b[k], b[pivot] = b[pivot], b[k]
        for i in range(k + 1, 6):
            f = a[i, k] / a[k, k]
            for j in range(k + 1, 6):
                a[i, j] -= f * a[k, j]
            b[i] -= f * b[k]
    least = math.inf
    for k in range(5, -1, -1):
        for j in range(k + 1, 6):
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]
        least = b[k] if not b[k] >= least else least
    return least


@njit
def box_is_clear(ground: Ground, rover: Array, axes: Array, x: float, y: float, z: float) -> bool:
    """Return True if the box is surely above the terrain.

    The plane of its lower face is compared with the terrain's upper bound at the nodes, all over the level rectangle around the
    box. False decides nothing.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        axes: (3, 3) the body's directions, one a row.
        x, y, z: m, the body's origin from the map's first node and the datum.
    """
    _, upper_bound, meta = ground
    box = rover[P_BOX : P_BOX + 6]
    if not axes[2, 2] > 0.1:
        return False
    mid_x = mid_y = far_x = far_y = 0.0
    for k in range(3):
        mid, long = 0.5 * (box[k] + box[3 + k]), 0.5 * (box[3 + k] - box[k])
        mid_x, mid_y = mid_x + mid * axes[k, 0], mid_y + mid * axes[k, 1]
        far_x, far_y = far_x + long * abs(axes[k, 0]), far_y + long * abs(axes[k, 1])
    west, east, south, north = x + mid_x - far_x, x + mid_x + far_x, y + mid_y - far_y, y + mid_y + far_y
    if not (on_map(meta, west, south) and on_map(meta, east, north)):
        return False
    dx, dy = meta[META_DX], meta[META_DY]
    i0, i1 = int(math.floor(west / dx)), min(int(math.floor(east / dx)) + 1, int(meta[META_NX]) - 1)
    j0, j1 = int(math.floor(south / dy)), min(int(math.floor(north / dy)) + 1, int(meta[META_NY]) - 1)
    gx, gy = -axes[2, 0] / axes[2, 2], -axes[2, 1] / axes[2, 2]
    for j in range(j0, j1 + 1):
        level = z + box[2] / axes[2, 2] + gy * (j * dy - y) - gx * x - 2.0 * CONTACT_GAP
        under = 0
        for i in range(i0, i1 + 1):
            under += not level + gx * (i * dx) > upper_bound[j, i]
        if under > 0:
            return False
    return True


@owning_njit
def box_off_ground(ground: Ground, rover: Array, axes: Array, x: float, y: float, z: float) -> bool:
    """Return True if the body's box is over known terrain and not in contact with it.

    Args:
        ground, rover, axes, x, y, z: as `box_is_clear` takes them.
    """
    if box_is_clear(ground, rover, axes, x, y, z):
        return True
    near = np.empty((NEAR_ROOM, NEAR_SIZE))
    code, points = box_over_ground(ground, rover[P_BOX : P_BOX + 6], axes, x, y, z, 0.0, near)
    return code == FOUND and least_clearance(near, points) > 2.0 * CONTACT_GAP


@njit
def within_stops(rover: Array, q: Array) -> bool:
    """Return True if no joint is at its limit or beyond it.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
    """
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        if not (rover[at] + LIMIT_MARGIN < q[ROCKER + k] < rover[at + 1] - LIMIT_MARGIN):
            return False
    return True


@njit
def list_six(site: Site, six: SixWheels, contacts: Contacts, slope: Array, force: Array) -> int:
    """List the contacts of a pose of contact mode, and compute the forces of the lowest.

    Args:
        site: rover, position and terrain.
        six: six.q holds the pose; it is refined by a Newton step. The wheels and the share are written: the
            share is 0 if the pose is not an equilibrium on six wheels.
        contacts: filled as `contact_set.touch_down` fills them.
        slope: (6,) filled with the gradient of the height of the centre of mass.
        force: (n,) filled with six forces.

    Returns:
        Number of contacts listed.
    """
    ground, rover, x, y, cy, sy, work = site
    q, touch, axes, pivots = six.q, work.touch, work.axes, work.pivots
    six.share[0] = 0.0
    if not (within_stops(rover, q) and forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, axes, pivots, work.wheels)):
        return 0
    count, least = 0, math.inf
    for i in range(6):
        t = touch[i]
        code, kept = least_gap_by_bounds(ground, work.wheels[i], 0.0, 1.0, CONTACT_GAP, t, work.contacts)
        if code != FOUND or not abs(t[GAP]) < CONTACT_GAP:
            return 0
        least = min(least, t[GAP])
        count = list_wheel(site, q, i, kept, contacts, count)
    if not box_off_ground(ground, rover, axes, x, y, q[Z] - least):
        return 0
    describe_wheels(site, q, six.wheels, six.rows)
    for i in range(6):
        work.step[i] = -touch[i, GAP]
    if not solve_linkage(six.rows, work.step):  # one more Newton step: six gaps of 0 within rounding
        return 0
    for e in range(6):
        q[e] += work.step[e]
        for k in range(count):
            contacts.gap[k] += contacts.rows[k, e] * work.step[e]
    centre_of_mass(rover, work.hub_offsets, q, cy, sy, axes, pivots, slope)
    share = wheel_shares(six.rows, slope, force)
    six.share[0] = share if share > LEAST_SHARE else 0.0
    return count


@inlined
def is_flat(rover: Array, a: Array, b: Array, share: float) -> bool:
    """Return True if the terrain under each wheel is nearly a plane between two poses.

    Args:
        rover: (P_SIZE,) packed rover.
        a, b: (6, W_SIZE) wheels of the poses.
        share: smallest force of a wheel divided by the weight; the error allowed is proportional to it.
    """
    worst = turn = 0.0
    for i in range(6):
        radius, half = rover[P_RADIUS + i], rover[P_HALF + i]
        turn = max(turn, math.hypot(a[i, W_GX] - b[i, W_GX], a[i, W_GY] - b[i, W_GY]))
        there = gap_over_plane(b[i], a[i], radius, half) - b[i, W_GAP]
        here = gap_over_plane(a[i], b[i], radius, half) - a[i, W_GAP]
        worst = max(worst, max(abs(there), abs(here)) / radius)
    return worst < FLATNESS * share and turn < TURN * share


@owning_njit
def describe_pose(site: Site, q: Array, wheels: Array, rows: Array) -> float:
    """Write the wheels of a pose, and compute the smallest of six forces that balance there.

    Args:
        site: rover, position and terrain.
        q: (6,) pose; z has no effect.
        wheels: (6, W_SIZE) filled.
        rows: (6, 6) scratch.

    Returns:
        The force divided by the weight; 0 if a wheel or the body is not surely above known terrain.
    """
    ground, rover, x, y, cy, sy, work = site
    slope, share, least = np.empty(6), np.empty(6), math.inf
    if not forward_kinematics(rover, work.hub_offsets, x, y, cy, sy, q, work.axes, work.pivots, work.wheels):
        return 0.0
    for i in range(6):
        t = work.touch[i]
        if least_gap_by_bounds(ground, work.wheels[i], t[SIN], t[COSINE], -math.inf, t, work.none)[0] != FOUND:
            return 0.0
        least = min(least, t[GAP])
    if not box_is_clear(ground, rover, work.axes, x, y, q[Z] - least):
        return 0.0
    describe_wheels(site, q, wheels, rows)
    centre_of_mass(rover, work.hub_offsets, q, cy, sy, work.axes, work.pivots, slope)
    return wheel_shares(rows, slope, share)


@njit
def leads_straight(site: Site, q: Array, six: SixWheels) -> bool:
    """Return True if the descent leads from its start to the six-wheel equilibrium.

    The start and the pose halfway are compared with it.

    Args:
        site: rover, position and terrain.
        q: (6,) start of the descent; overwritten.
        six: the six-wheel equilibrium.
    """
    rover = site.rover
    for k in range(1, 6):
        if not abs(q[k] - six.q[k]) < FARTHEST:
            return False
    share = min(six.share[0], describe_pose(site, q, six.here, six.rows))
    if not share > LEAST_SHARE:
        return False
    if is_flat(rover, six.here, six.wheels, share):
        return True
    for k in range(6):
        q[k] = 0.5 * (q[k] + six.q[k])
    share = min(share, describe_pose(site, q, six.midway, six.rows))
    if not share > LEAST_SHARE:
        return False
    return is_flat(rover, six.here, six.midway, 0.5 * share) and is_flat(rover, six.midway, six.wheels, 0.5 * share)


@owning_njit
def leads_to(site: Site, q: Array, slope: Array, six: SixWheels) -> bool:
    """Return True if the descent leads from a pose to the six-wheel equilibrium.

    Args:
        site: rover, position and terrain.
        q: (6,) pose of the last call of `contact_set.lowest_contacts`, z included.
        slope: (6,) gradient of the height of the centre of mass there.
        six: the six-wheel equilibrium.
    """
    for k in range(1, 6):
        if not abs(q[k] - six.q[k]) < FARTHEST:
            return False
    describe_wheels(site, q, six.here, six.rows)
    share = np.empty(6)
    least = min(six.share[0], wheel_shares(six.rows, slope, share))
    return least > LEAST_SHARE and is_flat(site.rover, six.here, six.wheels, least)
