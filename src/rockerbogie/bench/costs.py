"""Costs that do not depend on the terrain: one call, a new process, six Jacobians, memory."""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc

import numpy as np

from .._kernels.jit.parallel import threads
from ..motion.jacobian import SimpleStance, wheel_jacobians
from ..rover.formats import load_rover
from ..settling.settle import settle
from .baselines import pinocchio_seconds
from .cases import places, smooth_case
from .clock import best, each

MOST = 200_000  # Jacobians per measurement, over all repeats
FIRST_SETTLE = "import rockerbogie as rb; print(rb.settle(rb.load_rover('curiosity'), rb.surfaces.plane(), 0.0, 0.0).status)"


def calls() -> dict[str, float]:
    """Time single calls from Python.

    Returns:
        µs for one pose and for no pose, and the seconds of a process that settles its first pose with compiled kernels.
    """
    case = smooth_case()
    x, y, yaw = (float(a[0]) for a in places(case, 1))
    none = np.empty(0)
    python = [sys.executable, "-c", FIRST_SETTLE]
    return {
        "single_us": 1e6 * each(lambda: settle(case.rover, case.terrain, x, y, yaw), 2000),
        "empty_us": 1e6 * each(lambda: settle(case.rover, case.terrain, none, none, none), 2000),
        "first_settle_s": best(lambda: subprocess.run(python, check=True, capture_output=True), clock=_children),
    }


def _children() -> float:
    """Return the CPU time of child processes that have ended, s."""
    spent = os.times()
    return spent.children_user + spent.children_system


def jacobians(poses: int = 2000, many: int = 100_000) -> dict[str, float]:
    """Time frames and Jacobians of six wheels on one thread, beside Pinocchio.

    Args:
        poses: of a batch that stays in the processor's cache.
        many: poses of one large batch.

    Returns:
        µs per pose: into memory that is reused, for many poses at once, into new memory; and Pinocchio's.
    """
    rover = load_rover("elhami-dashti")

    def state(count: int) -> SimpleStance:
        rng = np.random.default_rng(3)
        rocker, bogie, contact, steering = (rng.normal(0, 0.2, (count, *tail)) for tail in ((), (2,), (6,), (6,)))
        return SimpleStance(rocker, bogie, contact, steering * rover.steers)

    def cost(count: int, *, given: bool) -> float:
        at, out, frames = state(count), np.zeros((count, 6, 6, 9)), np.zeros((count, 6, 4, 4))
        memory = {"out": out, "frames": frames} if given else {}
        return 1e6 / count * best(lambda: wheel_jacobians(rover, at, **memory), max(MOST // count, 7))

    with threads(1):
        found = {"poses": poses, "us": cost(poses, given=True), "many": many}
        found |= {"us_many": cost(many, given=True), "us_many_new_memory": cost(many, given=False)}
    theirs = pinocchio_seconds(rover)
    if theirs:
        bare, called = theirs
        found |= {"pinocchio_us": 1e6 * bare, "pinocchio_from_python_us": 1e6 * called, "ratio": 1e6 * bare / found["us"]}
    return found


def memory(poses: int = 250_000) -> dict[str, float]:
    """Measure the memory of a batch of poses on a grid.

    Args:
        poses: about this many.

    Returns:
        Number of poses, and MB per million of them: kept afterwards, and at most while settling.
    """
    case = smooth_case()
    side = np.linspace(-2, 2, round(poses**0.5))
    settle(case.rover, case.terrain, side[:600], 0.0)
    tracemalloc.start()
    pose = settle(case.rover, case.terrain, side[:, None], side)
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return {"poses": pose.status.size, "kept_mb": kept / pose.status.size, "peak_mb": peak / pose.status.size}
