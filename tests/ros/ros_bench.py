"""Nodes on loopback: the rover's node, and a driver that publishes and records."""

from __future__ import annotations

import importlib.util
import os
import time

import pytest

MISSING = [
    m
    for m in ("rclpy", "sensor_msgs", "nav_msgs", "geometry_msgs", "std_msgs", "diagnostic_msgs")
    if not importlib.util.find_spec(m)
]
needs_ros = pytest.mark.skipif(
    bool(MISSING), reason=f"ROS 2 is not installed ({', '.join(MISSING)}): pip install 'rockerbogie[ros2]'"
)


#: Time in which both ends of a topic find each other after one has found the other, s.
SETTLING = 0.2


class Bench:
    """A rover's node, a driver node, and an executor for both."""

    def __init__(self, namespace: str = "", start: bool = True, **parameters: object) -> None:
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))  # tests of other processes stay apart
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
        self.started = self.node.start() if start else None

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.driver.destroy_node()
        self.context.try_shutdown()

    def publisher(self, kind, topic, qos=100):
        """Return a publisher of the driver, once the node is subscribed."""
        made = self.driver.create_publisher(kind, topic, qos)
        self.until(lambda: made.get_subscription_count() > 0, f"a subscription to {topic}")
        self.spin(SETTLING)
        return made

    def record(self, kind, topic, qos=1000):
        """Record a topic of the node from now on, with the time of reception; return the list."""
        found = self.received.setdefault(topic, [])
        made = self.driver.create_subscription(kind, topic, lambda m: found.append((time.perf_counter(), m)), qos)
        self.until(lambda: self.driver.count_publishers(made.topic_name) > 0, f"a publisher of {topic}")
        self.spin(SETTLING)
        return found

    def until(self, condition, what, seconds=10.0):
        """Run the nodes until a condition holds."""
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"no {what} within {seconds:g} s"
            self.executor.spin_once(timeout_sec=0.02)

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
