"""Contact inference against torques from the table of (A.4) and against geometry done by hand."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, WAM
from contact_truth import L3, L4, torques

from wam_control.contact.contact_estimator import ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference, Hypothesis, detection_statistic
from wam_description.arm import Arm
from wam_description.reasons import Reason
from wam_description.rigid_body import RigidBody
from wam_description.units import STANDARD_GRAVITY

PARAMETERS = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).inference
INFERENCE = ContactInference(WAM, RigidBody(WAM), PARAMETERS)
UNIFORM = dataclasses.replace(PARAMETERS, end_weight=0.0, along_weight=0.0)  # contacts across the tubes, everywhere
EXACT = ContactInference(
    WAM, RigidBody(WAM), dataclasses.replace(UNIFORM, force_scale=1e4, moment_arm_offset=0.0, friction=0.0)
)
POSE = (0.0, -1.05, 0.0, 0.5)
SD = 0.02
S = SD**2 * np.eye(4)
W = np.linalg.inv(S)
COARSE = 0.1**2 * np.eye(4)  # as in motion; finer torques tell the links by where their tubes are
NOISELESS = 1e6 * W
DETECT = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).detect


def infer(
    q: tuple[float, ...], cover: str, point: tuple[float, ...], force: tuple[float, ...]
) -> tuple[Hypothesis, ...]:
    return INFERENCE.infer(q, torques(q, cover, point, force).tolist(), W)


def of(hypotheses: tuple[Hypothesis, ...], cover: str) -> Hypothesis:
    return next(hypothesis for hypothesis in hypotheses if hypothesis.cover == cover)


def test_in_plane_force_agrees_with_the_closed_form() -> None:
    """F1 = (m_n2 - tau4)/(L3 s4), x = tau4/F1; with theta3 = 0 axis 2 is parallel to axis 4."""
    x, force = 0.28, 6.0
    tau2, tau4 = (L3 * math.sin(0.5) + x) * force, x * force
    found = EXACT.infer(POSE, [0.0, tau2, 0.0, tau4], NOISELESS)[0]
    by_hand = (tau2 - tau4) / (L3 * math.sin(0.5))
    assert found.cover == "outer_link"
    assert found.force == pytest.approx((0.0, by_hand, 0.0), abs=1e-4)
    assert found.position == pytest.approx(tau4 / by_hand, abs=1e-4)
    assert found.position == pytest.approx(x, abs=1e-4)


def test_out_of_plane_force_agrees_with_the_closed_form() -> None:
    """F2 = m_u/(L3 c4), x = -m_n1/F2 - L3 s4, from a force that turns about axes 1 and 3 alone."""
    x, force, s4, c4 = 0.28, 6.0, math.sin(0.5), math.cos(0.5)
    # moment at the shoulder in frame 4: elbow at L3 (s4, c4) up to sign, force along z4
    m_u, m_n1 = L3 * c4 * force, -(L3 * s4 + x) * force
    u_on_inner, n_on_inner = s4, c4  # x4 and y4 seen along the inner link, axis 3
    tau3 = m_u * u_on_inner + m_n1 * n_on_inner
    across = m_u * c4 - m_n1 * s4  # the rest of the moment, across the inner link
    tau1 = tau3 * math.cos(POSE[1]) + across * math.sin(POSE[1])
    found = EXACT.infer(POSE, [tau1, 0.0, tau3, 0.0], NOISELESS)[0]
    assert found.cover == "outer_link"
    assert found.force == pytest.approx((0.0, 0.0, m_u / (L3 * c4)), abs=1e-4)
    assert found.position == pytest.approx(-m_n1 / found.force[2] - L3 * s4, abs=1e-4)


def test_any_direction_and_pose_on_the_outer_link() -> None:
    rng = np.random.default_rng(7)
    errors, forces, wrong = [], [], 0
    for _ in range(200):
        q = rng.uniform((-3.0, 0.3, -2.5, -1.2), (3.0, 2.2, 2.5, 2.4)) * (1, rng.choice((-1, 1)), 1, 1)
        x, phi, size = rng.uniform(0.05, L4), rng.uniform(-math.pi, math.pi), rng.uniform(3, 20)
        force = (0.0, size * math.cos(phi), size * math.sin(phi))
        found = EXACT.infer(q, torques(q, "outer_link", (x, 0, 0), force).tolist(), W)
        wrong += found[0].cover != "outer_link"
        outer = of(found, "outer_link")
        if not math.isnan(outer.position):
            errors.append((abs(outer.position - x), outer.position_sd))
            forces.append(np.linalg.norm(np.subtract(outer.force, force)) / size)
            assert outer.direction == pytest.approx(phi, abs=0.1)
    assert len(errors) > 195
    assert wrong <= 2
    assert max(error for error, _ in errors) < 0.1
    assert max(error / sd for error, sd in errors) < 2.0
    assert np.quantile([error for error, _ in errors], 0.9) < 0.02
    assert np.quantile(forces, 0.95) < 0.01


def test_reported_spread_is_the_spread_of_the_errors() -> None:
    rng = np.random.default_rng(8)
    scores = []
    for _ in range(400):
        q = tuple(rng.uniform(WAM.joints.lower, WAM.joints.upper))
        x, phi, size = rng.uniform(0.1, 0.3), rng.uniform(-math.pi, math.pi), rng.uniform(5, 20)
        tau = torques(q, "outer_link", (x, 0, 0), (0.0, size * math.cos(phi), size * math.sin(phi)))
        outer = of(EXACT.infer(q, (tau + SD * rng.standard_normal(4)).tolist(), W), "outer_link")
        if not math.isnan(outer.position):
            scores.append(abs(outer.position - x) / outer.position_sd)
    assert 0.5 < np.median(scores) < 0.85
    assert np.quantile(scores, 0.9) < 2.0


@pytest.mark.parametrize("x", [0.15, 0.3, 0.5])
@pytest.mark.parametrize("phi", [0.0, 90.0, 180.0, -90.0])
def test_inner_link_shows_moment_and_bound_but_no_place(x: float, phi: float) -> None:
    force = (0.0, 8 * math.cos(math.radians(phi)), 8 * math.sin(math.radians(phi)))
    found = of(infer(POSE, "inner_link", (x, 0, 0), force), "inner_link")
    assert math.isnan(found.position)
    assert math.isnan(found.position_sd)
    assert Reason.MOMENT_ONLY in found.reasons
    assert found.is_lower_bound
    bound = x * 8 / L3
    assert np.linalg.norm(found.force) == pytest.approx(bound, rel=0.03)
    # the tube stands 4 degrees askew, so that its twist is not the push's
    np.testing.assert_allclose(found.moment[1:], (-x * force[2], x * force[1]), atol=0.05 * x * 8)
    turned = found.direction - math.radians(phi)
    assert math.cos(turned) > 0.99


def test_a_push_on_the_inner_link_is_told_from_one_on_the_outer() -> None:
    """Along the tube, which is 1.6 in off at the elbow, and off its axis by what friction of a third does."""
    for off in (-0.3, 0.0, 0.3):
        aside = 0.04064 * 0.4 / L3 + off * WAM.covers.radius[0]
        for force in ((0.0, 8.0, 0.0), (0.0, -5.0, 6.0)):
            found = infer(POSE, "inner_link", (0.4, 0.0, aside), force)
            assert found[0].cover == "inner_link"
        in_plane = infer(POSE, "inner_link", (0.4, 0.0, aside), (0.0, 0.0, 8.0))  # as one along the outer link
        assert of(in_plane, "inner_link").probability > 0.2
        assert in_plane[0].probability < 0.95


POSE_BENT = (0.25, -1.3, 0.0, 1.0)
AMBIGUOUS = [
    ((0.3, -1.0, 0.2, 0.0), "outer_link", (0.28, 0, 0), (0, 6, 0), Reason.POSE),
    ((0.3, -1.0, 0.2, math.pi / 2), "outer_link", (0.28, 0, 0), (0, 0, 6), Reason.POSE),
    ((0.3, 0.0, math.pi / 2, 0.5), "outer_link", (0.28, 0, 0), (0, 6, 0), Reason.POSE),
    ((0.3, -1.0, 0.2, math.pi / 2), "outer_link", (0.28, 0, 0), (0, 0, 3), Reason.LINKS),
    (POSE, "outer_link", (0.0, 0, 0), (0, 0, 6), Reason.LINKS),
    (POSE_BENT, "inner_link", (0.5, 0, 0.5 * 0.04064 / L3), (0, 0, 6), Reason.LINKS),
    (POSE, "inner_link", (0.3, 0, 0), (0, 6, 0), Reason.MOMENT_ONLY),
]


@pytest.mark.parametrize(("q", "cover", "point", "force", "reason"), AMBIGUOUS)
def test_each_ambiguous_pose_is_named(
    q: tuple[float, ...], cover: str, point: tuple[float, ...], force: tuple[float, ...], reason: Reason
) -> None:
    found = INFERENCE.infer(q, torques(q, cover, point, force).tolist(), np.linalg.inv(COARSE))
    assert reason in found[0].reasons


def test_unknown_places_always_have_a_reason_and_the_least_force() -> None:
    rng = np.random.default_rng(9)
    seen = 0
    for _ in range(300):
        q = tuple(rng.uniform(WAM.joints.lower, WAM.joints.upper))
        tau = rng.normal(0.0, 2.0, 4)
        for found in INFERENCE.infer(q, tau.tolist(), W):
            if math.isnan(found.position):
                seen += 1
                assert found.reasons
                assert found.is_lower_bound
            else:
                assert 0.0 <= found.position <= L4
                assert 0.0 < found.position_sd < L4 / 2
    assert seen >= 300


def test_a_place_lost_in_noise_leaves_the_force_that_the_longest_lever_needs() -> None:
    tau = torques(POSE, "outer_link", (0.2, 0, 0), (0, 2, 0))
    outer = of(INFERENCE.infer(POSE, tau.tolist(), np.eye(4) / 1.0**2), "outer_link")
    assert Reason.WEAK in outer.reasons
    levers = torques(POSE, "outer_link", (L4, 0, 0), (0, 1, 0))
    assert outer.force[1] == pytest.approx(levers @ tau / (levers @ levers), rel=0.03)


def evidence(q: tuple[float, ...], tau: np.ndarray, cover: str) -> float:
    """Log probability of torques by brute force: every place alike, normal force, twist that goes with it."""
    length, slope = (L3, 0.04064 / L3) if cover == "inner_link" else (L4, 0.0)
    radius = WAM.covers.radius[WAM.covers.names.index(cover)]
    twist_arm = PARAMETERS.moment_arm_offset * WAM.covers.radius[WAM.covers.names.index(cover)]
    across = (0.0, 1.0, 0.0), (-slope, 0.0, 1.0)

    def levers(x: float) -> np.ndarray:
        return np.stack([torques(q, cover, (x, 0.0, slope * x), e) for e in across], axis=1)

    first, last = levers(0.0), levers(1.0)
    off = torques(q, cover, (0, 1, 0), (0, 0, 1)) - torques(q, cover, (0, 0, 0), (0, 0, 1))
    along = torques(q, cover, (0.0, 0.0, 0.0), (1.0, 0.0, slope))
    logs = []
    for x in np.linspace(0.0, length, 2001):
        at = first + x * (last - first)
        prior = np.linalg.inv(PARAMETERS.force_scale**2 * at @ at.T + COARSE)
        force = PARAMETERS.force_scale**2 * at.T @ prior @ tau
        twist = twist_arm**2 * (force @ force) * np.outer(off, off)
        lean = PARAMETERS.friction * (np.linalg.norm(force) * along + radius * (last - first) @ force)
        spread = COARSE + PARAMETERS.force_scale**2 * at @ at.T + twist + np.outer(lean, lean)
        logs.append(-0.5 * (tau @ np.linalg.solve(spread, tau) + np.linalg.slogdet(spread)[1]))
    return float(np.logaddexp.reduce(logs) - math.log(len(logs)))


@pytest.mark.slow
@pytest.mark.parametrize(("cover", "x", "force"), [
    ("outer_link", 0.0, (0, 6, 0)),
    ("outer_link", 0.02, (0, 0, 6)),
    ("outer_link", 0.02, (0, 4, 4)),
    ("inner_link", 0.3, (0, 0, 6)),
    ("inner_link", 0.5, (0, 4.2, 4.2)),
])  # fmt: skip
def test_odds_of_the_links_are_those_of_brute_force(cover: str, x: float, force: tuple[float, float, float]) -> None:
    tau = torques(POSE, cover, (x, 0, 0.04064 / L3 * x if cover == "inner_link" else 0), force)
    found = ContactInference(WAM, RigidBody(WAM), UNIFORM).infer(POSE, tau.tolist(), np.linalg.inv(COARSE))
    odds = math.log(of(found, "inner_link").probability / of(found, "outer_link").probability)
    inner, outer = (
        evidence(POSE, tau, name) + math.log(w) for name, w in zip(WAM.covers.names, PARAMETERS.weights, strict=True)
    )
    assert odds == pytest.approx(inner - outer, abs=1.2)  # friction has one size on the whole link


def test_two_contacts_are_not_explained_by_one() -> None:
    tau = torques(POSE, "outer_link", (0.35, 0, 0), (0, 0, 8)) + torques(POSE, "inner_link", (0.5, 0, 0), (0, 15, 4))
    assert Reason.MORE in INFERENCE.infer(POSE, tau.tolist(), W)[0].reasons
    assert Reason.MORE not in infer(POSE, "outer_link", (0.35, 0, 0), (0, 0, 8))[0].reasons


def with_joints(arm: Arm, kept: slice, **others: Any) -> Arm:
    """The arm with some of its joints, and what belongs to them; `others` are fields that have to fit these."""

    def part(values: Any) -> Any:
        each = len(values) // 4
        return tuple(np.reshape(values, (4, each))[kept].ravel().tolist()) if each else values

    parts = {name: getattr(arm, name) for name in ("motors", "cables", "joints", "links")}
    matrix = np.reshape(arm.joint_from_motor, (4, 4))[kept, kept]
    groups = {
        name: type(group)(**{k: part(v) for k, v in dataclasses.asdict(group).items()}) for name, group in parts.items()
    }
    return dataclasses.replace(arm, **others, **groups, joint_from_motor=tuple(matrix.ravel().tolist()))


def one_joint(arm: Arm) -> Arm:
    """A testbed: the first motor and joint, lying down, with the outer cover on its link."""
    covers = {k: v[len(v) // 2 :] for k, v in dataclasses.asdict(arm.covers).items()}
    outer = type(arm.covers)(**{**covers, "links": ("link1",)})
    return with_joints(arm, slice(1), covers=outer)


def test_a_single_joint_reports_what_it_measures() -> None:
    arm = one_joint(WAM)
    inference = ContactInference(arm, RigidBody(arm), dataclasses.replace(PARAMETERS, weights=(1.0,)))
    (found,) = inference.infer([0.4], [1.2], np.array([[SD**-2]]))
    assert found.cover == "outer_link"
    assert found.probability == 1.0
    assert math.isnan(found.position)
    assert Reason.MOMENT_ONLY in found.reasons
    assert found.moment == pytest.approx((0.0, 0.0, 1.2), rel=0.01)
    assert found.force == pytest.approx((0.0, 1.2 / L4, 0.0), rel=0.01)


@pytest.mark.parametrize(("q", "cover", "point", "force", "reason"), AMBIGUOUS)
def test_reasons_follow_from_the_arms_structure_and_not_from_a_number_of_joints(
    q: tuple[float, ...], cover: str, point: tuple[float, ...], force: tuple[float, ...], reason: Reason
) -> None:
    arm = with_joints(WAM, slice(1, None))
    inference = ContactInference(arm, RigidBody(arm), PARAMETERS)
    found = inference.infer(q[1:], torques(q, cover, point, force)[1:].tolist(), W[1:, 1:])
    assert reason in of(found, cover).reasons
    assert Reason.MOMENT_ONLY in of(found, "inner_link").reasons


@pytest.mark.slow
def test_the_links_count_before_anything_is_felt_by_the_area_that_they_sweep() -> None:
    """Any pose within the limits, each joint at any speed up to its own; by geometry done by hand, not by the arm's."""
    rng, swept = np.random.default_rng(3), np.zeros(2)
    lower, upper = np.array(WAM.joints.lower), np.array(WAM.joints.upper)
    for _ in range(1500):
        q, qd = rng.uniform(lower, upper), rng.uniform(-1.0, 1.0, 4) * WAM.joints.speed_limit
        for i, (cover, length) in enumerate((("inner_link", L3), ("outer_link", L4))):
            across = [[torques(tuple(q), cover, (x, 0, 0), e) @ qd for x in (0.0, 1.0)] for e in ((0, 1, 0), (0, 0, 1))]
            x = (np.arange(8) + 0.5) / 8 * length  # the speed across the link grows linearly along it
            speeds = [start + x * (end - start) for start, end in across]
            swept[i] += length * np.hypot(*speeds).mean()
    assert PARAMETERS.weights[1] / PARAMETERS.weights[0] == pytest.approx(swept[1] / swept[0], rel=0.03)


