"""The input synchroniser: which messages belong to one step of a node, whatever the wall clock does.

A node works when its trigger comes.  In lockstep it first waits, by stamp, for each other input that a
node of the bring-up streams; in realtime it takes the newest of each.  Pure logic on stamps in
nanoseconds, no ROS.

Nothing is used that is from the future, too old, or from before the driver's session:

- The stamps of the trigger are the node's clock.  One that goes back or jumps is refused, until the next
  one goes on from it: a single message never moves the clock, a driver that starts again does.
- An input far ahead of the clock is refused; one a little ahead is kept until the clock is there.
- An input older than its limit is given as absent, and an older one never replaces a newer one.
- A step waits for an input that answers an earlier state only until the clock is `longest_wait` ahead.  Two nodes
  that wait for each other go on so, after one of them has missed a state.
- A session that a status announces forgets nothing by itself, as anybody can send a status; its first state does.
- What a program sends is no clock, also where it starts a step: it is compared with the states that start another
  step of the node.  Without a stamp one that starts a step is refused; others have that of the newest state.
- A command of a program counts while it is streamed: a message of its own, which no other has preceded within
  the limit, does nothing.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from wam_description.arm import Timing, seconds
from wam_description.thresholds import INPUTS
from wam_description.wiring import Inputs, Origin


class OutOfTime(ValueError):
    """A message too old or of the future; the text names the value, what is allowed and what to do."""


CURE = "give a command the stamp of the state that it answers"


class InputSpec(NamedTuple):
    """How an input goes with the trigger.

    Attributes
    ----------
    outer : True where it comes once per outer period, False where it comes every inner period.
    delay : inner periods after which it is used.
    streamed : True where a node of the bring-up sends it in every period, so that a step can wait for it; False where
        it comes, or follows, from a program.
    limit_ns : age from which it counts as absent, ns, and how far it may be ahead of the clock.
    is_command : whether it is a command of a program, of which a single message does nothing.
    """

    outer: bool
    delay: int = 0
    streamed: bool = True
    limit_ns: int = INPUTS.longest_jump
    is_command: bool = False


TRIGGER = InputSpec(outer=True)
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
    started : how the trigger goes with the clock.
    clock : of another step of the node, which the states start; for a trigger that a program sends.

    Attributes
    ----------
    inlets : by topic, what takes the stamp and value of an input and returns the inputs of each step that is now
        complete, in the order of their stamps.  It raises OutOfTime where the stamp differs from that of the newest
        state by more than the limit of the input, or where a command that starts a step has none.
    strays : messages that do not go on from those before: older ones, or a second one for the same state.
    """

    def __init__(
        self,
        timing: Timing,
        trigger: str,
        inputs: Mapping[str, InputSpec],
        outer: bool = False,
        thinned: bool = False,
        started: InputSpec = TRIGGER,
        clock: "Synchroniser | None" = None,
    ) -> None:
        self._outer, self._thinned = outer, thinned
        self._trigger = trigger
        self._period = timing.outer_period_ns if outer else timing.period_ns
        self._nominal = seconds(self._period)
        waits = timing.mode == "lockstep"
        waited = {topic: spec for topic, spec in inputs.items() if waits and spec.streamed}
        self._longest_jump = max(INPUTS.longest_jump, 3 * self._period)
        self._outer_period, self._outer_phase = timing.outer_period_ns, timing.period_ns % timing.outer_period_ns
        self._triggers: deque[tuple[int, Any]] = deque()
        self._newest = {topic: _Newest(spec) for topic, spec in inputs.items() if topic not in waited}
        self._groups: list[_Group] = []
        self.inlets: dict[str, Inlet] = {trigger: self._start if started.streamed else self._commanded(started, clock)}
        rules = {topic: (outer or spec.outer, spec.delay) for topic, spec in waited.items()}
        for is_outer, delay in dict.fromkeys(rules.values()):
            topics = [topic for topic, rule in rules.items() if rule == (is_outer, delay)]
            repeats = timing.outer_period_ns if is_outer else 1
            group = _Group(delay * timing.period_ns, repeats, self._outer_phase, tuple(topics))
            self._groups.append(group)
            self.inlets.update({topic: self._waited(topic, group, waited[topic]) for topic in topics})
        self.inlets.update({topic: self._unwaited(topic, newest) for topic, newest in self._newest.items()})
        self._lacks: tuple[_Group, int, int] | None = None  # see `_inputs`
        self._announced: int | None = None  # first state of a session that none of its states has confirmed yet, ns
        self._early: deque[tuple[str, int, Any]] = deque(maxlen=INPUTS.early)
        self.strays = 0
        self.restart()

    def restart(self, begin: int = 0) -> None:
        """Forget everything: another session of the driver has begun, or the clock has jumped.

        Parameters
        ----------
        begin : first state of the session, ns; nothing can come in answer to one before it.
        """
        self._announced = None
        self._first = self._last = self._last_done = self._suspect = 0
        self._triggers.clear()
        self._lacks = None
        for group in self._groups:
            group.restart(begin)
        for newest in self._newest.values():
            newest.clear()

    def follow(self, begin: int) -> None:
        """Another session of the driver begins with this state, ns, as a status announces.

        Where the clock goes on, the driver only asks which nodes run.  Where it goes back, what came is forgotten
        with the first trigger that goes back, too.
        """
        if not self._last:
            self.restart(begin)
        elif begin < self._last:
            self._announced = begin
            self._early.clear()

    def discard_commands(self, before: int) -> None:
        """Forget the commands whose stamp is before this time, ns: the brakes have been switched."""
        for newest in self._newest.values():
            if newest.spec.is_command:
                newest.discard(before)

    def accepts(self, topic: str, stamp: int) -> bool:
        """Whether a message of this stamp can be part of a step; if not, it need not be decoded."""
        is_thinned = self._thinned if topic == self._trigger else self._outer and topic not in self._newest
        return not is_thinned or stamp % self._outer_period == self._outer_phase

    def _waited(self, topic: str, group: "_Group", waited: InputSpec) -> Inlet:
        """The inlet of an input that steps wait for."""
        outer, period, phase = self._outer, self._outer_period, self._outer_phase
        kept, triggers, limit_ns = group.kept, self._triggers, waited.limit_ns

        def take(stamp: int, value: Any) -> Sequence[Inputs]:
            if outer and stamp % period != phase:
                return ()
            if self._announced is not None:
                self._early.append((topic, stamp, value))
            if 0 < self._last < stamp - limit_ns:
                self._require_near(stamp, waited)
            slot = kept.get(stamp)
            if slot is None:
                kept[stamp] = {topic: value}
                if stamp > group.newest:  # noqa: PLR1730 - half the time of max()
                    group.newest = stamp
            elif topic in slot:
                self.strays += 1
            else:
                slot[topic] = value
            if not triggers:
                return ()
            if (lacks := self._lacks) is not None:
                lacking, cause, earliest = lacks
                if stamp <= earliest and len(lacking.kept.get(cause, ())) < lacking.count:
                    return ()  # nothing that the first step waits for, or shows that it waits in vain
            return self._complete()

        return take

    def _unwaited(self, topic: str, newest: "_Newest") -> Inlet:
        """The inlet of an input of which a step takes the newest."""

        def take(stamp: int, value: Any) -> Sequence[Inputs]:
            if self._announced is not None:
                self._early.append((topic, stamp, value))
            if not stamp and not newest.spec.streamed:
                stamp = self._last
            self._require_near(stamp, newest.spec)
            if not newest.put(stamp, value, self._last):
                self.strays += 1
            return self._complete() if self._triggers else ()

        return take

    def _commanded(self, started: InputSpec, clock: "Synchroniser | None") -> Inlet:
        """The inlet of a trigger that a program sends."""

        def take(stamp: int, value: Any) -> Sequence[Inputs]:
            if not stamp:
                raise OutOfTime(f"no stamp; a command that starts a step needs one; {CURE}")
            if clock is None:
                return self._start(stamp, value)
            now = clock._last
            clock._require_near(stamp, started)
            if stamp < self._last:
                if self._last <= now + started.limit_ns:
                    self.strays += 1
                    return ()
                self.restart()  # the driver has started again
            if stamp == self._last:
                self._last_done = 0  # another one for the same state: the step has the nominal dt
            self._last = 0  # it may go on from any other
            return self._start(stamp, value)

        return take

    def _start(self, stamp: int, value: Any) -> Sequence[Inputs]:
        """Take a trigger; returns the inputs of its step, where that is complete."""
        if self._thinned and stamp % self._outer_period != self._outer_phase:
            return ()
        last = self._last
        if (
            not last < stamp <= last + self._longest_jump
            and (last or stamp <= 0)
            and not (self._is_announced(stamp) or self._has_jumped(stamp))
        ):
            return ()
        self._last, self._suspect = stamp, 0
        self._first = self._first or stamp
        if not self._triggers:  # most often: nothing waits, and all inputs are there
            if (inputs := self._inputs(stamp, value)) is not None:
                return (inputs,)
            if self._has_missed(stamp):
                self._lacks = None
                return ()
        self._triggers.append((stamp, value))
        if (lacks := self._lacks) is not None and self._is_overdue(lacks[0], lacks[1]):
            return self._complete()
        return ()

    def _is_overdue(self, group: "_Group", cause: int) -> bool:
        """Whether states have gone on for so long that inputs which answer an earlier one will not come any more."""
        return group.is_delayed and self._last - cause > INPUTS.longest_wait * self._outer_period

    def _complete(self) -> Sequence[Inputs]:
        """The inputs of each step that is complete, in the order of their stamps."""
        complete: list[Inputs] = []
        while self._triggers:
            stamp, value = self._triggers[0]
            inputs = self._inputs(stamp, value)
            if inputs is None and not self._has_missed(stamp):
                break
            self._triggers.popleft()
            self._lacks = None
            if inputs is not None:
                complete.append(inputs)
        return complete

    def _require_near(self, stamp: int, spec: InputSpec) -> None:
        """Refuse what is too old for the clock or ahead of it; before the first state there is none."""
        age = self._last - stamp
        if not self._last or -spec.limit_ns <= age <= spec.limit_ns:
            return
        far, who = ("older than", "its sender") if age > 0 else ("ahead of", f"this node, or its {self._trigger},")
        cure = f"{who} is late; end other programs if the computer is busy" if spec.streamed else CURE
        raise OutOfTime(
            f"stamp {stamp} ns is {seconds(abs(age)):.3g} s {far} the newest state that this node has, {self._last} "
            f"ns, allowed: {seconds(spec.limit_ns):.3g} s; {cure}"
        )

    def _is_announced(self, stamp: int) -> bool:
        """Whether a trigger confirms the session that was announced; its inputs that came before it are kept."""
        begin = self._announced
        if begin is None or not begin <= stamp <= self._last:
            return False
        self.restart(begin)
        for topic, early, value in self._early:
            if begin <= early <= stamp:
                self.inlets[topic](early, value)
        self._early.clear()
        return True

    def _has_jumped(self, stamp: int) -> bool:
        """Whether a trigger that does not go on from the last one goes on from the one that was suspected before."""
        suspect, self._suspect = self._suspect, stamp
        if 0 < suspect < stamp <= suspect + self._longest_jump:
            self.restart()
            return True
        self.strays += 1
        if stamp > self._last:
            self._require_near(stamp, TRIGGER._replace(limit_ns=self._longest_jump))
        return False

    def _has_missed(self, stamp: int) -> bool:
        """Whether an input of this step can no longer come, as a later one is there: the node began too late for it."""
        for group in self._groups:  # noqa: SIM110 - a third of the time of any()
            if group.has_missed(stamp):
                return True
        return False

    def missing(self, stamp: int) -> list[str]:
        """Topics whose message the step of this stamp still waits for."""
        return [
            topic
            for group in self._groups
            if (cause := group.cause(stamp))
            for topic in group.topics
            if topic not in group.kept.get(cause, ())
        ]

    def awaited(self, now: int) -> list[str]:
        """Topics without which no step has been made for the state of this time, ns; none where it has been made."""
        if self._triggers and self._last <= now:
            return self.missing(self._triggers[0][0])
        due = now - (now - self._outer_phase) % self._outer_period if self._outer else now
        return [] if due <= self._last <= now else [self._trigger]  # what came after `now` is of an earlier session

    def ages(self) -> dict[str, float]:
        """How old the inputs are that no step waits for, as parts of their limits, by topic.

        One that has not come is as old as the first state: nobody else would notice that its sender is not there.
        """
        return {
            topic: (self._last - (newest.stamp or self._first)) / newest.spec.limit_ns
            for topic, newest in self._newest.items()
        }

    def _inputs(self, stamp: int, value: Any) -> Inputs | None:
        """The inputs of the step of a trigger, None where it still waits for one; older ones are forgotten.

        Where it waits, `_lacks` is the group that lacks one, its stamp, and the earliest stamp of all inputs of the
        step: no message that is not later can show that an input was missed.
        """
        found: dict[str, Any] = {}
        origins: list[Origin] = []
        for group in self._groups:  # before the others: most often it is one of these that is not there yet
            if stamp >= group.until and not group.find(stamp) and not self._is_overdue(group, group.cause(stamp)):
                self._lacks = group, group.cause(stamp), min([each.cause(stamp) for each in self._groups])
                return None
            found.update(group.found)
            origins.append(group.origin)
        for topic, newest in self._newest.items():
            taken = newest.taken(stamp)
            found[topic] = taken and taken[1]
            if taken:
                origins.append((taken[0], (topic,)))
        found[self._trigger] = value
        before, self._last_done = self._last_done, stamp
        is_next = not before or stamp - before == self._period
        inputs = Inputs(found)
        inputs.stamp, inputs.dt = stamp, self._nominal if is_next else seconds(stamp - before)
        inputs.origins = origins
        return inputs


