"""The contact estimator on the plant with elastic cables and true stick; its model is not the plant's."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import pytest
from arms import CONFIGURATION
from contact_truth import RigidArm, joint_torques, motor_from_joint, torques

from wam_control.contact.contact_estimator import ContactEstimate, ContactEstimator, ContactEstimatorParameters
from wam_control.contact.contact_estimator_node import ContactEstimatorNode, _is_pressing
from wam_control.contact.thresholds import CONTACT
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Arm
from wam_description.effects import no_effects
from wam_description.parameters import ParameterError
from wam_description.reasons import NO_REASON, Reason
from wam_description.rigid_body import RigidBody
from wam_description.signals import ForceCommand, State
from wam_description.wiring import Inputs
from wam_description.world import NO_SPRINGS, Obstacles, World
from wam_driver.plant import Plant
from wam_sim.simulation import Simulation
from wam_studies.contact.scenarios import base_values

ARM, TIMING = CONFIGURATION.shared.arm, CONFIGURATION.shared.timing
SENSORS = dataclasses.replace(
    CONFIGURATION.node("contact_estimator", ContactEstimatorParameters), use_joint_sensors=True
)
MOTORS = dataclasses.replace(SENSORS, use_joint_sensors=False)
NOTHING = World(Obstacles((), (), (), (), (), (), (), (), ()), NO_SPRINGS)
ZERO = [0.0] * 4
DT, SUBSTEPS, OUTER = 1e-3, 2, 5


def plant(start: tuple[float, ...], friction: float = 1.0) -> Plant:
    """The plant at a pose, its friction so many times the configured."""

    def more(levels: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(friction * level for level in levels)

    def scaled(group: object) -> dict[str, tuple[float, ...]]:
        return {name: more(getattr(group, name)) for name in ("static_friction", "dynamic_friction")}

    arm = dataclasses.replace(
        ARM,
        motors=dataclasses.replace(ARM.motors, **scaled(ARM.motors)),
        joints=dataclasses.replace(ARM.joints, start=start, **scaled(ARM.joints)),
    )
    return Plant(arm, NOTHING, no_effects(arm), DT / SUBSTEPS)


def push(arm: Plant, cover: str, x: float, force: tuple[float, float, float]) -> None:
    arm.push(cover, np.array(force), np.cross((x, 0.0, 0.0), force))


def sense(estimator: ContactEstimator, arm: Plant, tau: list[float]) -> None:
    motor = State(arm.theta, arm.thetad, tau)
    assert estimator.observe(motor, State(arm.q, arm.qd, arm.strain_torque), DT)


def at_rest(cover: str, x: float, force: tuple[float, float, float]) -> ContactEstimate:
    """What joint sensors feel 0.2 s after a push began on the braked arm."""
    arm, estimator = plant((0.0, -1.05, 0.0, 0.5)), ContactEstimator(ARM, TIMING, SENSORS)
    for tick in range(250):
        if tick == 50:
            assert not estimator.estimate().in_contact
            push(arm, cover, x, force)
        for _ in range(SUBSTEPS):
            arm.step(ZERO)
        sense(estimator, arm, ZERO)
    return estimator.estimate()


def test_a_single_period_just_above_the_threshold_is_noise_and_the_second_one_a_contact() -> None:
    arm = plant((0.0, -1.05, 0.0, 0.5))
    rest = State(arm.q, arm.qd, arm.strain_torque)

    def play(torque: float) -> list[ContactEstimate]:
        estimator, found = ContactEstimator(ARM, TIMING, SENSORS), []
        for tick in range(300):
            strain = list(rest.effort)
            strain[3] += torque * (tick >= 100)
            assert estimator.observe(rest, State(rest.position, rest.velocity, strain), DT)
            if tick % OUTER == 0:
                found.append(estimator.estimate())
        return found

    size = play(-1.0)[-1].statistic ** -0.5  # of statistic 1
    weak = play(-size * math.sqrt(1.1 * SENSORS.detect))
    above = [i for i, one in enumerate(weak) if one.statistic > SENSORS.detect]
    assert not weak[above[0]].in_contact
    assert all(weak[i].in_contact for i in above[1:])
    strong = next(one for one in play(-size * math.sqrt(60.0 * SENSORS.detect)) if one.statistic > SENSORS.detect)
    assert strong.statistic > CONTACT.alone * SENSORS.detect
    assert strong.in_contact


def test_while_a_force_changes_its_standard_deviation_has_the_delay_of_the_observer() -> None:
    """In a collision at speed 85 +- 10 N were stated where 136 N acted: the torques are 20 ms late."""
    arm, estimator = plant((0.0, -1.05, 0.0, 0.5)), ContactEstimator(ARM, TIMING, SENSORS)
    gravity = np.array(arm.strain_torque)
    wrench = np.array([0.0, 0.0, 1.0, 0.0, -0.28, 0.0])  # of 1 N at 0.28 m, in the frame of the cover
    lever = RigidBody(ARM).cover_jacobian(arm.q, "outer_link").T @ wrench
    rising, steady = [], []
    for tick in range(700):
        force = 3.0 * min(max(tick - 100, 0), 40)  # N, up to 120 N in 40 ms
        strain = (gravity - force * lever).tolist()
        assert estimator.observe(State(arm.q, ZERO, strain), State(arm.q, ZERO, strain), DT)
        if tick % OUTER == 0 and (one := estimator.estimate()).hypotheses and one.best.cover == "outer_link":
            error, sd = np.linalg.norm(one.best.force) - force, one.best.force_sd
            (rising if 110 < tick <= 140 else steady if tick > 500 else []).append((error, sd))
    assert len(rising) == 6
    assert max(abs(error) for error, _ in rising) > 40.0
    assert all(abs(error) < 2.0 * sd for error, sd in rising)
    assert max(sd for _, sd in steady) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize(("size", "phi"), [(5.0, 0.0), (10.0, 60.0), (5.0, 90.0), (10.0, 180.0), (5.0, -90.0)])
def test_joint_sensors_feel_a_light_push_at_rest(size: float, phi: float) -> None:
    force = (0.0, size * math.cos(math.radians(phi)), size * math.sin(math.radians(phi)))
    estimate = at_rest("outer_link", 0.28, force)
    assert estimate.in_contact
    assert estimate.best.cover == "outer_link"
    assert estimate.best.position == pytest.approx(0.28, abs=max(0.03, estimate.best.position_sd))
    assert abs(estimate.best.position - 0.28) < 2 * estimate.best.position_sd
    assert np.linalg.norm(np.subtract(estimate.best.force, force)) < 0.15 * size
    assert not estimate.reasons


def test_joint_sensors_feel_the_moment_of_a_push_on_the_inner_link() -> None:
    estimate = at_rest("inner_link", 0.3, (0.0, 8.0, 0.0))
    assert estimate.best.cover == "inner_link"
    assert math.isnan(estimate.best.position)
    assert Reason.MOMENT_ONLY in estimate.reasons
    assert estimate.best.moment[2] == pytest.approx(2.4, rel=0.05)
    assert np.linalg.norm(estimate.best.force) <= 8.0


def test_a_push_on_the_inner_link_whose_torques_are_those_of_one_along_the_outer_is_certain_on_neither() -> None:
    estimate = at_rest("inner_link", 0.3, (0.0, 0.0, 8.0))
    assert Reason.ALONG in estimate.reasons
    inner = next(one for one in estimate.hypotheses if one.cover == "inner_link")
    assert 0.05 < inner.probability < 0.95
    assert inner.moment[1] == pytest.approx(-2.4, rel=0.05)


@pytest.mark.slow
def test_joint_sensors_locate_a_push_on_an_arm_in_motion() -> None:
    arm, estimator = RigidArm(ARM, (0.2, -1.05, 0.3, 0.5), friction=0.0), ContactEstimator(ARM, TIMING, SENSORS)
    drive = np.array([joint_torques(one) for one in np.eye(4)]).T
    errors = []
    for tick in range(500):
        pushed = torques(arm.data.qpos, "outer_link", (0.28, 0.0, 0.0), (0.0, 24.0, 32.0))
        swing = np.array([1.2, 1.6, 0.6, 0.4]) * np.sin(2.0 * math.pi * np.array([1.1, 1.3, 1.7, 2.1]) * tick * DT)
        arm.step(np.linalg.solve(drive, swing + arm.gravity() - pushed), pushed)
        assert estimator.observe(State(ZERO, ZERO, ZERO), State(*arm.sensors()), DT)
        if tick % OUTER == 0 and tick > 200:
            found = estimator.estimate()
            assert found.best.cover == "outer_link"
            errors.append(abs(found.best.position - 0.28))
    assert max(errors) < 0.005


TILTED = (0.0, -1.05, 0.3, 0.9)


@pytest.mark.slow
def test_vibration_after_a_contact_is_no_new_one() -> None:
    """At 60 Hz, which passes the faster filter: after a contact it is that of the cables, later a contact."""
    smooth = dataclasses.replace(MOTORS, observer=dataclasses.replace(MOTORS.observer, shape_uncertainty=0.0))
    transmission, body = ARM.transmission, RigidBody(ARM, MOTORS.observer.mass_scale)
    pose, speed, rest = np.array(TILTED), [1.0, -1.2, 2.0, 1.5], np.zeros(4)
    lever = body.cover_jacobian(pose, "outer_link").T @ (0.0, 0.0, 1.0, 0.0, -0.28, 0.0)

    def play(estimator: ContactEstimator, span: float, force: float, vibration: float) -> list[ContactEstimate]:
        found = []
        for tick in range(round(span / DT)):
            np.add(pose, DT * np.array(transmission.joint_motion(speed)), out=pose)
            pushed = force + vibration * min(1.0, tick / 100) * math.sin(2.0 * math.pi * 60.0 * tick * DT)
            torque = transmission.motor_torques((body.gravity_torque(pose) + rest - pushed * lever).tolist())
            assert estimator.observe(State(transmission.motor_motion(pose.tolist()), speed, torque), None, DT)
            if tick % OUTER == 0:
                found.append(estimator.estimate())
        return found

    rest = np.array(play(ContactEstimator(ARM, TIMING, smooth), 0.2, 0.0, 0.0)[-1].external_torques)
    estimator = ContactEstimator(ARM, TIMING, smooth)
    assert not any(estimate.in_contact for estimate in play(estimator, 0.2, 0.0, 0.0))
    assert play(estimator, 0.3, 20.0, 0.0)[-1].in_contact
    assert not play(estimator, 0.1, 0.0, 0.0)[-1].in_contact
    assert not any(estimate.in_contact for estimate in play(estimator, 0.18, 0.0, 40.0))
    assert not any(estimate.in_contact for estimate in play(estimator, 0.2, 0.0, 0.0))
    estimator = ContactEstimator(ARM, TIMING, smooth)  # the other has learned that the torques are noisy
    assert not any(estimate.in_contact for estimate in play(estimator, 2.0, 0.0, 0.0))
    assert any(estimate.in_contact for estimate in play(estimator, 0.18, 0.0, 40.0))


class Move(NamedTuple):
    """Smooth moves between random poses, with stops."""

    seed: int
    fastest: float  # rad/s

    def reference(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles and velocities, a row per millisecond."""
        rng = np.random.default_rng(self.seed)
        here, q, qd = np.array((0.0, -0.9, 0.0, 0.5)), [], []
        while len(q) < seconds / DT:
            there = rng.uniform((-1.0, -1.5, -1.0, -0.5), (1.0, -0.4, 1.0, 1.3))
            duration = max(0.4, 1.9 * float(np.abs(there - here).max()) / self.fastest)
            s = np.arange(0.0, 1.0, DT / duration)[:, None]
            q += list(here + (there - here) * s**3 * (10 - 15 * s + 6 * s * s))
            qd += list((there - here) * 30 * s * s * (1 - s) ** 2 / duration)
            q += [there] * 200
            qd += [np.zeros(4)] * 200
            here = there
        return np.array(q), np.array(qd)


