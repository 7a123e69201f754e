"""The report of a demonstration: tables for a terminal."""

import math
import textwrap
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wam_analysis.contact_list import NOT_ESTIMATED
from wam_analysis.demo_summary import DemoSummary, LoopReport
from wam_analysis.demo_traces import TOPICS_READ
from wam_analysis.findings.analysed_run import AnalysedRun, analysed_run
from wam_analysis.findings.contact import contact_doubts, contact_numbers
from wam_analysis.findings.finding import Finding
from wam_analysis.findings.force import press_findings
from wam_analysis.findings.held_force import Theory
from wam_analysis.findings.steps import VerdictResult, verdict
from wam_analysis.findings.text import table_lines
from wam_analysis.thresholds import LAYOUT
from wam_bag.bag import BagError, read
from wam_bag.errors import command
from wam_description.event import Code
from wam_sim.reactions import STEADY, sentences, within


class DemoReport(NamedTuple):
    """The report as text, at most 100 columns wide, and what is not as it should be.

    These are a failure of the run, and those answers of the verdict that are no.
    """

    text: str
    unmet: tuple[str, ...]


def report(bag: Path, namespace: str = "") -> DemoReport:
    """Evaluate a recorded demonstration.

    Parameters
    ----------
    bag : directory of the bag, or its .mcap file.
    namespace : of the arm, '' for the one with the most topics.

    Raises
    ------
    BagError
        if the bag cannot be read or holds no demonstration.
    """
    bag = Path(bag)
    recording = analysed_run(read(bag, TOPICS_READ, may_lack=True), namespace)
    if not recording.summary.steps:
        raise BagError(
            f"{bag} is not a recording of the demonstration: it has no step of a scenario; "
            f"{command('wam analyse', bag)} analyses any recording, {command('wam bag info', bag)} lists its topics"
        )
    wrong = [str(answer) for answer in verdict(recording) if answer.result is VerdictResult.NO]
    failed = [f"FAILED: {why}" for why in [recording.failure] if why]
    return DemoReport(f"{text(recording)}\n\nbag      {bag}", (*failed, *wrong))


def reaction_report(bag: Path) -> str:
    """What was not simply obeyed in a recording, by step, and contacts that were too hard; '' if nothing."""
    summary = analysed_run(read(bag, TOPICS_READ, may_lack=True)).summary
    hard = [line for sentence in summary.unplanned.sentences for line in _wrapped(f"  {sentence}", "    ")]
    return "\n".join([*_reactions(summary), *([""] if hard else []), *hard])


def text(recording: AnalysedRun) -> str:
    """The report without the name of the file."""
    summary = recording.summary
    forces = [one for held in recording.held for one in press_findings(held, Theory())]
    short = [one.hold.name for one in recording.held if one.hold.is_short]
    lines = [line for lost in summary.lost for line in _wrapped(f"INCOMPLETE: {lost}")]
    lines += _wrapped(f"Demonstration of {summary.namespace or '/'}: {_played(summary)}")
    worst = "Result, worst case in brackets" + (", for what is left of the recording" if summary.lost else "")
    lines += ["", worst, *(f"  {answer}" for answer in verdict(recording))]
    lines += [
        "",
        *_titled("Commanded forces", tuple(forces), "none was recorded"),
        *(_wrapped(f"  Less than {STEADY:g} s, no steady state: {', '.join(short)}.", "    ") if short else ()),
        *_reactions(summary),
        "",
        *_titled("Estimated contacts, medians over each", tuple(contact_numbers(summary)), _no_contact(summary)),
    ]
    for sentence in (
        *_contact_steps(summary),
        *contact_doubts(summary),
        *(one.sentence for one in summary.missed),
        *summary.unplanned.sentences,
    ):
        lines += _wrapped(f"  {sentence}", "    ")
    lines += _wrapped(_false_contacts(summary))
    lines += ["", *_wrapped(f"Loop     {_loop(summary.loop)}"), f"Messages {_messages(summary)}"]
    lines += [line for note in summary.notes for line in _wrapped(f"Note     {note}")]
    return "\n".join(lines)


def _played(summary: DemoSummary) -> str:
    if not summary.steps:
        return summary.outcome
    seconds = (summary.steps[-1].end - summary.steps[0].begin) / 1e9
    ended = Code.DONE if summary.outcome == Code.DONE else f"FAILED: {summary.outcome}"
    steps = f"{len(summary.steps)} step{'s' * (len(summary.steps) != 1)}"
    mode = summary.loop.mode if summary.loop.mode != "unknown" else "mode not known"
    return f"{steps}, {seconds:.1f} s, {mode}, {ended}"


def _titled(title: str, findings: tuple[Finding, ...], silent: str) -> list[str]:
    """A title with the tables of some numbers below it, or that there are none."""
    return [title, *(table_lines(findings, LAYOUT.width) if findings else [f"  {silent}"])]


def _no_contact(summary: DemoSummary) -> str:
    return "none" if np.any(summary.traces.estimated.is_known) else NOT_ESTIMATED


def _reactions(summary: DemoSummary) -> list[str]:
    """Commands that were not simply obeyed, by step."""
    stated = [
        line
        for step in summary.steps
        for line in sentences(step.name, within(summary.reactions, step.begin, step.end), summary.traces.zero)
    ]
    lines = ["Commands that were refused, and what was reported of others"] if stated else []
    return ["", *lines, *(line for one in stated for line in _wrapped(f"  {one}", "    "))] if stated else []


def _contact_steps(summary: DemoSummary) -> list[str]:
    """In which step each estimated contact was."""
    named = [f"{number} {contact.step}" for number, contact in enumerate(summary.contacts, 1) if contact.step]
    return [f"In the steps: {', '.join(named)}."] if named else []


def _false_contacts(summary: DemoSummary) -> str:
    if not summary.free:
        true, estimated = (np.any(signal.is_known) for signal in (summary.traces.true, summary.traces.estimated))
        why = "the arm was in contact all the time" if true else "the true contact was not recorded"
        why = why if estimated or not true else NOT_ESTIMATED
        return f"  false detections: not known, {why}"
    longest = f", longest {1e3 * summary.longest_false_contact:.0f} ms" if summary.false_contact else ""
    return f"  false detections: {1e3 * summary.false_contact:.0f} ms{longest}, in {summary.free:.1f} s without contact"


def _loop(loop: LoopReport) -> str:
    if loop.mode == "lockstep":
        waits = "lockstep: the driver waits for every command, so there is no latency to measure"
        if math.isnan(loop.factor):
            return waits
        slower = f", {loop.slips} periods too late to be made up for" if loop.slips else ""
        return f"{waits}; real-time factor {loop.factor:.2f}, at most {1e3 * loop.behind:.0f} ms behind{slower}"
    if math.isnan(loop.rate):
        return "no timing was recorded (status of driver in /diagnostics)"
    percent = 100.0 * loop.missed / max(loop.periods, 1)
    return (
        f"{loop.rate:.1f} Hz, latency p50 {loop.p50:.0f} us, p99 {loop.p99:.0f} us "
        f"(worst second {loop.worst:.0f} us), missed {loop.missed} of {loop.periods} periods ({percent:.2g} %)"
    )


def _messages(summary: DemoSummary) -> str:
    if summary.received < 0:
        return "the recorder wrote no counts"
    gone = f", {summary.gone} of them no longer in the bag" if summary.gone else ""
    return f"{summary.received} recorded{gone}, {summary.dropped} dropped"


def _wrapped(line: str, indent: str = " " * 9) -> list[str]:
    return textwrap.wrap(line, LAYOUT.width, subsequent_indent=indent, drop_whitespace=True) if line else []
