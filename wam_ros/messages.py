"""Between ROS messages and plain values.  A message that is not complete and finite is refused."""

import importlib
import struct
from array import array
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

from wam_bag.printable import printable
from wam_description.arm import Shared
from wam_description.defects import point_defect, state_defect, table_defect, wrench_defect
from wam_description.signals import BASE, NodeStatus, PathPoint, Point, PosturePath, State, Table, Wrench
from wam_description.status import pairs, parse
from wam_description.topics import (
    BOOL,
    BY_NAME,
    JOINT_STATE,
    LARGEST,
    POINT,
    STRING,
    TABLE,
    TASK_COLUMNS,
    TIME,
    TRAJECTORY,
    WRENCH,
    Topic,
)  # fmt: skip
from wam_ros.limits import NODE_LIMITS
from wam_ros.markers import contact_markers
from wam_ros.topics import header, stamp_of


class Refused(ValueError):
    """A message that is refused; the text names the value, what is allowed and what to do.

    Attributes
    ----------
    kind : what is refused in the same way on many topics at once, and so reported together; '' where it is not.
    """

    def __init__(self, reason: str, kind: str = "") -> None:
        super().__init__(printable(reason, NODE_LIMITS.reason_length))
        self.kind = kind


def joint_state(stamp: int, names: Sequence[str], state: State) -> JointState:
    """JointState message; empty arrays stay empty."""
    return JointState(
        header=header(stamp), name=names, position=state.position, velocity=state.velocity, effort=state.effort
    )


def read_joint_state(message: JointState, names: list[str], fields: str) -> State:
    """Values of a JointState in the order of `names`; arrays that are not wanted stay empty.

    Parameters
    ----------
    message : the message; matched by name, never by index.
    names : names that must all be there, once each.
    fields : the arrays that must be filled, separated by blanks; one with a '?' may be empty.

    Raises
    ------
    Refused
        names the first thing that is wrong.
    """
    order = None
    if message.name != names:
        order = _order(list(message.name), names)
    sent = State(*(getattr(message, name).tolist() for name in State._fields))
    _require_usable(state_defect(sent, list(message.name), fields))
    taken = fields.replace("?", "").split()
    arrays = [values if name in taken else [] for name, values in zip(State._fields, sent, strict=True)]
    return State(*([values[i] for i in order] if order and values else values for values in arrays))


def _require_usable(defect: str) -> None:
    if defect:
        raise Refused(defect)


def _order(found: list[str], names: list[str]) -> list[int]:
    for name in found:
        if name not in names:
            raise Refused(f"unknown name '{name}'; allowed are {', '.join(names)}")
        if found.count(name) > 1:
            raise Refused(f"name '{name}' is there twice; send each of {', '.join(names)} once")
    for name in names:
        if name not in found:
            raise Refused(f"name '{name}' is missing; send all of {', '.join(names)}")
    return [found.index(name) for name in names]


def wrench_stamped(stamp: int, wrench: Wrench) -> WrenchStamped:
    """WrenchStamped message."""
    message = WrenchStamped(header=header(stamp, wrench.frame))
    message.wrench.force.x, message.wrench.force.y, message.wrench.force.z = map(float, wrench.force)
    message.wrench.torque.x, message.wrench.torque.y, message.wrench.torque.z = map(float, wrench.torque)
    return message


def read_wrench(message: WrenchStamped, frames: Sequence[str]) -> Wrench:
    """Values of a WrenchStamped.

    Raises
    ------
    Refused
        for a frame that is not one of `frames` or a number that is not finite.
    """
    force, torque = message.wrench.force, message.wrench.torque
    result = Wrench(message.header.frame_id, (force.x, force.y, force.z), (torque.x, torque.y, torque.z))
    _require_usable(wrench_defect(result, frames))
    return result


