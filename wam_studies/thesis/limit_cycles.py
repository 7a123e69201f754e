"""The limit cycles of chapter 5: by stiction, (5.8) and (5.9), and of the actuator alone, (5.20) to (5.22)."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wam_analysis.measures.limit_cycle import CycleExtent, last_cycle
from wam_studies.figures.panels import Line, Numbers, Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import (
    MeasuredResponse,
    OneLink,
    desired_force,
    measured_verdict,
    one_link,
    response,
)
from wam_studies.thesis.recording import Recording
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.regimes import actuator_cycle, actuator_cycle_power, actuator_cycle_work
from wam_theory.stick_slip import assess, simulate
from wam_theory.stiction import stiction_cycle_force, stiction_cycle_number, stiction_cycle_period


def stiction(runs: Mapping[str, Recording]) -> Result:
    """The experiment `stiction-limit-cycle`."""
    run = runs["without_deadband"]
    link = one_link(run)
    shown = response(run, link, run.steps[-1])
    found = last_cycle(shown.time, shown.force)
    rows, remark = _closed_form(link, found)
    force = float(rows[0].predicted)
    exact, curve = _exact(run, link, shown)
    rows += [
        near("F_c peak to peak, exact", exact.peak_to_peak, found.peak_to_peak, "N", "integrator"),
        near("period, exact", exact.period, found.period, "s", "integrator"),
    ]
    curves = [("without deadband", measured(shown.time, shown.force)), curve]
    rows += _with_deadband(runs["with_deadband"], force)
    rows.append(_with_smaller_deadband(runs["with_smaller_deadband"], force))
    quiet = response(runs["with_deadband"], link)
    curves.append(("with deadband", measured(quiet.time, quiet.force)))
    return Result(rows, [Panel("stiction limit cycle", "time [s]", "force [N]", curves)], (remark,))


def stiction_sample(runs: Mapping[str, Recording]) -> Result:
    """Some cycles of `stiction-limit-cycle`, without the start that the exact motion needs."""
    run = runs["without_deadband"]
    link = one_link(run)
    shown = response(run, link)
    rows, remark = _closed_form(link, last_cycle(shown.time, shown.force))
    curves = [("without deadband", measured(shown.time, shown.force))]
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


def _with_deadband(run: Recording, force: float) -> list[Comparison]:
    """The deadband of half the cycle, and the remaining motion in the last half of the run."""
    link = one_link(run)
    shown = response(run, link, run.steps[-1])
    late = shown.force[len(shown.force) // 2 :]
    deadband = link.loop.deadband / link.lever
    rest = abs(desired_force(run, shown.time[0]) - float(late[-1]))
    return [
        near("deadband that removes it", 0.5 * force, deadband, "N", "(5.7), (5.8)"),
        below("remaining peak to peak with it", np.ptp(late), "N", BOUNDS.within * force, "(5.7)"),
        below("remaining error with it", rest, "N", deadband, "(5.7)"),
    ]


def _with_smaller_deadband(run: Recording, force: float) -> Comparison:
    link = one_link(run)
    shown = response(run, link, run.steps[-1])
    fraction = 2.0 * link.loop.deadband / link.lever / force
    loop = replace(link.loop, sample_period=0.0)
    predicted = assess(link.node, loop, desired_force(run, shown.time[0]) * link.lever).verdict
    return Comparison(
        f"with {fraction:.2f} of that deadband",
        str(predicted),
        measured_verdict(run, run.steps[-1], shown),
        equation="integrator",
    )


def _exact(run: Recording, link: OneLink, shown: MeasuredResponse) -> tuple[CycleExtent, Line]:
    """Cycle and force of the exact motion of the continuous loop over the same time."""
    loop = replace(link.loop, sample_period=0.0)
    force = desired_force(run, shown.time[0]) * link.lever
    motion = simulate(link.node, loop, force, float(np.ptp(shown.time))).at(shown.time - shown.time[0])
    curve = motion.contact_force / link.lever
    return last_cycle(shown.time, curve), ("exact", line_only(shown.time, curve))


def actuator(runs: Mapping[str, Recording]) -> Result:
    """The experiment `actuator-limit-cycle`."""
    run = runs["press"]
    link = one_link(run)
    node = link.node
    shown = response(run, link)  # the only step, as far as it is recorded
    found = last_cycle(shown.time, shown.motor)
    swing = float(actuator_cycle(node.dynamic_friction, node.transmission_stiffness, link.gamma, link.zeta))
    work, power, error, half = half_cycle_work(run, link, shown)
    rows = [
        near("motor at the joint, peak to peak", swing, found.peak_to_peak, "rad", "(5.20)"),
        near(
            "work of a half cycle",
            actuator_cycle_work(node.dynamic_friction, node.transmission_stiffness),
            work,
            "N m",
            "(5.21)",
        ),
        near(
            f"power of a half cycle of {half:.2f} s",
            actuator_cycle_power(link.loop.gain, error, node.dynamic_friction),
            power,
            "W",
            "(5.22)",
            0.05,
        ),
        below(
            "contact force, remaining error",
            np.abs(shown.force[-1] - desired_force(run, shown.time[0])),
            "N",
            BOUNDS.within * desired_force(run, shown.time[0]),
        ),
    ]
    exact = simulate(node, link.loop, desired_force(run, shown.time[0]) * link.lever, float(np.ptp(shown.time)))
    motion = exact.at(shown.time - shown.time[0])
    panels = [
        Panel(
            "contact force",
            "time [s]",
            "force [N]",
            [
                ("measured", measured(shown.time, shown.force)),
                ("exact", line_only(shown.time, motion.contact_force / link.lever)),
            ],
        ),
        Panel(
            "motor at the joint",
            "time [s]",
            "angle [rad]",
            [
                ("measured", measured(shown.time, shown.motor)),
                ("exact", line_only(shown.time, motion.x_m)),
            ],
        ),
    ]
    by_law = float(rows[1].predicted) / float(rows[2].predicted)
    remark = (
        f"(5.22) is (5.21) over the {by_law:.3f} s from one breakaway to the next; the measured half cycle took "
        f"{half:.3f} s, including the slip"
    )
    return Result(rows, panels, (remark,))


def half_cycle_work(run: Recording, link: OneLink, shown: MeasuredResponse) -> tuple[float, float, float, float]:
    """Work, N m, and power, W, of the actuator in the last whole half cycle; its error, N m, and duration, s.

    Positive work on the spring of the stuck node, by the cable force in excess of the contact force.  Returned work
    does not count, because a velocity-controlled motor does not store it.
    """
    truth = run.joints("sim/joint_states")
    pull = -np.interp(shown.time, truth.time, truth.effort[:, 0]) - shown.force * link.lever
    speed = np.gradient(shown.motor, shown.time)
    turns = np.flatnonzero(np.diff(speed > 0.0))
    begin, end = turns[-2] + 1, turns[-1] + 1
    sticks = np.abs(shown.speed[begin:end]) < BOUNDS.stuck_speed
    given = np.where(sticks, np.clip(pull[begin:end] * speed[begin:end], 0.0, None), 0.0)
    length = float(shown.time[end] - shown.time[begin])
    work = float(_integral(given, shown.time[begin:end]))
    error = desired_force(run, shown.time[0]) * link.lever - float(np.median(shown.force[begin:end])) * link.lever
    return work, work / length, error, length


def _integral(values: Numbers, time: Numbers) -> float:
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(time)))
