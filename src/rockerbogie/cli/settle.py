"""`rockerbogie settle`: one pose, in numbers and in a picture."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..errors import RockerbogieError, unknown_name
from ..rover.formats import load_rover
from ..rover.model import Rover
from ..settling.pose import Pose
from ..settling.settle import settle as settle_rover
from ..settling.status import MEANING, Status
from .common import (
    Folder,
    Force,
    Json,
    Linear,
    RoverName,
    TerrainName,
    guard_outputs,
    in_folder,
    load_terrain,
    make_folder,
    map_span,
    middle,
    parse_point,
    print_json,
    save_netcdf,
)

#: Exit code where the rover finds no rest: an answer, not a wrong call.
EXIT_NO_POSE = 1


def settle(
    *,
    terrain: TerrainName,
    rover: RoverName = "elhami-dashti",
    at: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    yaw: float = 0.0,
    steering: str | None = None,
    mode: Literal["contact", "equilibrium"] = "contact",
    linear: Linear = None,
    output: Folder = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Let a rover settle at one place, and show how it sits there.

    The numbers go to the screen; with -o also a picture (pose.png) and the data (pose.nc). Exits 1 where the rover finds
    no rest there, 2 where it was asked wrongly (off the map, say).

    Parameters
    ----------
    terrain
        A raster file (GeoTIFF and others), or surface:NAME for a built-in one: surface:paper, surface:mars, surface:rocks …
    rover
        A preset's name, or a rover file.
    at
        Where the body's reference point stands, x,y in the map's metres. Default: the middle of the map.
    yaw
        Heading, degrees, counter-clockwise from +x (east).
    steering
        Angles of wheels that steer, degrees, left positive: LR=10,RR=12. The others stay straight.
    mode
        contact: all six wheels touch. equilibrium: at rest under its own weight; wheels may hang.
    linear
        Bilinear ground between the nodes, or a smooth cubic surface. Default: cubic for files.
    output
        Folder for the picture and the data.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) in place of the table.
    """
    guard_outputs(in_folder(output, "pose.nc", "pose.png"), terrain, rover, force=force)
    machine = load_rover(rover)
    ground = load_terrain(terrain, linear)
    x, y = middle(ground) if at is None else parse_point(at, "--at")
    pose = settle_rover(machine, ground, x, y, np.radians(yaw), steering=_steering(machine, steering), mode=mode)
    status = Status(int(pose.status))
    if status in (Status.OFF_MAP, Status.NO_DATA):
        why, remedy = MEANING[status]
        raise RockerbogieError(f"at ({x:.10g}, {y:.10g}) m {why}; {remedy} ({map_span(ground)})")
    found = bool(np.isfinite(pose.z))
    files = []
    if output is not None:
        from ..figures.closeup import pose_figure
        from ..figures.style import save

        folder = make_folder(output)
        data = pose.to_xarray()
        save_netcdf(data, folder / "pose.nc")
        files.append(folder / "pose.nc")
        if found:
            files.append(save(pose_figure(machine, ground, data, f"{machine.name} on {ground.name}"), folder / "pose.png"))
    if json:
        print_json(_record(pose, status) | {"files": files})
    else:
        _print_table(pose, status, found)
        for file in files:
            print(file)
    return 0 if found else EXIT_NO_POSE


def _steering(rover: Rover, text: str | None) -> NDArray[np.float64] | None:
    if text is None:
        return None
    angles = np.zeros(6)
    for part in text.split(","):
        name, _, value = part.strip().partition("=")
        if name not in rover.wheel_names:
            raise RockerbogieError(unknown_name("wheel", name, rover.wheel_names))
        try:
            angles[rover.wheel_names.index(name)] = np.radians(float(value))
        except ValueError:
            raise RockerbogieError(f"--steering {part.strip()!r} is not NAME=DEGREES, as in {rover.wheel_names[0]}=10") from None
    return angles


def _record(pose: Pose, status: Status) -> dict[str, Any]:
    names = (
        "x",
        "y",
        "z",
        "roll",
        "pitch",
        "yaw",
        "tilt",
        "rocker",
        "bogie",
        "steering",
        "contact_angle",
        "contact_point",
        "gap",
    )
    return (
        {"rover": pose.rover.name, "terrain": pose.terrain.name, "status": status.name, "meaning": MEANING[status][0]}
        | {name: getattr(pose, name) for name in (*names, "clearance")}
        | {"wheel_names": pose.rover.wheel_names}
    )


def _print_table(pose: Pose, status: Status, found: bool) -> None:
    console = Console()
    console.print(
        f"[bold]{escape(pose.rover.name)}[/] on [bold]{escape(pose.terrain.name)}[/]: {status.name}, {MEANING[status][0]}",
        highlight=False,
    )
    if not found:
        return
    table = Table(box=box.SIMPLE, show_header=False, padding=(0, 1))
    for _ in range(3):
        table.add_column()
        table.add_column(justify="right")
    angle = {name: f"{np.degrees(float(getattr(pose, name))):.3f}°" for name in ("roll", "pitch", "yaw", "tilt", "rocker")}
    left, right = np.degrees(pose.bogie)
    table.add_row("x", f"{float(pose.x):.3f} m", "roll", angle["roll"], "rocker", angle["rocker"])
    table.add_row("y", f"{float(pose.y):.3f} m", "pitch", angle["pitch"], "bogie left", f"{left:.3f}°")
    table.add_row("z", f"{float(pose.z):.4f} m", "yaw", angle["yaw"], "bogie right", f"{right:.3f}°")
    table.add_row("clearance", f"{float(pose.clearance):.3f} m", "tilt", angle["tilt"], "", "")
    console.print(table)
    wheels = Table(box=box.SIMPLE, padding=(0, 1))
    for head in ("wheel", "contact angle", "gap", "touches at x", "y", "z"):
        wheels.add_column(head, justify="left" if head == "wheel" else "right")
    for i, name in enumerate(pose.rover.wheel_names):
        gap = float(pose.gap[i])
        point = [f"{value:.3f}" for value in pose.contact_point[i]]
        wheels.add_row(
            name, f"{np.degrees(pose.contact_angle[i]):.3f}°", "0" if abs(gap) < 1e-6 else f"{1e3 * gap:.2f} mm", *point
        )
    console.print(wheels)
