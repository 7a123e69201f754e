"""The plant's effects, measured from the stepped plant, beside what the theory says of each.

One link on one motor, the testbed of section 5.6 with the effect in question alone.  Where a motor
has to turn at a given speed, its rotor is given an inertia that nothing can slow.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wam_analysis.ideal_testbed import (
    LEVER,
    NOTHING,
    STEP,
    UNSTOPPABLE,
    ideal_testbed,
    link_inertia,
    released_plant,
)
from wam_analysis.plant_loop import force_step
from wam_description.configuration import Configuration, packaged
from wam_description.effects import Ripples
from wam_description.world import NO_SPRINGS, Obstacles, Springs, World
from wam_driver.amplifier import Amplifier
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant
from wam_driver.sensors import Encoders
from wam_theory.cable import circuit_torque, creep, eccentric_ripple, efficiency, stage_loss
from wam_theory.resonance import force_resonances
from wam_theory.stick_slip import ForceLoop, simulate

Numbers = NDArray[np.float64]


class Curve(NamedTuple):
    """What the plant does and what the theory says, over x."""

    x: Numbers
    plant: Numbers
    theory: Numbers

    @property
    def error(self) -> float:
        """Greatest difference as a share of the greatest theoretical value."""
        return float(np.abs(self.plant - self.theory).max() / np.abs(self.theory).max())


class Resonance(NamedTuple):
    """Both resonances over contact stiffness, for one transmission ratio, rad/s."""

    ratio: float
    lower: Curve
    upper: Curve


def _run(plant: Plant, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        plant.step([0.0])


def slack() -> Curve:
    """Torque of a circuit over its stretch, past where the loose strand goes slack."""
    arm = ideal_testbed()
    plant = released_plant(arm, slack=True)
    (circuit,) = arm.circuits
    stretch = np.linspace(-2.5, 2.5, 101) * circuit.slack_stretch
    torques = []
    for value in stretch:
        plant.data.qpos[:] = (value, 0.0)
        mujoco.mj_forward(plant.model, plant.data)
        torques.append(plant.circuit_torque[0])
    theory = circuit_torque(stretch, circuit.stiffness, circuit.pretension, circuit.radius)
    return Curve(stretch, np.array(torques), theory)


def creep_out_and_back(torque: float = 40.0, speed: float = 1.0, seconds: float = 10.0) -> Curve:
    """Angle that the link gives way, while the motor turns out and back under a constant load.

    Parameters
    ----------
    torque : load at the joint, N m.
    speed : of the motor, rad/s.
    seconds : each way.

    Returns
    -------
    Curve
        over the motor's absolute travel, rad; angles at the joint, rad.
    """
    plant = _loaded(torque)
    arm = ideal_testbed()
    rest = plant.q[0] - plant.theta[0] / 14.0
    travel, given = [], []
    done = 0.0
    for way in (1.0, -1.0):
        plant.data.qvel[:] = (way * speed, way * speed / 14.0)
        for _ in range(round(seconds / STEP / 40)):
            before = plant.theta[0]
            _run(plant, 40 * STEP)
            done += abs(plant.theta[0] - before)
            travel.append(done)
            given.append(plant.q[0] - plant.theta[0] / 14.0 - rest)
    at_motor = torque / 14.0
    stages = zip(arm.cables.stage_ratio, arm.cables.stage_radius, arm.cables.stage_ea, strict=True)
    way_given = sum(n * creep(np.array(travel) / n, n * at_motor, r, ea) for n, r, ea in stages)
    return Curve(np.array(travel), np.array(given), np.asarray(way_given) / 14.0)


def _loaded(torque: float) -> Plant:
    """The testbed at rest under a load at the joint, N m, with creep, its rotor unstoppable."""
    arm = ideal_testbed(rotor=UNSTOPPABLE, damping=0.02)
    plant = released_plant(arm, creep=True)
    plant.push("link", np.zeros(3), np.array([0.0, 0.0, torque]))
    plant.data.qpos[0] = -torque / 14.0 / arm.circuits[0].stiffness
    _run(plant, 0.1)
    return plant


def efficiency_under_load() -> Curve:
    """Power out over power in of slow turning under load, over the motor's torque, N m."""
    torques = np.linspace(1.0, 6.779, 6)
    shares = []
    for torque in torques:
        plant = _loaded(-14.0 * torque)
        plant.data.qvel[:] = (5.0, 5.0 / 14.0)
        _run(plant, 1.5)
        q, work = plant.q[0], 0.0
        for _ in range(round(1.0 / STEP)):
            before = plant.theta[0]
            plant.step([0.0])
            work += plant.circuit_torque[0] * (plant.theta[0] - before)
        shares.append(14.0 * torque * (plant.q[0] - q) / work)
    cables = ideal_testbed().cables
    theory = [
        efficiency(stage_loss(torque, cables.stage_radius, cables.stage_ea, cables.stage_circuits, cables.stage_ratio))
        for torque in torques
    ]
    return Curve(torques, np.array(shares), np.array(theory))


