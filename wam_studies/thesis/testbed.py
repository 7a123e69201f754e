"""Section 5.6: effect of friction, step size, saturation and delay on the stable gain."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from wam_analysis.measures.swings import swings
from wam_control.force.force_loop_parameters import ForceLoopParameters, force_law, task_of
from wam_control.force.stability_guard import StabilityGuard
from wam_description.arm import Servo
from wam_studies.exact_cycles import last_cycle
from wam_studies.figures.panels import Numbers, Panel
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import ACROSS, OneLink, TestbedStep, one_link, played
from wam_studies.thesis.recording import Recording, Runs, Step
from wam_studies.thesis.rows import Comparison, Result, near, noted
from wam_theory.stick_slip import Kind, Verdict, assess, simulate
from wam_theory.velocity_servo import largest_scale

AXES = "time [s]", "force by deflection [N]"
GROUPS = {  # of the runs of `testbed-5.6`
    "without delay": ("below_the_margin", "above_the_margin"),
    "1.5 of the margin, with rod, removed at the end": ("rod",),
    "10 lb, with rod, 1.5 of the margin": ("large_step", "large_step_saturated"),
    "one sample of delay": ("delayed_below_the_margin", "delayed_above_the_margin"),
    "one sample of delay, with rod": ("delayed_with_rod_at_0.8", "delayed_with_rod_at_0.9"),
}


def section_5_6(runs: Runs) -> Result:
    """Every run of the experiment `testbed-5.6`, or some of them."""
    rows, panels = [], []
    for title, names in GROUPS.items():
        if own := {name: runs[name] for name in names if name in runs}:
            rows += margin(own, title) if "margin" in names[0] else _verdicts(own)
            panels.append(_panel(own, title))
    return Result(rows, panels)


def as_described(runs: Runs) -> Result:
    """The experiment `testbed-5.6-as-described`: verdict on every step and push, and of all runs the margin."""
    rows = _verdicts(runs)
    if len(runs) > 1:
        (link, low), (other, high) = (_ratio_at_rest(runs[f"rod_{side}_the_new_margin"]) for side in ("below", "above"))
        gain = link.loop.gain + (other.loop.gain - link.loop.gain) * (1.0 - low) / (high - low)
        expected = friction_margin(link, BOUNDS.small_step)
        rows += [
            near("marginal gain with the rod", link.tip_gain(expected), link.tip_gain(gain), "m/s/N", "integrator"),
            near("over that without", expected / link.margin.gain, gain / link.margin.gain, "", "5.6"),
        ]
    return Result(rows, [_panel({name: run}, name.replace("_", " ")) for name, run in runs.items()])


def _ratio_at_rest(run: Recording) -> tuple[OneLink, float]:
    """The loop of the last step, and the median ratio of the errors at successive standstills in it, Psi."""
    shown = played(run, run.steps[-1])
    errors = np.abs(errors_at_rest(shown))
    return shown.link, float(np.median(errors[1:] / errors[:-1]))


def friction_margin(link: OneLink, step: float) -> float:
    """G_I at the joint at which the errors of a small step, N, neither grow nor shrink with friction, within 0.1 %."""

    def shrinks(gain: float) -> bool:
        return abs(exact_ratio(link._replace(loop=replace(link.loop, gain=gain)), step)) <= 1.0

    return largest_scale(shrinks, 10.0 * link.margin.gain)


def exact_ratio(link: OneLink, force: float) -> float:
    """Error at the second rest over that at the first, of the exact response of the sampled loop; inf without rest."""
    trajectory = simulate(link.node, link.loop, force * link.lever, BOUNDS.standstills_until)
    rests = [force * link.lever - event.contact_force for event in trajectory.events if event.kind is Kind.STICK]
    return rests[1] / rests[0] if len(rests) > 1 else math.inf


def errors_at_rest(shown: TestbedStep) -> Numbers:
    """Error, N, in each standstill after the first slip."""
    resting, desired = np.abs(shown.speed) < BOUNDS.stuck_speed, shown.desired
    edges = np.flatnonzero(np.diff(resting.astype(int)))
    found = []
    for begin, end in pairwise([*(edges + 1).tolist(), len(resting)]):
        if resting[begin] and shown.time[end - 1] - shown.time[begin] > BOUNDS.shortest_standstill:
            found.append(desired - float(np.median(shown.force[begin:end])))
    return np.array(found)


def own_servo(runs: Runs) -> Result:
    """The experiment `testbed-own-servo`: the margin with the testbed's velocity loop instead of an ideal source."""
    title, first = "with the velocity loop", next(iter(runs.values()))
    ideal, rows = one_link(first), margin(runs, title, margin_with_servo(first))
    if len(runs) > 1:
        known = ideal.tip_gain(ideal.margin.gain)
        rows.append(noted("the same over that of an ideal velocity source", float(rows[-1].measured) / known, ""))
    lines = [(name.replace("_", " "), played(run, run.steps[-1]).line) for name, run in runs.items()]
    return Result(rows, [Panel(title, *AXES, lines)])