class _Newest:
    """The newest value of an input that no step waits for, and those that are ahead of the clock."""

    __slots__ = ("_ahead", "_before", "_value", "spec", "stamp")

    def __init__(self, spec: InputSpec) -> None:
        self.spec = spec
        self._ahead: deque[tuple[int, Any]] = deque(maxlen=INPUTS.ahead)
        self.clear()

    def clear(self) -> None:
        """Forget all."""
        self.stamp, self._before = 0, 0
        self._value: Any = None
        self._ahead.clear()

    def discard(self, before: int) -> None:
        """Forget the value if its stamp is before this time, and all that are ahead of the clock."""
        self._ahead.clear()
        if self.stamp < before:
            self.clear()

    def put(self, stamp: int, value: Any, clock: int) -> bool:
        """Take a value; False where it is no newer than the one that is known."""
        if stamp > clock:
            self._ahead.append((stamp, value))
            return True
        if stamp < self.stamp or (stamp == self.stamp and self.spec.streamed):
            return False
        self._before, self.stamp, self._value = self.stamp, stamp, value
        return True

    def taken(self, clock: int) -> tuple[int, Any] | None:
        """Stamp and value at this time, None where there is none or it does not count."""
        if self._ahead:
            for _ in range(len(self._ahead)):
                self.put(*self._ahead.popleft(), clock)
        if not self.stamp or clock - self.stamp > self.spec.limit_ns:
            return None
        if self.spec.is_command and not (self._before and self.stamp - self._before <= self.spec.limit_ns):
            return None
        return self.stamp, self._value


