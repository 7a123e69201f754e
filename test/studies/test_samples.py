"""The samples in bags/: they are as the index lists them, they open everywhere, and they show what they are to show."""

import hashlib
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from wam_bag.bag import read
from wam_bag.losses import CUT
from wam_cli.main import main
from wam_description.parameters import ParameterError
from wam_sim.replay import replay
from wam_studies.thesis.definition import load, names, tasks
from wam_studies.thesis.evaluation import evaluate
from wam_studies.thesis.samples import check, read_index, write_index

ROOT = Path(__file__).resolve().parents[2]
BAGS = ROOT / "bags"
INDEX = yaml.safe_load((BAGS / "index.yaml").read_text(encoding="utf-8"))["samples"]
ENTRIES = read_index(BAGS)
STICTION = BAGS / "sample" / "stiction-limit-cycle"


def versioned() -> set[str]:
    """Files below bags/ that git knows, or all of an archive without git."""
    if (ROOT / ".git").exists():
        listed = subprocess.run(["git", "ls-files", "bags"], cwd=ROOT, capture_output=True, text=True, check=True)
        return set(listed.stdout.split())
    return {str(file.relative_to(ROOT)) for file in (BAGS / "sample").rglob("*") if file.name != "result.png"} | {
        "bags/README.md",
        "bags/index.yaml",
    }


def test_every_listed_file_has_its_hash_and_nothing_else_is_in_bags() -> None:
    listed = {"bags/README.md", "bags/index.yaml"}
    for entry in INDEX:
        for name, digest in entry["sha256"].items():
            file = BAGS / "sample" / entry["name"] / name
            assert hashlib.sha256(file.read_bytes()).hexdigest() == digest, file
            listed.add(str(file.relative_to(ROOT)))
    assert versioned() == listed


def test_the_samples_are_small() -> None:
    files = [file for file in (BAGS / "sample").rglob("*") if file.is_file() and file.name != "result.png"]
    sizes = [file.stat().st_size for file in files]
    assert sum(sizes) < 8_000_000
    assert sum(entry["size"] for entry in INDEX) == sum(
        (BAGS / "sample" / entry["name"] / name).stat().st_size for entry in INDEX for name in entry["sha256"]
    )


def test_every_sample_that_an_experiment_or_task_declares_is_there_and_what_is_declared() -> None:
    assert [entry["name"] for entry in INDEX] == sorted([*names(), *tasks()])
    for entry in INDEX:
        sample = load(entry["name"]).sample
        assert sample is not None
        declared = [sample.run, sample.shows, *sample.seconds]
        assert [entry["run"], entry["shows"], *entry["seconds"]] == declared, entry["name"]
        thinned = read(BAGS / "sample" / entry["name"]).metadata[CUT].get("thinned", "")
        assert thinned == " ".join(f"{topic}:{each}" for topic, each in sample.thinned.items())


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ENTRIES))
def test_what_a_sample_shows_is_measured_again(name: str) -> None:
    assert check(load(name), ENTRIES[name], BAGS) == []
    assert ENTRIES[name].rows


def test_the_page_is_what_the_index_says(tmp_path: Path) -> None:
    shutil.copy(BAGS / "README.md", tmp_path)
    write_index(tmp_path, ENTRIES)
    for name in ("README.md", "index.yaml"):
        assert (tmp_path / name).read_text(encoding="utf-8") == (BAGS / name).read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stiction-limit-cycle"])
