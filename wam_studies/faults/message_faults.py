"""Broken messages: each field wrong in each way, wrong stamps, bytes that are no message.

A message is any object with `get_fields_and_field_types`, as ROS makes them; this module imports no ROS.
"""

import struct
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random
from typing import Any, Final, NamedTuple

SECOND: Final = 10**9  # ns
NOT_FINITE: Final = (float("nan"), float("inf"), float("-inf"))


@dataclass(frozen=True)
class BrokenValues:
    """What is put in the place of numbers, and how long lists are made."""

    huge: tuple[float, ...] = (1e6, -1e6, 1e12, -1e30, 1.7e308, -1.7e308)
    tiny: tuple[float, ...] = (5e-324, -5e-324, 1e-300, -0.0)
    lengths: tuple[int, ...] = (0, 1, 3, 5, 100, 5000)


BROKEN: Final = BrokenValues()
TEXTS: Final = ("", "x" * 10_000, "\x1b[2J\x1b[31m", "joint1", "base", "driver", "\U0001f9be", "../../etc", "[" * 500)
SIZES: Final = {
    "boolean": "?", "octet": "B", "byte": "B", "uint8": "B", "int8": "b", "uint16": "H", "int16": "h",
    "uint32": "I", "int32": "i", "uint64": "Q", "int64": "q", "float": "f", "double": "d",
}  # fmt: skip

Message = Any
Stamps = Callable[[Random, int], int]


class MessageLeaf(NamedTuple):
    """A field of a message that is no message itself: its owner, name and type."""

    owner: Message
    name: str
    kind: str

    @property
    def value(self) -> Any:
        """Its present value."""
        return getattr(self.owner, self.name)


