"""ROS 2 bags in MCAP files: joint states and IMU in; a whole run out, for Foxglove and `ros2 bag`. Needs the `ros` extra."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..outputs import SOURCE, check_outputs
from ..rotations import body_transform, quaternion_angles
from ..rover.formats import to_urdf
from ..rover.formats.export_tree import tree_of
from ..rover.model import Rover

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

JOINT_STATE, IMU, ODOMETRY = "sensor_msgs/msg/JointState", "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry"
TF, STRING = "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"
WORLD, BODY = "odom", "base_link"


def read_bag(file: Path) -> dict[str, dict[str, Array]]:
    """What joint states and IMU in a bag hold: topic -> column -> (n,) values, `time` (s) among them.

    Joint positions stand under the joint's name, velocities under the name and `.rate`; of an IMU `roll`, `pitch`, `yaw`
    and `gyro_x` … where it gives them.

    Raises:
        RockerbogieError: no rosbags installed, or not a bag.
    """
    readers = _rosbags()
    topics: dict[str, list[dict[str, float]]] = {}
    try:
        with readers.AnyReader([file]) as bag:
            wanted = [c for c in bag.connections if c.msgtype in (JOINT_STATE, IMU)]
            for connection, stamp, raw in bag.messages(connections=wanted):
                message: Any = bag.deserialize(raw, connection.msgtype)
                header = message.header.stamp
                time = header.sec + 1e-9 * header.nanosec or 1e-9 * stamp
                row = _joint_row(message) if connection.msgtype == JOINT_STATE else _imu_row(message)
                topics.setdefault(connection.topic, []).append({"time": time} | row)
    except (readers.AnyReaderError, OSError, ValueError, KeyError) as error:
        raise RockerbogieError(f"{file.name} cannot be read as a ROS 2 bag: {' '.join(str(error).split())}") from None
    return {topic: _columns(rows) for topic, rows in topics.items()}


def _joint_row(message: Any) -> dict[str, float]:
    row = dict(zip(message.name, map(float, message.position), strict=False))
    return row | {f"{name}.rate": float(v) for name, v in zip(message.name, message.velocity, strict=False)}


def _imu_row(message: Any) -> dict[str, float]:
    row: dict[str, float] = {}
    if message.angular_velocity_covariance[0] >= 0:  # -1 is ROS's way to say: not measured
        row |= {f"gyro_{k}": float(getattr(message.angular_velocity, k)) for k in "xyz"}
    q = message.orientation
    if message.orientation_covariance[0] >= 0 and abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 0.01:
        row["roll"], row["pitch"], row["yaw"] = quaternion_angles(q.w, q.x, q.y, q.z)
    return row


def _columns(rows: list[dict[str, float]]) -> dict[str, Array]:
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def write_mcap(run: xr.Dataset, rover: Rover, file: str | Path, *, force: bool = False) -> None:
    """Write a run as an MCAP file of ROS 2 messages that Foxglove and `ros2 bag` open.

    Topics: `/joint_states` (JointState), `/imu` (Imu), `/odom` (Odometry), `/tf` (odom → base_link → every link) and
    `/robot_description` (the URDF, latched). Frames are ROS's own: x forward, y left, z up.

    Args:
        run: from `drive`, `simulate` or `odometry`: at least `x y z roll pitch yaw` over `time`; the joints it has.
        file: ends in .mcap; replaced if this package wrote it.
        force: replace a file that this package did not write.

    Raises:
        RockerbogieError: no rosbags installed, or the file cannot be written.
    """
    from scipy.spatial.transform import Rotation

    check_outputs([file], force=force)
    bags = _rosbags()
    store = bags.get_typestore(bags.Stores.ROS2_HUMBLE)
    make = _Messages(store)
    time = np.asarray(run["time"], dtype=float)
    pose = {name: np.asarray(run[name].values, dtype=float) for name in ("x", "y", "z", "roll", "pitch", "yaw")}
    R = body_transform(0, 0, 0, pose["roll"], pose["pitch"], pose["yaw"])[:, :3, :3]
    place = np.stack([pose[k] for k in "xyz"], axis=-1)
    known = np.isfinite(place).all(axis=1) & np.isfinite(R).all(axis=(1, 2))
    quaternion = np.full((len(time), 4), np.nan)
    quaternion[known] = Rotation.from_matrix(R[known]).as_quat()
    twist = _twist(time, place, R)
    angle, rate = _joints(run, rover, time)
    joints = tree_of(rover).joints
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "run"
        with bags.Writer(bag, version=bags.Writer.VERSION_LATEST, storage_plugin=bags.StoragePlugin.MCAP) as writer:
            topics = {
                topic: writer.add_connection(topic, kind, typestore=store, offered_qos_profiles=[bags.qos(latched=latched)])
                for topic, kind, latched in (
                    ("/robot_description", STRING, True),
                    ("/joint_states", JOINT_STATE, False),
                    ("/imu", IMU, False),
                    ("/odom", ODOMETRY, False),
                    ("/tf", TF, False),
                )
            }

            def send(topic: str, stamp: int, message: Any) -> None:
                writer.write(topics[topic], stamp, store.serialize_cdr(message, topics[topic].msgtype))

            send("/robot_description", round(1e9 * time[0]), make.String(data=f"{to_urdf(rover)}<!-- {SOURCE} -->\n"))
            for k in np.flatnonzero(known):
                stamp = round(1e9 * time[k])
                now, speed = ({name: values[k] for name, values in table.items()} for table in (angle, rate))
                links = [
                    make.transform(stamp, joint.parent, joint.child, joint.T[:3, 3], _about(joint.axis, now[name]))
                    for name, joint in joints.items()
                ]
                body = make.transform(stamp, WORLD, BODY, place[k], quaternion[k])
                send("/joint_states", stamp, make.joint_state(stamp, now, speed))
                send("/imu", stamp, make.imu(stamp, quaternion[k], twist[k, 3:]))
                send("/odom", stamp, make.odometry(stamp, place[k], quaternion[k], twist[k]))
                send("/tf", stamp, make.TFMessage(transforms=[body, *links]))
        written = next(bag.glob("*.mcap"))
        try:
            shutil.move(written, file)
        except OSError as error:
            raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None


def _twist(time: Array, place: Array, R: Array) -> Array:
    """Twist (n, 6) in the body frame of poses over time."""
    v = np.einsum("nji,nj->ni", R, np.gradient(place, time, axis=0))
    W = np.swapaxes(R, 1, 2) @ np.gradient(R, time, axis=0)
    return np.concatenate([v, np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=-1)], axis=-1)


def _joints(run: xr.Dataset, rover: Rover, time: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Angles and rates (n,) of every joint of the rover's description; 0 where the run has none."""
    n = len(time)

    def channel(name: str, *width: int) -> Array:
        return np.asarray(run[name].values, dtype=float) if name in run else np.zeros((n, *width))

    rocker, bogie, steering, spin = channel("rocker"), channel("bogie", 2), channel("steering", 6), channel("wheel_rate", 6)
    step = np.diff(time, prepend=time[0])[:, None]
    turned = np.cumsum(np.nan_to_num(0.5 * (spin + np.roll(spin, 1, axis=0))) * step, axis=0)
    rolled = channel("wheel_angle", 6) if "wheel_angle" in run else turned
    angle = {
        "rocker_left_joint": rocker,
        "rocker_right_joint": rover.right_rocker(rocker),
        "bogie_left_joint": bogie[:, 0],
        "bogie_right_joint": bogie[:, 1],
    }
    angle |= {f"steer_{name}_joint": steering[:, i] for i, name in enumerate(rover.wheel_names) if rover.steers[i]}
    rate = {name: np.gradient(values, time) for name, values in angle.items()}
    angle |= {f"wheel_{name}_joint": rolled[:, i] for i, name in enumerate(rover.wheel_names)}
    rate |= {f"wheel_{name}_joint": spin[:, i] for i, name in enumerate(rover.wheel_names)}
    return angle, rate


