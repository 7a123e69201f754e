"""Run the contact estimator on a recording, and score what it reports of each contact, and between contacts."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.identification.fit import identify
from wam_analysis.identification.overlay import estimator_values, model_values
from wam_control.contact.contact_estimator import ContactEstimate, ContactEstimator, ContactEstimatorParameters
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Arm, seconds
from wam_description.configuration import Configuration
from wam_description.reasons import Reason
from wam_description.rigid_body import Array
from wam_description.signals import State
from wam_description.units import STANDARD_GRAVITY
from wam_driver.safety import Mode
from wam_sim.simulation import Simulation
from wam_studies.contact.degradations import Degradation, drawn
from wam_studies.contact.moves import MoveGenerator
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
from wam_studies.contact.scenarios import base_values, moves_and_stops
from wam_studies.contact.touches import CONTACTS, Touch, touches
from wam_studies.identification.plants import Values
from wam_studies.identification.study import play


@dataclass(frozen=True)
class RecordingTimes:
    """When contacts are, for how long the arm is moved, and how many drives of one kind there are."""

    warm_up: float = 6.0  # s of free motion before the first contact
    excitation: float = 20.0  # s of motion for an identification
    drift_steps: int = 20  # of friction, over a recording
    shortest: float = 10.0  # s, with one contact
    other: float = 0.4  # of the length of a recording, with contacts that last or with masses
    arms: int = 3  # of each seed, that are identified


TIMES = RecordingTimes()
IDENTIFIED_ARM = "identified"  # group of the scores of an arm that was identified before


class Drive(NamedTuple):
    """What is recorded.

    Attributes
    ----------
    configuration, degradation, seed, seconds : the arm, the degradation by name, what is drawn, the length in s.
    contacts : which of `CONTACTS` are drawn.
    is_identified : whether the arm's model is identified before, from a motion of its own.
    """

    configuration: Configuration
    degradation: str
    seed: int
    seconds: float
    contacts: str = "wide"
    is_identified: bool = False


class DriveRecording(NamedTuple):
    """Signals of the motors and truth, one row per inner period.

    Attributes
    ----------
    degradation : as drawn.
    theta, thetad, torque : (k, n), rad, rad/s, N m, as measured.
    speed : (k,), rad/s, true, of the fastest joint.
    touches : the contacts, with times counted from the first row.
    failure : why the recording ended early, ''.
    model : values of the configuration of the identified model.
    """

    degradation: Degradation
    theta: Array
    thetad: Array
    torque: Array
    speed: Array
    touches: tuple[Touch, ...]
    failure: str
    model: Mapping[str, Any] = {}


def draw(drive: Drive) -> tuple[Degradation, list[Touch], list[ScenarioStep], list[float]]:
    """Degradation, contacts, steps of the motion and start pose; each degradation has its own contacts."""
    arm = drive.configuration.shared.arm
    name = sum(map(ord, drive.degradation))
    degradation = drawn(drive.degradation, arm, np.random.default_rng((drive.seed, 1, name)))
    random = np.random.default_rng((drive.seed, 2, name))
    moves = MoveGenerator(arm)
    start = moves.pose(random)
    steps = moves_and_stops(moves, random, start, drive.seconds, (0.0, 0.0, 0.0, 0.1, 0.4))
    given = CONTACTS[drive.contacts]
    times = np.arange(TIMES.warm_up, drive.seconds - given.spacing, given.spacing) + random.uniform(0.0, 0.4)
    return degradation, touches(arm, random, times.tolist(), given), steps, list(start)


def record(drive: Drive) -> DriveRecording:
    """Play and record a drive."""
    degradation, contacts, steps, start = draw(drive)
    values: dict[str, Any] = {
        **base_values(drive.configuration, False),
        "nodes": [name for name in drive.configuration.shared.nodes if name != "contact_estimator"],
        **degradation.plant,
        "arm.joints.start": start,
        "driver:seed": drive.seed,
    }
    configured = drive.configuration.with_values(values)
    arm, period = configured.shared.arm, seconds(configured.shared.timing.period_ns)
    run = Simulation(configured, steps)
    rows: list[list[float]] = []
    nominal = np.array(arm.joints.dynamic_friction)
    drift_every = max(1, round(drive.seconds / period / TIMES.drift_steps))
    done = False
    while not done:
        k = len(rows)
        if degradation.drift and k % drift_every == 0:
            run.driver.plant.set_added_friction((degradation.drift * k * period / drive.seconds * nominal).tolist())
        state = run.driver.motor_state
        rows.append([*state.position, *state.velocity, *state.effort, max(map(abs, run.driver.plant.qd))])
        _push(run, arm, contacts, k * period)
        done = run.step() or run.driver.safety.mode is Mode.FAULT
    theta, thetad, torque, speed = np.split(np.array(rows), arm.n * np.arange(1, 4), axis=1)
    failure = run.driver.safety.fault or run.scenario.failure
    model = _identified(configured, degradation, drive.seed) if drive.is_identified else {}
    return DriveRecording(degradation, theta, thetad, torque, speed[:, 0], tuple(contacts), failure, model)


def _identified(configured: Configuration, degradation: Degradation, seed: int) -> Values:
    """Values of the model that `wam identify` finds for a plant from the signals that the estimator gets."""
    samples, _ = play(configured, seed, TIMES.excitation, degradation.signals)
    known = configured.with_values(degradation.model).shared
    found = identify(known, samples)
    return model_values(known, found, "an exciting motion") | estimator_values(configured)


def _push(run: Simulation, arm: Arm, contacts: Sequence[Touch], time: float) -> None:
    """Apply the contacts that act now, those that have just ended with no force; carry the masses."""
    run.driver.plant.carry(sum(touch.mass for touch in contacts if touch.begin <= time < touch.end))
    near = [touch for touch in contacts if not touch.mass and touch.begin - 0.01 <= time <= touch.end + 0.01]
    for cover in {touch.cover for touch in near}:
        wrench = np.sum([touch.wrench(time, arm.covers) for touch in near if touch.cover == cover], axis=0).tolist()
        run.driver.plant.push(cover, wrench[:3], wrench[3:])


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


def replay(drive: Drive, recording: DriveRecording) -> ContactScore:
    """Score the estimator of a configuration on a recording."""
    configured = drive.configuration.with_values(
        {**base_values(drive.configuration, False), **recording.degradation.model, **recording.model}
    )
    shared, own = configured.shared, configured.node("contact_estimator", ContactEstimatorParameters)
    period, outer = seconds(shared.timing.period_ns), shared.timing.outer_divisor
    estimator, moments = ContactEstimator(shared.model_arm, shared.timing, own, shared.model), list[EstimatedMoment]()
    for i, state, dt in arriving(recording, period, drive.seed):
        estimator.observe(state, None, dt)
        if i % outer == 0:
            is_moving = bool(recording.speed[i] > EVALUATION.moving)
            moments.append(EstimatedMoment(i * period, estimator.estimate(), is_moving))
    contacts = [_contact(touch, moments) for touch in recording.touches if touch.end < moments[-1].time]
    free = quiet(moments, contacts)
    settled = free & during(moments, EVALUATION.observer + 1e-6, np.inf) & np.array([one.is_moving for one in moments])
    warned = [one.estimate.warning is not None for one in compress(moments, free)]
    return score_of(
        shared.arm,
        moments,
        contacts,
        name=drive.degradation,
        group=IDENTIFIED_ARM if drive.is_identified else drive.contacts,
        torques=torque_errors(moments, np.zeros((len(moments), shared.arm.n)), settled),
        warnings=sum(warned) / max(1, len(warned)),
        contact_seconds=sum(one.end - one.begin for one in contacts if not one.mass),
        masses=tuple(_mass(one, moments) for one in contacts if one.mass),
        failure=recording.failure,
    )


def names_payload(estimate: ContactEstimate) -> bool:
    """Whether a mass at the tool is reported: as the most probable hypothesis, in its reason, or as a warning."""
    best = estimate.hypotheses[:1]
    warned = estimate.warning is not None and estimate.warning.values["part"] == PAYLOAD
    return warned or any(Reason.PAYLOAD in h.reasons or h.cover == PAYLOAD for h in best)


def _mass(contact: TrueContact, moments: Sequence[EstimatedMoment]) -> MassOutcome:
    acting = [one.estimate for one in compress(moments, during(moments, contact.begin, contact.end))]
    linked = [one.in_contact and one.best.cover != PAYLOAD for one in acting]
    named = [names_payload(one) for one in acting]
    return MassOutcome(
        mass=contact.mass,
        detected=any(linked) or any(named),
        named=any(named),
        wrong=any(is_sure_and_wrong(one, contact.cover) and one.best.cover != PAYLOAD for one in acting),
        lasting=linked[-1] and not named[-1],
    )


def _contact(touch: Touch, moments: Sequence[EstimatedMoment]) -> TrueContact:
    waits = (0.0, EVALUATION.settled, EVALUATION.late)
    times = [min(touch.begin + wait, touch.end) for wait in waits]
    first, due, late = np.searchsorted([one.time for one in moments], times).clip(max=len(moments) - 1).tolist()
    force = float(np.linalg.norm(touch.force)) + STANDARD_GRAVITY * touch.mass
    place = touch.place_at(moments[due].time)
    return TrueContact(
        touch.kind, touch.cover, place, force, touch.friction, touch.begin, touch.end, first, due, late, touch.begin,
        touch.mass,
    )  # fmt: skip
