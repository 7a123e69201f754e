"""Contact estimation on simulated arms: as the estimator's model states them, and on others."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_description.configuration import Configuration
from wam_description.parameters import parameter
from wam_studies.contact.degradations import IDENTIFIED, NAMES
from wam_studies.contact.drives import TIMES, Drive, record, replay
from wam_studies.contact.outcomes import ContactOutcome, ContactScore
from wam_studies.contact.rows import (
    MEDIANS,
    degraded_rows,
    degraded_tables,
    error_of,
    in_groups,
    near,
    on_outer_link,
    stated_rows,
)
from wam_studies.contact.scenarios import GROUPS, KINDS, RANGES, BenchmarkScenario, ScenarioGenerator
from wam_studies.contact.simulation import play, score
from wam_studies.figures.panels import Panel, Panels, line_only, measured
from wam_studies.harness import Study
from wam_studies.scores import Scores, ScoreTable

ALL = "all"
BINS = 6  # of the picture
CENTIMETRES = 100.0


class ContactCase(NamedTuple):
    """What is played on the arm of a configuration."""

    configuration: Configuration
    given: BenchmarkScenario | Drive

    def __str__(self) -> str:
        given = self.given
        return given.name if isinstance(given, BenchmarkScenario) else f"{given.degradation}, seed {given.seed}"


def play_case(case: ContactCase) -> ContactScore:
    """Simulate a case and score it."""
    given = case.given
    if isinstance(given, BenchmarkScenario):
        return score(play(case.configuration, given), case.configuration.shared.arm)
    return replay(given, record(given))


@dataclass(frozen=True)
class ContactStudy(Study[ContactCase, ContactScore]):
    """Scenarios of an arm as stated; and drives of arms and signals with degradations, one at a time and mixed."""

    title = "contact estimation on an arm as modelled, or with degradations"
    page = "docs/contact.md"

    contacts: int = parameter("contacts in motion per seed", low=1, default=200)
    resting: int = parameter("contacts at rest, with dither, per seed", default=30)
    free: float = parameter("motion without contact per seed", "s", default=200.0)
    joint_sensors: bool = parameter("estimate from the joint sensors", default=False)
    degradations: tuple[str, ...] = parameter("degradations of arm and signals", choices=(ALL, *NAMES), default=())
    seconds: float = parameter("length of a recording with degradations", "s", low=TIMES.shortest, default=110.0)

    def cases(self, seed: int) -> list[ContactCase]:
        """The scenarios of a seed, then its drives."""
        chosen: list[BenchmarkScenario | Drive] = [*self.scenarios(seed), *self.drives(seed)]
        return [ContactCase(self.configuration, one) for one in chosen]

    run = staticmethod(play_case)

    def scenarios(self, seed: int) -> list[BenchmarkScenario]:
        """Contacts in motion, free motion, and contacts at rest with dither if the velocity loop has it."""
        generator = ScenarioGenerator(self.configuration, seed, self.joint_sensors)
        return generator.contacts(self.contacts) + generator.free(self.free) + generator.resting(self.resting)

    def drives(self, seed: int) -> Iterator[Drive]:
        """Drives of each degradation.

        One with contacts of every kind; the same arm with contacts that last; the same arm picking up masses; arms
        of some degradations with contacts of three forces, whose models are not identified; the same, identified.
        """
        for name in NAMES if ALL in self.degradations else self.degradations:
            wide = Drive(self.configuration, name, seed, self.seconds)
            lasting = wide._replace(contacts="lasting", seconds=max(TIMES.shortest, TIMES.other * self.seconds))
            yield from (wide, lasting, lasting._replace(contacts="masses"))
            for arm in range(TIMES.arms) if name in IDENTIFIED else ():
                level = wide._replace(contacts="level", seed=TIMES.arms * seed + arm)
                yield from (level, level._replace(is_identified=True))

    def own_values(self, case: ContactCase) -> Collection[str]:
        """Parameters that the scenario of a case sets."""
        return case.given.values if isinstance(case.given, BenchmarkScenario) else ()

    def score(self, records: Sequence[ContactScore]) -> Scores:
        """Rows of the arm as stated, then of degradations."""
        rows = [*stated_rows(records, self.configuration.shared.arm), *degraded_rows(records)]
        return Scores(rows, [_extent(in_groups(records, *GROUPS)), *degraded_tables(records)])

    def panels(self, records: Sequence[ContactScore]) -> Panels:
        """Position errors and calibration on the arm as stated."""
        found = on_outer_link(records, self.configuration.shared.arm)
        return _errors(found), _deviations(found)


def _extent(scenarios: Sequence[ContactScore]) -> ScoreTable:
    """Numbers of scenarios and contacts."""
    counts = {
        "scenarios": len(scenarios),
        "contacts evaluated": sum(len(one.outcomes) for one in scenarios),
        "contacts too short or too hard": sum(one.excluded for one in scenarios),
        "contacts planned but not made": sum(one.not_made for one in scenarios),
        "free motion, s": round(sum(one.free_seconds for one in scenarios if one.group == "free")),
    }
    return ScoreTable("Extent", list(counts), [list(map(str, counts.values()))])


def _errors(found: Sequence[ContactOutcome]) -> Panel:
    lines = []
    for kind in KINDS:
        own = [one for one in found if one.kind == kind]
        medians = {force: error_of(near(own, force)).value for force in RANGES.levels}
        known = {force: CENTIMETRES * value for force, value in medians.items() if math.isfinite(value)}
        lines.append((kind, measured(list(known), list(known.values()))))
    required = [CENTIMETRES * most for most, _ in MEDIANS.values()]
    lines.append(("required", line_only(list(MEDIANS), required)))
    return Panel("position in motion, median error", "force [N]", "error [cm]", lines)


def _deviations(found: Sequence[ContactOutcome]) -> Panel:
    given = [one for one in found if one.right_link and math.isfinite(one.error) and one.position_sd > 0.0]
    sd = CENTIMETRES * np.array([one.position_sd for one in given])
    error = CENTIMETRES * np.array([one.error for one in given])
    groups = np.array_split(np.argsort(sd), BINS) if len(sd) >= BINS else []  # of equal number, from small to large
    middle = np.array([np.median(sd[group]) for group in groups])
    inner = np.array([np.quantile(error[group], 0.683) for group in groups])
    ends = np.array([0.3, 15.0])
    lines = [("68 % quantile of the error", measured(middle, inner)), ("one reported sd", line_only(ends, ends))]
    return Panel("reported standard deviation", "reported sd of the position [cm]", "error [cm]", lines, "xy")
