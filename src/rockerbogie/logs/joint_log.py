"""Logs of joint sensors: CSV, NetCDF or ROS bags, read to the Dataset that `odometry` takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..files.tables import read_columns
from ..rover.model import Rover
from .channels import ATTITUDE, AXES, LOG_VARIABLES, LogReport, check_angles, column_names, labels_of
from .counters import continuous_angle, replace_wild
from .imu import fit_imu
from .names import flipped
from .sensor_checks import WheelCheck, check_wheels
from .sources import Source, from_bag, from_dataset, from_table, open_netcdf
from .stamps import gaps_of

if TYPE_CHECKING:
    import xarray as xr

#: Rates and positions of wheels agree if their ratio is within this range.
SAME_RATE = (0.9, 1.1)
#: Rocker and bogies are doubtful if they stand further from rest than this for half of a log, rad.
USUAL_ANGLE = np.radians(20)


def read_log(
    file: str | Path,
    rover: Rover,
    *,
    names: Mapping[str, str] | None = None,
    topics: Sequence[str] | None = None,
    imu: str | None = None,
    imu_mounting: tuple[float, float, float] | None = None,
    imu_frame: str = "enu",
    flip: Sequence[str] = (),
    counts_per_turn: float | None = None,
    straight: bool = False,
) -> xr.Dataset:
    """Read a log for `odometry`: .csv, .nc, .mcap, .db3, .bag, or the folder of a ROS bag.

    CSV: a header line `name [unit]`, as `drive` writes it: `time [s]`, `wheel_angle_LF [rad]` or `wheel_rate_LF [rad/s]`,
    `steering_LF`, `rocker`, `bogie_left`, `roll`, `pitch`, `yaw`, `gyro_x`, … for this rover's wheel names. NetCDF: the
    variables of a run. Bags: JointState with the joints of `to_urdf` (`wheel_LF_joint`, `steer_LF_joint`,
    `rocker_left_joint`, `bogie_left_joint`), which may be spread over several topics, Imu, and Odometry (position only).

    Rows are sorted by time; duplicate stamps, missing values, wrapped angles, counters that roll over and single wild
    values are repaired. Sensors are compared with each other: an attitude that contradicts the wheels is not used.
    `attrs["read"]`, `["notes"]` and `["warnings"]` of the Dataset list sources, repairs and doubts, one per line; the
    warnings are also issued as `LogWarning`.

    Args:
        file: the log.
        rover: the rover that made it.
        names: the log's name of a column or joint -> ours, e.g. {"fl_wheel": "wheel_angle_LF"}; a minus before ours turns
            the sign, as in {"corner_lf": "-steering_LF"}.
        topics: topics of JointState to read. Default: those that hold the rover's joints, without commands.
        imu: topic of the IMU, or "none". Default: the one that agrees best with the wheels.
        imu_mounting: roll, pitch, yaw of the IMU in the body, rad.
        imu_frame: "enu", or "ned" for an attitude with axes x forward, y right, z down over north, east, down.
        flip: columns whose sign is turned: `wheel_RF`, `steering`, `yaw`, …
        counts_per_turn: encoder counts per turn of a wheel, for columns in counts; also the encoders' resolution.
        straight: accept a log without steering, as of wheels that were held straight.

    Returns:
        Dataset over `time` of those `LOG_VARIABLES` that the log has, SI; each variable with its `source` and `rate` (Hz).

    Raises:
        RockerbogieError: no such file, not a log of this rover, no steering; the message says what is missing.
    """
    path, report = Path(file), LogReport()
    if not path.exists():
        raise RockerbogieError(f"no log at {str(file)!r}")
    if counts_per_turn is not None and not (np.isfinite(counts_per_turn) and counts_per_turn > 0):
        raise RockerbogieError(f"counts_per_turn is {counts_per_turn}; give the encoder counts of one turn of a wheel")
    kind = path.suffix.lower()
    if kind == ".csv":
        source = from_table(read_columns(path, cut_off=True), rover, names or {}, counts_per_turn, report)
    elif kind == ".nc":
        source = from_dataset(open_netcdf(path), rover, path.name, report)
    elif kind in (".mcap", ".db3", ".bag") or path.is_dir():
        source = from_bag(path, rover, names or {}, topics, imu, counts_per_turn, report)
    else:
        raise RockerbogieError(
            f"{path.name} is no log this can read: give a .csv, .nc or .mcap file (or .db3, .bag), or the folder of a ROS 2 bag"
        )
    for column in flipped(rover, flip):
        if column in source.columns:
            time, values = source.columns[column]
            source.columns[column] = (time, -values)
    log = _assemble(source, rover, imu, imu_frame, imu_mounting, flip, straight, report)
    if counts_per_turn is not None:
        log.attrs["counts_per_turn"] = float(counts_per_turn)
    log.attrs |= report.attrs()
    report.emit()
    return log


def _assemble(
    source: Source,
    rover: Rover,
    imu: str | None,
    frame: str,
    mounting: tuple[float, float, float] | None,
    flip: Sequence[str],
    straight: bool,
    report: LogReport,
) -> xr.Dataset:
    """Return the Dataset of a log: columns at the wheels' times, repaired and compared.

    Remarks are added to `report`; `source.origin` gets the topics of the IMU.
    """
    import xarray as xr

    columns = source.columns
    kinds = [k for k in ("wheel_angle", "wheel_rate") if all(f"{k}_{w}" in columns for w in rover.wheel_names)]
    if not kinds:
        missing = [f"wheel_angle_{w}" for w in rover.wheel_names if not {f"wheel_angle_{w}", f"wheel_rate_{w}"} & set(columns)]
        found = f" {', '.join(missing)} are missing." if 0 < len(missing) < 6 else ""
        unused = f" Not used are {', '.join(source.unused)}." if source.unused else ""
        raise RockerbogieError(
            f"{source.file} holds no wheel_angle or wheel_rate for all six wheels of {rover.name!r} "
            f"({', '.join(rover.wheel_names)}).{found}{unused} Rename its columns, or match them with --name (names={{…}})"
        )
    time = max((columns[f"{k}_{w}"][0] for k in kinds for w in rover.wheel_names), key=len)
    for k in kinds:
        for w in rover.wheel_names:
            own = columns[f"{k}_{w}"][0]
            time = time[(time >= own[0]) & (time <= own[-1])]
    if len(time) < 2:
        raise RockerbogieError(f"{source.file} has fewer than two rows with all six wheels: there is nothing to integrate")
    data = _wheels(columns, kinds, rover, time, report)
    for name in ("steering", "rocker", "bogie", "x", "y", "z"):
        values = _stacked(name, source, rover, time, straight, report)
        if values is not None:
            check_angles(name, values, source.file)
            data[name] = values
    check = _check(rover, time, data, report)
    if imu != "none":
        _add_imu(source, data, time, check, (frame, mounting, flip), report)
    for k in gaps_of(time):
        text = f"{source.file}: no rows from {time[k] - time[0]:.1f} to {time[k + 1] - time[0]:.1f} s"
        if "wheel_angle" in data:
            report.note(f"{text}; the counters give the distance there, as one arc")
        else:
            share = float(np.abs(data["wheel_rate"][[k, k + 1]] * rover.wheel_radius).mean() * (time[k + 1] - time[k]))
            report.warn(f"{text}: wheel rates are interpolated there, over {share:.2g} m of the path")
    variables = {}
    labels = labels_of(rover)
    for name, (dims, unit) in LOG_VARIABLES.items():
        if name not in data:
            continue
        origin = list(dict.fromkeys(source.origin.get(c, "") for c, (v, _) in column_names(rover).items() if v == name))
        text = _origin_text([o for o in origin if o]) or source.file
        rate = _rate_of(source, name, rover)
        variables[name] = (("time", *dims), data[name], {"units": unit, "source": text} | ({"rate": rate} if rate else {}))
        report.read.append(f"{name} [{unit}]: {text}" + (f", {rate:.4g} Hz" if rate else ""))
    if source.unused:
        report.read.append(f"not used: {', '.join(source.unused)}")
    coords = {"time": ("time", time, {"units": "s"}), **{k: list(v) for k, v in labels.items()}}
    return xr.Dataset(variables, coords)


def _wheels(
    columns: dict[str, tuple[Array, Array]], kinds: list[str], rover: Rover, time: Array, report: LogReport
) -> dict[str, Array]:
    """Return wheel angles and rates (n, 6): continuous, and in agreement with each other."""
    angle = rate = None
    if "wheel_rate" in kinds:
        rate = np.stack([resample_all(*columns[f"wheel_rate_{w}"], time) for w in rover.wheel_names], axis=-1)
    if "wheel_angle" in kinds:
        parts: list[Array | None] = []
        for w in rover.wheel_names:
            own, values = columns[f"wheel_angle_{w}"]
            speed = resample_all(*columns[f"wheel_rate_{w}"], own) if rate is not None else None
            whole = continuous_angle(own, values, speed, f"wheel {w}", report)
            parts.append(None if whole is None else resample_all(own, whole, time))
        broken = [w for w, part in zip(rover.wheel_names, parts, strict=True) if part is None]
        if not broken:
            angle = np.stack([p for p in parts if p is not None], axis=-1)
        elif rate is None:
            raise RockerbogieError(
                f"the angle of wheel {broken[0]} jumps back and forth too often to be one counter: "
                "are two publishers on one topic?"
            )
        else:
            report.warn(f"wheel angles of {', '.join(broken)} jump back and forth; the wheel rates are used")
    if angle is not None and rate is not None:
        angle, rate = _agreed(angle, rate, time, report)
    return {name: values for name, values in (("wheel_angle", angle), ("wheel_rate", rate)) if values is not None}


def _agreed(angle: Array, rate: Array, time: Array, report: LogReport) -> tuple[Array | None, Array | None]:
    """Compare positions with rates: return what to keep of both."""
    dt = np.diff(time)[:, None]
    step, expected = np.diff(angle, axis=0), 0.5 * (rate[1:] + rate[:-1]) * dt
    step, expected = (np.delete(values, gaps_of(time), axis=0) for values in (step, expected))
    moved, by_rate = np.abs(step).sum(axis=0), np.abs(expected).sum(axis=0)
    if by_rate.max() > 1 and (moved < 0.05 * by_rate).any():
        stuck = "all wheels" if (moved < 0.05 * by_rate).all() else "some wheels"
        report.warn(f"wheel positions of {stuck} stand still while their rates do not; the rates are used")
        return None, rate
    if moved.max() > 1 and (by_rate < 0.05 * moved).any():
        report.note("wheel rates stand at 0 while positions change; the positions are used")
        return angle, None
    size = float((expected**2).sum())
    gain = float((step * expected).sum() / size) if size > 0 else 1.0
    if not SAME_RATE[0] < gain < SAME_RATE[1]:
        report.warn(
            f"wheel positions change {gain:.3g} times as fast as the wheel rates: check units and signs; the positions are used"
        )
        return angle, None
    return angle, rate


def resample_all(time: Array, values: Array, at: Array) -> Array:
    """Return a signal at other times, linear between its rows and constant outside.

    Args:
        time: (n,) ascending, s.
        values: (n,).
        at: (m,) s.

    Returns:
        (m,).
    """
    return values if len(time) == len(at) and bool((time == at).all()) else np.interp(at, time, values)


def _stacked(name: str, source: Source, rover: Rover, time: Array, straight: bool, report: LogReport) -> Array | None:
    """Return a variable at the log's times; `None` if the log does not have it."""
    dims, _ = LOG_VARIABLES[name]
    labels = labels_of(rover)[dims[0]] if dims else ("",)
    heads = [f"{name}_{label}" if dims else name for label in labels]
    needed = [head for k, head in enumerate(heads) if name != "steering" or rover.steers[k]]
    missing = [head for head in needed if head not in source.columns]
    if name == "steering" and missing and not straight and needed:
        has = "no steering" if len(missing) == len(needed) else f"no {', '.join(missing)}"
        unused = f"; it also has {', '.join(source.unused)}" if source.unused else ""
        raise RockerbogieError(
            f"{source.file} has {has} of the {len(needed)} wheels that steer{unused}. Match names with "
            f"--name THEIRS={missing[0]}, or give --straight (straight=True) if the wheels were held straight"
        )
    if missing:
        if len(missing) < len(needed):
            report.warn(f"{source.file} has no {', '.join(missing)}: {name} is not used")
        return None
    parts = []
    for k, head in enumerate(heads):
        if head not in source.columns or (name == "steering" and not rover.steers[k]):
            parts.append(np.zeros(len(time)))
            continue
        own, values = source.columns[head]
        if name not in ("x", "y", "z"):
            values = replace_wild(own, values, head, report)
        parts.append(resample_all(own, values, time))
        outside = max(own[0] - time[0], time[-1] - own[-1])
        gaps = [own[j + 1] - own[j] for j in gaps_of(own)]
        if outside > 1.0 or (gaps and max(gaps) > 1.0 and len(own) < 0.9 * len(time)):
            report.warn(f"{head} is missing for {max([outside, *gaps]):.3g} s; there it is taken to hold its value")
    found = np.stack(parts, axis=-1)
    if name in ("rocker", "bogie") and (usual := float(np.nanmedian(np.abs(found)))) > USUAL_ANGLE:
        report.warn(f"{name} stands at {np.degrees(usual):.0f}° for half of the log: check its unit (degrees?) and its zero")
    return found if dims else found[:, 0]


