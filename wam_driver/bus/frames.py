"""Frames of the arm's CAN bus: requests to motor controllers and safety module, packed torques, and their replies.

An identifier is a group bit, the sender and the receiver.  Source: libbarrett (`puck.h`, `motor_puck.cpp`), LGPL; facts
only.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple


class BusGroup(IntEnum):
    """Groups of nodes that take a frame, with the bit of groups."""

    ANY = 0x400
    ARM = 0x401  # torques of the controllers 1 to 4
    WRIST = 0x402  # torques of the controllers 5 to 7
    POSITIONS = 0x403  # replies
    MOTORS = 0x404
    VALUES = 0x406  # replies


HOST: Final = 0
SAFETY: Final = 10  # safety module; controllers of motors have the numbers 1 to 7
WRITE: Final = 0x80  # bit of the first byte


class Frame(NamedTuple):
    """A classic CAN frame: 11 bits of identifier, up to 8 bytes."""

    identifier: int
    data: bytes

    @property
    def sender(self) -> int:
        """Node that sends it, 0 is the host."""
        return self.identifier >> 5 & 31

    @property
    def receiver(self) -> int:
        """Node or group that takes it."""
        return self.identifier & 0x41F


class Value(NamedTuple):
    """Answer of a node: a property with its number, or encoder counts without a number."""

    node: int
    number: int | None
    value: int


def get(receiver: int, number: int) -> Frame:
    """Ask a node, or all nodes of a group, for a property."""
    return Frame(receiver, bytes([number]))


def put(receiver: int, number: int, value: int) -> Frame:
    """Write a property of a node or of a group, signed 32 bits; nobody acknowledges it."""
    return Frame(receiver, bytes([WRITE | number, 0]) + value.to_bytes(4, "little", signed=True))


def written(frame: Frame) -> int:
    """The value of `put`, or of a reply."""
    return int.from_bytes(frame.data[2:], "little", signed=True)


def reply(node: int, number: int, value: int) -> Frame:
    """The answer of a node to `get`."""
    return put(BusGroup.VALUES | node << 5, number, value)


def torques(group: int, number: int, values: Sequence[int]) -> Frame:
    """Torques of up to four controllers in counts of 14 bits; `number` of the property T."""
    packed = WRITE | number
    for value in (*values, 0, 0, 0)[:4]:
        packed = packed << 14 | value & 0x3FFF
    return Frame(group, packed.to_bytes(8, "big"))


def read_torques(frame: Frame) -> list[int]:
    """The four counts of `torques`."""
    packed = int.from_bytes(frame.data[1:], "big")
    return [_signed(packed >> shift, 14) for shift in (42, 28, 14, 0)]


def position(node: int, count: int) -> Frame:
    """The answer of a controller to `get` of its position."""
    return Frame(BusGroup.POSITIONS | node << 5, (count & 0x3FFFFF).to_bytes(3, "big"))


def read(frame: Frame) -> Value | None:
    """What a node has answered; None for any other frame."""
    to, data = frame.receiver, frame.data
    if to == BusGroup.POSITIONS and len(data) in (3, 6):  # those of a joint encoder may come after them
        return Value(frame.sender, None, _signed(int.from_bytes(data[:3], "big"), 22))
    if to == BusGroup.VALUES and len(data) in (4, 6) and data[0] & WRITE:
        return Value(frame.sender, data[0] & ~WRITE, written(frame))
    return None


def _signed(value: int, bits: int) -> int:
    """The lowest bits of a value as two's complement."""
    sign = 1 << bits - 1
    return (value & 2 * sign - 1 ^ sign) - sign