TIPS = [(0.3, -1.0, 0.2, 0.9), (-0.4, -1.4, 0.6, 1.3), (0.0, -0.8, -0.5, 0.6)]


@pytest.mark.parametrize("q", TIPS)
@pytest.mark.parametrize("size", [3.0, 10.0, 30.0])
def test_a_push_on_the_tip_along_the_tube_is_one_at_the_elbow(q: tuple[float, ...], size: float) -> None:
    tip, elbow = (torques(q, "outer_link", (x, 0, 0), (-size, 0, 0)) for x in (L4, 0.0))
    np.testing.assert_allclose(tip, elbow, atol=1e-6)
    found = infer(q, "outer_link", (L4, 0, 0), (-size, 0, 0))
    assert found[0].probability < 0.95
    along = of(found, "outer_link")
    assert Reason.ALONG in along.reasons
    assert along.is_lower_bound is (q != TIPS[1]), "there a force from the side explains them, too"
    if along.is_lower_bound:
        assert (np.linalg.norm(along.force) < 1.05 * size, any(along.moment)) == (True, False)
        assert torques(q, "outer_link", (0, 0, 0), along.force) == pytest.approx(tip, abs=0.01 * size)
    blind = ContactInference(WAM, RigidBody(WAM), UNIFORM).infer(q, tip.tolist(), W)[0]
    assert blind.cover == "inner_link"
    assert blind.probability > max(0.9, found[0].probability)


