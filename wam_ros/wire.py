"""The fast path between bytes on the wire (CDR) and values, for the four types that carry numbers and the clock.

`wam_ros.messages` does the same through message objects; it is the reference, and whatever does not have
the expected layout (another byte order, other names or their order, other arrays) goes through it, so that both
refuse the same.  Padding is written as zeros.  benchmarks/README.md shows the gain.
"""

from collections.abc import Callable
from functools import cache, lru_cache
from itertools import chain, product
from typing import Any, TypeVar

from rclpy.serialization import deserialize_message, serialize_message

from wam_bag.cdr import Pattern, first_stamp
from wam_description.arm import Shared
from wam_description.signals import BASE, State, Table, Wrench
from wam_description.topics import JOINT_STATE, LARGEST, LINK, POINT, TABLE, TIME, TRAJECTORY, WRENCH, Topic, columns_of
from wam_ros.limits import NODE_LIMITS
from wam_ros.messages import Refused, message_type, most_rows, reader, writer

_LARGEST = tuple(LARGEST[name] for name in State._fields)
_LARGEST_WRENCH = (LARGEST["force"],) * 3 + (LARGEST["torque"],) * 3
_NO_HEADER = ((0, 0), "")  # stamp and frame
_FLOAT64 = 8  # sensor_msgs/PointField
_STAMP_END = 12  # bytes to the end of the stamp of a message with a header

Encode = Callable[[int, Any], bytes]
Decode = Callable[[bytes], Any]
Key = TypeVar("Key")


def stamp_of(data: bytes) -> int:
    """Stamp of a serialized message with a header, ns; 0 where it is too short to have one."""
    return first_stamp(data) or 0


def encoder(topic: Topic, shared: Shared) -> Encode:
    """What turns a stamp in ns and a value into a serialized message of a topic."""
    if topic.type == JOINT_STATE:
        names = _names(topic, shared)
        return lambda stamp, value: _joint_state(names, stamp, value)
    if topic.type == WRENCH:
        return lambda stamp, value: _wrench(value.frame).pack(stamp, (*value.force, *value.torque))
    if topic.type == POINT:
        return lambda stamp, value: _point(value.frame).pack(stamp, value.position)
    if topic.type == TABLE:
        return lambda stamp, value: _packed_table(topic.columns, stamp, value)
    if topic.type == TIME:
        clock = Pattern(TIME, _NO_HEADER[:1])
        return lambda stamp, value: clock.pack(stamp)
    write = writer(topic, shared)
    return lambda stamp, value: bytes(serialize_message(write(stamp, value)))


def decoder(topic: Topic, shared: Shared, arrays: str) -> Decode:
    """What turns a serialized message of a topic into a value, or refuses it.

    Parameters
    ----------
    topic : row of the table of topics.
    shared : names of motors, joints and covers.
    arrays : of a JointState, the arrays that must be filled; one with a '?' may be empty.
    """
    kind, read = message_type(topic), reader(topic, shared, arrays)

    def slowly(data: bytes) -> Any:
        return read(deserialized(data, kind, topic.type))

    frames = (BASE, *shared.arm.covers.names)
    if topic.type == JOINT_STATE:
        wanted = arrays.split()
        names = _names(topic, shared)
        # which arrays are filled, as far as that is allowed
        filled = product(*((True,) if name in wanted else (True, False) for name in State._fields))
        states = [(there, _state(names, tuple(len(names) * each for each in there))) for there in filled]
        taken = [name in wanted or name + "?" in wanted for name in State._fields]
        return lambda data: _read_state(data, states, taken) or slowly(data)
    if topic.type == WRENCH:
        wrenches = [(frame, _wrench(frame)) for frame in frames]
        return lambda data: _read_wrench(data, wrenches) or slowly(data)
    if topic.type == TABLE:
        most = most_rows(topic, shared)
        return lambda data: _read_table(data, topic.columns, frames, most) or slowly(data)
    return _repeated(slowly) if topic.type == TRAJECTORY else slowly


def deserialized(data: bytes, kind: Any, name: str) -> Any:
    """A message of a type from its bytes.

    Raises
    ------
    Refused
        for too many bytes, which would take too long, and for bytes that are no such message.
    """
    if len(data) > NODE_LIMITS.message_size:
        raise Refused(f"{len(data)} bytes of {name}; send at most {NODE_LIMITS.message_size}")
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


