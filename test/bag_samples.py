"""Bags of every kind for the tests of the reader: random messages of any type, written in many ways."""

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.typesys import Stores, get_typestore

from wam_description.topics import TOPICS

STORE = get_typestore(Stores.ROS2_JAZZY)
OURS = sorted({topic.type for topic in TOPICS})
CLOUD = "sensor_msgs/msg/PointCloud2"
FOREIGN = [
    "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry", "sensor_msgs/msg/BatteryState", "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/MultiDOFJointState", CLOUD, "std_msgs/msg/Empty", "std_msgs/msg/Int8",
    "std_msgs/msg/UInt64MultiArray", "trajectory_msgs/msg/JointTrajectory",
]  # fmt: skip
PRIMITIVE, NAMED, FIXED = 1, 2, 3  # kinds of field in rosbags


class Sample(NamedTuple):
    """A message to be written: topic, type, log time in ns, CDR."""

    topic: str
    type: str
    time: int
    data: bytes


class Way(NamedTuple):
    """How a bag is written."""

    compression: CompressionType = CompressionType.ZSTD
    chunked: bool = True
    indexed: bool = True
    summary: bool = True
    crcs: bool = True
    data_crc: bool = False
    chunk_size: int = 4000


WAYS = {
    "zstd": Way(),
    "lz4": Way(CompressionType.LZ4),
    "none": Way(CompressionType.NONE),
    "all checksums": Way(data_crc=True),
    "no checksums": Way(CompressionType.NONE, crcs=False),
    "no message indexes": Way(indexed=False),
    "no summary": Way(summary=False),
    "unchunked": Way(chunked=False, crcs=False),
    "unchunked, checked": Way(chunked=False, data_crc=True),
    "one chunk": Way(chunk_size=2**20),
}


def random_message(kind: str, chance: random.Random, lengths: Sequence[int] = (0, 1, 3)) -> Any:
    """A message of a type with random values; strings and sequences have one of these lengths."""
    if kind == CLOUD:
        return random_cloud(chance, chance.choice(lengths))
    values = []
    for _, (field, inner) in STORE.fielddefs[kind][1]:
        if field == PRIMITIVE:
            values.append(_value(inner[0], chance, lengths))
        elif field == NAMED:
            values.append(random_message(inner, chance, lengths))
        else:
            count = inner[1] if field == FIXED else chance.choice(lengths)
            values.append(_values(inner[0], count, chance, lengths))
    return STORE.types[kind](*values)


def random_cloud(chance: random.Random, points: int, height: int = 1) -> Any:
    """A point cloud whose sizes fit; with fields of several types, gaps and padding."""
    numbers = {"x": (4, 8, 1), "n": (17, 3, 1), "ab": (20, 7, 3)}  # offset, datatype, count
    step, padding = 40, chance.choice([0, 6])
    header = STORE.types["std_msgs/msg/Header"]
    time = STORE.types["builtin_interfaces/msg/Time"](chance.randint(0, 9), chance.randint(0, 10**9 - 1))
    fields = [STORE.types["sensor_msgs/msg/PointField"](name, *each) for name, each in numbers.items()]
    data = np.frombuffer(chance.randbytes(height * (points * step + padding)), np.uint8)
    return STORE.types[CLOUD](
        header(time, chance.choice("ab")), height, points, fields, chance.random() < 0.5, step, points * step + padding,
        data, True,
    )  # fmt: skip


def _value(kind: str, chance: random.Random, lengths: Sequence[int]) -> Any:
    if kind == "string":
        return "".join(chance.choices("abcdeäß 0123", k=chance.choice(lengths)))
    if kind == "bool":
        return chance.random() < 0.5
    if kind.startswith("float"):
        value = chance.choice([chance.gauss(0, 1e3), float("nan"), -0.0, float("inf")])
        return float(np.float32(value)) if kind == "float32" else value
    if kind in ("byte", "octet", "char"):
        return chance.randint(0, 127)  # rosbags and ROS differ in the sign of larger ones
    limits = np.iinfo(kind)
    return chance.randint(int(limits.min), int(limits.max))


def _values(inner: Any, count: int, chance: random.Random, lengths: Sequence[int]) -> Any:
    field, kind = inner
    if field == NAMED:
        return [random_message(kind, chance, lengths) for _ in range(count)]
    values = [_value(kind[0], chance, lengths) for _ in range(count)]
    if kind[0] == "string":
        return values
    return np.array(values, "uint8" if kind[0] in ("byte", "char", "octet") else kind[0])


def random_samples(kinds: Sequence[str], number: int, seed: int, lengths: Sequence[int] = (0, 1, 3)) -> list[Sample]:
    """So many messages of each type, little- and big-endian, stamped in no order within a window."""
    chance = random.Random(seed)
    samples = []
    for k in range(number):
        for kind in kinds:
            message = random_message(kind, chance, lengths)
            data = bytes(STORE.serialize_cdr(message, kind, little_endian=chance.random() < 0.7))
            topic = "/" + kind.split("/")[-1].lower()
            samples.append(Sample(topic, kind, 1_000_000 * (k + chance.randint(0, 3)), data))
    return samples


def messages_of(path: Path, *topics: str) -> list[Sample]:
    """The messages of a bag, by the mcap library; of all topics where none is named."""
    found = []
    for file in [path] if path.is_file() else sorted(path.glob("*.mcap")):
        with file.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages(topics or None):
                assert schema is not None
                found.append(Sample(channel.topic, schema.name, message.log_time, message.data))
    return found


def write(path: Path, samples: Sequence[Sample], way: Way = WAYS["zstd"]) -> Path:
    """An .mcap file with these messages, an attachment and a metadata record, by the library's own writer."""
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            chunk_size=way.chunk_size,
            compression=way.compression,
            index_types=IndexType.ALL if way.indexed else IndexType.ALL & ~IndexType.MESSAGE,
            use_chunking=way.chunked,
            use_statistics=way.summary,
            repeat_channels=way.summary,
            repeat_schemas=way.summary,
            use_summary_offsets=way.summary,
            enable_crcs=way.crcs,
            enable_data_crcs=way.data_crc,
        )
        if not way.summary:
            writer._Writer__index_types = IndexType.NONE
        writer.start(profile="ros2", library="test")
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for i, (topic, kind, time, data) in enumerate(samples):
            if kind not in schemas:
                text = STORE.generate_msgdef(kind, ros_version=2)[0].encode()
                schemas[kind] = writer.register_schema(kind, "ros2msg", text)
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schemas[kind], {"offered_qos_profiles": ""})
            writer.add_message(channels[topic], time, data, time, i)
        writer.add_attachment(0, 0, "note.txt", "text/plain", b"written by a test")
        writer.add_metadata("note", {"by": "a test"})
        writer.finish()
    return path
