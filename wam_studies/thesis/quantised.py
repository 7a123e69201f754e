"""Force feedback read in steps: the smallest controllable force (3.2.1), a deadband against its cycle (5.7)."""

import math
from collections.abc import Mapping

import numpy as np

from wam_analysis.measures.limit_cycle import last_cycle
from wam_driver.driver import DriverParameters
from wam_studies.figures.panels import Numbers, Panel, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import OneLink, desired_force, one_link
from wam_studies.thesis.recording import Recording
from wam_studies.thesis.rows import Result, below, near
from wam_theory.quantisation import hunting, quantised_cycle_period, threshold

Runs = Mapping[str, Recording]


def quantised(runs: Runs) -> Result:
    """The experiment `quantised-force`."""
    run = runs["no_friction"]
    link, level = one_link(run), _level(run)
    time, force, _ = _true(run, link)
    desired, late = desired_force(run, time[0]), time > time[-1] - BOUNDS.frictionless_end
    middle = float(threshold(desired, level))
    swing = last_cycle(time[late], force[late])
    node = link.node
    natural = math.sqrt((node.transmission_stiffness + node.contact_stiffness) / node.inertia)
    rows = [
        near("no friction, F_c", middle, force[late].mean(), "N", "between two steps"),
        below("no friction, error of F_c", float(force[late].mean()) - desired, "N", 0.5 * level),
        near(
            "no friction, peak to peak",
            hunting(level, link.gamma, desired),
            swing.peak_to_peak,
            "N",
            "relay, (5.15)",
            BOUNDS.neglected_harmonics,
        ),
        near("no friction, period", 2.0 * math.pi / natural, swing.period, "s", "relay", BOUNDS.neglected_harmonics),
        *sampled({"friction": runs["friction"]}).rows,
    ]
    with_deadband = runs["with_deadband"]
    time, force, motor = _true(with_deadband, link)
    late = time > time[-1] - 1.0
    moved = float(np.ptp(motor[late]))
    rows.append(below("deadband of 3/4 of a step, the motor moves", moved, "rad", 1e-4, "5.7"))
    rows.append(below("deadband, error of F_c", float(force[-1]) - desired, "N", 1.25 * level, "deadband + 1/2"))
    curves, motors = [], []
    for name, each in runs.items():
        time, force, motor = _true(each, link)
        curves.append((name.replace("_", " "), measured(time, force)))
        motors.append((name.replace("_", " "), measured(time, motor)))
    panels = [
        Panel(f"true force, read in steps of {level:.2f} N", "time [s]", "force [N]", curves),
        Panel("motor", "time [s]", "motor at the joint [rad]", motors),
    ]
    return Result(rows, panels)


def sampled(runs: Runs) -> Result:
    """The run with friction, or some cycles of it."""
    (run,) = runs.values()
    link, level = one_link(run), _level(run)
    time, force, motor = _true(run, link)
    desired = desired_force(run, time[0])
    there = time > 0.4 * time[-1]
    cycle = last_cycle(time[there], motor[there])
    friction, k_tr = link.node.dynamic_friction, link.node.transmission_stiffness
    period = quantised_cycle_period(link.loop.gain, k_tr, friction, desired * link.lever, level * link.lever)
    rows = [
        near(
            "friction, cycle of the motor",
            2.0 * friction / k_tr,
            cycle.peak_to_peak,
            "rad",
            "(5.20)",
            BOUNDS.neglected_delays,
        ),
        near("friction, its period, which stays", period, cycle.period, "s", "(5.3)", BOUNDS.neglected_delays),
        below("friction, error of F_c", float(force[there].mean()) - desired, "N", level, "a step"),
    ]
    return Result(rows, [Panel("motor", "time [s]", "motor at the joint [rad]", [("", measured(time, motor))])])


def _level(run: Recording) -> float:
    """A step of the measured force at the tip, N."""
    (resolution,) = run.node("driver", DriverParameters).sensors.joint_encoder_resolution
    link = one_link(run)
    return resolution * link.node.contact_stiffness / link.lever


def _true(run: Recording, link: OneLink) -> tuple[Numbers, Numbers, Numbers]:
    """Times, s, true force at the tip, N, and motor at the joint, rad, from the simulator's truth."""
    truth, motors = run.joints("sim/joint_states"), run.joints("motor_states")
    force = -link.node.contact_stiffness * truth.position[:, 0] / link.lever
    return truth.time, force, -np.interp(truth.time, motors.time, motors.position[:, 0]) / link.ratio
