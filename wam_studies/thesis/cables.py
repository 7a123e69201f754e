"""Chapter 6: creep of the cables under load, (6.19), and joint angles that are corrected for it."""

import numpy as np
from numpy.typing import ArrayLike

from wam_description.arm import Arm
from wam_studies.figures.panels import Numbers, Panel, line_only, measured
from wam_studies.thesis.bounds import BOUNDS
from wam_studies.thesis.recording import Recording, Runs, Step
from wam_studies.thesis.rows import Comparison, Result
from wam_theory import cable


def creeping(runs: Runs) -> Result:
    """The experiments `creep` and `creep-correction`: error of the joint angle that the transform has of the motor's.

    At each rest after the motor begins to turn: the creep, or nothing where the transform corrects it.
    """
    rows, curves = [], []
    for name, run in runs.items():
        joints, sensors, motors = (run.joints(topic) for topic in ("joint_states", "joint_sensors", "motor_states"))
        time, begin, label = joints.time, run.step("out").begin, name.replace("_", " ")
        error = joints.position[:, 0] - np.interp(time, sensors.time, sensors.position[:, 0])
        error -= error[(time > begin - BOUNDS.rest_before) & (time <= begin)].mean()  # elastic stretch
        theta = np.interp(time, motors.time, motors.position[:, 0])
        travel = np.cumsum(np.abs(np.diff(theta, prepend=theta[0])) * (time > begin))
        creep = crept(run.shared.arm, travel, load_torque(run, run.step("out")))
        is_corrected = bool(run.parameters.node("transform")["creep_correction"])
        share, within = (0.0, BOUNDS.creep_left) if is_corrected else (1.0, BOUNDS.within)
        for step in run.steps:
            if step.name.startswith("rest"):
                late = (time > step.end - BOUNDS.rest_before) & (time < step.end)
                found, whole = 1e3 * float(error[late].mean()), 1e3 * float(creep[late][-1])
                quantity = f"{label}, {step.name}: error after {travel[late][-1]:.1f} rad of the motor"
                rows.append(Comparison(quantity, share * whole, found, "mrad", within * whole, "(6.19)", True))
        moved = slice(int(np.searchsorted(time, begin)), None)
        curves += [
            (label, measured(travel[moved], 1e3 * error[moved])),
            (f"{label}, predicted", line_only(travel[moved], 1e3 * share * creep[moved])),
        ]
    panel = Panel("joint angle, from motor angles", "travel of the motor [rad]", "error [mrad]", curves)
    return Result(rows, [panel], ("with the printed signed differential, (6.19) would be zero after each return",))


def load_torque(run: Recording, step: Step) -> float:
    """Torque of the push in a step at the joint, N m, positive against it."""
    push = run.forces("sim/disturbance").during(step.begin, step.end - BOUNDS.rounding)
    return -float(np.median(push.torque[:, 2]))


def crept(arm: Arm, travel: ArrayLike, load: float) -> Numbers:
    """Creep at the joint, rad, under a load at the joint, N m, over the motor's travel, (6.19)."""
    cables, ratio = arm.cables, arm.joint_from_motor[0]
    stages = zip(cables.stage_ratio, cables.stage_radius, cables.stage_ea, cables.stage_circuits, strict=True)
    total = sum(n * cable.creep(np.asarray(travel) / n, n * load * ratio / c, r, ea) for n, r, ea, c in stages)
    return np.asarray(total) * ratio
