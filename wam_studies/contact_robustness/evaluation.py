"""All degradations of some seeds on an executor, and the page docs/contact-robustness.md."""

import gc
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_description.arm import Arm, seconds
from wam_description.configuration import Configuration
from wam_description.signals import State
from wam_sim.batch import Report, results
from wam_studies.contact_benchmark.scenarios import base_values
from wam_studies.contact_benchmark.score import ScenarioScore
from wam_studies.contact_robustness import degradations
from wam_studies.contact_robustness.bounds import BOUNDS, bounds
from wam_studies.contact_robustness.comparison import EXTENT, comparison_table
from wam_studies.contact_robustness.reasons import Evidence, missed_table
from wam_studies.contact_robustness.recording import Drive, record
from wam_studies.contact_robustness.replay import ReplayScore, SignalFaults, replay
from wam_studies.contact_robustness.requirements import (
    MIX,
    alone_table,
    contacts_needed,
    required_rows,
    required_table,
    seconds_needed,
)
from wam_studies.contact_robustness.rows import DETECTION, POSITION, SECOND, kinds_table, masses_table, table
from wam_studies.identification import plants
from wam_studies.identification.trial import IdentificationResult, IdentificationTrial

Groups = dict[str, list[ReplayScore]]  # scores by degradation
ARMS = 3  # of each seed, that are identified
SECOND_SHARE = 0.4  # of the length of a recording, with second contacts or with masses
SHORTEST = 10.0  # s, with one contact
RUNS = 4  # of which the fastest counts
EXCITATION = 40.0  # s of motion of the plants that are identified for their friction


class DrivePlan(NamedTuple):
    """What is recorded.

    A drive for each degradation and seed; the same arms with many second contacts; the same arms picking up masses;
    arms of some degradations with contacts of three forces, whose models are not identified; the same, identified
    before.
    """

    wide: list[Drive]
    second: list[Drive]
    masses: list[Drive]
    level: list[Drive]
    identified: list[Drive]


class RobustnessResult(NamedTuple):
    """What was measured.

    Attributes
    ----------
    wide, second, masses, level, identified : scores of a plan.
    identifications : of plants with every error of friction.
    average : time of an update, average over the periods, s.
    bounds : rows of `bounds.bounds`.
    reference : time of the reference workload on this computer, s.
    first : scores of the first benchmark on the same seeds, none if it was not run.
    """

    wide: Groups
    second: Groups
    masses: Groups
    level: Groups
    identified: Groups
    identifications: list[IdentificationResult]
    average: float
    bounds: Sequence[Sequence[str]] = ()
    reference: float = math.nan
    first: Sequence[ScenarioScore] = ()


def drives(configuration: Configuration, seeds: Sequence[int], names: Sequence[str], seconds: float) -> DrivePlan:
    """The drives of some degradations.

    Raises
    ------
    ValueError
        for a degradation that is not known.
    """
    for name in names:
        if name not in degradations.NAMES:
            raise ValueError(f"no degradation is named '{name}'; degradations: {', '.join(degradations.NAMES)}")
    wide = [Drive(configuration, name, seed, seconds) for seed in seeds for name in names]
    second = [drive._replace(contacts="second", seconds=max(SHORTEST, SECOND_SHARE * seconds)) for drive in wide]
    masses = [drive._replace(contacts="masses") for drive in second]
    level = [
        drive._replace(contacts="level", seed=ARMS * drive.seed + arm)
        for drive in wide
        if drive.degradation in degradations.IDENTIFIED
        for arm in range(ARMS)
    ]
    return DrivePlan(wide, second, masses, level, [drive._replace(is_identified=True) for drive in level])


def evaluate_drive(drive: Drive) -> ReplayScore:
    """Record a drive and score the estimator on it."""
    return replay(drive.configuration, drive.degradation, record(drive), drive.seed)


def evaluate(
    chosen: Sequence[Drive], executor: Executor, file: Path | None = None, report: Report | None = None
) -> Groups:
    """Scores by degradation; the other arguments are those of `batch.results`."""
    scores = results(evaluate_drive, chosen, executor, file, report)
    names = [name for name in degradations.NAMES if any(drive.degradation == name for drive in chosen)]
    return {name: [score for score in scores if score.degradation == name] for name in names}