def _about(axis: Array | None, angle: float) -> Array:
    """Quaternion (x, y, z, w)."""
    a = np.zeros(3) if axis is None else axis
    return np.array([*(np.sin(angle / 2) * a), np.cos(angle / 2)])


class _Messages:
    """Builds ROS messages from numbers."""

    def __init__(self, store: Any) -> None:
        self.types = store.types

    def __getattr__(self, name: str) -> Any:
        return next(kind for full, kind in self.types.items() if full.rsplit("/", 1)[-1] == name)

    def header(self, stamp: int, frame: str) -> Any:
        return self.Header(stamp=self.Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id=frame)

    def quaternion(self, q: Array) -> Any:
        return self.Quaternion(x=float(q[0]), y=float(q[1]), z=float(q[2]), w=float(q[3]))

    def vector(self, v: Array) -> Any:
        return self.Vector3(x=float(v[0]), y=float(v[1]), z=float(v[2]))

    def transform(self, stamp: int, parent: str, child: str, at: Array, q: Array) -> Any:
        moved = self.Transform(translation=self.vector(at), rotation=self.quaternion(q))
        return self.TransformStamped(header=self.header(stamp, parent), child_frame_id=child, transform=moved)

    def joint_state(self, stamp: int, angle: dict[str, float], rate: dict[str, float]) -> Any:
        values = [np.array([d[name] for name in angle], dtype=np.float64) for d in (angle, rate)]
        return self.JointState(
            header=self.header(stamp, ""), name=list(angle), position=values[0], velocity=values[1], effort=np.zeros(0)
        )

    def imu(self, stamp: int, q: Array, spin: Array) -> Any:
        unmeasured = np.array([-1.0, *[0.0] * 8])
        return self.Imu(
            header=self.header(stamp, BODY),
            orientation=self.quaternion(q),
            orientation_covariance=np.zeros(9),
            angular_velocity=self.vector(spin),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(np.zeros(3)),
            linear_acceleration_covariance=unmeasured,
        )

    def odometry(self, stamp: int, at: Array, q: Array, twist: Array) -> Any:
        place = self.Point(x=float(at[0]), y=float(at[1]), z=float(at[2]))
        pose = self.PoseWithCovariance(pose=self.Pose(position=place, orientation=self.quaternion(q)), covariance=np.zeros(36))
        moving = self.Twist(linear=self.vector(twist[:3]), angular=self.vector(twist[3:]))
        return self.Odometry(
            header=self.header(stamp, WORLD),
            child_frame_id=BODY,
            pose=pose,
            twist=self.TwistWithCovariance(twist=moving, covariance=np.zeros(36)),
        )


