"""Contact estimation on simulated arms: as the estimator's model states them, and on others."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from wam_description.configuration import Configuration
from wam_studies.contact.bounds import BOUNDS, bounds
from wam_studies.contact.degradations import IDENTIFIED, NAMES
from wam_studies.contact.degraded_rows import DriveScore, degraded_rows, degraded_tables, groups_of
from wam_studies.contact.recording import Drive
from wam_studies.contact.rows import ScenarioScore, further_rows, stated_rows
from wam_studies.contact.scenarios import BenchmarkScenario, ScenarioGenerator, dither_values
from wam_studies.contact.trial import ContactCase, play_case
from wam_studies.harness import Study, option
from wam_studies.scores import Row, Scores, ScoreTable

ALL = "all"


class DriveExtent(NamedTuple):
    """How drives of one kind of contacts follow from the length of a recording."""

    shortest: float = 10.0  # s, with one contact
    other: float = 0.4  # of the length of a recording, with contacts that last or with masses
    arms: int = 3  # of each seed, that are identified


EXTENT = DriveExtent()


@dataclass(frozen=True)
class ContactStudy(Study[ContactCase, ScenarioScore | DriveScore]):
    """Scenarios of an arm as stated; and drives of arms and signals with degradations, one at a time and mixed."""

    title: ClassVar[str] = "contact estimation on the whole arm, as its model states it or with degradations"
    page: ClassVar[str] = "docs/contact.md"

    contacts: int = option(200, "contacts in motion per seed", 1)
    resting: int = option(30, "contacts at rest per seed", 0)
    free: float = option(200.0, "seconds of motion without contact per seed", 0.0)
    joint_sensors: bool = option(False, "estimate from the joint sensors")
    degradations: tuple[str, ...] = option(
        (), f"of arm and signals: {ALL}, or of {', '.join(NAMES)}".replace("%", "%%")
    )
    seconds: float = option(110.0, "length of a recording with degradations", EXTENT.shortest)

    def __post_init__(self) -> None:
        """Refuse a degradation that is not known.

        Raises
        ------
        ValueError
            which names it and those that there are.
        """
        super().__post_init__()
        for name in self.degradations:
            if name not in (ALL, *NAMES):
                raise ValueError(f"no degradation is named '{name}'; degradations: {', '.join(NAMES)}")

    def cases(self, seed: int) -> list[ContactCase]:
        """The scenarios of a seed, then its drives."""
        chosen: list[BenchmarkScenario | Drive] = [*self.scenarios(seed), *self.drives(seed)]
        return [ContactCase(self.configuration, one) for one in chosen]

    run = staticmethod(play_case)

    def scenarios(self, seed: int) -> list[BenchmarkScenario]:
        """Contacts in motion, free motion, contacts at rest, and these with dither if the velocity loop has it."""
        generator = ScenarioGenerator(self.configuration, seed, self.joint_sensors)
        dither = dither_values(self.configuration)
        found = generator.contacts(self.contacts) + generator.free(self.free) + generator.resting(self.resting)
        return found + generator.resting(self.resting, dither) if dither else found

    def drives(self, seed: int) -> Iterator[Drive]:
        """Drives of each degradation.

        One with contacts of every kind; the same arm with contacts that last; the same arm picking up masses; arms
        of some degradations with contacts of three forces, whose models are not identified; the same, identified.
        """
        for name in NAMES if ALL in self.degradations else self.degradations:
            wide = Drive(self.configuration, name, seed, self.seconds)
            lasting = wide._replace(contacts="lasting", seconds=max(EXTENT.shortest, EXTENT.other * self.seconds))
            yield from (wide, lasting, lasting._replace(contacts="masses"))
            for arm in range(EXTENT.arms) if name in IDENTIFIED else ():
                level = wide._replace(contacts="level", seed=EXTENT.arms * seed + arm)
                yield from (level, level._replace(is_identified=True))

    def own_values(self, case: ContactCase) -> Collection[str]:
        """Parameters of the scenario."""
        return case.given.values if isinstance(case.given, BenchmarkScenario) else ()

    def score(self, records: Sequence[ScenarioScore | DriveScore]) -> Scores:
        """Rows of the arm as stated, then of degradations."""
        arm = self.configuration.shared.arm
        scenarios = [one for one in records if isinstance(one, ScenarioScore)]
        drives = [one for one in records if isinstance(one, DriveScore)]
        rows: list[Row] = [*stated_rows(scenarios, arm), *further_rows(scenarios, arm), *degraded_rows(drives)]
        tables = [_extent(scenarios), *degraded_tables(drives), *_bounds(self.configuration, drives)]
        return Scores(rows, tables)

    def failure(self, record: ScenarioScore | DriveScore) -> str:
        """Why a case ended early."""
        return record.failure if isinstance(record, ScenarioScore) else record.score.failure

    def picture(self, records: Sequence[ScenarioScore | DriveScore], file: Path) -> bool:
        """Position errors, calibration, torque errors, latency, link identification on the arm as stated."""
        from wam_studies.contact.picture import figure  # matplotlib is slow to import

        figure([one for one in records if isinstance(one, ScenarioScore)], self.configuration.shared.arm, file)
        return True


def _extent(scenarios: Sequence[ScenarioScore]) -> ScoreTable:
    """Numbers of scenarios and contacts."""
    free = sum(one.contact_free.seconds for one in scenarios if one.contact_free.group == "free")
    counts = {
        "scenarios": len(scenarios),
        "contacts evaluated": sum(len(one.contacts) for one in scenarios),
        "contacts too short or too hard": sum(one.excluded for one in scenarios),
        "contacts planned but not made": sum(one.not_made for one in scenarios),
        "free motion, s": round(free),
    }
    return ScoreTable("Extent", list(counts), [list(map(str, counts.values()))])


def _bounds(configuration: Configuration, drives: Sequence[DriveScore]) -> Iterator[ScoreTable]:
    """What is possible at best with the errors of the torques of identified arms; none without any."""
    identified = [one for own in groups_of(drives, "level", True).values() for one in own]
    if identified:
        errors = np.sqrt(np.mean(np.square([one.torque_errors for one in identified]), axis=0))
        rows = bounds(configuration, min(one.seed for one in drives), errors)
        yield ScoreTable("What is possible at best", BOUNDS, rows, OPEN)


OPEN = """The inference alone, with torques that have the errors of a row and no others, and exactly their covariance;
poses and contacts are drawn as after an identification."""
