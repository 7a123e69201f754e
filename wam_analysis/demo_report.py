"""The report of a demonstration: tables for a terminal, and a picture in the directory of the bag."""

import math
import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wam_analysis.contact_comparison import NOT_RECORDED, StepContact
from wam_analysis.contact_list import NO_LINK, NOT_CERTAIN, NOT_ESTIMATED, NOT_PLACED, CutBy
from wam_analysis.demo_figure import save
from wam_analysis.demo_summary import DemoSummary, LoopReport, SteadyPress, failure_of, summary_of
from wam_analysis.demo_traces import TOPICS_READ
from wam_analysis.recorded import recorded_arm
from wam_analysis.table import bounded, plain
from wam_analysis.thresholds import HOLD, LAYOUT, TOUCH
from wam_analysis.unplanned_contact import LIMIT
from wam_bag.bag import BagError, read
from wam_description.event import Code
from wam_sim.reactions import OUTCOMES, STEADY, sentences, steady_begin, too_short, unassessed, unmet, within
from wam_sim.recording import recorded_run


class VerdictResult(StrEnum):
    """What a recording shows of a question of the verdict."""

    YES = "YES"
    NO = "NO"
    NOTHING = "NOT SHOWN"


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


class DemoReport(NamedTuple):
    """The report as text, at most 100 columns wide, and what is not as it should be.

    These are a failure of the run, and those answers of the verdict that are no.
    """

    text: str
    unmet: tuple[str, ...]


def report(bag: Path, picture: Path | None = None, namespace: str = "") -> DemoReport:
    """Evaluate a recorded demonstration, and draw it.

    Parameters
    ----------
    bag : directory of the bag, or its .mcap file.
    picture : PNG file to write, None for no picture.
    namespace : of the arm, '' for the one with the most topics.

    Raises
    ------
    BagError
        if the bag cannot be read or holds no demonstration; then nothing is written.
    """
    bag = Path(bag)
    run = recorded_run(read(bag, TOPICS_READ, may_lack=True), namespace)
    summary = summary_of(run)
    if not summary.steps:
        raise BagError(
            f"{bag} is not a recording of the demonstration: it has no step of a scenario; 'wam analyse {bag}' "
            f"analyses any recording, 'wam bag info {bag}' lists its topics"
        )
    notes: tuple[str, ...] = ()
    if picture is not None:
        try:
            notes = save(picture, summary, recorded_arm(run.parameters))
        except OSError as error:
            notes = (f"the picture was not written: {error}",)
    files = [f"bag      {bag}", *([f"picture  {picture}"] if picture is not None and picture.is_file() else [])]
    wrong = [str(answer) for answer in verdict(summary) if answer.result is VerdictResult.NO]
    failed = [f"FAILED: {why}" for why in [failure_of(run)] if why]
    return DemoReport("\n".join([text(summary, notes), "", *files]), (*failed, *wrong))


def reaction_report(bag: Path) -> str:
    """What was not simply obeyed in a recording, by step, and contacts that were too hard; '' if nothing."""
    return reaction_text(summary_of(recorded_run(read(bag, TOPICS_READ, may_lack=True))))


def reaction_text(summary: DemoSummary) -> str:
    """The same of a summary."""
    hard = [line for sentence in summary.unplanned.sentences for line in _wrapped(f"  {sentence}", "    ")]
    return "\n".join([*_reactions(summary), *([""] if hard else []), *hard])


def text(summary: DemoSummary, notes: Sequence[str] = ()) -> str:
    """The report without the names of files.

    Parameters
    ----------
    summary : of the bag.
    notes : to be added to those of the summary.
    """
    lines = [line for lost in summary.lost for line in _wrapped(f"INCOMPLETE: {lost}")]
    lines += _wrapped(f"Demonstration of {summary.namespace or '/'}: {_played(summary)}")
    worst = "Result, worst case in brackets" + (", for what is left of the recording" if summary.lost else "")
    lines += ["", worst, *(f"  {answer}" for answer in verdict(summary))]
    lines += [
        "",
        *_presses(summary.presses),
        *_positions(summary.presses),
        *_reactions(summary),
        "",
        *_contacts(summary),
        *_touches(summary.touches, summary.period),
    ]
    for sentence in (*_uncompared(summary), *(one.sentence for one in summary.missed), *summary.unplanned.sentences):
        lines += _wrapped(f"  {sentence}", "    ")
    lines += _wrapped(_false_contacts(summary))
    lines += ["", *_wrapped(f"Loop     {_loop(summary.loop)}"), f"Messages {_messages(summary)}"]
    lines += [line for note in (*summary.notes, *notes) for line in _wrapped(f"Note     {note}")]
    return "\n".join(lines)


