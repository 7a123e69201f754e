"""One joint or one wrench of one sender and frame, and what was done to its raw values."""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import after_gaps
from wam_bag.arrays import Mask, Numbers

AXES = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


class Treatment(StrEnum):
    """What was found in raw values, and done to them before the analysis, in words."""

    RECEIVED = "the stamps are coarse ({number} of {of} stamps repeat the one before); reception times are used"
    # the times of reception are coarse, too
    BETWEEN = "stamps repeat, or are uneven, though the values are not; the messages are placed evenly"
    ON_CHANGE = "messages come only when a value changes, so that none is known to be missing"
    TWICE = "{number} of {of} stamps came twice; the first message of each is used"
    RELAYED = "{number} of {of} messages repeat the one before at another interval, as by a relay; the others are used"
    WRAPPED = "the {quantity} jumps {times} by {size}; it is unwrapped"
    MOVED_ZERO = "the zero of the {quantity} moves {times}, by up to {size}; this is removed"
    HELD = "{quantity} only repeated in {number} of {of} messages; the others are used"
    UNFILLED = "the {quantity} is 0 in every message although the position moves; the rate of that is used"
    ZERO = "the {quantity} jumps to 0 in {number} of {of} messages; the others are used"
    LATE = "the {quantity} is about {size}, as by a filter; the rate of the position is used"
    SCALED = "the {quantity} is {factor:.3g} times the rate of the position; that rate is used"
    FROZEN = "the {quantity} is frozen in motion in {number} of {of} messages, and then jumps on; they are left out"
    SPIKES = "the {quantity} jumps away and back {times}, by up to {size}; the mean of its neighbours is used"
    SPARSE = "{quantity} in only {number} of {of} messages"


class Treated(NamedTuple):
    """What was done to the raw values of a source.

    Attributes
    ----------
    what : the kind.
    quantity : of which, '' for the messages.
    number, of : how many, of all; 0 where it is not stated.
    size : of a wrap, or the largest of the jumps, in the unit of the quantity; of a velocity, per rate of the position.
    """

    what: Treatment
    quantity: str
    number: int = 0
    of: int = 0
    size: float = math.nan


class Source(NamedTuple):
    """A joint or a wrench.

    Attributes
    ----------
    label : unique in the recording: the joint where one topic has it, else with the topic and its frame.
    topic, name, frame : where it comes from; `name` is that of the joint, '' for a wrench.
    is_command : whether the values are commanded.
    time : (n,), s from the first stamp of the recording, rising.
    sent, received : (m,), s from the first stamp, all stamps of its sender and when the recorder got them.
    away : (k,), s from the first stamp, rising: stamps of its sender's messages in another frame.
    values : (n,) by quantity: position, velocity, effort, or the axes of the wrench; NaN where a message has none.
    units : by quantity.
    treated : what was done to the raw values.
    velocity_factor : see `velocity_fit`; NaN where the velocity was left out.
    """

    label: str
    topic: str
    name: str
    frame: str
    is_command: bool
    time: Numbers
    sent: Numbers
    received: Numbers
    away: Numbers
    values: dict[str, Numbers]
    units: dict[str, str]
    treated: tuple[Treated, ...]
    velocity_factor: float = math.nan

    def only(self, *quantities: str) -> "Source":
        """The source with those of some quantities that it has, in the messages that have all of them.

        Where they come in turns it is in those that have the last of them.
        """
        values = {q: self.values[q] for q in quantities if q in self.values}
        known = _known(self, values)
        if len(values) > 1 and not np.any(known):
            values |= {q: _between(self.time, values[q]) for q in [*values][:-1]}
            known = _known(self, values)
        return self._replace(time=self.time[known], values={q: v[known] for q, v in values.items()})

    def with_values(self, values: Mapping[str, Numbers], treated: Treated) -> "Source":
        """The source with other values of some quantities, and what was done to them."""
        return self._replace(values=self.values | dict(values), treated=(*self.treated, treated))

    def known(self, quantity: str) -> Numbers:
        """The numbers of a quantity, (k,)."""
        return self.only(quantity).values.get(quantity, np.zeros(0))

    def since(self, first: float) -> "Source":
        """The source with times, s, from another instant on."""
        time, sent, received, away = (each - first for each in (self.time, self.sent, self.received, self.away))
        return self._replace(time=time, sent=sent, received=received, away=away)

    def without(self, quantity: str, treated: Treated) -> "Source":
        """The source without a quantity, and why."""
        return self._replace(
            values={q: v for q, v in self.values.items() if q != quantity}, treated=(*self.treated, treated)
        )

    @property
    def sends_changes(self) -> bool:
        """Whether its sender waits for a change, and nothing happens in its gaps."""
        return any(one.what is Treatment.ON_CHANGE for one in self.treated)

    @property
    def is_joint(self) -> bool:
        """Whether it is a joint, not a wrench."""
        return bool(self.name)

    @property
    def arrives(self) -> Mask:
        """Whether the message of its sender before each of its own was in another frame, (n,)."""
        return _last(self.away, self.time) > np.concatenate([[-math.inf], self.time[:-1]])

    def is_away(self, time: Numbers) -> Mask:
        """Whether its sender was in another frame at some times, so that its values are not known."""
        return _last(self.away, time) > _last(self.time, time)

    def shares_frame(self, other: "Source") -> bool:
        """Whether both may be in one frame: they name the same one, or one of them names none."""
        return self.frame == other.frame or not self.frame or not other.frame

    def leaves(self, begin: float) -> float:
        """When its sender goes over to another frame after an instant, s; infinite if it does not."""
        return float(np.min(self.away[self.away > begin], initial=math.inf))


def _known(source: Source, values: Mapping[str, Numbers]) -> Mask:
    """Which messages have all of some values."""
    nothing = np.full(len(source.time), 0.0 if values else math.nan)
    return np.isfinite(np.column_stack([nothing, *values.values()])).all(axis=1)


def _between(time: Numbers, value: Numbers) -> Numbers:
    """A value at all times, on straight lines between those of messages that have it, but not over gaps."""
    rows = np.flatnonzero(np.isfinite(value))
    if not len(rows):
        return value
    after = np.minimum(np.searchsorted(rows, np.arange(len(time))), len(rows) - 1)
    filled = np.interp(time, time[rows], value[rows], math.nan, math.nan)
    return np.where(after_gaps(time[rows])[after] & np.isnan(value), math.nan, filled)


def _last(stamps: Numbers, time: Numbers) -> Numbers:
    """The last of rising stamps at or before each time, minus infinity where there is none."""
    return np.concatenate([[-math.inf], stamps])[np.searchsorted(stamps, time, side="right")]
