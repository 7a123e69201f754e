"""Faults of every kind, each trial on nodes that are watched independently of what they report."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from wam_description.parameters import parameter
from wam_studies.faults import losses, messages, parameter_sets
from wam_studies.faults.trials import FaultCase, FaultTrial
from wam_studies.harness import Study
from wam_studies.scores import NONE_AT_ALL, Row, Scores, ScoreTable, exact, grouped, number

LOCKSTEP: Final = {"timing.mode": "lockstep"}
# how many periods are late depends on what else the computer does; nothing here is about that
REALTIME: Final = {"timing.mode": "realtime", "driver:late_periods": 1.0}

WORST: Final = ("kind", "trials", "faults", "escapes", "motion [rad]", "force [N]", "delay [ms]")


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
            for i in range(self.trials or kind.full):
                yield FaultCase(configuration, name, seed, i)

    def own_values(self, case: FaultCase) -> Mapping[str, Any]:
        """Parameters that the kind of fault sets."""
        return KINDS[case.kind].values

    def failure(self, record: FaultTrial) -> str:
        """What escaped in a trial, with its name; '' where nothing did."""
        return f"{record.kind}, {record.name}: {'; '.join(record.escapes)}" if record.escapes else ""

    def score(self, records: Sequence[FaultTrial]) -> Scores:
        """Trials from which something escaped, and the worst values of each kind."""
        worst = [_worst(kind, own) for kind, own in grouped(records, lambda one: one.kind).items()]
        escapes = exact(sum(bool(one.escapes) for one in records), len(records))
        table = ScoreTable("Worst values", WORST, worst, is_in_page=True)
        return Scores([Row("trials with an escape", escapes, required=NONE_AT_ALL)], [table])


def _worst(kind: str, trials: Sequence[FaultTrial]) -> list[str]:
    """The cells of a kind under `WORST`."""
    counts = len(trials), sum(one.size for one in trials), sum(bool(one.escapes) for one in trials)
    motion, force, delay = np.fmax.reduce([(one.motion, one.force, one.delay) for one in trials]).tolist()
    return [kind, *map(str, counts), number(motion, 1.0), number(force, 1.0), number(delay, 1e3)]
