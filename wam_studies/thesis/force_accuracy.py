"""Accuracy of the contact force without feedback, 5.2, and with a sensor that is calibrated wrong, 2.2."""

from collections.abc import Mapping

import numpy as np

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import OneLink, desired_force, one_link, response, set_until
from wam_studies.thesis.recording import Recording, Step
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.stiction import play


def accuracy(runs: Mapping[str, Recording]) -> Result:
    """The experiment `force-accuracy`, or its run without feedback alone."""
    rows, panel = open_loop(runs["open_loop"])
    curves = []
    for name, run in runs.items():
        if name != "open_loop":
            link = one_link(run)
            shown = response(run, link)
            rows.append(
                _calibration(
                    name.replace("_", " "), run, link, shown.force[shown.time > shown.time[-1] - BOUNDS.settled_force]
                )
            )
            curves.append((name.replace("_", " "), measured(shown.time, shown.force)))
    with_feedback = Panel("with feedback, 20 N commanded", "time [s]", "force [N]", curves)
    return Result(rows, [panel, with_feedback] if curves else [panel])


def open_loop(run: Recording) -> tuple[list[Comparison], Panel]:
    """F_c over F_des, without feedback: friction is a deadband, and keeps the force on the way back."""
    link = one_link(run)
    friction = link.node.dynamic_friction / link.lever
    desired, force = _fed_forward(run, link)
    expected = play(desired, friction)
    begin = float(desired[np.argmax(force > BOUNDS.least_contact)])
    rows = [near("deadband, F_des at which F_c begins", friction, begin - BOUNDS.least_contact, "N", "5.2")]
    times = run.joints("joint_sensors").time
    for step in run.steps:
        last = int(np.searchsorted(times, step.end)) - 1
        label = f"F_c at {desired[last]:.0f} N, {step.name}"
        rows.append(near(label, expected[last], force[last], "N", "5.2"))
    worst = float(np.abs(force - expected).max() / expected.max())
    rows.append(below("largest difference", worst, "of F_c", BOUNDS.within, "5.2"))
    each = slice(None, None, 40)
    curves = [("measured", measured(desired[each], force[each])), ("play", line_only(desired, expected))]
    return rows, Panel("without feedback", "F_des [N]", "F_c [N]", curves)


def active_pretension(runs: Mapping[str, Recording]) -> Result:
    """The experiment `active-pretension`: deadband by friction of the tension, and stretch of the cable, over it."""
    rows, curves = [], []
    for name, run in runs.items():
        link, label = one_link(run), name.replace("_", " ")
        desired, force = _fed_forward(run, link)
        delicate, strong = run.step("delicate"), run.step("strong")
        time, circuit = run.joints("joint_sensors").time, run.shared.arm.circuits[0]
        coefficient = float(run.parameters.node("driver")["effects.tension_friction"][0])
        tension = [_share(run, step) * circuit.pretension for step in (delicate, strong)]
        friction = coefficient * 2.0 * tension[0] * link.ratio / link.lever
        light, last = (int(np.searchsorted(time, step.end)) - 1 for step in (delicate, strong))
        torque = force[last] * link.lever / link.ratio
        slack = 2.0 * tension[1] * circuit.radius
        expected = max(torque, 2.0 * torque - slack) / circuit.stiffness
        shown = response(run, link)
        stretch = link.ratio * (shown.motor[last] - force[last] * link.lever / link.node.contact_stiffness)
        rows += [
            Comparison(
                f"{label}, deadband",
                friction,
                desired[light] - force[light],
                "N",
                BOUNDS.ramp_inertia,
                "c (T1 + T2)",
                True,
            ),
            near(f"{label}, stretch under {force[last]:.0f} N", expected, stretch, "rad", "slack strand"),
        ]
        curves.append((label, measured(desired[::20], force[::20])))
    return Result(rows, [Panel("force without feedback", "F_des [N]", "F_c [N]", curves)])


def _share(run: Recording, step: Step) -> float:
    """Part of the pretension in a step."""
    found = run.parameters.with_values(set_until(run, step)).node("driver")["effects.pretension_share"]
    return float(found[0])


def _fed_forward(run: Recording, link: OneLink) -> tuple[Numbers, Numbers]:
    """F_des from the torque of the motor, and F_c, N, at the times of the sensors."""
    motors, shown = run.joints("motor_states"), response(run, link)
    torque = -np.interp(shown.time, motors.time, motors.effort[:, 0])
    return torque * link.ratio / link.lever, shown.force


def _calibration(name: str, run: Recording, link: OneLink, force: Numbers) -> Comparison:
    """Settled force of a loop that knows another stiffness of its spring: F_des k/k_known."""
    known = run.node("force_loop", ForceLoopParameters).spring_stiffness[0]
    expected = desired_force(run, run.steps[0].begin) * link.node.contact_stiffness / known
    return near(f"settled force, {name}", expected, force.mean(), "N", "2.2")
