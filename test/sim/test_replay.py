"""Recorded inputs through the same machines: bit for bit, and the first difference where there is one."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_samples import Sample, messages_of
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from wam_bag.bag import BagError, read
from wam_bag.bag_writer import BagWriter
from wam_bag.metadata import offered
from wam_cli import main as cli
from wam_cli.commands.replay import other_values
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.status import CHANGES
from wam_ros.ros_topics import stamp_of
from wam_ros.testing import RunningArm, playing
from wam_sim.recorded_run import recorded_run
from wam_sim.replay import REPLAYED, replay

STEPS = {
    "steps": [
        {"name": "release", "seconds": 0.05, "request": "enable"},
        {
            "name": "move and be pushed",
            "seconds": 0.35,
            "posture": [0.1, -0.3, 0.05, 0.2],
            "push": {
                "cover": "outer_link",
                "contact_position": 0.28,
                "newtons": [0.0, 12.0, 0.0],
                "begin": 0.05,
                "end": 0.3,
            },
        },
        {"name": "softer", "seconds": 0.05, "set": {"force_loop": {"posture_gain": 4.0}}},
        {"name": "press", "seconds": 0.05, "force": {"frame": "outer_link", "newtons": [0.0, -5.0, 0.0]}},
    ]
}
QOS = offered(7)


RECORDED: list[Path] = []
Changes = Iterable[tuple[int, str, dict[str, Any]]]  # not before, ns; node, parameters


@pytest.fixture
def bag(tmp_path_factory: pytest.TempPathFactory, domain_id: int) -> Path:
    """Half a second of the arm, recorded in lockstep; once, because nobody changes it."""
    if not RECORDED:
        RECORDED.append(recorded(tmp_path_factory.mktemp("replay"), domain_id))
    return RECORDED[0]


def recorded(folder: Path, domain_id: int, changes: Changes = (), **values: Any) -> Path:
    stack = RunningArm(domain_id, folder).start(configuration=playing(STEPS["steps"], folder, **values))
    waiting = list(changes)

    def change(message: JointState) -> None:
        if waiting and stamp_of(message) > waiting[0][0]:
            _, node, given = waiting.pop(0)
            parameters = [Parameter(name, value=value) for name, value in given.items()]
            assert all(found.successful for found in stack.nodes[node].set_parameters(parameters))

    stack.nodes["scenario"].create_subscription(JointState, "joint_states", change, 10)
    return stack.play().path


def copied(writer: BagWriter, samples: Sequence[Sample], bag: Path | None = None) -> None:
    """Write messages, and the topics of a bag even where none of their messages is left."""
    types = {one.topic: one.type for one in samples} | (read(bag).types if bag else {})
    for name, kind in types.items():
        writer.add_topic(name, kind, QOS)
    for k, one in enumerate(samples):
        writer.write(one.topic, one.data, one.time, one.time, k)
    if bag:
        contents = read(bag)
        writer.attach("parameters.yaml", "application/yaml", contents.attachments["parameters.yaml"])
        writer.metadata("recording", contents.metadata["recording"])


def without_messages(bag: Path, to: Path, topic: str, word: bytes) -> Path:
    """The same bag without the messages of a topic that hold a word."""
    with BagWriter(to) as writer:
        copied(writer, [one for one in messages_of(bag) if one.topic != topic or word not in one.data], bag)
    return to


def changed(
    bag: Path, to: Path, topic: str, number: int, change: bytes, without: tuple[str, range] = ("", range(0))
) -> Path:
    """The same bag with the last bytes of one message replaced, some messages of a topic left out."""
    samples = messages_of(bag)
    left_out = [sample for sample in samples if sample.topic == without[0]]
    left_out = [sample for k, sample in enumerate(left_out) if k in without[1]]
    for one in [sample for sample in samples if sample.topic == topic][number : number + 1]:
        samples[samples.index(one)] = one._replace(data=one.data[: -len(change)] + change)
    with BagWriter(to) as writer:
        copied(writer, [sample for sample in samples if sample not in left_out], bag)
    return to


NOT_THERE = ("task_axes", "contact/tracked_friction")  # no task is in it, and its joint sensors lie behind the friction


@pytest.mark.parametrize("node", REPLAYED)
def test_a_lockstep_recording_replays_bit_for_bit(bag: Path, node: str) -> None:
    done = replay(bag, node)
    assert done.mode == "lockstep"
    assert [topic for topic in done.topics if not topic.is_same] == []
    counts = {topic.compared for topic in done.topics if topic.topic not in NOT_THERE}
    assert counts <= {501, 101, 11}  # inner, outer, display rate
    assert counts
    assert done.is_same


def test_gains_that_were_changed_at_any_time_replay_with_their_change(tmp_path: Path, domain_id: int) -> None:
    changes = [
        (100_000_000, "force_loop", {"posture_gain": 3.3, "contact_source": "pinned"}),
        (300_000_000, "force_loop", {"posture_gain": 2.9, "contact_source": "estimated"}),
    ]
    bag = recorded(tmp_path, domain_id, changes)
    for node in ("force_loop", "velocity_loop"):
        done = replay(bag, node)
        assert [topic for topic in done.topics if not topic.is_same] == []
        assert done.lost == ()
    run = recorded_run(read(bag))
    (begin, first), (later, third), (_, softer) = run.changes("force_loop").items()
    assert [value for _, value in sorted(first.items())] == ["pinned", 3.3]
    assert softer == {"force_loop:posture_gain": 4.0}
    assert third == {"force_loop:posture_gain": 2.9, "force_loop:contact_source": "estimated"}
    assert 0 < begin < later
    silent = without_messages(bag, tmp_path / "silent", "/wam/status", CHANGES.encode())
    assert not replay(silent, "force_loop").is_same, "as it was before the nodes reported what they took"


def test_an_arm_without_joint_sensors_replays_too(tmp_path: Path, domain_id: int) -> None:
    without: dict[str, Any] = {
        "arm": {"joint_sensors": False},
        "force_loop": {"feedback": "contact_estimate", "force_gain": [0.01]},
        "contact_estimator": {"use_joint_sensors": False},
    }
    bag = recorded(tmp_path, domain_id, **without)
    assert "/wam/joint_sensors" not in read(bag).topics
    for node in ("velocity_loop", "force_loop", "contact_estimator"):
        done = replay(bag, node)
        assert [topic.topic for topic in done.topics if not topic.is_same] == []
        assert sum(topic.compared for topic in done.topics) > 500


def test_the_pushed_arm_says_something(bag: Path) -> None:
    wrench = read(bag, ["contact/wrench"]).topics["/wam/contact/wrench"]
    assert np.abs(wrench.force).max() > 1.0, "a replay of zeros would show nothing"


def test_a_configuration_that_differs_from_the_recording_is_reported_with_the_values(bag: Path) -> None:
    """Who replays with a configuration means one value of it; the others change the result, too."""
    other = {"contact_estimator:use_joint_sensors": False, "arm.gravity": [0.0, 0.0, -9.7]}
    configuration = Configuration.load(packaged("wam")).with_values(other)
    done = replay(bag, "contact_estimator", configuration)
    assert {one.name for one in done.changed} >= {"contact_estimator:use_joint_sensors", "arm.gravity"}
    (line,) = other_values(done)
    assert line.startswith("--config differs from the recording in contact_estimator:use_joint_sensors=false, ")
    assert line.endswith("to keep a recorded value: --set contact_estimator:use_joint_sensors=true")
    assert "arm.gravity" in line
    assert replay(bag, "contact_estimator").changed == ()


@pytest.mark.parametrize(("node", "value", "topic"), [
    ("velocity_loop", {"servo.integral_gain": [2.5, 2.0, 2.0, 1.0]}, "motor_current_command"),
    ("force_loop", {"force_loop:posture_gain": 4.5}, "joint_velocity_command"),
    ("contact_estimator", {"contact_estimator:observer.time_constant": 0.03}, "external_joint_torques"),
    ("gravity", {"arm.gravity": [0.0, 0.0, -9.81]}, "gravity_effort"),
])  # fmt: skip
def test_another_parameter_makes_a_difference_that_is_named(bag: Path, node: str, value: dict, topic: str) -> None:  # type: ignore[type-arg]
    configuration = Configuration.load(packaged("wam")).with_values(value)
    done = replay(bag, node, configuration)
    found = {result.topic: result for result in done.topics}[topic]
    assert replay(bag, node, values=value).topics == done.topics, "as with a configuration that has it"
    assert not done.is_same
    assert found.different > 0
    assert found.first is not None
    assert found.largest > 0.0
    same = replay(bag, node, Configuration.load(packaged("wam")))
    assert same.is_same, "although a recorder and a scenario ran, which are not among its nodes"
    assert same.changed == ()


def test_the_last_bit_of_one_number_is_found(bag: Path, tmp_path: Path) -> None:
    efforts = read(bag).topics["/wam/gravity_effort"]
    wrong = np.nextafter(efforts.effort[40, 3], 1e9)
    other = changed(bag, tmp_path / "other", "/wam/gravity_effort", 40, wrong.tobytes())
    (topic,) = replay(other, "gravity").topics
    assert (topic.compared, topic.different) == (101, 1)
    assert topic.first == (int(efforts.stamp_ns[40]), "joint4", float(wrong), float(efforts.effort[40, 3]))
    assert 0.0 < topic.largest < 1e-12
    assert topic.unit == "N m"


def test_a_missing_input_is_named(bag: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "part") as writer:
        copied(writer, messages_of(bag, "/wam/gravity_effort")[:1])
        writer.attach("parameters.yaml", "application/yaml", read(bag).attachments["parameters.yaml"])
    with pytest.raises(BagError, match="part lacks the topic joint_states, without which gravity does nothing"):
        replay(tmp_path / "part", "gravity")
    with pytest.raises(BagError, match="part lacks the topic motor_states, without which velocity_loop does nothing"):
        replay(tmp_path / "part", "velocity_loop")


@pytest.mark.parametrize("topic", ["motor_states", "motor_effort_command", "motor_current_command"])
def test_a_topic_that_had_another_type_is_named_and_not_left_out(tmp_path: Path, topic: str) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic(f"/wam/{topic}", "std_msgs/msg/Bool", QOS)
        bag.write(f"/wam/{topic}", b"\0\1\0\0\1", 1, 1, 1)
    with pytest.raises(BagError, match=rf"/wam/{topic} was recorded as std_msgs/msg/Bool; this version has it as sen"):
        replay(tmp_path / "bag", "velocity_loop")


def test_a_comparison_of_nothing_is_no_success() -> None:
    with pytest.raises(BagError, match="velocity_loop publishes nothing from these inputs"):
        replay(Path(__file__).parents[2] / "bags/sample/force-accuracy", "velocity_loop")


def test_parameters_that_are_not_in_the_bag_are_asked_for(bag: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bare") as writer:
        copied(writer, messages_of(bag, "/wam/joint_states", "/wam/gravity_effort"))
    with pytest.raises(BagError, match=r"no parameters.yaml in the bag; give a configuration with --config"):
        replay(tmp_path / "bare", "gravity")
    assert replay(tmp_path / "bare", "gravity", Configuration.load(packaged("wam"))).is_same
    with pytest.raises(BagError, match=r"recorded are joint1, joint2, joint3, joint4; the configuration has joint1$"):
        replay(tmp_path / "bare", "gravity", Configuration.load(packaged("testbed")))


def test_a_hole_in_an_input_is_named(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stamps = read(bag, ["joint_states"]).topics["/wam/joint_states"].stamp_ns  # type: ignore[union-attr]
    hole = changed(bag, tmp_path / "hole", "", 0, b"x", without=("/wam/joint_states", range(40, 50)))
    with pytest.raises(SystemExit) as ended:
        cli.main(["replay", str(hole), "gravity"])
    assert ended.value.code == 1
    said = capsys.readouterr().out
    assert "INCOMPLETE: The recorder received 10 messages (10 of /wam/joint_states) that are not in the bag." in said
    assert f"first message that was only recorded: at {stamps[40] / 1e9:.9f} s" in said
    assert "where an input was lost, gravity has no output" in said


def test_a_parameter_that_cannot_be_set_is_refused_as_one_of_the_option(bag: Path) -> None:
    for name, value, said in (
        ("force_loop:gain", 1.0, "--set force_loop:gain: node 'force_loop' has no parameter 'gain'"),
        ("nonsense", 1.0, "--set nonsense: no node has parameter"),
        ("force_lop:force_gain", 1.0, "no parameter 'force_gain' in .*; did you mean 'force_loop:force_gain'"),
        ("force_loop:force_gain", -1.0, "--set: parameter 'force_gain' is -1.0 m/s/N; allowed: 0 to 100"),
        ("timing.period", "fast", "--set: parameter 'timing.period' is 'fast'"),
        ("timing.period", 0.002, "timing.period is 0.002 s; in a replay it must be 0.001 s, as recorded"),
    ):
        with pytest.raises(ParameterError, match=said):
            replay(bag, "gravity", values={name: value})


def test_the_command_prints_each_topic_and_says_by_its_code(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match=r"^0$"):
        cli.main(["replay", str(bag), "transform"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "joint_states: 101 messages, the same bit for bit"
    assert not any("nothing changed" in line for line in lines)
    with pytest.raises(SystemExit, match=r"^0$"):
        cli.main(["replay", str(bag), "gravity", "--set", "force_loop:force_gain=[0.01]"])
    assert "nothing changed with force_loop:force_gain=[0.01]: " in capsys.readouterr().out.splitlines()[-1]
    with pytest.raises(SystemExit) as ended:
        cli.main(["replay", str(bag), "gravity", "--config", "wam"])
    assert ended.value.code == 0
    assert "differs from the recording" not in capsys.readouterr().out
    for config in ([], ["--config", "wam"]):
        with pytest.raises(SystemExit) as ended:
            cli.main(["replay", str(bag), "gravity", "--set", "arm.gravity=[0.0, 0.0, -9.7]", *config])
        assert ended.value.code == 1
        assert "differ (" in capsys.readouterr().out
