"""Serialized messages (CDR): encoded, decoded one by one, the place of each value, exact length and stamp.

A message is 4 bytes that name the byte order, then its values one after the other, each aligned to its size
relative to the end of those 4 bytes.
"""

import json
import keyword
import struct
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import MappingProxyType, SimpleNamespace
from typing import Any, Final, NamedTuple

import numpy as np

from wam_bag.definitions import definition, schema
from wam_bag.errors import Damage
from wam_bag.limits import READING_LIMITS
from wam_bag.message_text import PRIMITIVES, Fields, definitions

ENCAPSULATION: Final = 4
ORDERS: Final = {b"\0\0": ">", b"\0\1": "<"}
LITTLE_ENDIAN: Final = b"\0\1\0\0"
SECOND: Final = 1_000_000_000  # ns
_STAMPS = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")

_AFTER_STAMP: Final = ENCAPSULATION + 8

CDR, ROS1, JSON = "cdr", "ros1", "json"  # encodings of messages
SCHEMAS: Final = {CDR: "ros2msg", ROS1: "ros1msg"}  # encoding of the definitions by that of the messages
ENCODINGS: Final = (*SCHEMAS, JSON)  # that are read
Definitions = Mapping[str, Fields]


class MessageType(NamedTuple):
    """Type of the messages of a topic.

    Attributes
    ----------
    name : ``package/msg/Type``, '' where it has none.
    encoding : `CDR`, `ROS1` or `JSON`.
    definitions : fields of it and of the types it consists of; none where each message names its fields.
    """

    name: str
    encoding: str
    definitions: Definitions = MappingProxyType({})

    @property
    def decode(self) -> Callable[[bytes], Any]:
        """Makes an object of a message; raises Damage if it is not of this type."""
        return from_json if self.encoding == JSON else Decoder(*self)


class Leaf(NamedTuple):
    """Numbers in a message: first byte behind the encapsulation, type, length of the array or None for one number."""

    offset: int
    dtype: np.dtype[Any]
    length: int | None


class Reading:
    """A message that is read from its start to its end.

    Parameters
    ----------
    data : it, with its encapsulation; of ROS 1 it has none.
    is_packed : whether it is of ROS 1: little-endian, its values not aligned, its texts not terminated.

    Attributes
    ----------
    numbers_at : numbers and arrays of them that have a path: '.header.stamp.sec', '.position', '.markers[0].scale.x'.
    counts_at : place and value of every count in the message, of characters, numbers or messages.
    texts_at : first byte and end of every string.
    end : bytes that were read.
    message : their values, where `Decoder.read` read them.
    """

    def __init__(self, data: bytes, is_packed: bool = False) -> None:
        self._is_packed = is_packed
        data = LITTLE_ENDIAN + data if is_packed else data
        try:
            self.order = ORDERS[data[:2]]
        except KeyError:
            raise Damage(f"a message has the encapsulation {data[:2].hex() or 'none'}; plain CDR is read") from None
        self.data = data
        self.numbers_at: dict[str, Leaf] = {}
        self.counts_at: list[tuple[int, int]] = []
        self.texts_at: list[tuple[int, int]] = []
        self.end = ENCAPSULATION
        self.message: Any = None

    def skip(self, size: int) -> int:
        """Pass over some bytes; returns the first."""
        start = self.end
        self.end += size
        if self.end > len(self.data):
            raise Damage("a message ends early")
        return start

    def numbers(self, kind: str, count: int | None, path: str | None = None) -> tuple[int, np.dtype[Any]]:
        """Pass over an array of numbers, or one without a count; their first byte and type.

        Their place is kept where they have a path.
        """
        dtype, number = number_type(self.order, kind), 1 if count is None else count
        if number and not self._is_packed:
            self.end += -(self.end - ENCAPSULATION) % dtype.itemsize
        start = self.skip(dtype.itemsize * number)
        if path is not None:
            self.numbers_at[path] = Leaf(start - ENCAPSULATION, dtype, count)
        return start, dtype

    def count(self) -> int:
        """The count of what follows."""
        start, _ = self.numbers("uint32", None)
        (count,) = struct.unpack_from(self.order + "I", self.data, start)
        self.counts_at.append((start, count))
        return int(count)

    def text(self) -> str:
        """A string without its terminator; bytes that are not UTF-8 are written with backslashes."""
        start = self.skip(self.count())
        self.texts_at.append((start, self.end))
        text = self.data[start : self.end]
        return (text if self._is_packed else text[:-1]).decode("utf-8", "backslashreplace")


