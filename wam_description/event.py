"""What happened, as data: a code, how serious it is, and the values that belong to it."""

from collections.abc import Mapping
from enum import IntEnum, StrEnum
from typing import NamedTuple

Value = float | str
RAISED = "raised"  # cause of a fault: a callback raised an exception
CAUSE = "cause"  # value that names the sentence of a code, where that has several
SUBJECTS = (CAUSE, "axis", "cover", "joint", "topic", "reason")  # values that distinguish two events of a code


class Level(IntEnum):
    """How serious a status or an event is, numbered as in diagnostic_msgs."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3  # nothing new is known


class Code(StrEnum):
    """What happened; in the order in which `force_axis` numbers what the force loop does, from 0."""

    NONE = "none"  # the command is obeyed
    NOT_SENSED = "not_sensed"  # holds: the commanded force cannot be measured here
    OTHER_LINK = "other_link"  # holds: another link is touched
    NOTHING_TOUCHED = "nothing_touched"  # holds: it has gone as far as allowed and nothing was touched
    CONTACT_FORCE = "contact_force"  # does not move against the world
    JOINT_END = "joint_end"  # a joint is at its end
    NOT_REACHED = "not_reached"  # goes on: the force or the motion is not reached within the time for it
    POSITION_ASSUMED = "position_assumed"  # goes on: where the force acts is not known well, and not pinned
    NOT_EXPLAINED = "not_explained"  # goes on: the torques are not those of the commanded force
    TASK_REFUSED = "task_refused"  # holds: the axes of the task cannot be done here
    UNCERTAIN = "uncertain"  # goes on: the force is not known as well as it has to be reached
    CYCLE = "cycle"  # goes on: the measured force is in a limit cycle
    SHAKEN = "shaken"  # holds: the arm shakes by more than the surface gives way under the commanded force
    TOO_SLOW = "too_slow"  # holds: the arm moves too slowly for the commanded force
    SECOND_CONTACT = "second_contact"  # holds: a second contact is nearly certain
    NOT_FOLLOWED = "not_followed"  # goes on: the commanded posture or position moves faster than the arm may
    REFUSED = "refused"  # a command is not taken: it is beyond a limit or has no effect
    FAULT = "fault"  # the driver has put the brakes on, or does so for a node that reports it
    MODEL_OFF = "model_off"  # the model of the contact estimator is off by more than is tolerable
    DONE = "done"  # the scenario was played to its end

    @property
    def holds(self) -> bool:
        """Whether the force loop holds the arm instead of controlling the force."""
        return self in _HOLDING

    @property
    def number(self) -> int:
        """Its number in `force_axis`."""
        return list(Code).index(self)


_HOLDING = frozenset(
    {
        Code.NOT_SENSED,
        Code.OTHER_LINK,
        Code.NOTHING_TOUCHED,
        Code.TASK_REFUSED,
        Code.SHAKEN,
        Code.TOO_SLOW,
        Code.SECOND_CONTACT,
    }
)


class Event(NamedTuple):
    """What happened.

    Attributes
    ----------
    code : what.
    severity : how serious it is.
    values : numbers in SI units, unless their name ends with another one, and names; those of one code and cause
        are always the same ones.
    """

    code: Code
    severity: Level = Level.OK
    values: Mapping[str, Value] = {}

    @property
    def subject(self) -> tuple[Value, ...]:
        """What it is about: events that differ in this are two, while one whose numbers change goes on."""
        return self.code, *(self.values.get(name, "") for name in SUBJECTS)

    def with_values(self, **values: Value) -> "Event":
        """The same with further values."""
        return self._replace(values={**self.values, **values})


def warning(code: Code, cause: str, **values: Value) -> Event:
    """An event that does not stop the arm, but that somebody has to know of."""
    return Event(code, Level.WARN, {CAUSE: cause, **values})


def refused(topic: str, reason: str) -> Event:
    """A message that is not taken; the reason is that of its check."""
    return Event(Code.REFUSED, Level.WARN, {"topic": topic, "reason": reason})


def fault(cause: str, **values: Value) -> Event:
    """What stops the arm: of the driver, or of a node for which the driver brakes."""
    return Event(Code.FAULT, Level.ERROR, {CAUSE: cause, **values})


OBEYED = Event(Code.NONE)
