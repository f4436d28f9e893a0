"""How fast, as ratios to baselines timed in the same run.

Machines differ and are busy, so a time says little by itself: each case is timed beside the paper's own way, fsolve on
eqs (13), on the same ground and the same places, warm, in one run. What is reported of a case are poses a second, the
time of a pose over small batches (median and 99th percentile), the worst gap left, and how many times faster than
fsolve with the contact under the hub ("point") and over 23 points of the rim ("rim").
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from . import surfaces
from ._kernels.jit import threads
from .baseline import Contact, fsolve_settle
from .formats import load_rover
from .jacobian import wheel_jacobians
from .rover import Rover
from .settle import settle
from .terrain import Terrain

Array = NDArray[np.float64]
BATCH = 100  # poses in one timed batch of the percentiles


@dataclass(frozen=True)
class Case:
    """One ground, one rover."""

    name: str
    rover: Rover
    terrain: Terrain


@dataclass(frozen=True)
class Result:
    """What was timed of a case. Times are µs a pose; ratios are the baseline's time over ours on one thread."""

    name: str
    poses: int
    settled: float
    worst_gap: float
    us: float
    us_p50: float
    us_p99: float
    us_along: float
    threads: int
    us_all_threads: float
    ratios: dict[str, float]


def cases() -> list[Case]:
    """The named cases: smooth cubic ground, rough linear ground under thin discs, rocks under whole treads, Mars."""
    paper, rocky, percy, curiosity = (load_rover(n) for n in ("elhami-dashti", "rocky7", "perseverance", "curiosity"))
    discs = rocky.replace(wheel_width=np.zeros(6))
    rng = np.random.default_rng(0)
    smooth = surfaces.rough(1, max_slope=np.radians(15), min_radius=0.5, size=12.0)
    noisy = Terrain.from_array(rng.normal(size=(400, 400)) * 0.01, 0.05, interpolation="linear", name="1 cm noise")
    return [
        Case("smooth cubic, thin disc", paper, smooth),
        Case("rough 5 cm, thin disc", discs, noisy),
        Case("rocks 10 cm, whole tread", percy, surfaces.rocks(0.1, 1, size=40.0, spacing=0.1, smallest=0.2)),
        Case("rocks 5 cm, whole tread", percy, surfaces.rocks(0.1, 1, size=40.0, spacing=0.05)),
        Case(
            "Mars 1 m, whole tread",
            curiosity,
            surfaces.mars(1, size=200.0, spacing=1.0, k=0.0, smallest_crater=10.0, interpolation="cubic"),
        ),
    ]


def places(case: Case, poses: int) -> tuple[Array, Array, Array]:
    """Seeded x, y, yaw (poses,) that keep the rover on the map."""
    rng = np.random.default_rng(2)
    x0, y0, x1, y1 = case.terrain.bounds
    margin = case.rover.wheelbase
    return (
        rng.uniform(x0 + margin, x1 - margin, poses),
        rng.uniform(y0 + margin, y1 - margin, poses),
        rng.uniform(-np.pi, np.pi, poses),
    )


def run_case(case: Case, poses: int = 20_000, baseline_poses: int = 20) -> Result:
    """Time one case: scattered places from a cold start, places one after another along a line, one thread and all."""
    x, y, yaw = places(case, poses)
    pose = settle(case.rover, case.terrain, x, y, yaw)  # compiles, warms
    with threads(1):
        batches = [_timed(_part(case, x, y, yaw, k)) / BATCH for k in range(0, poses, BATCH)]
        whole = _best(lambda: settle(case.rover, case.terrain, x, y, yaw)) / poses
        line = np.linspace(0, 1, poses)
        along = (
            _best(lambda: settle(case.rover, case.terrain, x[0] + line * (x[1] - x[0]), y[0] + line * (y[1] - y[0]), yaw[0]))
            / poses
        )
    with threads(None) as count:
        all_threads = _best(lambda: settle(case.rover, case.terrain, x, y, yaw), clock=perf_counter) / poses
    few = slice(0, baseline_poses)
    ways: tuple[Contact, ...] = ("point", "rim")
    ratios: dict[str, float] = {way: _baseline(case, x[few], y[few], yaw[few], way) / whole for way in ways}
    good = pose.status == 0
    return Result(
        case.name, poses, float(good.mean()), float(np.abs(pose.gap[good]).max()), 1e6 * whole,
        1e6 * float(np.median(batches)), 1e6 * float(np.percentile(batches, 99)), 1e6 * along,
        count, 1e6 * all_threads, ratios,
    )  # fmt: skip


