"""Rows of sensor readings of the odometry filter: checks, smoothing and intervals."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from .._kernels.odometry import layout as at
from ..arrays import Array, floats, is_number
from ..errors import RockerbogieError
from ..rover.model import Rover
from .resolution import half_width, smooth
from .stamps import GAP_STEPS, GAP_TIME
from .steps import turns

#: Columns of a row. Those from `TURN` on are derived: rotation vector and heading, summed over the rows.
WHEEL, STEERING, ROCKER, BOGIE, ATTITUDE, GYRO, TURN, TIME, SIZE = 0, 6, 12, 13, 15, 18, 21, 24, 25
#: Shortest interval between rows, s; wheel angle, rad, or rate, rad/s, beyond which a reading is not one of a wheel.
SHORTEST, MOST_TURNED = 1e-9, 1e9
#: Sensors of a row by the names of a log: columns and length. Wheel angles take the columns of the rates.
JOINTS = {
    "wheel_rate": (WHEEL, 6),
    "wheel_angle": (WHEEL, 6),
    "steering": (STEERING, 6),
    "rocker": (ROCKER, 1),
    "bogie": (BOGIE, 2),
}
IMU = {"roll": (ATTITUDE, 1), "pitch": (ATTITUDE + 1, 1), "yaw": (ATTITUDE + 2, 1), "gyro": (GYRO, 3)}


class Stretch:
    """Rows of a stretch without gaps, as far back as smoothing needs them.

    Attributes:
        window: rows over which readings are smoothed.
        reach: rows to either side that the smoothing uses; 0 for none.
        rows: (n, SIZE) buffer of which the first `count` rows are used.
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
        self.rows = np.empty((max(4 * self.reach, 8), SIZE))
        self.base = self.count = 0

    @property
    def newest(self) -> int:
        """Index of the newest row in the stretch."""
        return self.base + self.count - 1

    @property
    def last(self) -> Array:
        """Copy (SIZE,) of the newest row."""
        return np.array(self.rows[self.count - 1])

    def raw(self, k: int) -> Array:
        """Return a row of the stretch.

        Args:
            k: its index in the stretch.

        Returns:
            (SIZE,) copy, not smoothed.
        """
        return np.array(self.rows[k - self.base])

    def restart(self, row: Array) -> None:
        """Begin a new stretch.

        Args:
            row: (SIZE,) its first row.
        """
        self.base = self.count = 0
        self.append(row)

    def append(self, row: Array) -> None:
        """Append a row; drop those that no later one needs.

        Args:
            row: (SIZE,).
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
            last: (SIZE,) the row before it.
            row: (SIZE,), changed.
        """
        yaw = row[ATTITUDE + 2]
        if np.isfinite(yaw) and np.isfinite(last[ATTITUDE + 2]):
            row[ATTITUDE + 2] = yaw + 2 * np.pi * np.round((last[ATTITUDE + 2] - yaw) / (2 * np.pi))
        row[TURN : TURN + 3] = last[TURN : TURN + 3]
        if self.reach:
            row[TURN : TURN + 3] += _turn(last, row)

    def gap(self) -> float:
        """Return the step in time beyond which a stretch ends.

        Returns:
            s; inf before the second row.
        """
        steps = np.diff(self.rows[: self.count, TIME])
        return max(GAP_STEPS * float(np.median(steps)), GAP_TIME) if len(steps) else float("inf")

    def smooth_row(self, k: int) -> Array:
        """Return a row of the stretch, smoothed; rows beyond either end are mirrored about it.

        Args:
            k: its index in the stretch.

        Returns:
            (SIZE,).
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
        smoothed[TIME] = self.rows[k - self.base, TIME]
        return smoothed

    def smooth_short(self) -> Array | None:
        """Return all rows smoothed, if the stretch is shorter than the smoothing reaches.

        Returns:
            (n, SIZE), or `None` for a longer stretch, whose rows `smooth_row` smooths.
        """
        rows = self.rows[: self.count]
        return np.asarray(smooth(rows[:, TIME], rows, self.window)) if self.newest < self.reach else None


def read_row(
    rover: Rover, t: float, joints: Mapping[str, ArrayLike], imu: Mapping[str, ArrayLike], before: float, by_rate: bool | None
) -> tuple[Array, bool]:
    """Return sensor readings as a row.

    Args:
        rover: the rover.
        t: s.
        joints, imu: as `OdometryFilter.update` takes them.
        before: time of the last row, s; −inf without one.
        by_rate: True if earlier rows hold wheel rates, False if they hold wheel angles, `None` for the first row.

    Returns:
        (SIZE,) with NaN where there is no finite reading, and 0 in the derived columns; True if it holds wheel rates.

    Raises:
        RockerbogieError: as `OdometryFilter.update`.
    """
    row = np.full(SIZE, np.nan)
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
    row[np.isinf(row)] = np.nan
    rates = joints.get("wheel_angle") is None
    if not (np.abs(row[WHEEL : WHEEL + 6]) < MOST_TURNED).all():
        raise RockerbogieError(
            "joints holds neither wheel_angle nor wheel_rate of all six wheels, finite and below 1e9: give one of them"
        )
    if by_rate is not None and rates != by_rate:
        raise RockerbogieError("joints changes between wheel_angle and wheel_rate: give the one of the first row")
    if not is_number(t) or not t - before > SHORTEST:
        raise RockerbogieError(f"t is {t!r} s; it must be greater than that of the last row")
    row[TIME] = t
    row[STEERING : STEERING + 6][~rover.steers] = 0.0 if np.isfinite(row[STEERING : STEERING + 6]).any() else np.nan
    row[TURN : TURN + 3] = 0.0
    return row, rates


def interval_reading(a: Array, b: Array, A: Array, B: Array, dt: float, *, by_rate: bool, smoothed: bool) -> Array:
    """Return the readings of the interval between two rows.

    Args:
        a, b: (SIZE,) the rows.
        A, B: (SIZE,) these rows smoothed.
        dt: time between them, s.
        by_rate: True if the rows hold wheel rates, False if they hold wheel angles.
        smoothed: True if A and B differ from a and b.

    Returns:
        (1, R_SIZE).
    """
    middle, rate = 0.5 * (b + a), (B - A) / dt
    reading = np.full((1, at.R_SIZE), np.nan)
    r = reading[0]
    r[at.R_WHEEL : at.R_WHEEL + 6] = (middle if by_rate else rate)[WHEEL : WHEEL + 6]
    r[at.R_STEERING : at.R_STEERING + 6] = middle[STEERING : STEERING + 6]
    r[at.R_STEERING_RATE : at.R_STEERING_RATE + 6] = rate[STEERING : STEERING + 6]
    r[at.R_ROCKER : at.R_ROCKER + 3] = middle[ROCKER : ROCKER + 3]
    measured = r[at.R_STEERING : at.R_ROCKER_RATE]
    measured[np.isnan(measured)] = 0.0
    r[at.R_ROCKER_RATE : at.R_ROCKER_RATE + 3] = rate[ROCKER : ROCKER + 3]
    tilt, heading = middle[ATTITUDE : ATTITUDE + 2], middle[ATTITUDE + 2]
    tilted, headed = isfinite(tilt[0]) and isfinite(tilt[1]), isfinite(heading)
    gyro = middle[GYRO : GYRO + 3]
    if tilted and headed:
        turn = rate[TURN : TURN + 3]
        if not smoothed:
            turn = _turn(a, b) / dt
        r[at.R_GYRO : at.R_GYRO + 3] = turn
    elif np.isfinite(gyro).any():
        r[at.R_GYRO : at.R_GYRO + 3] = gyro
    elif headed and not tilted:  # a compass: only the angular velocity about z
        r[at.R_GYRO + 2] = rate[ATTITUDE + 2]
    if tilted:
        r[at.R_TILT : at.R_TILT + 2] = tilt
        if not headed:
            r[at.R_TILT_RATE : at.R_TILT_RATE + 2] = rate[ATTITUDE : ATTITUDE + 2]
    return reading


def or_zero(values: Array) -> Array:
    """Return values with 0 for NaN.

    Args:
        values: any shape.

    Returns:
        A copy.
    """
    return np.where(np.isnan(values), 0.0, values)


def _turn(a: Array, b: Array) -> Array:
    """Return the rotation vector (3,) between the attitudes of two rows; 0 if one has none."""
    both = np.stack([a[ATTITUDE : ATTITUDE + 3], b[ATTITUDE : ATTITUDE + 3]])
    return turns(both)[0] if np.isfinite(both).all() else np.zeros(3)
