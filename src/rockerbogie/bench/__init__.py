"""Benchmarks, as ratios to baselines timed in the same run (docs/bench.md).

Machines differ and are busy, so an absolute time is of little use. Each case is timed together with two baselines: the
paper's method (fsolve on eqs 13) and MuJoCo lowering the rover, on the same terrain and poses, warm, in one run. Jacobians
are timed together with Pinocchio's.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import threads
from ..settling.settle import settle
from ..terrain.heightfield import Terrain
from .baselines import drop_baseline, fsolve_baseline
from .cases import Case, cases, grounds, places
from .clock import best, timed
from .costs import calls, jacobians, memory
from .growth import growth
from .waits import FEW, waits
from .worst import ROVERS, worst

__all__ = ["SCHEMA", "Case", "Result", "cases", "figures", "machine", "places", "run_case"]

Array = NDArray[np.float64]

#: Version of the saved figures: raised when a name is removed or changes its meaning, not when one is added.
SCHEMA = 3
GROUP = 16  # poses timed together for the percentiles
FINE = 2881  # rim points with which fsolve has an error below 1e-6 m in half of the poses on 5 cm noise
LONG = 0.1  # s: least duration of a call that measures the gain of threads, not the cost of waking them


@dataclass(frozen=True)
class Result:
    """Results of one case: µs per pose on one thread unless stated; gaps of converged poses, m."""

    name: str
    poses: int
    settled: float  # share of the poses
    us: float  # scattered poses, each from a cold start
    us_p50: float  # of groups of GROUP poses, without the cost of a call
    us_p99: float
    us_along: float  # poses one after another on a line
    threads: int
    us_all_threads: float  # wall-clock time
    speedup: float  # wall-clock time of one thread over that of all
    poses_per_s: float
    poses_per_s_all_threads: float
    worst_gap: float
    within_1e_9: float  # share of the converged with all six gaps within 1e-9 m of zero
    within_1e_6: float
    baseline_us: dict[str, float]  # "hub", "point", "coarse", "rim": fsolve's; "mujoco": a drop's
    baseline_solved: dict[str, float]  # share of the poses that it solves
    baseline_gap: dict[str, float | None]  # m: median over its poses of the worst of six gaps
    ratios: dict[str, float]  # the baseline's time over `us`


def run_case(case: Case, poses: int = 10_000, baseline_poses: int = 20, drops: int = 2) -> Result:
    """Time one case: scattered poses and poses along a line, on one thread and on all.

    Args:
        case: rover and terrain.
        poses: number of scattered poses, and of poses on the line.
        baseline_poses: number of the poses that fsolve settles, per contact model.
        drops: number of the poses that MuJoCo settles.

    Returns:
        The results.
    """
    x, y, yaw = places(case, poses)
    line = np.linspace(0, 1, poses)

    def settled() -> object:
        return settle(case.rover, case.terrain, x, y, yaw)

    pose = settle(case.rover, case.terrain, x, y, yaw)  # compiles and warms up
    with threads(1):
        groups = _groups(case, x, y, yaw)
        whole = best(settled) / poses
        along = best(lambda: settle(case.rover, case.terrain, x[0] + line * (x[1] - x[0]), y[0] + line * (y[1] - y[0]), yaw[0]))
        again = max(round(LONG / (whole * poses)), 1)
        long = tuple(np.tile(a, again) for a in (x, y, yaw))
        one_wall = best(lambda: settle(case.rover, case.terrain, *long), clock=perf_counter) / (again * poses)
    with threads(None) as count:
        all_wall = best(lambda: settle(case.rover, case.terrain, *long), clock=perf_counter) / (again * poses)
    few, fewer = slice(0, baseline_poses), slice(0, drops)
    baseline = {
        "hub": fsolve_baseline(case, x[few], y[few], yaw[few], "hub"),
        "point": fsolve_baseline(case, x[few], y[few], yaw[few], "point"),
        "coarse": fsolve_baseline(case, x[few], y[few], yaw[few], "rim"),
        "rim": fsolve_baseline(case, x[few], y[few], yaw[few], "rim", FINE),
        "mujoco": drop_baseline(case, x[fewer], y[fewer], yaw[fewer]),
    }
    gap = np.abs(pose.gap[pose.status == 0]).max(axis=-1)
    return Result(
        name=case.name, poses=poses, settled=float((pose.status == 0).mean()),
        us=1e6 * whole, us_p50=1e6 * float(np.median(groups)), us_p99=1e6 * float(np.percentile(groups, 99)),
        us_along=1e6 * along / poses,
        threads=count, us_all_threads=1e6 * all_wall, speedup=one_wall / all_wall,
        poses_per_s=1 / whole, poses_per_s_all_threads=1 / all_wall,
        worst_gap=float(gap.max()), within_1e_9=float((gap <= 1e-9).mean()), within_1e_6=float((gap <= 1e-6).mean()),
        baseline_us={name: 1e6 * other.seconds for name, other in baseline.items()},
        baseline_solved={name: other.solved for name, other in baseline.items()},
        baseline_gap={name: other.gap if np.isfinite(other.gap) else None for name, other in baseline.items()},
        ratios={name: other.seconds / whole for name, other in baseline.items()},
    )  # fmt: skip


def _groups(case: Case, x: Array, y: Array, yaw: Array) -> Array:
    """Return the seconds per pose of each group of `GROUP` poses, without the cost of a call."""
    none = np.empty(0)
    call = best(lambda: settle(case.rover, case.terrain, none, none, none), 200)
    return np.array([timed(_part(case, x, y, yaw, k)) - call for k in range(0, len(x) - GROUP + 1, GROUP)]) / GROUP


def _part(case: Case, x: Array, y: Array, yaw: Array, first: int) -> Callable[[], object]:
    """Return a call that settles GROUP poses, from the given index on."""
    part = slice(first, first + GROUP)
    return lambda: settle(case.rover, case.terrain, x[part], y[part], yaw[part])


def figures(
    poses: int = 10_000, baseline_poses: int = 20, drops: int = 2, raster: Terrain | None = None, *, slowest: bool = False
) -> Iterator[tuple[str, int, dict[str, object]]]:
    """Time all cases and costs, one step at a time.

    Args:
        poses: number of poses per case.
        baseline_poses: as `run_case`.
        drops: as `run_case`.
        raster: terrain of one more case.
        slowest: True: also time single poses on every kind of terrain (`worst`), which takes some minutes more.

    Yields:
        After each step: its name, the number of steps, and all figures so far (docs/bench.md).
    """
    every = cases(raster)
    steps = len(every) + 5 + slowest * len(ROVERS) * len(list(grounds()))
    done: list[dict[str, object]] = []
    table: dict[str, object] = {"schema": SCHEMA, "machine": machine(), "cases": done}
    for case in every:
        done.append(asdict(run_case(case, poses, baseline_poses, drops)))
        yield case.name, steps, table
    for name, measure in (("calls", calls), ("jacobians", jacobians), ("memory", memory), ("growth", growth)):
        table[name] = measure()
        yield name, steps, table
    table["waits"] = waits(max(poses // 10, 2 * FEW))
    yield "waits", steps, table
    if slowest:
        for name, rows in worst(poses):
            table["worst"] = rows
            yield name, steps, table


def machine() -> dict[str, object]:
    """Return the machine and the versions that the times belong to.

    Returns:
        Version, machine, cores, versions of Python, numba and numpy.
    """
    from importlib.metadata import version

    from ..files.version import __version__

    return {
        "version": __version__, "machine": platform.machine(), "cores": os.cpu_count(), "python": platform.python_version(),
        "numba": version("numba"), "numpy": np.__version__,
    }  # fmt: skip
