"""Curves of the plant's effects, measured on the simulated plant and computed from theory.

One link on one motor, the testbed of section 5.6 with one effect at a time.  A motor that must turn at a given speed
has a rotor of practically infinite inertia.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from wam_analysis.measures.limit_cycle import mean_cycle
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.effects import Ripples, no_effects
from wam_description.world import NO_SPRINGS, Obstacles, Springs, World
from wam_driver.amplifier import Amplifier
from wam_driver.driver import DriverParameters
from wam_driver.friction import COULOMB_STICTION
from wam_driver.plant import Plant
from wam_studies.plant.force_response import force_step
from wam_studies.plant.ideal_testbed import (
    EMPTY,
    IMMOVABLE,
    LEVER,
    NOTHING,
    STEP,
    Numbers,
    against_spring,
    breakaway,
    crept,
    frequencies,
    ideal_testbed,
    limiting_efficiency,
    link_inertia,
    power_ratio,
    released_plant,
)
from wam_theory.backlash_cycle import GearedTorqueLoop, exact_cycle
from wam_theory.cable import circuit_torque, eccentric_ripple, play_torque
from wam_theory.friction_model import IntegralLoop
from wam_theory.stick_slip import simulate
from wam_theory.tension_element import coulomb_like_torque

CRITICAL = 0.8  # part of the stiffness at which the torque loop is marginal
RUN_STEP = 5e-4  # s, that users run
TURNS, FINE = 40, 1000  # cycles of the torque loop, and steps of each, so that it has practically no delay


class PlantCurve(NamedTuple):
    """Plant and theory over x."""

    x: Numbers
    plant: Numbers
    theory: Numbers

    @property
    def error(self) -> float:
        """Greatest difference over the greatest theoretical value."""
        return float(np.abs(self.plant - self.theory).max() / np.abs(self.theory).max())


def _curve(x: Numbers, plant: Callable[[float], float], theory: ArrayLike) -> PlantCurve:
    """What the plant does at each x, next to theory."""
    return PlantCurve(x, np.array([plant(value) for value in x.tolist()]), np.asarray(theory))


def level(plant: float, theory: float) -> PlantCurve:
    """A single number."""
    return PlantCurve(np.zeros(1), np.array([plant]), np.array([theory]))


def _run(plant: Plant, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        plant.step([0.0])


def slack() -> PlantCurve:
    """Torque of a circuit over its stretch, rad and N m, beyond the slack of the loose strand."""
    (circuit,) = ideal_testbed().circuits
    stretch = np.linspace(-2.5, 2.5, 101) * circuit.slack_stretch
    theory = circuit_torque(stretch, circuit.stiffness, circuit.pretension, circuit.radius)
    return _curve(stretch, _stretched(slack=True), theory)


def backlash() -> PlantCurve:
    """Torque of a circuit with backlash over its stretch, rad and N m."""
    play = 0.04
    stretch = np.linspace(-2.5, 2.5, 101) * play
    theory = play_torque(stretch, ideal_testbed().circuits[0].stiffness, play)
    return _curve(stretch, _stretched(backlash=(play,)), theory)


def _stretched(**effects: Any) -> Callable[[float], float]:
    """Torque of the circuit of a plant with these effects, N m, over its stretch, its link at rest."""
    plant = released_plant(ideal_testbed(), **effects)

    def torque(stretch: float) -> float:
        plant.data.qpos[:] = (stretch, 0.0)
        mujoco.mj_forward(plant.model, plant.data)
        return plant.circuit_torque[0]

    return torque


def creep_out_and_back(seconds: float = 10.0, rounds: int = 1, terminated: bool = False) -> PlantCurve:
    """Creep of the link while the motor turns out and back at 1 rad/s under a load of 40 N m at the joint.

    Parameters
    ----------
    seconds : in each direction.
    rounds : out and back.
    terminated : whether the cables end on both pulleys; the theory is that of cables without ends.

    Returns
    -------
    PlantCurve
        over the motor's absolute travel, rad; angles at the joint, rad.
    """
    torque = 40.0
    plant = _loaded(torque, terminated)
    rest = plant.q[0] - plant.theta[0] / 14.0
    travel, found, done = [], [], 0.0
    for direction in (1.0, -1.0) * rounds:
        plant.data.qvel[:] = (direction, direction / 14.0)
        for _ in range(round(seconds / STEP / 40)):
            before = plant.theta[0]
            _run(plant, 40 * STEP)
            done += abs(plant.theta[0] - before)
            travel.append(done)
            found.append(plant.q[0] - plant.theta[0] / 14.0 - rest)
    return PlantCurve(np.array(travel), np.array(found), crept(ideal_testbed(), travel, torque))


def _loaded(torque: float, terminated: bool = False) -> Plant:
    """The testbed at rest under a load at the joint, N m, with creep, its rotor immovable."""
    arm = ideal_testbed(rotor=IMMOVABLE, damping=0.02)
    plant = released_plant(arm, creep=True, terminated=terminated)
    plant.push("link", np.zeros(3), np.array([0.0, 0.0, torque]))
    plant.data.qpos[0] = -torque / 14.0 / arm.circuits[0].stiffness
    _run(plant, 0.1)
    return plant


def efficiency_under_load() -> PlantCurve:
    """Power out over power in of slow turning under load, over the motor's torque, N m."""
    torques = np.linspace(1.0, 6.779, 6)

    def efficiency(torque: float) -> float:
        plant = _loaded(-14.0 * torque)
        plant.data.qvel[:] = (5.0, 5.0 / 14.0)
        _run(plant, 1.5)
        return power_ratio(plant, 14.0 * torque, round(1.0 / STEP))

    return _curve(torques, efficiency, [limiting_efficiency(ideal_testbed(), torque) for torque in torques])


