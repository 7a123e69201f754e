"""The action FollowJointTrajectory of a running stack, for MoveIt and other planners, where control_msgs is installed.

A program next to the stack, as one of the user's would be: it streams the trajectory of a goal on
`joint_trajectory`, which the force loop plays, and compares the arm with it.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse
from rclpy.duration import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_control.task.motion import Moving
from wam_control.task.trajectory_goal import GoalCode, GoalEnd, JointTolerance, TrajectoryGoal
from wam_description.signals import State
from wam_description.status import ENABLED
from wam_description.topics import BY_NAME
from wam_live.thresholds import LIVE
from wam_ros.client import StackClient
from wam_ros.messages import Refused, WrongNames, read_trajectory
from wam_ros.ros_topics import header, qos, stamp_of
from wam_ros.run import Closing

ACTION: Final = "follow_joint_trajectory"
TOPIC: Final = "joint_trajectory"


class TrajectoryServer(Closing):
    """Serves the action in the namespace of the arm; a new goal takes the place of the present one.

    Parameters
    ----------
    client : of the stack, with its shared parameters.
    report : called with a line for people that names the action.
    """

    def __init__(self, client: StackClient, report: Callable[[str], None]) -> None:
        self._client, self._node = client, client.node
        self._names = list(client.shared.arm.joints.names)
        self._goal: _Following | None = None
        self._last, self._stamp = time.monotonic(), 0
        self._server = ActionServer(
            self._node, FollowJointTrajectory, ACTION, self._follow, cancel_callback=lambda _: CancelResponse.ACCEPT
        )
        client.follow_statuses()
        client.listen("joint_states", self._take, "position velocity", self._refuse)
        self._node.create_timer(LIVE.watch, self._watch)
        report(f"action {self._node.get_namespace().rstrip('/')}/{ACTION}")

    def close(self) -> None:
        """End the goal, leave the topic to others."""
        self._end(GoalEnd(GoalCode.INVALID_GOAL, "the server of the action has ended"))
        self._server.destroy()

    @property
    def _obstacle(self) -> str:
        """Why the arm follows no goal, '' where it does."""
        driver = self._client.statuses.get("driver")
        if driver is None:
            return "the driver has sent no status"
        return "" if driver.mode == ENABLED else f"the arm is {driver.mode}: {driver.fault or 'enable it'}"

    def _watch(self) -> None:
        """End a goal of an arm that does not follow it, or that publishes nothing more."""
        silent = f"no joint_states for {LIVE.silent:g} s" * (time.monotonic() - self._last > LIVE.silent)
        if reason := self._obstacle or silent:
            self._end(GoalEnd(GoalCode.PATH_TOLERANCE_VIOLATED, reason))

    async def _follow(self, handle: Any) -> Any:
        """Run a goal to its end."""
        end = self._begin(handle) or await self._goal.future  # type: ignore[union-attr]
        if handle.is_cancel_requested:
            handle.canceled()
        elif end.code is GoalCode.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
            self._node.get_logger().warning(f"{ACTION}: {end.reason}")
        return FollowJointTrajectory.Result(error_code=int(end.code), error_string=end.reason)

    def _begin(self, handle: Any) -> GoalEnd | None:
        """Start a goal; why not, None where it has begun."""
        goal = handle.request
        if obstacle := self._obstacle:
            return GoalEnd(GoalCode.INVALID_GOAL, obstacle)
        try:
            path = read_trajectory(goal.trajectory, self._names)
            following = TrajectoryGoal(
                path,
                self._client.shared,
                self._tolerances(goal.path_tolerance),
                self._tolerances(goal.goal_tolerance),
                goal.goal_time_tolerance.sec + goal.goal_time_tolerance.nanosec * 1e-9,
            )
            if goal.multi_dof_trajectory.points or goal.component_path_tolerance or goal.component_goal_tolerance:
                raise Refused("joints of several degrees of freedom are named; this arm has none")
        except Refused as refusal:
            code = GoalCode.INVALID_JOINTS if isinstance(refusal, WrongNames) else GoalCode.INVALID_GOAL
            return GoalEnd(code, str(refusal))
        if stamp_of(goal.trajectory) > self._stamp > 0:
            return GoalEnd(GoalCode.INVALID_GOAL, "header.stamp is in the future; send 0, the arm starts at once")
        self._end(GoalEnd(GoalCode.INVALID_GOAL, "a newer goal took its place"))
        if self._client.is_published(TOPIC):
            return GoalEnd(GoalCode.INVALID_GOAL, f"another program publishes {TOPIC}; end it")
        publisher = self._node.create_publisher(JointTrajectory, TOPIC, qos(BY_NAME[TOPIC]))
        self._goal = _Following(handle, following, publisher, rclpy.Future(executor=self._node.executor))
        self._last = time.monotonic()
        return None

    def _tolerances(self, tolerances: Sequence[Any]) -> dict[str, JointTolerance]:
        for one in tolerances:
            if one.name not in self._names:
                raise WrongNames(f"unknown name '{one.name}' of a tolerance; allowed: {', '.join(self._names)}")
            if one.acceleration > 0.0:
                raise Refused(f"the tolerance of {one.name} names an acceleration, which is not measured; send 0")
        return {one.name: JointTolerance(one.position, one.velocity) for one in tolerances}

    def _refuse(self, reason: str) -> None:
        self._node.get_logger().warning(f"joint_states: refused: {reason}", once=True)

    def _take(self, stamp: int, joints: State) -> None:
        """Go on with the goal: the answer to each state of the arm."""
        before, self._stamp, self._last = self._stamp, stamp, time.monotonic()
        self._watch()
        following = self._goal
        if following is None:
            return
        if following.handle.is_cancel_requested:
            self._end(GoalEnd(GoalCode.SUCCESSFUL, "canceled; the arm stops"))
            return
        dt = (stamp - before) / 1e9 if 0 < before < stamp else 0.0
        end = following.goal.step(joints, dt)
        if end is not None:
            self._end(end)
            return
        trajectory = following.handle.request.trajectory
        trajectory.header.stamp = header(stamp).stamp
        following.publisher.publish(trajectory)
        if stamp - following.reported >= LIVE.feedback * 1e9 and following.goal.desired:
            following.reported = stamp
            following.handle.publish_feedback(self._feedback(stamp, joints, following.goal))

    def _feedback(self, stamp: int, joints: State, goal: TrajectoryGoal) -> Any:
        desired, actual = goal.desired, Moving(joints.position, joints.velocity)
        assert desired is not None
        error = Moving(*([b - a for a, b in zip(*pair, strict=True)] for pair in zip(actual, desired, strict=True)))
        time = Duration(seconds=goal.time).to_msg()
        points = [
            JointTrajectoryPoint(positions=one.position, velocities=one.velocity, time_from_start=time)
            for one in (desired, actual, error)
        ]
        feedback = FollowJointTrajectory.Feedback(header=header(stamp), joint_names=self._names)
        feedback.desired, feedback.actual, feedback.error = points
        return feedback

    def _end(self, end: GoalEnd) -> None:
        """Stop streaming, so that the arm stops, and send the client the result."""
        following, self._goal = self._goal, None
        if following is not None:
            self._node.destroy_publisher(following.publisher)
            following.future.set_result(end)


@dataclass
class _Following:
    """A goal under way, its publisher, and the stamp of its last feedback, ns."""

    handle: Any
    goal: TrajectoryGoal
    publisher: Any
    future: Any
    reported: int = 0
