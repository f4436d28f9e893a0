"""Command `rockerbogie validate`: predicted and logged attitudes."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.table import Table

from ..errors import RockerbogieError
from ..logs.attitude_log import LogMap, known_log, read_places
from ..logs.validate import validate as compare_with_log
from ..rover.formats import load_rover
from ..settling.status import Status
from .common import (
    SURFACE,
    Folder,
    Force,
    Json,
    Linear,
    RoverName,
    TerrainName,
    Whole,
    guard_outputs,
    in_folder,
    make_folder,
    parse_point,
    print_json,
    progress,
    save_netcdf,
)
from .rasters import Raster, load_terrain

if TYPE_CHECKING:
    import xarray as xr

Columns = Annotated[list[str] | None, Parameter(name="--column", negative="")]
#: Greatest number of places printed; all of them are in the CSV.
MOST_PRINTED = 40


def validate(
    *,
    terrain: TerrainName,
    log: FilePath,
    rover: RoverName = "curiosity",
    mapping: FilePath | None = None,
    column: Columns = None,
    frame: Literal["enu", "ned"] | None = None,
    origin: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    position_sigma: float = 1.0,
    height_sigma: float = 0.05,
    level: float = 0.8,
    draws: Whole = 400,
    seed: Whole = 0,
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Compare predicted with logged attitudes: settle the rover at the positions of a log.

    Prints pitch and roll, logged and predicted, for each position, with a band for the uncertainty of position and terrain;
    then RMS, bias, median error, correlation, and the share of logged values, not used in the fit, inside the band. Rows with
    missing values are left out and counted. With -o it writes validation.png, validation.csv and validation.nc.
    The waypoints of Curiosity and the drives of Perseverance that docs/validation.md names, and a CSV of `rockerbogie drive`,
    need no mapping.

    Parameters
    ----------
    terrain
        The terrain model: a raster file (GeoTIFF and others), or surface:NAME.
    log
        A CSV with a header line; commas, semicolons or tabs between columns.
    rover
        A preset's name, or a rover file.
    mapping
        A TOML file with the meaning of the log's columns: frame, origin, [columns], [units].
    column
        One column: --column pitch=-nose_up_deg; may be repeated, and takes precedence over the mapping. A minus changes the
        sign; the unit is read from [deg] in the header or the name's ending. Roles: place, x, y, roll, pitch, yaw,
        steering_LF and so on, and quaternion=qx,qy,qz,qw.
    frame
        Axes of the log's attitude. enu: x forward, y left, z up over east, north, up, nose down positive. ned: x forward, y
        right, z down over north, east, down: nose up positive, yaw clockwise from north.
    origin
        Origin of the log's x and y: x,y in the terrain's metres.
    position_sigma
        Standard deviation of the logged x and y, m.
    height_sigma
        Standard deviation of the model's heights, m.
    level
        Share of values that the band contains.
    draws
        Number of random terrains per position; 0: no band.
    seed
        Seed of the draws.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: linear for files, because it amplifies their errors less.
    output
        Folder for picture and data.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of the tables.
    """
    written = in_folder(output, *(f"validation.{kind}" for kind in ("png", "csv", "nc")))
    guard_outputs(written, terrain, log, rover, mapping, force=force)
    machine = load_rover(rover)
    ground = load_terrain(terrain, True if linear is None and not terrain.startswith(SURFACE) else linear, raster)
    places = read_places(log, machine, _mapping(log, mapping, column or [], frame, origin))
    with progress() as bar:
        task = bar.add_task("settling on drawn terrains" if draws else "settling", total=1.0)
        found = compare_with_log(
            machine, ground, places, position_sigma=position_sigma, height_sigma=height_sigma, level=level, draws=draws,
            seed=seed, progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    files = _write(found, output)
    if json:
        print_json(_record(found) | {"files": files})
        return
    _print(found)
    for file in files:
        print(file)


def _mapping(
    log: FilePath, file: FilePath | None, pairs: list[str], frame: Literal["enu", "ned"] | None, origin: str | None
) -> LogMap | None:
    """Return the mapping of a file or known log, changed by the options; None without them."""
    if file is None and not pairs and frame is None and origin is None:
        return None
    base = LogMap.from_toml(file) if file is not None else known_log(log) or LogMap({}, name="--column")
    columns = dict(base.columns)
    for pair in pairs:
        role, equals, theirs = pair.partition("=")
        if not (role and equals and theirs):
            raise RockerbogieError(
                f"--column {pair!r} is not a pair: give the role, =, and the name in the log, as in pitch=-pitch_deg"
            )
        columns[role.strip()] = tuple(theirs.split(",")) if role.strip() == "quaternion" else theirs.strip()
    if not columns:
        raise RockerbogieError("--frame and --origin need the meaning of the columns: add --mapping or --column")
    start = base.origin if origin is None else parse_point(origin, "--origin")
    return replace(base, columns=columns, frame=frame or base.frame, origin=start)


def _first_rows(found: xr.Dataset) -> xr.Dataset:
    """Return one row per place."""
    if "stand" not in found:
        return found
    return found.isel(row=np.unique(found["stand"].to_numpy(), return_index=True)[1])


SUMMARY = ("rms", "bias", "median_absolute_error", "correlation", "spread", "coverage", "coverage_unfitted")


def _record(found: xr.Dataset) -> dict[str, Any]:
    """Return the result for JSON."""
    channels = [str(c) for c in found["channel"].to_numpy()]
    places = _first_rows(found)
    rows = []
    for k in range(places.sizes["row"]):
        at = places.isel(row=k)
        row: dict[str, Any] = {name: at[name].item() for name in ("place", "x", "y", "yaw")}
        row["status"] = Status(int(at["status"])).name
        for channel in channels:
            names = ("logged", "predicted", "error", "low", "high", "inside")
            row[channel] = {name: at[name].sel(channel=channel).item() for name in names if name in at}
        rows.append(row)
    summary: dict[str, dict[str, Any]] = {
        c: {name: float(found[name].sel(channel=c)) for name in SUMMARY if name in found} for c in channels
    }
    if "explained" in found:
        for c in channels:
            summary[c]["explained"] = {str(s): float(found["explained"].sel(channel=c, source=s)) for s in found["source"].values}
    return {**found.attrs, "channels": summary, "per_place": rows}


def _write(found: xr.Dataset, output: FilePath | None) -> list[FilePath]:
    """Write picture and data into the folder `output`; return the files."""
    if output is None:
        return []
    from ..figures.style import save
    from ..figures.validation import validation_figure

    folder = make_folder(output)
    save(validation_figure(found), folder / "validation.png")
    save_netcdf(found, folder / "validation.nc")
    columns: dict[str, Any] = {"place": found["place"].to_numpy(), "x [m]": found["x"].to_numpy(), "y [m]": found["y"].to_numpy()}
    columns |= {"yaw [deg]": np.degrees(found["yaw"].to_numpy()), "status": found["status"].to_numpy()}
    if "stand" in found:
        columns["stand"] = found["stand"].to_numpy()
    for channel in found["channel"].to_numpy():
        for name in ("logged", "predicted", "error", "low", "high"):
            if name in found:
                columns[f"{channel}_{name} [deg]"] = np.degrees(found[name].sel(channel=channel).to_numpy())
        if "inside" in found:
            columns[f"{channel}_inside"] = found["inside"].sel(channel=channel).to_numpy().astype(int)
    with open(folder / "validation.csv", "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        cells = [[f"{v:.10g}" if isinstance(v, float) else str(v) for v in values.tolist()] for values in columns.values()]
        writer.writerows(zip(*cells, strict=True))
    return [folder / f"validation.{kind}" for kind in ("png", "csv", "nc")]


def _print(found: xr.Dataset) -> None:
    """Print notes, the table of places, and the summary."""
    console = Console(highlight=False)
    places, band = _first_rows(found), "low" in found
    about = found.attrs
    rows = f"{about['rows']} rows" + (f" at {about['places']} places" if band and about["places"] != about["rows"] else "")
    for note in str(about.get("notes", "")).split("\n"):
        if note:
            console.print(f"note: {about.get('log', 'the log')}: {note}", markup=False)
    console.print(f"[bold]{about['rover']}[/] on [bold]{about['terrain']}[/] by {about.get('log', 'a log')}: {rows}, degrees")
    every = -(-places.sizes["row"] // MOST_PRINTED)
    table = Table(box=box.SIMPLE, padding=(0, 0), pad_edge=False, collapse_padding=True)
    table.add_column(f"\n{about.get('place_is', 'row')}", no_wrap=True)
    for channel in found["channel"].to_numpy():
        for head in (
            f"{channel}\n logged",
            "\n model",
            "\n error",
            *((f"\n {100 * about['level']:.0f} % band ",) if band else ()),
        ):
            table.add_column(head, justify="right", no_wrap=True)
    for k in range(0, places.sizes["row"], every):
        at = places.isel(row=k)
        cells = [str(at["place"].item())]
        for channel in found["channel"].to_numpy():
            c = at.sel(channel=channel)
            value = {name: float(np.degrees(c[name])) for name in ("logged", "predicted", "error")}
            cells += [f"{value['logged']:.1f}", f"{value['predicted']:.1f}", f"{value['error']:+.1f}"]
            if band:
                low, high = (np.degrees(float(c[end])) for end in ("low", "high"))
                cells.append(f"{low:.1f}…{high:.1f}" + (" " if bool(c["inside"]) else "*"))
        table.add_row(*cells)
    console.print(table)
    if band:
        console.print("* the logged value lies outside the band")
    if every > 1:
        console.print(f"every {every}th place is shown; -o writes all")
    _print_summary(console, found, band)


def _print_summary(console: Console, found: xr.Dataset, band: bool) -> None:
    """Print statistics per channel, and the band's coverage and sources."""
    about = found.attrs
    table = Table(box=box.SIMPLE, padding=(0, 1))
    heads = ("", "RMS", "bias", "median error", "correlation", "logged spread", *(("in band",) if band else ()))
    for head in heads:
        table.add_column(head, justify="left" if head == "" else "right", no_wrap=True)
    for channel in found["channel"].to_numpy():
        c = found.sel(channel=channel)
        deg = {name: np.degrees(float(c[name])) for name in ("rms", "bias", "median_absolute_error", "spread")}
        cells = [str(channel), f"{deg['rms']:.2f}", f"{deg['bias']:+.2f}", f"{deg['median_absolute_error']:.2f}"]
        cells += [f"{float(c['correlation']):.2f}", f"{deg['spread']:.2f}"]
        table.add_row(*cells, *((f"{100 * float(c['coverage']):.0f} %",) if band else ()))
    console.print(table)
    if about["settled"] < about["rows"]:
        lost = about["rows"] - about["settled"]
        console.print(f"{lost} rows did not settle and are left out of the statistics; validation.csv has their status")
    if band:
        console.print(
            f"the {100 * about['level']:.0f} % band holds {100 * float(found['coverage'].mean()):.0f} % of the values it was not "
            f"fitted on\nrandom relief is {about['factor']:.2g} times that from the terrain's own roughness "
            f"(Hurst {about['hurst']:.2f})"
        )
        for source in found["source"].to_numpy():
            pitch, roll = np.degrees(found["explained"].sel(source=source).to_numpy())
            console.print(f"{source} alone gives a standard deviation of {pitch:.2f}° in pitch and {roll:.2f}° in roll")
