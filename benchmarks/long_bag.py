"""`wam analyse` on a recording of ten minutes: seconds of the recording in a second of the wall.

A short lockstep recording is written many times through the recorder's own writer, each time with stamps one
length later, which is faster than recording ten minutes.
"""

import struct
import tempfile
import time
from pathlib import Path

import yaml
from comparing import arguments, machine, quartiles, save, table
from speed import lockstep, scenario

from wam_analysis.findings.analysis import TOPICS_READ, analyse_bag
from wam_analysis.findings.page import page
from wam_bag.bag import raw, read
from wam_bag.bag_writer import BagWriter
from wam_bag.cdr import stamp_reader
from wam_description.configuration import Configuration, packaged
from wam_description.topics import TOPICS
from wam_ros.topics import qos

MINUTES, QUICK_MINUTES = 10.0, 0.2
ROWS = ("reading", "analysis", "page")


def repeated(source: Path, target: Path, seconds: float) -> None:
    """Write the bag so often that it lasts `seconds`."""
    topics = {name: found for name, found in raw(source).items() if len(found.data)}
    rows = {name: next(row for row in TOPICS if name.endswith(row.name)) for name in topics}
    last = max(int(found.log_time_ns.max()) for found in topics.values())
    first = min(int(at) for found in topics.values() for at in found.log_time_ns if at > 0)
    length = last - first + 1_000_000
    order = sorted(
        (int(at), name, i) for name, found in topics.items() for i, at in enumerate(found.log_time_ns.tolist())
    )
    stamped = {name: stamp_reader(found.type) for name, found in topics.items()}
    recorded = read(source)
    count = 0
    with BagWriter(target) as bag:
        for name, found in topics.items():
            bag.add_topic(name, found.type, qos(rows[name]))
        for turn in range(max(1, round(seconds * 1e9 / length))):
            for at, name, i in order:
                data = topics[name].data[i]
                stamp = stamped[name](data)
                if stamp is None and turn:
                    continue  # latched: published once
                if stamp is not None and turn and topics[name].type != "visualization_msgs/msg/MarkerArray":
                    later = divmod(stamp + turn * length, 1_000_000_000)
                    data = data[:4] + struct.pack("<iI", *later) + data[12:]
                bag.write(name, data, at + turn * length, at + turn * length, count)
                count += 1
        for name, attached in recorded.attachments.items():
            bag.attach(name, "application/yaml", attached)
        bag.metadata("recording", recorded.metadata.get("recording", {}))


def timed(path: Path) -> tuple[float, float, float]:
    """Seconds that reading, analysis and page take."""
    times = [time.perf_counter()]
    bag = read(path, TOPICS_READ, may_lack=True)
    times.append(time.perf_counter())
    analysis = analyse_bag(bag, lambda doing: None)
    times.append(time.perf_counter())
    page(analysis)
    times.append(time.perf_counter())
    return times[1] - times[0], times[2] - times[1], times[3] - times[2]


def main() -> None:
    """Record, repeat, analyse."""
    given = arguments(__doc__ or "", rounds=3, quick_rounds=1)
    minutes = QUICK_MINUTES if given.quick else MINUTES
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(1.0 if given.quick else 20.0)))
        values = {
            "timing.mode": "lockstep",
            "timing.real_time_factor": 0.0,
            "timing.timeout": 60.0,
            "scenario:script": str(script),
            "recorder:directory": folder,
            "recorder:name": "short",
        }
        lockstep(Configuration.load(packaged("wam")).with_values(values), "recorder")
        long = Path(folder) / "long"
        repeated(Path(folder) / "short", long, 60.0 * minutes)
        rounds = [timed(long) for _ in range(given.rounds)]
    found = {row: quartiles([60.0 * minutes / times[i] for times in rounds]) for i, row in enumerate(ROWS)}
    print(machine())
    head = [f"{minutes:g} minutes", "times real time (middle half)", "seconds"]
    lines = [[row, f"{found[row]:.2f}", f"{60.0 * minutes / found[row].median:.1f}"] for row in ROWS]
    print(table(head, lines))
    save("long_bag", given, {row: {"real_time_ratio": found[row]} for row in ROWS})


if __name__ == "__main__":
    main()
