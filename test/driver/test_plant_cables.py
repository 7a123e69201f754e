"""Cables, pulleys and motors of the plant against closed forms worked out here.

Nothing comes from wam_theory or from the matrices of the simulator; thesis numbers are in pounds and inches.
"""

import dataclasses
import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from arms import LINK_INERTIA, NOWHERE, WAM, changed, frictionless, one_joint

from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.effects import Effects, Ripples, no_effects
from wam_description.parameters import ParameterError
from wam_description.world import NO_SPRINGS, Springs, World
from wam_driver.plant import Plant

STEP = 5e-4
LB, INCH = 4.4482216152605, 0.0254
IN_LB = LB * INCH
WEIGHTLESS = (0.0, 0.0, 0.0)
TESTBED = frictionless(Configuration.load(Path(__file__).parents[2] / "config" / "testbed.yaml").shared.arm)
ROTOR, CABLE, N = 4.067e-5, 8.33, 14.0  # of one_joint(): rotor kg m^2, k_tr N m/rad
PINION, PRETENSION = 0.01, 300.0  # of one_joint(): m, N
THOUSANDTH = 1e-3  # what the issue asks of creep, loss, ripple and slack


def plant_of(arm: Arm, step: float = STEP, springs: Springs = NO_SPRINGS, **effects: Any) -> Plant:
    """An arm with its brakes off, and only the effects that are named."""
    made = Plant(arm, World(NOWHERE, springs), dataclasses.replace(no_effects(arm), **effects), step)
    made.brake(False)
    return made


def drive(plant: Plant, seconds: float, torque: list[float], step: float = STEP, together: int = 1) -> None:
    for _ in range(round(seconds / step / together)):
        plant.step(torque, together)


def strands(plant: Plant) -> list[tuple[float, float]]:
    """Tension of the tight and of the loose strand of each first stage, N."""
    pulls = plant.cable_pull
    each = zip(plant.tensions(pulls), pulls, plant._arm.circuits, strict=True)
    return [(tight, tight - pull / circuit.radius) for tight, pull, circuit in each]


def load(plant: Plant, torque: list[float]) -> None:
    """Torques of the world on the joints, N m, until the next call."""
    n = len(torque)
    plant.data.qfrc_applied[n:] = torque


def damped(arm: Arm, damping: float = 0.06, **joints: tuple[float, ...]) -> Arm:
    """One joint whose cable comes to rest quickly and carries its load without a weight."""
    return changed(arm, cables={"damping": (damping,)}, joints=joints, gravity=WEIGHTLESS)


# stiffness


@pytest.mark.parametrize(("arm", "expected"), [
    (TESTBED, [14443 * IN_LB]),  # lb in/rad at the joint, section 5.6
    # (A.5) with the assumed 34, 34, 34 and 11.8 N m/rad at the motors; both motors of the differential carry
    (WAM, [29.97**2 * 34.0, 2 * 30.4**2 * 34.0, 2 * 15.2**2 * 34.0, 19.15**2 * 11.8]),
], ids=["testbed", "wam"])  # fmt: skip
def test_braked_joint_gives_way_as_its_cables_in_series(arm: Arm, expected: list[float]) -> None:
    """Static, so only as exact as the printed numbers and the settling: 0.5 %."""
    soft = changed(frictionless(arm), gravity=WEIGHTLESS, cables={"damping": (0.06,) * len(expected)})
    for joint, stiffness in enumerate(expected):
        plant = plant_of(soft)
        plant.brake(True)
        torque = [0.0] * len(expected)
        torque[joint] = 2.0
        load(plant, torque)
        drive(plant, 2.0, [0.0] * len(expected))
        assert plant.q[joint] - soft.joints.start[joint] == pytest.approx(2.0 / stiffness, rel=5e-3)


def test_stages_are_in_series_and_parallel_circuits_carry_together() -> None:
    """With 2 EA r^2/L, 20 and 45 N m/rad; the second turns 3 times slower and has 4 circuits: 20 N m/rad."""
    arm = one_joint()
    stages: dict[str, Any] = {
        "stage_motors": ("motor1", "motor1"),
        "stage_ea": (2000.0, 1000.0),
        "stage_length": (2.0, 1.0),
        "stage_radius": (0.1, 0.15),
        "stage_circuits": (1.0, 4.0),
        "stage_ratio": (1.0, 3.0),
    }
    plant = plant_of(damped(changed(arm, cables=stages)))
    plant.brake(True)
    load(plant, [5.0])
    drive(plant, 3.0, [0.0])
    series = 1 / (1 / 20.0 + 1 / (4 * 45.0 / 3**2))
    assert plant.q[0] == pytest.approx(5.0 / (N**2 * series), rel=1e-6)  # settled


