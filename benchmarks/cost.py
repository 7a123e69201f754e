"""What the code of a control period costs: parts of a direct run, and the contact estimator over a fixed workload."""

import json
import sys
import time
import timeit
from collections import Counter
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

import numpy as np
from bench import Benchmark, Ratio, Values
from simulation import ROOT, by_packages_of, scenario_steps

from wam_description.configuration import Configuration, packaged
from wam_description.interface import declared
from wam_description.rigid_body import RigidBody
from wam_sim.simulation import Simulation

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
        raise RuntimeError(failure)
    wall, own = time.perf_counter() - wall, time.process_time() - own
    if not classes and not methods:
        spent[WHOLE] = wall
    periods = run.driver.stamp / configuration.shared.timing.period_ns
    # what others ran meanwhile is taken off every part alike: reading the processor time costs more than some parts
    return Counter({part: 1e6 * own / wall * seconds / periods for part, seconds in spent.items()})


def parts_here(length: float) -> Values:
    """The whole without clocks in it, its parts in runs of their own, in turns."""
    configuration = Configuration.load(packaged("wam")).with_values({"timing.mode": "lockstep"})
    whole = play(configuration, length, (), {})
    nodes = play(configuration, length, NODES, DRIVER)
    nodes[REST] = max(whole[WHOLE] - sum(nodes.values()), 1e-9)
    return {**whole, **nodes, **play(configuration, length, (), WITHIN)}


def parts(quick: bool) -> Values:
    """Microseconds per period in plain Python: a compiled method cannot be timed from outside."""
    return by_packages_of(ROOT, __file__, 1.0 if quick else 5.0)


PARTS = Benchmark(
    parts, "us of a period", [Ratio(name) for name in (WHOLE, "driver", *NODES, TRUTH, REST, *WITHIN)], rounds=15
)

POSE = (0.1, -1.05, 0.3, 0.5)  # rad
FIXED, UPDATE = "fixed workload", "contact_estimator"


def fixed_workload(body: RigidBody) -> Callable[[], object]:
    """Work of the same kind: rigid-body algorithms, small matrices, scalar Python."""
    matrix = np.diag((1.0, 2.0, 3.0, 4.0))

    def work() -> object:
        solved = np.linalg.solve(body.mass_matrix(POSE) + matrix, body.gravity_torque(POSE)).tolist()
        return sum([a * b for a in solved for b in solved])

    return work


def estimator(quick: bool) -> Values:
    """Microseconds of a period of the contact estimator's node during a contact, and of the fixed workload."""
    spent: Spent = Counter()
    motors_alone = {"timing.mode": "lockstep", "contact_estimator:use_joint_sensors": False}
    configuration = Configuration.load(packaged("wam")).with_values(motors_alone)
    classes = {UPDATE: timed_class(spent, UPDATE)}
    run = Simulation(configuration, scenario_steps(5.0, configuration.shared), classes)
    while not run.estimate.in_contact:
        if run.step():
            raise RuntimeError("the push is not detected: the benchmark would measure free motion")
    spent.clear()
    periods = 0
    while run.estimate.in_contact and not (quick and periods == 20):
        run.step()
        periods += 1
    work, count = fixed_workload(RigidBody(configuration.shared.arm)), 20 if quick else 300
    return {FIXED: 1e6 * min(timeit.repeat(work, number=count)) / count, UPDATE: 1e6 * spent[UPDATE] / periods}


ESTIMATOR = Benchmark(estimator, "contact estimator in contact, us of a period", [Ratio(UPDATE, FIXED)], rounds=7)


if __name__ == "__main__":
    print(json.dumps(parts_here(float(sys.argv[1]))))
