"""Bags written without ROS and read by readers that are not ours, and the other way round."""

import contextlib
import os
import shutil
import struct
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bag_comparison import compare
from conftest import ran
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability, QosTime
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg
from sample_messages import QOS, STORE, joint_state, point, status, wrench

import wam_bag
from wam_bag.bag import BagError, JointColumns, read
from wam_bag.bag_writer import BagWriter, RecordingError
from wam_bag.cdr import stamp_reader
from wam_bag.definitions import definition, schema, type_hash
from wam_bag.mcap_writer import McapWriter
from wam_description.topics import TOPICS

TYPES = sorted({topic.type for topic in TOPICS})


def write_sample(path: Path, force: float = 3.0) -> None:
    with BagWriter(path) as bag:
        bag.add_topic("/wam/motor_states", "sensor_msgs/msg/JointState", QOS)
        bag.add_topic("/wam/contact/wrench", "geometry_msgs/msg/WrenchStamped", QOS)
        bag.add_topic("/wam/contact/point", "geometry_msgs/msg/PointStamped", QOS)
        bag.add_topic("/wam/contact/in_contact", "std_msgs/msg/Bool", QOS)
        bag.add_topic("/wam/status", "diagnostic_msgs/msg/DiagnosticStatus", QOS)
        bag.add_topic("/wam/sim/disturbance", "geometry_msgs/msg/WrenchStamped", QOS)
        bag.attach("parameters.yaml", "application/yaml", b"a: 1\n")
        for k in range(1, 101):
            t = k * 1_000_000
            names = ["motor1", "motor2"] if k % 2 else ["motor2", "motor1"]
            values = [0.1 * k, -0.1 * k] if k % 2 else [-0.1 * k, 0.1 * k]
            bag.write("/wam/motor_states", joint_state(t, names, values, [], values), t, t - 5, k)
            bag.write("/wam/contact/wrench", wrench(t, "outer_link", 1, 2, force, 4, 5, -0.0), t, t, k)
            bag.write("/wam/contact/point", point(t, "outer_link", np.nan, 0, k), t, t, k)
        bag.write("/wam/contact/in_contact", b"\0\1\0\0\1", 50_000_000, 50_000_000, 1)
        bag.write("/wam/status", status("driver", "ready"), 0, 0, 1)
        bag.metadata("recording", {"mode": "lockstep"})


