"""Step responses of integral force control: (5.2), (5.3), and the half cycles of (5.17) and (5.18)."""

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import MeasuredResponse, OneLink, desired_force, one_link, response
from wam_studies.thesis.recording import Recording
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.linear_loop import integral_time_constant, series_stiffness
from wam_theory.regimes import gamma_a, gamma_b, psi
from wam_theory.stick_slip import Kind, simulate
from wam_theory.stiction import breakaway_delay


def responses(runs: Mapping[str, Recording]) -> Result:
    """The experiment `step-response`."""
    rows, panels = [], []
    for name, run in runs.items():
        link = one_link(run)
        shown = response(run, link, run.steps[-1])
        force = desired_force(run, shown.time[0])
        exact = simulate(link.node, link.loop, force * link.lever, float(np.ptp(shown.time)))
        predicted = exact.at(shown.time - shown.time[0]).contact_force / link.lever
        label = name.replace("_", " ")
        rows += _first(label, link, shown, force)
        largest = float(np.abs(shown.force - predicted).max()) / force
        rows.append(below(f"{label}, largest difference from the exact response", largest, "of step", BOUNDS.within))
        curves = [
            ("measured", measured(shown.time, shown.force)),
            ("exact", line_only(shown.time, predicted)),
        ]
        panels.append(Panel(f"{label}, gamma {link.gamma:.2f}: {domain(link)}", "time [s]", "force [N]", curves))
    return Result(rows, panels)


def domain(link: OneLink) -> str:
    """Kind of the response by gamma (the ranges between gamma_a, gamma_b and 1)."""
    if not link.node.static_friction:
        return "linear"
    low, high = float(gamma_a(link.zeta)), float(gamma_b(link.zeta))
    if link.gamma < low:
        return "one slip"
    return (
        "stairs from one side"
        if link.gamma < high
        else "domain I, overshoots"
        if link.gamma < 1.0
        else "domain II, III"
    )


def _first(label: str, link: OneLink, shown: MeasuredResponse, force: float) -> list[Comparison]:
    """Quantities with a closed form: time constant, delay, and ratio of the first two errors at rest."""
    node, gain = link.node, link.loop.gain
    stiffness = node.transmission_stiffness, node.contact_stiffness
    if not node.static_friction:
        constant = float(integral_time_constant(gain, series_stiffness(*stiffness)))
        return [near(f"{label}, time constant", constant, time_constant(shown, force), "s", "(5.2)")]
    delay = float(breakaway_delay(gain, node.transmission_stiffness, node.static_friction, force * link.lever))
    moves = shown.time[np.flatnonzero(np.abs(shown.speed) > BOUNDS.stuck_speed)[0]] - shown.time[0]
    rows = [Comparison(f"{label}, delay", delay, float(moves), "s", BOUNDS.slip_delay, "(5.3)", True)]
    errors = errors_at_rest(shown, force)
    if link.gamma > float(gamma_a(link.zeta)) and len(errors) > 1:
        ratio = float(-psi(link.gamma, link.zeta))
        exact = exact_ratio(link, force)
        quantity = f"{label}, error at the second rest over the first"
        rows.append(near(quantity, ratio, errors[1] / errors[0], "", "(5.18)", BOUNDS.sample_and_hold))
        rows.append(near(f"{quantity}, sampled", exact, errors[1] / errors[0], "", "integrator"))
    return rows


def exact_ratio(link: OneLink, force: float) -> float:
    """Error at the second rest over that at the first, of the exact response of the sampled loop."""
    trajectory = simulate(link.node, link.loop, force * link.lever, BOUNDS.standstills_until)
    rests = [force * link.lever - event.contact_force for event in trajectory.events if event.kind is Kind.STICK]
    return rests[1] / rests[0]


def time_constant(shown: MeasuredResponse, force: float) -> float:
    """1/e time of the error, s, from a line through its logarithm between 0.8 and 0.1 of the step."""
    left = 1.0 - shown.force / force
    part = (left < 0.8) & (left > 0.1)
    if part.sum() < 3:
        return math.nan
    return float(-1.0 / np.polyfit(shown.time[part], np.log(left[part]), 1)[0])


def errors_at_rest(shown: MeasuredResponse, force: float) -> Numbers:
    """Error, N, in each standstill after the first slip."""
    resting = np.abs(shown.speed) < BOUNDS.stuck_speed
    edges = np.flatnonzero(np.diff(resting.astype(int)))
    bounds = [0, *(edges + 1).tolist(), len(resting)]
    found = []
    for begin, end in pairwise(bounds):
        if resting[begin] and begin > 0 and shown.time[end - 1] - shown.time[begin] > BOUNDS.shortest_standstill:
            found.append(force - float(np.median(shown.force[begin:end])))
    return np.array(found)
