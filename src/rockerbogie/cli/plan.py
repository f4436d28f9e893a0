"""Command `rockerbogie plan`: least-cost routes over a map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from ..errors import RockerbogieError
from ..files.vectors import require_vectors
from ..maps.files import check_place, read_map, write_map
from ..maps.plan import USUAL_SPEED, reachability
from ..maps.plan import plan as plan_route
from ..maps.preview import overview
from ..maps.slip import SlipCost
from ..motion.path_files import Route
from ..motion.route_package import read_line
from ..motion.soil_slip import SoilSlip
from ..rover.formats import load_rover
from .common import Force, Json, guard_outputs, make_folder, print_json, progress
from .rasters import Raster, RasterOptions, raster_or_surface

if TYPE_CHECKING:
    import xarray as xr

Place = Annotated[tuple[float, float], Parameter(allow_leading_hyphen=True, negative="")]
Heading = Annotated[float | None, Parameter(allow_leading_hyphen=True)]


def plan(
    map_file: Annotated[Path, Parameter(name="map")],
    /,
    *,
    start: Place,
    goal: Place | None = None,
    via: Annotated[list[tuple[float, float]] | None, Parameter(allow_leading_hyphen=True, negative="")] = None,
    goals: Path | None = None,
    start_heading: Heading = None,
    goal_heading: Heading = None,
    keep_out: Path | None = None,
    keep_out_margin: float | None = None,
    cost: Path | None = None,
    soil: Path | None = None,
    slip_limit: float = 0.8,
    slip_risk: float = 0.1,
    minimise: Literal["time", "energy"] = "time",
    reach: Path | None = None,
    speed: float = USUAL_SPEED,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    rover: Annotated[str | None, Parameter(name=["--rover", "-r"])] = None,
    tilt_weight: float = 1.0,
    turn_cost: float = 1.0,
    turn_in_place: bool | None = None,
    backward: Annotated[bool, Parameter(negative="")] = False,
    terrain: Annotated[str | None, Parameter(name=["--terrain", "-t"])] = None,
    raster: Raster = None,
    preview: bool = True,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compute the least-cost route over a map that `rockerbogie map` made.

    With -o it writes the route and a picture of it over the map (.png). `rockerbogie drive --path route.csv` drives it.

    Parameters
    ----------
    map_file
        The map: .zarr, .nc, or .tif. A .tif without --per-heading has no single headings: only cells that are passable
        at every heading then count as passable.
    start
        Position of the start: x y in the map's metres.
    goal
        Position of the last goal: x y in the map's metres.
    via
        Position of a goal before the last one: x y; may be repeated, in order.
    goals
        A vector file of points, reached in the order of the file, before --via and --goal.
    start_heading
        Yaw of the rover at the start, degrees, counter-clockwise from +x (east). Default: any.
    goal_heading
        Yaw at the goal, degrees. Default: any.
    keep_out
        Areas not to enter: all features of a vector file (GeoPackage, Shapefile, ...), or the cells of a raster that are
        neither 0 nor missing.
    keep_out_margin
        Distance that the rover's reference point keeps from them, m. Default: the rover's own radius.
    cost
        Extra cost per metre, at least 0: a vector file with a column `cost`, or a raster.
    soil
        File fit_soil.json of `rockerbogie fit-soil`. A metre then costs its expected wheel travel, from the slip curve of the
        soil at the end of that drive. Slopes with too much slip are avoided (--slip-limit).
    slip_limit
        Slip to avoid.
    slip_risk
        Largest allowed probability that slip exceeds --slip-limit at a pose of the route.
    minimise
        time: wheel travel. energy: motor work, with a rolling resistance of 10 % of the weight. With --soil only.
    reach
        Also write the part of the map that the rover can reach from the start, and the cost: .tif, .nc or .zarr. Needs no goal.
    speed
        Speed of the wheels, m/s, for the times in the route.
    output
        The route to write: .gpkg (lines with length, time, tilt and clearance, and poses; CRS of the map), .csv (poses) or
        .geojson (a line).
    rover
        A preset's name, or a rover file; determines how the rover turns. Default: the map's rover, if that is a preset.
    tilt_weight
        Weight w of the tilt: a metre costs 1 + w (tilt / tilt limit)².
    turn_cost
        Cost of a turn, m per radian.
    turn_in_place
        Override how the rover turns. Default: on the spot if its four corner wheels steer.
    backward
        Allow driving backwards.
    terrain
        Terrain for the shading of the picture: a raster file or surface:NAME.
    preview
        Write the picture too.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the route as JSON (SI units, radians) instead of a line.
    """
    if output is not None and output.suffix.lower() not in WRITERS:
        raise RockerbogieError(f"{str(output)!r} is not the name of a route: end it in .gpkg, .csv or .geojson")
    if output is not None and output.suffix.lower() == ".gpkg":
        require_vectors()
    if reach is not None:
        check_place(reach)
    picture = None if output is None or not preview else output.with_suffix(".png")
    written = [file for file in (output, picture, reach) if file is not None]
    guard_outputs(written, map_file, rover, terrain, goals, keep_out, cost, soil, force=force)
    ends = _goals(goals, via, None if goal is None else _state(goal, goal_heading))
    if not ends and reach is None:
        raise RockerbogieError("no goal: give --goal X Y, a file of --goals, or --reach for the reachable part of the map")
    maps, begin, files = read_map(map_file), _state(start, start_heading), []
    options: dict[str, Any] = {
        "rover": None if rover is None else load_rover(rover), "keep_out": keep_out, "keep_out_margin": keep_out_margin,
        "cost": cost, "tilt_weight": tilt_weight, "turn_cost": turn_cost, "turn_in_place": turn_in_place, "backward": backward,
        "slip": None if soil is None else SlipCost(SoilSlip.from_json(soil), slip_limit, slip_risk, minimise),
    }  # fmt: skip
    with progress() as bar:
        bar.add_task("planning", total=None)
        reached = None if reach is None else reachability(maps, begin, **options)
        found = plan_route(maps, begin, ends, speed=speed, **options) if ends else None
    if reach is not None and reached is not None:
        make_folder(reach.parent)
        files.append(write_map(reached, reach, force=force))
    if output is not None and found is not None:
        make_folder(output.parent)
        WRITERS[output.suffix.lower()](found, output, force=force)
        files.append(output)
        if picture is not None:
            from ..figures.style import save
            from ..figures.terrain_map import terrain_map

            ground = None if terrain is None else raster_or_surface(terrain, None, raster)
            files.append(save(terrain_map(overview(maps, ground, **(raster or RasterOptions()).file_options), found), picture))
    if json:
        names = ("x", "y", "yaw", "distance", "cost", "tilt", "clearance", "time", "goal")
        record = {} if found is None else {name: getattr(found, name) for name in names} | {"heading": found.yaw}
        print_json(record | _share(reached) | {"files": files})
        return
    console = Console(highlight=False, soft_wrap=True)
    if found is not None:
        console.print(str(found))
    if reached is not None:
        console.print(f"{100 * _share(reached)['reachable_share']:.1f} % of the passable cells can be reached from the start")
    for file in files:
        print(file)


#: Writers of a route by the file's ending.
WRITERS = {".csv": Route.to_csv, ".geojson": Route.to_geojson, ".gpkg": Route.to_geopackage}


def _share(reached: xr.Dataset | None) -> dict[str, float]:
    """Return `reachable_share`, of the passable cells; an empty dict without reachability."""
    if reached is None:
        return {}
    share = reached["reachable"].values
    free = reached["passable"].values > 0 if "passable" in reached else np.isfinite(share)
    return {"reachable_share": float((share[free] > 0).mean()) if free.any() else 0.0}


def _goals(file: Path | None, via: list[tuple[float, float]] | None, last: tuple[float, ...] | None) -> list[tuple[float, ...]]:
    """Return all goals in order."""
    found: list[tuple[float, ...]] = []
    if file is not None:
        line, yaw = read_line(file)
        points = line if yaw is None else np.column_stack([line, yaw])
        found = [tuple(map(float, point)) for point in points]
    return [*found, *(via or []), *([] if last is None else [last])]


def _state(place: tuple[float, float], heading: float | None) -> tuple[float, ...]:
    """Return a position and, if given, its yaw in rad."""
    return place if heading is None else (*place, float(np.radians(heading)))
