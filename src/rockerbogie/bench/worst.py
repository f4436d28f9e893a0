"""Slowest poses: for each terrain and rover, the distribution of the time of a single pose."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._kernels.jit.parallel import threads
from ..rover.formats import load_rover
from ..settling.settle import settle
from .cases import Case, grounds, places
from .clock import timed

Row = dict[str, str | float]

ROVERS = ("curiosity", "osr")
AGAIN = 20  # slowest poses that are timed again, because other work on the machine slows down a few calls
REPEATS = 3


def worst(poses: int = 10_000) -> Iterator[tuple[str, list[Row]]]:
    """Time single poses on every kind of terrain, on one thread, each by a call of its own.

    Args:
        poses: number of poses per terrain and rover.

    Yields:
        After each terrain and rover: its name, and all rows so far. A row has `terrain`, `rover`, the median, the 99th percentile
        and the slowest time of a pose (`us_p50`, `us_p99`, `us_worst`, µs), the status of the slowest (`status`), and its
        position (`x`, `y` m, `yaw` rad).
    """
    rows: list[Row] = []
    for name, terrain in grounds():
        for preset in ROVERS:
            with threads(1):
                rows.append(_slowest(Case(name, load_rover(preset), terrain), preset, poses))
            yield f"{name}, {preset}", rows


def _slowest(case: Case, preset: str, poses: int) -> Row:
    """Return the times of single poses of a case.

    Args:
        case: rover and terrain, named after the terrain.
        preset: name of the rover.
        poses: number of poses.
    """
    x, y, yaw = places(case, poses)

    def seconds(k: int) -> float:
        return timed(lambda: settle(case.rover, case.terrain, x[k], y[k], yaw[k]))

    settle(case.rover, case.terrain, x[:64], y[:64], yaw[:64])  # compiles and warms up
    spent = np.array([seconds(k) for k in range(poses)])
    for k in np.argsort(spent)[-AGAIN:]:
        spent[k] = min(spent[k], *(seconds(int(k)) for _ in range(REPEATS)))
    k = int(np.argmax(spent))
    return {
        "terrain": case.name, "rover": preset,
        "us_p50": 1e6 * float(np.median(spent)),
        "us_p99": 1e6 * float(np.percentile(spent, 99)),
        "us_worst": 1e6 * float(spent[k]),
        "status": int(settle(case.rover, case.terrain, x[k], y[k], yaw[k]).status),
        "x": float(x[k]), "y": float(y[k]), "yaw": float(yaw[k]),
    }  # fmt: skip
