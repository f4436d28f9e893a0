"""Poses of contact mode.

Each kernel computes the items start to stop of a batch (`jit.parallel.parallel_for`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, owning_njit
from ..jit.raw_views import unowned_view
from ..model.bridge import bridged_grid, cells_around, with_grid
from ..model.ground import META_X, META_Y, META_Z, CubicGround, Ground, LinearGround, borrow, near_map
from ..model.linkage import Z, reach, set_hub_offsets
from ..search.verify_minimum import LEAST
from ..search.workspace import WORK_SIZE, lay_out
from ..simd import bilinear_settle
from ..simd.bilinear_touch import store_contacts
from ..simd.cubic_newton import guaranteed_step
from ..simd.cubic_settle import ROUNDS, load, settle_block
from ..simd.layout import BILINEAR, BILINEAR_SIZE, CONTACT, CUBIC, CUBIC_SIZE, LANES, LINE, POSE, TWO_BLOCKS, in_use
from ..simd.linkage import line_up
from ..simd.map_edge import find_beyond, mark_near_edge
from ..simd.wheel_lanes import few_poses
from ..solve.newton import CONVERGED, JOINT_STOP, NO_DATA, NOT_CONVERGED, OFF_MAP, STARTS, beyond_stops, covered, settle_contact

Array = NDArray[np.float64]

REPEATS = 3  # starts that lead to the same pose over missing data again before it is refused
SAME_POSE = 1e-5  # m and rad, largest difference of two solutions for one pose
UNSETTLED = 255  # status of a pose that the lanes have not settled


@owning_njit
def settle_cubic(
    grid: Array, upper_bound: Array, meta: Array, rover: Array,
    x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Settle poses in contact mode on cubic terrain, by SIMD lanes.

    Args:
        grid, upper_bound, meta: arrays of the packed terrain, one by one: in a tuple they would take 0.7 µs more a call.
        rover: the packed rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) filled with the poses that are settled.
        status: (n,) filled; OFF_MAP off the map, UNSETTLED for poses that are left to `settle_left`.
        start, stop: range of poses that this call settles.
    """
    buffer, block, which = np.empty(WORK_SIZE), np.empty(CUBIC_SIZE + LINE), np.empty(LANES, np.int64)
    work, land, car, header, q, lanes = (
        lay_out(buffer),
        borrow(CubicGround(grid, upper_bound, meta)),
        unowned_view(rover),
        unowned_view(meta),
        unowned_view(out),
        line_up(block),
    )
    sure, far, fresh = guaranteed_step(header, car), reach(car), True
    for first in range(start, stop, LANES):
        count = min(LANES, stop - first)
        for l in range(count):
            which[l] = first + l
        count = keep_near(header, far, x, y, which, count, q, status)
        if count > 0:
            load(lanes, car, header, x, y, yaw, steering, which, count, fresh, work)
            fresh = False
            settle_block(lanes, land, car, count, sure, work)
            for l in range(count):
                store_lane(lanes, l, car, header, q, status, which[l], lanes[CUBIC.verdict + l] == LEAST)
    buffer[0] = block[0] = 0.0  # keep the buffers alive: `work` and `lanes` are unowned views of them


