"""Laws of dry friction in the stepped plant against their curves: velocity, breakaway, hysteresis, energy."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from arms import CONFIGURATION, NOWHERE, WAM, changed, frictionless, one_joint
from contact_truth import torques

from wam_description.arm import Arm
from wam_description.effects import no_effects
from wam_description.mismatch import true_arm
from wam_description.parameters import ParameterError
from wam_description.rigid_body import RigidBody
from wam_description.world import NO_SPRINGS, World
from wam_driver.driver import DriverParameters
from wam_driver.friction import COULOMB_STICTION, FrictionParameters
from wam_driver.plant import Plant

STEP = 5e-4
RATIO = 14.0
STATIC, DYNAMIC = 1.0, 0.6  # N m, at the joint
MOTOR = 0.05  # N m, static and dynamic, at the motor
V_S = 0.05  # rad/s
SIGMA = 50.0  # N m/rad


def law(name: str = "coulomb_stiction", **values: Any) -> FrictionParameters:
    return dataclasses.replace(COULOMB_STICTION, law=name, **values)


STRIBECK = law("stribeck", motor_stribeck_velocity=(V_S,), joint_stribeck_velocity=(V_S,))
EVERY_LAW = {
    "coulomb": law(),
    "stribeck": STRIBECK,
    "asymmetric": law(motor_asymmetry=(0.3,), joint_asymmetry=(0.3,)),
    "load": law(motor_load_factor=(0.2,), joint_load_factor=(0.2,)),
    "presliding": law(motor_presliding_stiffness=(SIGMA,), joint_presliding_stiffness=(400.0,)),
    "all at once": dataclasses.replace(
        STRIBECK,
        motor_asymmetry=(-0.2,),
        joint_asymmetry=(0.3,),
        motor_load_factor=(0.1,),
        joint_load_factor=(0.1,),
        motor_presliding_stiffness=(SIGMA,),
        joint_presliding_stiffness=(400.0,),
    ),
}


def with_friction(motor: float = 0.0, joint: tuple[float, float] = (0.0, 0.0), **motors: tuple[float, ...]) -> Arm:
    """The one-joint arm with friction and a damped cable."""
    return changed(
        one_joint(RATIO),
        motors={"static_friction": (motor,), "dynamic_friction": (motor,), **motors},
        joints={"static_friction": (joint[0],), "dynamic_friction": (joint[1],), "lower": (-1e3,), "upper": (1e3,)},
        cables={"damping": (0.05,)},
    )


def released(arm: Arm, friction: FrictionParameters, added: float = 0.0, step: float = STEP) -> Plant:
    effects = dataclasses.replace(no_effects(arm), added_coulomb_friction=(added,) * arm.n)
    plant = Plant(arm, World(NOWHERE, NO_SPRINGS), effects, step, friction)
    plant.brake(False)
    return plant


def run(plant: Plant, seconds: float, torque: float = 0.0, step: float = STEP) -> None:
    for _ in range(round(seconds / step)):
        plant.step([torque])


def joint_friction_at(
    velocity: float, friction: FrictionParameters, added: float = 0.0, arm: Arm | None = None
) -> float:
    """Torque that keeps the link at a velocity, N m: what the cable transmits behind a rotor that nothing slows."""
    base = arm or with_friction(joint=(STATIC, DYNAMIC))
    plant = released(changed(base, motors={"inertia": (1e9,)}, cables={"damping": (2.0,)}), friction, added)
    plant.data.qvel[:] = (RATIO * velocity, velocity)
    run(plant, 4.0)
    assert plant.qd[0] == pytest.approx(velocity, rel=1e-6)
    return plant.cable_torque[0]


def breakaway(friction: FrictionParameters, direction: int, arm: Arm) -> float:
    """Motor torque at which the rotor leaves, N m, ramped up from zero."""
    plant = released(arm, friction)
    torque = 0.0
    while abs(plant.theta[0]) < 0.02:
        torque += direction * 1e-6
        plant.step([torque])
    return torque


# over velocity


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [0.005, -0.05, 0.3])
@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_stribeck_friction_falls_from_static_to_dynamic_over_the_velocity(velocity: float, exponent: float) -> None:
    curve = DYNAMIC + (STATIC - DYNAMIC) * math.exp(-((abs(velocity) / V_S) ** exponent))
    measured = joint_friction_at(velocity, dataclasses.replace(STRIBECK, stribeck_exponent=exponent))
    assert measured == pytest.approx(math.copysign(curve, velocity), rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY_LAW)
def test_breakaway_of_every_law_is_at_static_friction(name: str) -> None:
    friction = EVERY_LAW[name]
    # an elastic shaft moves before it slides, which coulomb_stiction takes for motion
    expected = 0.6 * MOTOR if name == "presliding" else MOTOR * (1.0 + friction.motor_asymmetry[0])
    arm = changed(with_friction(MOTOR), motors={"dynamic_friction": (0.6 * MOTOR,)})
    assert breakaway(friction, 1, arm) == pytest.approx(expected, rel=0.04)  # some steps to be seen moving


# over direction


@pytest.mark.slow
def test_asymmetric_friction_differs_by_its_ratio_in_motion_and_at_breakaway() -> None:
    lean = law(motor_asymmetry=(0.25,), joint_asymmetry=(-0.25,))
    moving = [joint_friction_at(v, lean) for v in (0.1, -0.1)]
    assert moving == pytest.approx([0.75 * DYNAMIC, -1.25 * DYNAMIC], rel=1e-4)
    leaving = [breakaway(lean, way, with_friction(MOTOR)) for way in (1, -1)]
    assert leaving[0] / -leaving[1] == pytest.approx(1.25 / 0.75, rel=0.02)
    assert leaving[0] == pytest.approx(1.25 * MOTOR, rel=0.02)


# over load


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.0, 0.2])
def test_a_loaded_motor_needs_the_load_and_its_friction_to_lift_and_less_to_lower(factor: float) -> None:
    weight = 2.0  # N m at the joint, by a push on the link
    friction = law(motor_load_factor=(factor,))
    limits = []
    for way in (1, -1):
        plant = released(with_friction(MOTOR), friction)
        plant.push("tube", np.zeros(3), np.array([0.0, 0.0, -weight]))
        torque = weight / RATIO
        run(plant, 2.0, torque)
        start = plant.theta[0]
        while abs(plant.theta[0] - start) < 1e-3:
            torque += way * 4e-6
            plant.step([torque])
        limits.append(torque)
    expected = MOTOR + factor * weight / RATIO
    assert limits == pytest.approx([weight / RATIO + expected, weight / RATIO - expected], abs=0.04 * expected)


def test_a_loaded_joint_rubs_in_proportion_to_what_its_cable_carries() -> None:
    factor, push = 0.2, 3.0
    plant = released(with_friction(joint=(DYNAMIC, DYNAMIC)), law(joint_load_factor=(factor,)))
    plant.brake(True)
    for k in range(8000):
        plant.push("tube", np.zeros(3), np.array([0.0, 0.0, push * min(1.0, k / 6000)]))
        plant.step([0.0])
    assert -plant.cable_torque[0] == pytest.approx((push - DYNAMIC) / (1.0 + factor), rel=5e-3)


# before sliding


def quasi_static(peak: float, cycles: int, sigma: float = SIGMA) -> tuple[np.ndarray, np.ndarray]:
    """Angle of the rotor and slowly cycled motor torque, for each step; viscous friction takes what would ring."""
    plant = released(with_friction(MOTOR, viscous_friction=(0.05,)), law(motor_presliding_stiffness=(sigma,)))
    steps = round(8.0 / STEP)
    torque = peak * np.sin(2.0 * math.pi * np.arange(steps * cycles) / steps)
    angle = []
    for tau in torque:
        angle.append(plant.theta[0])
        plant.step([tau])
    return np.array(angle), torque


@pytest.mark.parametrize("sigma", [20.0, SIGMA])
def test_presliding_begins_with_its_stiffness_and_yields_as_dahl_has_it(sigma: float) -> None:
    angle, torque = quasi_static(0.8 * MOTOR, 1, sigma)
    quarter = round(2.0 / STEP)
    for share in (0.05, 0.3, 0.6, 0.79):
        k = int(np.searchsorted(torque[:quarter], share * MOTOR))
        assert angle[k] == pytest.approx(-MOTOR / sigma * math.log(1.0 - torque[k] / MOTOR), rel=0.03)


@pytest.mark.slow
def test_hysteresis_loop_has_the_width_and_the_area_of_dahl() -> None:
    peak = 0.8 * MOTOR
    angle, torque = quasi_static(peak, 3)
    turn = round(8.0 / STEP)
    loop, tau = angle[-turn:], torque[-turn:]
    width = MOTOR / SIGMA * math.log((MOTOR + peak) / (MOTOR - peak))
    assert np.ptp(loop) == pytest.approx(width, rel=0.01)
    area = float(np.sum(0.5 * (tau[1:] + tau[:-1]) * np.diff(loop)))
    assert area == pytest.approx(2.0 * (MOTOR * width - 2.0 * peak * MOTOR / SIGMA), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["presliding", "all at once"])
def test_a_load_below_static_friction_is_held_without_creep(name: str) -> None:
    plant = released(with_friction(MOTOR, (STATIC, DYNAMIC)), EVERY_LAW[name])
    run(plant, 5.0, 0.7 * MOTOR)
    before = plant.theta[0], plant.q[0]
    run(plant, 10.0, 0.7 * MOTOR)
    assert (plant.theta[0], plant.q[0]) == pytest.approx(before, abs=1e-8)


def test_reset_forgets_the_elastic_displacement() -> None:
    def story(plant: Plant) -> list[float]:
        heard = []
        for k in range(400):
            plant.step([0.08 * math.sin(0.05 * k)])
            heard += [plant.theta[0], plant.q[0]]
        return heard

    plant = released(with_friction(MOTOR, (STATIC, DYNAMIC)), EVERY_LAW["all at once"])
    first = story(plant)
    plant.reset()
    plant.brake(False)
    assert story(plant) == first


def test_strain_gauges_read_the_elastic_friction_too() -> None:
    plant = Plant(
        changed(
            WAM,
            joints={"static_friction": (40.0,) * 4, "dynamic_friction": (40.0,) * 4, "viscous_friction": (9.0,) * 4},
        ),
        World(NOWHERE, NO_SPRINGS),
        no_effects(WAM),
        STEP,
        law(joint_presliding_stiffness=(500.0,)),
    )
    force, at = np.array([0.0, 6.0, 9.0]), np.array([0.3, 0.0, 0.0])
    plant.push("outer_link", force, np.cross(at, force))
    for _ in range(4000):
        plant.step([0.0] * 4)
    external = torques(plant.q, "outer_link", tuple(at), tuple(force))
    needed = RigidBody(WAM).gravity_torque(plant.q) - external
    np.testing.assert_allclose(plant.strain_torque, needed, atol=2e-3)
    assert np.abs(np.subtract(plant.cable_torque, needed)).max() > 0.1  # friction carries a part


def test_a_presliding_stiffness_that_the_step_cannot_follow_is_refused() -> None:
    arm = with_friction(MOTOR)
    with pytest.raises(ParameterError, match="motor1: its presliding stiffness in 'friction' is 1000 N m/rad"):
        released(arm, law(motor_presliding_stiffness=(1000.0,)))
    released(arm, law(motor_presliding_stiffness=(1000.0,)), step=1e-4)


# energy


@pytest.mark.slow
@pytest.mark.parametrize("name", ["presliding", "all at once"])
def test_friction_never_gives_energy(name: str) -> None:
    """Random torques; the work of the motor less what is stored in rotor, link and cable is what friction took."""
    arm = dataclasses.replace(
        with_friction(MOTOR, (STATIC, DYNAMIC)), cables=dataclasses.replace(one_joint(RATIO).cables, damping=(0.0,))
    )
    step = 1e-4
    plant = released(arm, EVERY_LAW[name], step=step)
    random = np.random.default_rng(5)
    work, taken = 0.0, []
    for k in range(20_000):
        if k % 200 == 0:
            torque = random.uniform(-0.25, 0.25)
        speed = plant.thetad[0]
        plant.step([torque])
        work += torque * plant.thetad[0] * step
        stretch = plant.theta[0] - RATIO * plant.q[0]
        stored = 0.5 * (4.067e-5 * plant.thetad[0] ** 2 + 0.45 * plant.qd[0] ** 2 + 8.33 * stretch**2)
        taken.append(work - stored)
        assert math.isfinite(speed)
    lost = np.array(taken)
    assert lost[-1] > 0.1  # J, much sliding
    # elastic friction stores F^2 / (2 sigma) at most, and gives it back
    allowed = 0.02 * lost[-1] + (3e-5 if EVERY_LAW[name].motor_presliding_stiffness[0] else 0.0)
    assert (np.maximum.accumulate(lost) - lost).max() < allowed


# with everything else


@pytest.mark.slow
@pytest.mark.parametrize("name", ["presliding", "all at once"])
def test_mismatch_scales_and_added_friction_adds_under_every_law(name: str) -> None:
    friction, velocity = EVERY_LAW[name], 0.1
    parameters = CONFIGURATION.node("driver", DriverParameters).mismatch
    double = dataclasses.replace(
        parameters, mass=(1.0,), motor_friction=(1.0,), joint_friction=(2.0,), stiffness=(1.0,), torque_constant=(1.0,)
    )
    plain = joint_friction_at(velocity, friction)
    arm = with_friction(joint=(STATIC, DYNAMIC))
    assert joint_friction_at(velocity, friction, arm=true_arm(arm, double)) == pytest.approx(2.0 * plain, rel=1e-3)
    lean = friction.joint_load_factor[0] * (1.0 + friction.joint_asymmetry[0])  # what is added loads the cable too
    assert joint_friction_at(velocity, friction, 0.3) - plain == pytest.approx(0.3 / (1.0 - lean), rel=1e-3)


def test_one_value_counts_for_all_and_a_wrong_number_is_refused() -> None:
    arm = frictionless(WAM)
    four = released(changed(arm, gravity=(0.0, 0.0, 0.0)), law(motor_asymmetry=(0.1,) * 4))
    assert four.theta == released(changed(arm, gravity=(0.0, 0.0, 0.0)), law(motor_asymmetry=(0.1,))).theta
    with pytest.raises(ParameterError, match=r"friction\.motor_asymmetry' has 2 values; it needs 1 or 4"):
        released(arm, law(motor_asymmetry=(0.1, 0.2)))
