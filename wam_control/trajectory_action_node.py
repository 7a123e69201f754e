"""Node `trajectory_action`: the action FollowJointTrajectory in front of the topic `joint_trajectory`."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wam_control.trajectory_goal import GoalCode, GoalEnd, Tolerances, TrajectoryGoal
from wam_description.parameters import Nothing, ParameterError
from wam_description.signals import State
from wam_description.topics import BY_NAME
from wam_ros.header import stamp_of
from wam_ros.messages import Refused, read_joint_state, read_status, read_trajectory
from wam_ros.parameters import declare
from wam_ros.qos import qos

STREAMED = 4  # times within the age at which a command is stale
SECOND = 1_000_000_000


class TrajectoryAction:
    """`trajectory_action`, to be started next to the stack: it is no node that the others wait for."""

    name, parameters = "trajectory_action", Nothing
    ros_node = "wam_control.trajectory_action_node:TrajectoryActionNode"


class TrajectoryActionNode(Node):
    """Streams the trajectory of a goal until its end; a new goal takes the place of the present one."""

    def __init__(self, **ros: Any) -> None:
        try:
            from control_msgs.action import FollowJointTrajectory
        except ImportError:
            raise ParameterError(
                "the action FollowJointTrajectory needs control_msgs: apt install ros-jazzy-control-msgs; "
                "without it, stream the topic joint_trajectory"
            ) from None
        super().__init__(TrajectoryAction.name, **ros)
        self._shared, _ = declare(self, Nothing)
        self._names = list(self._shared.arm.joints.names)
        self._period = round(self._shared.ages.command / STREAMED * SECOND)
        self._kind, self._mode = FollowJointTrajectory, ""
        self._handle: Any = None
        self._goal: TrajectoryGoal | None = None
        self._ended: Future[GoalEnd] = Future()
        self._last = self._sent = 0
        self._publisher = self.create_publisher(JointTrajectory, "joint_trajectory", qos(BY_NAME["joint_trajectory"]))
        self.create_subscription(JointState, "joint_states", self._take_state, qos(BY_NAME["joint_states"]))
        self.create_subscription(DiagnosticStatus, "status", self._take_status, qos(BY_NAME["status"]))
        self._server = ActionServer(
            self,
            FollowJointTrajectory,
            "follow_joint_trajectory",
            self._execute,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )

    def destroy_node(self) -> None:
        """The server is no entity that the node destroys by itself."""
        self._server.destroy()
        super().destroy_node()

    async def _execute(self, handle: Any) -> Any:
        """Follow a goal and answer with how it ended; what is wrong with it is in the answer, too."""
        self._finish(GoalEnd(GoalCode.INVALID_GOAL, "another goal has come"))
        try:
            self._goal = self._read(handle.request)
        except Refused as reason:
            is_ours = sorted(handle.request.trajectory.joint_names) == sorted(self._names)
            end = GoalEnd(GoalCode.INVALID_GOAL if is_ours else GoalCode.INVALID_JOINTS, str(reason))
        else:
            self._handle, self._ended, self._sent = handle, Future(), 0
            end = await self._ended
        if handle.is_cancel_requested:
            handle.canceled()
        elif end.code is GoalCode.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
        self.get_logger().info(f"goal: {end.code.name.lower()}: {end.text}")
        return self._kind.Result(error_code=int(end.code), error_string=end.text)

    def _read(self, request: Any) -> TrajectoryGoal:
        if self._mode != "enabled":
            raise Refused(f"the driver is {self._mode or 'not there'}; enable it first: call driver/enable")
        if request.multi_dof_trajectory.points:
            raise Refused("multi_dof_trajectory has points; the joints of the arm have one degree of freedom each")
        if stamp_of(request.trajectory) > self._last:
            raise Refused("the trajectory is to start later; send it without a stamp, when it is to start")
        given = {name: {} for name in ("path_tolerance", "goal_tolerance")}  # type: dict[str, dict[str, float]]
        for name, found in given.items():
            for one in getattr(request, name):
                if one.name not in self._names:
                    raise Refused(f"{name} names '{one.name}'; allowed are {', '.join(self._names)}")
                if one.position > 0.0:
                    found[one.name] = one.position
        time = request.goal_time_tolerance
        tolerances = Tolerances(given["path_tolerance"], given["goal_tolerance"], time.sec + time.nanosec / SECOND)
        path = read_trajectory(request.trajectory, self._names)
        return TrajectoryGoal(path, tolerances, self._shared.arm, self._shared.motion)

    def _finish(self, end: GoalEnd) -> None:
        if self._goal is not None and not self._ended.done():
            self._ended.set_result(end)
        self._goal = None

    def _take_status(self, message: DiagnosticStatus) -> None:
        status = read_status(message)
        if status.node == "driver":
            self._mode = status.mode
            if status.mode != "enabled":
                self._finish(GoalEnd(GoalCode.INVALID_GOAL, f"the driver stopped: {status.fault or status.mode}"))

    def _take_state(self, message: JointState) -> None:
        stamp, before = stamp_of(message), self._last
        self._last = stamp
        if self._goal is None or not 0 < stamp - before < SECOND:
            return
        if self._handle.is_cancel_requested:
            self._finish(GoalEnd(GoalCode.SUCCESSFUL, "cancelled; the arm stops"))
            return
        try:
            state = read_joint_state(message, self._names, "position velocity")
        except Refused as reason:
            self.get_logger().warning(f"joint_states: refused: {reason}", throttle_duration_sec=1.0)
            return
        if stamp - self._sent >= self._period:
            self._sent = stamp
            trajectory = self._handle.request.trajectory
            trajectory.header.stamp = message.header.stamp  # the state that it answers
            self._publisher.publish(trajectory)
            self._publish_feedback(message, state)
        if end := self._goal.step(state.position, state.velocity, (stamp - before) / SECOND):
            self._finish(end)

    def _publish_feedback(self, message: JointState, state: State) -> None:
        desired = self._goal.desired if self._goal else None
        feedback = self._kind.Feedback(header=message.header, joint_names=self._names)
        feedback.actual = JointTrajectoryPoint(positions=state.position, velocities=state.velocity)
        if desired is not None:
            feedback.desired = JointTrajectoryPoint(positions=desired.position, velocities=desired.velocity)
            both = zip(desired.position, state.position, strict=True)
            feedback.error = JointTrajectoryPoint(positions=[a - b for a, b in both])
        self._handle.publish_feedback(feedback)
