"""Command `rockerbogie settle`: one pose, as numbers and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

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
from ..settling.engines import Mode
from ..settling.pose import JOINTS, Pose
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
    make_folder,
    map_span,
    middle,
    parse_point,
    print_json,
    progress,
    save_netcdf,
)
from .pictures import Film, Format, Html, Pictures, Theme, checked_film, checked_page, write_page
from .rasters import Raster, load_terrain

#: Exit code if there is no pose: a result, not a wrong call.
EXIT_NO_POSE = 1


def settle(
    *,
    terrain: TerrainName,
    rover: RoverName = "elhami-dashti",
    at: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    yaw: float = 0.0,
    steering: str | None = None,
    mode: Mode = "contact",
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
    """Compute the pose of a rover at one position, and show it.

    Prints the numbers; with -o also writes a picture (pose.png) and the data (pose.nc). Exits 1 if there is no pose, 2 for
    wrong input, such as a position off the map.

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
    steering
        Angles of wheels that steer, degrees, left positive: LR=10,RR=12. The others stay at 0.
    mode
        contact: all six wheels in contact, joint limits not enforced. equilibrium: balance under the rover's weight; wheels may
        be off the ground, joints at their limits.
    linear
        Bilinear or smooth cubic terrain between the nodes. Default: cubic for files.
    output
        Folder for the picture and the data.
    film
        Write a film of one turn around the rover: .gif, or .mp4 (needs the film extra).
    html
        Write a page (.html) that shows the pose in three dimensions, offline in any browser.
    format
        Format of the picture: png; svg or pdf for print.
    theme
        Colours of picture and film: light or dark page.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of the table.
    """
    drawn = Pictures(format, theme)
    written = in_folder(output, "pose.nc", drawn.name("pose")) + checked_film(film) + checked_page(html)
    guard_outputs(written, terrain, rover, force=force)
    machine = load_rover(rover)
    ground = load_terrain(terrain, linear, raster)
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

        folder = make_folder(output)
        data = pose.to_xarray()
        save_netcdf(data, folder / "pose.nc")
        files.append(folder / "pose.nc")
        if found:
            files.append(drawn.save(pose_figure(machine, ground, data, f"{machine.name} on {ground.name}"), folder, "pose"))
    if found:
        files += _write_film(pose, film, theme) + write_page(pose, html, force)
    if json:
        print_json(_record(pose, status) | {"files": files})
    else:
        _print_table(pose, status, found)
        for file in files:
            print(file)
    return 0 if found else EXIT_NO_POSE


def _write_film(pose: Pose, film: Path | None, theme: Theme) -> list[Path]:
    """Write a film around a pose; return the file, or no file if `film` is None."""
    if film is None:
        return []
    from ..figures.film import write_turn

    make_folder(film.parent)
    with progress() as bar:
        task = bar.add_task("filming", total=None)

        def shown(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        return [write_turn(film, pose, theme=theme, progress=shown)]


def _steering(rover: Rover, text: str | None) -> NDArray[np.float64] | None:
    """Return the steering (6,), rad, of NAME=DEGREES pairs, or None."""
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


#: Fields of the JSON record; the first are those of every pose, the last those of a pose in equilibrium.
FIELDS = (
    *("x", "y", "z", "roll", "pitch", "yaw", "tilt", "rocker", "bogie", "steering"),
    *("contact_angle", "contact_point", "gap", "clearance", "joint_stop"),
)
FORCES = ("support", "belly_support", "wheel_lifted")


def _record(pose: Pose, status: Status) -> dict[str, Any]:
    """Return the JSON record of a pose.

    A wheel off the ground has a gap, but no contact angle and no contact point.
    """
    record: dict[str, Any] = {
        "rover": pose.rover.name,
        "terrain": pose.terrain.name,
        "status": status.name,
        "meaning": MEANING[status][0],
    }
    names = FIELDS if pose.report is None else FIELDS + FORCES
    record |= {name: np.array(getattr(pose, name)) for name in names}
    for name in ("contact_angle", "contact_point"):
        record[name][pose.wheel_lifted] = np.nan
    if pose.report is not None:
        record["support_share"] = _shares(pose)
    return record | {"joints": JOINTS, "wheel_names": pose.rover.wheel_names}


def _shares(pose: Pose) -> NDArray[np.float64]:
    """Return the share (7,) of the contact force of each wheel and of the body."""
    forces = np.append(pose.support, pose.belly_support)
    return np.asarray(forces / forces.sum())


def _print_table(pose: Pose, status: Status, found: bool) -> None:
    """Print the pose as tables."""
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
    console.print(_wheel_table(pose))
    for line in _limits_and_body(pose):
        console.print(line, highlight=False)


def _wheel_table(pose: Pose) -> Table:
    """Return the table of the wheels: contacts and, in equilibrium mode, contact forces."""
    forces = pose.report is not None
    wheels = Table(box=box.SIMPLE, padding=(0, 1))
    for heading in ("wheel", "contact angle", "gap", *(["force", "share"] if forces else []), "contact at x", "y", "z"):
        wheels.add_column(heading, justify="left" if heading == "wheel" else "right", no_wrap=heading == "contact at x")
    for i, name in enumerate(pose.rover.wheel_names):
        gap, lifted = float(pose.gap[i]), bool(pose.wheel_lifted[i])
        angle = f"{np.degrees(pose.contact_angle[i]):.3f}°"
        force = [f"{pose.support[i]:.1f} N", f"{100 * _shares(pose)[i]:.1f} %"] if forces else []
        contact = ["off the ground", "", ""] if lifted else [f"{value:.3f}" for value in pose.contact_point[i]]
        wheels.add_row(name, "–" if lifted else angle, "0" if abs(gap) < 1e-6 else f"{1e3 * gap:.2f} mm", *force, *contact)
    return wheels


def _limits_and_body(pose: Pose) -> list[str]:
    """Return a line for each joint at or beyond its limit, and one if the body carries weight."""
    limits = (pose.rover.rocker_limits, pose.rover.bogie_limits, pose.rover.bogie_limits)
    angles = (pose.rocker, *pose.bogie)
    where = "at" if pose.report is not None else "beyond"
    lines = []
    for joint, side, limit, angle in zip(JOINTS, pose.joint_stop.tolist(), limits, angles, strict=True):
        if side != 0:
            end, bound = ("high", limit[1]) if side > 0 else ("low", limit[0])
            lines.append(
                f"{joint.replace('_', ' ')} {where} its {end} limit of {np.degrees(bound):.3g}° ({np.degrees(float(angle)):.3f}°)"
            )
    if pose.report is not None and pose.belly_support > 0:
        lines.append(f"body on the terrain: {float(pose.belly_support):.1f} N, {100 * _shares(pose)[6]:.1f} %")
    return lines
