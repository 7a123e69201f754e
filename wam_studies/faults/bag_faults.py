"""Broken bags: bytes of a file changed at random, and what a reader may make of it."""

import contextlib
import random
import resource
import signal
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from wam_bag.bag import Bag, BagError

MEMORY: Final = 2**31  # bytes that the process may take meanwhile
PATIENCE: Final = 10  # s, for one bag
HEAD: Final = struct.Struct("<BQ")
BAD_LENGTHS: Final = (0, 1, 2**16, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**64 - 1)


def records(data: bytes) -> list[tuple[int, int]]:
    """Begin and end of each record of an MCAP file."""
    found, position = [], 8
    while position + HEAD.size <= len(data) - 8:
        _, length = HEAD.unpack_from(data, position)
        found.append((position, position + HEAD.size + length))
        position += HEAD.size + length
    return found


def mutated(data: bytes, chance: random.Random) -> tuple[str, bytes]:
    """What was done to a file, and the file."""
    kind = chance.choice(
        ["flip", "flip", "flips", "cut", "remove", "insert", "zeros", "swap", "double", "length", "number"]
    )
    at = chance.randrange(len(data))
    span = chance.choice([1, 4, 9, 100, 5000])
    begin, end = chance.choice(records(data))
    out = bytearray(data)
    if kind == "flip":
        out[at] ^= 1 << chance.randrange(8)
    elif kind == "flips":
        for _ in range(chance.randint(2, 20)):
            out[chance.randrange(len(data))] = chance.randrange(256)
    elif kind == "cut":
        del out[at:]
    elif kind == "remove":
        del out[at : at + span]
    elif kind == "insert":
        out[at:at] = chance.randbytes(span)
    elif kind == "zeros":
        out[at : at + span] = bytes(len(out[at : at + span]))
    elif kind == "swap":
        other_begin, other_end = chance.choice(records(data))
        first, second = sorted([(begin, end), (other_begin, other_end)])
        out = bytearray(
            data[: first[0]]
            + data[second[0] : second[1]]
            + data[first[1] : second[0]]
            + data[first[0] : first[1]]
            + data[second[1] :]
            if first != second
            else data
        )
    elif kind == "double":
        out[end:end] = data[begin:end]
    elif kind == "length":
        length = chance.choice([*BAD_LENGTHS, end - begin - 9 + chance.choice([-9, -1, 1, 8, 9])])
        struct.pack_into("<Q", out, begin + 1, length % 2**64)
    else:  # a number somewhere, small or huge
        code, size = chance.choice([("<H", 2), ("<I", 4), ("<Q", 8)])
        at = min(at, len(data) - size)
        struct.pack_into(code, out, at, chance.choice([*BAD_LENGTHS, chance.randrange(2**16)]) % 2 ** (8 * size))
    return kind, bytes(out)


def values(bag: Bag) -> dict[str, Any]:
    """Everything in a bag in a form that compares, NaN as its bytes."""
    found: dict[str, Any] = {"types": bag.types, "attachments": bag.attachments, "metadata": bag.metadata}
    for topic, columns in bag.topics.items():
        found[topic] = [_plain(column) for column in columns]
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, float):
        return struct.pack("d", value)
    if isinstance(value, str | bytes | int):
        return value
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value]


def verdict(path: Path, truth: dict[str, Any], look: Callable[[Path], dict[str, Any]]) -> str:
    """'same', 'refused', or the first thing that differs: 'metadata', 'types', 'attachments' or a topic."""
    try:
        found = look(path)
    except BagError as error:
        return (
            "refused" if str(path) in str(error) and "; " in str(error) else f"refused without path or advice: {error}"
        )
    differs = [name for name in {*truth, *found} if truth.get(name) != found.get(name)]
    if not differs:
        return "same"
    return min(differs, key=lambda name: (name == "metadata", name))


@contextlib.contextmanager
def limits(memory: int = MEMORY) -> Iterator[None]:
    """A process of bounded memory (bytes more than now) in which a hang becomes an error."""

    def late(number: int, frame: object) -> None:
        raise TimeoutError(f"a bag took more than {PATIENCE} s")

    before = resource.getrlimit(resource.RLIMIT_DATA)  # files that are only mapped do not count
    used = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (used + memory, before[1]))
    handler = signal.signal(signal.SIGALRM, late)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_DATA, before)
