"""Resolution of encoders: counts found in a log, and angles smoothed over enough of them."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..arrays import Array
from .stamps import gaps_of

#: Counts that a smoothed step spans at least, and the longest span, s.
COUNTS, LONGEST = 30.0, 2.0
#: Error of a joint's rate that smoothing aims at, rad/s.
JOINT_RATE = 5e-3
#: Steps that are compared with the grid, and the share of them that lies on it.
LEAST_STEPS, ON_GRID = 10, 0.95


def resolution_of(angle: Array) -> float:
    """Find the step of the grid on which an encoder's angles lie.

    Args:
        angle: (n,) rad.

    Returns:
        The grid's step, rad; 0 if the angles lie on no grid.
    """
    step = np.diff(angle)
    change = np.abs(np.diff(step))
    sizes = [np.abs(step)[np.abs(step) > 1e-9], change[change > 1e-9]]
    if len(sizes[1]) < LEAST_STEPS:
        return 0.0
    for size in sizes:
        if not len(size):
            continue
        for q in np.percentile(size, (0, 1, 5, 25)):
            on = np.abs(step / q - np.round(step / q)) < 1e-3 * np.maximum(np.abs(np.round(step / q)), 1.0)
            fine = np.abs(step / q).max() < 1e4  # finer grids are rounded digits
            if fine and on.mean() >= ON_GRID:
                return float(q)
    return 0.0


def window_of(time: Array, angle: Array, resolution: float) -> int:
    """Return the number of rows over which angles are smoothed, to span `COUNTS`.

    Args:
        time: (n,) s.
        angle: (n, 6) rad.
        resolution: grid of the angles, rad.

    Returns:
        Rows; 1 for no smoothing.
    """
    dt = float(np.median(np.diff(time)))
    rows = max(round(1.0 / dt), 1)
    rows = min(rows, len(angle) - 1)
    speeds = np.abs(np.diff(angle[::rows], axis=0)).max(axis=1) / (rows * dt)
    moving = speeds[speeds > 2 * resolution / (rows * dt)]
    if not len(moving):
        return 1
    wanted = COUNTS * resolution / (float(np.median(moving)) * dt)
    return _rows(wanted, dt, len(time))


def joint_window(time: Array, resolution: float) -> int:
    """Return the number of rows over which a suspension joint is smoothed.

    Its rate is then known to `JOINT_RATE`.

    Args:
        time: (n,) s.
        resolution: grid of the joint's angles, rad.

    Returns:
        Rows; 1 for no smoothing.
    """
    dt = float(np.median(np.diff(time)))
    return _rows(resolution / np.sqrt(6) / JOINT_RATE / dt, dt, len(time))


def _rows(wanted: float, dt: float, count: int) -> int:
    """Return a possible number of rows of an interval: 1 if at most 2 are needed."""
    return int(max(min(np.ceil(wanted), LONGEST / dt, count // 4), 1)) if wanted > 2 else 1


def smooth(time: Array, values: Array, window: int) -> Array:
    """Return values smoothed by a triangular window.

    First and last value of each stretch without gaps are kept.

    Args:
        time: (n,) s.
        values: (n,) or (n, k).
        window: rows; 1 returns the values.

    Returns:
        As `values`.
    """
    half = window // 2
    if half < 2:
        return values
    out = values.copy()
    edges = [0, *(gaps_of(time) + 1), len(time)]
    for a, b in itertools.pairwise(edges):
        reach = min(2 * half, b - a - 1)
        if reach < 2:
            continue
        piece = values[a:b]
        before = 2 * piece[:1] - piece[reach:0:-1]
        after = 2 * piece[-1:] - piece[-2 : -reach - 2 : -1]
        padded = np.concatenate([before, piece, after])
        for _ in range(2):
            padded = uniform_filter1d(padded, 2 * (half // 2) + 1, axis=0, mode="nearest")
        out[a:b] = padded[reach : reach + b - a]
    return out


def half_width(window: int) -> int:
    """Return the number of rows to either side that `smooth` uses.

    Args:
        window: rows.

    Returns:
        Rows; 0 if the window does not smooth.
    """
    half = window // 2
    return 2 * (half // 2) if half >= 2 else 0
