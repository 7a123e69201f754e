"""Run the contact estimator on a recording, and score what it reports of each contact, and between contacts."""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import compress
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
    MassOutcome,
    TrueContact,
    during,
    is_sure_and_wrong,
    quiet,
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
        {**base_values(configuration, False), **recording.degradation.model, **recording.model}
    )
    shared, own = configured.shared, configured.node("contact_estimator", ContactEstimatorParameters)
    period, outer = seconds(shared.timing.period_ns), shared.timing.outer_divisor
    new = partial(ContactEstimator, shared.model_arm, shared.timing, own, shared.model)
    estimator, moments = new(), list[EstimatedMoment]()
    strong = [t for t in recording.touches if np.linalg.norm(t.force) >= EVALUATION.start_force]
    singles = [touch for touch in strong if touch.kind in ("outer", "inner")]
    trials: dict[Touch, tuple[ContactEstimator, ContactEstimator]] = {}
    started: dict[Touch, tuple[bool, bool]] = {}
    for i, state, dt in arriving(recording, period, seed):
        time = i * period
        estimator.observe(state, None, dt)
        for touch in singles:
            begin = touch.begin + EVALUATION.start_after
            if begin <= time < begin + EVALUATION.start_within:
                if touch not in trials:
                    trials[touch] = estimator.restarted_copy(), new()
                for trial in trials[touch]:
                    trial.observe(state, None, dt)
                if i % outer == 0:
                    warm, cold = (trial.estimate().in_contact for trial in trials[touch])
                    before = started.get(touch, (False, False))
                    started[touch] = before[0] or warm, before[1] or cold
        if i % outer == 0:
            is_moving = bool(recording.speed[i] > EVALUATION.moving)
            moments.append(EstimatedMoment(time, estimator.estimate(), is_moving))
    return _scored(recording, moments, shared.arm, name=name, group=group, started=tuple(started.values()))


def _scored(recording: DriveRecording, moments: Sequence[EstimatedMoment], arm: Arm, **more: Any) -> ContactScore:
    contacts = [_contact(touch, moments) for touch in recording.touches if touch.end < moments[-1].time]
    free = quiet(moments, contacts)
    settled = free & during(moments, EVALUATION.observer + 1e-6, np.inf) & np.array([one.is_moving for one in moments])
    warned = [one.estimate.warning is not None for one in compress(moments, free)]
    truth = np.zeros((len(moments), len(arm.joints.names)))
    return score_of(
        arm,
        moments,
        contacts,
        torques=torque_errors(moments, truth, settled),
        warnings=sum(warned) / max(1, len(warned)),
        contact_seconds=sum(one.end - one.begin for one in contacts if not one.mass),
        masses=tuple(_mass(one, moments) for one in contacts if one.mass),
        failure=recording.failure,
        **more,
    )


def names_payload(estimate: ContactEstimate) -> bool:
    """Whether a mass at the tool is reported: as the most probable hypothesis, in its reason, or as a warning."""
    best = estimate.hypotheses[:1]
    warned = estimate.warning is not None and estimate.warning.values["part"] == PAYLOAD
    return warned or any(Reason.PAYLOAD in h.reasons or h.cover == PAYLOAD for h in best)


def _mass(contact: TrueContact, moments: Sequence[EstimatedMoment]) -> MassOutcome:
    acting = [one.estimate for one in compress(moments, during(moments, contact.begin, contact.end))]
    linked = [one.in_contact and one.link != PAYLOAD for one in acting]
    named = [names_payload(one) for one in acting]
    return MassOutcome(
        mass=contact.mass,
        detected=any(linked) or any(named),
        named=any(named),
        wrong=any(is_sure_and_wrong(one, contact.cover) and one.link != PAYLOAD for one in acting),
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
    return TrueContact(
        touch.kind, touch.cover, place, force, touch.friction, touch.begin, touch.end, first, due, late, touch.begin,
        touch.mass,
    )  # fmt: skip
