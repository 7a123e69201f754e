"""Step responses of integral force control: (5.2), (5.3), and the half cycles of (5.17) and (5.18)."""

import math
from itertools import pairwise

import numpy as np

from wam_studies.figures.panels import Numbers, Panel
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import OneLink, TestbedStep, played
from wam_studies.thesis.recording import Runs
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.linear_loop import integral_time_constant, series_stiffness
from wam_theory.regimes import gamma_a, gamma_b, psi
from wam_theory.stick_slip import Kind, simulate
from wam_theory.stiction import breakaway_delay


def responses(runs: Runs) -> Result:
    """The experiment `step-response`."""
    rows, panels = [], []
    for name, run in runs.items():
        shown = played(run, run.steps[-1])
        link, label, exact = shown.link, name.replace("_", " "), shown.exact_line()
        rows += _first(label, shown)
        largest = float(np.abs(shown.force - exact[1].y).max()) / shown.desired
        rows.append(below(f"{label}, largest difference from the exact response", largest, "of step", BOUNDS.within))
        curves = [("measured", shown.line), exact]
        panels.append(Panel(f"{label}, gamma {link.gamma:.2f}: {domain(link)}", "time [s]", "force [N]", curves))
    return Result(rows, panels)


def domain(link: OneLink) -> str:
    """Kind of the response by gamma (the ranges between gamma_a, gamma_b and 1)."""
    if not link.node.static_friction:
        return "linear"
    kinds = {"one slip": float(gamma_a(link.zeta)), "stairs from one side": float(gamma_b(link.zeta))}
    kinds |= {"domain I, overshoots": 1.0, "domain II, III": math.inf}
    return next(kind for kind, bound in kinds.items() if link.gamma < bound)


def _first(label: str, shown: TestbedStep) -> list[Comparison]:
    """Quantities with a closed form: time constant, delay, and ratio of the first two errors at rest."""
    link, node, gain, force = shown.link, shown.link.node, shown.link.loop.gain, shown.desired
    if not node.static_friction:
        stiffness = series_stiffness(node.transmission_stiffness, node.contact_stiffness)
        constant = integral_time_constant(gain, stiffness)
        return [near(f"{label}, time constant", constant, time_constant(shown), "s", "(5.2)")]
    delay = float(breakaway_delay(gain, node.transmission_stiffness, node.static_friction, force * link.lever))
    moves = shown.time[np.flatnonzero(np.abs(shown.speed) > BOUNDS.stuck_speed)[0]] - shown.time[0]
    rows = [Comparison(f"{label}, delay", delay, float(moves), "s", BOUNDS.slip_delay, "(5.3)", True)]
    errors = errors_at_rest(shown)
    if link.gamma > float(gamma_a(link.zeta)) and len(errors) > 1:
        ratio, quantity = errors[1] / errors[0], f"{label}, error at the second rest over the first"
        rows += [
            near(quantity, -psi(link.gamma, link.zeta), ratio, "", "(5.18)", BOUNDS.sample_and_hold),
            near(f"{quantity}, sampled", exact_ratio(link, force), ratio, "", "integrator"),
        ]
    return rows


def exact_ratio(link: OneLink, force: float) -> float:
    """Error at the second rest over that at the first, of the exact response of the sampled loop."""
    trajectory = simulate(link.node, link.loop, force * link.lever, BOUNDS.standstills_until)
    rests = [force * link.lever - event.contact_force for event in trajectory.events if event.kind is Kind.STICK]
    return rests[1] / rests[0]


def time_constant(shown: TestbedStep) -> float:
    """1/e time of the error, s, from a line through its logarithm between 0.8 and 0.1 of the step."""
    left = 1.0 - shown.force / shown.desired
    part = (left < 0.8) & (left > 0.1)
    if part.sum() < 3:
        return math.nan
    return float(-1.0 / np.polyfit(shown.time[part], np.log(left[part]), 1)[0])


def errors_at_rest(shown: TestbedStep) -> Numbers:
    """Error, N, in each standstill after the first slip."""
    resting, desired = np.abs(shown.speed) < BOUNDS.stuck_speed, shown.desired
    edges = np.flatnonzero(np.diff(resting.astype(int)))
    found = []
    for begin, end in pairwise([*(edges + 1).tolist(), len(resting)]):
        if resting[begin] and shown.time[end - 1] - shown.time[begin] > BOUNDS.shortest_standstill:
            found.append(desired - float(np.median(shown.force[begin:end])))
    return np.array(found)
