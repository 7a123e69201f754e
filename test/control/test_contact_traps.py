"""What looks fine but is wrong: each way to fool oneself about contact estimation is walked into here, and shows."""

import dataclasses

import numpy as np
import pytest
from arms import CONFIGURATION, WAM
from contact_truth import RigidArm, joint_torques, motor_from_joint, torques

from wam_control.contact.contact_estimator import ContactEstimate, ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference
from wam_control.contact.momentum_observer import MomentumObserver
from wam_control.contact.shaft_friction import ShaftFriction
from wam_control.task.scenario import Push, ScenarioStep
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_sim.simulation import Simulation
from wam_studies.contact.scenarios import ScenarioGenerator

PARAMETERS = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters)
OWN = dataclasses.replace(
    PARAMETERS.observer, mass_scale=(1.0,) * 4, friction_scale=1.0, payload=(0.0, 0.0), payload_uncertainty=0.0
)
POSE = (0.2, -1.05, 0.3, 0.5)
DRIVE = np.array([joint_torques(e) for e in np.eye(4)]).T
DT = 1e-3


def felt_while_sliding(arm: Arm, observer: MomentumObserver, ticks: int, friction: float = 1.0) -> np.ndarray:
    """Residuals, a row per millisecond, of an arm that all motors drive one way against friction."""
    plant, rows = RigidArm(WAM, POSE, friction), []
    push = np.array([4.0, 5.0, 3.5, 2.0])
    for _ in range(ticks):
        motor = np.linalg.solve(DRIVE, plant.gravity() + push)
        plant.step(motor, np.zeros(4))
        assert observer.observe(State(*plant.motors(motor)), DT)
        rows.append(observer.torques()[0])
    return np.array(rows)


@pytest.mark.slow
def test_truth_does_not_share_masses_and_friction_with_the_estimator() -> None:
    """With shared ones the residual is zero and every error looks like 0.00 cm."""
    assert set(PARAMETERS.observer.mass_scale) != {1.0}
    assert PARAMETERS.observer.friction_scale != 1.0
    shared = felt_while_sliding(WAM, MomentumObserver(WAM, OWN, False), 300)
    nominal = dataclasses.replace(PARAMETERS.observer, payload=(0.0, 0.0))
    departed = felt_while_sliding(WAM, MomentumObserver(WAM, nominal, False), 300)
    assert np.abs(departed[280:]).max() > 5.0 * np.abs(shared[280:]).max()
    for scenario in ScenarioGenerator(CONFIGURATION, 1).contacts(4):
        assert len({*scenario.values["driver:mismatch.mass"], *scenario.values["driver:mismatch.motor_friction"]}) == 8


@pytest.mark.slow
def test_a_textbook_differential_mistakes_gravity_for_a_push() -> None:
    """Motors averaged, (m2 + m3)/2 and (m3 - m2)/2, without the 2:1 of (A.5)."""
    matrix = np.array(WAM.joint_from_motor).reshape(4, 4)
    matrix[2] *= 0.5
    textbook = dataclasses.replace(WAM, joint_from_motor=tuple(matrix.ravel().tolist()))
    worst = {}
    for name, arm in (("right", WAM), ("textbook", textbook)):
        observer = MomentumObserver(arm, OWN, False)
        worst[name] = np.abs(felt_while_sliding(arm, observer, 200)[180:]).max(axis=0)
    assert worst["right"].max() < 0.1
    assert worst["textbook"][1:3].max() > 1.0


def test_more_samples_of_the_same_friction_do_not_make_it_better_known() -> None:
    """Taken as independent, 1 kHz samples of one bias would shrink the spread by the root of their number."""
    observer = MomentumObserver(WAM, OWN, False)
    theta, spreads = motor_from_joint(np.array(POSE)), []
    speed = np.array([3.0, -4.0, 5.0, 3.0])
    for k in range(1000):
        observer.observe(State((theta + speed * k * DT).tolist(), speed.tolist(), [0.1] * 4), DT)
        if k in (150, 999):
            spreads.append(np.sqrt(observer.torques()[1].diagonal()))
    np.testing.assert_allclose(spreads[1], spreads[0], rtol=0.05)
    least = OWN.moving_uncertainty * np.array(WAM.joints.dynamic_friction)
    assert np.all(spreads[1] > least)


