"""Benchmark of force control: random poses, surfaces and forces, true force against the commanded one.

Each task starts with the arm at rest a few millimetres from a surface, commands a force along its normal and
ends with an outcome: within the tolerance, ended with a reason, or silent.  Tasks are drawn wider than the
design, singular poses included; the same seed draws the same tasks.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.scenario import ScenarioStep
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_description.signals import ForceCommand
from wam_sim.simulation import Simulation

Array = NDArray[np.float64]
Triple = tuple[float, float, float]

GAP = 0.002  # m, between link and surface at the start
CLEARANCE = 0.03  # m, between the surface and the rest of the arm
ROD = (0.02, 0.08)  # m, radius and half length of a rod that the link touches at one position
SURFACE = 0.5  # m, half length of a plane
RELEASE = 0.2  # s
TOLERANCE = 0.1  # of the commanded force, and at least LEAST
LEAST = 0.3  # N
OVERSHOOT = 1.5  # of the commanded force, above the impact
CONTINUOUS = 0.5  # s at the end of a task, in which the force is evaluated


class Task(NamedTuple):
    """One force on one surface.

    Attributes
    ----------
    q : joint angles at the start (n,), rad.
    cover, place : where the link touches, m along the cover.
    direction : of the force of the arm on the surface (3,), base frame.
    force : N.
    stiffness : of the surface, N/m.
    friction : coefficient of friction of the surface.
    is_plane : whether the surface is a plane at the end of the link, else a rod across it.
    """

    q: tuple[float, ...]
    cover: str
    place: float
    direction: Triple
    force: float
    stiffness: float
    friction: float
    is_plane: bool


class TaskEnd(StrEnum):
    """How a task has ended."""

    DONE = "within the tolerance"
    REFUSED = "ended with a reason"
    SILENT = "silent: wrong force without a reason"


class TaskResult(NamedTuple):
    """What the simulator saw of a task: forces along the commanded direction, N."""

    outcome: TaskEnd
    mean: float
    sd: float
    peak: float
    reason: str


def draw(arm: Arm, seed: int, count: int) -> Iterator[Task]:
    """Tasks of a seed: every fourth pose has the elbow within 0.3 rad of straight or theta2 within 0.3 rad of 0."""
    random = np.random.Generator(np.random.PCG64(seed))
    body = RigidBody(arm)
    made = 0
    while made < count:
        task = _draw(arm, body, random)
        if task is not None:
            made += 1
            yield task


def _draw(arm: Arm, body: RigidBody, random: np.random.Generator) -> Task | None:
    joints = arm.joints
    q = [random.uniform(low + 0.2, high - 0.2) for low, high in zip(joints.lower, joints.upper, strict=True)]
    if random.random() < 0.25:
        if random.random() < 0.5:
            q[3] = math.pi / 2.0 - random.uniform(0.0, 0.3)
        else:
            q[1] = random.uniform(-0.3, 0.3)
    cover = arm.covers.names[-1 if random.random() < 0.85 else 0]
    length = arm.covers.length[arm.covers.names.index(cover)]
    is_plane = cover == arm.covers.names[-1] and bool(random.random() < 0.3)
    lean = random.uniform(0.0, math.radians(60.0)) if is_plane else 0.0
    place = length if is_plane else random.uniform(0.15 * length, 0.97 * length)
    about = random.uniform(-math.pi, math.pi)
    across = np.array([0.0, math.cos(about), math.sin(about)])
    direction = body.cover_pose(q, cover).rotation @ (
        math.cos(lean) * across + math.sin(lean) * np.array([1.0, 0.0, 0.0])
    )
    force = math.exp(random.uniform(0.0, math.log(40.0)))
    stiffness = math.exp(random.uniform(math.log(400.0), math.log(4e5)))
    friction = random.uniform(0.0, 0.8)
    task = Task(tuple(q), cover, place, _triple(direction), force, stiffness, friction, is_plane)
    return task if _is_clear(arm, body, task) else None


def _is_clear(arm: Arm, body: RigidBody, task: Task) -> bool:
    """Whether the surface touches nothing at the start, and no other part of the arm is nearer than `CLEARANCE`."""
    surface, axis, into = _surface(arm, body, task), _frame(body, task)[:, 2], np.array(task.direction)
    for name, radius, length in zip(arm.covers.names, arm.covers.radius, arm.covers.length, strict=True):
        for place in np.linspace(0.0, length, 20):
            apart = surface - body.point(task.q, name, (place, *arm.covers.aside(name, place)))
            if task.is_plane:
                distance = float(apart @ into)
            else:
                along = min(max(float(-apart @ axis), -ROD[1]), ROD[1])
                distance = float(np.linalg.norm(apart + along * axis)) - ROD[0]
            if distance < radius + (0.9 * GAP if name == task.cover else CLEARANCE):
                return False
    return True


def _surface(arm: Arm, body: RigidBody, task: Task) -> Array:
    """A point of the plane, or the centre of the rod, (3,), m, base frame."""
    radius = arm.covers.radius[arm.covers.names.index(task.cover)]
    point = body.point(task.q, task.cover, (task.place, *arm.covers.aside(task.cover, task.place)))
    return point + (radius + GAP + (0.0 if task.is_plane else ROD[0])) * np.array(task.direction)


def _frame(body: RigidBody, task: Task) -> Array:
    """Rotation of the surface: z against the force; x of a rod's cylinder along its own axis, across the link."""
    direction = np.array(task.direction)
    link = body.cover_pose(task.q, task.cover).rotation[:, 0]
    across = np.cross(direction, link)
    across /= np.linalg.norm(across)
    if task.is_plane:
        return np.column_stack([across, np.cross(-direction, across), -direction])
    return np.column_stack([-direction, np.cross(across, -direction), across])


