"""How long the estimator takes, beside a fixed workload on the same machine in the same run."""

import math
from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np

from wam_analysis.contact_battery.scenes import Scene
from wam_analysis.direct import DirectRun
from wam_control.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.contact_inference import ContactInference
from wam_control.momentum_observer import MomentumObserver
from wam_description.arm import seconds
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_description.signals import State

SOLVES = 10
MUST_INFERENCE, MUST_WHOLE, MUST_AVERAGE = 75e-6, 125e-6, 100e-6  # s


class Times(NamedTuple):
    """Best of all calls, s.

    Attributes
    ----------
    observe : one sample into the observer while something touches.
    infer : the inference alone.
    estimate : one answer while something touches: covariance, detection, inference.
    divisor : samples for each answer.
    reference : ten solutions of a 4 x 4 system by NumPy.
    """

    observe: float
    infer: float
    estimate: float
    divisor: int
    reference: float


def times(configuration: Configuration, scene: Scene) -> Times:
    """Let an estimator see again what a scene with contacts gave it, and take the time."""
    configured = configuration.with_values(scene.values)
    shared = configured.shared
    run = DirectRun(configured, scene.steps)
    run.play()
    own = configured.node("contact_estimator", ContactEstimatorParameters)
    estimator = ContactEstimator(shared.arm, shared.timing, own)
    observer = MomentumObserver(shared.arm, own.observer, own.use_joint_sensors, shared.timing.dither_cycle)
    inference = ContactInference(shared.arm, RigidBody(shared.arm, own.observer.mass_scale), own.inference)
    n, period = len(shared.arm.motors.names), seconds(shared.timing.period_ns)
    sensors = run.rows.get("joint_sensors", run.rows["motor_states"])
    observed, inferred, estimated = [], [], []
    touched = False  # only then does the observer surely do all of its work: brakes would make it rest
    for motor, sensor in zip(run.rows["motor_states"], sensors, strict=True):
        states = [State(*(list(row.values[i * n : i * n + n]) for i in range(3))) for row in (motor, sensor)]
        begin = perf_counter()
        estimator.observe(states[0], states[1], period)
        middle = perf_counter()
        observer.observe(states[own.use_joint_sensors], period)
        if touched:
            observed.append(middle - begin)
        if shared.timing.is_outer(motor.stamp):
            begin = perf_counter()
            touched = estimator.estimate().in_contact
            end = perf_counter()
            if touched:
                estimated.append(end - begin)
                inferred.append(_seconds_of_inference(inference, observer))
    matrix, vector = np.eye(4) + 0.1, np.ones(4)
    observe, infer, estimate = (min(found, default=float("nan")) for found in (observed, inferred, estimated))
    return Times(observe, infer, estimate, shared.timing.outer_divisor, _best(lambda: _solve(matrix, vector)))


def _seconds_of_inference(inference: ContactInference, observer: MomentumObserver) -> float:
    torques, covariance = observer.torques()
    precision = np.asarray(np.linalg.inv(covariance), np.float64)
    begin = perf_counter()
    inference.infer(observer.q, torques, precision)
    return perf_counter() - begin


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


def section(found: Times) -> str:
    """The times as a part of the page; nothing depends on them."""
    rows = (
        ("a sample into the observer", found.observe, math.nan),
        ("the inference", found.infer, MUST_INFERENCE),
        ("an answer: covariance, detection, inference", found.estimate, math.nan),
        ("whole update: a sample and an answer", found.observe + found.estimate, MUST_WHOLE),
        ("whole update, average over all periods", found.observe + found.estimate / found.divisor, MUST_AVERAGE),
    )
    lines = [
        "## Compute",
        "",
        "| while something touches, best of all calls in one scene | us | must | times the reference |",
        "| --- | --- | --- | --- |",
        *(
            f"| {name} | {1e6 * time:.0f} | {'' if math.isnan(must) else f'{1e6 * must:.0f}'} |"
            f" {time / found.reference:.2f} |"
            for name, time, must in rows
        ),
        "",
        f"The reference, in the same run: ten solutions of a 4 x 4 system by NumPy, {1e6 * found.reference:.0f} us.",
        "The ratio is what another machine has to have; microseconds are this one's, on which other work ran.",
    ]
    return "\n".join(lines)
