"""Serialized messages (CDR): the place of each value, and messages decoded one by one.

A message is 4 bytes that name the byte order, then its values one after the other, each aligned to its size
relative to the end of those 4 bytes.
"""

import keyword
import struct
from collections import namedtuple
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_bag.errors import Damage
from wam_bag.message_text import PRIMITIVES, Fields

ENCAPSULATION: Final = 4
ORDERS: Final = {b"\0\0": ">", b"\0\1": "<"}
_CODES = {
    "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_LETTERS = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d",
}  # fmt: skip

Definitions = Mapping[str, Fields]


class Leaf(NamedTuple):
    """Numbers in a message: first byte behind the encapsulation, type, length of the array or None for one number."""

    offset: int
    dtype: np.dtype[Any]
    length: int | None


class Layout:
    """The place of everything in messages that have the same counts and strings as this one.

    Parameters
    ----------
    kind : ``package/msg/Type``.
    definitions : fields of it and of the types it consists of.
    data : a message of this type, with its encapsulation.

    Attributes
    ----------
    numbers : numbers and arrays of them, by path: 'header.stamp.sec', 'position', 'markers[0].scale.x'.
    texts : strings and arrays of them, by path.
    counts : length of each sequence of messages, by path.
    counts_at : place and value of every count in the message, of characters, numbers or messages.
    fixed : for each byte of the message whether it decides the layout: byte order, counts, strings.
    end : bytes of the message.
    """

    def __init__(self, kind: str, definitions: Definitions, data: bytes) -> None:
        self.order = byte_order(data)
        self.numbers: dict[str, Leaf] = {}
        self.texts: dict[str, tuple[str, ...]] = {}
        self.counts: dict[str, int] = {}
        self.counts_at: list[tuple[int, int]] = []
        self.fixed = np.zeros(len(data), np.bool_)
        self.fixed[:2] = True
        self.data = data
        self._definitions = definitions
        self.end = ENCAPSULATION
        self._message(kind, "")

    def _message(self, kind: str, path: str) -> None:
        fields = self._definitions[kind]
        for name, inner, length in fields:
            self._field(f"{path}.{name}" if path else name, inner, length)
        if not fields:
            self._skip(1)

    def _field(self, path: str, kind: str, length: int | None) -> None:
        count = length or (1 if length is None else self._count())
        if kind == "string":
            self.texts[path] = tuple(self._text() for _ in range(count))
        elif kind in PRIMITIVES:
            size = PRIMITIVES[kind]
            if count:
                self._align(size)
            dtype = np.dtype(self.order + _CODES[kind])
            self.numbers[path] = Leaf(self.end - ENCAPSULATION, dtype, None if length is None else count)
            self._skip(size * count)
        elif length is None:
            self._message(kind, path)
        else:
            self.counts[path] = count
            for i in range(count):
                self._message(kind, f"{path}[{i}]")

    def _count(self) -> int:
        self._align(4)
        start = self.end
        self._skip(4)
        self.fixed[start : self.end] = True
        (count,) = struct.unpack_from(self.order + "I", self.data, start)
        self.counts_at.append((start, count))
        return int(count)

    def _text(self) -> str:
        length = self._count()
        start = self.end
        self._skip(length)
        self.fixed[start : self.end] = True
        return text_of(self.data[start : self.end])

    def _align(self, size: int) -> None:
        self.end += -(self.end - ENCAPSULATION) % size

    def _skip(self, size: int) -> None:
        self.end += size
        if self.end > len(self.data):
            raise Damage("a message ends early")


def byte_order(data: bytes) -> str:
    """'<' or '>' by the encapsulation."""
    try:
        return ORDERS[data[:2]]
    except KeyError:
        raise Damage(f"a message has the encapsulation {data[:2].hex() or 'none'}; plain CDR is read") from None


def text_of(data: bytes) -> str:
    """A string without its terminator; bytes that are not UTF-8 are written with backslashes."""
    return data[:-1].decode("utf-8", "backslashreplace")


Step = Callable[[bytes, int], tuple[Any, int]]


