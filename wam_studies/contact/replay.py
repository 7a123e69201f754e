"""Run the contact estimator on a recording: what it reports of each contact, and between contacts."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from wam_control.contact.contact_estimator import ContactEstimate, ContactEstimator, ContactEstimatorParameters
from wam_description.arm import seconds
from wam_description.configuration import Configuration
from wam_description.reasons import Reason
from wam_description.signals import State
from wam_description.units import STANDARD_GRAVITY
from wam_studies.contact.contacts import EVALUATION
from wam_studies.contact.recording import DriveRecording
from wam_studies.contact.scenarios import base_values
from wam_studies.contact.touches import Touch

PAYLOAD = "payload"  # how hypotheses, reasons and warnings name a mass at the tool


@dataclass(frozen=True)
class ReplayLimits:
    """When an estimate of a recording is evaluated, and what counts."""

    late: float = 0.45  # s after the start of a contact, until which it is detected
    start_after: float = 0.1  # s, of an estimator that starts in contact
    start_within: float = 0.3  # s
    start_force: float = 9.0  # N
    sliding: float = 0.3  # rad/s, slowest motor
    sure: float = 0.95  # probability of a link
    outside: float = 0.1  # largest probability of what a 90 % set may lack
    setting_down: float = 0.5  # s after a mass is set down, in which the model is still that with it
    observer: float = 1.0  # s at the start, whose torques are the observer's own transient


REPLAY = ReplayLimits()


class TouchOutcome(NamedTuple):
    """What was reported of one contact.

    Attributes
    ----------
    kind, cover, position, force, friction : true, of the contact; m, N; the weight of a mass.
    moving : whether the arm moved at the start and when the estimate is evaluated.
    slowest : rad/s, of the slowest motor at the start.
    latency : s to the detection, inf without, NaN if there was one already.
    detected, probability, right_link : when evaluated, 0.2 s after the start.
    error, position_sd : m; inf on the wrong link or without an estimate; NaN sd without a position.
    in_set, set_length : whether the 90 % set holds the truth, and its length, m.
    sure_and_wrong : s of the contact in which another link is reported with more than `REPLAY.sure`.
    """

    kind: str
    cover: str
    position: float
    force: float
    friction: float
    moving: bool
    slowest: float
    latency: float
    detected: bool
    probability: float
    right_link: bool
    error: float
    position_sd: float
    in_set: bool
    set_length: float
    sure_and_wrong: float


class MassOutcome(NamedTuple):
    """What was reported of a mass while the tool carried it.

    Attributes
    ----------
    mass : kg.
    detected : whether there was any report, of a contact or of a payload.
    named : whether it was reported as a payload: the most probable hypothesis, its reason, or the warning.
    wrong : whether a link was ever reported with more than `REPLAY.sure` that the tool is not on.
    lasting : whether it is reported as a contact of a link at the end.
    """

    mass: float
    detected: bool
    named: bool
    wrong: bool
    lasting: bool


class FalseAlarm(NamedTuple):
    """A detection that starts without contact.

    Attributes
    ----------
    after : s since the last contact, inf before the first one.
    slowest : rad/s, of the slowest motor.
    excess : greatest statistic per threshold.
    """

    after: float
    slowest: float
    excess: float


class ReplayScore(NamedTuple):
    """One recording, scored.

    Attributes
    ----------
    degradation : its name.
    outcomes : of the contacts.
    free_seconds, alarms : time without contact; each detection that starts in it.
    warnings : share of that time with a warning that the model is off.
    torque_z : rms of error over stated sd of the external torques in free motion.
    torque_errors : (2, n), rms errors of the external torques in free motion, N m: with all motors sliding, and of all.
    contact_seconds : time with a contact.
    masses : of each mass that was picked up.
    started : whether a contact in which the estimator starts is detected: (warm, cold) of each.
    failure : of the recording.
    """

    degradation: str
    outcomes: list[TouchOutcome]
    free_seconds: float
    alarms: list[FalseAlarm]
    warnings: float
    torque_z: float
    torque_errors: list[list[float]]
    contact_seconds: float
    masses: list[MassOutcome]
    started: list[tuple[bool, bool]]
    failure: str


class _Row(NamedTuple):
    """One outer period."""

    time: float
    sample: int
    estimate: ContactEstimate


class SignalFaults:
    """Samples as the estimator gets them: state, torque, time since the last sample that arrived."""

    def __init__(self, recording: DriveRecording, period: float, seed: int) -> None:
        self._recording, self._period = recording, period
        self._random = np.random.default_rng((seed, 3))

    def __iter__(self) -> Iterator[tuple[int, State, float]]:
        recording = self._recording
        measured, arrives = recording.degradation.signals.of(recording.torque, self._random)
        signals = zip(recording.theta.tolist(), recording.thetad.tolist(), measured.tolist(), strict=True)
        gap = 0.0
        for i, (theta, thetad, torque) in enumerate(signals):
            gap += self._period
            if arrives[i]:
                yield i, State(theta, thetad, torque), gap
                gap = 0.0


def replay(configuration: Configuration, name: str, recording: DriveRecording, seed: int) -> ReplayScore:
    """Score the estimator of a configuration on a recording."""
    configured = configuration.with_values(
        {**base_values(configuration, False), **dict(recording.degradation.model), **dict(recording.model)}
    )
    shared, own = configured.shared, configured.node("contact_estimator", ContactEstimatorParameters)
    period, outer = seconds(shared.timing.period_ns), shared.timing.outer_divisor
    estimator = ContactEstimator(shared.model_arm, shared.timing, own, shared.model)
    rows: list[_Row] = []
    singles = [
        t for t in recording.touches if t.kind in ("outer", "inner") and np.linalg.norm(t.force) >= REPLAY.start_force
    ]
    trials: dict[int, tuple[ContactEstimator, ContactEstimator]] = {}
    started: dict[int, tuple[bool, bool]] = {}
    for i, state, dt in SignalFaults(recording, period, seed):
        time = i * period
        estimator.observe(state, None, dt)
        for number, touch in enumerate(singles):
            if touch.begin + REPLAY.start_after <= time < touch.begin + REPLAY.start_after + REPLAY.start_within:
                if number not in trials:
                    cold = ContactEstimator(shared.model_arm, shared.timing, own, shared.model)
                    trials[number] = estimator.restarted_copy(), cold
                for trial in trials[number]:
                    trial.observe(state, None, dt)
                if i % outer == 0:
                    now = [trial.estimate().in_contact for trial in trials[number]]
                    before = started.get(number, (False, False))
                    started[number] = before[0] or now[0], before[1] or now[1]
        if i % outer == 0:
            rows.append(_Row(time, i, estimator.estimate()))
    return _scored(name, recording, rows, list(started.values()), dict(_lengths(configured)), own.detect)


def _lengths(configuration: Configuration) -> Iterator[tuple[str, float]]:
    covers = configuration.shared.arm.covers
    return zip(covers.names, covers.length, strict=True)


def _scored(
    name: str,
    recording: DriveRecording,
    rows: Sequence[_Row],
    started: list[tuple[bool, bool]],
    lengths: dict[str, float],
    threshold: float,
) -> ReplayScore:
    step = rows[1].time - rows[0].time
    ended = rows[-1].time
    touches = [touch for touch in recording.touches if touch.end < ended]
    busy = np.zeros(len(rows), bool)
    for touch in touches:
        busy |= _during(rows, touch.begin, touch.end + (REPLAY.setting_down if touch.mass else EVALUATION.edge))
    moving = np.array([recording.speed[row.sample] > EVALUATION.moving for row in rows])
    alarm = np.array([row.estimate.in_contact for row in rows])
    # a detection that continues from a true contact ends late, and is no new alarm
    alarms = np.flatnonzero(alarm[1:] & ~alarm[:-1] & ~busy[1:]) + 1
    free = ~busy & moving & (np.array([row.time for row in rows]) > REPLAY.observer)
    found = np.array([row.estimate.external_torques for row in rows])
    z = (found / np.array([row.estimate.torque_sd for row in rows]))[free]
    slowest = np.abs(recording.thetad[[row.sample for row in rows]]).min(axis=1)
    sliding = free & (slowest > REPLAY.sliding)
    warned = [row.estimate.warning is not None for row, take in zip(rows, ~busy, strict=True) if take]
    return ReplayScore(
        degradation=name,
        outcomes=[_outcome(touch, rows, moving, slowest, lengths) for touch in touches],
        free_seconds=step * int((~busy).sum()),
        alarms=[_alarm(rows, i, touches, float(slowest[i]), threshold) for i in alarms.tolist()],
        warnings=sum(warned) / max(1, len(warned)),
        torque_z=float(np.sqrt(np.mean(np.square(z)))) if len(z) else math.nan,
        torque_errors=[np.sqrt(np.mean(np.square(found[which]), axis=0)).tolist() for which in (sliding, free)],
        contact_seconds=sum(touch.end - touch.begin for touch in touches if not touch.mass),
        masses=[_mass_outcome(touch, rows) for touch in touches if touch.mass],
        started=started,
        failure=recording.failure,
    )


def _alarm(rows: Sequence[_Row], i: int, touches: Sequence[Touch], slowest: float, threshold: float) -> FalseAlarm:
    during = takewhile(lambda row: row.estimate.in_contact, rows[i:])
    ended = max((touch.end for touch in touches if touch.end <= rows[i].time), default=-math.inf)
    return FalseAlarm(rows[i].time - ended, slowest, max(row.estimate.statistic for row in during) / threshold)


def payload_probability(estimate: ContactEstimate) -> float:
    """Probability of a mass at the tool: what those of the links lack to 1; 0 without any hypothesis."""
    links = [h.probability for h in estimate.hypotheses if h.cover != PAYLOAD]
    return max(0.0, 1.0 - sum(links)) if estimate.hypotheses else 0.0


def names_payload(estimate: ContactEstimate) -> bool:
    """Whether a mass at the tool is reported: as the most probable hypothesis, in its reason, or as a warning."""
    best = estimate.hypotheses[:1]
    warned = estimate.warning is not None and estimate.warning.values["part"] == PAYLOAD
    return warned or any(Reason.PAYLOAD in h.reasons or h.cover == PAYLOAD for h in best)


def _mass_outcome(touch: Touch, rows: Sequence[_Row]) -> MassOutcome:
    during = [row.estimate for row, take in zip(rows, _during(rows, touch.begin, touch.end), strict=True) if take]
    linked = [one.in_contact and one.link != PAYLOAD for one in during]
    named = [names_payload(one) for one in during]
    return MassOutcome(
        mass=touch.mass,
        detected=any(linked) or any(named),
        named=any(named),
        wrong=any(
            has_link and one.probability > REPLAY.sure and one.link != touch.cover
            for one, has_link in zip(during, linked, strict=True)
        ),
        lasting=linked[-1] and not named[-1],
    )


def _during(rows: Sequence[_Row], begin: float, end: float) -> np.ndarray:
    time = np.array([row.time for row in rows])
    return (time >= begin) & (time <= end)


def _outcome(
    touch: Touch, rows: Sequence[_Row], moving: np.ndarray, slowest: np.ndarray, lengths: dict[str, float]
) -> TouchOutcome:
    first = next(i for i, row in enumerate(rows) if row.time >= touch.begin)
    due, late = (
        next((i for i, row in enumerate(rows) if row.time >= min(touch.begin + wait, touch.end)), len(rows) - 1)
        for wait in (EVALUATION.settled, REPLAY.late)
    )
    now = rows[due].estimate
    best = now.hypotheses[0] if now.hypotheses else None
    carries = payload_probability(now) if touch.mass else 0.0
    right = best is not None and (best.cover == touch.cover or carries > best.probability)
    own = [h for h in now.hypotheses if h.cover == touch.cover]
    true = touch.place_at(rows[due].time)
    sizes = [h.high - h.low for h in now.hypotheses if not math.isnan(h.low)]
    already = first > 0 and rows[first - 1].estimate.in_contact
    times = [row.time - touch.begin for row in rows[first : late + 1] if row.estimate.in_contact]
    return TouchOutcome(
        kind=touch.kind,
        cover=touch.cover,
        position=true,
        force=float(np.linalg.norm(touch.force)) + STANDARD_GRAVITY * touch.mass,
        friction=touch.friction,
        moving=bool(moving[first] and moving[due]),
        slowest=float(slowest[first]),
        latency=math.nan if already else times[0] if times else math.inf,
        detected=now.in_contact,
        probability=now.probability,
        right_link=right,
        error=_error(now, touch.cover, true),
        position_sd=now.position_sd if right else math.nan,
        in_set=carries > REPLAY.outside
        or any(h.low - 1e-6 <= min(true, lengths[h.cover]) <= h.high + 1e-6 for h in own),
        set_length=sum(sizes),
        sure_and_wrong=_sure_and_wrong(touch, rows),
    )


def _sure_and_wrong(touch: Touch, rows: Sequence[_Row]) -> float:
    """Time, s, in which a link is reported with certainty that is not the touched one."""
    during = [row.estimate for row, acts in zip(rows, _during(rows, touch.begin, touch.end), strict=True) if acts]
    wrong = sum(one.in_contact and one.probability > REPLAY.sure and one.link != touch.cover for one in during)
    return wrong * (rows[1].time - rows[0].time)


def _error(estimate: ContactEstimate, cover: str, true: float) -> float:
    if estimate.link != cover or math.isnan(estimate.position):
        return math.inf
    return abs(estimate.position - true)
