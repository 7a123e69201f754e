"""The example of a client: it ends with a reason and a code other than 0 where the arm stops."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import LONG, ROOT
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from wam_description.signals import Level, NodeStatus
from wam_description.topics import BY_NAME
from wam_ros.messages import diagnostic_status
from wam_ros.qos import qos


def answered(request: Any, response: Any) -> Any:
    response.success = True
    return response


@pytest.mark.parametrize(
    ("mode", "fault", "text"),
    [
        ("fault", "emergency stop", "the driver stopped: emergency stop; call reset_fault, then start again\n"),
        ("braked", "", "another program put on the brakes; start again\n"),
    ],
)
def test_it_fails_where_the_arm_stops_under_it(mode: str, fault: str, text: str, ros: Any, tmp_path: Path) -> None:
    node = ros.node("driver")
    status = node.create_publisher(DiagnosticStatus, "status", qos(BY_NAME["status"]))
    states = node.create_publisher(JointState, "joint_states", qos(BY_NAME["joint_states"]))
    node.create_service(SetBool, "driver/enable", answered)
    commands: list[Any] = []
    node.create_subscription(JointState, "joint_posture_command", commands.append, 10)

    def report(level: Level, mode: str, fault: str) -> None:
        status.publish(diagnostic_status(NodeStatus(level, mode, "driver", True, mode, fault), "wam"))

    report(Level.OK, "enabled", "")
    state = JointState(name=["joint1", "joint2", "joint3", "joint4"], position=[0.0, -1.5, 0.0, 1.45])
    node.create_timer(0.01, lambda: states.publish(state))
    example = subprocess.Popen(
        [sys.executable, "-P", str(ROOT / "examples" / "force_step.py")],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=tmp_path,
    )
    try:
        ros.wait(lambda: len(commands) > 20, what="commands of the example")
        report(Level.ERROR if fault else Level.OK, mode, fault)
        ros.wait(lambda: example.poll() is not None, what="the end of the example")
        assert example.communicate(timeout=LONG)[0] == text
        assert example.returncode == 1
    finally:
        example.kill()
        example.communicate()
