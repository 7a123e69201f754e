"""Numbers of figure 1.1 and of its table: the testbed with cables, with a shaft and gears, and with direct drive."""

import math
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import yaml

from wam_analysis.table import markdown
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.effects import Effects, no_effects
from wam_description.signals import ZERO
from wam_description.world import World
from wam_driver.driver import DriverParameters
from wam_driver.friction import FrictionParameters
from wam_driver.plant import Plant
from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Panel, Panels, Series
from wam_studies.plant.ideal_testbed import (
    EMPTY,
    IMMOVABLE,
    against_spring,
    frequencies,
    ideal,
    limiting_efficiency,
    link_inertia,
    power_ratio,
)
from wam_theory.resonance import force_resonances

HZ = 0.5 / math.pi
KINDS = {"cables": "", "shaft and gears": "shaft_and_gear", "direct drive": "direct_drive"}


class Driven(NamedTuple):
    """One transmission: arm, effects, friction, and the step that the plant needs, s."""

    arm: Arm
    effects: Effects
    friction: FrictionParameters
    step: float

    @property
    def ratio(self) -> float:
        """Transmission ratio N, turns of the motor per turn of the joint."""
        return 1.0 / self.arm.joint_from_motor[0]

    @property
    def stiffness(self) -> float:
        """Configured stiffness of the transmission at the joint, N m/rad."""
        return self.ratio**2 * self.arm.circuits[0].stiffness

    @property
    def smooth(self) -> "Driven":
        """The transmission with the friction of the cables, which does not depend on the load."""
        return self._replace(friction=driven("cables").friction)

    def plant(
        self,
        rotor: float | None = None,
        world: World = EMPTY,
        dry: bool = False,
        play: bool = True,
        damping: float = 0.0,
    ) -> Plant:
        """A plant without gravity, released.

        Parameters
        ----------
        rotor : its inertia, kg m^2; None for that of the motor.
        world : around it.
        dry : whether rotor and joint have their static friction, also in motion; that by load is there in any case.
        play : whether there is backlash.
        damping : of the circuit, N m s/rad.
        """
        motors, joints = self.arm.motors, self.arm.joints
        at_motor, at_joint = (part.static_friction[0] if dry else 0.0 for part in (motors, joints))
        arm = ideal(self.arm, rotor, damping, (at_joint, at_joint), at_motor=at_motor)
        backlash = self.effects.backlash if play else (0.0,)
        effects = replace(no_effects(arm), creep=self.effects.creep, backlash=backlash)
        plant = Plant(arm, world, effects, self.step, self.friction)
        plant.brake(False)
        return plant


def driven(kind: str) -> Driven:
    """The transmission of a name in `KINDS`."""
    configuration = Configuration.load(packaged("testbed"))
    if KINDS[kind]:
        given = yaml.safe_load(packaged(f"experiments/sets/{KINDS[kind]}").read_text(encoding="utf-8"))
        configuration = configuration.with_values(given)
    driver = configuration.node("driver", DriverParameters)
    step = CASE.short_step if kind == "direct drive" else CASE.transmission_step
    return Driven(configuration.shared.arm, driver.effects, driver.friction, step)


Measures = dict[str, float]  # by name and unit
STIFFNESS, PLAY, BANDWIDTH = "stiffness [N m/rad]", "play [rad]", "force bandwidth on 10 lb/in [Hz]"
EFFICIENCY, INERTIA = "efficiency at peak torque [-]", "backdriven inertia [kg m²]"
BREAKAWAY, HEAVIER = "torque that backdrives it [N m]", "mass and heat of the motor, divided by those with cables [-]"


def predicted(kind: str) -> Measures:
    """Quantities of a transmission at the joint by the formulas of shaft, cable and gears."""
    it = driven(kind)
    motors, joints, cables = it.arm.motors, it.arm.joints, it.arm.cables
    rotor = motors.inertia[0]
    modulus, thickness, length = CASE.shaft
    rigid = {
        "cables": 14.0**2 * 2.0 * cables.stage_ea[0] / cables.stage_length[0] * cables.stage_radius[0] ** 2,
        "shaft and gears": 14.0**2 * modulus * math.pi * thickness**4 / 32.0 / length,
        "direct drive": CASE.coupling,
    }[kind]
    lower = float(force_resonances(rotor, link_inertia(it.arm), rigid / it.ratio**2, CASE.contact, it.ratio).lower)
    efficiency = {
        "cables": limiting_efficiency(it.arm, motors.peak_torque[0]),
        "shaft and gears": 1.0 - CASE.gear_meshes * CASE.mesh_loss,
        "direct drive": 1.0,
    }[kind]
    factor = it.friction.joint_load_factor[0]
    return {
        STIFFNESS: rigid,
        PLAY: 0.1e-3 / 36.83e-3 if kind == "shaft and gears" else 0.0,
        BANDWIDTH: HZ * lower,
        EFFICIENCY: efficiency,
        INERTIA: link_inertia(it.arm) + it.ratio**2 * rotor,
        BREAKAWAY: joints.static_friction[0] + (1.0 + factor) * it.ratio * motors.static_friction[0],
        HEAVIER: rotor / driven("cables").arm.motors.inertia[0],
    }