def _part(case: Case, x: Array, y: Array, yaw: Array, first: int) -> Callable[[], object]:
    part = slice(first, first + BATCH)
    return lambda: settle(case.rover, case.terrain, x[part], y[part], yaw[part])


def single_call(calls: int = 2000) -> float:
    """µs for one settle of one pose, called from Python."""
    case = cases()[0]
    x, y, yaw = places(case, 1)
    settle(case.rover, case.terrain, x[0], y[0], yaw[0])
    return 1e6 / calls * _timed(lambda: [settle(case.rover, case.terrain, x[0], y[0], yaw[0]) for _ in range(calls)])


def jacobians(poses: int = 100_000) -> tuple[float, float | None]:
    """µs a pose for all six wheel Jacobians in a batch on one thread; and Pinocchio's for the frames of one pose's wheels
    and their Jacobians, where it is installed."""
    rover = load_rover("elhami-dashti")
    rng = np.random.default_rng(3)
    rocker, bogie, angle = rng.normal(0, 0.2, poses), rng.normal(0, 0.2, (poses, 2)), rng.normal(0, 0.2, (poses, 6))
    stance = _Stance(rocker, bogie, angle)
    wheel_jacobians(rover, stance)
    with threads(1):
        ours = 1e6 * _best(lambda: wheel_jacobians(rover, stance)) / poses
    try:
        import pinocchio as pin  # type: ignore[import-untyped]
    except ImportError:
        return ours, None
    from .formats import to_urdf

    model = pin.buildModelFromXML(to_urdf(rover))
    data = model.createData()
    frames = [k for k, frame in enumerate(model.frames) if "wheel" in frame.name][-6:]
    q = pin.neutral(model)

    def theirs() -> None:
        for _ in range(1000):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            for frame in frames:
                pin.getFrameJacobian(model, data, frame, pin.LOCAL)

    return ours, 1e6 * _best(theirs) / 1000


@dataclass(frozen=True)
class _Stance:
    rocker: Array
    bogie: Array
    contact_angle: Array


def run(poses: int = 20_000, baseline_poses: int = 20) -> Iterator[tuple[str, int, Result]]:
    """Time every case; yields (its name, how many there are, its result) as each is done."""
    every = cases()
    for case in every:
        yield case.name, len(every), run_case(case, poses, baseline_poses)


def machine() -> dict[str, object]:
    """What the times were taken on."""
    from importlib.metadata import version

    from . import __version__

    return {
        "version": __version__, "machine": platform.machine(), "cores": os.cpu_count(), "python": platform.python_version(),
        "numba": version("numba"), "numpy": np.__version__,
    }  # fmt: skip


def as_json(results: list[Result]) -> list[dict[str, object]]:
    """Results as plain values, in their stable form."""
    return [asdict(result) for result in results]


def _baseline(case: Case, x: Array, y: Array, yaw: Array, contact: Contact) -> float:
    """Seconds a pose of the paper's way, of those it solves (a failure is not a time)."""
    spent: list[float] = []
    for place in zip(x, y, yaw, strict=True):
        start = process_time()
        pose = fsolve_settle(case.rover, case.terrain, *place, contact=contact)
        if int(pose.status) == 0:
            spent.append(process_time() - start)
    return float(np.median(spent)) if spent else float("nan")


def _timed(call: Callable[[], object], clock: Callable[[], float] = process_time) -> float:
    """Seconds of one call; of this process, so that a busy machine counts less, where it runs on one thread."""
    start = clock()
    call()
    return clock() - start


def _best(call: Callable[[], object], repeats: int = 3, clock: Callable[[], float] = process_time) -> float:
    return min(_timed(call, clock) for _ in range(repeats))
