"""Times that users wait for: single poses, equilibrium, clearance, maps, processes."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from statistics import median
from time import perf_counter

import numpy as np

from .._kernels.jit.parallel import threads
from .._kernels.jit.uncompiled import WAIT
from ..maps.traversability import traversability
from ..settling.settle import settle
from .baselines import fsolve_baseline
from .cases import Case, mars_case, places, smooth_case, waiting_cases
from .clock import best, each

Row = dict[str, str | float]

STARTS = 5  # new processes of which the median is taken
FEW = 10  # poses in equilibrium mode and single poses are fewer by this factor
MAP_SIDE = 60.0  # m, side of the part of the terrain that is mapped
HEADINGS = 16
HANDFUL = 4  # poses of a call that fills a part of a block
BEYOND = 1000.0  # m, distance from the map of poses off the map
AHEAD = 0.05  # m, distance of a planner's next poses from its last one
TURNS = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)  # rad, their directions

#: Settles the first pose after an installation, then ends the process that compiles in the background.
FIRST_START = """
import rockerbogie as rb
from rockerbogie._kernels.jit.uncompiled import first_calls
print(rb.settle(rb.load_rover("curiosity"), rb.surfaces.plane(interpolation="{interpolation}"), 0.0, 0.0).status)
first_calls.process.kill()
"""
COMMAND = ["-m", "rockerbogie", "settle", "--terrain", "surface:plane", "--rover", "curiosity", "--json"]


def waits(poses: int = 1000) -> list[Row]:
    """Time what users wait for, on one thread, beside a job of the same run.

    Args:
        poses: settled per case.

    Returns:
        Rows with `name`, `us` (µs per pose, or per process), `unit` ("fsolve": the paper's method on smooth terrain, contacts
        below the hubs; "import": a process that imports numba) and `ratio`, the unit's time over `us`.
    """
    reference = smooth_case()
    with threads(1):
        unit = fsolve_baseline(reference, *places(reference, 20), "hub").seconds
        rows = [_row(name, spent, "fsolve", unit) for case in waiting_cases() for name, spent in _settling(case, poses)]
        rows.append(_row(f"map of the default layers: {mars_case('linear').name}", _map_seconds(), "fsolve", unit))
    unit = process_seconds(["-c", "import numba"])
    return rows + [_row(name, spent, "import", unit) for name, spent in _starts()]


def _row(name: str, seconds: float, unit: str, unit_seconds: float) -> Row:
    """Return a row of the table.

    Args:
        name: of the job.
        seconds: per pose or process.
        unit: name of the job that the ratio is to.
        unit_seconds: its time.
    """
    return {"name": name, "us": 1e6 * seconds, "unit": unit, "ratio": unit_seconds / seconds}


def _settling(case: Case, poses: int) -> Iterator[tuple[str, float]]:
    """Yield each job on one case, with its seconds per pose.

    Args:
        case: rover and terrain.
        poses: number of poses.
    """
    x, y, yaw = places(case, poses)
    few = x[: poses // FEW], y[: poses // FEW], yaw[: poses // FEW]
    pose = settle(case.rover, case.terrain, x, y, yaw)  # compiles and warms up
    settle(case.rover, case.terrain, *few, mode="equilibrium")
    _ = pose.clearance
    yield f"settle: {case.name}", best(lambda: settle(case.rover, case.terrain, x, y, yaw), 3) / poses
    yield f"clearance: {case.name}", best(lambda: replace(pose).clearance, 3) / poses
    calls = count()

    def settle_one() -> object:
        k = next(calls) % len(few[0])
        return settle(case.rover, case.terrain, few[0][k], few[1][k], few[2][k])

    yield f"one pose: {case.name}", each(settle_one, len(few[0]))

    def settle_off() -> object:
        k = next(calls) % len(few[0])
        return settle(case.rover, case.terrain, case.terrain.bounds[2] + BEYOND, few[1][k], few[2][k])

    yield f"off the map: {case.name}", each(settle_off, len(few[0]))

    def settle_four() -> object:
        k = next(calls) % (poses - HANDFUL)
        part = slice(k, k + HANDFUL)
        return settle(case.rover, case.terrain, x[part], y[part], yaw[part])

    yield f"four poses: {case.name}", each(settle_four, len(few[0])) / HANDFUL

    def settle_next() -> object:
        k = next(calls) % len(few[0])
        return settle(case.rover, case.terrain, few[0][k] + AHEAD * np.cos(TURNS), few[1][k] + AHEAD * np.sin(TURNS), few[2][k])

    yield f"next poses: {case.name}", each(settle_next, len(few[0])) / TURNS.size
    yield f"equilibrium: {case.name}", best(lambda: settle(case.rover, case.terrain, *few, mode="equilibrium"), 3) / len(few[0])


def _map_seconds() -> float:
    """Return the seconds per cell and heading of a map with its default layers."""
    case, half = mars_case("linear"), MAP_SIDE / 2
    side = (-half, -half, half, half)
    cells = MAP_SIDE**2 * HEADINGS / case.terrain.spacing[0] ** 2
    return best(lambda: traversability(case.rover, case.terrain, HEADINGS, bounds=side), 3) / cells


def _starts() -> Iterator[tuple[str, float]]:
    """Yield each kind of new process, with its seconds."""
    for interpolation in ("linear", "cubic"):
        yield (
            f"first pose after installation, {interpolation}",
            process_seconds(["-c", FIRST_START.format(interpolation=interpolation)], empty_cache=True),
        )
    process_seconds(COMMAND, 1)  # compiles
    yield "rockerbogie settle, second time", process_seconds(COMMAND)


def process_seconds(arguments: list[str], starts: int = STARTS, *, empty_cache: bool = False) -> float:
    """Return the seconds from the start to the end of a Python process, median of some.

    Args:
        arguments: of the Python program.
        starts: number of processes.
        empty_cache: True: each process has an empty cache of compiled kernels.

    Returns:
        s.
    """
    spent = []
    for _ in range(starts):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            environment = {name: value for name, value in os.environ.items() if name != WAIT}
            start = perf_counter()
            subprocess.run(
                [sys.executable, *arguments],
                env=environment | ({"NUMBA_CACHE_DIR": folder} if empty_cache else {}), check=True, capture_output=True,
            )  # fmt: skip
            spent.append(perf_counter() - start)
    return median(spent)
