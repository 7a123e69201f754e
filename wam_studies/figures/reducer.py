"""Numbers of figures 4.3 to 4.7: where the reducer is, position bandwidth, and torque for bandwidth by feedback."""

from dataclasses import replace

import numpy as np

from wam_description.arm import Arm
from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Numbers, Panel, Panels, Series
from wam_studies.plant.ideal_testbed import (
    IMMOVABLE,
    RATIO,
    STEP,
    amplitude,
    frequencies,
    ideal_testbed,
    link_inertia,
    loop_plant,
    released_plant,
    stepped_map,
)
from wam_theory.cable import stiffness_with_reducer
from wam_theory.resonance import force_transfer, position_bandwidth

HZ = 0.5 / np.pi


def line_of(ratio: float, share: float, rotor: float | None = IMMOVABLE, thinner: float = 1.0) -> Arm:
    """The testbed with one line of cable of constant stress, its reducer at a share C/L of the way from the motor.

    Parameters
    ----------
    ratio : N.
    share : C/L, 0 for a reducer at the motor, 1 at the joint.
    rotor : its inertia, kg m^2; None for that of the motor.
    thinner : E A over that of the testbed.
    """
    arm = ideal_testbed(ratio, rotor)
    cables = arm.cables
    ea, length, radius = thinner * cables.stage_ea[0], cables.stage_length[0], cables.stage_radius[0]
    return replace(
        arm,
        cables=replace(
            cables,
            stage_ea=(ea, ratio * ea),
            stage_length=(share * length, (1.0 - share) * length),
            stage_radius=(radius, radius),
            stage_circuits=(1.0, 1.0),
            stage_ratio=(1.0, ratio),
        ),
    )


def static_stiffness(arm: Arm, torque: float = 5.0) -> float:
    """Stiffness at the joint, N m/rad, from the rest of a pushed link behind a rotor that does not turn."""
    damping = 2.0 * link_inertia(arm) * 40.0
    arm = replace(arm, joints=replace(arm.joints, viscous_friction=(damping,)))
    plant = released_plant(arm)
    plant.push("link", np.zeros(3), np.array([0.0, 0.0, torque]))
    plant.step([0.0], round(CASE.speed_change / STEP))
    while abs(plant.qd[0]) > 1e-7:
        plant.step([0.0])
    return torque / plant.q[0]


def link_frequency(arm: Arm) -> float:
    """Frequency of the link behind a rotor that does not turn, rad/s, from the plant's one-step map."""
    return float(frequencies(released_plant(arm))[-1])


def force_amplitude(arm: Arm, omega: Numbers) -> Numbers:
    """Amplitude of F_c over that of the motor's torque, from the plant's steps out of rest, over rad/s."""
    state, inlet = stepped_map(loop_plant(arm, CASE.contact))
    return CASE.contact * amplitude(state, inlet, np.exp(1j * omega * STEP), 1)


def reducer() -> Panels:
    """The three panels: stiffness over C/L (4.1), position bandwidth over N (4.2), torque over frequency (4.3)."""
    return _stiffness(), _bandwidth(), _torque()


def _stiffness() -> Panel:
    arm = ideal_testbed()
    cables, shares, some = arm.cables, np.linspace(0.0, 1.0, 101), np.linspace(0.0, 1.0, 7)
    lines = []
    for ratio in (4.0, RATIO):
        unit = 2.0 * cables.stage_radius[0] ** 2  # two strands on a pulley
        length = cables.stage_length[0]
        line = unit * stiffness_with_reducer(cables.stage_ea[0], length, ratio, shares * length)
        measured = np.array([static_stiffness(line_of(ratio, share)) for share in some])
        lines.append((f"N = {ratio:g}", Series(shares, line, some, measured)))
    return Panel("a) reducer part of the way (4.1)", "C/L [-]", "stiffness at the joint [N m/rad]", tuple(lines), "y")


def _bandwidth() -> Panel:
    ratios, some = np.geomspace(1.0, 40.0, 60), np.array([1.5, 4.0, 10.0, 30.0])
    arm = line_of(RATIO, 1.0)
    at_joint = position_bandwidth(link_inertia(arm), arm.circuits[0].stiffness, ratios)
    at_motor = at_joint / np.sqrt(ratios)  # lines of the same stress: (4.1) for C = L over C = 0
    measured = [np.array([link_frequency(line_of(n, share)) for n in some.tolist()]) for share in (1.0, 0.0)]
    lines = (
        ("at the joint, $N\\sqrt{k_{tr}/J_l}$", Series(ratios, HZ * at_joint, some, HZ * measured[0])),
        ("at the motor, same stress", Series(ratios, HZ * at_motor, some, HZ * measured[1])),
    )
    return Panel("b) position bandwidth (4.2)", "ratio N [-]", "frequency [Hz]", lines, "xy")


def _torque() -> Panel:
    some = 2.0 * np.pi * np.array([1.0, 3.0, 6.0, 10.0, 20.0, 35.0, 50.0])
    lines = []
    for thinner, label in ((1.0, "cable of the testbed"), (0.1, "a tenth of its stiffness")):
        arm = line_of(RATIO, 1.0, None, thinner)
        own = (arm.motors.inertia[0], link_inertia(arm), arm.circuits[0].stiffness, CASE.contact, RATIO)
        frequency = 2.0 * np.pi * np.linspace(0.5, 60.0, 400)
        line = RATIO / np.abs(force_transfer(1j * frequency, *own))
        measured = RATIO / force_amplitude(arm, some)
        lines.append((label, Series(HZ * frequency, line, HZ * some, measured)))
    return Panel(
        "c) torque for one force (4.3)", "frequency [Hz]", "motor torque over that at rest [-]", tuple(lines), "y"
    )
