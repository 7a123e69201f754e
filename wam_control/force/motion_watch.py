"""Whether an axis gets where the position or the velocity commanded along it takes an arm that nothing hinders."""

import math

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.event import OBEYED, Code, Event, Value, warning


class MotionWatch:
    """Watches one axis of a task, or a joint of the posture, next to an ideal arm that does what its law commands.

    An axis counts as behind from where its law commands a joint speed at which the arm is not at rest, w:
    e > w |r| / k, with the lever r and the velocity per error k.  On the way to a position, at the velocity v of
    the ideal arm, it may be late by the time constant of its law, v/k, too.  A velocity may be off by `tolerance`, too,
    in the mean over `limits.settling_time` T, e' = v - r.qd - e/T, or over `left_after` of T.  What is behind for
    `left_after` of T is reported.

    Parameters
    ----------
    name, unit : of the axis, 'm' or 'rad'.
    hindrance : what keeps it behind where no joint is too fast.
    """

    def __init__(self, name: str, unit: str, hindrance: str = "in_the_way") -> None:
        self._name, self._unit, self._hindrance = name, unit, hindrance
        self.restart()

    def restart(self) -> None:
        """Something else is commanded, or the arm holds its position."""
        self._ideal, self._goal, self._rested = math.nan, math.nan, 0.0
        self._behind, self._mean, self._error, self._made = 0.0, math.nan, 0.0, 0.0
        self._off = self._within = 0.0  # s
        self._found = OBEYED

    def velocity(
        self, speed: float, moved: float, lever: float, share: float, parameters: ForceLoopParameters, dt: float
    ) -> Event:
        """What a commanded velocity does not reach.

        Parameters
        ----------
        speed : commanded along the axis, m/s or rad/s.
        moved : along the axis since the period before, m or rad.
        lever : velocity along the axis per joint velocity, its size, m or 1.
        share : of the commanded joint velocities, which `joint_speed_limit` allows.
        parameters : of the force loop.
        dt : outer period, s.
        """
        lasting = max(parameters.limits.settling_time, dt)
        if math.isnan(self._mean):
            self._mean = abs(speed)
        self._mean += (abs(speed) - self._mean) * dt / lasting
        self._behind += speed * dt - moved - self._behind * dt / lasting
        brief_time = max(FORCE.left_after * lasting, dt)
        self._error += (speed * dt - moved - self._error * dt) / brief_time
        self._made += (moved - self._made * dt) / brief_time
        allowed = _allowed(lever, parameters.task.largest_rate, lasting) + FORCE.tolerance * self._mean * lasting
        return self._reported(
            min(self._behind, self._error * lasting, key=abs),  # a push that is over does not count for all of T
            allowed,
            FORCE.left_after * lasting,
            dt,
            share < 1.0,
            "velocity_off",
            speed,
            self._made,
        )

    def position(
        self,
        goal: float,
        rate: float,
        at: float,
        lever: float,
        law: tuple[float, float],
        share: float,
        parameters: ForceLoopParameters,
        dt: float,
    ) -> Event:
        """What a commanded position does not reach.

        Parameters
        ----------
        goal, at : commanded and present position, m or rad.
        rate : at which the commanded one moves, m/s or rad/s; it counts while that changes.
        lever, share, parameters, dt : as of `velocity`.
        law : velocity per error, 1/s, and largest velocity, m/s or rad/s.
        """
        lasting = max(parameters.limits.settling_time, dt)
        gain, fastest = max(law[0], FORCE.settled / lasting), law[1]  # slower, no position would be reached in time
        was_at_rest = self._rested > FORCE.pause
        self._goal, self._rested = goal, self._rested + dt if goal == self._goal else dt
        if is_at_rest := self._rested > FORCE.pause:
            rate = 0.0
        if math.isnan(self._ideal) or (is_at_rest and not was_at_rest):
            self._ideal = at  # the joints may go there more slowly
        speed = rate + min(gain, 1.0 / dt) * (goal - self._ideal)
        speed = min(max(speed, -fastest), fastest) * (share if is_at_rest else 1.0)
        self._ideal += speed * dt
        return self._reported(
            self._ideal - at,
            _allowed(lever, law[0], lasting) + abs(speed) / gain,
            FORCE.left_after * lasting,
            dt,
            share < 1.0 and not is_at_rest,
            "position_off",
            goal,
            at,
        )

    def _reported(
        self,
        behind: float,
        allowed: float,
        lasting: float,
        dt: float,
        is_limited: bool,
        cause: str,
        commanded: float,
        measured: float,
    ) -> Event:
        """What is reported of a way, m or rad, that is missing for so long, s, until it is not for as long."""
        if abs(behind) <= allowed:
            self._within += dt
            if self._within >= lasting:
                self._off, self._found = 0.0, OBEYED
            return self._found
        self._within = 0.0
        self._off += dt
        if self._off > lasting and self._found is OBEYED:
            values: dict[str, Value] = {"axis": self._name, "unit": self._unit, "time": self._off}
            values |= {"why": "too_fast" if is_limited else self._hindrance}
            values |= {"commanded": commanded, "measured": measured, "allowed": allowed}
            self._found = warning(Code.NOT_FOLLOWED if is_limited else Code.NOT_REACHED, cause, **values)
        return self._found


def _allowed(lever: float, gain: float, lasting: float) -> float:
    """Way, m or rad, that may be missing."""
    return MOTION.at_rest * lever / max(gain, FORCE.settled / lasting)
