"""Part of the node: twists in, wheel and steering commands out."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from ..arrays import Array
from ..errors import RockerbogieError
from ..logs.estimate import Estimate
from ..motion.wheel_controller import WheelCommand, WheelController
from ..rover.model import Rover
from .intake import STALE
from .joints import MotorNames
from .messages import destroy


class Host(Protocol):
    """Node that holds the part; a lifecycle node of rclpy."""

    active: bool
    estimate: Estimate | None
    measured_steering: Array  # (6,) rad, NaN where not measured
    wheel_effort: Array  # (6,) torques of the wheel motors, N·m, NaN where not measured
    effort_at: float  # time of the last of them, s

    def now(self) -> float:
        """Return the node's time.

        Returns:
            s.
        """

    def value(self, name: str) -> Any:
        """Return a parameter.

        Args:
            name: one of `PARAMETERS`.

        Returns:
            Its value.
        """

    def complain(self, name: str, text: str, count: int | None = None) -> None:
        """Write a warning to the log.

        Args:
            name: of its kind.
            text: the warning.
            count: of events of that kind.
        """


class CommandPart:
    """Subscription to cmd_vel, and publishers of wheel and steering commands.

    Attributes:
        controller: computes the commands.
        command: the last one; `None` before the first.
        wanted: (3,) vx, vy (m/s) and ωz (rad/s) of the last twist; 0 after its timeout.
    """

    def __init__(self, node: Any, rover: Rover, motors: MotorNames) -> None:
        """Make controller, publishers and subscription from the node's parameters.

        Args:
            node: a `Host` that is a lifecycle node.
            rover: the rover.
            motors: names and signs of its motors.

        Raises:
            RockerbogieError: a wrong parameter.
        """
        self.node: Host = node
        self.motors = motors
        value, none = node.value, {0.0: np.inf}
        self.controller = WheelController(
            rover,
            steering_limit=value("steering_limit"),
            wheel_rate_limit=none.get(value("wheel_rate_limit"), value("wheel_rate_limit")),
            steering_rate_limit=none.get(value("steering_rate_limit"), value("steering_rate_limit")),
            aligned=value("steering_aligned"),
            waiting=value("steering_waiting"),
            sharing_speed=value("sharing_speed"),
            sharing_limit=value("sharing_limit"),
        )
        self.command: WheelCommand | None = None
        self.wanted, self._wanted_at, self._sent_at = np.zeros(3), -np.inf, -np.inf
        self._wheels = node.create_lifecycle_publisher(Float64MultiArray, "wheel_velocity_controller/commands", 10)
        self._steering = node.create_lifecycle_publisher(Float64MultiArray, "steering_position_controller/commands", 10)
        self._joints = node.create_lifecycle_publisher(JointState, "joint_commands", 10)
        kind = TwistStamped if value("cmd_vel_stamped") else Twist
        self._twists = node.create_subscription(kind, "cmd_vel", self.take, 10)

    def close(self) -> None:
        """Release topics."""
        for made in (self._wheels, self._steering, self._joints, self._twists):
            destroy(self.node, made)

    def take(self, message: Any) -> None:
        """Command the wheels for a twist.

        Args:
            message: geometry_msgs/Twist, or TwistStamped if parameter cmd_vel_stamped is set.
        """
        twist = message.twist if self.node.value("cmd_vel_stamped") else message
        wanted = np.array([twist.linear.x, twist.linear.y, twist.angular.z])
        if not np.isfinite(wanted).all():
            self.node.complain("cmd_vel", "cmd_vel is not finite: the rover stops")
            wanted = np.zeros(3)
        self.wanted, self._wanted_at = wanted, self.node.now()
        self._send()

    def tick(self) -> None:
        """Repeat the last twist, or stop if it is too old."""
        if not self.node.active or not np.isfinite(self._wanted_at):
            return
        now = self.node.now()
        age = now - self._wanted_at
        if age < 0.0 or age > self.node.value("cmd_vel_timeout"):
            if self.wanted.any():
                self.node.complain("cmd_vel timeout", f"no cmd_vel for {age:.2f} s: the rover stops")
            self.stop()
        elif now - self._sent_at > 0.5 / self.node.value("command_rate"):
            self._send()

    def stop(self) -> None:
        """Stop the wheels; the steering stays."""
        if np.isfinite(self._wanted_at):
            self.wanted, self._wanted_at = np.zeros(3), -np.inf
            self._send()

    def _send(self) -> None:
        """Compute and publish commands for the last twist."""
        node, controller = self.node, self.controller
        if not node.active:
            return
        now = node.now()
        usual = 1.0 / node.value("command_rate")
        dt = now - self._sent_at
        dt = dt if 0.0 < dt < 2.0 * usual else usual
        e = node.estimate
        steering = node.measured_steering if node.value("use_measured_steering") else None
        contact = e.contact_angle if e is not None and node.value("use_contact_angles") else None
        rocker, bogie = (0.0, np.zeros(2)) if e is None else (e.rocker, e.bogie)
        if steering is not None and not np.isfinite(steering[controller.rover.steers]).all():
            steering = None
        effort = node.wheel_effort if node.value("share_load") and 0.0 <= now - node.effort_at <= STALE else None
        try:
            command = controller.command(
                self.wanted, dt=dt, steering=steering, rocker=rocker, bogie=bogie, contact_angle=contact, effort=effort
            )
        except RockerbogieError as error:
            node.complain("commands", str(error))
            return
        if not np.isfinite(command.wheel_rates).all():
            node.complain("commands", "the present joint angles allow no motion with six wheels in contact: the wheels stop")
            command.wheel_rates[:] = 0.0
        self.command, self._sent_at = command, now
        rates = self.motors.wheel_signs * command.wheel_rates
        angles = self.motors.steering_signs * command.steering[controller.rover.steers]
        self._wheels.publish(Float64MultiArray(data=rates.tolist()))
        if len(angles):
            self._steering.publish(Float64MultiArray(data=angles.tolist()))
        message = JointState(name=[*self.motors.wheels, *self.motors.steering])
        message.header.stamp = self.node.get_clock().now().to_msg()  # type: ignore[attr-defined]
        message.position = [float("nan")] * 6 + angles.tolist()
        message.velocity = [*rates.tolist(), *[float("nan")] * len(angles)]
        self._joints.publish(message)
