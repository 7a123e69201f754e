"""What is reported of a force or a motion: six events, each by a condition that has to last.

===============  ===================================================================================
REFUSED          the predicted error of the force is larger than tolerated; before the touch, the arm holds
NOT_REACHED      a force, a torque or a motion has been off by more than tolerated for too long
UNEXPLAINED      the torques are not those of what is commanded, or another link is touched; then the arm holds
PUSHED           something pushes harder than allowed
AT_LIMIT         a joint is at its end, or the arm has moved as far as it may; then it holds
OSCILLATING      the measured force turns back again and again
===============  ===================================================================================
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from wam_control.force.axes import CommandedAxis
from wam_control.force.belief import Belief
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.event import Code, Event, Value, holding, warning
from wam_description.rigid_body import Array
from wam_description.small_matrices import length


class Lasting:
    """A condition that starts when it was true for some time, and ends when it was false for some time."""

    def __init__(self) -> None:
        self._level, self.is_on, self._last = 0.0, False, list[Event]()

    def step(self, is_there: bool, after: float, back: float, dt: float) -> bool:
        """One period of dt, s; it begins `after` s with the condition, and ends `back` s without it."""
        if not (is_there or self._level):  # as most are for most of the time
            return False
        change = dt / max(after, dt) if is_there else -dt / max(back, dt)
        self._level = min(max(self._level + change, 0.0), 1.0)
        self.is_on = self._level > 1.0 - MOTION.rounding or (self.is_on and self._level > MOTION.rounding)
        return self.is_on

    def report(self, event: Event | None, after: float, back: float, dt: float) -> list[Event]:
        """An event that lasts, with the values that it last had; arguments as those of `step`."""
        self._last = [event] if event else self._last
        return [*self._last] if self.step(event is not None, after, back, dt) else []


class Turns:
    """Counts reversals of a signal that are larger than a size, within a window, and measures them."""

    def __init__(self) -> None:
        self._time, self._sense, self._extreme = 0.0, 1, math.nan
        self._found: deque[tuple[float, float]] = deque()

    def step(self, value: float, least: float, window: float, dt: float) -> int:
        """Number of turns by at least `least` within the last `window`, s."""
        self._time += dt
        if math.isnan(self._extreme) or self._sense * (value - self._extreme) >= 0.0:
            self._extreme = value
        elif abs(value - self._extreme) >= least:
            self._found.append((self._time, self._extreme))
            self._extreme, self._sense = value, -self._sense
        while self._found and self._found[0][0] < self._time - window:
            self._found.popleft()
        return len(self._found)

    @property
    def swing(self) -> tuple[float, float]:
        """Peak to peak, and period, s, of the turns in the window."""
        times, values = zip(*self._found, strict=True)
        return max(values) - min(values), 2.0 * (times[-1] - times[0]) / max(len(times) - 1, 1)


class TouchWatch:
    """Whether something is touched now, and whether it was before."""

    def __init__(self) -> None:
        self.is_there = self.has_been = False
        self._since = 0.0

    def step(self, force: float, desired: float, sd: float, dt: float) -> None:
        """A force is measured, N, of a desired one, N; by its standard deviation, N, nothing is touched."""
        self.is_there = desired > 0.0 and force >= max(FORCE.touch * desired, sd)
        self.has_been = self.has_been or self.is_there
        self._since = self._since + dt if self.has_been else 0.0

    @property
    def is_bouncing(self) -> bool:
        """Whether the first touch was so short ago that an impact turns the force."""
        return self.has_been and self._since < FORCE.impact_time


class Oscillation:
    """Slows the arm along a force that oscillates, and reports the oscillation if that does not help.

    Parameters
    ----------
    is_dithered : whether the motors have a dither, which shakes the force.

    Attributes
    ----------
    share : of the speed along the force.
    """

    def __init__(self, is_dithered: bool) -> None:
        self.share, self._is_dithered = 1.0, is_dithered
        self._turns, self._faint, self._lasting = Turns(), Turns(), Lasting()

    def rest(self) -> None:
        """There is nothing to see yet."""
        self._turns, self._faint = Turns(), Turns()

    def step(self, force: float, desired: float, sd: float, own: ForceLoopParameters, dt: float) -> list[Event]:
        """The event of one period, or none.

        Parameters
        ----------
        force, desired : measured and commanded, N or N m.
        sd : of the measured force, by the sensors; swings of less than `FORCE.certain` of it to each side do not count.
        own : parameters of the force loop.
        dt : s.
        """
        least, window = max(own.limits.cycle_force * abs(desired), 2.0 * FORCE.certain * sd), own.limits.settling_time
        count = self._turns.step(force, least, window, dt)
        # a cycle that grows is seen late, and with a wrong size; one that is slower than the loop is not its own
        faint = self._faint.step(force, FORCE.faint_swing * least, FORCE.turns * own.rise_time, dt)
        event = None
        if count > FORCE.turns:
            swing, period = self._turns.swing
            event = warning(
                Code.OSCILLATING,
                "oscillating",
                swing=swing,
                period=period,
                desired=desired,
                allowed=own.limits.cycle_force,
                source=_source(own, self._is_dithered),
                dither=float(self._is_dithered),
            )
        if faint > FORCE.turns // 2 and self.share > FORCE.slowed**2:
            self.share *= FORCE.slowed
            self.rest()
        return self._lasting.report(event, dt, window, dt)


class Seen(NamedTuple):
    """What the watch sees of a force in one period.

    Attributes
    ----------
    known : of the force.
    way : of the arm along the force since the period before, m; 0 while it holds.
    touched : the link that is surely touched instead, '' where none is.
    is_led : whether another motion is commanded besides.
    """

    known: Belief
    way: float
    touched: str
    is_led: bool


class ForceWatch:
    """The events of one force axis.

    Parameters
    ----------
    is_dithered : whether the motors have a dither.

    Attributes
    ----------
    touch : of what is pressed.
    oscillation : of the force.
    ended : the event because of which the arm holds until the command ends; None where there is none.
    """

    def __init__(self, is_dithered: bool) -> None:
        self._is_dithered = is_dithered
        self.touch, self.oscillation = TouchWatch(), Oscillation(is_dithered)
        self.ended: Event | None = None
        self._off, self._strange, self._doubt, self._other, self._changed, self._right = (Lasting() for _ in range(6))
        # of the largest doubt: 1 while it is refused, then somewhat more, and any once it is decided
        self._slack, self._has_settled = 1.0, False
        self._commanded: Array | float = math.nan
        self._travel = np.zeros(3)  # m, in the frame of the command
        self._pattern: Array | None = None  # m, torques per force that it did not explain as it settled

    def step(self, axis: CommandedAxis, seen: Seen, torques: Array, own: ForceLoopParameters, dt: float) -> list[Event]:
        """The events of one period.

        Parameters
        ----------
        axis : of the force.
        seen : of it.
        torques : of the world on the joints (n,), N m.
        own : parameters of the force loop.
        dt : s.
        """
        known, desired, limits = seen.known, axis.desired, own.limits
        error = desired - known.force
        commanded = desired * (axis.along if axis.is_joint else axis.in_frame)
        # the force turns with its command
        if not length(commanded - self._commanded) <= FORCE.faint_swing * known.tolerance:
            self._has_settled, self._pattern, self._commanded = False, None, commanded
            self._changed = Lasting()
            self.oscillation.rest()
        events = self._decide(axis, known, error, own, dt)
        if self._slack == 1.0:
            return events
        is_reached = self.touch.is_there and abs(error) <= known.tolerance
        self.ended = self.ended or self._contradicted(axis, seen, dt) or self._travelled(axis, seen, is_reached, own)
        if self.ended:
            return [self.ended]
        late = limits.settling_time
        soon = FORCE.quarter * late
        after, back = (soon, late) if self._has_settled else (late, soon)
        if self._off.step(not is_reached, after, back, dt):
            event = warning(
                Code.NOT_REACHED,
                "force_strays" if self._has_settled else "force_off",
                axis=axis.of.name,
                allowed=known.tolerance,
                measured=known.force,
                desired=desired,
                time=after,
                unit=_unit(axis),
                has_touched=float(self.touch.is_there),
            )
            events.append(event)
        # a force that rises too far is only crossed
        self._has_settled = self._right.step(is_reached, soon, dt, dt) or self._has_settled
        events += self._unexplained(axis, known, torques, own, dt)
        if self.touch.is_there and not self.touch.is_bouncing:
            sd = own.sensing.torque_sd
            sd = axis.sensed.error(sd) if axis.sensed else sd
            events += self.oscillation.step(known.force, desired, sd, own, dt)
        else:
            self.oscillation.rest()
        return events

    def _decide(
        self, axis: CommandedAxis, known: Belief, error: float, own: ForceLoopParameters, dt: float
    ) -> list[Event]:
        """Refused until the force is there, at a pinned position until the touch; then reported, where it lasts."""
        place = axis.place
        if known.doubt > self._slack * own.limits.doubt:
            self._slack = 1.0
            return [holding(Code.REFUSED, "error", **self._wrong(known.errors.size, axis, known, own))]
        is_there = self.touch.has_been if place is None or place.is_pinned else error < known.tolerance
        self._slack = max(self._slack, math.inf if is_there else FORCE.hysteresis)
        # what is off already leaves less of the tolerance to what is not known; what is off by all of it is not reached
        off = error if abs(error) <= known.tolerance else 0.0
        error = math.hypot(known.errors.size, off)
        event, lasting = None, own.limits.settling_time
        if error > known.tolerance and self.touch.is_there:
            event = warning(Code.REFUSED, "uncertain", **self._wrong(error, axis, known, own))
        return self._doubt.report(event, lasting, lasting, dt)

    def _wrong(self, error: float, axis: CommandedAxis, known: Belief, own: ForceLoopParameters) -> dict[str, Value]:
        """By how much a force may be wrong, N, and why."""
        part, source, place = known.errors.cause, _source(own, self._is_dithered), axis.place
        if part == "place" and place is not None:
            source = "pinned" if place.is_pinned else "estimated"
        return {
            "error": error, "part": part, "source": source, "desired": axis.desired,
            "allowed": known.tolerance, "unit": _unit(axis), **_where(axis),
        }  # fmt: skip

    def _contradicted(self, axis: CommandedAxis, seen: Seen, dt: float) -> Event | None:
        """Another link is touched."""
        place = axis.place
        is_strange = seen.known.chi2 > FORCE.unexplained
        is_other = bool(seen.touched) and (is_strange or place is None or not place.is_pinned)
        if not self._other.step(is_other, FORCE.impact_time, FORCE.impact_time, dt) or place is None:
            return None
        return holding(Code.UNEXPLAINED, "other_link", touched=seen.touched, **_where(axis))

    def _travelled(self, axis: CommandedAxis, seen: Seen, is_reached: bool, own: ForceLoopParameters) -> Event | None:
        """The arm has moved too far along or against a force that is not reached."""
        self._travel = self._travel + seen.way * axis.in_frame
        way, allowed = float(self._travel.dot(axis.in_frame)), own.limits.free_travel
        if is_reached:
            way = 0.0 if seen.is_led else min(way, 0.0)
            self._travel = way * axis.in_frame
        if abs(way) <= allowed:
            return None
        return holding(Code.AT_LIMIT, "free_travel", way=way, allowed=allowed, has_settled=float(self._has_settled))

    def _unexplained(
        self, axis: CommandedAxis, known: Belief, torques: Array, own: ForceLoopParameters, dt: float
    ) -> list[Event]:
        """The torques are not those of the force, or no longer those with which it has settled."""
        if axis.sensed is None or axis.place is None or known.sd == math.inf:
            return []
        event, lasting, where = None, own.limits.settling_time, _where(axis)
        if known.chi2 > FORCE.unexplained and self.touch.is_there:
            source, allowed = _source(own, self._is_dithered), FORCE.unexplained
            event = warning(
                Code.UNEXPLAINED, "torques_differ", **where, chi2=known.chi2, allowed=allowed, source=source
            )
        if found := self._strange.report(event, lasting, lasting, dt):
            return found
        if self._right.is_on and self._pattern is None:
            # with the pose the torques of the force change, too; what is estimated moves with whatever else pushes
            self._pattern = torques / known.force + axis.sensed.press * axis.place.is_pinned
        if not self.touch.is_there or self._pattern is None:
            return []
        change = axis.sensed.changed(torques - known.force * self._pattern)
        if not self._changed.step(change > FORCE.certain**2, FORCE.impact_time, FORCE.impact_time, dt):
            return []
        return [warning(Code.UNEXPLAINED, "torques_changed", **where, chi2=change, allowed=FORCE.certain**2)]


class MotionWatch:
    """Whether a joint or an axis follows its goal as well as an ideal one with the same speed limit and gain."""

    def __init__(self) -> None:
        self._ideal: float | None = None
        self._late = Lasting()

    def step(
        self,
        name: str,
        unit: str,
        goal: float,
        rate: float,
        at: float,
        gain: float,
        fastest: float,
        lasting: float,
        dt: float,
    ) -> Event | None:
        """The event of one period.

        Parameters
        ----------
        name, unit : of the axis, m or rad.
        goal, rate : commanded position, and the velocity at which it moves.
        at : present position.
        gain, fastest : velocity per error, 1/s, and the largest velocity.
        lasting : time after which it is reported, s.
        dt : s.
        """
        ideal = at if self._ideal is None else self._ideal
        speed = min(max(rate + gain * (goal - ideal), -fastest), fastest)
        self._ideal = ideal = ideal + speed * dt
        if abs(rate) > fastest:
            return warning(Code.AT_LIMIT, "speed", axis=name, unit=unit, speed=abs(rate), allowed=fastest)
        # behind by the time constant of its law while it moves, and by as much as an arm at rest may be
        allowed = MOTION.arrived + (abs(speed) / gain if gain else 0.0) + abs(goal - ideal) * FORCE.quarter
        if not self._late.step(abs(at - ideal) > allowed, lasting, lasting, dt):
            return None
        return warning(
            Code.NOT_REACHED,
            "motion_off",
            axis=name,
            unit=unit,
            desired=goal,
            measured=at,
            allowed=allowed,
            time=lasting,
        )


def _source(own: ForceLoopParameters, is_dithered: bool) -> str:
    """What measures the force."""
    return ("dithered motors" if is_dithered else "motors") if own.is_estimated else "sensors"


def _where(axis: CommandedAxis) -> dict[str, Value]:
    """On which link or joint it is commanded, '' for any link, and where it is now taken to act."""
    name, place = axis.of.name, axis.place
    if place is None:
        return {"commanded_on": name, "cover": name, "position": math.nan}
    return {"commanded_on": axis.of.cover, "cover": place.cover, "position": place.position}


def _unit(axis: CommandedAxis) -> str:
    return "N m" if axis.is_joint else "N"
