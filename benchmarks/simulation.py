"""The run without ROS and what is within it: the plant, and the inner loop as C."""

import filecmp
import hashlib
import json
import os
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
import yaml
from bench import Benchmark, Ratio, Values

from wam_control.task.scenario import ScenarioStep, load
from wam_description.arm import Shared
from wam_description.configuration import Configuration, packaged
from wam_description.mjcf import mjcf
from wam_description.rigid_body import RigidBody
from wam_driver.driver import DriverParameters
from wam_driver.plant import Plant
from wam_sim.simulation import Simulation

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


STATE = mujoco.mjtState.mjSTATE_INTEGRATION
FREE = (0.0, -0.6, 0.0, 0.5)  # rad
IN_CONTACT = (0.0, -1.974, 0.0, 1.45)  # rad, the outer link just touches the box
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
        self.torque = [tau + extra for tau in arm.transmission.motor_torques(gravity)]
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


CASES = {
    "arm free, moving": lambda: Case(FREE, extra=0.2),
    "arm free, pushed": lambda: Case(FREE, extra=0.2, pushed=True),
    "arm, every effect on": lambda: Case(FREE, extra=0.2, values=EVERY_EFFECT),
    "in contact": lambda: Case(IN_CONTACT, extra=0.0),
    "testbed, moving": lambda: Case((0.1,), extra=0.2, name="testbed"),
}


DIRECT, OVER, AS_PYTHON = "run without ROS, times real time", "substep over mj_step, ", ", plain Python"
GAIN = "gain"


def installed() -> Path | None:
    """Where the compiled packages of this source are installed; None where they are not."""
    site = Path(sysconfig.get_path("purelib"))
    if not any(site.glob("wam_driver/fast_steps.*.so")):
        return None
    sources = [path.relative_to(ROOT) for path in ROOT.glob("wam_*/**/*.py")]
    _, differing, missing = filecmp.cmpfiles(ROOT, site, map(str, sources), shallow=False)
    return None if differing or missing else site


def by_packages_of(tree: Path, module: str, length: float) -> dict[str, Any]:
    """What a module of the benchmarks prints as JSON, by the packages of a tree, in a process of its own."""
    here = os.pathsep.join([str(tree), str(Path(__file__).parent)])
    command = [sys.executable, "-P", module, str(length)]
    environment = {**os.environ, "PYTHONPATH": here}
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def measured_here(length: float) -> dict[str, Any]:
    """What the packages of this process take, and a hash of all numbers of the run."""
    configuration = Configuration.load(packaged("wam"))
    run = Simulation(configuration, scenario_steps(length, configuration.shared))
    begin = time.process_time()  # which other programs disturb less
    if failure := run.play():
        raise RuntimeError(failure)
    found: dict[str, Any] = {DIRECT: run.driver.stamp / 1e9 / (time.process_time() - begin)}
    found["hash"] = hashlib.sha256(repr(sorted(run.rows.items())).encode()).hexdigest()
    cases = {name: make() for name, make in CASES.items()}
    if not cases["in contact"].plant.data.ncon:
        raise RuntimeError("the box is not touched: give another pose in contact")
    for name, case in cases.items():
        found[OVER + name] = float(np.median([a / b for a, b in (case.measure() for _ in range(10))]))
    return found


def compiled(quick: bool) -> Values:
    """The tree, and the installed packages if they are its source as C; every number has the same bits in both."""
    length = 1.0 if quick else 5.0
    found = [by_packages_of(tree, __file__, length) for tree in (ROOT, installed()) if tree]
    if len({one.pop("hash") for one in found}) > 1:
        raise RuntimeError("the numbers of the two runs differ")
    plain, *fast = found
    values = {name + AS_PYTHON: value for name, value in plain.items()}
    return {**values, **fast[0], GAIN: fast[0][DIRECT] / plain[DIRECT]} if fast else values


COMPILED = Benchmark(
    compiled,
    "equal bits",
    (
        Ratio(DIRECT, "", 20.0, 26.0),
        Ratio(DIRECT + AS_PYTHON, "", 14.0, 18.0),
        Ratio(GAIN),
        *(Ratio(OVER + name, "", 1.08, 1.03) for name in CASES),
    ),
    rounds=10,
)


if __name__ == "__main__":
    print(json.dumps(measured_here(float(sys.argv[1]))))
