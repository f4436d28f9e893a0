"""Command `rockerbogie ros`: the rover's ROS 2 node, or a package for colcon."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import RockerbogieError, require, unknown_name
from ..ros.joints import parse_names
from ..ros.parameters import PARAMETERS, check_value
from ..rover.formats import load_rover
from .common import Force

#: Packages of ROS that the node imports.
MODULES = ("rclpy", "sensor_msgs.msg", "nav_msgs.msg", "geometry_msgs.msg", "std_msgs.msg", "diagnostic_msgs.msg")
Many = Parameter(negative="")


def ros(
    *,
    rover: Annotated[str | None, Parameter(name=["--rover", "-r"])] = None,
    name: Annotated[list[str] | None, Parameter(name="--name", negative="", allow_leading_hyphen=True)] = None,
    params: Path | None = None,
    set_: Annotated[list[str] | None, Parameter(name="--set", negative="", allow_leading_hyphen=True)] = None,
    namespace: str | None = None,
    node_name: str = "rockerbogie",
    remap: Annotated[list[str] | None, Many] = None,
    use_sim_time: Annotated[bool, Many] = False,
    list_parameters: Annotated[bool, Many] = False,
    write_package: Path | None = None,
    force: Force = False,
) -> int:
    """Run a ROS 2 node of a rover: odometry, wheel commands, state; or write its package.

    Subscribes to joint_states, imu/data and cmd_vel; publishes odom, /tf, wheel_velocity_controller/commands,
    steering_position_controller/commands, joint_commands and rover/state. The page docs/ros.md describes topics and
    parameters. Needs ROS 2, or `pip install 'rockerbogie[ros2]'` on Linux; --write-package and --list-parameters do not.

    Parameters
    ----------
    rover
        A preset's name, or a rover file. Default: parameter rover, or the topic robot_description.
    name
        Your name of a joint, and ours: --name fl_wheel=wheel_LF_joint. A minus changes the sign, as in --name
        corner_fl=-steering_LF. May be repeated.
    params
        File of ROS parameters (YAML).
    set_
        A parameter: --set cmd_vel_timeout=1.0. May be repeated.
    namespace
        Namespace of the node and its topics.
    node_name
        Name of the node.
    remap
        A topic and its new name: --remap imu/data:=/imu. May be repeated.
    use_sim_time
        Use the time of /clock.
    list_parameters
        Print all parameters with their defaults, and exit.
    write_package
        Folder, such as the src of a workspace: write the package rockerbogie_ros into it, and exit.
    force
        Replace existing files of the package.
    """
    from ..ros.package import parameter_file
    from ..ros.package import write_package as write

    given = _given(set_ or []) | ({"joint_names": name} if name else {})
    parse_names(given.get("joint_names", []))
    if list_parameters:
        print(parameter_file(given), end="")
        return 0
    if write_package is not None:
        if rover is None:
            raise RockerbogieError("--write-package needs --rover NAME: a preset, or a rover file")
        for file in write(write_package, load_rover(rover), given, force=force):
            print(file)
        return 0
    if params is not None and not params.is_file():
        raise RockerbogieError(f"--params {str(params)!r} is not a file")
    if rover is not None:
        load_rover(rover)
        given["rover"] = rover
    require("rockerbogie ros", "ros2", *MODULES)
    from ..ros.run import main

    args = ["--ros-args", "-r", f"__node:={node_name}"]
    if namespace is not None:
        args += ["-r", f"__ns:=/{namespace.strip('/')}"]
    for pair in remap or ():
        args += ["-r", pair]
    if params is not None:
        args += ["--params-file", str(params)]
    if use_sim_time:
        args += ["-p", "use_sim_time:=true"]
    return main(args, name=node_name, values=given)


def _given(pairs: list[str]) -> dict[str, Any]:
    """Return the pairs of --set as values of the parameters' types."""
    found: dict[str, Any] = {}
    for pair in pairs:
        name, equals, text = pair.partition("=")
        if not equals:
            raise RockerbogieError(f"--set {pair!r} is not a pair: give NAME=VALUE, as in cmd_vel_timeout=1.0")
        if name not in PARAMETERS:
            raise RockerbogieError(f"--set: {unknown_name('parameter', name, PARAMETERS)}")
        found[name] = _value(name, text)
        check_value(name, found[name])
    return found


def _value(name: str, text: str) -> Any:
    """Return the text of a parameter in the type of its default."""
    default = PARAMETERS[name].default
    try:
        if isinstance(default, bool):
            return {"true": True, "false": False}[text.lower()]
        if isinstance(default, list):
            parts = [part.strip() for part in text.split(",")]
            return [float(part) for part in parts] if isinstance(default[0], float) else parts
        return type(default)(text)
    except (KeyError, ValueError):
        kind = {bool: "true or false", int: "a whole number", float: "a number", list: "numbers, separated by commas"}
        raise RockerbogieError(f"--set {name}={text!r}: give {kind.get(type(default), 'a text')}") from None