def test_a_push_across_the_tube_is_not_taken_for_one_along_it() -> None:
    bent, tared = (0.0, -2.07, 0.0, 1.45), np.diag(np.array([0.02, 0.056, 0.027, 0.03]) ** -2.0)  # 83 N along
    for x in (0.1, 0.2, 0.3):
        for q, precision, force in ((POSE, W, (0, 4, 3)), (bent, tared, (0, 8, 0))):
            found = INFERENCE.infer(q, torques(q, "outer_link", (x, 0, 0), force).tolist(), precision)[0]
            assert found.cover == "outer_link"
            assert found.probability > 0.95
            assert not found.reasons
            assert found.position == pytest.approx(x, abs=0.02)


def test_torques_that_are_said_to_be_exact_are_no_more_certain_than_rounding() -> None:
    rng, exact = np.random.default_rng(5), 1e12 * np.eye(4)
    wrong = 0
    for k in range(400):
        q = tuple(rng.uniform(WAM.joints.lower, WAM.joints.upper))
        cover, length = (("outer_link", L4), ("inner_link", L3))[k % 2]
        angle = rng.uniform(-3.0, 3.0)
        force = 10.0 ** rng.uniform(0.0, 1.7) * np.array([0.0, math.cos(angle), math.sin(angle)])
        tau = torques(q, cover, (rng.uniform(0.02, length - 0.02), 0, 0), tuple(force))
        best = INFERENCE.infer(q, tau.tolist(), exact)[0]
        wrong += best.probability > 0.95 and best.cover != cover
    assert wrong == 0  # 36 where rounding decides


