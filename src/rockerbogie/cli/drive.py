"""Commands `rockerbogie drive` and `rockerbogie simulate`: kinematic and dynamic drives."""

from __future__ import annotations

import sys
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter
from rich.progress import Progress, TaskID

from ..errors import PathError, RockerbogieError
from ..files.vectors import is_vector
from ..logs.bag import require_rosbags
from ..motion.drive import drive as drive_rover
from ..motion.drive import to_csv
from ..motion.path import Path
from ..motion.path_files import read_route
from ..rover.formats import load_rover
from ..rover.model import Rover
from ..settling.engines import Mode
from ..settling.status import MEANING, Status
from ..simulation.compare import compare, settle_along
from ..simulation.simulate import simulate_plan
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
    map_span,
    parse_gravity,
    parse_point,
    print_json,
    progress,
    save_netcdf,
)
from .pictures import Film, Format, Html, Pictures, Theme, checked_film, checked_page, write_page
from .rasters import Raster, load_terrain
from .run_summary import MOTORS, print_summary, summarise, tracking, why_short

if TYPE_CHECKING:
    import xarray as xr

#: Exit code if a simulated rover ends further from the path's end than the share SHORT of its length: a result, not a wrong call.
EXIT_NOT_THERE, SHORT = 1, 0.05

Waypoints = Annotated[str | None, Parameter(name=["--path", "-p"], allow_leading_hyphen=True)]

#: Chart that `drive --loads` writes, without its ending.
LOADS_CHART = "loads"


def drive(
    *,
    terrain: TerrainName,
    rover: RoverName = "elhami-dashti",
    path: Waypoints = None,
    radius: float = 1.0,
    speed: float = 0.02,
    step: float = 0.01,
    mode: Mode = "contact",
    continuous_steering: Annotated[bool, Parameter(name="--continuous-steering", negative="")] = False,
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    loads: Annotated[bool, Parameter(name="--loads", negative="")] = False,
    gravity: str = "earth",
    mcap: Annotated[bool, Parameter(name="--mcap", negative="")] = False,
    film: Film = None,
    html: Html = None,
    format: Format = "png",
    theme: Theme = "light",
    force: Force = False,
    json: Json = False,
) -> None:
    """Drive a rover along a path quasi-statically.

    Prints the extremes of the run. With -o it also writes map.png (the path on the terrain, coloured by tilt), profile.png
    (angles, joints and clearance along the path), worst.png (the rover where it is closest to a limit), run.nc and run.csv.

    Parameters
    ----------
    terrain
        A raster file (GeoTIFF and others), or surface:NAME for a built-in one: surface:paper, surface:mars, surface:rocks …
    rover
        Name of a preset, or a rover file.
    path
        Waypoints in the map's metres: "x,y x,y …"; or a .csv or .gpkg file, as `rockerbogie plan` writes.
        Default: straight along +x through the middle of the map, from edge to edge.
    radius
        Turning radius at the waypoints, m.
    speed
        Horizontal speed along the path, m/s. It scales only times and rates.
    step
        Horizontal distance between stations, m.
    mode
        contact: all six wheels in contact, joint limits not enforced. equilibrium: balance under the rover's weight; wheels may
        be off the ground, joints at their limits.
    continuous_steering
        Keep each wheel within a quarter turn of its angle at the station before, without jumps of half a turn; angles may
        then exceed 90 degrees.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    output
        Folder for pictures and data.
    loads
        Also compute wheel loads, required friction, motor torques and tip margins; with -o, also write loads.png.
    gravity
        earth, mars, moon, or a number in m/s²; scales forces.
    mcap
        Also write run.mcap into the folder of -o: ROS 2 messages for Foxglove and `ros2 bag`. Needs the ros extra.
    film
        Write a film of the drive: .gif, or .mp4 (needs the film extra).
    html
        Write a page (.html) that replays the drive offline in any browser, with plots.
    format
        Format of the pictures: png; svg or pdf for print.
    theme
        Colours of pictures and film: light or dark page.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the summary as JSON (SI units, radians) instead of the table.
    """
    drawn = Pictures(format, theme)
    written = in_folder(
        output, *_files("run", drawn), *(("run.mcap",) if mcap else ()), *((drawn.name(LOADS_CHART),) if loads else ())
    )
    written += checked_film(film) + checked_page(html)
    if mcap:
        if output is None:
            raise RockerbogieError("--mcap writes run.mcap into a folder: give one with -o")
        require_rosbags()
    guard_outputs(written, terrain, rover, path, force=force)
    field = parse_gravity(gravity)
    machine = load_rover(rover)
    ground = load_terrain(terrain, linear, raster)
    way = path_of(path, radius, machine, ground)
    with progress() as bar:
        task = bar.add_task("driving", total=None)
        near = np.zeros(6) if continuous_steering else None
        run = drive_rover(machine, ground, way, speed, step=step, mode=mode, near=near, loads=loads, gravity=field)
        run = _on_map(run, ground)
        bar.update(task, description="drawing")
        files = _write_run(machine, ground, run, output, "run", drawn)
        if loads and output is not None:
            from ..figures.loads import loads_chart

            files.append(drawn.save(loads_chart(run), output, LOADS_CHART))
        if mcap and output is not None:
            from ..logs.mcap import write_mcap

            write_mcap(machine, run, output / "run.mcap", force=force)
            files.append(output / "run.mcap")
        files += _write_film(machine, ground, run, film, theme, bar, task) + write_page(run, html, force)
    summary = summarise(run)
    if json:
        print_json(summary | {"files": files})
    else:
        print_summary(machine, summary)
        for file in files:
            print(file)


