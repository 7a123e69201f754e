"""Several moments of one contact: against the whole covariance at once, and what they may and may not gain."""

import dataclasses

import numpy as np
import pytest
from arms import CONFIGURATION, WAM
from contact_truth import torques

from wam_control.contact.contact_estimator import ContactEstimatorParameters
from wam_control.contact.contact_fusion import ContactFusion, Torques
from wam_control.contact.contact_inference import ContactInference, Hypothesis
from wam_control.contact.thresholds import CONTACT
from wam_description.rigid_body import RigidBody

INFERENCE = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).inference
SMOOTH = dataclasses.replace(INFERENCE, friction=1e-3, moment_arm_offset=1e-3, fusion_time=1.0)
START, SPEED = np.array([0.2, -1.05, 0.3, 0.6]), np.array([0.6, 0.5, -0.6, 0.7])  # rad, rad/s
SD, STEP = 0.05, 0.0301  # N m; s
FORCE, PLACE = (0.0, 6.0, 5.0), 0.28


def test_the_present_moment_and_the_past_are_the_whole_covariance_at_once() -> None:
    """By the inverse of the covariance of all rows, whose blocks are written out here."""
    random = np.random.default_rng(3)
    shared = np.diag(random.uniform(0.5, 2.0, 5))
    # a force along the link alone explains the torques; levers are so long that `UNMEASURED` does not count
    rows = 1e4 * random.standard_normal((2, 7, 4))
    rows[:, [0, 6]] = same = 1e4 * random.standard_normal(4)
    moments = []
    for k in range(4):
        time, own, effects = k * 1.1 * CONTACT.instant_interval, random.uniform(0.1, 0.4, 4), random.normal(size=(4, 5))
        moments.append(Torques(time, same, effects, shared, np.diag(own), np.full(4, 0.01 * k)))
    fusion = ContactFusion(1.0)
    for at in moments[:-1]:
        fusion.remember(rows, at, [(0.2, 0.0)], 0.0)
    gram = fusion.gram(rows, moments[-1])
    assert gram is not None
    assert fusion.count == 3  # the last but one is too young
    used = [*moments[:2], moments[-1]]
    effects = np.concatenate([at.effects for at in used])
    covariance = effects @ shared @ effects.T
    for k, at in enumerate(used):
        covariance[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] += at.own
    whole = np.concatenate([rows] * 3, axis=2)
    assert gram == pytest.approx(whole @ np.linalg.inv(covariance) @ whole.transpose(0, 2, 1), rel=1e-9)


def played(
    random: np.random.Generator, stays: float, moves: float = 1.0, slides: float = 0.0, is_along: bool = False
) -> tuple[list[Hypothesis], ContactFusion]:
    """The best explanation at each moment of a push, whose torques err by a part that stays and one that changes."""
    inference = ContactInference(WAM, RigidBody(WAM), INFERENCE if is_along else SMOOTH)
    force, count = (-10.0, 0.0, 0.0) if is_along else FORCE, 7
    own, staying = np.eye(4) * SD**2 * (1.0 - stays), np.eye(4) * SD**2 * stays
    bias = SD * np.sqrt(stays) * random.standard_normal(4)
    found = []
    for k in range(count):
        q = START + moves * k * STEP * SPEED
        error = bias + SD * np.sqrt(1.0 - stays) * random.standard_normal(4)
        place = PLACE - slides * (count - 1 - k) * STEP
        seen = torques(q, "outer_link", (place, 0.0, 0.0), force) + error
        now = Torques(k * STEP, seen, np.eye(4), staying, own, q)
        found.append(inference.infer(q.tolist(), seen.tolist(), np.eye(4) / SD**2, None, now)[0])
    return found, inference.fusion


def errors(stays: float) -> np.ndarray:
    """(pushes, 2, 2): error of the position and its sd, m, by the first moment alone and by the last with all."""
    random = np.random.default_rng(11)
    ends = [played(random, stays)[0] for _ in range(150)]
    return np.array([[(one.position - PLACE, one.position_sd) for one in (found[0], found[-1])] for found in ends])


