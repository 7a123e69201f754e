"""Computing time of the contact estimator in contact, relative to a fixed workload in the same run."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from comparing import Quartiles, arguments, machine, quartiles, ratios, save, table

from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference
from wam_control.contact.momentum_observer import MomentumObserver
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.transmission_map import TransmissionMap

POSE = (0.1, -1.05, 0.3, 0.5)  # rad
SPEED = (1.0, -1.2, 2.0, 1.5)  # rad/s of the motors
POSITION, FORCE = 0.28, (0.0, 8.0, 6.0)  # m, N, of a push on the outer link, in the base frame
PERIOD = 1e-3


def reference(body: RigidBody) -> Callable[[], object]:
    """A fixed workload of the same kind: rigid-body algorithms, small matrices, scalar Python."""
    matrix = np.diag((1.0, 2.0, 3.0, 4.0))

    def work() -> object:
        inertia = body.mass_matrix(POSE) + matrix
        gravity = body.gravity_torque(POSE)
        solved = np.linalg.solve(inertia, gravity).tolist()
        return sum([a * b for a in solved for b in solved])

    return work


def pushed_observer(arm: Arm, parameters: ContactEstimatorParameters) -> tuple[MomentumObserver, State]:
    """An observer of the moving arm under a push, and its input."""
    transmission = TransmissionMap.of(arm)
    observer = MomentumObserver(arm, parameters.observer, use_joint_sensors=False)
    body = RigidBody(arm, parameters.observer.mass_scale)
    levers = body.point_jacobian(POSE, arm.covers.names[-1], (POSITION, 0.0, 0.0))
    torque = body.gravity_torque(POSE) - levers.T @ np.array(FORCE)
    state = State(transmission.motor_positions(POSE), list(SPEED), transmission.motor_torques(torque.tolist()))
    for _ in range(200):
        observer.observe(state, PERIOD)
    return observer, state


def best(work: Callable[[], object], count: int) -> float:
    """Seconds of one call, the shortest of some tries, to exclude other load."""
    tries = []
    for _ in range(5):
        begin = time.perf_counter()
        for _ in range(count):
            work()
        tries.append((time.perf_counter() - begin) / count)
    return min(tries)


def main() -> None:
    """Measure in turns, print the table."""
    given = arguments(__doc__, rounds=7, quick_rounds=1)
    configuration = Configuration.load(packaged("wam")).with_values({"contact_estimator:use_joint_sensors": False})
    arm, timing = configuration.shared.arm, configuration.shared.timing
    parameters = configuration.node("contact_estimator", ContactEstimatorParameters)
    observer, state = pushed_observer(arm, parameters)
    estimator = ContactEstimator(arm, timing, parameters)
    for _ in range(200):
        estimator.observe(state, None, PERIOD)
    if not estimator.estimate().in_contact:
        raise SystemExit("the push is not detected: the benchmark would measure free motion")
    torques, covariance = observer.torques()
    precision = np.linalg.inv(covariance)
    inference = ContactInference(arm, RigidBody(arm), parameters.inference)
    works: dict[str, Callable[[], object]] = {
        "reference": reference(RigidBody(arm)),
        "observe": lambda: observer.observe(state, PERIOD),
        "infer": lambda: inference.infer(POSE, torques, precision),
        "estimate": estimator.estimate,
    }
    count = 20 if given.quick else 300
    times: dict[str, list[float]] = {name: [] for name in (*works, "update")}
    for _ in range(given.rounds):
        for name, work in works.items():
            times[name].append(best(work, count))
        times["update"].append(times["observe"][-1] + times["estimate"][-1])
    rows, measured = [], dict[str, Any]()
    for name in ("observe", "infer", "estimate", "update"):
        microseconds: Quartiles = quartiles([1e6 * value for value in times[name]])
        ratio = ratios(times[name], times["reference"])
        rows.append([name, f"{microseconds:.1f}", f"{ratio:.2f}"])
        measured[name] = {"microseconds": microseconds, "reference_ratio": ratio}
    print(machine())
    print(table(["contact estimator", "us (middle half)", "ratio to the reference"], rows))
    save("contact", given, measured)


if __name__ == "__main__":
    main()
