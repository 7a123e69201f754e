"""Run the contact estimator on a recording, and score what it reports of each contact, and between contacts."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from wam_control.contact.contact_estimator import ContactEstimate, ContactEstimator, ContactEstimatorParameters
from wam_description.arm import Arm, seconds
from wam_description.configuration import Configuration
from wam_description.reasons import Reason
from wam_description.signals import State
from wam_description.units import STANDARD_GRAVITY
from wam_studies.contact.outcomes import (
    EVALUATION,
    PAYLOAD,
    ContactScore,
    EstimatedMoment,
    Mask,
    MassOutcome,
    TrueContact,
    during,
    is_sure_and_wrong,
    score_of,
    torque_errors,
)
from wam_studies.contact.recording import DriveRecording
from wam_studies.contact.scenarios import base_values
from wam_studies.contact.touches import Touch


def arriving(recording: DriveRecording, period: float, seed: int) -> Iterator[tuple[int, State, float]]:
    """Samples as the estimator gets them: number, state and torque, s since the last sample that arrived."""
    measured, arrives = recording.degradation.signals.of(recording.torque, np.random.default_rng((seed, 3)))
    signals = zip(recording.theta.tolist(), recording.thetad.tolist(), measured.tolist(), strict=True)
    gap = 0.0
    for i, (theta, thetad, torque) in enumerate(signals):
        gap += period
        if arrives[i]:
            yield i, State(theta, thetad, torque), gap
            gap = 0.0


def replay(configuration: Configuration, name: str, group: str, recording: DriveRecording, seed: int) -> ContactScore:
    """Score the estimator of a configuration on a recording."""
    configured = configuration.with_values(
        {**base_values(configuration, False), **dict(recording.degradation.model), **dict(recording.model)}
    )
    shared, own = configured.shared, configured.node("contact_estimator", ContactEstimatorParameters)
    period, outer = seconds(shared.timing.period_ns), shared.timing.outer_divisor
    estimator = ContactEstimator(shared.model_arm, shared.timing, own, shared.model)
    moments: list[EstimatedMoment] = []
    singles = [
        t
        for t in recording.touches
        if t.kind in ("outer", "inner") and np.linalg.norm(t.force) >= EVALUATION.start_force
    ]
    trials: dict[int, tuple[ContactEstimator, ContactEstimator]] = {}
    started: dict[int, tuple[bool, bool]] = {}
    for i, state, dt in arriving(recording, period, seed):
        time = i * period
        estimator.observe(state, None, dt)
        for number, touch in enumerate(singles):
            if (
                touch.begin + EVALUATION.start_after
                <= time
                < touch.begin + EVALUATION.start_after + EVALUATION.start_within
            ):
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
            is_moving = bool(recording.speed[i] > EVALUATION.moving)
            moments.append(EstimatedMoment(time, estimator.estimate(), is_moving))
    return _scored(recording, moments, shared.arm, name=name, group=group, started=tuple(started.values()))


def _scored(recording: DriveRecording, moments: Sequence[EstimatedMoment], arm: Arm, **more: Any) -> ContactScore:
    touches = [touch for touch in recording.touches if touch.end < moments[-1].time]
    acting = [during(moments, touch.begin, touch.end) for touch in touches]
    busy = np.zeros(len(moments), bool)
    for touch in touches:
        busy |= during(moments, touch.begin, touch.end + (EVALUATION.setting_down if touch.mass else EVALUATION.edge))
    free = ~busy & during(moments, EVALUATION.observer + 1e-6, np.inf) & np.array([one.is_moving for one in moments])
    warned = [one.estimate.warning is not None for one, take in zip(moments, ~busy, strict=True) if take]
    truth = np.zeros((len(moments), len(arm.joints.names)))
    return score_of(
        arm,
        moments,
        [_contact(touch, moments) for touch in touches],
        acting,
        busy,
        torques=torque_errors(moments, truth, free),
        warnings=sum(warned) / max(1, len(warned)),
        contact_seconds=sum(touch.end - touch.begin for touch in touches if not touch.mass),
        masses=tuple(_mass(touch, moments, acts) for touch, acts in zip(touches, acting, strict=True) if touch.mass),
        failure=recording.failure,
        **more,
    )


def names_payload(estimate: ContactEstimate) -> bool:
    """Whether a mass at the tool is reported: as the most probable hypothesis, in its reason, or as a warning."""
    best = estimate.hypotheses[:1]
    warned = estimate.warning is not None and estimate.warning.values["part"] == PAYLOAD
    return warned or any(Reason.PAYLOAD in h.reasons or h.cover == PAYLOAD for h in best)


def _mass(touch: Touch, moments: Sequence[EstimatedMoment], acting: Mask) -> MassOutcome:
    during = [one.estimate for one, acts in zip(moments, acting, strict=True) if acts]
    linked = [one.in_contact and one.link != PAYLOAD for one in during]
    named = [names_payload(one) for one in during]
    return MassOutcome(
        mass=touch.mass,
        detected=any(linked) or any(named),
        named=any(named),
        wrong=any(is_sure_and_wrong(one, touch.cover) and one.link != PAYLOAD for one in during),
        lasting=linked[-1] and not named[-1],
    )


def _contact(touch: Touch, moments: Sequence[EstimatedMoment]) -> TrueContact:
    first, due, late = (
        next((i for i, one in enumerate(moments) if one.time >= time), len(moments) - 1)
        for time in (
            touch.begin,
            *(min(touch.begin + wait, touch.end) for wait in (EVALUATION.settled, EVALUATION.late)),
        )
    )
    force = float(np.linalg.norm(touch.force)) + STANDARD_GRAVITY * touch.mass
    place = touch.place_at(moments[due].time)
    return TrueContact(touch.kind, touch.cover, place, force, touch.friction, first, due, late, touch.begin, touch.mass)
