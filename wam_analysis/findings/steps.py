"""Section about the steps of a scenario: whether each did what was commanded, in answers."""

import math
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import Section
from wam_analysis.held_messages import by_names, joint_angles, row_at
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import HOLD, TOUCH
from wam_analysis.traces import Traces
from wam_analysis.unplanned_contact import LIMIT
from wam_control.thresholds import MOTION
from wam_description.event import Code
from wam_description.number_text import apart, brief, digits_apart
from wam_sim.reactions import OUTCOMES, STEADY, unmet

HOW = (
    "In brackets: the worst value. The error of a force includes its ripple. "
    f"Contacts shorter than {TOUCH.bounce / 1e9:g} s do not count."
)


class VerdictResult(StrEnum):
    """What a recording shows of a question of the verdict."""

    YES = "YES"
    NO = "NO"
    NOTHING = "NOT EVALUATED"


def _yes(is_right: bool) -> VerdictResult:
    return VerdictResult.YES if is_right else VerdictResult.NO


class VerdictAnswer(NamedTuple):
    """One of the verdict.

    Attributes
    ----------
    question, result : as they are printed.
    worst : the worst value, '' where nothing is shown.
    remark : what was left out, '' if nothing.
    """

    question: str
    result: VerdictResult
    worst: str = ""
    remark: str = ""

    def __str__(self) -> str:
        """As a line of the report."""
        worst, remark = (f" ({self.worst})" * bool(self.worst), f", {self.remark}" * bool(self.remark))
        return f"{self.question}: {self.result}{worst}{remark}"


def steps_section(recording: AnalysedRecording) -> Section | None:
    """Whether the commands of a scenario were carried out; None without a scenario."""
    if not recording.steps:
        return None
    (brief, why), answers = recording.unassessed, [*verdict(recording)]
    failed = [f"{one.question} ({one.worst})" for one in answers if one.result is VerdictResult.NO]
    wrong = [f"Failed: {', '.join(failed)}."] if failed else []
    wrong += [f"{'; '.join(step.name for step in brief)}: {why}."] if brief else []
    stated_answers = (HOW, *(f"{answer}." for answer in answers)) if answers else ("Nothing in them can be evaluated.",)
    return Section("steps", "Result of the steps", stated_answers, wrong=wrong)


def _outcomes(recording: AnalysedRecording) -> dict[str, list[str]]:
    """Names of the steps whose command was not met, by what became of it; that of a force has its own answer."""
    found: dict[str, list[str]] = {one: [] for one in OUTCOMES}
    for step in recording.steps:
        is_force = any(step.begin < hold.end and hold.begin < step.end for hold in recording.holds)
        for one in {one.outcome for one in unmet(recording.reactions, step)} - {*OUTCOMES[:is_force]}:
            found[one].append(step.name)
    return found


def verdict(recording: AnalysedRecording) -> Iterator[VerdictAnswer]:
    """Whether postures, forces and contacts were right, each with its worst value, and what was too hard in motion."""
    if errors := _posture_errors(recording):
        yield _posture_verdict(errors)
    yield from _force_verdict(recording)
    yield from _command_verdict(recording)
    if recording.contacts or recording.touched:
        yield _link_verdict(recording)
        yield _position_verdict(recording)
    if not math.isnan(recording.traces.false_percent):
        yield _false_verdict(recording.traces)
    hard, unknown = recording.unplanned
    question = "without a commanded force, contacts stay below"
    if hard:
        worst = max(hard, key=lambda one: one.force)
        yield VerdictAnswer(
            f"{question} {worst.allowed:g} N", VerdictResult.NO, f"{apart(worst.force, worst.allowed, 0)} N"
        )
    elif unknown:
        yield VerdictAnswer(f"{question} {LIMIT}", VerdictResult.NOTHING, "", "see below")


def _posture_verdict(errors: Mapping[str, float]) -> VerdictAnswer:
    """Whether the arm came to each commanded posture."""
    missed = {name: error for name, error in errors.items() if error > MOTION.arrived}
    worst = max(errors, key=errors.__getitem__)
    shown = ", ".join(
        f"{brief(error, digits_apart(error, MOTION.arrived))} rad in step {name}"
        for name, error in (missed or {worst: errors[worst]}).items()
    )
    return VerdictAnswer(f"posture within {MOTION.arrived:g} rad", _yes(not missed), shown)


def _posture_errors(recording: AnalysedRecording) -> dict[str, float]:
    """How close all joints came to the posture of each step that moved it without a force or a task, rad, by its name.

    At the end of the step or soon after.  A step that was not played to its end, or ended while its commanded motion
    went on because of a contact, has no posture to reach.
    """
    run, arm, traces = recording.run, recording.parameters.arm, recording.traces
    command = run.joints("joint_posture_command")
    commanded = None if arm is None else by_names(command, "position", arm.joints.names)
    angles = None if arm is None else joint_angles(run, arm)
    if command is None or commanded is None or angles is None:
        return {}
    tasks = [(begin, end) for task, begin, end in recording.tasks if task.axes]
    errors: dict[str, float] = {}
    for step in run.steps if recording.outcome == Code.DONE else run.steps[:-1]:
        before, last = np.searchsorted(command.stamp_ns, [step.begin, step.end]) - 1
        is_still = last <= before or np.abs(commanded[last] - commanded[max(before, 0)]).max() <= MOTION.arrived
        newest = slice(last - 1, last + 1)
        moved, period = np.abs(np.diff(commanded[newest], axis=0)), np.diff(command.stamp_ns[newest]) / 1e9
        is_cut = np.any(moved > MOTION.at_rest * period)
        is_forced = np.any(traces.during(step.begin, step.end) & traces.commanded.acts)
        if is_still or is_cut or is_forced or any(step.begin < end and begin < step.end for begin, end in tasks):
            continue
        first, after = row_at(angles[0], np.array([step.end, step.end + round(1e9 * HOLD.arrival)]))
        off = np.abs(angles[1][first : after + 1] - commanded[last]).max(axis=1)
        errors[step.name] = max(errors.get(step.name, 0.0), float(off.min()))
    return errors