@cache
def number_type(order: str, kind: str) -> np.dtype[Any]:
    """Type of a primitive in this byte order."""
    return np.dtype(order + PRIMITIVES[kind])


class Decoder:
    """Decodes messages of a type one by one, fields as attributes, arrays of numbers as numpy arrays.

    Parameters
    ----------
    kind, encoding, definitions : as of `MessageType`.
    """

    def __init__(self, kind: str, encoding: str, definitions: Definitions) -> None:
        self._kind, self._definitions = kind, definitions
        self._is_packed = encoding == ROS1
        self._classes: dict[str, Any] = {}

    def __call__(self, data: bytes) -> Any:
        """The message; raises Damage if it is not of this type."""
        return self._value(Reading(data, self._is_packed), None, self._kind, None)

    def read(self, data: bytes) -> Reading:
        """The message, and where its parts are."""
        reading = Reading(data, self._is_packed)
        reading.message = self._value(reading, "", self._kind, None)
        return reading

    def _value(self, reading: Reading, path: str | None, kind: str, length: int | None) -> Any:
        """A value; without a path the places of its numbers are not kept."""
        if length is not None:
            count = length or reading.count()
            if kind not in PRIMITIVES:
                each = range(count)
                return [self._value(reading, None if path is None else f"{path}[{i}]", kind, None) for i in each]
            start, dtype = reading.numbers(kind, count, path)
            return np.frombuffer(reading.data, dtype, count, start)
        if kind == "string":
            return reading.text()
        if kind in PRIMITIVES:
            start, _ = reading.numbers(kind, None, path)
            (value,) = struct.unpack_from(reading.order + PRIMITIVES[kind], reading.data, start)
            return value != 0 if kind == "bool" else value
        fields = self._definitions[kind]
        values = [
            self._value(reading, None if path is None else f"{path}.{name}", of, size) for name, of, size in fields
        ]
        if not fields and not self._is_packed:
            reading.skip(1)
        if kind not in self._classes:
            self._classes[kind] = _message_class(kind, *(name for name, _, _ in fields))
        return self._classes[kind](*values)


@cache
def _message_class(kind: str, *fields: str) -> Any:
    """A class of messages with these fields: most topics of a bag have a header, and making one takes long."""
    return namedtuple(kind.rpartition("/")[2], [name + "_" * keyword.iskeyword(name) for name in fields])


@cache
def _decoder(kind: str) -> Decoder:
    """That of a type that the stack publishes."""
    return Decoder(kind, CDR, definitions(kind, schema(kind)))


def from_json(data: bytes) -> Any:
    """A message of JSON, fields as attributes; raises Damage if it is none."""
    try:
        return json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
    except ValueError as error:
        raise Damage(f"a message is no JSON: {error}") from None


def encoded(kind: str, value: Sequence[Any]) -> bytes:
    """A serialized message, little-endian, its padding zeros.

    Parameters
    ----------
    kind : ``package/msg/Type``.
    value : its fields in their order: a number, a string, bytes, a sequence of them, or the fields of a message.
    """
    body = bytearray()
    _add(body, kind, None, value)
    return LITTLE_ENDIAN + bytes(body)


def _add(body: bytearray, kind: str, length: int | None, value: Any) -> None:
    """Add a value, an array of so many, or a sequence, of length 0."""
    if length == 0:
        _add_numbers(body, "uint32", [len(value)])
    if isinstance(value, bytes):
        body += value
    elif kind in PRIMITIVES:
        _add_numbers(body, kind, [value] if length is None else value)
    elif length is not None:
        for item in value:
            _add(body, kind, None, item)
    elif kind == "string":
        text = value.encode() + b"\0"
        _add_numbers(body, "uint32", [len(text)])
        body += text
    else:
        for field, part in zip(definition(kind), value, strict=True):
            _add(body, field.type, field.length, part)


def _add_numbers(body: bytearray, kind: str, values: Sequence[float]) -> None:
    """Numbers, aligned to their size."""
    if values:
        body += bytes(-len(body) % number_type("<", kind).itemsize)
        body += struct.pack(f"<{len(values)}{PRIMITIVES[kind]}", *values)


