"""What follows from the plant's effects, measured on the simulated plant and computed from theory.

One link on one motor, the testbed of section 5.6 with one effect at a time.  Laws that were only put in are tested,
see test/driver.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wam_analysis.table import markdown
from wam_description.world import NO_SPRINGS, Obstacles, World
from wam_sim.batch import processes, results
from wam_sim.pieces import default_file
from wam_studies.exact_cycles import last_cycle
from wam_studies.plant.ideal_testbed import (
    IMMOVABLE,
    LEVER,
    Numbers,
    force_step,
    ideal_testbed,
    link_inertia,
    released_plant,
)
from wam_theory.backlash_cycle import GearedTorqueLoop, exact_cycle
from wam_theory.friction_model import IntegralLoop
from wam_theory.stick_slip import simulate

CRITICAL = 0.8  # part of the stiffness at which the torque loop is marginal
RUN_STEP = 5e-4  # s, that users run
TURNS, FINE = 40, 1000  # cycles of the torque loop, and steps of each, so that it has practically no delay


class PlantCurve(NamedTuple):
    """A quantity of the plant and by theory, (n,) each."""

    plant: Numbers
    theory: Numbers

    @property
    def error(self) -> float:
        """Greatest difference over the greatest theoretical value."""
        return float(np.abs(self.plant - self.theory).max() / np.abs(self.theory).max())


def _curve(x: Numbers, plant: Callable[[float], float], theory: ArrayLike) -> PlantCurve:
    """What the plant does at each x, next to theory."""
    return PlantCurve(np.array([plant(value) for value in x.tolist()]), np.asarray(theory))


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
    return PlantCurve(travel, 2.0 * friction / found[0].node.transmission_stiffness + crossed)


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
    return _curve(wanted, lambda hertz: 1.0 / last_cycle(*torque_loop_response(hertz)).period, exact)


def damped_impact() -> PlantCurve:
    """Greatest force of a tip that runs into a damped surface at 0.5 rad/s, over its stiffness, N/m.

    The force of m x'' + b x' + k x = 0 with the mass m of (3.1); the cable is so long that the rotor has no effect.
    """
    arm, stiffness, below, damping = ideal_testbed(), np.array([1e3, 4e3, 1.6e4]), 0.01, 20.0
    arm = replace(arm, cables=replace(arm.cables, stage_length=(1e6, 0.0)))
    speed, mass, expected = 0.5 * LEVER, link_inertia(arm) / LEVER**2, []

    def force(k: float) -> float:
        law, place = ((k,), (damping,), (0.0,)), ((0.0, 0.0, -0.0254 - below), (0.0,) * 3)
        floor = Obstacles(("floor",), *law, ("plane",), *place, (2.0, 2.0, 0.0), (0.0,))
        plant = released_plant(arm, World(floor, NO_SPRINGS), RUN_STEP)
        q = -float(np.arcsin(below / LEVER))
        plant.data.qpos[:], plant.data.qvel[:] = (14.0 * q, q), (-7.0, -0.5)
        forces = []
        for _ in range(round(np.pi * float(np.sqrt(mass / k)) / RUN_STEP)):
            plant.step([0.0])
            forces += [float(np.linalg.norm(load.force)) for load in plant.loads()]
        return max(forces)

    for k in stiffness.tolist():
        natural, decay = float(np.sqrt(k / mass)), damping / (2.0 * mass)
        times = np.arange(0.0, np.pi / natural, 0.1 * RUN_STEP)
        swing = np.sqrt(natural**2 - decay**2)
        x = speed / swing * np.exp(-decay * times) * np.sin(swing * times)
        v = speed * np.exp(-decay * times) * (np.cos(swing * times) - decay / swing * np.sin(swing * times))
        expected.append(float((k * x + damping * v).max()))
    return _curve(stiffness, force, expected)


def stiction_cycle() -> PlantCurve:
    """Stiction cycle of F_c, peak to peak, N m, with the exact one (5.8)."""
    contact, gain, seconds = 1464.28, 4e-3, 16.0
    found = force_step(20.0, contact, gain, 3.74, (6.0, 3.0), seconds, step=RUN_STEP)
    exact = simulate(found.node, IntegralLoop(gain), 20.0, seconds).at(found.time)
    late = found.time > 0.5 * seconds
    plant, theory = (np.array([np.ptp(force[late])]) for force in (found.force, exact.contact_force))
    return PlantCurve(plant, theory)


EFFECTS: dict[str, Callable[[], PlantCurve]] = {
    "impact on a damped surface at 0.5 ms": damped_impact,
    "backlash in the loop": actuator_cycle_with_backlash,
    "backlash in a torque loop": backlash_in_a_torque_loop,
    "stiction cycle at 0.5 ms": stiction_cycle,
}


def error_of(name: str) -> float:
    """The greatest difference of an effect from theory."""
    return EFFECTS[name]().error


def errors() -> dict[str, float]:
    """Greatest difference of each effect from theory, in parallel; what was measured with this code is kept."""
    with processes() as executor:
        return dict(zip(EFFECTS, results(error_of, list(EFFECTS), executor, default_file("plant")), strict=True))


def table(found: Mapping[str, float]) -> str:
    """Table of the greatest differences from theory as Markdown."""
    rows = [(n, "below 0.001 %" if e < 1e-5 else f"{100.0 * e:.2g} %") for n, e in found.items()]
    return markdown(("effect", "greatest difference from theory"), rows)
