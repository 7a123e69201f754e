"""The test kit: what `arm` does for a test, also of a user's own node, and what it leaves behind."""

import math
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from wam_control.velocity.gravity_node import GravityNode
from wam_description.arm import Shared
from wam_description.event import Level
from wam_description.parameters import Nothing, ParameterError, parameter
from wam_description.signals import State
from wam_description.topics import BY_NAME, JOINT_STATE, TASK_COLUMNS, Topic
from wam_description.wiring import Input, Inputs, Outputs, reaction
from wam_ros.limits import TEST_LIMITS
from wam_ros.network import is_inhabited, requested_domain
from wam_ros.testing import ArmFault, RunningArm, configured
from wam_ros.wire import encoder

OUTPUTS = ("joint_velocity_command", "joint_effort_command")
TORQUE = State([], [], [])
INNER = ["driver", "transform", "velocity_loop", "gravity"]
pytest_plugins = ["pytester"]


@dataclass(frozen=True)
class DampingParameters:
    damping: float = parameter("joint damping", "N m s/rad", low=0.0, high=10.0)


class Damping:
    """A user's node, in the place of the force loop."""

    name, parameters = "damping", DampingParameters

    def __init__(self, shared: Shared, own: DampingParameters) -> None:
        self.damping = own.damping

    @reaction(Input("joint_states", "velocity"), outputs=OUTPUTS)
    def step(self, inputs: Inputs) -> Outputs:
        efforts = [-self.damping * v for v in inputs["joint_states"].velocity]
        return {"joint_velocity_command": TORQUE, "joint_effort_command": State([], [], efforts)}


class Named(Damping):
    name = "force_loop"


class Raising(Damping):
    name, parameters = "raising", Nothing

    def __init__(self, shared: Shared, own: Nothing) -> None: ...

    @reaction(Input("joint_states", "velocity"), outputs=OUTPUTS)
    def step(self, inputs: Inputs) -> Outputs:
        raise ZeroDivisionError


class Silent(Raising):
    name = "silent"

    @reaction(Input("joint_states", "velocity"), outputs=OUTPUTS)
    def step(self, inputs: Inputs) -> None: ...  # type: ignore[override]


class Unread(Raising):
    name, topics = "unread", (Topic("share", JOINT_STATE, "outer", "a share of each joint", "joints"),)
    count = 0

    @reaction(Input("joint_states", "velocity"), outputs=("share",))
    def step(self, inputs: Inputs) -> Outputs:
        self.count += 1
        return {} if self.count % 8 else {"share": State([], [], [math.nan] * 4)}


class Changing(GravityNode):
    @reaction(Input("joint_states", "position"), outputs=("gravity_effort",))
    def step(self, inputs: Inputs) -> Outputs:
        outputs = super().step(inputs)
        inputs["joint_states"].position[:] = [9.0] * 4
        return outputs


def test_a_node_that_changes_its_input_changes_that_of_no_other(arm: RunningArm) -> None:
    arm.start(gravity=Changing)
    arm.enable()
    arm.run(0.2)
    assert np.abs(arm.truth.q - arm.recorded["joint_states"].position[0]).max() < 0.01