class Felt(NamedTuple):
    tick: int
    estimate: ContactEstimate


def moving(
    estimators: list[ContactEstimator], move: Move, seconds: float, friction: float, push_at: int = -1
) -> list[list[Felt]]:
    """What estimators feel while the arm moves under a plain motor servo."""
    arm, transmission, body = plant((0.0, -0.9, 0.0, 0.5), friction), ARM.transmission, RigidBody(ARM)
    arm.brake(False)
    felt: list[list[Felt]] = [[] for _ in estimators]
    for tick, (q, qd) in enumerate(zip(*move.reference(seconds), strict=True)):
        if tick * DT >= seconds:
            break
        if tick == push_at:
            push(arm, "outer_link", 0.28, (0.0, 4.0, 3.0))
        weight = np.array(transmission.motor_torques(body.gravity_torque(q).tolist()))
        servo = 0.05 * (motor_from_joint(qd) - arm.thetad) + (motor_from_joint(q) - arm.theta)
        tau = (weight + servo).tolist()
        for _ in range(SUBSTEPS):
            arm.step(tau)
        for estimator, results in zip(estimators, felt, strict=True):
            sense(estimator, arm, tau)
            if tick % OUTER == 0:
                results.append(Felt(tick, estimator.estimate()))
    return felt


@pytest.mark.slow
@pytest.mark.parametrize(("friction", "fastest"), [(0.8, 2.5), (1.05, 1.0)])
def test_no_false_alarm_in_motion_at_reversals_and_at_stops(friction: float, fastest: float) -> None:
    estimators = [ContactEstimator(ARM, TIMING, parameters) for parameters in (MOTORS, SENSORS)]
    for results in moving(estimators, Move(3, fastest), 5.0, friction):
        assert not any(felt.estimate.in_contact for felt in results)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_motors_alone_feel_5_newton_within_60_milliseconds_in_motion(seed: int) -> None:
    (results,) = moving([ContactEstimator(ARM, TIMING, MOTORS)], Move(seed, 1.0), 1.5, 1.0, push_at=600)
    assert not any(felt.estimate.in_contact for felt in results if felt.tick < 600)
    first = next(felt for felt in results if felt.estimate.in_contact)
    assert first.tick - 600 <= 60
    settled = next(felt.estimate for felt in results if felt.tick >= 680)
    assert settled.best.cover == "outer_link"
    assert np.linalg.norm(np.subtract(settled.best.force, (0, 4, 3))) < 2.0
    assert abs(settled.best.position - 0.28) < max(0.04, 2.5 * settled.best.position_sd)


