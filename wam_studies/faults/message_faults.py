"""Broken messages: each field wrong in each way, wrong stamps, bytes that are no message.

A message is any object with `get_fields_and_field_types`, as ROS makes them; this module imports no ROS.
"""

import math
import struct
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random
from typing import Any, Final, NamedTuple

SECOND: Final = 10**9  # ns


@dataclass(frozen=True)
class BrokenValues:
    """What is put in the place of numbers, and how long lists are made."""

    huge: tuple[float, ...] = (1e6, -1e6, 1e12, -1e30, 1.7e308, -1.7e308)
    tiny: tuple[float, ...] = (5e-324, -5e-324, 1e-300, -0.0)
    lengths: tuple[int, ...] = (0, 1, 3, 5, 100, 5000)


BROKEN: Final = BrokenValues()
TEXTS: Final = ("", "x" * 10_000, "\x1b[2J\x1b[31m", "joint1", "base", "driver", "\U0001f9be", "../../etc", "[" * 500)

Message = Any


class MessageLeaf(NamedTuple):
    """A field of a message that is no message itself: its owner, name and type."""

    owner: Message
    name: str
    kind: str

    @property
    def value(self) -> Any:
        """Present value of the field."""
        return getattr(self.owner, self.name)

    @property
    def is_real(self) -> bool:
        """Whether the field has real numbers."""
        return self.kind.removeprefix("sequence<").startswith(("double", "float"))

    @property
    def is_sequence(self) -> bool:
        """Whether the field has several values."""
        return self.kind.startswith("sequence")

    def put(self, value: Any) -> bool:
        """Replace its value; True."""
        old = self.value
        setattr(self.owner, self.name, array(old.typecode, value) if isinstance(old, array) else value)
        return True


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


# changes of a message; False where it cannot be changed so

Change = Callable[[Message, Random, int], bool]


def _field(is_meant: Callable[[MessageLeaf], bool], value: Callable[[MessageLeaf, Random], Any]) -> Change:
    """Put a value in the place of one of the fields that are meant."""

    def change(message: Message, chance: Random, now: int) -> bool:
        found = list(filter(is_meant, leaves(message)))
        return bool(found) and (leaf := chance.choice(found)).put(value(leaf, chance))

    return change


def _numbers(values: tuple[float, ...]) -> Change:
    """One of the values in one number of a message, or in all of an array."""

    def changed(leaf: MessageLeaf, chance: Random) -> Any:
        value = chance.choice(values)
        if not leaf.is_sequence:
            return value
        numbers = list(leaf.value)
        for i in range(len(numbers)) if chance.random() < 0.3 else [chance.randrange(len(numbers))]:
            numbers[i] = value
        return numbers

    return _field(lambda leaf: leaf.is_real and not (leaf.is_sequence and not len(leaf.value)), changed)


def _length(leaf: MessageLeaf, chance: Random) -> Any:
    """An array of another length."""
    return _resized(leaf, chance.choice([n for n in BROKEN.lengths if n != len(leaf.value)]))


def _resized(leaf: MessageLeaf, length: int) -> Any:
    old = list(leaf.value)
    filler = old[:1] or (["joint1"] if "string" in leaf.kind else [0] if "int" in leaf.kind else [0.3])
    return (old + filler * length)[:length]


def enlarge(message: Message) -> None:
    """Make every array of a message as long as one can be here."""
    for leaf in leaves(message):
        if leaf.is_sequence:
            leaf.put(_resized(leaf, max(BROKEN.lengths)))


def _text(leaf: MessageLeaf, chance: Random) -> Any:
    """A name or a text replaced, doubled or lost."""
    if not leaf.is_sequence:
        return chance.choice([text for text in TEXTS if text != leaf.value])
    first, *others = names = list(leaf.value) or ["joint1"]
    return chance.choice([[chance.choice(TEXTS[:3]), *others], [names[-1], *others], others, [*names, first]])


def _is_integer(leaf: MessageLeaf) -> bool:
    """Apart from those of a stamp."""
    return leaf.kind.startswith(("int", "uint")) and leaf.name not in ("sec", "nanosec")