def torque_controlled(torque: float, speed: float) -> tuple[float, float]:
    """Torque of the cables on a link that turns at a speed, and power lost over the speed of the motor, N m.

    Parameters
    ----------
    torque : of the motor, N m, against the link's motion for a positive speed.
    speed : of the link, rad/s, which its inertia keeps.
    """
    arm = ideal_testbed(damping=0.02)
    arm = replace(arm, joints=replace(arm.joints, armature=(IMMOVABLE,)))
    plant = released_plant(arm, creep=True)
    plant.data.qpos[0] = torque / arm.circuits[0].stiffness
    plant.data.qvel[:] = (14.0 * speed, speed)
    for _ in range(round(0.3 / STEP)):
        plant.step([torque])
    theta, q, count = plant.theta[0], plant.q[0], round(0.5 / STEP)
    for _ in range(count):
        plant.step([torque])
    travel = plant.theta[0] - theta
    return plant.cable_torque[0], torque * (travel - 14.0 * (plant.q[0] - q)) / abs(travel)


def coulomb_like() -> PlantCurve:
    """Loss under torque control as a friction torque at the motor, over its torque, N m: (6.22) of all pulleys."""
    torques = np.linspace(1.0, 6.0, 6)
    cables = ideal_testbed().cables
    stages = list(zip(cables.stage_ratio, cables.stage_radius, cables.stage_ea, strict=True))
    theory = sum(2.0 * coulomb_like_torque(n * torques, r, ea) / n for n, r, ea in stages)
    return _curve(torques, lambda torque: torque_controlled(torque, 0.5)[1], theory)


def ripple(eccentricity: float = 2.54e-4) -> PlantCurve:
    """Torque of an eccentric pulley at a third of the motor's speed, over the motor's angle, rad."""
    arm = ideal_testbed(rotor=IMMOVABLE)
    (circuit,) = arm.circuits
    amplitude = 2.0 * eccentricity * circuit.pretension
    ripples = Ripples(("motor1",), (1.0 / 3.0,), (amplitude,), (1,), (0.5,))
    plant = released_plant(arm, ripples=ripples)
    angles, torques = [], []
    plant.data.qvel[:] = (20.0, 20.0 / 14.0)
    for _ in range(round(2.0 / STEP)):
        angles.append(plant.theta[0])
        plant.step([0.0])
        torques.append(3.0 * plant.data.qfrc_actuator[0])
    angle = np.array(angles)
    return PlantCurve(angle, np.array(torques), eccentric_ripple(eccentricity, circuit.pretension, angle / 3.0 + 0.5))


