"""The tasks of the benchmark, each drawn from the seed and its number alone, and as configurations of the stack.

Wider than the design: singular poses, surfaces a hundred times stiffer than the foam that the defaults are for,
contacts anywhere on both links, and a true arm that differs from the configured one.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wam_control.force.stability_guard import triple
from wam_control.force.task import AxisKind, TaskAxis, TaskCommand
from wam_control.task.scenario import ScenarioStep
from wam_description.arm import Arm
from wam_description.configuration import Configuration
from wam_description.rigid_body import RigidBody
from wam_description.signals import ForceCommand
from wam_studies.force_benchmark.surfaces import SHAPE, Surface, is_clear, obstacles
from wam_studies.identification.plants import drawn_cover, factors, log_uniform, mismatch

Range = tuple[float, float]
RIGHT, ROUNDING = math.pi / 2.0, 1e-12  # rad; of the angle of a straight elbow


# share of each class of poses
POSES = {"elbow nearly straight": 0.15, "theta2 near 0": 0.1, "elbow near 90 deg": 0.1, "any": 0.65}


@dataclass(frozen=True)
class TaskRanges:
    """What is drawn of a task.

    Ranges are uniform in the logarithm where `draw` does so; a single number of the model mismatch is the largest
    error, a share is the fraction of tasks.
    """

    mass: float = 0.03  # of each link
    motor_friction: float = 0.2  # of each motor and joint
    cables: float = 0.1  # stiffness of each cable
    torque_constant: float = 0.03  # of each motor
    loaded: float = 0.05  # share of arms with a payload that is not declared
    payloads: Range = (0.05, 2.0)  # kg
    other_friction: float = 0.05  # share of arms with another law of friction
    asymmetry: float = 0.15  # of that friction by direction
    centres: float = 0.005  # m, sd of the centre of mass of each link along each axis
    strain_noises: Range = (0.0, 0.05)  # N m, sd of each measured joint torque
    mistaken: float = 0.1  # share of pinned positions that are declared elsewhere on the link
    mistakes: Range = (0.01, 0.06)  # m, by which

    forces: Range = (1.0, 40.0)  # N
    stiffnesses: Range = (400.0, 4e5)  # N/m: a hundred times the foam that the defaults are for
    deepest: float = 0.025  # m, to which the force presses a surface: less than half of what the simulator has of it
    frictions: Range = (0.0, 0.8)  # of the surface
    steepest: float = math.radians(75.0)  # lean of a plane from the side of the link
    on_outer: float = 0.85  # share of contacts on the covers after the first
    at_plane: float = 0.3  # share of planes at the tip of the last one
    places: Range = (0.1, 0.97)  # of the length of a cover, along which a rod is
    moving: float = 0.15  # share of surfaces that move
    along: float = 0.5  # share of these that move along the force, else across it
    speeds: Range = (0.002, 0.05)  # m/s
    frequencies: Range = (0.1, 1.0)  # Hz
    farthest: float = 0.02  # m, amplitude
    at_rest: float = 1.5  # s of the whole force, until a surface moves
    full_friction: float = 0.5  # sd of the friction of a moving surface, which is there in full: rms of `frictions`

    margin: float = 0.1  # rad, of a start from the ends of the joints
    near: float = 0.3  # rad, of a singular pose

    dithered: float = 0.4  # share with feedback from the motors
    pinned: float = 0.5  # share with a configured contact position
    tared: float = 0.5  # share that is tared before
    ramped: float = 0.5  # share whose force rises in a ramp
    longest_ramp: float = 1.0  # s
    first: float = 0.2  # fraction of the force that a ramp starts with
    ramp_step: float = 0.02  # s
    dither_cycle: int = 40  # inner periods: 25 Hz
    release: float = 0.5  # s, until the force is commanded
    seconds: float = 4.0  # of the whole force

    doubled: float = 0.1  # share with a second force
    apart: float = 0.1  # m, between two forces on a link
    tries: int = 100  # draws of the second one
    stepped: float = 0.1  # share, of those of one force, that command another force first
    down: float = 0.7  # share of these that command a larger one first
    changes: Range = (2.0, 4.0)  # factor between the two
    first_held: float = 2.5  # s of the first force
    long: float = 0.1  # share of small forces that are held for long
    longer: float = 5.0  # times `seconds`
    small_forces: Range = (1.0, 3.0)  # N
    soft: float = 4e3  # N/m, of their surface at most
    touching: float = 0.1  # share, of those of one force at rest, whose arm touches the surface when it is commanded
    away: Range = (0.01, 0.1)  # m, from where it comes
    pressed: Range = (0.1, 0.8)  # of the force, of the surface at the depth to which the arm is sent
    approach_time: float = 2.5  # s, in which it goes each way
    carried: float = 0.5  # share of these that carry a payload, which is not declared
    loads: Range = (0.05, 0.5)  # kg


RANGES = TaskRanges()


class Task(NamedTuple):
    """A force on a surface, and perhaps another one at the same time.

    Attributes
    ----------
    q : joint angles at the start (n,), rad.
    surface, force : what is pressed, and with how many N.
    pose : its class.
    second : another surface and its force, N.
    before : force that is commanded at first, N; 0 for none, and then the command does not step.
    longer : factor of the time for which the force is held.
    is_dithered : feedback from the motors with dither, else from the joint sensors.
    is_pinned : whether the contact position is configured, else estimated.
    is_tared : whether the external torques are tared before the force is commanded.
    ramp : time in which the commanded force rises, s.
    mismatch : factors of the true arm, by parameter of `driver:mismatch`.
    payload : mass at the tool that nobody declares, kg.
    asymmetry : of all friction, which then falls with the speed as Stribeck's, too; 0 for friction as configured.
    centres : m, by which the controllers are wrong about the centre of mass of each link, x y z of each; () for none.
    strain_noise : sd of each measured joint torque, N m.
    misplaced : m, by which a pinned position is declared too far along the link.
    approach : joint angles (n,), rad, away from the surface and inside it, to which the arm goes first; none where it
        does not touch before.
    """

    q: tuple[float, ...]
    surface: Surface
    force: float
    pose: str = "any"
    second: tuple[Surface, float] | None = None
    before: float = 0.0
    longer: float = 1.0
    is_dithered: bool = False
    is_pinned: bool = True
    is_tared: bool = False
    ramp: float = 0.0
    mismatch: Mapping[str, Sequence[float]] = {}
    payload: float = 0.0
    asymmetry: float = 0.0
    centres: tuple[float, ...] = ()
    strain_noise: float = 0.0
    misplaced: float = 0.0
    approach: tuple[tuple[float, ...], ...] = ()

    @property
    def forces(self) -> list[tuple[Surface, float]]:
        """Each surface with its force, N."""
        return [(self.surface, self.force), *([self.second] if self.second else [])]

    @property
    def approach_time(self) -> float:
        """Time in which the arm goes to the surface, s; 0 where the force makes it touch."""
        return RANGES.approach_time * len(self.approach)

    @property
    def mistake(self) -> float:
        """Distance by which the user declares the touched position too far along the link, m."""
        return self.misplaced if self.is_pinned and not self.second else 0.0


class ElbowJoint(NamedTuple):
    """The joint between the first two covers: its index, and the angle at which they are in line, rad."""

    joint: int
    straight: float

    @classmethod
    def of(cls, body: RigidBody) -> "ElbowJoint":
        """The elbow of an arm that has two covers or more."""
        arm = body.arm
        inner, outer = arm.covers.names[:2]
        joint, zero = arm.links.names.index(arm.covers.links[1]), [0.0] * arm.n
        pose = body.cover_pose(zero, outer)
        axis = pose.rotation @ body.cover_jacobian(zero, outer)[3:, joint]
        here, there = pose.rotation[:, 0], body.cover_pose(zero, inner).rotation[:, 0]
        straight = math.atan2(float(axis @ np.cross(here, there)), float(here @ there))
        exact = round(straight / RIGHT) * RIGHT
        return cls(joint, exact if abs(exact - straight) < ROUNDING else straight)

    def pose(self, q: Sequence[float]) -> str:
        """The class of a pose, one of `POSES`; the shoulder's second joint is two before the elbow."""
        bend = abs(q[self.joint] - self.straight)
        if bend < RANGES.near:
            return "elbow nearly straight"
        if abs(q[self.joint - 2]) < RANGES.near:
            return "theta2 near 0"
        return "elbow near 90 deg" if abs(bend - RIGHT) < RANGES.near else "any"


