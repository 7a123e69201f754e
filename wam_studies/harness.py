"""One harness for every study: seeds, progress, resume, processes or a cluster, results, command line and page.

A study is a frozen dataclass below `Study` with three pure methods; each field that is a `parameter` with a default is
an option.  `wam evaluate NAME` runs those of `STUDIES`, and `evaluate` runs any other (examples/study.py).
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, ClassVar, Final, Generic, NamedTuple, TypeVar

from wam_description.configuration import Configuration
from wam_sim.batch import Report, results
from wam_sim.pieces import key_of
from wam_studies.figures.panels import Panel
from wam_studies.scores import Scores

Case = TypeVar("Case")
Record = TypeVar("Record")

# name: where its class is
STUDIES: Final = {
    "contact": "wam_studies.contact.study:ContactStudy",
    "faults": "wam_studies.faults.study:FaultStudy",
    "force": "wam_studies.force_benchmark.study:ForceStudy",
    "guard": "wam_studies.guard_validation:GuardStudy",
    "identify": "wam_studies.identification.study:IdentificationStudy",
    "soak": "wam_studies.faults.soak:SoakStudy",
}


@dataclass(frozen=True)
class Study(ABC, Generic[Case, Record]):
    """A study: the cases that are drawn, what is measured of each, and what is required of all.

    Attributes
    ----------
    title : what is studied, in a line.
    page : of the documentation that has its result.
    seeds : by default.
    count : cases of a seed by default; None for all that there are.
    base : name of the configuration by default.
    over_topics : whether a case runs nodes over topics; then one case runs at a time, and --set takes any parameter.
    configuration : under test.
    """

    title: ClassVar[str]
    page: ClassVar[str] = ""
    seeds: ClassVar[tuple[int, ...]] = (1, 2, 3)
    count: ClassVar[int | None] = None
    base: ClassVar[str] = "wam"
    over_topics: ClassVar[bool] = False

    configuration: Configuration

    @abstractmethod
    def cases(self, seed: int) -> Iterable[Case]:
        """The cases of a seed, plain data; each depends on the options, the seed and its number alone."""

    @staticmethod
    @abstractmethod
    def run(case: Case, /) -> Record:
        """Measure a case.  A record is plain data: `wam_sim.pieces` keeps it as JSON."""

    @abstractmethod
    def score(self, records: Sequence[Record]) -> Scores:
        """Compare what was measured with what is required, from the records of all seeds or of one."""

    def panels(self, records: Sequence[Record]) -> Sequence[Panel]:
        """Panels of the picture of the records; none where the study has no picture."""
        return ()

    def failure(self, record: Record) -> str:
        """Why a case is to be looked at, by default the field of this name; '' where it is as it should be."""
        return str(getattr(record, "failure", ""))

    def own_values(self, case: Case) -> Collection[str]:
        """Parameters that a case sets itself, so that --set has no effect on them."""
        return ()


class Measurement(NamedTuple):
    """What a study has measured, when, and on which code.

    Attributes
    ----------
    study : with its options.
    records : by seed, in order of their cases.
    date : of its end.
    code : hash of code and configuration.
    """

    study: Study[Any, Any]
    records: Mapping[int, Sequence[Any]]
    date: str
    code: str

    @property
    def total(self) -> list[Any]:
        """The records of all seeds."""
        return [record for own in self.records.values() for record in own]

    @property
    def scores(self) -> Scores:
        """Scores from the records of all seeds together."""
        return self.study.score(self.total)

    @property
    def failures(self) -> list[tuple[int, int, str]]:
        """Seed, number and reason of each case that is to be looked at."""
        return [
            (seed, number, reason)
            for seed, own in self.records.items()
            for number, record in enumerate(own)
            if (reason := self.study.failure(record))
        ]

    @property
    def by_seed(self) -> dict[int, Scores]:
        """Scores of each seed, from its records alone."""
        return {seed: self.study.score(own) for seed, own in self.records.items()}


def chosen_cases(
    study: Study[Case, Any], seed: int, count: int | None = None, numbers: Sequence[int] = ()
) -> list[Case]:
    """The first cases of a seed, or those of some numbers."""
    first = list(islice(study.cases(seed), max(numbers) + 1 if numbers else count or study.count))
    return [first[number] for number in numbers if number < len(first)] if numbers else first


def evaluate(
    study: Study[Case, Record],
    cases: Mapping[int, Sequence[Case]],
    executor: Executor,
    file: Path | None = None,
    report: Report | None = None,
) -> Measurement:
    """Run the cases of each seed; the other arguments are those of `wam_sim.batch.results`."""
    found = iter(results(study.run, [case for own in cases.values() for case in own], executor, file, report))
    records = {seed: list(islice(found, len(own))) for seed, own in cases.items()}
    code = key_of(study.run, study.configuration.text)[:12]
    return Measurement(study, records, f"{datetime.now(UTC):%Y-%m-%d}", code)


def load(name: str) -> type[Study[Any, Any]]:
    """The class of a study."""
    return resolve_name(STUDIES[name])
