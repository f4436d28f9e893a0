"""`rockerbogie bench`: the stopwatch, as ratios to the paper's own way timed in the same run."""

from __future__ import annotations

import json as json_text
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from .. import bench as stopwatch
from ..errors import RockerbogieError
from .common import Json, print_json, progress


def bench(
    *, poses: int = 20_000, baseline_poses: int = 20, save: Path | None = None, compare: Path | None = None, json: Json = False
) -> None:
    """Time settling beside the paper's fsolve in one run, and say how many times faster it is.

    Parameters
    ----------
    poses
        How many places each case settles.
    baseline_poses
        How many of them the paper's way is given.
    save
        Write the figures to this JSON file.
    compare
        A file saved by another version: its times beside these, in units of that run's own fsolve.
    json
        Print the figures as JSON instead of a table.
    """
    if poses < stopwatch.BATCH or baseline_poses < 1:
        raise RockerbogieError(f"--poses is {poses} and --baseline-poses {baseline_poses}; give at least {stopwatch.BATCH} and 1")
    before = _saved(compare) if compare else {}
    results = []
    with progress() as bar:
        task = bar.add_task("timing (the first run compiles)", total=None)
        for name, count, result in stopwatch.run(poses, baseline_poses):
            results.append(result)
            bar.update(task, total=count, advance=1, description=name)
    call, (jacobian, pinocchio) = stopwatch.single_call(), stopwatch.jacobians()
    figures = {
        "machine": stopwatch.machine(),
        "cases": stopwatch.as_json(results),
        "single_call_us": call,
        "jacobians_us": jacobian,
        "pinocchio_us": pinocchio,
    }
    if save:
        save.write_text(json_text.dumps(figures, indent=1) + "\n")
    if json:
        print_json(figures)
        return
    table = Table(
        box=box.SIMPLE_HEAD,
        caption="µs a pose: scattered places, along a path, on all threads; ×: fsolve's time over ours in this run",
    )
    table.add_column("case", no_wrap=True)
    for heading in ("settled", "µs", "path", f"{results[0].threads} thr", "× point", "× rim", *(["before"] if before else [])):
        table.add_column(heading, justify="right", no_wrap=True)
    for r in results:
        figures_of = (r.us, r.us_along, r.us_all_threads)
        old = [f"{before[r.name]:,.0f}" if r.name in before else "-"] if before else []
        ratios = (f"{r.ratios['point']:,.0f}", f"{r.ratios['rim']:,.0f}")
        table.add_row(r.name, f"{r.settled:.1%}", *(f"{value:.1f}" for value in figures_of), *ratios, *old)
    console = Console()
    console.print(table)
    console.print(f"one pose in one call from Python: {call:.0f} µs")
    beside = f", {pinocchio / jacobian:.0f} times faster than Pinocchio's {pinocchio:.2f} µs" if pinocchio else ""
    console.print(f"six wheel Jacobians in a batch: {jacobian:.2f} µs a pose{beside}")


def _saved(path: Path) -> dict[str, float]:
    """× rim of each case in a saved run."""
    try:
        return {case["name"]: float(case["ratios"]["rim"]) for case in json_text.loads(path.read_text())["cases"]}
    except FileNotFoundError:
        raise RockerbogieError(f"no file {path}: save one with `rockerbogie bench --save {path}`") from None
    except (ValueError, KeyError, TypeError):
        raise RockerbogieError(f"{path} was not written by `rockerbogie bench --save`") from None
