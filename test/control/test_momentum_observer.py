"""The momentum observer against an arm simulated by MuJoCo, which knows nothing of it."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from arms import CONFIGURATION, changed
from arms import WAM as ELASTIC
from contact_truth import RigidArm, joint_torques, motor_from_joint, torques

from wam_control.contact.contact_estimator import ContactEstimatorParameters
from wam_control.contact.momentum_observer import MomentumObserver
from wam_control.contact.observer_parameters import ObserverParameters
from wam_description.arm import Arm
from wam_description.parameters import ParameterError
from wam_description.signals import State

WAM = changed(ELASTIC, cables={"stage_ea": tuple(1e3 * each for each in ELASTIC.cables.stage_ea)})  # as `RigidArm`
NOMINAL = CONFIGURATION.node("contact_estimator", ContactEstimatorParameters).observer
EXACT = dataclasses.replace(NOMINAL, mass_scale=(1.0,) * 4, friction_scale=1.0, payload=(0.0, 0.0))
KNOWN = dataclasses.replace(
    EXACT,
    mass_uncertainty=0.0,
    centre_uncertainty=0.0,
    moving_uncertainty=0.0,
    asymmetry_uncertainty=0.0,
    load_uncertainty=0.0,
    torque_scale_uncertainty=0.0,
    payload_uncertainty=0.0,
    motor_torque_sd=0.003,
    motor_torque_fraction=0.0,
    motor_noise=0.0,
)
FREE = dataclasses.replace(EXACT, friction_scale=0.0)
DT = 1e-3
NONE = np.zeros(4)
DRIVE = np.array([joint_torques(e) for e in np.eye(4)]).T
POSE = (0.2, -1.05, 0.3, 0.5)


def wave(time: float) -> np.ndarray:
    """Joint torques on top of gravity that swing the arm fast, every joint back and forth."""
    return np.array([6.0, 8.0, 3.0, 2.0]) * np.sin(2 * math.pi * np.array([1.1, 1.3, 1.7, 2.1]) * time)


def swing(
    observer: MomentumObserver,
    plant: RigidArm,
    seconds: float,
    *,
    external: Callable[[float], np.ndarray] = lambda _: NONE,
    sensors: bool = False,
    torque: Callable[[float], np.ndarray] = wave,
) -> np.ndarray:
    """Residuals of a swing, one row per millisecond."""
    rows = []
    for k in range(round(seconds / DT)):
        tau = torque(k * DT) + plant.gravity()
        motor = np.linalg.solve(DRIVE, tau)
        plant.step(motor, external(k * DT))
        state = State(*plant.sensors()) if sensors else State(*plant.motors(motor))
        assert observer.observe(state, DT)
        rows.append(list(observer.torques()[0]))
    return np.array(rows)


def test_residual_reaches_63_percent_of_a_step_after_the_time_constant() -> None:
    push = torques(POSE, "outer_link", (0.28, 0, 0), (0, 3, 4))
    observer = MomentumObserver(WAM, FREE, use_joint_sensors=False)
    plant = RigidArm(WAM, POSE, friction=0.0)
    rows = swing(observer, plant, 0.2, external=lambda t: push * (t > 0.0995), torque=lambda _: NONE)
    after = round(FREE.time_constant / DT)
    for ticks in (after // 2, after, 3 * after):
        expected = push * (1 - math.exp(-ticks * DT / FREE.time_constant))
        np.testing.assert_allclose(rows[99 + ticks], expected, atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("sensors", "cycle"), [(True, 0), (False, 0), (False, 40)])
def test_the_pose_is_as_late_as_the_torques(sensors: bool, cycle: int) -> None:
    """In the pose of now the same force has other torques: a contact would be found elsewhere."""
    at = ("outer_link", (0.28, 0, 0), (0, 24, 32))
    observer = MomentumObserver(WAM, FREE, sensors, cycle)
    plant = RigidArm(WAM, POSE, friction=0.0)
    late, now = [], []

    def push(time: float) -> np.ndarray:
        if time > 0.2:
            found = observer.torques()[0]
            late.append(np.abs(found - torques(observer.seen.pose, *at)).max())
            now.append(np.abs(found - torques(observer.q, *at)).max())
        return torques(plant.data.qpos, *at)

    swing(
        observer,
        plant,
        0.5,
        external=push,
        sensors=sensors,
        torque=lambda t: 0.2 * wave(t) - torques(plant.data.qpos, *at),
    )
    assert max(late) < 0.06
    assert max(now) > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("sensors", [False, True])
def test_motion_alone_gives_no_external_torque(sensors: bool) -> None:
    observer = MomentumObserver(WAM, FREE, use_joint_sensors=sensors)
    plant = RigidArm(WAM, POSE, friction=0.0)
    rows = swing(observer, plant, 1.0, sensors=sensors)
    assert np.abs(motor_from_joint(plant.data.qvel)).max() > 5.0
    assert np.abs(rows).max() < 0.05


@pytest.mark.slow
def test_torques_that_come_late_are_no_external_ones() -> None:
    """By 2 ms, which the observer finds out in free motion, and is uncertain about before."""
    worst, sds = {}, {}
    for name, sd in (("with", 1e-3), ("without", 0.0)):
        own = dataclasses.replace(KNOWN, friction_scale=0.0, torque_delay_uncertainty=sd)
        observer, plant = MomentumObserver(WAM, own, use_joint_sensors=False), RigidArm(WAM, POSE, friction=0.0)
        late, rows = [], []
        for k in range(3000):
            motor = np.linalg.solve(DRIVE, wave(k * DT) + plant.gravity())
            plant.step(motor, NONE)
            late.append(motor)
            assert observer.observe(State(*plant.motors(late[max(0, k - 2)])), DT)
            if k % 5:
                continue
            rows.append(observer.torques()[0])
            if k == 300:
                sds[name] = np.sqrt(observer.torques()[1].diagonal())
            observer.follow(0.0, False)
        worst[name] = np.abs(rows[400:]).max(axis=0)
        if sd:
            assert observer.model_errors["delay of the torques"].value == pytest.approx(2e-3, rel=0.2)
    assert np.all(worst["with"] < 0.5 * worst["without"])
    assert np.all(sds["with"][:2] > sds["without"][:2])


@pytest.mark.slow
def test_rotor_inertia_is_part_of_the_momentum() -> None:
    """Without it there are torques in the motion that alone gives none, see above."""
    without = dataclasses.replace(WAM, motors=dataclasses.replace(WAM.motors, inertia=(1e-9,) * 4))
    rows = swing(MomentumObserver(without, FREE, False), RigidArm(WAM, POSE, friction=0.0), 1.0)
    assert np.abs(rows).max() > 0.3


@pytest.mark.slow
def test_the_stretch_of_cables_is_no_external_torque() -> None:
    """At 12 Hz; the motors are ahead of the links by the torque of the cables over their stiffness."""
    stiffness, rotor = [circuit.stiffness for circuit in ELASTIC.circuits], ELASTIC.motors.inertia[0]
    worst = {}
    for name, model in (("with", ELASTIC), ("without", WAM)):
        plant = RigidArm(changed(WAM, motors={"inertia": (1e-9,) * 4}), POSE, friction=0.0)
        observer, rows, stretch, speed = MomentumObserver(model, FREE, False), [], np.zeros(4), np.zeros(4)
        for k in range(300):
            drive = np.array([12.0, 16.0, 3.0, 4.0]) * math.cos(24.0 * math.pi * k * DT)
            cable = np.linalg.solve(DRIVE, drive + plant.gravity())
            plant.step(cable, NONE)
            before, stretch, last = stretch, cable / stiffness, speed
            speed = motor_from_joint(plant.data.qvel) + (stretch - before) / DT
            motor = cable + rotor * (speed - last) / DT
            angle = motor_from_joint(plant.data.qpos) + stretch
            assert observer.observe(State(angle.tolist(), speed.tolist(), motor.tolist()), DT)
            rows.append(observer.torques()[0])
        worst[name] = np.abs(rows[200:]).max(axis=0)
    assert np.all(worst["with"] < 0.3 * worst["without"])
    assert np.all(worst["without"] > 0.1)


@pytest.mark.slow
def test_coulomb_friction_has_the_sign_of_each_motor() -> None:
    """Joints 2 and 3 move together so that motor 2 runs fast and motor 3 hardly changes its way."""

    def torque(time: float) -> np.ndarray:
        return np.array([1.0, 1.5, 3.5, 1.0]) * (1.0 if time < 0.3 else -1.0)

    def by_joints(arm: Arm) -> Arm:
        """The same friction as if it were at the joints, signed by their velocities."""
        levels = np.abs(DRIVE) @ arm.motors.dynamic_friction
        moved = np.array(arm.joints.dynamic_friction) + levels
        none = (0.0,) * 4
        return dataclasses.replace(
            arm,
            motors=dataclasses.replace(arm.motors, static_friction=none, dynamic_friction=none),
            joints=dataclasses.replace(arm.joints, static_friction=tuple(moved), dynamic_friction=tuple(moved)),
        )

    typical = {}
    for name, arm in (("motors", WAM), ("joints", by_joints(WAM))):
        plant = RigidArm(WAM, POSE, friction=1.0)
        rows = swing(MomentumObserver(arm, EXACT, False), plant, 0.6, torque=lambda t: 1.5 * torque(t))
        typical[name] = np.median(np.abs(rows[100:]), axis=0)
    assert typical["motors"].max() < 0.1
    assert typical["joints"][1:3].max() > 0.5
    assert typical["joints"][[0, 3]].max() < 0.1  # which is why it looks fine


def test_joint_sensors_see_neither_friction_nor_rotors() -> None:
    push = torques(POSE, "outer_link", (0.28, 0, 0), (0, 0, 2))
    plant = RigidArm(WAM, POSE, friction=1.7)
    observer = MomentumObserver(WAM, EXACT, use_joint_sensors=True)
    still = swing(observer, plant, 0.3, external=lambda _: push, sensors=True, torque=lambda _: NONE)
    np.testing.assert_allclose(still[-1], push, atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("sensors", [False, True])
@pytest.mark.parametrize("friction", [0.84, 1.02])
def test_declared_uncertainty_covers_a_nominal_model_that_is_wrong(sensors: bool, friction: float) -> None:
    observer = MomentumObserver(WAM, NOMINAL, use_joint_sensors=sensors)
    plant = RigidArm(WAM, POSE, friction=friction)
    ratios = []
    for _ in range(8):
        rows = swing(observer, plant, 0.1, sensors=sensors)
        ratios.append(np.abs(rows[-1]) / np.sqrt(observer.torques()[1].diagonal()))
    assert np.max(ratios) < 4.0
    assert np.median(ratios) < 1.5


def test_lost_samples_are_bridged() -> None:
    plant, observer = RigidArm(WAM, POSE, friction=0.0), MomentumObserver(WAM, FREE, use_joint_sensors=True)
    swing(observer, plant, 0.3, sensors=True)
    for k in range(300, 304):
        plant.step(np.zeros(4), NONE)
        q, qd, tau = plant.sensors()
        assert observer.observe(State(q, qd, [math.nan] * 4 if k < 302 else tau), DT) == (k >= 302)
    assert np.abs(observer.torques()[0]).max() < 0.1


@pytest.mark.parametrize("sensors", [False, True])
def test_nothing_is_taken_from_a_gap_longer_than_the_time_constant(sensors: bool) -> None:
    """Nobody knows what acted in it; it would look like a push."""
    plant, observer = RigidArm(WAM, POSE, friction=0.0), MomentumObserver(WAM, FREE, use_joint_sensors=sensors)
    swing(observer, plant, 0.3, sensors=sensors)
    before = list(observer.torques()[0])
    angle, speed, tau = plant.sensors() if sensors else plant.motors(np.full(4, 0.1))
    assert observer.observe(State(angle, [each + 20.0 for each in speed], tau), 2.0 * FREE.time_constant)
    assert list(observer.torques()[0]) == before
    assert observer.observe(State(angle, speed, tau), 0.5 * FREE.time_constant)
    assert np.abs(np.subtract(observer.torques()[0], before)).max() > 1.0, "a short one is bridged"


def test_a_shaft_that_has_just_stopped_is_held_as_it_was_slowed_down_and_that_fades() -> None:
    own = dataclasses.replace(EXACT, time_constant=2e-3, friction_memory=0.1)
    joints = dataclasses.replace(WAM.joints, static_friction=(0.0,) * 4, dynamic_friction=(0.0,) * 4)
    observer = MomentumObserver(dataclasses.replace(WAM, joints=joints), own, use_joint_sensors=False)
    theta = motor_from_joint(np.array(POSE)).tolist()
    slow = 20.0 * own.motor_rest_velocity  # hardly any momentum
    friction = np.array(WAM.motors.dynamic_friction)
    carry = np.linalg.solve(DRIVE, RigidArm(WAM, POSE, friction=0.0).gravity())

    def errors(speed: float, torque: np.ndarray, samples: int) -> np.ndarray:
        for _ in range(samples):
            assert observer.observe(State(theta, [speed] * 4, (carry + torque).tolist()), DT)
        return np.linalg.solve(DRIVE, observer.torques()[0]) / friction  # at the motors, per friction

    errors(slow, friction, 500)  # beyond the longest presliding distance
    faded = math.exp(-0.02 / own.friction_memory)
    assert errors(0.0, friction, 20) == pytest.approx([-(1.0 - faded)] * 4, abs=0.05)
    assert errors(0.0, friction, 500) == pytest.approx([-1.0] * 4, abs=0.05), "long at rest, friction is unknown"


def test_nothing_counts_before_two_time_constants_have_passed() -> None:
    observer = MomentumObserver(WAM, EXACT, use_joint_sensors=False)
    state = State(motor_from_joint(np.array(POSE)).tolist(), [0.0] * 4, [0.1] * 4)
    samples = 0
    while not observer.is_ready:
        observer.observe(state, DT)
        samples += 1
    assert samples * DT == pytest.approx(2.0 * EXACT.time_constant, abs=1.5 * DT)


def test_motors_without_current_at_rest_give_no_estimate() -> None:
    """Brakes hold: without this the arm's own weight would look like a contact."""
    observer = MomentumObserver(WAM, EXACT, use_joint_sensors=False)
    theta = motor_from_joint(np.array(POSE)).tolist()
    for _ in range(100):
        assert observer.observe(State(theta, [1e-9] * 4, [0.0] * 4), DT)
    assert list(observer.torques()[0]) == [0.0] * 4
    assert not observer.is_ready


def test_mass_scale_of_another_arm_is_refused() -> None:
    wrong: ObserverParameters = dataclasses.replace(NOMINAL, mass_scale=(1.0,))
    with pytest.raises(ParameterError, match=r"mass_scale.*1 values; it needs 4"):
        MomentumObserver(WAM, wrong, use_joint_sensors=False)


@pytest.mark.slow
def test_errors_that_are_larger_than_stated_widen_what_is_published_and_detected() -> None:
    """The same signals with errors in free motion of three times the variance: so has every covariance of torques."""
    covariances = []
    for size in (1.0, 3.0):
        observer = MomentumObserver(WAM, dataclasses.replace(EXACT, detection_time=0.008), use_joint_sensors=False)
        swing(observer, RigidArm(WAM, POSE, friction=1.0), 0.1)
        observer._errors.size = size
        fast = observer.fast_torques()
        assert fast is not None
        covariances.append((observer.torques()[1], fast[1]))
    for stated, widened in zip(*covariances, strict=True):
        assert widened == pytest.approx(3.0 * stated)
        assert stated.diagonal().min() > 0.0
