"""Section 5.6: what friction, step size, saturation and delay do to the stable gain."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from wam_analysis.experiments.one_link import (
    ACROSS,
    Growth,
    OneLink,
    asked,
    fate,
    growth,
    last_cycle,
    one_link,
    predicted_outcome,
    response,
    set_until,
)
from wam_analysis.experiments.recording import Recording, Step
from wam_analysis.experiments.rows import Curve, Panel, Result, Row
from wam_control.force_loop_parameters import ForceLoopParameters, force_law, task_of
from wam_control.stability_guard import StabilityGuard
from wam_control.velocity_loop import VelocityLoopParameters
from wam_theory.stick_slip import Verdict, simulate

TRANSIENT = 0.4  # s after a step until only the growing mode is left
WITHIN = 0.02
CYCLE = 0.05  # of a cycle that is approached for a long time
PLAIN = 2  # steps of a run whose last one is drawn with its prediction
ROUNDING = 1e-9  # s


def story(runs: Mapping[str, Recording]) -> Result:
    """Every run of the experiment `testbed-5.6`."""
    rows = margin(runs["below_the_margin"], runs["above_the_margin"], "answered within the sample")
    for name in ("rod", "large_step", "large_step_saturated"):
        rows += fates(runs[name], name.replace("_", " "))
    rows += margin(runs["late_below_the_margin"], runs["late_above_the_margin"], "one sample late")
    for name in ("late_with_rod_at_0.8", "late_with_rod_at_0.9"):
        rows += fates(runs[name], name.replace("_", " "))
    panels = [
        _panel(runs, ("below_the_margin", "above_the_margin"), "0.95 and 1.05 of the margin"),
        _panel(runs, ("rod",), "1.5 of the margin, rod on; taken away at the end"),
        _panel(runs, ("large_step", "large_step_saturated"), "10 lb, rod on, 1.5 of the margin"),
        _panel(runs, ("late_with_rod_at_0.8", "late_with_rod_at_0.9"), "one sample late, rod on"),
    ]
    return Result(rows, panels)


def large_step(runs: Mapping[str, Recording]) -> Result:
    """The run of a large step alone: what becomes of it."""
    rows = [row for name, run in runs.items() for row in fates(run, name.replace("_", " "))]
    return Result(rows, [_panel(runs, tuple(runs), "large step")])


def own_servo(runs: Mapping[str, Recording]) -> Result:
    """The experiment `testbed-own-servo`: the margin with the testbed's velocity loop, no ideal source."""
    below, above = runs["below_the_margin"], runs["above_the_margin"]
    ideal = margin(below, above, "")[0]
    with_servo = margin_with_servo(below)
    rows = [
        ideal._replace(quantity="marginal gain, beside that of an ideal velocity source", bound=math.nan),
        ideal._replace(
            quantity="marginal gain, with the velocity loop", predicted=with_servo, equation="wam_control.sampled_loop"
        ),
    ]
    panel = Panel(
        "either side of the margin",
        "time [s]",
        "force by deflection [N]",
        [_last_step(name.replace("_", " "), run) for name, run in runs.items()],
    )
    return Result(rows, [panel])


def own_servo_sample(runs: Mapping[str, Recording]) -> Result:
    """A run of `testbed-own-servo` alone: whether it shakes, by the margin with the velocity loop."""
    ((name, run),) = runs.items()
    link, shaken = _shaking(run)
    share = link.tip_gain(link.loop.gain) / margin_with_servo(run)
    row = _sense(share, shaken, "with the velocity loop", "wam_control.sampled_loop")
    shown = _last_step(name.replace("_", " "), run)
    return Result([row], [Panel("above the margin", "time [s]", "force by deflection [N]", [shown])])


def _sense(share: float, shaken: Growth, how: str, law: str) -> Row:
    """Whether an oscillation does what it should at this share of the marginal gain."""
    expected = "decays" if share < 1.0 else "grows"
    return Row(f"at {share:.2f} of it, {how}", expected, "grows" if shaken.rate > 0.0 else "decays", "", 0.0, law)


def _last_step(label: str, run: Recording) -> Curve:
    shown = response(run, one_link(run), run.steps[-1])
    return Curve("measured", label, shown.time, shown.force)


