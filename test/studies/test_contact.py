"""The benchmark of contact estimation: it counts true contacts only, knows the truth, and scores as by hand."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from contact_truth import torques as torques_by_hand

from wam_control.contact.contact_estimator import ContactEstimate, ContactEstimatorParameters
from wam_control.contact.contact_inference import Hypothesis
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.reasons import NO_REASON
from wam_description.rigid_body import RigidBody
from wam_description.signals import NO_LOAD, Load
from wam_sim.simulation import Simulation
from wam_studies.contact.outcomes import ContactOutcome, ContactScore, EstimatedMoment
from wam_studies.contact.scenarios import BenchmarkScenario, PlannedContact, ScenarioGenerator
from wam_studies.contact.simulation import Played, play, score, spans, torques_of
from wam_studies.contact.study import ContactCase, ContactStudy
from wam_studies.figures.style import draw_panels
from wam_studies.scores import Interval, events, quantile, rms, share

CONFIGURATION = Configuration.load(packaged("wam"))
ARM = CONFIGURATION.shared.arm
PERIOD = 0.005  # s
ZERO = (0.0, 0.0, 0.0)
NAN = math.nan
NONE = [0.0] * 100  # N, of so many moments
PUSHED = [*NONE, *[5.0] * 60]


def hypothesis(cover: str, probability: float, place: float = NAN, sd: float = NAN, **more: Any) -> Hypothesis:
    given = {"low": 0.2, "high": 0.4, "force": (0.0, 5.0, 0.0), "moment": ZERO, **more}
    other = {"force_sd": 1.0, "is_lower_bound": False, "direction": 0.0, "direction_sd": 0.1, "residual": 0.0}
    return Hypothesis(cover, probability, place, sd, **given, **other, reasons=NO_REASON)


def moment(i: int, hypotheses: tuple[Hypothesis, ...], speed: float, error: float) -> EstimatedMoment:
    estimate = ContactEstimate((error, 0.0, 0.0, 0.0), (0.5,) * 4, 0.0, hypotheses)
    return EstimatedMoment((i + 1) * PERIOD, estimate, speed > 0.1)


def story(
    force: list[float], hypotheses: dict[int, tuple[Hypothesis, ...]], speed: float = 1.0, error: float = 0.0
) -> Played:
    planned = (PlannedContact("push", "outer_link", 0.3, 0.0, 5.0, 0.5, 1.0, 0.0),)
    moments = [moment(i, hypotheses.get(i, ()), speed, error) for i in range(len(force))]
    loads = [Load("outer_link", 0.3, (0.0, f, 0.0), (0.0, 0.0, 0.3 * f)) if f else NO_LOAD for f in force]
    return Played(
        BenchmarkScenario("by hand", "moving", {}, (), planned), moments, loads, [(0.0,) * 4] * len(force), ""
    )


def outcome(force: list[float], hypotheses: dict[int, tuple[Hypothesis, ...]]) -> ContactOutcome:
    (found,) = score(story(force, hypotheses), ARM).outcomes
    return found


def test_a_contact_is_evaluated_as_by_hand() -> None:
    outer, inner = hypothesis("outer_link", 0.8, 0.33, 0.02), hypothesis("inner_link", 0.2)
    found = outcome([*PUSHED, *[0.0] * 40], dict.fromkeys(range(104, 170), (outer, inner)))
    assert (found.cover, found.position, found.force, found.kind) == ("outer_link", 0.3, 5.0, "push")
    assert found.latency == pytest.approx(0.025)  # from moment 99, the last without force, to 104
    assert (found.detected, found.right_link, found.probability) == (True, True, 0.8)
    assert (found.error, found.position_sd) == (pytest.approx(0.03), 0.02)
    assert found.in_set


def test_a_wrong_link_and_a_missed_contact_have_an_infinite_error() -> None:
    wrong = outcome(PUSHED, dict.fromkeys(range(100, 160), (hypothesis("inner_link", 0.99),)))
    assert (wrong.detected, wrong.right_link, wrong.error, wrong.in_set) == (True, False, math.inf, False)
    assert wrong.sure_and_wrong == pytest.approx(0.3)
    missing = outcome(PUSHED, {})
    assert (missing.latency, missing.error, missing.in_set) == (math.inf, math.inf, False)


def test_a_detection_from_before_the_contact_has_no_latency_and_is_a_false_alarm() -> None:
    before = dict.fromkeys(range(90, 160), (hypothesis("outer_link", 1.0, 0.3, 0.01),))
    assert math.isnan(outcome(PUSHED, before).latency)
    assert score(story(PUSHED, before), ARM).alarms == 1


@pytest.mark.parametrize("force", [[*NONE, *[5.0] * 10, *NONE], [*NONE, *[60.0] * 60]], ids=["short", "hard"])
def test_short_and_hard_contacts_are_counted_and_excluded(force: list[float]) -> None:
    found = score(story(force, {}), ARM)
    assert (found.outcomes, found.excluded, found.not_made) == ([], 1, 0)


@pytest.mark.parametrize(("gap", "count"), [(1, 1), (3, 2)])
def test_a_gap_of_one_period_does_not_split_a_contact_and_a_longer_one_does(gap: int, count: int) -> None:
    assert len(spans(story([5.0] * 40 + [0.0] * gap + [5.0] * 40, {}).loads)) == count


@pytest.mark.parametrize(("low", "high", "holds"), [(0.2, 0.31, True), (0.31, 0.4, False), (NAN, NAN, False)])
def test_the_set_of_the_estimator_counts(low: float, high: float, holds: bool) -> None:
    given = (hypothesis("outer_link", 1.0, 0.3, 0.01, low=low, high=high),)
    assert outcome(PUSHED, dict.fromkeys(range(100, 160), given)).in_set is holds


def test_an_alarm_that_ends_late_is_not_a_false_one_and_a_new_one_is() -> None:
    on = (hypothesis("outer_link", 1.0, 0.3, 0.01),)
    force = [*NONE[:50], *[5.0] * 50, *NONE]
    late = score(story(force, dict.fromkeys(range(52, 130), on)), ARM)
    assert (late.free_seconds, late.alarms) == (pytest.approx(0.65), 0)  # 50 + 80 moments
    anew = dict.fromkeys([*range(52, 110), *range(150, 153), *range(160, 170)], on)
    assert score(story(force, anew), ARM).alarms == 2


def test_torque_errors_count_in_motion_and_at_rest_apart_and_not_near_the_start_and_end_of_a_contact() -> None:
    found = score(story(NONE * 2, {}, error=2.0), ARM).torques
    assert found.moving_count == 160 - 1  # 0.2 s of the beginning are the observer's
    assert found.moving == (4.0 * found.moving_count, 0.0, 0.0, 0.0)
    assert found.moving_z[0] == pytest.approx(16.0 * found.moving_count)
    assert found.still_count == 0
    assert score(story(NONE * 2, {}, speed=0.03), ARM).torques.still_count == 159
    with_contact = score(story([*NONE, *[5.0] * 50, *[0.0] * 50], {}, error=2.0), ARM).torques
    assert 159 - 2 * 25 <= with_contact.moving_count <= 159 - 2 * 22


def test_a_dithered_arm_is_compared_with_the_truth_over_a_whole_cycle() -> None:
    """A hand that rubs back and forth with the dither, and an estimate that is its mean."""
    swing = [(1.0 + 3.0 * math.sin(2.0 * math.pi * i / 8.0), 0.0, 0.0, 0.0) for i in range(200)]
    played = story([5.0] * 200, {}, speed=0.0, error=1.0)._replace(torques=swing)
    errors = {}
    for group in ("moving", "dither"):
        found = score(played._replace(scenario=played.scenario._replace(group=group)), ARM)
        errors[group] = math.sqrt(found.torques.still[0] / found.torques.still_count)
    assert errors["moving"] == pytest.approx(3.0 / math.sqrt(2.0), rel=0.02)
    assert errors["dither"] < 1e-9


def test_intervals_are_those_of_the_textbooks() -> None:
    found = share(8, 10)  # Wilson 1927, as in Brown, Cai & DasGupta 2001
    assert (found.value, found.low, found.high) == (0.8, pytest.approx(0.490, abs=2e-3), pytest.approx(0.943, abs=2e-3))
    assert events(0, 120.0).high == pytest.approx(3.69, abs=0.03)  # exact Poisson, 97.5 %
    assert events(5, 1.0).low == pytest.approx(1.62, abs=0.03)
    middle = quantile([float(i) for i in range(1, 102)], 0.5)
    assert (middle.value, middle.low, middle.high) == (51.0, 41.0, 61.0)
    assert quantile([1.0, 2.0, 3.0, 4.0], 0.5).value == 2.5
    assert quantile([1.0, math.inf, math.inf], 0.5).value == math.inf
    few = quantile([1.0, 2.0, 3.0], 0.5)
    assert few.value == 2.0
    assert math.isnan(few.low)
    assert math.isnan(few.high), "the interval reaches beyond what was seen"
    assert rms([4.0, 12.0], [1, 3]).value == 2.0
    assert math.isnan(share(0, 0).value)


def test_the_interval_of_an_rms_is_that_of_its_scenes_not_of_its_samples() -> None:
    random = np.random.default_rng(1)
    biases = random.normal(0.0, 1.0, 40)
    few = rms((1000 * biases**2).tolist(), [1000] * 40)
    assert few.high - few.low > 0.2


def synthetic(error: float, latency: float, right: float) -> list[ContactScore]:
    """A hundred scenarios with a contact of 5 N, and free motion; a share names the right link, 90 % of the sets."""
    result = []
    torques = score(story(NONE, {}, error=0.2), ARM).torques
    for i in range(100):
        good = i < 100 * right
        found = ContactOutcome(
            "push", "outer_link", 0.2, 5.0, 0.0, True, latency, True, 0.99, good, "",
            error if good else math.inf, 0.015 if good else NAN, i % 10 != 0,
        )  # fmt: skip
        result.append(ContactScore(f"scenario {i}", "moving", [found], 0.0, 0, torques))
        result.append(ContactScore(f"free {i}", "free", [], 2.0, 0, torques))
    return result


STUDY = ContactStudy(CONFIGURATION)


def found(name: str, scores: list[ContactScore]) -> Interval:
    (row,) = [row for row in STUDY.score(scores).rows if row.name == name]
    return row.found


def test_rows_of_synthetic_contacts_are_those_that_went_in() -> None:
    scores = synthetic(error=0.025, latency=0.04, right=0.93)
    assert found("external torque in motion, rms, joint1", scores).value == pytest.approx(0.2)
    assert found("false alarms in free motion with pauses", scores)[::3] == (0.0, 200)
    assert found("5 N on the outer link detected within 60 ms", scores).value == 1.0
    assert found("5 N on the outer link detected within 30 ms", scores).value == 0.0
    assert found("position on the outer link at 5 N, median error", scores).value == pytest.approx(0.025)
    assert found("contacts with a reported sd below 2 cm", scores).value == pytest.approx(0.93)
    assert found("wrong link", scores).value == pytest.approx(0.07)
    assert found("position on the outer link at 10 N, median error", scores).observed == 0


def test_a_missed_must_is_named_and_a_met_one_is_not() -> None:
    bad = "; ".join(STUDY.score(synthetic(0.04, 0.07, 0.93)).missed)
    assert "position on the outer link at 5 N, median error: 4 cm, required ≤3" in bad
    assert "5 N on the outer link detected within 60 ms" in bad
    assert "wrong link: 7 %, required ≤5" in bad
    assert STUDY.score(synthetic(0.004, 0.02, 1.0)).missed == []
    half = found("position on the outer link at 5 N, median error", synthetic(0.01, 0.02, 0.4))
    assert half.value == math.inf, "half the contacts without a place"


@pytest.mark.parametrize("cover", ["inner_link", "outer_link"])
def test_torques_of_a_load_are_those_of_virtual_work(cover: str) -> None:
    random = np.random.default_rng(3)
    for _ in range(5):
        q, point, force = random.uniform(-1.0, 1.0, 4), random.uniform(-0.1, 0.4, 3), random.uniform(-9.0, 9.0, 3)
        load = Load(cover, point[0], tuple(force), tuple(np.cross(point, force)))
        by_hand = torques_by_hand(q, cover, point, force)
        assert np.abs(np.subtract(torques_of(RigidBody(ARM), q, load), by_hand)).max() < 1e-6
    assert torques_of(RigidBody(ARM), [0.0] * 4, NO_LOAD) == (0.0,) * 4


def pick(kind: str, seed: int = 1) -> BenchmarkScenario:
    """A scenario in motion whose first contact is of a kind."""
    drawn = ScenarioGenerator(CONFIGURATION, seed).contacts(120)
    return next(scenario for scenario in drawn if scenario.planned[0].kind == kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["push", "flat"])
def test_contacts_of_every_kind_truly_happen_where_they_are_planned(kind: str) -> None:
    scenario = pick(kind)
    meant = scenario.planned[0]
    played = play(CONFIGURATION, scenario)
    first = spans(played.loads)[0]
    assert first.cover == meant.cover
    middle = played.loads[first.first + 20]
    length = ARM.covers.length_of(meant.cover)
    assert middle.position == pytest.approx(meant.position, abs=0.03 if kind == "flat" else 0.015)
    assert -0.03 < middle.position < length + 0.03
    across = math.hypot(middle.force[1], middle.force[2])
    assert across == pytest.approx(meant.force, rel=0.2 + meant.friction)
    assert all(load.cover for load in played.loads[first.first : first.last + 1])  # kept contact
    assert (first.last - first.first) * PERIOD > 0.2


@pytest.mark.slow
def test_a_hand_that_misses_is_not_counted() -> None:
    scenario = pick("sphere")
    values = dict(scenario.values)
    late = [100.0 for _ in values["driver:world.pushers.begin"]]
    values |= {"driver:world.pushers.begin": late, "driver:world.pushers.end": [200.0] * len(late)}
    steps = tuple(step._replace(push=None) for step in scenario.steps)
    missing = scenario._replace(values=values, steps=steps)
    found_there = score(play(CONFIGURATION, missing), ARM)
    assert found_there.outcomes == []
    assert found_there.excluded == 0
    assert found_there.not_made == len(scenario.planned)


def study(**options: Any) -> ContactStudy:
    return ContactStudy(CONFIGURATION, **options)


def test_scenes_are_the_same_for_the_same_seed_and_others_for_another() -> None:
    small = study(contacts=6, resting=2, free=12.0)
    first, again, other = (small.scenarios(seed) for seed in (5, 5, 6))
    assert first == again
    assert all(a.values != b.values for a, b in zip(first, other, strict=True))
    assert study(contacts=8, resting=2, free=12.0).scenarios(5)[:3] == first[:3], "a larger one starts alike"


@pytest.mark.slow
def test_the_scores_have_a_picture(tmp_path: Path) -> None:
    scores = synthetic(error=0.025, latency=0.04, right=0.93)
    draw_panels(STUDY.panels(scores), tmp_path / "benchmark.png", 2)
    assert (tmp_path / "benchmark.png").stat().st_size > 20_000


def test_the_arm_of_every_scene_departs_from_the_configured_one_within_the_declared_range() -> None:
    drawn = ScenarioGenerator(CONFIGURATION, 2).contacts(40) + ScenarioGenerator(CONFIGURATION, 2).free(24.0)
    friction = [factor for scenario in drawn for factor in scenario.values["driver:mismatch.motor_friction"]]
    assert 0.9 <= min(friction) < 0.93
    assert 1.07 < max(friction) <= 1.1
    assert all(scenario.values["contact_estimator:observer.friction_scale"] == 1.0 for scenario in drawn)
    assert 0.0 < max(scenario.values.get("driver:mismatch.payload", 0.0) for scenario in drawn) <= 0.05
    for scenario in drawn:  # what is carried is declared, and only that
        assert ("driver:mismatch.payload" in scenario.values) is (
            "contact_estimator:observer.payload" in scenario.values
        )
    assert CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer.payload == (0.0, 0.0)
    assert not any(scenario.values["contact_estimator:use_joint_sensors"] for scenario in drawn)


def test_an_arm_that_is_drawn_too_stiff_for_the_configured_step_is_played_with_a_shorter_one() -> None:
    barrett = Configuration.load(packaged("barrett-wam7"))
    steps = tuple(ScenarioGenerator(barrett, 1).free(1)[0].steps[:1])
    stiff = BenchmarkScenario("stiff", "free", {"driver:mismatch.stiffness": [1.15] * 7}, steps, ())
    with pytest.raises(ParameterError, match=r"multiply timing\.substeps by 2"):
        Simulation(barrett.with_values(stiff.values), steps)
    played = play(barrett, stiff)
    assert not played.failure
    assert played.moments[-1].time == pytest.approx(sum(step.seconds for step in steps), abs=PERIOD)
    assert str(ContactCase(barrett, stiff)) == "stiff"