def test_certain_torques_of_a_pose_that_is_nearly_singular_are_explained() -> None:
    q, force = (0.0, -1.22, -0.631, 0.424), (0, 8.4, 5.4)
    tau = torques(q, "outer_link", (0.376, 0, 0), force).tolist()
    best = INFERENCE.infer(q, tau, np.diag([1e12, 50.0, 1e12, 1e12]))[0]
    assert best.cover == "outer_link"
    assert best.position == pytest.approx(0.376, abs=0.01)


def test_a_place_is_not_between_those_of_a_push_from_the_side_and_of_one_on_the_end() -> None:
    """As on foam: the mass of the links makes joint 2 uncertain, and 0.15 of the probability is on the end."""
    q, x = (0.0, -2.1, 0.0, 1.45), 0.26
    tau = torques(q, "outer_link", (x, 0, 0), (0, 5, 0))
    inference = ContactInference(WAM, RigidBody(WAM), dataclasses.replace(PARAMETERS, friction=0.33, along_weight=0.04))
    found = inference.infer(q, tau.tolist(), np.diag(np.array([0.02, 0.14, 0.02, 0.025]) ** -2.0))[0]
    assert found.cover == "outer_link"
    assert found.high == pytest.approx(L4, abs=1e-6)
    assert found.position == pytest.approx(x, abs=0.01)
    assert found.position_sd > 0.02, "the end counts in the spread"


