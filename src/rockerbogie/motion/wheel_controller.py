"""Controller of wheels and steering: motor commands for a wanted twist."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.jit.parallel import parallel_for
from .._kernels.odometry import commands as kernel
from .._kernels.odometry import layout as at
from ..errors import RockerbogieError, expect
from ..rover.model import LOAD_ROVER, Rover

Array = NDArray[np.float64]

#: Least speed that is a wish to move, m/s and rad/s.
STANDING = 1e-9
#: Gravity by which torques are compared, m/s².
GRAVITY = 9.81
#: Largest difference of a wheel's rate by its contact angle from its rate on the plane of the wheels, as a share of the latter.
#: Contact angles with errors can give several times the rate that a wheel needs on a rock.
MOST_CLIMBING = 0.6
#: Load sharing: change of the rim speed, m/s, of a wheel whose torque differs from the mean by g m r / 6 (mass m, wheel radius
#: r); time after which a lasting difference has doubled that change, s; largest change as a share of the wheel's rate.
SHARING_SPEED, SHARING_TIME, MOST_SHARING = 0.02, 0.4, 0.2


@dataclass(frozen=True, eq=False)
class WheelCommand:
    """Commands to the motors at one time, and the motion they make."""

    wheel_rates: Array  # (6,) rad/s, forward positive
    steering: Array  # (6,) rad
    twist: Array  # (6,) of the body, as the terrain constrains it, m/s and rad/s
    speed_scale: float  # share of the wanted speed, 0 to 1
    waiting: bool  # True while the wheels turn and the rover stands
    steering_error: Array  # (6,) steering to reach minus present steering, rad
    steering_short: Array  # (6,) steering without side slip minus the limited one, rad


class WheelController:
    """Controller that turns wheels first and drives as far as they have turned.

    Of the two steering angles at which a wheel rolls, the one nearer to its present angle is taken if it is within the limit.
    While a wheel is off its angle by more than `aligned`, the rover slows down; from `waiting` on it stands. All wheels are
    slowed alike, so that the path does not change.

    On rough terrain, six motors that hold rates which do not fit each other work against each other: wheels slip, and odometry
    is too long. Measured motor torques (`effort`) reduce this: a wheel whose torque exceeds the mean runs slower, and the others
    faster, by a proportional-integral rule within `sharing_limit`. The default gain is stable for motors that hold their rate
    with a time constant of 0.02 s or more, if commands follow within 0.04 s of the measurement.

    Attributes:
        steering: (6,) present steering angles, rad: those measured, or those commanded so far.
        trim: (6,) change of the wheel rates by the last efforts, rad/s; 0 without efforts.
    """

    def __init__(
        self,
        rover: Rover,
        *,
        steering_limit: ArrayLike = np.pi / 2,
        wheel_rate_limit: float = np.inf,
        steering_rate_limit: float = np.inf,
        aligned: float = np.radians(3.0),
        waiting: float = np.radians(15.0),
        sharing_speed: float = SHARING_SPEED,
        sharing_limit: float = MOST_SHARING,
    ) -> None:
        """Make a controller for a rover with straight wheels.

        Args:
            rover: the rover.
            steering_limit: largest angle to either side, a number or (6,), rad.
            wheel_rate_limit: largest rate of a wheel motor, rad/s.
            steering_rate_limit: largest rate of a steering motor, rad/s.
            aligned: steering error up to which the rover drives at full speed, rad.
            waiting: steering error from which it stands, rad, above `aligned`.
            sharing_speed: change of the rim speed, m/s, of a wheel whose effort differs from the mean by g m r / 6.
            sharing_limit: largest change as a share of the wheel's rate, from 0 (efforts are not used) to below 1.

        Raises:
            RockerbogieError: not a rover, a limit that is not above 0, or a gain or share out of its range.
        """
        expect(rover, Rover, "rover", LOAD_ROVER)
        numbers = {
            "wheel_rate_limit": wheel_rate_limit,
            "steering_rate_limit": steering_rate_limit,
            "aligned": aligned,
            "waiting": waiting,
            "sharing_speed": sharing_speed,
            "sharing_limit": sharing_limit,
        }
        for name, value in numbers.items():
            if not isinstance(value, (int, float, np.number)):
                raise RockerbogieError(f"{name} is {value!r:.60}; give a number")
        try:
            limit = np.array(np.broadcast_to(np.asarray(steering_limit, dtype=float), (6,)))
        except (TypeError, ValueError):
            raise RockerbogieError(f"steering_limit is {steering_limit!r:.60}; give a number or six, rad") from None
        if not ((limit > 0).all() and wheel_rate_limit > 0 and steering_rate_limit > 0):
            raise RockerbogieError("steering_limit, wheel_rate_limit and steering_rate_limit must be above 0 (rad, rad/s)")
        if not 0 <= aligned < waiting:
            raise RockerbogieError(f"aligned is {aligned!r} and waiting {waiting!r} rad; give 0 <= aligned < waiting")
        if not (0 <= sharing_speed < np.inf and 0 <= sharing_limit < 1):
            raise RockerbogieError(
                f"sharing_speed is {sharing_speed!r} m/s and sharing_limit {sharing_limit!r}; give a speed of 0 or above, and a "
                "share from 0 to below 1"
            )
        self.rover = rover
        self.sharing_speed, self.sharing_limit = sharing_speed, sharing_limit
        self.steering_limit, self.wheel_rate_limit, self.steering_rate_limit = limit, wheel_rate_limit, steering_rate_limit
        self.aligned, self.waiting = aligned, waiting
        self.steering = np.zeros(6)
        self.trim = np.zeros(6)
        self._lasting = np.zeros(6)  # integral part of the change of the rim speeds, m/s
        self._commanded: Array | None = None

    def command(
        self,
        twist: ArrayLike,
        *,
        dt: float | None = None,
        steering: ArrayLike | None = None,
        rocker: float = 0.0,
        bogie: ArrayLike = (0.0, 0.0),
        contact_angle: ArrayLike | None = None,
        effort: ArrayLike | None = None,
    ) -> WheelCommand:
        """Compute commands for a wanted twist.

        Args:
            twist: (6,) in the body frame, of which vx, vy and ωz are used, or these (3,): m/s and rad/s.
            dt: time until the next command, s. The steering commanded is what the motors reach in it; `None`: the final one.
            steering: (6,) measured steering angles, rad; NaN where there is none. Default: those commanded last.
            rocker: rad.
            bogie: (2,) rad.
            contact_angle: (6,) rad, as of `Estimate`; default and NaN: those of a rover on its plane of wheels (0 on flat
                terrain). They change rates only, each by at most 60 % of that on the plane; steering is that on the plane.
            effort: (6,) measured motor torques, forward positive, N·m; NaN where there is none. Default: no load sharing.

        Returns:
            The commands. Their twist is that before load sharing.

        Raises:
            RockerbogieError: a twist that is not finite, or a shape that does not fit.
        """
        wanted = _finite("twist", twist, (6,), (3,))
        wanted = wanted[[0, 1, 5]] if wanted.shape == (6,) else wanted
        if dt is not None and not (isinstance(dt, (int, float, np.number)) and dt > 0):
            raise RockerbogieError(f"dt is {dt!r} s; give a time above 0, or None")
        if steering is not None:
            measured = _six("steering", steering)
            self.steering = np.where(np.isfinite(measured), measured, self.steering)
        self.steering = np.where(self.rover.steers, self.steering, 0.0)
        reading = np.zeros(at.R_SIZE)
        reading[at.R_ROCKER] = _finite("rocker", rocker, ())
        reading[at.R_BOGIE : at.R_BOGIE + 2] = _finite("bogie", bogie, (2,))
        contact = np.zeros(6) if contact_angle is None else _six("contact_angle", contact_angle)
        present = self.steering
        reading[at.R_STEERING : at.R_STEERING + 6] = present
        torque = None if effort is None else _six("effort", effort)
        level = self._level(reading)
        contact = np.where(np.isfinite(contact), contact, level) if contact_angle is not None else level
        moving = bool(np.abs(wanted).max() > STANDING)
        before = present if self._commanded is None else self._commanded
        # estimated contact angles are noise while the rover stands: steering by them, it would wait for ever
        free = self._run(reading, level, wanted, fixed=False)[0] if moving else before
        target = np.clip(free, -self.steering_limit, self.steering_limit)
        error = target - present
        ahead = np.inf if dt is None else self.steering_rate_limit * dt
        commanded = before + np.clip(target - before, -ahead, ahead)
        worst = float(np.abs(error).max())
        share = float(np.clip((self.waiting - worst) / (self.waiting - self.aligned), 0.0, 1.0)) if moving else 0.0
        # rates that fit the present angles: a wheel that is not aligned yet rolls by what it moves along itself
        if dt is not None and np.isfinite(ahead):  # and by what it rolls about a steering axis beside it
            reading[at.R_STEERING_RATE : at.R_STEERING_RATE + 6] = (commanded - before) / dt
        _, motion, rates, _ = self._run(reading, contact, share * wanted, fixed=True)
        if contact_angle is not None and moving:
            flat = self._run(reading, level, share * wanted, fixed=True)[2]
            most = MOST_CLIMBING * np.abs(flat)
            rates = flat + np.clip(rates - flat, -most, most)
        rates = rates + self._share(torque, rates, dt)
        fastest = float(np.abs(rates).max())
        slower = min(1.0, self.wheel_rate_limit / fastest) if fastest > 0 else 1.0
        self._commanded = commanded
        if steering is None:
            self.steering = commanded
        return WheelCommand(
            slower * rates, commanded, slower * motion[:6], share * slower, moving and share == 0.0, error, free - target
        )  # fmt: skip

    def _share(self, torque: Array | None, rates: Array, dt: float | None) -> Array:
        """Set and return the changes (6,), rad/s, of rates (6,) that make torques (6,) more equal."""
        known = np.zeros(6, dtype=bool) if torque is None else np.isfinite(torque)
        if torque is None or known.sum() < 2:
            self._lasting, self.trim = np.zeros(6), np.zeros(6)
            return self.trim
        radius = self.rover.wheel_radius
        usual = GRAVITY * self.rover.mass * radius / 6.0  # N·m
        load = np.where(known, torque / usual, 0.0)
        speed = np.where(known, self.sharing_speed * (load[known].mean() - load), 0.0)
        most = self.sharing_limit * np.abs(rates) * radius
        if dt is not None:
            self._lasting = np.clip(np.where(known, self._lasting + speed * dt / SHARING_TIME, 0.0), -most, most)
        self.trim = np.clip(speed + self._lasting, -most, most) / radius
        return self.trim

    def _level(self, reading: Array) -> Array:
        """Return the contact angles (6,) of wheels on planes along the body's x and y."""
        rocker, (left, right) = float(reading[at.R_ROCKER]), reading[at.R_BOGIE : at.R_BOGIE + 2]
        other = float(self.rover.right_rocker(rocker))
        link = np.array([rocker, other, rocker + left, other + right, rocker + left, other + right])
        turn = reading[at.R_STEERING : at.R_STEERING + 6]
        return np.asarray(np.arctan2(-np.cos(turn) * np.sin(link), np.cos(link)))

    def _run(self, reading: Array, contact: Array, wanted: Array, *, fixed: bool) -> tuple[Array, Array, Array, Array]:
        """Return free steering (6,), motion (9,), wheel rates (6,), side slip (6,) of a twist (3,)."""
        out, steering = np.empty((1, at.C_SIZE)), reading[None, at.R_STEERING : at.R_STEERING + 6].copy()
        limits = np.stack([self.steering_limit, self.steering_limit])
        parallel_for(
            kernel.commands_batch, 1, self.rover.packed, self.rover.steers.copy(), reading[None], steering, contact[None],
            np.empty((0, 6, 4)), wanted[None], limits, fixed, out,
        )  # fmt: skip
        row = out[0]
        turn, motion, rates = row[: at.C_MOTION], row[at.C_MOTION : at.C_RATE], row[at.C_RATE : at.C_SIDE_SLIP]
        return turn, motion, rates, row[at.C_SIDE_SLIP : at.C_TURN_SLIP]


def _six(name: str, value: ArrayLike) -> Array:
    """Return an argument as an array (6,), NaN where a wheel has no value, or raise."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise RockerbogieError(f"{name} is {value!r:.60}; give six numbers, NaN for a wheel without one") from error
    if array.shape != (6,):
        raise RockerbogieError(f"{name} has shape {array.shape}; give (6,)")
    return array


def _finite(name: str, value: ArrayLike, *shapes: tuple[int, ...]) -> Array:
    """Return a finite array of one of the shapes, or raise."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.full((), np.nan)
    if array.shape not in shapes or not np.isfinite(array).all():
        wanted = " or ".join(str(shape) for shape in shapes)
        raise RockerbogieError(f"{name} is {value!r:.60}; give finite numbers of shape {wanted}")
    return array