def friction_trials(configuration: Configuration, seeds: Sequence[int]) -> list[IdentificationTrial]:
    """Identifications of the plant with every error, and with real sensors, for each seed."""
    return [IdentificationTrial(configuration, plants.KINDS[-1], seed, EXCITATION) for seed in seeds]


def average_update(configuration: Configuration, seed: int) -> float:
    """Computing time of a whole update, s, average over the periods of a recording in which there is contact.

    The least of a few runs, because other programs slow a computer down.  As in a node that spins, garbage is not
    looked for in what was there before.
    """
    configured = configuration.with_values(base_values(configuration, False))
    recording = record(Drive(configured, degradations.NAMES[0], seed, SHORTEST, "second"))
    samples = list(SignalFaults(recording, seconds(configured.shared.timing.period_ns), seed))
    gc.collect()
    gc.freeze()
    try:
        return min(_average_update(configured, samples) for _ in range(RUNS))
    finally:
        gc.unfreeze()


def _average_update(configured: Configuration, samples: Sequence[tuple[int, State, float]]) -> float:
    shared, own = configured.shared, configured.node("contact_estimator", ContactEstimatorParameters)
    estimator = ContactEstimator(shared.model_arm, shared.timing, own, shared.model)
    spent, periods, in_contact = 0.0, 0, False
    for i, state, dt in samples:
        begin = process_time()
        estimator.observe(state, None, dt)
        now = estimator.estimate().in_contact if i % shared.timing.outer_divisor == 0 else in_contact
        if in_contact:
            spent, periods = spent + process_time() - begin, periods + 1
        in_contact = now
    return spent / periods if periods else math.nan


def bounds_of(configuration: Configuration, seed: int, identified: Groups) -> list[list[str]]:
    """The bounds with the errors of the torques of identified arms, none without any."""
    errors = [score.torque_errors for own in identified.values() for score in own]
    return bounds(configuration, seed, np.sqrt(np.mean(np.square(errors), axis=0))) if errors else []


def report_text(result: RobustnessResult, arm: Arm) -> str:
    """The tables as text."""
    every = [score for own in result.wide.values() for score in own]
    after = result.identified.get(MIX, [])
    failures = sorted({f"{score.degradation}: {score.failure}" for score in every if score.failure})
    masses = [score for own in result.masses.values() for score in own]
    rows = required_rows(result.wide, result.second, result.masses, after, result.identifications, result.average)
    evidence = Evidence(
        result.wide, result.second, result.masses, after, result.identifications, result.bounds, result.reference
    )
    named = {
        f"{name}, {how}": own
        for name in result.level
        for how, own in (("as configured", result.level[name]), ("identified", result.identified[name]))
    }
    seconds = {**result.second, "all": [score for own in result.second.values() for score in own]}
    size = SIZE.format(needed=contacts_needed(), quiet=seconds_needed())
    parts = [
        ("Required", required_table(rows)),
        ("What is missed, and why", missed_table(rows, evidence)),
        *(
            [
                (
                    "Compared with the benchmark of an arm as stated",
                    FIRST + "\n\n" + comparison_table(result.first, arm, rows),
                )
            ]
            if result.first
            else []
        ),
        ("Each degradation", f"{size}\n\n{alone_table(result.wide)}"),
        ("Detection", table(DETECTION, result.wide)),
        ("Position on the outer link, and the link", table(POSITION, result.wide)),
        ("By kind of contact and by force, all degradations", kinds_table([*every, *masses])),
        ("Picking up", masses_table(masses)),
        ("Second contact", table(SECOND, seconds)),
        ("After an identification", table(DETECTION, named) + "\n" + table(POSITION, named)),
        ("What is possible at best", OPEN + "\n\n" + markdown(BOUNDS, result.bounds)),
    ]
    text = "\n".join(f"## {head}\n\n{body}" for head, body in parts)
    return "\n".join([text, *(f"\nEnded early: {failure}" for failure in failures)])


def page(text: str, command: str) -> str:
    """The page of the documentation."""
    return "\n\n".join([HEAD.format(command=command), text, METHOD])