@cache
def measured(kind: str) -> Measures:
    """Quantities of a transmission measured on the plant, without mass and heat of the motor."""
    it = driven(kind)
    near, far = (_deflection(it, torque) for torque in (CASE.near_load, CASE.far_load))
    stiffness = (CASE.far_load - CASE.near_load) / (far - near)
    return {
        STIFFNESS: stiffness,
        PLAY: 2.0 * (near - CASE.near_load / stiffness),
        BANDWIDTH: HZ * bandwidth(it, CASE.contact),
        EFFICIENCY: efficiency(it, 14.0 * driven("cables").arm.motors.peak_torque[0]),
        INERTIA: _inertia(it),
        BREAKAWAY: _breakaway(it),
    }


def _deflection(it: Driven, torque: float) -> float:
    """Of the link under a torque, rad, the motor held: the mean over a period of its undamped oscillation."""
    plant = it.smooth.plant(rotor=IMMOVABLE)
    plant.data.qpos[1] = 0.5 * it.effects.play(0) / it.ratio  # the gap is closed at the start
    plant.push("link", ZERO, (0.0, 0.0, torque))
    period = 2.0 * math.pi * math.sqrt(link_inertia(it.arm) / it.stiffness)
    angles = []
    for _ in range(round(period / it.step)):
        plant.step([0.0])
        angles.append(plant.q[0])
    return 0.5 * (max(angles) + min(angles))


def bandwidth(it: Driven, contact: float) -> float:
    """Lower frequency of the plant without play, rad/s, on a spring at the joint, N m/rad."""
    return float(frequencies(it.smooth.plant(world=against_spring(contact), play=False), it.step)[0])


def efficiency(it: Driven, load: float) -> float:
    """Work on a load at the joint, N m, over work of the motor, in slow motion."""
    plant = it.plant(rotor=IMMOVABLE, damping=0.02)
    plant.push("link", ZERO, (0.0, 0.0, -load))
    carried = load / (1.0 - it.friction.joint_load_factor[0])
    plant.data.qpos[1] = -(carried / it.stiffness + 0.5 * it.effects.play(0) / it.ratio)
    plant.data.qvel[:] = (it.ratio * CASE.speed_under_load, CASE.speed_under_load)
    count = round(1.0 / it.step)
    plant.step([0.0], count)
    return power_ratio(plant, load, count)


def _inertia(it: Driven, torque: float = 5.0, seconds: float = 2.0) -> float:
    """Torque on the link over its acceleration, kg m^2, without friction and play."""
    plant = it.smooth.plant(play=False)
    plant.push("link", ZERO, (0.0, 0.0, torque))
    plant.step([0.0], round(seconds / it.step))
    return torque * seconds / (plant.thetad[0] / it.ratio)


def _breakaway(it: Driven, rate: float = 0.2) -> float:
    """Torque on the link at which the rotor begins to turn, N m, slowly increased."""
    plant, torque = it.plant(dry=True, play=False), 0.0
    while abs(plant.thetad[0]) < 1e-4 * it.ratio:
        torque += rate * it.step
        plant.push("link", ZERO, (0.0, 0.0, torque))
        plant.step([0.0])
    return torque


def transmissions() -> Panels:
    """Bandwidth over contact stiffness, and torque over deflection."""
    contacts, some = np.geomspace(1e2, 1e6, 200), np.geomspace(2e2, 3e5, 6)
    lines, springs = [], []
    for kind in KINDS:
        it, by = driven(kind), predicted(kind)
        rotor = it.arm.motors.inertia[0]
        lower = force_resonances(rotor, link_inertia(it.arm), by[STIFFNESS] / it.ratio**2, contacts, it.ratio).lower
        points = np.array([bandwidth(it, k) for k in some])
        lines.append((kind, Series(contacts, HZ * lower, some, HZ * points)))
        torque, steps = np.linspace(0.0, 60.0, 100), np.array([10.0, 25.0, 40.0, 55.0])
        angle = 1e3 * (torque / by[STIFFNESS] + 0.5 * by[PLAY])
        springs.append((kind, Series(torque, angle, steps, 1e3 * np.array([_deflection(it, t) for t in steps]))))
    return (
        Panel("a) force bandwidth (4.4)", "contact stiffness [N m/rad]", "frequency [Hz]", lines, "xy"),
        Panel("b) motor held", "torque on the link [N m]", "deflection [mrad]", springs),
    )


def table() -> str:
    """Predicted and measured quantities of each transmission as Markdown."""
    head = ("at the joint", *(text for kind in KINDS for text in (f"{kind}, predicted", "plant")))
    found = [values for kind in KINDS for values in (predicted(kind), measured(kind))]
    rows = [(name, *(f"{round(own[name], 6) + 0.0:.4g}" if name in own else "" for own in found)) for name in found[0]]
    return markdown(head, rows)
