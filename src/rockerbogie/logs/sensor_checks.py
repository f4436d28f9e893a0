"""Sensors of a log compared with each other: wheels with steering, an IMU with the wheels."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..arrays import Array
from ..rover.model import Rover
from ..rover.rotations import body_transform, euler_angles

#: Wheels and steering disagree if what they leave over exceeds this share of the speed (RMS).
MOST_RESIDUAL = 0.25
#: A change of signs explains a disagreement above the first share if it leaves less than the second share of it.
DOUBTFUL_RESIDUAL, EXPLAINED = 0.05, 0.3
#: Headings are compared if they turn by this angle at least, rad, in blocks of this time, s.
LEAST_TURN, BLOCK = np.radians(40), 1.0
#: A steering angle is doubtful if its median is off the hub's direction of travel by this angle, rad. Hubs that move at less
#: than this share of the usual speed are left out.
STEERING_OFF, MOVING = np.radians(3), 0.3
#: Wheels that do not steer share an axle line if their hubs are this close in x, as a share of the wheelbase.
ONE_LINE = 0.05
#: Ratio of an IMU's turning to the wheels' that slip may explain.
PLAUSIBLE = (0.3, 3.0)
#: Tilt that no rover has for half of a log, rad.
MOST_TILT = np.radians(40)
#: Speed that no rover of this kind reaches, m/s.
MOST_SPEED = 5.0
NED = (np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), np.diag([1.0, -1.0, -1.0]))


@dataclass(frozen=True)
class WheelCheck:
    """Planar motion by the wheels alone, and how well it fits them."""

    yaw: Array  # (n + 1,) heading from 0, rad
    residual: float  # RMS left over, as a share of the RMS speed
    warnings: tuple[str, ...]

    @property
    def consistent(self) -> bool:
        """True if wheels and steering agree."""
        return not self.warnings


def planar_motion(rover: Rover, wheel_rates: Array, steering: Array, without: int | None = None) -> tuple[Array, float]:
    """Compute the planar motion that fits six wheels best, on flat terrain and without slip.

    Args:
        rover: the rover.
        wheel_rates: (n, 6) rad/s.
        steering: (n, 6) rad.
        without: index of a wheel to leave out.

    Returns:
        vx, vy (m/s) and yaw rate (rad/s): (n, 3); the RMS residual as a share of the RMS wheel speed.
    """
    c, s = np.cos(steering), np.sin(steering)
    x, y = rover.hubs[:, 0], rover.hubs[:, 1]
    along = np.stack([c, s, s * x - c * y], axis=-1)
    across = np.stack([-s, c, c * x + s * y], axis=-1)
    A = np.concatenate([along, across], axis=1)
    b = np.concatenate([rover.wheel_radius * wheel_rates, np.zeros_like(wheel_rates)], axis=1)
    if without is not None:
        A, b = (np.delete(part, [without, without + 6], axis=1) for part in (A, b))
    normal = np.einsum("nij,nik->njk", A, A)
    v = np.linalg.solve(normal, np.einsum("nij,ni->nj", A, b)[..., None])[..., 0]
    left = b - np.einsum("nij,nj->ni", A, v)
    speed = float((b**2).sum())
    return v, float(np.sqrt((left**2).sum() / speed)) if speed > 0 else 0.0


def check_wheels(rover: Rover, time: Array, wheel_rates: Array, steering: Array) -> WheelCheck:
    """Compare the wheels with each other and with the steering.

    Args:
        rover: the rover.
        time: (n + 1,) s.
        wheel_rates: (n, 6) between the times, rad/s.
        steering: (n, 6) rad.

    Returns:
        The heading by the wheels, the residual, and warnings with the change of signs that would explain it.
    """
    block = _blocks(time)
    dt = np.diff(time[block])
    angle = np.concatenate([np.zeros((1, 6)), np.cumsum(wheel_rates * np.diff(time)[:, None], axis=0)])
    rates = np.diff(angle[block], axis=0) / dt[:, None]
    mean = np.add.reduceat(steering, block[:-1], axis=0) / np.diff(block)[:, None]
    _, residual = planar_motion(rover, rates, mean)
    v, _ = planar_motion(rover, wheel_rates, steering)
    yaw = np.concatenate([[0.0], np.cumsum(v[:, 2] * np.diff(time))])
    found = []
    fastest = float(np.percentile(np.abs(rover.wheel_radius * rates), 95))
    if fastest > MOST_SPEED:
        found.append(
            f"the wheels turn at {fastest:.3g} m/s: check the unit of wheel angles and of time (degrees? counts? milliseconds?)"
        )
    if residual > DOUBTFUL_RESIDUAL:
        text = f"wheels and steering disagree by {100 * residual:.0f} % of the wheels' speed"
        flips = [(flip, planar_motion(rover, rates * w, mean * s)[1]) for flip, w, s in _flips(rover)]
        flip, best = min(flips, key=lambda item: item[1])
        if best < EXPLAINED * residual:
            found.append(
                f"{text}; with the sign of {flip} turned it is {100 * best:.0f} %: if that is the cause, add {_options(flip)}"
            )
        else:
            alone = [planar_motion(rover, rates, mean, without=i)[1] for i in range(6)]
            odd = int(np.argmin(alone))
            if alone[odd] < EXPLAINED * residual:
                name = rover.wheel_names[odd]
                found.append(f"{text}; without wheel {name} it is {100 * alone[odd]:.0f} %: check its rate and steering")
            elif residual > MOST_RESIDUAL:
                found.append(f"{text}: check names, units and signs of wheels and steering")
    if not found:
        found += _doubtful_steering(rover, rates, mean)
    return WheelCheck(yaw, residual, tuple(found))


def _doubtful_steering(rover: Rover, wheel_rates: Array, steering: Array) -> list[str]:
    """Compare each steering angle with the direction in which the other wheels carry its hub.

    Rovers whose fixed wheels do not share an axle line are left out: they turn with side slip.

    Args:
        rover: the rover.
        wheel_rates, steering: (n, 6) rad/s and rad.

    Returns:
        A warning for the wheel that is off the most; no warning if all agree.
    """
    fixed = rover.hubs[~rover.steers, 0]
    if not rover.steers.any() or (len(fixed) and np.ptp(fixed) > ONE_LINE * rover.wheelbase):
        return []
    off = np.zeros(6)
    for i in np.flatnonzero(rover.steers):
        v, _ = planar_motion(rover, wheel_rates, steering, without=int(i))
        x, y, _ = rover.hubs[i]
        along, across = v[:, 0] - v[:, 2] * y, v[:, 1] + v[:, 2] * x
        speed = np.hypot(along, across)
        moving = speed > MOVING * np.percentile(speed, 90)
        if not moving.any():
            continue
        apart = (steering[moving, i] - np.arctan2(across, along)[moving] + np.pi / 2) % np.pi - np.pi / 2  # rolling backward too
        middle = float(np.median(apart))
        if np.median(np.abs(apart - middle)) < abs(middle) / 2:
            off[i] = middle
    worst = int(np.argmax(np.abs(off)))
    if abs(off[worst]) < STEERING_OFF:
        return []
    return [
        f"steering of {rover.wheel_names[worst]} is {np.degrees(off[worst]):+.1f}° off the direction in which the other wheels "
        "carry it: check its sign, unit and zero"
    ]


def _flips(rover: Rover) -> list[tuple[str, Array, Array]]:
    """Return changes of sign to try: names, factors of wheels and of steering (6,)."""
    one = np.ones(6)
    found = [("steering", one, -one)]
    for side in (1, 0):
        wheels = ",".join(f"wheel_{rover.wheel_names[i]}" for i in range(side, 6, 2))
        factors = np.where(np.arange(6) % 2 == side, -1.0, 1.0)
        found += [(wheels, factors, one), (f"{wheels},steering", factors, -one)]
    for i, name in enumerate(rover.wheel_names):
        factors = np.where(np.arange(6) == i, -1.0, 1.0)
        found.append((f"wheel_{name}", factors, one))
        if rover.steers[i]:
            found.append((f"steering_{name}", one, factors))
    return found


def _options(names: str) -> str:
    """Return the command-line options that reverse the signs of sensors."""
    return " ".join(f"--flip {name}" for name in names.split(","))


def _blocks(time: Array) -> NDArray[np.int64]:
    """Return indices of times about `BLOCK` apart, the first and the last among them."""
    if time[-1] - time[0] > BLOCK * len(time):
        return np.arange(len(time))
    edges = np.searchsorted(time, np.arange(time[0], time[-1], BLOCK))
    return np.unique(np.concatenate([edges, [len(time) - 1]]))


def check_heading(time: Array, wheels: Array, measured: Array) -> str | None:
    """Compare the turning of a sensor with that of the wheels.

    Args:
        time: (n,) s.
        wheels: (n,) heading by the wheels, rad.
        measured: (n,) heading by the sensor, rad, continuous; NaN where it has none.

    Returns:
        A clause that states the disagreement; `None` if they agree as far as slip allows, or hardly turn.
    """
    k = _blocks(time)
    a, b = np.diff(wheels[k]), np.diff(measured[k])
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both], b[both]
    if not len(a):
        return None
    # sums over ten blocks, in which noise is small against a turn in one direction
    coarse = [float(np.abs(np.add.reduceat(v, np.arange(0, len(v), 10))).sum()) for v in (a, b)]
    if max(coarse) < LEAST_TURN:
        return None
    text = f"the wheels turn by {np.degrees(a.sum()):+.0f}° and this sensor by {np.degrees(b.sum()):+.0f}°"
    if coarse[0] < LEAST_TURN / 2:
        return text if coarse[1] > 2 * LEAST_TURN else None
    gain = float((a * b).sum() / (a * a).sum())
    if PLAUSIBLE[0] < gain < PLAUSIBLE[1]:
        return None
    hint = ""
    if -3 < gain < -0.3:
        hint = ", the other way (clockwise?)"
    elif 40 < abs(gain) < 80:
        hint = ", 57.3 times as much (degrees?)"
    return text + hint


def check_tilt(roll: Array, pitch: Array) -> str | None:
    """Check that an attitude is one a rover can have.

    Args:
        roll, pitch: (n,) rad, NaN where missing.

    Returns:
        A clause that states the tilt; `None` if it is possible.
    """
    tilt = float(np.nanmedian(np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1, 1))))
    return f"it lies at {np.degrees(tilt):.0f}° of tilt for half of the time" if tilt > MOST_TILT else None


def suggest_mounting(time: Array, wheels: Array, attitude: Array | None, gyro: Array | None) -> str:
    """Find the axes of an IMU, in steps of 90°, under which it agrees with the wheels.

    Args:
        time: (n,) s.
        wheels: (n,) heading by the wheels, rad.
        attitude: (n, 3) roll, pitch, yaw, rad, or `None`.
        gyro: (n, 3) rad/s, or `None`.

    Returns:
        A clause with the option to give; "" if no axes fit.
    """
    options = [("--imu-frame ned", *NED)]
    quarter = (0.0, np.pi / 2, np.pi, -np.pi / 2)
    seen: list[Array] = []
    for angles in sorted(itertools.product(quarter, (0.0, np.pi / 2, -np.pi / 2), quarter), key=lambda a: sum(map(abs, a))):
        M = body_transform(0, 0, 0, *angles)[:3, :3]
        if any(np.allclose(M, other) for other in seen):
            continue
        seen.append(M)
        options.append((f"--imu-mounting {','.join(f'{np.degrees(v):.0f}' for v in angles)}", np.eye(3), M))
    for option, world, body in options:
        if attitude is not None:
            roll, pitch, yaw = turn_attitude(attitude, world, body).T
            if check_tilt(roll, pitch) is None and check_heading(time, wheels, _unwrapped(yaw)) is None:
                return f"; {option} would make it agree"
        elif gyro is not None:
            rate = (gyro @ body.T)[:, 2] if option != "--imu-frame ned" else -gyro[:, 2]
            if check_heading(time, wheels, integrate_rate(time, rate)) is None:
                return f"; {option} would make it agree"
    return ""


def turn_attitude(attitude: Array, world: Array, body: Array) -> Array:
    """Return an attitude in other axes.

    Args:
        attitude: (n, 3) roll, pitch, yaw of the sensor, rad; NaN stays NaN.
        world: (3, 3) from the sensor's reference axes to x east, y north, z up.
        body: (3, 3) T_body_sensor, the axes of the sensor in the body.

    Returns:
        (n, 3) roll, pitch, yaw of the body, rad; yaw continuous.
    """
    found = np.full(attitude.shape, np.nan)
    finite = np.isfinite(attitude).all(axis=1)
    R = world @ body_transform(0, 0, 0, *attitude[finite].T)[:, :3, :3] @ body.T
    found[finite] = np.stack(euler_angles(R), axis=-1)
    found[:, 2] = _unwrapped(found[:, 2])
    return found


def _unwrapped(angle: Array) -> Array:
    """Return a copy of an angle without jumps of a turn; NaN stay."""
    finite = np.isfinite(angle)
    out = angle.copy()
    out[finite] = np.unwrap(angle[finite])
    return out


def integrate_rate(time: Array, rate: Array) -> Array:
    """Return the angle of a rate by the trapezoidal rule.

    Args:
        time: (n,) s.
        rate: (n,) rad/s; NaN counts as 0.

    Returns:
        (n,) rad, from 0.
    """
    rate = np.nan_to_num(rate)
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])


def attitude_of(quaternion: Array) -> Array:
    """Return roll, pitch and yaw of quaternions.

    Args:
        quaternion: (n, 4) x, y, z, w.

    Returns:
        (n, 3) rad.
    """
    return np.stack(euler_angles(Rotation.from_quat(quaternion).as_matrix()), axis=-1)
