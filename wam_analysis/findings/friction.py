"""Section about the friction of motors and joints."""

import math

import numpy as np

from wam_analysis.findings.finding import Finding, Section, deviations, shown
from wam_analysis.findings.transmission import CABLE
from wam_analysis.measures.friction import UNKNOWN, Friction
from wam_analysis.recording import AnalysedRecording
from wam_bag.arrays import Numbers
from wam_description.arm import Arm
from wam_description.parts import Joints, Motors

UNITS = {"static": "N m", "dynamic": "N m", "viscous": "N m s/rad"}
MORE = "record different motions, slow and fast, in both directions, over a turn or more of the motors"


def friction_section(recording: AnalysedRecording) -> Section:
    """Friction of motors and joints, next to what is configured."""
    signals, motors, joints, unknown = recording.friction
    if signals is None:
        return Section("friction", "Friction", (unknown,))
    arm = signals.arm
    alone = signals.load_from == CABLE
    note = "with the joint's friction; " * (not alone) + f"load from the {signals.load_from}"
    findings = []
    for i, (name, found) in enumerate(motors.items()):
        findings += _friction_findings(name, found, _of_motor(arm, i, alone), note)
    for i, (name, found) in enumerate(joints.items()):
        findings += _friction_findings(name, found, _configured(arm.joints)[:, i], "cable torque less strain")
    sentences, every = [], {**motors, **joints}
    unsure = [
        f"{kind} friction of {name}" for name, one in every.items() for kind in UNITS if getattr(one, kind).is_vague
    ]
    if unsure:
        sentences.append(f"This recording does not determine {', '.join(unsure)}: {MORE}.")
    if still := [name for name, one in every.items() if math.isnan(one.dynamic.value)]:
        sentences.append(f"No friction found for {', '.join(still)}: too little motion, or other torques act, too.")
    flagged = deviations(findings)
    stated = (*[unknown][: bool(unknown)], *signals.caveats, *sentences, *flagged)
    return Section("friction", "Friction", stated, findings, flagged)


def _configured(shafts: Motors | Joints) -> Numbers:
    """Static, dynamic and viscous friction of some shafts, (3, n)."""
    return np.array([getattr(shafts, f"{kind}_friction") for kind in UNITS])


def _of_motor(arm: Arm, i: int, alone: bool) -> Numbers:
    """Configured friction, (3,), with the joint's if it is part of the measured one; NaN with several joints."""
    own, column = _configured(arm.motors)[:, i], np.abs(arm.transmission.joint_from_motor[:, i])
    if alone:
        return own
    if np.count_nonzero(column) > 1:
        return np.full(3, math.nan)
    return own + (np.array([column, column, column**2]) * _configured(arm.joints)).sum(axis=1)


def _friction_findings(name: str, found: Friction, configured: Numbers, note: str) -> list[Finding]:
    """Of one shaft."""
    about = {"static": f"{found.breakaways} breakaways"}
    if math.isnan(found.offset) and math.isfinite(found.dynamic.value):
        about["dynamic"] = "measured in one direction only, includes any offset"
    findings = []
    for (kind, unit), predicted in zip(UNITS.items(), configured.tolist(), strict=True):
        doubt, known = "", getattr(found, kind)
        if known.is_vague:
            value, error = map(shown, known)
            doubt = f"not identifiable: {value} +-{error}" if math.isfinite(known.error) else "not identifiable"
            known = UNKNOWN
        text = "; ".join(filter(None, (about.get(kind), doubt, note)))
        findings.append(Finding(f"{name}: {kind} friction", unit, known.value, predicted, text, known.error))
    return findings
