"""Trials of faults: what was tried, what escaped, and how far the arm moved."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from wam_description.configuration import Configuration


@dataclass(frozen=True)
class FaultLimits:
    """What counts as an escape, and how long is waited.

    Times of the arm are those of its clock; others are of the wall clock, long enough for a busy machine.
    """

    zero_current: float = 0.05  # s of the arm's time, from the loss of a node to zero current
    motion: float = 0.01  # rad, of a joint without a legitimate command
    held_motion: float = 0.2  # rad, of a joint that obeys one wrong message of its own commander until it is too old
    force: float = 15.0  # N, of the arm on the world without a legitimate command
    most_escapes: int = 20  # of one kind; then the kind is stopped

    longest_start: float = 120.0  # s of a stack
    patience: float = 15.0  # s of work without progress and without a fault that is a hang
    answered: float = 0.5  # s, for each attempt to ask a service
    attempts: int = 20  # to ask a service of a stack in this process
    attempts_of_processes: int = 6  # to ask a service of nodes in processes of their own
    idle: float = 0.25  # s of work that a second of waiting counts as
    rest: float = 0.2  # s of work after which the time of an arm in fault is known to be at rest

    messages: int = 20  # of one trial
    between: float = 0.001  # s of the arm's time between two of them
    after: float = 0.03  # s of the arm's time after the last
    streamed: float = 0.15  # s of the arm's time with two publishers
    after_publishers: float = 0.05  # s of the arm's time that is watched afterwards
    replayed: int = 300  # messages of each topic of a bag

    noticed: float = 5.0  # s, in which a loss must be reported
    recovered: float = 20.0  # s, in which an operator gets an enabled arm again
    frozen: tuple[float, float] = (0.2, 1.5)  # s that a driver is frozen
    reported: float = 10.0  # s, in which a full or removed disk must be reported
    room: tuple[int, ...] = (0, 3_000, 100_000)  # bytes that a full disk still takes

    python: float = 0.3  # s, in which Python starts; a Ctrl-C before the first line of the program is its own
    starting: float = 4.0  # s, before which one half of the moments of a Ctrl-C is
    playing: float = 12.0  # s, before which the other half is
    longest_end: float = 30.0  # s, from a Ctrl-C to the end

    push: float = 3.0  # N, after which a stable arm is slow
    pushed: float = 0.02  # s
    settling: float = 0.1  # s
    fast: float = 1.0  # rad/s

    move: float = 2.0  # s of a move of the soak
    postures: int = 4  # that are gone to, one after the other
    along: float = 0.75  # of the last cover, where it is pushed
    seed: int = 1  # of the postures
    growth: float = 20.0  # MB from a tenth of the run on to its end


FAULTS = FaultLimits()


class FaultTrial(NamedTuple):
    """One trial.

    Attributes
    ----------
    number : of the trial among those of its kind and seed.
    name : the fault, in words.
    size : messages, sets, losses and so on in it.
    escapes : what went wrong, '' nowhere.
    motion : rad, largest motion of a joint that nobody had commanded.
    force : N, largest true force on the world.
    delay : s of the arm's time from the loss to zero current, NaN where it does not apply.
    """

    number: int
    name: str
    size: int = 1
    escapes: tuple[str, ...] = ()
    motion: float = 0.0
    force: float = 0.0
    delay: float = math.nan


class FaultKind(NamedTuple):
    """A kind of fault.

    Attributes
    ----------
    name : as on the command line.
    doc : what is done, one line.
    unit : of `FaultTrial.size`, plural.
    full, short : number of trials.
    play : makes trials from a configuration, a seed, the first index and the number.
    """

    name: str
    doc: str
    unit: str
    full: int
    short: int
    play: Callable[[Configuration, int, int, int], Iterator[FaultTrial]]


class KindResult(NamedTuple):
    """All trials of one kind."""

    kind: str
    unit: str
    seed: int
    trials: list[FaultTrial]
    seconds: float  # of wall time

    @property
    def tried(self) -> int:
        """Number of messages, sets, losses and so on."""
        return sum(trial.size for trial in self.trials)

    @property
    def escaped(self) -> list[FaultTrial]:
        """Trials in which something went wrong."""
        return [trial for trial in self.trials if trial.escapes]

    def worst(self, quantity: str) -> float:
        """Largest value of `motion`, `force` or `delay`, NaN where no trial has one."""
        found = [value for trial in self.trials if not math.isnan(value := getattr(trial, quantity))]
        return max(found, default=math.nan)


def played(
    kind: FaultKind,
    configuration: Configuration,
    seed: int,
    first: int,
    count: int,
    clock: Callable[[], float],
    report: Callable[[int, int], None] = lambda done, of: None,
) -> KindResult:
    """Play trials of one kind, at most until `FAULTS.most_escapes` have escaped."""
    begin = clock()
    trials: list[FaultTrial] = []
    escaped = 0
    report(0, count)
    for trial in kind.play(configuration, seed, first, count):
        trials.append(trial)
        escaped += bool(trial.escapes)
        report(len(trials), count)
        if escaped >= FAULTS.most_escapes:
            break
    return KindResult(kind.name, kind.unit, seed, trials, clock() - begin)


def finite(values: Iterable[Any]) -> bool:
    """Whether all numbers are finite; their sum is not where one is not."""
    return math.isfinite(math.fsum(values)) if (values := list(values)) else True