def verdict(summary: DemoSummary) -> tuple[VerdictAnswer, ...]:
    """Whether force, link and position were right, each with its worst value, and what was too hard in motion."""
    answers = (
        _force_verdict(summary.presses),
        *_command_verdict(summary),
        _link_verdict(summary),
        _position_verdict(summary),
        *_false_verdict(summary),
    )
    hard, unknown = summary.unplanned
    question = "without a commanded force no contact above"
    if hard:
        worst = max(hard, key=lambda one: one.force)
        return *answers, VerdictAnswer(f"{question} {worst.allowed:g} N", VerdictResult.NO, f"{worst.force:.0f} N")
    return *answers, *[VerdictAnswer(f"{question} {LIMIT}", VerdictResult.NOTHING, "", "see below")][: bool(unknown)]


def _force_verdict(presses: Sequence[SteadyPress]) -> VerdictAnswer:
    question = f"force within {HOLD.force_tolerance:g} %"
    # not the mean alone: a force that swings or is lost is not the commanded one
    done = [press for press in presses if not press.is_refused]
    ripples = [100.0 * press.ripple / abs(press.commanded) for press in done]
    errors = [abs(press.error(press.true)) + ripple for press, ripple in zip(done, ripples, strict=True)]
    if len(done) < len(presses):
        return VerdictAnswer(question, VerdictResult.NO, f"{len(presses) - len(done)} of {len(presses)} refused")

    def of(worst: float) -> str:
        ripple = f"{ripples[errors.index(worst)]:.1f}"
        return f"{worst:.1f} %" + (f", {ripple} % of it ripple" if float(ripple) else "")

    answer = _answer(question, errors, lambda error: error <= HOLD.force_tolerance, of)
    short = sum(press.is_short for press in presses)
    remark = f"{short} of {len(presses)} commanded for less than {STEADY:g} s" * bool(short)
    return answer._replace(remark=remark)


def _command_verdict(summary: DemoSummary) -> list[VerdictAnswer]:
    """Commands that were not carried out; none if there is none, and all could be assessed."""
    forces = {press.begin for press in summary.presses}
    outcomes: Counter[str] = Counter()
    for step in summary.steps:
        found = {one.outcome for one in unmet(summary.reactions, step)}
        if steady_begin(step) in forces:
            found -= {OUTCOMES[0]}  # that of a force has its own answer
        outcomes.update(found)
    counts = [f"{outcomes[one]} {one}" for one in OUTCOMES if outcomes[one]]
    brief = unassessed(summary.reactions, summary.torques, summary.steps, summary.settling_times)
    if not counts and not brief:
        return []
    result = VerdictResult.NO if counts else VerdictResult.NOTHING
    remark = f"{len(brief)} {too_short(summary.settling_times, brief)}" * bool(brief)
    return [VerdictAnswer("commands carried out", result, ", ".join(counts), remark)]


def _link_verdict(summary: DemoSummary) -> VerdictAnswer:
    def wrong(touch: StepContact) -> float:
        if NOT_RECORDED in (touch.link_true, touch.link_estimated):
            return math.nan
        return TOUCH.missed if touch.link_estimated == NO_LINK else float(touch.link_true != touch.link_estimated)

    least = min((touch.right for touch in summary.touches if not math.isnan(touch.right)), default=0.0)
    missed = [TOUCH.missed for contact in summary.missed if contact.end - contact.begin >= 1e-9 * TOUCH.bounce]
    return _answer(
        "right link",
        [*(wrong(touch) for touch in summary.touches), *missed],
        lambda value: not value,
        lambda wrong: {TOUCH.missed: "missed", 0.0: f"{100.0 * least:.0f} %"}.get(wrong, "another link"),
    )


