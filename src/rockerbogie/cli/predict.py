"""Command `rockerbogie predict`: an open-loop drive along a path."""

from __future__ import annotations

import sys
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..errors import RockerbogieError
from ..motion.drive import to_csv
from ..motion.prediction.predict import predict as predict_drive
from ..rover.formats import load_rover
from ..rover.model import Rover
from ..terrain.heightfield import Terrain
from .common import (
    Folder,
    Force,
    Json,
    Linear,
    RoverName,
    TerrainName,
    guard_outputs,
    in_folder,
    make_folder,
    parse_gravity,
    parse_point,
    print_json,
    progress,
    save_netcdf,
)
from .drive import Waypoints, path_of
from .pictures import Html, checked_page, write_page
from .rasters import Raster, load_terrain

if TYPE_CHECKING:
    import xarray as xr

#: Exit code if the predicted drive ends before its commands: a result, not a wrong call.
EXIT_ENDS_EARLY = 1
STAYS = 0.01  # of the wheelbase: a rover that moves by less stays in place
FILES = ("prediction.nc", "prediction.csv", "map.png", "prediction.png")


def predict(
    *,
    terrain: TerrainName,
    rover: RoverName = "elhami-dashti",
    friction: float | None = None,
    soil: str | None = None,
    grousers: float | None = None,
    path: Waypoints = None,
    radius: float = 1.0,
    start: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    yaw: float | None = None,
    speed: float = 0.02,
    step: float | None = None,
    tolerance: float | None = None,
    gravity: str = "earth",
    torque: float | None = None,
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    html: Html = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Predict where a rover goes when it is driven open loop along a path.

    Slip, wheel forces, torques and energies follow from the balance of the whole mechanism.

    With -o it also writes map.png (the predicted track on the terrain), prediction.png (commanded and predicted track, slip,
    torque and energy), prediction.nc and prediction.csv. Exits 1 if the drive ends before its commands.

    Parameters
    ----------
    terrain
        A raster file (GeoTIFF and others), or surface:NAME for a built-in one: surface:paper, surface:mars, surface:rocks …
    rover
        Name of a preset, or a rover file.
    friction
        Coefficient of friction between wheels and rigid terrain. Give this or --soil.
    soil
        Name of a soil preset, such as dry-sand (`rockerbogie soils` lists them), or a soil file.
    grousers
        Height of the wheels' grousers in soil, m. Only with --soil.
    path
        Waypoints in the map's metres: "x,y x,y …"; or a .csv or .gpkg file, as `rockerbogie plan` writes.
        Default: straight along +x through the middle of the map, from edge to edge.
    radius
        Turning radius at the waypoints, m.
    start
        Position at the start, x,y in the map's metres. Default: the start of the path.
    yaw
        Yaw at the start, degrees, counter-clockwise from +x. Default: that of the path.
    speed
        Commanded horizontal speed along the path, m/s.
    step
        Length of an integration step, m. Default: a quarter of the wheel radius.
    tolerance
        Halve steps while the error of their energy balance exceeds this share, such as 1e-6; the drive ends where that does
        not help. Default: steps that have no solution, and on soil those whose error exceeds 0.01.
    gravity
        earth, mars, moon, or a number in m/s².
    torque
        Torque limit of each hub motor, N·m. Default: torque_n_m of the rover file; without it, no limit.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    output
        Folder for pictures and data.
    html
        Page (.html) that replays the drive offline in any browser, with plots.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the result as JSON (SI units, radians) instead of the table.
    """
    guard_outputs([*in_folder(output, *FILES), *checked_page(html)], terrain, rover, path, force=force)
    if (soil is None) == (friction is None):
        raise RockerbogieError("give either --friction, a coefficient on rigid terrain, or --soil (rockerbogie soils lists them)")
    if soil is None and grousers is not None:
        raise RockerbogieError("--grousers acts in soil only: give --soil with it, or leave it out")
    field = parse_gravity(gravity)
    machine = load_rover(rover)
    surface = load_terrain(terrain, linear, raster)
    way = path_of(path, radius, machine, surface)
    x, y = (way.x[0], way.y[0]) if start is None else parse_point(start, "--start")
    at = (x, y, way.yaw[0] if yaw is None else np.radians(yaw))
    with progress() as bar:
        task = bar.add_task("predicting", total=None)
        run = predict_drive(
            machine, surface, at, way, friction=friction, soil=soil, grousers=grousers, speed=speed, step=step,
            tolerance=tolerance, gravity=field, torque=torque,
        )  # fmt: skip
        if run.sizes["time"] == 0:
            return _no_start(f"the drive does not start at ({x:.10g}, {y:.10g}) m: {run.attrs['ends_because']}", run.attrs["end"])
        bar.update(task, description="drawing")
        files = [*_write(machine, surface, run, output), *write_page(run, html, force)]
    result = _summary(run, machine)
    if json:
        print_json(result | {"files": files})
    else:
        _print_summary(result)
        print(*files, sep="\n", end="\n" if files else "")
    return 0 if run.attrs["reached_end"] else EXIT_ENDS_EARLY


def _no_start(sentence: str, end: str) -> int:
    """Return the exit code of a drive that does not start; raise if it starts off the map."""
    if end in ("OFF_MAP", "NO_DATA", "NO_POSE"):
        raise RockerbogieError(f"{sentence}; give another --start")
    print(f"rockerbogie: {sentence}", file=sys.stderr)
    return EXIT_ENDS_EARLY


def _write(rover: Rover, terrain: Terrain, run: xr.Dataset, output: FilePath | None) -> list[FilePath]:
    """Write pictures and data of a drive into the folder `output`; return the files."""
    if output is None:
        return []
    from ..figures.charts import run_map
    from ..figures.prediction import prediction_chart
    from ..figures.style import save

    folder = make_folder(output)
    files = in_folder(folder, *FILES)
    save_netcdf(run, files[0])
    to_csv(run, files[1])
    if run.sizes["time"] < 2:
        return files[:2]
    save(run_map(rover, terrain, run), files[2])
    save(prediction_chart(run), files[3])
    return files


def _summary(run: xr.Dataset, rover: Rover) -> dict[str, Any]:
    """Return the JSON record of a drive."""
    last = run.isel(time=-1)
    result: dict[str, Any] = {
        name: run.attrs[name] for name in ("rover", "terrain", "path", "law", "gravity", "step", "end", "ends_because")
    }
    result |= {"reached_end": bool(run.attrs["reached_end"]), "stations": int(run.sizes["time"])}
    result |= {"duration": float(last["time"]), "distance": float(last["distance"])}
    result |= {name: float(last[name]) for name in ("x", "y", "yaw", "motor_work", "dissipation", "height_gain")}
    result |= {name: float(last[name]) for name in ("x_command", "y_command", "yaw_command")}
    slip = run["slip_ratio"].to_numpy()
    torque = np.abs(run["wheel_torque"].to_numpy())
    result |= {
        "off_path": float(np.hypot(last["x"] - last["x_command"], last["y"] - last["y_command"])),
        "mean_slip": float(np.nanmean(slip)),
        "largest_slip": float(np.nanmax(np.abs(slip))),
        "largest_slip_angle": float(np.nanmax(np.abs(run["slip_angle"].to_numpy()))),
        "largest_torque": float(np.nanmax(torque)),
        "wheels": list(map(str, run["wheel"].to_numpy())),
        "mean_slip_by_wheel": np.nanmean(slip, axis=0),
        "largest_torque_by_wheel": np.nanmax(torque, axis=0),
        "mean_load_by_wheel": np.nanmean(run["normal_force"].to_numpy(), axis=0),
        "lifted_by_wheel": run["wheel_lifted"].to_numpy().mean(axis=0),
    }
    result["stays_from"] = _stays_from(run, rover)
    if "law_exceeded" in run:
        result["law_exceeded_by_wheel"] = run["law_exceeded"].to_numpy().mean(axis=0)
    return result


def _stays_from(run: xr.Dataset, rover: Rover) -> float | None:
    """Return the time from which a rover stays in place, s; None if it moves on.

    It is then within 1 % of the wheelbase of its end, and its wheels roll by half the wheelbase or more.
    """
    time, x, y = (run[name].to_numpy() for name in ("time", "x", "y"))
    away = np.hypot(x - x[-1], y - y[-1]) > STAYS * rover.wheelbase
    first = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
    rolled = np.abs(run["wheel_rate"].to_numpy() * rover.wheel_radius).mean(axis=-1)[first:-1] @ np.diff(time[first:])
    return float(time[first]) if rolled > 0.5 * rover.wheelbase else None


def _print_summary(result: dict[str, Any]) -> None:
    """Print a drive's result as sentences and a table."""
    console = Console(highlight=False)
    console.print(
        f"[bold]{escape(result['rover'])}[/] on [bold]{escape(result['terrain'])}[/], {result['law']}: {result['path']}"
    )
    console.print(
        f"{result['distance']:.2f} m in {result['duration']:.0f} s; {result['ends_because']}. End at "
        f"({result['x']:.3f}, {result['y']:.3f}) m, yaw {np.degrees(result['yaw']):.2f}°, "
        f"{result['off_path']:.3f} m from the command"
    )
    if result["stays_from"] is not None:
        console.print(f"From {result['stays_from']:.0f} s on, it stays there: its wheels turn, but do not move it.")
    console.print(
        f"motor work {result['motor_work']:.1f} J = gain of height {result['height_gain']:.1f} J + dissipation "
        f"{result['dissipation']:.1f} J"
    )
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for heading in ("wheel", "mean slip", "largest torque", "mean load", "off the ground"):
        table.add_column(heading, justify="left" if heading == "wheel" else "right")
    for i, name in enumerate(result["wheels"]):
        table.add_row(
            name, f"{100 * result['mean_slip_by_wheel'][i]:.2f} %", f"{result['largest_torque_by_wheel'][i]:.2f} N m",
            f"{result['mean_load_by_wheel'][i]:.1f} N", f"{100 * result['lifted_by_wheel'][i]:.1f} %",
        )  # fmt: skip
    console.print(table)
    share = float(np.max(result.get("law_exceeded_by_wheel", 0.0)))
    if share > 0.0:
        console.print(
            f"Caution: on up to {100 * share:.1f} % of the stations a wheel is outside the soil law's range: its axle moves "
            "against its turning, or its load is above half of the weight. Its forces are extrapolated there."
        )
