"""Commands of predicted drives, one row a step: paths, or wheel rates and steering."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._kernels.dynamics import evaluate as kernel
from ...arrays import Array
from ...errors import PathError, RockerbogieError
from ...rover.model import Rover
from ..command_table import read_commands
from ..drive import ackermann
from ..path import Path

if TYPE_CHECKING:
    import xarray as xr

#: Largest number of steps of one drive.
MOST_STEPS = 200_000
GIVE = "give a Path, a Dataset of wheel_rate and steering over (time, wheel), or a list of one kind"


class PackedCommands(NamedTuple):
    """Commands as the kernel takes them; they are constant over each step."""

    rows: Array  # (c, steps, C_SIZE)
    counts: NDArray[np.int64]  # (c,) number of steps
    span: float  # s, duration of a step
    fastest: Array  # (c,) fastest rim speed of each, m/s
    shape: tuple[int, ...]  # () for one command, (c,) for a list
    description: str


def pack_commands(
    rover: Rover, commands: Path | xr.Dataset | Sequence[Path] | Sequence[xr.Dataset], speed: float, step: float
) -> PackedCommands:
    """Return commands as the kernel takes them.

    Args:
        rover: the rover.
        commands: as for `predict`.
        speed: horizontal speed along paths, m/s.
        step: m.

    Returns:
        The packed commands.

    Raises:
        PathError, RockerbogieError: as for `predict`.
    """
    import xarray as xr

    single = isinstance(commands, Path | xr.Dataset)
    items = [commands] if single else list(commands) if isinstance(commands, Sequence) else []
    shape = () if single else (len(items),)
    if items and all(isinstance(item, Path) for item in items):
        return _pack_paths(rover, items, speed, step, shape)  # type: ignore[arg-type]
    if items and all(isinstance(item, xr.Dataset) for item in items):
        return _pack_rates(rover, items, step, shape)  # type: ignore[arg-type]
    raise RockerbogieError(f"commands are {commands!r:.60}: {GIVE}")


def _check_count(count: float, step: float) -> int:
    """Return the number of steps, or raise if there are too many."""
    if not count < MOST_STEPS:
        raise PathError(f"the commands take {count:.3g} steps of {step:g} m, more than {MOST_STEPS:,}: give a longer step")
    return max(int(np.ceil(count - 1e-9)), 1)


def _pack_paths(rover: Rover, paths: list[Path], speed: float, step: float, shape: tuple[int, ...]) -> PackedCommands:
    """Return the commands of paths: twist and steering in the middle of each step.

    The step is reduced a little if the longest path is no multiple of it. The last step of a shorter path is driven more slowly.
    """
    longest = max(path.length for path in paths)
    most = _check_count(longest / step, step)
    step = longest / most
    counts = np.array([_check_count(path.length / step, step) for path in paths])
    rows = np.zeros((len(paths), most, kernel.C_SIZE))
    for row, path, count in zip(rows, paths, counts, strict=True):
        at = np.minimum(np.arange(count + 1) * step, path.length)
        covered = np.diff(at)
        middle = path.sample(at[:-1] + covered / 2)
        turned = np.diff(path.sample(at).yaw)
        crab = middle.course - middle.yaw
        pace = speed * covered / step
        row[:count, kernel.C_TRACKS] = 1.0
        row[:count, kernel.C_VALUES] = pace * np.cos(crab)
        row[:count, kernel.C_VALUES + 1] = pace * np.sin(crab)
        row[:count, kernel.C_VALUES + 2] = speed * turned / step
        row[:count, kernel.C_STEERING :] = ackermann(rover, turned / covered, crab)
    what = paths[0].description if len(paths) == 1 else f"{len(paths)} paths, the first: {paths[0].description}"
    return PackedCommands(rows, counts, step / speed, np.full(len(paths), speed), shape, what)


def _pack_rates(rover: Rover, tables: list[xr.Dataset], step: float, shape: tuple[int, ...]) -> PackedCommands:
    """Return commands of wheel rates and steering over time, sampled in the middle of each step.

    In a step the fastest wheel of all rolls by `step`, or a little less.
    """
    read = [read_commands(rover, table) for table in tables]
    ends = np.array([time[-1] for time, _, _ in read])
    fastest = np.array([np.abs(rate * rover.wheel_radius).max() for _, rate, _ in read])
    if not fastest.min() > 0.0:
        raise RockerbogieError("all commanded wheel rates are 0: the rover is parked; use rockerbogie.settle and wheel_loads")
    if np.ptp(ends) > 1e-9 * ends.max():
        raise RockerbogieError(f"the commands last {ends.min():g} to {ends.max():g} s: give commands of one duration")
    count = _check_count(ends[0] * fastest.max() / step, step)
    rows = np.zeros((len(tables), count, kernel.C_SIZE))
    span = float(ends[0] / count)
    middle = (np.arange(count) + 0.5) * span
    for row, (time, rate, angle) in zip(rows, read, strict=True):
        for i in range(6):
            row[:, kernel.C_VALUES + i] = np.interp(middle, time, rate[:, i])
            row[:, kernel.C_STEERING + i] = np.interp(middle, time, angle[:, i])
    what = f"{ends[0]:g} s of commands" if len(tables) == 1 else f"{len(tables)} tables of commands of {ends[0]:g} s"
    return PackedCommands(rows, np.full(len(tables), count), span, fastest, shape, what)
