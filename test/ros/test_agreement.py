"""Nodes that were started apart: the driver brakes where they work with other shared parameters than itself."""

from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from ros_network import Network
from test_loss import Stack
from test_nodes import MS, SIX, WAM, changed, make

from wam_description.agreement import DIGESTS, OF_ONE_PROCESS, digests, disagreement
from wam_description.arm import Shared
from wam_description.parameters import fields, listed, values
from wam_description.topics import BY_NAME
from wam_driver.safety import Mode
from wam_ros.health import READY
from wam_ros.messages import diagnostic_status
from wam_ros.ros_topics import qos

OWN = digests(WAM.shared)
HEAVY = {"arm.payload": 1.5}
FEWER = {"nodes": [name for name in SIX if name != "gravity"]}
MANY = {"arm.payload": 1.5, "ages.command": 0.3, "motion.speed": 0.3, "motion.jerk": 9.0, "timing.dither_cycle": 8}


def started_with(other: dict[str, Any]) -> str:
    """Digests of a node that was started with other values than the packaged ones."""
    return digests(WAM.with_values(other).shared)


@pytest.mark.parametrize(("other", "names"), [
    (HEAVY, "another arm.payload than"),
    ({"arm.gravity": [0.0, 0.0, -9.8]}, "another arm.gravity than"),
    ({"arm.joints.upper": [2.6, 1.9, 2.7, 3.0]}, "another arm.joints.upper than"),
    ({"timing.mode": "realtime"}, "another timing.mode than"),
    ({"servo.integral_gain": [0.4] * 4}, "another servo.integral_gain than"),
    ({"disturbance_force_limit": 7.0}, "another disturbance_force_limit than"),
    (MANY, "another timing.dither_cycle, ages.command, arm.payload and 2 more than"),
])  # fmt: skip
def test_a_node_that_was_started_with_other_values_is_named_with_them(other: dict[str, Any], names: str) -> None:
    reason = disagreement("gravity", OWN, started_with(other))
    assert reason == f"gravity was started with {names} the driver; start all nodes with the same configuration"


def test_what_concerns_one_process_or_is_not_reported_may_differ() -> None:
    other = {
        "nodes": ["driver"], "timing.niceness": 0, "timing.fifo_priority": 1, "timing.timeout": 9.0,
        "timing.real_time_factor": 0.5,
    }  # fmt: skip
    assert other.keys() == OF_ONE_PROCESS
    for name, value in other.items():
        assert listed(values(WAM.shared)[name]) != value, name
        assert disagreement("gravity", OWN, started_with({name: value})) == "", name
    assert disagreement("gravity", started_with({"arm.payload": 0.0}), started_with({"arm.payload": -0.0})) == ""
    assert disagreement("gravity", OWN, "") == ""


def test_every_other_shared_parameter_is_compared() -> None:
    compared = [field.name for field in fields(Shared) if field.name not in OF_ONE_PROCESS]
    assert len(OWN) == 3 * (1 + len(compared))


@pytest.mark.parametrize("text", [
    "?", OWN[:-3], OWN + "abc", "AAA" + OWN[3:], "\x00" * len(OWN), "é" * 100_000,
], ids=["short", "fewer", "more", "other names", "zeros", "long"])  # fmt: skip
def test_digests_of_other_parameters_are_those_of_another_version(text: str) -> None:
    assert "gravity was started with another version" in disagreement("gravity", OWN, text)


class Apart(Stack):
    """The six nodes in this process, some of them started with other values; nobody has enabled the arm."""

    def __init__(self, ros: Network, folder: Path, others: dict[str, dict[str, Any]], **values: Any) -> None:
        self.ros, self.folder = ros, folder
        self.values = {"timing__mode": "lockstep", "timing__real_time_factor": 0.0, **values}
        self.nodes = {name: self.made(name, **others.get(name, {})) for name in SIX}

    def made(self, name: str, **other: Any) -> Any:
        """A node with other values than the rest."""
        return make(self.ros, self.folder, name, "/wam", changed(**{"nodes": SIX, **self.values, **other}))

    def end(self, name: str) -> None:
        """End a node, and wait until the arm's time is at rest without it."""
        self.ros.remove(self.nodes.pop(name))
        seen: list[int] = []
        while seen[-20:] != [self.driver.stamp] * 20:
            seen.append(self.driver.stamp)
            self.ros.executor.spin_once(timeout_sec=0.01)

    def restart(self, name: str, **other: Any) -> None:
        """End a node and start it with the values of the rest, but for some."""
        if name in self.nodes:
            self.ros.remove(self.nodes.pop(name))
        self.nodes[name] = self.made(name, **other)

    def refusal(self) -> str:
        """Why the driver refuses to release the brakes, once all nodes are connected, also after a fault."""
        node = self.nodes["driver"]
        self.ros.wait(lambda: node.time.is_started and not node.peers.absent, what="all nodes")
        self.driver.reset_fault()
        answer = node.enable()
        assert not answer.success
        assert self.driver.safety.mode is not Mode.ENABLED
        return str(answer.message)


