"""The benchmarks as a study: each round measures a subject and a reference in turns; only their ratio is compared.

    python benchmarks/bench.py                                           # all
    python benchmarks/bench.py --benchmarks speed compiled --rounds 3

Speeds differ between computers, and on one computer from hour to hour; the ratio of two quantities measured in turns
in the same run is stable.
"""

import math
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import ClassVar, Final, NamedTuple

from wam_cli.commands.evaluate import program
from wam_description.parameters import parameter
from wam_studies.figures.panels import Mark, Panel, measured
from wam_studies.harness import Study
from wam_studies.scores import ANY, NONE, Row, Scores, ScoreTable, exact, grouped

# name: where it is
BENCHMARKS: Final = {
    "speed": "stack:SPEED",
    "round_trip": "stack:ROUND_TRIP",
    "real_time": "stack:REAL_TIME",
    "bus": "bus:BUS",
    "compiled": "simulation:COMPILED",
    "parts": "cost:PARTS",
    "estimator": "cost:ESTIMATOR",
    "bag_reading": "bags:BAG_READING",
    "analysis": "bags:ANALYSIS",
}
Values = Mapping[str, float]  # of a round, by name; without what cannot be measured here


class Ratio(NamedTuple):
    """A row of a benchmark's table.

    Attributes
    ----------
    name : of a measured value, or of its row.
    reference : the value that it is divided by; '' for the value itself.
    must, aim : of the ratio, or of the value; the smaller the better where the aim is below what must be.
    """

    name: str
    reference: str = ""
    must: float = math.nan
    aim: float = math.nan

    def ratios(self, rounds: Sequence[Values]) -> list[float]:
        """The ratios of the rounds that have it, the least first."""
        return sorted(found[self.name] / found.get(self.reference, 1.0) for found in rounds if self.name in found)

    def row(self, benchmark: str, rounds: Sequence[Values]) -> Row:
        """The median of the rounds, with what is required."""
        ratios = self.ratios(rounds)
        required, target = (ANY if math.isnan(end) else self._better(end) for end in (self.must, self.aim))
        found = exact(statistics.median(ratios), len(ratios)) if ratios else NONE
        return Row(f"{benchmark}: {self.name}", found, required=required, target=target)

    def _better(self, end: float) -> tuple[float, float]:
        return (end, math.inf) if self.aim > self.must else (0.0, end)

    def cells(self, rounds: Sequence[Values]) -> list[str]:
        """Medians of measured value and reference, and the ratio with its ends."""
        if not (ratios := self.ratios(rounds)):
            return [self.name, *["–"] * 3]
        shown = [found for found in rounds if self.name in found]
        both = [statistics.median(found.get(name, 1.0) for found in shown) for name in (self.name, self.reference)]
        middle = f"{statistics.median(ratios):.3g} ({ratios[0]:.3g} to {ratios[-1]:.3g})"
        return [self.name, *(f"{value:.4g}" if self.reference else "" for value in both), middle]


class Benchmark(NamedTuple):
    """What is measured, and what is shown of it.

    Attributes
    ----------
    measure : the values of a round; a short one where its argument is true.
    title : of the table, with the unit of its values.
    ratios : the rows.
    rounds : by default.
    """

    measure: Callable[[bool], Values]
    title: str
    ratios: Sequence[Ratio]
    rounds: int


def load(name: str) -> Benchmark:
    """The benchmark of a name."""
    found: Benchmark = resolve_name(BENCHMARKS[name])
    return found


class Round(NamedTuple):
    """A case: one round of a benchmark.

    Attributes
    ----------
    begin : of the run, s since 1970: what was measured in another run is not taken.
    """

    benchmark: str
    number: int
    is_quick: bool
    begin: float


class Measured(NamedTuple):
    """What a round of a benchmark has measured."""

    benchmark: str
    values: Values


@dataclass(frozen=True)
class BenchmarkStudy(Study[Round, Measured]):
    """The rounds of each benchmark, one after the other."""

    title: ClassVar[str] = "speed of the stack and of its parts"
    page: ClassVar[str] = "benchmarks/README.md"
    seeds: ClassVar[tuple[int, ...]] = (1,)
    over_topics: ClassVar[bool] = True
    benchmarks: tuple[str, ...] = parameter("benchmarks", choices=tuple(BENCHMARKS), default=tuple(BENCHMARKS))
    rounds: int = parameter("rounds of each; 0 for as many as a benchmark has by itself", low=0, default=0)
    quick: bool = parameter("one short round of each", default=False)

    def cases(self, seed: int) -> Iterator[Round]:
        """The rounds; nothing is drawn."""
        begin = time.time()
        for name in self.benchmarks:
            for number in range(1 if self.quick else self.rounds or load(name).rounds):
                yield Round(name, number, self.quick, begin)

    @staticmethod
    def run(case: Round) -> Measured:
        """Measure one round."""
        return Measured(case.benchmark, dict(load(case.benchmark).measure(case.is_quick)))

    def score(self, records: Sequence[Measured]) -> Scores:
        """The median of each ratio; a table of each benchmark."""
        rows, tables = [], []
        for name, rounds in _rounds(records).items():
            benchmark = load(name)
            rows += [ratio.row(name, rounds) for ratio in benchmark.ratios]
            lines = [ratio.cells(rounds) for ratio in benchmark.ratios]
            tables.append(ScoreTable(f"{name}: {benchmark.title}", HEAD, lines))
        return Scores(rows, tables)

    def panels(self, records: Sequence[Measured]) -> Sequence[Panel]:
        """How the computing time grows from the bare plant to the stack in processes, and the parts of a period."""
        medians = {
            name: {key: statistics.median(found[key] for found in rounds) for key in rounds[0]}
            for name, rounds in _rounds(records).items()
        }
        panels = []
        if speeds := medians.get("speed"):
            names = ["bare plant", *(ratio.name for ratio in load("speed").ratios)]
            times = {name: 1e3 / speeds[name] for name in names}
            panels.append(_named_points("What each layer adds", "computing time of 1 s of the arm [ms]", times))
        if parts := medians.get("parts"):
            largest = dict(sorted(parts.items(), key=lambda item: -item[1]))
            panels.append(_named_points("Parts of a period, plain Python", "computing time [us]", largest))
        return panels


def _rounds(records: Sequence[Measured]) -> dict[str, list[Values]]:
    """What was measured in the rounds of each benchmark."""
    of = grouped(records, lambda record: record.benchmark)
    return {name: [record.values for record in own] for name, own in of.items()}


def _named_points(title: str, unit: str, values: Values) -> Panel:
    """A panel with a named point of each value, the first at the top."""
    places = range(0, -len(values), -1)
    marks = tuple(map(Mark, values, values.values(), places))
    line = ("", measured(list(values.values()), places))
    room = 30.0 * max(values.values())  # for the names
    return Panel(title, unit, "", [line], "x", marks, (math.nan, room, math.nan, math.nan))


HEAD: Final = ("", "measured", "reference", "ratio, or value: median (least to greatest)")


if __name__ == "__main__":
    sys.modules["bench"] = sys.modules["__main__"]
    sys.exit(program("bench", BenchmarkStudy))
