"""Logs of slip: each measurement at the row from which it is known (docs/forecast.md)."""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, floats
from ..errors import RockerbogieError, expect
from ..files.tables import Table, read_columns
from ..rover.model import LOAD_ROVER, Rover
from .attitude_log import LARGEST, known_log, read_places

if TYPE_CHECKING:
    import xarray as xr

#: A value counts as a measurement if the wheels have travelled this far since the one before it, m.
NEW_TRAVEL = 0.3
#: Values of the same travel that differ by less are equal.
SAME_VALUE = 1e-3
#: Slip that is linear between updates: at an update its rate changes by more than KINK, 1/s, and by a share of SAME. Stamps in
#: pauses are off by a second, which changes a rate by a few percent. An update nearer to a row than ON_ROW, s, is on it.
KINK, SAME, ON_ROW = 1e-6, 0.1, 1e-3
#: A corrected position: a step of more than STEP, m, within a pause of more than PAUSE, s, in which the wheels stand.
STEP, PAUSE, STANDING = 0.02, 2.0, 0.02
#: Longest travel between two corrected positions that is one measurement, m; largest share of it with wheels steered to turn.
LONGEST, TURNING, STEERED = 1.5, 0.2, 0.5
#: Steps between updates without wheel angles: speed of the wheels, m/s, and longest travel of a step, m.
STEP_SPEED, STEP_LENGTH = 0.0442, 1.0
#: Fastest mean speed of wheels, m/s.
FASTEST = 10.0
#: Largest yaw of a log, rad.
MOST_TURNS = 4 * np.pi
DRIVE, STEPS = "perseverance drive", ("sclk0_0", "sclk1_0", "fast_slip_frac")


