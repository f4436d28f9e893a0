"""Readings of a log as rates over its intervals, with their noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .._kernels.odometry import layout as at
from ..errors import RockerbogieError
from ..rover.model import Rover
from .channels import LogReport, arrange_log
from .intervals import middle
from .resolution import COUNTS, LONGEST, joint_window, resolution_of, smooth, window_of
from .sensor_checks import check_heading, check_tilt, check_wheels
from .steps import turns

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of a log over its n intervals between n + 1 times."""

    time: Array  # (n + 1,) s
    wheel_rates: Array  # (n, 6) rad/s
    steering: Array  # (n, 6) rad, midway between times, as are rocker and bogie
    rocker: Array  # (n,) rad, 0 if not logged
    bogie: Array  # (n, 2) rad
    lean: Array | None  # (n + 1, 2) roll, pitch, rad
    yaw: Array | None  # (n + 1,) rad
    measured: dict[str, Array]  # rates, by the names of the arguments of `body_twist`
    window: int  # rows over which they are smoothed; 1 for none
    joint_error: float  # error of the suspension's rates from its resolution, rad/s

    @classmethod
    def of(cls, rover: Rover, log: xr.Dataset, report: LogReport) -> Readings:
        """Return the readings of a log.

        Args:
            rover: the rover that made the log.
            log: as for `odometry`.
            report: collects warnings on missing or contradictory sensors.

        Returns:
            Rates over the intervals, smoothed over the counts of encoders.

        Raises:
            RockerbogieError: no wheels, fewer than two rows, times that do not grow, or values that are not finite.
        """
        if "time" not in log.variables or log.sizes[log["time"].dims[0]] < 2:
            raise RockerbogieError("the log has no time, or fewer than two rows: odometry needs at least two rows")
        counts = log.attrs.get("counts_per_turn")
        checked = "read" in log.attrs
        log = arrange_log(rover, log)
        time = np.asarray(log["time"], dtype=float)
        dt = np.diff(time)
        if not (dt > 0).all():
            k = int(np.argmin(dt))
            raise RockerbogieError(f"time does not grow from row {k + 1} ({time[k]:g} s) to {time[k + 1]:g} s: sort the log")

        def column(name: str) -> Array | None:
            if name not in log:
                return None
            values = np.asarray(log[name], dtype=float)
            if not np.isfinite(values).all() and name != "gyro":
                row = int(np.argmin(np.isfinite(values).reshape(len(time), -1).all(axis=1)))
                raise RockerbogieError(f"{name} in the log is not finite in row {row + 1}: fill the gaps, or drop those rows")
            return values

        angle, speed = column("wheel_angle"), column("wheel_rate")
        if angle is None and speed is None:
            raise RockerbogieError("the log has neither wheel_angle nor wheel_rate: odometry needs one of them")
        steering, rocker, bogie = column("steering"), column("rocker"), column("bogie")
        if steering is None and rover.steers.any() and not checked:
            report.warn("the log has no steering: wheels are assumed to be straight")
        window, joint_error = _window(time, angle, (rocker, bogie), counts, rover, report)

        def rate(values: Array) -> Array:
            return np.diff(smooth(time, values, window), axis=0) / dt.reshape(-1, *[1] * (values.ndim - 1))

        spin = rate(angle) if angle is not None else middle(speed)  # type: ignore[arg-type]
        measured = {"wheel_rates": spin}
        for name, values in (("steering_rates", steering), ("rocker_rate", rocker), ("bogie_rates", bogie)):
            if values is not None:
                measured[name] = rate(values)
        roll, pitch, yaw, gyro = column("roll"), column("pitch"), column("yaw"), column("gyro")
        lean = None if roll is None or pitch is None else np.stack([roll, pitch], axis=-1)
        if lean is not None and yaw is not None:
            turn = turns(np.column_stack([lean, yaw]))
            if window > 1:
                turn = np.diff(smooth(time, np.concatenate([np.zeros((1, 3)), np.cumsum(turn, axis=0)]), window), axis=0)
            measured["gyro"] = turn / dt[:, None]
        else:
            if gyro is not None:
                measured["gyro"] = middle(gyro)
            elif yaw is not None and lean is None:  # a compass: only the angular velocity about z
                measured["gyro"] = np.stack([np.full(len(dt), np.nan)] * 2 + [rate(np.unwrap(yaw))], axis=-1)
            if lean is not None:
                measured["inclinometer_rates"] = rate(lean)
        s = cls(
            time,
            spin,
            np.zeros((len(dt), 6)) if steering is None else np.where(rover.steers, middle(steering), 0.0),
            np.zeros(len(dt)) if rocker is None else middle(rocker),
            np.zeros((len(dt), 2)) if bogie is None else middle(bogie),
            lean,
            yaw,
            measured,
            window,
            joint_error,
        )
        if not checked:
            _compare(rover, s, report)
        return s

    @property
    def attitude(self) -> Array:
        """(n + 1, 3) roll, pitch, yaw, rad; NaN where not logged."""
        found = np.full((len(self.time), 3), np.nan)
        if self.lean is not None:
            found[:, :2] = self.lean
        if self.yaw is not None:
            found[:, 2] = self.yaw
        return found

    @property
    def has_suspension(self) -> bool:
        """True if rocker and bogies are logged."""
        return "rocker_rate" in self.measured and "bogie_rates" in self.measured

    def packed(self) -> Array:
        """Return the readings as the kernels take them.

        Returns:
            (n, R_SIZE), NaN where a sensor is missing.
        """
        m, found = self.measured, np.full((len(self.wheel_rates), at.R_SIZE), np.nan)
        found[:, at.R_WHEEL : at.R_WHEEL + 6] = self.wheel_rates
        found[:, at.R_STEERING : at.R_STEERING + 6] = self.steering
        found[:, at.R_STEERING_RATE : at.R_STEERING_RATE + 6] = m.get("steering_rates", 0.0)
        found[:, at.R_ROCKER] = self.rocker
        found[:, at.R_BOGIE : at.R_BOGIE + 2] = self.bogie
        found[:, at.R_ROCKER_RATE] = m.get("rocker_rate", np.nan)
        found[:, at.R_BOGIE_RATE : at.R_BOGIE_RATE + 2] = m.get("bogie_rates", np.nan)
        found[:, at.R_GYRO : at.R_GYRO + 3] = m.get("gyro", np.nan)
        found[:, at.R_TILT_RATE : at.R_TILT_RATE + 2] = m.get("inclinometer_rates", np.nan)
        if self.lean is not None:
            found[:, at.R_TILT : at.R_TILT + 2] = middle(self.lean)
        return found