def test_an_own_node_damps_the_arm_in_the_place_of_the_force_loop(arm: RunningArm) -> None:
    arm.start(force_loop=Damping, damping={"damping": 2.0}, timing={"outer_delay": 1})
    arm.enable()
    arm.send("sim/disturbance", frame="outer_link", force=(0.0, 20.0, 0.0))
    arm.run(0.1)
    assert np.abs(arm.truth.qd).max() > 0.05
    states, efforts = arm.recorded["joint_states"], arm.recorded["joint_effort_command"]
    assert states.position.shape == (len(states.stamp_ns), 4)
    assert "force_loop" not in arm.nodes
    common, at, of = np.intersect1d(states.stamp_ns, efforts.stamp_ns, return_indices=True)
    assert len(common) > 10
    np.testing.assert_array_equal(efforts.effort[of], -2.0 * states.velocity[at])
    for name, given, reason in (
        ("joint_posture_comand", {"position": [0.0, 0.0]}, "did you mean 'joint_posture_command'"),
        ("joint_posture_command", {"position": [0.0, 0.0]}, "send 4"),  # which no node takes here
        ("joint_posture_command", {"positions": [0.0]}, "no field 'positions'; it has position, velocity, effort"),
        ("joint_posture_command", {"position": 0.3}, "unusable .*: position is 0.3; give a list of floats"),
        ("joint_posture_command", {"seconds": -1.0}, "seconds is -1; give the time"),
        ("joint_posture_command", {"seconds": math.inf}, "seconds is inf; give the time"),
        ("joint_trajectory", {}, "is a trajectory_msgs/msg/JointTrajectory; publish it with a node .*JointState, "),
        ("sim/disturbance", {"force": (0.0, 5.0)}, "unusable sim/disturbance: .*; send three numbers for each"),
    ):
        with pytest.raises(ValueError, match=reason):
            arm.send(name, **given)
    with pytest.raises(ValueError, match="no node 'forceloop' in this test; it has driver, "):
        arm.status("forceloop")
    with pytest.raises(ValueError, match="did you mean 'force_command'"):
        arm.run_until_refused("force_comand")


def test_a_command_moves_the_arm_as_long_as_it_is_sent(arm: RunningArm) -> None:
    arm.start(nodes=INNER)
    arm.enable()
    arm.send("joint_velocity_command", velocity=[0.0, 0.0, 0.2, 0.0], seconds=0.5)
    arm.run_until(lambda: arm.newest("joint_states").velocity[2] > 0.15)
    arm.run(1.0)
    sent = arm.recorded["joint_velocity_command"].stamp_ns
    assert sent[-1] - sent[0] == 500_000_000
    assert abs(arm.truth.qd[2]) < 0.01
    for topic, reason in (("force_command", ".*joint_states"), ("/wam/joint_states", "did you mean 'joint_states'")):
        with pytest.raises(KeyError, match=f"nothing was recorded on '{topic}' so far; {reason}"):
            arm.recorded[topic]


@pytest.mark.parametrize(("taker", "topic", "stamp", "text", "fields"), [
    ("transform", "joint_velocity_command", 0, "no stamp", {"velocity": [0.1] * 4}),
    ("transform", "joint_velocity_command", 1, "1.0. s older .*allowed: 0.035 s", {"velocity": [0.0] * 4}),
    ("transform", "joint_velocity_command", 10**12, "999 s ahead .*allowed: 0.035 s", {"velocity": [0.0] * 4}),
    ("force_loop", "joint_posture_command", 1, "allowed: 0.2 s", {"position": [0.0, -0.6, 0.0, 0.5]}),
    ("force_loop", "task_command", 1, "1000 rows; send at most 4", {"rows": ((0.0,) * len(TASK_COLUMNS),) * 1000}),
])  # fmt: skip
def test_a_command_that_is_refused_is_in_the_status_of_the_node_that_takes_its_topic(
    taker: str, topic: str, stamp: int, text: str, fields: dict[str, Any], arm: RunningArm
) -> None:
    arm.start(nodes=INNER if taker == "transform" else ())
    arm.enable()
    arm.run(1.0)
    value = arm.value(topic, **fields)
    arm.publisher(topic).publish(encoder(BY_NAME[topic], arm.configuration.shared)(stamp, value))
    assert re.match(f"{taker}: .*{text}", arm.run_until_refused(topic))
    arm.run_until(lambda: arm.status(taker).level is Level.WARN)
    assert arm.status(taker).facts["refused"] == topic
    arm.run_until(lambda: arm.status(taker).level is Level.OK)
    with pytest.raises(AssertionError, match="that a node refuses"):
        arm.run_until_refused(topic, 0.1)
    arm.publisher(topic).publish(encoder(BY_NAME[topic], arm.configuration.shared)(stamp, value))
    with pytest.raises(ArmFault, match=f"{topic} is refused by {taker}"):
        arm.run(0.1)


