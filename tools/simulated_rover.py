"""Rover simulated by MuJoCo, for tools that close a loop by sensors and commands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import rockerbogie as rb
from rockerbogie.simulation.mjcf import build_spec
from rockerbogie.simulation.rigid_body import Rig

#: Time between commands, s; distance at which a corner is reached, m; largest rates of turn and of the steering motors, rad/s.
PERIOD, REACHED, TURNING, STEERING_RATE = 0.04, 0.25, 0.1, 0.3
#: Heading error from which the rover turns on the spot, and below which it drives on, rad.
ASIDE, ALIGNED = 0.5, 0.1
#: Height above the settled pose at the start, m; time to settle, s; terrain beyond the square, m.
START_LIFT, STAND, MARGIN = 2e-5, 0.5, 4.0


@dataclass
class Sensors:
    """Readings at one time."""

    time: float  # s, since the start
    wheel_angle: np.ndarray  # (6,) rad
    steering: np.ndarray  # (6,) rad
    suspension: np.ndarray  # (3,) rocker, left and right bogie, rad
    effort: np.ndarray  # (6,) torques of the hub motors, N·m
    quaternion: np.ndarray  # (4,) x, y, z, w of the body
    gyro: np.ndarray  # (3,) rad/s, in the body


class SimulatedRover:
    """Rover at the corner of a square on `surfaces.mars`, with hub motors that hold their rates.

    Attributes:
        corners: (4, 2) of the square, m; the last one is the start.
        length: distance driven so far, m.
    """

    def __init__(self, name: str, seed: int, rocks: float, side: float, friction: float = 1.0) -> None:
        self.rover = rb.load_rover(name)
        terrain = rb.surfaces.mars(seed=seed, k=rocks, size=2 * side + 3 * MARGIN)
        self.corners = np.array([(side, 0), (side, side), (0, side), (0, 0)], dtype=float) - side / 2
        pose = rb.settle(self.rover, terrain, *self.corners[-1], 0.0)
        self.rig = Rig(self.rover, build_spec(self.rover, terrain, friction=friction).compile())
        self.rig.place(pose, START_LIFT)
        self.rig.step(STAND)
        self._begin, self.length, self._turning = self.rig.data.time, 0.0, False

    @property
    def position(self) -> np.ndarray:
        """True (3,) x, y, z, m."""
        return np.array(self.rig.data.qpos[:3])

    def read(self) -> Sensors:
        """Return the sensors' readings."""
        s = self.rig.record()
        w, x, y, z = s.body_pose[3:]
        return Sensors(
            s.time - self._begin, s.wheel_angle, np.array(s.steering), s.hinge[[0, 2, 3]], s.wheel_torque,
            np.array([x, y, z, w]), s.body_velocity[3:],
        )  # fmt: skip

    def wanted(self, at: np.ndarray, yaw: float, corner: int, speed: float) -> tuple[float, float]:
        """Return speed, m/s, and turn rate, rad/s, towards a corner."""
        dx, dy = self.corners[corner] - at
        off = (np.arctan2(dy, dx) - yaw + np.pi) % (2 * np.pi) - np.pi
        self._turning = abs(off) > (ALIGNED if self._turning else ASIDE)
        if self._turning:
            return 0.0, float(np.copysign(TURNING, off))
        return speed, float(np.clip(0.6 * off, -TURNING, TURNING))

    def move(self, wheel_rates: np.ndarray, steering: np.ndarray) -> None:
        """Command the motors and advance by `PERIOD`."""
        before = self.position
        self.rig.command(wheel_rates, steering)
        self.rig.step(PERIOD)
        self.length += float(np.linalg.norm(self.position - before))


@dataclass
class Driven:
    """Result of a drive by odometry."""

    estimate: rb.Estimate  # the last one
    corners: int  # reached
    time: float  # simulated, s
    error: float  # of the last position, m
    doubted: float  # share of the distance of the track


def drive_by_odometry(
    robot: SimulatedRover, speed: float, legs: int, contact: bool, share: bool, reached: float, limit: float
) -> Driven:
    """Drive to corners by `WheelController` and `OdometryFilter`, without ROS.

    Args:
        robot: the rover.
        speed: m/s.
        legs: number of corners.
        contact: use contact angles for the wheel rates.
        share: share loads.
        reached: distance at which a corner is reached, m.
        limit: simulated time at which the drive ends, s.
    """
    odometer = rb.OdometryFilter(robot.rover, start=tuple(robot.position.tolist()))
    controller = rb.WheelController(robot.rover, steering_rate_limit=STEERING_RATE)
    corner, doubted, before = 0, 0.0, 0.0
    while True:
        now = robot.read()
        roll, pitch, yaw = angles(now.quaternion)
        rocker, bogie = now.suspension[0], now.suspension[1:]
        joints = {"wheel_angle": now.wheel_angle, "steering": now.steering, "rocker": rocker, "bogie": bogie}
        estimate = odometer.update(now.time, joints, {"roll": roll, "pitch": pitch, "yaw": yaw})
        doubted += (estimate.distance_3d - before) * estimate.doubted
        before = estimate.distance_3d
        corner += bool(np.hypot(*(robot.corners[corner] - estimate.position[:2])) < reached)
        if corner == legs or now.time >= limit:
            break
        v, turn = robot.wanted(estimate.position[:2], yaw, corner, speed)
        command = controller.command(
            (v, 0.0, turn), dt=PERIOD, steering=now.steering, rocker=rocker, bogie=bogie,
            contact_angle=estimate.contact_angle if contact else None, effort=now.effort if share else None,
        )  # fmt: skip
        robot.move(command.wheel_rates, command.steering)
    error = float(np.linalg.norm(estimate.position - robot.position))
    return Driven(estimate, corner, now.time, error, doubted / max(before, 1e-9))


def angles(quaternion: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw, rad."""
    yaw, pitch, roll = Rotation.from_quat(quaternion).as_euler("ZYX")
    return float(roll), float(pitch), float(yaw)