def _window(
    time: Array, angle: Array | None, joints: tuple[Array | None, ...], counts: float | None, rover: Rover, report: LogReport
) -> tuple[int, float]:
    """Return the rows to smooth over, and the error left in the joints' rates, rad/s."""
    window = 1
    if angle is not None:
        grid = 2 * np.pi / float(counts) if counts else float(np.median([resolution_of(column) for column in angle.T]))
        if grid > 0:
            window = window_of(time, angle, grid)
            span = window * float(np.median(np.diff(time)))
            if window > 1 and span > 0.9 * LONGEST:
                report.warn(
                    f"the wheels' encoders give {2 * np.pi / grid:.0f} counts a turn, fewer than {COUNTS:.0f} in {LONGEST:g} s: "
                    "expect an error of 1 % of the distance, more where the speed changes"
                )
    grid = max((resolution_of(c) for j in joints if j is not None for c in j.reshape(len(time), -1).T), default=0.0)
    if grid > 0:
        window = max(window, joint_window(time, grid))
        return window, grid / np.sqrt(6) / (window * float(np.median(np.diff(time))))
    return window, 0.0


def _compare(rover: Rover, s: Readings, report: LogReport) -> None:
    """Warn if wheels, steering and heading disagree, in logs that `read_log` has not compared."""
    check = check_wheels(rover, s.time, s.wheel_rates, s.steering)
    for text in check.warnings:
        report.warn(text)
    if s.yaw is not None:
        fault = check_heading(s.time, check.yaw, np.unwrap(s.yaw))
        if fault:
            report.warn(f"the log's yaw contradicts the wheels: {fault}")
    if s.lean is not None:
        fault = check_tilt(s.lean[:, 0], s.lean[:, 1])
        if fault:
            report.warn(f"the log's roll and pitch cannot be a rover's: {fault}")
