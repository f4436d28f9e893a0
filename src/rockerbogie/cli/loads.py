"""Command `rockerbogie loads`: forces, torques and tip margin at one position."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..errors import RockerbogieError
from ..rover.formats import load_rover
from ..settling.engines import Mode
from ..settling.pose import Pose
from ..settling.settle import settle
from ..statics.loads import LAWS, LoadStatus, WheelLoads, wheel_loads
from ..statics.stability import Stability, stability
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
    middle,
    parse_gravity,
    parse_point,
    print_json,
)
from .pictures import Format, Pictures, Theme
from .rasters import Raster, load_terrain

#: Exit code if no forces balance the pose: a result, not a wrong call.
EXIT_NO_BALANCE = 1

MEANING = {
    LoadStatus.BALANCED: "the forces below balance every body of the mechanism",
    LoadStatus.NO_POSE: "there is no pose here (see rockerbogie settle)",
    LoadStatus.NOT_HELD: "no friction coefficient holds the rover: it tips over",
    LoadStatus.PULLS: "under this law a wheel would have to pull at the terrain: a wheel lifts; try --law least_friction",
    LoadStatus.UNDETERMINED: "this law does not determine the forces of this pose; try --law least_friction",
    LoadStatus.NOT_CONVERGED: "the solution did not converge",
}


def loads(
    *,
    terrain: TerrainName,
    rover: RoverName = "elhami-dashti",
    at: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    yaw: float = 0.0,
    mode: Mode = "contact",
    law: str = "least_friction",
    gravity: str = "earth",
    drawbar: float = 0.0,
    linear: Linear = None,
    raster: Raster = None,
    output: Folder = None,
    format: Format = "png",
    theme: Theme = "light",
    force: Force = False,
    json: Json = False,
) -> int:
    """Compute wheel loads, required friction, motor torques and the tip margin at one position.

    Prints the numbers; with -o also draws the forces as arrows on the rover (loads.png).
    Exits 1 if no forces balance the pose, 2 for wrong input.

    Parameters
    ----------
    terrain
        A raster file (GeoTIFF and others), or surface:NAME for a built-in one: surface:paper, surface:mars, surface:rocks …
    rover
        Name of a preset, or a rover file.
    at
        Position of the body's reference point, x,y in the map's metres. Default: the middle of the map.
    yaw
        Yaw (heading), degrees, counter-clockwise from +x (east).
    mode
        contact: all six wheels in contact. equilibrium: balance under the rover's weight; wheels may be off the ground.
    law
        Law that selects one set of balancing forces: least_friction, equal_torque, equal_slip, frictionless_sides or vertical.
    gravity
        earth, mars, moon, or a number in m/s².
    drawbar
        Force that pulls the body backward, N.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    output
        Folder for the picture.
    format
        Format of the picture: png; svg or pdf for print.
    theme
        Colours of the picture: light or dark page.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of the table.
    """
    if law not in LAWS:
        raise RockerbogieError(f"--law {law!r} is not known; give one of {', '.join(LAWS)}")
    drawn, field = Pictures(format, theme), parse_gravity(gravity)
    guard_outputs(in_folder(output, drawn.name("loads")), terrain, rover, force=force)
    machine = load_rover(rover)
    surface = load_terrain(terrain, linear, raster)
    x, y = middle(surface) if at is None else parse_point(at, "--at")
    pose = settle(machine, surface, x, y, np.radians(yaw), mode=mode)
    result = wheel_loads(pose, gravity=field, drawbar=drawbar, law=law)  # type: ignore[arg-type]
    tip = stability(pose, gravity=field)
    status = LoadStatus(int(result.status))
    files = []
    if output is not None and np.isfinite(pose.z):
        from ..figures.load_closeup import loads_figure

        files.append(drawn.save(loads_figure(pose, result, tip, field), make_folder(output), "loads"))
    if json:
        print_json(_record(pose, result, status, field) | _margins(tip) | {"files": files})
    else:
        _print_tables(pose, result, status, field)
        _print_margins(tip)
        for file in files:
            print(file)
    return 0 if status == LoadStatus.BALANCED else EXIT_NO_BALANCE


def _margins(tip: Stability) -> dict[str, Any]:
    """Return the JSON record of the tip margin."""
    names = ("tip_margin", "direction", "stays", "slides", "force_angle", "energy")
    return {"stability": {name: getattr(tip, name) for name in names}}


def _print_margins(tip: Stability) -> None:
    """Print the tip margin as a sentence."""
    margin = float(tip.tip_margin)
    if np.isnan(margin):
        return
    if margin == 0.0:
        text = "no forces hold the rover as it stands"
    elif np.isnan(float(tip.direction)):
        text = "no turn of gravity up to 90° tips it"
    else:
        how = "slides" if tip.slides else f"tips over {tip.edge}"
        text = f"tip margin {np.degrees(margin):.1f}° towards azimuth {round(np.degrees(float(tip.direction)))}°, where it {how}"
    Console().print(text, highlight=False)


def _record(pose: Pose, result: WheelLoads, status: LoadStatus, gravity: float) -> dict[str, Any]:
    """Return position, gravity, law, status and wheel loads, in SI units."""
    names = (
        "normal",
        "traction",
        "side",
        "torque",
        "friction_used",
        "required_friction",
        "friction_bound",
        "belly",
        "joint_torque",
    )
    return {
        "rover": pose.rover.name,
        "terrain": pose.terrain.name,
        "x": float(pose.x),
        "y": float(pose.y),
        "yaw": float(pose.yaw),
        "gravity": gravity,
        "law": result.law,
        "status": status.name,
        "meaning": MEANING[status],
        "wheel_names": pose.rover.wheel_names,
    } | {name: getattr(result, name) for name in names}


def _print_tables(pose: Pose, result: WheelLoads, status: LoadStatus, gravity: float) -> None:
    """Print the forces as a table."""
    console = Console()
    weight = pose.rover.mass * gravity
    console.print(
        f"[bold]{escape(pose.rover.name)}[/] on [bold]{escape(pose.terrain.name)}[/], law {result.law}: {status.name}, "
        f"{MEANING[status]}",
        highlight=False,
    )
    if status != LoadStatus.BALANCED:
        return
    console.print(
        f"weight {weight:.1f} N ({pose.rover.mass:.4g} kg at {gravity:g} m/s²), tilt {np.degrees(float(pose.tilt)):.2f}°, "
        f"required friction {float(result.required_friction):.4f}",
        highlight=False,
    )
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for heading in ("wheel", "normal", "share", "traction", "side", "friction used", "axle torque"):
        table.add_column(heading, justify="left" if heading == "wheel" else "right")
    for i, name in enumerate(pose.rover.wheel_names):
        used = float(result.friction_used[i])
        table.add_row(
            name, f"{result.normal[i]:.1f} N", f"{100 * result.normal[i] / weight:.1f} %", f"{result.traction[i]:+.1f} N",
            f"{result.side[i]:+.1f} N", "off the ground" if np.isnan(used) else f"{used:.3f}", f"{result.torque[i]:+.2f} N m",
        )  # fmt: skip
    console.print(table)
    if float(result.belly) > 0.0:
        console.print(f"body on the terrain: {float(result.belly):.1f} N", highlight=False)
