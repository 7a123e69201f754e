"""Play one drawn arm without ROS and keep the motors' signals and the true contacts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.identification.fit import identify
from wam_analysis.identification.overlay import estimator_values, model_values
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Arm, seconds
from wam_description.configuration import Configuration
from wam_description.rigid_body import Array
from wam_driver.safety import Mode
from wam_sim.simulation import Simulation
from wam_studies.contact.degradations import Degradation, Values, drawn
from wam_studies.contact.moves import MoveGenerator
from wam_studies.contact.scenarios import base_values, moves_and_stops
from wam_studies.contact.touches import (
    KINDS,
    LASTING_KINDS,
    LEVEL_KINDS,
    MASS_KINDS,
    Touch,
    touches,
)
from wam_studies.identification.trial import play


@dataclass(frozen=True)
class RecordingTimes:
    """When contacts are, for how long the arm is moved, and how many drives of one kind there are."""

    warm_up: float = 6.0  # s of free motion before the first contact
    spacing: float = 1.9  # s from one contact to the next
    spacing_of_masses: float = 6.0  # s
    spacing_of_lasting: float = 11.0  # s
    excitation: float = 20.0  # s of motion for an identification
    drift_steps: int = 20  # of friction, over a recording
    shortest: float = 10.0  # s, with one contact
    other: float = 0.4  # of the length of a recording, with contacts that last or with masses
    arms: int = 3  # of each seed, that are identified


TIMES = RecordingTimes()
CONTACTS = {  # kinds of contacts, and s from one to the next
    "wide": (KINDS, TIMES.spacing),
    "lasting": (LASTING_KINDS, TIMES.spacing_of_lasting),
    "level": (LEVEL_KINDS, TIMES.spacing),
    "masses": (MASS_KINDS, TIMES.spacing_of_masses),
}


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
    kinds, spacing = CONTACTS[drive.contacts]
    times = np.arange(TIMES.warm_up, drive.seconds - spacing, spacing) + random.uniform(0.0, 0.4)
    return degradation, touches(arm, random, times.tolist(), kinds), steps, list(start)


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
    rows: list[tuple[list[float], list[float], list[float], float]] = []
    nominal = np.array(arm.joints.dynamic_friction)
    drift_every = max(1, round(drive.seconds / period / TIMES.drift_steps))
    done = False
    while not done:
        k = len(rows)
        if degradation.drift and k % drift_every == 0:
            run.driver.set_added_friction((degradation.drift * k * period / drive.seconds * nominal).tolist())
        state = run.driver.motor_state
        rows.append(
            (list(state.position), list(state.velocity), list(state.effort), max(map(abs, run.driver.plant.qd)))
        )
        _push(run, arm, contacts, k * period)
        done = run.step() or run.driver.safety.mode is Mode.FAULT
    theta, thetad, torque, speed = (np.array([row[i] for row in rows]) for i in range(4))
    failure = run.driver.safety.fault or run.scenario.failure
    model = _identified(configured, degradation, drive.seed) if drive.is_identified else {}
    return DriveRecording(degradation, theta, thetad, torque, speed, tuple(contacts), failure, model)


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
        run.driver.push(cover, wrench[:3], wrench[3:])
