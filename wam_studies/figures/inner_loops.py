"""Numbers of figure 2.1.2: what an inner loop on torque, velocity or position leaves of a disturbance at the motor.

Every loop is sampled at 1 kHz.  A velocity loop with an integral is a position loop whose reference is the integral
of the commanded velocity, so that both are one curve.  The loops as nodes: `wam_control.velocity.torque_loop`,
`wam_control.velocity.position_loop`.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wam_description.arm import Arm, Servo
from wam_description.configuration import Configuration, packaged
from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Numbers, Panel, Panels, Series
from wam_studies.plant.ideal_testbed import (
    RATIO,
    against_spring,
    amplitude,
    ideal_testbed,
    link_inertia,
    released_plant,
    stepped_map,
)
from wam_theory.velocity_servo import is_stable, largest_scale
from wam_theory.zero_order_hold import zero_order_hold


class InnerLoop(NamedTuple):
    """A loop that answers the state theta, q, theta', q' with a motor torque, -gain x state."""

    name: str
    gain: Callable[[Arm], Numbers]  # (4,), at scale 1


def on_torque(arm: Arm) -> Numbers:
    """1 N m of the motor per N m, at the motor, of a strain gauge at the root of the link."""
    (circuit,) = arm.circuits
    along = np.array([1.0, -RATIO])
    row = np.concatenate([circuit.stiffness * along, circuit.damping * along])
    row[3] -= arm.joints.viscous_friction[0] / RATIO
    return row


def on_position(servo: Servo) -> Numbers:
    """Gains of the velocity loop, or of a position loop with the same stiffness and damping."""
    return np.array([servo.integral_gain[0], 0.0, servo.proportional_gain[0], 0.0])


def _configured(_: Arm) -> Numbers:
    return on_position(Configuration.load(packaged("testbed")).shared.servo)


LOOPS = (InnerLoop("torque, sensor at the link", on_torque), InnerLoop("velocity or position", _configured))


def damped_testbed(stiffness: float = 1.0) -> Arm:
    """The testbed without gravity and dry friction, with its damping; stiffness of the cable over that configured."""
    arm, configured = ideal_testbed(), Configuration.load(packaged("testbed")).shared.arm
    cables = replace(configured.cables, stage_ea=tuple(stiffness * ea for ea in configured.cables.stage_ea))
    return replace(
        arm,
        cables=cables,
        motors=replace(arm.motors, viscous_friction=configured.motors.viscous_friction),
        joints=replace(arm.joints, viscous_friction=configured.joints.viscous_friction),
    )


def period_map(arm: Arm, contact: float = CASE.contact) -> tuple[Numbers, Numbers]:
    """State after a period from the state, (4, 4), and from a held motor torque, (4, 1), by theory.

    Parameters
    ----------
    contact : its stiffness at the joint, N m/rad.
    """
    (circuit,), inertia = arm.circuits, np.array([arm.motors.inertia[0], link_inertia(arm)])
    along = np.array([1.0, -RATIO])
    k = circuit.stiffness * np.outer(along, along) + np.diag([0.0, contact])
    d = circuit.damping * np.outer(along, along)
    d += np.diag([arm.motors.viscous_friction[0], arm.joints.viscous_friction[0]])
    rate = np.block([[np.zeros((2, 2)), np.eye(2)], [-k / inertia[:, None], -d / inertia[:, None]]])
    return zero_order_hold(rate, np.array([[0.0], [0.0], [1.0 / inertia[0]], [0.0]]), CASE.period)


def plant_period_map(arm: Arm) -> tuple[Numbers, Numbers]:
    """State after a period from the state, (4, 4), and from a held motor torque, (4, 1), by steps of the plant."""
    plant = released_plant(arm, against_spring(CASE.contact), CASE.period / CASE.substeps)
    state, inlet = stepped_map(plant, CASE.substeps)
    return state, inlet[:, None]


def largest_gain(maps: tuple[Numbers, Numbers], gain: Numbers) -> float:
    """Largest scale of the gain at which the sampled loop is stable."""
    state, inlet = maps
    return largest_scale(lambda scale: is_stable(state - scale * inlet * gain), CASE.first_gain_scale)


def left_of_disturbance(maps: tuple[Numbers, Numbers], gain: Numbers, frequency: Numbers) -> Numbers:
    """Amplitude of F_c over that of a torque at the motor, held over each period, frequency in Hz."""
    state, inlet = maps
    z = np.exp(2j * np.pi * frequency * CASE.period)
    return CASE.contact * amplitude(state - inlet * gain, inlet[:, 0], z, 1)


def inner_loops() -> Panels:
    """Disturbance that is left over frequency, and the largest gain over the stiffness between motor and sensor."""
    return _attenuation(), _largest_gains()


def _attenuation() -> Panel:
    arm = damped_testbed()
    theory, plant = period_map(arm), plant_period_map(arm)
    frequency, some = np.geomspace(0.3, 100.0, 400), np.array([0.5, 2.0, 5.0, 20.0, 50.0])
    gains = {"none": np.zeros(4)}
    for loop in LOOPS:
        gains[loop.name] = CASE.gain_share * largest_gain(theory, loop.gain(arm)) * loop.gain(arm)
    lines = [
        (
            name,
            Series(
                frequency,
                left_of_disturbance(theory, gain, frequency) / RATIO,
                some,
                left_of_disturbance(plant, gain, some) / RATIO,
            ),
        )
        for name, gain in gains.items()
    ]
    title = "a) disturbance at the motor"
    return Panel(title, "frequency [Hz]", "part that reaches the contact [-]", lines, "xy")


def _largest_gains() -> Panel:
    stiffness, some = np.geomspace(0.5, 3.0, 60), np.array([0.6, 1.0, 1.5, 2.5])
    lines = []
    for loop in LOOPS:
        line, points = (
            np.array([largest_gain(maps(damped_testbed(s)), loop.gain(damped_testbed(s))) for s in values.tolist()])
            for maps, values in ((period_map, stiffness), (plant_period_map, some))
        )
        reference = float(np.interp(1.0, stiffness, line))
        lines.append((loop.name, Series(stiffness, line / reference, some, points / reference)))
    title = "b) largest stable gain, over that of the testbed"
    return Panel(
        title, "stiffness of the cable over that of the testbed [-]", "largest gain over that [-]", lines, "xy"
    )
