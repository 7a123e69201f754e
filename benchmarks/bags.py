"""Reading and analysing bags that were recorded without ROS."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bench import Benchmark, Ratio, Values
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from simulation import scenario_steps, seconds

from wam_analysis.findings.analysis import TOPICS_READ, analyse_bag
from wam_analysis.findings.page import page
from wam_bag.bag import Messages, read
from wam_description.configuration import Configuration, packaged
from wam_sim.simulated_bag import record


@contextmanager
def recorded(quick: bool) -> Iterator[Path]:
    """A bag of a short form of the demonstration."""
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        configuration = Configuration.load(packaged("wam"))
        steps = scenario_steps(1.0 if quick else 20.0, configuration.shared)
        if failure := record(configuration, steps, Path(folder) / "bag"):
            raise RuntimeError(failure)
        yield Path(folder) / "bag"


def everything(bag: Path) -> int:
    """Every topic as columns, and every message that has none as an object; returns how many."""
    count = 0
    for columns in read(bag).topics.values():
        count += len(list(columns.messages)) if isinstance(columns, Messages) else len(columns.log_time_ns)
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


def cost(reader: Callable[[Path], int], bag: Path, times: int) -> tuple[float, int]:
    """Processor time for a message, us, which other programs disturb less; and how many there were."""
    begin = time.process_time()
    for _ in range(times):
        count = reader(bag)
    return (time.process_time() - begin) / times / count * 1e6, count


def bag_reading(quick: bool) -> Values:
    """Each message of the same bag by every reader."""
    readers = {"everything": (everything, 5), "columns": (columns_only, 5)}
    readers |= {"rosbags": (rosbags, 1), "mcap-ros2-support": (mcap_ros2, 1)}
    with recorded(quick) as bag:
        found = {name: cost(reader, bag, times) for name, (reader, times) in readers.items()}
    if len(counts := {count for _, count in found.values()}) != 1:
        raise RuntimeError(f"the readers found different numbers of messages: {counts}")
    one = {name: each for name, (each, _) in found.items()}
    return one | {f"{name}, columns": each for name, each in one.items()}


BAG_READING = Benchmark(
    bag_reading,
    "reading a message [us]",
    (
        Ratio("rosbags", "everything"),
        Ratio("mcap-ros2-support", "everything"),
        Ratio("rosbags, columns", "columns", 25.0, 50.0),
        Ratio("mcap-ros2-support, columns", "columns", 50.0, 100.0),
    ),
    rounds=5,
)


def analysis(quick: bool) -> Values:
    """`wam analyse` of 20 s of all topics, in times real time."""
    length = 1.0 if quick else 20.0
    kept: list = []
    with recorded(quick) as bag:
        times = {
            "reading": seconds(lambda: kept.append(read(bag, TOPICS_READ, may_lack=True))),
            "findings": seconds(lambda: kept.append(analyse_bag(kept[0], lambda doing: None))),
            "page": seconds(lambda: page(kept[1])),
        }
    return {name: length / taken for name, taken in times.items()}


ANALYSIS = Benchmark(analysis, "wam analyse, in times real time", tuple(map(Ratio, ("reading", "findings", "page"))), 5)