def ripple(eccentricity: float = 2.54e-4) -> Curve:
    """Torque of an eccentric pulley at a third of the motor's speed, over the motor's angle, rad."""
    arm = ideal_testbed(rotor=UNSTOPPABLE)
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
    return Curve(angle, np.array(torques), eccentric_ripple(eccentricity, circuit.pretension, angle / 3.0 + 0.5))


def resonances(ratio: float, stiffness: Numbers) -> Resonance:
    """Both resonances of (4.4) from the plant's own one-step map, over k_c at the joint, N m/rad."""
    arm = ideal_testbed(ratio)
    (circuit,) = arm.circuits
    found = []
    for k in stiffness:
        world = World(NOTHING, Springs(("joint1",), (float(k),), (1.0,), (0.0,), (True,)))
        angles = np.abs(np.angle(np.linalg.eigvals(_one_step_map(released_plant(arm, world)))))
        found.append(np.sort(angles)[[0, 2]] / STEP)
    inertia = float(arm.motors.inertia[0]), link_inertia(arm)
    theory = force_resonances(*inertia, circuit.stiffness, stiffness, ratio)
    lower, upper = np.array(found).T
    return Resonance(ratio, Curve(stiffness, lower, theory.lower), Curve(stiffness, upper, theory.upper))


def _one_step_map(plant: Plant) -> Numbers:
    """Matrix that takes angles and velocities over one step, by stepping from each unit state."""
    size, small = plant.model.nv, 1e-6
    columns = []
    for i in range(2 * size):
        state = np.zeros(2 * size)
        state[i] = small
        plant.data.qpos[:], plant.data.qvel[:] = state[:size], state[size:]
        plant.step([0.0])
        columns.append(np.concatenate([plant.data.qpos, plant.data.qvel]) / small)
    return np.array(columns).T


def surface(hardening: float) -> Curve:
    """Force of a surface of 4000 N/m over the depth of the tip in it, m, force in N."""
    depths = np.linspace(1e-4, 0.01, 25)
    below = 0.01  # m below the link, which then touches with its tip alone
    place = (0.0, 0.0, -0.0254 - below)
    floor = Obstacles(("floor",), ("plane",), place, (0.0,) * 3, (2.0, 2.0, 0.0), (4e3,), (0.0,), (hardening,), (0.0,))
    plant = released_plant(ideal_testbed(rotor=UNSTOPPABLE), World(floor, NO_SPRINGS))
    forces = []
    for depth in depths:
        q = -np.arcsin((depth + below) / LEVER)
        plant.data.qpos[:], plant.data.qvel[:] = (14.0 * q, q), 0.0
        plant.step([0.0])
        (load,) = plant.loads()
        forces.append(float(np.linalg.norm(load.force)))
    return Curve(depths, np.array(forces), 4e3 * depths * (1.0 + hardening * depths))


class Cycle(NamedTuple):
    """Peak-to-peak and period of a settled cycle."""

    peak_to_peak: float
    period: float


