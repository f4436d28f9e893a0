"""Timing of calls."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

Call = Callable[[], object]
Clock = Callable[[], float]


def timed(call: Call, clock: Clock = process_time) -> float:
    """Return the seconds of one call.

    Args:
        call: the function to time.
        clock: returns seconds; CPU time of the process by default, which sums over threads.

    Returns:
        s.
    """
    start = clock()
    call()
    return clock() - start


def best(call: Call, repeats: int = 5, clock: Clock = process_time) -> float:
    """Return the seconds of the fastest of some calls, as disturbances only add time.

    Args:
        call: the function to time.
        repeats: number of calls.
        clock: as `timed`.

    Returns:
        s.
    """
    return min(timed(call, clock) for _ in range(repeats))


def each(call: Call, calls: int, repeats: int = 3) -> float:
    """Return the seconds per call of many calls in a row.

    Args:
        call: the function to time.
        calls: number of calls in a row.
        repeats: number of such rows, of which the fastest counts.

    Returns:
        s.
    """
    return best(lambda: [call() for _ in range(calls)], repeats) / calls
