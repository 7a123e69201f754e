"""What a plant can have besides, each off by default, compared with closed forms."""

from dataclasses import replace

import numpy as np

from wam_description.configuration import Configuration, packaged
from wam_description.effects import no_effects
from wam_driver.amplifier import Amplifier
from wam_driver.driver import DriverParameters
from wam_driver.friction import COULOMB_STICTION
from wam_driver.plant import Plant
from wam_studies.plant.effects import PlantCurve, creep_out_and_back, surface
from wam_studies.plant.ideal_testbed import EMPTY, IMMOVABLE, STEP, breakaway, ideal_testbed, released_plant


def terminated_creep() -> PlantCurve:
    """Creep, rad, over the motor's travel, rad, out and back twice: half of (6.19) on the first way, then no more."""
    found = creep_out_and_back(seconds=6.0, rounds=2, terminated=True)
    first = found.x <= found.x[-1] / 4.0
    return found._replace(theory=0.5 * np.minimum(found.theory, found.theory[first][-1]))


def gross_slip(wrap: float = 3.0 * np.pi, friction: float = 0.2) -> PlantCurve:
    """Torque of the motor on a link that does not move, N m, over its angle times k_tr, N m; (6.16).

    Parameters
    ----------
    wrap : of the cable on the pinion, rad.
    friction : its coefficient.
    """
    arm = ideal_testbed(rotor=IMMOVABLE, friction=(1e4, 1e4))
    (circuit,) = arm.circuits
    plant, speed = released_plant(arm, capstan=wrap * friction), 1.0
    most = 2.0 * circuit.pretension * circuit.radius * float(np.tanh(0.5 * wrap * friction))
    plant.data.qvel[0] = speed
    wanted, found = [], []
    for _ in range(round(1.5 * most / circuit.stiffness / speed / STEP)):
        wanted.append(circuit.stiffness * plant.theta[0])
        plant.step([0.0])
        found.append(plant.circuit_torque[0])
    expected = np.array(wanted)
    return PlantCurve(expected, np.array(found), np.minimum(expected, most))


def soft_cover(cover: float = 2000.0) -> PlantCurve:
    """Force, N, over depth, m, of a surface of 4000 N/m under a cover of this stiffness, N/m, in series (1.1.1)."""
    found = surface(0.0, cover)
    return found._replace(theory=found.theory / (1.0 + 4000.0 / cover))


def current_loop(bandwidth: float = 100.0, delay: int = 2) -> PlantCurve:
    """Current after a step of its command by 1 A, over time, s: a delay and a lag of first order.

    Parameters
    ----------
    bandwidth : Hz.
    delay : periods of 1 ms.
    """
    configuration = Configuration.load(packaged("testbed"))
    parameters = configuration.node("driver", DriverParameters).amplifier
    slow = replace(parameters, bandwidth=bandwidth, delay=delay)
    amplifier = Amplifier(configuration.shared.arm.motors, slow, np.random.default_rng(0))
    found = np.array([amplifier.step([1.0], 1e-3)[0] for _ in range(20)])
    time = np.linspace(1e-3, 20e-3, 20)
    return PlantCurve(time, found, -np.expm1(-2.0 * np.pi * bandwidth * np.maximum(time - 1e-3 * delay, 0.0)))


def warm_friction(drop: float = 0.3) -> PlantCurve:
    """Breakaway of a motor, N m, over the heat of its winding, 1 at its limit: it falls by `drop` of it."""
    arm = ideal_testbed(friction=(50.0, 50.0))
    arm = replace(arm, motors=replace(arm.motors, static_friction=(0.05,), dynamic_friction=(0.05,)))
    heat = np.linspace(0.0, 1.0, 5)
    found = []
    for w in heat.tolist():
        plant = Plant(arm, EMPTY, no_effects(arm), STEP, replace(COULOMB_STICTION, warm_drop=drop))
        plant.brake(False)
        plant.heat([w])
        found.append(breakaway(plant, 0.045 * (1.0 - drop * w)))
    return PlantCurve(heat, np.array(found), 0.05 * (1.0 - drop * heat))
