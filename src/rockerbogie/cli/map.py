"""Command `rockerbogie map`: poses over a whole terrain, compared with limits."""

from __future__ import annotations

import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, fields
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..errors import RockerbogieError, unknown_name
from ..maps.files import check_place, write_map
from ..maps.grid import cell_size
from ..maps.layers import LAYERS, chosen_layers
from ..maps.limits import UNITS, Limits
from ..maps.preview import Tally, overview, tally
from ..maps.store import check_store, discard_store
from ..maps.style import write_style
from ..maps.traversability import traversability
from ..rover.formats import load_rover
from .common import Force, Json, Linear, RoverName, Whole, guard_outputs, make_folder, parse_gravity, print_json, progress
from .rasters import Raster, RasterOptions, parse_bounds, raster_or_surface

if TYPE_CHECKING:
    import xarray as xr

Degrees = Annotated[float | None, Parameter(negative="")]


def map_(
    terrain: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    rover: RoverName = "curiosity",
    headings: Whole = 16,
    resolution: float | None = None,
    limits: str = "curiosity",
    tilt: Degrees = None,
    pitch: Degrees = None,
    roll: Degrees = None,
    rocker: Degrees = None,
    bogie: Degrees = None,
    clearance: float | None = None,
    friction: float | None = None,
    tip_margin: Degrees = None,
    torque: float | None = None,
    gravity: str = "earth",
    bounds: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    mode: Literal["contact", "equilibrium"] = "contact",
    linear: Linear = None,
    raster: Raster = None,
    layers: str | None = None,
    per_heading: Annotated[bool, Parameter(negative="")] = False,
    chunk: Whole = 256,
    workers: Whole | None = None,
    scheduler: str | None = None,
    preview: bool = True,
    force: Force = False,
    json: Json = False,
) -> None:
    """Map where a rover can drive: settle it at every cell and heading, and compare with limits.

    The ending of -o gives the format: a cloud-optimised GeoTIFF (.tif; angles in degrees) with a style for QGIS (.qml) in
    the same folder, or Zarr (.zarr) or NetCDF (.nc) with every heading's layers (SI, radians). A picture (.png) is written
    too. Finished parts of a long run are kept in OUTPUT.parts: after an interruption, the same command continues from
    there.

    Parameters
    ----------
    terrain
        A raster file (GeoTIFF, PDS, ISIS and others), read in windows and never whole; or surface:NAME for a built-in one.
    output
        The map to write: .tif, .zarr or .nc.
    rover
        A preset's name, or a rover file.
    headings
        Number of headings, evenly spaced from +x (east).
    resolution
        Side of a cell, m. Default: the terrain's own.
    limits
        Limits of a pose: curiosity (its flight limits), none, or a TOML file with tilt_deg, pitch_deg, roll_deg, rocker_deg,
        bogie_deg, clearance_m, required_friction, tip_margin_deg, max_torque_n_m. The options below override single limits.
    tilt
        Greatest angle between the body's z axis and the vertical, degrees.
    pitch
        Greatest pitch, nose up or down, degrees.
    roll
        Greatest roll, left or right, degrees.
    rocker
        Greatest rocker angle, up or down, degrees.
    bogie
        Greatest bogie angle, up or down, degrees.
    clearance
        Least clearance of the body's box above the terrain, m.
    friction
        Friction coefficient of the terrain: poses that need more are not passable. Adds layers of the required friction.
    tip_margin
        Least tip margin, degrees: the angle by which gravity must turn until the rover tips over. Adds layers of the tip margin.
    torque
        Torque that each motor has, N·m. Adds layers of the largest motor torque.
    gravity
        earth, mars, moon, or a number in m/s²; for motor torques.
    bounds
        Map only this part: xmin,ymin,xmax,ymax in the terrain's metres.
    mode
        contact: all six wheels in contact, joint limits not enforced. equilibrium: balance under the rover's weight; wheels may
        be off the ground, joints at their limits.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    layers
        Keep only these layers, comma-separated, and passable and worst_exceeded. Default: all usual ones that the output
        can hold. Only on request: margin, worst_margin, slope, aspect, roughness, and, if they have no limit,
        required_friction, tip_margin, max_torque, worst_friction, worst_tip_margin, worst_torque.
    per_heading
        Write every heading's layers into the GeoTIFF too, after the summaries.
    chunk
        Side, in cells, of the part that a worker computes at once; a multiple of 128. It affects only memory and time.
    workers
        Number of processes on this machine. Default: depends on the size of the map.
    scheduler
        Address of a Dask cluster (tcp://host:8786) to do the work. Its workers must be able to read the same files.
    preview
        Write a picture into the folder of the map.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print the summary as JSON (SI units, radians) instead of the text.
    """
    check_place(output)
    geotiff = output.suffix.lower() in (".tif", ".tiff")
    style, picture = output.with_suffix(".qml"), output.with_suffix(".png")
    written = [output, *([style] if geotiff else []), *([picture] if preview else [])]
    guard_outputs(written, terrain, rover, limits, force=force)
    parts = output.with_name(f"{output.name}.parts") if find_spec("zarr") else None
    if parts is not None:
        check_store(parts)
    machine = load_rover(rover)
    allowed = _limits(limits, tilt, pitch, roll, rocker, bogie, clearance, friction, tip_margin, torque)
    chosen = _layers(layers, allowed, summaries_only=geotiff and not per_heading)
    ground = raster_or_surface(terrain, linear, raster)
    options = (raster or RasterOptions()).file_options
    make_folder(output.parent)
    began = time.perf_counter()
    with _shown(parts) as (settling, writing):
        maps = traversability(
            machine, ground, headings, resolution, allowed, bounds=parse_bounds(bounds, "--bounds"), mode=mode,
            gravity=parse_gravity(gravity), layers=chosen, interpolation="linear" if linear else "cubic", chunk=chunk, **options,
            store=parts, workers=workers, scheduler=scheduler, progress=settling,
        )  # fmt: skip
        seconds = time.perf_counter() - began
        try:
            files = [write_map(maps, output, per_heading=per_heading, force=force, progress=writing)]
        except RockerbogieError as error:
            kept = f"; finished parts are kept in {parts}; the same command continues from there" if parts else ""
            raise RockerbogieError(f"{error}{kept}") from None
    counts = tally(maps)
    if geotiff:
        files.append(write_style(maps, style, per_heading=per_heading))
    if preview:
        from ..figures.style import save
        from ..figures.terrain_map import terrain_map

        files.append(save(terrain_map(overview(maps, ground, **options)), picture))
    if json:
        print_json(_record(maps, counts, seconds) | {"files": files})
    else:
        _print(maps, counts, seconds)
        print(*files, sep="\n")
    if parts is not None:
        discard_store(parts)


