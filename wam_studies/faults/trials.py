"""Trials of faults: what was tried, what escaped, and how far the arm moved."""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from wam_description.configuration import Configuration

ZERO_CURRENT = 0.05  # s of the arm's time, from the loss of a node to zero current
MOTION = 0.01  # rad, of a joint without a legitimate command
HELD_MOTION = 0.2  # rad, of a joint that obeys one wrong message of its own commander until it is too old
FORCE = 15.0  # N, of the arm on the world without a legitimate command
MOST_ESCAPES = 20  # of one kind; then the kind is stopped


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
    """Play trials of one kind, at most until `MOST_ESCAPES` have escaped."""
    begin = clock()
    trials: list[FaultTrial] = []
    escaped = 0
    report(0, count)
    for trial in kind.play(configuration, seed, first, count):
        trials.append(trial)
        escaped += bool(trial.escapes)
        report(len(trials), count)
        if escaped >= MOST_ESCAPES:
            break
    return KindResult(kind.name, kind.unit, seed, trials, clock() - begin)


def finite(values: Iterable[Any]) -> bool:
    """Whether all numbers are finite; their sum is not where one is not."""
    return math.isfinite(math.fsum(values)) if (values := list(values)) else True
