"""The stopwatch itself."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

Call = Callable[[], object]
Clock = Callable[[], float]


def timed(call: Call, clock: Clock = process_time) -> float:
    """Return the seconds of one call; CPU time if it runs on one thread."""
    start = clock()
    call()
    return clock() - start


def best(call: Call, repeats: int = 5, clock: Clock = process_time) -> float:
    """Seconds of the quickest of some calls: what else the machine does can only add."""
    return min(timed(call, clock) for _ in range(repeats))


def each(call: Call, calls: int, repeats: int = 3) -> float:
    """Seconds of one call, of many in a row."""
    return best(lambda: [call() for _ in range(calls)], repeats) / calls