def configured(base: Configuration, task: Task, changes: Mapping[str, Any]) -> Configuration:
    """The configuration in which a task is done: its surface in the world, the arm at its start."""
    arm = base.shared.arm
    body = RigidBody(arm)
    values = {
        "arm.joints.start": list(task.q),
        "driver:world.obstacles.names": ["surface"],
        "driver:world.obstacles.shapes": ["plane" if task.is_plane else "cylinder"],
        "driver:world.obstacles.positions": _surface(arm, body, task).tolist(),
        "driver:world.obstacles.rotations": _angles(_frame(body, task)),
        "driver:world.obstacles.sizes": [SURFACE, SURFACE, 0.0] if task.is_plane else [*ROD, 0.0],
        "driver:world.obstacles.stiffness": [task.stiffness],
        "driver:world.obstacles.damping": [0.005 * task.stiffness if task.stiffness < 4000.0 else 20.0],
        "driver:world.obstacles.hardening": [0.0],
        "driver:world.obstacles.friction": [task.friction],
        "force_loop:contact_cover": task.cover,
        "force_loop:contact_position": task.place,
        "force_loop:guard.contact_stiffness": task.stiffness,
        "force_loop:guard.posture": list(task.q),
    }
    return base.with_values({**values, **changes})


def perform(base: Configuration, task: Task, seconds: float, changes: Mapping[str, Any] | None = None) -> TaskResult:
    """Do a task in simulation and evaluate it by the simulator's force."""
    try:
        configuration = configured(base, task, changes or {})
        command = ForceCommand("base", _triple(task.force * np.array(task.direction)))
        steps = [
            ScenarioStep("release", RELEASE, request="enable"),
            ScenarioStep("press", seconds, force=command),
        ]
        run = Simulation(configuration, steps)
    except ValueError as error:
        return TaskResult(TaskEnd.REFUSED, 0.0, 0.0, 0.0, str(error))
    reason = ""
    while not run.step():
        node = run.nodes["force_loop"]
        held = node.refusals.get("force_command", "") or node.reason
        reason = run.driver.safety.fault or held
        if run.driver.safety.fault:
            break
    return judged(task, true_forces(base.shared.arm, run, task), reason)


