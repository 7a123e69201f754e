"""A fixed foam post in the path of the arm: a contact that no pusher controls."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_studies.contact.moves import Move


@dataclass(frozen=True)
class FoamShape:
    """The post, and what is kept clear of it."""

    depth: tuple[float, float] = (0.02, 0.04)  # m, of the foam at the end of the unimpeded move
    radius: float = 0.06  # m, of the post, which is normal to the link
    half_length: float = 0.10  # m
    damping: float = 5.0  # N s/m
    clearance: float = 0.02  # m between the post and everything else
    late: float = 0.6  # of the path; the motion after it gives the direction of the collision
    samples: int = 12  # along the path, and along each link


SHAPE = FoamShape()


class Foam(NamedTuple):
    """The post as an obstacle."""

    position: tuple[float, ...]  # m
    rotation: tuple[float, ...]  # rad, roll pitch yaw
    depth: float  # m, at the end of the move


class FoamCollision:
    """A move of the arm into foam.

    Parameters
    ----------
    arm, body : the arm and its kinematics.
    start : pose before the move, rad.
    move : ends in the foam.
    """

    def __init__(self, arm: Arm, body: RigidBody, start: Sequence[float], move: Move) -> None:
        self._arm, self._body = arm, body
        self._begin, self._end = np.array(start), np.array(move.posture)

    def foam(self, random: np.random.Generator, cover: int, position: float) -> Foam | None:
        """A post that meets the link at a position, m; None if it would meet anything else."""
        name = self._arm.covers.names[cover]
        axis = self._body.cover_pose(self._end, name).rotation[:, 0]
        last, late = (self._body.point(self._pose(s), name, (position, 0.0, 0.0)) for s in (1.0, SHAPE.late))
        way = last - late
        way -= axis * (axis @ way)
        length = float(np.linalg.norm(way))
        if length < 1e-3:
            return None
        way /= length
        depth = float(random.uniform(*SHAPE.depth))
        centre = last + way * (self._arm.covers.radius[cover] - depth + SHAPE.radius)
        rotation = np.column_stack((axis, -way, np.cross(way, axis)))
        if not self._meets_only(cover, centre, rotation, depth):
            return None
        return Foam(tuple(centre.tolist()), _roll_pitch_yaw(rotation), depth)

    def _pose(self, s: float) -> np.ndarray:
        return self._begin + (self._end - self._begin) * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)

    def _meets_only(self, cover: int, centre: np.ndarray, rotation: np.ndarray, depth: float) -> bool:
        covers = self._arm.covers
        for s in np.linspace(0.0, 1.0, SHAPE.samples):
            for i, name in enumerate(covers.names):
                pose = self._body.cover_pose(self._pose(s), name)
                along = np.linspace(0.0, covers.length[i], SHAPE.samples)[:, None] * pose.rotation[:, 0] + pose.position
                seen = (along - centre) @ rotation
                outside = np.hypot(seen[:, 0], seen[:, 1]) - SHAPE.radius
                gap = float(np.maximum(outside, np.abs(seen[:, 2]) - SHAPE.half_length).min()) - covers.radius[i]
                if gap < (SHAPE.clearance if i != cover or s < 0.5 else -1.2 * depth):
                    return False
        return True


def foam_values(foam: Foam, force: float, friction: float) -> dict[str, Any]:
    """Parameters of the post; its force is `force`, N, at its depth."""
    return {
        "driver:world.obstacles.names": ["foam"],
        "driver:world.obstacles.shapes": ["cylinder"],
        "driver:world.obstacles.positions": list(foam.position),
        "driver:world.obstacles.rotations": list(foam.rotation),
        "driver:world.obstacles.sizes": [SHAPE.radius, SHAPE.half_length, 0.0],
        "driver:world.obstacles.stiffness": [force / foam.depth],
        "driver:world.obstacles.damping": [SHAPE.damping],
        "driver:world.obstacles.hardening": [0.0],
        "driver:world.obstacles.friction": [friction],
    }


def _roll_pitch_yaw(rotation: np.ndarray) -> tuple[float, ...]:
    """Fixed-axis x, y, z angles of a rotation matrix (3, 3), rad."""
    pitch = -math.asin(min(1.0, max(-1.0, float(rotation[2, 0]))))
    return math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0])
