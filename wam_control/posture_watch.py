"""Whether a commanded posture, or the position along an axis, moves on faster than the arm follows."""

import math
from collections.abc import Sequence
from typing import Final

CAUGHT_UP: Final = 1.25  # of the largest joint speed: on a path up to so fast the arm lags behind, and arrives in time
PAUSE: Final = 0.1  # s, after which a posture that changes is another goal, to which the arm goes as fast as it may
BEHIND: Final = 0.02  # rad, of an axis m, from where the posture is as it moves on, from which the arm is late
ROUNDING: Final = 1e-9  # s, rad
STILL: Final = [0.0]


class PostureWatch:
    """Compares a posture that moves with what follows it as fast as the arm may.

    A posture with velocities promises its path, on which the arm is to be at any time; one without them its end alone.

    Parameters
    ----------
    names : of the joints, or of an axis of a task.
    what : is commanded.
    limit, unit : name and unit of the largest speed, which `step` is given.
    """

    def __init__(self, names: Sequence[str], what: str, limit: str, unit: str) -> None:
        self._names, self._what, self._limit, self._unit = names, what, limit, unit
        self.restart()

    def restart(self) -> None:
        """Another posture is the first one."""
        self._before: list[float] = []
        self._follower: list[float] = []
        self._behind = STILL
        self._rested, self._late = math.inf, ""

    def step(self, posture: Sequence[float], has_rate: bool, q: Sequence[float], limit: float, dt: float) -> str:
        """Why the arm is late, '' where it is not.

        Parameters
        ----------
        posture, q : commanded and present joint angles (n,), rad; of an axis its position (1,), m or rad.
        has_rate : whether velocities are commanded with the posture.
        limit : largest speed, rad/s or m/s.
        dt : outer period, s.
        """
        before, time, behind = self._before, self._rested + dt, self._behind
        self._before, self._rested = list(posture), time
        if has_moved := self._before != before:
            self._rested = 0.0
            if time > PAUSE + ROUNDING:
                self._follower, behind = list(posture), STILL
        if self._follower == self._before:
            self._behind, self._late = STILL, ""
            return ""
        if has_moved and max(behind) > BEHIND and not self._late:
            k = behind.index(max(behind))
            if (speed := abs(posture[k] - before[k]) / time) > limit:  # otherwise it was set elsewhere at once, before
                self._late = (
                    f"the commanded {self._what} moves faster than the arm follows, {self._names[k]} with "
                    f"{speed:.3g} {self._unit}; allowed: {self._limit}, {limit:g} {self._unit}; the arm goes on and "
                    f"is late: give the motion more time, or raise force_loop:{self._limit}"
                )
        most = (1.0 if has_rate or self._late else CAUGHT_UP) * limit * dt
        pairs = zip(posture, self._follower, q, strict=True)
        self._follower = [_nearer(goal, at + min(max(goal - at, -most), most), arm) for goal, at, arm in pairs]
        self._behind = [abs(a - b) for a, b in zip(posture, self._follower, strict=True)]
        if max(self._behind) <= ROUNDING:
            self._late = ""
        return self._late


def _nearer(goal: float, follower: float, arm: float) -> float:
    return arm if abs(goal - arm) < abs(goal - follower) else follower