@pytest.mark.slow
def test_errors_that_change_average_out_and_the_stated_ones_with_them() -> None:
    found = errors(0.0)
    error = np.quantile(np.abs(found[:, :, 0]), 0.68, axis=0)
    assert error[1] < 0.7 * error[0]  # of 6 moments 0.41 if it could not slide
    ratio = np.abs(found[:, 1, 0]) / found[:, 1, 1]
    assert 0.6 < np.quantile(ratio, 0.68) < 1.0
    assert np.mean(ratio < 2.0) > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.2, 0.8])
def test_a_contact_that_slides_along_the_link_is_where_it_has_come_to(speed: float) -> None:
    """And one that stays there is known as well as stated, too."""
    random = np.random.default_rng(13)
    slid, stayed = ([played(random, 0.0, slides=slides)[0][-1] for _ in range(60)] for slides in (speed, 0.0))
    ratio = [
        np.quantile([abs(one.position - PLACE) / one.position_sd for one in ends], 0.68) for ends in (slid, stayed)
    ]
    assert max(ratio) < 1.6  # 2.4 and 4.0 of one that is taken to stay


@pytest.mark.slow
def test_errors_that_stay_are_not_taken_for_new_knowledge() -> None:
    found = errors(0.9)
    stated = np.median(found[:, :, 1], axis=0)
    assert stated[1] > 0.85 * stated[0]
    ratio = np.abs(found[:, 1, 0]) / found[:, 1, 1]
    assert np.quantile(ratio, 0.68) < 1.05


def test_an_arm_that_does_not_move_shows_nothing_new() -> None:
    found, fusion = played(np.random.default_rng(5), 0.5, moves=0.0)
    assert fusion.count == 1
    assert found[-1].position_sd == pytest.approx(found[0].position_sd, rel=0.5)


def test_torques_that_grow_with_their_lever_are_not_taken_for_a_force_that_grows() -> None:
    """A steady force along the tube: of a push of the inner link the lever would stay."""
    random = np.random.default_rng(7)
    ends = [played(random, 0.0, moves=2.0, is_along=True)[0][-1].cover for _ in range(12)]
    assert ends.count("inner_link") < 4  # 11 if the force of each link grew by its torques


@pytest.mark.parametrize(("change", "least", "most"), [(-1.0, 1, 1), (2.0, CONTACT.instants + 1, 9)])
def test_a_force_that_grows_is_followed_at_once_and_one_from_another_side_forgets_the_one_before(
    change: float, least: int, most: int
) -> None:
    inference = ContactInference(WAM, RigidBody(WAM), SMOOTH)
    for k in range(9):
        q = START + k * STEP * SPEED
        force = np.array(FORCE) * (1.0 if k < 8 else change)
        seen = torques(q, "outer_link", (PLACE, 0.0, 0.0), force.tolist())
        now = Torques(k * STEP, seen, np.eye(4), 0.0 * np.eye(4), SD**2 * np.eye(4), q)
        best = inference.infer(q.tolist(), seen.tolist(), np.eye(4) / SD**2, None, now)[0]
    assert least <= inference.fusion.count <= most
    assert best.force == pytest.approx(force, abs=1.0)
    assert best.position == pytest.approx(PLACE, abs=0.01)


@pytest.mark.parametrize("sd", [1e-6, 1e-5, 1e-4, 1e-3])
def test_errors_so_small_that_rounding_counts_end_no_estimate(sd: float) -> None:
    """A mass uncertainty keeps the covariance of one moment large, that of what changes is tiny."""
    random, lasting = np.random.default_rng(2), dataclasses.replace(INFERENCE, fusion_time=1.0)
    for _ in range(8):
        inference = ContactInference(WAM, RigidBody(WAM), lasting)
        force = random.uniform(-40.0, 40.0, 3).tolist()
        for k in range(12):
            q = START + k * STEP * SPEED
            seen = torques(q, "outer_link", (PLACE, 0.0, 0.0), force)
            weight = np.diag(0.3 * random.uniform(0.5, 5.0, 4))
            now = Torques(k * STEP, seen, np.hstack((weight, sd * np.eye(4))), np.eye(8), sd**2 * np.eye(4), q)
            precision = np.linalg.inv(weight @ weight.T + 2.0 * sd**2 * np.eye(4))
            found = inference.infer(q.tolist(), seen.tolist(), precision, None, now)
            assert sum(one.probability for one in found) == pytest.approx(1.0)
