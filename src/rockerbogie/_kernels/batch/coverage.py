"""Poses whose treads lie over missing data."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.bridge import cells_around
from ..model.ground import META_DX, META_DY, META_X, META_Y, META_Z, Ground, borrow, on_map
from ..model.linkage import Z, forward_kinematics, reach, set_hub_offsets
from ..model.wheel import HX, HY
from ..search.tread import FOUND, least_gap
from ..search.workspace import WORK_SIZE, lay_out
from ..solve.newton import CONVERGED, JOINT_STOP, NO_DATA, wheel_extent

Array = NDArray[np.float64]


@owning_njit
def refuse_uncovered(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Refuse settled poses with a tread over missing data.

    Args:
        ground, rover: the packed bilinear terrain, with its missing data, and the rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) poses; NaN is written where a pose is refused.
        status: (n,) statuses; NO_DATA is written in place of CONVERGED and JOINT_STOP where a pose is refused.
        start, stop: range of poses that this call checks.
    """
    buffer, q = np.empty(WORK_SIZE), np.empty(6)
    work, land, car, meta = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2])
    several, near = steering.shape[0] > 1, reach(car)
    for k in range(start, stop):
        if k == start or several:
            set_hub_offsets(car, steering[k if several else 0], work.hub_offsets)
        if status[k] != CONVERGED and status[k] != JOINT_STOP:
            continue
        px, py = x[k] - meta[META_X], y[k] - meta[META_Y]
        q[:] = out[k]
        q[Z] -= meta[META_Z]
        box = cells_around(land, px, py, near)
        known = forward_kinematics(
            car, work.hub_offsets, px, py, math.cos(yaw[k]), math.sin(yaw[k]), q, work.axes, work.pivots, work.wheels
        )
        for i in range(6):
            if known and data_missing_near(land, work.wheels[i], 0.0, box):
                code, _ = least_gap(land, work.wheels[i], 0.0, 1.0, 0.0, True, -math.inf, work.lowest, work.none)
                known = code == FOUND
        if not known:
            out[k] = math.nan
            status[k] = NO_DATA
    buffer[0] = 0.0  # keep the buffer alive: `work` is an unowned view of it


@owning_njit
def refuse_far(
    ground: Ground, rover: Array, x: Array, y: Array, yaw: Array, steering: Array, out: Array, status: NDArray[np.uint8],
    far: float, left: NDArray[np.int64],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Refuse poses at which a wheel is farther from data than the rover's reach.

    The wheels are those of the level rover. Only nodes within the rover's reach are read.

    Args:
        ground, rover: the packed bilinear terrain, bridged up to `far`, and the rover.
        x, y, yaw: (n,) position, m, and heading, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        out: (n, 6) poses; NaN is written where a pose is refused.
        status: (n,) statuses; NO_DATA is written where a pose is refused.
        far: m, the distance of each missing node of the bridged terrain from data.
        left: (m,) indices of the poses to check.
        start, stop: range of `left` that this call checks.
    """
    buffer = np.empty(WORK_SIZE)
    work, land, car, meta = lay_out(buffer), borrow(ground), unowned_view(rover), unowned_view(ground[2])
    level = np.zeros(6)
    near = reach(car)
    beyond = far - near
    for n in range(start, stop if beyond >= 0.0 else start):
        k = left[n]
        set_hub_offsets(car, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        px, py = x[k] - meta[META_X], y[k] - meta[META_Y]
        box = cells_around(land, px, py, near)
        forward_kinematics(
            car, work.hub_offsets, px, py, math.cos(yaw[k]), math.sin(yaw[k]), level, work.axes, work.pivots, work.wheels
        )
        for i in range(6):
            w = work.wheels[i]
            if on_map(meta, w[HX], w[HY]) and data_missing_near(land, w, beyond, box):
                out[k] = math.nan
                status[k] = NO_DATA
                break
    buffer[0] = 0.0  # keep the buffer alive: `work` is an unowned view of it


@njit
def data_missing_near(ground: Ground, w: Array, more: float, box: tuple[int, int, int, int]) -> bool:
    """Return True if a node of a cell under the box around a wheel is missing.

    Args:
        ground: bilinear terrain.
        w: (WHEEL_SIZE,) wheel.
        more: m, added to the box on each side.
        box: first column, one past the last, first row and one past the last of the cells that may be read.
    """
    grid, meta = ground[0], ground[2]
    far_x, far_y = wheel_extent(w)
    far_x, far_y = far_x + more, far_y + more
    i0, i1 = int(math.floor((w[HX] - far_x) / meta[META_DX])), int(math.floor((w[HX] + far_x) / meta[META_DX]))
    j0, j1 = int(math.floor((w[HY] - far_y) / meta[META_DY])), int(math.floor((w[HY] + far_y) / meta[META_DY]))
    for j in range(max(j0, box[2]), min(j1 + 1, box[3]) + 1):
        for i in range(max(i0, box[0]), min(i1 + 1, box[1]) + 1):
            if math.isnan(grid[j, i]):
                return True
    return False