def resonances(ratio: float, stiffness: Numbers) -> Numbers:
    """Both resonances of (4.4) from the plant's own one-step map, (2, k), rad/s, over k_c at the joint, N m/rad."""
    arm = ideal_testbed(ratio)
    return np.array([frequencies(released_plant(arm, against_spring(k)))[[0, 2]] for k in stiffness]).T


def surface(hardening: float, cover: float = 0.0) -> PlantCurve:
    """Force of a surface of 4000 N/m over the depth of the tip in it, m, force in N.

    Parameters
    ----------
    hardening : of the surface, 1/m.
    cover : stiffness of the link's cover, N/m; 0 for a rigid one, which the theory has.
    """
    depths = np.linspace(1e-4, 0.01, 25)
    below = 0.01  # m below the link, which then touches with its tip only
    floor = _floor(below, 4e3, 0.0, hardening)
    plant = released_plant(ideal_testbed(rotor=IMMOVABLE), World(floor, NO_SPRINGS, cover_stiffness=cover))

    def force(depth: float) -> float:
        q = -np.arcsin((depth + below) / LEVER)
        plant.data.qpos[:], plant.data.qvel[:] = (14.0 * q, q), 0.0
        plant.step([0.0])
        (load,) = plant.loads()
        return float(np.linalg.norm(load.force))

    return _curve(depths, force, 4e3 * depths * (1.0 + hardening * depths))


def _floor(below: float, stiffness: float, damping: float, hardening: float) -> Obstacles:
    """A plane this far below the link, m."""
    position = (0.0, 0.0, -0.0254 - below)
    law = (stiffness,), (damping,), (hardening,), (0.0,)
    return Obstacles(("floor",), ("plane",), position, (0.0,) * 3, (2.0, 2.0, 0.0), *law)


def actuator_cycle_with_backlash(desired: float = 5.0) -> PlantCurve:
    """Actuator cycle, peak to peak, over the play, both at the joint, rad: 2 F/k_tr of (5.20) and the play (2.2).

    A desired force below the friction, so that the gear changes its flank; above it the play is without effect.

    Parameters
    ----------
    desired : F_des, N m.
    """
    friction, play = 6.0, np.array([0.0, 2.5e-3, 5e-3, 1e-2])
    found = [
        force_step(desired, 1464.28, 4.3e-2, 18.7, (friction, friction), 4.0, backlash=value) for value in play.tolist()
    ]
    travel = np.array([np.ptp(response.motor[response.time > 0.15]) for response in found])
    crossed = play if desired < friction else 0.0 * play
    return PlantCurve(play, travel, 2.0 * friction / found[0].node.transmission_stiffness + crossed)


def torque_loop(hertz: float, damping: float = 0.0) -> GearedTorqueLoop:
    """A torque loop on the testbed's motor and shaft whose cycle by backlash has about this frequency (2.2).

    The critical gain is 0.8, the integral a third of the frequency.

    Parameters
    ----------
    hertz : of the cycle by the describing function.
    damping : of a velocity feedback, part of that which ends the cycle.
    """
    arm = ideal_testbed()
    stiffness, inertia, omega = arm.circuits[0].stiffness, arm.motors.inertia[0], 2.0 * np.pi * hertz
    proportional = omega**2 * inertia / (CRITICAL * stiffness) - 1.0
    needed = inertia * omega / 3.0
    integral, derivative = omega / 3.0 * (1.0 + proportional), needed / (CRITICAL * stiffness)
    return GearedTorqueLoop(stiffness, 0.01, inertia, damping * needed, proportional, integral, derivative)


def torque_loop_response(hertz: float, damping: float = 0.0) -> tuple[Numbers, Numbers]:
    """Times, s, and torque, N m, of the testbed's motor that runs into a flank, its link at rest.

    Parameters
    ----------
    hertz, damping : of the loop as in `torque_loop`.
    """
    arm, loop, step = ideal_testbed(), torque_loop(hertz, damping), 1.0 / (FINE * hertz)
    arm = replace(
        arm,
        motors=replace(arm.motors, viscous_friction=(loop.damping,)),
        joints=replace(arm.joints, armature=(IMMOVABLE,)),
    )
    plant, torques, wound = released_plant(arm, step=step, backlash=(loop.play,)), [], 0.0
    plant.data.qvel[0] = 2.0 * np.pi * hertz * loop.play
    theta, rate = plant.data.qpos, plant.data.qvel  # the sensor reads the present torque, not that of the last step
    for _ in range(TURNS * FINE):
        angle = theta[0] - 14.0 * theta[1]
        torque = loop.stiffness * float(np.sign(angle)) * max(abs(angle) - 0.5 * loop.play, 0.0)
        wound += loop.integral * torque * step
        slope = loop.stiffness * (rate[0] - 14.0 * rate[1]) if torque else 0.0
        plant.step([-float(loop.proportional * torque + wound + loop.derivative * slope)])
        torques.append(torque)
    return step * np.arange(len(torques), dtype=np.float64), np.array(torques, dtype=np.float64)