def test_a_payload_that_is_picked_up_is_no_certain_contact() -> None:
    """Its weight acts as a force at the tool, downwards: what the links lack to 1 is its probability."""
    loaded = dataclasses.replace(WAM, payload=WAM.payload + 1.0)
    load = np.subtract(RigidBody(WAM).gravity_torque(POSE), RigidBody(loaded).gravity_torque(POSE))
    for mass, picked in ((0.5, True), (1.5, True), (-1.0, False)):
        found = INFERENCE.infer(POSE, (mass * load).tolist(), W, load)
        assert (sum(each.probability for each in found) < 0.5) == picked
        assert (Reason.PAYLOAD in found[0].reasons) == picked
        alone = INFERENCE.infer(POSE, (mass * load).tolist(), W)
        assert sum(each.probability for each in alone) == pytest.approx(1.0)
        for with_it, without in zip(found, alone, strict=True):  # of a contact everything else is as it was
            assert with_it.cover == without.cover
            np.testing.assert_array_equal((with_it.position, with_it.low), (without.position, without.low))
    push = torques(POSE, "outer_link", (0.2, 0.0, 0.0), (0.0, 6.0, 4.0))
    found = INFERENCE.infer(POSE, push.tolist(), W, load)
    assert sum(each.probability for each in found) > 0.999
    assert Reason.PAYLOAD not in found[0].reasons


