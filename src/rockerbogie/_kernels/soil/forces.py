"""Forces of any wheel law on a batch of wheels."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .layout import COMPUTED, DRAWBAR, INVALID, L_KIND, OUT_OF_RANGE, SIDE, SINKAGE, SOIL, TORQUE
from .simple import simple_forces
from .sinkage import balanced_forces

Array = NDArray[np.float64]


@njit
def motion_of(slip: float, slip_angle: float) -> tuple[float, float, float]:
    """Return a motion with the given slip and slip angle.

    Args:
        slip: (rim - vx) / max(rim, vx), -1 to 1.
        slip_angle: atan2(vy, vx), below pi/2 in size, rad.

    Returns:
        Rim speed and axle speeds along and across the heading; the larger of the first two is 1.
    """
    rim = 1.0 + min(slip, 0.0)
    vx = 1.0 - max(slip, 0.0)
    return rim, vx, vx * math.tan(slip_angle)


@njit
def motion_forces(law: Array, load: float, rim: float, vx: float, vy: float, out: Array, space: Array) -> int:
    """Fill the forces of a wheel that turns forward and moves forward.

    Args:
        law: (LAW_SIZE,) packed law of any kind.
        load: N, at least 0.
        rim, vx, vy: rim speed and axle speeds along and across the heading; rim and vx at least 0, not all 0.
        out: (4,) filled with drawbar N, side force N, torque N m, sinkage m.
        space: (4, 5) work space.

    Returns:
        COMPUTED, or OVERLOADED or NOT_CONVERGED, with the forces at the last sinkage.
    """
    if load == 0.0:
        out[DRAWBAR] = out[SIDE] = out[TORQUE] = out[SINKAGE] = 0.0
        return COMPUTED
    if law[L_KIND] == SOIL:
        out[SINKAGE], code = balanced_forces(law, load, rim, vx, vy, space[0])
        for k in range(3):
            out[k] = space[0, k]
        if code != COMPUTED:  # the ratio to the load that the soil does carry
            for k in range(3):
                out[k] *= load / space[0, 3] if space[0, 3] > 0.0 else math.nan
        return code
    simple_forces(law, load, rim, vx, vy, space)
    for k in range(4):
        out[k] = space[k, 0]
    return COMPUTED


@owning_njit
def forces_batch(
    laws: Array, which: NDArray[np.int64], load: Array, slip: Array, slip_angle: Array, out: Array, status: NDArray[np.uint8],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Fill forces of wheels by slip and slip angle.

    Args:
        laws: (m, LAW_SIZE) packed laws.
        which: (n,) law of each item, 0 to m - 1.
        load: (n,) N.
        slip: (n,) (rim - vx) / max(rim, vx).
        slip_angle: (n,) rad.
        out: (n, 4) filled with drawbar N, side force N, torque N m, sinkage m; NaN unless COMPUTED.
        status: (n,) filled with COMPUTED, OVERLOADED, OUT_OF_RANGE, INVALID or NOT_CONVERGED.
        start, stop: range of items.
    """
    space = np.empty((4, 5))
    for k in range(start, stop):
        code = COMPUTED
        if not (math.isfinite(load[k]) and math.isfinite(slip[k]) and math.isfinite(slip_angle[k]) and load[k] >= 0.0):
            code = INVALID
        elif not (abs(slip[k]) <= 1.0 and abs(slip_angle[k]) < 0.5 * math.pi):
            code = OUT_OF_RANGE
        else:
            rim, vx, vy = motion_of(slip[k], slip_angle[k])
            code = motion_forces(laws[which[k]], load[k], rim, vx, vy, out[k], space)
        status[k] = code
        if code != COMPUTED:
            out[k] = math.nan


@owning_njit
def motion_batch(
    laws: Array, which: NDArray[np.int64], load: Array, rim: Array, vx: Array, vy: Array, out: Array, status: NDArray[np.uint8],
    start: int, stop: int,
) -> None:  # fmt: skip
    """Fill forces of wheels by their motion, overloaded ones too.

    Args:
        laws: (m, LAW_SIZE) packed laws.
        which: (n,) law of each item, 0 to m - 1.
        load, rim, vx, vy: (n,) load N, and motions as for `motion_forces`.
        out: (n, 4) filled with drawbar N, side force N, torque N m, sinkage m.
        status: (n,) filled with the code of each item.
        start, stop: range of items.
    """
    space = np.empty((4, 5))
    for k in range(start, stop):
        status[k] = motion_forces(laws[which[k]], load[k], rim[k], vx[k], vy[k], out[k], space)
