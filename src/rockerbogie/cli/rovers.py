"""Command `rockerbogie rovers`: list, show, write and import rovers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import cyclopts
import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.table import Table

from ..errors import RockerbogieError
from ..files.outputs import SOURCE
from ..rover.formats import LABELS, import_rover, load_rover, presets, read_details, schema, to_toml
from ..rover.frames import DHRow, dh_table
from ..rover.model import IDEAL_DIFFERENTIAL, Rover
from .common import Force, Json, guard_outputs, make_folder, print_json

app = cyclopts.App(name="rovers", help="List rovers, show one with its dimensions, start a rover file, import a robot file.")

#: Friction coefficient of the climb limits shown.
CLIMB_FRICTION = 0.7
#: Limits shown, fields of `ClimbLimits`.
LIMITS = (
    "slope_up", "slope_down", "slope_across", "step_forward", "step_backward", "ditch_forward", "ditch_backward",
    "slope_torque", "step_torque",
)  # fmt: skip

Picture = Annotated[Path | None, Parameter(name=["--output", "-o"])]


@app.default
def show(name: str | None = None, /, *, output: Picture = None, force: Force = False, json: Json = False) -> None:
    """List the rovers, or show one.

    It shows dimensions, the Denavit-Hartenberg table (K1 to K11), loads and tip margin on level terrain and the obstacles that
    the rover climbs at friction 0.7. With -o it also writes the drawing.

    Parameters
    ----------
    name
        A preset's name, or a rover file. Default: list the presets.
    output
        Picture to write (.png, .svg or .pdf): a drawing with dimensions.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of tables.
    """
    if name is None:
        if output is not None:
            raise RockerbogieError("-o draws one rover: give its name, as in: rockerbogie rovers curiosity -o curiosity.png")
        _list(json)
        return
    if output is not None:
        _check_ending(output, (".png", ".svg", ".pdf"))
        guard_outputs([output], name, force=force)
    rover = load_rover(name)
    details = read_details(name)
    if json:
        print_json(_record(rover) | details | _statics(rover))
    else:
        _print_rover(rover, details)
        _print_statics(rover, _statics(rover))
    if output is not None:
        from ..figures.blueprint import blueprint
        from ..figures.style import save

        _write(output, lambda: save(blueprint(rover, details.get("title", "")), output))
        if not json:
            print(output)


@app.command
def new(file: Path, /, *, like: str = "curiosity", force: Force = False) -> None:
    """Write a new rover file, with a comment on every key.

    Parameters
    ----------
    file
        The file to write, ending in .toml.
    like
        Rover whose numbers the file starts with: a preset's name, or a rover file.
    force
        Replace an existing rover file. Inputs are never replaced.
    """
    _check_ending(file, (".toml",))
    guard_outputs([file], like, force=force)
    rover = load_rover(like)
    if like in presets():
        rover = rover.replace(name=file.stem, source=f"started from the preset {like}: put your own source here")
    _write(file, lambda: file.write_text(to_toml(rover, options=True), encoding="utf-8"))
    print(f"{file}: change the numbers, then `rockerbogie rovers {file}`")
    print("Its first line names a schema for your editor: `rockerbogie rovers schema rover.schema.json` puts that beside it.")


@app.command(name="import")
def import_(
    file: Path,
    /,
    *,
    output: Picture = None,
    scale: float = 1.0,
    forward: str | None = None,
    up: str | None = None,
    joint: Annotated[list[str] | None, Parameter(name="--joint", negative="")] = None,
    set_: Annotated[list[str] | None, Parameter(name="--set", negative="")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Import a URDF, SDF or MJCF file, and write the rover as TOML.

    The report lists what was found, guessed, repaired and dropped, and warnings.

    Parameters
    ----------
    file
        Robot file. Expand xacro first. Meshes are read from files in its folder (needs the robots extra).
    output
        The .toml file to write.
    scale
        Metres in the file's unit of length: 0.001 for millimetres.
    forward
        Override the forward direction: an axis of the file's root frame, x, -x, y, -y, z or -z.
    up
        Override the upward direction: an axis of the file's root frame.
    joint
        Override the roles of joints, by name: wheels=A,B,C,D,E,F or bogies=A,B or rockers=A,B or steering=A,B,...
    set_
        Override a number, by its key in a rover file: wheels.radius_m=0.075, stops.bogie_deg=[-30,30], mass.total_kg=12, ...
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON instead of text.
    """
    from ..rover.formats.import_overrides import parse_joints, parse_numbers

    if output is not None:
        _check_ending(output, (".toml",))
        guard_outputs([output], file, force=force)
    result = import_rover(
        file, scale=scale, forward=forward, up=up, joints=parse_joints(joint or []), **parse_numbers(set_ or [])
    )
    if output is not None:
        _write(output, lambda: output.write_text(to_toml(result.rover), encoding="utf-8"))
    if json:
        print_json(_record(result.rover) | {key: getattr(result, key) for key in LABELS})
    else:
        print(result)
        if output is not None:
            print(output)


