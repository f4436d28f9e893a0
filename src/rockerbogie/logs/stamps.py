"""Time stamps of a log: unstamped, swapped and duplicate rows, and clocks that were set."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import RockerbogieError
from .channels import LogReport

#: Greatest distance of swapped rows from their position, rows; beyond it the clock was set.
MOST_SWAPPED = 5
#: A gap is this many times the median step, and at least this long, s.
GAP_STEPS, GAP_TIME = 10.0, 0.5


def order_stamps(stamp: Array, received: Array | None, source: str, report: LogReport) -> tuple[Array, NDArray[np.int64]]:
    """Return the times of rows in ascending order.

    Stamps of 0 mean "no stamp" in ROS: such rows get the time of reception if no row has a stamp, and are dropped
    otherwise. A clock that begins at 0 is recognised by the stamps after it. If the clock was set back, times of reception
    are used.

    Args:
        stamp: (n,) s.
        received: (n,) times of reception, s; `None` if the log has none.
        source: topic or file, for messages.
        report: gets a note for each repair.

    Returns:
        (m,) ascending times, s, possibly with duplicates; (m,) indices of their rows.

    Raises:
        RockerbogieError: the clock was set back and there are no times of reception.
    """
    kept = np.flatnonzero(np.isfinite(stamp))
    if len(kept) < len(stamp):
        report.note(f"{source}: {len(stamp) - len(kept)} rows without a time were left out")
    stamp = stamp.copy()
    zero = stamp[kept] == 0
    if received is not None and zero.all() and len(kept):
        stamp = received.copy()
        report.note(f"{source}: messages have no stamp; times of reception are used")
    elif received is not None and zero.any():
        steps = np.diff(stamp[kept][~zero])
        step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
        begins = zero.sum() == 1 and zero[0] and len(kept) > 1 and 0 < stamp[kept[1]] <= 5 * step
        if not begins:
            report.note(f"{source}: {int(zero.sum())} messages without a stamp were left out")
            kept = kept[~zero]
    order = np.argsort(stamp[kept], kind="stable")
    moved = np.abs(order - np.arange(len(order)))
    if len(moved) and moved.max() > MOST_SWAPPED:
        back = int(np.argmin(np.diff(stamp[kept])))
        size = float(stamp[kept[back]] - stamp[kept[back + 1]])
        text = f"{source}: time goes back by {size:.3g} s after row {kept[back] + 1}: the clock was set"
        if received is None or np.abs(np.argsort(received[kept], kind="stable") - np.arange(len(kept))).max() > MOST_SWAPPED:
            raise RockerbogieError(f"{text}; cut the log there, or correct the times after it")
        report.warn(f"{text}; times of reception are used")
        stamp = received
        order = np.argsort(stamp[kept], kind="stable")
    elif len(moved) and moved.max() > 0:
        report.note(f"{source}: {int((np.diff(stamp[kept]) < 0).sum())} swapped rows were sorted by time")
    kept = kept[order]
    return stamp[kept], kept


def drop_duplicates(time: Array, values: Array, source: str, report: LogReport) -> tuple[Array, Array]:
    """Return a signal without missing values and with one value per time: the first.

    Args:
        time: (n,) ascending, s.
        values: (n,) or (n, k); rows that are not finite are dropped.
        source: topic or column, for notes.
        report: gets the counts.

    Returns:
        Times (m,) strictly ascending, and values (m,) or (m, k).
    """
    finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
    time, values = time[finite], values[finite]
    fresh = np.diff(time, prepend=-np.inf) > 0
    if not fresh.all():
        report.note(f"{source}: {int((~fresh).sum())} rows with duplicate stamps were left out")
    return time[fresh], values[fresh]


def gaps_of(time: Array) -> NDArray[np.int64]:
    """Return the indices of steps that are gaps.

    Args:
        time: (n,) ascending, s.

    Returns:
        Indices k: the gap is from time[k] to time[k + 1].
    """
    step = np.diff(time)
    if not len(step):
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(step > max(GAP_STEPS * float(np.median(step)), GAP_TIME))


def resample(time: Array, values: Array, at: Array) -> Array:
    """Return a signal at other times, linear between its rows.

    Args:
        time: (n,) ascending, s.
        values: (n,) or (n, k).
        at: (m,) s.

    Returns:
        (m,) or (m, k); NaN inside gaps and more than a gap's length outside the signal.
    """
    if len(time) == len(at) and (time == at).all():
        return values
    columns = values.reshape(len(time), -1)
    found = np.stack([np.interp(at, time, column) for column in columns.T], axis=-1)
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    reach = max(2.0 * step, 0.1)
    found[(at < time[0] - reach) | (at > time[-1] + reach)] = np.nan
    for k in gaps_of(time):
        found[(at > time[k]) & (at < time[k + 1])] = np.nan
    return found.reshape(len(at), *values.shape[1:])
