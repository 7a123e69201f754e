"""Force feedback read in steps: the smallest controllable force (3.2.1), a deadband against its cycle (5.7)."""

import math

import numpy as np

from wam_driver.driver import DriverParameters
from wam_studies.exact_cycles import last_cycle
from wam_studies.figures.panels import Panel, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import TestbedStep, played
from wam_studies.thesis.recording import Runs
from wam_studies.thesis.rows import Comparison, Result, below, near
from wam_theory.quantisation import hunting, quantised_cycle_period, threshold


def quantised(runs: Runs) -> Result:
    """The experiment `quantised-force`, or some of its runs."""
    rows: list[Comparison] = []
    forces, motors = [], []
    for name, run in runs.items():
        shown, label = played(run, topic="sim/joint_states"), name.replace("_", " ")
        rows += {"no_friction": _hunting, "friction": _cycling, "with_deadband": _resting}[name](shown, _level(shown))
        forces.append((label, shown.line))
        motors.append((label, measured(shown.time, shown.motor)))
    panels = [
        Panel(f"true force, read in steps of {_level(shown):.2f} N", "time [s]", "force [N]", forces),
        Panel("motor", "time [s]", "motor at the joint [rad]", motors),
    ]
    return Result(rows, panels)


def _hunting(shown: TestbedStep, level: float) -> list[Comparison]:
    """Without friction: a relay about the border of two steps."""
    node, desired, neglected = shown.link.node, shown.desired, BOUNDS.neglected_harmonics
    late = shown.time > shown.time[-1] - BOUNDS.frictionless_end
    force = shown.force[late]
    swing = last_cycle(shown.time[late], force)
    expected = hunting(level, shown.link.gamma, desired)
    return [
        near("no friction, F_c", threshold(desired, level), force.mean(), "N", "between two steps"),
        below("no friction, error of F_c", float(force.mean()) - desired, "N", 0.5 * level),
        near("no friction, peak to peak", expected, swing.peak_to_peak, "N", "relay, (5.15)", neglected),
        near("no friction, period", 2.0 * math.pi / node.natural_frequency, swing.period, "s", "relay", neglected),
    ]


def _cycling(shown: TestbedStep, level: float) -> list[Comparison]:
    """With friction: a cycle of the motor, its force at rest."""
    link, desired = shown.link, shown.desired
    there = shown.time > 0.4 * shown.time[-1]
    cycle, within = last_cycle(shown.time[there], shown.motor[there]), BOUNDS.neglected_delays
    friction, k_tr = link.node.dynamic_friction, link.node.transmission_stiffness
    period = quantised_cycle_period(link.loop.gain, k_tr, friction, desired * link.lever, level * link.lever)
    return [
        near("friction, cycle of the motor", 2.0 * friction / k_tr, cycle.peak_to_peak, "rad", "(5.20)", within),
        near("friction, its constant period", period, cycle.period, "s", "(5.3)", within),
        below("friction, error of F_c", float(shown.force[there].mean()) - desired, "N", level, "a step"),
    ]


def _resting(shown: TestbedStep, level: float) -> list[Comparison]:
    """With a deadband of three quarters of a step."""
    moved = float(np.ptp(shown.motor[shown.time > shown.time[-1] - 1.0]))
    return [
        below("deadband of 3/4 of a step, the motor moves", moved, "rad", 1e-4, "5.7"),
        below("deadband, error of F_c", shown.force[-1] - shown.desired, "N", 1.25 * level, "deadband + 1/2"),
    ]


def _level(shown: TestbedStep) -> float:
    """A step of the measured force at the tip, N."""
    (resolution,) = shown.run.parameters.part("driver", DriverParameters).sensors.joint_encoder_resolution
    return resolution * shown.link.node.contact_stiffness / shown.link.lever
