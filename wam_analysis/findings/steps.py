"""Section about the steps of a scenario: whether each did what was commanded, in answers and numbers."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum
from typing import NamedTuple

from wam_analysis.contact_comparison import NOT_RECORDED, StepContact
from wam_analysis.contact_list import NO_LINK
from wam_analysis.demo_summary import DemoSummary, SteadyPress
from wam_analysis.findings.finding import Finding, Section
from wam_analysis.thresholds import HOLD, TOUCH
from wam_analysis.unplanned_contact import LIMIT
from wam_sim.reactions import OUTCOMES, STEADY, steady_begin, too_short, unassessed, unmet

ALONG = f"along the commanded force, mean of the last {STEADY:g} s of the step, at most its second half"


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


def steps_section(summary: DemoSummary) -> Section | None:
    """Answers and numbers of each step; None without a scenario."""
    if not summary.steps:
        return None
    answers = tuple(f"{answer}." for answer in verdict(summary))
    return Section(
        "steps", "Steps of the scenario", (*answers, *step_sentences(summary)), tuple(step_findings(summary))
    )


def step_findings(summary: DemoSummary) -> Iterator[Finding]:
    """The forces of each step, and its contacts compared with the true ones."""
    for press in summary.presses:
        yield from _press_findings(press)
    compared = [touch for touch in summary.touches if touch.link_true != NOT_RECORDED]
    for touch in compared:
        is_only = sum(other.step == touch.step for other in compared) == 1
        link = "" if is_only else f" of {touch.link_true}"
        yield from _touch_findings(f"contact{link} in {touch.step}", touch, summary.period)


def _press_findings(press: SteadyPress) -> Iterator[Finding]:
    name, note = press.step, "refused" if press.is_refused else "short: no steady state" if press.is_short else ALONG
    yield Finding(f"{name}: commanded force", "N", press.commanded)
    for whose in ("true", "measured", "estimated"):
        force = getattr(press, whose)
        yield Finding(f"{name}: {whose} force", "N", force, note=note)
        if not press.is_refused:
            yield Finding(f"{name}: error of the {whose} one", "%", press.error(force))
    yield Finding(f"{name}: ripple of the true one", "N", press.ripple, note="half of its range")
    if press.is_refused or not press.true:  # nothing was measured, or nothing touched
        return
    found = press.positions
    for where, one in zip(("configured", "estimated", "true"), found.forces, strict=True):
        note = f"of the same torques as if at {100.0 * one.position:.1f} cm"
        yield Finding(f"{name}: force at the {where} position", "N", one.force, note=note)
    used = "of the force loop, whose measured force allows for its uncertainty"
    yield Finding(f"{name}: position that is used", "cm", 100.0 * found.used, math.nan, used, 100.0 * found.used_sd)


def _touch_findings(name: str, touch: StepContact, period: float) -> Iterator[Finding]:
    least = "the least one: the estimator cannot observe the position" * touch.is_lower_bound
    yield Finding(f"{name}: on the right link", "%", 100.0 * touch.right)
    yield Finding(f"{name}: true position", "cm", 100.0 * touch.position_true)
    yield Finding(f"{name}: estimated position", "cm", 100.0 * touch.position_estimated)
    yield Finding(f"{name}: contact force, true", "N", touch.force_true, note="size of all that acts on the link")
    size = touch.force_estimated
    yield Finding(f"{name}: contact force, estimated", "N", size, note=least, is_lower_bound=touch.is_lower_bound)
    if touch.latency is not None and touch.link_true != NO_LINK:
        note = f"to {1e3 * period:.0f} ms" if touch.latency >= 0.0 else "missed or detected before"
        yield Finding(f"{name}: latency", "ms", 1e3 * (touch.latency + period), note=f"to its detection, known {note}")


def step_sentences(summary: DemoSummary) -> Iterator[str]:
    """What the numbers of the steps leave out, and why; links that were another one for most of the time."""
    for what, names in (
        ("Refused", [press.step for press in summary.presses if press.is_refused]),
        (f"Less than {STEADY:g} s, no steady state", [press.step for press in summary.presses if press.is_short]),
    ):
        if names:
            yield f"{what}: {', '.join(names)}."
    for touch in summary.touches:
        links = (touch.link_true, touch.link_estimated)
        if links[0] != links[1] and NOT_RECORDED not in links:
            yield f"{touch.step}: {touch.link_true} was touched, {touch.link_estimated} estimated."


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
