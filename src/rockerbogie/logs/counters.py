"""Repair of wheel angles: wraps, counters that roll over or restart, wild values."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from ..arrays import Array
from .channels import LogReport
from .stamps import gaps_of

#: A step is a jump if it is off the speed around it by this many times the highest speed, and by this angle, rad.
JUMP_SPEEDS, JUMP_ANGLE = 5.0, 1.0
#: Largest share of jumps in a signal that is still repaired.
MOST_JUMPS = 0.05
#: Rows whose median speed is the speed around a step.
NEIGHBOURS = 9


def continuous_angle(time: Array, angle: Array, rate: Array | None, name: str, report: LogReport) -> Array | None:
    """Return a wheel's angle without wraps, roll-overs, restarts and single wild values.

    An angle is wrapped if it stays within one turn and jumps by more than half a turn; the data decide, not the name. Whole
    turns are then added so that each step is nearest to the measured rate, or to the speed around it. Other jumps are
    bridged by the speed around them.

    Args:
        time: (n,) ascending, s.
        angle: (n,) rad.
        rate: (n,) measured rate, rad/s, or `None`.
        name: wheel, for notes.
        report: gets a note for each repair.

    Returns:
        (n,) rad; `None` if the angle jumps too often to be one counter.
    """
    if len(time) < 3:
        return angle
    dt, step = np.diff(time), np.diff(angle)
    around = median_filter(step / dt, size=NEIGHBOURS, mode="mirror")
    if rate is not None and _rates_fit(step, rate, dt):
        around = 0.5 * (rate[1:] + rate[:-1])
    fastest = float(np.percentile(np.abs(around), 99))
    full = 2 * np.pi
    if np.ptp(angle) <= full * (1 + 1e-9) and (np.abs(step) > np.pi).any():
        turned = step + full * np.round((around * dt - step) / full)
        gaps = [k for k in gaps_of(time) if fastest * dt[k] > np.pi / 2]
        report.note(f"{name}: the angle is wrapped to one turn and was unwrapped ({int((np.abs(step) > np.pi).sum())} wraps)")
        if gaps and rate is None:
            report.warn(f"{name}: the angle is wrapped to one turn, and in {len(gaps)} gaps whole turns may be lost")
        if fastest * float(np.median(dt)) > np.pi / 2 and rate is None:
            report.warn(f"{name}: the wrapped angle moves more than a quarter turn between rows; whole turns may be lost")
        return np.concatenate([angle[:1], angle[0] + np.cumsum(turned)])
    off = step - around * dt
    jump = np.abs(off) > np.maximum(JUMP_SPEEDS * fastest * dt, JUMP_ANGLE)
    if not jump.any():
        return angle
    if jump.mean() > MOST_JUMPS and jump.sum() > 4:
        return None
    values, found = angle.copy(), np.flatnonzero(jump)
    wild = [k + 1 for k in found if k + 1 in found and abs(off[k] + off[k + 1]) < 0.1 * abs(off[k]) + JUMP_ANGLE]
    if wild:
        keep = np.ones(len(angle), dtype=bool)
        keep[wild] = False
        values[wild] = np.interp(time[wild], time[keep], values[keep])
        report.note(f"{name}: {len(wild)} single wild values were replaced (first at {time[wild[0]] - time[0]:.2f} s)")
    for k in found:
        if k + 1 in wild or k in wild:
            continue
        values[k + 1 :] -= off[k]
        report.note(
            f"{name}: the counter jumps by {off[k]:+.4g} rad at {time[k + 1] - time[0]:.2f} s (it rolled over or restarted); "
            "the jump was bridged by the speed around it"
        )
    return values


def _rates_fit(step: Array, rate: Array, dt: Array) -> bool:
    """Return True if most steps are those of the rate (n + 1,), up to whole turns."""
    expected = 0.5 * (rate[1:] + rate[:-1]) * dt
    off = (step - expected + np.pi) % (2 * np.pi) - np.pi
    size = float(np.median(np.abs(expected)))
    return bool(size > 0 and np.median(np.abs(off)) < 0.2 * size)


def replace_wild(time: Array, values: Array, name: str, report: LogReport) -> Array:
    """Return a signal whose single wild values are replaced by the mean of their neighbours.

    Args:
        time: (n,) ascending, s.
        values: (n,) rad.
        name: column, for notes.
        report: gets the count.

    Returns:
        (n,) rad.
    """
    if len(values) < 5:
        return values
    step = np.diff(values)
    limit = max(0.2, 20.0 * float(np.percentile(np.abs(step), 90)))
    wild = (
        np.flatnonzero((np.abs(step[:-1]) > limit) & (np.abs(step[1:]) > limit) & (np.abs(step[:-1] + step[1:]) < limit / 4)) + 1
    )
    ends = [
        k for k, s, t in ((0, step[0], step[1]), (len(values) - 1, step[-1], step[-2])) if abs(s) > limit and abs(t) < limit / 20
    ]
    wild = np.unique(np.concatenate([wild, np.array(ends, dtype=int)]))
    if not len(wild):
        return values
    keep = np.ones(len(values), dtype=bool)
    keep[wild] = False
    values = values.copy()
    values[wild] = np.interp(time[wild], time[keep], values[keep])
    report.note(f"{name}: {len(wild)} single wild values were replaced (first at {time[wild[0]] - time[0]:.2f} s)")
    return values