def simulate(
    *,
    terrain: TerrainName,
    rover: RoverName = "elhami-dashti",
    path: Waypoints = None,
    radius: float = 1.0,
    speed: float = 0.02,
    friction: float = 0.8,
    torque: float | None = None,
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    film: Film = None,
    html: Html = None,
    format: Format = "png",
    theme: Theme = "light",
    force: Force = False,
    json: Json = False,
) -> int:
    """Simulate a drive in MuJoCo's rigid-body dynamics, and compare.

    The simulation has six driven wheels, gravity and friction on the same terrain. Prints the difference from the kinematic
    model at equal position and yaw. With -o it also writes attitude.png and joints.png (model and simulation), map.png,
    profile.png, worst.png, simulation.nc and simulation.csv. Exits 1 if the rover does not reach the end of the path.

    Parameters
    ----------
    terrain
        A raster file (GeoTIFF and others), or surface:NAME for a built-in one: surface:paper, surface:mars, surface:rocks …
    rover
        Name of a preset, or a rover file.
    path
        Waypoints in the map's metres: "x,y x,y …"; or a .csv or .gpkg file, as `rockerbogie plan` writes.
        Default: straight along +x through the middle of the map, from edge to edge.
    radius
        Turning radius at the waypoints, m.
    speed
        Speed along the path, m/s. Computing time grows with the time of the drive: use a higher speed for long paths.
    friction
        Coefficient of sliding friction between wheels and terrain.
    torque
        Torque limit of each hub motor, N·m. Default: torque_n_m of the rover file; without it, 0.4 times weight times wheel
        radius, like the motors of the JPL Open Source Rover.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    output
        Folder for pictures and data.
    film
        Write a film of the simulated drive: .gif, or .mp4 (needs the film extra).
    html
        Write a page (.html) that replays the simulated drive offline in any browser, with plots.
    format
        Format of the pictures: png; svg or pdf for print.
    theme
        Colours of pictures and film: light or dark page.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the comparison as JSON (SI units, radians) instead of the table.
    """
    drawn = Pictures(format, theme)
    written = (
        in_folder(output, *_files("simulation", drawn), drawn.name("attitude"), drawn.name("joints"))
        + checked_film(film)
        + checked_page(html)
    )
    guard_outputs(written, terrain, rover, path, force=force)
    machine = load_rover(rover)
    ground = load_terrain(terrain, linear, raster)
    way = path_of(path, radius, machine, ground)
    run = _on_map(drive_rover(machine, ground, way, speed), ground)
    with progress() as bar:
        task = bar.add_task("simulating", total=1.0)
        sim = simulate_plan(
            machine, ground, way, run,
            friction=friction, torque=torque, progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    beside = settle_along(machine, ground, sim)
    comparison = compare(beside, sim)
    files = _write_run(machine, ground, sim, output, "simulation", drawn)
    if output is not None:
        from ..bench.paper.figures import angles_figure, figures_7_to_9

        curves = figures_7_to_9(machine)
        for name, figure in (("attitude", "figure7"), ("joints", "figure8")):
            files.append(drawn.save(angles_figure(*curves[figure], run, sim, beside, {}), output, name))
    if film is not None:
        with progress() as bar:
            files += _write_film(machine, ground, sim, film, theme, bar, bar.add_task("filming", total=None))
    files += write_page(sim, html, force)
    short = float(sim.attrs["short_of_end"])
    motors = {name: float(sim.attrs[name]) for name in MOTORS}
    summary = summarise(sim) | {"short_of_end": short} | motors
    if json:
        print_json(summary | {"difference": comparison.to_dict(), "left_out": comparison.unlike, "files": files})
    else:
        print_summary(machine, summary)
        print(comparison, tracking(motors), *files, sep="\n")
    if short <= SHORT * way.length:
        return 0
    print(
        f"rockerbogie: the rover ends {short:.2f} m short of the path's end, {way.length:.2f} m away: {why_short(sim)}",
        file=sys.stderr,
    )
    return EXIT_NOT_THERE


def path_of(text: str | None, radius: float, rover: Rover, terrain: Terrain) -> Path:
    """Return the path of a file or of waypoints `x,y x,y …`.

    The default path is straight through the middle of the map; it keeps the rover's reach away from the edge of the map.

    Args:
        text: of the option; None for the default path.
        radius: turning radius at waypoints, m.
        rover, terrain: for the default path.

    Returns:
        The path.

    Raises:
        PathError: points that no path goes through, or a map that is too short.
    """
    if text is not None and (text.lower().endswith(".csv") or is_vector(text)):
        return read_route(text, radius)
    if text is not None:
        return Path.waypoints([parse_point(part, "--path") for part in text.split()], radius)
    xmin, ymin, xmax, ymax = terrain.bounds
    reach = 1.05 * (np.hypot(rover.hubs[:, 0], rover.hubs[:, 2]) + rover.wheel_radius).max()  # at any pitch
    if xmax - xmin <= 2 * reach:
        raise PathError(
            f"the map is {xmax - xmin:g} m long, too short for rover {rover.name!r}, reaching {reach:.3g} m: give more terrain"
        )
    return Path.straight((xmin + reach, (ymin + ymax) / 2), 0.0, xmax - xmin - 2 * reach)


def _on_map(run: xr.Dataset, terrain: Terrain) -> xr.Dataset:
    """Return the run if it lies on the map and has any pose, else raise."""
    status = run["status"].values
    off = status == Status.OFF_MAP
    if off.any():
        k = int(np.argmax(off))
        raise PathError(
            f"the path takes a wheel off the map at {float(run['distance'][k]):.4g} m along it, near ({float(run['x'][k]):.10g}, "
            f"{float(run['y'][k]):.10g}) m, and for {100 * off.mean():.3g} % of its stations: "
            f"{map_span(terrain)}; move the waypoints inward"
        )
    if not np.isfinite(run["z"].values).any():
        why, remedy = MEANING[Status(int(status[0]))]
        raise RockerbogieError(f"no pose was found anywhere along the path (at its start, {why}): {remedy}")
    return run


def _files(name: str, drawn: Pictures) -> tuple[str, ...]:
    """Return the names of the files that `_write_run` writes."""
    return f"{name}.nc", f"{name}.csv", *map(drawn.name, ("map", "profile", "worst"))


def _write_run(
    rover: Rover, terrain: Terrain, run: xr.Dataset, output: FilePath | None, name: str, drawn: Pictures
) -> list[FilePath]:
    """Write pictures and data of a run into the folder `output`; return the files."""
    if output is None:
        return []
    from ..figures.charts import run_map, run_profile, worst_of
    from ..figures.closeup import pose_figure

    folder = make_folder(output)
    save_netcdf(run, folder / f"{name}.nc")
    to_csv(run, folder / f"{name}.csv")
    drawn.save(run_map(rover, terrain, run), folder, "map")
    drawn.save(run_profile(rover, terrain, run), folder, "profile")
    if (worst := worst_of(rover, run)) is not None:
        title = f"{rover.name} on {terrain.name}, worst: {worst.reason}"
        drawn.save(pose_figure(rover, terrain, run.isel(time=worst.station), title), folder, "worst")
    return in_folder(folder, *_files(name, drawn))


def _write_film(
    rover: Rover, terrain: Terrain, run: xr.Dataset, film: FilePath | None, theme: Theme, bar: Progress, task: TaskID
) -> list[FilePath]:
    """Write a film of a run; return the file, or no file if `film` is None."""
    if film is None:
        return []
    from ..figures.film import write_film

    bar.update(task, description="filming")
    make_folder(film.parent)

    def shown(done: int, total: int) -> None:
        bar.update(task, completed=done, total=total)

    return [write_film(film, rover, terrain, run, theme=theme, progress=shown)]
