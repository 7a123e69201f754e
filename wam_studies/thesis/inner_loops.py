"""Inner loops on torque and on position, 2.1.2: largest gains, and what they leave of friction at the motor."""

import math

import numpy as np

from wam_control.velocity.torque_loop import TorqueLoopParameters
from wam_studies.figures.inner_loops import largest_gain, on_position, on_torque, period_map
from wam_studies.figures.panels import Numbers, Panel, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.one_link import OneLink, TestbedStep, growth, joint_stiffness, played
from wam_studies.thesis.recording import Recording, Runs
from wam_studies.thesis.rows import Comparison, Result, near

FRICTION = ("torque_fed_forward", "torque_loop", "position_loop")  # runs with friction at the motor


def compared(runs: Runs) -> Result:
    """The experiment `inner-loops`, or one run of the torque loop: growth or decay by its largest gain."""
    if len(runs) == 1:
        ((name, run),) = runs.items()
        fraction, words = _gain(run) / _expected(run), ("decays", "grows")
        label = f"torque loop at {fraction:.2f} of its largest gain"
        row = Comparison(label, words[fraction > 1.0], words[_growth(run) > 0.0], equation="sampled loop")
        return Result([row], [_speeds("torque loop", {name: run})])
    left = friction_left({name: runs[name] for name in FRICTION})
    rows, shown = list(left.rows), {}
    for below in runs:
        loop, found, cable = below.partition("_below")
        if found:
            above = f"{loop}_above{cable}"
            rows.append(_largest(f"{loop} loop{cable.replace('_', ' ')}, largest gain", runs[below], runs[above]))
            shown[above] = runs[above]
    return Result(rows, [*left.panels, _speeds("above the largest gain", shown)])


def _speeds(title: str, runs: Runs) -> Panel:
    each = [(name.replace("_", " "), run.joints("motor_states")) for name, run in runs.items()]
    return Panel(title, "time [s]", "motor [rad/s]", [(name, measured(m.time, m.velocity[:, 0])) for name, m in each])


def friction_left(runs: Runs) -> Result:
    """Half of the distance between the force on the way out and on the way back, where the command is the same."""
    rows, curves = [], []
    for name, run in runs.items():
        shown, label = played(run), name.replace("_", " ")
        link, command = shown.link, _command(shown)
        friction = run.shared.arm.motors.dynamic_friction[0] * link.ratio / link.lever
        there, again = (
            (shown.time >= step.begin) & (shown.time <= step.end) for step in (run.step("out"), run.step("back"))
        )
        middle = 0.5 * float(command.max())
        rising = np.interp(middle, command[there], shown.force[there], math.nan, math.nan)
        falling = np.interp(middle, command[again][::-1], shown.force[again][::-1], math.nan, math.nan)
        expected = friction * _part_left(run, link)
        rows.append(near(f"{label}, friction left", expected, 0.5 * (falling - rising), "N", "2.1.2"))
        curves.append((label, measured(command[::20], shown.force[::20])))
    panel = Panel("friction at the motor", "F_des, or what the position holds [N]", "F_c [N]", curves)
    return Result(rows, [panel])


def _command(shown: TestbedStep) -> Numbers:
    """Force, N, at the times of the sensors, of the commanded torque; of a position, that without friction."""
    run, link = shown.run, shown.link
    if not _has(run, "position_loop"):
        command = run.joints("motor_effort_command")
        return -np.interp(shown.time, command.time, command.effort[:, 0]) * link.ratio / link.lever
    command = run.joints("motor_velocity_command")
    turned = -np.cumsum(command.velocity[:, 0]) * run.shared.timing.period
    node, k = link.node, run.shared.servo.integral_gain[0] * link.ratio**2
    series = 1.0 / (1.0 / k + 1.0 / node.transmission_stiffness + 1.0 / node.contact_stiffness)
    return np.interp(shown.time, command.time, turned) / link.ratio * series / link.lever


def _part_left(run: Recording, link: OneLink) -> float:
    """Part of the friction at the motor that reaches the contact: 1/(1 + g), or that of springs against springs."""
    if _has(run, "torque_loop"):
        return 1.0 / (1.0 + run.node("torque_loop", TorqueLoopParameters).gain[0])
    if not _has(run, "position_loop"):
        return 1.0
    node = link.node
    beyond = 1.0 / (1.0 / node.transmission_stiffness + 1.0 / node.contact_stiffness)
    return beyond / (beyond + run.shared.servo.integral_gain[0] * link.ratio**2)


def _largest(label: str, below: Recording, above: Recording) -> Comparison:
    """Gain at which an oscillation of the motor neither grows nor decays, from runs on both sides of it."""
    (first, gain), (second, other) = ((_growth(run), _gain(run)) for run in (below, above))
    measured = gain + (other - gain) * first / (first - second) if first < second else math.nan
    unit = "" if _has(below, "torque_loop") else "N m/rad"
    return near(label, _expected(below), measured, unit, "sampled loop")


def _expected(run: Recording) -> float:
    """The largest gain in theory, of a position loop as its stiffness with this ratio of stiffness and damping."""
    shared = run.shared
    is_torque = _has(run, "torque_loop")
    row = on_torque(shared.arm) if is_torque else on_position(shared.servo) / shared.servo.integral_gain[0]
    return largest_gain(period_map(shared.arm, joint_stiffness(run)), row)


def _has(run: Recording, name: str) -> bool:
    """Whether a node of this module ran."""
    return any(f".{name}:" in entry for entry in run.shared.nodes)


def _gain(run: Recording) -> float:
    if _has(run, "torque_loop"):
        return run.node("torque_loop", TorqueLoopParameters).gain[0]
    return run.shared.servo.integral_gain[0]


def _growth(run: Recording) -> float:
    """Rate at which the jerk of the motor grows, 1/s; slow motions are without effect on it."""
    motors = run.joints("motor_states")
    late = motors.time > BOUNDS.one_mode_after
    return growth(motors.time[late][2:], np.diff(motors.velocity[late, 0], 2)).rate
