"""Whether a commanded posture, or the position along an axis, moves on faster than the arm follows, or gets there."""

import math
from collections.abc import Sequence
from typing import Final

from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.event import Code, Event, warning

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
        self._interval = math.inf  # s, between the last two changes
        self._late: Event | None = None
        self._rested, self._held = 0.0, 0.0  # s, since the last one, and of that commanded
        self._is_goal = True

    @property
    def is_moving(self) -> bool:
        """Whether the commanded posture moves."""
        return not self._is_goal and self._rested <= max(FORCE.pause, FORCE.rhythm * self._interval) + FORCE.rounding

    def wait(self, dt: float) -> Event | None:
        """Why the arm is late, while no posture is commanded for a period of dt, s, as before."""
        self._rested += dt
        if not self.is_moving:
            self._late = None
        return self._late

    def step(
        self, posture: Sequence[float], has_rate: bool, q: Sequence[float], limit: float, dt: float
    ) -> Event | None:
        """Why the arm is late, None where it is not.

        Parameters
        ----------
        posture, q : commanded and present joint angles (n,), rad; of an axis its position (1,), m or rad.
        has_rate : whether velocities are commanded with the posture.
        limit : largest speed, rad/s or m/s.
        dt : outer period, s.
        """
        before, self._before = self._before, list(posture)
        self._rested, self._held = self._rested + dt, self._held + dt
        if not before:
            self._follower = self._before
        elif self._before != before:
            self._change(before, limit)
        if self._follower == self._before:
            self._behind, self._late = STILL, None
            return None
        most = (1.0 if has_rate or self._late else FORCE.caught_up) * limit * dt
        pairs = zip(posture, self._follower, q, strict=True)
        self._follower = [_nearer(goal, at + min(max(goal - at, -most), most), arm) for goal, at, arm in pairs]
        self._behind = [abs(a - b) for a, b in zip(posture, self._follower, strict=True)]
        if max(self._behind) <= FORCE.rounding:
            self._late = None
        return self._late

    def _change(self, before: list[float], limit: float) -> None:
        """Take another posture, which goes on with a motion or is another goal."""
        time, held = self._rested, self._held
        is_soon = time <= FORCE.pause + FORCE.rounding
        goes_on = is_soon or self._interval <= FORCE.rhythm * time <= FORCE.rhythm * FORCE.rhythm * self._interval
        if is_soon and self._is_goal:  # a motion begins, there
            self._follower, self._behind = before, STILL
        if not goes_on:
            self._late = None
        elif max(self._behind) > MOTION.arrived and not self._late:
            k = self._behind.index(max(self._behind))
            way = self._before[k] - before[k]
            moves_on = way * (before[k] - self._follower[k]) > 0.0  # and was not set elsewhere at once, before
            if moves_on and (speed := abs(way) / held) > limit:
                self._late = warning(
                    Code.NOT_FOLLOWED,
                    "posture_late",
                    axis=self._what,
                    joint=self._names[k],
                    speed=speed,
                    unit=self._unit,
                    limit=self._limit,
                    allowed=limit,
                    is_streamed=float(held > time - FORCE.rounding),
                )
        self._interval, self._is_goal, self._rested, self._held = time, not goes_on, 0.0, 0.0


class ShortfallWatch:
    """Compares how far the arm is from a commanded posture with an arm of `pace`, which goes no faster than it may.

    It may be further away by `behind_angle`, and by the way of that arm in `behind_time`.

    Parameters
    ----------
    names : of the joints.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self.restart()

    def restart(self) -> None:
        """No posture is commanded, or the arm does something else."""
        self._follower: list[float] = []
        self._lasts = 0.0  # s
        self._report: Event | None = None

    def step(self, posture: Sequence[float], q: Sequence[float], gain: float, limit: float, dt: float) -> Event | None:
        """Why the posture is not reached, None where it is.

        Parameters
        ----------
        posture, q : commanded and present joint angles (n,), rad.
        gain : velocity per posture error of the arm, `posture_gain`, 1/s.
        limit : largest speed, rad/s.
        dt : outer period, s.
        """
        at = self._follower or list(q)
        speeds = [
            min(max(min(FORCE.pace, 1.0 / dt) * (goal - a), -limit), limit) for goal, a in zip(posture, at, strict=True)
        ]
        self._follower = [a + speed * dt for a, speed in zip(at, speeds, strict=True)]
        allowed = [
            abs(goal - a) + FORCE.behind_angle + FORCE.behind_time * abs(speed)
            for goal, a, speed in zip(posture, self._follower, speeds, strict=True)
        ]
        short = [abs(goal - angle) for goal, angle in zip(posture, q, strict=True)]
        k = max(range(len(short)), key=lambda joint: short[joint] - allowed[joint])
        self._lasts = self._lasts + dt if short[k] > allowed[k] else 0.0
        if not self._lasts:
            self._report = None
        elif self._lasts > FORCE.short_for and not self._report:
            self._report = warning(
                Code.NOT_REACHED,
                "posture_missed",
                joint=self._names[k],
                way=short[k],
                allowed=allowed[k],
                allowed_at_rest=FORCE.behind_angle,
                gain=gain,
            )
        return self._report


def _nearer(goal: float, follower: float, arm: float) -> float:
    return arm if abs(goal - arm) < abs(goal - follower) else follower
