"""The surface of a task: where the plane or the rod is, and whether the arm is clear of it at the start."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wam_description.rigid_body import Array, RigidBody
from wam_description.signals import Triple


@dataclass(frozen=True)
class SurfaceShape:
    """Size of the plane and the rod, and their distance from the arm at the start."""

    gap: float = 0.002  # m, between link and surface
    clearance: float = 0.03  # m, between the surface and the rest of the arm
    rod: tuple[float, float] = (0.02, 0.08)  # m, radius and half length; the link touches it at one position
    plane: float = 0.5  # m, half length
    points: int = 20  # along each cover, at which the distance is checked
    soft: float = 4000.0  # N/m, below which the damping follows the stiffness
    soft_damping: float = 0.005  # s, damping per stiffness
    damping: float = 20.0  # N s/m


SHAPE = SurfaceShape()
NAMES = ("surface", "second_surface")


class Surface(NamedTuple):
    """What is touched, and where.

    Attributes
    ----------
    cover, position : where the link touches, m along the cover.
    direction : of the force of the arm on the surface (3,), base frame.
    stiffness : N/m.
    friction : coefficient.
    is_plane : whether it is a plane, else a rod across the link.
    motion : amplitude of its motion, a sine (3,), base frame, m.
    frequency : of the motion, Hz; 0 for a surface at rest.
    begin : of the motion, since power-up, s.
    """

    cover: str
    position: float
    direction: Triple
    stiffness: float
    friction: float
    is_plane: bool
    motion: Triple = (0.0, 0.0, 0.0)
    frequency: float = 0.0
    begin: float = 0.0

    @property
    def speed(self) -> float:
        """Largest speed along the force, m/s."""
        along = sum(a * b for a, b in zip(self.direction, self.motion, strict=True))
        return 2.0 * math.pi * self.frequency * abs(along)

    @property
    def slide_speed(self) -> float:
        """Largest speed across the force, m/s."""
        whole = 2.0 * math.pi * self.frequency * math.hypot(*self.motion)
        return math.sqrt(max(whole * whole - self.speed * self.speed, 0.0))

    def slide(self, link: Array) -> float:
        """Standard deviation of the motion along a link, whose direction is given (3,), m."""
        return abs(float(link @ np.array(self.motion))) / math.sqrt(2.0)


def is_clear(body: RigidBody, q: Sequence[float], surface: Surface) -> bool:
    """Whether a surface touches nothing in the pose q, rad, and only its link is nearer than `SHAPE.clearance`."""
    covers = body.arm.covers
    centre, axis, into = position(body, q, surface), rotation(body, q, surface)[:, 2], np.array(surface.direction)
    for name, radius, length in zip(covers.names, covers.radius, covers.length, strict=True):
        for place in np.linspace(0.0, length, SHAPE.points):
            apart = centre - body.point(q, name, covers.on_axis(name, place))
            if surface.is_plane:
                distance = float(apart @ into)
            else:
                along = min(max(float(-apart @ axis), -SHAPE.rod[1]), SHAPE.rod[1])
                distance = float(np.linalg.norm(apart + along * axis)) - SHAPE.rod[0]
            if distance < radius + (0.9 * SHAPE.gap if name == surface.cover else SHAPE.clearance):
                return False
    return True


def position(body: RigidBody, q: Sequence[float], surface: Surface) -> Array:
    """A point of the plane, or the centre of the rod, (3,), m, base frame."""
    covers = body.arm.covers
    radius = covers.radius_of(surface.cover)
    point = body.point(q, surface.cover, covers.on_axis(surface.cover, surface.position))
    return point + (radius + SHAPE.gap + (0.0 if surface.is_plane else SHAPE.rod[0])) * np.array(surface.direction)


def rotation(body: RigidBody, q: Sequence[float], surface: Surface) -> Array:
    """Rotation (3, 3): z against the force for a plane; along the rod, across the link, for a rod."""
    direction = np.array(surface.direction)
    across = np.cross(direction, body.cover_pose(q, surface.cover).rotation[:, 0])
    across /= np.linalg.norm(across)
    if surface.is_plane:
        return np.column_stack([across, np.cross(-direction, across), -direction])
    return np.column_stack([-direction, np.cross(across, -direction), across])


def obstacles(body: RigidBody, q: Sequence[float], surfaces: Sequence[Surface]) -> dict[str, Any]:
    """Values of a configuration whose world are these surfaces alone, by the names `NAMES`."""
    found: dict[str, list[Any]] = {}
    for name, surface in zip(NAMES, surfaces, strict=False):
        soft = surface.stiffness < SHAPE.soft
        values = {
            "obstacles.names": [name],
            "obstacles.shapes": ["plane" if surface.is_plane else "cylinder"],
            "obstacles.positions": position(body, q, surface).tolist(),
            "obstacles.rotations": pin.rpy.matrixToRpy(rotation(body, q, surface)).tolist(),
            "obstacles.sizes": [SHAPE.plane, SHAPE.plane, 0.0] if surface.is_plane else [*SHAPE.rod, 0.0],
            "obstacles.stiffness": [surface.stiffness],
            "obstacles.damping": [SHAPE.soft_damping * surface.stiffness if soft else SHAPE.damping],
            "obstacles.hardening": [0.0],
            "obstacles.friction": [surface.friction],
            "motions.obstacles": [name],
            "motions.amplitude": list(surface.motion),
            "motions.frequency": [surface.frequency],
            "motions.begin": [surface.begin],
        }
        for key, value in values.items():
            found[f"driver:world.{key}"] = [*found.get(f"driver:world.{key}", []), *value]
    return found
