"""Where things stand in a serialized message (CDR): its exact length and its time stamp."""

import struct
from collections.abc import Callable
from typing import Final

from wam_ros.definitions import definition
from wam_ros.message_text import PRIMITIVES

HEADER: Final = 4  # encapsulation: byte order and options
_STAMPS = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
_LONGEST_CACHE = 256  # counts of a layout that are kept; a longer message is walked each time


def stamp_reader(name: str) -> Callable[[bytes], int | None]:
    """A function that reads the stamp of a message of this type from its bytes, in ns.

    The stamp is the one the message begins with, or that of the first element where it begins with a
    sequence of stamped messages (MarkerArray).  The function returns None where there is none.
    """
    first = definition(name).fields[0]
    if first.type in _STAMPS and first.length is None:
        return _first_stamp
    if first.length == 0 and "/" in first.type and definition(first.type).fields[0].type in _STAMPS:
        return _element_stamp
    return lambda data: None


def _first_stamp(data: bytes) -> int:
    sec, nanosec = struct.unpack_from("<iI" if data[1] else ">iI", data, HEADER)
    return int(sec) * 1_000_000_000 + int(nanosec)


def _element_stamp(data: bytes) -> int | None:
    layout = "<IiI" if data[1] else ">IiI"
    count, sec, nanosec = struct.unpack_from(layout, data.ljust(HEADER + 12, b"\0"), HEADER)
    return int(sec) * 1_000_000_000 + int(nanosec) if count else None


class ExactLength:
    """The length that a message of one type has without what the publisher left behind it.

    ``serialize_message`` of rclpy returns up to 16 bytes too many, which strict readers refuse.  The
    length follows from the counts of strings and sequences in the message.  Messages of a topic
    mostly repeat them, so the last layout is kept: as long as the same counts stand in the same
    places, nothing needs to be walked (0.5 us instead of 15).
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._known = struct.Struct("")
        self._counts: tuple[int, ...] | None = None
        self._length = 0

    def __call__(self, data: bytes) -> int:
        """Exact length of `data`; its whole length where it does not fit the type."""
        if len(data) >= self._length and self._known.unpack_from(data) == self._counts:
            return self._length
        try:
            walk = _Walk(data)
            walk.message(self._name)
        except (struct.error, KeyError):
            return len(data)
        if walk.position > len(data):
            return len(data)
        self._keep(walk)
        return walk.position

    def _keep(self, walk: "_Walk") -> None:
        if len(walk.counts) > _LONGEST_CACHE:
            self._counts = None
            return
        layout, position, counts = walk.order + "xB", 2, [walk.data[1]]
        for offset, count in walk.counts:
            layout += f"{offset - position}xI"
            position = offset + 4
            counts.append(count)
        self._known, self._counts, self._length = struct.Struct(layout), tuple(counts), walk.position


class _Walk:
    """One pass over a message that notes every count and ends where the message ends."""

    def __init__(self, data: bytes) -> None:
        if len(data) < HEADER:
            raise struct.error("no encapsulation header")
        self.data = data
        self.order = "<" if data[1] else ">"
        self.position = HEADER
        self.counts: list[tuple[int, int]] = []

    def message(self, name: str) -> None:
        """Pass over one message; an empty one takes a byte."""
        if self.position > len(self.data):
            raise struct.error("message ends early")
        fields = definition(name).fields
        for field in fields:
            if field.length is None:
                self._values(field.type, 1)
            else:
                self._values(field.type, field.length or self._count())
        self.position += not fields

    def _count(self) -> int:
        self._align(4)
        count = int(struct.unpack_from(self.order + "I", self.data, self.position)[0])
        self.counts.append((self.position, count))
        self.position += 4
        return count

    def _values(self, kind: str, number: int) -> None:
        if kind == "string":
            for _ in range(number):
                characters = self._count()
                self.position += characters
        elif "/" in kind:
            for _ in range(number):
                self.message(kind)
        elif number:
            size = PRIMITIVES[kind]
            self._align(size)
            self.position += size * number

    def _align(self, size: int) -> None:
        self.position += -(self.position - HEADER) % size