def backlash_in_a_torque_loop() -> PlantCurve:
    """Frequency of the cycle that backlash causes in a torque loop, over that of the describing function, Hz (2.2).

    The last two are those of Luh, Fisher and Paul on the first two joints of the Stanford arm.
    """
    wanted = np.array([60.0, 150.0, 334.0, 477.0])
    exact = [exact_cycle(torque_loop(hertz)).frequency / (2.0 * np.pi) for hertz in wanted.tolist()]
    return _curve(wanted, lambda hertz: 1.0 / mean_cycle(*torque_loop_response(hertz)).period, exact)


def impact() -> PlantCurve:
    """Greatest force of a link that runs into a spring at 0.5 rad/s, over its stiffness at the tip, N/m; (3.1).

    F = v sqrt(J k); the cable is so long that the rotor has no effect.
    """
    stiffness = np.linspace(200.0, 2e4, 25)
    arm = _with_long_cable()
    inertia = link_inertia(arm)

    def force(k: float) -> float:
        world = World(NOTHING, Springs(("joint1",), (k,), (LEVER,), (0.0,), (False,)))
        plant = released_plant(arm, world)
        plant.data.qvel[:] = (-7.0, -0.5)
        greatest = 0.0
        for _ in range(round(np.pi * np.sqrt(inertia / k) / LEVER / STEP)):
            plant.step([0.0])
            greatest = max(greatest, -k * LEVER * plant.q[0])
        return greatest

    return _curve(stiffness, force, 0.5 * np.sqrt(inertia * stiffness))


def _with_long_cable() -> Arm:
    arm = ideal_testbed()
    return replace(arm, cables=replace(arm.cables, stage_length=(1e6, 0.0)))


def damped_impact(step: float = RUN_STEP) -> PlantCurve:
    """Greatest force of a tip that runs into a damped surface at 0.5 rad/s, over its stiffness, N/m, at a step, s.

    The force of m x'' + b x' + k x = 0 with the mass m of (3.1); the cable is so long that the rotor has no effect.
    """
    arm, stiffness, below, damping = _with_long_cable(), np.array([1e3, 4e3, 1.6e4]), 0.01, 20.0
    speed, mass, found, expected = 0.5 * LEVER, link_inertia(arm) / LEVER**2, [], []
    for k in stiffness.tolist():
        floor = _floor(below, k, damping, 0.0)
        plant = released_plant(arm, World(floor, NO_SPRINGS), step)
        q = -float(np.arcsin(below / LEVER))
        plant.data.qpos[:], plant.data.qvel[:] = (14.0 * q, q), (-7.0, -0.5)
        natural, decay = float(np.sqrt(k / mass)), damping / (2.0 * mass)
        times = np.arange(0.0, np.pi / natural, 0.1 * step)
        swing = np.sqrt(natural**2 - decay**2)
        x = speed / swing * np.exp(-decay * times) * np.sin(swing * times)
        v = speed * np.exp(-decay * times) * (np.cos(swing * times) - decay / swing * np.sin(swing * times))
        expected.append(float((k * x + damping * v).max()))
        forces = []
        for _ in range(round(np.pi / natural / step)):
            plant.step([0.0])
            forces += [float(np.linalg.norm(load.force)) for load in plant.loads()]
        found.append(max(forces))
    return PlantCurve(stiffness, np.array(found), np.array(expected))