def _force_verdict(recording: AnalysedRecording) -> Iterator[VerdictAnswer]:
    """Whether each force was reached; nothing where none was commanded."""
    traces, held, holds = recording.traces, recording.held, recording.holds
    pressed = [one for one in recording.steps if np.any(traces.during(one.begin, one.end) & traces.commanded.acts)]
    # steps that commanded a force too briefly for a hold
    brief = sum(not any(hold.begin < step.end and step.begin < hold.end for hold in holds) for step in pressed)
    question = f"force within {HOLD.force_tolerance:g} %"
    # not the mean alone: a force that swings or is lost is not the commanded one
    done = [one for one in held if not one.hold.is_refused]
    if len(done) < len(held):
        yield VerdictAnswer(question, VerdictResult.NO, f"{len(held) - len(done)} of {len(held)} not applied")
    elif held or brief:
        errors = [100.0 * one.accuracy["true"].smallest / one.hold.commanded for one in done] + [math.nan] * brief
        short = brief + sum(one.hold.is_short for one in done)
        remark = f"{short} of {len(held) + brief} forces constant for less than {STEADY:g} s" * bool(short)
        yield _answer(question, errors, HOLD.force_tolerance, "{} %")._replace(remark=remark)


def _command_verdict(recording: AnalysedRecording) -> Iterator[VerdictAnswer]:
    """Commands that were not carried out; nothing if there is none, and all could be assessed."""
    missed = [f"{what}: {', '.join(names)}" for what, names in _outcomes(recording).items() if names]
    brief, why = recording.unassessed
    if missed or brief:
        result = VerdictResult.NO if missed else VerdictResult.NOTHING
        yield VerdictAnswer("commands carried out", result, "; ".join(missed), f"{len(brief)} {why}" * bool(brief))


def _link_verdict(recording: AnalysedRecording) -> VerdictAnswer:
    """Of each true contact; one that is estimated where none is has its own answer."""
    if any(one.lasts for one in recording.missed):
        return VerdictAnswer("correct link", VerdictResult.NO, "missed")
    lasting = [one for one in recording.touched if one.lasts]
    wrong = dict.fromkeys(one.link for one in lasting if one.right < TOUCH.lasting)
    shown = f"another link than {', '.join(wrong)}"
    answer = _answer("correct link", [1.0 - one.right for one in lasting], 1.0 - TOUCH.lasting, shown)
    if answer.result is not VerdictResult.YES:
        return answer
    least = 100.0 * min(one.right for one in lasting)
    return answer._replace(worst=f"{least:.3g} % of each contact, required: {100.0 * TOUCH.lasting:g} %")


def _position_verdict(recording: AnalysedRecording) -> VerdictAnswer:
    """Positions are compared unless the estimator reports that it cannot observe them, which are counted."""
    found = [(number, one) for number, one in enumerate(recording.contacts, 1) if not one.is_false]
    errors = [100.0 * abs(one.position_error) for _, one in found if not one.is_lower_bound]
    errors += [math.nan] * sum(one.lasts for one in recording.missed)
    question = f"position within {100.0 * TOUCH.position_tolerance:g} cm"
    unknown = [f"{number} ({one.link})" for number, one in found if one.is_lower_bound]
    answer = _answer(question, errors, 100.0 * TOUCH.position_tolerance, "{} cm")
    return answer._replace(remark=f"contact {', '.join(unknown)} not evaluated: position unknown" * bool(unknown))


def _false_verdict(traces: Traces) -> VerdictAnswer:
    """Whether a contact was estimated where none is."""
    part, seconds = traces.false_percent, traces.false_seconds
    question = f"at most {TOUCH.false_tolerance:g} % false contact"
    if part > TOUCH.false_tolerance and seconds <= TOUCH.ending:
        brief = f"only {1e3 * seconds:.0f} ms, which is normal when a contact ends"
        return VerdictAnswer(question, VerdictResult.NOTHING, remark=brief)
    remark = f"{apart(part, TOUCH.false_tolerance)} % of the time without contact"
    return VerdictAnswer(question, _yes(part <= TOUCH.false_tolerance), remark)


def _answer(question: str, values: Sequence[float], allowed: float, shown: str) -> VerdictAnswer:
    """Whether all values are at most what is allowed, with the largest of them as it is shown."""
    known = [value for value in values if not math.isnan(value)]
    worst = max(known, default=math.nan)
    if worst > allowed:
        return VerdictAnswer(question, VerdictResult.NO, shown.format(apart(worst, allowed)))
    if not known or len(known) < len(values):
        return VerdictAnswer(question, VerdictResult.NOTHING)
    return VerdictAnswer(question, VerdictResult.YES, shown.format(apart(worst, allowed)) * bool(allowed))
