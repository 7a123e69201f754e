"""One case of contact estimation: a scenario on the arm as stated, or a recorded drive with a degradation."""

from typing import NamedTuple

from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_studies.contact.contacts import evaluate_contacts
from wam_studies.contact.degraded_rows import DriveScore
from wam_studies.contact.free_motion import contact_free_time, torque_errors
from wam_studies.contact.recording import Drive, record
from wam_studies.contact.replay import replay
from wam_studies.contact.rows import ScenarioScore
from wam_studies.contact.scenarios import BenchmarkScenario
from wam_studies.contact.simulation import Played, play


class ContactCase(NamedTuple):
    """What is played on the arm of a configuration."""

    configuration: Configuration
    given: BenchmarkScenario | Drive

    def __str__(self) -> str:
        given = self.given
        return given.name if isinstance(given, BenchmarkScenario) else f"{given.degradation}, seed {given.seed}"


def play_case(case: ContactCase) -> ScenarioScore | DriveScore:
    """Simulate a case and score it."""
    given = case.given
    if isinstance(given, Drive):
        found = replay(given.configuration, given.degradation, record(given), given.seed)
        return DriveScore(given.seed, given.contacts, given.is_identified, found)
    return score(play(case.configuration, given), case.configuration.shared.arm)


def score(played: Played, arm: Arm) -> ScenarioScore:
    """Score a scenario."""
    lengths = dict(zip(arm.covers.names, arm.covers.length, strict=True))
    found, excluded = evaluate_contacts(played, lengths)
    return ScenarioScore(
        name=played.scenario.name,
        contacts=found,
        excluded=excluded,
        not_made=max(0, len(played.scenario.planned) - len(found) - excluded),
        torque_errors=torque_errors(played),
        contact_free=contact_free_time(played),
        failure=played.failure,
    )
