"""Command `rockerbogie benchmark mars`: predictions against attitudes recorded on Mars."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import cyclopts
import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from ..errors import RockerbogieError
from ..logs.benchmark import ENTERED, MarsBenchmark, benchmark_mars, data_files, write_benchmark_template
from .common import Folder, Force, Json, Whole, guard_outputs, in_folder, make_folder, print_json, progress

app = cyclopts.App(name="benchmark", help="Score predictions against what rovers recorded on Mars.")
#: Columns of the printed table -> their heads.
PRINTED = {"RMS": "RMS", "bias": "bias", "median error": "median", "correlation": "correlation", "in 80 % band": "% in band"}
FILES = tuple(f"mars.{kind}" for kind in ("html", "png", "csv"))


@app.command
def mars(
    *,
    data: Path | None = None,
    predictions: Path | None = None,
    write_template: Path | None = None,
    draws: Whole = 400,
    seed: Whole = 0,
    output: Folder = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Score predicted pitch and roll against recorded ones: package, plane, another program.

    The sets are 17 positions of Curiosity, and 9 positions and two drives of Perseverance. Prints RMS, bias, median error,
    correlation, share of values in the 80 % band and interval score. With -o it writes mars.html (one page), mars.png and
    mars.csv (all cases). docs/benchmark.md lists the data and their sources; they are not part of the package.

    Parameters
    ----------
    data
        Folder with gale/ and perseverance/. Default: the environment variable ROCKERBOGIE_DATA.
    predictions
        CSV of another program's predictions, with the columns of --write-template. They are scored in the same way.
    write_template
        Write the cases (rover, terrain, x, y, yaw) to this CSV, without the logged attitudes, and exit.
    draws
        Random terrains per case; 0: no bands.
    seed
        Seed of the draws.
    output
        Folder for page, picture and table.
    force
        Replace existing output files that rockerbogie did not write. Inputs are never replaced.
    json
        Print JSON (SI units, radians) instead of the table.
    """
    if write_template is not None:
        if predictions is not None or output is not None:
            raise RockerbogieError("--write-template only writes the cases: give --predictions and -o in a second call")
        guard_outputs([write_template], *data_files(data), force=force)
        make_folder(write_template.parent)
        print(write_benchmark_template(write_template, data, force=force))
        return
    guard_outputs(in_folder(output, *FILES), predictions, *data_files(data), force=force)
    with progress() as bar:
        task = bar.add_task("settling on drawn terrains", total=None)
        result = benchmark_mars(
            data, predictions, draws=draws, seed=seed, progress=lambda done, total: bar.update(task, completed=done, total=total)
        )
        bar.update(task, description="drawing")
        files = _write(result, output)
    if json:
        print_json(_record(result) | {"files": files})
        return
    _print(result)
    for file in files:
        print(file)


def _write(result: MarsBenchmark, output: Path | None) -> list[Path]:
    """Write page, picture and table to a folder; return the files, none without a folder."""
    if output is None:
        return []
    from ..figures.benchmark import benchmark_figure, write_page
    from ..figures.style import save

    page, picture, table = in_folder(make_folder(output), *FILES)
    save(benchmark_figure(result), picture)
    write_page(page, picture, result)
    with open(table, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        keys = ("predicted", "low", "high")
        writer.writerow(["case", "channel", "logged [deg]", *(f"{by} {key} [deg]" for by in result.contenders for key in keys)])
        for case in result.cases["case"].to_numpy():
            for channel in result.cases["channel"].to_numpy():
                one = result.cases.sel(case=case, channel=channel)
                values = [one["logged"], *(one[key].sel(contender=by) for by in result.contenders for key in keys)]
                writer.writerow([case, channel, *("" if np.isnan(v) else f"{np.degrees(float(v)):.4f}" for v in values)])
    return [page, picture, table]


def _record(result: MarsBenchmark) -> dict[str, Any]:
    """Return the record for JSON: attributes of the cases, `scores`, `not_scored`.

    `scores` is nested: set, contender, then `cases` (their number) or a score and its channels.
    """
    scores = result.scores
    channels = [str(c) for c in scores["channel"].to_numpy()]
    found: dict[str, Any] = {}
    for name in scores["set"].to_numpy():
        for by in result.contenders:
            s = scores.sel(set=name, contender=by)
            values = {
                str(key): dict(zip(channels, s[key].to_numpy().tolist(), strict=True)) for key in s.data_vars if key != "count"
            }
            found.setdefault(str(name), {})[by] = {"cases": int(s["count"]), **values}
    return {**result.cases.attrs, "scores": found, "not_scored": result.absent}


def _print(result: MarsBenchmark) -> None:
    """Print the scores, one table per set; the page has the interval scores too."""
    from ..figures.benchmark import TITLES, score_rows

    console = Console(highlight=False, soft_wrap=True)
    console.print("pitch / roll in degrees: predicted minus logged; 80 % bands were fitted on other positions", markup=False)
    rows = score_rows(result)
    for title in dict.fromkeys(row["set"] for row in rows):
        these = [row for row in rows if row["set"] == title]
        table = Table(box=box.SIMPLE, padding=(0, 0), pad_edge=False, show_edge=False)
        for head in ("", *PRINTED.values()):
            table.add_column(head, no_wrap=True, justify="left" if not head else "right")
        for row in these:
            table.add_row(row["by"], *(row[head] for head in PRINTED))
        console.print(f"\n[bold]{title}[/], {these[0]['cases'].partition(' of ')[2]} cases")
        console.print(table)
        for row in these:
            if row["by"] == ENTERED:
                console.print(
                    f"entered predicts {row['cases']} cases, on which rockerbogie has {row['of rockerbogie there']} RMS"
                )
    for name, reason in result.absent.items():
        console.print(f"not scored: {TITLES[name]}: {reason}", markup=False)
