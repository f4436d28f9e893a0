"""Runs as ROS 2 bags in MCAP files, for Foxglove and `ros2 bag`."""

from __future__ import annotations

import shutil
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, expect
from ..files.outputs import SOURCE, check_outputs
from ..rover.formats import to_urdf
from ..rover.formats.export_tree import tree_of
from ..rover.model import LOAD_ROVER, Rover
from ..rover.rotations import body_transform
from .bag import IMU, JOINT_STATE, ODOMETRY, require_rosbags
from .channels import ATTITUDE, seconds_of

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

TF, STRING = "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"
WORLD, BODY = "odom", "base_link"
#: Variance written for what no sensor measures.
UNMEASURED = 1e9


def write_mcap(rover: Rover | xr.Dataset, run: xr.Dataset | Rover, file: str | Path, *, force: bool = False) -> None:
    """Write a run as an MCAP file of ROS 2 messages that Foxglove and `ros2 bag` open.

    Topics: `/joint_states` (JointState of the joints that the run has), `/imu` (Imu), `/odom` (Odometry), `/tf` (odom →
    base_link → every link that moves), `/tf_static` (links that do not) and `/robot_description` (the URDF), the last
    two latched. Frames are ROS's own: x forward, y left, z up.
    `/odom` has the covariances of a run of `odometry`; 0 otherwise.

    Args:
        rover: the rover of the run. `write_mcap(run, rover, file)` works too and is deprecated.
        run: from `drive`, `simulate` or `odometry`: at least `x y z roll pitch yaw` over `time` (s from 0, or dates); the
            joints it has.
        file: ends in .mcap; replaced if this package wrote it.
        force: replace a file that this package did not write.

    Raises:
        RockerbogieError: no rosbags installed, a run without poses, times that ROS cannot hold, or a file that cannot be
            written.
    """
    from scipy.spatial.transform import Rotation

    rover, run = _ordered(rover, run)
    stamps = _stamps(run)
    check_outputs([file], force=force)
    bags = _rosbags()
    store = bags.get_typestore(bags.Stores.ROS2_HUMBLE)
    make = _Messages(store)
    time = 1e-9 * (stamps - stamps[0])
    missing = [name for name in ("x", "y", "z", *ATTITUDE) if name not in run]
    if missing:
        raise RockerbogieError(f"the run has no {missing[0]}: an MCAP file needs x, y, z, roll, pitch and yaw over time")
    pose = {name: np.asarray(run[name].values, dtype=float) for name in ("x", "y", "z", *ATTITUDE)}
    R = body_transform(0, 0, 0, pose["roll"], pose["pitch"], pose["yaw"])[:, :3, :3]
    position = np.stack([pose[k] for k in "xyz"], axis=-1)
    known = np.isfinite(position).all(axis=1) & np.isfinite(R).all(axis=(1, 2))
    if not known.any():
        raise RockerbogieError("the run has no row with a pose (all are NaN): there is nothing to write")
    quaternion = np.full((len(time), 4), np.nan)
    quaternion[known] = Rotation.from_matrix(R[known]).as_quat()
    twist = _twist(time, position, R)
    pose_covariance, twist_covariance = _covariance(run, "pose_covariance"), _covariance(run, "twist_covariance")
    angle, rate = _joints(run, rover, time)
    joints, measured = tree_of(rover).joints, [name for name in angle if _has(run, name)]
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
                    ("/tf_static", TF, True),
                )
            }

            def send(topic: str, stamp: int, message: Any) -> None:
                writer.write(topics[topic], stamp, store.serialize_cdr(message, topics[topic].msgtype))

            urdf = to_urdf(rover)
            send("/robot_description", int(stamps[0]), make.String(data=f"{urdf}<!-- {SOURCE} -->\n"))
            fixed = [make.transform(int(stamps[0]), *joint) for joint in _fixed_joints(urdf)]
            send("/tf_static", int(stamps[0]), make.TFMessage(transforms=fixed))
            for k in np.flatnonzero(known):
                stamp = int(stamps[k])
                now, speed = ({name: values[k] for name, values in table.items()} for table in (angle, rate))
                links = [
                    make.transform(stamp, joint.parent, joint.child, joint.T[:3, 3], _about(joint.axis, now[name]))
                    for name, joint in joints.items()
                ]
                body = make.transform(stamp, WORLD, BODY, position[k], quaternion[k])
                if measured:
                    send("/joint_states", stamp, make.joint_state(stamp, {name: now[name] for name in measured}, speed))
                send("/imu", stamp, make.imu(stamp, quaternion[k], twist[k, 3:]))
                odometry = make.odometry(stamp, position[k], quaternion[k], twist[k], pose_covariance[k], twist_covariance[k])
                send("/odom", stamp, odometry)
                send("/tf", stamp, make.TFMessage(transforms=[body, *links]))
        written = next(bag.glob("*.mcap"))
        try:
            shutil.move(written, file)
        except OSError as error:
            raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None


