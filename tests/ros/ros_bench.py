"""Nodes on loopback: the rover's node, and a driver that publishes and records."""

from __future__ import annotations

import importlib.util
import os
import time
from typing import Any

import pytest

from support.patience import PATIENCE

MISSING = [
    m
    for m in ("rclpy", "sensor_msgs", "nav_msgs", "geometry_msgs", "std_msgs", "diagnostic_msgs")
    if not importlib.util.find_spec(m)
]
needs_ros = pytest.mark.skipif(
    bool(MISSING), reason=f"ROS 2 is not installed ({', '.join(MISSING)}): pip install 'rockerbogie[ros2]'"
)


def use_own_domain() -> None:
    """Separate the nodes of this process and its children from others on the machine."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))


class Bench:
    """A rover's node, a driver node, and an executor for both."""

    def __init__(self, namespace: str = "", start: bool = True, **parameters: object) -> None:
        use_own_domain()
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.parameter import Parameter

        from rockerbogie.ros.node import RoverNode

        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        overrides = [Parameter(name, value=value) for name, value in ({"reliable": True} | parameters).items()]
        self.node = RoverNode(context=self.context, namespace=namespace, parameter_overrides=overrides)
        self.driver = rclpy.create_node("driver", context=self.context, namespace=namespace)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.driver)
        self.received: dict[str, list] = {}
        self.sent: dict[str, int] = {}
        self._clock: Any = None
        self.started = self.node.start() if start else None

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.driver.destroy_node()
        self.context.try_shutdown()

    def publisher(self, kind, topic, qos=100):
        """Return a publisher of the driver that is matched with the node's subscription."""
        made = self.driver.create_publisher(kind, topic, qos)
        self.until(lambda: made.get_subscription_count() > 0, f"a subscription to {topic}")
        self.until(lambda: self._found(self.node.subscriptions, made, "get_publisher_count"), f"a publisher of {topic}")
        return made

    def record(self, kind, topic, qos=1000):
        """Record a topic of the node from now on, with the time of reception; return the list."""
        found = self.received.setdefault(topic, [])
        made = self.driver.create_subscription(kind, topic, lambda m: found.append((time.perf_counter(), m)), qos)
        self.until(lambda: made.get_publisher_count() > 0, f"a publisher of {topic}")
        self.until(lambda: self._found(self.node.publishers, made, "get_subscription_count"), f"a subscription to {topic}")
        return found

    @staticmethod
    def _found(ends, other, count):
        """Return True if the node's end of a topic has found the driver's end."""
        return any(end.topic_name == other.topic_name and getattr(end, count)() > 0 for end in ends)

    def until(self, condition, what):
        """Run the nodes until a condition holds."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f"not within {PATIENCE:g} s: {what}"
            self.executor.spin_once(timeout_sec=0.02)

    def set_time(self, seconds):
        """Set the clock of a node with use_sim_time, and wait until it has that time."""
        from rosgraph_msgs.msg import Clock

        if self._clock is None:
            self._clock = self.publisher(Clock, "/clock", 10)
        message, nanoseconds = Clock(), round(1e9 * seconds)
        message.clock.sec, message.clock.nanosec = divmod(nanoseconds, 10**9)
        self._clock.publish(message)
        self.until(lambda: self.node.get_clock().now().nanoseconds == nanoseconds, f"the time {seconds:g} s")

    def send(self, publisher, message, kind, backlog=3):
        """Publish a sensor's message once the node has read all but the last few before it."""
        publisher.publish(message)
        self.sent[kind] = self.sent.get(kind, 0) + 1
        self.until(lambda: self.node.received[kind] >= self.sent[kind] - backlog, f"reading of {kind}")

    def spin(self, seconds):
        """Run the nodes for a time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=min(left, 0.02))