def payload_rows() -> list[str]:
    """Rows of the table of docs/estimator.md: 200 poses, torques with errors of 0.1 N m at each joint, as in motion."""
    rows = []
    body, heavier = RigidBody(WAM), RigidBody(dataclasses.replace(WAM, payload=WAM.payload + 1.0))
    for mass in (0.1, 0.3, 0.5):
        found: list[list[float]] = [[], [], []]
        random = np.random.default_rng(54)
        for q in random.uniform(np.array(WAM.joints.lower) + 0.4, np.array(WAM.joints.upper) - 0.4, (200, 4)):
            load = np.array(body.gravity_torque(q)) - heavier.gravity_torque(q)
            rotation = np.array(body.cover_pose(q, "outer_link").rotation)
            azimuth = random.uniform(-math.pi, math.pi)
            off = np.array([math.cos(azimuth) / 2.0, math.sin(azimuth) / 2.0, -math.sqrt(3.0) / 2.0])
            pushes = [np.array([0.0, 0.0, -1.0]), off]
            weight = mass * STANDARD_GRAVITY
            noise = 0.1 * random.standard_normal(4)
            every = [mass * load]
            every += [torques(q, "outer_link", (L4, 0.0, 0.0), weight * rotation.T @ push) for push in pushes]
            for probabilities, tau in zip(found, every, strict=True):
                seen = tau + noise
                precision = np.linalg.inv(COARSE)
                if detection_statistic(seen, precision) > DETECT:
                    links = INFERENCE.infer(q, seen.tolist(), precision, load)
                    probabilities.append(1.0 - sum(each.probability for each in links))
        cells = [f"{100 * np.mean(np.array(p) > 0.5):.0f} % of {len(p)}" if p else "none" for p in found]
        medians = [f"{np.median(p):.2f}" if p else "none" for p in found]
        rows.append(f"| {mass:g} kg | " + " | ".join(f"{m}, {c}" for m, c in zip(medians, cells, strict=True)) + " |")
    return rows


@pytest.mark.slow
def test_the_odds_of_a_payload_are_those_of_the_table_in_the_page() -> None:
    page = (Path(__file__).parents[2] / "docs" / "estimator.md").read_text(encoding="utf-8")
    missing = [row for row in payload_rows() if row not in page]
    assert not missing, "\n".join(["write these in docs/estimator.md:", *missing])
