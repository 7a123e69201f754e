"""Section about the efficiency in both directions."""

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown, stated
from wam_analysis.findings.transmission import TransmissionSignals
from wam_analysis.measures.runs import median_step
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Numbers


def efficiency_section(recording: AnalysedRecording) -> Section | None:
    """Efficiency of the transmission, where its losses are larger than the work that it stores."""
    signals, _, _, unknown = recording.friction
    if signals is None or unknown:
        return None
    has_strain = bool(np.any(np.isfinite(signals.strain)))
    at_links = signals.strain if has_strain else signals.cable_torque
    motor = np.sum((signals.torque - signals.rotors) * signals.velocity, axis=1)
    joint = np.sum(at_links * signals.joint_velocity, axis=1)
    known = np.isfinite(motor + joint)
    time, motor, joint, loss = (one[known] for one in (signals.time, motor, joint, _losses(signals, has_strain)))
    put, got = works(time, motor, joint)
    put_back, got_back = works(time, -joint, -motor)
    stored = float(np.sum(np.abs(motor[motor * joint < 0.0]))) * median_step(signals.time)
    sentences, findings = [], []
    if got > put or got_back > put_back or stored > put - got + put_back - got_back:
        sentences.append(
            "The efficiency was not measured: rotors and cables store and return more work here than is lost."
        )
        put = put_back = 0.0
    if put > SHAFT.least_work:
        rows = (motor > 0.0) & (joint > 0.0)
        expected = max(1.0 - float(np.sum(loss[rows]) / np.sum(motor[rows])), 0.0)
        note = "friction and cables (6.14) as configured, at the speeds and loads of this recording"
        findings.append(Finding("efficiency, motors to links", "%", 100.0 * got / put, 100.0 * expected, note))
        sentences.append(f"While driving, the motors put {shown(put, 'J')} into the transmission.")
    if put_back > SHAFT.least_work:
        findings.append(Finding("efficiency, links to motors", "%", 100.0 * got_back / put_back, note="backdriven"))
        sentences.append(f"The links, by their weight or a push, put {shown(put_back, 'J')} into it.")
    if not sentences:
        sentences.append("Too little work was done to measure the efficiency.")
    shows = [stated(f"{one.name}: {shown(one.measured, '%')}") for one in findings]
    return Section("efficiency", "Efficiency", sentences, findings, shows)


def _losses(signals: TransmissionSignals, with_joints: bool) -> Numbers:
    """Power lost to friction and creep by the configured parameters, (k,), W: up to the cables, or with the joints."""
    shafts = (signals.arm.motors, signals.velocity), (signals.arm.joints, np.nan_to_num(signals.joint_velocity))
    loss = sum(np.abs(v) @ one.dynamic_friction + v**2 @ one.viscous_friction for one, v in shafts[: 1 + with_joints])
    creep = [circuit.loss_per_torque for circuit in signals.arm.circuits]
    return loss + signals.load**2 * np.abs(signals.velocity) @ np.array(creep)


def works(time: Numbers, put: Numbers, got: Numbers) -> tuple[float, float]:
    """Work put in and got out, J, of the samples in which both powers are positive: their ratio is the efficiency.

    Parameters
    ----------
    time : (n,), s.
    put, got : (n,), power at either side in one direction, W, less that which accelerates a rotor.

    Notes
    -----
    Of a gap that is longer than the median period nothing is known: it holds no work.
    """
    steps = np.diff(time)
    usual = median_step(time)
    dt = np.minimum(np.append(steps, usual), usual)[: len(time)]
    onward = (put > 0.0) & (got > 0.0)
    return float(put[onward] @ dt[onward]), float(got[onward] @ dt[onward])
