"""IMU of a log: axes, choice among several, agreement with the wheels, gaps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..rover.rotations import body_transform
from .channels import LogReport
from .counters import replace_wild
from .sensor_checks import (
    NED,
    WheelCheck,
    attitude_of,
    check_heading,
    check_tilt,
    integrate_rate,
    suggest_mounting,
    turn_attitude,
)
from .stamps import resample

#: Least share of the log that an IMU covers to be used.
LEAST_COVER = 0.1
#: Clocks that differ by more are set to one, s.
CLOCK_SLACK = 1.0


@dataclass(frozen=True)
class Imu:
    """Attitude and angular rates of one sensor, each with its own times."""

    source: str
    frames: frozenset[str] = frozenset()
    attitude: tuple[Array, Array] | None = None  # times (n,), roll, pitch, yaw (n, 3) rad
    gyro: tuple[Array, Array] | None = None  # times (n,), (n, 3) rad/s

    @classmethod
    def from_signals(cls, source: str, frames: set[str], signals: dict[str, tuple[Array, Array]], report: LogReport) -> Imu:
        """Return the IMU of a topic.

        Args:
            source: topic.
            frames: frame_id of its messages.
            signals: `gyro_x` … and `q_x` … `q_w`, each with its times.
            report: gets a note for each repair.

        Returns:
            The IMU; parts without signals are `None`.
        """
        attitude = gyro = None
        if "q_w" in signals:
            time, angles = signals["q_w"][0], attitude_of(np.stack([signals[f"q_{k}"][1] for k in "xyzw"], axis=-1))
            roll, pitch, yaw = (replace_wild(time, angle, f"attitude of {source}", report) for angle in angles.T)
            attitude = (time, np.stack([np.unwrap(roll), pitch, np.unwrap(yaw)], axis=-1))
        if all(f"gyro_{k}" in signals and len(signals[f"gyro_{k}"][0]) == len(signals["gyro_x"][0]) for k in "xyz"):
            time = signals["gyro_x"][0]
            rates = [replace_wild(time, signals[f"gyro_{k}"][1], f"gyro of {source}", report) for k in "xyz"]
            gyro = (time, np.stack(rates, axis=-1))
        return cls(source, frozenset(frames), attitude, gyro)

    def turned(self, frame: str, mounting: tuple[float, float, float] | None) -> Imu:
        """Return the IMU in the body's axes: x forward, y left, z up over x east, y north, z up.

        Args:
            frame: "enu", or "ned" for axes x forward, y right, z down over north, east, down.
            mounting: roll, pitch, yaw of the sensor in the body, rad.

        Returns:
            The IMU itself if nothing turns.

        Raises:
            RockerbogieError: a frame that is not known.
        """
        if frame not in ("enu", "ned"):
            raise RockerbogieError(f"imu_frame is {frame!r}; give 'enu' or 'ned'")
        if frame == "enu" and mounting is None:
            return self
        world, axes = NED if frame == "ned" else (np.eye(3), np.eye(3))
        body = (np.eye(3) if mounting is None else body_transform(0, 0, 0, *mounting)[:3, :3]) @ axes
        attitude = None if self.attitude is None else (self.attitude[0], turn_attitude(self.attitude[1], world, body))
        gyro = None if self.gyro is None else (self.gyro[0], self.gyro[1] @ body.T)
        return replace(self, attitude=attitude, gyro=gyro)


@dataclass
class _Fitted:
    """An IMU at the times of the log, as far as it agrees with the wheels."""

    imu: Imu
    attitude: Array | None
    gyro: Array | None
    faults: list[str] = field(default_factory=list)

    @property
    def rank(self) -> tuple[int, int]:
        """Order of choice: fewest faults, then attitude before gyro alone."""
        return len(self.faults), -(2 * (self.attitude is not None) + (self.gyro is not None))


def fit_imu(imus: list[Imu], time: Array, check: WheelCheck, report: LogReport) -> tuple[Imu | None, Array | None, Array | None]:
    """Choose an IMU and return its readings at the times of the log.

    Readings that contradict the wheels grossly (no turning where the wheels turn, the opposite sense, an impossible tilt) are
    not used, with a warning, if wheels and steering agree with each other. Gaps of the attitude are filled by the
    wheels' own turning.

    Args:
        imus: candidates, in the body's axes.
        time: (n,) of the log, s.
        check: heading by the wheels.
        report: gets the choice, the gaps and the warnings.

    Returns:
        The chosen IMU; its attitude (n, 3) and gyro (n, 3), or `None` for what it does not give.
    """
    fitted = [_fit(imu, time, check) for imu in imus]
    if not fitted:
        return None, None, None
    best = min(fitted, key=lambda f: f.rank)
    for other in fitted:
        if other is not best:
            why = f": {other.faults[0]}" if other.faults else ""
            report.note(f"{other.imu.source} is another IMU and was not used{why}")
    if len(fitted) > 1:
        report.note(
            f"{best.imu.source} is used of {len(fitted)} IMUs: it agrees best with the wheels (--imu TOPIC chooses another)"
        )
    odd = sorted(frame for frame in best.imu.frames if frame not in ("", "base_link", "base_footprint", "body"))
    if odd and not best.faults:
        report.note(f"{best.imu.source} is in frame {', '.join(odd)}; it is taken to lie along the body's axes")
    for fault in best.faults:
        report.warn(f"{best.imu.source}: {fault}")
    attitude, gyro = best.attitude, best.gyro
    if attitude is not None:
        attitude = _fill(time, attitude, check, best.imu.source, report)
    if gyro is not None and not np.isfinite(gyro).all():
        lost = float((~np.isfinite(gyro).all(axis=1)).mean())
        report.warn(
            f"{best.imu.source}: the gyro is missing for {100 * lost:.0f} % of the log; the wheels give the turning there"
        )
    return best.imu, attitude, gyro


def _fit(imu: Imu, time: Array, check: WheelCheck) -> _Fitted:
    """Return an IMU's readings at the log's times, without those that contradict the wheels."""
    attitude = None if imu.attitude is None else resample(*imu.attitude, time)
    gyro = None if imu.gyro is None else resample(*imu.gyro, time)
    found = _Fitted(imu, attitude, gyro)
    for name in ("attitude", "gyro"):
        values = getattr(found, name)
        if values is None:
            continue
        cover = float(np.isfinite(values).all(axis=1).mean())
        if cover < LEAST_COVER:
            own = getattr(imu, name)[0]
            found.faults.append(
                f"the {name} covers {100 * cover:.0f} % of the log ({own[0] - time[0]:.6g} to {own[-1] - time[0]:.6g} s after "
                "its start) and is not used"
            )
            setattr(found, name, None)
            continue
        fault = _fault(name, values, time, check)
        if fault is None:
            continue
        if not check.consistent:
            found.faults.append(f"{name} and wheels disagree: {fault}")
            continue
        hint = suggest_mounting(time, check.yaw, values if name == "attitude" else None, values if name == "gyro" else None)
        found.faults.append(f"the {name} contradicts the wheels and is not used: {fault}{hint}")
        setattr(found, name, None)
    return found


def _fault(name: str, values: Array, time: Array, check: WheelCheck) -> str | None:
    """Return the disagreement of attitude or gyro with the wheels, if there is one."""
    if name == "attitude":
        same = bool(np.nanmax(np.ptp(values[np.isfinite(values).all(axis=1)], axis=0)) == 0)
        tilt = check_tilt(values[:, 0], values[:, 1])
        heading = check_heading(time, check.yaw, values[:, 2])
        return ("it never changes; " if same and heading else "") + (tilt or heading or "") or None
    return check_heading(time, check.yaw, integrate_rate(time, values[:, 2]))


def _fill(time: Array, attitude: Array, check: WheelCheck, source: str, report: LogReport) -> Array:
    """Return the attitude without gaps: yaw by the wheels, roll and pitch linear."""
    finite = np.isfinite(attitude).all(axis=1)
    if finite.all():
        return attitude
    filled = attitude.copy()
    known = np.flatnonzero(finite)
    for k in (0, 1):
        filled[~finite, k] = np.interp(time[~finite], time[finite], attitude[finite, k])
    wheels = check.yaw
    offset = attitude[known, 2] - wheels[known]
    turns = np.zeros(len(known))
    steps = np.diff(known)
    for j in np.flatnonzero(steps > 1):  # whole turns made inside a gap
        turns[j + 1 :] -= 2 * np.pi * np.round((offset[j + 1] + turns[j + 1] - offset[j] - turns[j]) / (2 * np.pi))
    filled[known, 2] += turns
    filled[~finite, 2] = wheels[~finite] + np.interp(time[~finite], time[known], offset + turns)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~finite).astype(int), [0]])))
    spans = [(time[max(a - 1, 0)], time[min(b, len(time) - 1)]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    long = [(a, b) for a, b in spans if b - a > 1.0]
    if long:
        listed = ", ".join(f"{a - time[0]:.1f} to {b - time[0]:.1f} s" for a, b in long[:3]) + (" …" if len(long) > 3 else "")
        report.warn(
            f"{source}: no attitude from {listed}; there the wheels give the heading, and roll and pitch are interpolated"
        )
    short = len(spans) - len(long)
    if short:
        report.note(f"{source}: {short} short gaps of the attitude were filled")
    return filled
