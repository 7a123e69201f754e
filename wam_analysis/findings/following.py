"""Section about how what was measured follows its command: joints in steps, joints and forces in motion."""

import math

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.findings.force import SWINGS_ON, fate_words
from wam_analysis.findings.force_steps import force_steps, steady_error, worst
from wam_analysis.findings.repetition import LEAST
from wam_analysis.foreign.pieces import pieces, resolution, rests
from wam_analysis.foreign.source import AXES, Source
from wam_analysis.held_messages import value_changes
from wam_analysis.measures.following import Following, following
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import CYCLE, SHAFT
from wam_bag.columns import JOINT_FIELDS


def following_section(recording: AnalysedRecording) -> Section | None:
    """How what was measured follows its command; None where nothing was commanded."""
    sentences, findings, wrong = list[str](), list[Finding](), list[str]()
    for one in recording.states:
        if (command := recording.command_of(one)) is None:
            continue
        own = one if command.values.keys() & one.values.keys() else _with_rate(one)
        quantities = [q for q in (*JOINT_FIELDS, *AXES) if q in command.values and q in own.values]
        for quantity in quantities[: 1 if one.is_joint else len(AXES)]:
            name, unit = f"{one.label} {quantity}", one.units[quantity]
            measured, wanted = own.only(quantity), command.only(quantity)
            found, steps = _following(measured, wanted), force_steps(measured, wanted) if one.is_joint else []
            numbers, remarks = dict[str, tuple[float, str]](), list[str]()
            if rests(measured) and _moves(measured, wanted):
                wrong.append(f"{name}: it was commanded to move, and never did.")
            if found:
                remarks.append(_words(found, unit))
                numbers |= {"error, rms": (found.rms, unit), "largest error": (found.largest, unit)}
            is_like = found is None or math.isfinite(found.gain)
            if found and is_like:
                numbers |= {"gain": (found.gain, ""), "delay": (found.delay, "s"), "offset": (found.offset, unit)}
                numbers |= {"play": (found.play, unit)} if found.play else {}
            if steps:
                remarks.append(steady_error(steps, "step", unit))
                error = worst(steps).error
                numbers |= {"largest steady error": (error, unit)} if math.isfinite(error) else {}
                known = [step.response for step in steps if math.isfinite(step.response.rise)]
                if known and found is None:  # a path has a rise of its own
                    overshoot = 100.0 * max(one.overshoot for one in known)
                    remarks.append(f"the largest overshoot is {shown(overshoot, '%')}")
                    numbers["median rise time 10-90 %"] = (float(np.median([one.rise for one in known])), "s")
                    numbers["largest overshoot"] = (overshoot, "%")
                wrong += [
                    f"{name}, {shown(step.commanded, unit)} at {step.begin:.1f} s: it {fate_words(step.swings)}."
                    for step in steps
                    if step.swings.verdict in SWINGS_ON
                ]
            if remarks:
                (sentences if is_like else wrong).append(f"{name}: {'; '.join(remarks)}.")
            findings += [Finding(f"{name}: {what}", of, value) for what, (value, of) in numbers.items()]
    stated = [*sentences, *wrong]
    return Section("following", "Commands", stated, findings, sentences, wrong) if stated else None


def _words(found: Following, unit: str) -> str:
    """How a quantity follows, in words."""
    error = f"the largest error is {shown(found.largest, unit)} at {found.at:.1f} s"
    if math.isnan(found.gain):
        return (
            f"a gain and a delay do not explain {shown(100.0 * found.unexplained, '%')} of how it follows its command; "
            f"{error}"
        )
    play = f" and a play of {shown(found.play, unit)}" * bool(found.play)
    off = f", and is off by {shown(found.offset, unit)}" * (abs(found.offset) > SHAFT.agree * found.largest)
    when = f"{shown(abs(found.delay), 's')} {'after' if found.delay >= 0.0 else 'before'} its command"
    return f"follows {when}, with a gain of {shown(found.gain)}{play}{off}; {error}"


def _with_rate(one: Source) -> Source:
    """A joint with the rate of its position, where only a velocity may have been commanded."""
    if not (some := pieces(one, "position")):
        return one
    time, rate = np.hstack([(piece.time, piece.values["velocity"]) for piece in some])
    return one._replace(time=time, values={"velocity": rate})


def _moves(measured: Source, command: Source) -> bool:
    """Whether a command moves, early enough to be followed, by more than the noise of what follows it."""
    (value,), (sent,) = measured.values.values(), command.values.values()
    least = max(SHAFT.joint_rest, SHAFT.far * resolution(value))
    early = sent[command.time < measured.time[-1] - CYCLE.longest_delay]
    return float(np.max(np.abs(early - sent[0]), initial=0.0)) > least


def _following(measured: Source, command: Source) -> Following | None:
    """How the only quantity of a source follows that of its command; None where the command hardly moves."""
    ((quantity, value),), (sent,) = measured.values.items(), command.values.values()
    moves = np.count_nonzero(value_changes(sent[:, np.newaxis], LEAST[measured.units[quantity]]))
    known = (measured.time >= command.time[0]) & ~command.is_away(measured.time)
    if moves < SHAFT.fewest_samples or np.count_nonzero(known) < SHAFT.fewest_samples:
        return None
    return following(measured.time[known], value[known], command.time, sent)
