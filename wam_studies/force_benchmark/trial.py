"""One task in simulation, without ROS."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.event import Code, Event, Level
from wam_description.mismatch import true_arm
from wam_description.rigid_body import Array, RigidBody
from wam_driver.driver import DriverParameters
from wam_driver.loads import contact_force
from wam_sim.simulation import Simulation
from wam_studies.force_benchmark.controllers import Admittance, TorqueControl, UsualController
from wam_studies.force_benchmark.outcome import TaskResult, TaskTrace, evaluated, refused, worst
from wam_studies.force_benchmark.surfaces import NAMES
from wam_studies.force_benchmark.tasks import RANGES, Task, configured, steps

STOPPED = 1.0  # s, after which a task that is held or in fault is over
FORCE_LOOP = "force loop"
Doer = tuple[Mapping[str, Any], type[UsualController] | None]
# what else does a task: values of the configuration, and what takes the place of the force loop
OWN: dict[str, Doer] = {FORCE_LOOP: ({}, None)}
OTHERS: dict[str, Doer] = {
    "force loop that tries everything": ({"force_loop:limits.doubt": 1e6}, None),
    "admittance": ({}, Admittance),
    "torque control": ({}, TorqueControl),
}


class ForceTaskCase(NamedTuple):
    """A task of a number, the seconds of its whole force, and whether others do it, too."""

    configuration: Configuration
    seed: int
    number: int
    task: Task
    seconds: float
    is_compared: bool = False

    def __str__(self) -> str:
        return f"task {self.number} of seed {self.seed}"


class ForceTrial(NamedTuple):
    """A task of the benchmark, its result, those of others by name, and how well the force can be known at all.

    `knowable` is the error of the force per force, at best; NaN where nothing was compared.
    """

    seed: int
    number: int
    task: Task
    result: TaskResult
    others: Mapping[str, TaskResult] = {}
    knowable: float = math.nan


def play(case: ForceTaskCase) -> ForceTrial:
    """Do the task of a case."""
    results = {
        name: perform(case.configuration, case.task, case.seconds, changes, controller)
        for name, (changes, controller) in (OWN | OTHERS if case.is_compared else OWN).items()
        if not (case.task.second and controller)  # these know one force
    }
    known = knowable(case.configuration, case.task) if case.is_compared else math.nan
    return ForceTrial(case.seed, case.number, case.task, results.pop(FORCE_LOOP), results, known)


def perform(
    base: Configuration,
    task: Task,
    seconds: float = RANGES.seconds,
    changes: Mapping[str, Any] | None = None,
    controller: type[UsualController] | None = None,
) -> TaskResult:
    """Do a task in simulation and evaluate it by the simulator's force.

    Parameters
    ----------
    base : configuration under test.
    task : what to do.
    seconds : of the whole force.
    changes : values that override the configuration of the task.
    controller : in place of the force loop.
    """
    try:
        configuration = configured(base, task).with_values(changes or {})
        run = Simulation(configuration, steps(task, seconds), {"force_loop": controller} if controller else None)
    except ValueError as error:
        return refused(task, str(error))
    traces = TaskWatch(configuration, task, run).traces()
    return worst(
        [evaluated(task._replace(force=force), trace) for (_, force), trace in zip(task.forces, traces, strict=True)]
    )


class TaskWatch:
    """Plays a task and watches the true arm.

    Parameters
    ----------
    configuration : of the task.
    task : what is done.
    run : its simulation, at the start.
    """

    def __init__(self, configuration: Configuration, task: Task, run: Simulation) -> None:
        self._task, self._run = task, run
        self._timing = configuration.shared.timing
        driver = configuration.node("driver", DriverParameters)
        self._arm = true_arm(configuration.shared.arm, driver.mismatch)
        self._body = RigidBody(self._arm)
        self._directions = [np.array(surface.direction) for surface, _ in task.forces]
        self._surfaces = {run.driver.plant.model.geom(name).id: i for i, name in enumerate(NAMES[: len(task.forces)])}
        self._node = run.nodes["force_loop"]

    def traces(self) -> list[TaskTrace]:
        """Play the task to its end, or until it has been stopped for `STOPPED`; what was seen of each force."""
        run, plant, period = self._run, self._run.driver.plant, self._timing.period
        for _ in range(round(RANGES.release / period)):
            run.step()
        if self._task.is_tared:
            self._node.tare()
        for _ in range(round(self._task.approach_time / period)):
            run.step()
        start, travel = self._along(plant.q), np.zeros(len(self._directions))
        forces, impact, stopped, velocity = [], 0.0, 0.0, plant.qd
        standing = self._standing  # with the scenario the command ends, and what was reported of it
        while stopped < STOPPED and not run.step():
            force = self._force()
            if any(force) and not impact:
                impact = self._impact(plant.q, velocity)
            velocity = plant.qd
            if run.driver.is_outer:
                travel = np.maximum(travel, np.abs(self._along(plant.q) - start))
            forces.append(force)
            standing = self._standing
            stopped = stopped + period if standing[1] else 0.0
        return [
            TaskTrace(np.array(column), period, float(way), impact, *standing)
            for column, way in zip(zip(*forces, strict=True), travel, strict=True)
        ]

    @property
    def _standing(self) -> tuple[Event, bool, float]:
        """What driver and loop report now: the last fields of `TaskTrace`."""
        node, topics = self._node, ("force_command", "task_command")
        cycle = float(node.guard_report.facts.get("limit cycle [N]", 0.0))
        if fault := self._run.driver.safety.fault:
            return Event(Code.FAULT, Level.ERROR, {"reason": fault}), True, cycle
        event = next((node.refusals[topic] for topic in topics if topic in node.refusals), node.event)
        return event, node.event.holds, cycle

    def _along(self, q: list[float]) -> Array:
        """Position of each touched point along its force, m."""
        covers, found = self._arm.covers, []
        for (surface, _), direction in zip(self._task.forces, self._directions, strict=True):
            point = covers.on_axis(surface.cover, surface.position)
            found.append(float(direction @ self._body.point(q, surface.cover, point)))
        return np.array(found)

    def _force(self) -> list[float]:
        """Force of the arm on each surface along the commanded direction, N, over all covers."""
        model, data = self._run.driver.plant.model, self._run.driver.plant.data
        total = [0.0] * len(self._directions)
        for i in range(data.ncon):
            force = contact_force(model, data, i)  # on the second
            for geom, sign in zip(data.contact.geom[i].tolist(), (-1.0, 1.0), strict=True):
                if (k := self._surfaces.get(geom)) is not None:
                    total[k] += sign * float(self._directions[k] @ force)
        return total

    def _impact(self, q: list[float], qd: list[float]) -> float:
        """Largest force of the first touch by (3.1), N: all kinetic energy goes into the surface."""
        speed = np.array(qd)
        energy = float(speed @ inertia(self._arm, self._body, q) @ speed)
        return math.sqrt(energy * self._task.surface.stiffness)


def knowable(base: Configuration, task: Task) -> float:
    """Standard deviation of the first force per force by generalised least squares, whatever controls it.

    The torques tau = -J'(u f + t) + e have the noise e of the sensors, or the error of the estimate from the motors;
    friction t across the force is anywhere in the true cone, mu^2 f^2 / 4 along each axis; a position that is not
    declared is anywhere on the link.
    """
    arm, surface = base.shared.arm, task.surface
    sensing = base.node("force_loop", ForceLoopParameters).sensing
    sd = sensing.estimated_torque_sd if task.is_dithered else max(task.strain_noise, 0.005)
    body, u = RigidBody(arm), np.array(surface.direction)
    here, there = (
        body.point_jacobian(task.q, surface.cover, (surface.position + by, *arm.covers.on_axis(surface.cover, 0.0)[1:]))
        for by in (0.0, 1.0)
    )
    lever, shift = u @ here, u @ (there - here)
    spread = 0.0 if task.is_pinned else arm.covers.length_of(surface.cover) / math.sqrt(12.0)
    across = 0.5 * surface.friction * (np.eye(3) - np.outer(u, u)) @ here
    covariance = (sd / task.force) ** 2 * np.eye(len(lever)) + across.T @ across + spread**2 * np.outer(shift, shift)
    return float(lever @ np.linalg.solve(covariance, lever)) ** -0.5


def inertia(arm: Arm, body: RigidBody, q: list[float]) -> Array:
    """Inertia at the joints, (n, n), kg m^2: links, pulleys, and rotors as if the cables were stiff."""
    return body.mass_matrix(q) + arm.pulleys + arm.rotors
