"""The report of a demonstration: tables for a terminal and a picture beside the bag."""

import math
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path

from wam_analysis.bag import BagError, read
from wam_analysis.demo_figure import save
from wam_analysis.demo_summary import (
    NO_LINK,
    NOT_RECORDED,
    STEADY,
    DemoSummary,
    Loop,
    Press,
    Touch,
    summarize,
)
from wam_analysis.demo_traces import TOPICS_READ

FORCE_TOLERANCE = 10.0  # % of the force asked for
PLACE_TOLERANCE = 0.04  # m
WIDTH = 100


def report(bag: Path) -> str:
    """Judge a recorded demonstration and draw it.

    Parameters
    ----------
    bag : directory of the bag, or its .mcap file; the picture ``demo.png`` is written beside the data.

    Returns
    -------
    str
        tables and verdict, at most 100 columns wide.

    Raises
    ------
    BagError
        where the bag cannot be read, or has no demonstration in it; then nothing is written.
    """
    bag = Path(bag)
    recording = read(bag, TOPICS_READ, may_lack=True)
    summary = summarize(recording)
    if not summary.steps:
        raise BagError(
            f"{bag} is no recording of a demonstration: no step of a scenario is in it; its topics: "
            f"{', '.join(recording.counts) or 'none'}. 'wam analyse {bag}' says what any recording shows"
        )
    picture = (bag if bag.is_dir() else bag.parent) / "demo.png"
    try:
        notes = save(picture, summary, recording)
    except OSError as error:
        notes = (f"the picture was not written: {error}",)
    files = [f"bag      {bag}", *([f"picture  {picture}"] if picture.is_file() else [])]
    return "\n".join([text(summary, notes), "", *files])


def text(summary: DemoSummary, notes: Sequence[str] = ()) -> str:
    """The report without the names of files.

    Parameters
    ----------
    summary : of the bag.
    notes : what else has to be said.
    """
    lines = [line for lost in summary.lost for line in _wrapped(f"INCOMPLETE: {lost}")]
    lines += _wrapped(f"Demonstration of {summary.namespace or '/'}: {_played(summary)}")
    lines += ["", *_presses(summary.presses), "", *_touches(summary.touches, summary.period)]
    lines += _wrapped(_false_contacts(summary))
    lines += ["", *_wrapped(f"Loop     {_loop(summary.loop)}"), f"Messages {_messages(summary)}"]
    lines += [line for note in (*summary.notes, *notes) for line in _wrapped(f"Note     {note}")]
    worst = "Verdict, the worst in brackets" + (", of what is left of the recording" if summary.lost else "")
    return "\n".join([*lines, "", worst, f"  {verdict(summary)}"])


def verdict(summary: DemoSummary) -> str:
    """Whether force, link and place were right, each with the worst number."""
    return " | ".join([_force_verdict(summary.presses), _link_verdict(summary), _place_verdict(summary)])


def _force_verdict(presses: Sequence[Press]) -> str:
    question = f"force within {FORCE_TOLERANCE:g} %"
    errors = [abs(press.error(press.applied)) for press in presses]
    return _answer(question, errors, lambda error: error <= FORCE_TOLERANCE, lambda worst: f"{worst:.1f} %")


def _link_verdict(summary: DemoSummary) -> str:
    def wrong(touch: Touch) -> float:
        if NOT_RECORDED in (touch.link_true, touch.link_felt):
            return math.nan
        return float(touch.link_true == NO_LINK or touch.link_true != touch.link_felt)

    least = min((touch.right for touch in summary.touches if not math.isnan(touch.right)), default=0.0)
    return _answer(
        "right link",
        [wrong(touch) for touch in summary.touches],
        lambda value: not value,
        lambda wrong: "another link" if wrong else f"{100.0 * least:.0f} %",
    )


def _place_verdict(summary: DemoSummary) -> str:
    """Places that the estimator says it cannot observe are not judged; all others are."""
    errors = [abs(touch.place_felt - touch.place_true) for touch in summary.touches if not touch.reason]
    question = f"place within {100.0 * PLACE_TOLERANCE:g} cm"
    return _answer(question, errors, lambda error: error <= PLACE_TOLERANCE, lambda worst: f"{100.0 * worst:.1f} cm")


def _answer(
    question: str, values: Sequence[float], good: Callable[[float], bool], worst: Callable[[float], str]
) -> str:
    known = [value for value in values if not math.isnan(value)]
    if known and not all(good(value) for value in known):
        return f"{question}: NO ({worst(max(known))})"
    if not known or len(known) < len(values):
        return f"{question}: NOT SHOWN"
    return f"{question}: YES ({worst(max(known))})"


def _played(summary: DemoSummary) -> str:
    if not summary.steps:
        return summary.outcome
    seconds = (summary.steps[-1].end - summary.steps[0].begin) / 1e9
    ended = "done" if summary.outcome == "done" else f"FAILED: {summary.outcome}"
    return f"{len(summary.steps)} steps, {seconds:.1f} s, {summary.loop.mode}, {ended}"


