"""What the node `force_loop` says and refuses over ROS."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from test_nodes import ARM, WAM, Listener, start
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_description.rigid_body import RigidBody
from wam_description.signals import ZERO, State, Wrench
from wam_description.topics import BY_NAME
from wam_ros.messages import joint_state, message_type
from wam_ros.ros_topics import qos
from wam_ros.wire import encoder

MS = 1_000_000
NAMES = list(ARM.joints.names)
FORCE = encoder(BY_NAME["force_command"], WAM.shared)
CARRYING = RigidBody(ARM).gravity_torque([0.0, -1.8, 0.0, 1.45]).tolist()  # N m: nothing touches


class Feeder:
    """A force loop alone, fed with states that stand still."""

    def __init__(self, ros: Any, folder: Path) -> None:
        self.ros, self.stamp = ros, 0
        self.node = ros.node("feeder")
        self._publishers = {
            name: self.node.create_publisher(message_type(BY_NAME[name]), name, qos(BY_NAME[name]))
            for name in ("joint_states", "joint_sensors", "force_command")
        }
        self.loop = start(ros, folder, ["force_loop"], timing__mode="realtime")["force_loop"]
        self.heard = Listener(ros, "status", "force_error", "/diagnostics")
        ros.wait(lambda: all(p.get_subscription_count() for p in self._publishers.values()))

    def feed(self, newtons: float | None = 0.0, torque: float = 0.0) -> None:
        """One state, with a force commanded unless it is None."""
        self.stamp += 5 * MS
        if newtons is not None:
            force = FORCE(self.stamp, Wrench("base", (0.0, 0.0, -newtons), (0.0, 0.0, torque)))
            self._publishers["force_command"].publish(force)
        sensed = State([0.0, -1.8, 0.0, 1.45], [0.0] * 4, CARRYING)
        self._publishers["joint_sensors"].publish(joint_state(self.stamp, ARM.joints.names, sensed))
        state = State([0.0, -1.8, 0.0, 1.45], [0.0] * 4, [1.0] * 4)
        self._publishers["joint_states"].publish(joint_state(self.stamp, ARM.joints.names, state))
        before = len(self.heard.seen["force_error"])
        self.ros.wait(lambda: len(self.heard.seen["force_error"]) > before, what="an answer")

    def set(self, **values: Any) -> Any:
        """Answer to a set of parameters."""
        client = self.node.create_client(SetParametersAtomically, "force_loop/set_parameters_atomically")
        self.ros.wait(client.service_is_ready, what="the parameter service")
        parameters = [Parameter(key.replace("__", "."), value=v).to_parameter_msg() for key, v in values.items()]
        future = client.call_async(SetParametersAtomically.Request(parameters=parameters))
        self.ros.wait(future.done, what="an answer to the set")
        return future.result().result

    def feed_until(self, condition: Callable[[], bool]) -> None:
        """States one after the other until a status that was awaited has come."""
        for _ in range(200):
            self.feed()
            if condition():
                return
        raise AssertionError([m.message for m in self.heard.seen["status"]])

    def facts(self) -> tuple[DiagnosticStatus, dict[str, str]]:
        reported = self.heard.seen["status"][-1]
        return reported, {pair.key: pair.value for pair in reported.values}


def test_status_says_domain_margin_stiffness_and_cycle_and_changes_with_the_set(ros: Any, tmp_path: Path) -> None:
    feeder = Feeder(ros, tmp_path)
    seen = feeder.heard.seen["status"]
    feeder.feed_until(
        lambda: bool(seen) and {"gains": "accepted", "peers": "connected"}.items() <= feeder.facts()[1].items()
    )
    reported, facts = feeder.facts()
    assert (reported.level, reported.message) == (DiagnosticStatus.OK, "stable, domain I")
    assert float(facts["effective stiffness [N/m]"]) > 1000.0
    assert float(facts["deadband that removes the limit cycle [N]"]) > 0.0
    refused = feeder.set(force_gain=[0.5], guard__mode="refuse")
    assert not refused.successful
    assert "times the largest linearly stable one" in refused.reason
    assert feeder.loop.node._loop.parameters.force_gain == (0.02,)
    assert feeder.set(force_gain=[0.5]).successful
    feeder.feed_until(lambda: "lowered" in feeder.facts()[0].message)
    assert feeder.facts()[1]["lowered"].startswith("force_gain [")
    assert 0.02 < feeder.loop.node._loop.parameters.force_gain[0] < 0.2
    assert feeder.set(force_gain=[0.5], guard__mode="warn").successful
    feeder.feed_until(lambda: feeder.facts()[0].message.startswith("not stable: force_gain "))
    assert feeder.facts()[0].level == DiagnosticStatus.WARN


def test_a_torque_in_a_force_command_is_refused_by_name_once_for_each_message(
    ros: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    feeder = Feeder(ros, tmp_path)
    for _ in range(2):
        feeder.feed(8.0)
    feeder.feed(8.0, torque=0.5)
    for _ in range(50):
        feeder.feed(None)
    assert feeder.loop.health.refusals["force_command"].count == 1
    said = capfd.readouterr().err
    assert said.count("force_command: refused: torque (0.0, 0.0, 0.5) N m is commanded in frame 'base'") == 1


def test_a_trajectory_that_is_refused_is_in_the_status_until_it_ends(ros: Any, tmp_path: Path) -> None:
    feeder = Feeder(ros, tmp_path)
    publisher = feeder.node.create_publisher(JointTrajectory, "joint_trajectory", 10)
    ros.wait(publisher.get_subscription_count)
    beyond = JointTrajectory(joint_names=list(ARM.joints.names))
    beyond.points = [JointTrajectoryPoint(positions=[9.0, -1.8, 0.0, 1.45])]

    def is_refused() -> bool:
        beyond.header.stamp.nanosec = feeder.stamp
        publisher.publish(beyond)
        return any(m.level == DiagnosticStatus.WARN and "joint1" in m.message for m in feeder.heard.seen["status"])

    feeder.feed_until(is_refused)
    feeder.feed_until(lambda: "domain" in feeder.facts()[0].message)


@pytest.mark.parametrize(("topic", "message", "reason"), [
    ("force_command", lambda stamp: FORCE(stamp, Wrench("outer", ZERO, ZERO)), "frame_id is 'outer'"),
    ("joint_posture_command", lambda stamp: joint_state(stamp, NAMES, State([0.0] * 3, [], [])), "has 3 values"),
    ("joint_posture_command", lambda stamp: joint_state(stamp, [], State([0.0] * 4, [], [])), "is missing"),
])  # fmt: skip
def test_the_status_names_a_malformed_command_until_none_comes_any_more(
    topic: str, message: Callable[[int], Any], reason: str, ros: Any, tmp_path: Path
) -> None:
    feeder = Feeder(ros, tmp_path)
    sender = feeder.node.create_publisher(message_type(BY_NAME[topic]), topic, qos(BY_NAME[topic]))
    ros.wait(sender.get_subscription_count)
    feeder.feed_until(lambda: any("domain" in m.message for m in feeder.heard.seen["status"]))

    def feed_until(condition: Callable[[], bool], is_wrong: bool) -> None:
        for _ in range(500):  # 2.5 s of the arm's time
            if is_wrong:
                sender.publish(message(feeder.stamp))
            feeder.feed(None)
            if condition():
                return
        raise AssertionError(feeder.facts())

    feed_until(lambda: "refused" in feeder.facts()[1], is_wrong=True)
    reported, facts = feeder.facts()
    assert (reported.level, facts["refused"], reason in reported.message) == (DiagnosticStatus.WARN, topic, True)
    count = len(feeder.heard.seen["status"])
    for _ in range(50):
        sender.publish(message(feeder.stamp))
        feeder.feed(None)
    assert len(feeder.heard.seen["status"]) <= count + 1, "one status a second at most"
    feed_until(lambda: "refused" not in feeder.facts()[1], is_wrong=False)
    assert feeder.facts()[0].level == DiagnosticStatus.OK
