"""A trajectory as a goal: its end without ROS and, where control_msgs is installed, the action itself on the arm."""

from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from conftest import ROOT
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_control.trajectory_goal import GoalCode, GoalEnd, Tolerances, TrajectoryGoal
from wam_description.configuration import Configuration
from wam_description.parameters import ParameterError
from wam_description.signals import PathPoint, PosturePath

CONFIGURATION = Configuration.load(ROOT / "config" / "wam.yaml")
SHARED = CONFIGURATION.shared
START, REST, DT = [0.0, -1.2, 0.2, 0.3], [0.0] * 4, 0.01
NONE = Tolerances({}, {}, 0.0)


def followed(tolerances: Tolerances, joint1: float, lag: float = 0.0, longest: float = 20.0) -> tuple[GoalEnd, float]:
    """How a goal ends that an arm follows with joint1 `lag` behind, and when."""
    path = PosturePath((PathPoint((joint1, *START[1:])),))
    goal = TrajectoryGoal(path, tolerances, SHARED.arm, SHARED.motion)
    q, time = list(START), 0.0
    while time < longest:
        time += DT
        if end := goal.step(q, REST, DT):
            return end, time
        assert goal.desired is not None
        q = [goal.desired.position[0] - lag, *goal.desired.position[1:]]
    return GoalEnd(GoalCode.SUCCESSFUL, "never"), time


def test_a_goal_that_is_followed_succeeds_at_its_end_and_says_how_far_off_it_is() -> None:
    end, _ = followed(NONE, 0.3, 0.02)
    assert end == (GoalCode.SUCCESSFUL, "at rest, joint1 0.02 rad from the goal")


def test_too_far_from_the_trajectory_is_seen_at_once_and_too_far_from_the_goal_at_the_end() -> None:
    end, when = followed(Tolerances({"joint1": 0.01}, {}, 0.0), 0.3, 0.02)
    assert end.code is GoalCode.PATH_TOLERANCE_VIOLATED
    assert "joint1 is 0.02 rad from the trajectory; allowed: 0.01" in end.text
    assert when < 3 * DT
    end, when = followed(Tolerances({}, {"joint1": 0.01}, 0.5), 0.3, 0.02)
    at_once = followed(Tolerances({}, {"joint1": 0.01}, 0.0), 0.3, 0.02)
    assert end.code is at_once[0].code is GoalCode.GOAL_TOLERANCE_VIOLATED
    assert when - at_once[1] == pytest.approx(0.5, abs=2 * DT)


def test_a_goal_beyond_the_limits_is_refused_with_the_joint() -> None:
    end, _ = followed(NONE, 9.0)
    assert end.code is GoalCode.INVALID_GOAL
    assert "joint1" in end.text


def test_without_control_msgs_the_node_says_what_to_install(ros: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    from wam_ros.node import make_node

    monkeypatch.setitem(sys.modules, "control_msgs.action", None)
    with pytest.raises(ParameterError, match=r"apt install ros-jazzy-control-msgs"):
        make_node("wam_control.trajectory_action_node:TrajectoryAction", context=ros.context)


def test_the_action_moves_the_arm_and_refuses_with_the_reason(domain_id: int) -> None:
    action = pytest.importorskip("control_msgs.action").FollowJointTrajectory
    from rclpy.action import ActionClient
    from rclpy.node import Node

    from wam_ros.bring_up import Composition, parameter_file
    from wam_ros.node import make_node

    quick = {"timing.mode": "lockstep", "timing.real_time_factor": 0.0, "timing.timeout": 60.0}
    configuration = CONFIGURATION.with_values(quick)
    entry = "wam_control.trajectory_action_node:TrajectoryAction"
    with Composition(configuration, domain_id=domain_id) as stack, parameter_file(configuration) as file:
        ros = {"context": stack.context, "namespace": "wam"}
        given = ["--ros-args", "--params-file", str(file)]
        server, client = make_node(entry, **ros, cli_args=given), Node("client", **ros)
        for node in (server, client):
            stack.executor.add_node(node)
        enable = client.create_client(SetBool, "driver/enable")
        goals = ActionClient(client, action, "follow_joint_trajectory")
        stack.spin(lambda: enable.service_is_ready() and goals.server_is_ready())

        def answer(future: Any) -> Any:
            stack.spin(future.done)
            return future.result()

        def result(goal: Any, feedback: Any = None) -> Any:
            handle = answer(goals.send_goal_async(goal, feedback))
            return answer(handle.get_result_async())

        names = list(SHARED.arm.joints.names)
        there = JointTrajectory(joint_names=names[::-1], points=[JointTrajectoryPoint(positions=[1.2, 0.1, -1.6, 0.1])])
        refused = result(action.Goal(trajectory=there))
        assert (refused.status, refused.result.error_code) == (6, -1)
        assert "enable it first" in refused.result.error_string
        assert answer(enable.call_async(SetBool.Request(data=True))).success
        seen: list[Any] = []
        done = result(action.Goal(trajectory=there), seen.append)
        assert (done.status, done.result.error_code) == (4, 0), done.result.error_string
        assert list(seen[-1].feedback.actual.positions) == pytest.approx([0.1, -1.6, 0.1, 1.2], abs=0.05)
        wrong = JointTrajectory(joint_names=["a", *names[1:]], points=there.points)
        refused = result(action.Goal(trajectory=wrong))
        assert (refused.status, refused.result.error_code) == (6, -2)
        assert "unknown name 'a'" in refused.result.error_string
        slow = JointTrajectoryPoint(positions=[-1.0, -1.6, 0.1, 1.2], time_from_start=Duration(sec=1000))
        far = JointTrajectory(joint_names=names, points=[slow])
        moved = len(seen)
        handle = answer(goals.send_goal_async(action.Goal(trajectory=far), seen.append))
        stack.spin(lambda: len(seen) > moved + 5)
        answer(handle.cancel_goal_async())
        ended = answer(handle.get_result_async())
        assert (ended.status, ended.result.error_string) == (5, "cancelled; the arm stops")
        goals.destroy()
        server.destroy_node()
        client.destroy_node()