def _fixed_joints(urdf: str) -> list[tuple[str, str, Array, Array]]:
    """Return parent, child, position and quaternion (x, y, z, w) of the fixed joints of a URDF."""
    from xml.etree import ElementTree

    from scipy.spatial.transform import Rotation

    found = []
    for joint in ElementTree.fromstring(urdf).findall("joint[@type='fixed']"):
        origin = joint.find("origin")
        at, angles = (
            np.array((origin.get(name, "0 0 0") if origin is not None else "0 0 0").split(), dtype=float)
            for name in ("xyz", "rpy")
        )
        ends = [str(element.get("link")) for element in (joint.find("parent"), joint.find("child")) if element is not None]
        found.append((ends[0], ends[1], at, Rotation.from_euler("xyz", angles).as_quat()))
    return found


def _ordered(rover: object, run: object) -> tuple[Rover, xr.Dataset]:
    """Return rover and run, which older calls give in the other order."""
    import xarray as xr

    if isinstance(rover, xr.Dataset) and isinstance(run, Rover):
        warnings.warn(
            "write_mcap(run, rover, file) is deprecated: call write_mcap(rover, run, file)", DeprecationWarning, stacklevel=3
        )
        rover, run = run, rover
    expect(rover, Rover, "rover", LOAD_ROVER)
    if not isinstance(run, xr.Dataset) or "time" not in run.variables:
        raise RockerbogieError(f"run is {run!r:.60}, not a Dataset over time: make one with rockerbogie.drive")
    return rover, run  # type: ignore[return-value]


def _stamps(run: xr.Dataset) -> NDArray[np.int64]:
    """Return the times of a run in ns; raise if ROS stamps cannot hold them."""
    values = np.atleast_1d(run["time"].values)
    if values.dtype.kind in "mM":
        stamps = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
    else:
        seconds = seconds_of(values, str(run["time"].attrs.get("units", "")), "the run")
        if not np.isfinite(seconds).all():
            raise RockerbogieError("time in the run has missing values: drop those rows")
        stamps = np.array([round(1e9 * v) for v in seconds.tolist()], dtype=object)
    if not len(stamps):
        raise RockerbogieError("the run has no rows: there is nothing to write")
    if min(stamps) < 0 or max(stamps) >= 2**31 * 10**9:
        raise RockerbogieError(
            f"time in the run is from {1e-9 * min(stamps):.10g} to {1e-9 * max(stamps):.10g} s; ROS stamps hold 0 to 2^31 s: "
            "add an offset"
        )
    stamps = stamps.astype(np.int64)
    if (np.diff(stamps) <= 0).any():
        k = int(np.argmin(np.diff(stamps)))
        raise RockerbogieError(f"time in the run does not grow after row {k + 1}: sort it, and drop duplicates")
    return np.asarray(stamps)


def _covariance(run: xr.Dataset, name: str) -> Array:
    """Return the covariance (n, 36) of a run: 0 if absent, `UNMEASURED` if infinite."""
    n = run.sizes["time"]
    if name not in run:
        return np.zeros((n, 36))
    values = np.asarray(run[name].values, dtype=float).reshape(n, 36)
    return np.where(np.isnan(values), 0.0, np.clip(values, -UNMEASURED, UNMEASURED))


def _twist(time: Array, position: Array, R: Array) -> Array:
    """Return the twist (n, 6) in the body frame of poses over time; 0 for a single pose."""
    if len(time) < 2:
        return np.zeros((len(time), 6))
    v = np.einsum("nji,nj->ni", R, np.gradient(position, time, axis=0))
    W = np.swapaxes(R, 1, 2) @ np.gradient(R, time, axis=0)
    return np.concatenate([v, np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=-1)], axis=-1)


