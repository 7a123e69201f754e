"""The design rule of 4.4 with numbers: stiffness of the arm."""

import math
from typing import NamedTuple

from wam_analysis.table import markdown
from wam_description.configuration import Configuration
from wam_studies.scorecard import measures
from wam_theory.resonance import (
    best_contact_stiffness,
    best_transmission_stiffness,
    force_resonances,
    hard_contact_bandwidth,
)


class StiffnessRule(NamedTuple):
    """One joint of the arm, everything at the joint; stiffness in N m/rad, bandwidth in Hz.

    `best_contact` and `best_transmission` are by (4.9) and (4.10); `with_best` is the bandwidth with the
    transmission that (4.10) requires, on the present contact.
    """

    joint: int
    transmission: float
    contact: float
    best_transmission: float
    best_contact: float
    bandwidth: float
    asymptote: float
    with_best: float


def stiffness_rule(configuration: Configuration) -> tuple[StiffnessRule, ...]:
    """The rule of 4.4 for each joint, with the hardest contact of the configuration at the tip.

    Parameters
    ----------
    configuration : of the arm, as in `scorecard.measures`.
    """
    m = measures(configuration)
    rows = []
    columns = (m.transmission_stiffness, m.joint_contact_stiffness, m.rotor_inertia, m.link_inertia)
    for joint, (cable, contact, rotor, link) in enumerate(zip(*columns, strict=True), 1):
        best = float(best_transmission_stiffness(rotor, link, contact))
        lower = [float(force_resonances(rotor, link, k, contact, 1.0).lower) for k in (cable, best)]
        asymptote = float(hard_contact_bandwidth(rotor, cable))
        hertz = [value / (2.0 * math.pi) for value in (lower[0], asymptote, lower[1])]
        rows.append(
            StiffnessRule(joint, cable, contact, best, float(best_contact_stiffness(rotor, link, cable)), *hertz)
        )
    return tuple(rows)


def stiffness_table(configuration: Configuration) -> str:
    """`stiffness_rule` as Markdown."""
    head = (
        "joint",
        "k_tr, N m/rad",
        "k_c at the tip",
        "k_tr by (4.10)",
        "k_c by (4.9)",
        "bandwidth, Hz",
        "its asymptote (4.6)",
        "bandwidth with k_tr of (4.10)",
    )
    rows = [(str(r.joint), *(f"{value:.3g}" for value in r[1:])) for r in stiffness_rule(configuration)]
    return markdown(head, rows)
