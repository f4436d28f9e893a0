"""Intake of sensor messages that may be late, doubled, faulty or missing."""

from __future__ import annotations

import bisect
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array
from ..logs.channels import SIDES
from ..logs.sensor_checks import MOST_SPEED
from ..rover.model import Rover

#: Greatest distance in time of an IMU reading that is used for a row, s.
IMU_REACH = 0.1
#: Values of joints without wheels that are older than this are not used, s.
STALE = 0.5
#: A step of the clock back by more than this is a clock that was set, once so many messages in a row agree, s.
CLOCK_BACK, AGREEING = 1.0, 3
#: A step in time beyond which a gap is reported, s.
GAP = 1.0
#: Angles that all six wheels have after a restart, at most, and that one had before, at least, rad.
RESTARTED, TURNED = 0.5, 1.5


@dataclass
class Row:
    """Readings of all sensors at one time, as `OdometryFilter.update` takes them."""

    stamp: float  # s, of the message
    time: float  # s, which always grows
    joints: dict[str, Array | float]
    imu: dict[str, Array | float] | None


@dataclass
class Imu:
    """Attitude and angular velocity at one time, in the body's axes; NaN where missing."""

    stamp: float  # s
    attitude: Array  # (3,) roll, pitch, yaw, rad
    gyro: Array  # (3,) rad/s


