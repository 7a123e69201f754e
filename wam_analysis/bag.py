"""Bags as named numpy columns, without ROS.

Reads what `wam_ros.bag` and rosbag2 write: MCAP of profile ros2, a directory or a single file.
"""

from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.bag_file import BagError, Decoders, Opened, channels, files, schemas

__all__ = [
    "Bag", "BagError", "BoolColumns", "Columns", "JointColumns", "Messages", "PointColumns", "WrenchColumns",
    "read",
]  # fmt: skip

_JOINTS = "sensor_msgs/msg/JointState"
_WRENCH = "geometry_msgs/msg/WrenchStamped"
_POINT = "geometry_msgs/msg/PointStamped"

Times = NDArray[np.int64]
Numbers = NDArray[np.float64]


class JointColumns(NamedTuple):
    """sensor_msgs/JointState, k messages of n joints, matched by name.

    `names` are in the order of their first appearance; what a message leaves empty is NaN.  A field
    that every message leaves empty has shape (k, 0).
    """

    log_time_ns: Times
    stamp_ns: Times
    frames: tuple[str, ...]
    names: tuple[str, ...]
    position: Numbers
    velocity: Numbers
    effort: Numbers


class WrenchColumns(NamedTuple):
    """geometry_msgs/WrenchStamped, k messages: force (k, 3) N, torque (k, 3) N m."""

    log_time_ns: Times
    stamp_ns: Times
    frames: tuple[str, ...]
    force: Numbers
    torque: Numbers


class PointColumns(NamedTuple):
    """geometry_msgs/PointStamped, k messages: point (k, 3) m."""

    log_time_ns: Times
    stamp_ns: Times
    frames: tuple[str, ...]
    point: Numbers


class BoolColumns(NamedTuple):
    """std_msgs/Bool, k messages."""

    log_time_ns: Times
    data: NDArray[np.bool_]


class Messages(NamedTuple):
    """Messages of any other type, decoded; fields are attributes."""

    log_time_ns: Times
    messages: tuple[Any, ...]


Columns = JointColumns | WrenchColumns | PointColumns | BoolColumns | Messages


class Bag(NamedTuple):
    """A bag in memory: columns and type by topic, attachments and metadata records by name."""

    path: Path
    topics: dict[str, Columns]
    types: dict[str, str]
    attachments: dict[str, bytes]
    metadata: dict[str, dict[str, str]]


def read(path: str | Path, topics: Collection[str] | None = None) -> Bag:
    """Read a bag, the whole of it or some topics.

    Parameters
    ----------
    path : bag directory or .mcap file.
    topics : names of the topics to read, one without a leading '/' in every namespace; None reads all.

    Raises
    ------
    BagError
        where it is missing, empty, cut off or not a ROS 2 bag.
    """
    times: dict[str, list[int]] = {}
    messages: dict[str, list[Any]] = {}
    types: dict[str, str] = {}
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    decoders = Decoders()
    for file in files(Path(path)):
        with Opened(file) as reader:
            for channel in channels(reader, file):
                if not _is_asked(channel.topic, topics):
                    continue
                times.setdefault(channel.topic, [])
                messages.setdefault(channel.topic, [])
                types[channel.topic] = schemas(reader)[channel.schema_id].name
            for schema, channel, message in reader.iter_messages(topics=None if topics is None else list(types)):
                times[channel.topic].append(message.log_time)
                messages[channel.topic].append(decoders(schema, channel, message.data))
            attachments.update({item.name: item.data for item in reader.iter_attachments()})
            metadata.update({item.name: item.metadata for item in reader.iter_metadata()})
    columns = {name: _columns(types[name], times[name], messages[name]) for name in messages}
    return Bag(Path(path), columns, types, attachments, metadata)


def _is_asked(name: str, topics: Collection[str] | None) -> bool:
    if topics is None or name in topics:
        return True
    return any(name.endswith(f"/{topic}") for topic in topics if not topic.startswith("/"))


def _columns(kind: str, times: list[int], messages: list[Any]) -> Columns:
    log_times = np.array(times, dtype=np.int64)
    if kind == "std_msgs/msg/Bool":
        return BoolColumns(log_times, np.array([message.data for message in messages], dtype=np.bool_))
    if kind not in (_JOINTS, _WRENCH, _POINT):
        return Messages(log_times, tuple(messages))
    stamps = np.array([_nanoseconds(message.header.stamp) for message in messages], dtype=np.int64)
    frames = tuple(message.header.frame_id for message in messages)
    if kind == _WRENCH:
        force = _vectors([message.wrench.force for message in messages])
        torque = _vectors([message.wrench.torque for message in messages])
        return WrenchColumns(log_times, stamps, frames, force, torque)
    if kind == _POINT:
        return PointColumns(log_times, stamps, frames, _vectors([m.point for m in messages]))
    names = tuple(dict.fromkeys(name for message in messages for name in message.name))
    position, velocity, effort = (_by_name(names, messages, field) for field in ("position", "velocity", "effort"))
    return JointColumns(log_times, stamps, frames, names, position, velocity, effort)


def _nanoseconds(time: Any) -> int:
    return int(time.sec * 1_000_000_000 + time.nanosec)


def _vectors(vectors: list[Any]) -> Numbers:
    return np.array([(v.x, v.y, v.z) for v in vectors], dtype=np.float64).reshape(-1, 3)


def _by_name(names: tuple[str, ...], messages: list[Any], field: str) -> Numbers:
    arrays = [getattr(message, field) for message in messages]
    if not any(len(values) for values in arrays):
        return np.empty((len(messages), 0))
    column = {name: i for i, name in enumerate(names)}
    result = np.full((len(messages), len(names)), np.nan)
    for row, message, numbers in zip(result, messages, arrays, strict=True):
        for name, number in zip(message.name, numbers, strict=False):
            row[column[name]] = number
    return result
