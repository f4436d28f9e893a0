"""Table of the settle engines: mode, interpolation and engine -> kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels.batch import contact_mode, coverage, equilibrium_mode
from .._kernels.jit.parallel import parallel_for
from .._kernels.model.ground import META_MAX_CURVATURE, META_STEEP
from .._kernels.simd.bilinear_touch import TOUCH_SIZE
from .._kernels.simd.layout import LANES
from ..arrays import Array
from ..rover.model import Rover
from ..terrain.heightfield import Terrain
from ..terrain.spline import BRIDGE
from .status import Status

Mode = Literal["contact", "equilibrium"]
Engine = Literal["simd", "scalar"]

FINE = 0.25  # of the largest wheel radius: on finer cells equilibrium mode does not start from the six-wheel pose
UNSETTLED = bytes([contact_mode.UNSETTLED])
FIRST = np.zeros(1, dtype=np.int64)  # order of one pose
NO_TOUCH = np.empty((0, 6, TOUCH_SIZE))
HEADING_BINS = 64  # bins of half a turn by which poses are sorted on bilinear terrain

_engine: ContextVar[Engine] = ContextVar("rockerbogie_settle_engine", default="simd")


class Batch(NamedTuple):
    """Poses to solve: inputs, and the arrays to fill."""

    rover: Rover
    terrain: Terrain
    x: Array  # (n,) m
    y: Array  # (n,) m
    yaw: Array  # (n,) rad
    steering: Array  # (n, 6) or (1, 6) rad
    q: Array  # (n, 6) filled: z (m), roll, pitch, rocker, bogie left, bogie right (rad)
    status: NDArray[np.uint8]  # (n,) filled
    report: Array  # (n, forces.R_SIZE) filled in equilibrium mode; (0, R_SIZE) in contact mode
    touch: Array = NO_TOUCH  # (n, 6, TOUCH_SIZE) contacts, filled for poses that lanes on bilinear terrain settle in contact mode


def settle_batch(mode: Mode, poses: Batch) -> None:
    """Solve a batch with the engine of the table.

    Args:
        mode: "contact" or "equilibrium".
        poses: inputs; `q`, `status` and (in equilibrium mode) `report` are filled.
    """
    ENGINES[mode, poses.terrain.interpolation, _engine.get()](poses)


@contextmanager
def use_engine(engine: Engine) -> Iterator[None]:
    """Select the engine inside a `with` block, for tests: "scalar" solves each pose by itself.

    Args:
        engine: "simd" (default: 16 poses at once, the rest by the scalar engine) or "scalar".

    Yields:
        None.
    """
    token = _engine.set(engine)
    try:
        yield
    finally:
        _engine.reset(token)


def _contact_cubic(poses: Batch) -> None:
    """Solve in contact mode on cubic terrain: SIMD lanes, then the scalar engine for the rest."""
    _lanes_cubic(poses)
    _contact_left(poses)
    _contact_bridged(poses)


def _contact_linear(poses: Batch) -> None:
    """Solve in contact mode on bilinear terrain: SIMD lanes, then the scalar engine.

    Missing data is bridged first, and poses with a tread over it are refused at the end. So missing data takes no more time.
    """
    _lanes_linear(poses, poses.terrain.bridged)
    _refuse_far(poses)
    _contact_left(poses, bridged=True)
    _refuse_uncovered(poses)


def _lanes_cubic(poses: Batch) -> None:
    """Solve in contact mode on cubic terrain, by SIMD lanes alone.

    Poses that they do not settle become UNSETTLED.
    """
    terrain = poses.terrain
    parallel_for(
        contact_mode.settle_cubic, poses.status.size, terrain.grid, terrain.upper_bound, terrain.meta, *_after_ground(poses),
        plain=_leave,
    )  # fmt: skip


def _lanes_linear(poses: Batch, grid: Array) -> None:
    """Solve in contact mode on bilinear terrain with the nodes `grid`, by SIMD lanes alone.

    Poses that they do not settle become UNSETTLED.
    """
    parallel_for(
        contact_mode.settle_linear, poses.status.size, grid, poses.terrain.meta, *_after_ground(poses), _lane_order(poses),
        poses.touch, plain=_leave,
    )  # fmt: skip


def _leave(*args: Any) -> None:
    """Leave every pose to the scalar engine: in plain Python, lanes take the time of 16.

    Args:
        args: of a kernel of SIMD lanes; the only array of bytes is the status.
    """
    status: NDArray[np.uint8] = next(array for array in args if array.dtype == np.uint8)
    status[:] = contact_mode.UNSETTLED


def _contact_left(poses: Batch, bridged: bool = False) -> None:
    """Solve the poses whose status is UNSETTLED one by one."""
    if UNSETTLED in poses.status.tobytes():  # for one pose, comparing arrays takes as long as a tenth of settling it
        left = np.flatnonzero(poses.status == contact_mode.UNSETTLED)
        parallel_for(contact_mode.settle_left, left.size, *_inputs(poses, bridged), left)


def _contact_cubic_scalar(poses: Batch) -> None:
    """Solve every pose in contact mode on cubic terrain by itself."""
    parallel_for(contact_mode.settle_left, poses.status.size, *_inputs(poses), np.arange(poses.status.size))
    _contact_bridged(poses)


def _contact_linear_scalar(poses: Batch) -> None:
    """Solve every pose in contact mode on bilinear terrain by itself."""
    poses.status[:] = contact_mode.UNSETTLED
    _refuse_far(poses)
    _contact_left(poses, bridged=True)
    _refuse_uncovered(poses)


def _refuse_far(poses: Batch) -> None:
    """Refuse the UNSETTLED poses on bilinear terrain with a wheel far inside missing data."""
    if poses.terrain.bridged is not poses.terrain.grid:
        left = np.flatnonzero(poses.status == contact_mode.UNSETTLED)
        parallel_for(coverage.refuse_far, left.size, *_inputs(poses, True), BRIDGE * min(poses.terrain.spacing), left)


def _refuse_uncovered(poses: Batch) -> None:
    """Refuse the poses with a tread over missing data, on bilinear terrain that has some."""
    if poses.terrain.bridged is not poses.terrain.grid:
        parallel_for(coverage.refuse_uncovered, poses.status.size, *_inputs(poses))


def _contact_bridged(poses: Batch) -> None:
    """Solve the refused poses again on cubic terrain, with missing data bridged."""
    left = _refused(poses)
    if left.size > 0:
        parallel_for(contact_mode.settle_bridged, left.size, *_inputs(poses), left)


def _equilibrium_cubic(poses: Batch) -> None:
    """Solve in equilibrium mode on cubic terrain: six-wheel poses first."""
    if _is_fine(poses):
        _equilibrium_scalar(poses)
        return
    _lanes_cubic(poses)
    _contact_left(poses)
    _equilibrium(poses)


def _equilibrium_linear(poses: Batch) -> None:
    """Solve in equilibrium mode on bilinear terrain: six-wheel poses first."""
    if _is_fine(poses):
        _equilibrium_scalar(poses)
        return
    _lanes_linear(poses, poses.terrain.grid)
    _contact_left(poses)
    _equilibrium(poses)


def _equilibrium_scalar(poses: Batch) -> None:
    """Solve every pose in equilibrium mode by the descent alone."""
    poses.status[:] = contact_mode.UNSETTLED
    _equilibrium(poses)


def _equilibrium(poses: Batch) -> None:
    """Solve in equilibrium mode: from above, then, if that fails, from the six-wheel pose."""
    inputs = _inputs(poses)
    parallel_for(equilibrium_mode.equilibrium_batch, poses.status.size, *inputs, poses.report)
    left = np.flatnonzero((poses.status == Status.TIPPED) | (poses.status == Status.NOT_CONVERGED))
    if left.size > 0:
        parallel_for(contact_mode.settle_left, left.size, *inputs[:-1], poses.status.copy(), left)
        parallel_for(equilibrium_mode.equilibrium_left, left.size, *inputs, poses.report, left)
    left = _refused(poses)
    if left.size > 0:
        parallel_for(equilibrium_mode.equilibrium_bridged, left.size, *inputs, poses.report, left)


def _refused(poses: Batch) -> NDArray[np.int64]:
    """Return the indices (m,) of poses that missing data may have refused.

    There are none on a map without missing data."""
    meta = poses.terrain.meta  # of each kind, one bound is infinite if data is missing
    if math.isfinite(meta[META_MAX_CURVATURE if poses.terrain.interpolation == "cubic" else META_STEEP]):
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(np.isin(poses.status, (Status.NO_DATA, Status.NOT_CONVERGED, Status.TIPPED)))


def _inputs(poses: Batch, bridged: bool = False) -> tuple[object, ...]:
    """Return the leading arguments that all batch kernels share but those of SIMD lanes.

    If `bridged`, missing data of bilinear terrain is bridged.
    """
    return (poses.terrain.packed_bridged if bridged else poses.terrain.packed, *_after_ground(poses))


def _after_ground(poses: Batch) -> tuple[Array | NDArray[np.uint8], ...]:
    """Return the arguments of batch kernels that come after the terrain."""
    return poses.rover.packed, poses.x, poses.y, poses.yaw, poses.steering, poses.q, poses.status


def _is_fine(poses: Batch) -> bool:
    """Return True if cells are finer than `FINE` of a wheel's radius.

    Terrain may then be rougher than the tests of `_kernels/solve/six_wheels.py` show, and the descent alone decides.
    """
    return min(poses.terrain.spacing) < FINE * float(poses.rover.wheel_radius.max())


def _lane_order(poses: Batch) -> NDArray[np.int64]:
    """Return the order (n,) in which SIMD lanes on bilinear terrain take the poses."""
    count = poses.status.size
    if count == 1:
        return FIRST
    return _by_heading(poses.yaw) if count > LANES and poses.rover.wheel_width.any() else np.arange(count)


def _by_heading(yaw: Array) -> NDArray[np.int64]:
    """Return an order (n,) that groups poses with like or opposite yaw, for speed.

    Wheels in neighbouring SIMD lanes then lie over cells in the same way. The order does not change any result.
    """
    with np.errstate(invalid="ignore"):  # a yaw of 1e18 rad has no bin
        part = np.floor(yaw * (HEADING_BINS / np.pi)).astype(np.int64) & (HEADING_BINS - 1)
    return np.argsort(part.astype(np.uint8), kind="stable")


#: Mode, interpolation and engine -> function.
ENGINES: dict[tuple[Mode, Literal["linear", "cubic"], Engine], Callable[[Batch], None]] = {
    ("contact", "cubic", "simd"): _contact_cubic,
    ("contact", "linear", "simd"): _contact_linear,
    ("contact", "cubic", "scalar"): _contact_cubic_scalar,
    ("contact", "linear", "scalar"): _contact_linear_scalar,
    ("equilibrium", "cubic", "simd"): _equilibrium_cubic,
    ("equilibrium", "linear", "simd"): _equilibrium_linear,
    ("equilibrium", "cubic", "scalar"): _equilibrium_scalar,
    ("equilibrium", "linear", "scalar"): _equilibrium_scalar,
}
