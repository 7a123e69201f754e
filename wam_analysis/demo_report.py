"""The report of a demonstration: tables for a terminal, and a picture in the directory of the bag."""

import math
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wam_analysis.contact_list import NO_LINK, NOT_CERTAIN, ListedContact
from wam_analysis.demo_figure import save
from wam_analysis.demo_summary import (
    NOT_RECORDED,
    STEADY,
    DemoSummary,
    LoopReport,
    SteadyPress,
    StepContact,
    summary_of,
)
from wam_analysis.demo_traces import TOPICS_READ
from wam_analysis.reactions import sentences, within
from wam_analysis.recorded import recorded_arm
from wam_analysis.table import plain
from wam_bag.bag import BagError, read
from wam_description.status import DONE
from wam_sim.recording import recorded_run

FORCE_TOLERANCE = 10.0  # % of the commanded force
POSITION_TOLERANCE = 0.04  # m
NO = ": NO ("  # begins what an answer of the verdict has against it
WIDTH, STEP = 100, 24  # columns of the report, and of the name of a step


class DemoReport(NamedTuple):
    """The report as text, at most 100 columns wide, and those answers of the verdict that are no."""

    text: str
    unmet: tuple[str, ...]


def report(bag: Path, picture: Path | None = None) -> DemoReport:
    """Evaluate a recorded demonstration, and draw it.

    Parameters
    ----------
    bag : directory of the bag, or its .mcap file.
    picture : PNG file to write, None for no picture.

    Raises
    ------
    BagError
        if the bag cannot be read or holds no demonstration; then nothing is written.
    """
    bag = Path(bag)
    run = recorded_run(read(bag, TOPICS_READ, may_lack=True))
    summary = summary_of(run)
    if not summary.steps:
        raise BagError(
            f"{bag} is not a recording of the demonstration: it has no step of a scenario; its topics: "
            f"{', '.join(run.bag.counts) or 'none'}. 'wam analyse {bag}' analyses any recording"
        )
    notes: tuple[str, ...] = ()
    if picture is not None:
        try:
            notes = save(picture, summary, recorded_arm(run.parameters))
        except OSError as error:
            notes = (f"the picture was not written: {error}",)
    files = [f"bag      {bag}", *([f"picture  {picture}"] if picture is not None and picture.is_file() else [])]
    unmet = tuple(answer for answer in verdict(summary) if NO in answer)
    return DemoReport("\n".join([text(summary, notes), "", *files]), unmet)


def reaction_report(bag: Path) -> str:
    """What was not simply obeyed in a recording, by step; '' if nothing."""
    return "\n".join(_reactions(summary_of(recorded_run(read(bag, TOPICS_READ, may_lack=True)))))


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
        *_contacts(summary.contacts),
        *_touches(summary.touches, summary.period),
    ]
    lines += _wrapped(_false_contacts(summary))
    lines += ["", *_wrapped(f"Loop     {_loop(summary.loop)}"), f"Messages {_messages(summary)}"]
    lines += [line for note in (*summary.notes, *notes) for line in _wrapped(f"Note     {note}")]
    return "\n".join(lines)


def verdict(summary: DemoSummary) -> tuple[str, str, str]:
    """Whether force, link and position were right, each with its worst value."""
    return _force_verdict(summary.presses), _link_verdict(summary), _position_verdict(summary)


def _force_verdict(presses: Sequence[SteadyPress]) -> str:
    question = f"force within {FORCE_TOLERANCE:g} %"
    # not the mean alone: a force that swings or is lost is not the commanded one
    done = [press for press in presses if not press.is_refused]
    ripples = [100.0 * press.ripple / abs(press.commanded) for press in done]
    errors = [abs(press.error(press.true)) + ripple for press, ripple in zip(done, ripples, strict=True)]
    if len(done) < len(presses):
        return f"{question}{NO}{len(presses) - len(done)} of {len(presses)} refused)"

    def of(worst: float) -> str:
        ripple = f"{ripples[errors.index(worst)]:.1f}"
        return f"{worst:.1f} %" + (f", {ripple} % of it ripple" if float(ripple) else "")

    return _answer(question, errors, lambda error: error <= FORCE_TOLERANCE, of)


def _link_verdict(summary: DemoSummary) -> str:
    def wrong(touch: StepContact) -> float:
        if NOT_RECORDED in (touch.link_true, touch.link_estimated):
            return math.nan
        return float(touch.link_true != touch.link_estimated)

    least = min((touch.right for touch in summary.touches if not math.isnan(touch.right)), default=0.0)
    return _answer(
        "right link",
        [wrong(touch) for touch in summary.touches],
        lambda value: not value,
        lambda wrong: "another link" if wrong else f"{100.0 * least:.0f} %",
    )


def _position_verdict(summary: DemoSummary) -> str:
    """Positions are compared unless the estimator reports that it cannot observe them, which are counted."""
    touches = [touch for touch in summary.touches if touch.link_true != NO_LINK]
    errors = [abs(touch.position_estimated - touch.position_true) for touch in touches if not touch.reason]
    question = f"position within {100.0 * POSITION_TOLERANCE:g} cm"
    unknown = len(touches) - len(errors)
    answer = _answer(question, errors, lambda error: error <= POSITION_TOLERANCE, lambda far: f"{100.0 * far:.1f} cm")
    return answer + f", unknown for {unknown} of {len(touches)} contacts" * bool(unknown)


