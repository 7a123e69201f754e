"""What happened, as data: a code, how serious it is, and the values that belong to it."""

from collections.abc import Mapping
from enum import IntEnum, StrEnum
from typing import NamedTuple

Value = float | str
HOLDS = "holds"  # value that is 1 where the force loop holds the arm instead of obeying
RAISED = "raised"  # cause of a fault: a callback raised an exception
CAUSE = "cause"  # value that names the sentence of a code, where that has several
SUBJECTS = (CAUSE, "axis", "commanded_on", "joint", "node", "topic", "reason")  # which events of a code are two


class Level(IntEnum):
    """How serious a status or an event is, numbered as in diagnostic_msgs."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3  # nothing new is known


class Code(StrEnum):
    """What happened; in the order in which `force_axis` numbers what the force loop reports, from 0."""

    NONE = "none"  # the command is obeyed
    REFUSED = "refused"  # a command is not taken: it is beyond a limit, or its force would be off by too much
    NOT_REACHED = "not_reached"  # a force, a torque or a motion is not reached within the time for it
    UNEXPLAINED = "unexplained"  # the torques are not those of the commanded force, or another link is touched
    PUSHED = "pushed"  # something pushes harder than allowed
    AT_LIMIT = "at_limit"  # a bound of the motion is reached
    OSCILLATING = "oscillating"  # the measured force turns back again and again
    FAULT = "fault"  # the driver has put the brakes on, or does so for a node that reports it
    MODEL_OFF = "model_off"  # the model of the contact estimator is off by more than is tolerable
    DONE = "done"  # the scenario was played to its end
    UNSTAMPED = "unstamped"  # a program sends messages without a stamp; they count as answers to the newest state

    @property
    def words(self) -> str:
        """The name of the code in words, as reports print it."""
        return self.replace("_", " ")

    @property
    def number(self) -> int:
        """The number that stands for this code in the topic `force_axis`."""
        return list(Code).index(self)


class Event(NamedTuple):
    """Something that happened: a code, how serious it is, and the values behind it.

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
    def cause(self) -> Value:
        """Which case of its code the event is; '' where the code has one case."""
        return self.values.get(CAUSE, "")

    @property
    def holds(self) -> bool:
        """Whether the force loop holds the arm because of the event."""
        return bool(self.values.get(HOLDS, 0.0))

    @property
    def subject(self) -> tuple[Value, ...]:
        """What the event is about.  Events of different subjects are two; an event whose numbers change goes on."""
        return self.code, *(self.values.get(name, "") for name in SUBJECTS)

    def with_values(self, **values: Value) -> "Event":
        """The event with further values."""
        return self._replace(values={**self.values, **values})


def warning(code: Code, cause: str, **values: Value) -> Event:
    """An event that does not stop the arm, but that somebody has to know of."""
    return Event(code, Level.WARN, {CAUSE: cause, **values})


def holding(code: Code, cause: str, **values: Value) -> Event:
    """An event because of which the force loop holds the arm."""
    return warning(code, cause, **{HOLDS: 1.0, **values})


def refused(topic: str, reason: str, code: Code = Code.REFUSED) -> Event:
    """A message that is not taken, or not as it is; the reason is that of its check."""
    return Event(code, Level.WARN, {"topic": topic, "reason": reason})


def fault(cause: str, **values: Value) -> Event:
    """What stops the arm: of the driver, or of a node for which the driver brakes."""
    return Event(Code.FAULT, Level.ERROR, {CAUSE: cause, **values})


OBEYED = Event(Code.NONE)
