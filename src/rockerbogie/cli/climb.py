"""Command `rockerbogie climb`: drive over an obstacle, or limits of a rover."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..errors import RockerbogieError
from ..files.tables import read_columns
from ..rover.formats import load_rover
from ..statics import obstacles
from ..statics.climb import REASONS, Climb, ClimbLaw
from ..statics.climb import climb as climb_over
from ..statics.climb_limits import ClimbLimits, limits_of
from ..statics.obstacles import Profile
from .common import Force, Json, guard_outputs, make_folder, parse_gravity, print_json, progress
from .pictures import Film, Html, checked_page, write_page

#: Exit code if the rover does not get over: a result, not a wrong call.
EXIT_NOT_CLIMBED = 1
PICTURES, FILMS = (".png", ".svg", ".pdf"), (".gif", ".mp4")


def climb(
    rover: str,
    /,
    *,
    step: float | None = None,
    ditch: str | None = None,
    ramp: str | None = None,
    stairs: str | None = None,
    profile: Path | None = None,
    friction: float = 0.7,
    torque: float | None = None,
    backward: Annotated[bool, Parameter(name="--backward", negative="")] = False,
    law: ClimbLaw = "least_friction",
    gravity: str = "earth",
    plot: Path | None = None,
    chart: Path | None = None,
    film: Film = None,
    html: Html = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Drive a rover over an obstacle, and print the friction and torque that it needs.

    The motion is quasi-static: momentum does not help.

    Without an obstacle, the command prints the rover's limits: steepest slopes, highest step, widest ditch.
    Exits 1 if the rover does not get over, 2 for wrong input.

    Parameters
    ----------
    rover
        Name of a preset, or a rover file.
    step
        Height of a step with a vertical face, m.
    ditch
        Width of a ditch with vertical walls, m, or WIDTH,DEPTH. Default: as deep as wide.
    ramp
        Slope in degrees and height in m of a ramp: 25,0.5.
    stairs
        Rise and run of stairs, m, and their number (default 5): 0.2,0.3 or 0.2,0.3,4.
    profile
        CSV file with columns x [m], z [m]: a polyline; x never decreases.
    friction
        Coefficient of friction between wheels and terrain.
    torque
        Largest torque of a hub motor, N m; inf for no limit. Default: that of the rover, if it states one.
    backward
        Drive backward.
    law
        least_friction: the distribution of torques that needs the least friction. equal_slip: all wheels use the same share
        of friction, as wheels driven at one rate do.
    gravity
        earth, mars, moon, or a number in m/s².
    plot
        Picture of the hardest station with forces, friction and torque along the way: .png, .svg or .pdf.
    chart
        Picture of the required friction against step height, forward and backward.
    film
        Film of the climb: .gif, or .mp4 (needs the film extra).
    html
        Page (.html) that replays the climb offline in any browser, with plots.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of text.
    """
    for option, file, endings in (("--plot", plot, PICTURES), ("--chart", chart, PICTURES), ("--film", film, FILMS)):
        if file is not None and file.suffix.lower() not in endings:
            raise RockerbogieError(f"{option} {str(file)!r}: end its name in {', '.join(endings)}")
    written = [file for file in (plot, chart, film) if file is not None] + checked_page(html)
    guard_outputs(written, rover, profile, force=force)
    field = parse_gravity(gravity)
    machine = load_rover(rover)
    obstacle = _obstacle(step, ditch, ramp, stairs, profile)
    if obstacle is None and (plot is not None or film is not None or html is not None):
        raise RockerbogieError("--plot, --film and --html show a climb: give an obstacle, such as --step 0.2")
    files = []
    if chart is not None:
        from ..figures.climbing import step_chart
        from ..figures.style import save

        make_folder(chart.parent)
        files.append(save(step_chart(machine, friction), chart))
    if obstacle is None:
        limits = limits_of(machine, friction=friction, torque=torque, gravity=field)
        if json:
            print_json({**vars(limits), "files": files})
        else:
            _print_limits(limits)
            _print_files(files)
        return 0
    run = climb_over(
        machine,
        obstacle,
        friction=friction,
        torque=torque,
        direction="backward" if backward else "forward",
        law=law,
        gravity=field,
    )
    if plot is not None:
        from ..figures.climbing import climb_figure
        from ..figures.style import save

        make_folder(plot.parent)
        files.append(save(climb_figure(run), plot))
    if film is not None:
        from ..figures.climbing import write_climb_film

        make_folder(film.parent)
        with progress() as bar:
            task = bar.add_task("filming", total=None)
            files.append(write_climb_film(film, run, progress=lambda done, total: bar.update(task, completed=done, total=total)))
    files += write_page(run, html, force)
    if json:
        print_json(_record(run) | {"files": files})
    else:
        _print_climb(run)
        _print_files(files)
    return 0 if run.climbed else EXIT_NOT_CLIMBED