def test_contact_is_released_below_the_lower_threshold_only() -> None:
    arm, estimator = plant((0.0, -1.05, 0.0, 0.5)), ContactEstimator(ARM, TIMING, SENSORS)
    states = []
    for tick in range(500):
        if tick in (100, 250):
            push(arm, "outer_link", 0.28, (0.0, 0.0, 5.0 if tick == 100 else 0.0))
        for _ in range(SUBSTEPS):
            arm.step(ZERO)
        sense(estimator, arm, ZERO)
        found = estimator.estimate()
        states.append(found.in_contact)
        limit = SENSORS.release if len(states) > 1 and states[-2] else SENSORS.detect
        assert found.in_contact == (found.statistic > limit)
    changes = [i for i in range(1, 500) if states[i] != states[i - 1]]
    assert len(changes) == 2
    assert 100 <= changes[0] < 110
    assert 250 < changes[1] < 500


def test_bad_samples_are_counted_and_change_nothing() -> None:
    arm, estimator = plant((0.0, -1.05, 0.0, 0.5)), ContactEstimator(ARM, TIMING, SENSORS)
    for tick in range(100):
        push(arm, "outer_link", 0.28, (0.0, 0.0, 5.0 * (tick > 20)))
        for _ in range(SUBSTEPS):
            arm.step(ZERO)
        sense(estimator, arm, ZERO)
    before = estimator.estimate()
    motor, good = State(arm.theta, arm.thetad, ZERO), State(arm.q, arm.qd, arm.strain_torque)
    assert not estimator.observe(motor, None, DT)
    assert not estimator.observe(motor, State(good.position, [math.nan] * 4, good.effort), DT)
    assert not estimator.observe(motor, State(good.position[:2], good.velocity, good.effort), DT)
    assert estimator.estimate() == before
    assert estimator.observe(State([math.nan] * 4, ZERO, ZERO), good, DT)  # not looked at


