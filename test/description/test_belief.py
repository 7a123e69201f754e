"""Whom the nodes believe: nothing from the future, nothing stale, nothing of the past, nothing foreign."""

import dataclasses
from typing import Any

import pytest

from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Timing
from wam_description.configuration import Configuration, packaged
from wam_description.event import Level
from wam_description.interface import Interface, declared
from wam_description.nodes import NODES
from wam_description.signals import NodeStatus, State, Wrench
from wam_description.synchroniser import InputSpec, OutOfTime, Synchroniser
from wam_description.wiring import Inputs
from wam_driver.session import Session
from wam_sim.simulation import Simulation

WAM = Configuration.load(packaged("wam"))
MS = 1_000_000
NOW = 1_790_000_000_001_000_000  # ns, a time of the wall clock, at the begin of an outer period
REALTIME = dataclasses.replace(WAM.shared.timing, mode="realtime")
FEEDBACK = InputSpec(outer=True, limit_ns=40 * MS)
COMMAND = InputSpec(outer=True, streamed=False, limit_ns=200 * MS, is_command=True)
ZERO = (0.0, 0.0, 0.0)


class Realtime:
    """A step in realtime, with a state every 5 ms and one input."""

    def __init__(self, spec: InputSpec, timing: Timing = REALTIME) -> None:
        self.synchroniser = Synchroniser(timing, "state", {"input": spec})
        self.stamp = 0

    def state(self, count: int = 1) -> Any:
        """The input in the last of some steps."""
        for _ in range(count):
            self.stamp += 5 * MS
            (inputs,) = self.synchroniser.inlets["state"](self.stamp, "state")
        return inputs["input"]

    def give(self, value: str, stamp: int | None = None) -> None:
        assert list(self.synchroniser.inlets["input"](self.stamp if stamp is None else stamp, value)) == []


@pytest.mark.parametrize("spec", [FEEDBACK, COMMAND], ids=["feedback", "command"])
def test_an_input_of_the_future_is_refused_and_never_used(spec: InputSpec) -> None:
    node = Realtime(spec)
    node.state()
    for _ in range(2):
        with pytest.raises(OutOfTime, match="ahead of the newest state that this node has, 5000000 ns"):
            node.give("from the future", NOW)
    assert node.state() is None
    node.give("one")
    node.state()
    node.give("two")
    assert node.state() == "two"


def test_an_input_a_little_ahead_is_used_when_its_state_has_come() -> None:
    node = Realtime(FEEDBACK)
    node.state()
    node.give("now")
    node.give("ahead", node.stamp + 10 * MS)
    assert [node.state() for _ in range(3)] == ["now", "ahead", "ahead"]


@pytest.mark.parametrize("spec", [FEEDBACK, COMMAND], ids=["feedback", "command"])
def test_an_input_older_than_its_limit_is_absent(spec: InputSpec) -> None:
    node = Realtime(spec)
    for value in ("one", "two"):
        node.state()
        node.give(value)
    periods = spec.limit_ns // (5 * MS)
    assert node.state(periods) == "two"
    assert node.state() is None


def test_a_message_of_the_past_replaces_no_newer_one() -> None:
    node = Realtime(FEEDBACK)
    node.state(4)
    node.give("new")
    node.give("old", node.stamp - 5 * MS)
    assert node.state() == "new"


def test_a_single_command_does_nothing_and_a_stream_without_stamps_counts() -> None:
    node = Realtime(COMMAND)
    node.state()
    node.give("once", 0)
    assert node.state() is None
    node.give("twice", 0)
    assert node.state() == "twice"
    assert node.state(40) is None, "its age counts from its arrival"


def test_an_input_that_never_comes_is_as_old_as_the_first_state() -> None:
    arm = Realtime(FEEDBACK)
    for _ in range(2):
        arm.state(9)
        assert arm.synchroniser.ages() == {"input": 1.0}
        arm.synchroniser.restart()


def test_a_step_that_a_program_starts_has_the_states_of_another_step_as_its_clock() -> None:
    clock = Synchroniser(REALTIME, "state", {})
    step = Synchroniser(REALTIME, "command", {}, started=FEEDBACK._replace(streamed=False), clock=clock)
    with pytest.raises(OutOfTime, match="no stamp"):
        Synchroniser(REALTIME, "command", {}, started=FEEDBACK._replace(streamed=False)).inlets["command"](0, "")
    for now, stamp, used in (  # ms
        (5, 5, 5),
        (5, 5, 5),
        (5, 15, 15),
        (10, 12, None),
        (2000, 1959, "older than"),
        (2000, 2041, "ahead of"),
        (2000, 1990, 1990),
        (1, 1, 1),  # of a driver that has started again
    ):
        clock.restart()
        clock.inlets["state"](now * MS, "state")
        if isinstance(used, str):
            with pytest.raises(OutOfTime, match=f"{used}.*allowed: 0.04 s"):
                step.inlets["command"](stamp * MS, "")
        else:
            made = [inputs.stamp for inputs in step.inlets["command"](stamp * MS, "") if inputs.dt > 0.0]
            assert made == ([] if used is None else [used * MS])