def margin_with_servo(run: Recording) -> float:
    """Marginal G_I at the tip, m/s/N, of the sampled loop with the velocity loop and the damping of the cable."""
    parameters = run.node("force_loop", ForceLoopParameters)
    servo = run.node("velocity_loop", VelocityLoopParameters)
    guard = replace(
        parameters.guard, servo_proportional=servo.proportional_gain, servo_integral=servo.integral_gain, late=0
    )
    found = StabilityGuard(run.shared.arm, run.shared.timing, guard)
    touches = found.touches(guard.posture, parameters.contact_cover, parameters.contact_place)
    law = force_law(parameters)
    return law.gain[ACROSS] * found.judge(task_of(parameters, law), touches).scale


def margin(below: Recording, above: Recording, how: str) -> list[Row]:
    """Marginal gain and frequency, between a run whose last step decays and one whose grows."""
    (link, first), (other, second) = (_shaking(run) for run in (below, above))
    predicted = link.margin
    share = -first.rate / (second.rate - first.rate)
    gain = link.loop.gain + share * (other.loop.gain - link.loop.gain)
    frequency = first.frequency + share * (second.frequency - first.frequency)
    of, law = f"marginal gain, {how}", "(5.15) sampled"
    rows = [
        Row(of, link.tip_gain(predicted.gain), link.tip_gain(gain), "m/s/N", WITHIN, law),
        Row(f"frequency at it, {how}", predicted.frequency, frequency, "rad/s", WITHIN, law),
    ]
    for one, shaken in ((link, first), (other, second)):
        rows.append(_sense(one.loop.gain / one.margin.gain, shaken, how, law))
    return rows


def _shaking(run: Recording) -> tuple[OneLink, Growth]:
    """The loop in the last step, and how its oscillation grows after the transient."""
    link = one_link(run, set_until(run, run.steps[-1]))
    shown = response(run, link, run.steps[-1])
    late = shown.time > shown.time[0] + TRANSIENT
    return link, growth(shown.time[late], shown.force[late])


def fates(run: Recording, name: str) -> list[Row]:
    """What becomes of each step of a run, judged from its first instant by the exact integrator."""
    rows: list[Row] = []
    for step in run.steps:
        if _is_pushed(run, step):
            continue
        link = one_link(run, set_until(run, step))
        shown = response(run, link, step)
        outcome = predicted_outcome(link, shown, asked(run, step.begin))
        label, law = f"{name}, {step.name}", "(5.14)-(5.17)"
        rows.append(Row(label, str(outcome.verdict), fate(run, step, shown), equation=law))
        if outcome.verdict is Verdict.LIMIT_CYCLE:
            found = last_cycle(shown.time, shown.force)
            rows.append(
                Row(f"{label}, peak to peak", outcome.peak_to_peak / link.lever, found.peak_to_peak, "N", CYCLE)
            )
            rows.append(Row(f"{label}, period", outcome.period, found.period, "s", CYCLE))
    return rows


def _is_pushed(run: Recording, step: Step) -> bool:
    push = run.forces("sim/disturbance")
    during = (push.time >= step.begin) & (push.time < step.end - ROUNDING)
    return bool(push.force[during].any())


def _panel(runs: Mapping[str, Recording], names: Sequence[str], title: str) -> Panel:
    """Forces over time; the exact response of the last step, where it begins at rest, beside them."""
    curves = []
    for name in names:
        run = runs[name]
        step = run.steps[-1]
        link = one_link(run, set_until(run, step))
        is_plain = len(run.steps) <= PLAIN
        last = response(run, link, step)
        shown = last if is_plain else response(run, link)
        curves.append(Curve("measured", name.replace("_", " "), shown.time, shown.force))
        if is_plain:
            exact = simulate(
                link.node, link.loop, asked(run, step.begin) * link.lever, np.ptp(last.time), link.state(last)
            )
            curves.append(
                Curve("predicted", "", last.time, exact.at(last.time - last.time[0]).contact_force / link.lever)
            )
    return Panel(title, "time [s]", "force by deflection [N]", curves)
