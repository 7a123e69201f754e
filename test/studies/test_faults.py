"""The evaluation of faults: broken inputs are broken as described, and what escapes is noticed."""

import os
import subprocess
import sys
from random import Random
from typing import Any

import pytest
from conftest import LONG

from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError, build, fields, values
from wam_ros.messages import joint_state
from wam_studies.faults.message_faults import MESSAGE_FAULTS, MessageFault, big_endian, broken, leaves
from wam_studies.faults.page import faults_section, report
from wam_studies.faults.parameter_faults import UNKNOWN_CODES, parameter_set
from wam_studies.faults.trials import FAULTS, FaultKind, FaultTrial, KindResult, played
from wam_studies.faults.watched_stack import StackSource, WatchedStack

CONFIGURATION = Configuration.load(packaged("wam"))
NOW = 5_000_000_000


def fault(name: str) -> MessageFault:
    return next(one for one in MESSAGE_FAULTS if one.name == name)


def message() -> Any:
    from wam_description.signals import State

    return joint_state(NOW, ["joint1", "joint2"], State([0.1, 0.2], [0.3, 0.4], []))


def broken_message(name: str, seed: int) -> Any:
    from rclpy.serialization import deserialize_message, serialize_message
    from sensor_msgs.msg import JointState

    data = broken(message(), fault(name), Random(seed), NOW, lambda one: bytes(serialize_message(one)))
    assert data is not None
    return deserialize_message(data, JointState)


def test_every_fault_changes_a_message_unless_it_means_the_same() -> None:
    from rclpy.serialization import serialize_message

    whole = bytes(serialize_message(message()))
    for one in MESSAGE_FAULTS:
        made = {broken(message(), one, Random(seed), NOW, lambda m: bytes(serialize_message(m))) for seed in range(20)}
        if one.name not in ("the same message again", "names in another order", "an extreme integer"):
            assert whole not in made, one.name


def test_the_same_seed_breaks_a_message_in_the_same_way() -> None:
    for one in MESSAGE_FAULTS:  # as text, because CDR has padding that nobody sets
        first, again = (broken(message(), one, Random(7), NOW, lambda m: str(m).encode()) for _ in "12")
        assert first == again


def test_a_message_of_the_other_byte_order_means_the_same() -> None:
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    assert deserialize_message(big_endian(message()), JointState) == message()


def test_names_in_another_order_keep_their_values() -> None:
    found = broken_message("names in another order", 3)
    assert dict(zip(found.name, found.position, strict=True)) == {"joint1": 0.1, "joint2": 0.2}


def test_stamps_of_the_future_are_later_and_of_the_past_earlier() -> None:
    for one in MESSAGE_FAULTS:
        if one.name.startswith("a stamp of the "):
            stamp = broken_message(one.name, 5).header.stamp
            later = stamp.sec * 1_000_000_000 + stamp.nanosec > NOW
            assert later == one.name.startswith("a stamp of the future"), one.name


def test_leaves_are_the_fields_that_are_no_messages() -> None:
    assert [leaf.name for leaf in leaves(message())] == [
        "sec", "nanosec", "frame_id", "name", "position", "velocity", "effort",
    ]  # fmt: skip


def test_sets_that_must_be_refused_are_refused_by_the_parameter_classes() -> None:
    shared = CONFIGURATION.shared
    present = values(shared)
    known = [one._replace(live=True) for one in fields(Shared)]
    seen = set()
    for seed in range(300):
        found = parameter_set(known, present, Random(seed))
        seen.add(found.name)
        names = [one.name for one in found.assignments]
        if (
            not found.is_wrong
            or found.name == "an unknown name"
            or {*UNKNOWN_CODES} & {a.code for a in found.assignments}
        ):
            continue
        changed = {one.name: tuple(v) if isinstance(v := one.value, list) else v for one in found.assignments}
        if all(
            isinstance(v, int) for value in changed.values() for v in (value if isinstance(value, tuple) else [value])
        ):
            continue  # the classes take whole numbers for others; ROS does not
        with pytest.raises(ParameterError):
            build(Shared, {**present, **changed})
        assert len(names) == len(set(names))
    assert len(seen) == 8