def _extreme(leaf: MessageLeaf, chance: Random) -> int:
    bits, is_signed = int("".join(filter(str.isdigit, leaf.kind))), not leaf.kind.startswith("u")
    top = 2 ** (bits - is_signed)
    return chance.choice([top - 1, top // 2, -top if is_signed else 0])


def _permuted(message: Message, chance: Random, now: int) -> bool:
    """Change the order of names and values together, which means the same."""
    names = getattr(message, "name", None)
    if not isinstance(names, list) or not names:
        return False
    order = chance.sample(range(len(names)), len(names))
    for leaf in leaves(message):
        if leaf.is_sequence and len(leaf.value) == len(order):
            leaf.put([leaf.value[i] for i in order])
    return True


def set_stamp(message: Message, nanoseconds: int) -> bool:
    """Set the stamp in the header, ns, the seconds limited to 32 bits; False where it has no header."""
    if not hasattr(message, "header"):
        return False
    sec, nanosec = divmod(nanoseconds, SECOND)
    message.header.stamp.sec = max(-(2**31), min(sec, 2**31 - 1))
    message.header.stamp.nanosec = nanosec
    return True


def _stamp(time: Callable[[Random, int], int]) -> Change:
    return lambda message, chance, now: set_stamp(message, time(chance, now))


def _unchanged(message: Message, chance: Random, now: int) -> bool:
    return True


# bytes


def _miscounted(data: bytes, chance: Random) -> bytes:
    """A count or a length far too large."""
    at = 4 * chance.randrange(1, max(2, len(data) // 4))
    return data[:at] + struct.pack("<I", chance.choice([2**31, 2**32 - 1, 2**16])) + data[at + 4 :]


NO_MESSAGES: Final[tuple[Callable[[bytes, Random], bytes], ...]] = (  # bytes that are no message
    lambda data, chance: chance.randbytes(chance.choice([0, 1, 3, 4, 7, 8, 11, 12, 16, 50, 500, 4000])),
    lambda data, chance: data[: chance.randrange(len(data))],
    lambda data, chance: b"\0\0\0\0" + data[4:],  # declared big-endian, is little-endian
    lambda data, chance: data[:4] + chance.randbytes(len(data) - 4),
    _miscounted,
    lambda data, chance: data[:4] + struct.pack("<I", 2**32 - 1) * chance.randrange(1, 60),
)


# the faults


class MessageFault(NamedTuple):
    """A way to break a message.

    Attributes
    ----------
    name : in words.
    moves : whether the values would move the arm if the message were used; they do not where it is right to use it.
    change : changes a message, the chance and the time of the arm given; False where it cannot be broken so.
    """

    name: str
    moves: bool
    change: Change


STAMPS: Final[dict[str, Callable[[Random, int], int]]] = {
    "future: next period": lambda chance, now: now + 1_000_000,
    "future: next seconds": lambda chance, now: now + chance.randrange(2_000_000, 10 * SECOND),
    "future: wall clock": lambda chance, now: 1_790_000_000 * SECOND + chance.randrange(SECOND),
    "future: end of time": lambda chance, now: (2**31 - 1) * SECOND + SECOND - 1,
    "past: zero": lambda chance, now: 0,
    "past: negative": lambda chance, now: -chance.randrange(1, 2**31) * SECOND,
    "past: stale": lambda chance, now: max(1_000_000, now - chance.randrange(200_000_000, 5 * SECOND)),
}
GARBAGE: Final = "bytes that are no message"
MESSAGE_FAULTS: Final = (
    MessageFault("a number not finite", True, _numbers((math.nan, math.inf, -math.inf))),
    MessageFault("a huge number", True, _numbers(BROKEN.huge)),
    MessageFault("a tiny number", False, _numbers(BROKEN.tiny)),
    MessageFault("an array of another length", True, _field(lambda leaf: leaf.is_sequence, _length)),
    MessageFault("a wrong text or name", True, _field(lambda leaf: "string" in leaf.kind, _text)),
    MessageFault("names in another order", False, _permuted),
    MessageFault("an extreme integer", True, _field(_is_integer, _extreme)),
    *(MessageFault(f"a stamp of the {name}", True, _stamp(time)) for name, time in STAMPS.items()),
    MessageFault(
        "a stamp of too many nanoseconds",
        True,
        _field(lambda leaf: leaf.name == "nanosec", lambda leaf, chance: chance.randrange(SECOND, 2**32)),
    ),
    MessageFault("the same message again", False, _unchanged),
    MessageFault(GARBAGE, True, _unchanged),
)


def broken(
    message: Message, fault: MessageFault, chance: Random, now: int, serialize: Callable[[Message], bytes]
) -> bytes | None:
    """The bytes of a message after it has been broken, None where it cannot be broken in this way."""
    if not fault.change(message, chance, now):
        return None
    data = serialize(message)
    return chance.choice(NO_MESSAGES)(data, chance) if fault.name == GARBAGE else data


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