def _answer(
    question: str, values: Sequence[float], good: Callable[[float], bool], worst: Callable[[float], str]
) -> str:
    known = [value for value in values if not math.isnan(value)]
    if known and not all(good(value) for value in known):
        return f"{question}{NO}{worst(max(known))})"
    if not known or len(known) < len(values):
        return f"{question}: NOT SHOWN"
    return f"{question}: YES ({worst(max(known))})"


def _played(summary: DemoSummary) -> str:
    if not summary.steps:
        return summary.outcome
    seconds = (summary.steps[-1].end - summary.steps[0].begin) / 1e9
    ended = DONE if summary.outcome == DONE else f"FAILED: {summary.outcome}"
    return f"{len(summary.steps)} steps, {seconds:.1f} s, {summary.loop.mode}, {ended}"


def _presses(presses: Sequence[SteadyPress]) -> list[str]:
    title = f"Force along the commanded one, mean of the last {STEADY:g} s of each step [N]"
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
    title = "The force that the same torques are at three contact positions"
    error = "  error: to the true force; at the true position, the error of the torques alone"
    places = _wrapped(f"  used by the force loop, +- its standard deviation [cm]: {', '.join(used)}", "    ")
    other = "  measured above: by all positions that this leaves open, so by none of these three"
    return ["", title, *_table(rows, first, head), error, *places, other]


def _reactions(summary: DemoSummary) -> list[str]:
    """Commands that were not simply obeyed, by step."""
    stated = [
        line
        for step in summary.steps
        for line in sentences(step.name, within(summary.reactions, step.begin, step.end), summary.traces.zero)
    ]
    lines = ["Commands that were refused, and what was reported of others"] if stated else []
    return ["", *lines, *(line for one in stated for line in _wrapped(f"  {one}", "    "))] if stated else []


def _contacts(contacts: Sequence[ListedContact]) -> list[str]:
    """All that was estimated, from the estimate alone."""
    title = "Estimated contacts, medians over each"
    if not contacts:
        return [title, "  none"]
    first = ["", "time", "[s]", "link", "", "position", "[cm]", "force", "[N]", "second"]
    head = ["step", "from", "to", "", "[%]", "", "+-", "", "+-", "[%]"]
    rows = [
        [
            *(one.step, _number(one.begin, 2), _number(one.end, 2), one.link, _number(100.0 * one.probability, 0)),
            "?*" if math.isnan(one.position) and one.reasons else _number(100.0 * one.position, 1),
            _number(100.0 * one.position_sd, 1),
            ">=" * one.is_lower_bound + _number(one.force, 2),
            *(_number(one.force_sd, 2), _number(100.0 * one.second, 0)),
        ]
        for one in contacts
    ]
    lines = [title, *_table(rows, first, head)]
    unknown = (reason for one in contacts if math.isnan(one.position) for reason in one.reasons)
    for reason in dict.fromkeys(unknown):
        lines += _wrapped(f"  * {reason}", "    ")
    if any(math.isnan(one.probability) for one in contacts):
        lines += _wrapped(f"  {NOT_CERTAIN}", "    ")
    link = "link [%]: its probability; +-: standard deviation"
    second = "second: of the time in which a second contact was suspected"
    return [*lines, *_wrapped(f"  {link}; {second}", "    ")]


def _touches(touches: Sequence[StepContact], period: float) -> list[str]:
    """What was estimated in each step, compared with the true contact as far as that was recorded."""
    compared = [touch for touch in touches if touch.link_true != NOT_RECORDED]
    if not compared:
        return []
    first = ["", "link", "", "right", "position", "[cm]", "force", "[N]", ""]
    head = ["step", "true", "estimated", "[%]", "true", "est.", "true", "est.", "latency"]
    rows = [
        [
            *(touch.step, touch.link_true, touch.link_estimated, _number(100.0 * touch.right, 0)),
            _number(100.0 * touch.position_true, 1),
            "?" if touch.reason else _number(100.0 * touch.position_estimated, 1),
            _number(touch.force_true, 2),
            f">={_number(touch.force_estimated, 2)}" if touch.reason else _number(touch.force_estimated, 2),
            "-" if touch.link_true == NO_LINK else _latency(touch.latency, period),
        ]
        for touch in compared
    ]
    right = "right: fraction of the contact's time in which the estimated link was the true one"
    latency = f"latency: of the detection where the contact began; the true one is recorded every {1e3 * period:.0f} ms"
    force = "force: magnitude of all that acts on the link, a push (sim/disturbance) or the contact with the world"
    return [
        *("", "The same compared with the true contact, by step that pushes or presses"),
        *_table(rows, first, head),
        *_wrapped(f"  {right}; {force}; {latency}", "    "),
    ]


def _false_contacts(summary: DemoSummary) -> str:
    if not summary.free:
        is_known = np.any(summary.traces.true.is_known)
        why = "the arm was in contact all the time" if is_known else "the true contact was not recorded"
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
    return "-" if math.isnan(error) else f"{error:+.1f} %"


def _latency(latency: float | None, period: float) -> str:
    if latency is None:
        return "goes on"
    if math.isnan(latency):
        return "missed"
    return "before" if latency < 0.0 else f"<{1e3 * (latency + period):.0f} ms"


def _table(rows: Sequence[Sequence[str]], *head: Sequence[str]) -> list[str]:
    lines = plain(head, rows, first=STEP)
    rule = "─" * max(map(len, lines))
    return [f"  {line}" for line in (*lines[: len(head)], rule, *lines[len(head) :])]


def _wrapped(line: str, indent: str = " " * 9) -> list[str]:
    return textwrap.wrap(line, WIDTH, subsequent_indent=indent, drop_whitespace=True) if line else []
