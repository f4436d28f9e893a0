"""Command `rockerbogie slip-table`: slip by slope, heading and soil."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..arrays import Array
from ..errors import RockerbogieError
from ..logs.slip_table import TableSoil, slip_table, table_rows, write_slip_table
from ..motion.soil_slip import SoilSlip
from ..rover.formats import load_rover
from ..terrain.soil.load import load_soil
from .common import Force, Json, RoverName, guard_outputs, make_folder, parse_gravity, print_json, progress

#: Largest number of slopes times headings.
MOST = 10_000


def slip_table_(
    soils: Annotated[list[str], Parameter(consume_multiple=True)],
    /,
    *,
    rover: RoverName = "perseverance",
    slopes: str = "0,2.5,5,7.5,10,12.5,15,17.5,20,22.5,25",
    headings: str = "0,45,90,135,180",
    gravity: str = "mars",
    grousers: float | None = None,
    torque: float | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Tabulate slip by slope, heading and soil.

    Slip is 1 − advance along the heading / wheel travel. On a soil's law it is that of the rover's balance on a plane, as
    `predict` computes it. The curve of a drive's log (`fit-soil`) has a band from 10 to 90 %.

    Parameters
    ----------
    soils
        Names of soil presets (`rockerbogie soils`), soil files (.toml), or files fit_soil.json of `rockerbogie fit-soil`.
    rover
        Name of a preset, or a rover file. It must have masses.
    slopes
        Angles of the steepest ascent, degrees, from 0 to below 90, separated by commas.
    headings
        Angles on the slope from straight uphill, degrees: 0 uphill, 90 across, 180 downhill.
    gravity
        earth, mars, moon, or a number in m/s².
    grousers
        Height of the wheels' grousers in soil, m.
    torque
        Torque limit of each hub motor, N·m. Default: torque_n_m of the rover file; without it, no limit.
    output
        CSV to write. A slip table there is replaced.
    force
        Replace an existing file that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of the table.
    """
    if output is not None:
        if output.suffix.lower() != ".csv":
            raise RockerbogieError(f"{str(output)!r} should end in .csv")
        guard_outputs([output], rover, *soils, force=force)
    named = _soils(soils)
    angles = _degrees(slopes, "--slopes"), _degrees(headings, "--headings")
    if not ((angles[0] >= 0.0) & (angles[0] < 90.0)).all() or np.abs(angles[1]).max() > 360.0:
        raise RockerbogieError("--slopes are degrees from 0 to below 90, --headings from -360 to 360")
    if angles[0].size * angles[1].size > MOST:
        raise RockerbogieError(f"{angles[0].size} slopes x {angles[1].size} headings are more than {MOST:,}: give fewer")
    machine, field = load_rover(rover), parse_gravity(gravity)
    with progress() as bar:
        bar.add_task("predicting", total=None)
        table = slip_table(named, *map(np.radians, angles), rover=machine, gravity=field, grousers=grousers, torque=torque)
    if output is not None:
        make_folder(output.parent)
        write_slip_table(table, output, force=force)
    if json:
        print_json(
            {name: table[name].to_numpy() for name in ("soil", "slope", "heading", "probability", "slip", "drift", "status")}
            | {"extrapolated": table["outside"].to_numpy(), "rover": machine.name, "gravity": field}
        )
        return
    _print(table_rows(table), [f"slip {100 * q:g} %" for q in table["probability"].to_numpy()])
    if output is not None:
        print(output)


def _soils(names: list[str]) -> Mapping[str, TableSoil]:
    """Return soils by name, or raise."""
    found: dict[str, TableSoil] = {}
    for name in names:
        if name in found:
            raise RockerbogieError(f"soil {name!r} is given twice")
        found[name] = SoilSlip.from_json(name) if Path(name).suffix.lower() == ".json" else load_soil(name)
    return found


def _degrees(text: str, option: str) -> Array:
    """Return the angles of an option, degrees, or raise."""
    try:
        angles = np.array([float(part) for part in text.replace(",", " ").split()])
    except ValueError:
        angles = np.empty(0)
    if angles.size == 0 or not np.isfinite(angles).all():
        raise RockerbogieError(f"{option} is {text!r:.60}; give degrees separated by commas, such as 0,5,10")
    return angles


def _print(rows: list[list[str]], slips: list[str]) -> None:
    """Print the table without its empty columns."""
    names = ["soil", "slope", "heading", *slips, "drift", "extrapolated", "status"]
    units = dict.fromkeys(("slope", "heading", "drift"), "°")
    table = Table(box=box.SIMPLE, padding=(0, 1))
    shown = [k for k, name in enumerate(names) if any(row[k] not in ("", "no") for row in rows)]
    for k in shown:
        left, is_soil = names[k] in ("soil", "status"), names[k] == "soil"
        table.add_column(names[k], justify="left" if left else "right", no_wrap=not is_soil, overflow="fold")
    for row in rows:
        table.add_row(*(escape(row[k]) + (units.get(names[k], "") if row[k] else "") for k in shown))
    Console(highlight=False).print(table)