def test_cable_damping_lets_rotor_and_link_ring_out() -> None:
    """The closed form of a damped swing; 0.5 % of the start is twice the step's lead w h/2."""
    damping, step = 2e-3, 1e-5
    w = math.sqrt(CABLE * (1 / ROTOR + N**2 / LINK_INERTIA))
    zeta = damping * w / (2 * CABLE)
    plant = plant_of(damped(one_joint(), damping), step)
    plant.data.qpos[0] = 0.1
    time = np.arange(1, 5001) * step
    heard = []
    for _ in time:
        plant.step([0.0])
        heard.append((plant.theta[0] - N * plant.q[0]) / 0.1)
    wd = w * math.sqrt(1 - zeta**2)
    expected = np.exp(-zeta * w * time) * (np.cos(wd * time) + zeta / math.sqrt(1 - zeta**2) * np.sin(wd * time))
    np.testing.assert_allclose(heard, expected, atol=5e-3)
    assert abs(np.array(heard[-1400:])).max() == pytest.approx(math.exp(-zeta * w * 0.041), abs=0.02)  # 9 swings later


# slack


@pytest.mark.parametrize("pretension", [0.0, 5.0])
def test_arm_that_hangs_in_slack_cables_starts_at_rest(pretension: float) -> None:
    loose = changed(WAM, cables={"pretension": (pretension,) * 4})
    plant = plant_of(frictionless(loose, damping=1.0), slack=True)
    plant.brake(True)
    assert min(low for _, low in strands(plant)) == 0.0
    drive(plant, 0.5, [0.0] * 4)
    np.testing.assert_allclose(plant.q, WAM.joints.start, atol=1e-9)


# creep and loss


def efficiency(arm: Arm, creep: bool, way: float, torque: float) -> tuple[float, float]:
    """Power out over power in, and the torque at the motor over that of the load, at a slow and steady speed."""
    plant = plant_of(
        changed(arm, gravity=WEIGHTLESS, joints={"start": (-0.5 * way,), "lower": (-9.0,), "upper": (9.0,)}),
        creep=creep,
    )
    plant.brake(True)
    load(plant, [-N * torque])
    drive(plant, 2.0, [0.0])
    plant.brake(False)
    begin, speed = plant.theta[0], way * 6.0
    put_in = got_out = turned = 0.0
    for k in range(4000):
        time = (k + 1) * STEP
        goal = begin + speed * (time - 0.5 if time > 1.0 else 0.5 * time * time)
        before = plant.theta[0], plant.q[0]
        tau = torque + 5.0 * (goal - before[0]) + 0.02 * (speed * min(1.0, time) - plant.thetad[0])
        plant.step([tau])
        if time > 1.4:  # the jerk at 1 s has rung out
            put_in += tau * (plant.theta[0] - before[0])
            got_out += torque * N * (plant.q[0] - before[1])
            turned += plant.theta[0] - before[0]
    assert turned == pytest.approx(speed * 0.6, rel=0.01)
    return (got_out / put_in if put_in > 0.0 else put_in / got_out), put_in / (turned * torque)


SINGLE: dict[str, Any] = {
    "stage_motors": ("motor1",),
    "stage_ea": (9500 * LB,),
    "stage_length": (36.26 * INCH,),
    "stage_radius": (0.375 * INCH,),
    "stage_circuits": (1.0,),
    "stage_ratio": (1.0,),
    "damping": (0.06,),
}
FULL = 60 * IN_LB  # of the testbed's motor; 160 lb on its pinion of 0.375 in, EA = 9500 lb


