"""The reader against readers that are not ours, on every type and way of writing, whole and broken."""

import itertools
import os
import random
import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import multimode
from typing import Any

import numpy as np
import pytest
import yaml
from bag_mutations import MEMORY, break_bags, limits
from bag_samples import CLOUD, FOREIGN, OURS, STORE, WAYS, Sample, Way, random_cloud, random_samples, write
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer

from wam_bag import mcap_file, safe_yaml
from wam_bag.bag import (
    Bag,
    BagError,
    BoolColumns,
    JointColumns,
    Messages,
    PointColumns,
    TableColumns,
    WrenchColumns,
    read,
)
from wam_bag.limits import READING_LIMITS
from wam_bag.mcap_records import LARGEST, MAGIC
from wam_bag.repair import repair

JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"


def in_order(samples: Sequence[Sample]) -> dict[str, list[Sample]]:
    """Samples by topic in the order of their times."""
    found: dict[str, list[Sample]] = {}
    for sample in sorted(samples, key=lambda sample: sample.time):
        found.setdefault(sample.topic, []).append(sample)
    return found


def decoded(samples: Sequence[Sample]) -> list[Any]:
    """What rosbags makes of them."""
    return [STORE.deserialize_cdr(sample.data, sample.type) for sample in samples]


def nanoseconds(time: Any) -> int:
    return int(time.sec) * 10**9 + int(time.nanosec)


def xyz(vectors: Sequence[Any]) -> np.ndarray[Any, Any]:
    return np.array([[v.x, v.y, v.z] for v in vectors])


def named(message: Any) -> list[str]:
    """Names of a message's values: numbered where there is none, or where another value has it."""
    lengths = [len(getattr(message, field)) for field in ("name", "position", "velocity", "effort")]
    width = max(multimode(n for n in lengths if n >= max(lengths[0], 1)), default=0)
    found: list[str] = []
    for i in range(width):
        name = (message.name[i] if i < len(message.name) else "") or f"joint{i + 1}"
        found.append(f"{name} ({i + 1})" if name in found else name)
    return found


def assert_joints(columns: JointColumns, messages: Sequence[Any]) -> None:
    assert columns.names == tuple(dict.fromkeys(name for message in messages for name in named(message)))
    for field in ("position", "velocity", "effort"):
        array = getattr(columns, field)
        assert array.shape[1] in (0, len(columns.names))
        for row, message in zip(array, messages, strict=True):
            values = getattr(message, field).tolist()
            expected = dict(zip(named(message), values, strict=True)) if len(values) == len(named(message)) else {}
            np.testing.assert_array_equal(row, [expected.get(name, np.nan) for name in columns.names[: len(row)]])
            assert len(row) or not expected


def assert_equal(ours: Any, theirs: Any) -> None:
    """An object of ours against one of another reader: every field, every value."""
    if hasattr(ours, "_fields"):
        for field in ours._fields:
            assert_equal(getattr(ours, field), getattr(theirs, field))
    elif isinstance(ours, list | np.ndarray) and not isinstance(theirs, bytes):
        assert len(ours) == len(theirs)
        for one, other in zip(ours, theirs, strict=True):
            assert_equal(one, other)
    elif isinstance(ours, float | np.floating):
        assert ours == theirs or (np.isnan(ours) and np.isnan(theirs))
        assert np.signbit(ours) == np.signbit(theirs) or np.isnan(ours)
    elif isinstance(theirs, bytes):
        assert bytes(ours) == theirs
    else:
        assert ours == theirs


def assert_table(columns: TableColumns, messages: Sequence[Any]) -> None:
    """Rows of a table against each point of each message, taken from its bytes one by one."""
    assert columns.message.tolist() == [i for i, m in enumerate(messages) for _ in range(m.height * m.width)]
    assert columns.row_stamp_ns.tolist() == [nanoseconds(messages[i].header.stamp) for i in columns.message]
    row = 0
    for message in messages:
        for line, place in itertools.product(range(message.height), range(message.width)):
            for field in message.fields:
                start = line * message.row_step + place * message.point_step + field.offset
                form = (">" if message.is_bigendian else "<") + "bBhHiIfd"[field.datatype - 1] * field.count
                values = struct.unpack_from(form, message.data.tobytes(), start)
                np.testing.assert_array_equal(
                    columns.columns[field.name][row], values if field.count > 1 else values[0]
                )
            row += 1
    assert row == len(columns.message)


