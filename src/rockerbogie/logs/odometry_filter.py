"""Odometry one row at a time, with the numbers of `odometry` of the whole record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._kernels.odometry import layout as at
from .._kernels.odometry import rows as row_kernel
from ..arrays import Array, is_number
from ..errors import RockerbogieError, expect
from ..rover.model import LOAD_ROVER, Rover
from .channels import LogReport
from .estimate import Estimate
from .filter_rows import Stretch, read_row
from .odometry import SlopeSlip
from .readings import Readings
from .steps import (
    ATTITUDE_SIGMA,
    UNKNOWN_SLOPE,
    IntervalMotion,
    continue_track,
    interval_motion,
    new_track,
    pose_of,
    track_noise,
    weights_of,
)

if TYPE_CHECKING:
    import xarray as xr

#: Largest number of rows to smooth over.
MOST_ROWS = 10_000
#: Version of the saved state.
VERSION = 2


class OdometryFilter:
    """Odometry of a rover that drives, one row of readings at a time.

    On the same rows it gives the same poses, twists and covariances as `odometry` without a map. If `window` smooths the
    readings, these exist only once later rows are known: `confirmed` holds them. `update` then continues from the last of
    them to the present row in a single step.

    Attributes:
        estimate: the last `Estimate`; `None` before the first row.
        confirmed: estimates that the last call of `update` made final, oldest first; with `window` = 1 the one returned.
    """

    def __init__(
        self,
        rover: Rover,
        *,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        soil: SlopeSlip | None = None,
        window: int = 1,
        joint_error: float = 0.0,
    ) -> None:
        """Make a filter that has seen no row.

        Args:
            rover: the rover.
            start: x, y, z of the first pose, m.
            soil: expected slip on slopes; used while roll and pitch are measured.
            window: rows over which readings are smoothed, for encoders of few counts; 1 for none. `for_log` finds
                the value that `odometry` uses for a record.
            joint_error: error of the suspension's rates from the resolution of its sensors, rad/s.

        Raises:
            RockerbogieError: not a rover or soil, a window or an error out of its range, or a start that is not finite.
        """
        expect(rover, Rover, "rover", LOAD_ROVER)
        if isinstance(window, bool) or not (isinstance(window, (int, np.integer)) and 1 <= window <= MOST_ROWS):
            raise RockerbogieError(f"window is {window!r}; give the number of rows to smooth over, 1 (none) to {MOST_ROWS:,}")
        if not (is_number(joint_error) and joint_error >= 0):
            raise RockerbogieError(f"joint_error is {joint_error!r:.60} rad/s; give a number of 0 or above")
        if soil is not None:
            expect(soil, SlopeSlip, "soil", "make one with rockerbogie.SlopeSlip(along, across)")
        if not (isinstance(start, Iterable) and len(found := tuple(start)) == 3 and all(map(is_number, found))):
            raise RockerbogieError(f"start is {start!r}; give x, y, z in metres")
        self.rover = rover
        self.window, self.joint_error, self.soil = int(window), float(joint_error), soil
        self.estimate: Estimate | None = None
        self.confirmed: tuple[Estimate, ...] = ()
        x, y, z = (float(v) for v in start)
        self._start = (x, y, z)
        slopes = (0.0, 0.0) if soil is None else (soil.along, soil.across)
        self._weights = weights_of(rover, UNKNOWN_SLOPE, self.joint_error, slopes)
        self._steers = rover.steers.copy()
        self._rows = Stretch(self.window)
        self._at = 0  # row of the stretch at which the track ends
        self._smoothed = np.full(at.S_SIZE, np.nan)
        self._track: Array | None = None
        self._stepped = False
        self._aided, self._unaided = np.zeros(2), np.zeros(2)  # length with and without attitude, suspension sensors, m
        self._by_rate: bool | None = None
        self._yaw_offset = float("nan")  # of the track's heading to the measured one, rad
        self._measured = (False, False)  # roll and pitch, yaw

    @classmethod
    def for_log(
        cls,
        rover: Rover,
        log: xr.Dataset,
        *,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        soil: SlopeSlip | None = None,
    ) -> OdometryFilter:
        """Return a filter that smooths as `odometry` does with a record, which it has not read yet.

        Args:
            rover: the rover.
            log: as for `odometry`: a record of the same sensors.
            start, soil: as for the filter.

        Returns:
            A filter that has seen no row.

        Raises:
            RockerbogieError: as `odometry`.
        """
        found = Readings.of(rover, log, LogReport())
        return cls(rover, start=start, soil=soil, window=found.window, joint_error=found.joint_error)

    def update(self, t: float, joints: Mapping[str, ArrayLike], imu: Mapping[str, ArrayLike] | None = None) -> Estimate:
        """Add a row of readings.

        Args:
            t: s, greater than that of the last row.
            joints: `wheel_angle` (6,) or `wheel_rate` (6,), and as far as there are sensors `steering` (6,), `rocker`, `bogie`
                (2,): rad, rad/s, in the order of the rover's wheels.
            imu: `roll`, `pitch`, `yaw` (rad), `gyro` (3,) in the body frame (rad/s); `None` or NaN if there is no reading.
                Readings of 1e9 and above count as missing.

        Returns:
            The estimate at `t`.

        Raises:
            RockerbogieError: a time that does not grow, wheels that are missing or not finite, or a shape that does not fit.
        """
        rows = self._rows
        before = float(rows.last[at.S_TIME]) if rows.count else -np.inf
        row, self._by_rate = read_row(self._steers, t, joints, {} if imu is None else imu, before, self._by_rate)
        if self._track is None:
            self._smoothed = row
            track = self._begin(row)
            first = pose_of(track, track_noise(float(self._weights[at.W_WHEELBASE]), 0.0, 0.0))
            self.estimate = self._estimate(row, None, track, *first)
            self.confirmed = (self.estimate,)
            rows.append(row)
            return self.estimate
        last = rows.last
        rows.sum_turn(last, row)
        confirmed: list[Estimate] = []
        if rows.reach and row[at.S_TIME] - last[at.S_TIME] > rows.gap():
            confirmed += self.finish()
            confirmed.append(self._step(last, row, last, row))
            self._at, self._smoothed = 0, row
            rows.restart(row)
        else:
            rows.append(row)
            if rows.newest - rows.reach > self._at:
                confirmed.append(self._confirm(rows.smooth_row(self._at + 1)))
        self.confirmed = tuple(confirmed)
        behind = rows.newest > self._at
        self.estimate = self._step(rows.raw(self._at), row, self._smoothed, row, keep=False) if behind else confirmed[-1]
        return self.estimate

    def finish(self) -> tuple[Estimate, ...]:
        """Make the rows final that wait for later ones, as at the end of a record.

        Returns:
            Their estimates, oldest first; none without smoothing.
        """
        rows = self._rows
        if self._track is None or rows.newest <= self._at:
            return ()
        short = rows.smooth_short()
        found = []
        while self._at < rows.newest:
            found.append(self._confirm(rows.smooth_row(self._at + 1) if short is None else short[self._at + 1]))
        self._at = 0
        rows.restart(rows.last)
        return tuple(found)

    def state(self) -> dict[str, Any]:
        """Return all that later estimates depend on.

        Returns:
            Numbers, lists and texts that JSON can hold; `from_state` continues from them bit by bit.
        """
        return {
            "version": VERSION,
            "rover": self.rover.name,
            "settings": {
                "start": list(self._start),
                "soil": None if self.soil is None else [self.soil.along, self.soil.across],
                "window": self.window,
                "joint_error": self.joint_error,
            },
            "rows": _numbers(self._rows.rows[: self._rows.count]),
            "base": self._rows.base,
            "at": self._at,
            "smoothed": _numbers(self._smoothed),
            "track": None if self._track is None else _numbers(self._track),
            "stepped": self._stepped,
            "aided": _numbers(self._aided),
            "unaided": _numbers(self._unaided),
            "by_rate": self._by_rate,
            "yaw_offset": None if np.isnan(self._yaw_offset) else self._yaw_offset,
            "measured": list(self._measured),
        }

    @classmethod
    def from_state(cls, rover: Rover, state: Mapping[str, Any]) -> OdometryFilter:
        """Return a filter that continues from a saved state.

        Args:
            rover: the rover of the state.
            state: of `state`.

        Returns:
            The filter; `estimate` is `None` until the next row.

        Raises:
            RockerbogieError: a state of another rover or version, or one that is incomplete.
        """
        if not isinstance(state, Mapping) or state.get("version") != VERSION:
            raise RockerbogieError(f"the state is not one of OdometryFilter.state(), version {VERSION}")
        if state.get("rover") != rover.name:
            raise RockerbogieError(f"the state is of rover {state.get('rover')!r}, not of {rover.name!r}")
        try:
            settings = state["settings"]
            soil = None if settings["soil"] is None else SlopeSlip(*settings["soil"])
            made = cls(
                rover,
                start=tuple(settings["start"]),
                soil=soil,
                window=settings["window"],
                joint_error=settings["joint_error"],
            )
            rows = _array(state["rows"]).reshape(-1, at.S_SIZE)
            made._rows.count = len(rows)
            made._rows.rows[: len(rows)] = rows
            made._rows.base, made._at = int(state["base"]), int(state["at"])
            if rows.size and not made._rows.base <= made._at <= made._rows.newest:
                raise ValueError(f"no row {made._at}")
            made._smoothed = _array(state["smoothed"]).reshape(at.S_SIZE)
            made._track = None if state["track"] is None else _array(state["track"]).reshape(at.T_SIZE)
            made._stepped, made._by_rate = bool(state["stepped"]), state["by_rate"]
            made._aided, made._unaided = _array(state["aided"]).reshape(2), _array(state["unaided"]).reshape(2)
            made._yaw_offset = float("nan") if state["yaw_offset"] is None else float(state["yaw_offset"])
            tilted, headed = state["measured"]
            made._measured = bool(tilted), bool(headed)
            made._check()
        except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
            raise RockerbogieError(f"the state is incomplete or damaged: {error}") from None
        return made

    def _check(self) -> None:
        """Raise ValueError if a state that was read holds what `state` never returns."""
        rows = self._rows.rows[: self._rows.count]
        lengths = np.concatenate([self._aided, self._unaided])
        if (self._track is None) != (len(rows) == 0) or self._rows.base < 0:
            raise ValueError("rows and track do not belong together")
        if not (np.isfinite(rows[:, [*range(6), at.S_TIME]]).all() and (np.diff(rows[:, at.S_TIME]) > 0).all()):
            raise ValueError("wheels or times of the rows are not finite, or times do not grow")
        if not (self._track is None or np.isfinite(self._track).all()):
            raise ValueError("the track is not finite")
        if not (np.isfinite(lengths).all() and (lengths >= 0).all()):
            raise ValueError("aided and unaided are no lengths")
        if not (self._by_rate is None or isinstance(self._by_rate, bool)):
            raise ValueError("by_rate is neither true nor false")

    def _confirm(self, smoothed: Array) -> Estimate:
        """Continue the track by the next row, which becomes final, and return the estimate there."""
        a, b = self._rows.raw(self._at), self._rows.raw(self._at + 1)
        found = self._step(a, b, self._smoothed, smoothed)
        self._at, self._smoothed = self._at + 1, smoothed
        return found

    def _begin(self, row: Array) -> Array:
        """Make the track at its first row, and return its state (T_SIZE,)."""
        reading = self._reading(row, row, row, row, 1.0)
        motion = interval_motion(self.rover, self._weights, reading)
        attitude = row[at.S_ATTITUDE : at.S_ATTITUDE + 3]
        self._track = track = new_track(self._start, attitude, motion.normal[0])
        self._measured = isfinite(attitude[0]) and isfinite(attitude[1]), isfinite(attitude[2])
        if self._measured[1]:
            self._yaw_offset = 0.0
        return track

    def _reading(self, a: Array, b: Array, A: Array, B: Array, dt: float) -> Array:
        """Return the readings (1, R_SIZE) of the interval between rows a and b, smoothed A and B."""
        reading = np.empty((1, at.R_SIZE))
        row_kernel.interval_reading(a, b, A, B, dt, bool(self._by_rate), self._rows.reach > 0, reading[0])
        return reading

    def _step(self, a: Array, b: Array, A: Array, B: Array, *, keep: bool = True) -> Estimate:
        """Return the estimate at row b, one row after a; A and B are these rows smoothed.

        If `keep`, the track continues from there. Otherwise the filter's state stays unchanged.
        """
        assert self._track is not None
        dt = float(b[at.S_TIME] - a[at.S_TIME])
        reading = self._reading(a, b, A, B, dt)
        motion = interval_motion(self.rover, self._weights, reading)
        if keep and not self._stepped:
            self._track = new_track(self._start, a[at.S_ATTITUDE : at.S_ATTITUDE + 3], motion.normal[0])
            self._stepped = True
        attitude = b[at.S_ATTITUDE : at.S_ATTITUDE + 3].copy()
        measured = isfinite(attitude[0]) and isfinite(attitude[1]), isfinite(attitude[2])
        attitude[2] += self._yaw_offset  # NaN before the first heading, which then continues the track's own
        track = self._track if keep else self._track.copy()
        has = measured[0], all(map(isfinite, reading[0, at.R_ROCKER_RATE : at.R_ROCKER_RATE + 3].tolist()))
        lengths = zip(self._aided.tolist(), self._unaided.tolist(), has, strict=True)
        share = [without / (with_ + without) if with_ + without > 0 else float(not now) for with_, without, now in lengths]
        before = track[at.T_LENGTH]
        T, P, lengths_slip = continue_track(
            track, track_noise(float(self._weights[at.W_WHEELBASE]), *share), np.array([dt]), motion, attitude[None]
        )
        if keep:
            travelled = track[at.T_LENGTH] - before
            for part, now in enumerate(has):
                (self._aided if now else self._unaided)[part] += travelled
            self._regain(track, measured, b)
        return self._estimate(b, motion, track, T[0], P[0], lengths_slip[0])

    def _regain(self, track: Array, measured: tuple[bool, bool], row: Array) -> None:
        """Reset attitude errors and heading offset where a sensor begins or begins again.

        Args:
            track: (T_SIZE,) state of the track; rows and columns of the attitude's errors are changed.
            measured: True where tilt and heading are measured now.
            row: the newest row of readings.
        """
        P = track[at.T_COVARIANCE : at.T_COVARIANCE + 36].reshape(6, 6)
        for k in (3, 4, 5):
            part = int(k == 5)
            if measured[part] and not self._measured[part] and not (part and np.isnan(self._yaw_offset)):
                P[k], P[:, k] = 0.0, 0.0
                P[k, k] = ATTITUDE_SIGMA[k - 3] ** 2
        if measured[1] and np.isnan(self._yaw_offset):
            R = track[at.T_ROTATION : at.T_ROTATION + 9].reshape(3, 3)
            self._yaw_offset = float(np.arctan2(R[1, 0], R[0, 0]) - row[at.S_ATTITUDE + 2])
        self._measured = measured

    def _estimate(
        self, row: Array, motion: IntervalMotion | None, track: Array, T: Array, P: Array, lengths_slip: Array
    ) -> Estimate:
        """Return the estimate at a row."""
        joints = row[at.S_STEERING : at.S_BOGIE + 2].copy()  # steering, rocker, bogies
        joints[np.isnan(joints)] = 0.0
        if motion is None:
            nothing = np.full(6, np.nan)
            twist, covariance, slip, angle = nothing, np.full((6, 6), np.nan), np.full((6, 3), np.nan), nothing
        else:
            twist, covariance = motion.motion[0, :6], motion.covariance[0, :6, :6]
            slip, angle = motion.residual[0], motion.contact_angle[0]
        return Estimate(
            self.rover, float(row[at.S_TIME]), T, P, twist, covariance, slip[:, 0], slip[:, 1], angle,
            joints[:6], float(joints[6]), joints[7:], *lengths_slip.tolist(),
        )  # fmt: skip


def _numbers(values: Array) -> Any:
    """Return an array as lists, with `None` for NaN."""
    found = values.astype(object)
    found[np.isnan(values)] = None
    return found.tolist()


def _array(values: Any) -> Array:
    """Return lists of `_numbers` as an array."""
    return np.array(values, dtype=float)