@pytest.mark.slow
@pytest.mark.parametrize("reducer", ["joint", "motor"])
@pytest.mark.parametrize("way", [1.0, -1.0])  # -1: the load drives the motor
def test_efficiency_is_6_15_and_the_loss_is_counted_once(way: float, reducer: str) -> None:
    """All of the loss is speed: the torque at the motor is that of the load, whichever way it turns.

    0.01 % for what still rings from the start.
    """
    two = changed(TESTBED, cables={"damping": (0.06,)})
    one = changed(TESTBED, cables=SINGLE | {"reducer": (reducer,)})
    for arm, expected in ((two, (1 - 160 / 9500) ** 2), (one, 1 - 160 / 9500)):
        found, ratio = efficiency(arm, True, way, FULL)
        assert found == pytest.approx(expected, rel=THOUSANDTH)
        assert ratio == pytest.approx(1.0, abs=1e-4)
        lossless, ratio = efficiency(arm, False, way, FULL)
        assert lossless == pytest.approx(1.0, abs=1e-4)
        assert ratio == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("joint", range(4))
def test_every_circuit_of_the_arm_loses_what_two_equal_stages_lose(joint: int) -> None:
    """Both stages of a circuit have the stress of the first: 2 tau/(r EA) of the speed."""
    assert WAM.circuits[joint].loss_per_torque == pytest.approx(2 / (0.375 * INCH * 9500 * LB), rel=1e-5)


def test_differential_of_three_stages_loses_less_than_four_percent_on_the_stepped_plant() -> None:
    """7.2.2: joint 2 is turned against a load by both motors of the differential, by pounds and inches of 7.2.2."""
    arm = frictionless(Configuration.load(packaged("thesis-effects")).shared.arm, damping=1.0)
    arm = changed(
        arm,
        motors={"inertia": (1e9,) * 4},  # the rotors turn as they are told
        joints={"start": (0.0, -2.0, 0.0, 0.0), "lower": (-9.0,) * 4, "upper": (9.0,) * 4},
        gravity=WEIGHTLESS,
    )
    plant, speed, at_motor = plant_of(arm, creep=True), 0.5, 3.0  # rad/s of joint 2 without loss, N m
    load(plant, [0.0, -2 * 30.4 * at_motor, 0.0, 0.0])
    plant.data.qvel[:8] = (0.0, -30.4 * speed, 30.4 * speed, 0.0, 0.0, speed, 0.0, 0.0)
    drive(plant, 1.5, [0.0] * 4)
    q, theta = plant.q[1], plant.theta[2]
    drive(plant, 1.0, [0.0] * 4)
    lost = 1.0 - 30.4 * (plant.q[1] - q) / (plant.theta[2] - theta)
    pounds = at_motor / (0.375 * INCH) / LB
    assert lost == pytest.approx(2 * pounds / 9500 + 30.4 * pounds * 0.375 / 2.5 / 51_500, rel=0.01)
    assert lost * 43 * IN_LB / at_motor < 0.04


def test_pretension_reaches_the_second_stage_in_proportion_to_its_cables() -> None:
    """7.2.2, figure 7.8: a pulley and pinion for each strand multiply the tension by their radii, E A with it."""
    first, second = WAM.cables.stage_ea[0::2], WAM.cables.stage_ea[1::2]
    for motor in range(4):
        n = WAM.cables.stage_ratio[2 * motor + 1]
        propagated = n * WAM.cables.pretension[motor]
        # each half of the shaft between the stages is in balance: T_1 times the pulley is T_2 times the pinion
        pulley, pinion = n * WAM.cables.stage_radius[2 * motor], WAM.cables.stage_radius[2 * motor + 1]
        assert propagated * pinion == pytest.approx(WAM.cables.pretension[motor] * pulley)
        assert propagated / second[motor] == pytest.approx(WAM.cables.pretension[motor] / first[motor], rel=1e-5)
        # so that both stages slacken at the same torque of the motor, as the plant's one circuit does
        assert 2 * propagated * pinion / n == pytest.approx(2 * 57.0 * LB * WAM.circuits[motor].radius, rel=1e-4)


