"""Messages of the stack as bytes, by serializers that are not ours."""

from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from wam_bag.metadata import offered

STORE = get_typestore(Stores.ROS2_JAZZY)
QOS = offered(7, True)


def header(stamp: int, frame: str = "") -> Any:
    time = STORE.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    return STORE.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def joint_state(stamp: int, names: list[str], *arrays: list[float]) -> bytes:
    fields = [np.array(values, dtype=np.float64) for values in arrays]
    message = STORE.types["sensor_msgs/msg/JointState"](header(stamp), names, *fields)
    return bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/JointState"))


def vector(x: float, y: float, z: float, kind: str = "Vector3") -> Any:
    return STORE.types[f"geometry_msgs/msg/{kind}"](x, y, z)


def wrench(stamp: int, frame: str, *values: float) -> bytes:
    inner = STORE.types["geometry_msgs/msg/Wrench"](vector(*values[:3]), vector(*values[3:]))
    message = STORE.types["geometry_msgs/msg/WrenchStamped"](header(stamp, frame), inner)
    return bytes(STORE.serialize_cdr(message, "geometry_msgs/msg/WrenchStamped"))


def point(stamp: int, frame: str, *values: float) -> bytes:
    message = STORE.types["geometry_msgs/msg/PointStamped"](header(stamp, frame), vector(*values, kind="Point"))
    return bytes(STORE.serialize_cdr(message, "geometry_msgs/msg/PointStamped"))


def status(name: str, text: str) -> bytes:
    message = STORE.types["diagnostic_msgs/msg/DiagnosticStatus"](0, name, text, "", [])
    return bytes(STORE.serialize_cdr(message, "diagnostic_msgs/msg/DiagnosticStatus"))
