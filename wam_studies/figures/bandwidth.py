"""Numbers of figure 4.9: open-loop force bandwidth over contact stiffness, theory and plant."""

from typing import NamedTuple

import numpy as np

from wam_studies.figures.series import Numbers, Series
from wam_studies.plant.effects import resonances
from wam_studies.plant.ideal_testbed import RATIO, ideal_testbed, link_inertia
from wam_theory.resonance import (
    best_contact_stiffness,
    force_resonances,
    hard_contact_bandwidth,
    matched_ratio,
    small_ratio_resonances,
)


class Breakpoints(NamedTuple):
    """Over contact stiffness at the joint, N m/rad: frequencies of (4.4), rad/s, and the limits in figure 4.9.

    `link` and `rotor` are the curves of (4.7), (n,) over the stiffness of the lines; `crossover` is their
    intersection (4.9); `asymptote` (4.6).  `family` has the lower frequency for each of `ratios`, with
    stiffness relative to the crossover and frequency relative to the asymptote.
    """

    lower: Series
    upper: Series
    link: Numbers
    rotor: Numbers
    crossover: float
    asymptote: float
    ratios: Numbers
    matched: float
    family: tuple[Series, ...]


def breakpoints() -> Breakpoints:
    """The testbed of section 4.3.2; the plant's frequencies are those of its one-step map."""
    arm = ideal_testbed()
    inertias = float(arm.motors.inertia[0]), link_inertia(arm)
    stiffness = arm.circuits[0].stiffness
    crossover = float(best_contact_stiffness(*inertias, stiffness))
    asymptote = float(hard_contact_bandwidth(inertias[0], stiffness))
    lines, points = crossover * np.geomspace(1e-3, 1e2, 301), crossover * np.geomspace(1.2e-3, 10.0, 14)
    matched = float(matched_ratio(*inertias))
    ratios = np.array([RATIO / 4.0, RATIO, 0.4 * matched, matched, 3.0 * matched])
    family = []
    for ratio in ratios.tolist():
        exact = force_resonances(*inertias, stiffness, lines, ratio).lower
        plant = resonances(ratio, points).lower.plant
        family.append(Series(lines / crossover, exact / asymptote, points / crossover, plant / asymptote))
    both, measured = force_resonances(*inertias, stiffness, lines, RATIO), resonances(RATIO, points)
    simple = small_ratio_resonances(*inertias, stiffness, lines)
    return Breakpoints(
        Series(lines, both.lower, points, measured.lower.plant),
        Series(lines, both.upper, points, measured.upper.plant),
        simple.link_on_contact,
        simple.rotor_on_cable,
        crossover,
        asymptote,
        ratios,
        matched,
        tuple(family),
    )
