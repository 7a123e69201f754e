"""Bags broken at random: none may crash the reader, hang it, fill the memory or give a wrong value unseen.

    python test/bag_mutations.py 5000 [seed]      all of it, some minutes; the suite runs a part

A wrong value is one that differs from what was written although no error was raised.  If the file has
checksums over everything ('all checksums', 'unchunked, checked') there may be none at all; if it has those of
chunks, attachments and summary, only in metadata records, which MCAP does not protect; if it has none, values
may differ unseen.
"""

import random
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any, Final

from bag_samples import CLOUD, OURS, WAYS, random_samples, write

from wam_bag.bag import read
from wam_studies.faults.bag_faults import PATIENCE, limits, mutated, values, verdict

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


def is_unseen(way: str, result: str) -> bool:
    """Whether a verdict is a wrong value without an error in spite of a checksum."""
    if result in ("same", "refused") or way not in COVERED:
        return False
    return result != "metadata" or COVERED[way] == "everything"


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
            assert way not in COVERED_IN_PARTS or part in ("same", "refused"), (
                f"bag {i} of seed {seed}: {part} in a part"
            )
            assert not is_unseen(way, result), f"bag {i} of seed {seed} ({way}, {kind}): {result} differs unseen"
            results[way, result if result in ("same", "refused", "metadata") else "differs"] += 1
    return results


def main() -> None:
    """Break bags, print what was read of them."""
    number, seed = int(sys.argv[1]), int((*sys.argv, 1)[2])
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        results = break_bags(number, seed, Path(folder))
    print(
        f"{number} broken bags in {time.monotonic() - begin:.0f} s, seed {seed}: no crash, hang or unseen wrong value"
    )
    for way in WAYS:
        counts = {verdict: count for (owner, verdict), count in sorted(results.items()) if owner == way}
        print(f"  {way:20} {', '.join(f'{count} {verdict}' for verdict, count in counts.items())}")


if __name__ == "__main__":
    main()
