"""The input synchroniser: which messages belong to one step of a node, whatever the wall clock does.

A node works when its trigger comes.  In lockstep it first waits, by stamp, for each other input that a
node of the bring-up streams; in realtime it takes the newest of each.  Pure logic on stamps in
nanoseconds, no ROS.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from wam_description.arm import Timing, seconds


class InputSpec(NamedTuple):
    """How an input goes with the trigger.

    Attributes
    ----------
    outer : True where it comes once per outer period, False where it comes every inner period.
    delay : inner periods after which it is used.
    streamed : True where a node of the bring-up sends it in every period, so that a step can wait for it.
    """

    outer: bool
    delay: int = 0
    streamed: bool = True


class Inputs:
    """The inputs of one step, by topic.

    Attributes
    ----------
    stamp : time of the trigger, ns.
    dt : time since the step before, s; the nominal period at the first step.
    """

    __slots__ = ("_taken", "dt", "stamp")

    def __init__(self, stamp: int, dt: float, taken: Mapping[str, tuple[int, Any] | None]) -> None:
        self.stamp, self.dt, self._taken = stamp, dt, taken

    def __getitem__(self, topic: str) -> Any:
        """The value, None where there is none or the topic does not exist on this arm."""
        found = self._taken.get(topic)
        return found[1] if found is not None else None

    def stamp_of(self, topic: str) -> int:
        """Stamp of an input, ns; that of the trigger where there is none."""
        found = self._taken.get(topic)
        return found[0] if found is not None else self.stamp

    def age(self, topic: str) -> float:
        """Time from the state that caused an input to the trigger, s; 0 where there is none."""
        return seconds(self.stamp - self.stamp_of(topic))


class Synchroniser:
    """Collects the inputs of one kind of step and gives out the steps that are complete.

    Parameters
    ----------
    timing : periods of the loops; the mode decides whether a step waits.
    trigger : topic that starts a step.
    inputs : the other inputs by topic.
    outer : whether steps come at the outer rate, so that waited inputs of other periods are of no interest.
    thinned : whether the trigger comes at the inner rate and only those of outer periods start a step.
    """

    def __init__(
        self,
        timing: Timing,
        trigger: str,
        inputs: Mapping[str, InputSpec],
        outer: bool = False,
        thinned: bool = False,
    ) -> None:
        self._outer, self._thinned = outer, thinned
        self._timing, self._trigger = timing, trigger
        self._period = timing.outer_period_ns if outer else timing.period_ns
        waits = timing.mode == "lockstep"
        waited = {topic: spec for topic, spec in inputs.items() if waits and spec.streamed}
        self._kept: dict[str, dict[int, Any]] = {topic: {} for topic in waited}
        self._newest: dict[str, tuple[int, Any] | None] = {topic: None for topic in inputs if topic not in waited}
        self._groups = [
            _Group(
                spec.outer,
                spec.delay * timing.period_ns,
                spec.outer == outer and not spec.delay,
                [(t, self._kept[t]) for t in waited if waited[t] == spec],
            )
            for spec in dict.fromkeys(waited.values())
        ]
        self._is_alone = not inputs  # a trigger is all there is to a step
        self._triggers: deque[tuple[int, Any]] = deque()
        self._last = self._last_done = 0

    def accepts(self, topic: str, stamp: int) -> bool:
        """Whether a message of this stamp can be part of a step; if not, it need not be decoded."""
        if topic == self._trigger:
            return not self._thinned or self._timing.is_outer(stamp)
        return not self._outer or topic in self._newest or self._timing.is_outer(stamp)

    def put(self, topic: str, stamp: int, value: Any) -> Sequence[Inputs]:
        """Take an input; returns the inputs of each step that is now complete, in the order of their stamps."""
        if topic == self._trigger:
            if stamp <= self._last or (self._thinned and not self._timing.is_outer(stamp)):
                return ()
            self._last = stamp
            self._triggers.append((stamp, value))
        elif topic in self._newest:
            self._newest[topic] = (stamp, value)
        elif not self._outer or self._timing.is_outer(stamp):
            self._kept[topic][stamp] = value
        if not self._triggers:
            return ()
        if self._is_alone:
            self._triggers.clear()
            return (self._step(stamp, {topic: (stamp, value)}),)
        complete: list[Inputs] = []
        while self._triggers:
            taken = self._taken(self._triggers[0][0])
            if taken is None and not self._has_missed(self._triggers[0][0]):
                break
            stamp, value = self._triggers.popleft()
            if taken is not None:
                taken[self._trigger] = (stamp, value)
                complete.append(self._step(stamp, taken))
        return complete

    def _has_missed(self, stamp: int) -> bool:
        """Whether an input of this step can no longer come, as a later one is there: the node began too late for it."""
        return any(
            kept and 0 < cause < max(kept) and cause not in kept
            for group in self._groups
            for cause in (self._cause(group, stamp),)
            for _, kept in group.members
        )

    def _step(self, stamp: int, taken: Mapping[str, tuple[int, Any] | None]) -> Inputs:
        """The inputs of a step that is complete, with the time since the one before."""
        dt = stamp - self._last_done if self._last_done else self._period
        self._last_done = stamp
        return Inputs(stamp, seconds(dt), taken)

    def missing(self, stamp: int) -> list[str]:
        """Topics whose message the step of this stamp still waits for."""
        return [
            topic
            for group in self._groups
            if (cause := self._cause(group, stamp))
            for topic, kept in group.members
            if cause not in kept
        ]

    def _cause(self, group: "_Group", stamp: int) -> int:
        """Stamp of the inputs that belong to a step, 0 where none can have come yet."""
        cause = stamp - group.delay_ns
        if cause <= 0:
            return 0
        return self._timing.outer_stamp(cause) if group.outer else cause

    def _taken(self, stamp: int) -> dict[str, tuple[int, Any] | None] | None:
        """The inputs of a step, None where it still waits for one; older ones are forgotten."""
        taken = self._newest.copy()
        for group in self._groups:
            cause = self._cause(group, stamp)
            for topic, kept in group.members:
                if cause in kept:
                    taken[topic] = (cause, kept[cause])
                elif cause:
                    return None
        for group in self._groups:
            for topic, kept in group.members:
                if len(kept) > 1:
                    found = taken.get(topic)
                    for old in [known for known in kept if found and known < found[0]]:
                        del kept[old]
                if group.once:
                    kept.pop(stamp, None)
        return taken


class _Group(NamedTuple):
    """Inputs that belong to a step by the same rule, each with the values kept by stamp."""

    outer: bool
    delay_ns: int
    once: bool  # each value is used by one step, that of its own stamp
    members: list[tuple[str, dict[int, Any]]]