def assert_columns(columns: Any, samples: Sequence[Sample]) -> None:
    """Columns of a topic against what rosbags decodes."""
    messages = decoded(samples)
    assert columns.log_time_ns.tolist() == [sample.time for sample in samples]
    if isinstance(columns, Messages):
        assert_equal(list(columns.messages), messages)
        return
    if isinstance(columns, BoolColumns):
        assert columns.data.tolist() == [message.data for message in messages]
        return
    assert columns.stamp_ns.tolist() == [nanoseconds(message.header.stamp) for message in messages]
    assert columns.frames.tolist() == [message.header.frame_id for message in messages]
    if isinstance(columns, JointColumns):
        assert_joints(columns, messages)
    elif isinstance(columns, TableColumns):
        assert_table(columns, messages)
    elif isinstance(columns, WrenchColumns):
        np.testing.assert_array_equal(columns.force, xyz([message.wrench.force for message in messages]))
        np.testing.assert_array_equal(columns.torque, xyz([message.wrench.torque for message in messages]))
    else:
        assert isinstance(columns, PointColumns)
        np.testing.assert_array_equal(columns.point, xyz([message.point for message in messages]))


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_every_value_of_every_type_is_that_of_rosbags(tmp_path: Path, way: str) -> None:
    samples = random_samples([*OURS, *FOREIGN], 25, seed=len(way))
    bag = read(write(tmp_path / "bag.mcap", samples, WAYS[way]))
    expected = in_order(samples)
    assert bag.topics.keys() == expected.keys()
    for topic, columns in bag.topics.items():
        assert_columns(columns, expected[topic])
    assert bag.attachments == {"note.txt": b"written by a test"}
    assert bag.metadata == {"note": {"by": "a test"}}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_a_part_of_a_bag_is_that_part_however_it_was_written(tmp_path: Path, way: str) -> None:
    samples = random_samples(OURS, 60, seed=9)
    bag = read(write(tmp_path / "bag.mcap", samples, WAYS[way]), ["jointstate", "string"], 30_000_000, 45_000_000)
    expected = in_order([sample for sample in samples if 30_000_000 <= sample.time < 45_000_000])
    assert bag.topics.keys() == {"/jointstate", "/string"}
    for topic, columns in bag.topics.items():
        assert_columns(columns, expected[topic])


@pytest.mark.parametrize("kind", [*OURS, *FOREIGN])
def test_many_messages_of_one_layout_are_the_same_as_one_by_one(tmp_path: Path, kind: str) -> None:
    samples = random_samples([kind], 80, seed=3, lengths=(2,))
    bag = read(write(tmp_path / "bag.mcap", samples))
    ((topic, columns),) = bag.topics.items()
    assert_columns(columns, in_order(samples)[topic])


def joints(time: int, frame: str, names: list[str], values: list[float]) -> Sample:
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
    header = STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)
    arrays = [np.array(values, float), np.array([]), -np.array(values, float)]
    message = STORE.types[JOINTS](header, names, *arrays)
    return Sample("/js", JOINTS, time, bytes(STORE.serialize_cdr(message, JOINTS)))


def cloud(time: int, points: int, lines: int = 1, **changed: Any) -> Sample:
    message = random_cloud(random.Random(time), points, lines)
    for name, value in changed.items():
        setattr(message, name, value)
    return Sample("/cloud", CLOUD, time, bytes(STORE.serialize_cdr(message, CLOUD, little_endian=time % 2 == 0)))


def test_point_clouds_of_any_number_of_points_are_one_table(tmp_path: Path) -> None:
    samples = [
        cloud(k, points, lines) for k, (points, lines) in enumerate([(3, 1), (0, 1), (2, 4), (0, 0), (1, 1)] * 30)
    ]
    columns = read(write(tmp_path / "bag.mcap", samples[::-1])).topics["/cloud"]
    assert isinstance(columns, TableColumns)
    assert_columns(columns, samples)
    assert {name: column.dtype.str[1:] for name, column in columns.columns.items()} == {
        "x": "f8",
        "n": "i2",
        "ab": "f4",
    }
    assert columns.columns["ab"].shape == ((3 + 8 + 1) * 30, 3)