def read_slip_log(file: str | Path, rover: Rover) -> xr.Dataset:
    """Read slip, wheel travel and slope from a log.

    Each slip stands in the row from which it is known.

    Three kinds of CSV are read. Drives of Perseverance (docs/validation.md): their slip is linear between the updates of
    the visual odometry, and so contains the next update before it is made; only the values at the updates are used. Tables of
    steps (`sclk0_0, sclk1_0, fast_slip_frac`): travel is that of the usual speed, at most 1 m a step. CSV with columns
    `time [s]`, `slip [1]`, `distance [m]` (wheel travel) and, if available, `roll`, `pitch` (unit in the header), and `x [m]`,
    `y [m]`, `yaw` of the body on a map: slip is held between updates, and the drive is forward.

    Positions that are corrected while the wheels stand give the slip since the last correction too, 1 − displacement /
    wheel travel, and replace the logged slip of the same travel. Several values of the same travel (less than 0.3 m apart)
    are one measurement: the last one counts.

    Args:
        file: the CSV.
        rover: the rover that made it.

    Returns:
        Dataset over `row`: `time` (s), `distance` (wheel travel, m), `slip` (1; NaN in rows without a new measurement),
        `from_position` (True: measured by positions), `along`, `across` (sine of the slope in the direction of travel, uphill
        positive, and to the left of the body, uphill positive; NaN if the log has no attitude), and `x`, `y`, `yaw`,
        `heading` (+1 forward, −1 backward) if it has positions.

    Raises:
        RockerbogieError: no such file, or a file of another kind.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    path = Path(file)
    if not path.is_file():
        raise RockerbogieError(f"no slip log at {str(file)!r}")
    with open(path, encoding="utf-8", errors="replace") as stream:
        if stream.readline().lstrip("#").strip().split(",") == list(STEPS):
            return _dataset(_steps(path), path.name)
    table = read_columns(path)
    known = known_log(path)
    if known is not None and known.name == DRIVE and table.find("SLIP") is not None:
        return _dataset(_drive(table, path, rover), path.name)
    if all(table.find(name) is not None for name in ("time", "slip", "distance")):
        return _dataset(_plain(table), path.name)
    raise RockerbogieError(
        f"{table.file} is no slip log: give columns time [s], slip [1] and distance [m] (wheel travel), or a drive of "
        f"Perseverance; it has {', '.join(table.names)}"
    )


def last_of_each(distance: Array, slip: Array) -> Any:
    """Return the row of the last value of each measurement.

    Args:
        distance: (n,) wheel travel, m.
        slip: (n,) NaN in rows without a new value.

    Returns:
        Rows, ascending; values less than 0.3 m of travel after the first of a measurement belong to it.
    """
    rows: list[int] = []
    first = -np.inf
    for row in np.flatnonzero(np.isfinite(slip)):
        if distance[row] - first >= NEW_TRAVEL:
            first = distance[row]
            rows.append(int(row))
        else:
            rows[-1] = int(row)
    return np.array(rows, dtype=np.int64)


def arrange_slip_log(log: xr.Dataset) -> xr.Dataset:
    """Check a slip log that was made by hand.

    Args:
        log: over one dim with `time`, `distance` and `slip`, and, if available, `along`, `across`, `x`, `y`, `yaw` and
            `heading`: see `read_slip_log`. Without `heading` the drive is forward.

    Returns:
        The log over `row`, with all variables of `read_slip_log` that have a default.

    Raises:
        RockerbogieError: a variable is missing, not finite or out of range; time or distance decreases.
    """
    import xarray as xr

    expect(log, xr.Dataset, "log", "give the path of a log, or what rockerbogie.read_slip_log returns")
    missing_names = [name for name in ("time", "distance", "slip") if name not in log.variables]
    if missing_names:
        raise RockerbogieError(
            f"the slip log has no {', '.join(missing_names)}: it needs time (s), distance (wheel travel, m) and slip"
        )
    for name in ("time", "distance", "slip"):
        if log[name].ndim != 1 or log[name].dims != log["slip"].dims:
            raise RockerbogieError(f"{name} in the slip log lies over {log[name].dims}: give one value a row")
    (dim,) = log["slip"].dims
    values: dict[str, Any] = {name: _floats(log, name) for name in ("time", "distance", "slip")}
    missing = np.full(len(values["slip"]), np.nan)
    values |= {name: _floats(log, name) if name in log.variables else missing for name in ("along", "across")}
    values["from_position"] = np.asarray(log["from_position"].to_numpy() if "from_position" in log else missing == 0, dtype=bool)
    for name in ("x", "y", "yaw", "heading"):
        if name in log.variables:
            values[name] = _floats(log, name)
    if all(name in values for name in ("x", "y", "yaw")):
        values.setdefault("heading", np.ones(len(values["slip"])))
    return _dataset(values, str(log.attrs.get("log", dim)))


def _floats(log: xr.Dataset, name: str) -> Array:
    """Return a variable of a slip log as floats, or raise."""
    try:
        return floats(log[name].to_numpy())
    except (TypeError, ValueError, OverflowError):
        raise RockerbogieError(f"{name} in the slip log is of type {log[name].dtype}: give numbers") from None


def _dataset(values: dict[str, Any], name: str) -> xr.Dataset:
    """Return the Dataset of a log after the checks that all kinds share."""
    import xarray as xr

    if not len(values["slip"]):
        raise RockerbogieError(f"{name} has no rows: there is nothing to fit")
    for key in ("time", "distance"):
        column = values[key]
        if not np.isfinite(column).all() or (np.diff(column) < 0).any():
            row = int(np.argmax(~np.isfinite(column) | (np.diff(column, prepend=column[0]) < 0))) + 1
            raise RockerbogieError(f"{name}: {key} is not finite or decreases in row {row}: sort the log and fill its gaps")
    took, gone = np.ptp(values["time"]), np.ptp(values["distance"])
    if gone > FASTEST * took:
        raise RockerbogieError(
            f"{name}: the wheels travel {gone:g} m in {took:g} s: give the distance in metres and the time in seconds"
        )
    slip = values["slip"]
    if not np.isfinite(slip).any():
        raise RockerbogieError(f"{name} holds no slip after the wheels began to turn: there is nothing to fit")
    beyond = np.flatnonzero((slip < -1) | (slip > 1))
    if len(beyond):
        raise RockerbogieError(f"{name}: slip is {slip[beyond[0]]:.4g} in row {beyond[0] + 1}, beyond 1: divide percent by 100")
    for key in ("along", "across"):
        if (np.abs(values[key]) > 1).any():
            worst = np.nanmax(np.abs(values[key]))
            raise RockerbogieError(f"{name}: {key} is up to {worst:.4g}: give the sine of the slope, which is within ±1")
    units = {"time": "s", "distance": "m", "x": "m", "y": "m", "yaw": "rad"}
    data = {key: ("row", column, {"units": units.get(key, "1")}) for key, column in values.items()}
    return xr.Dataset(data, {"row": 1 + np.arange(len(slip))}, {"log": name})


def _steps(path: Path) -> dict[str, Array]:
    """Return the columns of a table of steps: one row per step, in the order of time."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # no rows: the error below says so
            table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        reason = str(error).partition(";")[0]  # after it loadtxt suggests one of its own options
        raise RockerbogieError(f"{path.name} cannot be read as a table of steps: {reason}") from None
    if table.shape[1] != len(STEPS) or not np.isfinite(table[:, :2]).all(axis=1).any():
        raise RockerbogieError(f"{path.name} has no row with a start, an end and a slip: there is nothing to fit")
    start, end, slip = table.T
    kept = np.flatnonzero(np.isfinite(start) & np.isfinite(end))
    kept = kept[np.argsort(start[kept], kind="stable")]
    travel = np.minimum(STEP_LENGTH, STEP_SPEED * (end - start)[kept])
    missing = np.full(len(kept), np.nan)
    distance = np.concatenate([[0.0], np.cumsum(travel)[:-1]])  # the value is known from the start of its step
    return {
        "time": start[kept] - start[kept[0]], "distance": distance, "slip": slip[kept], "from_position": missing == 0,
        "along": missing, "across": missing,
    }  # fmt: skip


