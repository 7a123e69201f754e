"""Bags that were not closed, or are damaged, made whole; disks that fill up."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from io import BytesIO
from pathlib import Path

import pytest
import yaml
from bag_samples import OURS, WAYS, Sample, Way, messages_of, random_samples, write
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from wam_analysis.findings.analysis import analyse_bag
from wam_analysis.findings.topics import topics_section
from wam_analysis.foreign.topic_map import NOTHING_GIVEN
from wam_analysis.recording import AnalysedRecording
from wam_bag.bag import BagError, read
from wam_bag.bag_writer import RESERVE, WHOLE, BagWriter, RecordingError, Split
from wam_bag.losses import losses
from wam_bag.metadata import offered
from wam_bag.repair import repair
from wam_cli.commands.bag import described, stated

ROOT = Path(__file__).parents[2]
JOINTS = "sensor_msgs/msg/JointState"
QOS = offered(7)


def record(path: Path, samples: list[Sample], split: Split = WHOLE) -> BagWriter:
    """A bag of ours that is still open, a chunk for each ten messages."""
    bag = BagWriter(path, split)
    for topic, kind in dict.fromkeys((sample.topic, sample.type) for sample in samples):
        bag.add_topic(topic, kind, QOS)
    for k, sample in enumerate(samples, 1):
        bag.write(sample.topic, sample.data, sample.time, sample.time, k)
        if k % 10 == 0:
            bag._next_flush = 0.0
            bag.flush_when_due()
    return bag


def killed(path: Path, samples: list[Sample], split: Split = WHOLE, parameters: bytes = b"") -> None:
    """A bag as a killed recorder leaves it: what is in memory is lost, nothing is closed."""
    child = os.fork()
    if child == 0:
        bag = record(path, samples, split)
        if parameters:
            bag.attach("parameters.yaml", "application/yaml", parameters)
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)


def serialized(path: Path) -> list[bytes]:
    return written(messages_of(path))


def written(samples: list[Sample]) -> list[bytes]:
    return sorted(sample.data for sample in samples)


def assert_others_read_it(path: Path, count: int) -> None:
    with AnyReader([path]) as reader:
        assert sum(1 for _ in reader.messages()) == count
    streams = [BytesIO(file.read_bytes()) for file in path.glob("*.mcap")]
    assert sum(1 for one in streams for _ in make_reader(one, validate_crcs=True).iter_messages()) == count


def samples_of(number: int) -> list[Sample]:
    """Joint states and wrenches, stamped one after the other."""
    samples = random_samples([JOINTS, "geometry_msgs/msg/WrenchStamped"], number // 2, seed=number)
    return [sample._replace(time=10 * k) for k, sample in enumerate(samples)]


@pytest.mark.parametrize("split", [WHOLE, Split(4000, 0.0)])
def test_a_killed_recording_is_whole_again_up_to_the_last_chunk(tmp_path: Path, split: Split) -> None:
    samples = samples_of(106)
    killed(tmp_path / "bag", samples, split)
    with pytest.raises(BagError, match=r"was not closed.*wam bag repair"):
        read(tmp_path / "bag")
    lines = [stated(result) for result in repair(tmp_path / "bag")]
    assert "was repaired" in lines[-1]
    assert serialized(tmp_path / "bag") == written(samples[:100])
    assert_others_read_it(tmp_path / "bag", 100)
    assert sorted(path.suffix for path in (tmp_path / "bag").iterdir()) == [".mcap"] * len(lines) + [".yaml"]
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["message_count"] == 100
    assert information["topics_with_message_count"][0]["topic_metadata"]["offered_qos_profiles"] == [QOS]
    assert (len(lines) > 1) == (split.size > 0)


@pytest.mark.slow
def test_a_repair_that_is_killed_can_be_done_again(tmp_path: Path) -> None:
    samples = samples_of(4000)
    killed(tmp_path / "broken", samples)
    chance = random.Random(1)
    for k in range(6):
        bag = tmp_path / f"bag{k}"
        shutil.copytree(tmp_path / "broken", bag)
        (bag / "broken_0.mcap").rename(bag / f"bag{k}_0.mcap")
        child = os.fork()
        if child == 0:
            repair(bag)
            os._exit(0)
        time.sleep(chance.uniform(0.0, 0.1))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        repair(bag)
        assert serialized(bag) == written(samples)
        assert {path.name for path in bag.iterdir()} == {f"bag{k}_0.mcap", "metadata.yaml"}
    (bag / "metadata.yaml").unlink()  # as where it is killed before this is written
    repair(bag)
    assert (bag / "metadata.yaml").is_file()


def test_a_repair_that_is_killed_before_its_last_step_has_changed_nothing(tmp_path: Path) -> None:
    killed(tmp_path / "bag", samples_of(50))
    before = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    child = os.fork()
    if child == 0:
        Path.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)  # type: ignore[method-assign]
        repair(tmp_path / "bag")
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() == before
    (result,) = repair(tmp_path / "bag")
    assert result.messages == 50


def test_a_repair_that_fails_leaves_the_bag_as_it_was(tmp_path: Path) -> None:
    file = write(tmp_path / "bag.mcap", samples_of(20))
    whole = file.read_bytes()
    for hopeless in (b"\x89MCAP0\r\n" + b"\xff" * 20 + whole[28:], whole[:300]):
        file.write_bytes(hopeless)
        with pytest.raises(BagError, match=r"cannot be repaired.*nothing was changed"):
            repair(file)
        assert file.read_bytes() == hopeless
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_what_stands_before_a_cut_is_saved_however_it_was_written(tmp_path: Path, way: str) -> None:
    samples = random_samples(OURS, 20, seed=8)
    file = write(tmp_path / "bag.mcap", samples, WAYS[way]._replace(chunk_size=2000))
    whole = file.read_bytes()
    for cut in range(len(whole) // 3, len(whole), len(whole) // 7):
        file.write_bytes(whole[:cut])
        (result,) = repair(file)
        found = serialized(file)
        assert result.messages == len(found)
        order = [sample.data for sample in samples]
        assert found == sorted(order[: len(found)])
        assert len(found) > 5 or WAYS[way].chunk_size > 10000


@pytest.mark.parametrize(("way", "least"), [("none", 1380), ("lz4", 1200), ("zstd", 1200)])
def test_the_whole_messages_of_a_chunk_that_breaks_off_are_saved(tmp_path: Path, way: str, least: int) -> None:
    samples = samples_of(2000)
    file = write(tmp_path / "bag.mcap", samples, WAYS[way]._replace(chunk_size=2**24))
    file.write_bytes(file.read_bytes()[: int(0.6 * file.stat().st_size)])
    (result,) = repair(file)
    assert result.messages >= least
    assert serialized(file) == written(samples[: result.messages])


def broken(file: Path, number: int) -> tuple[int, int]:
    """Turn one byte of a chunk; its first and last log time."""
    with file.open("rb") as stream:
        chunks = [record for record in StreamReader(stream, emit_chunks=True).records if isinstance(record, Chunk)]
    data = bytearray(file.read_bytes())
    data[data.index(chunks[number].data) + 30] ^= 255
    file.write_bytes(data)
    return chunks[number].message_start_time, chunks[number].message_end_time


def test_around_a_damaged_chunk_everything_is_saved(tmp_path: Path) -> None:
    samples = samples_of(400)
    file = write(tmp_path / "bag.mcap", samples, Way(chunk_size=2000))
    first, last = broken(file, 5)
    (result,) = repair(file)
    lost = set(written(samples)) - set(serialized(file))
    assert lost == {sample.data for sample in samples if first <= sample.time <= last}
    assert result.losses is not None
    assert result.losses.bytes > 0
    assert read(file).attachments == {"note.txt": b"written by a test"}


def damaged(path: Path, samples: list[Sample], number: int) -> tuple[int, int]:
    """A recording of ours with one byte of a chunk turned; first and last log time of that chunk."""
    bag = record(path, samples)
    counts = Counter(sample.topic for sample in samples)
    bag.metadata(
        "recording", {"mode": "lockstep", **{f"{topic} driver received": str(n) for topic, n in counts.items()}}
    )
    bag.close()
    return broken(path / f"{path.name}_0.mcap", number)


def test_what_a_repair_could_not_save_is_told_first_wherever_one_looks(tmp_path: Path) -> None:
    samples = [sample._replace(time=10**7 * k) for k, sample in enumerate(samples_of(100))]
    first, last = damaged(tmp_path / "bag", samples, 5)
    gone = Counter(sample.topic for sample in samples if first <= sample.time <= last)
    lines = stated(repair(tmp_path / "bag")[0]).splitlines()
    assert "lost are 10 messages (5 of /jointstate, 5 of /wrenchstamped)" in lines[1]
    assert lines[2] == f"A gap from {(first - 10**7) / 1e9:.3f} s to {(last + 10**7) / 1e9:.3f} s."
    info = described(read(tmp_path / "bag", ()))
    assert info[:2] == [f"INCOMPLETE: {line}" for line in lines[1:]]
    assert "recorded in lockstep mode, lost: 10 of those that were recorded" in info
    assert [line.split()[-3] for line in info if line.endswith("are gone")] == [str(gone[t]) for t in sorted(gone)]
    bag = read(tmp_path / "bag")
    assert list(AnalysedRecording(bag).lost) == lines[1:]
    assert list(topics_section(AnalysedRecording(bag, given=NOTHING_GIVEN)).wrong[:2]) == info[:2]
    found = analyse_bag(bag, lambda doing: None)
    assert list(found.sections[1].wrong[:2]) == info[:2]
    assert found.sections[0].sentences[1].startswith(f"Problems: {info[0]}")
    assert found.provenance["lost"] == " ".join(lines[1:])


def test_the_losses_of_two_repairs_stand_side_by_side(tmp_path: Path) -> None:
    samples = samples_of(100)
    damaged(tmp_path / "bag", samples, 2)
    repair(tmp_path / "bag")
    broken(tmp_path / "bag" / "bag_0.mcap", 7)
    repair(tmp_path / "bag")
    lost = (found := read(tmp_path / "bag", ())).losses
    assert list(lost.repaired) == ["bag_0.mcap", "bag_0.mcap (2)"]
    assert lost.by_topic == {topic: 50 - count for topic, count in found.counts.items()}
    assert lost.gone == 20


def test_what_the_recorder_counted_is_compared_with_what_is_there(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", samples_of(100))
    bag.metadata(
        "recording", {"mode": "lockstep", "/jointstate driver received": "57", "/jointstate driver dropped": "0"}
    )
    bag.close()
    first = described(read(tmp_path / "bag", ()))[0]
    assert first == "INCOMPLETE: The recorder received 7 messages (7 of /jointstate) that are not in the bag."


def test_one_file_of_several_and_a_cut_are_not_held_against_the_counts_of_the_whole(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", samples_of(100), Split(4000, 0.0))
    bag.metadata(
        "recording", {"mode": "lockstep", "/jointstate driver received": "50", "/wrenchstamped driver received": "50"}
    )
    bag.close()
    files = sorted((tmp_path / "bag").glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    assert len(files) > 2
    for path in (files[-1], tmp_path / "bag"):
        assert not any("INCOMPLETE" in line for line in described(read(path, ())))
    found = read(tmp_path / "bag", ())
    cut = {**found.metadata, "cut": {"begin_ns": "0"}}
    assert losses(found.path, cut, found.attachments, {"/jointstate": 1}).gone == 0
    assert losses(found.path, found.metadata, found.attachments, {"/jointstate": 1}).gone == 99


def test_after_a_kill_the_mode_is_that_of_the_parameters(tmp_path: Path) -> None:
    values = {"/wam/driver": {"ros__parameters": {"timing": {"mode": "realtime"}}}}
    killed(tmp_path / "bag", samples_of(20), parameters=yaml.safe_dump(values).encode())
    repair(tmp_path / "bag")
    lines = described(read(tmp_path / "bag", ()))
    assert lines[0].startswith("INCOMPLETE: bag_0.mcap had not been closed")
    assert lines[1].startswith("INCOMPLETE: The recorder wrote no counts")
    assert "recorded in realtime mode, lost: unknown, see above" in lines
    assert AnalysedRecording(read(tmp_path / "bag")).mode == "realtime"


def test_a_bag_that_is_being_recorded_is_left_alone(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", samples_of(20))
    with pytest.raises(RecordingError, match="is being recorded; stop the recorder"):
        repair(tmp_path / "bag")
    bag.close()
    assert len(serialized(tmp_path / "bag")) == 20
    assert not (tmp_path / "bag" / RESERVE).exists()
    (tmp_path / "bag" / "bag_1.mcap.zstd").touch()
    with pytest.raises(BagError, match="has compressed ones"):
        repair(tmp_path / "bag")


def test_info_says_what_is_in_a_bag(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", samples_of(100), Split(4000, 0.0))
    bag.metadata("recording", {"mode": "lockstep", "/jointstate driver dropped": "3", "/clock driver dropped": "0"})
    bag.close()
    lines = described(read(tmp_path / "bag", ()))
    assert any(line.startswith(f"{tmp_path}/bag/bag_1.mcap") for line in lines)
    assert "100 messages" in "\n".join(lines)
    assert lines[0] == "INCOMPLETE: Lost on the way to the recorder: 3 of /jointstate from driver."
    assert "recorded in lockstep mode, lost: 3 of /jointstate from driver" in lines
    joints = next(line for line in lines if line.startswith("/jointstate "))
    assert joints.split()[1] == "50"
    assert joints.endswith(JOINTS)


FILL = """
import os, sys
from pathlib import Path
sys.path.append(sys.argv[3])
from test_bag_repair import QOS
from wam_bag.bag_writer import BagWriter, RecordingError, Split
path = Path(sys.argv[1])
bag = BagWriter(path / "bag", Split(int(sys.argv[2]), 0.0))
bag.add_topic("/t", "std_msgs/msg/String", QOS)
try:
    for k in range(100_000):
        text = os.urandom(500).hex().encode()
        bag.write("/t", b"\\0\\1\\0\\0" + (1001).to_bytes(4, "little") + text + b"\\0", k, k, k)