def _check(rover: Rover, time: Array, data: dict[str, Array], report: LogReport) -> WheelCheck:
    """Return the comparison of wheels and steering, and add its warnings to the report."""
    dt = np.diff(time)[:, None]
    if "wheel_angle" in data:
        rates = np.diff(data["wheel_angle"], axis=0) / dt
    else:
        rates = 0.5 * (data["wheel_rate"][1:] + data["wheel_rate"][:-1])
    steering = data.get("steering", np.zeros((len(time), 6)))
    check = check_wheels(rover, time, rates, 0.5 * (steering[1:] + steering[:-1]))
    for text in check.warnings:
        report.warn(text)
    return check


def _add_imu(
    source: Source,
    data: dict[str, Array],
    time: Array,
    check: WheelCheck,
    axes: tuple[str, tuple[float, float, float] | None, Sequence[str]],
    report: LogReport,
) -> None:
    """Add attitude and gyro to `data`, and their topics to `source.origin`."""
    frame, mounting, flip = axes
    imus = [one.turned(frame, mounting) for one in source.imus]
    chosen, attitude, gyro = fit_imu(imus, time, check, report)
    if chosen is not None:
        for k, name in enumerate(ATTITUDE):
            if attitude is not None:
                data[name] = -attitude[:, k] if name in flip and chosen.source != source.file else attitude[:, k]
                source.origin.setdefault(name, f"topic {chosen.source}")
        if gyro is not None:
            data["gyro"] = gyro
            source.origin |= {f"gyro_{a}": source.origin.get(f"gyro_{a}", f"topic {chosen.source}") for a in AXES}
        return
    for name in ATTITUDE:  # parts of an attitude, such as an inclinometer's
        if name in source.columns:
            own, values = source.columns[name]
            values = replace_wild(own, values, name, report)
            data[name] = resample_all(own, np.unwrap(values) if name == "yaw" else values, time)


def _origin_text(origins: list[str]) -> str:
    """Return sources in one phrase: the topic or the kind once, then the names."""
    by_kind: dict[str, list[str]] = {}
    for origin in origins:
        topic, _, joint = origin.partition(", joint ")
        if joint:
            kind, name = f"{topic}, joints", joint
        elif origin.startswith("column "):
            kind, name = "columns", origin.removeprefix("column ")
        else:
            kind, name = origin, ""
        by_kind.setdefault(kind, []).append(name)
    return "; ".join(f"{kind} {', '.join(n for n in names if n)}".strip() for kind, names in by_kind.items())


def _rate_of(source: Source, name: str, rover: Rover) -> float | None:
    """Return the rate of a variable's first column, Hz."""
    for column, (variable, _) in column_names(rover).items():
        if variable == name and column in source.columns:
            time = source.columns[column][0]
            return float(1.0 / np.median(np.diff(time))) if len(time) > 1 else None
    for one in source.imus:
        part = one.attitude if name in ATTITUDE else one.gyro
        if name in (*ATTITUDE, "gyro") and part is not None and len(part[0]) > 1:
            return float(1.0 / np.median(np.diff(part[0])))
    return None