def resting(newtons: float, seconds: float = 0.5, **values: object) -> tuple[ContactEstimate, Simulation]:
    """What the motors alone feel of a push on the outer link of the arm that holds its posture."""
    own = {
        "contact_estimator:use_joint_sensors": False,
        "arm.joints.start": [0.1, -0.9, 0.2, 0.7],
        "driver:mismatch.motor_friction": [1.05, 0.95, 1.02, 0.97],
        "driver:world.obstacles.positions": [5.0] * 3,
        **values,
    }
    push = Push("outer_link", 0.28, (0.0, 0.8 * newtons, 0.6 * newtons), 0.0, seconds)
    steps = [
        ScenarioStep("release", 0.05, request="enable"),
        ScenarioStep("settle", 0.45),
        ScenarioStep("rest", seconds, push=push),
    ]
    run = Simulation(CONFIGURATION.with_values(own), steps)
    assert run.play() == ""
    return run.estimate, run


@pytest.mark.slow
def test_stiction_hides_2_newton_at_rest_and_the_estimate_says_so() -> None:
    """A test that pushes with 20 N only would not notice."""
    light, _ = resting(2.0)
    assert not light.in_contact
    assert min(light.torque_sd) > 0.3
    heavy, _ = resting(20.0)
    assert heavy.in_contact


@pytest.mark.slow
def test_dither_feels_5_newton_at_rest() -> None:
    found, run = resting(5.0, **{"timing.dither_cycle": 40})
    assert found.in_contact
    assert found.best.cover == "outer_link"
    assert abs(found.best.position - 0.28) < max(0.03, 2.0 * found.best.position_sd)
    assert np.linalg.norm(np.subtract(found.best.force, (0.0, 4.0, 3.0))) < 1.0
    tip = [row.values[:4] for row in run.rows["sim/joint_states"][60:100]]
    moved = np.ptp([RigidBody(WAM).tool_pose(q).position for q in tip], axis=0)
    assert 0.0 < np.linalg.norm(moved) < 0.6e-3
    # shafts that do not slip both ways still hide the push
    weak, _ = resting(5.0, **{"timing.dither_cycle": 40, "velocity_loop:dither.level": 0.6})
    assert np.divide(weak.torque_sd, found.torque_sd).min() > 2.0


@pytest.mark.slow
def test_dither_averaged_over_less_than_a_cycle_is_felt_as_a_push() -> None:
    swings = {}
    for cycle in (40, 27):
        _, run = resting(0.0, 0.3, **{"timing.dither_cycle": 40})
        observer = MomentumObserver(WAM, OWN, False, cycle)
        felt = []
        for row in run.rows["motor_states"][60:]:
            observer.observe(State(list(row.values[:4]), list(row.values[4:8]), list(row.values[8:])), DT)
            felt.append(observer.torques()[0])
        swings[cycle] = np.ptp(felt[300:], axis=0).max()
    assert swings[40] < 0.1
    assert swings[27] > 5.0 * swings[40]


@pytest.mark.parametrize("lean", [-0.3, 0.3])
def test_friction_along_the_tube_makes_the_place_a_set_that_holds_the_truth(lean: float) -> None:
    """Near 90 deg at the elbow the force of friction has the lever of the inner link, and moves the answer by 9 cm."""
    q, place, force = (0.3, -1.0, 0.2, 0.2), 0.2, (10.0 * lean, 6.0, 8.0)
    surface = (place, -0.6 * WAM.covers.radius[1], -0.8 * WAM.covers.radius[1])
    tau, precision = torques(q, "outer_link", surface, force).tolist(), np.eye(4) / 0.05**2
    smooth = dataclasses.replace(PARAMETERS.inference, friction=0.0)
    sure = ContactInference(WAM, RigidBody(WAM), smooth).infer(q, tau, precision)[0]
    wide = ContactInference(WAM, RigidBody(WAM), PARAMETERS.inference).infer(q, tau, precision)[0]
    assert not sure.low <= place <= sure.high
    assert wide.low <= place <= wide.high


def test_friction_after_a_reversal_is_uncertain_for_as_long_as_presliding_may_last() -> None:
    """A dither swings back in every cycle, beyond any presliding."""
    ahead = np.full(8, 2.0)
    for keep, is_uncertain in ((0.97, True), (0.0, False)):
        shafts = ShaftFriction(WAM, OWN, None)
        before = [shafts.of(ahead, keep, DT).by_distance for _ in range(2000)][-1]
        assert before == pytest.approx(np.ones_like(before), abs=1e-3)
        assert (np.ptp(shafts.of(-0.05 * ahead, keep, 0.05).by_distance[0]) > 1.0) == is_uncertain
