"""Serialized messages on their way into a bag: their exact length and their time stamp."""

import struct
from collections.abc import Callable
from typing import Final

from wam_bag.cdr import ENCAPSULATION, Layout
from wam_bag.definitions import definition, schema
from wam_bag.errors import Damage
from wam_bag.message_text import definitions

_STAMPS = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
_LONGEST_CACHE: Final = 256  # counts of a layout that are kept; a longer message is walked through each time


def stamp_reader(name: str) -> Callable[[bytes], int | None]:
    """A function that reads the stamp of a message of this type from its bytes, in ns.

    The stamp is the one the message begins with, or that of the first element if it begins with a
    sequence of stamped messages (MarkerArray).  The function returns None if there is none, or too few bytes.
    """
    first = definition(name).fields[0]
    if first.type in _STAMPS and first.length is None:
        return _first_stamp
    if first.length == 0 and "/" in first.type and definition(first.type).fields[0].type in _STAMPS:
        return _element_stamp
    return lambda data: None


def _first_stamp(data: bytes) -> int | None:
    if len(data) < ENCAPSULATION + 8:
        return None
    sec, nanosec = struct.unpack_from("<iI" if data[1] else ">iI", data, ENCAPSULATION)
    return int(sec) * 1_000_000_000 + int(nanosec)


def _element_stamp(data: bytes) -> int | None:
    if len(data) < ENCAPSULATION:
        return None
    layout = "<IiI" if data[1] else ">IiI"
    count, sec, nanosec = struct.unpack_from(layout, data.ljust(ENCAPSULATION + 12, b"\0"), ENCAPSULATION)
    return int(sec) * 1_000_000_000 + int(nanosec) if count else None


class ExactLength:
    """The length that a message of one type has without the extra bytes that the publisher left at its end.

    ``serialize_message`` of rclpy returns up to 16 bytes too many, which strict readers refuse.  The length
    follows from the counts of strings and sequences in the message.  Messages of a topic mostly repeat them,
    so the last layout is kept: as long as the same counts are in the same places, nothing needs to be walked
    through (0.3 us instead of 20).
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._definitions = definitions(name, schema(name))
        self._known = struct.Struct("")
        self._counts: tuple[int, ...] | None = None
        self._length = 0

    def __call__(self, data: bytes) -> int:
        """Exact length of `data`; its whole length if it does not fit the type."""
        if len(data) >= self._length and self._known.unpack_from(data) == self._counts:
            return self._length
        try:
            layout = Layout(self._name, self._definitions, data)
        except Damage:
            return len(data)
        if len(layout.counts_at) > _LONGEST_CACHE:
            self._counts = None
        else:
            self._keep(layout)
        return layout.end

    def _keep(self, layout: Layout) -> None:
        form, position, counts = layout.order + "xB", 2, [layout.data[1]]
        for offset, count in layout.counts_at:
            form += f"{offset - position}xI"
            position = offset + 4
            counts.append(count)
        self._known, self._counts, self._length = struct.Struct(form), tuple(counts), layout.end