def draw(arm: Arm, seed: int, number: int) -> Task:
    """The task of a number: it depends on the seed and the number alone."""
    random = np.random.Generator(np.random.PCG64((seed, number)))
    body = RigidBody(arm)
    unknowns, errors = (np.random.Generator(np.random.PCG64((seed, number, stream))) for stream in (2, 3))
    conditions = {**_conditions(arm, random), **_unknowns(unknowns), **_errors(arm, errors)}
    force = log_uniform(random, *RANGES.forces)
    elbow = ElbowJoint.of(body)
    q = _pose(arm, elbow, random)
    surface = _surface(body, q, random)
    while not is_clear(body, q, surface):
        q = _pose(arm, elbow, random)
        surface = _surface(body, q, random)
    surface = surface._replace(stiffness=max(surface.stiffness, force / RANGES.deepest))
    task = Task(q, _moving(surface, conditions["ramp"], random), force, elbow.pose(q), **conditions)
    if random.random() < RANGES.doubled:
        return _doubled(body, task, random)
    task = _in_time(task, np.random.Generator(np.random.PCG64((seed, number, 1))))
    is_plain = not task.before and not task.surface.frequency
    return _touching(body, task, np.random.Generator(np.random.PCG64((seed, number, 4)))) if is_plain else task


def _touching(body: RigidBody, task: Task, random: np.random.Generator) -> Task:
    """The task as it is, or with an arm that touches the surface already, and may carry a payload."""
    if random.random() >= RANGES.touching:
        return task
    cover, position, direction, stiffness = task.surface[:4]
    lever = np.array(direction) @ body.point_jacobian(task.q, cover, body.arm.covers.on_axis(cover, position))
    depth = SHAPE.gap + float(random.uniform(*RANGES.pressed)) * task.force / stiffness
    payload = log_uniform(random, *RANGES.loads) if random.random() < RANGES.carried else task.payload
    ways = [
        np.array(task.q) + lever * way / float(lever @ lever) for way in (-log_uniform(random, *RANGES.away), depth)
    ]
    within = [np.clip(q, body.arm.joints.lower, body.arm.joints.upper) for q in ways]
    return task._replace(approach=tuple(tuple(q.tolist()) for q in within), payload=payload)


