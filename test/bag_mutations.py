"""Bags broken at random: none may crash the reader, hang it, fill the memory or give a wrong value unseen.

    python test/bag_mutations.py 5000 [seed]      all of it, some minutes; the suite runs a part

A wrong value is one that differs from what was written although no error was raised.  If the file has
checksums over everything ('all checksums', 'unchunked, checked') there may be none at all; if it has those of
chunks, attachments and summary, only in metadata records, which MCAP does not protect; if it has none, values
may differ unseen.
"""

import contextlib
import random
import resource
import signal
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from bag_samples import CLOUD, OURS, WAYS, random_samples, write

from wam_bag.bag import Bag, BagError, read

MEMORY: Final = 2**31  # bytes that the process may take meanwhile
PATIENCE: Final = 10  # s, for one bag
BAD_LENGTHS: Final = (0, 1, 2**16, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**64 - 1)


def records(data: bytes) -> list[tuple[int, int]]:
    """Begin and end of each record of an MCAP file."""
    found, position = [], 8
    while position + 9 <= len(data) - 8:
        end = position + 9 + struct.unpack_from("<Q", data, position + 1)[0]
        found.append((position, end))
        position = end
    return found


def mutated(data: bytes, chance: random.Random) -> tuple[str, bytes]:
    """What was done to a file, and the file."""
    at, span, size = chance.randrange(len(data)), chance.choice([1, 4, 9, 100, 5000]), chance.choice([2, 4, 8])
    (begin, end), (a, b), (c, d) = chance.choice(records(data)), *sorted(chance.choices(records(data), k=2))
    hit = len(data[at : at + span])
    length = chance.choice([*BAD_LENGTHS, end - begin - 9 + chance.choice([-9, -1, 1, 8, 9])]) % 2**64
    number = chance.choice([*BAD_LENGTHS, chance.randrange(2**16)]) % 2 ** (8 * size)  # small or huge
    changes = {
        "flip": (at, at + 1, bytes([data[at] ^ 1 << chance.randrange(8)])),
        "noise": (at, at + hit, chance.randbytes(hit)),
        "cut": (at, len(data), b""),
        "remove": (at, at + hit, b""),
        "insert": (at, at, chance.randbytes(span)),
        "zeros": (at, at + hit, bytes(hit)),
        "swap": (a, d, data[c:d] + data[b:c] + data[a:b]),
        "double": (end, end, data[begin:end]),
        "length": (begin + 1, begin + 9, length.to_bytes(8, "little")),
        "number": (min(at, len(data) - size), min(at + size, len(data)), number.to_bytes(size, "little")),
    }
    kind = chance.choice([*changes, "flip"])
    first, last, new = changes[kind]
    return kind, data[:first] + new + data[last:]


def values(bag: Bag) -> dict[str, Any]:
    """Everything in a bag in a form that compares, NaN as its bytes."""
    found: dict[str, Any] = {"types": bag.types, "attachments": bag.attachments, "metadata": bag.metadata}
    return found | {topic: [_plain(column) for column in columns] for topic, columns in bag.topics.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, float):
        return struct.pack("d", value)
    if isinstance(value, str | bytes | int):
        return value
    return {key: _plain(item) for key, item in value.items()} if isinstance(value, dict) else list(map(_plain, value))


def verdict(path: Path, truth: dict[str, Any], look: Callable[[Path], dict[str, Any]]) -> str:
    """'same', 'refused', or the first thing that differs: 'metadata', 'types', 'attachments' or a topic."""
    try:
        found = look(path)
    except BagError as error:
        return "refused" if str(path) in str(error) and "; " in str(error) else f"refused without advice: {error}"
    differs = [name for name in {*truth, *found} if truth.get(name) != found.get(name)]
    return min(differs, key=lambda name: (name == "metadata", name), default="same")


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


COVERED: Final = {
    "all checksums": "everything", "unchunked, checked": "everything",
    "zstd": "not metadata", "lz4": "not metadata", "none": "not metadata", "one chunk": "not metadata",
    "no message indexes": "not metadata",
}  # fmt: skip

COVERED_IN_PARTS: Final = COVERED.keys() - {"unchunked, checked"}  # its checksum is that of all data


def some(path: Path) -> dict[str, Any]:
    """Two topics for some time, which is read without looking at the rest of the file."""
    bag = read(path, ["jointstate", "clock"], 5_000_000, 20_000_000)
    return values(bag._replace(attachments={}, metadata={}))


def break_bags(number: int, seed: int, folder: Path) -> Counter[tuple[str, str]]:
    """Break `number` bags; counts by way of writing and verdict.  An unseen wrong value is an AssertionError."""
    chance = random.Random(seed)
    samples = random_samples(sorted({*OURS, CLOUD}), 40, seed)
    ways = list(WAYS)
    wholes, truths, parts = {}, {}, {}
    for way in ways:
        file = write(folder / "whole.mcap", samples, WAYS[way])
        wholes[way], truths[way], parts[way] = file.read_bytes(), values(read(file)), some(file)
    results: Counter[tuple[str, str]] = Counter()
    broken = folder / "broken.mcap"
    with limits():
        for i in range(number):
            way = ways[i % len(ways)]
            kind, data = mutated(wholes[way], chance)
            broken.write_bytes(data)
            signal.alarm(PATIENCE)
            result = verdict(broken, truths[way], lambda path: values(read(path)))
            assert not result.startswith("refused without"), result
            part = verdict(broken, parts[way], some)
            where = f"bag {i} of seed {seed} ({way}, {kind})"
            assert way not in COVERED_IN_PARTS or part in ("same", "refused"), f"{where}: {part} in a part"
            is_covered = way in COVERED and (result != "metadata" or COVERED[way] == "everything")
            assert result in ("same", "refused") or not is_covered, f"{where}: {result} differs unseen"
            results[way, result if result in ("same", "refused", "metadata") else "differs"] += 1
    return results


def main() -> None:
    """Break bags, print what was read of them."""
    number, seed = int(sys.argv[1]), int((*sys.argv, 1)[2])
    with tempfile.TemporaryDirectory() as folder:
        results = break_bags(number, seed, Path(folder))
    print(f"{number} broken bags, seed {seed}: no crash, hang or unseen wrong value")
    for (way, found), count in sorted(results.items()):
        print(f"  {way:20} {found:10} {count}")


if __name__ == "__main__":
    main()
