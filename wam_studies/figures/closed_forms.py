"""Figures of closed forms: 3.1, 4.3 to 4.9, and efficiency (6.15) of chapter 6."""

from dataclasses import replace

import numpy as np

from wam_description.arm import Arm
from wam_description.signals import ZERO
from wam_studies.figures.conditions import CASE
from wam_studies.figures.panels import Mark, Numbers, Panel, Panels, Series, line_only
from wam_studies.figures.transmissions import driven, efficiency
from wam_studies.plant.ideal_testbed import (
    IMMOVABLE,
    RATIO,
    STEP,
    against_spring,
    amplitude,
    frequencies,
    ideal_testbed,
    limiting_efficiency,
    link_inertia,
    loop_plant,
    released_plant,
    stepped_map,
)
from wam_theory.cable import stiffness_with_reducer
from wam_theory.requisites import largest_cylinder, secure_angle, useful_length
from wam_theory.resonance import (
    best_contact_stiffness,
    force_resonances,
    force_transfer,
    hard_contact_bandwidth,
    matched_ratio,
    position_bandwidth,
    small_ratio_resonances,
)
from wam_theory.tension_element import equal_stages_efficiency

HZ = 0.5 / np.pi


def grasp() -> Panels:
    """Useful length (3.2) and largest cylinder (3.3) over the aspect ratio, for coefficients of friction."""
    ratio, aspect = np.geomspace(1.5, 40.0, 200), "aspect ratio L/W [-]"
    length, diameter = [], []
    for mu in (0.2, 0.4, 0.6):
        length.append((f"μ = {mu:g}", line_only(ratio, useful_length(ratio, secure_angle(mu)))))
        diameter.append((f"μ = {mu:g}", line_only(ratio, largest_cylinder(ratio, mu))))
    return (
        Panel("useful length of a link (3.2)", aspect, "L'/L [-]", length, "x"),
        Panel("largest cylinder (3.3)", aspect, "D/L [-]", diameter, "x"),
    )


def resonances(ratio: float, stiffness: Numbers) -> Numbers:
    """Both resonances of (4.4) from the plant's own one-step map, (2, k), rad/s, over k_c at the joint, N m/rad."""
    arm = ideal_testbed(ratio)
    return np.array([frequencies(released_plant(arm, against_spring(k)))[[0, 2]] for k in stiffness]).T


def breakpoints() -> Panels:
    """Frequencies of (4.4) of the testbed of 4.3.2, those of the plant of its one-step map; limits; several N."""
    arm = ideal_testbed()
    inertias = float(arm.motors.inertia[0]), link_inertia(arm)
    stiffness = arm.circuits[0].stiffness
    crossover = float(best_contact_stiffness(*inertias, stiffness))
    asymptote = float(hard_contact_bandwidth(inertias[0], stiffness))
    lines, points = crossover * np.geomspace(1e-3, 1e2, 301), crossover * np.geomspace(1.2e-3, 10.0, 14)
    both, measured = force_resonances(*inertias, stiffness, lines, RATIO), resonances(RATIO, points)
    lower = Series(lines, both.lower, points, measured[0]).scaled(1.0, HZ)
    upper = Series(lines, both.upper, points, measured[1]).scaled(1.0, HZ)
    simple = small_ratio_resonances(*inertias, stiffness, lines)
    limits = (
        ("ω₁, N = 14 (4.4)", lower),
        ("√(k_c/J_l) (4.7)", line_only(lines, HZ * simple.link_on_contact)),
        ("√(k_tr/J_m) (4.7)", line_only(lines, HZ * simple.rotor_on_cable)),
    )
    matched, family = float(matched_ratio(*inertias)), []
    for ratio in (RATIO / 4.0, RATIO, 0.4 * matched, matched, 3.0 * matched):
        exact = force_resonances(*inertias, stiffness, lines, ratio).lower
        plant = resonances(ratio, points)[0]
        one = Series(lines, exact, points, plant).scaled(1.0 / crossover, 1.0 / asymptote)
        family.append((f"N = {ratio / matched:.2g} N_m", one))
    axes, shown = ("contact stiffness at the joint [N m/rad]", "frequency [Hz]"), (np.nan, np.nan, 1.0, 2e3)
    marks = (Mark("(4.9)", crossover),)
    return (
        Panel("a) breakpoints (4.4)", *axes, (("ω₁", lower), ("ω₂", upper)), "xy", marks, shown),
        Panel("b) the approximation for small N", *axes, limits, "xy", marks, shown),
        Panel(
            f"c) several N, N_m = {matched:.4g}",
            "contact stiffness over that of (4.9) [-]",
            "ω₁ over its asymptote (4.6) [-]",
            family,
            "xy",
            limits=(np.nan, np.nan, 7e-3, 1.5),
        ),
    )


def efficiencies() -> Panels:
    """Upper bound (6.15): the testbed over torque and the plant in slow motion; equal stages over the tension."""
    arm, torques, some = ideal_testbed(), np.linspace(0.0, 7.5, 60), np.linspace(1.0, 6.779, 6)
    line = [limiting_efficiency(arm, torque) for torque in torques]
    strain = np.linspace(0.0, 0.03, 60)
    equal = [(f"n = {n}", line_only(1e2 * strain, equal_stages_efficiency(strain, 1.0, float(n)))) for n in range(1, 7)]
    cables = driven("cables")
    plant = np.array([efficiency(cables, RATIO * torque) for torque in some.tolist()])
    testbed, power = Series(torques, np.array(line), some, plant), "power out over power in [-]"
    return (
        Panel("two-stage testbed", "motor torque [N m]", power, (("(6.15)", testbed),)),
        Panel("n stages of equal stress", "(T₂ - T₁)/EA [%]", power, equal),
    )


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
    plant.push("link", ZERO, (0.0, 0.0, torque))
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
    return Panel("a) reducer between the ends (4.1)", "C/L [-]", "stiffness at the joint [N m/rad]", lines, "y")


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
    return Panel("c) torque for equal force (4.3)", "frequency [Hz]", "motor torque over that at rest [-]", lines, "y")
