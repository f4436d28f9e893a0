"""Parameters of the node: names, defaults and meaning."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite
from typing import Any, NamedTuple

from ..errors import RockerbogieError, did_you_mean

#: Ranges of numbers: any but NaN; rates of timers, Hz; times, lengths and limits.
ANY, RATE, LENGTH = (-inf, inf), (1e-3, 1e4), (0.0, inf)


class Parameter(NamedTuple):
    """Parameter of the node."""

    default: bool | int | float | str | list[str] | list[float]
    text: str  # meaning and unit
    live: bool = False  # may be set while the node is configured
    limits: tuple[float, float] = ANY  # least and largest number


PARAMETERS: dict[str, Parameter] = {
    "rover": Parameter("", "preset, or path of a rover file; '' takes the rover from robot_description"),
    "robot_description": Parameter("", "URDF, SDF or MJCF of the robot; '' waits for topic robot_description if rover is '' too"),
    "joint_names": Parameter([""], "THEIRS=OURS each, as in fl_wheel=wheel_LF_joint or corner_fl=-steering_LF"),
    "autostart": Parameter(True, "configure and activate the node when it starts"),
    "odom_frame": Parameter("odom", "frame of the track"),
    "base_frame": Parameter("base_link", "frame of the body"),
    "publish_tf": Parameter(True, "publish odom_frame -> base_frame on /tf"),
    "publish_robot_description": Parameter(False, "publish the rover's URDF on robot_description, latched"),
    "start_position": Parameter([0.0, 0.0, 0.0], "x, y, z of the start, m"),
    "state_file": Parameter("", "file from which the track continues, and to which it is saved; '' for none"),
    "reliable": Parameter(False, "subscribe to joint states and IMU reliably; false accepts publishers of either kind"),
    "use_imu": Parameter(True, "use imu/data"),
    "imu_mounting": Parameter([0.0, 0.0, 0.0], "roll, pitch, yaw of the IMU in the body, rad"),
    "imu_frame": Parameter("enu", "reference axes of the IMU: enu or ned"),
    "smoothing_window": Parameter(
        1, "rows over which readings are smoothed, for encoders of few counts; 1 for none", limits=(1, 10_000)
    ),
    "most_speed": Parameter(5.0, "speed of a wheel's rim beyond which its counter has jumped, m/s", limits=(1e-3, inf)),
    "cmd_vel_stamped": Parameter(False, "cmd_vel is TwistStamped instead of Twist"),
    "cmd_vel_timeout": Parameter(0.5, "time after the last cmd_vel at which the rover stops, s", live=True, limits=LENGTH),
    "command_rate": Parameter(50.0, "least rate of commands while the rover moves, Hz", limits=RATE),
    "use_measured_steering": Parameter(
        True, "wait for measured steering angles, if there are any; false trusts the commands", live=True
    ),
    "use_contact_angles": Parameter(
        False, "command each wheel by its estimated contact angle, not by the plane of its path", live=True
    ),
    "share_load": Parameter(
        False, "slow down wheels whose effort in joint_states, N·m, exceeds the mean of the six; speed up the others", live=True
    ),
    "sharing_speed": Parameter(0.02, "change of a rim's speed for an effort that differs from the mean by g m r / 6, m/s"),
    "sharing_limit": Parameter(0.2, "largest change of a wheel's rate by its effort, as a share of the rate"),
    "steering_limit": Parameter(1.5707963267948966, "largest steering angle to either side, rad"),
    "wheel_rate_limit": Parameter(0.0, "largest rate of a wheel motor, rad/s; 0 for none", limits=LENGTH),
    "steering_rate_limit": Parameter(0.0, "largest rate of a steering motor, rad/s; 0 for none", limits=LENGTH),
    "steering_aligned": Parameter(0.05235987755982989, "steering error up to which the rover drives at full speed, rad"),
    "steering_waiting": Parameter(0.2617993877991494, "steering error from which the rover stands, rad"),
    "cost_map": Parameter(False, "publish the rover's cost map of the heights received"),
    "cost_map_headings": Parameter(16, "number of headings at which each cell is settled", limits=(1, inf)),
    "cost_map_resolution": Parameter(0.0, "side of a cell of the cost map, m; 0 takes that of the heights", limits=LENGTH),
    "cost_map_limits": Parameter("curiosity", "limits of a passable pose, as map --limits: a name"),
    "cost_map_layers": Parameter([""], "layers of map that are published on costmap_layers beside passable"),
    "cost_map_layer": Parameter("elevation", "layer of elevation_map with the heights"),
    "cost_map_point_spacing": Parameter(0.1, "side of the cells made from elevation_points, m"),
    "cost_map_frame": Parameter("map", "frame of the cost map if the heights come without one"),
    "state_rate": Parameter(5.0, "rate of rover/state, Hz", limits=RATE),
    "tip_margin_warning": Parameter(0.3490658503988659, "tip margin below which rover/state warns, rad", live=True),
    "tip_margin_error": Parameter(0.17453292519943295, "tip margin below which rover/state reports an error, rad", live=True),
    "slip_warning": Parameter(
        0.5,
        "slip of a wheel against the others, as a share of their speed, above which rover/state warns",
        live=True,
        limits=LENGTH,
    ),
    "sensor_timeout": Parameter(
        1.0, "time without joint states after which rover/state reports an error, s", live=True, limits=LENGTH
    ),
}

#: First parts of the names of parameters that ROS declares itself.
ROS_NAMES = ("use_sim_time", "start_type_description_service", "qos_overrides")
#: Parameters that must not be empty.
FRAMES = ("odom_frame", "base_frame", "cost_map_frame")


def declare(node: Any) -> list[str]:
    """Declare the parameters of a node, and report those that it does not have.

    The node must have declared all that it was given (rclpy's automatically_declare_parameters_from_overrides), of any type.
    These declarations are replaced by those with the types of the defaults, or removed if the name is not known.

    Args:
        node: an rclpy node.

    Returns:
        One sentence for each parameter that is not known, with the most similar known name.
    """
    given = node.get_parameters_by_prefix("")
    unknown = sorted(name for name in given if name not in PARAMETERS and name.split(".")[0] not in ROS_NAMES)
    defaults = {name: parameter.default for name, parameter in PARAMETERS.items()} | {"use_sim_time": False}
    for name in given.keys() & {*unknown, *defaults}:
        node.undeclare_parameter(name)
    for name, default in defaults.items():
        node.declare_parameter(name, default)
    return [f"parameter {name} is not known and has no effect{did_you_mean(name, PARAMETERS)}" for name in unknown]


def check_value(name: str, value: Any) -> None:
    """Raise if a value of the right type is out of its parameter's range.

    Args:
        name: one of `PARAMETERS`.
        value: in the type of the default.

    Raises:
        RockerbogieError: NaN, a number outside the limits, numbers that are not three finite ones, or a frame without a name.
    """
    default, _, _, (low, high) = PARAMETERS[name]
    if isinstance(default, (int, float)) and not low <= value <= high:
        wanted = "a number, not NaN" if (low, high) == ANY else f"{low:g} to {high:g}"
        raise RockerbogieError(f"parameter {name} is {value:g}; give {wanted}")
    if isinstance(default, list) and isinstance(default[0], float) and not (len(value) == 3 and all(map(isfinite, value))):
        raise RockerbogieError(f"parameter {name} is {list(value)}; give three finite numbers")
    if name in FRAMES and not value.strip():
        raise RockerbogieError(f"parameter {name} is empty; give the name of a frame")


def refusal(values: Mapping[str, Any], configured: bool) -> str:
    """Return the reason for which parameters cannot be set now.

    Args:
        values: by name, in the types of the defaults; names that are not in `PARAMETERS` are left out.
        configured: True while the node is configured.

    Returns:
        One sentence; '' if they can be set.
    """
    known = {name: value for name, value in values.items() if name in PARAMETERS}
    if configured and (fixed := [name for name in known if not PARAMETERS[name].live]):
        return f"{', '.join(fixed)} is read when the node is configured: clean it up first"
    try:
        for name, value in known.items():
            check_value(name, value)
    except RockerbogieError as error:
        return str(error)
    return ""
