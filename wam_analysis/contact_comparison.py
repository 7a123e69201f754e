"""The true contacts of a recording one by one, each with what was estimated of it."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.contact_list import (
    NO_LINK,
    Certainty,
    CutBy,
    contacts_by_link,
    cut_at,
    cut_ends,
    estimate,
    median,
    most,
)
from wam_analysis.demo_traces import NAN, Mask, Times, Traces
from wam_analysis.thresholds import TOUCH
from wam_sim.recording import RecordedStep

NOT_RECORDED = "not recorded"


class StepContact(NamedTuple):
    """A true contact, or its part in one step, and its estimate: links, medians of position (m) and force (N).

    Attributes
    ----------
    begin, end : ns.
    link_true : 'none' where something was estimated and nothing touched.
    link_estimated : 'none' also where a contact was estimated for less than `lasting` of the time.
    right : fraction of the time in which the estimated link was the true one; NaN where it is not known.
    position_estimated : NaN also where another link was estimated.
    is_lower_bound : whether the estimated force is the least one, because the estimator cannot observe the position.
    latency : s from the start of the true contact to its detection, below zero if a contact was reported before; NaN
        if it was missed, None where it cannot be known.
    """

    step: str
    begin: int
    end: int
    link_true: str
    link_estimated: str
    right: float
    position_true: float
    position_estimated: float
    force_true: float
    force_estimated: float
    is_lower_bound: bool
    latency: float | None


def compared_contacts(
    traces: Traces, certainty: Certainty, steps: Sequence[RecordedStep], refused: Collection[str]
) -> tuple[StepContact, ...]:
    """All true contacts, cut as the estimated ones are, and of each step that pushes or presses what was estimated.

    Parameters
    ----------
    refused : names of the steps whose force was not controlled: they may touch nothing.
    """
    acting = [step for step in steps if np.any(traces.during(step.begin, step.end) & _acts(traces))]
    moving = [step for step in steps if step not in acting]
    found: list[StepContact] = []
    compared: list[RecordedStep | None] = []
    links = contacts_by_link(traces.stamp, traces.true)
    for number, (first, last) in enumerate(links):
        latency = _latency(traces, links, number)
        for begin, end in cut_at(traces.stamp, [(first, last)], _bounds(traces.stamp, first, steps, moving)):
            if traces.stamp[end - 1] - traces.stamp[begin] >= TOUCH.bounce:
                own = _step(traces.stamp[begin:end], steps, moving)
                name = own.name if own else ""
                rows = np.arange(begin, end)
                found.append(_compared(traces, certainty, name, rows, latency if begin == first else None))
                compared.append(own)
    for step in acting:
        if step in compared:
            continue
        rows = np.flatnonzero(traces.during(step.begin, step.end))
        true = traces.true
        is_known = step.name in refused or bool(np.any(true.is_known[rows]))
        if is_known and not np.any(true.acts[rows] | traces.estimated.acts[rows]):
            continue  # nothing was touched
        begun = [_latency(traces, links, i) for i, (begin, _) in enumerate(links) if rows[0] <= begin <= rows[-1]]
        found.append(_compared(traces, certainty, step.name, rows, next(iter(begun), None)))
    return tuple(sorted(found, key=lambda one: one.begin))


def uncompared_contacts(traces: Traces, touches: Sequence[StepContact]) -> int:
    """The number of true contacts that are in none of those that are compared: they are shorter than `bounce`."""
    times = [traces.stamp[[begin, end - 1]] for begin, end in contacts_by_link(traces.stamp, traces.true)]
    return sum(not any(one.begin <= end and begin <= one.end for one in touches) for begin, end in times)


def _acts(traces: Traces) -> Mask:
    """Whether the arm is commanded to press or is pushed, (k,)."""
    return traces.push.acts | traces.commanded.acts


def _bounds(stamp: Times, first: int, steps: Sequence[RecordedStep], moving: Sequence[RecordedStep]) -> list[int]:
    """Stamps at which a contact that begins in a row is cut: where a step begins, unless it was touched just before.

    A step that lowers the arm until it touches ends with a contact that is that of the step which presses then.
    """
    pressing = _pressed(int(stamp[first]), steps, moving)
    return [step.begin for step in steps if step.begin > stamp[first] and step != pressing]


def _pressed(begin: int, steps: Sequence[RecordedStep], moving: Sequence[RecordedStep]) -> RecordedStep | None:
    """The step to which a contact belongs that begins shortly before it, in a step that only moves."""
    later = next((step for step in steps if step.begin > begin), None)
    is_moving = any(step.begin <= begin < step.end for step in moving)
    return later if later and is_moving and later not in moving and later.begin - begin < TOUCH.touch else None


def _step(stamp: Times, steps: Sequence[RecordedStep], moving: Sequence[RecordedStep]) -> RecordedStep | None:
    """The step to which a part of a contact at some stamps belongs: that of its middle, or that which presses then."""
    begin, end = int(stamp[0]), int(stamp[-1])
    pressing = _pressed(begin, steps, moving)
    if pressing and pressing.begin <= end:
        begin = pressing.begin
    return next((step for step in steps if step.begin <= (begin + end) // 2 < step.end), None)


def _compared(
    traces: Traces, certainty: Certainty, step: str, rows: NDArray[np.intp], latency: float | None
) -> StepContact:
    """The true contact in some rows and its estimate."""
    true, estimated = traces.true, traces.estimated
    stamps = int(traces.stamp[rows[0]]), int(traces.stamp[rows[-1]])
    is_recorded = bool(np.any(true.is_known[rows]))
    link = most(true.frame[rows[true.acts[rows]]]) if is_recorded else NOT_RECORDED
    touching = rows[true.acts[rows]] if is_recorded and link != NO_LINK else rows[estimated.acts[rows]]
    own = touching[true.frame[touching] == link]
    watched = touching if len(touching) else rows
    known = touching[estimated.is_known[touching]]
    is_lasting = link == NOT_RECORDED or float(np.mean(estimated.acts[known])) >= TOUCH.lasting if len(known) else False
    found = estimate(traces, certainty, touching[estimated.acts[touching] & is_lasting])
    is_seen = found.link != NO_LINK or float(np.mean(estimated.is_known[watched])) >= TOUCH.lasting
    is_same = estimated.acts[known] & (estimated.frame[known] == true.frame[known])
    return StepContact(
        step,
        *stamps,
        link,
        found.link if is_seen else NOT_RECORDED,
        float(np.mean(is_same)) if len(known) and link not in (NO_LINK, NOT_RECORDED) else NAN,
        median(true.position[own]),
        found.position if link in (found.link, NOT_RECORDED) else NAN,
        median(true.size[own]),
        found.force,
        found.is_lower_bound,
        latency,
    )


def _latency(traces: Traces, contacts: Sequence[tuple[int, int]], number: int) -> float | None:
    """Of the detection of a true contact, s; NaN if it was missed, None where it cannot be known.

    It cannot where the contact was there before its recording began, while the estimate is missing, and where that of
    the contact before goes on.
    """
    (begin, end), estimated = contacts[number], traces.estimated
    before, _ = cut_ends(traces.true, begin, end)
    if before is not CutBy.NOTHING or not estimated.is_known[begin]:
        return None
    if estimated.acts[begin]:
        free = np.flatnonzero(~estimated.acts[:begin])
        first = int(free[-1]) + 1 if len(free) else 0
        if number and first < contacts[number - 1][1]:
            return None
    else:
        detected = begin + np.flatnonzero(estimated.acts[begin:end])
        first = int(detected[0]) if len(detected) else end
        if not np.all(estimated.is_known[begin:first]):
            return None
        if first == end:
            return NAN
    return float(traces.stamp[first] - traces.stamp[begin]) / 1e9
