"""Trajectories of others: how a goal of FollowJointTrajectory goes, and a trajectory that a program streams."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from enum import IntEnum
from statistics import fmean
from typing import Final, NamedTuple

from wam_control.task.motion import Moving, PostureMotion
from wam_control.thresholds import MOTION
from wam_description.arm import Shared
from wam_description.parameters import ParameterError
from wam_description.signals import PosturePath, State


class GoalCode(IntEnum):
    """The numbers of control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalEnd(NamedTuple):
    """How a goal ended; the reason is '' if it was reached."""

    code: GoalCode
    reason: str


class JointTolerance(NamedTuple):
    """Largest error of a joint, rad and rad/s; 0 for the default, below 0 for no limit."""

    position: float = 0.0
    velocity: float = 0.0


NO_TOLERANCE: Final = JointTolerance()


class TrajectoryPlayer:
    """Converts trajectories to postures.

    Parameters
    ----------
    shared : of the arm, with the limits of joints and motions, and the dither.

    Attributes
    ----------
    trajectory : that was streamed in the last period, None for none.
    refusal : why the present trajectory is not played, '' where it is.
    motion : the present trajectory; None until the arm is at rest and it has begun.
    time : s, since it began.
    """

    def __init__(self, shared: Shared) -> None:
        self._arm, self._limits, timing = shared.arm, shared.motion, shared.timing
        # a dither shakes the joints: they rest where their mean over a cycle does
        self._velocities = deque[Sequence[float]](maxlen=math.ceil(timing.dither_cycle / timing.outer_divisor) or 1)
        self._waited = 0.0
        self.trajectory: PosturePath | None = None
        self.motion: PostureMotion | None = None
        self.time, self.refusal = 0.0, ""

    def step(self, trajectory: PosturePath | None, q: Sequence[float], qd: Sequence[float], dt: float) -> Moving | None:
        """The posture of this period; None where the arm is to stay where it is.

        Parameters
        ----------
        trajectory : that is streamed now; None for none.
        q, qd : joint angles and velocities (n,), rad and rad/s.
        dt : outer period, s.
        """
        if self.trajectory is None:
            self._velocities.clear()
        self._velocities.append(qd)
        if trajectory != self.trajectory:
            self.trajectory, self.motion, self.time, self.refusal, self._waited = trajectory, None, 0.0, "", 0.0
        if trajectory is None or (self.refusal and not self._waited):
            return None
        if self.motion is None:
            if len(self._velocities) != self._velocities.maxlen:
                return None
            speed = max(abs(fmean(each)) for each in zip(*self._velocities, strict=True))
            if speed > MOTION.at_rest:
                self._waited += dt
                if self._waited > MOTION.goal_time:
                    allowed = f"a trajectory begins at rest, below {MOTION.at_rest:g} rad/s"
                    self.refusal = f"a joint moves at {speed:.3g} rad/s; {allowed}; stop the arm"
                return None
            self._waited, self.refusal = 0.0, ""
            try:
                self.motion = PostureMotion(q, trajectory, self._arm, self._limits)
            except ParameterError as error:
                self.refusal = f"{error}; the arm stays where it is"
                return None
        self.time += dt
        return self.motion.at(self.time)


class TrajectoryGoal:
    """Compares the arm with a trajectory that the force loop plays at the same time.

    Parameters
    ----------
    path : of the client.
    shared : as of the player.
    on_path, at_goal : tolerances by name of the joint; usual is none on the path, and `arrived` at the goal.
    goal_time : s after the end; 0 for `goal_time`.

    Attributes
    ----------
    desired : where the arm is to be; None until it is at rest and the trajectory has begun.
    """

    def __init__(
        self,
        path: PosturePath,
        shared: Shared,
        on_path: Mapping[str, JointTolerance],
        at_goal: Mapping[str, JointTolerance],
        goal_time: float,
    ) -> None:
        self._path, self._player = path, TrajectoryPlayer(shared)
        self._names = names = shared.arm.joints.names
        self._on_path = [on_path.get(name, NO_TOLERANCE) for name in names]
        goal = [at_goal.get(name, NO_TOLERANCE) for name in names]
        self._at_goal = [one._replace(position=one.position or MOTION.arrived) for one in goal]
        self._goal_time = goal_time or MOTION.goal_time
        self.desired: Moving | None = None

    @property
    def time(self) -> float:
        """Since the trajectory began, s."""
        return self._player.time

    def step(self, joints: State, dt: float) -> GoalEnd | None:
        """Go on by one period; how the goal ended, None while it has not.

        Parameters
        ----------
        joints : angles and velocities (n,), rad and rad/s.
        dt : s, since the last period.
        """
        self.desired = self._player.step(self._path, joints.position, joints.velocity, dt)
        if self._player.refusal:
            return GoalEnd(GoalCode.INVALID_GOAL, self._player.refusal)
        if self.desired is None or self._player.motion is None:
            return None
        if off := self._error(joints, self._on_path):
            return GoalEnd(GoalCode.PATH_TOLERANCE_VIOLATED, f"{off}, {self.time:.3f} s after the start")
        late = self.time - self._player.motion.duration
        if late < 0.0:
            return None
        if not (off := self._error(joints, self._at_goal)):
            return GoalEnd(GoalCode.SUCCESSFUL, "")
        if late <= self._goal_time:
            return None
        return GoalEnd(GoalCode.GOAL_TOLERANCE_VIOLATED, f"{off}, {late:.3f} s after the end")

    def _error(self, joints: State, allowed: list[JointTolerance]) -> str:
        """The first joint that is off by more than is allowed, '' for none."""
        assert self.desired is not None
        pairs = ((self.desired.position, joints.position, "rad"), (self.desired.velocity, joints.velocity, "rad/s"))
        for k, (desired, actual, unit) in enumerate(pairs):
            for name, want, got, most in zip(self._names, desired, actual, allowed, strict=True):
                if 0.0 < most[k] < abs(got - want):
                    return f"{name} is off by {got - want:.3g} {unit}, allowed: {most[k]:g} {unit}"
        return ""
