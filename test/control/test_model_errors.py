"""The errors of the model: learned without contact, frozen in contact, their covariance that of the errors."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from arms import CONFIGURATION, WAM

from wam_control.contact.contact_estimator import ContactEstimatorParameters
from wam_control.contact.model_errors import ModelErrors, Observation
from wam_control.contact.model_prior import ModelPrior, model_prior
from wam_control.contact.momentum_observer import MomentumObserver
from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_description.signals import State

TRUE = np.array([0.3, -0.2, 0.1])
SD = 0.25
STAYS = np.zeros((2, 0))  # torques of errors of the rest that stay: none
LEAST = 1e-6  # N^2 m^2, of the noise of a motor
QUIET = 1.0  # a detection statistic without contact


def errors(drift: float = 0.0, noise: float = 0.0) -> ModelErrors:
    variance = np.full(3, SD**2)
    prior = ModelPrior(("a", "b", "c"), np.zeros(3), np.diag(variance), variance, np.full(3, 0.2))
    return ModelErrors(prior, drift, np.diag([30.0, 20.0]), np.full(2, noise**2), LEAST)


def seen(random: np.random.Generator, external: tuple[float, float] = (0.0, 0.0)) -> Observation:
    """One moment of some motion, its residual with the true errors, an external torque and noise of 0.05 N m."""
    effects = random.uniform(-1.0, 1.0, (2, 3))
    residual = effects @ TRUE + external + 0.05 * random.standard_normal(2)
    return Observation(residual, effects, 0.05**2 * np.eye(2), np.ones(2), random.uniform(-1.0, 1.0, 2), STAYS)


def follow(
    tracked: ModelErrors, count: int, *, in_contact: bool = False, statistic: float = QUIET, seed: int = 1
) -> None:
    random = np.random.default_rng(seed)
    for _ in range(count):
        tracked.follow(seen(random), statistic, in_contact, CONTACT.learn_interval)


def test_free_motion_shows_the_errors_and_the_covariance_is_theirs() -> None:
    scores = []
    for seed in range(20):
        tracked = errors()
        follow(tracked, 60, seed=seed)
        scores.append((tracked.errors - TRUE) / np.sqrt(tracked.covariance.diagonal()))
    assert np.abs(tracked.errors - TRUE).max() < 0.1
    # observations count for less because they are taken as correlated; these are not
    assert 0.6 < np.sqrt(CONTACT.correlated) * np.std(scores) < 1.5
    torques, covariance = tracked.corrected(seen(np.random.default_rng(9)))
    assert np.abs(torques).max() < 4.0 * np.sqrt(covariance.diagonal().max())


def test_nothing_is_learned_in_contact_beyond_the_gate_or_shortly_after_a_contact() -> None:
    for given in ({"in_contact": True}, {"statistic": CONTACT.gate + 1.0}):
        tracked = errors()
        follow(tracked, 100, **given)
        assert not tracked.errors.any()
    tracked = errors()
    follow(tracked, 100, in_contact=True)
    follow(tracked, 20)
    assert not tracked.errors.any(), "a quarter of a second after a second of contact"
    follow(tracked, 60)
    assert tracked.errors.any()


def test_what_was_seen_shortly_before_a_contact_is_not_learned() -> None:
    tracked, random = errors(), np.random.default_rng(2)
    for _ in range(round(CONTACT.hindsight / CONTACT.learn_interval)):
        # a force that is not yet detected
        tracked.follow(seen(random, (1.0, 1.0)), QUIET, False, CONTACT.learn_interval)
    tracked.follow(seen(random, (1.0, 1.0)), 30.0, True, CONTACT.learn_interval)
    assert not tracked.errors.any()


def test_in_contact_the_errors_become_less_certain_but_never_less_than_before_any_motion() -> None:
    tracked = errors(drift=0.5)
    follow(tracked, 200)
    before = tracked.covariance.diagonal().copy()
    follow(tracked, 50, in_contact=True)
    assert np.all(tracked.covariance.diagonal() > 1.5 * before)
    follow(tracked, 5000, in_contact=True)
    assert tracked.covariance.diagonal() == pytest.approx([SD**2] * 3)
    assert np.linalg.eigvalsh(tracked.covariance).min() > 0.0


def test_what_is_learned_of_one_pose_by_holding_it_long_is_forgotten_elsewhere() -> None:
    """Its error stays as it is: taken for many, it would be learned as one of the model, and that as certain."""
    random = np.random.default_rng(5)
    held = seen(random)
    found = []
    for count in (20, 1000):
        tracked = errors()
        for _ in range(count):
            shaken = held.pose + 0.4 * CONTACT.pose_change * random.uniform(-1.0, 1.0, 2)
            tracked.follow(held._replace(pose=shaken), QUIET, False, CONTACT.learn_interval)
        there = tracked.covariance.trace()
        tracked.follow(held._replace(pose=held.pose + 1.1 * CONTACT.rest_left), QUIET, True, CONTACT.learn_interval)
        assert tracked.covariance.trace() == there, "a push that moves the arm does not hide itself"
        tracked.follow(held._replace(pose=held.pose + 1.1 * CONTACT.rest_left), QUIET, False, CONTACT.learn_interval)
        found.append((tracked.errors, tracked.covariance))
    assert there < 0.8 * tracked.covariance.trace() < 0.8 * 3 * SD**2
    assert found[0][0].any()
    for few, many in zip(*found, strict=True):
        assert np.array_equal(few, many)


def test_noise_of_a_motor_is_followed_and_widens_the_covariance() -> None:
    tracked, random = errors(), np.random.default_rng(3)
    effects = np.zeros((2, 3))
    for _ in range(400):
        residual = np.array([30.0 * 0.01 * random.standard_normal(), 0.0])
        pose = random.uniform(-1.0, 1.0, 2)
        tracked.follow(
            Observation(residual, effects, 1e-4 * np.eye(2), np.ones(2), pose, STAYS),
            QUIET,
            False,
            CONTACT.learn_interval,
        )
    assert np.sqrt(tracked.noise[0]) == pytest.approx(0.01, rel=0.3)
    assert tracked.noise[1] == 0.0
    _, covariance = tracked.corrected(
        Observation(np.zeros(2), effects, 1e-4 * np.eye(2), np.ones(2), np.zeros(2), STAYS)
    )
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.3, rel=0.3)


def test_errors_of_a_shaft_whose_friction_is_uncertain_show_no_noise_of_its_motor() -> None:
    tracked, random = errors(noise=0.005), np.random.default_rng(3)
    for k in range(2000):
        stated, times = (0.5, 2.0) if k % 2 else (0.05, 1.0)
        residual, pose = times * stated * random.standard_normal(2), random.uniform(-1.0, 1.0, 2)
        moment = Observation(residual, np.zeros((2, 3)), stated**2 * np.eye(2), np.ones(2), pose, STAYS)
        tracked.follow(moment, QUIET, False, CONTACT.learn_interval)
    assert np.all(np.sqrt(tracked.noise) < 0.05 / np.array([30.0, 20.0])), "as noise it would hide contacts in motion"


@pytest.mark.slow
def test_the_size_of_the_errors_is_followed_in_motion_but_not_in_contact_or_at_rest() -> None:
    def rough(tracked: ModelErrors, times: float, count: int, in_contact: bool = False, moving: float = 1.0) -> None:
        random = np.random.default_rng(1)
        for _ in range(count):
            now = seen(random)._replace(moving=np.array([1.0, moving]))
            error = times * 0.05 * random.standard_normal(2)
            moment = now._replace(residual=now.effects @ TRUE + error)
            tracked.follow(moment, QUIET, in_contact, CONTACT.learn_interval)

    for times, size in ((0.3, 1.0), (1.0, CONTACT.margin)):
        tracked = errors()
        rough(tracked, times, 6 * round(CONTACT.trust_time / CONTACT.learn_interval))
        assert tracked.size == pytest.approx(size, rel=0.3)
        before = tracked.size
        rough(tracked, 3.0, 100, in_contact=True)
        assert tracked.size == before
    tracked = errors()
    rough(tracked, 300.0, round(CONTACT.hindsight / CONTACT.learn_interval) + 5)
    assert tracked.size == CONTACT.largest_size
    tracked = errors()
    rough(tracked, 3.0, 200, moving=0.0)
    assert tracked.size == 1.0


def test_only_an_error_that_is_certainly_large_is_named() -> None:
    variance = np.full(3, SD**2)
    for certainty, named in ((1.0, ""), (1e-4, "b")):
        prior = ModelPrior(
            ("a", "b", "c"), np.array([0.3, -0.4, 0.1]), certainty * np.diag(variance), variance, np.full(3, 0.2)
        )
        assert ModelErrors(prior, 0.0, np.eye(2), np.zeros(2), LEAST).beyond == named
    tracked = errors()
    assert tracked.beyond == ""
    follow(tracked, 400)
    assert tracked.beyond == "a"


def test_errors_of_parameters_without_uncertainty_stay_zero() -> None:
    """A covariance of zero must not become a division by zero, which would silence the detection."""
    given = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer
    none = dict.fromkeys(("asymmetry_uncertainty", "load_uncertainty", "payload_uncertainty", "motor_noise"), 0.0)
    observer = MomentumObserver(
        WAM, dataclasses.replace(given, **none, moving_uncertainty=0.0, mass_uncertainty=0.0), False
    )
    for _ in range(100):
        assert observer.observe(State([0.0, 35.0, 0.0, 10.0], [3.0, -2.0, 4.0, 1.0], [0.2] * 4), 1e-3)
        observer.follow(QUIET, False)
    assert np.all(np.isfinite(observer.torques()[1]))
    assert {error.value for error in observer.model_errors.values()} == {0.0}


def test_an_identified_model_gives_each_direction_its_friction_and_its_covariance() -> None:
    given = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer
    names = [f"motors.coulomb_{way}.motor{j}" for way in ("positive", "negative") for j in (1, 2, 3, 4)]
    sd = np.linspace(0.001, 0.002, 8)
    shared = CONFIGURATION.with_values(
        {
            "model.source": "bag",
            "model.motors.coulomb_positive": [0.05, 0.03, 0.03, 0.03],
            "model.motors.coulomb_negative": [0.04, 0.03, 0.03, 0.03],
            "model.covariance.parameters": names,
            "model.covariance.values": np.diag(sd**2).ravel().tolist(),
        }
    ).shared
    prior = model_prior(shared.model_arm, given, shared.model)
    by_name = dict(zip(prior.names, prior.errors, strict=True))
    assert by_name["friction of motor1 in positive motion"] == pytest.approx(0.05 / 0.045 - 1.0)
    assert by_name["friction of motor1 in negative motion"] == pytest.approx(0.04 / 0.045 - 1.0)
    assert by_name["friction of motor2 in negative motion"] == pytest.approx(0.0, abs=1e-12)
    first = prior.names.index("friction of motor1 in positive motion")
    assert np.sqrt(prior.covariance[first, first]) == pytest.approx(np.hypot(0.001 / 0.045, 0.02))
    wide = model_prior(WAM, given, CONFIGURATION.shared.model)
    assert wide.covariance[first, first] > 10.0 * prior.covariance[first, first]
    assert np.array_equal(wide.limit, prior.limit), "friction may drift from what was identified"


def test_the_identified_covariance_is_that_of_masses_and_load_too_with_what_they_have_in_common() -> None:
    given = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer
    names = [
        "motors.coulomb_negative.motor2", "joints.coulomb.joint2", "motors.load_positive.motor2",
        "motors.load_negative.motor2", "joints.load.joint2", "links.weight.joint2",
    ]  # fmt: skip
    mixed = np.random.default_rng(4).standard_normal((6, 6))
    units = np.array([1e-3, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3])
    covariance = mixed @ mixed.T * np.outer(units, units)
    shared = CONFIGURATION.with_values(
        {
            "model.source": "bag",
            "model.motors.load_positive": [0.04, 0.04, 0.0, 0.0],
            "model.motors.load_negative": [0.04, 0.02, 0.0, 0.0],
            "model.covariance.parameters": names,
            "model.covariance.values": covariance.ravel().tolist(),
        }
    ).shared
    prior = model_prior(shared.model_arm, given, shared.model)
    motor, joint = WAM.motors.dynamic_friction[1], WAM.joints.dynamic_friction[1]
    at = [
        prior.names.index(name)
        for name in (
            "friction of motor2 in negative motion", "friction of joint2 in positive motion",
            "friction of joint2 in negative motion", "load friction of motor2", "load friction of joint2",
            "masses at joint2",
        )
    ]  # fmt: skip
    rows = np.zeros((6, 6))
    rows[0, 0], rows[1:3, 1], rows[3, 2:4], rows[4, 4], rows[5, 5] = 1.0 / motor, 1.0 / joint, 0.5, 1.0, 1.0
    least = np.diag([0.02**2] * 3 + [0.0] * 3)
    assert prior.covariance[np.ix_(at, at)] == pytest.approx(rows @ covariance @ rows.T + least)
    assert prior.errors[at] == pytest.approx([0.0, 0.0, 0.0, 0.03, 0.0, 0.0])
    assert prior.limit[at[3:]] == pytest.approx(prior.covariance[at[3:], at[3:]]), "of these only friction drifts"
    others = np.delete(np.arange(len(prior.names)), at)
    wide = model_prior(WAM, given, CONFIGURATION.shared.model)
    assert np.array_equal(prior.covariance[np.ix_(others, others)], wide.covariance[np.ix_(others, others)])
    assert not prior.covariance[np.ix_(at, others)].any()


def rest_at(arm: Arm, observer: MomentumObserver, q: Sequence[float]) -> float:
    """The detection statistic of an arm that rests without contact, by its joint sensors."""
    observer.reset()
    for _ in range(150):
        observer.observe(State(list(q), [0.0] * 4, RigidBody(arm).gravity_torque(q).tolist()), 1e-3)
    torques, covariance = observer.torques()
    return float(torques @ np.linalg.solve(covariance, torques))


def test_centres_of_mass_that_are_off_are_no_contact_and_a_zero_holds_in_other_poses() -> None:
    """Of 24 poses of a free arm with centres off by 5 mm; without the prior a contact in most of them."""
    own = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters)
    random = np.random.default_rng(0)
    centre = np.array(WAM.links.centre) + 0.005 * random.standard_normal(12)
    arm = dataclasses.replace(WAM, links=dataclasses.replace(WAM.links, centre=tuple(centre.tolist())))
    poses = random.uniform([-1.5, -1.6, -1.5, 0.2], [1.5, 1.2, 1.5, 2.4], (24, 4))
    exact = dataclasses.replace(own.observer, mass_scale=(1.0,) * 4)
    found, sds = {}, {}
    for name, sd in (("prior", 0.005), ("none", 0.0)):
        observer = MomentumObserver(WAM, dataclasses.replace(exact, centre_uncertainty=sd), True)
        found[name] = [rest_at(arm, observer, q) > own.detect for q in poses]
        sds[name] = observer.torques()[1].trace()
    assert sum(found["prior"]) == 0
    assert sum(found["none"]) > 5
    zeroed = MomentumObserver(WAM, exact, True)
    rest_at(arm, zeroed, poses[0])
    assert [zeroed.zero(own.detect), zeroed.zero(own.detect)] == ["", ""]
    assert [rest_at(arm, zeroed, q) > own.detect for q in poses] == [False] * 24
    assert sds["none"] < zeroed.torques()[1].trace() < 0.9 * sds["prior"], "a zero makes what is left more certain"


def test_a_zero_in_the_same_pose_takes_the_place_of_the_one_before() -> None:
    own = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer
    once, often = (MomentumObserver(WAM, own, True) for _ in range(2))
    for observer, times in ((once, 1), (often, 20)):
        rest_at(WAM, observer, (0.2, -1.05, 0.3, 0.5))
        for _ in range(times):
            assert observer.zero(24.0) == ""
    np.testing.assert_array_equal(once.torques()[1], often.torques()[1])
    moving = State([0.2, -1.05, 0.3, 0.5], [0.1, 0.0, 0.0, 0.0], [0.0] * 4)
    once.observe(moving, 1e-3)
    assert "the arm moves" in once.zero(24.0)
    once.observe(moving._replace(velocity=[0.03, 0.0, 0.0, 0.0]), 1e-3)
    assert once.zero(0.0) == "", "at rest for the force loop; and with any threshold"
    assert np.isfinite(once.torques()[1]).all()


@pytest.mark.parametrize(("kind", "weight", "friction"), [("friction of motor", 1.0, 1.1), ("masses at", 1.1, 1.0)])
def test_an_error_is_what_an_arm_has_more_as_in_the_covariance_of_its_model(
    kind: str, weight: float, friction: float
) -> None:
    own = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer
    own = dataclasses.replace(own, mass_scale=(1.0,) * 4, friction_scale=1.0)
    shafts, body, shown = WAM.transmission, RigidBody(WAM), []
    for g, f in ((1.0, 1.0), (weight, friction)):
        observer = MomentumObserver(WAM, own, False)
        for theta in (0.003 * np.arange(300)[:, None] + [2.0, 30.0, 3.0, 9.0]).tolist():
            carried = shafts.motor_torques(body.gravity_torque(shafts.joint_motion(theta)).tolist())
            torque = g * np.array(carried) + f * np.array(WAM.motors.dynamic_friction)
            observer.observe(State(theta, [3.0] * 4, torque.tolist()), 1e-3)
        observer.torques()
        shown.append(observer.seen)
    more = 0.1 * np.array([name.startswith(kind) for name in observer.model_errors])
    assert shown[1].residual - shown[0].residual == pytest.approx(shown[0].effects @ more, abs=0.01)
    assert np.abs(shown[0].effects @ more).max() > 0.1