@pytest.mark.parametrize(("changed", "words"), [
    ({"row_step": 81}, "row_step 81 does"), ({"point_step": 0}, "point_step 0"),
    ({"fields": [STORE.types["sensor_msgs/msg/PointField"]("x", 0, 9, 1)]}, "x \\[0, 9, 1\\]"),
    ({"fields": [STORE.types["sensor_msgs/msg/PointField"]("x", 0, 8, 1)] * 2}, "name already used"),
    ({"fields": [STORE.types["sensor_msgs/msg/PointField"]("y", 0, 8, 1)]}, "have the fields x, n, ab and y"),
])  # fmt: skip
def test_point_clouds_whose_sizes_do_not_fit_are_refused(tmp_path: Path, changed: dict[str, Any], words: str) -> None:
    path = write(tmp_path / "bag.mcap", [cloud(1, 3), cloud(2, 3, **changed)])
    with pytest.raises(BagError, match=rf"bag\.mcap.*/cloud.*{words}"):
        read(path)


def test_messages_that_are_missing_are_missed(tmp_path: Path) -> None:
    path = write(tmp_path / "bag.mcap", random_samples([JOINTS], 30, seed=1), Way(crcs=False))
    counts = struct.pack("<IHQ", 10, 1, 30)
    assert path.read_bytes().count(counts) == 1
    path.write_bytes(path.read_bytes().replace(counts, struct.pack("<IHQ", 10, 1, 31)))
    with pytest.raises(BagError, match="topic /jointstate has 30 messages instead of 31"):
        read(path)
    with pytest.raises(BagError, match="30 messages instead of 31"):
        read(path, ["jointstate"])


def three_chunks(tmp_path: Path) -> tuple[Path, list[Sample]]:
    """A bag whose chunks hold joint states, then wrenches, then joint states."""
    chance = random_samples([WRENCH], 40, seed=5)
    samples = [joints(k, "a", ["x"], [k]) for k in range(40)]
    samples += [sample._replace(time=100 + k) for k, sample in enumerate(chance)]
    samples += [joints(200 + k, "a", ["x"], [k]) for k in range(40)]
    return write(tmp_path / "bag.mcap", samples, Way(chunk_size=1500, compression=CompressionType.NONE)), samples


def test_topics_and_times_that_are_not_asked_for_are_not_read(tmp_path: Path) -> None:
    path, samples = three_chunks(tmp_path)
    part = read(path, begin_ns=110, end_ns=220)
    assert part.topics["/js"].log_time_ns.tolist() == list(range(200, 220))
    assert_columns(part.topics["/wrenchstamped"], [s for s in samples if s.type == WRENCH and s.time >= 110])
    assert (
        list(read(path, ["wrenchstamped"]).topics) == list(read(path, ["/wrenchstamped"]).topics) == ["/wrenchstamped"]
    )
    assert read(path, ["stamped"], may_lack=True).topics == {}
    with path.open("rb") as stream:
        chunks = [record for record in StreamReader(stream, emit_chunks=True).records if isinstance(record, Chunk)]
    assert len(chunks) > 4
    broken = bytearray(path.read_bytes())
    broken[broken.index(chunks[-1].data) + 50] ^= 1
    path.write_bytes(broken)
    with pytest.raises(BagError, match="checksum"):
        read(path)
    with pytest.raises(BagError, match="checksum"):
        read(path, ["js"])
    assert len(read(path, ["wrenchstamped"]).topics["/wrenchstamped"].log_time_ns) == 40
    assert len(read(path, end_ns=100).topics["/js"].log_time_ns) == 40


def test_what_is_not_there_is_no_empty_answer(tmp_path: Path) -> None:
    path, _ = three_chunks(tmp_path)
    with pytest.raises(BagError, match=r"no topic 'nosuch'; its topics: /js, /wrenchstamped\. .*may_lack"):
        read(path, ["js", "nosuch"])
    assert list(read(path, ["js", "nosuch"], may_lack=True).topics) == ["/js"]
    with pytest.raises(ValueError, match="from 9 ns to 8 ns; the end must not be before the start"):
        read(path, begin_ns=9, end_ns=8)


