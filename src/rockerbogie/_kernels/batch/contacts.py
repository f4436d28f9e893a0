"""Contacts and clearance of given poses.

Each kernel computes the items start to stop of a batch (`jit.parallel.parallel_for`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.ground import META_X, META_Y, META_Z, Ground, borrow
from ..model.linkage import P_BOX, PITCH, ROLL, Z, body_axes, forward_kinematics, set_hub_offsets
from ..model.wheel import (
    CONTACT_SIZE,
    COSINE,
    GAP,
    HALF,
    HX,
    HY,
    HZ,
    PLACE,
    SIN,
    contact_angle,
    contact_slope,
    gap_at,
    tread_point,
)
from ..search.body_box import box_over_ground
from ..search.box_points import NEAR_ROOM, NEAR_SIZE, least_clearance
from ..search.separate_contacts import count_contacts
from ..search.tread import FOUND, least_gap
from ..search.workspace import WORK_SIZE, lay_out

Array = NDArray[np.float64]


COUNTED = 256  # local minima of a tread's gap that contacts are counted from


@njit
def flush(grid: Array, meta: Array, w: Array, lowest: Array) -> bool:
    """Return True if the tread touches along its whole width.

    Its middle then stands for the contact.

    Args:
        grid, meta: terrain.
        w: (WHEEL_SIZE,) wheel.
        lowest: (CONTACT_SIZE,) the contact.
    """
    far = gap_at(grid, meta, w, lowest[SIN], lowest[COSINE], -lowest[PLACE])
    middle = gap_at(grid, meta, w, lowest[SIN], lowest[COSINE], 0.0)
    return max(far, middle) <= lowest[GAP] + 1e-9


@owning_njit
def contacts_batch(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, q: Array, keep: float,
    gap: Array, angle: Array, point: Array, normal: Array, count: NDArray[np.int64],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Compute the contacts of given poses.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        q: (n, 6) poses.
        keep: m, largest gap of a contact that is counted.
        gap: (n, 6) filled, m; NaN if the tread is off the map or over missing data. So are angle, point and normal.
        angle: (n, 6) filled with contact angles, rad.
        point, normal: (n, 6, 3) filled, in the world.
        count: (n, 6) filled with the number of separate contacts, 0 where there is none.
        start, stop: range of poses that this call computes.
    """
    land = borrow(ground)
    grid, _, meta = land
    buffer = np.empty(WORK_SIZE)
    work = lay_out(buffer)
    lowest, wheels, local = work.lowest, work.wheels, work.step
    contacts_buffer = np.empty((COUNTED, CONTACT_SIZE))
    contacts = unowned_view(contacts_buffer)
    for k in range(start, stop):
        gap[k] = angle[k] = math.nan
        point[k] = normal[k] = math.nan
        count[k] = 0
        local[:] = q[k]
        local[Z] -= meta[META_Z]
        if math.isnan(local[Z]):
            continue
        set_hub_offsets(rover, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        px, py = x[k] - meta[META_X], y[k] - meta[META_Y]
        if not forward_kinematics(
            rover, work.hub_offsets, px, py, math.cos(yaw[k]), math.sin(yaw[k]), local, work.axes, work.pivots, wheels
        ):
            continue
        for i in range(6):
            w = wheels[i]
            code, kept = least_gap(land, w, 0.0, 1.0, 0.0, True, keep, lowest, contacts)
            if code != FOUND:
                continue
            gap[k, i] = lowest[GAP]
            if abs(lowest[PLACE]) == w[HALF] and flush(grid, meta, w, lowest):
                lowest[PLACE] = 0.0
            ox, oy, oz = tread_point(w, lowest[SIN], lowest[COSINE], lowest[PLACE])
            point[k, i, 0] = w[HX] + ox + meta[META_X]
            point[k, i, 1] = w[HY] + oy + meta[META_Y]
            point[k, i, 2] = w[HZ] + oz + meta[META_Z]
            gx, gy = contact_slope(grid, meta, w, lowest[SIN], lowest[COSINE], lowest[PLACE])
            size = math.sqrt(1.0 + gx * gx + gy * gy)
            normal[k, i, 0], normal[k, i, 1], normal[k, i, 2] = -gx / size, -gy / size, 1.0 / size
            angle[k, i] = contact_angle(w, lowest[SIN], lowest[COSINE], lowest[PLACE])
            count[k, i] = count_contacts(land, w, contacts, kept, keep)
    buffer[0] = contacts_buffer[0, 0] = 0.0  # keep the buffers alive: `work` and `contacts` are unowned views of them


@owning_njit
def clearance_batch(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, q: Array, out: Array, start: int, stop: int
) -> None:
    """Compute the clearance of given poses.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        q: (n, 6) poses.
        out: (n,) filled with the smallest height of the body's box above the terrain, m; NaN off the map and over
            missing data.
        start, stop: range of poses that this call computes.
    """
    land, meta = borrow(ground), ground[2]
    axes_buffer, near_buffer = np.empty((3, 3)), np.empty((NEAR_ROOM, NEAR_SIZE))
    axes, near, box = unowned_view(axes_buffer), unowned_view(near_buffer), unowned_view(rover)[P_BOX : P_BOX + 6]
    for k in range(start, stop):
        out[k] = math.nan
        if not math.isnan(q[k, Z]):
            body_axes(q[k, ROLL], q[k, PITCH], math.cos(yaw[k]), math.sin(yaw[k]), axes)
            px, py, pz = x[k] - meta[META_X], y[k] - meta[META_Y], q[k, Z] - meta[META_Z]
            code, count = box_over_ground(land, box, axes, px, py, pz, 0.0, near)
            if code == FOUND:
                out[k] = least_clearance(near, count)
    axes_buffer[0, 0] = near_buffer[0, 0] = 0.0  # keep them alive: `axes` and `near` are unowned views
