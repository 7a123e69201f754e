"""Chapter 5 for a force loop of your own: one inertia with friction between transmission and contact."""

import math
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from wam_theory.friction_verdict import Domain, FrictionVerdict, friction_verdict
from wam_theory.linear_loop import damping_ratio, gain_ratio
from wam_theory.rounding import rounded_down
from wam_theory.stick_slip import FrictionNode, IntegralLoop
from wam_theory.thresholds import DESIGN

UNITS = "units: those of the options; errors, deadband and limit cycles (peak to peak) in N, or N m of a rotary loop"
ASSUMED = "assumed: the motor follows its commanded velocity at once; the lag of a velocity loop changes the margin"


class LoopDesign(NamedTuple):
    """What chapter 5 predicts for a loop.

    Attributes
    ----------
    node, loop : as designed; the loop sampled with its delay in whole periods, rounded up.
    gamma, zeta : coordinates of figure 5.8, (5.15) and (5.12): of the loop without sampling and delay.
    verdict : domain, margin, largest safe error and limit cycles, with this contact and all softer ones.
    """

    node: FrictionNode
    loop: IntegralLoop
    gamma: float
    zeta: float
    verdict: FrictionVerdict

    @property
    def is_safe(self) -> bool:
        """Whether the saturation of the loop is not above the largest safe error."""
        return self.loop.error_limit <= self.verdict.stable_error

    def text(self) -> str:
        """For people, with what to do where the loop is not safe."""
        node, verdict, cycle = self.node, self.verdict, self.verdict.cycle
        part, ratio = self.loop.gain / verdict.margin, node.transmission_stiffness / node.contact_stiffness
        stiction, followed = "none", f"{verdict.saturated_cycle:.3g}"
        if cycle.peak_to_peak:
            stiction = f"{cycle.peak_to_peak:.4g} every {cycle.period:.3g} s by (5.8), (5.9)"
            if verdict.saturated_cycle and verdict.stable_error:
                stiction += f", {followed} by simulation"
            stiction += f"; a deadband of {cycle.deadband:.3g} removes it"
        undecided = verdict.undecided_error
        lines = [
            f"domain {verdict.domain}: {MEANING[verdict.domain]}",
            UNITS,
            f"margin: {1.0 / part:.4g}; largest linearly stable gain: {verdict.margin:.4g}",
            f"largest safe error: {verdict.stable_error:.4g}; saturation of the loop: {self.loop.error_limit:.4g}",
            *([] if verdict.domain is Domain.III else [f"limit cycle of stiction: {stiction}"]),  # has another one
            f"in figure 5.8, not sampled: gamma {self.gamma:.3g}, zeta {self.zeta:.3g}, k_tr/k_c {ratio:.3g}",
            ASSUMED,
        ]
        if undecided > verdict.stable_error:
            lines.append(
                f"undecided: up to {undecided:.4g} all responses that were followed to their end come to rest, but "
                f"some were not followed to their end ({DESIGN.patient_events} events)"
            )
        lower = f"lower the gain to {rounded_down(DESIGN.close * verdict.margin):g}, {DESIGN.close:g} of the largest"
        if verdict.saturated_cycle and not verdict.stable_error:
            lines.append(f"friction keeps up a limit cycle, peak to peak: {followed}")
            lower = "lower the gain or the delay"
        if not self.is_safe:
            error = rounded_down(verdict.stable_error)
            saturate = f", or saturate the error at {error:g}" if error else ""
            finding = "not shown to be safe" if self.loop.error_limit <= undecided else "not safe"
            lines.append(f"{finding}: {lower}{saturate}")
        elif DESIGN.close < part <= 1.0:
            lines.append(f"close to the margin: a plant that differs a little may be unstable; {lower}")
        return "\n".join(lines)


MEANING = {
    Domain.I: "without friction stable for every error",
    Domain.II: "friction stabilises it for small errors",
    Domain.BEYOND: "undecided: no error was shown to be safe, and not all were shown to be unsafe",
    Domain.III: "unstable: at every error that was tried, some response does not come to rest",
}


def loop_design(node: FrictionNode, loop: IntegralLoop, rate: float = 0.0, delay: float = 0.0) -> LoopDesign:
    """Assess a loop on a plant; units are free but consistent (N, m, s or N m, rad, s).

    Parameters
    ----------
    node : inertia, damping, stiffness of transmission and contact, friction.
    loop : G_I, saturation and deadband.
    rate : of the samples, Hz; 0 for a continuous loop.
    delay : from a sample to its command, s.

    Raises
    ------
    ValueError
        where the damping is 0, a rate or delay is below 0, the delay has no rate or more than `longest_delay` periods,
        or a number is beyond `DESIGN.absurd`.
    """
    if not node.damping > 0.0:
        raise ValueError(f"damping is {node.damping:g}; without damping no gain is stable, give one above 0")
    for name, value in (("rate", rate), ("delay", delay)):
        if not 0.0 <= value < math.inf:
            raise ValueError(f"{name} is {value:g}; it must be 0 or more")
    given = {f.name: getattr(one, f.name) for one in (node, loop) for f in fields(one)} | {"rate": rate, "delay": delay}
    for name, value in given.items():
        if 0.0 < abs(value) < 1.0 / DESIGN.absurd or DESIGN.absurd < abs(value) < math.inf:
            raise ValueError(f"{name} is {value:g}; it must be between {1.0 / DESIGN.absurd:g} and {DESIGN.absurd:g}")
    if delay and not rate:
        raise ValueError(f"delay is {delay:g} s and rate is 0; give the rate of the samples, Hz")
    samples = math.ceil(delay * rate - 1e-9)
    if samples > DESIGN.longest_delay:
        raise ValueError(
            f"delay is {delay:g} s, {samples} periods; allowed: {DESIGN.longest_delay} periods, "
            f"{DESIGN.longest_delay / rate:g} s"
        )
    sampled = replace(loop, sample_period=1.0 / rate if rate else 0.0, delay_samples=samples)
    plant = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    zeta = float(damping_ratio(*plant))
    gamma = float(gain_ratio(loop.gain, *plant))
    try:
        with np.errstate(over="raise", invalid="raise"):
            return LoopDesign(node, sampled, gamma, zeta, friction_verdict(node, sampled, DESIGN.patient_events))
    except ArithmeticError:
        worst = max((name for name in given if 0.0 < given[name] < math.inf), key=lambda n: abs(math.log(given[n])))
        raise ValueError(
            f"{worst} is {given[worst]:g}; compared with the other numbers it is too far off to compute"
        ) from None
