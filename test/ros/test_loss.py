"""What an enabled arm does where a node of the chain stops, another one speaks for it, or the driver starts again."""

import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest
from conftest import LONG
from ros_network import Network
from test_nodes import ARM, MS, SIX, Listener, changed, make

from wam_description.arm import Shared
from wam_description.event import Level
from wam_description.parameters import Nothing
from wam_description.signals import NodeStatus, State
from wam_description.topics import BY_NAME
from wam_description.wiring import Input, Inputs, Outputs, reaction
from wam_driver.safety import Mode
from wam_ros.long_steps import LongStep, Steps
from wam_ros.messages import diagnostic_status, joint_state, message_type
from wam_ros.ros_topics import qos, stamp_of
from wam_studies.faults.answered_clock import AnsweredClock

LIMIT = 50 * MS  # ns of the arm's time, from the last answer of a node to zero current


class Stack:
    """The six nodes in this process; the arm is enabled."""

    def __init__(self, ros: Network, folder: Path, mode: str, **values: Any) -> None:
        self.ros, self.folder, self._clock = ros, folder, AnsweredClock(MS * 1e-9)
        self.values = {"timing__mode": mode, "timing__timeout": 2.0, **values}
        self._frozen: list[tuple[Any, Any, list[Any]]] = []
        others = [name for name in SIX if name != "driver"]
        configured = changed(SIX, **self.values)
        self.nodes = {name: make(ros, folder, name, "/wam", configured) for name in others}
        self.start_driver()
        row = BY_NAME["motor_current_command"]
        self._answers = ros.node("watch").create_subscription(message_type(row), row.name, self._take_answer, qos(row))
        self._heard = Listener(ros, "motor_states")
        self.enable()

    def start_driver(self) -> None:
        """In realtime a period passes with each answer, so that no node is late on a busy machine."""
        with self._clock.of_new_nodes(self.values["timing__mode"]):
            self.nodes["driver"] = make(self.ros, self.folder, "driver", "/wam", changed(SIX, **self.values))

    def _take_answer(self, command: Any) -> None:
        if stamp_of(command) >= self.driver.stamp:
            self._clock.advance()

    @property
    def driver(self) -> Any:
        return self.nodes["driver"].driver

    @property
    def fault(self) -> str:
        return str(self.driver.safety.fault)

    def wait_periods(self, count: int) -> None:
        begin = self.driver.stamp
        self.ros.wait(lambda: self.driver.stamp >= begin + count * MS, what="periods")

    def enable(self) -> None:
        """Until currents have flowed for a while; a node that was frozen may need several tries."""
        node = self.nodes["driver"]
        self.ros.wait(lambda: node.time.is_started and not node.peers.absent, what="all nodes")
        self.ros.wait(lambda: not self.driver_is_new(), what="the session")
        for _ in range(50):
            self.wait_periods(100)
            self.driver.reset_fault()
            node.announce()
            answer = node.enable()
            node.announce()
            self.wait_periods(100)
            if answer.success and not self.fault:
                return
        pytest.fail(f"not enabled: {answer.message} {self.fault}")

    def driver_is_new(self) -> bool:
        return bool(self.nodes["driver"].session.silent)

    def freeze(self, name: str) -> int:
        """Let a node do nothing any more, as SIGSTOP does, while its messages wait; the time of the arm then, ns."""
        for subscription in self.nodes[name].subscriptions:
            waiting: list[Any] = []
            self._frozen.append((subscription, subscription.callback, waiting))
            subscription.callback = waiting.append
        return int(self.driver.stamp)

    def thaw(self) -> None:
        """Let the node go on with what has waited, the status last: it does not know yet that the brakes are on."""
        for subscription, callback, waiting in reversed(self._frozen):
            subscription.callback = callback
            for message in waiting:
                callback(message)
        self._frozen.clear()

    def last_flow(self) -> int:
        """Arm time of the last state with a torque of the motors, ns."""
        return max(stamp_of(state) for state in self._heard.seen["motor_states"] if any(state.effort))


