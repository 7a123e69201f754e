"""Chapter 5 applied to one axis with friction: domain, stable error, limit cycle, deadband.

One friction node behind an ideal velocity source, with sampling and delay, by the exact integrator
of `wam_theory.stick_slip`.
"""

import math
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

from wam_theory.linear_loop import damping_ratio, routh_gain, sampled_margin
from wam_theory.stick_slip import FrictionNode, IntegralLoop, Verdict, assess
from wam_theory.stiction import stiction_cycle_force, stiction_cycle_period
from wam_theory.thresholds import DESIGN


class Domain(StrEnum):
    """Domains of figure 5.8: stable for every step, for small ones, for none."""

    I = "I"  # noqa: E741 - the thesis's name
    II = "II"
    III = "III"
    BEYOND = "II or III"  # whether friction stabilises it has not been examined


class PredictedCycle(NamedTuple):
    """Stiction limit cycle of F_c to which small errors lead; zeros without stiction.

    `peak_to_peak` N or N m by (5.8), `period` s by (5.9) corrected; `deadband`, half of the first, removes it.
    """

    peak_to_peak: float
    period: float
    deadband: float


class FrictionVerdict(NamedTuple):
    """Prediction of chapter 5 for one axis.

    Attributes
    ----------
    domain : of figure 5.8.
    margin : largest gain that is linearly stable with every contact stiffness.
    stable_error : largest saturation that is accepted; infinite in domain I, 0 in domain III and where friction keeps
        up a cycle.
    undecided_error : largest saturation that may be stable: with it no response was found unstable, but some were
        not followed to their end; `stable_error` where all were.
    cycle : stiction limit cycle of small errors.
    saturated_cycle : peak to peak of the largest limit cycle of F_c found in domain I with the saturation of the loop,
        N or N m: that of stiction, or, with a `stable_error` of 0, one that friction keeps up in a delayed loop.
    """

    domain: Domain
    margin: float
    stable_error: float
    undecided_error: float
    cycle: PredictedCycle
    saturated_cycle: float


def friction_verdict(node: FrictionNode, loop: IntegralLoop, events: int = DESIGN.events) -> FrictionVerdict:
    """Verdict on a node under a loop, with its contact and every softer one.

    The saturation of the loop counts for `saturated_cycle` only.  A response that has neither settled nor failed
    after `events` of the integrator, samples among them, is undecided, and its saturation is not accepted.
    """
    nodes = [replace(node, contact_stiffness=part * node.contact_stiffness) for part in DESIGN.softer]
    margins = [linear_margin(each, loop) for each in nodes]
    cycle = stiction_cycle(node, loop.gain)
    if loop.gain <= min(margins):
        kept_up = _saturated_cycle(node, loop)
        error = 0.0 if kept_up > DESIGN.cycle_excess * cycle.peak_to_peak else math.inf
        return FrictionVerdict(Domain.I, min(margins), error, error, cycle, kept_up)
    beyond = [each for each, margin in zip(nodes, margins, strict=True) if loop.gain > margin]
    if not loop.delay_samples and node.natural_frequency * loop.sample_period < DESIGN.continuous:
        loop = replace(loop, sample_period=0.0)
    errors = [stable_errors(each, loop, events) for each in beyond]
    error, undecided = min(each.stable for each in errors), min(each.undecided for each in errors)
    domain = Domain.II if error else Domain.BEYOND if undecided else Domain.III
    return FrictionVerdict(domain, min(margins), error, undecided, cycle, 0.0)


def linear_margin(node: FrictionNode, loop: IntegralLoop) -> float:
    """Largest linearly stable G_I of a node under a loop, without its friction; 0 without damping."""
    plant = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    if not node.damping:
        return 0.0
    if not loop.sample_period:
        return float(routh_gain(*plant))
    return sampled_margin(*plant, loop.sample_period, loop.delay_samples).gain


def stiction_cycle(node: FrictionNode, gain: float) -> PredictedCycle:
    """Stiction limit cycle of a node under a loop with this gain, and the deadband that removes it."""
    stiffness = node.transmission_stiffness, node.contact_stiffness
    friction = node.static_friction, node.dynamic_friction
    if node.static_friction <= node.dynamic_friction or not gain:
        return PredictedCycle(0.0, 0.0, 0.0)
    zeta = damping_ratio(node.inertia, node.damping, *stiffness)
    size = float(stiction_cycle_force(*stiffness, *friction, zeta))
    period = float(stiction_cycle_period(gain, *stiffness, *friction, zeta))
    return PredictedCycle(size, period, size / 2.0)


class StableErrors(NamedTuple):
    """Largest saturations of F_error with which all responses come to rest, or none was found unstable; 0 for none."""

    stable: float
    undecided: float


def stable_errors(node: FrictionNode, loop: IntegralLoop, events: int = DESIGN.events) -> StableErrors:
    """Largest saturation of F_error with which every response ends at rest or in the stiction cycle.

    Do not use the largest stable step as the saturation limit: after a larger step the loop oscillates
    indefinitely, by several times that limit.  So each candidate is tried with steps up to 50 times as
    large, and with the node thrown at the contact.

    Parameters
    ----------
    node, loop : whose responses are followed.
    events : of the integrator, samples among them, after which a response is undecided.
    """
    if not node.static_friction:
        return StableErrors(0.0, 0.0)
    undecided = 0.0
    cycle = DESIGN.cycle_excess * stiction_cycle(node, loop.gain).peak_to_peak
    for part in DESIGN.candidates:
        limit = part * node.static_friction
        if limit <= loop.deadband / DESIGN.sure:
            break
        comes_to_rest = _comes_to_rest(node, replace(loop, error_limit=limit), cycle, events)
        if comes_to_rest is not False:
            undecided = undecided or DESIGN.sure * limit
        if comes_to_rest:
            return StableErrors(DESIGN.sure * limit, undecided)
    return StableErrors(0.0, undecided)


def _saturated_cycle(node: FrictionNode, loop: IntegralLoop) -> float:
    if math.isinf(loop.error_limit) or not loop.sample_period:
        return 0.0
    ends = [assess(node, loop, force, start, max_events=DESIGN.events) for force, start in _responses(node, loop)]
    return max([0.0, *(end.peak_to_peak for end in ends if end.verdict is Verdict.LIMIT_CYCLE)])


def _responses(node: FrictionNode, loop: IntegralLoop) -> list[tuple[float, tuple[float, float, float]]]:
    """Steps of F_des, and the state in which they begin: at rest, or thrown at the contact or away from it."""
    limit = loop.error_limit
    thrown = 3.0 * limit / node.contact_stiffness * node.natural_frequency
    tries = [(part * limit, (0.0, 0.0, 0.0)) for part in DESIGN.steps]
    return [*tries, (0.0, (0.0, thrown, 0.0)), (limit, (0.0, -thrown, 0.0))]


def _comes_to_rest(node: FrictionNode, loop: IntegralLoop, cycle: float, events: int) -> bool | None:
    """Whether every response does; None where the first that does not is one that is undecided."""
    for force, start in _responses(node, loop):
        found = assess(node, loop, force, start, max_events=events)
        is_stiction = found.verdict is Verdict.LIMIT_CYCLE and found.peak_to_peak <= cycle
        if found.verdict is not Verdict.SETTLED and not is_stiction:
            return None if found.verdict is Verdict.UNDECIDED else False
    return True
