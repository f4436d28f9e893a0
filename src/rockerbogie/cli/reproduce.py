"""Command `rockerbogie reproduce`: section III of the paper."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.table import Table

from ..bench.paper.report import ErrorRow
from ..bench.paper.reproduce import OUTPUTS, ROVER
from ..bench.paper.reproduce import reproduce as reproduce_paper
from ..rover.formats import load_rover
from .common import Force, Json, RoverName, guard_outputs, in_folder, make_folder, print_json, progress

#: Exit code if the model exceeds a limit of its error against the simulation.
EXIT_NOT_CLOSE = 1


def reproduce(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    rover: RoverName = ROVER,
    force: Force = False,
    json: Json = False,
) -> int:
    """Reproduce section III of the paper: figures, data, animation, report.

    The rover crosses the paper's two hills by the kinematic model and in a MuJoCo simulation. The command writes figures 6 to
    9 (PNG), crossing.gif, both runs (NetCDF and CSV) and report.html. The report contains all of them, the errors, and a check
    of each statement of the paper. Exits 1 if an error exceeds its limit.

    Parameters
    ----------
    output
        Folder for the files.
    rover
        Another rover to cross the bumps: a preset's name, or a rover file with your own constants (`rockerbogie rovers new`
        writes one; `rockerbogie rovers NAME` prints the Denavit-Hartenberg table, the paper's Table I). Bumps, path and speed
        are scaled to its size; the paper's statements and limits are left out.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print errors and statements as JSON instead of tables.
    """
    guard_outputs(in_folder(output, *OUTPUTS), rover, force=force)
    machine = None if rover == ROVER else load_rover(rover)
    folder = make_folder(output)
    began = time.perf_counter()
    with progress() as bar:
        task = bar.add_task("starting", total=1.0)
        made = reproduce_paper(folder, lambda what, share: bar.update(task, description=what, completed=share), rover=machine)
    if json:
        print_json(
            {
                "report": made.report,
                "errors": [vars(row) | {"within": row.within} for row in made.errors],
                "claims": [{"model": vars(model), "simulation": vars(simulated)} for model, simulated in made.claims],
            }
        )
    else:
        console = Console(highlight=False)
        _print_errors(console, made.errors)
        for model, simulated in made.claims:
            verdict = ["true" if claim.holds else "not true" for claim in (model, simulated)]
            console.print(f"figure {model.figure}: {model.says} [bold]{verdict[0]}[/] (simulation: {verdict[1]})")
        print(f"{made.report} after {time.perf_counter() - began:.0f} s")
    return 0 if made.close else EXIT_NOT_CLOSE


def _print_errors(console: Console, errors: list[ErrorRow]) -> None:
    """Print the errors of the model against the simulation, one row per channel."""
    table = Table(box=box.SIMPLE, padding=(0, 1), title="model against simulation, at equal x, y, yaw", title_justify="left")
    for head in ("", "RMS", "limit", "worst", "limit", "", ""):
        table.add_column(head, justify="right" if head else "left")
    for row in errors:
        limits = ["" if limit is None else f"{limit:g}" for limit in (row.rms_limit, row.worst_limit)]
        verdict = "" if row.rms_limit is None else "within" if row.within else "[bold]beyond[/]"
        table.add_row(row.channel, f"{row.rms:.4f}", limits[0], f"{row.worst:.4f}", limits[1], row.unit, verdict)
    console.print(table)
