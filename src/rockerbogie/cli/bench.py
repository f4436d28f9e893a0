"""Command `rockerbogie bench`: times, as ratios to baselines timed in the same run."""

from __future__ import annotations

import json as json_text
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from .. import bench as stopwatch
from ..bench.tables import tables
from ..errors import RockerbogieError
from ..files.outputs import SOURCE
from .common import Force, Json, Whole, guard_outputs, make_folder, print_json, progress
from .rasters import Raster, load_terrain

#: Lines of a page between which the tables are written.
MARK, END = "<!-- bench -->", "<!-- end of bench -->"


def bench(
    *,
    poses: Whole = 10_000,
    baseline_poses: Whole = 20,
    drops: Whole = 2,
    terrain: str | None = None,
    raster: Raster = None,
    slowest: bool = False,
    save: Path | None = None,
    compare: Path | None = None,
    json: Json = False,
    markdown: Path | None = None,
    force: Force = False,
) -> None:
    """Time settling and Jacobians, as ratios to fsolve, MuJoCo and Pinocchio in the same run.

    Parameters
    ----------
    poses
        Number of poses per case.
    baseline_poses
        Number of these poses that the paper's method (fsolve) settles.
    drops
        Number of these poses that MuJoCo settles.
    terrain
        Raster file for one more case: Curiosity's whole treads with linear interpolation.
    slowest
        Also time each pose separately on every kind of terrain, and list the slowest. This takes some minutes more.
    save
        JSON file to write the results to.
    compare
        File that --save wrote with another version: its ratios are added as columns.
    json
        Print the results as JSON instead of tables.
    markdown
        Also write the tables into this Markdown page, between its lines `<!-- bench -->` and `<!-- end of bench -->`.
    force
        Replace an existing file of --save that rockerbogie did not write. Inputs are never replaced.
    """
    if poses < stopwatch.GROUP or baseline_poses < 1 or drops < 1:
        raise RockerbogieError(
            f"--poses is {poses}, --baseline-poses {baseline_poses} and --drops {drops}; give at least {stopwatch.GROUP}, 1 and 1"
        )
    guard_outputs([save] if save else [], terrain, compare, markdown, force=force)
    ground = None if terrain is None else load_terrain(terrain, True, raster)
    before = _saved(compare) if compare else {}
    page = _page(markdown) if markdown else None
    figures: dict[str, Any] = {}
    with progress() as bar:
        task = bar.add_task("timing (the first run compiles)", total=None)
        for name, count, done in stopwatch.figures(poses, baseline_poses, drops, ground, slowest=slowest):
            figures = done
            bar.update(task, total=count, advance=1, description=name)
    if save:
        make_folder(save.parent)
        save.write_text(json_text.dumps({"source": SOURCE} | figures, indent=1) + "\n")
    every = tables(figures, before)
    if markdown and page:
        markdown.write_text("\n\n".join([page[0], _machine(figures["machine"]), *(made.markdown() for made in every), page[1]]))
    if json:
        print_json(figures)
        return
    console = Console()
    for made in every:
        console.print(made.caption)
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
        table.add_column(made.headings[0], no_wrap=True)
        for heading in made.headings[1:]:
            table.add_column(heading, justify="right", no_wrap=True)
        for row in made.rows:
            table.add_row(*row)
        console.print(table)


def _saved(path: Path) -> dict[str, float]:
    """Return case → ratio to fsolve with a fine rim, and name of a wait → ratio, of a saved run."""
    try:
        saved = json_text.loads(path.read_text())
        ratios, found = {case["name"]: float(case["ratios"]["rim"]) for case in saved["cases"]}, int(saved["schema"])
        ratios |= {row["name"]: float(row["ratio"]) for row in saved.get("waits", [])}
    except FileNotFoundError:
        raise RockerbogieError(f"no file {path}: save one with `rockerbogie bench --save {path}`") from None
    except (ValueError, KeyError, TypeError):
        raise RockerbogieError(f"{path} was not written by `rockerbogie bench --save`") from None
    if found != stopwatch.SCHEMA:  # its names have another meaning
        raise RockerbogieError(f"{path} has schema {found}, this version compares schema {stopwatch.SCHEMA} only: save it again")
    return ratios


def _page(path: Path) -> tuple[str, str]:
    """Return a page's text up to MARK and from END on."""
    try:
        head, _, rest = path.read_text().partition(MARK)
    except FileNotFoundError:
        raise RockerbogieError(f"no page {path}: give an existing Markdown page to --markdown") from None
    if END not in rest:
        raise RockerbogieError(f"{path} has no lines {MARK} and {END}: add them where the tables belong")
    return head + MARK, END + rest.partition(END)[2]


def _machine(machine: dict[str, Any]) -> str:
    """Return a sentence with machine and versions."""
    return (
        f"rockerbogie {machine['version']} on {machine['machine']} with {machine['cores']} cores; Python {machine['python']}, "
        f"numba {machine['numba']}, numpy {machine['numpy']}."
    )