class _Rosbags:
    """The few names we use of the rosbags library."""

    def __init__(self) -> None:
        from rosbags import highlevel, interfaces, rosbag2, typesys

        self.AnyReader, self.AnyReaderError = highlevel.AnyReader, highlevel.AnyReaderError
        self.Writer, self.StoragePlugin = rosbag2.Writer, rosbag2.StoragePlugin
        self.get_typestore, self.Stores = typesys.get_typestore, typesys.Stores
        self.interfaces = interfaces

    def qos(self, *, latched: bool) -> Any:
        """Reliable, the last ten kept; latched ones reach who comes late."""
        i = self.interfaces
        never = i.QosTime(2**63 // 10**9, 2**63 % 10**9)
        return i.Qos(
            i.QosHistory.KEEP_LAST,
            1 if latched else 10,
            i.QosReliability.RELIABLE,
            i.QosDurability.TRANSIENT_LOCAL if latched else i.QosDurability.VOLATILE,
            never,
            never,
            i.QosLiveliness.AUTOMATIC,
            never,
            avoid_ros_namespace_conventions=False,
        )


def _rosbags() -> _Rosbags:
    try:
        return _Rosbags()
    except ImportError:
        raise RockerbogieError("ROS 2 bags need the rosbags library: pip install 'rockerbogie[ros]'") from None