def _in_time(task: Task, random: np.random.Generator) -> Task:
    """The task as it is, with a step of the command, or with a small force that is held for long.

    From the motors most small forces on hard surfaces or at estimated positions are refused.
    """
    share = random.random()
    if share < RANGES.stepped:
        change = log_uniform(random, *RANGES.changes)
        first = task.force * (change if random.random() < RANGES.down else 1.0 / change)
        most = min(RANGES.forces[1], RANGES.deepest * task.surface.stiffness)
        return task._replace(before=min(max(first, RANGES.forces[0]), most))
    if share < RANGES.stepped + RANGES.long:
        surface = task.surface._replace(stiffness=log_uniform(random, RANGES.stiffnesses[0], RANGES.soft))
        small = log_uniform(random, *RANGES.small_forces)
        return task._replace(surface=surface, force=small, is_pinned=True, longer=RANGES.longer)
    return task


def _unknowns(random: np.random.Generator) -> dict[str, Any]:
    """Of some tasks a payload or a law of friction of which the controllers know nothing."""
    share = random.random()
    if share < RANGES.loaded:
        return {"payload": log_uniform(random, *RANGES.payloads)}
    if share < RANGES.loaded + RANGES.other_friction:
        return {"asymmetry": float(random.uniform(-RANGES.asymmetry, RANGES.asymmetry))}
    return {}