def test_looped_back_cable_shares_the_load_that_two_cables_of_unequal_length_do_not() -> None:
    """7.2.2: MuJoCo's tendons on one drum; one cable over a free pulley against two cables of their own."""
    stiffness, mismatch, tension = 4e4, 2e-3, 300.0  # N/m, m, N
    for looped in (False, True):
        model = mujoco.MjModel.from_xml_string(
            f"""<mujoco><option gravity="0 0 0" timestep="1e-3"><flag contact="disable"/></option><worldbody>
            <body><joint name="drum" type="slide" axis="1 0 0" damping="2e3"/><geom size="0.1" mass="1"/></body>
            <body><joint name="yoke" type="hinge" axis="0 0 1" damping="2e2"/><geom size="0.1" mass="1"/></body>
            </worldbody><tendon>
            <fixed name="a" stiffness="{stiffness}" springlength="{-mismatch}">
              <joint joint="drum" coef="1"/>{'<joint joint="yoke" coef="1"/>' * looped}</fixed>
            <fixed name="b" stiffness="{stiffness}" springlength="0">
              <joint joint="drum" coef="1"/>{'<joint joint="yoke" coef="-1"/>' * looped}</fixed>
            </tendon></mujoco>"""
        )
        data = mujoco.MjData(model)
        data.qfrc_applied[0] = 2 * tension
        for _ in range(4000):
            mujoco.mj_step(model, data)
        pulls = stiffness * (data.ten_length - model.tendon_lengthspring[:, 0])
        assert pulls.sum() == pytest.approx(2 * tension, rel=1e-3)
        expected = 0.0 if looped else stiffness * mismatch
        assert pulls[0] - pulls[1] == pytest.approx(expected, abs=0.1)


# ripple and cogging


def shaft_torque(plant: Plant, dof: int, inertia: float, angles: np.ndarray) -> np.ndarray:
    """Torque on a shaft at rest at each angle, by its acceleration; the other shaft is moved along."""
    found = []
    for angle in angles:
        plant.data.qpos[:] = (angle, angle / N) if dof == 0 else (N * angle, angle)
        plant.data.qvel[:] = 0.0
        plant.step([0.0])
        found.append(plant.data.qvel[dof] / STEP * inertia)
    return np.array(found)


@pytest.mark.parametrize(("shaft", "dof", "inertia", "ratio", "cycles"), [
    ("motor1", 0, ROTOR, 1.0, 24),  # cogging
    ("motor1", 0, ROTOR, 0.2586, 1),  # an eccentric pulley geared down from the motor, 0.75 in on 2.9 in
    ("joint1", 1, LINK_INERTIA, 1.0, 1),  # the driven pulley itself
    ("joint1", 1, LINK_INERTIA, -3.867, 2),  # one that turns the other way, faster than the joint
])  # fmt: skip
def test_ripple_of_a_pulley_has_its_amplitude_its_cycles_and_its_phase(
    shaft: str, dof: int, inertia: float, ratio: float, cycles: int
) -> None:
    """(6.23): 0.010 in under 50 lb make 1 in lb at the pulley, `ratio` times as much on the shaft."""
    amplitude, phase = 2 * (0.010 * INCH) * (50 * LB), 0.7
    plant = plant_of(
        changed(one_joint(), joints={"lower": (-9.0,), "upper": (9.0,)}),
        ripples=Ripples((shaft,), (ratio,), (amplitude,), (cycles,), (phase,)),
    )
    turn_of_shaft = 2 * math.pi / (abs(ratio) * cycles)
    angles = np.arange(48) / 48 * turn_of_shaft
    found = shaft_torque(plant, dof, inertia, angles)
    expected = ratio * 1.0 * IN_LB * np.sin(cycles * ratio * angles + phase)
    np.testing.assert_allclose(found, expected, atol=THOUSANDTH * abs(ratio) * IN_LB)
    first = 2 / 48 * np.abs(np.sum(found * np.exp(-2j * np.pi * np.arange(48) / 48)))
    assert first / abs(ratio) / IN_LB == pytest.approx(1.0, rel=THOUSANDTH)


def test_ripples_on_one_shaft_add_up() -> None:
    ripples = Ripples(("motor1", "joint1", "motor1"), (1.0, 1.0, 0.5), (0.1, 5.0, 0.2), (24, 1, 3), (0.0, 0.0, 0.4))
    angles = np.linspace(-3.0, 3.0, 40)
    found = shaft_torque(plant_of(one_joint(), ripples=ripples), 0, ROTOR, angles)
    expected = 0.1 * np.sin(24 * angles) + 0.5 * 0.2 * np.sin(3 * 0.5 * angles + 0.4)
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_cogging_holds_a_rotor_below_its_amplitude_and_lets_it_go_above() -> None:
    ripples = Ripples(("motor1",), (1.0,), (0.1,), (4,), (math.pi,))  # a detent at angle zero
    for share, holds in ((0.9, True), (1.1, False)):
        plant = plant_of(damped(one_joint(), 0.02), ripples=ripples)
        for k in range(4000):
            plant.step([0.1 * share * min(1.0, k / 3000)])
        assert (abs(plant.theta[0]) < math.pi / 8) is holds


