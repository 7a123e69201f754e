"""Figures of closed forms: 3.1, 4.9, and efficiency (6.15) of chapter 6."""

import numpy as np

from wam_studies.figures.panels import Mark, Numbers, Panel, Panels, Series, line_only
from wam_studies.plant.ideal_testbed import (
    IMMOVABLE,
    RATIO,
    STEP,
    against_spring,
    frequencies,
    ideal_testbed,
    limiting_efficiency,
    link_inertia,
    power_ratio,
    released_plant,
)
from wam_theory.requisites import largest_cylinder, secure_angle, useful_length
from wam_theory.resonance import (
    best_contact_stiffness,
    force_resonances,
    hard_contact_bandwidth,
    matched_ratio,
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
        Panel("useful length of a link (3.2)", aspect, "L'/L [-]", tuple(length), "x"),
        Panel("largest cylinder (3.3)", aspect, "D/L [-]", tuple(diameter), "x"),
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
            tuple(family),
            "xy",
            limits=(np.nan, np.nan, 7e-3, 1.5),
        ),
    )


def plant_efficiency(torque: float) -> float:
    """Power out over power in of the plant in slow motion under a load of a torque of the motor, N m."""
    arm = ideal_testbed(rotor=IMMOVABLE, damping=0.02)
    plant, load = released_plant(arm, creep=True), 14.0 * torque
    plant.push("link", np.zeros(3), np.array([0.0, 0.0, -load]))
    plant.data.qpos[0] = load / 14.0 / arm.circuits[0].stiffness
    plant.step([0.0], round(0.1 / STEP))
    plant.data.qvel[:] = (5.0, 5.0 / 14.0)
    plant.step([0.0], round(1.5 / STEP))
    return power_ratio(plant, load, round(1.0 / STEP))


def efficiencies() -> Panels:
    """Upper bound (6.15): the testbed over torque and the plant in slow motion; equal stages over the tension."""
    arm, torques, some = ideal_testbed(), np.linspace(0.0, 7.5, 60), np.linspace(1.0, 6.779, 6)
    line = [limiting_efficiency(arm, torque) for torque in torques]
    strain = np.linspace(0.0, 0.03, 60)
    equal = [(f"n = {n}", line_only(1e2 * strain, equal_stages_efficiency(strain, 1.0, float(n)))) for n in range(1, 7)]
    plant = np.array([plant_efficiency(torque) for torque in some.tolist()])
    testbed, power = Series(torques, np.array(line), some, plant), "power out over power in [-]"
    return (
        Panel("two-stage testbed", "motor torque [N m]", power, (("(6.15)", testbed),)),
        Panel("n stages of equal stress", "(T₂ - T₁)/EA [%]", power, tuple(equal)),
    )