def _position_verdict(summary: DemoSummary) -> VerdictAnswer:
    """Positions are compared unless the estimator reports that it cannot observe them, which are counted."""
    touches = [touch for touch in summary.touches if touch.link_true != NO_LINK]
    errors = [abs(touch.position_estimated - touch.position_true) for touch in touches if not touch.is_lower_bound]
    question = f"position within {100.0 * TOUCH.position_tolerance:g} cm"
    unknown = len(touches) - len(errors)
    answer = _answer(
        question, errors, lambda error: error <= TOUCH.position_tolerance, lambda far: f"{100.0 * far:.1f} cm"
    )
    return answer._replace(remark=f"unknown for {unknown} of {len(touches)} contacts" * bool(unknown))


def _false_verdict(summary: DemoSummary) -> list[VerdictAnswer]:
    """Whether a contact was estimated where none is; none where that is not known."""
    if not summary.free:
        return []
    question = f"false detections within {TOUCH.false_tolerance:g} % of the time without contact"
    part = 100.0 * summary.false_contact / summary.free
    if part > TOUCH.false_tolerance and summary.false_contact <= TOUCH.ending:
        brief = f"{1e3 * summary.false_contact:.0f} ms, as a contact that ends may take"
        return [VerdictAnswer(question, VerdictResult.NOTHING, remark=brief)]
    is_right = part <= TOUCH.false_tolerance
    return [VerdictAnswer(question, VerdictResult.YES if is_right else VerdictResult.NO, f"{part:.1f} %")]


def _answer(
    question: str, values: Sequence[float], good: Callable[[float], bool], worst: Callable[[float], str]
) -> VerdictAnswer:
    known = [value for value in values if not math.isnan(value)]
    if known and not all(good(value) for value in known):
        return VerdictAnswer(question, VerdictResult.NO, worst(max(known)))
    if not known or len(known) < len(values):
        return VerdictAnswer(question, VerdictResult.NOTHING)
    return VerdictAnswer(question, VerdictResult.YES, worst(max(known)))


def _played(summary: DemoSummary) -> str:
    if not summary.steps:
        return summary.outcome
    seconds = (summary.steps[-1].end - summary.steps[0].begin) / 1e9
    ended = Code.DONE if summary.outcome == Code.DONE else f"FAILED: {summary.outcome}"
    steps = f"{len(summary.steps)} step{'s' * (len(summary.steps) != 1)}"
    mode = summary.loop.mode if summary.loop.mode != "unknown" else "mode not known"
    return f"{steps}, {seconds:.1f} s, {mode}, {ended}"


def _presses(presses: Sequence[SteadyPress]) -> list[str]:
    title = f"Force along the commanded one, mean of the last {STEADY:g} s of each step, at most its second half [N]"
    if not presses:
        return [title, "  no pressing step was recorded"]
    head = ["step", "commanded", "true", "+-", "error", "measured", "error", "estimated", "error"]
    rows = [
        [
            press.step,
            *(_number(force, 2) for force in (press.commanded, press.true, press.ripple)),
            _per_cent(press, press.true),
            *(_number(press.measured, 2), _per_cent(press, press.measured)),
            *(_number(press.estimated, 2), _per_cent(press, press.estimated)),
        ]
        for press in presses
    ]
    return [
        title,
        *_table(rows, head),
        "  true: of all that acts on the link (simulator), the part along the commanded force; +-: half of",
        "    its range; measured: force loop; estimated: contact estimator",
        *[f"  short: commanded for less than {STEADY:g} s: no steady state"][: any(p.is_short for p in presses)],
        *["  refused: the arm did not follow the command, see below"][: any(p.is_refused for p in presses)],
    ]


