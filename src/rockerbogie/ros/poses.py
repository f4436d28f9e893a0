"""Poses of a running rover from its ROS 2 topics, for a live view."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from ..errors import RockerbogieError
from ..logs.channels import SIDES
from ..logs.live_pose import LivePose
from ..rover.model import Rover
from ..rover.rotations import quaternion_angles
from .joints import JointReader
from .messages import seconds


class LivePoses:
    """Listener to odom and joint_states that gives the newest pose.

    It runs in a thread of its own, in its own ROS context, until it is closed or its `with` block ends.
    """

    def __init__(self, rover: Rover, *, namespace: str = "", names: Mapping[str, str] | None = None) -> None:
        """Start to listen.

        Args:
            rover: the rover.
            namespace: of its node.
            names: its joint names -> ours.
        """
        self.rover, self._reader = rover, JointReader(rover, names or {})
        self._values: dict[str, float] = {}
        self._pose: LivePose | None = None
        self._news = threading.Condition()
        self._closed = False
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("rockerbogie_view", context=self._context, namespace=namespace)
        self._node.create_subscription(JointState, "joint_states", self._on_joints, qos_profile_sensor_data)
        self._node.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def __enter__(self) -> LivePoses:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[LivePose]:
        """Yield each new pose, the newest if several came; end when the listener is closed."""
        last = None
        while True:
            with self._news:
                self._news.wait_for(lambda last=last: self._closed or self._pose is not last)  # type: ignore[misc]
                if self._closed:
                    return
                last = self._pose
            if last is not None:
                yield last

    @property
    def newest(self) -> LivePose | None:
        """The newest pose; `None` before the first."""
        return self._pose

    def close(self) -> None:
        """Stop to listen."""
        with self._news:
            self._closed = True
            self._news.notify_all()
        self._context.try_shutdown()
        self._thread.join(timeout=5.0)

    def _spin(self) -> None:
        """Serve the subscriptions until ROS shuts down; runs in the thread."""
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()

    def _on_joints(self, message: JointState) -> None:
        """Keep the joint angles of a message for the next pose."""
        try:
            self._values |= self._reader.read(message.name, message.position, message.velocity)
        except RockerbogieError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=5.0)

    def _on_odometry(self, message: Any) -> None:
        """Make the newest pose from odometry and the joint angles kept, and wake who waits for it."""
        at, q = message.pose.pose.position, message.pose.pose.orientation
        roll, pitch, yaw = quaternion_angles(q.w, q.x, q.y, q.z)
        names, value = self.rover.wheel_names, self._values
        pose = LivePose(
            seconds(message.header.stamp), at.x, at.y, at.z, roll, pitch, yaw,
            value.get("rocker", 0.0), np.array([value.get(f"bogie_{side}", 0.0) for side in SIDES]),
            np.array([value.get(f"steering_{name}", 0.0) for name in names]),
            np.array([value.get(f"wheel_angle_{name}", 0.0) for name in names]),
        )  # fmt: skip
        with self._news:
            self._pose = pose
            self._news.notify_all()
