"""Chapter 6: what cables lose under load, (6.15), and how they creep, (6.19)."""

from collections.abc import Mapping

import numpy as np

from wam_analysis.experiments.recording import Recording, Step
from wam_analysis.experiments.rows import Curve, Numbers, Panel, Result, Row
from wam_description.arm import Arm
from wam_theory import cable

WITHIN = 0.02
ROUNDING = 1e-6  # s
REST = 0.1  # s before the motor turns, in which the link swings a little about where it is


def efficiency(runs: Mapping[str, Recording]) -> Result:
    """The experiment `efficiency`: what is lost while a load is lifted, from rest to rest."""
    run = runs["lift"]
    arm = run.shared.arm
    rows, torques, losses, predictions = [], [], [], []
    for step, after in zip(run.steps[:-1], run.steps[1:], strict=True):
        if not step.name.startswith("lift"):
            continue
        torque, given, taken = work(run, step, after)
        predicted = 1.0 - cable.efficiency(_losses(arm, torque))
        measured = 1.0 - taken / given
        rows.append(
            Row(f"power lost, {torque:.2f} N m at the motor", 100 * predicted, 100 * measured, "%", WITHIN, "(6.15)")
        )
        torques.append(torque)
        losses.append(measured)
        predictions.append(predicted)
    x = np.array(torques)
    curves = [
        Curve("measured", "measured", x, 100 * np.array(losses)),
        Curve("predicted", "(6.15)", x, 100 * np.array(predictions)),
    ]
    return Result(rows, [Panel("power lost in the cables", "motor torque [N m]", "[%]", curves)])


def work(run: Recording, lift: Step, after: Step) -> tuple[float, float, float]:
    """Torque of the load at the motor, N m, work that the cable takes from the motor and that the load takes, N m.

    From the begin of a lift to the end of the rest after it, where links and cables hold what they held before.
    """
    load = load_torque(run, lift)
    share = run.shared.arm.joint_from_motor[0]
    motors, sensors, truth = run.joints("motor_states"), run.joints("joint_sensors"), run.joints("sim/joint_states")
    begin, end = (int(np.searchsorted(motors.time, time)) for time in (lift.begin, after.end - ROUNDING))
    theta = motors.position[begin:end, 0]
    pull = share * np.interp(motors.time[begin:end], truth.time, truth.effort[:, 0])
    given = float(np.sum(0.5 * (pull[1:] + pull[:-1]) * np.diff(theta)))
    taken = load * float(sensors.position[end - 1, 0] - sensors.position[begin, 0])
    return load * share, given, taken


def load_torque(run: Recording, step: Step) -> float:
    """Torque that the push of a step asks of the joint, N m, positive against it."""
    push = run.forces("sim/disturbance")
    during = (push.time >= step.begin) & (push.time < step.end - ROUNDING)
    return -float(np.median(push.torque[during, 2]))


def creeping(runs: Mapping[str, Recording]) -> Result:
    """The experiment `creep`: angle that the link gives way while the motor turns out and back under a load."""
    run = runs["out_and_back"]
    arm = run.shared.arm
    motors, sensors = run.joints("motor_states"), run.joints("joint_sensors")
    start = run.step("out").begin
    first = int(np.searchsorted(motors.time, start))
    theta, angle = motors.position[first:, 0], sensors.position[first:, 0]
    time = motors.time[first:]
    before = slice(int(np.searchsorted(motors.time, start - REST)), first + 1)
    given = -(angle - theta * arm.joint_from_motor[0])
    given += float(np.mean(sensors.position[before, 0] - motors.position[before, 0] * arm.joint_from_motor[0]))
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(theta)))])
    load = load_torque(run, run.step("out"))
    predicted = crept(arm, travel, load)
    rows = []
    for step in run.steps:
        if step.name.startswith("rest"):
            at = int(np.searchsorted(time, step.end - ROUNDING)) - 1
            label = f"given way after {travel[at]:.1f} rad of the motor, {step.name.removeprefix('rest ')}"
            rows.append(Row(label, float(1e3 * predicted[at]), float(1e3 * given[at]), "mrad", WITHIN, "(6.19)"))
    curves = [Curve("measured", "measured", travel, 1e3 * given), Curve("predicted", "(6.19)", travel, 1e3 * predicted)]
    remark = "with the signed differential that is printed, (6.19) would give zero after each way back"
    return Result(
        rows, [Panel("creep, out and back twice", "travel of the motor [rad]", "given way [mrad]", curves)], (remark,)
    )


def crept(arm: Arm, travel: Numbers, load: float) -> Numbers:
    """Angle at the joint that the cables give way under a load at the joint, N m, over the motor's travel, (6.19)."""
    cables, share = arm.cables, arm.joint_from_motor[0]
    stages = zip(cables.stage_ratio, cables.stage_radius, cables.stage_ea, cables.stage_circuits, strict=True)
    total = sum(n * cable.creep(travel / n, n * load * share / c, r, ea) for n, r, ea, c in stages)
    return np.asarray(total) * share


def _losses(arm: Arm, torque: float) -> Numbers:
    cables = arm.cables
    return cable.stage_loss(torque, cables.stage_radius, cables.stage_ea, cables.stage_circuits, cables.stage_ratio)
