"""The evaluation of faults: broken inputs are broken as described, and what escapes is noticed."""

import dataclasses
import math
import os
import subprocess
import sys
from random import Random
from typing import Any

import pytest
from conftest import LONG
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError, build, fields, values
from wam_description.signals import State
from wam_ros.messages import joint_state
from wam_studies.faults.message_faults import MESSAGE_FAULTS, MessageFault, broken
from wam_studies.faults.messages import play_flood
from wam_studies.faults.parameter_sets import parameter_set
from wam_studies.faults.soak import SoakStudy
from wam_studies.faults.study import KINDS, FaultStudy
from wam_studies.faults.trials import FAULTS, KEPT, FaultCase, FaultTrial
from wam_studies.faults.watched_stack import WatchedStack, watched_trial

CONFIGURATION = Configuration.load(packaged("wam"))
NOW = 5_000_000_000


def fault(name: str) -> MessageFault:
    return next(one for one in MESSAGE_FAULTS if one.name == name)


def message() -> Any:
    return joint_state(NOW, ["joint1", "joint2"], State([0.1, 0.2], [0.3, 0.4], []))


def broken_message(name: str, seed: int) -> Any:
    data = broken(message(), fault(name), Random(seed), NOW, lambda one: bytes(serialize_message(one)))
    assert data is not None
    return deserialize_message(data, JointState)


def test_every_fault_changes_a_message_unless_it_means_the_same() -> None:
    whole = bytes(serialize_message(message()))
    for one in MESSAGE_FAULTS:
        made = {broken(message(), one, Random(seed), NOW, lambda m: bytes(serialize_message(m))) for seed in range(20)}
        if one.name not in ("the same message again", "names in another order", "an extreme integer"):
            assert whole not in made, one.name
    found = broken_message("names in another order", 3)
    assert dict(zip(found.name, found.position, strict=True)) == {"joint1": 0.1, "joint2": 0.2}


def test_the_same_seed_breaks_a_message_in_the_same_way() -> None:
    for one in MESSAGE_FAULTS:  # as text, because CDR has padding that nobody sets
        first, again = (broken(message(), one, Random(7), NOW, lambda m: str(m).encode()) for _ in "12")
        assert first == again


def test_stamps_of_the_future_are_later_and_of_the_past_earlier() -> None:
    for one in MESSAGE_FAULTS:
        if one.name.startswith("a stamp of the "):
            stamp = broken_message(one.name, 5).header.stamp
            later = stamp.sec * 1_000_000_000 + stamp.nanosec > NOW
            assert later == one.name.startswith("a stamp of the future"), one.name


def test_sets_that_must_be_refused_are_refused_by_the_parameter_classes() -> None:
    present, seen = values(CONFIGURATION.shared), set()
    known = [one._replace(live=True) for one in fields(Shared)]
    for seed in range(300):
        found = parameter_set(known, present, Random(seed))
        seen.add(found.name)
        changed = {one.name: tuple(v) if isinstance(v := one.value, list) else v for one in found.assignments}
        given = [v for value in changed.values() for v in (value if isinstance(value, tuple) else [value])]
        if found.is_wrong:
            assert len(changed) == len(found.assignments), "no name comes twice"
        # the classes take whole numbers for others, and have no type codes; ROS refuses these
        if found.is_wrong and not found.name.startswith("an unknown") and not all(isinstance(v, int) for v in given):
            with pytest.raises(ParameterError):
                build(Shared, {**present, **changed})
    assert len(seen) == 8


def trial(kind: str, *escapes: str) -> FaultTrial:
    return FaultTrial(kind, "a fault", 10, escapes, 0.002, 1.5, 0.042 if kind == "losses" else math.nan)


def test_escapes_are_counted_by_kind_and_each_is_listed() -> None:
    study = FaultStudy(CONFIGURATION)
    records = [trial("messages", "the arm moved"), trial("messages"), trial("losses")]
    scores = study.score(records)
    assert scores.missed == ["trials with an escape: 1, required 0"]
    (table,) = scores.tables
    assert table.rows == [
        ["messages", "2", "20", "1", "0.002", "1.5", "–"],
        ["losses", "1", "10", "0", "0.002", "1.5", "42"],
    ]
    assert [study.failure(one) for one in records] == ["messages, a fault: the arm moved", "", ""]


def test_cases_are_the_trials_of_each_kind() -> None:
    found = list(FaultStudy(CONFIGURATION, kinds=("parameters", "losses"), trials=2).cases(3))
    names = [f"{kind} {number}, seed 3" for kind in ("parameters", "losses") for number in (0, 1)]
    assert [str(case) for case in found] == names
    assert all(case.configuration.shared.timing.mode == "lockstep" for case in found)


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


def test_a_node_that_ends_is_an_escape_and_the_next_trial_has_all_nodes(
    domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    case = FaultCase(in_lockstep(), "planted", 1, 0)

    def end_a_node(stack: WatchedStack) -> int:
        stack.commander.node.create_timer(0.001, lambda: 1 // 0)  # a node without tolerance
        stack.wait(lambda: False)
        return 1

    ended = watched_trial(case, "planted", end_a_node)
    assert "a node ended: ZeroDivisionError" in ended.escapes[0]
    assert watched_trial(case, "nothing", lambda stack: 1).escapes == ()
    KEPT.discard()


@pytest.mark.parametrize(("allowed", "text"), [(FAULTS.stopped, ""), (0.0, "no answer to an emergency stop within")])
def test_an_emergency_stop_that_is_answered_late_in_a_flood_is_an_escape(
    allowed: float, text: str, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    monkeypatch.setattr("wam_studies.faults.messages.FAULTS", dataclasses.replace(FAULTS, stopped=allowed))
    flooded = play_flood(FaultCase(in_lockstep(), "floods", 1, 0))
    KEPT.discard()
    assert flooded.delay > 0.0
    assert bool(flooded.escapes) is bool(text)
    assert text in "".join(flooded.escapes)


@pytest.mark.slow
def test_nothing_escapes_from_a_trial_of_each_kind_in_one_process(domain_id: int) -> None:
    kinds = [name for name in KINDS if not name.startswith("losses")]
    command = [
        sys.executable,
        "-m",
        "wam_cli.main",
        "evaluate",
        "faults",
        "--fresh",
        "--trials",
        "2",
        "--kinds",
        *kinds,
    ]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=2 * LONG, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr[-2000:]}"


@pytest.mark.slow
def test_a_short_soak_loses_nothing(domain_id: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    study = SoakStudy(in_lockstep(), seconds=4.0)
    found = [study.run(case) for case in study.cases(1)]
    assert study.score(found).missed == []
    assert study.failure(found[0]) == ""
    assert found[0].seconds > 3.0
    assert found[0].messages > 10_000
