"""Section about stick and slip."""

from wam_analysis.findings.finding import Finding, Section, rest_words, shown
from wam_analysis.foreign.mechanics import hidden_motion, sticking
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import SHAFT


def stick_section(recording: AnalysedRecording) -> Section:
    """How long each motor and joint was at rest, and how often it moved; whether it sticks under a command."""
    sentences, findings, verdict = [], [], []
    lacking = () if recording.is_foreign else recording.run.lacking("motor_states")
    for one in recording.states:
        command = recording.command_of(one)
        # not a position that is sent once and held
        is_speed = command is not None and len(command.time) >= SHAFT.fewest_samples
        least = SHAFT.motor_rest if one.topic == f"{recording.namespace}/motor_states" else SHAFT.joint_rest
        found = sticking(one, command if is_speed else None, least) if one.is_joint else None
        if found is None:
            continue
        if not found.slips and (distance := hidden_motion(one)):
            far = shown(distance, one.units["position"])
            sentences.append(f"{one.label}: moved by {far}, more slowly than the noise of its velocity.")
            continue
        findings += [
            Finding(f"{one.label}: at rest", "%", 100.0 * found.stuck),
            Finding(f"{one.label}: slips", "", float(found.slips)),
        ]
        sentence = f"{one.label}: {rest_words(found.stuck, found.slips)}"
        if found.commanded > SHAFT.disobeyed and found.slips > 2 and 100.0 * found.stuck > SHAFT.turning:
            sentence += f"; it sticks: {100.0 * found.commanded:.0f} % of its rest it was commanded to move"
            verdict.append(f"{sentence}.")
        sentences.append(f"{sentence}.")
    stated = tuple(sentences) or ("No velocity was recorded.",)
    return Section("stick_slip", "Stick and slip", stated, tuple(findings), lacking, tuple(verdict))