class Decoder:
    """Decodes messages of a type one by one, fields as attributes, arrays of numbers as numpy arrays.

    Parameters
    ----------
    kind : ``package/msg/Type``.
    definitions : fields of it and of the types it consists of.
    """

    def __init__(self, kind: str, definitions: Definitions) -> None:
        self.kind, self.definitions = kind, definitions
        self._classes: dict[str, Any] = {}
        self._steps: dict[tuple[str, str], Step] = {}

    def __call__(self, data: bytes) -> Any:
        """The message; raises Damage if it is not of this type."""
        order = byte_order(data)
        try:
            message, _ = self._struct(self.kind, order)(data[ENCAPSULATION:], 0)
        except struct.error:
            raise Damage("a message ends early") from None
        return message

    def _struct(self, kind: str, order: str) -> Step:
        """The step of a type, made once: types in types may occur any number of times."""
        step = self._steps.get((kind, order))
        if step is None:
            step = self._steps[kind, order] = self._new_struct(kind, order)
        return step

    def _new_struct(self, kind: str, order: str) -> Step:
        fields = self.definitions[kind]
        make = self.maker(kind)
        steps = [self._field(inner, length, order) for _, inner, length in fields]

        def decode(data: bytes, position: int) -> tuple[Any, int]:
            values = []
            for step in steps:
                value, position = step(data, position)
                values.append(value)
            if not steps and position > len(data):
                raise Damage("a message ends early")
            return make(values), position + (not steps)

        return decode

    def maker(self, kind: str) -> Callable[[Any], Any]:
        """A function that makes an object of a type from the values of its fields."""
        make: Callable[[Any], Any] | None = self._classes.get(kind)
        if make is None:
            names = [name + "_" * keyword.iskeyword(name) for name, _, _ in self.definitions[kind]]
            kinds: Any = namedtuple(kind.rpartition("/")[2], names)  # type: ignore[misc]
            make = self._classes[kind] = kinds._make
        return make

    def _field(self, kind: str, length: int | None, order: str) -> Step:
        if length is not None and kind in PRIMITIVES:
            return _array(kind, length, order)
        if kind in PRIMITIVES:
            return _number(kind, order)
        one = _string(order) if kind == "string" else self._struct(kind, order)
        return one if length is None else _sequence(one, length, order)


def _number(kind: str, order: str) -> Step:
    size = PRIMITIVES[kind]
    take = struct.Struct(order + _LETTERS[_CODES[kind]]).unpack_from

    def decode(data: bytes, position: int) -> tuple[Any, int]:
        position += -position % size
        return take(data, position)[0], position + size

    def decode_bool(data: bytes, position: int) -> tuple[bool, int]:
        return take(data, position)[0] != 0, position + 1

    return decode_bool if kind == "bool" else decode


def _counter(length: int, order: str) -> Callable[[bytes, int], tuple[int, int]]:
    """Reads the count of a sequence; a fixed array has none in the message."""
    take = struct.Struct(order + "I").unpack_from

    def count(data: bytes, position: int) -> tuple[int, int]:
        position += -position % 4
        return take(data, position)[0], position + 4

    return count if not length else lambda data, position: (length, position)


def _array(kind: str, length: int, order: str) -> Step:
    size, dtype = PRIMITIVES[kind], np.dtype(order + _CODES[kind])
    counter = _counter(length, order)

    def decode(data: bytes, position: int) -> tuple[NDArray[Any], int]:
        count, position = counter(data, position)
        if not count:
            return np.empty(0, dtype), position
        position += -position % size
        end = position + count * size
        if end > len(data):
            raise Damage("a message ends early")
        return np.frombuffer(data, dtype, count, position), end

    return decode


def _string(order: str) -> Step:
    counter = _counter(0, order)

    def decode(data: bytes, position: int) -> tuple[str, int]:
        count, start = counter(data, position)
        end = start + count
        if end > len(data):
            raise Damage("a message ends early")
        return text_of(data[start:end]), end

    return decode


def _sequence(one: Step, length: int, order: str) -> Step:
    counter = _counter(length, order)

    def decode(data: bytes, position: int) -> tuple[list[Any], int]:
        count, position = counter(data, position)
        values = []
        for _ in range(count):
            value, position = one(data, position)
            if position > len(data):
                raise Damage("a message ends early")
            values.append(value)
        return values, position

    return decode
