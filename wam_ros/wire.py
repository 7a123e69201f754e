"""The fast path between bytes on the wire (CDR) and values, for the four types that carry numbers and the clock.

`wam_ros.messages` does the same through message objects; it is the reference, and whatever does not have
the expected layout (another byte order, other names or their order, other arrays) goes through it, so that both
refuse the same.  Padding is written as zeros.  benchmarks/speed.py shows the gain.
"""

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from wam_description.arm import Shared
from wam_description.signals import BASE, State, Table, Wrench
from wam_description.topics import JOINT_STATE, LARGEST, LINK, POINT, TABLE, TIME, WRENCH, Topic, columns_of
from wam_ros.messages import Refused, message_type, reader, writer

LITTLE_ENDIAN = b"\0\1\0\0"
HEAD = struct.Struct("<4siI")  # encapsulation, seconds, nanoseconds
SECOND = 1_000_000_000
_COUNT = struct.Struct("<I")
_LARGEST = tuple(LARGEST[name] for name in State._fields)
_LARGEST_WRENCH = (LARGEST["force"],) * 3 + (LARGEST["torque"],) * 3

Encode = Callable[[int, Any], bytes]
Decode = Callable[[bytes], Any]


def stamp_of(data: bytes) -> int:
    """Stamp of a serialized message with a header, ns; 0 where it is too short to have one."""
    if len(data) < HEAD.size:
        return 0
    if not data[1] & 1:  # big-endian
        sec, nanosec = struct.unpack_from(">iI", data, 4)
    else:
        _, sec, nanosec = HEAD.unpack_from(data)
    return int(sec * SECOND + nanosec)


def encoder(topic: Topic, shared: Shared) -> Encode:
    """What turns a stamp in ns and a value into a serialized message of a topic."""
    if topic.type == JOINT_STATE:
        names = _strings(_names(topic, shared))
        return lambda stamp, value: _joint_state(names, stamp, value)
    if topic.type == WRENCH:
        return lambda stamp, value: _framed(value.frame, 6).pack(
            LITTLE_ENDIAN, *divmod(stamp, SECOND), *_string(value.frame), *value.force, *value.torque
        )
    if topic.type == POINT:
        return lambda stamp, value: _framed(value.frame, 3).pack(
            LITTLE_ENDIAN, *divmod(stamp, SECOND), *_string(value.frame), *value.position
        )
    if topic.type == TABLE:
        return lambda stamp, value: _table(topic.columns, stamp, value)
    if topic.type == TIME:
        return lambda stamp, value: HEAD.pack(LITTLE_ENDIAN, *divmod(stamp, SECOND))
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
        try:
            message = deserialize_message(data, kind)
        except Exception as error:  # rclpy raises its own kinds for bytes that are no such message
            raise Refused(f"{len(data)} bytes are no {topic.type}; send one of that type") from error
        return read(message)

    if topic.type == JOINT_STATE:
        wanted = arrays.split()
        names, count = _strings(_names(topic, shared)), len(_names(topic, shared))
        needed = [name in wanted for name in State._fields]
        taken = [name in wanted or name + "?" in wanted for name in State._fields]
        return lambda data: _read_joint_state(data, names, count, needed, taken) or slowly(data)
    frames = frozenset((BASE, *shared.arm.covers.names))
    if topic.type == WRENCH:
        return lambda data: _read_wrench(data, frames) or slowly(data)
    if topic.type == TABLE:
        return lambda data: _read_table(data, topic.columns, frames) or slowly(data)
    return slowly


def _names(topic: Topic, shared: Shared) -> tuple[str, ...]:
    return shared.arm.motors.names if topic.side == "motors" else shared.arm.joints.names


# JointState: stamp, empty frame, names, then three arrays, each a count and, aligned to 8, its numbers


@cache
def _strings(names: tuple[str, ...]) -> bytes:
    """An empty frame and a sequence of strings as they follow the stamp; padded to 4 bytes."""
    parts = bytearray(_COUNT.pack(1) + b"\0" + bytes(3) + _COUNT.pack(len(names)))
    for name in names:
        text = name.encode() + b"\0"
        parts += _COUNT.pack(len(text)) + text + bytes(-len(text) % 4)
    return bytes(parts)


@cache
def _doubles(count: int) -> struct.Struct:
    return struct.Struct(f"<{count}d")


@cache
def _joint_state_layout(size: int, counts: tuple[int, ...]) -> struct.Struct:
    layout, at = f"<4siI{size}s", 8 + size  # `at` counts from behind the encapsulation
    for count in counts:
        layout, at = layout + "I", at + 4
        if count:
            padding = -at % 8
            layout, at = f"{layout}{padding}x{count}d", at + padding + 8 * count
    return struct.Struct(layout)


def _joint_state(names: bytes, stamp: int, value: State) -> bytes:
    position, velocity, effort = value
    p, v, e = len(position), len(velocity), len(effort)
    layout = _joint_state_layout(len(names), (p, v, e))
    return layout.pack(LITTLE_ENDIAN, *divmod(stamp, SECOND), names, p, *position, v, *velocity, e, *effort)


