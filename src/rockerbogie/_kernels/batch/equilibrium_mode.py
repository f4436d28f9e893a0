"""Poses of equilibrium mode.

Each kernel computes the items start to stop of a batch (`jit.parallel.parallel_for`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from ..jit.raw_views import unowned_view
from ..model.bridge import bridged_grid, cells_around, with_grid
from ..model.ground import META_X, META_Y, META_Z, Ground, borrow
from ..model.linkage import Z, reach, set_hub_offsets
from ..search.workspace import WORK_SIZE, lay_out
from ..solve.equilibrium import settle_equilibrium, settle_from_pose
from ..solve.forces import R_SIZE
from ..solve.newton import CONVERGED, covered
from ..solve.site import MEMORY_SIZE, OWNERS, Site, lay_out_memory
from ..solve.six_wheels import SIX_SIZE, lay_out_six

Array = NDArray[np.float64]


@owning_njit
def equilibrium_batch(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    report: Array,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Solve for equilibria by descent from above.

    A pose of contact mode in balance is the equilibrium if the descent leads to it.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) poses of contact mode; replaced by the equilibria, NaN where none is found.
        status: (n,) statuses of contact mode, UNSETTLED for poses without one; replaced.
        report: (n, forces.R_SIZE) filled with forces and flags, NaN where no pose is found.
        start, stop: range of poses that this call solves for.
    """
    buffer = np.empty(WORK_SIZE)
    work, land, car, meta, q = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2]), unowned_view(out)
    room, memory_buffer, owners = np.empty(SIX_SIZE), np.empty(MEMORY_SIZE), np.empty(OWNERS, np.int64)
    six, memory = lay_out_six(room), lay_out_memory(memory_buffer, owners)
    for k in range(start, stop):
        set_hub_offsets(car, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        px, py = x[k] - meta[META_X], y[k] - meta[META_Y]
        six.q[:] = q[k]
        six.q[Z] = q[k, Z] - meta[META_Z] if status[k] == CONVERGED else math.nan
        status[k] = settle_equilibrium(
            Site(land, car, px, py, math.cos(yaw[k]), math.sin(yaw[k]), work), q[k], report[k], six, memory
        )
        q[k, Z] += meta[META_Z]
    owners[0] = 0
    buffer[0] = room[0] = memory_buffer[0] = 0.0  # keep the buffers alive: `work`, `six` and `memory` are unowned views of them


@owning_njit
def equilibrium_left(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    report: Array, left: NDArray[np.int64],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Solve for an equilibrium from the six-wheel pose, where the descent found none.

    A pose for which this search fails too keeps the status of the first search.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) the six-wheel poses of `settle_left`, NaN where there is none; replaced by the equilibrium, NaN if none.
        status: (n,) the statuses of the first search; replaced where an equilibrium is found.
        report: (n, forces.R_SIZE) forces and flags; written where an equilibrium is found.
        left: (m,) indices of the poses to solve for.
        start, stop: range of `left` that this call solves for.
    """
    buffer = np.empty(WORK_SIZE)
    work, land, car, meta, q = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2]), unowned_view(out)
    memory_buffer, owners = np.empty(MEMORY_SIZE), np.empty(OWNERS, np.int64)
    memory = lay_out_memory(memory_buffer, owners)
    for n in range(start, stop):
        k = left[n]
        if math.isnan(q[k, Z]):
            continue
        set_hub_offsets(car, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        px, py = x[k] - meta[META_X], y[k] - meta[META_Y]
        q[k, Z] -= meta[META_Z]
        site = Site(land, car, px, py, math.cos(yaw[k]), math.sin(yaw[k]), work)
        code = settle_from_pose(site, q[k], report[k], memory)
        if not math.isnan(q[k, Z]):
            status[k] = code
            q[k, Z] += meta[META_Z]
    owners[0] = 0
    buffer[0] = memory_buffer[0] = 0.0  # keep the buffers alive: `work` and `memory` are unowned views of them


@owning_njit
def equilibrium_bridged(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    report: Array, left: NDArray[np.int64],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Solve for equilibria again, on terrain whose missing data is bridged: as `settle_bridged`.

    The pose found counts if its treads and the body's box lie over known terrain.

    Args:
        ground, rover: the packed terrain and rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) poses; written where one is found.
        status: (n,) statuses; written where a pose is found.
        report: (n, forces.R_SIZE) forces and flags; written where a pose is found.
        left: (m,) indices of the poses to solve for.
        start, stop: range of `left` that this call solves for.
    """
    buffer = np.empty(WORK_SIZE)
    work, land, car, meta, q = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2]), unowned_view(out)
    trial, forces, far = np.empty(6), np.empty(R_SIZE), reach(rover)
    room, memory_buffer, owners = np.empty(SIX_SIZE), np.empty(MEMORY_SIZE), np.empty(OWNERS, np.int64)
    six, memory = lay_out_six(room), lay_out_memory(memory_buffer, owners)
    six.q[Z] = math.nan
    for n in range(start, stop):
        k = left[n]
        set_hub_offsets(car, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        px, py, cy, sy = x[k] - meta[META_X], y[k] - meta[META_Y], math.cos(yaw[k]), math.sin(yaw[k])
        i0, i1, j0, j1 = cells_around(land, px, py, far)
        grid, missing = bridged_grid(land, i0, i1, j0, j1)
        if 0 < missing < grid.size:
            site = Site(with_grid(land, grid, j0, i0), car, px, py, cy, sy, work)
            code = settle_equilibrium(site, trial, forces, six, memory)
            if not math.isnan(trial[Z]) and covered(land, car, px, py, cy, sy, trial, True, work):
                status[k], q[k], report[k] = code, trial, forces
                q[k, Z] += meta[META_Z]
            grid[0, 0] = 0.0  # keep the grid alive: the bridged terrain is an unowned view of it
    owners[0] = 0
    buffer[0] = room[0] = memory_buffer[0] = 0.0  # keep the buffers alive: `work`, `six` and `memory` are unowned views of them