def _plain(table: Table) -> dict[str, Array]:
    """Return the columns of a CSV whose slip is held between updates."""
    time, slip, distance = table.times("time"), table.numbers("slip"), table.numbers("distance")
    rows = np.flatnonzero(~np.isnan(slip))
    changed = rows[np.flatnonzero(np.diff(slip[rows], prepend=np.nan) != 0)]
    new = np.full(len(slip), np.nan)
    new[changed] = slip[changed]
    missing = np.full(len(slip), np.nan)
    found = {"time": time, "distance": distance, "slip": new, "from_position": missing == 0, "along": missing, "across": missing}
    if all(table.find(name) is not None for name in ("roll", "pitch")):
        roll, pitch = (_attitude(table, name) for name in ("roll", "pitch"))
        found |= {"along": -np.sin(pitch), "across": np.cos(pitch) * np.sin(roll)}
    if all(table.find(name) is not None for name in ("x", "y", "yaw")):
        x, y, yaw = (table.numbers(name) for name in ("x", "y", "yaw"))
        if (np.abs(yaw) > MOST_TURNS).any():
            raise RockerbogieError(f"{table.file}: yaw is beyond 4 π: if it is in degrees, write yaw [deg] in the header")
        found |= {"x": x, "y": y, "yaw": yaw, "heading": np.ones(len(slip))}
    return found


def _attitude(table: Table, name: str) -> Array:
    """Return roll or pitch, rad."""
    values = table.numbers(name)
    if (np.abs(values) > LARGEST).any():
        raise RockerbogieError(f"{table.file}: {name} is beyond π/2: if it is in degrees, write {name} [deg] in the header")
    return values


