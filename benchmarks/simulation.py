"""The run without ROS and what is within it: plant, compiled inner loop, parts of a period, contact, stability map."""

import filecmp
import hashlib
import json
import math
import os
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache, wraps
from pathlib import Path
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
import yaml
from bench import Benchmark, Measured, Row

from wam_control.contact.contact_estimator import ContactEstimator, ContactEstimatorParameters
from wam_control.contact.contact_inference import ContactInference
from wam_control.contact.momentum_observer import MomentumObserver
from wam_control.task.scenario import ScenarioStep, load
from wam_description.arm import Arm, Shared
from wam_description.configuration import Configuration, packaged
from wam_description.interface import declared
from wam_description.mjcf import mjcf
from wam_description.rigid_body import RigidBody
from wam_description.signals import State
from wam_description.transmission_map import TransmissionMap
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant
from wam_sim.simulation import Simulation
from wam_theory.stability_map import largest_stable_steps
from wam_theory.stick_slip import FrictionNode, IntegralLoop, largest_stable_step

ROOT = Path(__file__).resolve().parents[1]


def scenario(seconds: float) -> dict[str, Any]:
    """A short form of the demonstration, of `seconds` in total."""
    push = {
        "cover": "outer_link", "contact_position": 0.28, "newtons": [0.0, 12.0, 0.0], "begin": 0.1,
        "end": 0.3 * seconds,
    }  # fmt: skip
    return {
        "steps": [
            {"name": "release", "seconds": 0.1 * seconds, "request": "enable"},
            {"name": "move", "seconds": 0.4 * seconds, "posture": [0.0, -0.8, 0.0, 0.3]},
            {"name": "be pushed", "seconds": 0.4 * seconds, "posture": [0.1, -0.9, 0.0, 0.5], "push": push},
            {"name": "brake", "seconds": 0.1 * seconds, "request": "disable"},
        ]
    }


def scenario_steps(seconds: float, shared: Shared) -> list[ScenarioStep]:
    """The steps of `scenario`, as the scenario node has them."""
    with tempfile.TemporaryDirectory(prefix="wam_bench_") as folder:
        script = Path(folder) / "script.yaml"
        script.write_text(yaml.safe_dump(scenario(seconds)), encoding="utf-8")
        return load(script, shared)


# the plant

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
FREE = (0.0, -0.6, 0.0, 0.5)  # rad
PUSH = (np.array([0.0, 12.0, 0.0]), np.array([0.0, 0.0, 12.0 * 0.28]))  # N, N m
STEPS = 40  # measured together: short, so that the state stays what it is