def test_commands_from_before_the_brakes_were_switched_are_forgotten() -> None:
    node = Realtime(COMMAND)
    for value in ("one", "two"):
        node.state()
        node.give(value)
    node.synchroniser.discard_commands(node.stamp + MS)
    assert node.state() is None


@pytest.mark.parametrize("mode", ["realtime", "lockstep"])
def test_one_state_of_the_future_does_not_make_a_node_deaf(mode: str) -> None:
    node = Realtime(FEEDBACK._replace(streamed=False), dataclasses.replace(REALTIME, mode=mode))
    node.state()
    with pytest.raises(OutOfTime, match="ahead of the newest state"):
        node.synchroniser.inlets["state"](NOW, "foreign")
    node.state(3)
    assert node.synchroniser.strays == 1


def test_the_states_of_a_driver_that_starts_again_are_followed_at_the_second_one() -> None:
    node = Realtime(FEEDBACK)
    node.state(1000)
    node.give("of the driver before")
    node.stamp = 0
    assert list(node.synchroniser.inlets["state"](MS, "first")) == []
    (inputs,) = node.synchroniser.inlets["state"](2 * MS, "second")
    assert (inputs.stamp, inputs["input"]) == (2 * MS, None)


def test_a_session_lets_a_step_in_lockstep_begin_again_with_the_first_state() -> None:
    synchroniser = Synchroniser(dataclasses.replace(REALTIME, mode="lockstep"), "state", {"input": FEEDBACK})
    synchroniser.inlets["input"](6 * MS, "old")
    synchroniser.inlets["state"](6 * MS, "old")
    synchroniser.restart(MS)
    synchroniser.inlets["input"](MS, "new")
    (inputs,) = synchroniser.inlets["state"](MS, "first")
    assert (inputs["state"], inputs["input"]) == ("first", "new")
    synchroniser.restart(14 * MS)
    (inputs,) = synchroniser.inlets["state"](14 * MS, "in the midst of an outer period, whose answers are gone")
    assert inputs["input"] is None


def test_a_new_driver_takes_a_number_that_no_node_follows() -> None:
    session = Session(["gravity", "transform"])
    session.hear(NodeStatus(Level.OK, "ready", "gravity", session=7))
    session.begin()
    assert (session.number, session.silent) == (8, ["gravity", "transform"])
    for name in ("gravity", "transform"):
        session.hear(NodeStatus(Level.OK, "ready", name, session=8))
    assert session.silent == []


@pytest.mark.parametrize(("ages", "silent"), [
    ({"motor_effort_command": 1.02, "motor_velocity_command": 0.05}, ["gravity"]),
    ({"motor_effort_command": 1.02, "motor_velocity_command": 0.65}, ["gravity"]),  # transform is late, too
    ({"motor_effort_command": 0.05, "motor_velocity_command": 1.02}, ["force_loop"]),
    ({"motor_effort_command": 1.02, "motor_velocity_command": 0.8}, ["transform"]),
    ({"motor_effort_command": 2.5, "motor_velocity_command": 1.2}, ["gravity"]),
    ({"external_joint_torques": 1.0, "contact/hypotheses": 1.1}, ["contact_estimator"]),
])  # fmt: skip
def test_the_node_that_has_stopped_is_named(ages: dict[str, float], silent: list[str]) -> None:
    lost, nodes, others = Interface(WAM.shared).silent(ages)
    assert (nodes, others) == (silent, ["force_loop", "gravity"] * (silent == ["transform"]))
    assert (len(lost) == 2) is (silent in (["transform"], ["contact_estimator"]))


CHAIN: dict[str, list[str]] = {
    "velocity_loop": ["motor_effort_command", "motor_velocity_command"],
    "transform": ["joint_effort_command", "joint_velocity_command"],
    "gravity": [],
    "force_loop": [],
    "contact_estimator": [],
}


@pytest.mark.parametrize(
    ("awaited", "found"),
    [
        (CHAIN, {"force_loop": ["joint_effort_command", "joint_velocity_command"]}),
        ({**CHAIN, "velocity_loop": []}, {"velocity_loop": ["motor_current_command"]}),
        (
            {**CHAIN, "velocity_loop": ["motor_effort_command"], "transform": ["gravity_effort"]},
            {"gravity": ["gravity_effort"]},
        ),
        ({**CHAIN, "force_loop": ["contact/hypotheses"]}, {"contact_estimator": ["contact/hypotheses"]}),
    ],
)  # fmt: skip
def test_the_node_that_lacks_nothing_and_did_not_answer_is_named(
    awaited: dict[str, list[str]], found: dict[str, list[str]]
) -> None:
    assert Interface(WAM.shared).unanswered(["motor_current_command"], awaited) == found


