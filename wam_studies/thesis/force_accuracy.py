"""Accuracy of the contact force without feedback, 5.2, and with a sensor that is calibrated wrong, 2.2."""

import numpy as np

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import TestbedStep, played
from wam_studies.thesis.recording import Recording, Runs
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.stiction import play


def accuracy(runs: Runs) -> Result:
    """The experiment `force-accuracy`, or its run without feedback alone."""
    rows, panel = open_loop(runs["open_loop"])
    closed = {name.replace("_", " "): played(run) for name, run in runs.items() if name != "open_loop"}
    rows += [_calibration(label, shown) for label, shown in closed.items()]
    curves = [(label, shown.line) for label, shown in closed.items()]
    with_feedback = Panel("with feedback, 20 N commanded", "time [s]", "force [N]", curves)
    return Result(rows, [panel, with_feedback] if curves else [panel])


def open_loop(run: Recording) -> tuple[list[Comparison], Panel]:
    """F_c over F_des, without feedback: friction is a deadband, and keeps the force on the way back."""
    shown = played(run)
    friction, force = shown.link.node.dynamic_friction / shown.link.lever, shown.force
    desired = _fed_forward(shown)
    expected = play(desired, friction)
    begin = float(desired[np.argmax(force > BOUNDS.least_contact)])
    rows = [near("deadband, F_des at which F_c begins", friction, begin - BOUNDS.least_contact, "N", "5.2")]
    for step in run.steps:
        last = int(np.searchsorted(shown.time, step.end)) - 1
        rows.append(near(f"{step.name}, F_c at {desired[last]:.0f} N", expected[last], force[last], "N", "5.2"))
    worst = float(np.abs(force - expected).max() / expected.max())
    rows.append(below("largest difference", worst, "of F_c", BOUNDS.within, "5.2"))
    each = slice(None, None, 40)
    curves = [("measured", measured(desired[each], force[each])), ("play", line_only(desired, expected))]
    return rows, Panel("without feedback", "F_des [N]", "F_c [N]", curves)


def _fed_forward(shown: TestbedStep) -> Numbers:
    """F_des from the torque of the motor, N, at the times of the sensors."""
    motors = shown.run.joints("motor_states")
    torque = -np.interp(shown.time, motors.time, motors.effort[:, 0])
    return torque * shown.link.ratio / shown.link.lever


def _calibration(name: str, shown: TestbedStep) -> Comparison:
    """Settled force of a loop that knows another stiffness of its spring: F_des k/k_known."""
    known = shown.run.parameters.part("force_loop", ForceLoopParameters).spring_stiffness[0]
    settled = shown.force[shown.time > shown.time[-1] - BOUNDS.settled_force]
    expected = shown.desired * shown.link.node.contact_stiffness / known
    return near(f"settled force, {name}", expected, settled.mean(), "N", "2.2")
