"""Identified against true friction, over kinds of plants and seeds."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np

from wam_analysis.identification.fit import Identification, identify
from wam_analysis.identification.motion import MotionSamples, motion
from wam_analysis.identification.overlay import model_values
from wam_analysis.identification.regressor import Regressor
from wam_analysis.identification.unknowns import DIRECTIONS
from wam_description.configuration import Configuration
from wam_description.mismatch import true_arm
from wam_description.parameters import parameter
from wam_description.rigid_body import Array, RigidBody
from wam_driver.driver import Driver, DriverParameters
from wam_studies.harness import Study
from wam_studies.identification.excitation import moves, path
from wam_studies.identification.plants import EXACT, KINDS, MeasuredSignals, measured_signals, plant, true_friction
from wam_studies.scores import Interval, Row, Scores, by_group, exact, grouped, named, percent, share


@dataclass(frozen=True)
class ComparedAt:
    """Where identified and true friction and gravity are compared."""

    speed: float = 10.0  # rad/s of a motor
    poses: int = 50  # drawn, in which the gravity torque is compared
    signals: int = 1  # stream of random numbers of the measured signals


AT = ComparedAt()


class IdentificationTrial(NamedTuple):
    """A case: one identification from one motion on one plant.

    Attributes
    ----------
    kind, seed : of the plant; the seed also draws the motion.
    seconds : of motion.
    """

    configuration: Configuration
    kind: str
    seed: int
    seconds: float

    def __str__(self) -> str:
        return f"{self.kind}, seed {self.seed}"


class IdentificationResult(NamedTuple):
    """Errors of one identification.

    Attributes
    ----------
    level : (2 n,), friction of each motor and direction at `AT.speed` and its mean load: error per true friction.
    level_sd : (2 n,), stated standard error per true friction.
    coulomb, coulomb_sd : (2 n,), the same of Coulomb friction alone.
    before : (2 n,), error of the present model's friction.
    gravity, gravity_before : rms error of the joints' gravity torque in random poses, N m.
    failure : why the motion ended early, ''.
    """

    kind: str
    seed: int
    level: Array
    level_sd: Array
    coulomb: Array
    coulomb_sd: Array
    before: Array
    gravity: float
    gravity_before: float
    failure: str


def run_trial(trial: IdentificationTrial) -> IdentificationResult:
    """Play the motion on a plant of its own and identify the model from it."""
    configuration = plant(trial.configuration, trial.kind, trial.seed)
    samples, failure = play(configuration, trial.seed, trial.seconds, measured_signals(trial.kind))
    shared = configuration.shared
    found = identify(shared, samples)
    truth = true_friction(configuration)
    regressor = Regressor(shared, found.unknowns, samples)
    # of each motor at each state, (k, n), N m, without and with the friction of own joints
    links, cables = (each.reshape(-1, each.shape[2]) for each in regressor.loads(found.values))
    errors: dict[str, list[Array]] = {name: [] for name in ("level", "level_sd", "coulomb", "coulomb_sd", "before")}
    for way, direction in enumerate(DIRECTIONS):
        moves = (samples.velocities * (1.0 - 2.0 * way) > 0.0).reshape(links.shape)
        rows = friction_row(found, direction, (np.abs(cables) * moves).sum(0) / moves.sum(0))
        true, coulomb = truth.level(way, AT.speed, links, moves), truth.coulomb[way]
        at = found.unknowns.places(f"motors.coulomb_{direction}")
        errors["level"].append((rows @ found.values - true) / true)
        errors["level_sd"].append(np.sqrt(found.uncertainty.variances(rows)) / true)
        errors["before"].append((rows @ found.unknowns.present - true) / true)
        errors["coulomb"].append((found.values[at] - coulomb) / coulomb)
        errors["coulomb_sd"].append(found.sd[at] / coulomb)
    gravity = _gravity_errors(configuration, found)
    joined = {name: np.concatenate(each) for name, each in errors.items()}
    return IdentificationResult(
        trial.kind, trial.seed, **joined, gravity=gravity[0], gravity_before=gravity[1], failure=failure
    )


def play(
    configuration: Configuration, seed: int, seconds: float, signals: MeasuredSignals = EXACT
) -> tuple[MotionSamples, str]:
    """Samples of the exciting motion on the plant of a configuration, as measured, and why it ended early, ''.

    The motors follow the moves with the gains of the velocity loop, without the nodes, which take most of the time.
    """
    shared = configuration.shared
    driver = Driver(shared, configuration.node("driver", DriverParameters))
    driver.safety.enable("")
    period, matrix = shared.timing.period, shared.arm.transmission.joint_from_motor
    k_p, k_i = (np.array(gain) for gain in (shared.servo.proportional_gain, shared.servo.integral_gain))
    body, inverse = RigidBody(shared.model_arm), np.linalg.inv(matrix)
    stamps, rows = [], []
    posture = np.array(shared.arm.joints.start)
    for move in moves(configuration, seed, seconds):
        points = path(posture, move, period)
        posture = np.array(move.posture)
        desired = zip(points.q @ inverse.T, points.qd @ inverse.T, points.q, strict=True)
        for theta, thetad, q in desired:
            at, velocity, effort = driver.motor_state
            stamps.append(driver.stamp / 1e9)
            rows.append((*at, *effort))
            torque = k_p * (thetad - velocity) + k_i * (theta - at) + body.gravity_torque(q) @ matrix
            driver.command(driver.stamp, (torque / shared.arm.motors.torque_constant).tolist())
            driver.advance(0.0)
            if driver.safety.fault:
                break
    n, values = len(matrix), np.array(rows)
    torque, arrives = signals.of(values[:, n:], np.random.Generator(np.random.PCG64([seed, AT.signals])))
    return motion(np.array(stamps)[arrives], values[arrives, :n], torque[arrives]), driver.safety.fault


def friction_row(found: Identification, direction: str, load: Array) -> Array:
    """(n, p), friction of each motor at `AT.speed` and these loads, N m, per parameter."""
    unknowns, n = found.unknowns, len(load)
    rows = np.zeros((n, len(unknowns.names)))
    rows[range(n), unknowns.places(f"motors.coulomb_{direction}")] = 1.0
    rows[range(n), unknowns.places(f"motors.load_{direction}")] = load
    rows[range(n), unknowns.places("motors.viscous")] = AT.speed
    return rows


def _gravity_errors(configuration: Configuration, found: Identification) -> tuple[float, float]:
    """Rms error of the gravity torque by the identified and by the present model, N m."""
    shared = configuration.shared
    truth = RigidBody(true_arm(shared.arm, configuration.node("driver", DriverParameters).mismatch))
    identified = configuration.with_values(model_values(shared, found, "evaluation")).shared
    joints = shared.arm.joints
    random = np.random.Generator(np.random.PCG64(1))
    poses = random.uniform(joints.lower, joints.upper, (AT.poses, len(joints.names)))

    def error(body: RigidBody) -> float:
        left = [body.gravity_torque(q) - truth.gravity_torque(q) for q in poses]
        return float(np.sqrt(np.mean(np.square(left))))

    return error(RigidBody(identified.model_arm)), error(RigidBody(shared.model_arm))


@dataclass(frozen=True)
class IdentificationLimits:
    """What is required of the errors of a motor's friction."""

    required: float = 0.04
    target: float = 0.02
    factor: float = 2.0  # between errors and stated standard errors