# friction that grows with tension


BASE, COEFFICIENT = 0.02, 5e-5  # N m, N m/N


def gripping(pretension: float, slack: bool = True) -> Plant:
    base = {"static_friction": (BASE,), "dynamic_friction": (BASE / 2,)}
    arm = changed(damped(one_joint(), 0.02), cables={"pretension": (pretension,)}, motors=base)
    return plant_of(arm, slack=slack, tension_friction=(COEFFICIENT,))


TENSIONS = [
    (300.0, 0.0, True),
    (300.0, 5.0, True),
    (300.0, -5.0, True),
    (20.0, 0.3, True),
    (20.0, 0.6, True),  # slack from 0.4 N m on
    (20.0, 2.0, True),
    (20.0, -5.0, True),
    (20.0, 5.0, False),
]


def gripping_under_load(pretension: float, torque: float, slack: bool) -> Plant:
    """At rest under a load that the motor carries with `torque`, brakes released just now."""
    plant = gripping(pretension, slack)
    plant.brake(True)
    load(plant, [-N * torque])
    drive(plant, 5.0, [torque])
    plant.brake(False)
    return plant


@pytest.mark.slow
@pytest.mark.parametrize(("pretension", "torque", "slack"), TENSIONS)
def test_rotor_breaks_away_at_a_friction_in_proportion_to_both_tensions(
    pretension: float, torque: float, slack: bool
) -> None:
    """Constant until a strand is slack, then growing; 0.1 %: the torque rises by 0.01 % a step."""
    plant = gripping_under_load(pretension, torque, slack)
    drive(plant, 0.1, [torque])
    both = max(2.0 * pretension, slack * abs(torque) / PINION)  # of the tensions
    expected = BASE + COEFFICIENT * both
    way = math.copysign(1.0, torque)
    excess, begin = 0.95 * expected, plant.theta[0]
    while abs(plant.theta[0] - begin) < 1e-7:
        excess += 1e-4 * expected
        assert excess < 1.1 * expected
        plant.step([torque + way * excess])
    assert excess == pytest.approx(expected, rel=THOUSANDTH)


@pytest.mark.slow
def test_parallel_circuits_of_the_first_stage_share_its_tension() -> None:
    """2 N m on 10 mm are 200 N for one cable, 100 N each for two; slack from 2 x 300 N x 10 mm x 2 on."""
    for circuits, difference in ((1.0, 200.0), (2.0, 100.0)):
        plant = plant_of(changed(damped(one_joint()), cables={"stage_circuits": (circuits,)}), slack=True)
        plant.brake(True)
        load(plant, [2.0 * N])
        drive(plant, 2.0, [0.0])
        np.testing.assert_allclose(strands(plant)[0], (300 + difference / 2, 300 - difference / 2), rtol=1e-6)
        assert plant.q[0] * N == pytest.approx(2.0 / (CABLE * circuits), rel=1e-6)
        load(plant, [9.0 * N])
        drive(plant, 2.0, [0.0])
        assert (min(strands(plant)[0]) == 0.0) is (circuits == 1.0)


# active pretension


@pytest.mark.parametrize("share", [0.3, 1.5])
def test_cables_tightened_to_a_share_are_those_of_an_arm_with_that_pretension(share: float) -> None:
    """6.5: slack, friction by tension and tensions, to the bit, also after a reset; at first with other cables."""
    arm = damped(one_joint())
    less = changed(arm, cables={"pretension": (share * PRETENSION,)})
    effects = {"slack": True, "tension_friction": (1e-4,), "creep": True}
    live, expected = plant_of(arm, **effects), plant_of(less, **effects)
    live.set_pretension([share])
    for _ in range(2):
        found = []
        for plant in (live, expected):
            load(plant, [-60.0])
            torque = [2.4 * PRETENSION * share * PINION]  # enough for a slack strand
            values = []
            for _ in range(400):
                plant.step(torque)
                values += [*plant.theta, *plant.q, *sum(strands(plant), ())]
            found.append(values)
            plant.reset()
            plant.brake(False)
        np.testing.assert_allclose(found[0], found[1], rtol=1e-12, atol=1e-12)
        assert min(found[0][3::4]) == 0.0