def test_nothing_is_felt_before_anything_is_observed_or_after_reset() -> None:
    estimator = ContactEstimator(ARM, TIMING, SENSORS)
    for _ in range(2):
        found = estimator.estimate()
        assert not found.in_contact
        assert found.best.cover == ""
        assert math.isnan(found.best.position)
        assert found.reasons == Reason.TOO_EARLY
        estimator.observe(State(ZERO, ZERO, ZERO), State(ZERO, ZERO, [9.0] * 4), DT)
        estimator.reset()


def test_sets_that_do_not_fit_are_refused() -> None:
    blind: Arm = dataclasses.replace(ARM, joint_sensors=False)
    with pytest.raises(ParameterError, match=r"use_joint_sensors.*set it to false"):
        ContactEstimator(blind, TIMING, SENSORS)
    ContactEstimator(blind, TIMING, MOTORS)
    with pytest.raises(ParameterError, match="release"):
        dataclasses.replace(SENSORS, release=30.0)
    hasty = dataclasses.replace(SENSORS, observer=dataclasses.replace(SENSORS.observer, time_constant=1e-3))
    with pytest.raises(ParameterError, match=r"time_constant.*two periods"):
        ContactEstimator(ARM, TIMING, hasty)


def carrying(mass: float) -> Arm:
    """The arm with a mass at the tool, which lies on the x axis of the last link as its centre does."""
    links, lever = ARM.links, ARM.tool[0] - ARM.links.centre[-3]
    total = links.mass[-1] + mass
    moved = mass * links.mass[-1] / total * lever * lever
    centre = (*links.centre[:-3], links.centre[-3] + lever * mass / total, 0.0, 0.0)
    inertia = (*links.inertia[:-2], links.inertia[-2] + moved, links.inertia[-1] + moved)
    heavy = dataclasses.replace(links, mass=(*links.mass[:-1], total), centre=centre, inertia=inertia)
    start = dataclasses.replace(ARM.joints, start=(0.0, -1.05, 0.0, 0.5))
    return dataclasses.replace(ARM, links=heavy, joints=start)


