"""The reader of bags against rosbags and mcap-ros2-support, on the same bag, each message decoded.

The other readers make an object of every message; ours makes columns, and objects of the types that have none.
Processor time is measured, because other programs disturb it less.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import yaml
from comparing import arguments, machine, quartiles, ratios, save, table
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from speed import lockstep, scenario

from wam_bag.bag import Messages, read
from wam_description.configuration import Configuration, packaged

SECONDS = 20.0  # of the arm in the bag


def ours(bag: Path) -> int:
    """Every topic as columns, and every message that has none as an object; returns how many."""
    count = 0
    for columns in read(bag).topics.values():
        count += len(columns.messages) if isinstance(columns, Messages) else len(columns.log_time_ns)
        if isinstance(columns, Messages):
            list(columns.messages)
    return count


def columns_only(bag: Path) -> int:
    """The topics that become columns; the few others are read and left serialized."""
    return sum(len(columns.log_time_ns) for columns in read(bag).topics.values())


def rosbags(bag: Path) -> int:
    """Every message as an object of rosbags."""
    with AnyReader([bag]) as reader:
        return sum(1 for c, _, data in reader.messages() if reader.deserialize(data, c.msgtype) is not None)


def mcap_ros2(bag: Path) -> int:
    """Every message as an object of mcap-ros2-support."""
    with next(bag.glob("*.mcap")).open("rb") as stream:
        return sum(1 for _ in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())


def microseconds(read_all: Callable[[Path], int], bag: Path, times: int) -> tuple[float, int]:
    """Processor time for a message, and how many there were."""
    begin = time.process_time()
    for _ in range(times):
        count = read_all(bag)
    return (time.process_time() - begin) / times / count * 1e6, count


def main() -> None:
    """Record a bag in lockstep, read it in turns, print the table."""
    given = arguments(__doc__, rounds=5, quick_rounds=1)
    costs: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(1.0 if given.quick else SECONDS)), encoding="utf-8")
        configuration = Configuration.load(packaged("wam")).with_values(
            {
                "timing.mode": "lockstep",
                "timing.real_time_factor": 0.0,
                "scenario:script": str(script),
                "recorder:directory": folder,
                "recorder:name": "bag",
            }
        )
        lockstep(configuration, "recorder")
        bag = Path(folder) / "bag"
        readers = {"everything": ours, "columns": columns_only, "rosbags": rosbags, "mcap-ros2-support": mcap_ros2}
        for _ in range(given.rounds):
            counts = set()
            for name, reader in readers.items():
                cost, count = microseconds(reader, bag, 1 if reader in (rosbags, mcap_ros2) else 5)
                costs.setdefault(name, []).append(cost)
                counts.add(count)
            if len(counts) != 1:
                raise SystemExit(f"the readers found different numbers of messages: {counts}")
    rows, measured = [], {}
    for other in ("rosbags", "mcap-ros2-support"):
        for mine in ("everything", "columns"):
            ratio = ratios(costs[other], costs[mine])
            measured[f"{mine}, {other}"] = ratio
            rows.append(
                [f"{mine} against {other}"]
                + [f"{quartiles(costs[name]).median:.2f}" for name in (mine, other)]
                + [f"{ratio:.2f}"]
            )
    print(machine())
    print(table(["reading a bag of the arm", "ours [us a message]", "theirs [us]", "theirs / ours"], rows))
    save("bag_reading", given, measured)


if __name__ == "__main__":
    main()
