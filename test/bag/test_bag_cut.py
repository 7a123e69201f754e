"""Bags cut out of others: what is in the part, what explains it, and nothing else."""

from pathlib import Path

import pytest
from bag_samples import OURS, WAYS, Sample, random_samples, write
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from wam_bag.bag import BagError, read
from wam_bag.bag_writer import WHOLE, BagWriter, Split
from wam_bag.cut import CUT, Cut, cut
from wam_bag.metadata import INFINITE

PART = Cut(20_000_000, 60_000_000)
QOS = {
    "history": "keep_last", "depth": 7, "reliability": "reliable", "durability": "volatile", "deadline": INFINITE,
    "lifespan": INFINITE, "liveliness": "automatic", "liveliness_lease_duration": INFINITE,
    "avoid_ros_namespace_conventions": False,
}  # fmt: skip
LATCHED = {**QOS, "durability": "transient_local"}


def bool_message(value: bool) -> bytes:
    return b"\0\1\0\0" + bytes([value])


def written(path: Path, split: Split = WHOLE, is_turned: bool = False) -> Path:
    """A bag of our own with 100 messages a millisecond apart, and a latched topic at 5 and 50 ms.

    Parameters
    ----------
    is_turned : whether what comes at the same time, and what has no time, comes in the other order.
    """
    with BagWriter(path, split) as bag:
        topics = [("/wam/fast", QOS), ("/wam/contact/in_contact", LATCHED)]
        for topic, offered in reversed(topics) if is_turned else topics:
            bag.add_topic(topic, "std_msgs/msg/Bool", offered)
        bag.attach("parameters.yaml", "application/yaml", b"a: 1\n")
        for k in range(100):
            time = k * 1_000_000
            some = [("/wam/fast", bool_message(k % 3 == 0), time, time + 7, k + 1)]
            if k in (5, 50):
                some.append(("/wam/contact/in_contact", bool_message(k == 5), time, time, k))
            for message in reversed(some) if is_turned else some:
                bag.write(*message)
        counts = [("mode", "lockstep"), ("/wam/fast driver received", "100")]
        bag.metadata("recording", dict(reversed(counts) if is_turned else counts))
    return path


def messages(file: Path) -> list[tuple[str, int, int, int, bytes]]:
    """Every message of a file by the library of its format, in the order in which it stands there."""
    with file.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(c.topic, m.log_time, m.publish_time, m.sequence, bytes(m.data)) for _, c, m in found]


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_the_part_has_the_messages_of_its_time_and_topics_and_no_other(tmp_path: Path, way: str) -> None:
    samples = random_samples(OURS, 30, seed=3)
    file = write(tmp_path / "whole.mcap", samples, WAYS[way])
    topics = ("/jointstate", "/bool", "/diagnosticarray")

    def is_meant(sample: Sample) -> bool:
        return sample.topic in topics and 5_000_000 <= sample.time < 20_000_000

    new = cut(file, tmp_path / "part", Cut(5_000_000, 20_000_000, topics))
    found = [(topic, time, data) for topic, time, _, _, data in messages(new)]
    expected = [(sample.topic, sample.time, sample.data) for sample in samples if is_meant(sample)]
    assert sorted(found) == sorted(expected)
    assert len(expected) > 20
    assert [time for _, time, _ in found] == sorted(time for _, time, _ in found)
    with new.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert [(note.name, bytes(note.data)) for note in reader.iter_attachments()] == [
            ("note.txt", b"written by a test")
        ]
        said = {record.name: record.metadata for record in reader.iter_metadata()}
    assert said["note"] == {"by": "a test"}
    assert said[CUT] == {"begin_ns": "5000000", "end_ns": "20000000", "topics": " ".join(topics)}


def test_what_was_latched_before_the_part_is_kept_at_its_own_time(tmp_path: Path) -> None:
    new = cut(written(tmp_path / "whole"), tmp_path / "part", PART)
    found = messages(new)
    assert [time for topic, time, *_ in found if topic == "/wam/contact/in_contact"] == [5_000_000, 50_000_000]
    fast = [entry for entry in found if entry[0] == "/wam/fast"]
    assert fast == [
        ("/wam/fast", k * 1_000_000, k * 1_000_000 + 7, k + 1, bool_message(k % 3 == 0)) for k in range(20, 60)
    ]
    bag = read(tmp_path / "part")
    assert bag.attachments == {"parameters.yaml": b"a: 1\n"}
    assert bag.metadata["recording"] == {"mode": "lockstep", "/wam/fast driver received": "100"}


def test_a_thinned_topic_has_the_first_of_so_many_messages_and_the_part_says_so(tmp_path: Path) -> None:
    new = cut(written(tmp_path / "whole"), tmp_path / "part", PART._replace(thinned={"fast": 10}))
    times = [time for topic, time, *_ in messages(new) if topic == "/wam/fast"]
    assert times == [20_000_000, 30_000_000, 40_000_000, 50_000_000]
    assert [topic for topic, *_ in messages(new)].count("/wam/contact/in_contact") == 2
    assert read(tmp_path / "part").metadata[CUT]["thinned"] == "fast:10"


def test_rosbags_reads_counts_times_and_qos_of_the_part(tmp_path: Path) -> None:
    cut(written(tmp_path / "whole"), tmp_path / "part", PART)
    with Reader(tmp_path / "part") as reader:
        assert reader.message_count == 42
        assert (reader.start_time, reader.end_time) == (5_000_000, 59_000_001)
        offered = {each.topic: each.ext.offered_qos_profiles[0] for each in reader.connections}
        assert offered["/wam/contact/in_contact"].durability.name == "TRANSIENT_LOCAL"
        assert offered["/wam/fast"].depth == 7
    with AnyReader([tmp_path / "part"]) as reader:
        values = [reader.deserialize(data, each.msgtype).data for each, _, data in reader.messages()]
    assert values.count(True) == sum(k % 3 == 0 for k in range(20, 60)) + 1


def test_equal_messages_give_an_equal_file_however_they_were_recorded(tmp_path: Path) -> None:
    one = cut(written(tmp_path / "one"), tmp_path / "a" / "part", PART)
    other = cut(written(tmp_path / "other", Split(0, 0.03), is_turned=True), tmp_path / "b" / "part", PART)
    assert len(list((tmp_path / "other").glob("*.mcap"))) == 4
    assert one.read_bytes() == other.read_bytes()
    assert (one.parent / "metadata.yaml").read_bytes() == (other.parent / "metadata.yaml").read_bytes()


def test_what_cannot_be_cut_is_refused_and_nothing_is_overwritten(tmp_path: Path) -> None:
    whole = written(tmp_path / "whole")
    with pytest.raises(BagError, match="has no topic slow; what it has: 'wam bag info"):
        cut(whole, tmp_path / "part", Cut(topics=("fast", "slow")))
    with pytest.raises(BagError, match="has nothing from 200000000 to 300000000 ns"):
        cut(whole, tmp_path / "part", Cut(200_000_000, 300_000_000))
    assert not (tmp_path / "part").exists()
    with pytest.raises(FileExistsError):
        cut(whole, whole, PART)
    broken = bytearray((whole / "whole_0.mcap").read_bytes())
    broken[len(broken) // 3] ^= 1
    (tmp_path / "broken.mcap").write_bytes(broken)
    with pytest.raises(BagError):
        cut(tmp_path / "broken.mcap", tmp_path / "part", PART)
