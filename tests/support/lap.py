"""One lap of 2 m radius to the left on flat terrain, by plane geometry alone."""

from __future__ import annotations

import shutil
from functools import lru_cache

import numpy as np
import xarray as xr

import rockerbogie as rb

ROVER = rb.load_rover("osr")
NAMES = list(ROVER.wheel_names)
RADIUS, SPEED = 2.0, 0.1
LAP_LENGTH = 2 * np.pi * RADIUS
#: Pose of this rover on a plane, by `settle`; only logs with an IMU or suspension sensors use it.
REST = rb.settle(ROVER, rb.surfaces.plane(), 0.0, 0.0, 0.0)


class Lap:
    """Closed form of the lap: the axis of the wheels that do not steer turns about (0, RADIUS)."""

    def __init__(self, hz: float, laps: float = 1.0) -> None:
        self.wz = SPEED / RADIUS
        count = round(LAP_LENGTH * laps / SPEED * hz) + 1
        self.t = np.arange(count) / hz
        self.ns = 1_700_000_000 * 10**9 + np.round(self.t * 1e9).astype(np.int64)
        x0 = ROVER.hubs[~ROVER.steers, 0].mean()
        x, y = ROVER.hubs[:, 0] - x0, ROVER.hubs[:, 1]
        vx, vy = -self.wz * (y - RADIUS), self.wz * x
        self.steering = np.where(ROVER.steers, np.arctan(vy / vx), 0.0)
        self.rate = np.where(ROVER.steers, np.hypot(vx, vy), vx) / ROVER.wheel_radius
        self.angle = np.outer(self.t, self.rate)
        self.yaw = self.wz * self.t

    def dataset(self, counts: int | None, *, imu: bool, suspension: bool) -> xr.Dataset:
        """Return the lap as a log, with wheel angles in whole counts if `counts` is given."""
        n = len(self.t)
        grid = 2 * np.pi / counts if counts else None
        angle = np.floor(self.angle / grid) * grid if grid else self.angle
        data = {"wheel_angle": (("time", "wheel"), angle.copy()), "steering": (("time", "wheel"), np.tile(self.steering, (n, 1)))}
        if imu:
            data |= {"roll": ("time", np.zeros(n)), "pitch": ("time", np.full(n, float(REST.pitch))), "yaw": ("time", self.yaw)}
        if suspension:
            data |= {"rocker": ("time", np.full(n, float(REST.rocker))), "bogie": (("time", "side"), np.tile(REST.bogie, (n, 1)))}
        return xr.Dataset(data, {"time": self.t, "wheel": NAMES})


def quaternion(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return the quaternion x, y, z, w of R = Rz(yaw) Ry(pitch) Rx(roll)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()


@lru_cache
def _store():
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def _header(stamp: int, frame: str):
    types = _store().types
    time = types["builtin_interfaces/msg/Time"](sec=int(stamp) // 10**9, nanosec=int(stamp) % 10**9)
    return types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def joint_message(stamp, names, position, velocity):
    """Return a sensor_msgs/JointState; `None` for an empty field."""
    fields = [np.zeros(0) if v is None else np.asarray(v, dtype=np.float64) for v in (position, velocity)]
    kind = _store().types["sensor_msgs/msg/JointState"]
    return kind(header=_header(stamp, ""), name=list(names), position=fields[0], velocity=fields[1], effort=np.zeros(0))


def imu_message(stamp, q=(0, 0, 0, 1), w=(0, 0, 0), frame="base_link"):
    """Return a sensor_msgs/Imu; `q` = None marks the orientation as not measured."""
    types = _store().types
    covariance = np.zeros(9)
    if q is None:
        q, covariance = (0, 0, 0, 0), np.array([-1.0, *[0.0] * 8])
    vector = types["geometry_msgs/msg/Vector3"]
    return types["sensor_msgs/msg/Imu"](
        header=_header(stamp, frame), orientation=types["geometry_msgs/msg/Quaternion"](*map(float, q)),
        orientation_covariance=covariance, angular_velocity=vector(*map(float, w)), angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(0.0, 0.0, 9.81), linear_acceleration_covariance=np.zeros(9),
    )  # fmt: skip


def write_bag(folder, messages, *, sqlite=False):
    """Write (topic, time of reception in ns, message) as a bag in a folder, which is replaced."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    shutil.rmtree(folder, ignore_errors=True)
    store = _store()
    plugin = StoragePlugin.SQLITE3 if sqlite else StoragePlugin.MCAP
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        topics = {}
        for topic, received, message in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
            writer.write(topics[topic], int(received), store.serialize_cdr(message, message.__msgtype__))
    return folder
