"""The example of a client: it ends with a reason and a code other than 0 where the arm stops."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import LONG, ROOT
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from wam_description.event import Level
from wam_description.signals import NodeStatus
from wam_description.topics import BY_NAME
from wam_ros.messages import diagnostic_status
from wam_ros.ros_topics import qos


def answered(request: Any, response: Any) -> Any:
    response.success = True
    return response


class Stub:
    """A driver by hand: joint states of an arm at rest, statuses, and the example as a client of both."""

    def __init__(self, ros: Any, folder: Path) -> None:
        self.ros, node = ros, ros.node("driver")
        self._status = node.create_publisher(DiagnosticStatus, "status", qos(BY_NAME["status"]))
        states = node.create_publisher(JointState, "joint_states", qos(BY_NAME["joint_states"]))
        touch = node.create_publisher(WrenchStamped, "contact/wrench", qos(BY_NAME["contact/wrench"]))
        node.create_service(SetBool, "driver/enable", answered)
        self.commands: list[Any] = []
        self.forces: list[float] = []
        node.create_subscription(JointState, "joint_posture_command", self.commands.append, 10)
        node.create_subscription(WrenchStamped, "force_command", self._take_force, 10)
        self.report("driver", Level.OK, "enabled", "enabled")
        state = JointState(name=["joint1", "joint2", "joint3", "joint4"], position=[0.0, -1.5, 0.0, 1.45])
        force = WrenchStamped()
        force.wrench.force.y = 3.0
        node.create_timer(0.002, lambda: (states.publish(state), touch.publish(force)))
        self.example = subprocess.Popen(
            [sys.executable, "-P", str(ROOT / "examples" / "force_step.py")],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=folder,
        )

    def _take_force(self, message: WrenchStamped) -> None:
        self.forces.append(message.wrench.force.y)

    def report(self, name: str, level: Level, message: str, mode: str = "", fault: str = "", **facts: str) -> None:
        status = NodeStatus(level, message, name, True, mode, fault, facts=facts)
        self._status.publish(diagnostic_status(status, "wam"))

    def ended(self) -> tuple[int, str]:
        """Exit code and output of the example."""
        self.ros.wait(lambda: self.example.poll() is not None, what="the end of the example")
        return self.example.returncode, self.example.communicate(timeout=LONG)[0]


@pytest.fixture
def stub(ros: Any, tmp_path: Path) -> Iterator[Stub]:
    found = Stub(ros, tmp_path)
    yield found
    found.example.kill()
    found.example.communicate()


@pytest.mark.parametrize(("mode", "fault", "text"), [
    ("fault", "emergency stop", "the driver stopped: emergency stop; call reset_fault, then start again\n"),
    ("braked", "", "another program put on the brakes; start again\n"),
])  # fmt: skip
def test_it_fails_where_the_arm_stops_under_it(mode: str, fault: str, text: str, stub: Stub) -> None:
    stub.ros.wait(lambda: len(stub.commands) > 20, what="commands of the example")
    stub.report("driver", Level.ERROR if fault else Level.OK, mode, mode, fault)
    assert stub.ended() == (1, text)


def test_it_fails_with_the_reason_where_its_force_is_refused(stub: Stub) -> None:
    stub.ros.wait(lambda: stub.forces and stub.forces[-1] == -5.0, what="a commanded force")
    reason = "the force is measured with a standard deviation of 3 N; bend the arm"
    stub.report("force_loop", Level.WARN, reason, refused="force_command", reaction="refused")
    assert stub.ended() == (1, f"5 N were refused: {reason}\n")


def test_it_fails_with_the_reason_where_its_commands_are_malformed(stub: Stub) -> None:
    reason = "frame_id is 'outer'; allowed: base, outer_link"
    stub.report("force_loop", Level.WARN, reason, refused="force_command")
    assert stub.ended() == (1, f"a command was refused: {reason}\n")
