"""The action FollowJointTrajectory of a running stack, for MoveIt and other planners, where control_msgs is installed.

A node next to the stack, as a program of the user's would be: it streams the trajectory of a goal on
`joint_trajectory`, which the force loop plays, and compares the arm with it.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import rclpy
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_control.task.motion import Moving
from wam_control.task.trajectory_goal import GoalCode, GoalEnd, JointTolerance, TrajectoryGoal
from wam_description.arm import Shared
from wam_description.signals import State
from wam_description.topics import BY_NAME, STATUS
from wam_live.thresholds import LIVE
from wam_ros.client import run_next_to
from wam_ros.messages import Refused, WrongNames, message_type, read_status, read_trajectory
from wam_ros.ros_topics import header, qos
from wam_ros.wire import decoder, stamp_in

ACTION: Final = "follow_joint_trajectory"
TOPIC: Final = "joint_trajectory"


class TrajectoryActionNode(Node):
    """Serves the action in the namespace of the arm; a new goal takes the place of the present one.

    Parameters
    ----------
    context, namespace : of ROS.
    shared : shared parameters of the driver.
    """

    def __init__(self, context: Any, namespace: str, shared: Shared) -> None:
        super().__init__("trajectory_action", context=context, namespace=namespace)
        self._shared = shared
        self._names = list(shared.arm.joints.names)
        self._goal: _Following | None = None
        self._last, self._stamp = time.monotonic(), 0
        self._obstacle = "the driver has sent no status"
        self._server = ActionServer(
            self, FollowJointTrajectory, ACTION, self._follow, cancel_callback=lambda _: CancelResponse.ACCEPT
        )
        states, status = BY_NAME["joint_states"], BY_NAME[STATUS]
        self._decode = decoder(states, shared, "position velocity")
        self.create_subscription(JointState, "joint_states", self._take, qos(states), raw=True)
        self.create_subscription(message_type(status), STATUS, self._take_status, qos(status))

    def destroy_node(self) -> None:
        """End the goal, leave the topic to others."""
        self._end(GoalEnd(GoalCode.INVALID_GOAL, "the server of the action has ended"))
        self._server.destroy()
        super().destroy_node()

    def watch(self) -> None:
        """End a goal of an arm that publishes nothing more; to be called now and then."""
        if self._goal and time.monotonic() - self._last > LIVE.silent:
            self._end(GoalEnd(GoalCode.PATH_TOLERANCE_VIOLATED, f"no joint_states for {LIVE.silent:g} s"))

    async def _follow(self, handle: Any) -> Any:
        """Run a goal to its end."""
        end = self._begin(handle) or await self._goal.future  # type: ignore[union-attr]
        if handle.is_cancel_requested:
            handle.canceled()
        elif end.code is GoalCode.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
            self.get_logger().warning(f"{ACTION}: {end.reason}")
        return FollowJointTrajectory.Result(error_code=int(end.code), error_string=end.reason)

    def _begin(self, handle: Any) -> GoalEnd | None:
        """Start a goal; why not, None where it has begun."""
        goal = handle.request
        if self._obstacle:
            return GoalEnd(GoalCode.INVALID_GOAL, self._obstacle)
        try:
            path = read_trajectory(goal.trajectory, self._names)
            following = TrajectoryGoal(
                path,
                self._shared,
                self._tolerances(goal.path_tolerance),
                self._tolerances(goal.goal_tolerance),
                goal.goal_time_tolerance.sec + goal.goal_time_tolerance.nanosec * 1e-9,
            )
            if goal.multi_dof_trajectory.points or goal.component_path_tolerance or goal.component_goal_tolerance:
                raise Refused("joints of several degrees of freedom are named; this arm has none")
        except Refused as refusal:
            code = GoalCode.INVALID_JOINTS if isinstance(refusal, WrongNames) else GoalCode.INVALID_GOAL
            return GoalEnd(code, str(refusal))
        if Time.from_msg(goal.trajectory.header.stamp).nanoseconds > self._stamp > 0:
            return GoalEnd(GoalCode.INVALID_GOAL, "header.stamp is in the future; send 0, the arm starts at once")
        self._end(GoalEnd(GoalCode.INVALID_GOAL, "a newer goal took its place"))
        if self.count_publishers(TOPIC):
            return GoalEnd(GoalCode.INVALID_GOAL, f"another program publishes {TOPIC}; end it")
        row = BY_NAME[TOPIC]
        publisher = self.create_publisher(JointTrajectory, TOPIC, qos(row))
        self._goal = _Following(handle, following, publisher, rclpy.Future(executor=self.executor))
        self._last = time.monotonic()
        return None

    def _tolerances(self, tolerances: Sequence[Any]) -> dict[str, JointTolerance]:
        for one in tolerances:
            if one.name not in self._names:
                raise WrongNames(f"unknown name '{one.name}' of a tolerance; allowed: {', '.join(self._names)}")
            if one.acceleration > 0.0:
                raise Refused(f"the tolerance of {one.name} names an acceleration, which is not measured; send 0")
        return {one.name: JointTolerance(one.position, one.velocity) for one in tolerances}

    def _take(self, data: bytes) -> None:
        """Go on with the goal: the answer to each state of the arm; one of another program may be none."""
        try:
            joints = self._decode(data)
        except Refused as reason:
            self.get_logger().warning(f"joint_states: refused: {reason}", once=True)
            return
        stamp, before = stamp_in(data), self._stamp
        self._stamp, self._last = stamp, time.monotonic()
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
        points = []
        for one in (desired, actual, error):
            points.append(point := JointTrajectoryPoint(positions=one.position, velocities=one.velocity))
            point.time_from_start.sec = int(goal.time)
            point.time_from_start.nanosec = int(goal.time % 1.0 * 1e9)
        feedback = FollowJointTrajectory.Feedback(joint_names=self._names)
        feedback.header.stamp = header(stamp).stamp
        feedback.desired, feedback.actual, feedback.error = points
        return feedback

    def _take_status(self, message: DiagnosticStatus) -> None:
        status = read_status(message)
        if status.node != "driver":
            return
        self._obstacle = "" if status.mode == "enabled" else f"the arm is {status.mode}: {status.fault or 'enable it'}"
        if self._obstacle:
            self._end(GoalEnd(GoalCode.PATH_TOLERANCE_VIOLATED, self._obstacle))

    def _end(self, end: GoalEnd) -> None:
        """Stop streaming, so that the arm stops, and send the client the result."""
        following, self._goal = self._goal, None
        if following is not None:
            self.destroy_publisher(following.publisher)
            following.future.set_result(end)


@dataclass
class _Following:
    """A goal under way, its publisher, and the stamp of its last feedback, ns."""

    handle: Any
    goal: TrajectoryGoal
    publisher: Any
    future: Any
    reported: int = 0


def serve(namespace: str, until: Callable[[], bool], report: Callable[[str], None]) -> None:
    """Serve the action of the stack in a namespace until a condition holds; a stack that comes later is waited for."""

    def make(context: Any, shared: Shared) -> TrajectoryActionNode:
        node = TrajectoryActionNode(context, namespace, shared)
        report(f"action {node.get_namespace().rstrip('/')}/{ACTION}")
        return node

    run_next_to(namespace, make, until, TrajectoryActionNode.watch)
