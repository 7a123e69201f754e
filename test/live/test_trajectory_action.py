"""The action FollowJointTrajectory over topics, as a planner calls it, around the whole stack."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("control_msgs", reason="needs control_msgs, of a ROS installation; it is not in the wheels")
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectoryPoint

from wam_control.task.trajectory_goal import GoalCode
from wam_description.configuration import Configuration, packaged
from wam_live.trajectory_action import TrajectoryServer
from wam_ros.bring_up import Composition
from wam_ros.client import StackClient

JOINTS = ("joint1", "joint2", "joint3", "joint4")
REACHED = [0.1, -0.9, 0.0, 0.4]
Client = Callable[..., tuple[int, int, str, list[Any]]]


@pytest.fixture
def follow(domain_id: int) -> Iterator[Client]:
    """Sends a goal to an enabled stack: status, error code and text of its end, and the feedback."""
    configuration = Configuration.load(packaged("wam")).with_values({"timing.real_time_factor": 2.0})
    with Composition(configuration, domain_id=domain_id) as stack:
        server = TrajectoryServer(StackClient("wam", "trajectory_action", stack, configuration.shared), print)
        node = stack.add(Node("planner", context=stack.context, namespace="wam"))
        client = ActionClient(node, FollowJointTrajectory, "follow_joint_trajectory")
        brakes = node.create_client(SetBool, "driver/enable")

        def wait(future: Any) -> Any:
            stack.spin(future.done)
            return future.result()

        def enable(on: bool) -> None:
            stack.spin(brakes.service_is_ready)
            assert wait(brakes.call_async(SetBool.Request(data=on))).success

        def send(
            points: list[tuple[float, list[float]]],
            names: tuple[str, ...] = JOINTS,
            on_path: tuple[JointTolerance, ...] = (),
            after: Callable[[Any, list[Any]], Any] = lambda handle, feedback: None,
        ) -> tuple[int, int, str, list[Any]]:
            goal = FollowJointTrajectory.Goal(path_tolerance=on_path)
            goal.trajectory.joint_names = list(names)
            for time, positions in points:
                since = Duration(sec=int(time), nanosec=round(time % 1.0 * 1e9))
                goal.trajectory.points.append(JointTrajectoryPoint(positions=positions, time_from_start=since))
            feedback: list[Any] = []
            stack.spin(client.server_is_ready)
            handle = wait(client.send_goal_async(goal, lambda message: feedback.append(message.feedback)))
            result = handle.get_result_async()
            stack.spin(lambda: result.done() or after(handle, feedback))
            found = wait(result)
            return found.status, found.result.error_code, found.result.error_string, feedback

        send.enable = enable  # type: ignore[attr-defined]
        stack.spin(lambda: node.count_publishers("status") > 0)
        enable(True)
        stack.spin(lambda: not server._obstacle)
        yield send
        server.close()


def test_goals_are_followed_cancelled_and_refused_with_the_reason(follow: Client) -> None:
    status, code, reason, feedback = follow([(1.0, REACHED)])
    assert (status, code, reason) == (GoalStatus.STATUS_SUCCEEDED, GoalCode.SUCCESSFUL, "")
    assert len(feedback) > 10
    assert max(map(abs, feedback[-1].error.positions)) < 0.01
    assert feedback[-1].desired.positions.tolist() == pytest.approx(REACHED, abs=0.01)

    reordered = ("joint4", "joint3", "joint2", "joint1")
    back = [(0.0, REACHED[::-1]), (1.0, [0.3, 0.0, -0.8, 0.0])]  # with a point where the arm is, as planners send it
    status, _, reason, feedback = follow(back, reordered)
    assert (status, reason) == (GoalStatus.STATUS_SUCCEEDED, "")
    assert feedback[-1].actual.positions.tolist() == pytest.approx([0.0, -0.8, 0.0, 0.3], abs=0.02)

    wrong = {
        ("of the trajectory reaches", GoalCode.INVALID_GOAL): ([(0.05, REACHED)], JOINTS),
        ("unknown name 'elbow'", GoalCode.INVALID_JOINTS): ([(1.0, REACHED)], ("elbow", *JOINTS[1:])),
        ("starts at", GoalCode.INVALID_GOAL): ([(0.0, [1.0, -0.9, 0.0, 0.4]), (2.0, REACHED)], JOINTS),
        ("0 points", GoalCode.INVALID_GOAL): ([], JOINTS),
    }
    for (text, expected), (points, names) in wrong.items():
        status, code, reason, feedback = follow(points, names)
        assert (status, code) == (GoalStatus.STATUS_ABORTED, expected)
        assert text in reason
        assert not feedback

    tight = (JointTolerance(name="joint1", position=1e-7),)
    status, code, reason, _ = follow([(1.0, REACHED)], on_path=tight)
    assert (status, code) == (GoalStatus.STATUS_ABORTED, GoalCode.PATH_TOLERANCE_VIOLATED)
    assert "joint1 is off by" in reason

    cancelled: list[Any] = []

    def cancel(handle: Any, feedback: list[Any]) -> None:
        if len(feedback) > 5 and not cancelled:
            cancelled.append(handle.cancel_goal_async())

    status, _, reason, feedback = follow([(3.0, [0.3, -1.2, 0.0, 0.8])], after=cancel)
    assert (status, reason) == (GoalStatus.STATUS_CANCELED, "canceled; the arm stops")
    assert feedback[-1].actual.positions[1] > -1.1, "it stopped on the way"


def test_brakes_end_a_goal_and_a_braked_arm_takes_none(follow: Any) -> None:
    braked: list[bool] = []

    def brake(handle: Any, feedback: list[Any]) -> None:
        if len(feedback) > 5 and not braked:
            braked.append(True)
            follow.enable(False)

    status, code, reason, _ = follow([(3.0, [0.3, -1.2, 0.0, 0.8])], after=brake)
    assert (status, code) == (GoalStatus.STATUS_ABORTED, GoalCode.PATH_TOLERANCE_VIOLATED)
    assert reason.startswith("the arm is braked")
    status, code, reason, _ = follow([(3.0, REACHED)])
    assert (status, code) == (GoalStatus.STATUS_ABORTED, GoalCode.INVALID_GOAL)
    assert reason.startswith("the arm is braked")