@contextmanager
def _shown(parts: Path | None) -> Iterator[tuple[Callable[[int, int], None], Callable[[int, int], None]]]:
    """Show progress and notes on resumed work; yield callbacks for settling and writing."""
    with progress() as bar:
        task = bar.add_task("settling", total=None)
        seen: list[int] = []

        def settling(done: int, total: int) -> None:
            if not seen:
                bar.reset(task, total=total, completed=done)
                if done:
                    print(f"rockerbogie: note: continuing with {parts}: {100 * done / total:.0f} % is done", file=sys.stderr)
            seen.append(done)
            bar.update(task, total=total, completed=done)

        def writing(done: int, total: int) -> None:
            bar.update(task, description="writing", total=total, completed=done)

        try:
            yield settling, writing
        except KeyboardInterrupt:
            if parts is not None and parts.exists():
                print(
                    f"\nrockerbogie: note: finished parts are in {parts}; the same command continues from there", file=sys.stderr
                )
            raise


def _layers(text: str | None, limits: Limits, *, summaries_only: bool) -> list[str] | None:
    """Return the layers to keep; None for all of them.

    Args:
        text: "tilt,clearance", or None.
        limits: of the map.
        summaries_only: keep no layer of single headings, as the output does not hold them.

    Returns:
        Names of layers, or None.

    Raises:
        RockerbogieError: an unknown layer, or a layer that the output does not hold.
    """
    held = [name for name, layer in LAYERS.items() if not (summaries_only and layer.per_heading)]
    if text is None:
        return [name for name in chosen_layers(None, limits.forces) if name in held] if summaries_only else None
    names = chosen_layers([part.strip() for part in text.split(",")])
    if missing := [name for name in names if name not in held]:
        raise RockerbogieError(
            f"--layers {', '.join(missing)}: a GeoTIFF holds layers of single headings only with --per-heading"
        )
    return list(dict.fromkeys([*names, "passable", "worst_exceeded"]))