def result(*escapes: str) -> KindResult:
    trials = [FaultTrial(3, "a fault", 10, escapes, 0.002, 1.5), FaultTrial(4, "a loss", 1, (), 0.001, 0.5, 0.042)]
    return KindResult("messages", "messages", 1, trials, 2.0)


def test_the_report_counts_and_says_how_to_repeat_an_escape() -> None:
    text = report([result("the arm moved")])
    assert "11 messages" in text
    assert "wam evaluate faults --only messages --count 1 --seed 1 --first 3" in text
    assert "42" in text
    assert "--only" not in report([result()])


def test_a_kind_is_stopped_after_many_escapes() -> None:
    def play(configuration: Any, seed: int, first: int, count: int) -> Any:
        yield from (FaultTrial(i, "bad", escapes=("it escaped",)) for i in range(first, first + count))

    kind = FaultKind("bad", "", "trials", 100, 1, play)
    assert len(played(kind, CONFIGURATION, 1, 0, 100, lambda: 0.0).trials) == FAULTS.most_escapes


def test_kinds_that_were_not_played_keep_their_rows() -> None:
    first = faults_section([result()], "a", "")
    others = faults_section([result()._replace(kind="bags", unit="bags")], "b", first)
    again = faults_section([result("the arm moved")], "c", others)
    assert [line.split("|")[1:4] for line in again.splitlines()[4:]] == [
        [" messages ", " 11 messages ", " 1 "],
        [" bags ", " 11 bags ", " 0 "],
    ]


# what is watched, on the nodes


def in_lockstep(**more: object) -> Configuration:
    return CONFIGURATION.with_values({"timing.mode": "lockstep", **more})


def test_what_escapes_is_noticed(domain_id: int) -> None:
    with WatchedStack(in_lockstep(), domain_id) as stack:
        assert stack.begin() == ""
        stack.run(0.02)
        assert stack.escapes == []
        own = stack.own_publisher("gravity_effort", Random(1))
        assert own is not None
        wrong = stack.newest("gravity_effort")
        wrong.effort = [float("nan")] * 4
        own.publish(wrong)
        stack.run(0.01)
        assert stack.escapes == ["gravity_effort has effort not finite"]
        stack.begin()
        stack.driver.plant.push("outer_link", [0.0, 300.0, 0.0], [0.0, 0.0, 0.0])
        stack.run(0.1)
        assert stack.escapes == ["the arm pressed without a command", "the arm moved without a command"]
        assert stack.begin() == ""
        stack.nodes["gravity"].create_timer(0.001, lambda: 1 // 0)
        stack.wait(lambda: stack.escapes)
        assert "unexpected ZeroDivisionError" in stack.escapes[0]


def test_a_node_that_ends_is_an_escape_and_the_next_trial_has_all_nodes(domain_id: int) -> None:
    with StackSource(in_lockstep()) as source:

        def end_a_node(stack: WatchedStack) -> int:
            stack.commander.create_timer(0.001, lambda: 1 // 0)  # a node without tolerance
            stack.wait(lambda: False)
            return 1

        ended = source.trial(0, "planted", end_a_node)
        assert "a node ended: ZeroDivisionError" in ended.escapes[0]
        assert source.trial(1, "nothing", lambda stack: 1).escapes == ()


@pytest.mark.slow
def test_nothing_escapes_in_the_short_form(domain_id: int) -> None:
    command = [sys.executable, "-m", "wam_cli.main", "evaluate", "faults", "--short", "--seed", "1"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=2 * LONG, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr[-2000:]}"


@pytest.mark.slow
def test_ctrl_c_leaves_nothing(domain_id: int) -> None:
    from wam_studies.faults import interruptions

    assert [trial.escapes for trial in interruptions.play(1, 1, 1)] == [()]


@pytest.mark.slow
def test_a_short_soak_loses_nothing(domain_id: int) -> None:
    from wam_studies.faults.soak import soak

    seconds: list[int] = []
    found = soak(in_lockstep(), 4.0, lambda done, of: seconds.append(done))
    assert found.missed == []
    assert found.seconds > 3.0
    assert found.messages > 10_000
    assert "lost messages | none" in found.section("make soak")