def _errors(arm: Arm, random: np.random.Generator) -> dict[str, Any]:
    """Centres of mass that are off, noise of the joint sensors, and mistakes of the user."""
    mistake = float(random.uniform(*RANGES.mistakes) * random.choice((-1.0, 1.0)))
    return {
        "centres": tuple((RANGES.centres * random.normal(size=3 * arm.n)).tolist()),
        "strain_noise": float(random.uniform(*RANGES.strain_noises)),
        "misplaced": mistake if random.random() < RANGES.mistaken else 0.0,
    }


def _conditions(arm: Arm, random: np.random.Generator) -> dict[str, Any]:
    return {
        "is_dithered": bool(random.random() < RANGES.dithered) or not arm.joint_sensors,
        "is_pinned": bool(random.random() < RANGES.pinned),
        "is_tared": bool(random.random() < RANGES.tared),
        "ramp": float(random.uniform(0.0, RANGES.longest_ramp)) if random.random() < RANGES.ramped else 0.0,
        "mismatch": {
            **mismatch(random, arm, RANGES.mass, RANGES.motor_friction, RANGES.cables),
            "torque_constant": factors(random, RANGES.torque_constant, arm.motors.names),
        },
    }


def _pose(arm: Arm, elbow: ElbowJoint, random: np.random.Generator) -> tuple[float, ...]:
    joints = arm.joints
    ends = zip(joints.lower, joints.upper, strict=True)
    q = [float(random.uniform(low + RANGES.margin, high - RANGES.margin)) for low, high in ends]
    kind = random.choice(list(POSES), p=list(POSES.values()))
    near = float(random.uniform(-RANGES.near, RANGES.near))
    if kind == "elbow nearly straight":
        q[elbow.joint] = elbow.straight + near
    elif kind == "theta2 near 0":
        q[elbow.joint - 2] = near
    elif kind == "elbow near 90 deg":
        right = (elbow.straight - RIGHT, elbow.straight + RIGHT)
        middle = 0.5 * (joints.lower[elbow.joint] + joints.upper[elbow.joint])
        q[elbow.joint] = min(right, key=lambda angle: abs(angle - middle)) + near
    return tuple(q)


def _surface(body: RigidBody, q: Sequence[float], random: np.random.Generator) -> Surface:
    covers = body.arm.covers
    cover = covers.names[drawn_cover(random.random(), RANGES.on_outer, len(covers.names))]
    length = covers.length_of(cover)
    is_plane = cover == covers.names[-1] and bool(random.random() < RANGES.at_plane)
    lean = float(random.uniform(0.0, RANGES.steepest)) if is_plane else 0.0
    place = length if is_plane else float(random.uniform(RANGES.places[0] * length, RANGES.places[1] * length))
    about = float(random.uniform(-math.pi, math.pi))
    local = np.array([math.sin(lean), math.cos(lean) * math.cos(about), math.cos(lean) * math.sin(about)])
    stiffness = log_uniform(random, *RANGES.stiffnesses)
    direction = triple(body.cover_pose(q, cover).rotation @ local)
    return Surface(cover, place, direction, stiffness, float(random.uniform(*RANGES.frictions)), is_plane)


def _moving(surface: Surface, ramp: float, random: np.random.Generator) -> Surface:
    """The surface at rest, or with a motion along the force or across it."""
    if random.random() >= RANGES.moving:
        return surface
    along, about = np.array(surface.direction), random.normal(size=3)
    if random.random() >= RANGES.along:
        along = np.cross(along, about) / np.linalg.norm(np.cross(along, about))
    speed, frequency = log_uniform(random, *RANGES.speeds), log_uniform(random, *RANGES.frequencies)
    amplitude = min(speed / (2.0 * math.pi * frequency), RANGES.farthest)
    begin = RANGES.release + ramp + RANGES.at_rest
    return surface._replace(motion=triple(amplitude * along), frequency=frequency, begin=begin)


