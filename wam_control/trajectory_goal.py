"""A trajectory as a goal: followed until its time is over and the arm rests, within the tolerances of its sender."""

import enum
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from wam_control.motion import Moving
from wam_control.trajectory_player import AT_REST, TrajectoryPlayer
from wam_description.arm import Arm, MotionParameters
from wam_description.signals import PosturePath


class GoalCode(enum.IntEnum):
    """How a goal ended; the values are those of control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalEnd(NamedTuple):
    """The code, and what it rests on."""

    code: GoalCode
    text: str


class Tolerances(NamedTuple):
    """Largest distances from the trajectory on its way and at its end, rad, by joint, and the time to reach it, s.

    A joint that is not named has none; so has the time that is 0.
    """

    path: Mapping[str, float]
    goal: Mapping[str, float]
    time: float


class TrajectoryGoal:
    """Plays the trajectory next to the force loop, with the same code, and compares.

    Attributes
    ----------
    desired : where the arm should be, None before it starts.
    """

    def __init__(self, trajectory: PosturePath, tolerances: Tolerances, arm: Arm, limits: MotionParameters) -> None:
        self._trajectory, self._tolerances, self._names = trajectory, tolerances, arm.joints.names
        self._player = TrajectoryPlayer(arm, limits)
        self._late = 0.0
        self.desired: Moving | None = None

    def step(self, q: Sequence[float], qd: Sequence[float], dt: float) -> GoalEnd | None:
        """How the goal ended, None while it goes on.

        Parameters
        ----------
        q, qd : joint angles and velocities (n,), rad and rad/s.
        dt : since the last step, s.
        """
        self.desired = self._player.step(self._trajectory, q, qd, dt)
        if self._player.refusal:
            return GoalEnd(GoalCode.INVALID_GOAL, self._player.refusal)
        if self.desired is None:
            return None
        off = {name: abs(a - b) for name, a, b in zip(self._names, q, self.desired.position, strict=True)}
        if far := _beyond(off, self._tolerances.path):
            return GoalEnd(GoalCode.PATH_TOLERANCE_VIOLATED, far)
        if not self._player.is_over:
            return None
        self._late += dt
        far = _beyond(off, self._tolerances.goal)
        if not far and max(map(abs, qd)) <= AT_REST:
            worst = max(off, key=lambda name: off[name])
            return GoalEnd(GoalCode.SUCCESSFUL, f"at rest, {worst} {off[worst]:.2g} rad from the goal")
        if (far and self._late > self._tolerances.time) or 0.0 < self._tolerances.time < self._late:
            return GoalEnd(GoalCode.GOAL_TOLERANCE_VIOLATED, far or f"not at rest after {self._late:.3g} s")
        return None


def _beyond(off: Mapping[str, float], tolerances: Mapping[str, float]) -> str:
    return next(
        (
            f"{name} is {off[name]:.3g} rad from the trajectory; allowed: {most:g}"
            for name, most in tolerances.items()
            if off[name] > most
        ),
        "",
    )
