"""Run of the rover's node in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter

from .._kernels.jit.uncompiled import compile_first
from ..errors import RockerbogieError
from .node import RoverNode


def main(args: Sequence[str] | None = None, name: str = "rockerbogie", values: Mapping[str, Any] | None = None) -> int:
    """Start ROS 2, make the node, and run it until it is interrupted or ROS shuts down.

    At the end the wheels are stopped, the track is saved to `state_file` if one is set, and ROS is shut down.

    Args:
        args: ROS arguments, such as --ros-args -p rover:=osr; `None` for those of the process.
        name: name of the node.
        values: parameters by name. They take precedence over those of `args`.

    Returns:
        Exit code: 0, or 2 if the node does not start because a parameter is wrong.

    Raises:
        RockerbogieError: ROS does not start.
    """
    try:
        rclpy.init(args=None if args is None else ["rockerbogie", *args])
        overrides = [Parameter(key, value=value) for key, value in (values or {}).items()]
        node = RoverNode(name, parameter_overrides=overrides)
    except (RuntimeError, ValueError, ParameterException, NameValidationException) as error:
        rclpy.try_shutdown()
        empty = " (a parameter without a value, such as []: give it one, or leave it out)" if "NOT_SET" in str(error) else ""
        raise RockerbogieError(f"ROS does not start: {' '.join(str(error).split())}{empty}") from None
    try:
        if node.value("autostart") and not node.start():
            return 2
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        with compile_first():
            executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if rclpy.ok() and node.rover is not None:
            node.stop()
        node.save()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