def test_a_payload_is_no_alarm_within_what_is_declared_and_can_be_tared() -> None:
    arm, found = Plant(carrying(0.3), NOTHING, no_effects(ARM), DT / SUBSTEPS), {}
    for name, payload in (("none", (0.0, 0.0)), ("declared", (0.0, 0.4))):
        observer = dataclasses.replace(SENSORS.observer, payload=payload)
        estimator = ContactEstimator(ARM, TIMING, dataclasses.replace(SENSORS, observer=observer))
        for _ in range(150):
            for _ in range(SUBSTEPS):
                arm.step(ZERO)
            sense(estimator, arm, ZERO)
        found[name] = (estimator.estimate(), estimator.zero(), estimator.estimate())
    assert found["none"][0].in_contact
    assert not found["none"][2].in_contact, "a person says that nothing is touched"
    before, reason, after = found["declared"]
    assert (before.in_contact, reason) == (False, "")
    assert before.torque_sd[3] > 3.0 * after.torque_sd[3]
    assert abs(after.external_torques[3]) < 0.1 * abs(before.external_torques[3])


@pytest.mark.slow
def test_from_the_motors_a_payload_is_tracked_and_not_tared() -> None:
    arm = RigidArm(carrying(0.3), (0.2, -1.05, 0.3, 0.5), friction=0.0)
    observer = dataclasses.replace(MOTORS.observer, payload=(0.0, 0.5), mass_scale=(1.0,) * 4)
    frictionless = dataclasses.replace(observer, friction_scale=0.0)
    estimator = ContactEstimator(ARM, TIMING, dataclasses.replace(MOTORS, observer=frictionless))
    drive = np.array([joint_torques(one) for one in np.eye(4)]).T
    for tick in range(3000):
        swing = np.array([6.0, 8.0, 3.0, 2.0]) * np.sin(2.0 * math.pi * np.array([1.1, 1.3, 1.7, 2.1]) * tick * DT)
        motor = np.linalg.solve(drive, 0.5 * swing + arm.gravity())
        arm.step(motor, np.zeros(4))
        assert estimator.observe(State(*arm.motors(motor)), None, DT)
        if tick % OUTER == 0:
            estimator.estimate()
    before = estimator.estimate()
    reason = estimator.zero()
    assert "the payload is tracked while the arm moves" in reason
    assert float(reason.partition("now ")[2].split()[0]) == pytest.approx(0.3, abs=0.015)
    assert estimator.estimate().external_torques == before.external_torques


