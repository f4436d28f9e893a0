"""Rows of sensor readings of the odometry filter: checks and smoothing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.odometry import layout as at
from .._kernels.odometry import rows as kernel
from ..arrays import Array, floats, is_number
from ..errors import RockerbogieError
from .resolution import half_width, smooth
from .stamps import GAP_STEPS, GAP_TIME

#: Shortest interval between rows, s.
SHORTEST = 1e-9
#: Sensors of a row by the names of a log: columns and length. Wheel angles take the columns of the rates.
JOINTS = {
    "wheel_rate": (at.S_WHEEL, 6),
    "wheel_angle": (at.S_WHEEL, 6),
    "steering": (at.S_STEERING, 6),
    "rocker": (at.S_ROCKER, 1),
    "bogie": (at.S_BOGIE, 2),
}
IMU = {"roll": (at.S_ATTITUDE, 1), "pitch": (at.S_ATTITUDE + 1, 1), "yaw": (at.S_ATTITUDE + 2, 1), "gyro": (at.S_GYRO, 3)}


class Stretch:
    """Rows of a stretch without gaps, as far back as smoothing needs them.

    Attributes:
        window: rows over which readings are smoothed.
        reach: rows to either side that the smoothing uses; 0 for none.
        rows: (n, S_SIZE) buffer of which the first `count` rows are used.
        base: index in the stretch of the first row of the buffer.
        count: number of rows in the buffer.
    """

    def __init__(self, window: int) -> None:
        """Make a stretch without rows.

        Args:
            window: rows over which readings are smoothed; 1 for none.
        """
        self.window, self.reach = window, half_width(window)
        box = np.full(self.reach + 1, 1.0 / (self.reach + 1))
        self._kernel = np.convolve(box, box)
        self.rows = np.empty((max(4 * self.reach, 8), at.S_SIZE))
        self.base = self.count = 0

    @property
    def newest(self) -> int:
        """Index of the newest row in the stretch."""
        return self.base + self.count - 1

    @property
    def last(self) -> Array:
        """Copy (S_SIZE,) of the newest row."""
        return np.array(self.rows[self.count - 1])

    def raw(self, k: int) -> Array:
        """Return a row of the stretch.

        Args:
            k: its index in the stretch.

        Returns:
            (S_SIZE,) copy, not smoothed.
        """
        return np.array(self.rows[k - self.base])

    def restart(self, row: Array) -> None:
        """Begin a new stretch.

        Args:
            row: (S_SIZE,) its first row.
        """
        self.base = self.count = 0
        self.append(row)

    def append(self, row: Array) -> None:
        """Append a row; drop those that no later one needs.

        Args:
            row: (S_SIZE,).
        """
        if self.count == len(self.rows):
            kept = 2 * self.reach + 2
            self.rows[:kept] = self.rows[self.count - kept :].copy()
            self.base += self.count - kept
            self.count = kept
        self.rows[self.count] = row
        self.count += 1

    def sum_turn(self, last: Array, row: Array) -> None:
        """Set the derived columns of a row: heading without wraps, and turns summed since the first.

        Args:
            last: (S_SIZE,) the row before it.
            row: (S_SIZE,), changed.
        """
        kernel.follow_row(last, row, self.reach > 0)

    def gap(self) -> float:
        """Return the step in time beyond which a stretch ends.

        Returns:
            s; inf before the second row.
        """
        steps = np.diff(self.rows[: self.count, at.S_TIME])
        return max(GAP_STEPS * float(np.median(steps)), GAP_TIME) if len(steps) else float("inf")

    def smooth_row(self, k: int) -> Array:
        """Return a row of the stretch, smoothed; rows beyond either end are mirrored about it.

        Args:
            k: its index in the stretch.

        Returns:
            (S_SIZE,).
        """
        if not self.reach:
            return self.raw(k)
        index = np.arange(k - self.reach, k + self.reach + 1)
        last = self.newest
        rows = self.rows[np.where(index < 0, -index, np.where(index > last, 2 * last - index, index)) - self.base]
        if index[0] < 0:
            rows[index < 0] = 2 * self.rows[0] - rows[index < 0]
        if index[-1] > last:
            rows[index > last] = 2 * self.rows[self.count - 1] - rows[index > last]
        smoothed = np.asarray(self._kernel @ rows)
        smoothed[at.S_TIME] = self.rows[k - self.base, at.S_TIME]
        return smoothed

    def smooth_short(self) -> Array | None:
        """Return all rows smoothed, if the stretch is shorter than the smoothing reaches.

        Returns:
            (n, S_SIZE), or `None` for a longer stretch, whose rows `smooth_row` smooths.
        """
        rows = self.rows[: self.count]
        return np.asarray(smooth(rows[:, at.S_TIME], rows, self.window)) if self.newest < self.reach else None


def read_row(
    steers: NDArray[np.bool_],
    t: float,
    joints: Mapping[str, ArrayLike],
    imu: Mapping[str, ArrayLike],
    before: float,
    by_rate: bool | None,
) -> tuple[Array, bool]:
    """Return sensor readings as a row.

    Args:
        steers: (6,) bools, True for wheels that steer.
        t: s.
        joints, imu: as `OdometryFilter.update` takes them.
        before: time of the last row, s; −inf without one.
        by_rate: True if earlier rows hold wheel rates, False if they hold wheel angles, `None` for the first row.

    Returns:
        (S_SIZE,) with NaN where there is no finite reading, and 0 in the derived columns; True if it holds wheel rates.

    Raises:
        RockerbogieError: as `OdometryFilter.update`.
    """
    row = np.full(at.S_SIZE, np.nan)
    for given, known, what in ((joints, JOINTS, "joints"), (imu, IMU, "imu")):
        if not isinstance(given, Mapping):
            raise RockerbogieError(f"{what} is {given!r:.60}; give a dict of readings by name")
        unknown = given.keys() - known.keys()
        if unknown:
            raise RockerbogieError(f"{what} holds {min(unknown)!r}; it may hold {', '.join(known)}")
        for name, (first, width) in known.items():
            value = given.get(name)
            if value is None:
                continue
            try:
                row[first : first + width] = floats(value)
            except (TypeError, ValueError, OverflowError):
                raise RockerbogieError(f"{name} is {value!r:.60}; give {width} numbers") from None
    rates = joints.get("wheel_angle") is None
    if not kernel.clean_row(row, steers):
        raise RockerbogieError(
            "joints holds neither wheel_angle nor wheel_rate of all six wheels, finite and below 1e9: give one of them"
        )
    if by_rate is not None and rates != by_rate:
        raise RockerbogieError("joints changes between wheel_angle and wheel_rate: give the one of the first row")
    if not is_number(t) or not t - before > SHORTEST:
        raise RockerbogieError(f"t is {t!r} s; it must be greater than that of the last row")
    row[at.S_TIME] = t
    return row, rates