def _drive(table: Table, path: Path, rover: Rover) -> dict[str, Array]:
    """Return the columns of a drive of Perseverance."""
    places = read_places(path, rover)
    rows = places["row"].to_numpy() - 1
    time = table.numbers("SCLK")[rows]
    slip = table.numbers("SLIP")[rows]
    wheels = np.stack([table.numbers(f"{wheel}_DRIVE")[rows] for wheel in rover.wheel_names], axis=-1) * rover.wheel_radius
    position = np.stack([table.numbers(f"ROVER_{axis}")[rows] for axis in "XYZ"], axis=-1)
    if not all(np.isfinite(column).all() for column in (time, slip, wheels, position)):
        raise RockerbogieError(f"{table.file}: time, slip, wheels or position have gaps: leave those rows out")
    step = np.diff(wheels, axis=0)
    distance = np.concatenate([[0.0], np.abs(step).mean(axis=1).cumsum()])
    yaw = places["yaw"].to_numpy()
    nose = np.stack([np.sin(yaw), np.cos(yaw)], axis=-1)  # north and east, as the position
    heading = _direction(position[:, :2], nose, distance)
    steered = np.abs(places["steering"].to_numpy()).max(axis=1) > STEERED
    by_log = _updates(time, slip)
    by_position = _corrections(time, distance, position, steered)
    new, from_position = np.full(len(time), np.nan), np.zeros(len(time), dtype=bool)
    first, last = 0.0, -1  # travel at the first, and row of the last, value of the same travel
    for k in sorted({*by_log, *by_position}):
        fresh, direct = distance[k] - first >= NEW_TRAVEL, k in by_position
        value = by_position[k] if direct else by_log[k]
        if fresh:
            first = distance[k]
        elif last < 0 or (from_position[last] and not direct) or abs(value - new[last]) < SAME_VALUE:
            continue
        new[k], from_position[k], last = value, direct, k
    pitch, roll = places["pitch"].to_numpy(), places["roll"].to_numpy()
    return {
        "time": time - time[0], "distance": distance, "slip": new, "from_position": from_position,
        "along": -np.sin(pitch) * heading, "across": np.cos(pitch) * np.sin(roll),
        "x": places["x"].to_numpy(), "y": places["y"].to_numpy(), "yaw": yaw, "heading": heading,
    }  # fmt: skip


def _direction(position: Array, nose: Array, distance: Array) -> Array:
    """Return the direction of the last travel for each row: +1 forward, −1 backward.

    Before the first travel it is +1. Positions give it, because the signs of encoders differ from rover to rover.
    """
    ahead = (np.diff(position, axis=0) * nose[1:]).sum(axis=1)
    gone = np.concatenate([[0.0], np.where(np.diff(distance) > 1e-3, ahead, 0.0).cumsum()])
    net = gone - gone[np.searchsorted(distance, distance - NEW_TRAVEL)]
    at = np.maximum.accumulate(np.where(np.abs(net) > NEW_TRAVEL / 2, np.arange(len(net)), 0))
    return np.where(np.abs(net[at]) > NEW_TRAVEL / 2, np.sign(net[at]), 1.0)


def _updates(time: Array, slip: Array) -> dict[int, float]:
    """Return row -> value of the updates of a slip that is linear between them.

    The lines before and after an update meet at it. It is known two rows later, when the second line is. An interval with an
    update inside is on neither line.
    """
    rate = np.diff(slip) / np.maximum(np.diff(time), 1e-9)
    found: dict[int, float] = {}
    mixed = -2  # the last interval with an update inside
    for k in range(1, len(rate) - 1):
        before, after = rate[k - 1], rate[k + 1]
        if abs(after - before) <= KINK + SAME * abs(before) or mixed == k - 1:
            continue
        span = time[k + 1] - time[k]
        x = (slip[k + 1] - after * span - slip[k]) / (before - after)
        if -ON_ROW <= x <= span + ON_ROW and slip[k] != 0:
            found[k + 2] = float(slip[k] + before * x)
            mixed = k if ON_ROW < x < span - ON_ROW else mixed
    return found


def _corrections(time: Array, distance: Array, position: Array, steered: Any) -> dict[int, float]:
    """Return row -> slip since the last corrected position, without turns on the spot."""
    moved, travel = np.linalg.norm(np.diff(position, axis=0), axis=1), np.diff(distance)
    rows = [0, *(1 + np.flatnonzero((moved > STEP) & (travel < STANDING) & (np.diff(time) > PAUSE)))]
    found = {}
    for a, b in pairwise(rows):
        rolled = distance[b] - distance[a]
        if not NEW_TRAVEL <= rolled <= LONGEST:
            continue
        turned = float(travel[a:b][steered[a + 1 : b + 1]].sum())
        if turned <= TURNING * rolled:
            found[int(b)] = float(np.clip(1 - np.linalg.norm(position[b] - position[a]) / rolled, -1, 1))
    return found