@app.command(name="schema")
def schema_(file: Path | None = None, /, *, force: Force = False) -> None:
    """Print or write the JSON schema of rover files.

    Editors use it to check a file while you write it.

    Parameters
    ----------
    file
        File to write. Default: print the schema.
    force
        Replace an existing file that rockerbogie did not write.
    """
    import json

    if file is not None:
        guard_outputs([file], force=force)

    text = json.dumps({"$comment": SOURCE} | schema(), indent=2) + "\n"
    if file is None:
        print(text, end="")
    else:
        _write(file, lambda: file.write_text(text, encoding="utf-8"))


def _check_ending(file: Path, endings: tuple[str, ...]) -> None:
    """Raise an error if a file's name has none of the endings."""
    if file.suffix.lower() not in endings:
        raise RockerbogieError(f"{str(file)!r} should end in {' or '.join(endings)}")


def _write(file: Path, write: Any) -> None:
    """Make the file's folder and call `write`; raise one sentence if the file cannot be written."""
    make_folder(file.parent)
    try:
        write()
    except OSError as error:
        raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None


def _list(as_json: bool) -> None:
    """Print the presets as a table or as JSON."""
    rows = {name: (load_rover(name), read_details(name)) for name in presets()}
    if as_json:
        print_json({name: _record(rover) | details for name, (rover, details) in rows.items()})
        return
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in ("rover", "title", "wheelbase", "wheels", "mass", "grade"):
        table.add_column(column, justify="right" if column in ("wheelbase", "wheels", "mass") else "left", no_wrap=True)
    for name, (rover, details) in rows.items():
        size, mass = f"{rover.wheelbase:.3f} m", f"{rover.mass:.4g} kg"
        table.add_row(name, details["title"], size, f"{2e3 * rover.wheel_radius.max():.0f} mm", mass, details["grade"])
    Console().print(table)
    print(
        "\n`rockerbogie rovers NAME` shows one. Grade A: the maker's own numbers; B: an independent model's; C: partly estimated."
    )


def _record(rover: Rover) -> dict[str, Any]:
    """Return name, dimensions, limits, mass and source of a rover, in SI units."""
    names = (
        "name", "rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "wheel_names", "steers", "steering_offset",
        "rocker_limits", "bogie_limits", "differential", "body_box", "mass", "source",
    )  # fmt: skip
    return {name: getattr(rover, name) for name in names}


def _print_rover(rover: Rover, details: dict[str, str]) -> None:
    """Print a rover's dimensions and its Denavit-Hartenberg table."""
    console = Console()
    console.print(f"[bold]{rover.name}[/]  {details.get('title', '')}", highlight=False)
    for label, text in (("source", rover.source), ("grade", details.get("grade", ""))):
        if text:
            console.print(f"{label}: {text}", highlight=False)
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for column in ("", "x m", "y m", "z m", "radius m", "width m", "steers"):
        table.add_column(column, justify="right" if column not in ("", "steers") else "left")
    for label, points in (("rocker pivot", rover.rocker_pivot), ("bogie pivot", rover.bogie_pivot)):
        for side, point in zip(("left", "right"), points, strict=True):
            table.add_row(f"{label} {side}", *(f"{v:.5g}" for v in point))
    for i, name in enumerate(rover.wheel_names):
        size = (rover.wheel_radius[i], rover.wheel_width[i])
        table.add_row(f"hub {name}", *(f"{v:.5g}" for v in (*rover.hubs[i], *size)), "yes" if rover.steers[i] else "")
    console.print(table)
    limits = " · ".join(
        f"{joint} {_limits(limits)}" for joint, limits in (("rocker", rover.rocker_limits), ("bogie", rover.bogie_limits))
    )
    print(f"mass {rover.mass:.4g} kg · joint limits: {limits} · differential: {_differential(rover)}\n")
    print("Denavit-Hartenberg table (Elhami & Dashti, Table I; ρ, β, ψ are the joints' angles)")
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for column in ("frame", "on", "θ °", "d m", "a m", "α °"):
        table.add_column(column, justify="left" if column in ("frame", "on") else "right")
    for row in dh_table(rover):
        table.add_row(row.frame, row.parent, _theta(rover, row), f"{row.d:.5g}", f"{row.a:.5g}", f"{np.degrees(row.alpha):.5g}")
    console.print(table)


