"""`rockerbogie odometry`: where a log of joint sensors says the rover went."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.table import Table

from ..errors import RockerbogieError
from ..logs.joint_log import read_log
from ..logs.odometry import SlopeSlip, flat_odometry
from ..logs.odometry import odometry as integrate
from ..motion.drive import to_csv
from ..rover.formats import load_rover
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
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Where a log of wheels, steering, rocker and bogies says the rover went, in three dimensions.

    Prints the way's length, where it ends, and the slip left over; beside it what flat 2-D odometry makes of the same log, and
    the error of both where the log knows better. With -o it writes odometry.png, odometry.nc, odometry.csv and odometry.mcap
    (the last with the ros extra only).

    Parameters
    ----------
    log
        A .csv, .nc or .mcap file, or the folder of a ROS 2 bag: see the documentation for the names of columns and joints.
    rover
        A preset's name, or a rover file.
    terrain
        The ground, where there is a map: a raster file, or surface:NAME.
    start
        Where the log begins: "x,y" or "x,y,z" in metres. Default: the log's own first position, or 0,0,0.
    soil
        Slip to expect of a slope: "ALONG,ACROSS" per unit of its sine, as in 0.5,0.4.
    name
        What the log calls a column or joint, and what it is called here: --name fl_wheel=wheel_angle_LF; may be repeated.
    linear
        Bilinear ground between the nodes, or a smooth cubic surface. Default: cubic for files.
    output
        Folder for pictures and data.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the summary as JSON (SI units, radians) in place of the table.
    """
    written = in_folder(output, *(f"odometry.{kind}" for kind in ("png", "nc", "csv", "mcap")))
    guard_outputs(written, log, rover, terrain, force=force)
    machine = load_rover(rover)
    readings = read_log(log, machine, names=_names(name or []))
    ground = None if terrain is None else load_terrain(terrain, linear, raster)
    begin = _numbers(start, "--start", (2, 3)) if start is not None else [_first(readings, axis) for axis in "xyz"]
    place = (begin[0], begin[1], begin[2] if len(begin) == 3 else 0.0)
    slip = None if soil is None else SlopeSlip(*_numbers(soil, "--soil", (2,)))
    with progress() as bar:
        task = bar.add_task("reckoning", total=None)
        track = integrate(machine, readings, ground, start=place, soil=slip)
        flat = flat_odometry(machine, readings, start=place)
        bar.update(task, description="drawing")
        files = _write(machine, track, flat, readings, output)
    summary = _summary(track, flat, readings)
    if json:
        print_json(summary | {"files": files})
        return
    _print_summary(machine.name, log.name, summary)
    for file in files:
        print(file)


def _names(pairs: list[str]) -> dict[str, str]:
    found = {}
    for pair in pairs:
        theirs, equals, ours = pair.partition("=")
        if not (theirs and equals and ours):
            raise RockerbogieError(f"--name {pair!r} is no pair: give the log's name, =, and ours, as in fl_wheel=wheel_angle_LF")
        found[theirs] = ours
    return found


def _numbers(text: str, option: str, counts: tuple[int, ...]) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts or not np.isfinite(values).all():
        raise RockerbogieError(f"{option} {text!r}: give {' or '.join(map(str, counts))} finite numbers with commas between")
    return values


def _first(log: xr.Dataset, axis: str) -> float:
    value = float(log[axis][0]) if axis in log else 0.0
    return value if np.isfinite(value) else 0.0


def _error(track: xr.Dataset, log: xr.Dataset) -> float | None:
    """Distance from the log's own last position, where it has one, m."""
    if not all(axis in log for axis in "xyz"):
        return None
    return float(np.sqrt(sum(float(track[axis][-1] - log[axis][-1]) ** 2 for axis in "xyz")))


def _summary(track: xr.Dataset, flat: xr.Dataset, log: xr.Dataset) -> dict[str, Any]:
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
    return {"duration": float(log["time"][-1] - log["time"][0]), "rows": int(log.sizes["time"]), "odometry": rows}


def _write(rover: Any, track: xr.Dataset, flat: xr.Dataset, log: xr.Dataset, output: FilePath | None) -> list[FilePath]:
    if output is None:
        return []
    from ..figures.odometry import odometry_figure
    from ..figures.style import save
    from ..logs.mcap import write_mcap

    folder = make_folder(output)
    save(odometry_figure(track, flat, log), folder / "odometry.png")
    save_netcdf(track, folder / "odometry.nc")
    to_csv(track, folder / "odometry.csv")
    files = [folder / f"odometry.{kind}" for kind in ("png", "nc", "csv")]
    try:
        joints = {name: log[name].variable for name in JOINTS if name in log}
        write_mcap(track.assign(joints), rover, folder / "odometry.mcap", force=True)
    except RockerbogieError as error:  # without the ros extra there is no bag, and all the rest
        Console(stderr=True).print(str(error), highlight=False, markup=False)
        return files
    return [*files, folder / "odometry.mcap"]


def _print_summary(rover: str, log: str, summary: dict[str, Any]) -> None:
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
    console.print(
        f"the wheels disagree by {1e3 * left['roll_slip_rms']:.1f} mm/s along and {1e3 * left['side_slip_rms']:.1f} mm/s "
        "across their way (RMS): slip that shows; what all of them slip alike does not"
    )