LOST = {
    "transform": "transform has stopped",
    "force_loop and gravity": "(or force_loop and gravity have stopped)",
    "contact_estimator": "contact_estimator has stopped",
    "velocity_loop": "check that velocity_loop runs",
}


@pytest.mark.parametrize("name", LOST)
def test_a_node_that_is_frozen_is_named_and_the_current_is_zero_within_50_ms(
    name: str, ros: Network, tmp_path: Path
) -> None:
    feedback = {"force_loop:feedback": "contact_estimate", "force_loop:guard.mode": "off"}
    stack = Stack(ros, tmp_path, "realtime", **(feedback if name == "contact_estimator" else {}))
    frozen = max(map(stack.freeze, name.split(" and ")))
    ros.wait(lambda: stack.driver.safety.mode is Mode.FAULT, what="a fault")
    stack.wait_periods(100)
    assert LOST[name] in stack.fault
    assert stack.last_flow() - frozen <= LIMIT
    assert stack.driver.currents == [0.0] * 4
    assert name in stack.nodes["driver"].reset_fault().message.partition(" cleared; ")[2], "it does not answer yet"
    stack.thaw()
    stack.wait_periods(10)
    assert all(text not in stack.fault for other, text in LOST.items() if other != name)
    stack.enable()


def test_in_lockstep_the_node_that_does_not_answer_is_named_and_time_goes_on_with_it(
    ros: Network, tmp_path: Path
) -> None:
    stack = Stack(ros, tmp_path, "lockstep")
    stack.freeze("gravity")
    ros.wait(lambda: stack.driver.safety.mode is Mode.FAULT, what="a fault")
    assert "lockstep: no motor_current_command for the state at" in stack.fault
    assert "gravity has stopped or is very slow; if it has stopped, start it" in stack.fault
    stack.thaw()
    stack.wait_periods(10)
    stack.enable()


def test_in_lockstep_a_node_that_runs_and_skips_its_answers_is_named(ros: Network, tmp_path: Path) -> None:
    stack = Stack(ros, tmp_path, "lockstep")
    node = stack.nodes["force_loop"]
    publish, node._publish = node._publish, lambda stamp, outputs: None
    ros.wait(lambda: stack.driver.safety.mode is Mode.FAULT, what="a fault")
    assert "force_loop runs, but did not publish joint_effort_command and joint_velocity_command" in stack.fault
    assert "velocity_loop" not in stack.fault
    stack.driver.reset_fault()
    answer = stack.nodes["driver"].enable()
    assert "force_loop runs, but did not publish" in answer.message
    node._publish = publish
    stack.enable()


def test_a_forged_status_of_the_driver_does_not_stop_the_arms_time(ros: Network, tmp_path: Path) -> None:
    stack = Stack(ros, tmp_path, "lockstep")
    row = BY_NAME["status"]
    forger = ros.node("forger").create_publisher(message_type(row), row.name, qos(row))
    ros.wait(lambda: forger.get_subscription_count() >= len(stack.nodes), what="listeners")
    forged = NodeStatus(Level.OK, "braked", "driver", mode="braked", session=999, since=1, stamp=1)
    forger.publish(diagnostic_status(forged, "wam"))
    followers = [node for name, node in stack.nodes.items() if name != "driver"]
    ros.wait(lambda: all(node.health.session == 999 for node in followers), what="the forged status")
    stack.wait_periods(300)
    assert stack.fault == ""


def test_a_node_that_is_ended_brakes_before_its_commands_cease(ros: Network, tmp_path: Path) -> None:
    stack = Stack(ros, tmp_path, "realtime")
    ros.wait(lambda: stack.nodes["gravity"]._is_enabled)
    stack.nodes["gravity"].end()
    ros.wait(lambda: stack.driver.safety.mode is Mode.FAULT, what="a fault")
    assert "gravity has ended; start it again" in stack.fault


