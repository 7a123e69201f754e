"""Whether every published message is in the bag, in a minute of the arm in real time; and the cost of writing one.

The whole stack and the recorder share one process and one executor, and every call of publish is counted.
With --quick two seconds in lockstep.
"""

import io
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from comparing import arguments, machine, quartiles, ratios, save, table
from mcap.writer import Writer
from rclpy.publisher import Publisher

from wam_bag.bag import raw
from wam_bag.contents import contents
from wam_bag.mcap_writer import McapWriter
from wam_description.configuration import Configuration, packaged
from wam_description.topics import TOPICS
from wam_ros.bring_up import Composition
from wam_ros.topics import NAMESPACE

SECONDS, QUICK_SECONDS = 60.0, 2.0
MESSAGES = 20_000  # written in one measurement


def published(configuration: Configuration) -> Counter[str]:
    """Play a scenario with recorder; returns how often each topic was published."""
    counts: Counter[str] = Counter()
    publish = Publisher.publish

    def counting(self: Any, message: Any) -> None:
        counts[self.topic_name] += 1
        publish(self, message)

    Publisher.publish = counting
    try:
        with Composition(configuration) as composition:
            player: Any = composition.nodes["scenario"]
            composition.spin(lambda: player.done)
            if player.failure:
                raise SystemExit(player.failure)
    finally:
        Publisher.publish = publish
    names = {topic.name if topic.name.startswith("/") else f"/{NAMESPACE}/{topic.name}" for topic in TOPICS}
    return Counter({name: count for name, count in counts.items() if name in names})


def library(messages: list[tuple[int, bytes]], path: Path) -> Callable[[], None]:
    """Writes messages with the writer of the mcap library."""

    def write() -> None:
        with path.open("wb") as stream:
            writer = Writer(stream, chunk_size=2**20)
            writer.start(profile="ros2")
            channel = writer.register_channel("/t", "cdr", writer.register_schema("a", "ros2msg", b""))
            for i, (log_time, data) in enumerate(messages):
                writer.add_message(channel, log_time, data, log_time, i)
            writer.finish()

    return write


def ours(messages: list[tuple[int, bytes]], path: Path) -> Callable[[], None]:
    """Writes messages with the recorder's writer."""

    def write() -> None:
        with io.FileIO(path, "w") as stream:
            writer = McapWriter(stream, "benchmark", 2**20)
            channel = writer.channel("/t", "cdr", writer.schema("a", "ros2msg", b""), {})
            for i, (log_time, data) in enumerate(messages):
                writer.add(channel, log_time, log_time, i, data)
            writer.finish()

    return write


def microseconds(write: Callable[[], None]) -> float:
    """Processor time for one of the messages."""
    begin = time.process_time()
    write()
    return (time.process_time() - begin) / MESSAGES * 1e6


def main() -> None:
    """Record, count, measure the writers in turns, print the table."""
    given = arguments(__doc__, rounds=7, quick_rounds=1)
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        step = {
            "name": "speak",
            "seconds": QUICK_SECONDS if given.quick else SECONDS,
        }  # braked, so that a slow computer causes no fault
        script.write_text(yaml.safe_dump({"steps": [step]}), encoding="utf-8")
        base = Configuration.load(packaged("wam"))
        configuration = base.with_values(
            {
                "nodes": [*base.shared.nodes, "scenario", "recorder"],
                "timing.mode": "lockstep" if given.quick else "realtime",
                "timing.real_time_factor": 0.0,
                "scenario:script": str(script),
                "recorder:directory": folder,
                "recorder:name": "bag",
            }
        )
        sent = published(configuration)
        recorded = contents(Path(folder) / "bag")
        found = {name: topic.messages for name, topic in recorded.topics.items()}
        early = Counter[str]()  # published before the recorder was there
        for key, value in recorded.metadata.get("recording", {}).items():
            if key.endswith(" missed"):
                early[key.split(" ")[0]] += int(value)
        states = raw(Path(folder) / "bag", ["motor_states"])["/wam/motor_states"]
        messages = list(zip(states.log_time_ns.tolist(), states.data, strict=True))
        messages = (messages * (MESSAGES // len(messages) + 1))[:MESSAGES]
        costs: dict[str, list[float]] = {"library": [], "ours": []}
        for _ in range(given.rounds):
            costs["library"].append(microseconds(library(messages, Path(folder) / "a.mcap")))
            costs["ours"].append(microseconds(ours(messages, Path(folder) / "b.mcap")))
    sent -= early
    lost = {name: number - found.get(name, 0) for name, number in sent.items() if number != found.get(name, 0)}
    counted = ratios([float(sum(found.values()))], [float(sent.total())])
    cheaper = ratios(costs["library"], costs["ours"])
    rows = [
        [
            "messages in the bag",
            f"{sum(found.values())}",
            f"{sent.total()} published ({early.total()} before)",
            f"{counted:.2f}",
        ],
        [
            "writing a message [us]",
            f"{quartiles(costs['ours']).median:.2f}",
            f"{quartiles(costs['library']).median:.2f} by mcap's writer",
            f"{cheaper:.2f}",
        ],
    ]
    print(machine())
    print(table(["recording", "ours", "against", "ratio"], rows))
    save("recording", given, {"counted": counted, "writer": cheaper, "published": sent.total(), "lost": lost})
    if lost:
        raise SystemExit(f"published and not in the bag: {lost}")


if __name__ == "__main__":
    main()