def stiction_cycle(step: float = RUN_STEP) -> PlantCurve:
    """Stiction cycle of F_c, peak to peak, N m, with the exact one (5.8), at a step, s."""
    contact, gain, seconds = 1464.28, 4e-3, 16.0
    found = force_step(20.0, contact, gain, 3.74, (6.0, 3.0), seconds, step=step)
    exact = simulate(found.node, IntegralLoop(gain), 20.0, seconds).at(found.time)
    late = found.time > 0.5 * seconds
    return level(float(np.ptp(found.force[late])), float(np.ptp(exact.contact_force[late])))


def pretension() -> PlantCurve:
    """Breakaway torque of the motor over the pretension, N m over N: what active pretension would lower, (6.5)."""
    arm, coefficient = ideal_testbed(friction=(50.0, 50.0)), 1e-4  # the link does not move
    tension = np.linspace(0.2, 1.0, 5) * arm.cables.pretension[0]

    def torque(value: float) -> float:
        less = replace(arm, cables=replace(arm.cables, pretension=(value,)))
        return breakaway(released_plant(less, tension_friction=(coefficient,)), 0.9 * coefficient * 2.0 * value)

    return _curve(tension, torque, coefficient * 2.0 * tension)


def terminated_creep() -> PlantCurve:
    """Creep, rad, over the motor's travel, rad, out and back twice: half of (6.19) on the first way, then no more."""
    found = creep_out_and_back(seconds=6.0, rounds=2, terminated=True)
    first = found.x <= found.x[-1] / 4.0
    return found._replace(theory=0.5 * np.minimum(found.theory, found.theory[first][-1]))


def gross_slip() -> PlantCurve:
    """Torque of the motor on a link that does not move, N m, over its angle times k_tr, N m; (6.16)."""
    wrapped = 3.0 * np.pi * 0.2  # turns of the cable on the pinion, rad, times its friction
    arm = ideal_testbed(rotor=IMMOVABLE, friction=(1e4, 1e4))
    (circuit,) = arm.circuits
    plant, speed = released_plant(arm, capstan=wrapped), 1.0
    most = 2.0 * circuit.pretension * circuit.radius * float(np.tanh(0.5 * wrapped))
    plant.data.qvel[0] = speed
    wanted, found = [], []
    for _ in range(round(1.5 * most / circuit.stiffness / speed / STEP)):
        wanted.append(circuit.stiffness * plant.theta[0])
        plant.step([0.0])
        found.append(plant.circuit_torque[0])
    expected = np.array(wanted)
    return PlantCurve(expected, np.array(found), np.minimum(expected, most))


def soft_cover() -> PlantCurve:
    """Force, N, over depth, m, of a surface of 4000 N/m under a cover of 2000 N/m in series (1.1.1)."""
    found = surface(0.0, 2000.0)
    return found._replace(theory=found.theory / (1.0 + 4000.0 / 2000.0))


def current_loop() -> PlantCurve:
    """Current after a step of its command by 1 A, over time, s: a delay and a lag of first order."""
    bandwidth, delay = 100.0, 2  # Hz, periods of 1 ms
    configuration = Configuration.load(packaged("testbed"))
    parameters = configuration.node("driver", DriverParameters).amplifier
    slow = replace(parameters, bandwidth=bandwidth, delay=delay)
    amplifier = Amplifier(configuration.shared.arm.motors, slow, np.random.default_rng(0))
    found = np.array([amplifier.step([1.0], 1e-3)[0] for _ in range(20)])
    time = np.linspace(1e-3, 20e-3, 20)
    return PlantCurve(time, found, -np.expm1(-2.0 * np.pi * bandwidth * np.maximum(time - 1e-3 * delay, 0.0)))


def warm_friction() -> PlantCurve:
    """Breakaway of a motor, N m, over the heat of its winding, 1 at its limit: it falls by `drop` of it."""
    arm, drop = ideal_testbed(friction=(50.0, 50.0)), 0.3
    arm = replace(arm, motors=replace(arm.motors, static_friction=(0.05,), dynamic_friction=(0.05,)))
    heat = np.linspace(0.0, 1.0, 5)

    def torque(w: float) -> float:
        plant = Plant(arm, EMPTY, no_effects(arm), STEP, replace(COULOMB_STICTION, warm_drop=drop))
        plant.brake(False)
        plant.heat([w])
        return breakaway(plant, 0.045 * (1.0 - drop * w))

    return _curve(heat, torque, 0.05 * (1.0 - drop * heat))