@pytest.mark.parametrize(("topic", "names"), [
    ("joint_states", "/wam/intruder and /wam/transform publish joint_states"),
    ("motor_states", "/wam/driver and /wam/intruder publish motor_states"),
])  # fmt: skip
def test_a_second_publisher_is_named_and_the_arm_brakes(topic: str, names: str, ros: Network, tmp_path: Path) -> None:
    stack = Stack(ros, tmp_path, "lockstep")
    row = BY_NAME[topic]
    other = ros.node("intruder")
    second = other.create_publisher(message_type(row), topic, qos(row))
    ros.wait(lambda: stack.driver.safety.mode is Mode.FAULT, what="a fault")
    assert names in stack.fault
    owners = ARM.motors.names if row.side == "motors" else ARM.joints.names
    for ahead in (0, 5 * MS):
        second.publish(joint_state(stack.driver.stamp + ahead, owners, State([0.5] * 4, [0.5] * 4, [0.5] * 4)))
    other.destroy_publisher(second)
    ros.wait(lambda: not any(node.health.problem for node in stack.nodes.values()), what="one publisher each")
    stack.enable()


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_a_driver_that_starts_again_is_followed_by_all_nodes(mode: str, ros: Network, tmp_path: Path) -> None:
    stack = Stack(ros, tmp_path, mode)
    before = stack.nodes["driver"].session.number
    ros.remove(stack.nodes["driver"])
    stack.start_driver()
    stack.enable()
    assert stack.nodes["driver"].session.number > before
    assert all(node.health.session > before for name, node in stack.nodes.items() if name != "driver")


class Slow:
    """A node whose step does not end before a count changes."""

    name, parameters = "slow", Nothing
    count: ClassVar[Callable[[], float]] = time.monotonic

    def __init__(self, shared: Shared, own: Nothing) -> None: ...

    @reaction(Input("joint_states", "position"), outputs=())
    def step(self, inputs: Inputs) -> Outputs:
        end, before = time.monotonic() + LONG, type(self).count()
        while type(self).count() == before and time.monotonic() < end:
            time.sleep(0.001)
        return {}


def test_a_node_inside_a_long_step_is_named_and_not_one_that_it_holds_up(
    ros: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stack = Stack(ros, tmp_path, "realtime")
    slow = make(ros, tmp_path, f"{__name__}:Slow", "/wam", changed([*SIX, f"{__name__}:Slow"], timing__mode="realtime"))
    published = slow.outlets.written
    monkeypatch.setattr(Slow, "count", lambda: published["status"])
    peers, reasons = stack.nodes["velocity_loop"].peers, set[str]()
    hear = peers.hear
    monkeypatch.setattr(peers, "hear", lambda status: [hear(status), reasons.add(peers.held_up(["transform"]))])
    ros.wait(lambda: any(one.startswith("slow was in a step of ") for one in reasons), what="a report from the step")
    monkeypatch.setattr(Slow, "count", time.monotonic)


@pytest.mark.parametrize(("taken", "since", "named"), [
    ({"force_loop": 0.4, "transform": 0.05}, 0.02, "force_loop"),
    ({"transform": 0.05, "force_loop": 0.4}, 0.02, "force_loop"),
    ({"force_loop": 0.03}, 0.2, ""),
    ({"force_loop": 0.01}, 0.0, ""),
])  # fmt: skip
def test_the_longest_step_that_has_just_ended_holds_up_the_others(
    taken: dict[str, float], since: float, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, steps = 100.0, Steps()
    monkeypatch.setattr("wam_ros.long_steps.time", SimpleNamespace(monotonic=lambda: now))
    for node, seconds in taken.items():
        began = now
        steps.begin(node, began)
        now += seconds
        steps.end(node, began)
    now += since
    step = steps.recent()
    assert (step.node if step else "") == named


def test_what_a_held_up_node_lacks_is_the_fault_of_the_long_step(ros: Network, tmp_path: Path) -> None:
    stack = Stack(ros, tmp_path, "realtime")
    stack.freeze("transform")
    stack.nodes["gravity"].health.report_long_step(LongStep("gravity", 0.7))
    ros.wait(lambda: stack.driver.safety.mode is Mode.FAULT, what="a fault")
    assert "gravity was in a step of 0.7 s" in stack.fault
    assert "transform has stopped" not in stack.fault
