"""How long the estimator takes, beside a fixed workload on the same machine in the same run."""

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np

from wam_analysis.contact_battery.scenes import Scene
from wam_analysis.direct import DirectRun
from wam_control.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_description.arm import seconds
from wam_description.configuration import Configuration
from wam_description.signals import State

SOLVES = 10
MUST_INFERENCE, MUST_WHOLE = 75e-6, 125e-6  # s


class Times(NamedTuple):
    """Best of all calls, s.

    Attributes
    ----------
    observe : one sample into the observer while something touches.
    estimate : one answer while something touches: covariance, detection, inference.
    reference : ten solutions of a 4 x 4 system by NumPy.
    """

    observe: float
    estimate: float
    reference: float


def times(configuration: Configuration, scene: Scene) -> Times:
    """Let an estimator see again what a scene with contacts gave it, and take the time."""
    configured = configuration.with_values(scene.values)
    shared = configured.shared
    run = DirectRun(configured, scene.steps)
    run.play()
    own = configured.node("contact_estimator", ContactEstimatorParameters)
    estimator = ContactEstimator(shared.arm, shared.timing, own)
    n, period = len(shared.arm.motors.names), seconds(shared.timing.period_ns)
    sensors = run.rows.get("joint_sensors", run.rows["motor_states"])
    observed, estimated = [], []
    touched = False  # only then does the observer surely do all of its work: brakes would make it rest
    for motor, sensor in zip(run.rows["motor_states"], sensors, strict=True):
        states = [State(*(list(row.values[i * n : i * n + n]) for i in range(3))) for row in (motor, sensor)]
        begin = perf_counter()
        estimator.observe(states[0], states[1], period)
        middle = perf_counter()
        if touched:
            observed.append(middle - begin)
        if shared.timing.is_outer(motor.stamp):
            touched = estimator.estimate().in_contact
            if touched:
                estimated.append(perf_counter() - middle)
    matrix, vector = np.eye(4) + 0.1, np.ones(4)
    return Times(
        min(observed, default=float("nan")), min(estimated, default=float("nan")), _best(lambda: _solve(matrix, vector))
    )


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


def sentence(found: Times) -> str:
    """The times in words; nothing depends on them."""
    whole = found.observe + found.estimate
    return (
        f"Compute, best of all calls in one scene: a sample into the observer {1e6 * found.observe:.0f} us, an answer "
        f"with inference {1e6 * found.estimate:.0f} us (must {1e6 * MUST_INFERENCE:.0f}), both {1e6 * whole:.0f} us "
        f"(must {1e6 * MUST_WHOLE:.0f}); that is {found.observe / found.reference:.1f}, "
        f"{found.estimate / found.reference:.1f} and {whole / found.reference:.1f} times ten solutions of a "
        f"4 x 4 system by NumPy, {1e6 * found.reference:.0f} us in the same run. Stated, not judged."
    )