def _joints(run: xr.Dataset, rover: Rover, time: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return angles and rates (n,) of every joint; 0 for those that the run does not have."""
    n = len(time)

    def channel(name: str, *width: int) -> Array:
        return np.asarray(run[name].values, dtype=float) if name in run else np.zeros((n, *width))

    rocker, bogie, steering, spin = channel("rocker"), channel("bogie", 2), channel("steering", 6), channel("wheel_rate", 6)
    if "wheel_rate" not in run and "wheel_angle" in run and n > 1:
        spin = np.gradient(channel("wheel_angle", 6), time, axis=0)
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
    rate = {name: np.gradient(values, time) if n > 1 else np.zeros(n) for name, values in angle.items()}
    angle |= {f"wheel_{name}_joint": rolled[:, i] for i, name in enumerate(rover.wheel_names)}
    rate |= {f"wheel_{name}_joint": spin[:, i] for i, name in enumerate(rover.wheel_names)}
    return angle, rate


def _has(run: xr.Dataset, joint: str) -> bool:
    """Return True if the run has the angle or the rate of a joint."""
    kind = joint.partition("_")[0]
    return any(name in run for name in {"steer": ("steering",), "wheel": ("wheel_angle", "wheel_rate")}.get(kind, (kind,)))


def _about(axis: Array | None, angle: float) -> Array:
    """Return the quaternion (x, y, z, w) of a turn about an axis, rad."""
    a = np.zeros(3) if axis is None else axis
    return np.array([*(np.sin(angle / 2) * a), np.cos(angle / 2)])


class _Messages:
    """Builder of ROS messages for MCAP files from numbers, without ROS."""

    def __init__(self, store: Any) -> None:
        self.types = store.types

    def __getattr__(self, name: str) -> Any:
        return next(kind for full, kind in self.types.items() if full.rsplit("/", 1)[-1] == name)

    def header(self, stamp: int, frame: str) -> Any:
        """Return a std_msgs/Header.

        Args:
            stamp: ns.
            frame: name of the frame.

        Returns:
            The message.
        """
        return self.Header(stamp=self.Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id=frame)

    def quaternion(self, q: Array) -> Any:
        """Return a geometry_msgs/Quaternion.

        Args:
            q: (4,) x, y, z, w.

        Returns:
            The message.
        """
        return self.Quaternion(x=float(q[0]), y=float(q[1]), z=float(q[2]), w=float(q[3]))

    def vector(self, v: Array) -> Any:
        """Return a geometry_msgs/Vector3 for an MCAP file.

        Args:
            v: (3,).

        Returns:
            The message.
        """
        return self.Vector3(x=float(v[0]), y=float(v[1]), z=float(v[2]))

    def transform(self, stamp: int, parent: str, child: str, at: Array, q: Array) -> Any:
        """Return a geometry_msgs/TransformStamped.

        Args:
            stamp: ns.
            parent, child: names of the frames.
            at: (3,) translation, m.
            q: (4,) x, y, z, w.

        Returns:
            The message.
        """
        moved = self.Transform(translation=self.vector(at), rotation=self.quaternion(q))
        return self.TransformStamped(header=self.header(stamp, parent), child_frame_id=child, transform=moved)

    def joint_state(self, stamp: int, angle: dict[str, float], rate: dict[str, float]) -> Any:
        """Return a sensor_msgs/JointState.

        Args:
            stamp: ns.
            angle: rad, by name of the joint.
            rate: rad/s, by name of the joint.

        Returns:
            The message.
        """
        values = [np.array([d[name] for name in angle], dtype=np.float64) for d in (angle, rate)]
        return self.JointState(
            header=self.header(stamp, ""), name=list(angle), position=values[0], velocity=values[1], effort=np.zeros(0)
        )

    def imu(self, stamp: int, q: Array, spin: Array) -> Any:
        """Return a sensor_msgs/Imu whose acceleration is marked as not measured.

        Args:
            stamp: ns.
            q: (4,) attitude as x, y, z, w.
            spin: (3,) rate of turn, rad/s.

        Returns:
            The message.
        """
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

    def odometry(self, stamp: int, at: Array, q: Array, twist: Array, pose_covariance: Array, twist_covariance: Array) -> Any:
        """Return a nav_msgs/Odometry.

        Args:
            stamp: ns.
            at: (3,) position, m.
            q: (4,) attitude as x, y, z, w.
            twist: (6,) of the body, m/s and rad/s.
            pose_covariance, twist_covariance: (36,).

        Returns:
            The message.
        """
        point = self.Point(x=float(at[0]), y=float(at[1]), z=float(at[2]))
        pose = self.PoseWithCovariance(pose=self.Pose(position=point, orientation=self.quaternion(q)), covariance=pose_covariance)
        moving = self.Twist(linear=self.vector(twist[:3]), angular=self.vector(twist[3:]))
        return self.Odometry(
            header=self.header(stamp, WORLD),
            child_frame_id=BODY,
            pose=pose,
            twist=self.TwistWithCovariance(twist=moving, covariance=twist_covariance),
        )


class _Rosbags:
    """Names of the rosbags library that are used here."""

    def __init__(self) -> None:
        from rosbags import interfaces, rosbag2, typesys

        self.Writer, self.StoragePlugin = rosbag2.Writer, rosbag2.StoragePlugin
        self.get_typestore, self.Stores = typesys.get_typestore, typesys.Stores
        self.interfaces = interfaces

    def qos(self, *, latched: bool) -> Any:
        """Return the quality of service: reliable; latched topics keep 1 message."""
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
    """Return the message types of rosbags; raise RockerbogieError if it is not installed."""
    require_rosbags()
    return _Rosbags()
