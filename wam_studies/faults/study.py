"""Faults of every kind, each trial on nodes that are watched independently of what they report."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from wam_description.parameters import parameter
from wam_studies.faults import losses, messages, parameter_sets
from wam_studies.faults.trials import FaultCase, FaultTrial
from wam_studies.harness import Study
from wam_studies.scores import NONE_AT_ALL, Row, Scores, by_group, exact, grouped, named

LOCKSTEP: Final = {"timing.mode": "lockstep"}
# how many periods are late depends on what else the computer does; nothing here is about that
REALTIME: Final = {"timing.mode": "realtime", "driver:late_periods": 1.0}


class FaultKind(NamedTuple):
    """A kind of fault.

    Attributes
    ----------
    full : number of trials.
    play : plays a trial.
    values : of the configuration.
    """

    full: int
    play: Callable[[FaultCase], FaultTrial]
    values: Mapping[str, Any]


KINDS: Final = {
    "messages": FaultKind(960, messages.play, LOCKSTEP),
    "messages-realtime": FaultKind(960, messages.play, REALTIME),
    "floods": FaultKind(80, messages.play_flood, LOCKSTEP),
    "floods-realtime": FaultKind(80, messages.play_flood, REALTIME),
    "parameters": FaultKind(2000, parameter_sets.play, LOCKSTEP),
    "losses": FaultKind(108, losses.play, {**LOCKSTEP, **losses.FEEDBACK}),
    "losses-realtime": FaultKind(108, losses.play, {**REALTIME, **losses.FEEDBACK}),
    "publishers": FaultKind(60, messages.play_second, LOCKSTEP),
    "publishers-realtime": FaultKind(60, messages.play_second, REALTIME),
}


def run_fault(case: FaultCase) -> FaultTrial:
    """Play a trial."""
    return KINDS[case.kind].play(case)


@dataclass(frozen=True)
class FaultStudy(Study[FaultCase, FaultTrial]):
    """Trials of each kind."""

    title = "wrong messages, wrong parameters, lost nodes"
    page = "docs/safety.md"
    seeds = (1,)
    over_topics = True

    kinds: tuple[str, ...] = parameter("kinds of faults", choices=tuple(KINDS), default=tuple(KINDS))
    trials: int = parameter("trials of each kind; 0: as many as in docs/safety.md", default=0)

    run = staticmethod(run_fault)

    def cases(self, seed: int) -> Iterator[FaultCase]:
        """The trials, kind by kind."""
        for name in self.kinds:
            kind = KINDS[name]
            configuration = self.configuration.with_values(kind.values)
            for number in range(self.trials or kind.full):
                yield FaultCase(configuration, name, seed, number)

    def own_values(self, case: FaultCase) -> Mapping[str, Any]:
        """Parameters that the kind of fault sets."""
        return KINDS[case.kind].values

    def failure(self, record: FaultTrial) -> str:
        """What escaped in a trial, with its name; '' where nothing did."""
        return f"{record.kind}, {record.name}: {'; '.join(record.escapes)}" if record.escapes else ""

    def score(self, records: Sequence[FaultTrial]) -> Scores:
        """Trials of each kind from which something escaped, and the worst values."""
        by_kind = grouped(records, lambda one: one.kind)
        rows = [row for name, own in by_kind.items() for row in named(list(_rows(own))[:1], name)]
        return Scores(rows, [by_group("Worst values", by_kind, _rows)])


def _rows(trials: Sequence[FaultTrial]) -> Iterator[Row]:
    """What escaped from the trials of a kind, and their largest values."""
    yield Row("escapes", exact(sum(bool(one.escapes) for one in trials), len(trials)), required=NONE_AT_ALL)
    yield Row("messages, sets, nodes and so on", exact(sum(one.size for one in trials), len(trials)))
    for name, unit, scale in (("motion", "rad", 1.0), ("force", "N", 1.0), ("delay", "ms", 1e3)):
        known = [value for one in trials if not math.isnan(value := getattr(one, name))]
        yield Row(f"largest {name}", exact(max(known, default=math.nan), len(known)), unit, scale)
