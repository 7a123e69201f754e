"""The arm as a MuJoCo model (MJCF), from the same parameters as everything else.

Structure: one body per link with a hinge along z of frame i (A.4); one free-standing body per
rotor; one fixed tendon per cable circuit, of length theta_m - (row of the inverse of (A.5)) q, so
that its spring is the transmission stiffness k_tr on the motor side.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from wam_description.arm import Arm
from wam_description.parameters import parameter, require

ROTOR_MASS = 1e-3  # kg; a rotor turns about its centre, so that its mass moves nothing
SHAPES = {"box": 3, "cylinder": 2, "plane": 3}  # numbers that MuJoCo needs for the size of each


@dataclass(frozen=True)
class Obstacles:
    """Surfaces that the covers can touch, fixed in the base frame."""

    names: tuple[str, ...] = parameter("names of the obstacles")
    shapes: tuple[str, ...] = parameter("shape of each", choices=tuple(SHAPES))
    positions: tuple[float, ...] = parameter("centre in the base frame, x y z of each", "m")
    rotations: tuple[float, ...] = parameter("turn from the base frame, roll pitch yaw of each", "rad")
    sizes: tuple[float, ...] = parameter(
        "three numbers each: box half lengths; cylinder radius, half length, 0; plane half lengths, 0", "m", low=0.0
    )
    stiffness: tuple[float, ...] = parameter("k_c of the surface, at the contact", "N/m", low=1.0)
    damping: tuple[float, ...] = parameter("damping of the surface, at the contact", "N s/m", low=0.0)
    friction: tuple[float, ...] = parameter("coefficient of friction against the covers", low=0.0)

    def __post_init__(self) -> None:
        for key in ("shapes", "stiffness", "damping", "friction"):
            self._length(key, 1)
        for key in ("positions", "rotations", "sizes"):
            self._length(key, 3)

    def _length(self, key: str, width: int) -> None:
        expected, found = width * len(self.names), len(getattr(self, key))
        require(
            expected == found,
            f"parameter 'obstacles.{key}' has {found} values; {len(self.names)} obstacles need {expected}",
        )


def mjcf(arm: Arm, step: float, obstacles: Obstacles) -> str:
    """MJCF of the arm among obstacles.

    Parameters
    ----------
    arm : the arm.
    step : simulation step, s.
    obstacles : the environment, each paired with every cover and with nothing else.

    Returns
    -------
    str
        XML with joints named as motors and joints, tendons and actuators named as motors, bodies
        as links, geoms as covers and obstacles, a site ``tool``.
    """
    root = ElementTree.Element("mujoco", model=arm.name)
    _add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", eulerseq="XYZ")
    _add_solver(root, arm, step)
    world = _add(root, "worldbody")
    _add_rotors(world, arm)
    _add_links(world, arm)
    for i, name in enumerate(obstacles.names):
        _add_obstacle(world, obstacles, i, name)
    _add_pairs(root, arm, obstacles)
    _add_cables(root, arm)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, {key: value for key, value in attributes.items() if value})


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _triple(values: Sequence[float], i: int) -> str:
    return _numbers(values[3 * i : 3 * i + 3])


def _add_solver(root: ElementTree.Element, arm: Arm, step: float) -> None:
    option = _add(
        root,
        "option",
        timestep=repr(step),
        gravity=_numbers(arm.gravity),
        integrator="implicitfast",
        solver="Newton",
        cone="elliptic",
        impratio="1",
        noslip_iterations="4",
        noslip_tolerance="0",
    )
    _add(option, "flag", diagexact="enable")
    default = _add(root, "default")
    # a stiff friction constraint: with MuJoCo's own values a stuck joint creeps at about 1 rad/s
    _add(
        default,
        "joint",
        type="hinge",
        axis="0 0 1",
        solreffriction=_numbers((2 * step, 1.0)),
        solimpfriction="0.9999 0.9999 0.001 0.5 2",
        solreflimit=_numbers((4 * step, 1.0)),
    )
    _add(default, "geom", contype="0", conaffinity="0")


def _add_rotors(world: ElementTree.Element, arm: Arm) -> None:
    motors = arm.motors
    for i, name in enumerate(motors.names):
        body = _add(world, "body", name=f"{name}_rotor", pos=_numbers((-0.3, 0.15 * i, -0.3)))
        inertia = motors.inertia[i]
        _add(body, "inertial", pos="0 0 0", mass=repr(ROTOR_MASS), diaginertia=_numbers((inertia, inertia, inertia)))
        _add(
            body,
            "joint",
            name=name,
            damping=repr(motors.viscous_friction[i]),
            frictionloss=repr(motors.static_friction[i]),
        )


def _add_links(world: ElementTree.Element, arm: Arm) -> None:
    joints, links, covers = arm.joints, arm.links, arm.covers
    parent = world
    for i, name in enumerate(links.names):
        twist = joints.twist[i]
        position = (joints.length[i], -math.sin(twist) * joints.offset[i], math.cos(twist) * joints.offset[i])
        parent = _add(parent, "body", name=name, pos=_numbers(position), euler=_numbers((twist, 0.0, 0.0)))
        _add(
            parent,
            "inertial",
            pos=_triple(links.centre, i),
            mass=repr(links.mass[i]),
            diaginertia=_triple(links.inertia, i),
        )
        _add(
            parent,
            "joint",
            name=joints.names[i],
            range=_numbers((joints.lower[i], joints.upper[i])),
            armature=repr(joints.armature[i]),
            damping=repr(joints.viscous_friction[i]),
            frictionloss=repr(joints.static_friction[i]),
        )
        for j, cover in enumerate(covers.names):
            if covers.links[j] == name:
                _add_cover(parent, arm, j, cover)
    _add(parent, "site", name="tool", pos=_numbers(arm.tool))


def _add_cover(body: ElementTree.Element, arm: Arm, i: int, name: str) -> None:
    covers = arm.covers
    site = {"pos": _triple(covers.origin, i), "euler": _triple(covers.rotation, i)}
    _add(body, "site", name=f"{name}_frame", **site)
    rotation = rotation_xyz(*covers.rotation[3 * i : 3 * i + 3])
    ends = [
        rotation @ np.array(end[3 * i : 3 * i + 3]) + np.array(covers.origin[3 * i : 3 * i + 3])
        for end in (covers.start, covers.end)
    ]
    _add(
        body,
        "geom",
        name=name,
        type="capsule",
        fromto=_numbers([*ends[0], *ends[1]]),
        size=repr(covers.radius[i]),
        rgba="0.25 0.25 0.28 1" if i % 2 == 0 else "0.35 0.35 0.4 1",
    )


def rotation_xyz(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rotation matrix (3, 3) of URDF's roll, pitch, yaw: about fixed x, then y, then z."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _add_obstacle(world: ElementTree.Element, obstacles: Obstacles, i: int, name: str) -> None:
    shape = obstacles.shapes[i]
    size = list(obstacles.sizes[3 * i : 3 * i + 3])
    if shape == "plane":
        size[2] = 0.1  # MuJoCo's spacing of the grid lines that it draws
    _add(
        world,
        "geom",
        name=name,
        type=shape,
        pos=_triple(obstacles.positions, i),
        euler=_triple(obstacles.rotations, i),
        size=_numbers(size[: SHAPES[shape]]),
        rgba="0.95 0.75 0.35 1",
    )


def _add_pairs(root: ElementTree.Element, arm: Arm, obstacles: Obstacles) -> None:
    contact = _add(root, "contact")
    for cover in arm.covers.names:
        for i, obstacle in enumerate(obstacles.names):
            friction = obstacles.friction[i]
            _add(
                contact,
                "pair",
                name=f"{cover}/{obstacle}",
                geom1=cover,
                geom2=obstacle,
                condim="3" if friction > 0.0 else "1",
                friction=_numbers((friction, friction, 0.0, 0.0, 0.0)),
                # with this small impedance the force is stiffness x depth, see plant.py
                solimp="0.001 0.001 0.001 0.5 2",
                solref=_numbers((-obstacles.stiffness[i], -obstacles.damping[i])),
            )


def _add_cables(root: ElementTree.Element, arm: Arm) -> None:
    tendon, actuator = _add(root, "tendon"), _add(root, "actuator")
    size = len(arm.motors.names)
    motor_from_joint = np.linalg.inv(np.array(arm.joint_from_motor).reshape(size, size))
    for i, motor in enumerate(arm.motors.names):
        circuit = _add(
            tendon,
            "fixed",
            name=motor,
            stiffness=repr(arm.cables.stiffness[i]),
            damping=repr(arm.cables.damping[i]),
            springlength="0",
        )
        _add(circuit, "joint", joint=motor, coef="1")
        for joint, ratio in zip(arm.joints.names, motor_from_joint[i], strict=True):
            if abs(ratio) > 1e-12:
                _add(circuit, "joint", joint=joint, coef=repr(-float(ratio)))
        _add(actuator, "motor", name=motor, joint=motor)