class Case:
    """The plant and its bare MuJoCo model in one state.

    Parameters
    ----------
    q : pose at the start, rad.
    extra : torque of each motor in addition to gravity compensation, N m.
    pushed : whether a disturbance pushes on the last link.
    name : of the configuration.
    values : overrides of it.
    """

    def __init__(
        self,
        q: tuple[float, ...],
        extra: float,
        pushed: bool = False,
        name: str = "wam",
        values: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        configuration = Configuration.load(packaged(name)).with_values({"arm.joints.start": q, **values})
        arm, step = configuration.shared.arm, configuration.shared.timing.substep
        parameters = configuration.node("driver", DriverParameters)
        self._together = configuration.shared.timing.substeps
        self.plant = Plant(arm, parameters.world, parameters.effects, step)
        self.bare = mujoco.MjModel.from_xml_string(mjcf(arm, step, parameters.world, parameters.effects))
        self.data = mujoco.MjData(self.bare)
        gravity = RigidBody(arm).gravity_torque(q).tolist()
        self.torque = [tau + extra for tau in TransmissionMap.of(arm).motor_torques(gravity)]
        self.plant.brake(False)
        if pushed:
            self.plant.push(arm.covers.names[-1], *PUSH)
        self._steps(20)
        self._state = np.empty(mujoco.mj_stateSize(self.bare, STATE))
        mujoco.mj_getState(self.plant.model, self.plant.data, self._state, STATE)

    def _steps(self, count: int) -> None:
        for _ in range(count // self._together):  # as the driver does
            self.plant.step(self.torque, self._together)

    def _bare_steps(self, count: int) -> None:
        for _ in range(count):
            mujoco.mj_step(self.bare, self.data)

    def measure(self) -> tuple[float, float]:
        """Microseconds a step, of the plant and of the bare model, from the same state."""
        mujoco.mj_setState(self.plant.model, self.plant.data, self._state, STATE)
        self.bare.dof_frictionloss[:] = self.plant.model.dof_frictionloss
        mujoco.mj_setState(self.bare, self.data, self._state, STATE)
        plant, bare = (1e6 * seconds(lambda work=work: work(STEPS)) for work in (self._steps, self._bare_steps))
        return plant / STEPS, bare / STEPS


def seconds(work: Callable[[], object]) -> float:
    """How long it takes on the wall clock."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


# everything that the plant can do at once, in addition to what is always on
EVERY_EFFECT = {
    "driver:effects.tension_friction": (1e-5,) * 4,
    "driver:effects.added_coulomb_friction": (0.1,) * 4,
    "driver:effects.ripples.amplitude": (0.01,) * 4,
}


def pose_in_contact() -> tuple[float, ...]:
    """Where the outer link just touches the box on the demonstration's way down, rad."""
    steps = load(packaged("demo_scenario"), Configuration.load(packaged("wam")).shared)
    i = next(i for i, step in enumerate(steps) if step.until_force > 0.0)
    above, below = np.array(steps[i - 1].posture), np.array(steps[i].posture)
    for share in np.linspace(0.0, 1.0, 51):
        pose = tuple((above + share * (below - above)).tolist())
        if Case(pose, 0.0).plant.data.ncon:
            return pose
    raise SystemExit("the demonstration's way down does not touch the box; look at config/demo_scenario.yaml")


CASES = {
    "arm free, moving": lambda: Case(FREE, extra=0.2),
    "arm free, pushed": lambda: Case(FREE, extra=0.2, pushed=True),
    "arm, every effect on": lambda: Case(FREE, extra=0.2, values=EVERY_EFFECT),
    "in contact": lambda: Case(pose_in_contact(), extra=0.0),
    "testbed, moving": lambda: Case((0.1,), extra=0.2, name="testbed"),
}


def plant(quick: bool) -> Measured:
    """A substep of the plant, and a bare mj_step of the same model from the same state."""
    cases = {name: make() for name, make in CASES.items()}
    while True:
        found = {name: case.measure() for name, case in cases.items()}
        bare = {BARE + name: both[1] for name, both in found.items()}
        yield {**bare, **{name: both[0] for name, both in found.items()}}


BARE = "mj_step, "
PLANT = Benchmark(
    plant,
    "a substep of the plant [us]",
    (
        Row("arm free, moving", BARE + "arm free, moving", 1.38, 1.3),
        Row("arm free, pushed", BARE + "arm free, pushed", 1.75, 1.3),
        Row("arm, every effect on", BARE + "arm, every effect on"),
        Row("in contact", BARE + "in contact", 1.5, 1.3),
        Row("testbed, moving", BARE + "testbed, moving", 1.5, 1.3),
    ),
    rounds=200,
    quick_rounds=5,
)


# the inner loop as C

DIRECT, OVER, AS_PYTHON = "direct run, times real time", "substep over mj_step, ", ", plain Python"


def installed() -> Path | None:
    """Where the compiled packages of this source are installed; None where they are not."""
    site = Path(sysconfig.get_path("purelib"))
    if not any(site.glob("wam_driver/fast_steps.*.so")):
        return None
    sources = [path.relative_to(ROOT) for path in ROOT.glob("wam_*/**/*.py")]
    _, differing, missing = filecmp.cmpfiles(ROOT, site, map(str, sources), shallow=False)
    return None if differing or missing else site


def measured_here(length: float) -> dict[str, Any]:
    """What the packages of this process take, and a hash of all numbers of the run."""
    configuration = Configuration.load(packaged("wam"))
    run = Simulation(configuration, scenario_steps(length, configuration.shared))
    begin = time.process_time()  # which other programs disturb less
    if failure := run.play():
        raise SystemExit(failure)
    found: dict[str, Any] = {DIRECT: run.driver.stamp / 1e9 / (time.process_time() - begin)}
    found["hash"] = hashlib.sha256(repr(sorted(run.rows.items())).encode()).hexdigest()
    for name, make in CASES.items():
        case = make()
        found[OVER + name] = float(np.median([a / b for a, b in (case.measure() for _ in range(10))]))
    return found


def compiled(quick: bool) -> Measured:
    """The installed packages and the tree, in processes of their own; every number of their runs has the same bits."""
    if (site := installed()) is None:
        print("left out: this source is not installed as C; run make install")
        raise SystemExit
    while True:
        found = []
        for tree in (site, ROOT):
            command = [sys.executable, "-P", __file__, str(1.0 if quick else 5.0)]
            here = os.pathsep.join([str(tree), str(Path(__file__).parent)])
            environment = {**os.environ, "PYTHONPATH": here}
            done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
            found.append(json.loads(done.stdout))
        fast, slow = found
        if fast.pop("hash") != slow.pop("hash"):
            raise SystemExit("the numbers of the two runs differ")
        yield {**fast, **{name + AS_PYTHON: value for name, value in slow.items()}, "gain": fast[DIRECT] / slow[DIRECT]}


COMPILED = Benchmark(
    compiled,
    "equal bits",
    (
        Row(DIRECT, "", 14.0, 20.0),
        Row(DIRECT + AS_PYTHON),
        Row("gain"),
        *(Row(OVER + name, "", 1.15, 1.05) for name in CASES),
    ),
    rounds=10,
)


# parts of a period

NODES = ("contact_estimator", "force_loop", "velocity_loop", "transform", "gravity", "scenario")
TRUTH, REST = "true state, published", "bus, synchronisers, scheduling"
WITHIN = {  # methods of an object of the simulation, by part
    "driver: substeps": ("driver.plant", "step"),
    "driver: measuring": ("driver", "_measure"),
    "driver: limits": ("driver", "_watch_limits"),
    "driver: amplifier": ("driver.amplifier", "step"),
    "contact_estimator: observe": ("nodes.contact_estimator._estimator", "observe"),
    "contact_estimator: estimate": ("nodes.contact_estimator._estimator", "estimate"),
}
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


def timed_node(spent: Spent, name: str) -> Any:
    """A node of the stack whose steps are timed."""
    kind = declared(name).node
    steps = {step: value for step in dir(kind) if hasattr(value := getattr(kind, step), "reaction")}
    body = {step: timed(spent, name, value) for step, value in steps.items()}
    return type(kind.__qualname__, (kind,), {**body, "__module__": kind.__module__})


def spent_in(configuration: Configuration, steps: list[ScenarioStep], which: str) -> Spent:
    """Microseconds per period of the parts: '' the whole, 'nodes' the nodes and the driver, 'within' parts of these."""
    spent: Spent = Counter()
    classes = {name: timed_node(spent, name) for name in NODES} if which == "nodes" else {}
    run = Simulation(configuration, steps, classes)
    places = {"driver": ("driver", "advance"), TRUTH: ("", "_publish_truth")}
    for part, (path, name) in {"": {}, "nodes": places, "within": WITHIN}[which].items():
        place: Any = run
        for step in filter(None, path.split(".")):
            place = place[step] if isinstance(place, dict) else getattr(place, step)
        setattr(place, name, timed(spent, part, getattr(place, name)))
    wall, own = time.perf_counter(), time.process_time()
    if failure := run.play():
        raise SystemExit(failure)
    wall, own = time.perf_counter() - wall, time.process_time() - own
    if not which:
        spent["whole"] = wall
    periods = run.driver.stamp / configuration.shared.timing.period_ns
    # what others ran meanwhile is taken off every part alike: to read the processor time costs more than some parts
    return Counter({part: 1e6 * own / wall * taken / periods for part, taken in spent.items()})


def parts(quick: bool) -> Measured:
    """The whole, measured without clocks in it, its parts and what they consist of."""
    configuration = Configuration.load(packaged("wam"))
    steps = scenario_steps(1.0 if quick else 5.0, configuration.shared)
    while True:
        whole, nodes, within = (spent_in(configuration, steps, which) for which in ("", "nodes", "within"))
        nodes[REST] = max(whole["whole"] - sum(nodes.values()), 1e-9)
        yield {**whole, **nodes, **within}


NAMES = [name for part in ("driver", *NODES) for name in (part, *(one for one in WITHIN if one.startswith(f"{part}:")))]
PARTS = Benchmark(parts, "a period of the direct run [us]", tuple(map(Row, ("whole", *NAMES, TRUTH, REST))), rounds=15)


# the contact estimator

POSE = (0.1, -1.05, 0.3, 0.5)  # rad
SPEED = (1.0, -1.2, 2.0, 1.5)  # rad/s of the motors
POSITION, FORCE = 0.28, (0.0, 8.0, 6.0)  # m, N, of a push on the outer link, in the base frame
PERIOD = 1e-3


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


def fixed_workload(body: RigidBody) -> None:
    """Work of the same kind: rigid-body algorithms, small matrices, scalar Python."""
    inertia = body.mass_matrix(POSE) + np.diag((1.0, 2.0, 3.0, 4.0))
    solved = np.linalg.solve(inertia, body.gravity_torque(POSE)).tolist()
    sum([a * b for a in solved for b in solved])


@cache
def contact_works() -> dict[str, Callable[[], object]]:
    """What is measured, of an arm that is pushed."""
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
    body, inference = RigidBody(arm), ContactInference(arm, RigidBody(arm), parameters.inference)
    return {
        "fixed workload": lambda: fixed_workload(body),
        "observe": lambda: observer.observe(state, PERIOD),
        "infer": lambda: inference.infer(POSE, torques, precision),
        "estimate": estimator.estimate,
    }


def contact(quick: bool) -> Measured:
    """The contact estimator during contact; the shortest of five tries, to exclude other load."""
    works, many = contact_works(), 20 if quick else 300
    while True:
        found = {
            name: 1e6 / many * min(seconds(lambda work=work: [work() for _ in range(many)]) for _ in range(5))
            for name, work in works.items()
        }
        yield {**found, "update": found["observe"] + found["estimate"]}


CONTACT = Benchmark(
    contact,
    "contact estimator [us]",
    tuple(Row(name, "fixed workload") for name in ("observe", "infer", "estimate", "update")),
    rounds=7,
)


# the stability map

GAMMA, ZETA = np.meshgrid(np.linspace(1.02, 3.0, 100), np.geomspace(0.05, 1.0, 100))


def scalar(gamma: float, zeta: float) -> float:
    """The exact integrator, one response after the other, of a node with J, k_tr, k_c and its friction 1."""
    damping = 2.0 * zeta * math.sqrt(2.0)
    node = FrictionNode(1.0, damping, 1.0, 1.0, 1.0, 1.0)
    return largest_stable_step(node, IntegralLoop(2.0 * gamma * damping), rtol=1e-4)


def stability_map(quick: bool) -> Measured:
    """A point of the map, and some of its points by bisection; both have the same largest stable steps."""
    many, chance = 4 if quick else 250, np.random.default_rng(58)
    while True:
        steps: list[Any] = []
        whole = seconds(lambda found=steps: found.append(largest_stable_steps(GAMMA, ZETA)))
        chosen = chance.choice(GAMMA.size, many, replace=False)
        points = list(zip(GAMMA.ravel()[chosen].tolist(), ZETA.ravel()[chosen].tolist(), strict=True))
        bisected = seconds(lambda found=steps, at=points: found.append([scalar(*point) for point in at]))
        np.testing.assert_allclose(steps[0].ravel()[chosen], steps[1], rtol=5e-3)
        yield {"by bisection": 1e6 * bisected / many, "map": 1e6 * whole / GAMMA.size}


STABILITY_MAP = Benchmark(stability_map, "per point [us]", (Row("by bisection", "map"),), rounds=4)


if __name__ == "__main__":
    print(json.dumps(measured_here(float(sys.argv[1]))))