LIMITS = IdentificationLimits()


@dataclass(frozen=True)
class IdentificationStudy(Study[IdentificationTrial, IdentificationResult]):
    """Every kind of plant with every seed."""

    title = "identified and true friction of many plants"
    page = "docs/identify.md"

    seconds: float = parameter("length of each motion", "s", low=20.0, default=60.0)

    def cases(self, seed: int) -> list[IdentificationTrial]:
        """Each kind of plant."""
        return [IdentificationTrial(self.configuration, kind, seed, self.seconds) for kind in KINDS]

    run = staticmethod(run_trial)

    def score(self, records: Sequence[IdentificationResult]) -> Scores:
        """Errors of all plants, errors by stated ones of each kind, and all of each kind as a table."""
        kinds = grouped(records, lambda one: one.kind)
        ratios = chain.from_iterable(named(map(_ratio, _errors(own)), kind) for kind, own in kinds.items())
        return Scores([*_rows(records), *ratios], [by_group("By kind of plant", kinds, _rows)])


class _Errors(NamedTuple):
    """Errors of a kind of friction, and those that were stated."""

    name: str
    errors: Array
    stated: Array


def _errors(records: Sequence[IdentificationResult]) -> Iterator[_Errors]:
    """Errors of friction, and of Coulomb friction alone."""
    for name, kind in (("friction", "level"), ("Coulomb friction alone", "coulomb")):
        yield _Errors(name, *(np.concatenate([getattr(one, f"{kind}{end}") for one in records]) for end in ("", "_sd")))


def _ratio(one: _Errors) -> Row:
    """Errors by stated ones."""
    allowed = 1.0 / LIMITS.factor, LIMITS.factor
    return Row(f"{one.name}, error / standard error, rms", _rms(one.errors / one.stated), required=allowed)


def _rows(records: Sequence[IdentificationResult]) -> Iterator[Row]:
    """Errors of friction, of Coulomb friction alone and of gravity."""
    for one in _errors(records):
        name, errors = one.name, one.errors
        beyond, largest = np.abs(errors / one.stated) > 2.0, exact(float(np.abs(errors).max()), len(errors))
        yield percent(f"{name}, error, rms", _rms(errors))
        yield percent(f"{name}, largest error", largest, (0.0, LIMITS.required), (0.0, LIMITS.target))
        yield _ratio(one)
        yield percent(f"{name}, beyond twice its standard error", share(int(beyond.sum()), len(errors)))
    yield percent("friction error before, rms", _rms(np.concatenate([one.before for one in records])))
    yield Row("gravity error, rms", _rms(np.array([one.gravity for one in records])), "N m")
    yield Row("gravity error before, rms", _rms(np.array([one.gravity_before for one in records])), "N m")


def _rms(values: Array) -> Interval:
    return exact(math.sqrt(float(np.mean(np.square(values)))), len(values))
