"""Command `rockerbogie soils`: list soils, show one, draw the forces on a wheel."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..errors import RockerbogieError
from ..terrain.soil.forces import ForceStatus, wheel_soil_forces
from ..terrain.soil.laws import Soil
from ..terrain.soil.load import load_soil, soils
from .common import Force, Json, guard_outputs, make_folder, parse_gravity, print_json

#: Slips of the table.
SLIPS = (-1.0, -0.5, -0.2, 0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
ENDINGS = (".png", ".svg", ".pdf")
#: Meaning of a status that is not COMPUTED.
MEANING = {
    ForceStatus.OVERLOADED: "the soil cannot carry this load",
    ForceStatus.OUT_OF_RANGE: "outside the law's range",
    ForceStatus.INVALID: "the input is not valid",
    ForceStatus.NOT_CONVERGED: "the load balance did not converge",
}


def soils_(
    name: str | None = None,
    /,
    *,
    radius: float = 0.25,
    width: float = 0.3,
    load: float = 500.0,
    grousers: float = 0.0,
    slip_angle: float = 0.0,
    gravity: str = "earth",
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """List the soils, or show one with the forces on a wheel in it.

    Parameters
    ----------
    name
        A soil of the list, or a soil file (.toml). Default: list the soils.
    radius
        Radius of the wheel, m.
    width
        Width of the wheel, m.
    load
        Vertical load, N.
    grousers
        Height of the grousers, m; 0: a smooth rim.
    slip_angle
        Angle from the wheel's heading to its direction of motion, degrees, positive to the left.
    gravity
        earth, mars, moon, or a number in m/s².
    output
        Picture to write (.png, .svg or .pdf): drawbar, side force, torque and sinkage against slip.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of tables.
    """
    if name is None:
        if output is not None:
            raise RockerbogieError("-o draws one soil: give its name, as in: rockerbogie soils dry-sand -o sand.png")
        _list(json)
        return
    if output is not None:
        if output.suffix.lower() not in ENDINGS:
            raise RockerbogieError(f"{str(output)!r} should end in {' or '.join(ENDINGS)}")
        guard_outputs([output], name, force=force)
    field = parse_gravity(gravity)
    soil = load_soil(name)
    forces = wheel_soil_forces(soil, radius, width, load, SLIPS, np.radians(slip_angle), gravity=field, grousers=grousers)
    if json:
        wheel = {"radius": radius, "width": width, "grousers": grousers, "load": load, "slip_angle": np.radians(slip_angle)}
        names = ("drawbar", "side", "torque", "sinkage")
        status = [ForceStatus(int(code)).name for code in forces.status]
        curves = {"slip": SLIPS, **{part: getattr(forces, part) for part in names}, "status": status}
        print_json({"soil": _record(soil), "wheel": wheel, "gravity": field, "forces": curves})
    else:
        _print_soil(soil)
        _print_forces(forces, load)
    if output is not None:
        from ..figures.soil import soil_chart
        from ..figures.style import save

        make_folder(output.parent)
        title = f"{soil.title or soil.name}: wheel {radius:g} m × {width:g} m, load {load:g} N"
        angles = tuple(dict.fromkeys((np.radians(slip_angle), 0.0, np.radians(15.0), np.radians(30.0))))
        save(soil_chart(soil, radius, width, load, gravity=field, grousers=grousers, slip_angles=angles, title=title), output)
        if not json:
            print(output)


def _record(soil: Soil) -> dict[str, Any]:
    """Return the JSON record of a soil."""
    return dataclasses.asdict(soil)


def _list(as_json: bool) -> None:
    """Print the soils as a table or as JSON."""
    known = soils()
    if as_json:
        print_json({name: _record(soil) for name, soil in known.items()})
        return
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for heading in ("soil", "grade", "c", "φ", "n", "K", "title"):
        table.add_column(heading)
    for name, soil in known.items():
        table.add_row(
            name, soil.grade, f"{soil.cohesion:.0f} Pa", f"{np.degrees(soil.friction_angle):.1f}°", f"{soil.exponent:.2f}",
            f"{1000.0 * soil.shear_modulus:.1f} mm", escape(soil.title),
        )  # fmt: skip
    Console().print(table)
    print("grade A: published measurement; B: fitted or from a secondary source; C: partly estimated")


def _print_soil(soil: Soil) -> None:
    """Print the parameters of a soil."""
    console = Console()
    console.print(f"[bold]{escape(soil.name)}[/] {escape(soil.title)}, grade {escape(soil.grade)}", highlight=False)
    console.print(escape(soil.source), highlight=False)
    table = Table(box=box.SIMPLE, padding=(0, 1))
    table.add_column("parameter (SI, rad)")
    table.add_column("value", justify="right")
    for name, value in _record(soil).items():
        if name in ("name", "title", "source", "grade"):
            continue
        shown = ", ".join(f"{item:g}" for item in value) if isinstance(value, tuple) else value
        table.add_row(name, f"{shown:.6g}" if isinstance(shown, float) else str(shown))
    console.print(table)


def _print_forces(forces: Any, load: float) -> None:
    """Print the forces at several slips."""
    console = Console()
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for heading in ("slip", "drawbar", "of the load", "side", "torque", "sinkage"):
        table.add_column(heading, justify="right")
    for k, slip in enumerate(SLIPS):
        status = ForceStatus(int(forces.status[k]))
        if status != ForceStatus.COMPUTED:
            table.add_row(f"{slip:+.1f}", MEANING[status])
            continue
        table.add_row(
            f"{slip:+.1f}", f"{forces.drawbar[k]:+.1f} N", f"{100.0 * forces.drawbar[k] / load:+.1f} %" if load else "–",
            f"{forces.side[k]:+.1f} N", f"{forces.torque[k]:+.2f} N m", f"{1000.0 * forces.sinkage[k]:.1f} mm",
        )  # fmt: skip
    console.print(table)