HEAD = """# Contact estimation on arms that differ from the model

Written by `{command}`; nothing here is written by hand.

How well the [contact estimator](estimator.md) works on arms, sensors and contacts that it is not made for, in
simulation, from the motors alone: for those who plan to use it on a real arm. What is required and missed comes first,
the tables of each degradation after it. The [benchmark](contact.md) has the arm as the estimator's model states it.

What the estimator assumes is in the section `contact_estimator` of the configuration. What is drawn is in
`wam_studies/contact_robustness/degradations.py` (the arm and its signals) and `touches.py` (the contacts: 1 to
60 N, friction to 0.8, tip, end cap, elbow, two at once, sliding, impacts, masses that are picked up). Neither reads
the other. Every row adds one degradation to friction within 10 % and masses within 2 %; contacts are drawn for each
row.

sd: standard deviation. p: probability of the link, as published. mu: friction coefficient of the contact. Stated: as
the estimator publishes it. 90 % set: the positions that the estimator gives with 90 % probability. Numbers in brackets
are counts. *First version*: what an early version of the estimator had on other recordings. *Realistic mix*: several
degradations at once; *identified*: after `wam identify`."""

SIZE = """With {needed} contacts or more the 95 % interval (Wilson) of a measured 91 % lies within 85 to 97 %; with
fewer a row can only be marginal. Contacts of one arm share its errors, so these intervals are rather too narrow. No
false alarm in {quiet:.0f} s or more shows less than 1 a minute (Poisson). Of twenty rows whose true value is within
the required range, one is outside its interval by chance: the worst of many rows is no measure of all."""

FIRST = f"""The benchmark of [contact.md](contact.md) on the seeds of this page, {EXTENT.contacts} contacts in motion,
{EXTENT.resting} at rest and {EXTENT.free:g} s of free motion of each: there the arm is as the estimator states
it, and the contacts are those of its prior. The quantities are alike, the arms and contacts are not."""

OPEN = """The inference alone, with torques that have the errors of a row and no others, and exactly their covariance;
poses and contacts are drawn as after an identification.

* Friction of the contact is in all rows: four torques do not distinguish it from position and force, however long the
  contact lasts. The first row is that friction alone. It makes the 95 % error; the medians come from the errors of the
  torques.
* The required values above are to be compared with the last three rows. Errors in motion change within some 50 ms, so
  that the moments of 0.2 s are worth about four independent ones (with `inference.fusion_time` 0 one). The last row
  has errors at rest, where stiction hides a force, as frequent as all others; these do not average out.
* The last column is what a threshold detects on torques with these errors: near the shoulder 10 N have hardly a
  moment."""

METHOD = """## Method

* The plant is simulated with the degradation, the contacts are exact forces. Torque constant, torque noise, delay and
  dropped samples change the recorded signals; an error of the centre of mass is in the arm that the estimator is given;
  drift is added Coulomb friction of the joints. The estimator starts with the recording and has 6 s without contact.
* The estimate is evaluated 0.2 s after the start of a contact, if the arm moves then and moved at the start. A contact
  that is missed, has no position or a wrong link has an infinite error, written as inf.
* False alarm: a detection that starts without contact. Warned: fraction of the contact-free time with a warning that
  the model is off. Stated sd: rms over all joints in free motion; 68 % quantile for positions.
* Second contact: other recordings of the same arms, two of five contacts with a second one 0.5 s later, on the same
  link or on the other, of 4 to 60 N; the others are single for 1 s, constant, sliding at 0.2 m/s, or growing to 1.5 to
  3 times their force within 50 to 400 ms. False: reported while there is one, from 0.1 s after its start.
* Picking up: other recordings of the same arms, whose tool carries a mass for 3 of every 6 s of its motion, a point of
  0.1 to 1 kg in the plant's inertia. While it is carried: whether a payload is reported, as hypothesis or warning;
  whether a link that the tool is not on ever has a probability above 0.95; what is reported at the end. By kind above:
  0.2 s after the start, as for contacts; the payload and the tool's link are right.
* After an identification: three more arms of each seed, with contacts of 5, 10 and 20 N on both links. Their models
  come from `wam identify` on 20 s of exciting motion, which has every degradation of the mix but the drift that comes
  after it: torque constant, delay, noise and dropped samples are those of the recording. Friction is that of the
  reported torques, in units of the torque constants as configured: no motion shows the constants apart from it.
* Start in contact: an estimator that starts 0.1 s after the contact, with the model errors known (warm) or
  without (cold), detects it within 0.3 s; contacts of at least 9 N.
"""