def test_other_readers_see_the_same(name: str) -> None:
    bag = read(BAGS / "sample" / name)
    counts, sums = dict.fromkeys(bag.topics, 0), dict.fromkeys(bag.topics, 0)
    with AnyReader([BAGS / "sample" / name]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            counts[connection.topic] += 1
            if hasattr(message, "header"):
                sums[connection.topic] += message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    theirs = dict.fromkeys(bag.topics, 0)
    with (BAGS / "sample" / name / f"{name}_0.mcap").open("rb") as file:
        for _, channel, _, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            assert message is not None
            theirs[channel.topic] += 1
    ours = {topic: len(columns.log_time_ns) for topic, columns in bag.topics.items()}
    assert ours == counts == theirs
    for topic, columns in bag.topics.items():
        if sums[topic]:
            assert int(columns.stamp_ns.sum()) == sums[topic]


def test_the_limit_cycle_of_the_sample_is_that_of_the_thesis() -> None:
    """Read by rosbags; (5.8) and (5.9) corrected, by hand: zeta 0.1604, Omega 1.6, friction 6 to 3 N m."""
    time, angle = [], []
    with AnyReader([STICTION]) as reader:
        chosen = [each for each in reader.connections if each.topic.endswith("/joint_sensors")]
        for _, stamp, data in reader.messages(connections=chosen):
            time.append(stamp / 1e9)
            angle.append(reader.deserialize(data, "sensor_msgs/msg/JointState").position[0])
    lever, stiffness = 0.9144, 1464.28  # m, N m/rad
    force = -stiffness / lever * np.array(angle)
    level = 0.5 * (force.max() + force.min())
    rises = np.array(time)[1:][(force[:-1] <= level) & (force[1:] > level)]
    assert np.ptp(force) == pytest.approx(1.6 * 3.0 * stiffness / 3096.9 / lever, rel=0.04)
    assert np.diff(rises) == pytest.approx(1.943, rel=0.04)


@pytest.mark.slow
def test_nodes_replayed_from_the_sample_say_the_same_but_for_the_last_digits_of_another_processor() -> None:
    for node in ("contact_estimator", "velocity_loop"):
        topics = replay(BAGS / "sample" / "wam-touch", node).topics
        for topic in (one for one in topics if one.topic != "contact/tracked_friction"):  # not with joint sensors
            assert topic.compared > 400
            assert topic.only_recorded == topic.only_replayed == 0
            assert topic.largest < 1e-6, topic.first


def test_steps_that_are_not_whole_in_a_sample_are_not_judged() -> None:
    rows = [row.quantity for row in evaluate(load("wam-press"), BAGS / "sample" / "wam-press").rows]
    assert [row for row in rows if row.endswith("true")] == ["press 20 N, true", "press 5 N again, true"]


def test_a_changed_sample_and_a_changed_list_are_noticed(tmp_path: Path) -> None:
    experiment, entry = load("stiction-limit-cycle"), ENTRIES["stiction-limit-cycle"]
    bag = tmp_path / "sample" / "stiction-limit-cycle"
    shutil.copytree(BAGS / "sample" / "stiction-limit-cycle", bag)
    first = entry.rows[0]
    other = entry._replace(rows=[first | {"measured": 1.001 * first["measured"]}, *entry.rows[2:]])
    wrong = check(experiment, other, tmp_path)
    assert [line.split("'")[1] for line in wrong] == [row["quantity"] for row in entry.rows[:2]]
    with (bag / "metadata.yaml").open("a") as stream:
        stream.write("\n")
    (line,) = check(experiment, entry, tmp_path)
    assert "metadata.yaml differ from the index" in line


def test_an_index_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "index.yaml").write_text("samples: [{name: creep}]")
    with pytest.raises(ParameterError, match=r"is not an index of samples .*'wam experiment --samples make' writes it"):
        read_index(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"run": "walk"}, "no run is named 'walk'; choose from out_and_back"),
        ({"seconds": [3.0, 1.0]}, r"'seconds' is \[3.0, 1.0\]; it must be start and end"),
        ({"second": [1.0, 3.0]}, "unknown key 'second'"),
        ({"thinned": {"joint_sensors": 0}}, "'thinned' is .*; give each of some of the topics a number above 0"),
        ({"thinned": {"joint_sensor": 9}}, "'thinned' is .*; give each of some of the topics a number above 0"),
    ],
)
def test_a_declaration_that_is_none_is_refused(change: dict, message: str, tmp_path: Path) -> None:
    body = yaml.safe_load((ROOT / "config" / "experiments" / "creep.yaml").read_text())
    body["sample"] |= change
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(body))
    with pytest.raises(ParameterError, match=message):
        load(str(tmp_path / "mine.yaml"))


def test_a_sample_is_recorded_cut_judged_and_listed_by_one_command(
    tmp_path: Path, domain_id: int, monkeypatch, capfd
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bags").mkdir()
    shutil.copy(BAGS / "README.md", "bags")
    with pytest.raises(SystemExit) as ended:
        main(["experiment", "testbed-own-servo", "--samples", "make"])
    assert ended.value.code == 0
    assert "every sample is as the index lists it" in capfd.readouterr().out
    (entry,) = read_index(Path("bags")).values()
    assert all(row["is_whole"] for row in entry.rows)
    assert [row["quantity"] for row in entry.rows] == [row["quantity"] for row in ENTRIES["testbed-own-servo"].rows]
    assert entry.sha256["testbed-own-servo_0.mcap"][:16] in Path("bags/README.md").read_text()
    assert (
        np.diff(read(Path("bags/sample/testbed-own-servo")).topics["/wam/joint_sensors"].stamp_ns) == 1_000_000
    ).all()
    assert not Path("bags/recorded").exists()
