"""Messages of ROS bags: joint states, IMU and odometry, by topic. Needs the `ros` extra."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError, require
from .channels import LogReport
from .stamps import drop_duplicates, order_stamps

JOINT_STATE, IMU, ODOMETRY = "sensor_msgs/msg/JointState", "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry"
STORAGE = (".mcap", ".db3", ".bag")
#: A quaternion whose length differs from 1 by less is normalised.
QUATERNION_SLACK = 0.1
#: Modules below rosbags that raise errors of their own on broken files.
READERS = ("apsw", "backports", "compression", "lz4", "zlib", "struct", "ruamel", "rosbags", "zstandard")
#: Errors of those readers on damaged lengths and offsets, besides their own classes.
DAMAGED = (EOFError, IndexError, TypeError, MemoryError, OverflowError, RecursionError)


@dataclass
class Topic:
    """Messages of one topic: times, and the columns of each message."""

    name: str
    kind: str
    count: int = 0
    frames: set[str] = field(default_factory=set)
    stamp: list[float] = field(default_factory=list)
    received: list[float] = field(default_factory=list)
    rows: list[dict[str, float]] = field(default_factory=list)
    signatures: list[tuple[Any, ...]] = field(default_factory=list)

    @property
    def clock_offset(self) -> float:
        """Median of stamp less time of reception, s; 0 if messages have no stamps."""
        stamp, received = np.array(self.stamp), np.array(self.received)
        stamped = stamp != 0
        return float(np.median((stamp - received)[stamped])) if stamped.any() else 0.0

    def signals(self, report: LogReport, shift: float = 0.0) -> dict[str, tuple[Array, Array]]:
        """Return each column of the topic with the times at which it was sent.

        Args:
            report: gets notes on stamps.
            shift: added to the times, s.

        Returns:
            Column -> (times (n,) strictly ascending in s, values (n,)). Columns without a finite value are left out.
        """
        kept = self._one_publisher(report)
        time, order = order_stamps(np.array(self.stamp)[kept], np.array(self.received)[kept], self.name, report)
        rows = [self.rows[kept[k]] for k in order]
        found = {}
        for column in dict.fromkeys(name for row in rows for name in row):
            has = np.array([column in row for row in rows])
            values = np.array([row[column] for row in rows if column in row])
            finite = np.isfinite(values)
            if not finite.any():
                continue
            if not finite.all():
                report.note(f"{self.name}: {column} has {int((~finite).sum())} missing values (NaN)")
            found[column] = drop_duplicates(time[has] + shift, values, self.name, report)
        return found

    def _one_publisher(self, report: LogReport) -> list[int]:
        """Return the indices of messages of one publisher per joint: those with velocities."""
        by_kind: dict[tuple[Any, ...], int] = {}
        for signature in self.signatures:
            by_kind[signature] = by_kind.get(signature, 0) + 1
        dropped = set()
        for a in by_kind:
            for b in by_kind:
                if a != b and set(a[0]) & set(b[0]) and a[1:] < b[1:]:
                    dropped.add(a)
        for signature in dropped:
            if by_kind[signature] > 0.05 * self.count:
                report.warn(
                    f"{self.name}: two publishers send the same joints; {by_kind[signature]} messages without velocities "
                    "were left out"
                )
                continue
            dropped = dropped - {signature}
        return [k for k, signature in enumerate(self.signatures) if signature not in dropped]


def require_rosbags() -> None:
    """Raise if the rosbags library is not installed."""
    require("a ROS bag", "ros", "rosbags")


def read_topics(path: Path, report: LogReport) -> tuple[dict[str, Topic], dict[str, str]]:
    """Read joint states, IMU and odometry from a bag of ROS 2 or ROS 1.

    A bag is a file (.mcap, .db3, .bag) or a folder of them; metadata.yaml and message definitions are not needed.

    Args:
        path: the bag.
        report: gets a note for each repair.

    Returns:
        Topic -> its messages, and topic -> type for all topics of the bag.

    Raises:
        RockerbogieError: rosbags is not installed, or the bag cannot be read.
    """
    require_rosbags()
    from rosbags.rosbag1 import ReaderError as Reader1Error
    from rosbags.rosbag2 import ReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import TypesysError

    topics: dict[str, Topic] = {}
    kinds: dict[str, str] = {}
    try:
        for name, kind, received, message in _messages(path, kinds, report):
            topic = topics.setdefault(name, Topic(name, kind))
            _append(topic, message, received)
    except (Reader1Error, ReaderError, SerdeError, TypesysError, OSError, ValueError, KeyError, AssertionError) as error:
        remedy = "; `mcap recover` restores a file whose recording was cut off" if "magic" in str(error) else ""
        raise _unreadable(path, error, remedy) from None
    except Exception as error:  # the readers below rosbags raise errors of their own (zstd, lz4, apsw, struct)
        if not type(error).__module__.startswith(READERS) and not isinstance(error, DAMAGED):
            raise
        raise _unreadable(path, error, "") from None
    for topic in topics.values():
        topic.count = len(topic.rows)
    return topics, kinds


def _unreadable(path: Path, error: Exception, remedy: str) -> RockerbogieError:
    """Return the error for a bag that cannot be read."""
    text = " ".join(str(error).split()) or type(error).__name__
    return RockerbogieError(f"{path.name} cannot be read as a ROS 2 bag: {text}{remedy}")


def _messages(path: Path, kinds: dict[str, str], report: LogReport) -> Iterator[tuple[str, str, float, Any]]:
    """Yield topic, type, time of reception (s) and message of joints, IMUs and odometry.

    Args:
        path: the bag.
        kinds: filled with the type of every topic of the bag.
        report: gets notes on damaged bags.
    """
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    for file in _storages(path, report):
        ros1 = file.suffix == ".bag"
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        with Reader1(file) if ros1 else Reader(file) as bag:
            kinds |= {c.topic: c.msgtype for c in bag.connections}
            wanted = [c for c in bag.connections if c.msgtype in (JOINT_STATE, IMU, ODOMETRY)]
            for connection, stamp, raw in bag.messages(connections=wanted) if wanted else ():
                decode = store.deserialize_ros1 if ros1 else store.deserialize_cdr
                yield (
                    connection.topic,
                    connection.msgtype,
                    1e-9 * (stamp % 10**9) + stamp // 10**9,
                    decode(raw, connection.msgtype),
                )


def _storages(path: Path, report: LogReport) -> list[Path]:
    """Return the bag itself, or the files in a folder that has no usable metadata.yaml."""
    if not path.is_dir():
        return [path]
    files = sorted(file for file in path.iterdir() if file.suffix in STORAGE)
    metadata = path / "metadata.yaml"
    if metadata.exists():
        from rosbags.rosbag2 import Reader, ReaderError

        try:
            with Reader(path):
                return [path]
        except (ReaderError, OSError, ValueError, KeyError, AssertionError, *DAMAGED) as error:
            if not files:
                raise
            report.note(f"metadata.yaml cannot be used ({' '.join(str(error).split())}); the folder's files were read")
    elif files and not all(file.suffix == ".bag" for file in files):
        report.note(f"the folder has no metadata.yaml; its {len(files)} files were read")
    if not files:
        packed = [file.name for file in path.iterdir() if file.suffix == ".zstd"]
        remedy = f"; unpack {packed[0]} with zstd first" if packed else ""
        raise RockerbogieError(f"{path.name} holds no bag: it has no .mcap, .db3 or .bag file{remedy}")
    return files


def _append(topic: Topic, message: Any, received: float) -> None:
    """Append a message's columns to its topic."""
    header = message.header
    topic.stamp.append(1e-9 * header.stamp.nanosec + header.stamp.sec)
    topic.received.append(received)
    topic.frames.add(header.frame_id)
    if topic.kind == JOINT_STATE:
        names = list(message.name)
        row = dict(zip(names, map(float, message.position), strict=False))
        row |= {f"{name}.rate": float(v) for name, v in zip(names, message.velocity, strict=False)}
        topic.signatures.append((tuple(names), len(message.velocity) > 0))
    elif topic.kind == IMU:
        row = _imu_row(message)
        topic.signatures.append(((), True))
    else:
        at = message.pose.pose.position
        row = {"x": float(at.x), "y": float(at.y), "z": float(at.z)}
        topic.signatures.append(((), True))
    topic.rows.append(row)


def _imu_row(message: Any) -> dict[str, float]:
    """Return gyro_x … and quaternion q_x … of a message, without parts marked as not measured."""
    row: dict[str, float] = {}
    if message.angular_velocity_covariance[0] >= 0:
        row |= {f"gyro_{k}": float(getattr(message.angular_velocity, k)) for k in "xyz"}
    q = np.array([getattr(message.orientation, k) for k in "xyzw"], dtype=float)
    size = float(np.linalg.norm(q))
    if message.orientation_covariance[0] >= 0 and abs(size - 1) < QUATERNION_SLACK:
        row |= {f"q_{k}": float(v) for k, v in zip("xyzw", q / size if abs(size - 1) > 1e-12 else q, strict=True)}
    return row
