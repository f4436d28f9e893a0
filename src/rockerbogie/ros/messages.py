"""ROS messages from numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu as ImuMessage

from ..arrays import Array
from ..errors import RockerbogieError
from ..logs.estimate import Estimate
from ..logs.mcap import UNMEASURED
from ..logs.sensor_checks import NED, attitude_of, turn_attitude
from ..rover.rotations import body_transform
from .intake import Imu

#: Levels of a diagnosis, from best to worst.
OK, WARN, ERROR, STALE = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE)


def seconds(stamp: Any) -> float:
    """Return a stamp in seconds.

    Args:
        stamp: builtin_interfaces/Time.

    Returns:
        s.
    """
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def optional_message(package: str, name: str) -> Any:
    """Return a message type that the extra `ros2` does not bring.

    Args:
        package: of ROS, such as tf2_msgs.
        name: of the type.

    Returns:
        The type; `None` if the package is not installed.
    """
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except ModuleNotFoundError:
        return None


def destroy(node: Any, made: Any) -> None:
    """Destroy a publisher, subscription or timer of a node.

    Args:
        node: of rclpy.
        made: by that node.
    """
    for kind in ("publisher", "subscription", "timer"):
        if type(made).__name__.lower().endswith(kind):
            getattr(node, f"destroy_{kind}")(made)


def imu_axes(frame: str, mounting: Sequence[float]) -> tuple[Array | None, Array | None]:
    """Return the axes of an IMU as `imu_reading` takes them.

    Args:
        frame: its reference axes, "enu" or "ned".
        mounting: roll, pitch, yaw of the IMU in the body, rad.

    Returns:
        World and body axes, (3, 3) each; `None` where they need no change.

    Raises:
        RockerbogieError: another frame.
    """
    if frame not in ("enu", "ned"):
        raise RockerbogieError(f"imu_frame is {frame!r}; give 'enu' or 'ned'")
    if frame == "enu" and not any(mounting):
        return None, None
    world, axes = NED if frame == "ned" else (np.eye(3), np.eye(3))
    roll, pitch, yaw = mounting
    return world, body_transform(0, 0, 0, roll, pitch, yaw)[:3, :3] @ axes


def imu_reading(message: ImuMessage, stamp: float, world: Array | None, body: Array | None) -> Imu:
    """Return an IMU message in the body's axes.

    Args:
        message: sensor_msgs/Imu; a first covariance of -1 marks what it does not measure.
        stamp: s.
        world: (3, 3) from the sensor's reference axes to x east, y north, z up; `None` if they are these.
        body: (3, 3) T_body_sensor; `None` for a sensor along the body's axes.

    Returns:
        Attitude and gyro; NaN for what is not measured.
    """
    q, w = message.orientation, message.angular_velocity
    quaternion = np.array([[q.x, q.y, q.z, q.w]])
    attitude = np.full(3, np.nan)
    if message.orientation_covariance[0] != -1.0 and np.isfinite(quaternion).all() and (quaternion**2).sum() > 1e-6:
        attitude = attitude_of(quaternion)[0]
        if body is not None and world is not None:
            attitude = turn_attitude(attitude[None], world, body)[0]
    gyro = np.array([w.x, w.y, w.z])
    if message.angular_velocity_covariance[0] == -1.0:
        gyro = np.full(3, np.nan)
    elif body is not None:
        gyro = body @ gyro
    return Imu(stamp, attitude, gyro)


def odometry_message(estimate: Estimate, stamp: Any, frame: str, child: str) -> Odometry:
    """Return nav_msgs/Odometry of an estimate.

    Args:
        estimate: of the filter.
        stamp: of its readings.
        frame: odometry frame.
        child: the body's frame.

    Returns:
        The message; variances that are infinite are `UNMEASURED`.
    """
    message = Odometry()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, frame, child
    at, turn = message.pose.pose.position, message.pose.pose.orientation
    at.x, at.y, at.z = estimate.position.tolist()
    turn.x, turn.y, turn.z, turn.w = Rotation.from_matrix(estimate.T[:3, :3]).as_quat().tolist()
    message.pose.covariance = _covariance(estimate.pose_covariance)
    message.twist.covariance = _covariance(estimate.twist_covariance)
    twist = np.where(np.isfinite(estimate.twist), estimate.twist, 0.0).tolist()
    v, w = message.twist.twist.linear, message.twist.twist.angular
    v.x, v.y, v.z, w.x, w.y, w.z = twist
    return message


def _covariance(values: Array) -> Array:
    """Return a covariance (36,) without NaN and infinity."""
    flat = values.ravel()
    return np.where(np.isnan(flat), 0.0, np.clip(flat, -UNMEASURED, UNMEASURED))


def transform_of(odometry: Odometry) -> TransformStamped:
    """Return the transform of an odometry message.

    Args:
        odometry: the message.

    Returns:
        From its frame to its child frame.
    """
    found = TransformStamped()
    found.header, found.child_frame_id = odometry.header, odometry.child_frame_id
    at, moved = odometry.pose.pose.position, found.transform.translation
    moved.x, moved.y, moved.z = at.x, at.y, at.z
    found.transform.rotation = odometry.pose.pose.orientation
    return found


def status(name: str, level: bytes, text: str, values: Mapping[str, str], hardware: str) -> DiagnosticStatus:
    """Return a diagnosis.

    Args:
        name: part of the node that it is of.
        level: OK, WARN, ERROR or STALE.
        text: one sentence.
        values: names -> texts.
        hardware: name of the rover.

    Returns:
        The status.
    """
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=name, message=text, hardware_id=hardware, values=pairs)


def diagnostics(stamp: Any, found: Sequence[DiagnosticStatus]) -> DiagnosticArray:
    """Return an array of diagnoses.

    Args:
        stamp: present time.
        found: the diagnoses.

    Returns:
        The message.
    """
    message = DiagnosticArray(status=list(found))
    message.header.stamp = stamp
    return message
