"""The benchmark of contact estimation on arms that differ from what the estimator states."""

from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.contact.contact_inference import Hypothesis
from wam_description.event import Code, warning
from wam_description.reasons import NO_REASON, Reason
from wam_description.rigid_body import RigidBody
from wam_studies.contact.degradations import NAMES, drawn
from wam_studies.contact.drives import Drive, arriving, names_payload, record
from wam_studies.contact.outcomes import ContactOutcome, ContactScore, TorqueErrors, payload_probability
from wam_studies.contact.rows import IDENTIFIED_ARM, degraded_rows, degraded_tables
from wam_studies.contact.scenarios import base_values
from wam_studies.contact.study import ContactCase, ContactStudy, play_case
from wam_studies.identification.plants import MeasuredSignals
from wam_studies.scores import Row, ScoreTable

TOUCH = ContactOutcome("outer", "", 0.2, 5.0, 0.0, True, 0.0, True, 0.99, True, "outer", 0.0, 0.01, True)
QUIET = TorqueErrors(*[(0.0,)] * 3, 1, 1)
OWN = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters)
STATED, COARSE, LOADED = "as stated", "encoder 4096", "payload 0.3 kg"
EXACT = ("moving", "asymmetry", "load", "shape", "payload", "mass")
BELIEVING = {f"contact_estimator:observer.{name}_uncertainty": 0.0 for name in EXACT} | {
    "contact_estimator:observer.motor_noise": 0.0
}


def score_of(drive: Drive) -> ContactScore:
    return play_case(ContactCase(drive.configuration, drive))


@pytest.mark.parametrize("name", NAMES)
def test_a_degradation_is_drawn_from_its_seed_and_changes_the_arm_or_its_signals(name: str) -> None:
    first, again = (drawn(name, WAM, np.random.default_rng(5)) for _ in range(2))
    assert first == again
    assert (drawn(STATED, WAM, np.random.default_rng(5)) == first) is (name == STATED)


def test_drives_are_of_each_degradation_and_the_mix_is_identified_too() -> None:
    drives = list(ContactStudy(CONFIGURATION, degradations=("all",), seconds=20.0).drives(2))
    wide = [drive for drive in drives if drive.contacts == "wide"]
    assert [drive.degradation for drive in wide] == list(NAMES)
    assert {drive.degradation for drive in drives if drive.is_identified} == {"realistic mix"}
    assert {drive.seed for drive in drives if drive.contacts == "level"} == {6, 7, 8}
    assert {drive.seconds for drive in drives if drive.contacts == "masses"} == {10.0}
    assert not list(ContactStudy(CONFIGURATION).drives(2))


def scored(*outcomes: ContactOutcome, **parts: Any) -> ContactScore:
    return ContactScore(STATED, "", list(outcomes), 100.0, 0, QUIET, contact_seconds=60.0)._replace(**parts)


def driven(*scores: ContactScore, group: str = "wide") -> list[ContactScore]:
    return [score._replace(group=group) for score in scores]


def rows_of(drives: list[ContactScore]) -> dict[str, Row]:
    return {row.name: row for row in degraded_rows(drives)}


def test_the_worst_degradation_is_the_one_with_the_most_false_alarms_even_if_they_are_allowed() -> None:
    rows = rows_of(driven(scored(name=COARSE), scored(name=LOADED, alarms=1)))
    assert rows[f"false alarms, any degradation alone, the worst: {LOADED}"].found.value == 0.01


def test_what_goes_in_is_counted_in_the_row_that_it_is_of() -> None:
    late = TOUCH._replace(latency=0.1, error=0.2)
    inner = TOUCH._replace(kind="inner", force=10.0, latency=np.inf)
    rough = TOUCH._replace(force=20.0, friction=0.8, in_set=False)
    drives = [
        *driven(scored(inner, inner._replace(latency=0.01), rough, name="delay 2 ms")),
        *driven(scored(TOUCH._replace(sure_and_wrong=0.5)), group="lasting"),
        *driven(scored(TOUCH, late), group=IDENTIFIED_ARM),
    ]
    rows = rows_of(drives)
    mix = "realistic mix, identified"
    assert rows[f"5 N on the outer link detected within 30 ms, {mix}"].found[::3] == (0.5, 2)
    assert rows[f"position on the outer link at 5 N, 95 % quantile of the error, {mix}"].found.value > 0.1
    assert rows["10 N on the inner link detected within 200 ms, every arm"].found[::3] == (0.5, 2)
    assert rows["90 % set contains the truth at 20 N, mu 0.8, every arm, masses included"].found[::3] == (0.0, 1)
    assert rows["90 % set contains the truth, contacts of 0.2 to 10 s"].found[::3] == (1.0, 1)
    assert rows["contact time with a wrong link, probability > 0.95, every arm"].found.value == pytest.approx(0.5 / 180)
    assert rows_of([]) == {}


def table(title: str, drives: list[ContactScore]) -> ScoreTable:
    return next(one for one in degraded_tables(drives) if one.title.startswith(title))