def _positions(presses: Sequence[SteadyPress]) -> list[str]:
    """What the estimated contact position is worth: the force that the same torques are at each position."""
    rows: list[list[str]] = []
    used: list[str] = []
    for press in presses:
        if press.is_refused or not press.true:  # nothing was measured, or nothing touched
            continue
        cells: list[str] = []
        for one in press.positions.forces:
            off = 100.0 * (one.force - press.true) / press.true
            cells += [_number(100.0 * one.position, 1), _number(one.force, 2)]
            cells.append("-" if math.isnan(off) else f"{off:+.1f} %")
        if any(not math.isnan(one.force) for one in press.positions.forces):
            used.append(f"{100.0 * press.positions.used:.1f} +- {100.0 * press.positions.used_sd:.1f}")
            rows.append([press.step, _number(press.true, 2), *cells])
    if not rows:
        return []
    first = ["", "", "configured", "[cm]", "", "estimated", "[cm]", "", "true", "[cm]", ""]
    head = ["step", "true", "at", "[N]", "error", "at", "[N]", "error", "at", "[N]", "error"]
    title = "Force from the same torques, for three assumed contact positions"
    error = ["  error: relative to the true force; at the true position it is that of the torques alone"]
    if any("-" in row for row in rows):
        error.append("  -: not known, on another link or beyond the ends of this one")
    places = _wrapped(f"  position used by the force loop, +- its standard deviation [cm]: {', '.join(used)}", "    ")
    other = "  the measured force above allows for that uncertainty, so it is none of these three"
    return ["", title, *_table(rows, first, head), *error, *places, other]


def _reactions(summary: DemoSummary) -> list[str]:
    """Commands that were not simply obeyed, by step."""
    stated = [
        line
        for step in summary.steps
        for line in sentences(step.name, within(summary.reactions, step.begin, step.end), summary.traces.zero)
    ]
    lines = ["Commands that were refused, and what was reported of others"] if stated else []
    return ["", *lines, *(line for one in stated for line in _wrapped(f"  {one}", "    "))] if stated else []


def _contacts(summary: DemoSummary) -> list[str]:
    """All that was estimated, from the estimate alone."""
    title, contacts = "Estimated contacts, medians over each", summary.contacts
    if not contacts:
        return [title, "  none" if np.any(summary.traces.estimated.is_known) else f"  {NOT_ESTIMATED}"]
    estimates = [contact.estimate for contact in contacts]
    first = ["", "time", "[s]", "link", "prob.", "position", "[cm]", "force", "[N]", "second"]
    head = ["step", "from", "to", "", "[%]", "", "+-", "", "+-", "contact"]
    rows = [
        [
            *(contact.step, "<=" * (contact.before is not CutBy.NOTHING) + _number(contact.begin, 2)),
            bounded(_number(contact.end, 2), contact.after is not CutBy.NOTHING),
            *(one.link, _number(100.0 * one.probability, 0)),
            ("?" + "*" * bool(one.reasons)) if one.is_lower_bound else _number(100.0 * one.position, 1),
            _number(100.0 * one.position_sd, 1),
            bounded(_number(one.force, 2), one.is_lower_bound),
            *(_number(one.force_sd, 2), _number(100.0 * one.second, 0)),
        ]
        for contact, one in zip(contacts, estimates, strict=True)
    ]
    lines = [title, *_table(rows, first, head)]
    before, after = ({getattr(contact, end) for contact in contacts} for end in ("before", "after"))
    if CutBy.RECORDING in before:
        lines.append("  from <=: it began before the recording")
    if CutBy.RECORDING in after:
        lines.append("  to >=: it goes past the end of the recording")
    if CutBy.GAP in before | after:
        lines.append("  from <=, to >= within the recording: the estimate is missing there, and comes again")
    if any(math.isnan(one.position) and one.is_placed and not one.is_lower_bound for one in estimates):
        lines.append("  position -: known for less than half of the time of the contact")
    if not all(one.is_placed for one in estimates):
        lines += _wrapped(f"  position -: {NOT_PLACED}", "    ")
    if any(one.is_lower_bound for one in estimates):
        lines.append("  position ?: the estimator cannot observe it")
        lines.append("  force >=: the least force that explains the torques, not an estimate")
    unknown = (reason for one in estimates if one.is_lower_bound for reason in one.reasons)
    for reason in dict.fromkeys(unknown):
        lines += _wrapped(f"  * {reason}", "    ")
    if any(math.isnan(one.probability) for one in estimates):
        lines += _wrapped(f"  {NOT_CERTAIN}", "    ")
    link = "prob.: probability of the link; +-: standard deviation"
    second = "second contact: per cent of the time in which one was suspected"
    return [*lines, *_wrapped(f"  {link}; {second}", "    ")]