def margin_with_servo(run: Recording) -> float:
    """Marginal G_I at the tip, m/s/N, of the sampled loop with the velocity loop and the damping of the cable."""
    parameters = run.parameters.part("force_loop", ForceLoopParameters)
    servo = run.parameters.part("velocity_loop", Servo, "servo.")
    guard = replace(parameters.guard, extra_delay=0)
    found = StabilityGuard(run.shared.arm, servo, run.shared.timing, guard, parameters.sensing)
    touches = found.contacts(guard.posture, parameters.contact_cover, parameters.contact_position, 0.0)
    law = force_law(parameters)
    return law.gain[ACROSS] * found.assess(task_of(parameters), tuple(touches)).scale


def margin(runs: Runs, how: str, with_servo: float = math.nan) -> list[Comparison]:
    """Whether the last step of each run grows, and of one that decays and one that grows what is at the margin.

    Parameters
    ----------
    with_servo : predicted margin, G_I at the tip, m/s/N; NaN for (5.15) of the sampled loop.
    """
    law = "(5.15) sampled" if math.isnan(with_servo) else "wam_control.force.sampled_loop"
    gains, trends, rows = [], [], []
    for run in runs.values():
        shown = played(run, run.steps[-1])
        late, link = shown.time > shown.time[0] + BOUNDS.mode_transient, shown.link
        ideal = link.margin
        predicted = link.tip_gain(ideal.gain) if math.isnan(with_servo) else with_servo
        found = swings(shown.time[late], shown.force[late], BOUNDS.least_swing)
        gains.append(link.tip_gain(link.loop.gain))
        trends.append((math.log(found.growth), 2.0 * math.pi / found.period))
        expected, seen = (("decays", "grows")[grows] for grows in (gains[-1] >= predicted, found.growth > 1.0))
        label = f"at {gains[-1] / predicted:.2f} of the margin, {how}"
        rows.append(Comparison(label, expected, seen, equation=law))
    if len(runs) > 1:
        rates, frequencies = zip(*trends, strict=True)
        gain, frequency = (float(np.interp(0.0, rates, values)) for values in (gains, frequencies))
        if math.isnan(with_servo):
            rows.append(near(f"frequency at the margin, {how}", ideal.frequency, frequency, "rad/s", law))
        rows.append(near(f"marginal gain, {how}", predicted, gain, "m/s/N", law))
    return rows


def _verdicts(runs: Runs) -> list[Comparison]:
    """Verdict on each step of these runs, predicted from its initial state by the exact integrator."""
    rows: list[Comparison] = []
    for name, run in runs.items():
        for step in run.steps:
            if _is_pushed(run, step):
                continue
            shown, label = played(run, step), f"{name.replace('_', ' ')}, {step.name}"
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


def _panel(runs: Runs, title: str) -> Panel:
    """Forces over time, with the exact response of the last step if it starts at rest."""
    curves = []
    for name, run in runs.items():
        is_plain = len(run.steps) <= BOUNDS.plain_steps
        shown = played(run, run.steps[-1] if is_plain else None)
        curves.append((name.replace("_", " "), shown.line))
        if is_plain:
            curves.append(shown.exact_line(shown.start))
    return Panel(title, *AXES, curves)
