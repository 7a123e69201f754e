"""Plays a trajectory that a program streams: the same one goes on, another one starts, none stops the arm."""

from collections.abc import Sequence

from wam_control.task.motion import Moving, PostureMotion
from wam_control.thresholds import MOTION
from wam_description.arm import Arm, MotionParameters
from wam_description.parameters import ParameterError
from wam_description.signals import PosturePath


class TrajectoryPlayer:
    """Makes postures of trajectories.

    Parameters
    ----------
    arm : with the limits of the joints.
    limits : of motions.

    Attributes
    ----------
    refusal : why the present trajectory is not played, '' where it is.
    """

    def __init__(self, arm: Arm, limits: MotionParameters) -> None:
        self._arm, self._limits = arm, limits
        self._present: PosturePath | None = None
        self._motion: PostureMotion | None = None
        self._time = 0.0
        self.refusal = ""

    def step(self, trajectory: PosturePath | None, q: Sequence[float], qd: Sequence[float], dt: float) -> Moving | None:
        """The posture of this period; None where the arm is to stay where it is.

        Parameters
        ----------
        trajectory : that is streamed now; None for none.
        q, qd : joint angles and velocities (n,), rad and rad/s.
        dt : outer period, s.
        """
        if trajectory != self._present:
            self._present, self._motion, self.refusal = trajectory, None, ""
        if trajectory is None or self.refusal:
            return None
        if self._motion is None:
            if max(map(abs, qd)) > MOTION.at_rest:
                return None
            try:
                self._motion = PostureMotion(q, trajectory, self._arm, self._limits)
            except ParameterError as error:
                self.refusal = f"{error}; the arm stays where it is"
                return None
            self._time = 0.0
        self._time += dt
        return self._motion.at(self._time)
