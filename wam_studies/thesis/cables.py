"""Chapter 6: efficiency of cables under load, (6.15), and their creep, (6.19)."""

import numpy as np
from numpy.typing import ArrayLike

from wam_description.arm import Arm
from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.plant.ideal_testbed import limiting_efficiency
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.recording import Recording, Runs, Step
from wam_studies.thesis.rows import Comparison, Result, near
from wam_theory import cable


def efficiency(runs: Runs) -> Result:
    """The experiment `efficiency`: power lost while a load is lifted, from rest to rest."""
    run = runs["lift"]
    arm = run.shared.arm
    rows, points = [], []
    for step, after in zip(run.steps[:-1], run.steps[1:], strict=True):
        if not step.name.startswith("lift"):
            continue
        torque, input_work, output_work = work(run, step, after)
        predicted = 1.0 - limiting_efficiency(arm, torque)
        lost = 1.0 - output_work / input_work
        rows.append(near(f"power lost, {torque:.2f} N m at the motor", 100 * predicted, 100 * lost, "%", "(6.15)"))
        points.append((torque, 100 * lost, 100 * predicted))
    torques, losses, predictions = zip(*points, strict=True)
    curves = [("measured", measured(torques, losses)), ("(6.15)", line_only(torques, predictions))]
    return Result(rows, [Panel("power lost in the cables", "motor torque [N m]", "power lost [%]", curves)])


def work(run: Recording, lift: Step, after: Step) -> tuple[float, float, float]:
    """Torque of the load at the motor, N m, work of the motor on the cable and of the cable on the load, N m.

    From the start of a lift to the end of the rest after it, when link and cables store the same energy as before.
    """
    load = load_torque(run, lift)
    ratio = run.shared.arm.joint_from_motor[0]
    motors, sensors, truth = run.joints("motor_states"), run.joints("joint_sensors"), run.joints("sim/joint_states")
    begin, end = (int(np.searchsorted(motors.time, time)) for time in (lift.begin, after.end - BOUNDS.rounding))
    theta = motors.position[begin:end, 0]
    pull = ratio * np.interp(motors.time[begin:end], truth.time, truth.effort[:, 0])
    input_work = float(np.sum(0.5 * (pull[1:] + pull[:-1]) * np.diff(theta)))
    output_work = load * float(sensors.position[end - 1, 0] - sensors.position[begin, 0])
    return load * ratio, input_work, output_work


def load_torque(run: Recording, step: Step) -> float:
    """Torque of the push in a step at the joint, N m, positive against it."""
    push = run.forces("sim/disturbance").during(step.begin, step.end - BOUNDS.rounding)
    return -float(np.median(push.torque[:, 2]))


def creeping(runs: Runs) -> Result:
    """The experiment `creep`: creep of the link while the motor turns out and back under a load."""
    run = runs["out_and_back"]
    arm = run.shared.arm
    motors, sensors = run.joints("motor_states"), run.joints("joint_sensors")
    start = run.step("out").begin
    first = int(np.searchsorted(motors.time, start))
    theta, angle = motors.position[first:, 0], sensors.position[first:, 0]
    time = motors.time[first:]
    before = slice(int(np.searchsorted(motors.time, start - BOUNDS.rest_before)), first + 1)
    creep = -(angle - theta * arm.joint_from_motor[0])
    creep += float(np.mean(sensors.position[before, 0] - motors.position[before, 0] * arm.joint_from_motor[0]))
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(theta)))])
    load = load_torque(run, run.step("out"))
    predicted = crept(arm, travel, load)
    rows = []
    for step in run.steps:
        if step.name.startswith("rest"):
            at = int(np.searchsorted(time, step.end - BOUNDS.rounding)) - 1
            label = f"creep after {travel[at]:.1f} rad of the motor, {step.name.removeprefix('rest ')}"
            rows.append(near(label, 1e3 * predicted[at], 1e3 * creep[at], "mrad", "(6.19)"))
    curves = [("measured", measured(travel, 1e3 * creep)), ("(6.19)", line_only(travel, 1e3 * predicted))]
    remark = "with the printed signed differential, (6.19) would be zero after each return"
    return Result(
        rows, [Panel("creep, out and back twice", "travel of the motor [rad]", "creep [mrad]", curves)], (remark,)
    )


def crept(arm: Arm, travel: ArrayLike, load: float) -> Numbers:
    """Creep at the joint, rad, under a load at the joint, N m, over the motor's travel, (6.19)."""
    cables, ratio = arm.cables, arm.joint_from_motor[0]
    stages = zip(cables.stage_ratio, cables.stage_radius, cables.stage_ea, cables.stage_circuits, strict=True)
    total = sum(n * cable.creep(np.asarray(travel) / n, n * load * ratio / c, r, ea) for n, r, ea, c in stages)
    return np.asarray(total) * ratio


def corrected(runs: Runs) -> Result:
    """The experiment `creep-correction`: joint angles of the transform, with and without (6.19)."""
    rows, curves = [], []
    for name, run in runs.items():
        joints, sensors, motors = run.joints("joint_states"), run.joints("joint_sensors"), run.joints("motor_states")
        begin = run.step("out").begin
        error = joints.position[:, 0] - np.interp(joints.time, sensors.time, sensors.position[:, 0])
        error -= float(
            np.mean(error[(joints.time > begin - BOUNDS.rest_before) & (joints.time < begin)])
        )  # elastic stretch
        theta = motors.position[motors.time > begin, 0]
        creep = float(crept(run.shared.arm, np.abs(np.diff(theta)).sum(), load_torque(run, run.step("out"))))
        last = 1e3 * float(np.mean(error[joints.time > run.steps[-1].end - BOUNDS.rest_before]))
        label, left = name.replace("_", " "), 0.0 if run.parameters.node("transform")["creep_correction"] else creep
        within = BOUNDS.creep_left if not left else BOUNDS.creep_of_torque
        rows.append(
            Comparison(
                f"error of the joint angle, {label}", 1e3 * left, last, "mrad", within * 1e3 * creep, "(6.19)", True
            )
        )
        curves.append((label, measured(joints.time, 1e3 * error)))
    return Result(rows, [Panel("error of the joint angle, from motor angles", "time [s]", "error [mrad]", curves)])