def cycle(times: Numbers, values: Numbers) -> Cycle:
    """The cycle of the second half of a signal, from its extremes and its rising crossings of the middle."""
    half = values[len(values) // 2 :]
    above = half > 0.5 * (half.max() + half.min())
    rises = np.flatnonzero(above[1:] & ~above[:-1])
    return Cycle(float(np.ptp(half)), float(np.diff(rises).mean() * (times[1] - times[0])))


class Response(NamedTuple):
    """Step response of integral force control, over time: force F_c and motor position, each with the exact one."""

    force: Curve
    motor: Curve


def step_response(friction: tuple[float, float], damping: float, gain: float, seconds: float) -> Response:
    """Response of the testbed to a step of 20 N m, the exact motion beside it.

    The motor is an ideal velocity source, the loop answers in every step.

    Parameters
    ----------
    friction : static and dynamic, at the joint, N m.
    damping : b at the joint, N m s/rad.
    gain : G_I, rad/s/(N m).
    seconds : how long.
    """
    found = force_step(20.0, 1464.28, gain, damping, friction, seconds)
    exact = simulate(found.node, ForceLoop(gain=gain), 20.0, seconds).at(found.time)
    return Response(Curve(found.time, found.force, exact.contact_force), Curve(found.time, found.motor, exact.x_m))


def stiction_cycle() -> Curve:
    """F_c of a force loop with stiction, (5.8) and (5.9), N m over s."""
    return step_response((6.0, 4.0), damping=12.0, gain=2e-2, seconds=8.0).force


def actuator_cycle() -> Curve:
    """Motor position of a force loop with Coulomb friction, (5.20), rad over s; domain I, above gamma_b."""
    return step_response((6.0, 6.0), damping=18.7, gain=4.3e-2, seconds=6.0).motor


def impact() -> Curve:
    """Greatest force of a link that runs into a spring at 0.5 rad/s, over its stiffness at the tip, N/m; (3.1).

    F = v sqrt(J k); the cable is so long that the rotor is not felt.
    """
    stiffness = np.linspace(200.0, 2e4, 25)
    arm = ideal_testbed()
    arm = replace(arm, cables=replace(arm.cables, stage_length=(1e6, 0.0)))
    inertia = link_inertia(arm)
    found = []
    for k in stiffness:
        world = World(NOTHING, Springs(("joint1",), (float(k),), (LEVER,), (0.0,), (False,)))
        plant = released_plant(arm, world)
        plant.data.qvel[:] = (-7.0, -0.5)
        greatest = 0.0
        for _ in range(round(np.pi * np.sqrt(inertia / k) / LEVER / STEP)):
            plant.step([0.0])
            greatest = max(greatest, -float(k) * LEVER * plant.q[0])
        found.append(greatest)
    return Curve(stiffness, np.array(found), 0.5 * np.sqrt(inertia * stiffness))


class Level(NamedTuple):
    """One number of the plant and what it ought to be."""

    plant: float
    theory: float

    @property
    def error(self) -> float:
        """Difference as a share of the theoretical value."""
        return abs(self.plant / self.theory - 1.0)


def _breakaway(plant: Plant, at_joint: bool, start: float) -> float:
    """Torque, N m, at which a shaft at rest begins to turn, raised by a hundred-thousandth each step."""
    torque = start
    while abs(plant.qd[0] if at_joint else plant.thetad[0]) < 1e-5:
        torque *= 1.00001
        if at_joint:
            plant.push("link", np.zeros(3), np.array([0.0, 0.0, torque]))
        plant.step([0.0 if at_joint else torque])
    return torque


def tension_friction(coefficient: float = 1e-4) -> Level:
    """Breakaway torque of the motor by friction that goes with the tension of both strands, c (T1 + T2), (6.5)."""
    arm = ideal_testbed(friction=(50.0, 50.0))  # the link stays where it is
    plant = released_plant(arm, tension_friction=(coefficient,))
    return Level(_breakaway(plant, False, 0.06), coefficient * 2.0 * arm.circuits[0].pretension)


def rubbing() -> Level:
    """Breakaway torque of the joint with a rod of 0.7 N m pressed on it, motor free."""
    plant = released_plant(ideal_testbed(friction=(0.3, 0.3)))
    plant.rub((0.7,))
    return Level(_breakaway(plant, True, 0.9), 1.0)


def circuit_damping() -> Level:
    """Decay of the link against a motor that stands still, s^-1: N^2 d/(2 J)."""
    damping = 0.02
    arm = ideal_testbed(rotor=UNSTOPPABLE, damping=damping)
    values = np.linalg.eigvals(_one_step_map(released_plant(arm)))
    swinging = values[np.abs(values.imag) > 1e-6][0]
    inertia = link_inertia(arm)
    return Level(-float(np.log(np.abs(swinging))) / STEP, 14.0**2 * damping / (2.0 * inertia))


def heating(share: float = 2.0) -> Level:
    """Time until twice the continuous current is limited, s: T ln(r^2/(r^2 - 1))."""
    configuration = Configuration.load(packaged("testbed"))
    parameters = configuration.node("driver", DriverParameters).amplifier
    amplifier = Amplifier(configuration.shared.arm.motors, parameters, np.random.default_rng(0))
    asked, ticks = share * amplifier.continuous[0], 0
    while amplifier.step([asked], 1e-3)[0] == asked:
        ticks += 1
    return Level(ticks * 1e-3, parameters.thermal_time * float(np.log(share**2 / (share**2 - 1.0))))


def noise(sd: float = 1e-3) -> Level:
    """Standard deviation of 20 000 readings of a motor encoder, rad."""
    encoders = Encoders([0.0], [sd], np.random.default_rng(1))
    readings = [encoders.read([0.0], [0.0], 1e-3)[0][0] for _ in range(20_000)]
    return Level(float(np.std(readings)), sd)


LEVELS: dict[str, Callable[[], Level]] = {
    "friction with tension, breakaway": tension_friction,
    "rubbing, breakaway": rubbing,
    "damping of the circuit, decay": circuit_damping,
    "amplifier, time to the continuous limit": heating,
    "sensor noise, 20 000 readings": noise,
}

STUDIES: dict[str, Callable[[], Curve]] = {
    "slack": slack,
    "creep": creep_out_and_back,
    "efficiency": efficiency_under_load,
    "ripple": ripple,
    "linear surface": lambda: surface(0.0),
    "hardening surface": lambda: surface(50.0),
    "impact": impact,
    "actuator cycle": actuator_cycle,
    "stiction cycle": stiction_cycle,
}
