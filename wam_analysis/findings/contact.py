"""Section about the estimated contacts, compared with the true ones."""

import math
from collections.abc import Iterator

import numpy as np

from wam_analysis.contact_list import NOT_CERTAIN, NOT_ESTIMATED, NOT_PLACED, ListedContact, median
from wam_analysis.findings.finding import Finding, Section, shown, stated
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import SHAFT, TOUCH
from wam_control.force.force_loop_parameters import ForceLoopParameters

BLIND = "Contacts while the brakes hold are not compared: without joint sensors they are not detected."


def contact_section(recording: AnalysedRecording) -> Section:
    """Estimated contacts, compared with the true ones."""
    traces = recording.traces
    findings: list[Finding] = []
    wrong = [*(one.sentence for one in recording.missed), *recording.unplanned.sentences]
    shows: list[str] = []
    named = [f"{number} ({one.step})" for number, one in enumerate(recording.contacts, 1) if one.step]
    sentences = [f"Contacts and their steps: {', '.join(named)}."] * bool(named)
    for number, contact in enumerate(recording.contacts, 1):
        name = f"{number} {contact.link}{' false' * contact.is_false}"
        declared = declared_position(recording, contact)
        findings += _numbers(name, contact, traces.period, declared)
        sentences += _doubts(name, contact)
        wrong += _contradicted(name, contact, declared, recording.parameters.force_loop)
    if any(math.isnan(contact.probability) for contact in recording.contacts):
        sentences.append(NOT_CERTAIN)
    if not all(contact.is_placed for contact in recording.contacts):
        sentences.append(f"Positions of contacts: {NOT_PLACED}.")
    sentences += [BLIND] * bool(np.any(recording.blind & traces.true.acts))
    sentences += wrong
    traces = recording.seen
    true, sensed, known = traces.true, traces.estimated, traces.is_compared
    touching = known & true.acts
    if np.any(touching):
        both = touching & sensed.acts & (sensed.frame == true.frame)
        is_estimate = both & sensed.is_placed & ~sensed.is_lower_bound
        right = 100.0 * float(np.mean(both[touching]))
        away = 100.0 * median(np.abs(sensed.position - true.position)[is_estimate])
        off = median(np.linalg.norm(sensed.force - true.force, axis=1)[is_estimate])
        findings += [
            Finding("correct link, of true contact time", "%", right),
            Finding("position error, median", "cm", away, note="along the link"),
            Finding("force error where the position is known, median", "N", off, note="norm of the vector"),
        ]
        medians = {"position": shown(away, "cm"), "force vector": shown(off, "N")}
        errors = ", ".join(f"{what} {error}" for what, error in medians.items() if error != "-")
        errors = f"; median error where the position is known: {errors}" * bool(errors)
        shows.append(f"Contacts: correct link for {right:.3g} % of true contact time{errors}.")
    if np.any(known):
        note = "false contacts, and the ends of others"
        findings.append(Finding("contact estimated where none is", "s", traces.false_seconds, note=note))
        if count := sum(one.is_false for one in recording.contacts):
            share = f"False contacts: {count} of {len(recording.contacts)}."
            (wrong if traces.false_percent > TOUCH.false_tolerance else shows).append(share)
    elif recording.contacts:
        sentences.insert(0, "Estimated contacts; the true ones are not in this bag.")
        shows.append(f"Contacts: {len(recording.contacts)} estimated; the true ones are not in this bag.")
    if not sentences and not findings:
        is_recorded = np.any(sensed.is_known)
        sentences.append("No contact was estimated." if is_recorded else stated(NOT_ESTIMATED))
    return Section("contact", "Contact", sentences, findings, shows, wrong)


def declared_position(recording: AnalysedRecording, contact: ListedContact) -> float:
    """Where the command or the parameters pin the force of a contact, m along its link; NaN where they do not."""
    link, zero, loop = contact.link, recording.traces.zero, recording.parameters.force_loop
    for hold in recording.holds:
        middle = (0.5 * (hold.begin + hold.end) - zero) / 1e9
        if contact.begin <= middle < contact.end and link == (hold.cover or hold.frame):
            is_pinned = loop is not None and loop.contact_source == "pinned" and loop.contact_cover == link
            return loop.contact_position if loop and is_pinned and math.isnan(hold.position) else hold.position
    return math.nan


def _contradicted(
    name: str, contact: ListedContact, declared: float, loop: ForceLoopParameters | None
) -> Iterator[str]:
    """That the true position, else the estimated one, is further from the declared one than their sd explain."""
    cm, place, sd, how = 100.0, contact.position, contact.position_sd, "estimated"
    if contact.true == contact.link and math.isfinite(contact.true_position):
        place, sd, how = contact.true_position, 0.0, "true"
    stated, found = (f"{cm * each:.3g}" for each in (declared, place))
    is_beyond = abs(place - declared) > SHAFT.sigmas * math.hypot(sd, loop.contact_position_sd if loop else 0.0)
    if is_beyond and found != stated:
        yield f"{name}: declared position {stated} cm, {how} position {found}{f' +- {cm * sd:.2g}' if sd else ''} cm."


def _numbers(name: str, contact: ListedContact, period: float, declared: float) -> Iterator[Finding]:
    """A contact in numbers, those that are compared with the true ones last."""
    cm = 100.0
    yield Finding(f"{name}: from", "s", contact.begin)
    yield Finding(f"{name}: to", "s", contact.end)
    yield Finding(f"{name}: probability of the link", "%", 100.0 * contact.probability)
    yield Finding(f"{name}: position along the link", "cm", cm * contact.position, error=cm * contact.position_sd)
    yield Finding(f"{name}: declared position", "cm", cm * declared)
    least = "lower bound: the least force that explains the torques" * contact.is_lower_bound
    yield Finding(f"{name}: force", "N", contact.force, math.nan, least, contact.force_sd, contact.is_lower_bound)
    yield Finding(f"{name}: error of the median position", "cm", cm * contact.position_error)
    unknown = "not known: the force may be a lower bound" * (not contact.is_placed)
    yield Finding(f"{name}: error of the median force", "N", contact.force_error, note=least or unknown)
    is_early = contact.latency <= 0.0
    note = f"time until its detection, to within {1e3 * period:.0f} ms" if not is_early else "reported before it began"
    yield Finding(f"{name}: latency", "ms", math.nan if is_early else 1e3 * contact.latency, note=note)


def _doubts(name: str, contact: ListedContact) -> Iterator[str]:
    """What is not to be trusted of a contact, and whether it was another one."""
    if cut := " and ".join(filter(None, contact.cut)):
        yield f"{name}: {cut}."
    if contact.lasting < TOUCH.steady_link:
        yield f"{name}: this link for {contact.lasting:.0%} of the estimated contact, others for the rest."
    yield from (f"{name}: {reason}." for reason in contact.reasons)
    if contact.true not in ("", contact.link) and not contact.is_false:
        yield f"{name}: {contact.true} was touched."
