"""Section 5.6: effect of friction, step size, saturation and delay on the stable gain."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from wam_analysis.measures.limit_cycle import last_cycle
from wam_control.force.force_loop_parameters import ForceLoopParameters, force_law, task_of
from wam_control.force.stability_guard import StabilityGuard
from wam_description.arm import Servo
from wam_studies.figures.panels import Panel
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import ACROSS, Growth, OneLink, growth, played
from wam_studies.thesis.recording import Recording, Runs, Step
from wam_studies.thesis.rows import Comparison, Result, near
from wam_studies.thesis.step_response import errors_at_rest, exact_ratio
from wam_theory.stick_slip import Verdict, assess

AXES = "time [s]", "force by deflection [N]"
SAMPLED = "wam_control.force.sampled_loop"


def section_5_6(runs: Runs) -> Result:
    """Every run of the experiment `testbed-5.6`, or one of them."""
    if len(runs) == 1:
        return Result(_verdicts(runs, runs), [_panel(runs, runs, "large step")])
    rows = margin(runs["below_the_margin"], runs["above_the_margin"], "without delay")
    rows += _verdicts(runs, ("rod", "large_step", "large_step_saturated"))
    rows += margin(runs["delayed_below_the_margin"], runs["delayed_above_the_margin"], "one sample of delay")
    rows += _verdicts(runs, ("delayed_with_rod_at_0.8", "delayed_with_rod_at_0.9"))
    panels = [
        _panel(runs, ("below_the_margin", "above_the_margin"), "0.95 and 1.05 of the margin"),
        _panel(runs, ("rod",), "1.5 of the margin, with rod, removed at the end"),
        _panel(runs, ("large_step", "large_step_saturated"), "10 lb, with rod, 1.5 of the margin"),
        _panel(runs, ("delayed_with_rod_at_0.8", "delayed_with_rod_at_0.9"), "one sample of delay, with rod"),
    ]
    return Result(rows, panels)


def as_described(runs: Runs) -> Result:
    """The experiment `testbed-5.6-as-described`: verdict on every step and push, and of all runs the margin."""
    rows = _verdicts(runs, runs)
    if len(runs) > 1:
        (link, low), (other, high) = (_ratio_at_rest(runs[f"rod_{side}_the_new_margin"]) for side in ("below", "above"))
        gain = link.loop.gain + (other.loop.gain - link.loop.gain) * (1.0 - low) / (high - low)
        expected = friction_margin(link, BOUNDS.small_step)
        rows += [
            near("marginal gain with the rod", link.tip_gain(expected), link.tip_gain(gain), "m/s/N", "integrator"),
            near("over that without", expected / link.margin.gain, gain / link.margin.gain, "", "5.6"),
        ]
    return Result(rows, [_panel(runs, (name,), name.replace("_", " ")) for name in runs])


def _ratio_at_rest(run: Recording) -> tuple[OneLink, float]:
    """The loop of the last step, and the median ratio of the errors at successive standstills in it, Psi."""
    shown = played(run, run.steps[-1])
    errors = np.abs(errors_at_rest(shown))
    return shown.link, float(np.median(errors[1:] / errors[:-1]))


def friction_margin(link: OneLink, step: float) -> float:
    """G_I at the joint at which the errors of a small step, N, neither grow nor shrink with friction, within 0.1 %."""
    low, high = link.margin.gain, 10.0 * link.margin.gain
    while high > 1.001 * low:
        middle = math.sqrt(low * high)
        grows = abs(exact_ratio(link._replace(loop=replace(link.loop, gain=middle)), step)) > 1.0
        low, high = (low, middle) if grows else (middle, high)
    return low


def own_servo(runs: Runs) -> Result:
    """The experiment `testbed-own-servo`: the margin with the testbed's velocity loop instead of an ideal source.

    Of one run growth or decay by that margin.
    """
    below, *others = runs.values()
    with_servo = margin_with_servo(below)
    if others:
        ideal = margin(below, others[0], "")[0]
        rows = [
            ideal._replace(quantity="marginal gain, compared with that of an ideal velocity source", bound=math.nan),
            ideal._replace(quantity="marginal gain, with the velocity loop", predicted=with_servo, equation=SAMPLED),
        ]
    else:
        link, oscillation = _oscillation(below)
        fraction = link.tip_gain(link.loop.gain) / with_servo
        rows = [_growth_row(fraction, oscillation, "with the velocity loop", SAMPLED)]
    return Result(rows, [_last_steps("either side of the margin" if others else "above the margin", runs)])


def _growth_row(fraction: float, oscillation: Growth, how: str, law: str) -> Comparison:
    """Growth or decay of an oscillation at this fraction of the marginal gain."""
    expected, found = (("decays", "grows")[grows] for grows in (fraction >= 1.0, oscillation.rate > 0.0))
    return Comparison(f"at {fraction:.2f} of the margin, {how}", expected, found, equation=law)


def _last_steps(title: str, runs: Runs) -> Panel:
    lines = [(name.replace("_", " "), played(run, run.steps[-1]).line) for name, run in runs.items()]
    return Panel(title, *AXES, lines)


def margin_with_servo(run: Recording) -> float:
    """Marginal G_I at the tip, m/s/N, of the sampled loop with the velocity loop and the damping of the cable."""
    parameters = run.node("force_loop", ForceLoopParameters)
    servo = run.part("velocity_loop", "servo", Servo)
    guard = replace(parameters.guard, extra_delay=0)
    found = StabilityGuard(run.shared.arm, servo, run.shared.timing, guard, parameters.sensing)
    touches = found.contacts(guard.posture, parameters.contact_cover, parameters.contact_position, 0.0)
    law = force_law(parameters)
    return law.gain[ACROSS] * found.assess(task_of(parameters, law), touches).scale


def margin(below: Recording, above: Recording, how: str) -> list[Comparison]:
    """Marginal gain and frequency, between a run whose last step decays and one whose grows."""
    (link, first), (other, second) = (_oscillation(run) for run in (below, above))
    predicted = link.margin
    fraction = -first.rate / (second.rate - first.rate)
    gain = link.loop.gain + fraction * (other.loop.gain - link.loop.gain)
    frequency = first.frequency + fraction * (second.frequency - first.frequency)
    of, law = f"marginal gain, {how}", "(5.15) sampled"
    rows = [
        near(of, link.tip_gain(predicted.gain), link.tip_gain(gain), "m/s/N", law),
        near(f"frequency at the margin, {how}", predicted.frequency, frequency, "rad/s", law),
    ]
    for one, oscillation in ((link, first), (other, second)):
        rows.append(_growth_row(one.loop.gain / one.margin.gain, oscillation, how, law))
    return rows


def _oscillation(run: Recording) -> tuple[OneLink, Growth]:
    """The loop in the last step, and the growth of its oscillation after the transient."""
    shown = played(run, run.steps[-1])
    late = shown.time > shown.time[0] + BOUNDS.mode_transient
    return shown.link, growth(shown.time[late], shown.force[late])


def _verdicts(runs: Runs, names: Iterable[str]) -> list[Comparison]:
    """Verdict on each step of these runs, predicted from its initial state by the exact integrator."""
    rows: list[Comparison] = []
    for name, step in [(run, step) for run in names for step in runs[run].steps]:
        if _is_pushed(runs[name], step):
            continue
        shown, label = played(runs[name], step), f"{name.replace('_', ' ')}, {step.name}"
        link = shown.link
        outcome = assess(link.node, link.loop, shown.desired * link.lever, start=shown.start)
        rows.append(Comparison(label, str(outcome.verdict), shown.verdict, equation="(5.14)-(5.17)"))
        if outcome.verdict is Verdict.LIMIT_CYCLE:
            found, swing = last_cycle(shown.time, shown.force), outcome.peak_to_peak / link.lever
            rows += [
                near(f"{label}, peak to peak", swing, found.peak_to_peak, "N", within=BOUNDS.long_cycle),
                near(f"{label}, period", outcome.period, found.period, "s", within=BOUNDS.long_cycle),
            ]
    return rows


def _is_pushed(run: Recording, step: Step) -> bool:
    return bool(run.forces("sim/disturbance").during(step.begin, step.end - BOUNDS.rounding).force.any())


def _panel(runs: Runs, names: Iterable[str], title: str) -> Panel:
    """Forces over time, with the exact response of the last step if it starts at rest."""
    curves = []
    for name in names:
        run = runs[name]
        is_plain = len(run.steps) <= BOUNDS.plain_steps
        shown = played(run, run.steps[-1] if is_plain else None)
        curves.append((name.replace("_", " "), shown.line))
        if is_plain:
            curves.append(shown.exact_line(shown.start))
    return Panel(title, *AXES, curves)
