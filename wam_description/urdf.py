"""The arm as URDF, for robot_state_publisher, viewers and other tools.

Links: ``base_link``, the root by REP 120, ``base`` in the same place, the links of the arm, a frame for
each cover (named like the cover, so that contacts find it in TF) and ``tool``.  The tubes are drawn as
cylinders with spheres at both ends.
"""

from collections.abc import Iterable
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.parameters import rows
from wam_description.parts import tensor
from wam_description.rigid_body import cover_placement, joint_placement
from wam_description.signals import ZERO
from wam_description.xml_element import add, text, written

ROOT = "base_link"
BASE = "base"
TOOL = "tool"
PLUGIN = "joint_state_topic_hardware_interface/JointStateTopicSystem"
TOPICS = {"joint_states_topic": "joint_states", "joint_commands_topic": "joint_posture_command"}
EVERY = "-1"  # threshold from which a command is sent: below 0 each of them, as the arm drops a command that ends


def urdf(arm: Arm, namespace: str = "") -> str:
    """URDF of the arm: kinematics, inertia of the links, limits and tubes.

    A joint's effort limit is the peak torque of the motors that drive it, its velocity limit the speed
    above which the driver faults.  Lengths in m, angles in rad, frames of (A.4).

    Parameters
    ----------
    arm : the arm.
    namespace : of its topics, where controllers of ros2_control are to command postures; '' for a URDF without them.
    """
    robot = Element("robot", name=arm.name)
    add(robot, "link", name=ROOT)
    add(robot, "link", name=BASE)
    _add_fixed(robot, ROOT, BASE)
    for link in rows(arm.carried):
        _add_link(robot, arm, link)
    for cover in rows(arm.covers):
        add(robot, "link", name=cover.name)
        _add_fixed(robot, cover.link, cover.name, cover.origin, cover.rotation)
    add(robot, "link", name=TOOL)
    _add_fixed(robot, arm.links.names[-1], TOOL, arm.tool)
    efforts = arm.transmission.largest_joint_torques(arm.motors.peak_torque)
    for i, (joint, effort) in enumerate(zip(rows(arm.joints), efforts, strict=True)):
        _add_joint(robot, arm, i, joint, effort)
    if namespace:
        _add_ros2_control(robot, arm, namespace)
    return f'<?xml version="1.0"?>\n{text(robot)}\n'


def _add_link(robot: Element, arm: Arm, link: Any) -> None:
    element = add(robot, "link", name=link.name)
    inertial = add(element, "inertial")
    add(inertial, "origin", xyz=link.centre, rpy=ZERO)
    add(inertial, "mass", value=link.mass)
    inertia = tensor(link)
    elements = ((a, b) for a in range(3) for b in range(a, 3))
    add(inertial, "inertia", **{f"i{'xyz'[a]}{'xyz'[b]}": inertia[a, b] for a, b in elements})
    for cover in rows(arm.covers):
        if cover.link == link.name:
            _add_tube(element, cover)


def _add_joint(robot: Element, arm: Arm, i: int, joint: Any, effort: float) -> None:
    parent = arm.links.names[i - 1] if i else BASE
    element = _add_connection(robot, joint.name, "revolute", parent, arm.links.names[i])
    add(element, "origin", xyz=joint_placement(joint).translation, rpy=(joint.twist, 0.0, 0.0))
    add(element, "axis", xyz="0 0 1")
    add(element, "limit", lower=joint.lower, upper=joint.upper, effort=effort, velocity=joint.speed_limit)


def _add_tube(link: Element, cover: Any) -> None:
    """Draw a cover on the link that carries it: geometry on a massless frame gets a mass in MuJoCo."""
    placement = cover_placement(cover)
    start, end = (placement.act(np.array(one)) for one in (cover.start, cover.end))
    turn, radius = _along(end - start), cover.radius
    for tag in ("visual", "collision"):
        length = float(np.linalg.norm(end - start))
        _add_shape(link, tag, (start + end) / 2.0, turn, "cylinder", radius=radius, length=length)
        _add_shape(link, tag, start, turn, "sphere", radius=radius)
        _add_shape(link, tag, end, turn, "sphere", radius=radius)


def _add_shape(link: Element, tag: str, xyz: Iterable[float], rpy: Iterable[float], shape: str, **size: float) -> None:
    part = add(link, tag)
    add(part, "origin", xyz=xyz, rpy=rpy)
    add(add(part, "geometry"), shape, **size)


def _add_fixed(
    robot: Element, parent: str, child: str, xyz: Iterable[float] = ZERO, rpy: Iterable[float] = ZERO
) -> None:
    add(_add_connection(robot, f"{child}_frame", "fixed", parent, child), "origin", xyz=xyz, rpy=rpy)


def _add_connection(robot: Element, name: str, kind: str, parent: str, child: str) -> Element:
    joint = add(robot, "joint", name=name, type=kind)
    add(joint, "parent", link=parent)
    add(joint, "child", link=child)
    return joint


def _along(direction: NDArray[np.float64]) -> tuple[float, float, float]:
    """Roll, pitch and yaw, rad, that turn z, along which a URDF cylinder lies, into a direction, (3,)."""
    x, y, z = direction
    return 0.0, float(np.arctan2(np.hypot(x, y), z)), float(np.arctan2(y, x))


def _add_ros2_control(robot: Element, arm: Arm, namespace: str) -> None:
    """A system of position interfaces of ros2_control that listens to the arm's states and sends it postures."""
    system = add(robot, "ros2_control", name=arm.name, type="system")
    hardware = add(system, "hardware")
    add(hardware, "plugin").text = PLUGIN
    for name, topic in TOPICS.items():
        add(hardware, "param", name=name).text = f"/{namespace.strip('/')}/{topic}"
    add(hardware, "param", name="trigger_joint_command_threshold").text = EVERY
    for one in rows(arm.joints):
        joint = add(system, "joint", name=one.name)
        command = add(joint, "command_interface", name="position")
        for name, limit in (("min", one.lower), ("max", one.upper)):
            add(command, "param", name=name).text = written(limit)
        for quantity in ("position", "velocity"):
            add(joint, "state_interface", name=quantity)
