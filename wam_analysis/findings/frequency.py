"""Section about the velocity loops: their bandwidth."""

import math

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.held_messages import at_stamps, by_names
from wam_analysis.measures.frequency import bandwidth, frequency_response
from wam_analysis.measures.runs import after_gaps
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import CYCLE


def frequency_section(recording: AnalysedRecording) -> Section | None:
    """Up to which frequency the motors follow their velocity commands."""
    arm, signals, *_ = recording.motion
    if arm is None or signals is None:
        return None
    sentences, findings = [], []
    shows: list[str] = []
    commands, states = recording.run.joints("motor_velocity_command"), recording.run.joints("motor_states")
    lacking = recording.run.lacking("motor_velocity_command")
    commanded, got = (by_names(one, "velocity", arm.motors.names) for one in (commands, states))
    if commands is not None and states is not None and commanded is not None and got is not None:
        there, row = at_stamps(states, commands.stamp_ns)
        rate = 1e9 / max(float(np.median(np.diff(commands.stamp_ns))), 1.0) if len(commands.stamp_ns) > 1 else 0.0
        for i, name in enumerate(arm.motors.names):
            good = there & np.isfinite(commanded[:, i])
            put, out = commanded[good, i], got[row[good], i]
            try:
                found = frequency_response(
                    rate, put, out, max(8, round(CYCLE.segment * rate)), after_gaps(commands.stamp_ns[good])
                )
            except ValueError:
                continue
            if found.segments < CYCLE.segments:
                continue
            believed = (found.coherence >= CYCLE.coherent) & (found.excitation >= CYCLE.excited)
            width = bandwidth(found, believed)
            trusted = found.frequency[believed]
            top = float(trusted[-1]) if len(trusted) else math.nan
            findings += [
                Finding(f"{name}: bandwidth of the velocity loop", "Hz", width, note="-3 dB, of the coherent part"),
                Finding(
                    f"{name}: highest coherent frequency", "Hz", top, note=f"coherence at least {CYCLE.coherent:g}"
                ),
            ]
            sentences.append(_bandwidth_sentence(name, width, top))
            shows += [sentences[-1]] * (not math.isnan(width))
    if not sentences:
        least = 0.5 * (CYCLE.segments + 1) * CYCLE.segment
        sentences.append(
            f"The velocity commands are too short for a frequency response, which takes {least:g} s without a gap."
        )
    title = "Frequency response of the velocity loops"
    return Section("frequency", title, sentences, findings, lacking, shows)


def _bandwidth_sentence(name: str, width: float, top: float) -> str:
    if math.isnan(width):
        return f"{name}: bandwidth not identifiable (coherence below {CYCLE.coherent:g})."
    if math.isinf(width):
        return f"{name} followed its velocity command up to {shown(top, 'Hz')}, the highest frequency that was excited."
    return f"{name} followed its velocity command up to {shown(width, 'Hz')} (-3 dB)."
