"""Logs of joint sensors: CSV, NetCDF or an MCAP of ROS 2 messages, to the Dataset that `odometry` reads."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..rover.model import Rover
from ..tables import read_columns

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

SIDES, AXES = ("left", "right"), ("x", "y", "z")
#: Variable of a log: (dims behind time, units).
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
TURNS = ("roll", "pitch", "yaw")
IMU_COLUMNS = {*TURNS, *(f"gyro_{axis}" for axis in AXES)}


def read_log(file: str | Path, rover: Rover, *, names: Mapping[str, str] | None = None) -> xr.Dataset:
    """A log for `odometry`, by the file's ending: .csv, .nc, .mcap, or the folder of a ROS 2 bag.

    CSV: a line of heads `name [unit]`, as `drive` writes them: `time [s]`, `wheel_angle_LF [rad]` or
    `wheel_rate_LF [rad/s]`, `steering_LF`, `rocker`, `bogie_left`, `roll`, `pitch`, `yaw`, `gyro_x`, … for this rover's
    wheel names; degrees and rpm are turned to SI. NetCDF: the variables of a run. MCAP: JointState with the joints of
    `to_urdf` (`wheel_LF_joint`, `steer_LF_joint`, `rocker_left_joint`, `bogie_left_joint`), and Imu in ROS's axes, carried
    over to the joint states' times.

    Args:
        names: what the log calls a column or joint -> what it is called here, e.g. {"fl_wheel": "wheel_angle_LF"}.

    Raises:
        RockerbogieError: no such file, not a log of this rover; the message says what is missing.
    """
    path = Path(file)
    if not path.exists():
        raise RockerbogieError(f"no log at {str(file)!r}")
    kind = path.suffix.lower()
    if kind == ".csv":
        log = _assemble(read_columns(path), rover, path.name, names or {})
    elif kind == ".nc":
        log = _read_netcdf(path, rover)
    elif kind == ".mcap" or path.is_dir():
        log = _assemble(_read_bag(path), rover, path.name, names or {})
    else:
        raise RockerbogieError(
            f"{path.name} is no log this can read: give a .csv, .nc or .mcap file, or the folder of a ROS 2 bag"
        )
    if not {"wheel_angle", "wheel_rate"} & set(log.data_vars):
        wheels = ", ".join(rover.wheel_names)
        raise RockerbogieError(
            f"{path.name} holds no wheel_angle or wheel_rate for all six wheels of {rover.name!r} ({wheels}): "
            "rename its columns or tell their names"
        )
    return log


def _read_bag(path: Path) -> dict[str, Array]:
    from .mcap import read_bag

    topics = read_bag(path)
    states = [t for t in topics.values() if t.keys() - IMU_COLUMNS - {"time"}]
    if not states:
        raise RockerbogieError(f"{path.name} holds no sensor_msgs/JointState")
    joints = max(states, key=lambda t: len(t["time"]))
    columns = {"time": joints["time"]}
    for name, values in joints.items():
        joint, _, rate = name.partition(".")
        role, _, rest = joint.removesuffix("_joint").partition("_")
        if joint == "time":
            continue
        if role == "wheel":
            columns[f"wheel_{'rate' if rate else 'angle'}_{rest}"] = values if rate else np.unwrap(values)
        elif rate:
            columns[name] = values
        elif role == "steer":
            columns[f"steering_{rest}"] = values
        else:
            columns["rocker" if joint.startswith("rocker_left") else joint.removesuffix("_joint")] = values
    both = np.ones(len(joints["time"]), dtype=bool)  # rows that the IMU covers too
    for topic in topics.values():
        if topic.keys() - {"time"} <= IMU_COLUMNS:
            both &= (joints["time"] >= topic["time"][0]) & (joints["time"] <= topic["time"][-1])
            for name in topic.keys() & IMU_COLUMNS:
                values = np.unwrap(topic[name]) if name in TURNS else topic[name]
                columns[name] = np.interp(joints["time"], topic["time"], values)
    return {name: values[both] for name, values in columns.items()}


def _read_netcdf(path: Path, rover: Rover) -> xr.Dataset:
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="h5netcdf") as file:
            log = file.load()
    except (OSError, ValueError) as error:
        raise RockerbogieError(f"{path.name} cannot be read as NetCDF: {' '.join(str(error).split())}") from None
    if "wheel" in log.coords and sorted(map(str, log["wheel"].values)) != sorted(rover.wheel_names):
        theirs = ", ".join(map(str, log["wheel"].values))
        raise RockerbogieError(f"{path.name} is of wheels {theirs}; rover {rover.name!r} has {', '.join(rover.wheel_names)}")
    if "wheel" in log.coords:
        log = log.sel(wheel=list(rover.wheel_names))
    if "time" not in log.coords:
        raise RockerbogieError(f"{path.name} has no coordinate 'time'")
    return log.reset_coords(drop=True).drop_vars([name for name in log.data_vars if name not in LOG_VARIABLES])


def _assemble(columns: dict[str, Array], rover: Rover, file: str, names: Mapping[str, str]) -> xr.Dataset:
    """Columns by name to variables by wheel, side and axis. A variable of which a column is missing is left out."""
    import xarray as xr

    strangers = sorted(set(names) - set(columns))
    if strangers:
        raise RockerbogieError(f"{file} has no column {strangers[0]!r}; it has {', '.join(sorted(columns))}")
    columns = {names.get(name, name): values for name, values in columns.items()}
    if "time" not in columns:
        raise RockerbogieError(f"{file} has no column 'time'; it has {', '.join(sorted(columns))}")
    labels = {"wheel": rover.wheel_names, "side": SIDES, "axis": AXES}
    data = {}
    for name, (dims, units) in LOG_VARIABLES.items():
        heads = [name] if not dims else [f"{name}_{label}" for label in labels[dims[0]]]
        if name == "steering":  # wheels that do not steer need no column
            for head, steers in zip(heads, rover.steers, strict=True):
                if not steers:
                    columns.setdefault(head, np.zeros_like(columns["time"]))
        if all(head in columns for head in heads):
            stacked = np.stack([columns[head] for head in heads], axis=-1)
            data[name] = (("time", *dims), stacked if dims else stacked[:, 0], {"units": units})
    return xr.Dataset(data, {"time": ("time", columns["time"], {"units": "s"}), **{k: list(v) for k, v in labels.items()}})
