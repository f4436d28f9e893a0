"""ROS 2 lifecycle node of a rover."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import Imu as ImuMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ..errors import RockerbogieError
from ..logs.estimate import Estimate
from ..logs.odometry_filter import OdometryFilter
from ..rover.formats import load_rover, to_urdf
from ..rover.model import Rover
from . import messages
from .command_part import CommandPart
from .costmap_part import LATCHED, CostMapPart
from .health import diagnoses
from .intake import AGREEING, Intake, Row
from .joints import JointReader, MotorNames, parse_names, read_description
from .parameters import PARAMETERS, check_value, declare, refusal
from .track_file import load_track, save_track

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
#: Seconds between two log messages on the same kind of event.
QUIET = 5.0
#: Longest wait of a row for the IMU reading of its time, s.
IMU_PATIENCE = 0.25


class RoverNode(LifecycleNode):  # type: ignore[misc]
    """Lifecycle node: joint states, IMU and twists in; odometry, commands and diagnoses out.

    Attributes:
        rover: the rover, once configured.
        odometer: its odometry.
        commands: its commands, once configured.
        cost_map: its cost map, if parameter cost_map is set.
        intake: its sensors.
        received: number of messages by kind.
    """

    # ROS destroys a node whose parameters it refuses: these exist before them
    rover: Rover | None = None
    commands: CommandPart | None = None
    cost_map: CostMapPart | None = None
    active = False
    _made: Sequence[Any] = ()

    def __init__(self, name: str = "rockerbogie", **options: Any) -> None:
        """Make an unconfigured node.

        Args:
            name: of the node.
            options: of rclpy's nodes: context, namespace, parameter_overrides, …
        """
        super().__init__(name, **options | {"automatically_declare_parameters_from_overrides": True})
        for sentence in declare(self):
            self.get_logger().warning(sentence)
        self._values: dict[str, Any] = {}
        self.add_on_set_parameters_callback(self._on_set)
        self._description = ""
        self._logged: dict[str, tuple[int, float]] = {}
        self._waiting_for_description: Any = None

    def value(self, name: str) -> Any:
        """Return the value of a parameter.

        Args:
            name: one of `PARAMETERS`.

        Returns:
            Its value.
        """
        if name not in self._values:
            self._values[name] = parameter_value_to_python(self.get_parameter(name).get_parameter_value())
        return self._values[name]

    def _on_set(self, parameters: Sequence[Any]) -> Any:
        """Accept parameters that need no new configuration, and all before it."""
        reason = refusal({p.name: p.value for p in parameters}, self.rover is not None)
        if not reason:
            self._values.clear()
        return SetParametersResult(successful=not reason, reason=reason)

    # Transitions

    def on_configure(self, state: LifecycleState) -> Any:
        """Load the rover, and subscribe.

        Args:
            state: before the transition.

        Returns:
            FAILURE with an error in the log if a parameter is wrong.
        """
        try:
            self._configure()
        except RockerbogieError as error:
            self.get_logger().error(str(error))
            self._release()
            return FAILURE
        return SUCCESS

    def on_activate(self, state: LifecycleState) -> Any:
        """Publish from now on.

        Args:
            state: before the transition.

        Returns:
            SUCCESS.
        """
        self.active = True
        if self.cost_map is not None:
            self.cost_map.activate()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> Any:
        """Stop the rover, and publish no more.

        Readings are still used, so that the track stays whole.

        Args:
            state: before the transition.

        Returns:
            SUCCESS.
        """
        self.stop()
        self.active = False
        if self.cost_map is not None:
            self.cost_map.active = False
        self.save()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> Any:
        """Release rover, track and topics.

        Args:
            state: before the transition.

        Returns:
            SUCCESS.
        """
        self._release()
        return SUCCESS

    def on_shutdown(self, state: LifecycleState) -> Any:
        """Stop the rover, save the track and release all.

        Args:
            state: before the transition.

        Returns:
            SUCCESS.
        """
        self.stop()
        self.save()
        self.active = False
        self._release()
        return SUCCESS

    def _configure(self) -> None:
        """Make all parts from the parameters."""
        for name in PARAMETERS:
            check_value(name, self.value(name))
        names = parse_names(self.value("joint_names"))
        description = self.value("robot_description") or self._description
        if self.value("rover"):
            self.rover = load_rover(self.value("rover"))
        elif description:
            self.rover, theirs = read_description(description)
            names = theirs | names
        else:
            raise RockerbogieError("no rover: set parameter rover to a preset or a file, or give robot_description")
        self.names = names
        patience = max(round(IMU_PATIENCE * self.value("command_rate")), 1)
        self.intake = Intake(self.rover, self.value("most_speed"), self.value("use_imu"), patience)
        self.reader, self.motors = JointReader(self.rover, names), MotorNames.of(self.rover, names)
        self.odometer = self._new_odometer(self.rover)
        self._imu_axes = messages.imu_axes(self.value("imu_frame"), self.value("imu_mounting"))
        self.estimate: Estimate | None = None
        self.failures = 0
        self.received, self._unstamped = Counter[str](), Counter[str]()
        self.joints_at = self.effort_at = -np.inf
        self.measured_steering, self.wheel_effort = np.full(6, np.nan), np.full(6, np.nan)
        self._connect(self.rover)

    def _new_odometer(self, rover: Rover) -> OdometryFilter:
        """Return the filter: continued from the state file, if it exists."""
        file = self.value("state_file")
        if (found := load_track(rover, file)) is not None:
            self.get_logger().info(f"the track continues from {file}")
            return found
        x, y, z = self.value("start_position")
        return OdometryFilter(rover, start=(x, y, z), window=self.value("smoothing_window"))

    def _connect(self, rover: Rover) -> None:
        """Make publishers, subscriptions, timers and parts."""
        reliability = ReliabilityPolicy.RELIABLE if self.value("reliable") else ReliabilityPolicy.BEST_EFFORT
        sensors = QoSProfile(depth=100, reliability=reliability)
        self.odom = self.create_lifecycle_publisher(Odometry, "odom", 10)
        self.state = self.create_lifecycle_publisher(DiagnosticArray, "rover/state", 10)
        self.tf = None
        if self.value("publish_tf"):
            self._transforms = messages.optional_message("tf2_msgs", "TFMessage")  # no wheel of it on PyPI
            if self._transforms is None:
                self.get_logger().warning("tf2_msgs is not installed: /tf is not published")
            else:
                self.tf = self.create_lifecycle_publisher(self._transforms, "/tf", 100)
        self._made = parts = [made for made in (self.odom, self.state, self.tf) if made is not None]
        if self.value("publish_robot_description"):
            publisher = self.create_publisher(String, "robot_description", LATCHED)
            publisher.publish(String(data=to_urdf(rover)))
            parts.append(publisher)
        parts += [
            self.create_subscription(JointState, "joint_states", self._on_joints, sensors),
            self.create_timer(1.0 / self.value("command_rate"), self._on_command_timer),
            self.create_timer(1.0 / self.value("state_rate"), self._on_state_timer),
        ]
        if self.value("use_imu"):
            parts.append(self.create_subscription(ImuMessage, "imu/data", self._on_imu, sensors))
        self.commands = CommandPart(self, rover, self.motors)
        if self.value("cost_map"):
            self.cost_map = CostMapPart(
                self,
                rover,
                layer=self.value("cost_map_layer"),
                spacing=self.value("cost_map_point_spacing"),
                frame=self.value("cost_map_frame"),
                headings=self.value("cost_map_headings"),
                resolution=self.value("cost_map_resolution") or None,
                limits=self.value("cost_map_limits"),
                layers=[name for name in self.value("cost_map_layers") if name],
                active=self.active,
            )

    def _release(self) -> None:
        """Destroy what `_connect` made."""
        for part in (self.commands, self.cost_map):
            if part is not None:
                part.close()
        self.commands = self.cost_map = None
        for made in self._made:
            messages.destroy(self, made)
        self._made, self.rover = [], None

    # Sensors

    def now(self) -> float:
        """Return the node's time.

        Returns:
            s; the simulation's if use_sim_time is set.
        """
        return 1e-9 * float(self.get_clock().now().nanoseconds)

    def _on_joints(self, message: JointState) -> None:
        """Take a joint state: continue the track by the rows that it completes."""
        self.joints_at = self.now()
        stamp = self._stamp_of(message, "joint states")
        if stamp is None:
            return
        try:
            values = self.reader.read(message.name, message.position, message.velocity)
            efforts = self.reader.efforts(message.name, message.effort)
        except RockerbogieError as error:
            self.complain("joint states", str(error))
            return
        if efforts:
            self.effort_at = self.joints_at
            self.wheel_effort[list(efforts)] = list(efforts.values())
        self._take(self.intake.joints(stamp, values))

    def _on_imu(self, message: ImuMessage) -> None:
        """Take an IMU reading: continue the track by the rows that waited for it."""
        stamp = self._stamp_of(message, "IMU readings")
        if stamp is not None:
            reading = messages.imu_reading(message, stamp, *self._imu_axes)
            self._take(self.intake.imu(reading))

    def _stamp_of(self, message: Any, kind: str) -> float | None:
        """Return the time of a message, s; that of reception for publishers that give none."""
        self.received[kind] += 1
        stamp = messages.seconds(message.header.stamp)
        if stamp > 0.0:
            self._unstamped[kind] = 0
            return stamp
        self._unstamped[kind] += 1
        self.complain(f"{kind} without time", f"{kind} come without a time: times of reception are used")
        return self.now() if self._unstamped[kind] >= AGREEING else None

    def _take(self, rows: Sequence[Row]) -> None:
        """Give rows to the filter, and publish its estimates."""
        for row in rows:
            try:
                self.estimate = self.odometer.update(row.time, row.joints, row.imu)
            except RockerbogieError as error:
                self.failures += 1
                self.complain("odometry", str(error))
                continue
            steering = row.joints.get("steering")
            self.measured_steering = np.full(6, np.nan) if steering is None else np.asarray(steering)
            if self.active:
                nanoseconds = round(1e9 * row.stamp)
                stamp = Time(nanoseconds=max(nanoseconds, 0)).to_msg()
                odometry = messages.odometry_message(self.estimate, stamp, self.value("odom_frame"), self.value("base_frame"))
                self.odom.publish(odometry)
                if self.tf is not None:
                    self.tf.publish(self._transforms(transforms=[messages.transform_of(odometry)]))
        for name, count in self.intake.events.items():
            if count != self._logged.get(name, (0, 0.0))[0]:
                self.complain(name, self.intake.last[name], count)

    def complain(self, name: str, text: str, count: int | None = None) -> None:
        """Write a warning to the log, at most every `QUIET` seconds for one kind.

        Args:
            name: of the kind.
            text: the warning.
            count: of events of that kind so far; `None`: not counted.
        """
        known, when = self._logged.get(name, (0, -np.inf))
        now = time.monotonic()
        if now - when >= QUIET:
            more = "" if count is None or count - known <= 1 else f" ({count - known} times)"
            self.get_logger().warning(f"{text}{more}")
            self._logged[name] = (known if count is None else count, now)

    def destroy_node(self) -> None:
        """End the parts, and release all."""
        self._release()
        super().destroy_node()

    # Commands and state

    def stop(self) -> None:
        """Stop the wheels; the steering stays."""
        if self.commands is not None:
            self.commands.stop()

    def _on_command_timer(self) -> None:
        """Use rows that have waited for long; repeat the last command, or stop."""
        self._take(self.intake.tick())
        if self.commands is not None:
            self.commands.tick()

    def _on_state_timer(self) -> None:
        """Publish the diagnoses while the node is active."""
        if self.active:
            self.state.publish(messages.diagnostics(self.get_clock().now().to_msg(), diagnoses(self)))

    def save(self) -> None:
        """Write the filter's state to the state file, if there is one."""
        file = self.value("state_file")
        if not file or self.rover is None:
            return
        try:
            save_track(self.odometer, file)
        except RockerbogieError as error:
            self.get_logger().error(str(error))

    def on_description(self, message: String) -> None:
        """Take the robot description, and start.

        Args:
            message: URDF, SDF or MJCF.
        """
        if self._waiting_for_description is not None:
            self.destroy_subscription(self._waiting_for_description)
            self._waiting_for_description = None
            self._description = message.data
            self.start()

    def start(self) -> bool:
        """Configure and activate the node, now or when robot_description comes.

        Returns:
            True if it is active, or waits for a robot description; False if a parameter is wrong.
        """
        if not (self.value("rover") or self.value("robot_description") or self._description):
            self.get_logger().info("waiting for robot_description")
            self._waiting_for_description = self.create_subscription(String, "robot_description", self.on_description, LATCHED)
            return True
        return bool(self.trigger_configure() == SUCCESS and self.trigger_activate() == SUCCESS)
