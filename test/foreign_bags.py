"""Bags of other robots, by writers of other projects: mcap-ros2-support, the mcap library, rosbags."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer as McapRos2Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ORIGIN = 1_700_000_000_000_000_000  # ns
JOINTS, WRENCH, MOTORS = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped", "robot_msgs/msg/Motors"
OWN = get_types_from_msg("std_msgs/Header header\nfloat64[] q\nfloat64[] dq\nfloat64[] current\n", MOTORS)
HEADER = "std_msgs/Header header\n"
LINE = "=" * 80
TIME = f"{LINE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
STAMP = f"{LINE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{TIME}"
VECTOR = f"{LINE}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
WRENCH_TEXT = f"{LINE}\nMSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n{VECTOR}"
SCHEMAS = {
    JOINTS: f"{HEADER}string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{STAMP}",
    WRENCH: f"{HEADER}geometry_msgs/Wrench wrench\n{STAMP}{WRENCH_TEXT}",
}


class Sent(NamedTuple):
    """A message before it is written: times in s from the origin, and fields by name."""

    topic: str
    kind: str
    stamp: float
    received: float
    frame: str
    fields: dict[str, Any]


def joints(
    topic: str, time: Any, names: Iterable[str], frame: str = "", delay: float = 1e-3, **fields: Any
) -> list[Sent]:
    """JointState: each field is (n, joints), or left empty."""
    values = {q: np.asarray(fields[q]) for q in fields}
    return [
        Sent(topic, JOINTS, t, t + delay, frame, {"name": list(names), **{q: v[i] for q, v in values.items()}})
        for i, t in enumerate(np.asarray(time).tolist())
    ]


def wrenches(topic: str, time: Any, force: Any, frame: str = "") -> list[Sent]:
    """WrenchStamped: force (n, 3)."""
    return [
        Sent(topic, WRENCH, t, t + 1e-3, frame, {"force": force[i]}) for i, t in enumerate(np.asarray(time).tolist())
    ]


def ns(seconds: float) -> int:
    return ORIGIN + round(1e9 * seconds)


def by_mcap_ros2(path: Path, sent: list[Sent]) -> Path:
    """One MCAP file by mcap-ros2-support."""
    file = path.with_suffix(".mcap")
    with file.open("wb") as stream, McapRos2Writer(stream) as writer:
        schemas = {kind: writer.register_msgdef(kind, text) for kind, text in SCHEMAS.items()}
        for one in in_order(sent):
            stamp = {"sec": ns(one.stamp) // 10**9, "nanosec": ns(one.stamp) % 10**9}
            message: dict[str, Any] = {"header": {"stamp": stamp, "frame_id": one.frame}}
            if one.kind == WRENCH:
                message["wrench"] = {"force": dict(zip("xyz", map(float, one.fields["force"]), strict=True))}
            else:
                message |= {q: list(v) for q, v in one.fields.items()}
            writer.write_message(one.topic, schemas[one.kind], message, ns(one.received), ns(one.received))
        writer.finish()
    return file


def by_json(path: Path, sent: list[Sent]) -> Path:
    """One MCAP file with JSON, by the mcap library."""
    file = path.with_suffix(".mcap")
    with file.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        schema = writer.register_schema("robot.State", "jsonschema", b'{"type": "object"}')
        channels: dict[str, int] = {}
        for one in in_order(sent):
            if one.topic not in channels:
                channels[one.topic] = writer.register_channel(one.topic, "json", schema)
            fields = {q: np.asarray(v).tolist() for q, v in one.fields.items()}
            data = json.dumps({"time": one.stamp, "state": fields}).encode()
            writer.add_message(channels[one.topic], ns(one.received), data, ns(one.received))
        writer.finish()
    return file


def by_rosbags(path: Path, sent: list[Sent], storage: str = "mcap") -> Path:
    """A rosbag2 directory, or a bag of ROS 1, by rosbags."""
    is_ros1 = storage == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    store.register(OWN)
    file = path.with_suffix(".bag") if is_ros1 else path
    plugin = StoragePlugin.SQLITE3 if storage == "sqlite3" else StoragePlugin.MCAP
    with Ros1Writer(file) if is_ros1 else Ros2Writer(file, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for one in in_order(sent):
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, one.kind, typestore=store)
            message = made(store, one, is_ros1)
            take = store.serialize_ros1 if is_ros1 else store.serialize_cdr
            writer.write(connections[one.topic], ns(one.received), take(message, one.kind))
    return file


def made(store: Any, one: Sent, is_ros1: bool) -> Any:
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](ns(one.stamp) // 10**9, ns(one.stamp) % 10**9)
    header = types["std_msgs/msg/Header"](*([0] if is_ros1 else []), stamp, one.frame)
    if one.kind == WRENCH:
        vector = types["geometry_msgs/msg/Vector3"]
        wrench = types["geometry_msgs/msg/Wrench"](vector(*map(float, one.fields["force"])), vector(0.0, 0.0, 0.0))
        return types[WRENCH](header, wrench)
    kind, fields = types[one.kind], dict(one.fields)
    if one.kind == JOINTS:
        empty = np.empty(0)
        return kind(
            header, fields["name"], *(np.array(fields.get(q, empty)) for q in ("position", "velocity", "effort"))
        )
    return kind(header, *(np.array(fields[q]) for q in ("q", "dq", "current")))


def in_order(sent: list[Sent]) -> list[Sent]:
    return sorted(sent, key=lambda one: one.received)


Write = Callable[[Path, list[Sent]], Path]
