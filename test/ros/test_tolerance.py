"""No message, request or timer ends a node: what a callback raises is a fault by its name, and the arm brakes."""

from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from wam_bag.printable import printable
from wam_description.configuration import Configuration, packaged
from wam_description.event import Level
from wam_description.signals import NodeStatus
from wam_description.topics import BY_NAME
from wam_driver.safety import Mode
from wam_ros.limits import NODE_LIMITS
from wam_ros.messages import Refused, diagnostic_status
from wam_ros.node import make_node
from wam_ros.ros_topics import header, qos
from wam_ros.tolerance import TolerantNode

WAM = Configuration.load(packaged("wam"))
SEED = 20261120


def make(ros: Any, folder: Path, name: str, nodes: list[str], **values: Any) -> Any:
    """A node of the configuration in the test's own executor."""
    given = {key.replace("__", ":"): value for key, value in values.items()}
    file = folder / "parameters.yaml"
    file.write_text(WAM.with_values({"nodes": nodes, "timing.mode": "realtime", **given}).text)
    arguments = ["--ros-args", "--params-file", str(file)]
    return ros.add(
        make_node(name, context=ros.context, namespace="/wam", cli_args=arguments, use_global_arguments=False)
    )


def request(ros: Any, kind: Any, service: str, **fields: Any) -> Any:
    client = ros.node("operator").create_client(kind, service)
    ros.wait(client.service_is_ready)
    future = client.call_async(kind.Request(**fields))
    ros.wait(future.done)
    return future.result()


def test_a_parameter_of_an_unknown_type_is_refused_and_the_node_goes_on(ros: Any, tmp_path: Path) -> None:
    node = make(ros, tmp_path, "gravity", ["gravity"])
    unknown = Parameter(name="arm.name\x1b[2J", value=ParameterValue(type=77))
    (result,) = request(ros, SetParameters, "gravity/set_parameters", parameters=[unknown]).results
    assert (result.successful, result.reason) == (
        False,
        "parameter 'arm.name\\x1b[2J' has the type 77; allowed: 0 to 9",
    )
    answer = request(ros, SetParametersAtomically, "gravity/set_parameters_atomically", parameters=[unknown]).result
    assert not answer.successful
    assert request(ros, GetParameters, "gravity/get_parameters", names=["arm.name"]).values[0].string_value == "wam"
    for wrong, text in ([Parameter()], "unknown parameter ''"), ([Parameter(name="a")] * 501, "at most 500"):
        answer = request(ros, SetParametersAtomically, "gravity/set_parameters_atomically", parameters=wrong).result
        assert not answer.successful
        assert text in answer.reason
    assert not node.health.problems.get("exception"), "a wrong request is no fault of the node"


class Clumsy(TolerantNode):
    """A node whose callbacks raise while `is_wrong`."""

    def __init__(self, **ros: Any) -> None:
        super().__init__("clumsy", **ros)
        self.is_wrong = True
        self.calls = 0
        self.faults: list[str] = []
        self.create_subscription(DiagnosticStatus, "status", self._fail, 10)
        self.create_service(Trigger, "~/do", self._serve)

    def _fail(self, message: Any) -> None:
        self.calls += 1
        if self.is_wrong:
            raise ValueError("\x1b[31mtoo clumsy " + "x" * 5_000_000)

    def _serve(self, _: Any, response: Any) -> Any:
        raise KeyError("no such thing")

    def take_fault(self, reason: str) -> None:
        self.faults.append(reason)


def test_a_callback_that_raises_is_a_bounded_fault_until_all_goes_well_again(ros: Any) -> None:
    node = ros.add(Clumsy(context=ros.context, namespace="/wam"))
    sender = ros.node("sender").create_publisher(DiagnosticStatus, "status", 10)
    ros.wait(lambda: sender.get_subscription_count() == 1)
    for k in range(1, 6):
        sender.publish(DiagnosticStatus())
        ros.wait(lambda k=k: node.calls == k)
    (said,) = node.faults
    assert "unexpected ValueError: \\x1b[31mtoo clumsy xxx" in said
    assert "after a message on status" in said
    assert len(said) < 600
    node.is_wrong = False
    ros.wait(lambda: len(node.faults) == 2)
    assert node.faults[1] == ""
    answer = request(ros, Trigger, "clumsy/do")
    assert not answer.success
    assert "unexpected KeyError" in answer.message
    assert f", at {__file__}:" in answer.message


