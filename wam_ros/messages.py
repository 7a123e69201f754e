"""Between ROS messages and plain values: whatever the codec of `wam_ros.wire` does not know by its layout."""

import struct
from collections.abc import Callable, Sequence
from pkgutil import resolve_name
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, WrenchStamped
from sensor_msgs.msg import JointState, PointCloud2, PointField
from trajectory_msgs.msg import JointTrajectory

from wam_bag.printable import printable
from wam_description.arm import Arm
from wam_description.defects import owners, state_defect
from wam_description.signals import NodeStatus, PathPoint, Point, PosturePath, State, Table, Wrench
from wam_description.status import pairs, parse
from wam_description.topics import BY_NAME, JOINT_STATE, POINT, TABLE, TASK_COLUMNS, TRAJECTORY, WRENCH, Topic
from wam_ros.limits import NODE_LIMITS
from wam_ros.ros_topics import header, stamp_of

Read = Callable[[Any], Any]


class Refused(ValueError):
    """A message that is refused; the text names the value, what is allowed and what to do.

    Attributes
    ----------
    is_late : whether it is only out of time, as on a loaded machine all topics of other nodes are, at once.
    """

    def __init__(self, reason: str, is_late: bool = False) -> None:
        super().__init__(printable(reason, NODE_LIMITS.reason_length))
        self.is_late = is_late


class WrongNames(Refused):
    """Names that are not those of the arm's joints or motors, each once."""


def reader(topic: Topic, arm: Arm) -> Read:
    """What turns messages of a topic into values, or refuses them; only of a trajectory are the numbers looked at.

    Raises
    ------
    TypeError
        where no step can take a topic of this type.
    """
    names, columns, most = owners(topic, arm), topic.columns, most_rows(topic, arm)
    readers: dict[str, Read] = {
        JOINT_STATE: lambda message: _joint_state(message, names),
        WRENCH: _wrench,
        POINT: _point,
        TRAJECTORY: lambda message: read_trajectory(message, names),
        TABLE: lambda message: read_table(message, columns, most),
    }
    if topic.type not in readers:
        raise TypeError(f"topic '{topic.name}' of type {topic.type} cannot be the input of a step")
    return readers[topic.type]


def most_rows(topic: Topic, arm: Arm) -> int:
    """Rows that a table of a topic may have, so that a step takes its usual time: of a task one for each joint."""
    return arm.n if topic.columns == TASK_COLUMNS else NODE_LIMITS.table_rows


def joint_state(stamp: int, names: Sequence[str], state: State) -> JointState:
    """JointState message; empty arrays stay empty."""
    return JointState(
        header=header(stamp), name=names, position=state.position, velocity=state.velocity, effort=state.effort
    )


def _joint_state(message: JointState, names: Sequence[str]) -> State:
    """Values in the order of `names`, which must all be there, once each; matched by name, never by index."""
    order = _order(message.name, names)
    arrays = [getattr(message, name).tolist() for name in State._fields]
    return State(*([values[i] for i in order] if len(values) == len(order) else values for values in arrays))


def _order(found: Sequence[str], names: Sequence[str]) -> list[int]:
    for name in found:
        if name not in names:
            raise WrongNames(f"unknown name '{name}'; allowed: {', '.join(names)}")
        if found.count(name) > 1:
            raise WrongNames(f"name '{name}' is given twice; send each of {', '.join(names)} once")
    for name in names:
        if name not in found:
            raise WrongNames(f"name '{name}' is missing; send all of {', '.join(names)}")
    return [found.index(name) for name in names]


def _wrench(message: WrenchStamped) -> Wrench:
    force, torque = message.wrench.force, message.wrench.torque
    return Wrench(message.header.frame_id, (force.x, force.y, force.z), (torque.x, torque.y, torque.z))


def _point(message: PointStamped) -> Point:
    return Point(message.header.frame_id, (message.point.x, message.point.y, message.point.z))


def read_table(message: PointCloud2, columns: Sequence[str], most: int = NODE_LIMITS.message_size) -> Table:
    """Rows of a PointCloud2 under these columns.

    Raises
    ------
    Refused
        for other columns, a wrong size or more than `most` rows.
    """
    step, data = 8 * len(columns), bytes(message.data)
    fields = [
        PointField(name=name, offset=8 * i, datatype=PointField.FLOAT64, count=1) for i, name in enumerate(columns)
    ]
    if message.is_bigendian or message.fields != fields:
        given = ", ".join(field.name for field in message.fields[:40])
        raise Refused(f"fields are {given or 'none'}; send little-endian float64 fields {', '.join(columns)}")
    if message.point_step != step or len(data) != step * message.width * message.height:
        raise Refused(f"{len(data)} bytes of data; {message.width * message.height} rows need {step} bytes each")
    if len(data) > most * step:
        raise Refused(f"{len(data) // step} rows; send at most {most}")
    return Table(message.header.frame_id, tuple(struct.iter_unpack(f"<{len(columns)}d", data)))


def read_trajectory(message: JointTrajectory, names: Sequence[str]) -> PosturePath:
    """Points of a JointTrajectory in the order of `names`; accelerations do not count.

    Raises
    ------
    Refused
        names the first thing that is wrong.
    """
    order = _order(message.joint_names, names)
    if not 0 < len(message.points) <= NODE_LIMITS.trajectory_points:
        raise Refused(f"{len(message.points)} points; send 1 to {NODE_LIMITS.trajectory_points}")
    found = []
    for i, point in enumerate(message.points):
        sent = State(point.positions.tolist(), point.velocities.tolist(), [])
        if defect := state_defect(sent, message.joint_names, ("position",)):
            raise Refused(f"point {i}: {defect}")
        position, velocity = (tuple(values[k] for k in order) if values else () for values in sent[:2])
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


def message_type(topic: Topic) -> Any:
    """Message class of a row of the table of topics."""
    return resolve_name(topic.type.replace("/", "."))


def plain(message: Any, topic: str = "") -> Any:
    """A message as mappings, lists and numbers; a table of the stack as its rows."""
    row = BY_NAME.get(topic)
    if row is not None and row.type == TABLE:
        rows = read_table(message, row.columns).rows
        return {"stamp": stamp_of(message), "rows": [dict(zip(row.columns, found, strict=True)) for found in rows]}
    if hasattr(message, "get_fields_and_field_types"):
        return {name: plain(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, bytes) or hasattr(message, "tolist"):
        return list(message)
    return [plain(item) for item in message] if isinstance(message, list) else message
