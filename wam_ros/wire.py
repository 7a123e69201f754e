"""The codec between bytes on the wire (CDR) and values.

The types that carry numbers, and the clock, have a fast path, but for points: messages of one layout differ in their
numbers alone.
Whatever has another layout (another byte order, other names or their order, other arrays) goes through a message object
and `wam_ros.messages`.  Both give the same values, which are checked alike.  Padding is written as zeros.
benchmarks/README.md shows the gain.
"""

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message

from wam_bag import value_messages
from wam_bag.cdr import Pattern, first_stamp
from wam_bag.value_messages import Encode, joint_states, tables, wrenches
from wam_description.arm import Arm, Shared
from wam_description.defects import defect_finder, frames, owners
from wam_description.signals import NodeStatus, State, Table, Wrench, mask
from wam_description.topics import JOINT_STATE, STATUS, TABLE, TRAJECTORY, WRENCH, Topic
from wam_ros.limits import NODE_LIMITS
from wam_ros.markers import contact_markers
from wam_ros.messages import Refused, message_type, most_rows, read_status, reader

_STAMP_END = 12  # bytes to the end of the stamp of a message with a header

MARKERS = "visualization_msgs/msg/MarkerArray"
Decode = Callable[[bytes], Any]


def stamp_in(data: bytes) -> int:
    """Stamp of a serialized message with a header, ns; 0 where it is too short to have one."""
    return first_stamp(data) or 0


def encoder(topic: Topic, shared: Shared) -> Encode:
    """What turns a stamp in ns and a value into a serialized message of a topic.

    Raises
    ------
    TypeError
        where no step can return a value for a topic of this type.
    """
    found = value_messages.encoder(topic.type, owners(topic, shared.arm), topic.columns)
    if found is None and topic.type == MARKERS:
        return lambda stamp, value: bytes(serialize_message(contact_markers(stamp, value)))
    if found is None:
        raise TypeError(f"topic '{topic.name}' of type {topic.type} cannot be the output of a step")
    return found


def decoder(topic: Topic, shared: Shared, arrays: str) -> Decode:
    """What turns a serialized message of a topic into a value, or refuses it.

    Parameters
    ----------
    topic : row of the table of topics.
    shared : names of motors, joints and covers.
    arrays : of a JointState, the arrays that must be filled; one with a '?' may be empty, others are left empty.
    """
    kind, read = message_type(topic), reader(topic, shared.arm)

    def slowly(data: bytes) -> Any:
        return read(deserialized(data, kind, topic.type))

    if topic.type == TRAJECTORY:
        return _repeated(slowly)
    known, require_usable = _known(topic, shared.arm), requirement(topic, shared, arrays)

    def decode(data: bytes) -> Any:
        for find in known:
            if (value := find(data)) is not None:
                if find is not known[0]:
                    known.remove(find)
                    known.insert(0, find)
                return require_usable(value)
        return require_usable(slowly(data))

    return decode


def requirement(topic: Topic, shared: Shared, arrays: str) -> Callable[[Any], Any]:
    """What a value of a topic must fulfil, as a function that refuses others; parameters as of `decoder`."""
    if topic.type == TRAJECTORY:  # its reader has looked at it
        return lambda value: value
    defect_of, masked = defect_finder(topic, shared.arm, arrays), mask(arrays)

    def required(value: Any) -> Any:
        if defect := defect_of(value):
            raise Refused(defect)
        return masked(value)

    return required


def status_of(data: bytes) -> NodeStatus:
    """The status of a node from its bytes.

    Raises
    ------
    Refused
        as `deserialized`.
    """
    return read_status(deserialized(data, DiagnosticStatus, STATUS, NODE_LIMITS.status_size))


def deserialized(data: bytes, kind: Any, name: str, most: int = NODE_LIMITS.message_size) -> Any:
    """A message of a type from its bytes, of which it may have so many.

    Raises
    ------
    Refused
        for too many bytes, which would take too long, and for bytes that are no such message.
    """
    if len(data) > most:
        raise Refused(f"{len(data)} bytes of {name}; send at most {most}")
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # rclpy raises its own kinds for bytes that are no such message
        raise Refused(f"{len(data)} bytes are no {name}; send one of that type") from error


def _repeated(decode: Decode) -> Decode:
    """The same, at once for a message that differs from the last one in its stamp alone, as one that is streamed."""
    last, value = b"", None

    def take(data: bytes) -> Any:
        nonlocal last, value
        if data[_STAMP_END:] != last:
            value = decode(data)
            last = data[_STAMP_END:]
        return value

    return take


def _known(topic: Topic, arm: Arm) -> list[Decode]:
    """What finds the value in a message of each known layout, None in any other; the newest one is tried first."""
    if topic.type == JOINT_STATE:
        names = owners(topic, arm)
        return [partial(_find_state, joint_states(names, counts)) for counts in product((len(names), 0), repeat=3)]
    if topic.type == WRENCH:
        return [partial(_find_wrench, frame, wrenches(frame)) for frame in frames(arm)]
    if topic.type == TABLE:
        return [partial(_find_table, topic.columns, frame, most_rows(topic, arm)) for frame in frames(arm)]
    return []  # points, which no node takes in every period


def _find_state(layout: Pattern, data: bytes) -> State | None:
    numbers = layout.numbers(data)
    return None if numbers is None else State(*map(list, numbers))


def _find_wrench(frame: str, layout: Pattern, data: bytes) -> Wrench | None:
    numbers: Any = layout.numbers(data)
    return None if numbers is None else Wrench(frame, numbers[0][:3], numbers[0][3:])


def _find_table(columns: tuple[str, ...], frame: str, most: int, data: bytes) -> Table | None:
    count = (len(data) - tables(columns, frame, 0).size) // (8 * len(columns))
    numbers = tables(columns, frame, count).numbers(data) if 0 <= count <= most else None
    return None if numbers is None else Table(frame, tuple(zip(*[iter(numbers[0])] * len(columns), strict=True)))