def test_a_posture_without_a_stamp_counts_as_now_and_the_status_says_so(arm: RunningArm) -> None:
    arm.start()
    arm.enable()
    topic, goal = "joint_posture_command", list(arm.truth.q)
    goal[2] += 0.1
    encode, sender = encoder(BY_NAME[topic], arm.configuration.shared), arm.publisher(topic)
    for _ in range(100):
        sender.publish(encode(0, arm.value(topic, position=goal)))
        arm.run(0.005)
    assert arm.truth.q[2] > goal[2] - 0.05
    assert arm.newest("contact/in_contact").data is False
    assert (arm.status("force_loop").level, arm.status("force_loop").facts["unstamped"]) == (Level.WARN, topic)
    arm.run_until(lambda: arm.status("force_loop").level is Level.OK)


def test_a_plain_node_shares_the_executor(arm: RunningArm) -> None:
    from rclpy.node import Node

    node, heard = Node("mine", namespace="wam", context=arm.context), []
    arm.start(nodes=INNER)
    written = arm.nodes["transform"].outlets.written
    arm.run(0.1)
    assert written["joint_states"] == 0  # the nodes of the process hand it to each other
    listener = node.create_subscription(JointState, "joint_states", heard.append, 10)
    arm.add(node)
    arm.run_until(lambda: len(heard) > 20)
    assert list(heard[0].name) == list(arm.configuration.shared.arm.joints.names)
    node.destroy_subscription(listener)
    before = written["joint_states"]
    arm.nodes["gravity"].inlets.close()  # it takes joint_states, too, and ends
    node.create_subscription(JointState, "joint_states", heard.append, 10)
    arm.nodes["transform"].outlets.publish("joint_states", 1, State([0.0] * 4, [0.0] * 4, []))
    assert written["joint_states"] == before + 1
    node.create_service(Trigger, "hello", lambda request, answer: answer)
    arm.run_until(lambda: "/wam/hello" in dict(arm.node.get_service_names_and_types()))
    assert not arm.call("hello").success
    with pytest.raises(ValueError, match="3 is no node of rclpy"):
        arm.add(3)
    node.destroy_node()
    arm.close()
    assert not is_inhabited(requested_domain())


def test_a_fault_is_an_exception_unless_it_is_expected(arm: RunningArm) -> None:
    arm.enable()
    takes = {("driver/estop", True): "'driver/estop' takes no value", ("driver/enable",): "takes True or False"}
    takes["driver/enable", 1] = "takes True or False"
    for words in (("driver/estp",), ("estop",), *takes):
        with pytest.raises(ValueError, match=takes.get(words, f"is named '{words[0]}'; there are .*driver/")):
            arm.call(*words)
    assert arm.call("driver/estop").success
    with pytest.raises(ArmFault, match="emergency stop"):
        arm.run(0.1)
    assert arm.run_until_fault() == "emergency stop"
    arm.run(0.1)
    assert (arm.status("driver").level, arm.status("driver").fault) == (Level.ERROR, "emergency stop")
    for service in ("driver/reset_fault", "driver/estop"):
        arm.call(service)
    with pytest.raises(ArmFault, match="emergency stop"):
        arm.run(0.1)
    arm.run_until_fault()
    arm.send("sim/disturbance", frame="outer_lnk", force=(0.0, 1.0, 0.0))
    with pytest.raises(ArmFault, match=r"sim/disturbance is refused by driver: .*outer_lnk"):
        arm.run(0.1)


def test_an_arm_in_realtime_is_enabled_once_it_can_be(arm: RunningArm) -> None:
    arm.start(nodes=INNER, timing={"mode": "realtime"}, driver={"late_periods": 0.99})
    arm.enable()


def test_a_number_that_is_none_is_an_exception_though_no_node_takes_it(arm: RunningArm) -> None:
    arm.start(Unread, nodes=INNER)
    words = "share is refused by the test, as no node takes it: unread published share: effort of joint1 is nan"
    with pytest.raises(ArmFault, match=words):
        arm.run(0.1)
    arm.run_until_refused("share")
    arm.run(0.1)


@pytest.mark.parametrize(("node", "text"), [
    (Raising, "raising: unexpected ZeroDivisionError"),
    (Silent, "silent: unusable output of step: None; return a dictionary from topic to value"),
])  # fmt: skip
def test_a_node_that_fails_is_named(node: type, text: str, arm: RunningArm) -> None:
    arm.start(force_loop=node)
    assert arm.run_until_fault().startswith(text)