def _presses(presses: Sequence[Press]) -> list[str]:
    title = f"Force along the one asked for, mean of the last {STEADY:g} s of each step [N]"
    if not presses:
        return [title, "  no step that presses was recorded"]
    head = ["step", "asked", "applied", "+-", "error", "measured", "error", "estimated", "error"]
    rows = [
        [
            press.step,
            *(_number(force, 2) for force in (press.asked, press.applied, press.spread)),
            _per_cent(press, press.applied),
            *(_number(press.measured, 2), _per_cent(press, press.measured)),
            *(_number(press.felt, 2), _per_cent(press, press.felt)),
        ]
        for press in presses
    ]
    return [
        title,
        *_table(head, rows, [25, 6, 8, 6, 8, 9, 8, 10, 8]),
        "  applied: by the simulator, +- half its range; measured: by the force loop",
    ]


def _touches(touches: Sequence[Touch], period: float) -> list[str]:
    title = "Contacts, medians while they lasted"
    if not touches:
        return [title, "  no step with a push or a press was recorded"]
    first = ["", "link", "", "right", "place", "[cm]", "force", "[N]", "felt"]
    head = ["step", "true", "felt", "[%]", "true", "felt", "true", "felt", "after"]
    rows = [
        [
            *(touch.step, touch.link_true, touch.link_felt, _number(100.0 * touch.right, 0)),
            _number(100.0 * touch.place_true, 1),
            "?*" if touch.reason else _number(100.0 * touch.place_felt, 1),
            *(_number(touch.force_true, 2), _number(touch.force_felt, 2), _delay(touch.delay, period)),
        ]
        for touch in touches
    ]
    lines = [title, *_table(head, rows, [25, 12, 12, 6, 6, 7, 7, 7, 8], first)]
    for reason in dict.fromkeys(touch.reason for touch in touches if touch.reason):
        lines += _wrapped(f"  * {reason}", "    ")
    right = "right: part of the contact's time in which the right link was felt"
    after = f"after: the truth has a value every {1e3 * period:.0f} ms"
    return [*lines, *_wrapped(f"  {right}; {after}", "    ")]


def _false_contacts(summary: DemoSummary) -> str:
    if not summary.free:
        return "  felt without a contact: not recorded"
    longest = f", longest {1e3 * summary.longest_false_contact:.0f} ms" if summary.false_contact else ""
    return (
        f"  felt without a contact: {1e3 * summary.false_contact:.0f} ms{longest}, in {summary.free:.1f} s without one"
    )


def _loop(loop: Loop) -> str:
    if loop.mode == "lockstep":
        return "lockstep: the arm waits for every answer, there is no timing"
    if math.isnan(loop.rate):
        return "no timing was recorded (driver in /diagnostics)"
    share = 100.0 * loop.missed / max(loop.periods, 1)
    return (
        f"{loop.rate:.1f} Hz, latency p50 {_number(loop.p50, 0)} us, p99 {_number(loop.p99, 0)} us "
        f"(worst second {_number(loop.worst, 0)} us), missed {loop.missed} of {loop.periods} periods ({share:.2g} %)"
    )


def _messages(summary: DemoSummary) -> str:
    if summary.received < 0:
        return "the recorder did not say how many it received"
    gone = f", {summary.gone} of them no longer in the bag" if summary.gone else ""
    return f"{summary.received} recorded{gone}, {summary.dropped} dropped"


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _per_cent(press: Press, force: float) -> str:
    error = press.error(force)
    return "-" if math.isnan(error) else f"{error:+.1f} %"


def _delay(delay: float | None, period: float) -> str:
    if delay is None:
        return "held"
    if math.isnan(delay):
        return "never"
    return "before" if delay < 0.0 else f"<{1e3 * (delay + period):.0f} ms"


def _table(
    head: Sequence[str], rows: Sequence[Sequence[str]], widths: Sequence[int], first: Sequence[str] = ()
) -> list[str]:
    """Lines of a table; the first column is text and is wrapped, the others are right-aligned."""
    lines = [_row(cells, widths) for cells in (first, head) if cells]
    lines.append("  " + "─" * sum(widths))
    for cells in rows:
        wrapped = textwrap.wrap(cells[0], widths[0] - 1) or [""]
        lines.append(_row([wrapped[0], *cells[1:]], widths))
        lines += [f"    {more}" for more in wrapped[1:]]
    return lines


def _row(cells: Sequence[str], widths: Sequence[int]) -> str:
    start = f"  {cells[0]:<{widths[0]}}"
    return start + "".join(f"{cell:>{width}}" for cell, width in zip(cells[1:], widths[1:], strict=True))


def _wrapped(line: str, indent: str = " " * 9) -> list[str]:
    return textwrap.wrap(line, WIDTH, subsequent_indent=indent, drop_whitespace=True) if line else []