def _names(topic: Topic, shared: Shared) -> tuple[str, ...]:
    return shared.arm.motors.names if topic.side == "motors" else shared.arm.joints.names


@cache
def _state(names: tuple[str, ...], counts: tuple[int, ...]) -> Pattern:
    return Pattern(JOINT_STATE, (_NO_HEADER, names, *((0.0,) * count for count in counts)))


@cache
def _wrench(frame: str) -> Pattern:
    return Pattern(WRENCH, (((0, 0), frame), ((0.0,) * 3, (0.0,) * 3)))


@cache
def _point(frame: str) -> Pattern:
    return Pattern(POINT, (((0, 0), frame), (0.0,) * 3))


@lru_cache(maxsize=256)
def _table(columns: tuple[str, ...], frame: str, rows: int) -> Pattern:
    fields = [(name, 8 * i, _FLOAT64, 1) for i, name in enumerate(columns)]
    step = 8 * len(columns)
    return Pattern(
        TABLE, (((0, 0), frame), 1, rows, fields, False, step, step * rows, bytes(step * rows), False), "data"
    )


def _joint_state(names: tuple[str, ...], stamp: int, value: State) -> bytes:
    position, velocity, effort = value
    counts = len(position), len(velocity), len(effort)
    return _state(names, counts).pack(stamp, position, velocity, effort)


def _packed_table(columns: tuple[str, ...], stamp: int, value: Table) -> bytes:
    rows = value.rows
    return _table(columns, value.frame, len(rows)).pack(stamp, tuple(chain.from_iterable(rows)))


def _found(data: bytes, patterns: list[tuple[Key, Pattern]]) -> tuple[Key, list[tuple[float, ...]]] | None:
    """The key of the pattern of a message and its numbers, None where it has none; the newest is tried first."""
    for i, (key, pattern) in enumerate(patterns):
        numbers = pattern.numbers(data)
        if numbers is not None:
            if i:
                patterns.insert(0, patterns.pop(i))
            return key, numbers
    return None


def _read_state(data: bytes, patterns: list[tuple[tuple[bool, ...], Pattern]], taken: list[bool]) -> State | None:
    """The value, None where the message has to be looked at more closely."""
    found = _found(data, patterns)
    if found is None:
        return None
    _, numbers = found
    arrays: list[list[float]] = []
    for i in range(3):
        values = list(numbers[i])
        limit = _LARGEST[i]
        for value in values:
            if not -limit <= value <= limit:  # NaN, too
                return None
        arrays.append(values if taken[i] else [])
    return State(*arrays)


def _read_wrench(data: bytes, patterns: list[tuple[str, Pattern]]) -> Wrench | None:
    """The value, None where the message has to be looked at more closely."""
    found = _found(data, patterns)
    if found is None:
        return None
    frame, (numbers,) = found
    for value, limit in zip(numbers, _LARGEST_WRENCH, strict=True):
        if not -limit <= value <= limit:  # NaN, too
            return None
    fx, fy, fz, tx, ty, tz = numbers
    return Wrench(frame, (fx, fy, fz), (tx, ty, tz))


@cache
def _table_limits(columns: tuple[str, ...]) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """The largest magnitude of each column, and which ones may not be NaN."""
    found = columns_of(columns)
    return tuple(column.largest for column in found), tuple(
        i for i, column in enumerate(found) if not column.may_be_unknown
    )


def _read_table(data: bytes, columns: tuple[str, ...], frames: tuple[str, ...], most: int) -> Table | None:
    """The value, None where the message has to be looked at more closely."""
    step = 8 * len(columns)
    for frame in frames:
        count = (len(data) - _table(columns, frame, 0).size) // step
        if count > most:
            continue
        numbers = _table(columns, frame, max(count, 0)).numbers(data)
        if numbers is not None:
            break
    else:
        return None
    rows = tuple(zip(*[iter(numbers[0])] * len(columns), strict=True))
    largest, known = _table_limits(columns)
    for row in rows:
        for number, limit in zip(row, largest, strict=True):
            if abs(number) > limit:
                return None
        for i in known:
            if row[i] != row[i]:
                return None
    if columns[0] == LINK and any(row[0] not in range(len(frames) - 1) for row in rows):
        return None
    return Table(frame, rows)