@dataclass
class Intake:
    """Intake of joint states and IMU readings in the order of their arrival.

    `events` counts what was found, by name; `last` holds a sentence for each, of the last time.
    """

    rover: Rover
    most_speed: float = MOST_SPEED  # of a wheel's rim, m/s
    uses_imu: bool = True
    patience: int = 12  # ticks that a row waits for its IMU reading; then the IMU is silent, and no row waits until it is heard
    events: Counter[str] = field(default_factory=Counter)
    last: dict[str, str] = field(default_factory=dict)
    _values: dict[str, tuple[float, float]] = field(default_factory=dict, repr=False)  # column -> stamp, value
    _fresh: set[str] = field(default_factory=set, repr=False)  # wheels since the last row
    _waiting: list[tuple[float, float, dict[str, Array | float]]] = field(
        default_factory=list, repr=False
    )  # stamp, tick of arrival, joints
    _ticks: int = field(default=0, repr=False)
    _silent: bool = field(default=False, repr=False)  # the IMU has kept a row waiting for too long
    _imu: deque[Imu] = field(default_factory=lambda: deque(maxlen=400), repr=False)
    _stamp: float = field(default=-np.inf, repr=False)  # of the last row given
    _shift: float = field(default=0.0, repr=False)  # time minus stamp, s
    _step: float = field(default=0.02, repr=False)  # the last usual step, s
    _old: list[float] = field(default_factory=list, repr=False)  # stamps of messages before the last row, in a row
    _old_imu: int = field(default=0, repr=False)
    _raw: Array | None = field(default=None, repr=False)  # (6,) wheel angles of the last row, as they came
    _turned: Array = field(default_factory=lambda: np.zeros(6), repr=False)  # (6,) added to wheel angles
    _total: Array = field(default_factory=lambda: np.zeros(6), repr=False)  # (6,) continuous wheel angles of the last row
    _rate: Array = field(default_factory=lambda: np.zeros(6), repr=False)  # (6,) of the last step, rad/s

    def joints(self, stamp: float, values: Mapping[str, float]) -> list[Row]:
        """Add a joint state.

        Args:
            stamp: s.
            values: our columns -> rad or rad/s, any part of them.

        Returns:
            Rows that are complete now, oldest first.
        """
        if not np.isfinite(stamp):
            self._count("not finite", "a joint state has a time that is not finite and was dropped")
            return []
        wheels = {name: value for name, value in values.items() if name.startswith("wheel")}
        if not np.isfinite(list(wheels.values())).all():
            self._count("not finite", f"the joint state at {stamp:.3f} s has wheels that are not finite and was dropped")
            return []
        if wheels and self._is_old(stamp):
            return []
        for name, value in values.items():
            if np.isfinite(value):
                self._values[name] = (stamp, value)
            else:
                self._values.pop(name, None)
                self._count("not finite", f"{name} at {stamp:.3f} s is not finite and was not used")
        self._fresh |= wheels.keys()
        joints = self._complete(stamp)
        if joints is not None:
            self._fresh.clear()
            bisect.insort(self._waiting, (stamp, self._ticks, joints), key=lambda row: row[0])
        return self._ready()

    def imu(self, reading: Imu) -> list[Row]:
        """Add an IMU reading.

        Args:
            reading: in the body's axes.

        Returns:
            Rows that are complete now, oldest first.
        """
        found = bool(np.isfinite(reading.attitude).any() or np.isfinite(reading.gyro).any())
        if not (np.isfinite(reading.stamp) and found):
            self._count("not finite", "an IMU reading is not finite and was dropped")
            return []
        if self._imu and reading.stamp <= self._imu[-1].stamp:
            back = self._imu[-1].stamp - reading.stamp
            self._old_imu += 1
            if back <= CLOCK_BACK or self._old_imu < AGREEING:
                self._count("late IMU", f"an IMU reading is {back:.3f} s older than the one before it and was dropped")
                return self._ready()
            self._imu.clear()
        self._old_imu, self._silent = 0, False
        if self._imu:
            before = self._imu[-1].attitude[2]
            if np.isfinite(before) and np.isfinite(reading.attitude[2]):
                reading.attitude[2] += 2 * np.pi * np.round((before - reading.attitude[2]) / (2 * np.pi))
        self._imu.append(reading)
        return self._ready()

    def tick(self) -> list[Row]:
        """Count a tick of the timer.

        Rows wait by ticks, not by a clock: after a pause of the whole process, the messages that came in it are read between
        the ticks that follow.

        Returns:
            Rows that have waited for long enough, oldest first.
        """
        self._ticks += 1
        return self._ready()

    @property
    def missing(self) -> list[str]:
        """Names of the wheels from which no reading has come yet."""
        seen = {name.partition("_")[2].partition("_")[2] for name in self._values if name.startswith("wheel_")}
        return [name for name in self.rover.wheel_names if name not in seen]

    @property
    def has_imu(self) -> bool:
        """True while IMU readings keep up with the joint states."""
        return bool(self._imu) and not self._silent

    def _count(self, name: str, text: str) -> None:
        """Count an event."""
        self.events[name] += 1
        self.last[name] = text

    def _is_old(self, stamp: float) -> bool:
        """Return True for a message to drop; set the clock back if several messages agree."""
        doubled = any(stamp == waiting[0] for waiting in self._waiting) or stamp == self._stamp
        if doubled and self._all_fresh():
            self._count("duplicate", f"two joint states are of {stamp:.3f} s; the second was dropped")
            return True
        if doubled or stamp > self._stamp:
            self._old.clear()
            return False
        back = self._stamp - stamp
        if back > CLOCK_BACK:
            self._old = [t for t in self._old if t <= stamp] + [stamp]
            if len(self._old) >= AGREEING:
                self._old.clear()
                self._set_clock(stamp, f"the clock was set back by {back:.3f} s: the track continues from the pose before")
                return False
        self._count("late", f"a joint state came {back:.3f} s late, after its row was used, and was dropped")
        return True

    def _all_fresh(self) -> bool:
        """Return True if no wheel waits for the rest of its row."""
        return not self._fresh

    def _set_clock(self, stamp: float, text: str) -> None:
        """Continue at `stamp` one usual step after the last row."""
        self._count("clock set", text)
        self._shift = self._stamp + self._shift + self._step - stamp
        self._stamp = stamp - self._step
        self._waiting.clear()
        self._values = {name: value for name, value in self._values.items() if value[0] <= stamp}
        if self._imu and self._imu[-1].stamp > stamp + CLOCK_BACK:
            self._imu.clear()

    def _complete(self, stamp: float) -> dict[str, Array | float] | None:
        """Return the joints of a row, or `None` until all six wheels are new."""
        names = self.rover.wheel_names
        joints: dict[str, Array | float] = {}
        for kind in ("wheel_angle", "wheel_rate"):
            columns = [f"{kind}_{name}" for name in names]
            if all(column in self._fresh for column in columns):
                joints[kind] = np.array([self._values[column][1] for column in columns])
        if not joints:
            return None
        if "wheel_angle" in joints:
            joints.pop("wheel_rate", None)
        steering = np.array([self._recent(f"steering_{n}", stamp) for n in names])
        steering = np.where(self.rover.steers, steering, 0.0)
        if np.isfinite(steering).all() and self.rover.steers.any():
            joints["steering"] = steering
        rocker, bogie = self._recent("rocker", stamp), np.array([self._recent(f"bogie_{side}", stamp) for side in SIDES])
        if np.isfinite(rocker):
            joints["rocker"] = rocker
        if np.isfinite(bogie).all():
            joints["bogie"] = bogie
        return joints

    def _recent(self, column: str, stamp: float) -> float:
        """Return a value that is not stale; NaN otherwise."""
        at, value = self._values.get(column, (-np.inf, np.nan))
        return value if stamp - at <= STALE else float("nan")

    def _ready(self) -> list[Row]:
        """Return the rows whose IMU reading has come, or is not waited for any longer."""
        rows = []
        while self._waiting:
            stamp, ticks, joints = self._waiting[0]
            if self.uses_imu and not self._silent and (not self._imu or self._imu[-1].stamp < stamp):
                if self._ticks - ticks < self.patience:
                    break
                self._silent = True
            rows.append(self._row(stamp, joints))
            self._waiting.pop(0)
        return rows

    def _row(self, stamp: float, joints: dict[str, Array | float]) -> Row:
        """Return a row; its wheel angles are continuous and its time grows."""
        step = stamp - self._stamp
        first = not np.isfinite(step)
        if not first and step > GAP:
            self._count("gap", f"no joint states for {step:.2f} s before {stamp:.3f} s")
            if "wheel_rate" in joints:
                self._shift -= step - self._step
                self.last["gap"] += "; without wheel angles, the way in it is not known"
                step = self._step
        elif not first:
            self._step = step
        if "wheel_angle" in joints:
            joints["wheel_angle"] = self._continuous(np.asarray(joints["wheel_angle"]), 0.0 if first else step)
        self._stamp = stamp
        imu = self._imu_at(stamp) if self.uses_imu else None
        if self.uses_imu and imu is None and self._imu:
            self._count("no IMU", f"no IMU reading at {stamp:.3f} s: the wheels give the turn")
        return Row(stamp, stamp + self._shift, joints, imu)

    def _continuous(self, angle: Array, step: float) -> Array:
        """Return wheel angles (6,) without wraps and restarts of their counters."""
        if self._raw is not None and step > 0:
            change = angle - self._raw
            most = self.most_speed / float(self.rover.wheel_radius.min()) * step + 0.1
            jumps = np.abs(change) > most
            restarted = step > 0.5 * GAP and (np.abs(angle) < RESTARTED).all() and (np.abs(self._raw) > TURNED).any()
            if restarted:
                self._count("restart", "the wheels' counters restarted in a gap: the rover is taken to have stood")
                self._turned -= change
                self._rate = np.zeros(6)
            elif jumps.any():
                turn = 2 * np.pi * np.round(change / (2 * np.pi))
                wrapped = jumps & (np.abs(turn) == 2 * np.pi) & (np.abs(change - turn) <= most)
                wrapped &= np.maximum(np.abs(angle), np.abs(self._raw)) <= 2 * np.pi + 1e-6
                self._turned -= np.where(wrapped, turn, 0.0)
                lost = jumps & ~wrapped
                if lost.any():
                    which = ", ".join(n for n, bad in zip(self.rover.wheel_names, lost, strict=True) if bad)
                    self._count("counter jump", f"the angle of wheel {which} jumped; the jump was bridged by the speed before it")
                    self._turned -= np.where(lost, change - self._rate * step, 0.0)
            self._rate = (angle + self._turned - self._total) / step
        self._raw, self._total = angle, angle + self._turned
        return self._total.copy()

    def _imu_at(self, stamp: float) -> dict[str, Array | float] | None:
        """Return the IMU's reading at a time, linear between messages; `None` without one."""
        if not self._imu:
            return None
        stamps = [reading.stamp for reading in self._imu]
        k = bisect.bisect_left(stamps, stamp)
        if k < len(stamps) and stamps[k] == stamp:
            attitude, gyro = self._imu[k].attitude, self._imu[k].gyro
        elif 0 < k < len(stamps) and stamps[k] - stamps[k - 1] <= 0.5:
            a, b = self._imu[k - 1], self._imu[k]
            share = (stamp - a.stamp) / (b.stamp - a.stamp)
            attitude = a.attitude + share * (b.attitude - a.attitude)
            gyro = a.gyro + share * (b.gyro - a.gyro)
        else:
            nearest = self._imu[min(k, len(stamps) - 1)]
            if abs(nearest.stamp - stamp) > IMU_REACH:
                return None
            attitude, gyro = nearest.attitude, nearest.gyro
        found: dict[str, Array | float] = {}
        if np.isfinite(attitude[:2]).all():
            found |= {"roll": float(attitude[0]), "pitch": float(attitude[1])}
        if np.isfinite(attitude[2]):
            found["yaw"] = float(attitude[2])
        if np.isfinite(gyro).all():
            found["gyro"] = gyro
        return found or None
