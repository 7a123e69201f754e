"""What the code of a control period costs: parts of a direct run, and the contact estimator over a fixed workload."""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

import numpy as np
from bench import Benchmark, Measured, Row
from simulation import scenario_steps

from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference
from wam_control.contact.momentum_observer import MomentumObserver
from wam_description.arm import Arm
from wam_description.configuration import Configuration, packaged
from wam_description.interface import declared
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.transmission_map import TransmissionMap
from wam_sim.simulation import Simulation

# parts of a direct run

NODES = ("contact_estimator", "force_loop", "velocity_loop", "transform", "gravity", "scenario")
WITHIN = {  # methods of an object of the simulation, by part
    "driver: substeps": ("driver.plant", "step"),
    "driver: measuring": ("driver", "_measure"),
    "driver: limits": ("driver", "_watch_limits"),
    "driver: amplifier": ("driver.amplifier", "step"),
    "contact_estimator: observe": ("nodes.contact_estimator._estimator", "observe"),
    "contact_estimator: estimate": ("nodes.contact_estimator._estimator", "estimate"),
}
WHOLE, TRUTH, REST = "whole", "true state", "bus, synchronisers, scheduling"
DRIVER = {"driver": ("driver", "advance"), TRUTH: ("driver", "outer_values")}
Spent = Counter[str]


def timed(spent: Spent, part: str, work: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose time counts for a part, s."""

    @wraps(work)
    def call(*given: Any) -> Any:
        begin = time.perf_counter()
        result = work(*given)
        spent[part] += time.perf_counter() - begin
        return result

    return call


def timed_class(spent: Spent, name: str) -> Any:
    """A node of the stack whose steps are timed."""
    kind = declared(name).node
    steps = {step: value for step in dir(kind) if hasattr(value := getattr(kind, step), "reaction")}
    body = {step: timed(spent, name, value) for step, value in steps.items()}
    return type(kind.__qualname__, (kind,), {**body, "__module__": kind.__module__})


def play(configuration: Configuration, length: float, nodes: tuple[str, ...], methods: Mapping[str, Any]) -> Spent:
    """Microseconds per period of some nodes and methods; without any, of the whole."""
    spent: Spent = Counter()
    classes = {name: timed_class(spent, name) for name in nodes}
    run = Simulation(configuration, scenario_steps(length, configuration.shared), classes)
    for part, (path, name) in methods.items():
        owner: Any = run
        for step in filter(None, path.split(".")):
            owner = owner[step] if isinstance(owner, dict) else getattr(owner, step)
        setattr(owner, name, timed(spent, part, getattr(owner, name)))
    wall, own = time.perf_counter(), time.process_time()
    if failure := run.play():
        raise SystemExit(failure)
    wall, own = time.perf_counter() - wall, time.process_time() - own
    if not classes and not methods:
        spent[WHOLE] = wall
    periods = run.driver.stamp / configuration.shared.timing.period_ns
    # what others ran meanwhile is taken off every part alike: reading the processor time costs more than some parts
    return Counter({part: 1e6 * own / wall * seconds / periods for part, seconds in spent.items()})


def parts(quick: bool) -> Measured:
    """Microseconds per period; the whole without clocks in it, its parts in runs of their own, in turns."""
    configuration = Configuration.load(packaged("wam")).with_values({"timing.mode": "lockstep"})
    length = 1.0 if quick else 5.0
    while True:
        whole = play(configuration, length, (), {})
        nodes = play(configuration, length, NODES, DRIVER)
        nodes[REST] = max(whole[WHOLE] - sum(nodes.values()), 1e-9)
        yield {**whole, **nodes, **play(configuration, length, (), WITHIN)}


PARTS = Benchmark(
    parts, "us of a period", [Row(name) for name in (WHOLE, "driver", *NODES, TRUTH, REST, *WITHIN)], rounds=15
)

# the contact estimator, of a moving arm that is pushed

POSE = (0.1, -1.05, 0.3, 0.5)  # rad
SPEED = (1.0, -1.2, 2.0, 1.5)  # rad/s of the motors
PUSH = (0.28, (0.0, 8.0, 6.0))  # m along the outer link; N in the base frame
WARM_UP = 200  # periods, until the push is detected
FIXED = "fixed workload"


def fixed_workload(body: RigidBody) -> Callable[[], object]:
    """Work of the same kind: rigid-body algorithms, small matrices, scalar Python."""
    matrix = np.diag((1.0, 2.0, 3.0, 4.0))

    def work() -> object:
        solved = np.linalg.solve(body.mass_matrix(POSE) + matrix, body.gravity_torque(POSE)).tolist()
        return sum([a * b for a in solved for b in solved])

    return work


def pushed_state(arm: Arm, mass_scale: Any) -> State:
    """Motor positions, velocities and torques of the pushed arm."""
    transmission, body, (position, force) = TransmissionMap.of(arm), RigidBody(arm, mass_scale), PUSH
    levers = body.point_jacobian(POSE, arm.covers.names[-1], (position, 0.0, 0.0))
    torque = body.gravity_torque(POSE) - levers.T @ np.array(force)
    return State(transmission.motor_positions(POSE), list(SPEED), transmission.motor_torques(torque.tolist()))


def shortest(work: Callable[[], object], count: int) -> float:
    """Microseconds of one call, the shortest of some tries, to exclude other load."""
    tries = []
    for _ in range(5):
        begin = time.perf_counter()
        for _ in range(count):
            work()
        tries.append(1e6 * (time.perf_counter() - begin) / count)
    return min(tries)


def estimator(quick: bool) -> Measured:
    """Microseconds of the observer, the inference, the estimate, and a whole update in contact."""
    configuration = Configuration.load(packaged("wam")).with_values({"contact_estimator:use_joint_sensors": False})
    arm, timing = configuration.shared.arm, configuration.shared.timing
    parameters = configuration.node("contact_estimator", ContactEstimatorParameters)
    state, period = pushed_state(arm, parameters.observer.mass_scale), timing.period
    observer = MomentumObserver(arm, parameters.observer, use_joint_sensors=False)
    whole = ContactEstimator(arm, timing, parameters)
    for _ in range(WARM_UP):
        observer.observe(state, period)
        whole.observe(state, None, period)
    if not whole.estimate().in_contact:
        raise SystemExit("the push is not detected: the benchmark would measure free motion")
    torques, covariance = observer.torques()
    precision = np.linalg.inv(covariance)
    inference = ContactInference(arm, RigidBody(arm), parameters.inference)
    works: dict[str, Callable[[], object]] = {
        FIXED: fixed_workload(RigidBody(arm)),
        "observe": lambda: observer.observe(state, period),
        "infer": lambda: inference.infer(POSE, torques, precision),
        "estimate": whole.estimate,
    }
    while True:
        found = {name: shortest(work, 20 if quick else 300) for name, work in works.items()}
        yield {**found, "update": found["observe"] + found["estimate"]}


ESTIMATOR = Benchmark(
    estimator,
    "contact estimator in contact, us",
    [Row(name, FIXED) for name in ("observe", "infer", "estimate", "update")],
    rounds=7,
)