def _read_joint_state(data: bytes, names: bytes, count: int, needed: list[bool], taken: list[bool]) -> State | None:
    """The value, None where the message has to be looked at more closely."""
    at = 12 + len(names)
    if data[:4] != LITTLE_ENDIAN or data[12:at] != names:
        return None
    arrays: list[list[float]] = []
    for i in range(3):
        if len(data) < at + 4:
            return None
        (found,) = _COUNT.unpack_from(data, at)
        at += 4
        values: list[float] = []
        if found:
            at += -(at - 4) % 8
            if found != count or len(data) < at + 8 * count:
                return None
            values = list(_doubles(count).unpack_from(data, at))
            at += 8 * count
            limit = _LARGEST[i]
            for value in values:
                if not -limit <= value <= limit:  # NaN, too
                    return None
        elif needed[i]:
            return None
        arrays.append(values if taken[i] else [])
    return State(*arrays)


# WrenchStamped and PointStamped: stamp, frame, then numbers aligned to 8


@cache
def _string(text: str) -> tuple[int, bytes]:
    data = text.encode() + b"\0"
    return len(data), data


@cache
def _framed(frame: str, numbers: int) -> struct.Struct:
    size, _ = _string(frame)
    return struct.Struct(f"<4siII{size}s{-(12 + size) % 8}x{numbers}d")


def _frame(data: bytes, size: int) -> str:
    """The frame in a header, '' where it does not end as a string does."""
    text = data[16 : 16 + size]
    return text[:-1].decode("ascii", "replace") if text[-1:] == b"\0" else ""


def _read_wrench(data: bytes, frames: frozenset[str]) -> Wrench | None:
    """The value, None where the message has to be looked at more closely."""
    if len(data) < 16 or data[:4] != LITTLE_ENDIAN:
        return None
    (size,) = _COUNT.unpack_from(data, 12)
    at = 16 + size
    at += -(at - 4) % 8
    if len(data) < at + 48:
        return None
    frame = _frame(data, size)
    fx, fy, fz, tx, ty, tz = numbers = struct.unpack_from("<6d", data, at)
    if frame not in frames:
        return None
    for value, limit in zip(numbers, _LARGEST_WRENCH, strict=True):
        if not -limit <= value <= limit:  # NaN, too
            return None
    return Wrench(frame, (fx, fy, fz), (tx, ty, tz))


# PointCloud2 as a table of float64 columns


@cache
def _fields(columns: tuple[str, ...]) -> bytes:
    """The sequence of fields, as it begins at a multiple of 4."""
    parts = bytearray(_COUNT.pack(len(columns)))
    for i, name in enumerate(columns):
        text = name.encode() + b"\0"
        parts += _COUNT.pack(len(text)) + text + bytes(-len(text) % 4)
        parts += struct.pack("<IB3xI", 8 * i, 8, 1)  # offset, FLOAT64, count
    return bytes(parts)


def _table(columns: tuple[str, ...], stamp: int, value: Table) -> bytes:
    rows, step = len(value.rows), 8 * len(columns)
    size, frame = _string(value.frame)
    numbers = [number for row in value.rows for number in row]
    return b"".join(
        (
            HEAD.pack(LITTLE_ENDIAN, *divmod(stamp, SECOND)),
            _COUNT.pack(size) + frame + bytes(-size % 4),
            struct.pack("<II", 1, rows),
            _fields(columns),
            struct.pack("<B3xIII", 0, step, step * rows, step * rows),
            struct.pack(f"<{len(numbers)}d", *numbers),
            b"\0",  # is_dense
        )
    )


@cache
def _table_limits(columns: tuple[str, ...]) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """The largest magnitude of each column, and which ones may not be NaN."""
    found = columns_of(columns)
    return tuple(column.largest for column in found), tuple(
        i for i, column in enumerate(found) if not column.may_be_unknown
    )


def _read_table(data: bytes, columns: tuple[str, ...], frames: frozenset[str]) -> Table | None:
    """The value, None where the message has to be looked at more closely."""
    if len(data) < 16 or data[:4] != LITTLE_ENDIAN:
        return None
    (size,) = _COUNT.unpack_from(data, 12)
    frame = _frame(data, size)
    at = 16 + size + -size % 4
    fields, step = _fields(columns), 8 * len(columns)
    start = at + 8 + len(fields)
    if frame not in frames or data[at + 8 : start] != fields or len(data) < start + 16:
        return None
    height, width = struct.unpack_from("<II", data, at)
    big, point_step, row_step, count = struct.unpack_from("<B3xIII", data, start)
    expected = step * width
    if (height, big, point_step, row_step, count) != (1, 0, step, expected, expected):
        return None
    numbers = data[start + 16 : start + 16 + count]
    if len(numbers) != count:
        return None
    rows = tuple(struct.iter_unpack(f"<{len(columns)}d", numbers))
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