def true_forces(arm: Arm, run: Simulation, task: Task) -> Array:
    """Force of the arm on the world along the commanded direction in every outer period, N."""
    body = RigidBody(arm)
    forces = []
    n = len(task.q)
    for wrench, joints in zip(run.rows["sim/contact/wrench"], run.rows["sim/joint_states"], strict=False):
        if wrench.frame == "base":
            forces.append(0.0)
            continue
        rotation = body.cover_pose(joints.values[:n], wrench.frame).rotation
        forces.append(-float(np.array(task.direction) @ rotation @ np.array(wrench.values[:3])))
    return np.array(forces)


def judged(task: Task, forces: Array, reason: str) -> TaskResult:
    """The outcome of a task from its true forces, one per outer period of 5 ms, and why it was refused or held."""
    last = forces[-round(CONTINUOUS / 0.005) :]
    mean, sd, peak = float(last.mean()), float(last.std()), float(forces.max())
    is_right = abs(mean - task.force) <= max(TOLERANCE * task.force, LEAST)
    outcome = TaskEnd.REFUSED if reason else TaskEnd.DONE if is_right else TaskEnd.SILENT
    return TaskResult(outcome, mean, sd, peak, reason)


class ElbowRow(NamedTuple):
    """A force on a surface in front of or at the side of a nearly straight arm."""

    bend: float  # rad
    is_radial: bool
    force: float  # N, commanded
    result: TaskResult


def elbow(base: Configuration, seconds: float = 3.0) -> list[ElbowRow]:
    """Forces of 5 and 15 N, the elbow bent by 0 to 0.5 rad, against a wall ahead and a rod at its side."""
    arm = base.shared.arm
    body, cover, length = RigidBody(arm), arm.covers.names[-1], arm.covers.length[-1]
    rows = []
    for is_radial in (True, False):
        for bend in [round(0.05 * k, 2) for k in range(11)]:
            q = (0.0, -1.0, 0.0, math.pi / 2.0 - bend)
            tip, rotation = body.point(q, cover, (length, 0.0, 0.0)), body.cover_pose(q, cover).rotation
            direction = _triple(tip / np.linalg.norm(tip) if is_radial else rotation[:, 2])
            for force in (5.0, 15.0):
                task = Task(q, cover, length if is_radial else 0.28, direction, force, 4000.0, 0.3, is_radial)
                result = perform(base, task, seconds, {"force_loop:contact_source": "pinned"})
                rows.append(ElbowRow(bend, is_radial, force, result))
    return rows


def elbow_table(rows: Sequence[ElbowRow]) -> str:
    """Mean and peak of the true force, N, in Markdown; with a star where the loop reports that it cannot do it."""
    lines = [
        "| bend [rad] | radial 5 N | radial 15 N | lateral 5 N | lateral 15 N |",
        "| --- | --- | --- | --- | --- |",
    ]
    for bend in sorted({row.bend for row in rows}):
        cells = []
        for is_radial, force in product((True, False), (5.0, 15.0)):
            (found,) = (r.result for r in rows if (r.bend, r.is_radial, r.force) == (bend, is_radial, force))
            star = " *" if found.outcome is TaskEnd.REFUSED else ""
            cells.append(f"{found.mean:.2f} ({found.peak:.2f}){star}")
        lines.append(f"| {bend:g} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def summary(tasks: Sequence[Task], results: Sequence[TaskResult]) -> str:
    """Counts of the outcomes, and the shares above the allowed peak."""
    counts = {outcome: sum(result.outcome is outcome for result in results) for outcome in TaskEnd}
    high = sum(result.peak > OVERSHOOT * task.force for task, result in zip(tasks, results, strict=True))
    lines = [f"{len(results)} tasks: " + ", ".join(f"{count} {outcome}" for outcome, count in counts.items())]
    return "\n".join([*lines, f"peak above {OVERSHOOT:g} times the commanded force: {high}"])


def _angles(rotation: Array) -> list[float]:
    """Roll, pitch and yaw about fixed axes, rad."""
    pitch = math.asin(min(max(-rotation[2, 0], -1.0), 1.0))
    return [
        math.atan2(rotation[2, 1], rotation[2, 2]),
        pitch,
        math.atan2(rotation[1, 0], rotation[0, 0]),
    ]


def _triple(values: Array) -> Triple:
    x, y, z = values.tolist()
    return x, y, z