def test_a_node_that_was_started_with_another_parameter_keeps_the_arm_braked_until_it_is_started_again(
    ros: Network, tmp_path: Path
) -> None:
    stack = Apart(ros, tmp_path, {"gravity": HEAVY})
    assert "gravity was started with another arm.payload than the driver" in stack.refusal()
    stack.restart("gravity")
    ros.wait(lambda: not stack.nodes["driver"].health.problem, what="the same parameters")
    stack.enable()


NO, GRAVITY = None, "gravity was started with another "
RESTARTS = {
    "a node that differs": ([("gravity", NO), ("gravity", HEAVY)], f"{GRAVITY}arm.payload than"),
    "a node with other periods": (
        [("gravity", NO), ("gravity", {"timing.outer_divisor": 10})], f"{GRAVITY}timing.outer_divisor than",
    ),
    "a node of the inner loop": ([("velocity_loop", NO), ("velocity_loop", {})], "check that velocity_loop runs"),
    "a node that missed the state": ([("gravity", NO), ("gravity", {})], "check that gravity runs"),
    "a driver without the node": ([("gravity", HEAVY), ("gravity", NO), ("driver", {})], "not connected yet: gravity"),
    "a driver that does not list the node": (
        [("gravity", HEAVY), ("gravity", NO), ("driver", FEWER)],
        "list a node in 'nodes' that publishes gravity_effort, or start yours, then call reset_fault",
    ),
    "a node that differs and is not listed": ([("driver", FEWER), ("gravity", HEAVY)], f"{GRAVITY}arm.payload than"),
}  # fmt: skip


@pytest.mark.parametrize(("restarts", "reason"), RESTARTS.values(), ids=RESTARTS)
def test_after_restarts_the_driver_names_the_reason_and_the_time_goes_on_when_it_is_gone(
    restarts: list[tuple[str, dict[str, Any] | None]], reason: str, ros: Network, tmp_path: Path
) -> None:
    stack = Apart(ros, tmp_path, {}, timing__timeout=2.0)
    ros.wait(lambda: stack.driver.stamp > 20 * MS, what="lockstep")
    for name, other in restarts:
        if other is None:
            stack.end(name)
        else:
            stack.restart(name, **other)
    ros.wait(lambda: reason in stack.nodes["driver"].health.status.message, 30.0, reason)
    stack.restart("gravity")
    stack.enable()


def test_other_parameters_that_appear_while_the_arm_is_enabled_are_a_fault(ros: Network, tmp_path: Path) -> None:
    stack = Apart(ros, tmp_path, {})
    stack.enable()
    driver = stack.nodes["driver"]
    other = ros.node("other").create_publisher(DiagnosticStatus, "status", qos(BY_NAME["status"]))
    ros.wait(lambda: other.get_subscription_count() >= len(SIX), what="listeners")

    def send(node: str, text: str) -> None:
        status = READY._replace(node=node, session=driver.session.number, facts={DIGESTS: text})
        other.publish(diagnostic_status(status, "wam"))

    send("stranger", started_with(HEAVY))
    stack.wait_periods(500)
    assert stack.driver.safety.mode is Mode.ENABLED, "of no node of the bring-up"
    send("gravity", started_with(HEAVY))
    ros.wait(lambda: stack.driver.safety.mode is Mode.FAULT, what="a fault")
    text = "gravity was started with another arm.payload than the driver"
    assert stack.fault.startswith(text)
    assert stack.driver.currents == [0.0] * 4
    assert text in stack.refusal()
    send("gravity", driver.health.digests)
    ros.wait(lambda: not driver.health.problem, what="the same parameters")
    stack.enable()