class Pattern:
    """Stamped messages of one type that differ in their stamp and in float64 numbers only.

    All these numbers are packed, or found, in one go.  They are in three groups at most: a group is an array, or what
    follows without a gap, as the components of a wrench.

    Parameters
    ----------
    kind : ``package/msg/Type``, which begins with a stamp.
    value : such a message, as `encoded` takes it.
    table : path of bytes that hold float64 numbers, '' where none do.

    Attributes
    ----------
    size : bytes of a message.
    """

    def __init__(self, kind: str, value: Sequence[Any], table: str = "") -> None:
        data = encoded(kind, value)
        spans: list[tuple[int, int]] = []  # of the groups
        for path, (offset, dtype, length) in _decoder(kind).read(data).numbers_at.items():
            begin = ENCAPSULATION + offset
            end = begin + dtype.itemsize * (1 if length is None else length)
            if path != f".{table}" and dtype.str != "<f8":
                continue
            if length is None and spans and begin == spans[-1][1]:
                begin, _ = spans.pop()
            spans.append((begin, end))
        self.size = len(data)
        groups = tuple(spans)
        spans += [(len(data), len(data))] * (3 - len(spans))
        begins, ends = zip(*spans, strict=True)
        edges = zip((_AFTER_STAMP, *ends), (*begins, len(data)), strict=True)
        self._constants = tuple((begin, end, data[begin:end]) for begin, end in edges)
        first, second, third, last = (constant for _, _, constant in self._constants)
        self._between = first, second, third, last
        forms = [
            f"{len(constant)}s{(end - begin) // 8}d"
            for constant, (begin, end) in zip(self._between, spans, strict=False)
        ]
        self._pack = struct.Struct(f"<4siI{''.join(forms)}{len(last)}s").pack
        self._groups = [(struct.Struct(f"<{(end - begin) // 8}d").unpack_from, begin) for begin, end in groups]

    def pack(
        self, stamp: int, first: Sequence[float] = (), second: Sequence[float] = (), third: Sequence[float] = ()
    ) -> bytes:
        """A message, from its stamp, ns, and the groups of numbers."""
        a, b, c, d = self._between
        return self._pack(LITTLE_ENDIAN, *divmod(stamp, SECOND), a, *first, b, *second, c, *third, d)

    def numbers(self, data: bytes) -> list[tuple[float, ...]] | None:
        """The groups of numbers, None of a message that is of another pattern."""
        if len(data) < self.size or data[:ENCAPSULATION] != LITTLE_ENDIAN:
            return None
        for begin, end, constant in self._constants:
            if data[begin:end] != constant:
                return None
        return [unpack_from(data, begin) for unpack_from, begin in self._groups]


def stamp_reader(name: str) -> Callable[[bytes], int | None]:
    """A function that reads the stamp of a message of this type from its bytes, in ns.

    The stamp is the one the message begins with, or that of the first element if it begins with a
    sequence of stamped messages (MarkerArray).  The function returns None if there is none, or too few bytes.
    """
    first = definition(name)[0]
    if first.type in _STAMPS and first.length is None:
        return first_stamp
    if first.length == 0 and "/" in first.type and definition(first.type)[0].type in _STAMPS:
        element = ENCAPSULATION + 4  # behind the count
        return lambda data: first_stamp(data, element) if any(data[ENCAPSULATION:element]) else None
    return lambda data: None


def first_stamp(data: bytes, at: int = ENCAPSULATION) -> int | None:
    """The stamp that a message begins with, or has at a place, ns; None where it is too short to have one."""
    if len(data) < at + 8:
        return None
    sec, nanosec = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, at)
    return int(sec) * SECOND + int(nanosec)


class ExactLength:
    """The length that a message of one type has without the extra bytes that the publisher left at its end.

    ``serialize_message`` of rclpy returns up to 16 bytes too many, which strict readers refuse.  The length
    follows from the counts of strings and sequences in the message.  Messages of a topic mostly repeat them,
    so the last layout is kept: as long as the same counts are in the same places, nothing needs to be walked
    through (0.3 us instead of 20).
    """

    def __init__(self, name: str) -> None:
        self._decoder = _decoder(name)
        self._known = struct.Struct("")
        self._counts: tuple[int, ...] | None = None
        self._length = 0

    def __call__(self, data: bytes) -> int:
        """Exact length of `data`; its whole length if it does not fit the type."""
        if len(data) >= self._length and self._known.unpack_from(data) == self._counts:
            return self._length
        try:
            found = self._decoder.read(data)
        except Damage:
            return len(data)
        if len(found.counts_at) > READING_LIMITS.counts_kept:
            self._counts = None
        else:
            self._keep(found)
        return found.end

    def _keep(self, found: Reading) -> None:
        form, position, counts = found.order + "xB", 2, [found.data[1]]
        for offset, count in found.counts_at:
            form += f"{offset - position}xI"
            position = offset + 4
            counts.append(count)
        self._known, self._counts, self._length = struct.Struct(form), tuple(counts), found.end