def test_one_topic_on_two_channels_is_one_topic(tmp_path: Path) -> None:
    with (tmp_path / "bag.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema(JOINTS, "ros2msg", STORE.generate_msgdef(JOINTS, ros_version=2)[0].encode())
        channels = [writer.register_channel("/js", "cdr", schema, {"publisher": str(i)}) for i in range(2)]
        for k in range(20):
            writer.add_message(channels[k % 2], k // 2, joints(k, "", ["a"], [k]).data, k)
        writer.finish()
    columns = read(tmp_path / "bag.mcap").topics["/js"]
    assert isinstance(columns, JointColumns)
    assert columns.position[:, 0].tolist() == list(range(20))


def split_bag(path: Path) -> list[Sample]:
    """A bag of three files, as rosbag2 splits it."""
    path.mkdir()
    samples = [joints(k, "a", ["x"], [k]) for k in range(90)]
    for i in range(3):
        write(path / f"{path.name}_{i}.mcap", samples[30 * i : 30 * i + 30])
    names = [f"{path.name}_{i}.mcap" for i in range(3)]
    information = {"version": 9, "relative_file_paths": names, "files": [{"path": name} for name in names]}
    (path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))
    return samples


def test_a_split_bag_is_read_as_one_and_a_missing_file_is_named(tmp_path: Path) -> None:
    samples = split_bag(tmp_path / "bag")
    assert_columns(read(tmp_path / "bag").topics["/js"], samples)
    (tmp_path / "bag" / "bag_1.mcap").unlink()
    with pytest.raises(BagError, match=r"lacks its file bag_1\.mcap; copy the whole"):
        read(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    assert len(read(tmp_path / "bag").topics["/js"].log_time_ns) == 60


@pytest.mark.parametrize("name", ["/{}/elsewhere.mcap", "../elsewhere.mcap", "a/../../elsewhere.mcap"])
def test_files_outside_the_bag_are_not_read(tmp_path: Path, name: str) -> None:
    samples = split_bag(tmp_path / "bag")
    (tmp_path / "bag" / "a").mkdir()
    write(tmp_path / "elsewhere.mcap", samples)
    file = tmp_path / "bag" / "metadata.yaml"
    outside = name.format(str(tmp_path)[1:])
    file.write_text(file.read_text().replace("- bag_1.mcap", f"- {outside}"))
    with pytest.raises(BagError, match=r"lacks its file .*elsewhere\.mcap; copy the whole"):
        read(tmp_path / "bag")
    repair(tmp_path / "bag")
    assert_columns(read(tmp_path / "bag").topics["/js"], samples)


def test_a_record_that_is_longer_than_the_data_is_refused(tmp_path: Path) -> None:
    length = 8
    path = write(tmp_path / "bag.mcap", random_samples([JOINTS], 3, seed=1), Way(crcs=False))
    data = bytearray(path.read_bytes())
    index = data.rindex(struct.pack("<BQ", Opcode.METADATA_INDEX, 8 + 8 + 4 + len("note")))
    start, whole = struct.unpack_from("<QQ", data, index + 9)
    struct.pack_into("<QQ", data, index + 9, start, length)
    struct.pack_into("<BQ", data, start + length, 0x80, whole - length - 9)  # the rest is a record to be skipped
    path.write_bytes(data)
    with pytest.raises(BagError, match=r"is damaged \(the record at byte \d+ is longer than what contains it\); copy"):
        read(path)


@pytest.mark.slow
def test_a_small_file_that_decompresses_to_much_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    text = STORE.generate_msgdef("std_msgs/msg/String", ros_version=2)[0].encode()
    path = tmp_path / "bag.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("std_msgs/msg/String", "ros2msg", text))
        writer.add_message(channel, 1, bytes(LARGEST), 1)
        writer.finish()
    before = path.read_bytes()
    assert len(before) < 100_000
    for look in (read, repair):
        with (
            limits(MEMORY // 16),
            pytest.raises(BagError, match=r"bag\.mcap .*is to hold \d+ bytes; chunks of at most"),
        ):
            look(path)
    assert path.read_bytes() == before


def test_an_attachment_that_is_too_large_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "bag.mcap", random_samples([JOINTS], 3, seed=1))
    data = bytearray(path.read_bytes())
    content = b"written by a test"
    start = data.index(content) - data[: data.index(content)][::-1].index(b"\x09") - 1
    assert data[start] == Opcode.ATTACHMENT
    del data[start:]
    extra = LARGEST
    with path.open("wb") as stream:  # a sparse file: it takes no space on disk
        stream.write(data)
        stream.write(struct.pack("<BQ", Opcode.ATTACHMENT, extra))
        stream.seek(extra, os.SEEK_CUR)
        stream.write(struct.pack("<BQI", Opcode.DATA_END, 4, 0))
        stream.write(struct.pack("<BQQQI", Opcode.FOOTER, 20, 0, 0, 0) + MAGIC)
    with limits(MEMORY // 16), pytest.raises(BagError, match=r"the attachment at byte \d+ has \d+ bytes; at most"):
        read(path)


@pytest.mark.parametrize(
    "text", [b"a: " + b"[" * 50_000, b"a: &a [1]\nb: [*a, *a]\n", b"- " * 40_000, b"\xff", b"{" * 3000]
)
def test_yaml_that_would_take_much_memory_or_end_the_process_is_refused(text: bytes) -> None:
    with pytest.raises((yaml.YAMLError, UnicodeDecodeError)):
        safe_yaml.load(text)
    assert Bag(Path(), {}, {}, {"parameters.yaml": text}, {}).mode == "unknown"


def hostile(path: Path, schema: str, *messages: bytes, **metadata: dict[str, str]) -> Path:
    """A bag of one topic with any schema and any messages."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/T", "ros2msg", schema.encode()))
        for k, message in enumerate(messages):
            writer.add_message(channel, k, b"\0\1\0\0" + message, k)
        for name, values in metadata.items():
            writer.add_metadata(name, values)
        writer.finish()
    return path


def doubling(depth: int, last: str) -> str:
    """Types that each have two of the next one: 2^depth numbers."""
    parts = [f"{'=' * 80}\nMSG: a/B{i}\nB{i + 1} x\nB{i + 1} y\n" for i in range(depth)]
    return "B0 x\n" + "".join(parts) + f"{'=' * 80}\nMSG: a/B{depth}\n{last}\n"


@pytest.mark.parametrize(("schema", "reason"), [
    (doubling(40, "uint8 z"), "a message ends early"), (doubling(40, ""), "a message ends early"),
    ("float64[1000000000000] x", "a message ends early"), ("uint8 a\nuint8 a", "has a field twice"),
    (f"uint8[{'9' * 5000}] x", "with a schema that cannot be read"),
])  # fmt: skip
def test_a_hostile_schema_is_refused_in_no_time(schema: str, reason: str, tmp_path: Path) -> None:
    path = hostile(tmp_path / "bag.mcap", schema, b"\xff" * 4 + bytes(100))
    with limits(MEMORY // 16), pytest.raises(BagError, match=reason):
        list(read(path).topics["/a"].messages)  # type: ignore[union-attr]


def test_a_file_that_decompresses_to_a_thousand_times_its_size_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    message = struct.pack("<I", 2**23) + bytes(2**23)
    path = hostile(tmp_path / "bag.mcap", "uint8[] z", *[message] * 4)
    assert path.stat().st_size < 10_000
    assert len(read(path).topics["/a"].log_time_ns) == 4, "so little may be that small"
    monkeypatch.setattr(mcap_file, "READING_LIMITS", replace(READING_LIMITS, expanded=2**24))
    with pytest.raises(BagError, match="bytes decompress to more than 1000 times as many"):
        read(path)


@pytest.mark.slow
def test_a_broken_metadata_file_is_refused_or_read_never_a_crash(tmp_path: Path) -> None:
    samples = split_bag(tmp_path / "bag")
    file = tmp_path / "bag" / "metadata.yaml"
    whole, chance = file.read_bytes(), random.Random(1)
    refused = 0
    for _ in range(300):
        text = bytearray(whole)
        for _ in range(chance.randint(1, 3)):
            text[chance.randrange(len(text))] = chance.choice(b"\0\xff\t[]{}:&*!-x0\n")
        file.write_bytes(text)
        try:
            assert len(read(tmp_path / "bag").topics["/js"].log_time_ns) == len(samples)
        except BagError:
            refused += 1
    assert refused > 50


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_what_rosbag2_compressed_is_read_by_rosbags(
    mode: CompressionMode, storage: StoragePlugin, tmp_path: Path
) -> None:
    kind, bag = "std_msgs/msg/Float64", tmp_path / "bag"
    writer = Ros2Writer(bag, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        topic = writer.add_connection("/x", kind, typestore=STORE)
        for k in range(50):
            writer.write(topic, k, STORE.serialize_cdr(STORE.types[kind](float(k)), kind))
    assert [one.data for one in read(bag).topics["/x"].messages] == list(range(50))
    for file in bag.glob("*.zstd"):
        with pytest.raises(BagError, match="if it is compressed, give its directory"):
            read(file)


def _with(sample: Sample, change: Callable[[bytearray], None]) -> Sample:
    data = bytearray(sample.data)
    change(data)
    return sample._replace(data=bytes(data))


def _huge_count(data: bytearray) -> None:
    struct.pack_into("<I", data, 12, 2**32 - 1)


@pytest.mark.parametrize(("change", "words"), [
    (lambda data: data.__delitem__(slice(40, None)), "a message ends early"), (_huge_count, "a message ends early"),
    (lambda data: data.__setitem__(1, 7), "encapsulation 0007; plain CDR is read"),
    (lambda data: data.clear(), "encapsulation none"),
])  # fmt: skip
@pytest.mark.parametrize("topic", ["/js", "/js_decoded"])
def test_a_message_that_is_none_is_named(
    tmp_path: Path, change: Callable[[bytearray], None], words: str, topic: str
) -> None:
    kind = JOINTS if topic == "/js" else "sensor_msgs/msg/MultiDOFJointState"
    good = joints(5, "abc", ["a"], [1.0])
    if topic != "/js":
        good = random_samples([kind], 1, seed=1, lengths=(3,))[0]
    path = write(tmp_path / "bag.mcap", [good, _with(good, change)], Way(crcs=False))

    def look() -> Bag:
        bag = read(path)
        for columns in bag.topics.values():
            if isinstance(columns, Messages):
                list(columns.messages)
        return bag

    with pytest.raises(BagError, match=words) as caught:
        look()
    assert "bag.mcap" in str(caught.value)


@pytest.mark.parametrize(
    ("encoding", "schema", "text", "words"),
    [
        ("cbor", "ros2msg", b"int32 x", "in encoding 'cbor'; 'cdr', 'ros1', 'json' are read; name the topics"),
        ("cdr", "ros2idl", b"module x {}", "in 'ros2idl'; 'ros2msg' is read; name the topics"),
        ("cdr", "ros2msg", b"wstring x", "field 'x' of a_msgs/msg/A is a wstring, which is not read"),
        ("cdr", "ros2msg", b"B x", "type a_msgs/msg/B of field 'x' of a_msgs/msg/A is not defined"),
        ("cdr", "ros2msg", b"A x", "type a_msgs/msg/A contains itself"),
    ],
)
def test_a_topic_that_cannot_be_read_is_named_and_leaves_the_others(
    tmp_path: Path, encoding: str, schema: str, text: bytes, words: str
) -> None:
    with (tmp_path / "bag.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        odd = writer.register_channel("/odd", encoding, writer.register_schema("a_msgs/msg/A", schema, text))
        known = STORE.generate_msgdef("std_msgs/msg/Bool", ros_version=2)[0].encode()
        good = writer.register_channel("/good", "cdr", writer.register_schema("std_msgs/msg/Bool", "ros2msg", known))
        writer.add_message(odd, 1, b"\0\1\0\0\0\0\0\0", 1)
        writer.add_message(good, 1, b"\0\1\0\0\1", 1)
        writer.finish()
    with pytest.raises(BagError, match=words):
        read(tmp_path / "bag.mcap")
    assert read(tmp_path / "bag.mcap", ["/good"]).topics["/good"].log_time_ns.tolist() == [1]


def test_a_chunk_that_claims_to_be_huge_takes_no_memory(tmp_path: Path) -> None:
    path = write(tmp_path / "bag.mcap", random_samples([JOINTS], 30, seed=1), Way(summary=False, crcs=False))
    whole = path.read_bytes()
    with path.open("rb") as stream:
        chunk = next(record for record in StreamReader(stream, emit_chunks=True).records if isinstance(record, Chunk))
    claim = struct.pack("<Q", chunk.uncompressed_size)
    for size in (2**63, 2**40, 2**30, 2**29):
        path.write_bytes(whole.replace(claim, struct.pack("<Q", size), 1))
        with limits(), pytest.raises(BagError, match=r"is to hold|instead of"):
            read(path)


@pytest.mark.slow
def test_broken_bags_are_refused_and_none_gives_a_wrong_value_unseen(tmp_path: Path) -> None:
    results = break_bags(400, 11, tmp_path)
    verdicts = [verdict for _, verdict in results]
    assert verdicts.count("refused") == len(WAYS)
    assert "differs" in verdicts, "without checksums some damage is not seen: values are compared"
    assert "same" in verdicts