@pytest.mark.parametrize("slack", [True, False])
@pytest.mark.parametrize("shares", [[-1.0], [math.nan], [math.inf], [], [0.5, 0.5]])
def test_a_pretension_that_is_refused_changes_nothing(shares: list[float], slack: bool) -> None:
    plant = plant_of(damped(one_joint()), slack=slack, tension_friction=(1e-4,), creep=True)
    plant.set_pretension([0.5])
    before = repr((strands(plant), plant.data.plastic.tolist(), plant._friction.levels, plant._circuits.each))
    with pytest.raises(ValueError, match=r"effects.pretension_share is .*; give one for all or one for each of 1 c"):
        plant.set_pretension(shares)
    plant.set_pretension([0.5])
    after = repr((strands(plant), plant.data.plastic.tolist(), plant._friction.levels, plant._circuits.each))
    assert after == before


@pytest.mark.slow
def test_active_pretension_lowers_the_least_force_and_a_large_one_needs_it_back() -> None:
    """6.5: a delicate task with a fifth of the pretension, a strong one with all of it, on one plant."""
    arm = damped(one_joint())
    plant, coefficient = plant_of(arm, slack=True, tension_friction=(1e-3,)), 1e-3
    for share in (1.0, 0.2, 1.0):
        plant.reset()
        plant.brake(False)
        plant.set_pretension([share])
        friction = coefficient * 2 * PRETENSION * share
        for torque, moves in ((0.98 * friction, False), (1.02 * friction, True)):
            plant.reset()
            plant.brake(False)
            drive(plant, 0.05, [torque])
            assert (abs(plant.theta[0]) > 1e-7) == moves
        plant.brake(True)
        load(plant, [-N * 3.0])  # 3 N m at the motor: half of it is the loose strand's
        drive(plant, 2.0, [0.0])
        slack = 2 * PRETENSION * share * PINION
        expected = 3.0 / CABLE if slack > 3.0 else (2 * 3.0 - slack) / CABLE
        assert abs(plant.theta[0] - N * plant.q[0]) == pytest.approx(expected, rel=2e-2)


# all together


EVERYTHING = Effects(
    ripples=Ripples(("motor1", "motor4", "joint2"), (1.0, 0.26, 5.5), (0.02, 0.1, 0.1), (24, 1, 1), (0.0, 0.5, 1.0)),
    creep=True,
    slack=True,
    backlash=(0.0, 0.0, 0.0, 0.02),
    pretension_share=(0.8,),
    tension_friction=(1e-5,) * 4,
    included_in_friction=True,
    added_coulomb_friction=(0.05,) * 4,
    terminated=True,
)


def story(plant: Plant) -> list[float]:
    """A motion with every effect on; every number on its way."""
    values: list[float] = []
    for k in range(2000):
        plant.brake(k < 50 or 1200 < k < 1300)
        if k == 600:
            plant.push("outer_link", np.array([0.0, 6.0, 30.0]), np.array([0.1, 0.0, 0.5]))
        plant.step([0.6, 0.5 * math.sin(k / 50), -0.5, 0.4])
        values += [*plant.theta, *plant.q, *plant.qd, *plant.strain_torque, *sum(strands(plant), ())]
    return values


@pytest.mark.slow
def test_plants_with_every_effect_are_equal_bit_for_bit_and_reset_undoes_creep() -> None:
    arm = changed(WAM, cables={"pretension": (20.0,) * 4})
    first = Plant(arm, World(NOWHERE, NO_SPRINGS), EVERYTHING, STEP)
    first_story = story(first)
    assert 0.0 in first_story  # a strand was slack
    assert first_story == story(Plant(arm, World(NOWHERE, NO_SPRINGS), EVERYTHING, STEP))
    first.reset()
    assert first_story == story(first)
    first.release()
    assert first_story != story(first)


def test_a_pretension_without_room_for_the_load_is_refused_by_name() -> None:
    arm = Configuration.load(packaged("wam")).shared.arm
    fine = dataclasses.replace(no_effects(arm), pretension_share=(1.9,))
    fine.require_fit(arm)
    for shares in ((2.0,), (1.0, 1.0, 7.0, 1.0)):
        with pytest.raises(ParameterError, match=r"pretension_share of motor\d is .*; allowed: up to 1.98"):
            dataclasses.replace(fine, pretension_share=shares).require_fit(arm)
