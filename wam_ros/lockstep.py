"""Which messages belong together: the rule that makes runs equal, whatever the wall clock does.

A node works when its trigger comes.  In lockstep it first waits for each other input that some
node of the bring-up streams, by stamp; in realtime it takes the newest of each.  Pure logic on
stamps in nanoseconds, no ROS.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from wam_description.arm import Timing


class Need(NamedTuple):
    """An input that goes with the trigger.

    Attributes
    ----------
    outer : True where it comes once an outer period, False where it comes every period.
    delay : periods after which it is used.
    streamed : True where a node of the bring-up sends it for every period, so that it can be waited for.
    """

    outer: bool
    delay: int = 0
    streamed: bool = True


class Gate:
    """Collects the inputs of one kind of step and says when the step can be done.

    Parameters
    ----------
    timing : the clockwork; its mode decides whether the gate waits.
    trigger : topic that starts a step.
    needs : the other inputs by topic.
    """

    def __init__(self, timing: Timing, trigger: str, needs: Mapping[str, Need]) -> None:
        self._timing = timing
        self._trigger = trigger
        self._needs = dict(needs)
        self._waits = timing.mode == "lockstep"
        self._triggers: list[tuple[int, Any]] = []
        self._kept: dict[str, dict[int, Any]] = {topic: {} for topic in needs}
        self._last = 0

    def put(self, topic: str, stamp: int, value: Any) -> Iterator[tuple[int, dict[str, Any]]]:
        """Take an input; yield each step that can now be done as (stamp, value by topic, None where absent)."""
        if topic != self._trigger:
            kept = self._kept[topic]
            if not (self._waits and self._needs[topic].streamed):
                kept.clear()
            kept[stamp] = value
        elif stamp > self._last:
            self._last = stamp
            self._triggers.append((stamp, value))
        while self._triggers:
            stamp, value = self._triggers[0]
            if self.missing(stamp):
                return
            del self._triggers[0]
            yield stamp, {self._trigger: value, **self._take(stamp)}

    def missing(self, stamp: int) -> list[str]:
        """Topics whose message the step of this stamp still waits for."""
        return [topic for topic in self._needs if self._required(topic, stamp) not in self._kept[topic].keys() | {0}]

    def _required(self, topic: str, stamp: int) -> int:
        """Stamp that a step has to wait for, 0 where it need not wait."""
        need = self._needs[topic]
        if not (self._waits and need.streamed):
            return 0
        cause = stamp - need.delay * self._timing.period_ns
        if cause <= 0:
            return 0
        return self._timing.outer_stamp(cause) if need.outer else cause

    def _take(self, stamp: int) -> dict[str, Any]:
        taken: dict[str, Any] = {}
        for topic, kept in self._kept.items():
            required = self._required(topic, stamp)
            if required:
                taken[topic] = kept[required]
                for old in [key for key in kept if key < required]:
                    del kept[old]
            elif self._waits and self._needs[topic].streamed:
                taken[topic] = None
            else:
                taken[topic] = next(iter(kept.values()), None)
        return taken