def leaves(message: Message) -> Iterator[MessageLeaf]:
    """Every field that is no message, in order; a sequence of messages by its members."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            yield from leaves(value)
        elif "/" in kind:
            for member in value:
                yield from leaves(member)
        else:
            yield MessageLeaf(message, name, kind)


def _numbers(message: Message) -> list[MessageLeaf]:
    return [leaf for leaf in leaves(message) if leaf.kind.removeprefix("sequence<").startswith(("double", "float"))]


def with_numbers(message: Message, chance: Random, values: tuple[float, ...]) -> bool:
    """Put one of the values into one number of a message, or into all of an array; False where it has none."""
    found = [leaf for leaf in _numbers(message) if not leaf.kind.startswith("sequence") or len(leaf.value)]
    if not found:
        return False
    leaf, value = chance.choice(found), chance.choice(values)
    if leaf.kind.startswith("sequence"):
        numbers = list(leaf.value)
        for i in range(len(numbers)) if chance.random() < 0.3 else [chance.randrange(len(numbers))]:
            numbers[i] = value
        setattr(leaf.owner, leaf.name, numbers)
    else:
        setattr(leaf.owner, leaf.name, value)
    return True


def with_lengths(message: Message, chance: Random) -> bool:
    """Give an array another length; False where there is none."""
    found = [leaf for leaf in leaves(message) if leaf.kind.startswith("sequence")]
    if not found:
        return False
    leaf = chance.choice(found)
    old = list(leaf.value)
    length = chance.choice([n for n in BROKEN.lengths if n != len(old)])
    filler = old[:1] or (["joint1"] if "string" in leaf.kind else [0] if "int" in leaf.kind else [0.3])
    setattr(leaf.owner, leaf.name, _like(leaf.value, (old + filler * length)[:length]))
    return True


def with_texts(message: Message, chance: Random) -> bool:
    """Replace, double or lose a name or a text; False where there is none."""
    found = [leaf for leaf in leaves(message) if "string" in leaf.kind]
    if not found:
        return False
    leaf = chance.choice(found)
    if not leaf.kind.startswith("sequence"):
        setattr(leaf.owner, leaf.name, chance.choice([text for text in TEXTS if text != leaf.value]))
        return True
    names = list(leaf.value) or ["joint1"]
    i, way = chance.randrange(len(names)), chance.randrange(4)
    if way == 0:
        names[i] = chance.choice(TEXTS[:3])
    elif way == 1:
        names[i] = names[i - 1]
    elif way == 2:
        del names[i]
    else:
        names.append(names[0])
    setattr(leaf.owner, leaf.name, names)
    return True


def permuted(message: Message, chance: Random) -> bool:
    """Change the order of names and values together, which means the same; False where there are no names."""
    names = getattr(message, "name", None)
    if not isinstance(names, list) or not names:
        return False
    order = chance.sample(range(len(names)), len(names))
    for leaf in leaves(message):
        if leaf.kind.startswith("sequence") and len(leaf.value) == len(order):
            setattr(leaf.owner, leaf.name, _like(leaf.value, [leaf.value[i] for i in order]))
    return True


def with_integers(message: Message, chance: Random) -> bool:
    """Put an extreme into an integer other than those of a stamp; False where there is none."""
    found = [
        leaf
        for leaf in leaves(message)
        if leaf.kind.startswith(("int", "uint")) and leaf.name not in ("sec", "nanosec")
    ]
    if not found:
        return False
    leaf = chance.choice(found)
    bits = int("".join(filter(str.isdigit, leaf.kind)))
    top = 2**bits if leaf.kind.startswith("u") else 2 ** (bits - 1)
    setattr(leaf.owner, leaf.name, chance.choice([top - 1, top // 2, 0 if leaf.kind.startswith("u") else -top]))
    return True


def _like(old: Any, new: list[Any]) -> Any:
    return array(old.typecode, new) if isinstance(old, array) else new


def set_stamp(message: Message, nanoseconds: int) -> bool:
    """Set the stamp in the header, ns, or any 64-bit pair where it is out of range; False where it has no header."""
    if not hasattr(message, "header"):
        return False
    sec, nanosec = divmod(nanoseconds, SECOND)
    message.header.stamp.sec = max(-(2**31), min(sec, 2**31 - 1))
    message.header.stamp.nanosec = nanosec
    return True


FUTURE: Final[dict[str, Stamps]] = {
    "next period": lambda chance, now: now + 1_000_000,
    "next seconds": lambda chance, now: now + chance.randrange(2_000_000, 10 * SECOND),
    "wall clock": lambda chance, now: 1_790_000_000 * SECOND + chance.randrange(SECOND),
    "end of time": lambda chance, now: (2**31 - 1) * SECOND + SECOND - 1,
}
PAST: Final[dict[str, Stamps]] = {
    "zero": lambda chance, now: 0,
    "negative": lambda chance, now: -chance.randrange(1, 2**31) * SECOND,
    "stale": lambda chance, now: max(1_000_000, now - chance.randrange(200_000_000, 5 * SECOND)),
}


def with_excess_nanoseconds(message: Message, chance: Random) -> bool:
    """A stamp with more nanoseconds than a second has; False where it has no header."""
    if not hasattr(message, "header"):
        return False
    message.header.stamp.nanosec = chance.randrange(SECOND, 2**32)
    return True


# bytes


def garbage(data: bytes, chance: Random) -> bytes:
    """Bytes that are no message: random, cut, with bits flipped, of the other byte order, or too long."""
    way = chance.randrange(6)
    if way == 0:
        return chance.randbytes(chance.choice([0, 1, 3, 4, 7, 8, 11, 12, 16, 50, 500, 4000]))
    if way == 1:
        return data[: chance.randrange(len(data))]
    if way == 2:
        return b"\0\0\0\0" + data[4:]  # declared big-endian, is little-endian
    if way == 3:
        return data[:4] + chance.randbytes(len(data) - 4)
    out = bytearray(data)
    if way == 4:  # a count or a length far too large
        at = 4 * chance.randrange(1, max(2, len(out) // 4))
        out[at : at + 4] = struct.pack("<I", chance.choice([2**31, 2**32 - 1, 2**16]))
        return bytes(out)
    return data[:4] + struct.pack("<I", 2**32 - 1) * chance.randrange(1, 60)


def big_endian(message: Message) -> bytes:
    """The message in the other byte order, which is a valid message."""
    out = bytearray(b"\0\0\0\0")
    _write(message, out)
    return bytes(out)


def _write(message: Message, out: bytearray) -> None:
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if kind.startswith("sequence<"):
            _put(out, "I", len(value))
            for member in value:
                _write_one(member, kind[9:-1], out)
        elif kind.endswith("]"):
            for member in value:
                _write_one(member, kind.partition("[")[0], out)
        else:
            _write_one(value, kind, out)


def _write_one(value: Any, kind: str, out: bytearray) -> None:
    if hasattr(value, "get_fields_and_field_types"):
        _write(value, out)
    elif kind.startswith("string"):
        text = value.encode() + b"\0"
        _put(out, "I", len(text))
        out += text
    else:
        _put(out, SIZES[kind], value[0] if isinstance(value, bytes) else value)


def _put(out: bytearray, code: str, value: Any) -> None:
    size = struct.calcsize(code)
    out += bytes(-(len(out) - 4) % size) + struct.pack(f">{code}", value)


# the faults


class MessageFault(NamedTuple):
    """A way to break a message.

    Attributes
    ----------
    name : in words.
    moves : whether the values would move the arm if the message were used; they do not where it is right to use it.
    change : changes a message, the chance and the time of the arm given; False where it cannot be broken so.
    data : changes the bytes afterwards.
    """

    name: str
    moves: bool
    change: Callable[[Message, Random, int], bool] = lambda message, chance, now: True
    data: Callable[[bytes, Message, Random], bytes] = lambda data, message, chance: data


def _stamped(stamps: Stamps) -> Callable[[Message, Random, int], bool]:
    return lambda message, chance, now: set_stamp(message, stamps(chance, now))


MESSAGE_FAULTS: Final = (
    MessageFault("a number not finite", True, lambda m, chance, now: with_numbers(m, chance, NOT_FINITE)),
    MessageFault("a huge number", True, lambda m, chance, now: with_numbers(m, chance, BROKEN.huge)),
    MessageFault("a tiny number", False, lambda m, chance, now: with_numbers(m, chance, BROKEN.tiny)),
    MessageFault("an array of another length", True, lambda m, chance, now: with_lengths(m, chance)),
    MessageFault("a wrong text or name", True, lambda m, chance, now: with_texts(m, chance)),
    MessageFault("names in another order", False, lambda m, chance, now: permuted(m, chance)),
    MessageFault("an extreme integer", True, lambda m, chance, now: with_integers(m, chance)),
    *(MessageFault(f"a stamp of the future: {name}", True, _stamped(stamps)) for name, stamps in FUTURE.items()),
    *(MessageFault(f"a stamp of the past: {name}", True, _stamped(stamps)) for name, stamps in PAST.items()),
    MessageFault("a stamp of too many nanoseconds", True, lambda m, chance, now: with_excess_nanoseconds(m, chance)),
    MessageFault("the same message again", False),
    MessageFault("bytes that are no message", True, data=lambda data, m, chance: garbage(data, chance)),
    MessageFault("the other byte order", False, data=lambda data, m, chance: big_endian(m)),
)


def broken(
    message: Message, fault: MessageFault, chance: Random, now: int, serialize: Callable[[Message], bytes]
) -> bytes | None:
    """The bytes of a message after it has been broken, None where it cannot be broken in this way."""
    if not fault.change(message, chance, now):
        return None
    return fault.data(serialize(message), message, chance)


# values that would move the arm
EFFECTIVE: Final = {
    "joint_velocity_command": {"velocity": 0.5},
    "motor_velocity_command": {"velocity": 10.0},
    "joint_effort_command": {"effort": 8.0},
    "gravity_effort": {"effort": -15.0},
    "motor_effort_command": {"effort": 0.4},
    "motor_current_command": {"effort": 0.8},
    "joint_torque_command": {"effort": 8.0},
    "joint_posture_command": {"position": 0.4},
    "joint_states": {"position": 0.4, "velocity": -0.5},
    "motor_states": {"position": 5.0, "velocity": -10.0},
    "external_joint_torques": {"effort": 8.0},
    "force_command": {"force": 12.0},
    "sim/disturbance": {"force": 60.0},
}


def made_effective(topic: str, message: Message, cover: str) -> None:
    """Give a message values that would move the arm, all within what the arm can do; a force acts on the cover."""
    for name, value in EFFECTIVE.get(topic, {}).items():
        if name == "force":
            message.wrench.force.x, message.wrench.force.z = value, -value
            message.header.frame_id = cover
        else:
            numbers = list(getattr(message, name))
            setattr(message, name, [number + value for number in numbers])