def test_the_sets_are_counted_by_force_too() -> None:
    light = TOUCH
    strong = light._replace(force=40.0, in_set=False)
    held = column_of(table("By kind", driven(scored(light, strong, strong))), "90 % set contains the truth [%]")
    assert (held["outer"], held["0 to 7.5 N"], held["30 to 80 N"]) == ("33.3 (3)", "100 (1)", "0 (2)")


def column_of(found: ScoreTable, quantity: str) -> dict[str, str]:
    """A quantity of each group."""
    return dict(zip(found.head, next(line for line in found.rows if line[0] == quantity), strict=True))


@pytest.mark.slow
def test_the_forces_of_the_contacts_act_in_full_all_the_time() -> None:
    """By the joint torques that the estimator finds in motion: they are those of the drawn force, within 4 %."""
    drive = Drive(CONFIGURATION.with_values(base_values(CONFIGURATION, False)), STATED, 905, 14.0, "level")
    recording, shared = record(drive), drive.configuration.shared
    own = drive.configuration.node("contact_estimator", ContactEstimatorParameters)
    estimator, body = ContactEstimator(WAM, shared.timing, own, shared.model), RigidBody(WAM)
    products = squares = 0.0
    for i, state, dt in arriving(recording, 1e-3, 905):
        estimator.observe(state, None, dt)
        for touch in recording.touches:
            if i == round(1e3 * (touch.begin + 0.2)):
                wrench = touch.wrench(i * 1e-3, WAM.covers)
                true = wrench @ body.cover_jacobian(WAM.transmission.joint_motion(state.position), touch.cover)
                products += float(true @ estimator.estimate().external_torques)
                squares += float(true @ true)
    assert squares > 1.0
    assert products / squares == pytest.approx(1.0, abs=0.04)


@pytest.mark.slow
def test_a_coarse_encoder_and_an_unknown_payload_make_no_false_alarms_and_the_payload_is_named() -> None:
    coarse, loaded = (score_of(Drive(CONFIGURATION, name, 901, 10.0)) for name in (COARSE, LOADED))
    believing = score_of(Drive(CONFIGURATION.with_values(BELIEVING), LOADED, 901, 10.0))
    for score in (coarse, loaded):
        assert not score.failure
        assert score.free_seconds > 3.0
        assert score.alarms <= (score is loaded)  # one just above the threshold: the payload swings on the cables
        assert len(score.outcomes) >= 1
    assert believing.alarms
    assert loaded.warnings > 0.5
    assert coarse.warnings == 0.0
    assert list(table("By degradation", driven(coarse, loaded)).head) == ["quantity (observations)", COARSE, LOADED]


@pytest.mark.slow
def test_a_mass_that_is_picked_up_is_in_the_plant_while_it_is_carried_and_its_report_is_counted() -> None:
    """0.9 kg are 9 N at the tool, which nobody overlooks."""
    drive = Drive(CONFIGURATION, STATED, 3402, 14.0, "masses")
    score = score_of(drive)
    assert not score.failure
    (carried,), (outcome,) = score.masses, score.outcomes
    assert carried.mass > 0.8
    assert carried.detected
    assert outcome.kind == "picking up"
    drives = [*driven(score), *driven(score, group="masses")]
    assert column_of(table("Picking up", drives), "reported at all [%]")["all"] == "100 (1)"
    assert "picking up" in table("By kind", drives).head


def test_a_payload_is_known_by_what_the_links_lack_in_probability_and_named_by_reason_or_warning() -> None:
    estimator = ContactEstimator(WAM, CONFIGURATION.shared.timing, OWN, CONFIGURATION.shared.model)
    nothing = estimator.estimate()
    link = Hypothesis("outer_link", 0.3, *[0.0] * 4, (0.0,) * 3, 0.0, False, 0.0, 0.0, (0.0,) * 3, 0.0, NO_REASON)
    assert payload_probability(nothing) == 0.0
    assert not names_payload(nothing)
    assert payload_probability(nothing._replace(hypotheses=(link,))) == pytest.approx(0.7)
    assert payload_probability(nothing._replace(hypotheses=(link._replace(cover="payload"),))) == 1.0
    assert not names_payload(nothing._replace(hypotheses=(link,)))
    assert names_payload(nothing._replace(hypotheses=(link._replace(reasons=Reason.PAYLOAD),)))
    assert names_payload(nothing._replace(warning=warning(Code.MODEL_OFF, "model_off", part="payload")))


def test_measured_torques_are_late_and_some_samples_do_not_arrive() -> None:
    signals = MeasuredSignals(scale=(2.0,), delay=3, dropped=0.5)
    torque, arrives = signals.of(np.arange(1.0, 2001.0)[:, None], np.random.default_rng(1))
    assert torque[:5, 0].tolist() == [0.0, 0.0, 0.0, 2.0, 4.0]
    assert 900 < arrives.sum() < 1100
