"""Tables of wheel forces for other kernels (`rockerbogie._kernels.soil.table`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._kernels.jit.parallel import parallel_for
from ..._kernels.soil import forces as node_kernel
from ..._kernels.soil import layout as lay
from ..._kernels.soil import table as kernel
from ...arrays import Array
from ...errors import RockerbogieError
from ...gravity import GRAVITY, check_gravity
from .forces import check_law
from .laws import Grousers, Wheel, WheelLaw
from .limits import check_range

#: Nodes of load, slip and slip angle.
SIZE = (15, 49, 25)
#: Stretch of slip and slip angle around 0.
STRETCH = (0.1, 0.2)
#: (rim + vx) / 2 at a slip angle of 90°, relative to the side speed.
SIDEWAYS = 1e-4
#: Random forces with which the error of a table is measured.
SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class ForceTable:
    """Tabulated forces of one wheel on one soil.

    Attributes:
        packed: (size,) the table as kernels take it. Tables of one size can be stacked.
        law: the law.
        wheel: the wheel.
        gravity: m/s².
        loads: (2,) least and largest load, N. Below the least, ratios of force to load are constant.
        overloaded: fraction of the nodes at which the soil cannot carry the load; there the forces are those at the deepest
            sinkage, scaled to the load.
    """

    packed: Array
    law: WheelLaw
    wheel: Wheel
    gravity: float
    loads: tuple[float, float]
    overloaded: float

    def forces(self, load: ArrayLike, slip: ArrayLike, slip_angle: ArrayLike = 0.0) -> tuple[Array, NDArray[np.uint8]]:
        """Return the tabulated forces with their derivatives.

        Args:
            load: (...) N.
            slip: (...) as for `wheel_soil_forces`.
            slip_angle: (...) rad.

        Returns:
            (..., 4, 4): rows drawbar N, side N, torque N m, sinkage m; columns value and derivatives with respect to load, slip
            and slip angle. And (...) `ForceStatus`.
        """
        parts = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (load, slip, slip_angle)))
        out, status = self._evaluate(kernel.table_batch, *parts)
        return out[..., :4], status

    def motion_forces(self, load: ArrayLike, rim: ArrayLike, vx: ArrayLike, vy: ArrayLike) -> tuple[Array, NDArray[np.uint8]]:
        """Return the tabulated forces of wheels in any motion, with their derivatives.

        Args:
            load: (...) N.
            rim: (...) rim speed, forward positive, m/s.
            vx, vy: (...) speed of the axle along the heading and to its left, m/s.

        Returns:
            (..., 4, 5): rows as `forces`; columns value and derivatives with respect to load, rim, vx and vy. And (...)
            `ForceStatus`.
        """
        parts = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (load, rim, vx, vy)))
        return self._evaluate(kernel.motion_table_batch, *parts)

    def _evaluate(self, batch: object, *parts: Array) -> tuple[Array, NDArray[np.uint8]]:
        """Return the outputs (..., 4, 5) and status (...) of a batch kernel."""
        shape = parts[0].shape
        flat = [np.ascontiguousarray(part).ravel() for part in parts]
        n = flat[0].size
        out, status = np.empty((n, lay.OUTPUTS, 5)), np.empty(n, dtype=np.uint8)
        parallel_for(batch, n, self.packed, *flat, out, status)  # type: ignore[arg-type]
        return out.reshape(*shape, lay.OUTPUTS, 5), status.reshape(shape)

    @cached_property
    def error(self) -> dict[str, float]:
        """Largest and RMS interpolation errors.

        Forces are over load, torque over load × radius, sinkage over radius. They are
        measured at random loads, slips and slip angles to 80°, where the soil carries the load.
        """
        rng = np.random.default_rng(0)
        low, high = self.loads
        load = low * (high / low) ** rng.uniform(0.0, 1.0, SAMPLES)
        slip = rng.uniform(-1.0, 1.0, SAMPLES)
        angle = rng.uniform(-1.4, 1.4, SAMPLES)
        law = self.law.packed(self.wheel, self.gravity)[None]
        exact, status = np.empty((SAMPLES, lay.OUTPUTS)), np.empty(SAMPLES, dtype=np.uint8)
        parallel_for(node_kernel.forces_batch, SAMPLES, law, np.zeros(SAMPLES, dtype=np.int64), load, slip, angle, exact, status)
        apart = np.abs(self.forces(load, slip, angle)[0][..., 0] - exact)[status == lay.COMPUTED]
        scale = load[status == lay.COMPUTED]
        r = self.wheel.radius
        relative = apart / np.stack([scale, scale, scale * r, np.full_like(scale, r)], axis=1)
        names = ("drawbar", "side", "torque", "sinkage")
        result = {name: float(relative[:, k].max()) for k, name in enumerate(names)}
        return result | {f"{name}_rms": float(np.sqrt((relative[:, k] ** 2).mean())) for k, name in enumerate(names)}


def tabulate(
    soil: WheelLaw,
    radius: float,
    width: float,
    loads: tuple[float, float],
    *,
    gravity: float = GRAVITY["earth"],
    grousers: Grousers | float | None = None,
    passes: int = 1,
    size: tuple[int, int, int] = SIZE,
) -> ForceTable:
    """Build the table of forces of a wheel for kernels.

    Args:
        soil: a law, as for `wheel_soil_forces`.
        radius: m.
        width: m.
        loads: least and largest load of the table, N; a ratio of 500 costs little.
        gravity: m/s².
        grousers: their height, m, or Grousers.
        passes: number of this pass over the same rut.
        size: numbers of nodes of load, slip (odd) and slip angle; ignored for laws without sinkage.

    Returns:
        The table. It takes about 0.3 s; `ForceTable.error` measures its error.

    Raises:
        RockerbogieError: impossible dimensions or loads.
    """
    law, field = check_law(soil), check_gravity(gravity)
    lugs = grousers if grousers is None or isinstance(grousers, Grousers) else Grousers(grousers)
    wheel = Wheel(radius, width, lugs, passes)
    low, high = (float(v) for v in loads)
    check_range("least load", low, 1e-6, 1e7, "N")
    check_range("largest load", high, low * 1.0001, 1e8, "N")
    if min(size) < 6 or size[1] % 2 == 0:
        raise RockerbogieError(f"size is {size}: give at least 6 nodes of load, slip and slip angle, and an odd number of slip")
    packed = law.packed(wheel, field)
    if packed[lay.L_KIND] != lay.SOIL:
        return ForceTable(np.concatenate([packed, np.zeros(kernel.T_VALUES - lay.LAW_SIZE)]), law, wheel, field, (low, high), 0.0)
    step = np.log(high / low) / (size[0] - 1)
    header = np.array([*size, low, step, *STRETCH, packed[lay.L_DEEPEST]])
    values, status = _nodes(packed, low * np.exp(step * np.arange(size[0])), size)
    overloaded = float((status == lay.OVERLOADED).mean())
    if not np.isfinite(values).all():
        raise RockerbogieError(f"the soil carries no load of {high:g} N on this wheel at some slips: give smaller loads")
    flat = np.concatenate([packed, header, _coefficients(values).ravel()])
    return ForceTable(flat, law, wheel, field, (low, high), overloaded)


def _unstretch(t: Array, stretch: float) -> Array:
    """Return p of t = p (1 + sqrt((1 + k²) / (p² + k²))) / 2, by bisection."""
    low, high = np.zeros_like(t), np.ones_like(t)
    for _ in range(60):
        p = 0.5 * (low + high)
        above = 0.5 * p * (1.0 + np.sqrt((1.0 + stretch**2) / (p * p + stretch**2))) > np.abs(t)
        low, high = np.where(above, low, p), np.where(above, p, high)
    return np.asarray(np.sign(t) * np.where(np.abs(t) == 1.0, 1.0, high) * (t != 0.0))


def _nodes(law: Array, loads: Array, size: tuple[int, int, int]) -> tuple[Array, NDArray[np.uint8]]:
    """Return force ratios (loads, slips, angles, 4) at the nodes, and the status of each."""
    p = _unstretch(np.linspace(-1.0, 1.0, size[1]), STRETCH[0])
    q = _unstretch(np.linspace(0.0, 1.0, size[2]), STRETCH[1])
    mean, across = np.maximum((1.0 - q * q) / (1.0 + q * q), SIDEWAYS), 2.0 * q / (1.0 + q * q)
    parts = np.broadcast_arrays(
        loads[:, None, None], mean * (1.0 + p[:, None]), mean * (1.0 - p[:, None]), np.broadcast_to(across, size[1:])
    )
    flat = [np.ascontiguousarray(part).ravel() for part in parts]
    n = flat[0].size
    out, status = np.empty((n, lay.OUTPUTS)), np.empty(n, dtype=np.uint8)
    parallel_for(node_kernel.motion_batch, n, law[None], np.zeros(n, dtype=np.int64), *flat, out, status)
    radius = law[lay.L_RADIUS]
    ratios = out / np.stack([flat[0], flat[0], flat[0] * radius, np.full(n, radius)], axis=1)
    return ratios.reshape(*size, lay.OUTPUTS), status.reshape(size)


def _coefficients(values: Array) -> Array:
    """Return the coefficients of the cubic B-spline through values (loads, slips, angles, 4).

    Each of the first three axes has two more coefficients than values.
    """
    free = (1.0, -4.0, 6.0, -4.0, 1.0)  # the third derivative has no jump at the node next to the end
    flat = (-0.5, 0.0, 0.5, 0.0, 0.0)
    coefficients = _along(_along(values, 0, flat, free), 1, free, free)
    even = _along(coefficients, 2, flat, free)
    odd = _along(coefficients, 2, (1.0, 0.0, 1.0, 0.0, 0.0), free)
    even[..., lay.SIDE] = odd[..., lay.SIDE]
    return even


def _along(values: Array, axis: int, first: tuple[float, ...], last: tuple[float, ...]) -> Array:
    """Return spline coefficients along an axis: interpolation, and one condition at each end."""
    n = values.shape[axis]
    matrix = np.zeros((n + 2, n + 2))
    for k in range(n):
        matrix[k + 1, k : k + 3] = 1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0
    matrix[0, :5] = first
    matrix[-1, -5:] = last[::-1]
    right = np.moveaxis(values, axis, 0).reshape(n, -1)
    right = np.concatenate([np.zeros((1, right.shape[1])), right, np.zeros((1, right.shape[1]))])
    solved = np.linalg.solve(matrix, right).reshape(n + 2, *np.moveaxis(values, axis, 0).shape[1:])
    return np.ascontiguousarray(np.moveaxis(solved, 0, axis))
