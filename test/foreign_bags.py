"""Bags of other robots, by writers of other projects: mcap-ros2-support, the mcap library, rosbags."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer as McapRos2Writer
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ORIGIN = 1_700_000_000_000_000_000  # ns
JOINTS, WRENCH, MOTORS = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped", "robot_msgs/msg/Motors"
HEADER = "std_msgs/Header header\n"
CONTROLLER, INTERFACES = "control_msgs/msg/JointTrajectoryControllerState", "control_msgs/msg/DynamicJointState"
PARTS = ("reference", "feedback", "desired", "actual")  # of new and old controllers
OWN = {  # types that rosbags does not have
    MOTORS: f"{HEADER}float64[] q\nfloat64[] dq\nfloat64[] current\n",
    CONTROLLER: f"{HEADER}string[] joint_names\n"
    + "".join(f"trajectory_msgs/JointTrajectoryPoint {part}\n" for part in PARTS),
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    INTERFACES: f"{HEADER}string[] joint_names\nInterfaceValue[] interface_values\n",
}
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


def by_json(path: Path, sent: list[Sent], kind: str = "robot.State") -> Path:
    """One MCAP file with JSON, by the mcap library; a type of ROS has a header as rosbridge writes it."""
    file = path.with_suffix(".mcap")
    with file.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        schema = writer.register_schema(kind, "jsonschema", b'{"type": "object"}')
        channels: dict[str, int] = {}
        for one in in_order(sent):
            if one.topic not in channels:
                channels[one.topic] = writer.register_channel(one.topic, "json", schema)
            fields = {q: np.asarray(v).tolist() for q, v in one.fields.items()}
            header = {"stamp": {"sec": ns(one.stamp) // 10**9, "nsec": ns(one.stamp) % 10**9}}
            message = {"header": header, **fields} if "/" in kind else {"time": one.stamp, "state": fields}
            data = json.dumps(message).encode()
            writer.add_message(channels[one.topic], ns(one.received), data, ns(one.received))
        writer.finish()
    return file


def by_rosbags(path: Path, sent: list[Sent], storage: str = "mcap") -> Path:
    """A rosbag2 directory, or a bag of ROS 1, by rosbags."""
    is_ros1 = storage == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    for kind, text in OWN.items():
        store.register(get_types_from_msg(text, kind))
    file = path.with_suffix(".bag") if is_ros1 else path
    plugin = StoragePlugin.SQLITE3 if storage == "sqlite3" else StoragePlugin.MCAP
    with Ros1Writer(file) if is_ros1 else Ros2Writer(file, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for one in in_order(sent):
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, one.kind, typestore=store)
            message = made(store, one)
            take = store.serialize_ros1 if is_ros1 else store.serialize_cdr
            writer.write(connections[one.topic], ns(one.received), take(message, one.kind))
    return file


def made(store: Any, one: Sent) -> Any:
    stamp = {"sec": ns(one.stamp) // 10**9, "nanosec": ns(one.stamp) % 10**9}
    header = {"header": {"stamp": stamp, "frame_id": one.frame}}
    fields = (
        {"wrench": {"force": dict(zip("xyz", one.fields["force"], strict=True))}} if one.kind == WRENCH else one.fields
    )
    return built(store, one.kind, header | fields)


def built(store: Any, kind: str, fields: dict[str, Any]) -> Any:
    """A message of a type; what is not given is zero or empty."""
    values = []
    for name, (node, detail) in store.fielddefs[kind][1]:
        if node == Nodetype.BASE:
            values.append(fields.get(name, "" if detail[0] == "string" else 0))
        elif node == Nodetype.NAME:
            values.append(built(store, detail, fields.get(name, {})))
        else:
            (inner, type_of), _ = detail
            given = fields.get(name, ())
            is_list = inner == Nodetype.NAME or type_of[0] == "string"
            parts = [built(store, type_of, part) if inner == Nodetype.NAME else part for part in given]
            values.append(parts if is_list else np.array(given, type_of[0]))
    return store.types[kind](*values)


def in_order(sent: list[Sent]) -> list[Sent]:
    return sorted(sent, key=lambda one: one.received)


Write = Callable[[Path, list[Sent]], Path]
