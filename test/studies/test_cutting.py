"""Samples cut out of recordings: what is in the part, what explains it, and nothing else."""

from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from sample_messages import QOS

from wam_bag.bag import BagError, read
from wam_bag.bag_writer import BagWriter, RecordingError
from wam_bag.losses import CUT
from wam_studies.thesis.cutting import cut
from wam_studies.thesis.definition import SampleDefinition

PART = SampleDefinition("", "", (0.02, 0.06))
LATCHED = "/wam/contact/in_contact"


def bool_message(value: bool) -> bytes:
    return b"\0\1\0\0" + bytes([value])


def written(path: Path, is_turned: bool = False) -> Path:
    """A bag of our own with 100 messages a millisecond apart, and a latched topic at 5 and 50 ms.

    Parameters
    ----------
    is_turned : whether what comes at the same time, and what has no time, comes in the other order.
    """
    with BagWriter(path) as bag:
        topics = [("/wam/fast", {**QOS, "durability": "volatile"}), (LATCHED, QOS)]
        for topic, offered in reversed(topics) if is_turned else topics:
            bag.add_topic(topic, "std_msgs/msg/Bool", offered)
        bag.attach("parameters.yaml", "application/yaml", b"a: 1\n")
        for k in range(100):
            time = k * 1_000_000
            some = [("/wam/fast", bool_message(k % 3 == 0), time, time + 7, k + 1)]
            if k in (5, 50):
                some.append((LATCHED, bool_message(k == 5), time, time, k))
            for message in reversed(some) if is_turned else some:
                bag.write(*message)
        counts = [("mode", "lockstep"), ("/wam/fast driver received", "100")]
        bag.metadata("recording", dict(reversed(counts) if is_turned else counts))
    return path


def messages(part: Path) -> list[tuple[str, int, int, int, bytes]]:
    """Every message of a part by the library of its format, in the order in which it stands there."""
    with (part / "part_0.mcap").open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [(c.topic, m.log_time, m.publish_time, m.sequence, bytes(m.data)) for _, c, m in found]


def test_the_part_has_the_messages_of_its_time_and_what_was_latched_before(tmp_path: Path) -> None:
    cut(written(tmp_path / "whole"), tmp_path / "part", PART)
    found = messages(tmp_path / "part")
    assert [time for topic, time, *_ in found if topic == LATCHED] == [5_000_000, 50_000_000]
    assert [entry for entry in found if entry[0] == "/wam/fast"] == [
        ("/wam/fast", k * 1_000_000, k * 1_000_000 + 7, k + 1, bool_message(k % 3 == 0)) for k in range(20, 60)
    ]
    assert [time for _, time, *_ in found] == sorted(time for _, time, *_ in found)
    bag = read(tmp_path / "part")
    assert bag.attachments == {"parameters.yaml": b"a: 1\n"}
    assert bag.metadata["recording"] == {"mode": "lockstep", "/wam/fast driver received": "100"}
    assert bag.metadata[CUT] == {"begin_ns": "20000000", "end_ns": "60000000", "topics": "*"}
    with Reader(tmp_path / "part") as reader:
        assert (reader.message_count, reader.start_time, reader.end_time) == (42, 5_000_000, 59_000_001)
        offered = {each.topic: each.ext.offered_qos_profiles[0].durability.name for each in reader.connections}
        assert offered == {"/wam/fast": "VOLATILE", LATCHED: "TRANSIENT_LOCAL"}


def test_a_thinned_topic_has_the_first_of_so_many_messages_and_the_part_says_so(tmp_path: Path) -> None:
    part = PART._replace(thinned={"fast": 10}, topics=("fast",))
    cut(written(tmp_path / "whole"), tmp_path / "part", part)
    found = messages(tmp_path / "part")
    assert [time for _, time, *_ in found] == [20_000_000, 30_000_000, 40_000_000, 50_000_000]
    said = read(tmp_path / "part").metadata[CUT]
    assert (said["thinned"], said["topics"]) == ("fast:10", "fast")


def test_equal_messages_give_an_equal_file_however_they_were_recorded(tmp_path: Path) -> None:
    cut(written(tmp_path / "one"), tmp_path / "a" / "part", PART)
    cut(written(tmp_path / "other", is_turned=True), tmp_path / "b" / "part", PART)
    for name in ("part_0.mcap", "metadata.yaml"):
        assert (tmp_path / "a" / "part" / name).read_bytes() == (tmp_path / "b" / "part" / name).read_bytes()


def test_what_cannot_be_cut_is_refused_and_nothing_is_overwritten(tmp_path: Path) -> None:
    whole = written(tmp_path / "whole")
    with pytest.raises(BagError, match="has no topic slow; what it has: 'wam bag info"):
        cut(whole, tmp_path / "part", PART._replace(topics=("fast", "slow")))
    with pytest.raises(BagError, match="has no message from 200000000 to 300000000 ns"):
        cut(whole, tmp_path / "part", PART._replace(seconds=(0.2, 0.3)))
    assert not (tmp_path / "part").exists()
    with pytest.raises(RecordingError, match="exists already"):
        cut(whole, whole, PART)