except RecordingError as error:
    print(error)
assert bag.closed
from wam_bag.bag import read
from test_bag_repair import assert_others_read_it
count = len(read(path / "bag").topics["/t"].log_time_ns)
assert_others_read_it(path / "bag", count)
assert count == bag.written > 1000, (count, bag.written)
BagWriter(path / "second")
try:
    BagWriter(path / "third")
except RecordingError as error:
    print(error)
assert not (path / "third").exists()
"""


@pytest.mark.slow
@pytest.mark.parametrize("split_size", [0, 1_000_000])
def test_a_disk_that_fills_up_leaves_a_bag_that_is_closed(tmp_path: Path, split_size: int) -> None:
    inside = f'mount -t tmpfs -o size=12m none {tmp_path} && exec "$@"'
    own_mounts = ["unshare", "--map-root-user", "--mount", "sh", "-c", inside, "sh"]
    if subprocess.run([*own_mounts, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this system lets nobody mount a small disk")
    done = subprocess.run(
        [*own_mounts, sys.executable, "-c", FILL, str(tmp_path), str(split_size), str(Path(__file__).parent)],
        env={**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'test'}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first.startswith("the disk is full (No space left on device); the bag is closed")
    assert "third cannot be created: No space left on device; free 8 MiB or more" in second
