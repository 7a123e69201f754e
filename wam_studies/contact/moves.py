"""Random moves of the arm that stay within its limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wam_control.task.motion import FASTEST
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody


@dataclass(frozen=True)
class MoveRanges:
    """How moves are drawn, and how fast parts of the arm may be."""

    slowest: float = 0.4  # rad/s, peak of the fastest joint
    fastest: float = 2.5  # rad/s
    shortest: float = 0.7  # s
    longest: float = 1.1  # s
    elbow_speed: float = 1.9  # m/s, well below the driver's limit, as the next
    tip_speed: float = 3.2  # m/s
    share: float = 0.6  # of the range of a joint, about its middle, of an arm without poses of its own
    margin: float = 0.1  # rad, from the ends of the joints
    return_probability: float = 0.3  # of a move back to the start of the last one


MOVES = MoveRanges()
# rad, middle of the poses of each joint and range each way from it, by arm
POSES = {"wam": ((0.0, 0.0, 0.0, 0.5), (1.5, 1.8, 1.5, 1.2))}


class MoveGenerator:
    """Random poses and moves of one arm."""

    def __init__(self, arm: Arm) -> None:
        self._body = RigidBody(arm)
        lower, upper = np.array(arm.joints.lower), np.array(arm.joints.upper)
        middle, span = map(np.array, POSES.get(arm.name, (0.5 * (lower + upper), 0.5 * MOVES.share * (upper - lower))))
        self._low = np.maximum(middle - span, lower + MOVES.margin)
        self._high = np.minimum(middle + span, upper - MOVES.margin)

    def pose(self, random: np.random.Generator) -> tuple[float, ...]:
        """A pose within the range, rad."""
        return tuple(random.uniform(self._low, self._high).tolist())

    def moves(
        self, random: np.random.Generator, start: Sequence[float], count: int, before: Sequence[float] = ()
    ) -> list[ScenarioStep]:
        """Successive moves, some of them back to the last start.

        Parameters
        ----------
        start : pose before the first one, rad.
        before : pose before `start`; empty if unknown.
        """
        result: list[ScenarioStep] = []
        last, here = np.array(before), np.array(start)
        for _ in range(count):
            seconds = float(random.uniform(MOVES.shortest, MOVES.longest))
            target = np.array(self.pose(random))
            if last.size and random.random() < MOVES.return_probability and np.abs(last - here).max() > 0.1:
                target = last
            way = target - here
            peak = float(random.uniform(MOVES.slowest, MOVES.fastest))
            way *= min(1.0, peak * seconds / FASTEST / float(np.abs(way).max()))
            way *= min(1.0, 1.0 / self._speed_ratio(here, way, seconds))
            last, here = here, here + way
            result.append(ScenarioStep("move", round(seconds, 3), tuple(here.tolist())))
        return result

    def _speed_ratio(self, here: np.ndarray, way: np.ndarray, seconds: float) -> float:
        """Greatest speed of elbow, wrist or tip, over the allowed one."""
        worst = 0.0
        for s in np.linspace(0.1, 0.9, 9):
            q = here + way * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
            qd = way * 30.0 * s * s * (1.0 - s) ** 2 / seconds
            *starts, tip = self._body.start_and_tool_speeds(q, qd)
            worst = max(worst, *(speed / MOVES.elbow_speed for speed in starts), tip / MOVES.tip_speed)
        return worst