def _doubled(body: RigidBody, task: Task, random: np.random.Generator) -> Task:
    """The task with a second force elsewhere on a surface of its own, both at known positions, where it fits."""
    for _ in range(RANGES.tries):
        found = _surface(body, task.q, random)._replace(stiffness=task.surface.stiffness)
        is_apart = found.cover != task.surface.cover or abs(found.position - task.surface.position) > RANGES.apart
        if is_apart and is_clear(body, task.q, found):
            return task._replace(second=(found, log_uniform(random, *RANGES.forces)), is_pinned=True)
    return task


def configured(base: Configuration, task: Task) -> Configuration:
    """The configuration of a task: its surface in the world, what a user declares of it, the true arm."""
    return base.with_values(task_values(base, task))


def task_values(base: Configuration, task: Task) -> dict[str, Any]:
    """What `configured` sets, by parameter."""
    surface, n = task.surface, len(task.q)
    values: dict[str, Any] = {
        "arm.joints.start": list(task.q),
        "force_loop:guard.contact_stiffness": surface.stiffness,
        "force_loop:guard.posture": list(task.q),
        "force_loop:contact_source": "pinned" if task.is_pinned else "estimated",
        "contact_estimator:observer.mass_scale": [1.0] * n,
        "contact_estimator:observer.friction_scale": 1.0,
        **obstacles(RigidBody(base.shared.arm), task.q, [surface for surface, _ in task.forces]),
        **{f"driver:mismatch.{name}": each for name, each in task.mismatch.items()},
    }
    if task.payload:
        values["driver:mismatch.payload"] = task.payload
    if task.asymmetry:
        values |= {f"driver:friction.{one}_asymmetry": [task.asymmetry] for one in ("motor", "joint")}
        values["driver:friction.law"] = "stribeck"
    if task.centres:
        values["model.links.centre"] = np.add(base.shared.model.links.centre, task.centres).tolist()
    values["driver:sensors.strain_noise"] = [task.strain_noise] * n
    if task.is_pinned:
        length = base.shared.arm.covers.length_of(surface.cover)
        place = min(max(surface.position + task.mistake, 0.0), length)  # as the user declares it
        values |= {"force_loop:contact_cover": surface.cover, "force_loop:contact_position": place}
    if surface.frequency:
        along = RigidBody(base.shared.arm).cover_pose(task.q, surface.cover).rotation[:, 0]
        values |= {
            "force_loop:sensing.friction": RANGES.full_friction,
            "force_loop:limits.surface_speed": surface.speed,
            "force_loop:limits.slide_speed": surface.slide_speed,
            "force_loop:contact_position_sd": surface.slide(along),
        }
    if task.is_dithered:
        values |= {
            "arm.joint_sensors": False,
            "contact_estimator:use_joint_sensors": False,
            "force_loop:feedback": "contact_estimate",
            "timing.dither_cycle": RANGES.dither_cycle,
        }
    return values


def steps(task: Task, seconds: float) -> list[ScenarioStep]:
    """Release, touch, ramp in small steps, perhaps another force, and `seconds` of the whole force, or longer."""
    count = round(task.ramp / RANGES.ramp_step)
    rising = [RANGES.first + (1.0 - RANGES.first) * i / count for i in range(count)]
    before = task.before / task.force if task.before else 1.0
    ramp = [ScenarioStep("ramp", RANGES.ramp_step, **_command(task, before * fraction)) for fraction in rising]
    return [
        ScenarioStep("release", RANGES.release, request="enable"),
        *(ScenarioStep("approach", RANGES.approach_time, posture=posture) for posture in task.approach),
        *ramp,
        *([ScenarioStep("press first", RANGES.first_held, **_command(task, before))] if task.before else []),
        ScenarioStep("press", task.longer * seconds, **_command(task, 1.0)),
    ]


def _command(task: Task, fraction: float) -> dict[str, Any]:
    """What a step of the scenario commands: one force, or a task of two."""
    if not task.second:
        return {"force": ForceCommand("base", triple(fraction * task.force * np.array(task.surface.direction)))}
    axes = [
        TaskAxis(AxisKind.FORCE, -1, surface.cover, surface.position, surface.direction, fraction * force)
        for surface, force in task.forces
    ]
    return {"task": TaskCommand("base", tuple(axes))}