def test_a_message_that_is_handed_over_after_the_end_of_a_node_is_left_alone(ros: Any) -> None:
    node = ros.add(Clumsy(context=ros.context, namespace="/wam"))
    (callback,) = (found.callback for found in node.subscriptions if found.topic_name == "/wam/status")
    ros.remove(node)
    callback(DiagnosticStatus())
    assert node.calls == 0


@pytest.mark.parametrize("name", ["velocity_loop", "recorder"])
def test_the_driver_brakes_by_name_where_a_node_reports_a_fault(name: str, ros: Any, tmp_path: Path) -> None:
    driver = make(ros, tmp_path, "driver", ["driver", "velocity_loop", "recorder"])
    row = BY_NAME["status"]
    sender = ros.node("other").create_publisher(DiagnosticStatus, "status", qos(row))
    ros.wait(lambda: sender.get_subscription_count() >= 1)
    sender.publish(diagnostic_status(NodeStatus(Level.ERROR, "bad", name, fault="unexpected ValueError"), "wam"))
    ros.wait(lambda: driver.driver.safety.mode is Mode.FAULT, what="a fault")
    assert driver.driver.safety.fault == f"{name}: unexpected ValueError"
    request(ros, Trigger, "driver/reset_fault")
    answer = request(ros, SetBool, "driver/enable", data=True)
    assert (answer.success, f"{name}: unexpected ValueError" in answer.message) == (False, True)
    sender.publish(diagnostic_status(NodeStatus(Level.OK, "ready", name), "wam"))
    ros.wait(lambda: not driver.peers.faults)


def test_a_step_that_raises_is_reported_by_the_node_and_brakes_the_arm(ros: Any, tmp_path: Path) -> None:
    nodes = ["driver", "gravity"]
    driver = make(ros, tmp_path, "driver", nodes)
    gravity = make(ros, tmp_path, "gravity", nodes)
    body, gravity.node._body = gravity.node._body, None  # a defect of the node
    sender = ros.node("sender").create_publisher(JointState, "joint_states", 10)
    ros.wait(lambda: sender.get_subscription_count() == 1)
    names = list(WAM.shared.arm.joints.names)
    state = JointState(header=header(5_000_000), name=names, position=[0.0] * 4, velocity=[0.0] * 4, effort=[0.0] * 4)
    sender.publish(state)
    ros.wait(lambda: "gravity: unexpected AttributeError" in driver.driver.safety.fault, what="a fault by name")
    gravity._exception_time = -NODE_LIMITS.fault_held  # long ago, and no step since
    gravity._look_for_end()
    assert "unexpected AttributeError" in gravity.health.problem, "it has not worked since"
    request(ros, Trigger, "driver/reset_fault")
    assert "gravity: unexpected AttributeError" in request(ros, SetBool, "driver/enable", data=True).message
    gravity.node._body = body
    state.header = header(10_000_000)
    sender.publish(state)
    ros.wait(lambda: not driver.peers.faults, what="the node is well again")
    assert gravity.health.counts["steps"] == 2


def test_refusals_are_bounded_in_length_and_number(ros: Any, tmp_path: Path, capfd: Any) -> None:
    assert len(str(Refused("x" * 5_000_000))) < 1.2 * NODE_LIMITS.reason_length
    assert "\x1b" not in str(Refused("\x1b[2J"))
    gravity = make(ros, tmp_path, "gravity", ["gravity"])
    capfd.readouterr()
    for k in range(500):
        gravity.health.refuse("joint_states", f"reason {k} " + "y" * 10_000)
    lines = [line for line in capfd.readouterr().err.splitlines() if "refused" in line]
    assert 1 <= len(lines) <= 3
    assert sum(map(len, lines)) < 3000
    assert gravity.health.refusals["joint_states"].count == 500
    for topic in ("joint_states", "joint_torque", "joint_posture"):  # in the same way, as on a busy machine
        for _ in range(10):
            gravity.health.refuse(topic, "stamp 1 ns is ahead", is_reported=True)
    (line,) = (line for line in capfd.readouterr().err.splitlines() if "refused" in line)
    assert "joint_states: refused: stamp 1 ns is ahead" in line


def test_control_characters_are_shown_and_not_sent() -> None:
    assert printable("\x1b[31m/topic\n") == "\\x1b[31m/topic\\n"
    assert printable("a\nb\t\u202e", kept="\n") == "a\nb\\t\\u202e"
    assert printable("Gelenk ä 1") == "Gelenk ä 1"
    assert len(printable("z" * 10**6, 100)) < 140
