"""`rockerbogie plan`: the least-cost way over a map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from ..errors import RockerbogieError
from ..maps.files import read_map
from ..maps.plan import plan as plan_route
from ..maps.preview import overview
from ..rover.formats import load_rover
from .common import Force, Json, guard_outputs, make_folder, print_json, progress
from .rasters import Raster, RasterOptions, raster_or_surface

Place = Annotated[tuple[float, float], Parameter(allow_leading_hyphen=True)]
Heading = Annotated[float | None, Parameter(allow_leading_hyphen=True)]


def plan(
    map_file: Annotated[Path, Parameter(name="map")],
    /,
    *,
    start: Place,
    goal: Place,
    start_heading: Heading = None,
    goal_heading: Heading = None,
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
    """The least-cost way over a map that `rockerbogie map` made, as the rover can turn.

    With -o it writes the way and a picture of it over the map (.png). `rockerbogie drive --path route.csv` goes along it.

    Parameters
    ----------
    map_file
        The map: .zarr, .nc, or .tif. A .tif without --per-heading knows cells and no headings: there only cells that are
        passable at every heading are passable.
    start
        x y in the map's metres.
    goal
        x y in the map's metres.
    start_heading
        Where the rover faces there, degrees, counter-clockwise from +x (east). Default: any.
    goal_heading
        Where it is to face at the goal, degrees. Default: any.
    output
        The way to write: .csv (poses; for drive) or .geojson (a line in the map's CRS; for QGIS).
    rover
        A preset's name, or a rover file: how it turns. Default: the map's own rover, if that is a preset.
    tilt_weight
        A metre at the tilt limit costs this many metres more than a level one; less tilt costs less, by its square.
    turn_cost
        What a turn costs, m a radian.
    turn_in_place
        Whether the rover can. Default: if its four corner wheels steer.
    backward
        It may drive backwards too.
    terrain
        The ground, a raster file or surface:NAME, to shade the picture with.
    preview
        The picture beside the way.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the way as JSON (SI units, radians) in place of a line.
    """
    if output is not None and output.suffix.lower() not in (".csv", ".geojson"):
        raise RockerbogieError(f"{str(output)!r} names no kind of way: end it in .csv or .geojson")
    picture = None if output is None or not preview else output.with_suffix(".png")
    guard_outputs([file for file in (output, picture) if file is not None], map_file, rover, terrain, force=force)
    maps = read_map(map_file)
    with progress() as bar:
        bar.add_task("planning", total=None)
        found = plan_route(
            maps, _state(start, start_heading), _state(goal, goal_heading), rover=None if rover is None else load_rover(rover),
            tilt_weight=tilt_weight, turn_cost=turn_cost, turn_in_place=turn_in_place, backward=backward,
        )  # fmt: skip
    files = []
    if output is not None:
        make_folder(output.parent)
        (found.to_csv if output.suffix.lower() == ".csv" else found.to_geojson)(output, force=force)
        files.append(output)
        if picture is not None:
            from ..figures.style import save
            from ..figures.terrain_map import terrain_map

            ground = None if terrain is None else raster_or_surface(terrain, None, raster)
            files.append(save(terrain_map(overview(maps, ground, **(raster or RasterOptions()).file_options), found), picture))
    if json:
        names = ("x", "y", "yaw", "distance", "cost", "tilt")
        print_json({name: getattr(found, name) for name in names} | {"heading": found.yaw, "files": files})  # heading: old name
    else:
        Console(highlight=False, soft_wrap=True).print(str(found))
        for file in files:
            print(file)


def _state(place: tuple[float, float], heading: float | None) -> tuple[float, ...]:
    return place if heading is None else (*place, float(np.radians(heading)))
