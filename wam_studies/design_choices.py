"""Design rules of 4.4 and 5.7 with numbers: stiffness of the arm, less friction against more stiffness."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_description.configuration import Configuration
from wam_studies.scorecard import measures
from wam_theory.linear_loop import damping_ratio, routh_gain, series_stiffness
from wam_theory.regimes import actuator_cycle_power, actuator_cycle_work
from wam_theory.resonance import (
    best_contact_stiffness,
    best_transmission_stiffness,
    force_resonances,
    hard_contact_bandwidth,
)
from wam_theory.stability_map import largest_stable_steps
from wam_theory.stick_slip import FrictionNode
from wam_theory.stiction import breakaway_delay, stiction_cycle_force


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


class Choice(NamedTuple):
    """A quantity of 5.7 with half the friction, and with twice k_tr, over the present one."""

    quantity: str
    half_friction: float
    twice_stiffness: float
    better: str  # "less" or "more"


# the testbed of 5.6, SI, with zeta = 0.25, beyond the Routh limit so that a largest stable step exists
BASE = FrictionNode(0.45194, 2.0 * 0.25 * math.sqrt(0.45194 * 3097.0), 1632.7, 1464.3, 0.7, 0.9)
GAMMA, STEP = 1.8, 20.0  # G_I in the units of (5.15) at BASE; F_error, N m


def friction_or_stiffness() -> tuple[Choice, ...]:
    """Half the friction or twice k_tr, at the same G_I, k_c and b: the question of 5.7."""
    gain = GAMMA * float(routh_gain(*_linear(BASE)))
    base, *changed = (_quantities(node, gain) for node in (BASE, half_friction(), twice_stiffness()))
    better = {"largest stable step": "more", "margin of the gain (5.15)": "more"}
    return tuple(
        Choice(name, changed[0][name] / value, changed[1][name] / value, better.get(name, "less"))
        for name, value in base.items()
    )


def half_friction() -> FrictionNode:
    """BASE with both frictions halved."""
    return FrictionNode(*_linear(BASE), 0.5 * BASE.dynamic_friction, 0.5 * BASE.static_friction)


def twice_stiffness() -> FrictionNode:
    """BASE with twice k_tr."""
    j, b, ktr, kc = _linear(BASE)
    return FrictionNode(j, b, 2.0 * ktr, kc, BASE.dynamic_friction, BASE.static_friction)


def _linear(node: FrictionNode) -> tuple[float, float, float, float]:
    return node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness


def _quantities(node: FrictionNode, gain: float) -> dict[str, float]:
    """The Coulomb ones with F_dynamic."""
    j, b, ktr, kc = _linear(node)
    friction, zeta = node.dynamic_friction, damping_ratio(j, b, ktr, kc)
    gamma = j * gain * series_stiffness(ktr, kc) / b
    found = {
        "delay (5.3)": breakaway_delay(gain, ktr, friction, STEP),
        "actuator cycle, peak to peak (5.20)": 2.0 * friction / ktr,
        "its work per half cycle (5.21)": actuator_cycle_work(friction, ktr),
        "its power (5.22)": actuator_cycle_power(gain, STEP, friction),
        "stiction cycle, peak to peak (5.8)": stiction_cycle_force(ktr, kc, node.static_friction, friction, zeta),
        "margin of the gain (5.15)": routh_gain(j, b, ktr, kc),
        "largest stable step": friction * largest_stable_steps(gamma, zeta, ktr / kc),
    }
    return {name: float(np.asarray(value)) for name, value in found.items()}


def friction_table() -> str:
    """`friction_or_stiffness` as Markdown."""
    rows = [
        (c.quantity, f"{c.half_friction:.3g}", f"{c.twice_stiffness:.3g}", c.better) for c in friction_or_stiffness()
    ]
    return markdown(("over the present value", "half the friction", "twice k_tr", "better"), rows)