def _statics(rover: Rover) -> dict[str, Any]:
    """Return loads, tip margin and climb limits; empty if the rover cannot stand on a plane."""
    from ..settling.settle import settle
    from ..settling.status import Status
    from ..statics.climb_limits import limits_of
    from ..statics.loads import LoadStatus, wheel_loads
    from ..statics.stability import stability
    from ..terrain import surfaces

    pose = settle(rover, surfaces.plane(size=4.0 * rover.wheelbase), 0.0, 0.0)
    if not rover.mass > 0.0 or pose.status != Status.CONVERGED:
        return {}
    loads, tip = wheel_loads(pose, law="vertical"), stability(pose)
    if loads.status != LoadStatus.BALANCED:
        return {}
    limits = limits_of(rover, friction=CLIMB_FRICTION)
    return {
        "load_share": loads.normal / (rover.mass * pose.gravity),
        "tip_margin": float(tip.tip_margin),
        "tip_direction": float(tip.direction),
        "climb_limits": {name: getattr(limits, name) for name in LIMITS} | {"friction": CLIMB_FRICTION},
    }


def _print_statics(rover: Rover, found: dict[str, Any]) -> None:
    """Print loads, tip margin and climb limits as sentences."""
    if not found:
        return
    shares = " · ".join(f"{name} {100 * share:.1f} %" for name, share in zip(rover.wheel_names, found["load_share"], strict=True))
    print(f"\nlevel terrain: load {shares}")
    if np.isfinite(found["tip_direction"]):
        print(
            f"tip margin {np.degrees(found['tip_margin']):.1f}°, towards {round(np.degrees(found['tip_direction']))}° from ahead"
        )
    limits = found["climb_limits"]
    slopes = " · ".join(f"{way} {np.degrees(limits[f'slope_{way}']):.1f}°" for way in ("up", "down", "across"))
    both = " · ".join(
        f"{what} {limits[f'{what}_forward']:.3g} m forward, {limits[f'{what}_backward']:.3g} m backward"
        for what in ("step", "ditch")
    )
    print(f"at friction {CLIMB_FRICTION}: slopes {slopes} · {both} (rockerbogie climb {rover.name})")


def _theta(rover: Rover, row: DHRow) -> str:
    """Return θ in the paper's form: a constant and the joint's angle.

    The right rocker's is minus the left one's for the ideal differential.
    """
    joint, _, which = row.joint.partition("_")
    sign, angle = "", ""
    if joint == "rocker":
        mirrored = which == "right" and np.array_equal(rover.differential, IDEAL_DIFFERENTIAL)
        sign, angle = ("-", "ρ") if mirrored else ("", "ρ" if which == "left" else "ρ right")
    elif joint == "bogie":
        angle = "β1" if which == "left" else "β2"
    elif joint == "steering" and rover.steers[int(which)]:
        angle = f"ψ{int(which) + 1}"
    constant = float(np.degrees(row.theta))
    if not angle:
        return f"{constant + 0.0:.5g}"
    if abs(constant) < 1e-9:
        return sign + angle
    return f"{constant:.5g} {sign or '+'} {angle}"


def _limits(limits: Any) -> str:
    """Return joint limits (2,) as text, degrees."""
    low, high = np.degrees(limits)
    if np.isinf(low) and np.isinf(high):
        return "none"
    return " to ".join("none" if np.isinf(v) else f"{v:.4g}°" for v in (low, high))


def _differential(rover: Rover) -> str:
    """Return a rover's differential as text.

    It is ideal, a ratio, or a bar with its deviation from a ratio.
    """
    slope = rover.differential[1]
    if rover.differential[2:].any():
        low, high = (float(v) for v in np.clip(rover.rocker_limits, -0.5, 0.5))
        reach = np.linspace(low, high, 101)
        off = np.degrees(np.abs(rover.right_rocker(reach) - slope * reach).max())
        return f"a bar, right ≈ {slope:.4g} left, up to {off:.2g}° off that within {np.degrees(reach[-1]):.0f}°"
    return "ideal, right = -left" if slope == -1 else f"right = {slope:.6g} left"
