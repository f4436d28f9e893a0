"""Variables of a log: names, dims and units, and a Dataset brought into that form."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..files.tables import UNITS, find_unit
from ..rover.model import Rover

if TYPE_CHECKING:
    import xarray as xr

SIDES, AXES = ("left", "right"), ("x", "y", "z")
#: Variable of a log -> (dims after time, unit).
LOG_VARIABLES: dict[str, tuple[tuple[str, ...], str]] = {
    "wheel_angle": (("wheel",), "rad"),
    "wheel_rate": (("wheel",), "rad/s"),
    "steering": (("wheel",), "rad"),
    "rocker": ((), "rad"),
    "bogie": (("side",), "rad"),
    "roll": ((), "rad"),
    "pitch": ((), "rad"),
    "yaw": ((), "rad"),
    "gyro": (("axis",), "rad/s"),
    "x": ((), "m"),
    "y": ((), "m"),
    "z": ((), "m"),
}
ATTITUDE = ("roll", "pitch", "yaw")
#: Largest angle of each variable, rad: a larger one is most likely in degrees.
LARGEST = {"steering": np.pi, "rocker": np.pi / 2, "bogie": np.pi / 2, "pitch": np.pi / 2 + 1e-6}


#: Names of the column of times, the usual one first.
CLOCKS = ("time", "t", "timestamp", "stamp")


def clock_of(names: Iterable[str], file: str) -> str | None:
    """Find the column of times by its name, in any case.

    Args:
        names: columns of a log.
        file: its name, for messages.

    Returns:
        `time` if it is there, else the one of `CLOCKS`; `None` if there is none.

    Raises:
        RockerbogieError: several names other than `time`.
    """
    found = {name.lower(): name for name in names if name.lower() in CLOCKS}
    if "time" in found or len(found) < 2:
        return found.get("time") or next(iter(found.values()), None)
    theirs = sorted(found.values())
    raise RockerbogieError(f"{file} has times {' and '.join(theirs)}: name one of them, as in --name {theirs[0]}=time")


class LogWarning(UserWarning):
    """A log that is read, but whose sensors are missing or disagree."""


@dataclass
class LogReport:
    """Remarks on a log: `read` (sources), `notes` (repairs), `warnings` (doubtful sensors)."""

    read: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Add a repair, once.

        Args:
            text: a sentence.
        """
        if text not in self.notes:
            self.notes.append(text)

    def warn(self, text: str) -> None:
        """Add a warning, once.

        Args:
            text: a sentence.
        """
        if text not in self.warnings:
            self.warnings.append(text)

    def attrs(self) -> dict[str, str]:
        """Return the remarks as attributes of a Dataset, one line each.

        Returns:
            Attribute -> text.
        """
        return {name: "\n".join(getattr(self, name)) for name in ("read", "notes", "warnings")}

    def emit(self) -> None:
        """Issue the warnings as `LogWarning`."""
        for text in self.warnings:
            warnings.warn(text, LogWarning, stacklevel=3)


def labels_of(rover: Rover) -> dict[str, tuple[str, ...]]:
    """Return the labels of each dim of a log.

    Args:
        rover: the rover; its wheels' names are the labels of `wheel`.

    Returns:
        Dim -> labels, in order.
    """
    return {"wheel": tuple(rover.wheel_names), "side": SIDES, "axis": AXES}


def column_names(rover: Rover) -> dict[str, tuple[str, int]]:
    """Return the column names of a log of this rover.

    Args:
        rover: the rover.

    Returns:
        Column -> (variable, index): `wheel_angle_LF` -> ("wheel_angle", 0). The index is 0 for variables of one column.
    """
    found = {}
    for variable, (dims, _) in LOG_VARIABLES.items():
        for k, label in enumerate(labels_of(rover)[dims[0]] if dims else ("",)):
            found[f"{variable}_{label}" if dims else variable] = (variable, k)
    return found