def test_a_condition_that_does_not_come_fails(arm: RunningArm, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(AssertionError, match=r"0\.1 s of .*: arm\.run_until.* \(test_kit\.py:\d+\).* is \[0\.0, -0"):
        arm.run_until(lambda: False, 0.1)
    with pytest.raises(AssertionError, match=r"0\.1 s of .*: a fault of the driver; "):
        arm.run_until_fault(0.1)
    with pytest.raises(AssertionError, match="does not go back by 1 s"):
        arm.run(-1.0)
    monkeypatch.setattr("wam_ros.testing.TEST_LIMITS", replace(TEST_LIMITS, lockstep_timeout=0.3))
    arm.call("driver/pause", True)
    with pytest.raises(AssertionError, match=r"within 0 s; the arm is paused, call driver/pause with False: .*run"):
        arm.run(0.1)
    arm.call("driver/pause", False)
    arm.run(0.1)


@pytest.mark.parametrize(("values", "text"), [
    ({"driver": {"watchdogg": 1.0}}, "did you mean"),
    ({"force_loop": Damping.__new__(Damping)}, "is no node; give its class, or 'module:Class'"),
    ({"nobody": {"gain": 1.0}}, "section '/\\*\\*/nobody' belongs to no node"),
    ({"timing": {"period": -1.0}}, "period"),
    ({"nodes": "driver"}, r"give a list, as \['driver'\]"),
    ({"force_loop": Damping, "damping": {"gan": 1.0}}, "^a value that you set.*damping.*gan"),
    ({"force_loop": Named}, "has the name .* 'force_loop': give it another"),
    ({"driver": {"sensors.encoder_noise": [0.0] * 9}}, "it needs 4"),  # by the node itself
])  # fmt: skip
def test_a_value_that_cannot_be_is_refused_by_name(values: dict[str, Any], text: str, arm: RunningArm) -> None:
    with pytest.raises(ParameterError, match=text) as kept:
        arm.start(**values)
    assert not is_inhabited(requested_domain()), f"a node that was half made is left, after {kept}"
    arm.start()


def test_a_stack_that_has_ended_has_no_truth_and_is_not_started_again(arm: RunningArm) -> None:
    with pytest.raises(ParameterError, match="is no node; give its class"):
        arm.start(object())
    assert arm.context.ok()  # also before the start
    arm.close()
    with pytest.raises(AssertionError, match="has ended; read the bag"):
        _ = arm.truth


def test_a_scenario_that_fails_is_an_exception_and_so_are_steps_that_no_file_can_contain(arm: RunningArm) -> None:
    with pytest.raises(ParameterError, match=r"the steps contain <object.*; give mappings as a scenario file has"):
        arm.play([object()])  # type: ignore[list-item]
    with pytest.raises(ArmFault, match="driver refuses"):
        arm.play([{"name": "rub", "seconds": 0.3, "set": {"driver": {"effects.added_coulomb_friction": [1.0] * 9}}}])
    assert arm.play([{"name": "wait", "seconds": 0.1}]).path.name == "bag1"


def test_nested_values_and_a_class_in_the_place_of_a_node_make_a_configuration() -> None:
    made = configured(force_loop=Damping, damping={"damping": 2.0}, arm={"joints": {"start": [0.1] * 4}})
    assert made.shared.arm.joints.start == (0.1,) * 4
    assert made.node("damping", DampingParameters).damping == 2.0
    assert f"{__name__}:Damping" in made.shared.nodes
    assert "force_loop" not in made.shared.nodes


@pytest.mark.slow
def test_after_a_failed_test_the_next_one_runs_and_workers_do_not_meet(
    pytester: pytest.Pytester, domain_id: int
) -> None:
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("number", range(2))
        def test_that_fails(arm, number):
            arm.run(0.02)
            assert False

        @pytest.mark.parametrize("number", range(2))
        def test_that_passes(arm, number):
            arm.run(0.02)
            assert len(arm.recorded["motor_states"].stamp_ns) > 20
        """
    )
    arguments = ("-p", "wam_ros.pytest_plugin", "-p", "no:cacheprovider", "-n", "2")
    pytester.runpytest_subprocess(*arguments).assert_outcomes(passed=2, failed=2)
