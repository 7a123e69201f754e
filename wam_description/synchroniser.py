"""The input synchroniser: which messages belong to one step of a node, whatever the wall clock does.

A node works when its trigger comes.  In lockstep it first waits, by stamp, for each other input that a
node of the bring-up streams; in realtime it takes the newest of each.  Pure logic on stamps in
nanoseconds, no ROS.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from wam_description.arm import Timing, seconds

Taken = tuple[int, Any]  # stamp, ns, and value of an input


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

    def __init__(self, stamp: int, dt: float, taken: Mapping[str, Taken | None]) -> None:
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
        found = self._taken.get(topic)
        return seconds(self.stamp - found[0]) if found is not None else 0.0


Inlet = Callable[[int, Any], Sequence[Inputs]]


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
        self._newest: dict[str, Taken | None] = {topic: None for topic in inputs if topic not in waited}
        groups = {spec: _Group(timing, spec) for spec in waited.values()}
        self._groups = list(groups.values())
        self._triggers: deque[Taken] = deque()
        self._last = self._last_done = 0
        self._inlets = {trigger: self._start} | {topic: self._newest_inlet(topic) for topic in self._newest}
        for topic, spec in waited.items():
            groups[spec].topics.append(topic)
            self._inlets[topic] = self._waited_inlet(topic, groups[spec])

    def accepts(self, topic: str, stamp: int) -> bool:
        """Whether a message of this stamp can be part of a step; if not, it need not be decoded."""
        if topic == self._trigger:
            return not self._thinned or self._timing.is_outer(stamp)
        return not self._outer or topic in self._newest or self._timing.is_outer(stamp)

    def put(self, topic: str, stamp: int, value: Any) -> Sequence[Inputs]:
        """Take an input; returns the inputs of each step that is now complete, in the order of their stamps."""
        return self._inlets[topic](stamp, value)

    def inlet(self, topic: str) -> Inlet:
        """What `put` does with the inputs of one topic, as a function of stamp and value."""
        return self._inlets[topic]

    def _start(self, stamp: int, value: Any) -> Sequence[Inputs]:
        if stamp <= self._last or (self._thinned and not self._timing.is_outer(stamp)):
            return ()
        self._last = stamp
        self._triggers.append((stamp, value))
        return self._complete()

    def _newest_inlet(self, topic: str) -> Inlet:
        def take(stamp: int, value: Any) -> Sequence[Inputs]:
            self._newest[topic] = (stamp, value)
            return self._complete() if self._triggers else ()

        return take

    def _waited_inlet(self, topic: str, group: "_Group") -> Inlet:
        is_outer, first, outer_period = self._outer, self._timing.period_ns, self._timing.outer_period_ns
        kept, topics, triggers = group.kept, group.topics, self._triggers

        def take(stamp: int, value: Any) -> Sequence[Inputs]:
            if is_outer and (stamp - first) % outer_period:  # no step of this period
                return ()
            if stamp in kept:
                kept[stamp][topic] = (stamp, value)
            else:
                kept[stamp] = {topic: (stamp, value)}
            return self._complete() if triggers and len(kept[stamp]) == len(topics) else ()

        return take

    def _complete(self) -> Sequence[Inputs]:
        """The inputs of each step that has them all."""
        complete: list[Inputs] = []
        while self._triggers:
            stamp, taken = self._triggers[0][0], self._newest.copy()
            for group in self._groups:
                if not group.hold(stamp):
                    return complete
                taken.update(group.held)
            taken[self._trigger] = self._triggers.popleft()
            dt = stamp - self._last_done if self._last_done else self._period
            self._last_done = stamp
            complete.append(Inputs(stamp, seconds(dt), taken))
        return complete

    def missing(self, stamp: int) -> list[str]:
        """Topics whose message the step of this stamp still waits for."""
        return [topic for group in self._groups for topic in group.missing(stamp)]


class _Group:
    """Inputs of the same specification, which a step takes by the same stamp: their cause.

    Attributes
    ----------
    topics : of these inputs.
    kept : stamp and value by topic, by stamp, for steps to come.
    held : those of the newest cause that a step had; empty before there can be one.
    """

    __slots__ = ("_cause", "_delay", "_first", "_outer_period", "held", "kept", "topics")

    def __init__(self, timing: Timing, spec: InputSpec) -> None:
        self._delay = spec.delay * timing.period_ns
        self._first, self._outer_period = timing.period_ns, timing.outer_period_ns if spec.outer else 1
        self._cause = 0
        self.topics: list[str] = []
        self.kept: dict[int, dict[str, Taken]] = {}
        self.held: dict[str, Taken] = {}

    def hold(self, stamp: int) -> bool:
        """Whether every input of a step is there; they are `held` then."""
        cause = self._cause_of(stamp)
        if cause <= self._cause:
            return True
        kept = self.kept
        if cause not in kept or len(kept[cause]) < len(self.topics):
            return False
        self._cause, self.held = cause, kept.pop(cause)
        if kept:
            for old in [known for known in kept if known < cause]:
                del kept[old]
        return True

    def missing(self, stamp: int) -> list[str]:
        """Topics that the step of a stamp still waits for."""
        cause = self._cause_of(stamp)
        found = self.kept.get(cause, {}) if cause > self._cause else self.topics
        return [topic for topic in self.topics if topic not in found]

    def _cause_of(self, stamp: int) -> int:
        """Stamp of the inputs that belong to a step; 0 or less where none can have come yet."""
        cause = stamp - self._delay
        return cause - (cause - self._first) % self._outer_period