def _obstacle(
    step: float | None, ditch: str | None, ramp: str | None, stairs: str | None, profile: Path | None
) -> Profile | None:
    """Return the obstacle of the options, or None if no option names one."""
    given = [
        name
        for name, value in zip(("step", "ditch", "ramp", "stairs", "profile"), (step, ditch, ramp, stairs, profile), strict=True)
        if value is not None
    ]
    if len(given) > 1:
        raise RockerbogieError(f"give one obstacle, not {' and '.join('--' + name for name in given)}")
    if step is not None:
        return obstacles.step(step)
    if ditch is not None:
        width, depth = _numbers("--ditch", ditch, "WIDTH or WIDTH,DEPTH in m", 1, 2)
        return obstacles.ditch(width, width if depth is None else depth)
    if ramp is not None:
        angle, height = _numbers("--ramp", ramp, "DEGREES,HEIGHT, such as 25,0.5", 2, 2)
        return obstacles.ramp(float(np.radians(angle)), height)
    if stairs is not None:
        rise, run, count = _numbers("--stairs", stairs, "RISE,RUN or RISE,RUN,COUNT, such as 0.2,0.3,4", 2, 3)
        number = 5 if count is None else int(count) if count == int(count) else count
        return obstacles.stairs(rise, run, number)
    if profile is not None:
        table = read_columns(profile)
        missing = {"x", "z"} - set(table)
        if missing:
            raise RockerbogieError(
                f"{str(profile)!r} has no column {' and '.join(sorted(missing))}: a profile has columns x [m] and z [m]"
            )
        return obstacles.profile(table["x"], table["z"], profile.stem)
    return None


def _numbers(option: str, text: str, form: str, least: int, most: int) -> list[Any]:
    """Return the numbers of an option, with None for those left out."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not (least <= len(values) <= most and np.isfinite(values).all()):
        raise RockerbogieError(f"{option} {text!r} is not {form}")
    return [*values, *[None] * (most - len(values))]


def _record(run: Climb) -> dict[str, Any]:
    """Return the JSON record of a climb."""
    data = run.to_dataset()
    record = {name: value for name, value in data.attrs.items() if name != "source"}
    record["climbed"] = run.climbed
    record["friction_needed"] = run.friction_needed
    record["torque_needed"] = float(run.required_torque[run.uphill].max(initial=0.0))
    record["wheels"] = run.wheels
    record["wheel_names"] = run.rover.wheel_names
    return record | {str(name): data[name].to_numpy() for name in data.data_vars}


def _print_climb(run: Climb) -> None:
    """Print the verdict, and the hardest station of each axle."""
    console = Console()
    back = ", backward" if run.direction == "backward" else ""
    console.print(
        f"[bold]{escape(run.rover.name)}[/] over [bold]{escape(run.profile.name)}[/]{back}, friction {run.friction:g}",
        highlight=False,
    )
    console.print(escape(run.verdict), style="green" if run.climbed else "red", highlight=False)
    k = run.station if run.limit else run.hardest
    table = Table(
        box=box.SIMPLE,
        padding=(0, 1),
        title=f"{'where it ends' if run.limit else 'the hardest station'}, after {run.distance[k]:.3f} m",
        title_justify="left",
    )
    for heading in ("wheels", "contact", "normal", "traction", "friction used", "torque"):
        table.add_column(heading, justify="left" if heading == "wheels" else "right")
    for i in range(0, 6, 2):
        n = run.contact_normal[k, i]
        used = run.friction_used[k, i]
        table.add_row(
            " ".join(run.rover.wheel_names[i : i + 2]), f"{np.degrees(np.arctan2(-n[0], n[1])):.1f}°",
            f"{run.normal[k, i]:.1f} N", f"{run.traction[k, i]:+.1f} N",
            "–" if np.isnan(used) else f"{used:.3f}", f"{run.torque[k, i]:+.2f} N m",
        )  # fmt: skip
    console.print(table)
    if run.slides.any():
        console.print(f"the rover slides downhill at {int(run.slides.sum())} of {run.slides.size} stations", highlight=False)


def _print_limits(limits: ClimbLimits) -> None:
    """Print the limits of a rover as a table."""
    console = Console()
    torque = "" if np.isinf(limits.torque_limit) else f", motor torque {limits.torque_limit:g} N m"
    console.print(f"[bold]{escape(limits.rover)}[/], friction {limits.friction:g}{torque}", highlight=False)
    table = Table(box=box.SIMPLE, padding=(0, 1))
    for heading in ("limit", "value", "", "because"):
        table.add_column(heading, justify="right" if heading in ("value", "") else "left")
    for name in ("slope_up", "slope_down", "slope_across"):
        table.add_row(name.replace("_", " "), f"{np.degrees(getattr(limits, name)):.1f}°", "", _because(limits.why[name]))
    for name in ("step_forward", "step_backward", "ditch_forward", "ditch_backward"):
        size = getattr(limits, name)
        table.add_row(name.replace("_", " "), f"{size:.3f} m", f"{size / limits.wheel_radius:.2f} r", _because(limits.why[name]))
    console.print(table)
    console.print(
        f"motor torque at the steepest slope up {limits.slope_torque:.3g} N m, at the highest step {limits.step_torque:.3g} N m",
        highlight=False,
    )


def _because(reason: str) -> str:
    """Return the reason for a limit as text."""
    return "larger ones were not tried" if reason == "size" else REASONS[reason]


def _print_files(files: list[Path]) -> None:
    """Print the names of the files, one a line."""
    for file in files:
        print(file)