def arrange_log(rover: Rover, log: xr.Dataset, file: str = "the log") -> xr.Dataset:
    """Return the variables of a log in SI, with labels in the rover's order.

    Units are read from each variable's attribute `units`, labels from coordinates; without them, SI and the rover's order
    are assumed. Times may be numbers, dates (datetime64) or durations (timedelta64).

    Args:
        rover: the rover that made the log.
        log: Dataset over `time`.
        file: its name, for messages.

    Returns:
        Dataset of those `LOG_VARIABLES` that the log has. Values that need no conversion are unchanged.

    Raises:
        RockerbogieError: no time, other wheels, a unit that does not fit, a shape that does not fit, angles in degrees.
    """
    import xarray as xr

    if "time" not in log.variables:
        clock = clock_of(map(str, log.variables), file)
        if clock is None:
            raise RockerbogieError(f"{file} has no coordinate 'time'")
        log = log.rename({clock: "time"})
    if log["time"].ndim != 1:
        raise RockerbogieError(f"time in {file} lies over {log['time'].dims}; give one value a row")
    (dim,) = log["time"].dims
    data: dict[str, Any] = {}
    for name, (dims, unit) in LOG_VARIABLES.items():
        if name not in log.variables:
            continue
        array = log[name]
        given = ["time" if d == dim else d for d in map(str, array.dims)]
        if sorted(given) != sorted(("time", *dims)) and array.ndim == 1 + len(dims):
            given = ["time", *dims]  # other names of dims: by position
        values = np.asarray(array.values)
        if sorted(given) == sorted(("time", *dims)):
            values = np.transpose(values, [given.index(d) for d in ("time", *dims)])
        shape = (log.sizes[dim], *(len(labels_of(rover)[d]) for d in dims))
        if values.shape != shape:
            raise RockerbogieError(f"{name} in the log has shape {array.shape}; give {shape}")
        if dims and (array.dims[-1] in array.coords or dims[0] in array.coords):
            values = _in_order(values, array, dims[0], labels_of(rover)[dims[0]], rover, file)
        values = _in_si(values, name, unit, str(array.attrs.get("units", "")), file)
        check_angles(name, values, file)
        kept = {key: text for key, text in array.attrs.items() if key not in ("units", "long_name")}
        data[name] = (("time", *dims), values, {"units": unit, **kept})
    coords = {key: list(v) for key, v in labels_of(rover).items()}
    time = seconds_of(log["time"].values, str(log["time"].attrs.get("units", "")), file)
    return xr.Dataset(data, {"time": ("time", time, {"units": "s"}), **coords}, dict(log.attrs))


def _in_order(values: Array, array: xr.DataArray, dim: str, labels: tuple[str, ...], rover: Rover, file: str) -> Array:
    """Return the values with their last axis in the order of the labels."""
    theirs = (
        [str(label) for label in array[dim].values] if dim in array.coords else [str(v) for v in array[array.dims[-1]].values]
    )
    if theirs == list(labels) or theirs == [str(k) for k in range(len(labels))]:
        return values
    if sorted(theirs) != sorted(labels):
        if dim == "wheel":
            raise RockerbogieError(f"{file} is of wheels {', '.join(theirs)}; rover {rover.name!r} has {', '.join(labels)}")
        raise RockerbogieError(f"{array.name} in {file} has {dim}s {', '.join(theirs)}; they must be {', '.join(labels)}")
    return values[..., [theirs.index(label) for label in labels]]


def _in_si(values: Array, name: str, unit: str, given: str, file: str) -> Array:
    """Return the values in SI from the unit that the log gives; no unit is SI."""
    values = np.asarray(values, dtype=float)
    if not given or given == unit:
        return values
    found = find_unit(given)
    wanted = UNITS[unit][0]
    if found is None or found[0] != wanted:
        why = "is not a known unit" if found is None else f"is a unit of {found[0]}"
        raise RockerbogieError(f"{name} in {file} is in {given!r}, which {why}; give {unit} or another unit of {wanted}")
    return values * found[1] if found[1] != 1.0 else values


def check_angles(name: str, values: Array, file: str) -> None:
    """Raise if angles are too large to be radians.

    Args:
        name: the variable.
        values: (...) rad.
        file: the log's name, for the message.

    Raises:
        RockerbogieError: an angle beyond `LARGEST`.
    """
    limit = LARGEST.get(name)
    if limit is None or not np.isfinite(values).any():
        return
    # single wild values are repaired later; a log in degrees has many
    share = float((np.abs(values) > limit).any(axis=tuple(range(1, values.ndim))).mean())
    if share > 0.02 and share * len(values) > 2:
        raise RockerbogieError(
            f"{name} in {file} reaches {np.nanmax(np.abs(values)):.4g} rad ({100 * share:.0f} % of its rows are beyond "
            f"{limit:.3g} rad): if it is in degrees, write its unit, as in {name} [deg]"
        )


def seconds_of(time: Any, unit: str, file: str) -> Array:
    """Return times in seconds.

    Args:
        time: (n,) numbers, datetime64 (seconds since 1970) or timedelta64.
        unit: unit of the numbers; "" for seconds.
        file: the log's name, for the message.

    Returns:
        (n,) s; NaN for missing times.

    Raises:
        RockerbogieError: a unit that is not one of time.
    """
    values = np.asarray(time)
    if values.dtype.kind in "mM":
        whole = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
        return np.where(np.isnat(values), np.nan, 1e-9 * (whole % 10**9) + whole // 10**9)
    found = ("time", 1.0) if not unit else find_unit(unit.partition(" since ")[0])
    if found is None or found[0] != "time":
        raise RockerbogieError(f"time in {file} is in {unit!r}, which is not a unit of time; give s, ms, us, ns or min")
    try:
        values = values.astype(float)
    except (TypeError, ValueError):
        raise RockerbogieError(
            f"time in {file} holds {values.ravel()[0]!r}, which is neither a number nor a datetime64"
        ) from None
    return values * found[1] if found[1] != 1.0 else values