def _touches(touches: Sequence[StepContact], period: float) -> list[str]:
    """What was estimated in each step, compared with the true contact as far as that was recorded."""
    compared = [touch for touch in touches if touch.link_true != NOT_RECORDED]
    if not compared:
        return []
    first = ["", "link", "", "same", "position", "[cm]", "force", "[N]", ""]
    head = ["step", "true", "estimated", "link", "true", "est.", "true", "est.", "latency"]
    rows = [
        [
            *(touch.step, touch.link_true, touch.link_estimated, _number(100.0 * touch.right, 0)),
            _number(100.0 * touch.position_true, 1),
            "?" if touch.is_lower_bound else _number(100.0 * touch.position_estimated, 1),
            _number(touch.force_true, 2),
            bounded(_number(touch.force_estimated, 2), touch.is_lower_bound),
            "-" if touch.link_true == NO_LINK else _latency(touch.latency, period),
        ]
        for touch in compared
    ]
    same = "same link: per cent of the contact's time in which the estimated link was the true one"
    force = (
        "force: magnitude of all that acts on the link, a push (sim/disturbance) or the contact with the world; where "
        "several links are touched at once, on the one with the largest (sim/contact/wrench)"
    )
    latency = f"latency: from the start of the contact, known to {1e3 * period:.0f} ms, to its detection"
    none = (
        "- where it cannot be known: the contact began before the step or the recording, the estimate is missing, or "
        "that of the contact before goes on"
    )
    is_missed = any(touch.link_estimated == NO_LINK for touch in compared)
    return [
        *("", "Compared with the true contacts, each in each of its steps"),
        *_table(rows, first, head),
        *_wrapped(f"  {same}; {force}; {latency}, {none}", "    "),
        *[f"  estimated {NO_LINK}: no contact was, for most of the time"][:is_missed],
    ]


def _uncompared(summary: DemoSummary) -> list[str]:
    """How many true contacts the table lacks."""
    number = summary.uncompared
    contacts = "1 true contact is" if number == 1 else f"{number} true contacts are"
    return [f"{contacts} shorter than {1e-9 * TOUCH.bounce:g} s and not compared."] if number else []


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
        f"{loop.rate:.1f} Hz, latency p50 {_number(loop.p50, 0)} us, p99 {_number(loop.p99, 0)} us "
        f"(worst second {_number(loop.worst, 0)} us), missed {loop.missed} of {loop.periods} periods ({percent:.2g} %)"
    )


def _messages(summary: DemoSummary) -> str:
    if summary.received < 0:
        return "the recorder wrote no counts"
    gone = f", {summary.gone} of them no longer in the bag" if summary.gone else ""
    return f"{summary.received} recorded{gone}, {summary.dropped} dropped"


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _per_cent(press: SteadyPress, force: float) -> str:
    error = press.error(force)
    if press.is_refused:
        return "refused"
    if press.is_short:
        return "short"
    return "-" if math.isnan(error) else f"{error:+.1f} %"


def _latency(latency: float | None, period: float) -> str:
    if latency is None:
        return "-"
    if math.isnan(latency):
        return "missed"
    return "before" if latency < 0.0 else f"<{1e3 * (latency + period):.0f} ms"


def _table(rows: Sequence[Sequence[str]], *head: Sequence[str]) -> list[str]:
    lines = plain(head, rows, first=LAYOUT.step)
    rule = "─" * max(map(len, lines))
    return [f"  {line}" for line in (*lines[: len(head)], rule, *lines[len(head) :])]


def _wrapped(line: str, indent: str = " " * 9) -> list[str]:
    return textwrap.wrap(line, LAYOUT.width, subsequent_indent=indent, drop_whitespace=True) if line else []