def _limits(name: str, *single: float | None) -> Limits:
    """Return limits by name or from a TOML file; single ones (degrees, m) override them."""
    base = _from_toml(Path(name)) if name.endswith(".toml") else Limits.named(name)
    names = ("tilt", "pitch", "roll", "rocker", "bogie", "clearance", "required_friction", "tip_margin", "max_torque")
    given = {key: value for key, value in zip(names, single, strict=True) if value is not None}
    return Limits(**(asdict(base) | {key: v if key in UNITS else float(np.radians(v)) for key, v in given.items()}))


def _from_toml(file: Path) -> Limits:
    """Return the limits of a TOML file in degrees, metres and N m; missing keys mean no limit."""
    if not file.exists():
        raise RockerbogieError(f"no file of limits at {str(file)!r}")
    try:
        found = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RockerbogieError(f"{str(file)!r} is not TOML: {error}") from None
    known = {field.name + UNITS.get(field.name, ("deg", "_deg"))[1]: field.name for field in fields(Limits)}
    values = {}
    for key, value in found.items():
        if key not in known:
            raise RockerbogieError(f"{str(file)!r}: {unknown_name('limit', key, known)}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RockerbogieError(f"{str(file)!r}: {key} is {value!r}; give a number")
        values[known[key]] = float(value) if known[key] in UNITS else float(np.radians(value))
    return Limits(**values)


def _record(maps: xr.Dataset, counts: Tally, seconds: float) -> dict[str, Any]:
    """Return the summary of a map for JSON."""
    dx, dy = cell_size(maps)
    rest = counts.known - counts.every - counts.some
    poses = counts.cells * maps.sizes["heading"]
    return {
        "rover": maps.attrs["rover"],
        "terrain": maps.attrs["terrain"],
        "cells": [maps.sizes["x"], maps.sizes["y"]],
        "cell_size": [dx, dy],
        "headings": maps.sizes["heading"],
        "area": counts.cells * dx * dy,
        "known_area": counts.known * dx * dy,
        "passable_share": {
            name: part / counts.known if counts.known else None
            for name, part in (("every_heading", counts.every), ("some_headings", counts.some), ("no_heading", rest))
        },
        "exceeded_at_some_heading": {name: n / counts.known if counts.known else None for name, n in counts.exceeded.items()},
        "poses": poses,
        "seconds": seconds,
    }


def _print(maps: xr.Dataset, counts: Tally, seconds: float) -> None:
    """Print the summary of a map."""
    found = _record(maps, counts, seconds)
    console = Console(highlight=False)
    dx, dy = found["cell_size"]
    side = f"{dx:.4g} m" if np.isclose(dx, dy) else f"{dx:.4g} x {dy:.4g} m"
    console.print(f"[bold]{escape(found['rover'])}[/] on [bold]{escape(found['terrain'])}[/]")
    console.print(
        f"{found['cells'][0]} x {found['cells'][1]} cells of {side}, {_area(found['area'])}, {_area(found['known_area'])} of it "
        f"with data; {found['headings']} headings, {found['poses']:,} poses in {seconds:.3g} s"
    )
    if not counts.known:
        console.print(
            "no cell has terrain data under all wheels: see the missing data of the terrain; another --resolution does not help"
        )
        return
    table = Table(box=box.SIMPLE, padding=(0, 1), show_header=False)
    table.add_column()
    table.add_column(justify="right")
    shares = found["passable_share"]
    for label, key in (("passable at every heading", "every_heading"), ("at some", "some_headings"), ("at none", "no_heading")):
        table.add_row(label, f"{100 * shares[key]:.1f} %")
    beyond = {name: part for name, part in found["exceeded_at_some_heading"].items() if part}
    for name, part in sorted(beyond.items(), key=lambda item: -item[1]):
        label = (
            "not settled at some heading" if name == "unsettled" else f"{name.replace('_', ' ')} beyond its limit at some heading"
        )
        table.add_row(label, f"{100 * part:.1f} %")
    console.print(table)


def _area(square_metres: float) -> str:
    """Return an area as text in m² or km²."""
    return f"{square_metres / 1e6:.4g} km²" if square_metres >= 1e5 else f"{square_metres:.4g} m²"