def point_stamped(stamp: int, point: Point) -> PointStamped:
    """PointStamped message, NaN where a coordinate is not known."""
    message = PointStamped(header=header(stamp, point.frame))
    message.point.x, message.point.y, message.point.z = map(float, point.position)
    return message


def read_point(message: PointStamped, frames: Sequence[str]) -> Point:
    """Values of a PointStamped; NaN where a coordinate is not known, nothing else may be.

    Raises
    ------
    Refused
        for a frame that is not one of `frames` or a coordinate that is infinite.
    """
    point = message.point
    result = Point(message.header.frame_id, (float(point.x), float(point.y), float(point.z)))
    _require_usable(point_defect(result, frames))
    return result


def table(stamp: int, columns: Sequence[str], value: Table) -> PointCloud2:
    """PointCloud2 message with one float64 field for each column and one point for each row."""
    return PointCloud2(
        header=header(stamp, value.frame),
        height=1,
        width=len(value.rows),
        fields=_fields(tuple(columns)),
        is_bigendian=False,
        point_step=8 * len(columns),
        row_step=8 * len(columns) * len(value.rows),
        data=array("B", b"".join(struct.pack(f"<{len(row)}d", *row) for row in value.rows)),
        is_dense=False,
    )


@cache
def _fields(columns: tuple[str, ...]) -> list[PointField]:
    kind = PointField.FLOAT64
    return [PointField(name=name, offset=8 * i, datatype=kind, count=1) for i, name in enumerate(columns)]


def most_rows(topic: Topic, shared: Shared) -> int:
    """Rows that a table of a topic may have, so that a step takes its usual time: of a task one for each joint."""
    return len(shared.arm.joints.names) if topic.columns == TASK_COLUMNS else NODE_LIMITS.table_rows


def read_table(message: PointCloud2, columns: Sequence[str], frames: Sequence[str], most: int | None = None) -> Table:
    """Rows of a PointCloud2 under these columns; NaN where a number is not known, nothing else may be.

    Raises
    ------
    Refused
        for a frame that is not one of `frames`, other columns, a wrong size, more than `most` rows or a number that is
        infinite.
    """
    frame, step = message.header.frame_id, 8 * len(columns)
    if message.is_bigendian or message.fields != _fields(tuple(columns)):
        given = ", ".join(field.name for field in message.fields[:40])
        raise Refused(f"fields are {given or 'none'}; send little-endian float64 fields {', '.join(columns)}")
    data = bytes(message.data)
    if message.point_step != step or len(data) != step * message.width * message.height:
        raise Refused(f"{len(data)} bytes of data; {message.width * message.height} rows need {step} bytes each")
    if most is not None and len(data) > most * step:
        raise Refused(f"{len(data) // step} rows; send at most {most}")
    rows = tuple(struct.iter_unpack(f"<{len(columns)}d", data))
    result = Table(frame, rows)
    _require_usable(table_defect(result, columns, frames))
    return result


def read_trajectory(message: JointTrajectory, names: list[str]) -> PosturePath:
    """Points of a JointTrajectory in the order of `names`; accelerations do not count.

    Raises
    ------
    Refused
        names the first thing that is wrong.
    """
    order = list(range(len(names))) if message.joint_names == names else _order(list(message.joint_names), names)
    if not 0 < len(message.points) <= NODE_LIMITS.trajectory_points:
        raise Refused(f"{len(message.points)} points; send 1 to {NODE_LIMITS.trajectory_points}")
    found = []
    for i, point in enumerate(message.points):
        arrays = [point.positions.tolist(), point.velocities.tolist()]
        for name, values in zip(("position", "velocity"), arrays, strict=True):
            if len(values) != len(names) and (values or name == "position"):
                raise Refused(f"{name} of point {i} has {len(values)} values; send {len(names)}")
            for value in values:
                if not abs(value) <= LARGEST[name]:  # NaN, too
                    raise Refused(f"{name} of point {i} is {value:g}; send at most {LARGEST[name]:g}")
        position, velocity = (tuple(values[k] for k in order) if values else () for values in arrays)
        time = point.time_from_start
        found.append(PathPoint(position, velocity, time.sec + time.nanosec * 1e-9))
    return PosturePath(tuple(found))