class _Group:
    """Inputs that belong to a step by the same rule.

    Parameters
    ----------
    delay_ns : time after which they are used, ns.
    repeats_ns : time for which steps use the same ones, ns: an outer period, or none, as 1.
    phase_ns : stamp of the first ones, where they repeat, ns.
    topics : of the inputs.

    Attributes
    ----------
    count : number of its topics.
    is_delayed : whether they answer an earlier state than that of the step.
    kept : the inputs by stamp and topic.
    newest : largest stamp of those that came, ns.
    found : those of the last step, by topic.
    origin : their stamp, ns, and their topics.
    until : stamp from which a step needs others, ns.
    """

    __slots__ = (
        "_begin",
        "_delay_ns",
        "_phase_ns",
        "_repeats_ns",
        "count",
        "found",
        "is_delayed",
        "kept",
        "newest",
        "origin",
        "topics",
        "until",
    )

    def __init__(self, delay_ns: int, repeats_ns: int, phase_ns: int, topics: tuple[str, ...]) -> None:
        self._delay_ns, self._repeats_ns, self._phase_ns, self.topics = delay_ns, repeats_ns, phase_ns, topics
        self.count, self.is_delayed = len(topics), delay_ns > 0
        self.kept: dict[int, dict[str, Any]] = {}
        self.restart(0)

    def restart(self, begin: int) -> None:
        """Forget all; nothing can come in answer to a state before this one, ns."""
        self.kept.clear()
        self.newest = 0
        self._begin = max(begin, 1)
        self.found: dict[str, Any] = {}
        self.origin: Any = (0, ())  # an object, which each step takes as it is
        self.until = 0

    def cause(self, stamp: int) -> int:
        """Stamp of the inputs that belong to a step, 0 where none can have come yet."""
        cause = stamp - self._delay_ns
        cause -= (cause - self._phase_ns) % self._repeats_ns
        return cause if cause >= self._begin else 0

    def has_missed(self, stamp: int) -> bool:
        """Whether an input of the step of this stamp, ns, is not there, and a later one of its topic is."""
        cause = self.cause(stamp)
        if not cause or self.newest <= cause:
            return False
        here = self.kept.get(cause, {}).keys()
        return any(later > cause and not there.keys() <= here for later, there in self.kept.items())

    def find(self, stamp: int) -> bool:
        """Take the inputs of the step of this stamp, ns, and forget those before; False where one is not there yet."""
        cause = stamp - self._delay_ns  # as `cause` does, without a call in every period
        cause -= (cause - self._phase_ns) % self._repeats_ns
        if cause < self._begin:
            return True
        kept = self.kept
        slot = kept.get(cause)
        if slot is None or len(slot) < self.count:
            return False
        self.found, self.origin, self.until = slot, (cause, slot), cause + self._delay_ns + self._repeats_ns
        if len(kept) > 1:
            while (oldest := next(iter(kept))) < cause:
                del kept[oldest]
        return True
