"""What the force loop did instead of what was commanded, when and why; whether a step's command was met in the end."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from wam_control.force.task import TaskCommand, watched_axes
from wam_description.event import Code, Event
from wam_description.event_text import sentence

SETTLING_TIME = "limits.settling_time"
TOO_MUCH, UNREACHED = "with too much force", "not reached"
REFUSAL = str(Code.REFUSED)
IN_DOUBT = "applied, but perhaps wrong"  # a force that would be refused, had the arm not pressed with it already
OUTCOMES = (REFUSAL, TOO_MUCH, UNREACHED)  # of a command that is not met
BRIEF = 50_000_000  # ns; what lasts no longer into a step belongs to the one before
STEADY = 1.0  # s at the end of a step, taken as its steady state; a force that is commanded for less has none


class RecordedReaction(NamedTuple):
    """A time in which a command was not simply obeyed.

    Attributes
    ----------
    begin, end : ns.
    event : what was reported, with the values of its start.
    """

    begin: int
    end: int
    event: Event

    @property
    def name(self) -> Code:
        """What it is."""
        return self.event.code

    @property
    def reason(self) -> str:
        """In words."""
        return sentence(self.event)

    @property
    def holds(self) -> bool:
        """Whether the force was not controlled meanwhile."""
        return self.event.holds or self.name is Code.FAULT or "topic" in self.event.values

    @property
    def outcome(self) -> str:
        """What became of a command that is not met because of it, one of `OUTCOMES`."""
        if self.holds:
            return REFUSAL
        return TOO_MUCH if self.name is Code.PUSHED else UNREACHED


class RecordedStep(NamedTuple):
    """A step of the scenario: begin and end in ns, with the live parameters that it set, by 'node:parameter'."""

    name: str
    begin: int
    end: int
    settings: Mapping[str, Any] = {}


def within(reactions: Sequence[RecordedReaction], begin: int, end: int) -> tuple[RecordedReaction, ...]:
    """The parts of reactions between two times, ns."""
    parts = (one._replace(begin=max(one.begin, begin), end=min(one.end, end)) for one in reactions)
    return tuple(one for one in parts if one.end - one.begin > BRIEF or (one.begin < one.end == end))


def of_force_loop(reactions: Iterable[RecordedReaction]) -> list[RecordedReaction]:
    """Those of the force loop: a fault of the driver ends a force, and refuses none."""
    return [one for one in reactions if one.name is not Code.FAULT]


def duration(reactions: Iterable[RecordedReaction]) -> float:
    """How long reactions last in all, s."""
    return sum(one.end - one.begin for one in reactions) / 1e9


def steady_begin(begin: int, end: int) -> int:
    """When what is taken as the steady state of a time begins, ns."""
    return max(end - round(STEADY * 1e9), (begin + end) // 2)


def unmet(reactions: Sequence[RecordedReaction], step: RecordedStep) -> list[RecordedReaction]:
    """Why what a step commands is not met, nothing where it is.

    Refused in its steady state, with more force than allowed in all of it, not reached at its end, a posture too fast.
    """
    steady = steady_begin(step.begin, step.end)
    found = within(reactions, steady, step.end)
    refused = [one for one in of_force_loop(found) if one.holds]
    at_end = [one for one in found if one.end >= step.end - BRIEF]
    hard = [one for one in at_end if one.name is Code.PUSHED and one.begin <= steady]
    missed = [one for one in at_end if one.name is Code.NOT_REACHED]
    late = [one for one in within(reactions, step.begin, step.end) if one.event.cause == "speed"]
    return [*refused[:1], *hard[:1], *missed[:1], *late[:1]]


def watched_times(tasks: Iterable[tuple[TaskCommand | None, int, int]]) -> list[tuple[int, int]]:
    """Begin and end of each time in which tasks, given with theirs in ns, command the same axes that are watched.

    Forces of links do not count: how far such a force is off, a report has from the simulator.
    """
    times: list[tuple[list[str], int, int]] = []
    for task, begin, end in tasks:
        since = begin
        axes = [axis.name for axis in watched_axes(task) if axis.is_joint or not axis.is_force]
        if times and (times[-1][0], times[-1][2]) == (axes, begin):
            _, since, _ = times.pop()
        times.append((axes, since, end))
    return [(begin, end) for axes, begin, end in times if axes]


def is_too_short(times: Sequence[tuple[int, int]], step: RecordedStep, settling_time: float) -> bool:
    """Whether the task of a step commands an axis for too brief a time to be assessed at its end.

    Parameters
    ----------
    times : in which axes are commanded, see `watched_times`.
    settling_time : of the force loop, s, after which what is off is reported.
    """
    parts = ((begin, min(end, step.end)) for begin, end in times)
    return any(end > max(begin, step.begin) + BRIEF and end - begin <= 1e9 * settling_time for begin, end in parts)


def unassessed(
    reactions: Sequence[RecordedReaction],
    times: Sequence[tuple[int, int]],
    steps: Sequence[RecordedStep],
    settling_times: Sequence[tuple[int, float]],
) -> list[RecordedStep]:
    """The steps of whose command nothing is reported because it lasts too briefly; arguments as of `is_too_short`.

    `settling_times`: since when, ns, the force loop has each, s, in order of time.
    """
    return [
        one
        for one in steps
        if is_too_short(times, one, settling_time_in(settling_times, one)) and not unmet(reactions, one)
    ]


def settling_time_in(settling_times: Sequence[tuple[int, float]], step: RecordedStep) -> float:
    """The largest settling time, s, that was in force during a step; NaN where it is not known."""
    before = [seconds for since, seconds in settling_times if since <= step.begin]
    during = [seconds for since, seconds in settling_times if step.begin < since < step.end]
    return max([*before[-1:], *during], default=math.nan)


def too_short(settling_times: Sequence[tuple[int, float]], steps: Iterable[RecordedStep]) -> str:
    """What `unassessed` means of the steps that it gives, in words."""
    values = dict.fromkeys(settling_time_in(settling_times, one) for one in steps)
    limit = f"{' or '.join(f'{seconds:g}' for seconds in values)} s ({SETTLING_TIME})"
    return f"not assessed: its force, torque or motion was commanded for at most {limit}"


def in_words(name: str, reactions: Sequence[RecordedReaction], zero: int) -> list[tuple[str, str]]:
    """Each kind of reaction to a command of this name: when, from `zero` on, ns, and how long; and why.

    Time and reason are those of the longest.
    """
    lines = []
    for kind in dict.fromkeys(one.name for one in reactions):
        alike = [one for one in reactions if one.name is kind]
        longest = max(alike, key=lambda one: one.end - one.begin)
        others = duration(alike) - duration([longest])
        verb = REFUSAL if longest.holds else IN_DOUBT if kind is Code.REFUSED else "reported"
        verb += f" ({kind.words})" * (kind is not Code.REFUSED)
        again = f", and for {others:.2f} s at other times" * (len(alike) > 1)
        begin, end = ((stamp - zero) / 1e9 for stamp in (longest.begin, longest.end))
        lines.append((f"{name}: {verb} from {begin:.2f} to {end:.2f} s{again}", longest.reason))
    return lines


def lasting(found: Iterable[tuple[int, Sequence[Event]]], end: int) -> list[RecordedReaction]:
    """Reactions from the events each time they change, ns; one of which only the numbers change goes on.

    What holds the arm for another cause is another one.
    """
    over: list[RecordedReaction] = []
    present: dict[Code, RecordedReaction] = {}
    for stamp, events in found:
        first = {event.code: event for event in reversed(events)}
        over += [
            present.pop(code)._replace(end=stamp)
            for code, one in [*present.items()]
            if code not in first or (one.holds and one.event.subject != first[code].subject)
        ]
        for code, event in first.items():
            one = present.setdefault(code, RecordedReaction(stamp, end, event))
            if one.event.values.items() <= event.values.items():
                present[code] = one._replace(event=event)  # with what would help, which is found later
    return [one for one in (*over, *present.values()) if one.end > one.begin]