@owning_njit
def settle_linear(
    grid: Array, meta: Array, rover: Array,
    x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    order: NDArray[np.int64], touch: Array,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Settle poses in contact mode on bilinear terrain, by SIMD lanes.

    Poses that need more than one round wait until there is a block of them.

    Args:
        grid, meta: arrays of the packed terrain, one by one: in a tuple they would take 0.7 µs more a call.
        rover: the packed rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) filled with the poses that are settled.
        status: (n,) filled; OFF_MAP off the map, UNSETTLED for poses that are left to `settle_left`.
        order: (n,) order in which the poses are taken.
        touch: (n, 6, TOUCH_SIZE) filled with the contacts of the poses that are settled; (0, 6, TOUCH_SIZE): not wanted.
        start, stop: range of `order` that this call settles.
    """
    buffer, block = np.empty(WORK_SIZE), np.empty(TWO_BLOCKS)
    which, wait, scratch = np.empty(LANES, np.int64), np.empty(2 * LANES, np.int64), np.empty(5 * LANES)
    work, land, car, header, q, lanes = (
        lay_out(buffer),
        borrow(LinearGround(grid, grid, meta)),
        unowned_view(rover),
        unowned_view(meta),
        unowned_view(out),
        line_up(block),
    )
    wheels = lanes[BILINEAR_SIZE:]
    waiting, first, far, fresh = 0, start, reach(car), True
    if bilinear_settle.too_fine(header, car):
        for n in range(start, stop):
            status[order[n]] = UNSETTLED
        first = stop
    while first < stop or waiting > 0:
        anew = waiting < LANES and first < stop  # if False, the waiting poses
        count = min(LANES, stop - first if anew else waiting)
        for l in range(count):
            which[l] = order[first + l] if anew else wait[l]
        if anew:
            first += count
            count = keep_near(header, far, x, y, which, count, q, status)
            if count == 0:
                continue
        few = few_poses(car, count)
        load(lanes, car, header, x, y, yaw, steering, which, count, fresh, work)
        mark_near_edge(lanes, header, far)
        fresh = False
        if anew:
            bilinear_settle.start(lanes, wheels, land[0], header, car, few)
        else:
            waiting -= count
            for l in range(waiting):
                wait[l] = wait[count + l]
            for l in range(in_use(lanes)):
                for n in range(6):
                    lanes[POSE.q + n * LANES + l] = q[which[min(l, count - 1)], n]
                    lanes[CONTACT.sine + n * LANES + l] = 0.0  # reset the contacts of the lane's former pose
        bilinear_settle.settle(lanes, wheels, land, car, count, few, 1 if anew else ROUNDS)
        find_beyond(lanes, header, car, count)
        for l in range(count):
            k = which[l]
            if anew and lanes[BILINEAR.fate + l] == bilinear_settle.SEARCHING:
                for n in range(6):
                    q[k, n] = lanes[POSE.q + n * LANES + l]
                wait[waiting] = k
                waiting += 1
            elif lanes[BILINEAR.fate + l] == bilinear_settle.BEYOND:
                q[k] = math.nan
                status[k] = OFF_MAP
            else:
                store_lane(lanes, l, car, header, q, status, k, lanes[BILINEAR.fate + l] == bilinear_settle.SETTLED)
        if touch.shape[0] > 0:
            store_contacts(lanes, land[0], header, car, which, count, scratch, touch)
    buffer[0] = block[0] = 0.0  # keep the buffers alive: `work`, `lanes` and `wheels` are unowned views of them


@inlined
def keep_near(
    meta: Array, far: float, x: Array, y: Array, which: NDArray[np.int64], count: int, q: Array, status: NDArray[np.uint8]
) -> int:
    """Remove the poses whose rover lies wholly beyond the map's edge from a block.

    The scalar engine finds the same status: a wheel wholly off the map ends each of its starts.

    Args:
        meta: (META_SIZE,) map header.
        far: m, the rover's reach.
        x, y: (n,) positions, m.
        which: (LANES,) indices of the block's poses; replaced by those that stay.
        count: number of poses of the block.
        q: (n, 6) poses; NaN is written where a pose is removed.
        status: (n,) statuses; OFF_MAP is written where a pose is removed.

    Returns:
        The number of poses that stay.
    """
    kept = 0
    for l in range(count):
        k = which[l]
        if near_map(meta, x[k] - meta[META_X], y[k] - meta[META_Y], far):
            which[kept] = k
            kept += 1
        else:
            q[k] = math.nan
            status[k] = OFF_MAP
    return kept


@inlined
def store_lane(
    lanes: Array, l: int, rover: Array, meta: Array, q: Array, status: NDArray[np.uint8], k: int, settled: bool
) -> None:
    """Store a lane's pose and status, or UNSETTLED.

    Args:
        lanes: the block's array (simd/layout.py).
        l: lane.
        rover: (P_SIZE,) packed rover.
        meta: (META_SIZE,) map header.
        q: (n, 6) poses; row k is written if it is settled.
        status: (n,) statuses; item k is written.
        k: pose.
        settled: True if the lane is settled.

    Reads:  POSE.q
    Writes: nothing
    """
    if settled:
        for n in range(6):
            q[k, n] = lanes[POSE.q + n * LANES + l]
        status[k] = JOINT_STOP if beyond_stops(rover, q[k]) else CONVERGED
        q[k, Z] += meta[META_Z]
    else:
        status[k] = UNSETTLED


@owning_njit
def settle_left(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    left: NDArray[np.int64],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Settle poses in contact mode one by one.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) filled with the poses, NaN where none is found.
        status: (n,) filled.
        left: (m,) indices of the poses to settle.
        start, stop: range of `left` that this call settles.
    """
    buffer = np.empty(WORK_SIZE)
    work, land, car, meta, q = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2]), unowned_view(out)
    for n in range(start, stop):
        k = left[n]
        set_hub_offsets(car, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        px, py = x[k] - meta[META_X], y[k] - meta[META_Y]
        status[k], _ = settle_contact(land, car, px, py, math.cos(yaw[k]), math.sin(yaw[k]), 0, q[k], work)
        q[k, Z] += meta[META_Z]
    buffer[0] = 0.0  # keep the buffer alive: `work` is an unowned view of it


@owning_njit
def settle_bridged(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    left: NDArray[np.int64],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Settle poses in contact mode again, on terrain whose missing data is bridged.

    A search that finds no terrain in missing cells may fail where another pose lies over known terrain. The first pose found here
    whose treads lie over known terrain counts: there the bridged terrain is the terrain itself. If the search finds no pose at
    all, NOT_CONVERGED replaces NO_DATA: missing data is not what refuses the pose. The search ends once `REPEATS`
    more starts lead to the pose that was refused first: other solutions, with the linkage folded, then do not count.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) poses; written where one is found.
        status: (n,) statuses; written where a pose is found.
        left: (m,) indices of the poses to settle.
        start, stop: range of `left` that this call settles.
    """
    buffer = np.empty(WORK_SIZE)
    work, land, car, meta, q = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2]), unowned_view(out)
    trial, refused, far = np.empty(6), np.empty(6), reach(rover)
    for n in range(start, stop):
        k = left[n]
        set_hub_offsets(car, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        px, py, cy, sy = x[k] - meta[META_X], y[k] - meta[META_Y], math.cos(yaw[k]), math.sin(yaw[k])
        i0, i1, j0, j1 = cells_around(land, px, py, far)
        grid, missing = bridged_grid(land, i0, i1, j0, j1)
        if 0 < missing < grid.size:
            bridged, attempt, found, again = with_grid(land, grid, j0, i0), 0, False, 0
            while attempt < STARTS and again < REPEATS:  # past poses over bridged terrain
                code, attempt = settle_contact(bridged, car, px, py, cy, sy, attempt, trial, work)
                if attempt < STARTS and covered(land, car, px, py, cy, sy, trial, False, work):
                    status[k], q[k] = code, trial
                    q[k, Z] += meta[META_Z]
                    break
                if code == NOT_CONVERGED and status[k] == NO_DATA and not found:
                    status[k] = code  # it is not missing data that refuses the pose
                if not found:
                    refused[:] = trial
                elif attempt < STARTS and np.abs(trial - refused).max() < SAME_POSE:
                    again += 1
                found = True
                attempt += 1
            grid[0, 0] = 0.0  # keep the grid alive: the bridged terrain is an unowned view of it
    buffer[0] = 0.0  # keep the buffer alive: `work` is an unowned view of it
