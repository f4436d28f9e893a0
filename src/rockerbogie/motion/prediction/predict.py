"""Predicted drives: motion, slip, forces and energy from the balance of the mechanism."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._kernels.dynamics.evaluate import C_STEERING
from ..._kernels.dynamics.record import R_SIZE
from ..._kernels.dynamics.rollout import predict_batch
from ..._kernels.jit.parallel import parallel_for
from ...arrays import Array, floats, is_number
from ...errors import PathError, RockerbogieError, expect
from ...gravity import GRAVITY, check_gravity
from ...rover.model import LOAD_ROVER, Rover
from ...terrain.heightfield import Terrain
from ...terrain.soil.laws import Grousers, WheelLaw
from ..path import Path
from .commands import PackedCommands, pack_commands
from .dataset import prediction_dataset
from .outcome import drive_ends
from .soil import SoilTables, soil_tables

if TYPE_CHECKING:
    import xarray as xr

#: Fastest commanded speed, m/s: the motion is quasi-static.
FASTEST = 10.0
#: Default step over the smallest wheel radius.
STEP_SHARE = 0.25
#: Largest size of the records of one call, bytes.
MOST_BYTES = 4e9
#: Coefficient of friction from which the solution on soil starts.
START_FRICTION = 0.6
#: Drives of one piece of a parallel loop.
PIECE = 8


def predict(
    rover: Rover,
    terrain: Terrain,
    start: ArrayLike | None,
    commands: Path | xr.Dataset | Sequence[Path] | Sequence[xr.Dataset],
    *,
    friction: ArrayLike | None = None,
    soil: str | WheelLaw | Sequence[str | WheelLaw] | None = None,
    grousers: Grousers | float | None = None,
    ruts: bool = True,
    speed: float = 0.02,
    step: float | None = None,
    tolerance: float | None = None,
    record: float | None = None,
    gravity: float = GRAVITY["earth"],
    torque: ArrayLike | None = None,
    details: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Predict where a rover goes when it is driven open loop.

    At each station the pose is settled. Forward, side and yaw rate and the six wheel loads then follow from the nine balance
    equations of the mechanism with the force law of each wheel. x, y and yaw are integrated by a Runge-Kutta method of
    order 3. Motion is quasi-static: accelerations are neglected.

    Leading axes of `start`, a list of commands, and `friction` or a list of soils are broadcast against each other. Each
    combination is one drive, computed by itself: results do not depend on the number of threads.

    Args:
        rover: the mechanism, with masses.
        terrain: the height field.
        start: (..., 3) x (m), y (m) and yaw (rad) at the start. None: where the path starts.
        commands: a Path, whose curvature and direction relative to the body are commanded open loop from the start, with the
            wheel rates at which no wheel would slip forward at the pose; or a Dataset of `wheel_rate`, rad/s, and `steering`,
            rad, over (time, wheel), linear in between. Or a list of either, for one more batch axis.
        friction: (...) coefficient of friction between wheels and rigid terrain, above 0.
        soil: instead of friction: name of a soil (`soils`), a law (`Soil`, `SlipCurve`, `Coulomb`), or a list of them for a
            batch axis. Wheels sink; the pose is settled on the surface, without sinkage.
        grousers: on soil: their height, m, or Grousers.
        ruts: on soil: True if wheels behind others run in their ruts.
        speed: horizontal speed along a path, m/s.
        step: distance of a step, m, at most the wheelbase: along a path, or rolled by the fastest wheel; reduced a little if
            the length is no multiple of it. Default: a quarter of the smallest wheel radius.
        tolerance: halve a step, at most 20 times, while the error of its energy balance exceeds this share of the work that
            lifts the rover by the step's length. If the errors of its parts add up to 32 times as much, the drive ends as
            INACCURATE. Default: a step without a pose or a motion is halved, at most 4 times, and on soil a step whose error
            exceeds 0.01 too.
        record: distance between records, m, rounded to steps. Default: each step is recorded.
        gravity: m/s², from 0.001 to 100 (`GRAVITY`).
        torque: torque limit of the wheel motors, a number or (6,), N·m. A wheel whose motor would exceed it turns at the rate at
            which its torque equals the limit. Default: the rover's `wheel_torque`, inf if not known.
        details: False leaves out contact points, contact angles, gaps and clearance, which take longer than the drive itself.
        progress: called with (drives done, drives in all).

    Returns:
        Dataset over (..., time), as from `drive`, with slip, forces, torques and energies (docs/prediction.md). Batch axes are
        `run`, or `run_0`, `run_1`, … A drive that cannot continue ends: its further records are NaN, and `ends_because`
        gives the reason. Without batch axes the records end there.

    Raises:
        PathError: speed or step that is not above 0; a speed above 10 m/s; a step beyond the wheelbase; too many steps.
        RockerbogieError: another argument of a wrong type, shape or value; too many records for memory.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_array, from_raster or rockerbogie.surfaces")
    if not rover.mass > 0.0:
        raise RockerbogieError(f"rover {rover.name!r} has no mass: give its masses, the motion depends on wheel loads")
    field = check_gravity(gravity)
    if not (is_number(speed) and speed > 0):
        raise PathError(f"speed is {speed!r:.60} m/s; give one above 0 (to drive backwards, give a path whose yaw points back)")
    if step is None:
        step = STEP_SHARE * float(rover.wheel_radius.min())
    for name, value in (("step", step), ("record", step if record is None else record)):
        if not (is_number(value) and value > 0):
            raise PathError(f"{name} is {value!r:.60} m; give one above 0")
    wheelbase = float(np.ptp(rover.hubs[..., 0]))
    if step > wheelbase:
        raise PathError(f"step is {step:g} m; give at most the wheelbase, {wheelbase:.4g} m (is it in millimetres?)")
    error = np.inf if tolerance is None else tolerance
    if tolerance is not None and not (is_number(tolerance) and tolerance > 0.0):
        raise RockerbogieError(f"tolerance is {tolerance!r:.60}; give a number above 0, such as 1e-6")
    mu, grip = _force_law(rover, friction, soil, field, grousers, ruts)
    limits = _torque(rover, torque)
    packed = pack_commands(rover, commands, float(speed), float(step))
    if packed.fastest.max() > FASTEST:
        raise PathError(
            f"the fastest wheel is commanded to roll at {packed.fastest.max():g} m/s; the motion is quasi-static, give at most "
            f"{FASTEST:g} m/s (is a speed in mm/s, or a wheel rate in deg/s?)"
        )
    first = _start(start, commands)
    try:
        shape = np.broadcast_shapes(first.shape[:-1], packed.shape, mu.shape, grip.shape)
    except ValueError:
        raise RockerbogieError(
            f"start of shape {first.shape}, {packed.shape} commands, friction of shape {mu.shape} and "
            f"{grip.shape} soils do not broadcast together"
        ) from None
    size = int(np.prod(shape))
    if size == 0:
        raise RockerbogieError(f"start of shape {first.shape} and friction of shape {mu.shape} give no drive: give one or more")
    first = np.ascontiguousarray(np.broadcast_to(first, (*shape, 3))).reshape(size, 3)
    mu = np.ascontiguousarray(np.broadcast_to(mu, shape)).reshape(size)
    soil_of = np.ascontiguousarray(np.broadcast_to(np.arange(len(grip.table_of)).reshape(grip.shape), shape)).reshape(size)
    which = np.ascontiguousarray(np.broadcast_to(np.arange(len(packed.rows)).reshape(packed.shape), shape)).reshape(size)
    steps = int(packed.counts.max())
    every = 1 if record is None else max(round(record * steps / _length(packed)), 1)
    records = -(-steps // every) + 1
    if size * records * R_SIZE * 8.0 > MOST_BYTES:
        raise RockerbogieError(
            f"{size:,} drives of {records:,} records take {size * records * R_SIZE * 8e-9:.1f} GB: give a larger record="
        )
    drives = _Drives(first, which, mu, grip.tables, grip.table_of[soil_of])
    out, ends, places = _roll_out(rover, terrain, packed, drives, field, limits, float(error), every, records, progress)
    stopped = packed.rows[which, np.minimum(ends[:, 1], packed.counts[which] - 1), C_STEERING:]
    rigid = mu if soil is None else np.full(size, np.nan)
    codes = drive_ends(rover, terrain, ends[:, 0], places, stopped, rigid, bool(np.isfinite(limits).any()))
    return prediction_dataset(
        rover, terrain, packed, commands, first, which, out, ends[:, 1], codes, shape, every, details,
        {"friction": rigid.reshape(shape), "gravity": field, "speed": float(speed), "soils": np.array(grip.names)[soil_of]},
    )  # fmt: skip


class _Drives(NamedTuple):
    """Inputs of each of n drives."""

    first: Array  # (n, 3) x, y (m) and yaw (rad) at the start
    which: NDArray[np.int64]  # (n,) row of the packed commands
    friction: Array  # (n,) coefficient on rigid terrain
    tables: Array  # (m, size) packed tables of wheel-soil forces (`SoilTables`)
    table_of: NDArray[np.int64]  # (n, 6) table of each wheel


def _roll_out(
    rover: Rover, terrain: Terrain, packed: PackedCommands, drives: _Drives, gravity: float, limits: Array, tolerance: float,
    every: int, records: int, progress: Callable[[int, int], None] | None,
) -> tuple[Array, NDArray[np.int64], Array]:  # fmt: skip
    """Return records (n, records, R_SIZE), ends (n, 2) and the positions of the ends (n, 3)."""
    size = len(drives.first)
    # numba compiles read-only arrays apart
    first, mu, tables, limits, rows, fastest = (
        np.require(array, requirements=["C", "W"])
        for array in (drives.first, drives.friction, drives.tables, limits, packed.rows, packed.fastest)
    )
    which, table_of, counts = (
        np.require(array, requirements=["C", "W"]) for array in (drives.which, drives.table_of, packed.counts)
    )
    out, ends, places = np.empty((size, records, R_SIZE)), np.zeros((size, 2), dtype=np.int64), np.zeros((size, 3))
    batch = size if progress is None else max(PIECE * 64, 1)
    for begin in range(0, size, batch):
        part = slice(begin, min(begin + batch, size))
        parallel_for(
            predict_batch, part.stop - begin, terrain.packed, rover.packed, first[part], rows, which[part],
            counts, packed.span, fastest, mu[part], tables, table_of[part], gravity, limits, tolerance, every,
            out[part], ends[part], places[part],
            piece=PIECE,
        )  # fmt: skip
        if progress is not None:
            progress(part.stop, size)
    return out, ends, places


def _length(packed: PackedCommands) -> float:
    """Return the longest distance that is commanded, m."""
    return float(packed.fastest.max() * packed.span * packed.counts.max())


def _numbers(name: str, value: ArrayLike, unit: str) -> Array:
    """Return an argument as an array of finite floats, or raise."""
    try:
        array = floats(value)
    except (TypeError, ValueError, OverflowError):
        raise RockerbogieError(f"{name} is {value!r:.60}; give numbers{unit}") from None
    if not np.isfinite(array).all():
        raise RockerbogieError(f"{name} is not finite in {int((~np.isfinite(array)).sum())} of {array.size} values")
    return array


def _force_law(
    rover: Rover, friction: ArrayLike | None, soil: str | WheelLaw | Sequence[str | WheelLaw] | None, gravity: float,
    grousers: Grousers | float | None, ruts: bool,
) -> tuple[Array, SoilTables]:  # fmt: skip
    """Return friction coefficients (...) and soil tables, or raise.

    On soil the coefficient only starts the solver.
    """
    if (friction is None) == (soil is None):
        raise RockerbogieError("give either friction=, the coefficient on rigid terrain, or soil=, one of rockerbogie.soils()")
    if soil is not None:
        return np.array(START_FRICTION), soil_tables(rover, soil, gravity, grousers, ruts)
    if grousers is not None:
        raise RockerbogieError("grousers act in soil only: give soil= with them, or leave them out")
    mu = _numbers("friction", friction, "")  # type: ignore[arg-type]
    if not (mu > 0.0).all():
        raise RockerbogieError(f"friction is {float(mu.min()):g}: give coefficients above 0")
    return mu, SoilTables(np.zeros((1, 1)), np.full((1, 6), -1, dtype=np.int64), (), [""])


def _torque(rover: Rover, torque: ArrayLike | None) -> Array:
    """Return torque limits (6,), N m, or raise."""
    if torque is None:
        return np.array(rover.wheel_torque, dtype=float)
    try:
        limits = floats(torque)
    except (TypeError, ValueError, OverflowError):
        raise RockerbogieError(f"torque is {torque!r:.60}; give N·m, one number or six") from None
    if limits.shape not in ((), (6,)) or not (limits > 0.0).all():
        raise RockerbogieError(f"torque is {torque!r:.60}; give N·m above 0, one number or six")
    return np.broadcast_to(limits, (6,)).copy()


def _start(start: ArrayLike | None, commands: object) -> Array:
    """Return x, y and yaw (..., 3) at the start, or raise."""
    if start is None:
        paths = [commands] if isinstance(commands, Path) else list(commands) if isinstance(commands, Sequence) else []
        if not paths or not all(isinstance(path, Path) for path in paths):
            raise RockerbogieError("start is None, but commands over time have no position: give start=(x, y, yaw)")
        at = np.array([[path.x[0], path.y[0], path.yaw[0]] for path in paths])
        return at[0] if isinstance(commands, Path) else at
    first = _numbers("start", start, ": x (m), y (m) and yaw (rad)")
    if first.ndim == 0 or first.shape[-1] != 3:
        raise RockerbogieError(f"start has shape {first.shape}; give (..., 3): x (m), y (m) and yaw (rad)")
    return first