def diagnostic_status(status: NodeStatus, hardware: str) -> DiagnosticStatus:
    """DiagnosticStatus message of a node's status; `hardware` is the name of the arm."""
    return DiagnosticStatus(
        name=status.node,
        level=bytes([status.level]),
        message=status.message,
        hardware_id=hardware,
        values=[KeyValue(key=key, value=value) for key, value in pairs(status)],
    )


def read_status(message: DiagnosticStatus) -> NodeStatus:
    """The status that a message describes, fit for a terminal: another program may have sent it."""
    level = message.level[0] if isinstance(message.level, bytes) else int(message.level)
    given = [(printable(item.key), printable(item.value)) for item in message.values]
    return parse(printable(message.name), level, printable(message.message), given)


Read = Callable[[Any], Any]
Write = Callable[[int, Any], Any]


def reader(topic: Topic, shared: Shared, arrays: str) -> Read:
    """What turns messages of a topic into values, or refuses them.

    Parameters
    ----------
    topic : row of the table of topics.
    shared : names of motors, joints and covers.
    arrays : of a JointState, the arrays that must be filled, as `read_joint_state` takes them.
    """
    frames = (BASE, *shared.arm.covers.names)
    if topic.type == JOINT_STATE:
        names = _names(topic, shared)
        return lambda message: read_joint_state(message, names, arrays)
    if topic.type == WRENCH:
        return lambda message: read_wrench(message, frames)
    if topic.type == POINT:
        return lambda message: read_point(message, frames)
    if topic.type == TRAJECTORY:
        joints = list(shared.arm.joints.names)
        return lambda message: read_trajectory(message, joints)
    if topic.type == TABLE:
        most = most_rows(topic, shared)
        return lambda message: read_table(message, topic.columns, frames, most)
    raise TypeError(f"topic '{topic.name}' of type {topic.type} cannot be the input of a step")


def writer(topic: Topic, shared: Shared) -> Write:
    """What turns a stamp in ns and a value into a message of a topic."""
    if topic.type == JOINT_STATE:
        names = _names(topic, shared)
        return lambda stamp, value: joint_state(stamp, names, value)
    by_type: dict[str, Write] = {
        WRENCH: wrench_stamped,
        POINT: point_stamped,
        TABLE: lambda stamp, value: table(stamp, topic.columns, value),
        BOOL: lambda stamp, value: Bool(data=bool(value)),
        STRING: lambda stamp, value: String(data=value),
        "visualization_msgs/msg/MarkerArray": contact_markers,
        TIME: lambda stamp, value: Clock(clock=header(stamp).stamp),
    }
    if topic.type not in by_type:
        raise TypeError(f"topic '{topic.name}' of type {topic.type} cannot be the output of a step")
    return by_type[topic.type]


def message_type(topic: Topic) -> Any:
    """Message class of a row of the table of topics."""
    package, _, name = topic.type.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def _names(topic: Topic, shared: Shared) -> list[str]:
    return list(shared.arm.motors.names if topic.side == "motors" else shared.arm.joints.names)


def plain(message: Any, topic: str = "") -> Any:
    """A message as mappings, lists and numbers; a table of the stack as its rows."""
    row = BY_NAME.get(topic)
    if row is not None and row.type == TABLE:
        table = read_table(message, row.columns, [message.header.frame_id, *[""] * 100])
        return {
            "stamp": stamp_of(message),
            "rows": [dict(zip(row.columns, found, strict=True)) for found in table.rows],
        }
    if hasattr(message, "get_fields_and_field_types"):
        return {name: plain(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, bytes) or hasattr(message, "tolist"):
        return list(message)
    return [plain(item) for item in message] if isinstance(message, list) else message