def test_a_session_that_only_a_status_announces_forgets_nothing() -> None:
    synchroniser = Synchroniser(dataclasses.replace(REALTIME, mode="lockstep"), "state", {"input": FEEDBACK})
    synchroniser.inlets["state"](6 * MS, "waiting")
    assert synchroniser.awaited(6 * MS) == ["input"]
    synchroniser.follow(MS)  # anybody can send that
    (inputs,) = synchroniser.inlets["input"](6 * MS, "its input")
    assert (inputs["state"], inputs["input"]) == ("waiting", "its input")
    assert synchroniser.awaited(6 * MS) == []
    assert synchroniser.awaited(11 * MS) == ["state"]


def test_a_session_that_a_state_confirms_begins_with_it_and_with_what_came_before_it() -> None:
    synchroniser = Synchroniser(dataclasses.replace(REALTIME, mode="lockstep"), "state", {"input": FEEDBACK})
    synchroniser.inlets["state"](6 * MS, "of the driver before")
    synchroniser.follow(MS)
    assert list(synchroniser.inlets["input"](MS, "early")) == []
    (inputs,) = synchroniser.inlets["state"](MS, "first")
    assert (inputs["state"], inputs["input"]) == ("first", "early")


def test_a_driver_sees_that_another_one_has_begun_a_session() -> None:
    session = Session(["gravity"])
    session.begin()
    session.hear(NodeStatus(Level.OK, "ready", "gravity", session=999))
    assert session.is_overtaken
    session.begin()
    assert (session.number, session.is_overtaken) == (1000, False)


def test_every_input_of_the_stack_says_how_old_it_may_be_and_what_its_absence_means() -> None:
    for name in NODES:
        for reaction in declared(name).reactions:
            for item in reaction.inputs:
                assert item.age in ("feedback", "command"), item
                assert item.absent in ("hold", "zero", "brake"), item
                is_command = not Interface(WAM.shared).is_streamed(item.topic)
                assert (item.age == "command") is (is_command and item.topic != "joint_effort_command"), item


class Intruder:
    """A node of the simulation that publishes one message, beside the node that is declared for the topic."""

    def __init__(self, run: Simulation) -> None:
        self.run = run

    def send(self, topic: str, stamp: int, value: Any) -> int:
        """Give a message to the inputs of every node; how many refused it."""
        refused = 0
        for synchroniser in {one for found in self.run._synchronisers.values() for one in found}:
            try:
                assert list(synchroniser.inlets[topic](stamp, value)) == []
            except OutOfTime:
                refused += 1
            except KeyError:  # the step does not take this topic
                continue
        return refused


@pytest.fixture
def enabled() -> Simulation:
    """An enabled arm at rest; nobody commands."""
    run = Simulation(WAM, [ScenarioStep("release", 0.3, request="enable"), ScenarioStep("hold", 10.0)])
    while run.driver.stamp < 200 * MS:
        run.step()
    return run


@pytest.mark.parametrize(("topic", "value"), [
    ("joint_velocity_command", State([], [0.5, 0.0, 0.0, 0.0], [])),
    ("motor_velocity_command", State([], [15.0, 0.0, 0.0, 0.0], [])),
    ("force_command", Wrench("outer_link", (0.0, -10.0, 0.0), ZERO)),
])  # fmt: skip
def test_a_message_with_a_stamp_of_the_wall_clock_is_refused_and_moves_nothing(
    topic: str, value: Any, enabled: Simulation
) -> None:
    before = enabled.driver.plant.q
    assert Intruder(enabled).send(topic, NOW, value) > 0
    while enabled.driver.stamp < 700 * MS:
        enabled.step()
    assert enabled.driver.safety.fault == ""
    assert enabled.driver.plant.q == pytest.approx(before, abs=2e-3)


def test_a_state_with_a_stamp_of_the_wall_clock_does_not_stop_the_arms_time(enabled: Simulation) -> None:
    Intruder(enabled).send("motor_states", NOW, enabled.driver.motor_state)
    while enabled.driver.stamp < 400 * MS:
        enabled.step()
    answered = [row.stamp for row in enabled.rows["motor_current_command"]]
    assert answered[-100:] == list(range(answered[-1] - 99 * MS, answered[-1] + MS, MS))


def test_the_force_ends_where_nobody_measures_it() -> None:
    """Feedback of an estimator that has stopped: no force is commanded, so that it cannot grow."""
    values = {"force_loop:feedback": "contact_estimate", "force_loop:guard.mode": "off"}
    node: Any = declared("force_loop").node
    configured = WAM.with_values(values)
    loop = node(configured.shared, configured.node("force_loop", declared("force_loop").parameter_class))
    assert loop.needs == {"external_joint_torques", "contact/hypotheses"}
    state = (5 * MS, State([0.0, -1.8, 0.0, 1.45], [0.0] * 4, [1.0] * 4))
    force = (5 * MS, Wrench("outer_link", (0.0, -10.0, 0.0), ZERO))
    out = loop.step(Inputs.of(5 * MS, 0.005, {"joint_states": state, "force_command": force}))
    assert not any(out["joint_effort_command"].effort)
    assert not any(out["joint_velocity_command"].velocity)
