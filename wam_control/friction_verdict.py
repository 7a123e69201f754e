"""Verdict of chapter 5 on one axis with friction: domain, stable error, limit cycle, dead zone.

One friction node behind an actuator that does at once what it is told, by the exact integrator of
`wam_theory.stick_slip`; sampling and delay are part of it.
"""

import math
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

from wam_theory.linear_loop import damping_ratio, routh_gain, sampled_margin
from wam_theory.stick_slip import ForceLoop, FrictionNode, Verdict, assess
from wam_theory.stiction import deadband_against_stiction, stiction_cycle_force, stiction_cycle_period

SOFTER = (1.0, 0.6, 0.35, 0.2, 0.1, 0.03)  # parts of the worst contact stiffness that are looked at as well
STEPS = (0.3, 0.8, 1.0, 1.5, 3.0, 10.0, 50.0)  # of F_des, in saturations, that have to come to rest
CANDIDATES = (100.0, 50.0, 25.0, 12.0, 6.0, 4.0, 2.8, 2.0, 1.4, 1.0, 0.7, 0.5)  # saturations, in F_static
SURE = 0.7  # part of the largest saturation found good that is accepted: between two candidates and steps lies more
EVENTS = 4000  # of the exact integrator, after which a response counts as not settled
CYCLE_EXCESS = 1.5  # cycle that counts as that of stiction, in sizes of (5.8)


class Domain(StrEnum):
    """Domains of figure 5.8: stable for every step, for small ones, for none."""

    I = "I"  # noqa: E741 - the thesis's name
    II = "II"
    III = "III"
    BEYOND = "beyond I"  # II or III: nobody looked whether friction holds it


class Cycle(NamedTuple):
    """Stiction limit cycle of F_c that small errors end in; zeros where there is no stiction.

    `peak_to_peak` N or N m by (5.8), `period` s by (5.9) corrected, `deadband` the one that removes it,
    half of the first.
    """

    peak_to_peak: float
    period: float
    deadband: float


class FrictionVerdict(NamedTuple):
    """What chapter 5 says of one axis.

    Attributes
    ----------
    domain : of figure 5.8.
    margin : largest linearly stable gain, over all contacts up to the worst.
    stable_error : largest saturation that is accepted; infinite in domain I, 0 in domain III.
    cycle : what stiction makes of small errors.
    """

    domain: Domain
    margin: float
    stable_error: float
    cycle: Cycle


def judge(node: FrictionNode, loop: ForceLoop) -> FrictionVerdict:
    """Verdict on a node, with its contact and every softer one, under a loop; its saturation is not looked at."""
    nodes = [replace(node, contact_stiffness=part * node.contact_stiffness) for part in SOFTER]
    margins = [linear_margin(each, loop) for each in nodes]
    cycle = stiction_cycle(node, loop.gain)
    if loop.gain <= min(margins):
        return FrictionVerdict(Domain.I, min(margins), math.inf, cycle)
    beyond = [each for each, margin in zip(nodes, margins, strict=True) if loop.gain > margin]
    error = min(stable_error(each, loop) for each in beyond)
    return FrictionVerdict(Domain.II if error else Domain.III, min(margins), error, cycle)


def linear_margin(node: FrictionNode, loop: ForceLoop) -> float:
    """Largest linearly stable G_I without friction, 0 without damping."""
    plant = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    if not node.damping:
        return 0.0
    if not loop.sample_period:
        return float(routh_gain(*plant))
    return sampled_margin(*plant, loop.sample_period, loop.delay_samples).gain


def stiction_cycle(node: FrictionNode, gain: float) -> Cycle:
    """Limit cycle of (5.8), (5.9), and the dead zone that removes it."""
    stiffness = node.transmission_stiffness, node.contact_stiffness
    friction = node.static_friction, node.dynamic_friction
    if node.static_friction <= node.dynamic_friction or not gain:
        return Cycle(0.0, 0.0, 0.0)
    zeta = damping_ratio(node.inertia, node.damping, *stiffness)
    size = float(stiction_cycle_force(*stiffness, *friction, zeta))
    period = float(stiction_cycle_period(gain, *stiffness, *friction, zeta))
    return Cycle(size, period, float(deadband_against_stiction(size)))


def stable_error(node: FrictionNode, loop: ForceLoop) -> float:
    """Largest saturation of F_error with which every response comes to rest or to the cycle of stiction; 0 for none.

    The largest stable step is no answer: a loop that saturates at it shakes for ever after a larger
    step, by several times the saturation.  So each candidate is tried with steps up to 50 times as
    large, and with the node thrown at the contact.
    """
    if not node.static_friction:
        return 0.0
    cycle = CYCLE_EXCESS * stiction_cycle(node, loop.gain).peak_to_peak
    for part in CANDIDATES:
        limit = part * node.static_friction
        if limit > loop.deadband / SURE and _comes_to_rest(node, replace(loop, error_limit=limit), cycle):
            return SURE * limit
    return 0.0


def _comes_to_rest(node: FrictionNode, loop: ForceLoop, cycle: float) -> bool:
    limit = loop.error_limit
    frequency = math.sqrt((node.transmission_stiffness + node.contact_stiffness) / node.inertia)
    thrown = 3.0 * limit / node.contact_stiffness * frequency
    tries = [(part * limit, (0.0, 0.0, 0.0)) for part in STEPS]
    tries += [(0.0, (0.0, thrown, 0.0)), (limit, (0.0, -thrown, 0.0))]
    for force, start in tries:
        found = assess(node, loop, force, start, max_events=EVENTS)
        is_stiction = found.verdict is Verdict.LIMIT_CYCLE and found.peak_to_peak <= cycle
        if found.verdict is not Verdict.SETTLED and not is_stiction:
            return False
    return True
