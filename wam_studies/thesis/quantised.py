"""Force feedback read in steps: the smallest controllable force (3.2.1), a deadband against its cycle (5.7)."""

import math
from collections.abc import Sequence

import numpy as np

from wam_analysis.measures.limit_cycle import last_cycle
from wam_driver.driver import DriverParameters
from wam_studies.figures.panels import Panel, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import TestbedStep, one_link
from wam_studies.thesis.recording import Recording, Runs
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.quantisation import hunting, quantised_cycle_period, threshold


def quantised(runs: Runs) -> Result:
    """The experiment `quantised-force`, or its run with friction alone."""
    if len(runs) == 1:
        (shown,) = map(_true, runs.values())
        return Result(_with_friction(shown), [_motors([("", shown)])])
    shown, friction, quiet = map(_true, runs.values())
    level, node, desired = _level(shown), shown.link.node, shown.desired
    late = shown.time > shown.time[-1] - BOUNDS.frictionless_end
    force = shown.force[late]
    swing, neglected = last_cycle(shown.time[late], force), BOUNDS.neglected_harmonics
    natural = math.sqrt((node.transmission_stiffness + node.contact_stiffness) / node.inertia)
    expected = hunting(level, shown.link.gamma, desired)
    moved, left = float(np.ptp(quiet.motor[quiet.time > quiet.time[-1] - 1.0])), float(quiet.force[-1]) - desired
    rows = [
        near("no friction, F_c", threshold(desired, level), force.mean(), "N", "between two steps"),
        below("no friction, error of F_c", float(force.mean()) - desired, "N", 0.5 * level),
        near("no friction, peak to peak", expected, swing.peak_to_peak, "N", "relay, (5.15)", neglected),
        near("no friction, period", 2.0 * math.pi / natural, swing.period, "s", "relay", neglected),
        *_with_friction(friction),
        below("deadband of 3/4 of a step, the motor moves", moved, "rad", 1e-4, "5.7"),
        below("deadband, error of F_c", left, "N", 1.25 * level, "deadband + 1/2"),
    ]
    labelled = [(name.replace("_", " "), each) for name, each in zip(runs, (shown, friction, quiet), strict=True)]
    forces = [(label, each.line) for label, each in labelled]
    return Result(
        rows,
        [Panel(f"true force, read in steps of {level:.2f} N", "time [s]", "force [N]", forces), _motors(labelled)],
    )


def _with_friction(shown: TestbedStep) -> list[Comparison]:
    link, level, desired = shown.link, _level(shown), shown.desired
    there = shown.time > 0.4 * shown.time[-1]
    cycle, within = last_cycle(shown.time[there], shown.motor[there]), BOUNDS.neglected_delays
    friction, k_tr = link.node.dynamic_friction, link.node.transmission_stiffness
    period = quantised_cycle_period(link.loop.gain, k_tr, friction, desired * link.lever, level * link.lever)
    return [
        near("friction, cycle of the motor", 2.0 * friction / k_tr, cycle.peak_to_peak, "rad", "(5.20)", within),
        near("friction, its period, which stays", period, cycle.period, "s", "(5.3)", within),
        below("friction, error of F_c", float(shown.force[there].mean()) - desired, "N", level, "a step"),
    ]


def _motors(shown: Sequence[tuple[str, TestbedStep]]) -> Panel:
    lines = [(label, measured(each.time, each.motor)) for label, each in shown]
    return Panel("motor", "time [s]", "motor at the joint [rad]", lines)


def _level(shown: TestbedStep) -> float:
    """A step of the measured force at the tip, N."""
    (resolution,) = shown.run.node("driver", DriverParameters).sensors.joint_encoder_resolution
    return resolution * shown.link.node.contact_stiffness / shown.link.lever


def _true(run: Recording) -> TestbedStep:
    """What a run did, by the simulator's truth."""
    truth, motors, link = run.joints("sim/joint_states"), run.joints("motor_states"), one_link(run)
    force = -link.node.contact_stiffness * truth.position[:, 0] / link.lever
    motor = -np.interp(truth.time, motors.time, motors.position[:, 0]) / link.ratio
    return TestbedStep(run, None, link, truth.time, force, motor, -truth.velocity[:, 0])
