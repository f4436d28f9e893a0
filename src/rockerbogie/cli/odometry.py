"""Command `rockerbogie odometry`: the track of a log of joint sensors."""

from __future__ import annotations

import warnings
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.table import Table

from ..errors import RockerbogieError
from ..logs.channels import LogWarning
from ..logs.joint_log import read_log
from ..logs.odometry import SlopeSlip, flat_odometry
from ..logs.odometry import odometry as integrate
from ..motion.drive import to_csv
from ..rover.formats import load_rover
from ..rover.model import Rover
from .common import (
    Folder,
    Force,
    Json,
    Linear,
    RoverName,
    guard_outputs,
    in_folder,
    make_folder,
    print_json,
    progress,
    save_netcdf,
)
from .rasters import Raster, load_terrain

if TYPE_CHECKING:
    import xarray as xr

JOINTS = ("wheel_angle", "wheel_rate", "steering", "rocker", "bogie")
Many = Parameter(negative="")
Names = Annotated[list[str] | None, Parameter(name="--name", negative="")]


def odometry(
    log: FilePath,
    /,
    *,
    rover: RoverName = "elhami-dashti",
    terrain: Annotated[str | None, Parameter(name=["--terrain", "-t"])] = None,
    start: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    soil: str | None = None,
    name: Names = None,
    topic: Annotated[list[str] | None, Many] = None,
    imu: str | None = None,
    imu_mounting: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    imu_frame: Literal["enu", "ned"] = "enu",
    flip: Annotated[list[str] | None, Many] = None,
    counts_per_turn: float | None = None,
    straight: Annotated[bool, Many] = False,
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute 3-D odometry from a log of wheels, steering, rocker and bogies.

    Prints what was read, what was repaired and which sensors are doubtful. Then prints length, end and residual slip of the
    track and of flat 2-D odometry of the same log, and the error of both if the log has positions. With -o it writes
    odometry.png, odometry.nc, odometry.csv and odometry.mcap (with the ros extra only). The last three can be read as logs.

    Parameters
    ----------
    log
        A .csv, .nc, .mcap, .db3 or .bag file, or the folder of a ROS bag: docs/odometry.md lists names of columns and joints.
    rover
        A preset's name, or a rover file.
    terrain
        The map, if there is one: a raster file, or surface:NAME.
    start
        Start of the track: "x,y" or "x,y,z" in metres. Default: the first position in the log, or 0,0,0.
    soil
        Slip on slopes: "ALONG,ACROSS" per unit of the sine of the slope, as in 0.5,0.4.
    name
        A name in the log, and ours: --name fl_wheel=wheel_angle_LF. A minus changes the sign: --name corner_fl=-steering_LF.
        May be repeated.
    topic
        A topic of joint states to read; may be repeated. Default: those with the rover's joints, without commands.
    imu
        The topic of the IMU, or none. Default: the one that agrees best with the wheels.
    imu_mounting
        Roll, pitch, yaw of the IMU in the body: "180,0,0", degrees.
    imu_frame
        Axes of the IMU's attitude. enu: x forward, y left, z up. ned: x forward, y right, z down over north, east, down.
    flip
        A column whose sign is changed: wheel_RF, wheel, steering, yaw, bogie_left, gyro_z; may be repeated.
    counts_per_turn
        Encoder counts per turn of a wheel, for logs in counts.
    straight
        Accept a log without steering: the wheels were held straight.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    output
        Folder for pictures and data.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the summary as JSON (SI units, radians) instead of the table.
    """
    written = in_folder(output, *(f"odometry.{kind}" for kind in ("png", "nc", "csv", "mcap")))
    guard_outputs(written, log, rover, terrain, force=force)
    machine = load_rover(rover)
    mounting = None
    if imu_mounting is not None:
        roll, pitch, yaw = np.radians(_numbers(imu_mounting, "--imu-mounting", (3,))).tolist()
        mounting = (roll, pitch, yaw)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # printed below
        readings = read_log(
            log, machine, names=_names(name or []), topics=topic, imu=imu, flip=flip or (), counts_per_turn=counts_per_turn,
            straight=straight, imu_mounting=mounting, imu_frame=imu_frame,
        )  # fmt: skip
        ground = None if terrain is None else load_terrain(terrain, linear, raster)
        begin = _numbers(start, "--start", (2, 3)) if start is not None else [_first(readings, axis) for axis in "xyz"]
        position = (begin[0], begin[1], begin[2] if len(begin) == 3 else 0.0)
        slip = None if soil is None else SlopeSlip(*_numbers(soil, "--soil", (2,)))
        with progress() as bar:
            task = bar.add_task("integrating", total=None)
            track = integrate(machine, ground, readings, start=position, soil=slip)
            flat = flat_odometry(machine, readings, start=position)
            bar.update(task, description="drawing")
            files = _write(machine, track, flat, readings, output)
    summary = _summary(track, flat, readings)
    if json:
        print_json(summary | {"files": files})
        return
    _print_read(readings)
    _print_summary(machine.name, log.name, summary)
    for text in summary["warnings"]:
        Console(stderr=True).print(f"warning: {text}", highlight=False, markup=False, soft_wrap=True)
    for file in files:
        print(file)


def _lines(data: xr.Dataset, name: str) -> list[str]:
    """Return the lines of a text attribute of a log."""
    return [line for line in str(data.attrs.get(name, "")).split("\n") if line]


def _print_read(log: xr.Dataset) -> None:
    """Print sources, units and rates of a log, and its repairs."""
    console = Console(highlight=False, markup=False, soft_wrap=True)
    for text in _lines(log, "read"):
        console.print(f"read {text}" if not text.startswith("not used") else text)
    for text in _lines(log, "notes"):
        console.print(f"note: {text}")


def _names(pairs: list[str]) -> dict[str, str]:
    """Return the pairs of --name: name in the log → our name."""
    found = {}
    for pair in pairs:
        theirs, equals, ours = pair.partition("=")
        if not (theirs and equals and ours):
            raise RockerbogieError(f"--name {pair!r} is not a pair: give THEIRS=OURS, as in fl_wheel=wheel_angle_LF")
        found[theirs] = ours
    return found


def _numbers(text: str, option: str, counts: tuple[int, ...]) -> list[float]:
    """Return the comma-separated numbers of an option; raise if their count is not in `counts`."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts or not np.isfinite(values).all():
        raise RockerbogieError(f"{option} {text!r}: give {' or '.join(map(str, counts))} finite numbers, separated by commas")
    return values


def _first(log: xr.Dataset, axis: str) -> float:
    """Return the first value of an axis of a log; 0 if it has none."""
    value = float(log[axis][0]) if axis in log else 0.0
    return value if np.isfinite(value) else 0.0


def _error(track: xr.Dataset, log: xr.Dataset) -> float | None:
    """Return the distance from the log's last position, m; None if the log has no positions."""
    if not all(axis in log for axis in "xyz"):
        return None
    return float(np.sqrt(sum(float(track[axis][-1] - log[axis][-1]) ** 2 for axis in "xyz")))


def _summary(track: xr.Dataset, flat: xr.Dataset, log: xr.Dataset) -> dict[str, Any]:
    """Return the numbers that are printed, or written with --json."""
    rows = {}
    for label, way in (("3-D", track), ("flat 2-D", flat)):
        rows[label] = {
            "length": float(way["distance"][-1]),
            "end": [float(way[axis][-1]) for axis in "xyz"],
            "heading": float(way["yaw"][-1]),
            "roll_slip_rms": float(np.sqrt(np.nanmean(way["roll_slip"] ** 2))),
            "side_slip_rms": float(np.sqrt(np.nanmean(way["side_slip"] ** 2))),
            "end_error": _error(way, log),
        }
    sigma = np.sqrt(np.diag(track["pose_covariance"][-1].values))
    rows["3-D"]["end_sigma"] = [float(v) for v in sigma[:3]]
    remarks = {name: _lines(log, name) for name in ("read", "notes")}
    found = list(dict.fromkeys([*_lines(log, "warnings"), *_lines(track, "warnings")]))
    span = {"duration": float(log["time"][-1] - log["time"][0]), "rows": int(log.sizes["time"])}
    return span | remarks | {"warnings": found, "odometry": rows}


def _write(rover: Rover, track: xr.Dataset, flat: xr.Dataset, log: xr.Dataset, output: FilePath | None) -> list[FilePath]:
    """Write figure, tracks and bag into a folder, and return the files; none without a folder."""
    if output is None:
        return []
    from ..figures.odometry import odometry_figure
    from ..figures.style import save
    from ..logs.mcap import write_mcap

    folder = make_folder(output)
    save(odometry_figure(track, flat, log), folder / "odometry.png")
    run = track.assign({name: log[name].variable for name in JOINTS if name in log})
    run = run.assign_coords({name: log[name].variable for name in ("side", "axis") if name in log.coords})
    save_netcdf(run, folder / "odometry.nc")
    to_csv(run.drop_vars(["twist_covariance", "pose_covariance"]), folder / "odometry.csv")
    files = [folder / f"odometry.{kind}" for kind in ("png", "nc", "csv")]
    try:
        write_mcap(rover, run, folder / "odometry.mcap", force=True)
    except RockerbogieError as error:  # without the ros extra: all files but the bag
        Console(stderr=True).print(str(error), highlight=False, markup=False)
        return files
    return [*files, folder / "odometry.mcap"]


def _print_summary(rover: str, log: str, summary: dict[str, Any]) -> None:
    """Print the numbers as a table, with notes and warnings."""
    console = Console(highlight=False)
    console.print(f"[bold]{log}[/] as rover [bold]{rover}[/]: {summary['rows']} rows, {summary['duration']:.1f} s")
    table = Table(box=box.SIMPLE, padding=(0, 1))
    known = summary["odometry"]["3-D"]["end_error"] is not None
    for head in ("", "length", "end x", "y", "z", "heading", *(("end error",) if known else ())):
        table.add_column(head, justify="left" if head == "" else "right", no_wrap=True)
    for label, row in summary["odometry"].items():
        cells = [f"{row['length']:.2f} m", *(f"{v:.2f} m" for v in row["end"]), f"{np.degrees(row['heading']):.1f}°"]
        if known:
            cells.append(f"{row['end_error']:.3f} m, {100 * row['end_error'] / row['length']:.2f} %")
        table.add_row(label, *cells)
    console.print(table)
    left = summary["odometry"]["3-D"]
    x, y, z = left["end_sigma"]
    console.print(f"expected error of the 3-D end: {x:.2f} m in x, {y:.2f} m in y, {z:.2f} m in z (standard deviations)")
    console.print(
        f"the wheels disagree by {1e3 * left['roll_slip_rms']:.1f} mm/s along and {1e3 * left['side_slip_rms']:.1f} mm/s "
        "across their path (RMS); slip common to all wheels does not show"
    )
