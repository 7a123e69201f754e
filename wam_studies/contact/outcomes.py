"""What the estimator reports of true contacts, between them, and of torques: the same for every way to play an arm."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.contact_estimator import ContactEstimate
from wam_description.arm import Arm
from wam_description.rigid_body import Array

Mask = NDArray[np.bool_]
PAYLOAD = "payload"  # how hypotheses, reasons and warnings name a mass at the tool


@dataclass(frozen=True)
class EvaluationLimits:
    """Which true contacts count, when an estimate is evaluated, and what counts as motion."""

    least_force: float = 0.3  # N, of a true contact
    gap: int = 1  # moments without force within one contact
    greatest_force: float = 25.0  # N; contacts with a greater force are excluded
    settled: float = 0.2  # s from the start of a contact until the estimate is evaluated
    settled_at_rest: float = 0.4  # s, the same at rest, where the estimate averages over the dither
    shortest: float = 0.12  # s; shorter contacts are excluded
    edge: float = 0.1  # s after the start or end of a contact in which the observer lags
    moving: float = 0.1  # rad/s of the fastest joint
    sure: float = 0.95  # probability of a link
    outside: float = 0.1  # largest probability of what a 90 % set may lack

    # of a row
    near: float = 0.2  # of a force: 5 N are 4 to 6 N
    small_sd: float = 0.02  # m
    rough_force: tuple[float, float] = (12.0, 28.0)  # N, of contacts with the greatest friction
    quiet: tuple[float, float] = (120.0, 600.0)  # s that show no false alarm, required and target
    inner_within: float = 0.2  # s, in which a contact on the inner link is detected
    forces: tuple[float, ...] = (0.0, 7.5, 15.0, 30.0, 80.0)  # N, between the rows by force
    masses: tuple[float, ...] = (0.1, 0.2, 0.5, 1.0)  # kg, between the rows by mass

    # of a recording
    late: float = 0.45  # s after the start of a contact, until which it is detected
    setting_down: float = 0.5  # s after a mass is set down, in which the model is still that with it
    observer: float = 1.0  # s at the start, whose torques are the observer's own transient


EVALUATION = EvaluationLimits()


class EstimatedMoment(NamedTuple):
    """The estimate of one outer period.

    Attributes
    ----------
    time : s.
    estimate : of the estimator.
    is_moving : whether a joint truly moves.
    """

    time: float
    estimate: ContactEstimate
    is_moving: bool


class TrueContact(NamedTuple):
    """A contact as it truly was.

    Attributes
    ----------
    kind, cover : of the scenario or the drawn contact.
    position, force : at the evaluation; m, N.
    friction : coefficient.
    begin, end : s, in which it acts.
    first, due, last : numbers of the moments of its start, of the evaluation, and until which it may be detected.
    since : s, from which on the latency counts.
    mass : kg, of a mass at the tool.
    counts : whether it is neither too short nor too hard.
    """

    kind: str
    cover: str
    position: float
    force: float
    friction: float
    begin: float
    end: float
    first: int
    due: int
    last: int
    since: float
    mass: float = 0.0
    counts: bool = True


class ContactOutcome(NamedTuple):
    """One contact: the truth, and the estimate a fixed time after its start.

    Attributes
    ----------
    kind, cover, position, force, friction : true.
    moving : whether the arm moved at the start and at the evaluation.
    latency : s to the detection; inf without one, NaN if there was one before the contact.
    detected, probability, right_link, link : of the most probable link, '' and NaN without any.
    error, position_sd : m; inf on the wrong link or without a position; NaN sd without a position.
    in_set : whether the 90 % set contains the truth.
    sure_and_wrong : s of the contact in which another link is reported with certainty.
    """

    kind: str
    cover: str
    position: float
    force: float
    friction: float
    moving: bool
    latency: float
    detected: bool
    probability: float
    right_link: bool
    link: str
    error: float
    position_sd: float
    in_set: bool
    sure_and_wrong: float = 0.0


def outcome_of(contact: TrueContact, moments: Sequence[EstimatedMoment], length: float) -> ContactOutcome:
    """What was reported of a contact in the moments of the whole run, on a cover of this length, m."""
    now = moments[contact.due].estimate
    best = now.best
    carries = payload_probability(now) if contact.mass else 0.0
    is_named = best.cover == contact.cover
    own = [one for one in now.hypotheses if one.cover == contact.cover]
    right = is_named or carries > best.probability
    known = best if is_named and not math.isnan(best.position) else None
    times = [m.time - contact.since for m in moments[contact.first : contact.last + 1] if m.estimate.in_contact]
    already = contact.first > 0 and moments[contact.first - 1].estimate.in_contact
    place = min(contact.position, length)
    acting = compress(moments, during(moments, contact.begin, contact.end))
    wrong = [is_sure_and_wrong(m.estimate, contact.cover) for m in acting]
    return ContactOutcome(
        *contact[:5],
        moving=moments[contact.first].is_moving and moments[contact.due].is_moving,
        latency=math.nan if already else times[0] if times else math.inf,
        detected=now.in_contact,
        probability=best.probability,
        right_link=right,
        link=best.cover,
        error=abs(known.position - contact.position) if known else math.inf,
        position_sd=best.position_sd if right else math.nan,
        in_set=carries > EVALUATION.outside or any(one.low - 1e-6 <= place <= one.high + 1e-6 for one in own),
        sure_and_wrong=sum(wrong) * (moments[1].time - moments[0].time),
    )


def is_sure_and_wrong(estimate: ContactEstimate, cover: str) -> bool:
    """Whether a link is reported with certainty that is not the touched one."""
    return estimate.in_contact and estimate.best.probability > EVALUATION.sure and estimate.best.cover != cover


def payload_probability(estimate: ContactEstimate) -> float:
    """Probability of a mass at the tool: what those of the links lack to 1; 0 without any hypothesis."""
    links = [h.probability for h in estimate.hypotheses if h.cover != PAYLOAD]
    return max(0.0, 1.0 - sum(links)) if estimate.hypotheses else 0.0


class TorqueErrors(NamedTuple):
    """Errors of the external torques of one run.

    Attributes
    ----------
    moving, still : (n,), sums of squares, N^2 m^2, over the moments in which the arm moves, and is at rest.
    moving_z : (n,), sum of squared errors over reported variances, moving.
    moving_count, still_count : of moments.
    """

    moving: tuple[float, ...]
    still: tuple[float, ...]
    moving_z: tuple[float, ...]
    moving_count: int
    still_count: int


def torque_errors(moments: Sequence[EstimatedMoment], truth: Array, counts: Mask) -> TorqueErrors:
    """Errors of the external torques.

    Parameters
    ----------
    truth : (k, n), true torques, N m.
    counts : (k,), whether a moment counts.
    """
    square = (np.array([one.estimate.external_torques for one in moments]) - truth) ** 2
    variance = np.array([one.estimate.torque_sd for one in moments]) ** 2
    is_moving = np.array([one.is_moving for one in moments])
    moving, still = counts & is_moving, counts & ~is_moving
    return TorqueErrors(
        _sums(square[moving]),
        _sums(square[still]),
        _sums(square[moving] / variance[moving]),
        *(int(there.sum()) for there in (moving, still)),
    )


def _sums(squares: Array) -> tuple[float, ...]:
    return tuple(squares.sum(axis=0).tolist())


class MassOutcome(NamedTuple):
    """What was reported of a mass while the tool carried it.

    Attributes
    ----------
    mass : kg.
    detected : whether there was any report, of a contact or of a payload.
    named : whether it was reported as a payload: the most probable hypothesis, its reason, or the warning.
    wrong : whether a link was ever reported with certainty that the tool is not on.
    lasting : whether it is reported as a contact of a link at the end.
    """

    mass: float
    detected: bool
    named: bool
    wrong: bool
    lasting: bool


class ContactScore(NamedTuple):
    """One run, scored.

    Attributes
    ----------
    name : of the scenario, or of the degradation.
    group : 'moving', 'rest', 'dither' or 'free' of a scenario; of a drive the contacts that were drawn, 'identified'
        where the arm was identified before.
    outcomes : of the contacts.
    free_seconds, alarms : time without contact; detections that start in it.
    torques : errors of the external torques.
    excluded, not_made : contacts that were too short or too hard; that were planned and did not happen.
    warnings : share of the time without contact with a warning that the model is off.
    contact_seconds : time with a contact.
    masses : of each mass that was picked up.
    failure : why the run ended early.
    """

    name: str
    group: str
    outcomes: list[ContactOutcome]
    free_seconds: float
    alarms: int
    torques: TorqueErrors
    excluded: int = 0
    not_made: int = 0
    warnings: float = 0.0
    contact_seconds: float = 0.0
    masses: tuple[MassOutcome, ...] = ()
    failure: str = ""


def during(moments: Sequence[EstimatedMoment], begin: float, end: float) -> Mask:
    """Whether each moment is within some times, s."""
    time = np.array([one.time for one in moments])
    return (time >= begin - 1e-9) & (time <= end + 1e-9)


def quiet(moments: Sequence[EstimatedMoment], contacts: Sequence[TrueContact]) -> Mask:
    """Whether at each moment no contact acts, or has just acted."""
    found: Mask = np.ones(len(moments), bool)
    for one in contacts:
        found &= ~during(moments, one.begin, one.end + (EVALUATION.setting_down if one.mass else EVALUATION.edge))
    return found


def score_of(
    arm: Arm, moments: Sequence[EstimatedMoment], contacts: Sequence[TrueContact], **more: Any
) -> ContactScore:
    """Score a run; `more` are other fields of the score."""
    free = quiet(moments, contacts)
    alarm = np.array([one.estimate.in_contact for one in moments])
    counted = [contact for contact in contacts if contact.counts]
    return ContactScore(
        outcomes=[outcome_of(one, moments, arm.covers.length_of(one.cover)) for one in counted],
        free_seconds=(moments[1].time - moments[0].time) * int(free.sum()),
        # one that continues from a true contact ends late, and is no new alarm
        alarms=int((alarm[1:] & ~alarm[:-1] & free[1:]).sum()),
        excluded=len(contacts) - len(counted),
        **more,
    )
