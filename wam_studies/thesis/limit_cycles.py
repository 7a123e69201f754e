"""The limit cycles of chapter 5: by stiction, (5.8) and (5.9), and of the actuator alone, (5.20) to (5.22)."""

from dataclasses import replace

import numpy as np

from wam_studies.exact_cycles import CycleExtent, last_cycle
from wam_studies.figures.panels import Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import OneLink, TestbedStep, played
from wam_studies.thesis.recording import Runs
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.regimes import actuator_cycle, actuator_cycle_power, actuator_cycle_work
from wam_theory.stick_slip import assess
from wam_theory.stiction import stiction_cycle_force, stiction_cycle_number, stiction_cycle_period


def stiction(runs: Runs) -> Result:
    """The experiment `stiction-limit-cycle`; of a sample, without the start, (5.8) and (5.9)."""
    shown, *others = (played(run, run.steps[-1] if run.steps else None) for run in runs.values())
    found = last_cycle(shown.time, shown.force)
    rows, remark = _closed_form(shown.link, found)
    curves = [("without deadband", shown.line)]
    if others:
        quiet, smaller = others
        force = float(rows[0].predicted)
        curve = shown.exact_line(is_sampled=False)
        exact = last_cycle(shown.time, curve[1].y)
        rows += [
            near("F_c peak to peak, exact", exact.peak_to_peak, found.peak_to_peak, "N", "integrator"),
            near("period, exact", exact.period, found.period, "s", "integrator"),
            *_with_deadband(quiet, force),
            _with_smaller_deadband(smaller, force),
        ]
        curves += [curve, ("with deadband", played(quiet.run).line)]
    return Result(rows, [Panel("stiction limit cycle", "time [s]", "force [N]", curves)], (remark,))


def _closed_form(link: OneLink, found: CycleExtent) -> tuple[list[Comparison], str]:
    """(5.8) and (5.9) compared with a cycle, and their validity."""
    node, gain = link.node, link.loop.gain
    stiffness = node.transmission_stiffness, node.contact_stiffness
    friction = node.static_friction, node.dynamic_friction
    number = float(stiction_cycle_number(gain, node.inertia, node.damping, *stiffness))
    force = float(stiction_cycle_force(*stiffness, *friction, link.zeta)) / link.lever
    period = float(stiction_cycle_period(gain, *stiffness, *friction, link.zeta))
    rows = [
        near("F_c peak to peak", force, found.peak_to_peak, "N", "(5.8)", BOUNDS.neglected * number),
        near("period", period, found.period, "s", "(5.9)", BOUNDS.neglected * number),
    ]
    return rows, f"(5.8) and (5.9) hold for (5.11) far below 1; here it is {number:.3f}"


def _with_deadband(shown: TestbedStep, force: float) -> list[Comparison]:
    """The deadband of half the cycle, and the remaining motion in the last half of the run."""
    late = shown.force[len(shown.force) // 2 :]
    deadband = shown.link.loop.deadband / shown.link.lever
    return [
        near("deadband that removes it", 0.5 * force, deadband, "N", "(5.7), (5.8)"),
        below("remaining peak to peak with it", np.ptp(late), "N", BOUNDS.within * force, "(5.7)"),
        below("remaining error with it", abs(shown.desired - float(late[-1])), "N", deadband, "(5.7)"),
    ]


def _with_smaller_deadband(shown: TestbedStep, force: float) -> Comparison:
    link = shown.link
    fraction = 2.0 * link.loop.deadband / link.lever / force
    predicted = assess(link.node, replace(link.loop, sample_period=0.0), shown.desired * link.lever).verdict
    return Comparison(f"with {fraction:.2f} of that deadband", str(predicted), shown.verdict, equation="integrator")


def actuator(runs: Runs) -> Result:
    """The experiment `actuator-limit-cycle`."""
    shown = played(runs["press"])  # the only step, as far as it is recorded
    link, node, desired = shown.link, shown.link.node, shown.desired
    found = last_cycle(shown.time, shown.motor)
    friction = node.dynamic_friction, node.transmission_stiffness
    work, power, error, half = half_cycle_work(shown)
    by_law = float(actuator_cycle_work(*friction)), float(actuator_cycle_power(link.loop.gain, error, friction[0]))
    swing = actuator_cycle(*friction, link.gamma, link.zeta)
    rows = [
        near("motor, as a joint angle, peak to peak", swing, found.peak_to_peak, "rad", "(5.20)"),
        near("work of a half cycle", by_law[0], work, "N m", "(5.21)"),
        near(f"power of a half cycle of {half:.2f} s", by_law[1], power, "W", "(5.22)", 0.05),
        below("contact force, remaining error", abs(shown.force[-1] - desired), "N", BOUNDS.within * desired),
    ]
    motion = shown.exact()
    motor = [("measured", measured(shown.time, shown.motor)), ("exact", line_only(shown.time, motion.x_m))]
    force = [("measured", shown.line), ("exact", line_only(shown.time, motion.contact_force / link.lever))]
    panels = [
        Panel("contact force", "time [s]", "force [N]", force),
        Panel("motor at the joint", "time [s]", "angle [rad]", motor),
    ]
    remark = (
        f"(5.22) is (5.21) over the {by_law[0] / by_law[1]:.3f} s from one breakaway to the next; the measured half "
        f"cycle took {half:.3f} s, including the slip"
    )
    return Result(rows, panels, (remark,))


def half_cycle_work(shown: TestbedStep) -> tuple[float, float, float, float]:
    """Work, N m, and power, W, of the actuator in the last whole half cycle; its error, N m, and duration, s.

    Positive work on the spring of the stuck node, by the cable force in excess of the contact force.  Returned work
    does not count, because a velocity-controlled motor does not store it.
    """
    truth, lever = shown.run.joints("sim/joint_states"), shown.link.lever
    pull = -np.interp(shown.time, truth.time, truth.effort[:, 0]) - shown.force * lever
    speed = np.gradient(shown.motor, shown.time)
    turns = np.flatnonzero(np.diff(speed > 0.0))
    half = slice(turns[-2] + 1, turns[-1] + 1)
    sticks = np.abs(shown.speed[half]) < BOUNDS.stuck_speed
    given = np.where(sticks, np.clip(pull[half] * speed[half], 0.0, None), 0.0)
    length = float(shown.time[half.stop] - shown.time[half.start])
    work = float(np.trapezoid(given, shown.time[half]))
    return work, work / length, (shown.desired - float(np.median(shown.force[half]))) * lever, length
