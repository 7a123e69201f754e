"""The moving parts of an arm as parameters: motors, joints and links, each in the order of the `names` of its group."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wam_description.parameters import named, parameter, require, rows
from wam_description.small_matrices import Array
from wam_description.thresholds import MODEL


@dataclass(frozen=True)
class Motors:
    """The motors, one per cable circuit."""

    names: tuple[str, ...] = parameter("motor names, as in JointState messages")
    inertia: tuple[float, ...] = parameter("rotor inertia", "kg m^2", low=1e-9, high=1e5)
    torque_constant: tuple[float, ...] = parameter("torque per current", "N m/A", low=1e-6, high=100.0)
    peak_torque: tuple[float, ...] = parameter("peak torque, at which the amplifier clips", "N m")
    continuous_torque: tuple[float, ...] = parameter("rated (continuous) torque", "N m", low=1e-6)
    static_friction: tuple[float, ...] = parameter(
        "static friction F_s (breakaway torque) of rotor and first pinion", "N m", high=100.0
    )
    dynamic_friction: tuple[float, ...] = parameter("dynamic friction F_d in motion", "N m", high=100.0)
    viscous_friction: tuple[float, ...] = parameter("viscous friction", "N m s/rad", high=10.0)

    def __post_init__(self) -> None:
        _check_shafts("arm.motors", self)
        for one in rows(self):
            require(
                one.continuous_torque <= one.peak_torque,
                f"{one.name}: arm.motors.continuous_torque {one.continuous_torque:g} N m is above peak_torque "
                f"{one.peak_torque:g} N m",
            )

    @cached_property
    def peak_current(self) -> tuple[float, ...]:
        """Current of each motor at its peak torque, (n,), A."""
        return tuple(torque / k for torque, k in zip(self.peak_torque, self.torque_constant, strict=True))


@dataclass(frozen=True)
class Joints:
    """The joints in Craig's Denavit-Hartenberg convention (A.4)."""

    names: tuple[str, ...] = parameter("joint names, as in JointState messages")
    twist: tuple[float, ...] = parameter("alpha_(i-1), link twist before the joint", "rad", within=6.3)
    length: tuple[float, ...] = parameter("a_(i-1), link length before the joint", "m", within=3.0)
    offset: tuple[float, ...] = parameter("d_i, link offset along the joint axis", "m", within=3.0)
    lower: tuple[float, ...] = parameter("lower stop", "rad", within=13.0)
    upper: tuple[float, ...] = parameter("upper stop", "rad", within=13.0)
    start: tuple[float, ...] = parameter("angle at power-up, brakes on", "rad", within=13.0)
    armature: tuple[float, ...] = parameter("inertia of the pulleys that turn with the joint", "kg m^2", high=1e3)
    static_friction: tuple[float, ...] = parameter(
        "static friction F_s (breakaway torque) at the joint", "N m", high=1e3
    )
    dynamic_friction: tuple[float, ...] = parameter("dynamic friction F_d in motion, at the joint", "N m", high=1e3)
    viscous_friction: tuple[float, ...] = parameter("viscous friction at the joint", "N m s/rad", high=1e3)
    speed_limit: tuple[float, ...] = parameter("speed above which there is a fault", "rad/s", high=100.0)

    def __post_init__(self) -> None:
        _check_shafts("arm.joints", self)
        for one in rows(self):
            require(
                one.lower < one.upper,
                f"{one.name}: arm.joints.lower {one.lower:g} rad is not below upper {one.upper:g} rad",
            )
            require(
                one.lower <= one.start <= one.upper,
                f"{one.name}: arm.joints.start {one.start:g} rad is outside {one.lower:g} to {one.upper:g} rad",
            )

    @property
    def places(self) -> list[tuple[float, float, float]]:
        """Origin of the frame of each joint in that of the one before it, x y z, m."""
        shapes = zip(self.twist, self.length, self.offset, strict=True)
        return [(length, -math.sin(twist) * offset, math.cos(twist) * offset) for twist, length, offset in shapes]

    def beyond(self, posture: Sequence[float]) -> str:
        """Why a posture (n,), rad, is refused: the first joint beyond its stops; '' where none is."""
        for name, angle, low, high in zip(self.names, posture, self.lower, self.upper, strict=True):
            if not low <= angle <= high:
                return f"{name} is commanded to {angle:.4g} rad; allowed: {low:.4g} to {high:.4g} rad"
        return ""


def _check_shafts(group: str, shafts: Motors | Joints) -> None:
    """Refuse a name twice, a list that has not one value each, and friction that grows with the motion."""
    named(group, shafts, least=1)
    for one in rows(shafts):
        require(
            one.dynamic_friction <= one.static_friction,
            f"{one.name}: {group}.dynamic_friction {one.dynamic_friction:g} N m is above static_friction "
            f"{one.static_friction:g} N m",
        )


@dataclass(frozen=True)
class Links:
    """The rigid links; link i moves with joint i, its frame is frame i of (A.4)."""

    names: tuple[str, ...] = parameter("link names, one per joint, as in frame ids")
    mass: tuple[float, ...] = parameter("mass", "kg", low=1e-6, high=500.0)
    centre: tuple[float, ...] = parameter(
        "centre of mass in the link's frame, x y z of each link", "m", within=3.0, width=3
    )
    inertia: tuple[float, ...] = parameter(
        "moments of inertia about the centre of mass, along the axes of the link's frame, xx yy zz",
        "kg m^2",
        high=100.0,
        width=3,
    )
    product: tuple[float, ...] = parameter(
        "elements xy xz yz of the same inertia tensor; zero if the axes are principal",
        "kg m^2",
        within=100.0,
        width=3,
    )

    def __post_init__(self) -> None:
        named("arm.links", self, least=1)
        for link in rows(self):
            least = float(np.linalg.eigvalsh(tensor(link))[0])
            require(
                least >= 0.0,
                f"{link.name}: arm.links.inertia and product give a principal inertia of {least:.3g} kg m^2, below 0",
            )

    def require_bodies(self) -> None:
        """Refuse inertias that no body has; those of an identified model need only move the arm alike.

        Raises
        ------
        ParameterError
            names the link and its inertias.
        """
        for link in rows(self):
            least, middle, largest = np.linalg.eigvalsh(tensor(link)).tolist()
            require(
                largest <= (least + middle) * (1.0 + MODEL.rounded),
                f"{link.name}: arm.links.inertia and product give the principal inertias {least:.4g}, {middle:.4g} and "
                f"{largest:.4g} kg m^2; of no body is the largest one above the sum of the others, "
                f"{least + middle:.4g} kg m^2",
            )


def tensor(link: Any) -> Array:
    """Inertia tensor of one of the `rows` of the links, about its centre of mass in its frame, (3, 3), kg m^2."""
    (xx, yy, zz), (xy, xz, yz) = link.inertia, link.product
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
