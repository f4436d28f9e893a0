"""Columns of logs in CSV, NetCDF and ROS bags, under the package's own names and in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..files.tables import Table, find_unit
from ..rover.model import Rover
from .channels import ATTITUDE, AXES, LOG_VARIABLES, LogReport, arrange_log, clock_of, column_names
from .counters import replace_wild
from .imu import CLOCK_SLACK, Imu
from .names import match_columns
from .stamps import drop_duplicates, order_stamps

if TYPE_CHECKING:
    import xarray as xr

#: A log whose rows are further apart than this, s, and whose time has no unit, is most likely in ms, us or ns.
LONGEST_STEP = 4.0


@dataclass
class Source:
    """Columns of a log by our names, each with its own times."""

    file: str
    columns: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    origin: dict[str, str] = field(default_factory=dict)
    imus: list[Imu] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)


def from_table(table: Table, rover: Rover, names: Mapping[str, str], counts: float | None, report: LogReport) -> Source:
    """Return the columns of a CSV file.

    Args:
        table: the file.
        rover: the rover that made the log.
        names: the log's name -> ours.
        counts: encoder counts per turn, or `None`.
        report: gets a note for each repair.

    Returns:
        The columns, sorted by time.

    Raises:
        RockerbogieError: no time, names that do not match, a unit that does not fit, a cell that is not a number.
    """
    for note in table.notes:
        report.note(f"{table.file}: {note}")
    listed = list(table)
    clock = next((theirs for theirs, ours in names.items() if ours == "time"), None)
    if clock is not None and table.find(clock) is None:
        raise RockerbogieError(f"{table.file} has no column {clock!r}; it has {', '.join(sorted(listed))}")
    if clock is None:
        clock = clock_of(listed, table.file)
    if clock is None:
        for name in names:  # a name that is not there is the likelier slip
            if table.find(name) is None:
                raise RockerbogieError(f"{table.file} has no column {name!r}; it has {', '.join(sorted(listed))}")
        raise RockerbogieError(f"{table.file} has no column 'time'; it has {', '.join(sorted(listed))}")
    matches = match_columns({"": listed}, rover, {k: v for k, v in names.items() if v != "time"}, table.file, report)
    raw = {ours: _si_column(table, match.column, ours, counts) * match.sign for ours, match in matches.items()}
    stamps = table.times(clock)
    k = table.find(clock)
    assert k is not None
    if not table.units[k]:
        _check_time_unit(stamps, table.file)
    time, order = order_stamps(stamps, None, table.file, report)
    source = Source(table.file)
    for ours, values in raw.items():
        column = values[order]
        missing = int((~np.isfinite(column)).sum())
        if missing == len(column):
            continue
        if missing:
            report.note(f"{table.file}: {matches[ours].column} has {missing} missing values; they are interpolated")
        source.columns[ours] = drop_duplicates(time, column, table.file, report)
        source.origin[ours] = f"column {matches[ours].column}"
    taken = {match.column for match in matches.values()} | {clock}
    source.unused = [name for name in listed if name not in taken]
    _imu_of_columns(source, table.file, report)
    return source


def _si_column(table: Table, column: str, ours: str, counts: float | None) -> Array:
    """Return a column in SI; counts of an encoder become angles."""
    values = table.numbers(column)
    k = table.find(column)
    assert k is not None
    found = find_unit(table.units[k]) if table.units[k] else None
    unit = LOG_VARIABLES[_variable_of(ours)][1]
    if found and found[0] in ("count", "count rate"):
        return values * _turn_of_counts(counts, f"{table.file}: column {column!r}")
    quantity = find_unit(unit)[0]  # type: ignore[index]
    if found and found[0] not in (quantity, "number"):
        raise RockerbogieError(
            f"{table.file}: column {column!r} is in {table.units[k]!r}, a unit of {found[0]}; {ours} needs one of {quantity}"
        )
    if found is None and ours.startswith("wheel_angle"):
        return _whole_counts(values, counts, f"{table.file}: column {column!r}")
    return values


def _variable_of(column: str) -> str:
    """Return the variable of one of our columns, such as `steering_LF`."""
    return next(name for name in sorted(LOG_VARIABLES, key=len, reverse=True) if column == name or column.startswith(f"{name}_"))


def _turn_of_counts(counts: float | None, where: str) -> float:
    """Return the angle of one encoder count, rad; raise if the counts of a turn are missing."""
    if counts is None:
        raise RockerbogieError(f"{where} is in counts: give the counts of one turn with --counts-per-turn (counts_per_turn=…)")
    return 2 * np.pi / counts


def _whole_counts(values: Array, counts: float | None, where: str) -> Array:
    """Return angles; whole numbers without a unit are counts."""
    finite = values[np.isfinite(values)]
    if len(finite) < 3 or np.ptp(finite) < 20 or (finite != np.round(finite)).any():
        return values
    if counts is None:
        raise RockerbogieError(
            f"{where} holds whole numbers without a unit: write the unit, as in [deg] or [count], or give --counts-per-turn"
        )
    return values * (2 * np.pi / counts)


def _check_time_unit(time: Array, file: str) -> None:
    """Raise if times without a unit are too far apart to be seconds."""
    step = np.diff(time[np.isfinite(time)])
    if len(step) and float(np.median(np.abs(step))) > LONGEST_STEP:
        raise RockerbogieError(
            f"{file}: the rows are {np.median(np.abs(step)):.6g} apart in time, which has no unit: write it in the header, as in "
            "time [ms], [us], [ns] or [s]"
        )


def open_netcdf(path: Path) -> xr.Dataset:
    """Read a NetCDF file into memory.

    Args:
        path: the file.

    Returns:
        Its variables; times as dates if the file has CF units.

    Raises:
        RockerbogieError: the file cannot be read.
    """
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="h5netcdf", decode_timedelta=False) as file:
            return file.load()
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError, NotImplementedError) as error:
        raise RockerbogieError(f"{path.name} cannot be read as NetCDF: {' '.join(str(error).split())}") from None


def from_dataset(data: xr.Dataset, rover: Rover, file: str, report: LogReport) -> Source:
    """Return the columns of a Dataset.

    Args:
        data: Dataset over time.
        rover: the rover that made the log.
        file: its name, for messages.
        report: gets a note for each repair.

    Returns:
        The columns, sorted by time.

    Raises:
        RockerbogieError: as for `arrange_log`.
    """
    log = arrange_log(rover, data, file)
    time, order = order_stamps(log["time"].values, None, file, report)
    source = Source(file)
    for column, (variable, k) in column_names(rover).items():
        if variable not in log:
            continue
        values = log[variable].values[order].reshape(len(order), -1)[:, k]
        missing = int((~np.isfinite(values)).sum())
        if missing == len(values):
            continue
        if missing:
            report.note(f"{file}: {column} has {missing} missing values; they are interpolated")
        source.columns[column] = drop_duplicates(time, values, file, report)
        source.origin[column] = f"variable {variable}"
    source.unused = [str(name) for name in data.data_vars if name not in LOG_VARIABLES]
    _imu_of_columns(source, file, report)
    return source


def _imu_of_columns(source: Source, file: str, report: LogReport) -> None:
    """Move attitude and gyro from the columns to an IMU."""
    names = [name for name in (*ATTITUDE, *(f"gyro_{axis}" for axis in AXES)) if name in source.columns]
    c = {name: (source.columns[name][0], replace_wild(*source.columns[name], name, report)) for name in names}
    attitude = gyro = None
    if all(name in c for name in ATTITUDE) and len({len(c[name][0]) for name in ATTITUDE}) == 1:
        attitude = (c["yaw"][0], np.stack([c["roll"][1], c["pitch"][1], np.unwrap(c["yaw"][1])], axis=-1))
    names = [f"gyro_{axis}" for axis in AXES]
    if all(name in c for name in names) and len({len(c[name][0]) for name in names}) == 1:
        gyro = (c["gyro_x"][0], np.stack([c[name][1] for name in names], axis=-1))
    if attitude is not None or gyro is not None:
        source.imus.append(Imu(file, frozenset(), attitude, gyro))


def from_bag(
    path: Path,
    rover: Rover,
    names: Mapping[str, str],
    topics: Sequence[str] | None,
    imu: str | None,
    counts: float | None,
    report: LogReport,
) -> Source:
    """Return the joints, IMUs and positions of a bag.

    Args:
        path: the bag.
        rover: the rover that made it.
        names: the bag's name of a joint -> ours.
        topics: topics of JointState to read, or `None`.
        imu: topic of the IMU to read, "none", or `None` for all.
        counts: encoder counts per turn, or `None`.
        report: gets a note for each repair.

    Returns:
        The columns, each with its topic's times.

    Raises:
        RockerbogieError: a bag that cannot be read, topics that are not there, joints that do not match.
    """
    from .bag import IMU, JOINT_STATE, read_topics

    found, kinds = read_topics(path, report)
    held = ", ".join(f"{name} ({kind.rpartition('/')[2]})" for name, kind in sorted(kinds.items())) or "no topics"
    for name in topics or ():
        if name not in found or found[name].kind != JOINT_STATE:
            raise RockerbogieError(f"{path.name} has no topic {name!r} of sensor_msgs/JointState; it has {held}")
    if imu not in (None, "none") and (imu not in found or found[imu].kind != IMU):
        raise RockerbogieError(f"{path.name} has no topic {imu!r} of sensor_msgs/Imu; it has {held}")
    joints = {n: t for n, t in found.items() if t.kind == JOINT_STATE and (topics is None or n in topics)}
    if not any(t.count for t in joints.values()):
        raise RockerbogieError(f"{path.name} holds no sensor_msgs/JointState with messages; it has {held}")
    signals = {name: topic.signals(report) for name, topic in joints.items()}
    matches = match_columns({n: list(s) for n, s in signals.items()}, rover, names, path.name, report)
    if not any(ours.startswith(("wheel_angle", "wheel_rate")) for ours in matches):
        listed = "; ".join(f"{n}: {', '.join(c for c in s if not c.endswith('.rate'))}" for n, s in signals.items())
        raise RockerbogieError(
            f"{path.name} holds no wheel_angle or wheel_rate for all six wheels of {rover.name!r} "
            f"({', '.join(rover.wheel_names)}). Its joints are {listed}. "
            f"Match them with --name JOINT=wheel_angle_{rover.wheel_names[0]} and so on"
        )
    source = Source(path.name)
    for ours, match in matches.items():
        time, values = signals[match.topic][match.column]
        if ours.startswith("wheel_angle") and counts is not None:
            values = _whole_counts(values, counts, f"{path.name}: joint {match.column!r}")
        source.columns[ours] = (time, match.sign * values)
        source.origin[ours] = f"topic {match.topic}, joint {match.column.removesuffix('.rate')}"
    taken = {(m.topic, m.column) for m in matches.values()}
    source.unused = [c for n, s in signals.items() for c in s if (n, c) not in taken and not c.endswith(".rate")]
    wheels = joints[next(m.topic for ours, m in matches.items() if ours.startswith("wheel"))]
    for name, topic in found.items():
        if topic.kind == JOINT_STATE or (topic.kind == IMU and imu is not None and name != imu):
            continue
        shift = topic.clock_offset - wheels.clock_offset
        apart = abs(shift) > CLOCK_SLACK
        if apart:
            report.warn(f"{name}: its clock is {shift:+.4g} s off that of {wheels.name}; its times were shifted by as much")
        columns = topic.signals(report, -shift if apart else 0.0)
        if topic.kind == IMU:
            source.imus.append(Imu.from_signals(name, topic.frames, columns, report))
        elif "x" not in source.columns or name == "/odom":
            source.columns |= {k: columns[k] for k in "xyz" if k in columns}
            source.origin |= dict.fromkeys("xyz", f"topic {name}, compared with only")
    return source
