"""Forces between wheels and soil by load, slip and slip angle (docs/soil.md)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._kernels.jit.parallel import parallel_for
from ..._kernels.soil import forces as kernel
from ..._kernels.soil import layout as lay
from ...arrays import Array
from ...errors import RockerbogieError
from ...gravity import GRAVITY, check_gravity
from .laws import Grousers, Wheel, WheelLaw


class ForceStatus(IntEnum):
    """Outcome of a wheel's forces, one code a wheel (uint8)."""

    COMPUTED = lay.COMPUTED
    OVERLOADED = lay.OVERLOADED  # the soil cannot carry the load: the wheel sinks to 95 % of its radius
    OUT_OF_RANGE = lay.OUT_OF_RANGE  # |slip| above 1 or |slip angle| of 90° or more: outside the law
    INVALID = lay.INVALID  # NaN, infinite or negative load
    NOT_CONVERGED = lay.NOT_CONVERGED


@dataclass(frozen=True, eq=False)
class WheelForces:
    """Forces of the soil on wheels; NaN where `status` is not COMPUTED.

    Attributes:
        drawbar: (...) force along the wheel's heading, N: net traction, below 0 for resistance.
        side: (...) force to the left of the heading, N.
        torque: (...) motor torque at the axle, forward positive, N m.
        sinkage: (...) of the rim below the surface that the wheel meets, m.
        status: (...) `ForceStatus`.
    """

    drawbar: Array
    side: Array
    torque: Array
    sinkage: Array
    status: NDArray[np.uint8]

    def __repr__(self) -> str:
        done = int((self.status == ForceStatus.COMPUTED).sum())
        return f"WheelForces({done} of {self.status.size} wheels computed)"


def check_law(soil: object) -> WheelLaw:
    """Return a wheel law after a check of its type.

    Args:
        soil: a Soil, Coulomb, SlipCurve or another WheelLaw.

    Returns:
        The same.

    Raises:
        RockerbogieError: another type.
    """
    if isinstance(soil, str):
        raise RockerbogieError(f"soil is the name {soil!r}: give a Soil, as in rb.load_soil({soil!r})")
    if not isinstance(soil, WheelLaw):
        raise RockerbogieError(f"soil is {soil!r:.60}: give a Soil (rb.load_soil), rb.Coulomb or rb.SlipCurve")
    return soil


def wheel_soil_forces(
    soil: WheelLaw,
    radius: ArrayLike,
    width: ArrayLike,
    load: ArrayLike,
    slip: ArrayLike,
    slip_angle: ArrayLike = 0.0,
    *,
    gravity: float = GRAVITY["earth"],
    grousers: Grousers | float | None = None,
    passes: ArrayLike = 1,
) -> WheelForces:
    """Compute the forces on rigid wheels in soil; all arguments but the last block broadcast.

    The sinkage is solved for so that the vertical resultant of the stresses is the load. Equations, ranges and sources are in
    docs/soil.md.

    Args:
        soil: `load_soil(...)`, a Soil, or another law: Coulomb, SlipCurve.
        radius: (...) of the rim, without grousers, m.
        width: (...) m.
        load: (...) vertical load, N.
        slip: (...) (r ω − vx) / max(r ω, vx): 0 rolls, 1 spins on the spot, below 0 skids, −1 is locked.
        slip_angle: (...) atan2(vy, vx), below π/2 in size, rad; positive if the wheel moves to the left of its heading.
        gravity: m/s² (`GRAVITY`). It acts through the weight of bulldozed soil, and in Reece's pressure law.
        grousers: their height, m, or Grousers.
        passes: (...) number of this pass over the same rut; 1 on undisturbed soil.

    Returns:
        WheelForces with the broadcast shape. A load that the soil cannot carry, and a slip or an angle outside
        the law, give NaN and a status.

    Raises:
        RockerbogieError: impossible dimensions or gravity, numbers that do not broadcast, or no wheel law.
    """
    law = check_law(soil)
    field = check_gravity(gravity)
    lugs = grousers if grousers is None or isinstance(grousers, Grousers) else Grousers(grousers)
    names = ("radius", "width", "load", "slip", "slip_angle", "passes")
    try:
        arrays = [np.asarray(value, dtype=float) for value in (radius, width, load, slip, slip_angle, passes)]
        spread = np.broadcast_arrays(*arrays)
    except (TypeError, ValueError):
        raise RockerbogieError(f"{', '.join(names)} must be numbers of shapes that broadcast") from None
    shape = spread[0].shape
    laws, which = _laws(law, field, lugs, arrays, shape)
    flat = [np.array(part, dtype=float).ravel() for part in spread[2:5]]  # copies, as broadcast views are read-only
    n = flat[0].size
    out, status = np.empty((n, lay.OUTPUTS)), np.empty(n, dtype=np.uint8)
    parallel_for(kernel.forces_batch, n, laws, which, *flat, out, status)
    parts = [np.ascontiguousarray(out[:, k]).reshape(shape) for k in range(lay.OUTPUTS)]
    return WheelForces(parts[0], parts[1], parts[2], parts[3], status.reshape(shape))


def _whole(value: float) -> int:
    """Return a number of passes; raise an error if it is not whole."""
    if not (np.isfinite(value) and value == int(value)):
        raise RockerbogieError(f"passes is {value:g}: give 1 for undisturbed soil, 2 for the second wheel in a rut, ...")
    return int(value)


def _laws(
    law: WheelLaw, gravity: float, grousers: Grousers | None, arrays: list[Array], shape: tuple[int, ...]
) -> tuple[Array, NDArray[np.int64]]:
    """Return the packed laws (m, LAW_SIZE) of the distinct wheels and the law of each item (n,)."""
    wheels = np.broadcast_arrays(arrays[0], arrays[1], arrays[5])
    rows = np.stack([part.ravel() for part in wheels], axis=1)
    distinct, inverse = np.unique(rows, axis=0, return_inverse=True)
    packed = [law.packed(Wheel(float(r), float(b), grousers, _whole(n)), gravity) for r, b, n in distinct]
    which = np.broadcast_to(inverse.reshape(wheels[0].shape), shape)
    return np.array(packed).reshape(len(packed), lay.LAW_SIZE), np.array(which, dtype=np.int64).ravel()  # writable
