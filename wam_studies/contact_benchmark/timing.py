"""Computing time of the estimator, relative to a fixed workload on the same computer in the same run."""

import math
from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference
from wam_control.contact.momentum_observer import MomentumObserver
from wam_description.arm import seconds
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_sim.simulation import Simulation
from wam_studies.contact_benchmark.scenarios import BenchmarkScenario

SOLVES = 10
INFERENCE_LIMIT, UPDATE_LIMIT, AVERAGE_LIMIT = 75e-6, 125e-6, 100e-6  # s


class EstimatorTimes(NamedTuple):
    """Shortest time of all calls, s.

    Attributes
    ----------
    observe : one sample into the observer during contact.
    infer : the inference alone.
    estimate : one estimate during contact: covariance, detection, inference.
    divisor : samples per estimate.
    reference : ten solutions of a 4 x 4 system by NumPy.
    """

    observe: float
    infer: float
    estimate: float
    divisor: int
    reference: float


def times(configuration: Configuration, scenario: BenchmarkScenario) -> EstimatorTimes:
    """Run an estimator on the recorded input of a scenario with contacts."""
    configured = configuration.with_values(scenario.values)
    shared = configured.shared
    run = Simulation(configured, scenario.steps)
    run.play()
    own = configured.node("contact_estimator", ContactEstimatorParameters)
    estimator = ContactEstimator(shared.arm, shared.timing, own)
    observer = MomentumObserver(shared.arm, own.observer, own.use_joint_sensors, shared.timing.dither_cycle)
    inference = ContactInference(shared.arm, RigidBody(shared.arm, own.observer.mass_scale), own.inference)
    n, period = len(shared.arm.motors.names), seconds(shared.timing.period_ns)
    sensors = run.rows.get("joint_sensors", run.rows["motor_states"])
    observed, inferred, estimated = [], [], []
    in_contact = False  # only in contact is the observer sure to do all of its work: with brakes on it rests
    for motor, sensor in zip(run.rows["motor_states"], sensors, strict=True):
        states = [State(*(list(row.values[i * n : i * n + n]) for i in range(3))) for row in (motor, sensor)]
        begin = perf_counter()
        estimator.observe(states[0], states[1], period)
        middle = perf_counter()
        observer.observe(states[own.use_joint_sensors], period)
        if in_contact:
            observed.append(middle - begin)
        if shared.timing.is_outer(motor.stamp):
            begin = perf_counter()
            in_contact = estimator.estimate().in_contact
            end = perf_counter()
            if in_contact:
                estimated.append(end - begin)
                inferred.append(_inference_time(inference, observer))
    observe, infer, estimate = (min(found, default=float("nan")) for found in (observed, inferred, estimated))
    return EstimatorTimes(observe, infer, estimate, shared.timing.outer_divisor, reference_time())


def _inference_time(inference: ContactInference, observer: MomentumObserver) -> float:
    torques, covariance = observer.torques()
    precision = np.asarray(np.linalg.inv(covariance), np.float64)
    begin = perf_counter()
    inference.infer(observer.q, torques, precision)
    return perf_counter() - begin


def reference_time() -> float:
    """Time of the fixed workload, s: ten solutions of a 4 x 4 system by NumPy."""
    matrix, vector = np.eye(4) + 0.1, np.ones(4)
    return _best(lambda: _solve(matrix, vector))


def _solve(matrix: np.ndarray, vector: np.ndarray) -> None:
    for _ in range(SOLVES):
        np.linalg.solve(matrix, vector)


def _best(work: Callable[[], None]) -> float:
    best = float("inf")
    for _ in range(500):
        begin = perf_counter()
        work()
        best = min(best, perf_counter() - begin)
    return best


def section(found: EstimatorTimes) -> str:
    """The times as a section of the page, for information."""
    rows = (
        ("a sample into the observer", found.observe, math.nan),
        ("the inference", found.infer, INFERENCE_LIMIT),
        ("an estimate: covariance, detection, inference", found.estimate, math.nan),
        ("whole update: a sample and an estimate", found.observe + found.estimate, UPDATE_LIMIT),
        ("whole update, average over all periods", found.observe + found.estimate / found.divisor, AVERAGE_LIMIT),
    )
    lines = [
        "## Computing time",
        "",
        markdown(
            ("during contact, shortest of all calls in one scenario", "us", "required", "ratio to the reference"),
            [
                (
                    name,
                    f"{1e6 * time:.0f}",
                    "" if math.isnan(limit) else f"{1e6 * limit:.0f}",
                    f"{time / found.reference:.2f}",
                )
                for name, time, limit in rows
            ],
        ),
        f"The reference, in the same run: ten solutions of a 4 x 4 system by NumPy, {1e6 * found.reference:.0f} us.",
        "Compare computers by the ratio; the microseconds are those of this computer, under other load.",
    ]
    return "\n".join(lines)
