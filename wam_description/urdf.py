"""The arm as URDF, for robot_state_publisher, viewers and other tools.

Links: ``base_link``, the root by REP 120, ``base`` in the same place, the links of the arm, a frame for
each cover (named like the cover, so that contacts find it in TF) and ``tool``.  The tubes are drawn as
cylinders with spheres at both ends.
"""

from collections.abc import Iterable
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from wam_description.arm import Arm
from wam_description.rigid_body import cover_placement, joint_placement
from wam_description.transmission_map import TransmissionMap

ROOT = "base_link"
BASE = "base"
TOOL = "tool"


def urdf(arm: Arm) -> str:
    """URDF of the arm: kinematics, inertia of the links, limits and tubes.

    A joint's effort limit is the peak torque of the motors that drive it, its velocity limit the speed
    above which the driver faults.  Lengths in m, angles in rad, frames of (A.4).
    """
    robot = Element("robot", name=arm.name)
    SubElement(robot, "link", name=ROOT)
    SubElement(robot, "link", name=BASE)
    _add_fixed(robot, ROOT, BASE, _origin((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    for i in range(len(arm.links.names)):
        _add_link(robot, arm, i)
    for i in range(len(arm.covers.names)):
        _add_cover(robot, arm, i)
    _add_tool(robot, arm)
    efforts = TransmissionMap.of(arm).largest_joint_torques(arm.motors.peak_torque)
    for i, effort in enumerate(efforts):
        _add_joint(robot, arm, i, effort)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _add_link(robot: Element, arm: Arm, i: int) -> None:
    link = SubElement(robot, "link", name=arm.links.names[i])
    inertial = SubElement(link, "inertial")
    inertial.append(_origin(_triple(arm.carried.centre, i), (0.0, 0.0, 0.0)))
    SubElement(inertial, "mass", value=_numbers([arm.carried.mass[i]]))
    tensor = arm.carried.tensor(i).tolist()
    elements = ((a, b) for a in range(3) for b in range(a, 3))
    SubElement(inertial, "inertia", {f"i{'xyz'[a]}{'xyz'[b]}": _numbers([tensor[a][b]]) for a, b in elements})
    for cover, carrier in enumerate(arm.covers.links):
        if carrier == arm.links.names[i]:
            _add_tube(link, arm, cover)


def _add_joint(robot: Element, arm: Arm, i: int, effort: float) -> None:
    joint = SubElement(robot, "joint", name=arm.joints.names[i], type="revolute")
    SubElement(joint, "parent", link=arm.links.names[i - 1] if i else BASE)
    SubElement(joint, "child", link=arm.links.names[i])
    joint.append(_origin(joint_placement(arm, i).translation, (arm.joints.twist[i], 0.0, 0.0)))
    SubElement(joint, "axis", xyz="0 0 1")
    SubElement(
        joint,
        "limit",
        lower=_numbers([arm.joints.lower[i]]),
        upper=_numbers([arm.joints.upper[i]]),
        effort=_numbers([effort]),
        velocity=_numbers([arm.joints.speed_limit[i]]),
    )


def _add_cover(robot: Element, arm: Arm, i: int) -> None:
    SubElement(robot, "link", name=arm.covers.names[i])
    origin = _origin(_triple(arm.covers.origin, i), _triple(arm.covers.rotation, i))
    _add_fixed(robot, arm.covers.links[i], arm.covers.names[i], origin)


def _add_tube(link: Element, arm: Arm, i: int) -> None:
    """Draw cover i on the link that carries it: geometry on a massless frame gets a mass in MuJoCo."""
    cover = cover_placement(arm, i)
    start, end = (cover.act(np.array(_triple(ends, i))) for ends in (arm.covers.start, arm.covers.end))
    turn = _along(end - start)
    radius = _numbers([arm.covers.radius[i]])
    length = _numbers([float(np.linalg.norm(end - start))])
    for tag in ("visual", "collision"):
        _add_shape(link, tag, _origin((start + end) / 2.0, turn), "cylinder", radius=radius, length=length)
        _add_shape(link, tag, _origin(start, turn), "sphere", radius=radius)
        _add_shape(link, tag, _origin(end, turn), "sphere", radius=radius)


def _add_shape(link: Element, tag: str, origin: Element, shape: str, **size: str) -> None:
    part = SubElement(link, tag)
    part.append(origin)
    SubElement(SubElement(part, "geometry"), shape, size)


def _add_tool(robot: Element, arm: Arm) -> None:
    SubElement(robot, "link", name=TOOL)
    _add_fixed(robot, arm.links.names[-1], TOOL, _origin(arm.tool, (0.0, 0.0, 0.0)))


def _add_fixed(robot: Element, parent: str, child: str, origin: Element) -> None:
    joint = SubElement(robot, "joint", name=f"{child}_frame", type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    joint.append(origin)


def _along(direction: NDArray[np.float64]) -> tuple[float, float, float]:
    """Roll, pitch and yaw, rad, that turn z, along which a URDF cylinder lies, into a direction, (3,)."""
    x, y, z = direction
    return 0.0, float(np.arctan2(np.hypot(x, y), z)), float(np.arctan2(y, x))


def _origin(xyz: Iterable[float], rpy: Iterable[float]) -> Element:
    return Element("origin", xyz=_numbers(xyz), rpy=_numbers(rpy))


def _triple(values: tuple[float, ...], i: int) -> tuple[float, ...]:
    return values[3 * i : 3 * i + 3]


def _numbers(values: Iterable[float]) -> str:
    """Numbers as XML text that reads back to the same floats."""
    return " ".join(repr(float(value)) for value in values)