def test_held_motors_feel_nothing_and_joint_sensors_feel_on() -> None:
    arm = plant((0.0, -1.05, 0.0, 0.5))
    for parameters, is_felt in ((MOTORS, False), (SENSORS, True)):
        estimator = ContactEstimator(ARM, TIMING, parameters)
        estimator.brake(True)
        push(arm, "outer_link", 0.28, (0.0, 4.0, 3.0))
        for _ in range(300):
            for _ in range(SUBSTEPS):
                arm.step(ZERO)
            sense(estimator, arm, [0.05] * 4)  # a current that is read though none flows
        found = estimator.estimate()
        assert found.in_contact is is_felt
        assert found.reasons == (NO_REASON if is_felt else Reason.BRAKED)


@pytest.mark.slow
def test_drift_of_friction_is_followed_and_published_once_a_second() -> None:
    configured = CONFIGURATION.with_values(base_values(CONFIGURATION, False))
    ends = ((0.5, -0.9, 0.3, 2.0), (-0.4, -0.3, -0.3, 1.4))
    steps = [ScenarioStep("release", 0.5, request="enable")]
    steps += [ScenarioStep("move", 1.2, posture=ends[i % 2]) for i in range(12)]
    run = Simulation(configured, steps)
    level = ARM.joints.dynamic_friction[0]
    tick = 0
    while not run.step():
        tick += 1
        if tick == 6000:
            run.driver.plant.set_added_friction([0.3 * level, 0.0, 0.0, 0.0])
    rows = run.rows["contact/tracked_friction"]
    stamps = [row.stamp // 1_000_000_000 for row in rows]
    assert stamps == list(range(stamps[0], stamps[-1] + 1))
    assert len(stamps) > 12
    friction = np.array([row.values for row in rows]).reshape(len(rows), 8, 6)
    at_motor = np.abs(ARM.transmission.joint_from_motor[0, 0])
    total = friction[:, 0, :2] + at_motor * friction[:, 4, :2]  # free motion does not separate motor 1 and joint 1
    assert np.all(friction[:, :4, 3:5] > 0.0)
    assert np.all(friction[5:, :4, 3:5] < 0.25 * friction[5:, :4, :2])  # in motion; before, all that is stated
    grown = total[-1] - total[5]
    assert grown == pytest.approx([0.3 * level * at_motor] * 2, rel=0.5)
    assert np.abs(total[5] - total[3]).max() < 0.3 * grown.min()


@pytest.mark.slow
@pytest.mark.parametrize("feedback", ["joint_sensors", "contact_estimate"])
def test_as_a_force_begins_the_estimator_takes_the_zero_of_the_force_loop(feedback: str) -> None:
    """What the loop measures by the estimate must not be zeroed twice."""
    given = CONFIGURATION.with_values(
        {"driver:mismatch.payload": 0.02, "force_loop:feedback": feedback, "force_loop:guard.mode": "warn"}
    )
    command = ForceCommand("base", (0.0, 0.0, 3.0))
    run = Simulation(given, [ScenarioStep("release", 0.6, request="enable"), ScenarioStep("press", 0.2, force=command)])
    while len(run.played) < 2:
        run.step()
    before = np.abs(run.estimate.external_torques).max()
    run.play()
    is_zeroed = feedback == "joint_sensors"
    assert np.any(run.rows["external_torque_zero"][-1].values) == is_zeroed
    assert (np.abs(run.estimate.external_torques).max() < 0.5 * before) == is_zeroed


@pytest.mark.parametrize(("effort", "presses"), [([0.0, 4.0, 0.0, 2.0], True), (ZERO, False)])
def test_torques_that_are_commanded_press_as_a_force_does(effort: list[float], presses: bool) -> None:
    assert _is_pressing(Inputs.of(0, DT, {"joint_torque_command": (0, State([], [], effort))})) is presses
    assert "joint_torque_command" not in ContactEstimatorNode(CONFIGURATION.shared, MOTORS).unused