def test_rosbags_reads_counts_values_times_and_qos(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample")
    with AnyReader([tmp_path / "sample"], default_typestore=STORE) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        assert counts["/wam/motor_states"] == counts["/wam/contact/wrench"] == 100
        assert counts["/wam/contact/in_contact"] == 1
        assert counts["/wam/sim/disturbance"] == 0
        assert (reader.start_time, reader.end_time) == (0, 100_000_001)
        connection = next(c for c in reader.connections if c.topic == "/wam/contact/wrench")
        (qos,) = connection.ext.offered_qos_profiles
        assert (qos.history, qos.depth) == (QosHistory.KEEP_LAST, 7)
        assert (qos.reliability, qos.durability) == (QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL)
        assert qos.deadline == QosTime(9223372036, 854775807)
        for k, (where, time, data) in enumerate(reader.messages([connection]), 1):
            message = reader.deserialize(data, where.msgtype)
            assert time == message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == k * 1_000_000
            assert (message.wrench.force.z, message.header.frame_id) == (3.0, "outer_link")


def test_mcap_ros2_reads_every_message_and_the_extras(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample")
    with (tmp_path / "sample" / "sample_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        decoded = list(reader.iter_decoded_messages(log_time_order=False))
        assert len(decoded) == 302
        first = next(item for item in decoded if item.channel.topic == "/wam/motor_states")
        assert (first.message.sequence, first.message.publish_time) == (1, 999_995)
        assert list(first.decoded_message.position) == [0.1, -0.1]
        assert [item.data for item in reader.iter_attachments()] == [b"a: 1\n"]


def test_metadata_yaml_has_every_field_that_rosbag2_writes(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample")
    text = (tmp_path / "sample" / "metadata.yaml").read_text()
    assert "&id" not in text
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    topic = information["topics_with_message_count"][0]
    with Writer(tmp_path / "theirs", version=9, storage_plugin=StoragePlugin.MCAP) as theirs:
        connection = theirs.add_connection("/a", "std_msgs/msg/Bool", typestore=STORE)
        theirs.write(connection, 1, b"\0\1\0\0\1")
    reference = yaml.safe_load((tmp_path / "theirs" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information.keys() == reference.keys()
    assert topic["topic_metadata"].keys() == reference["topics_with_message_count"][0]["topic_metadata"].keys()
    assert information["files"][0].keys() == reference["files"][0].keys()
    assert topic["topic_metadata"]["offered_qos_profiles"] == [QOS]
    assert information["version"] == 9
    assert (information["message_count"], information["files"][0]["message_count"]) == (302, 302)
    assert information["duration"]["nanoseconds"] == 100_000_000
    assert (
        read(tmp_path / "sample").metadata["rosbag2"]["serialized_metadata"]
        == yaml.dump(information, Dumper=_no_aliases(), sort_keys=False).strip()
    )


def _no_aliases() -> Any:
    return type("Plain", (yaml.SafeDumper,), {"ignore_aliases": lambda self, data: True})


@pytest.mark.parametrize("name", TYPES)
def test_every_recorded_type_has_the_schema_and_hash_of_ros(name: str) -> None:
    parsed = get_types_from_msg(schema(name).decode(), name)
    assert parsed[name][1] == STORE.fielddefs[name][1]
    assert type_hash(name) == STORE.hash_rihs01(name)
    assert definition(name)


def test_stamps_are_read_from_either_byte_order() -> None:
    stamp_of = stamp_reader("sensor_msgs/msg/JointState")
    assert stamp_of(joint_state(12_345_678_901, ["a"], [], [], [])) == 12_345_678_901
    assert stamp_of(b"\0\0\0\0" + struct.pack(">iI", 2, 3)) == 2_000_000_003
    assert stamp_reader("std_msgs/msg/Bool")(b"\0\1\0\0\1") is None
    markers = stamp_reader("visualization_msgs/msg/MarkerArray")
    assert markers(b"\0\1\0\0" + struct.pack("<I", 0)) is None
    assert markers(b"\0\1\0\0" + struct.pack("<IiI", 1, 4, 5)) == 4_000_000_005


def test_an_existing_target_is_refused_and_left_alone(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample")
    before = (tmp_path / "sample" / "sample_0.mcap").read_bytes()
    with pytest.raises(RecordingError, match=r"sample exists already.*another name"):
        BagWriter(tmp_path / "sample")
    assert (tmp_path / "sample" / "sample_0.mcap").read_bytes() == before


def test_an_empty_bag_is_closed_and_read(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "empty") as bag:
        bag.add_topic("/a", "sensor_msgs/msg/JointState", QOS)
    with Reader(tmp_path / "empty") as reader:
        assert reader.message_count == 0
    columns = read(tmp_path / "empty").topics["/a"]
    assert isinstance(columns, JointColumns)
    assert columns.position.shape == (0, 0)


def test_broken_bags_are_refused_in_words(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample")
    whole = (tmp_path / "sample" / "sample_0.mcap").read_bytes()
    (tmp_path / "directory").mkdir()
    cases = {
        "nothing": (None, "does not exist"),
        "directory": (None, "no .mcap file and no .db3 file"),
        "empty.mcap": (b"", "is empty"),
        "text.mcap": (b"hello, this is not a bag at all", "is not MCAP"),
        "cut.mcap": (whole[: len(whole) * 2 // 3], "was not closed"),
        "flipped.mcap": (_flipped(whole), "is damaged"),
    }
    for name, (data, words) in cases.items():
        if data is not None:
            (tmp_path / name).write_bytes(data)
        with pytest.raises(BagError, match=words) as caught:
            read(tmp_path / name)
        assert name in str(caught.value)


def _flipped(data: bytes) -> bytes:
    where = data.index(b"zstd") + 20
    return data[:where] + bytes(255 - byte for byte in data[where : where + 200]) + data[where + 200 :]


def test_equal_bags_compare_equal_and_the_first_difference_is_named(tmp_path: Path) -> None:
    write_sample(tmp_path / "a")
    write_sample(tmp_path / "b")
    write_sample(tmp_path / "c", force=np.nextafter(3.0, 4.0))
    assert compare(tmp_path / "a", tmp_path / "b", log_times=True) == []
    (difference,) = compare(tmp_path / "a", tmp_path / "c")
    assert difference == "/wam/contact/wrench: message 0: wrench.force.z 3.0 and 3.0000000000000004"
    assert compare(tmp_path / "a", tmp_path / "c", without=("/wam/contact/wrench",)) == []


def test_after_a_failed_write_the_file_is_still_whole(tmp_path: Path) -> None:
    """The reason for a writer of our own: the library's counts and checksum would include what is not on disk."""

    class FullDisk(FileIO):
        room = 10**6

        def write(self, data: Any) -> int:
            taken = data[: max(self.room, 0)]
            self.room -= len(data)
            if not taken:
                raise OSError(28, "No space left on device")
            return super().write(taken)

    with FullDisk(tmp_path / "bag.mcap", "w") as stream:
        writer = McapWriter(stream, "test", 10**6)
        writer.define(Schema(1, schema("std_msgs/msg/Bool"), "ros2msg", "std_msgs/msg/Bool"))
        writer.define(Channel(1, "/a", "cdr", {}, 1))
        for k in range(3):
            writer.add(1, k, k, k, b"\0\1\0\0\1")
            stream.room = (10**6, 60, 10**6)[k]
            with contextlib.nullcontext() if k != 1 else pytest.raises(OSError, match="No space"):
                writer.flush()
            assert (tmp_path / "bag.mcap").stat().st_size == writer.position
        writer.finish()
    assert writer.counts.by_channel == {1: 2}
    assert read(tmp_path / "bag.mcap").topics["/a"].log_time_ns.tolist() == [0, 2]
    with (tmp_path / "bag.mcap").open("rb") as stream:
        assert sum(isinstance(record, Message) for record in StreamReader(stream, validate_crcs=True).records) == 2


@pytest.mark.slow
def test_bags_are_read_without_the_rest_of_the_project(tmp_path: Path) -> None:
    write_sample(tmp_path / "sample")
    shutil.copytree(Path(wam_bag.__file__).parent, tmp_path / "alone" / "wam_bag")
    program = (
        "import sys; from wam_bag import bag, bag_writer, losses, repair; "
        "assert len(bag.read(sys.argv[1]).topics) == 6; repair.repair(repair.Path(sys.argv[1])); "
        "print(*sorted({name.split('.')[0] for name in sys.modules if name.startswith(('wam_', 'rclpy'))}))"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "alone")}
    done = ran("-P", "-c", program, str(tmp_path / "sample"), env=environment, cwd=tmp_path)
    assert (done.stderr, done.stdout.split()) == ("", ["wam_bag"])
