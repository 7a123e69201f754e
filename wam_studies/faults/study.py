"""Faults of every kind, each trial on nodes that are watched independently of what they report."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from wam_studies.faults import bags, disks, interruptions, losses, messages, parameter_sets
from wam_studies.faults.trials import FaultCase, FaultTrial
from wam_studies.harness import Study, option
from wam_studies.scores import NONE_AT_ALL, Row, Scores, ScoreTable, exact

LOCKSTEP: Final = {"timing.mode": "lockstep"}
# how many periods are late depends on what else the computer does; nothing here is about that
REALTIME: Final = {"timing.mode": "realtime", "driver:late_periods": 1.0}


class FaultKind(NamedTuple):
    """A kind of fault.

    Attributes
    ----------
    unit : of `FaultTrial.size`, plural.
    full, short : number of trials.
    play : plays a trial.
    values : of the configuration.
    """

    unit: str
    full: int
    short: int
    play: Callable[[FaultCase], FaultTrial]
    values: Mapping[str, Any]


KINDS: Final = {
    "messages": FaultKind("messages", 960, 2, messages.play, LOCKSTEP),
    "messages-realtime": FaultKind("messages", 960, 1, messages.play, REALTIME),
    "floods": FaultKind("messages", 80, 1, messages.play_flood, LOCKSTEP),
    "floods-realtime": FaultKind("messages", 80, 1, messages.play_flood, REALTIME),
    "parameters": FaultKind("sets", 2000, 5, parameter_sets.play, LOCKSTEP),
    "losses": FaultKind("losses", 108, 0, losses.play, {**LOCKSTEP, **losses.FEEDBACK}),
    "losses-realtime": FaultKind("losses", 108, 0, losses.play, {**REALTIME, **losses.FEEDBACK}),
    "publishers": FaultKind("publishers", 60, 2, messages.play_second, LOCKSTEP),
    "publishers-realtime": FaultKind("publishers", 60, 1, messages.play_second, REALTIME),
    "disks": FaultKind("disks", 12, 1, disks.play, LOCKSTEP),
    "bags": FaultKind("bags", 3000, 10, bags.play, LOCKSTEP),
    "interruptions": FaultKind("interruptions", 100, 0, interruptions.play, {}),
}


def run_fault(case: FaultCase) -> FaultTrial:
    """Play a trial."""
    return KINDS[case.kind].play(case)


@dataclass(frozen=True)
class FaultStudy(Study[FaultCase, FaultTrial]):
    """Trials of each kind."""

    title = "wrong messages, lost nodes, full disks, Ctrl-C"
    page = "docs/safety.md"
    seeds = (1,)
    over_topics = True

    kinds: tuple[str, ...] = option(tuple(KINDS), "kinds of faults", choices=tuple(KINDS))
    trials: int = option(0, "trials of each kind; 0: as many as in docs/safety.md", 0)
    short: bool = option(False, "one or a few trials of each kind")

    run = staticmethod(run_fault)

    def cases(self, seed: int) -> Iterator[FaultCase]:
        """The trials, kind by kind."""
        for name in self.kinds:
            kind = KINDS[name]
            configuration = self.configuration.with_values(kind.values)
            for number in range(self.trials or (kind.short if self.short else kind.full)):
                yield FaultCase(configuration, name, seed, number)

    def own_values(self, case: FaultCase) -> Mapping[str, Any]:
        """Those of the kind."""
        return KINDS[case.kind].values

    def failure(self, record: FaultTrial) -> str:
        """What escaped."""
        return f"{record.kind}, {record.name}: {'; '.join(record.escapes)}" if record.escapes else ""

    def score(self, records: Sequence[FaultTrial]) -> Scores:
        """Trials of each kind from which something escaped, and the worst values."""
        every = {name: [one for one in records if one.kind == name] for name in self.kinds}
        by_kind = {name: own for name, own in every.items() if own}
        rows = [
            Row(f"escapes, {name}", exact(sum(bool(one.escapes) for one in own), len(own)), required=NONE_AT_ALL)
            for name, own in by_kind.items()
        ]
        head = ("kind", "tried", "largest motion [rad]", "largest force [N]", "zero current or answer after [ms]")
        worst = [
            [
                name,
                f"{sum(one.size for one in own)} {KINDS[name].unit}",
                _largest([one.motion for one in own], 1.0, 4),
                _largest([one.force for one in own], 1.0, 1),
                _largest([one.delay for one in own], 1e3, 0),
            ]
            for name, own in by_kind.items()
        ]
        return Scores(rows, [ScoreTable("Worst values", head, worst)])


def _largest(values: Sequence[float], scale: float, digits: int) -> str:
    known = [scale * value for value in values if not math.isnan(value)]
    return f"{max(known):.{digits}f}" if known else "–"
