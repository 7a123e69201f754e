"""A post of foam that stands still in the way of the arm, which runs into it: the contact that nobody steers."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.contact_battery.paths import Move
from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody

DEPTH = (0.02, 0.04)  # m to which the move would press the foam
RADIUS, HALF_LENGTH = 0.06, 0.10  # m of the post, which lies across the link
DAMPING = 5.0  # N s/m
CLEARANCE = 0.02  # m of everything else from the post
LATE = 0.6  # of the path; the way from there on is the direction of the blow
SAMPLES = 12  # of the path, and of each link


class Foam(NamedTuple):
    """A post as the parameters of an obstacle want it."""

    position: tuple[float, ...]  # m
    rotation: tuple[float, ...]  # rad, roll pitch yaw
    depth: float  # m, at the end of the move


class Blow:
    """A move of the arm that ends in foam.

    Parameters
    ----------
    arm, body : the arm and its kinematics.
    start : pose before the move, rad.
    move : towards its end the foam stands.
    """

    def __init__(self, arm: Arm, body: RigidBody, start: Sequence[float], move: Move) -> None:
        self._arm, self._body = arm, body
        self._begin, self._end = np.array(start), np.array(move.posture)

    def foam(self, random: np.random.Generator, cover: int, place: float) -> Foam | None:
        """A post that the link runs into at a place, m, None where it would hit otherwise or another thing."""
        name = self._arm.covers.names[cover]
        axis = self._body.cover_pose(self._end, name).rotation[:, 0]
        last, late = (self._body.point(self._pose(s), name, (place, 0.0, 0.0)) for s in (1.0, LATE))
        way = last - late
        way -= axis * (axis @ way)
        length = float(np.linalg.norm(way))
        if length < 1e-3:
            return None
        way /= length
        depth = float(random.uniform(*DEPTH))
        centre = last + way * (self._arm.covers.radius[cover] - depth + RADIUS)
        rotation = np.column_stack((axis, -way, np.cross(way, axis)))
        if not self._hits_as_meant(cover, centre, rotation, depth):
            return None
        return Foam(tuple(centre.tolist()), _roll_pitch_yaw(rotation), depth)

    def _pose(self, s: float) -> np.ndarray:
        return self._begin + (self._end - self._begin) * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)

    def _hits_as_meant(self, cover: int, centre: np.ndarray, rotation: np.ndarray, depth: float) -> bool:
        covers = self._arm.covers
        for s in np.linspace(0.0, 1.0, SAMPLES):
            for i, name in enumerate(covers.names):
                pose = self._body.cover_pose(self._pose(s), name)
                along = np.linspace(0.0, covers.length[i], SAMPLES)[:, None] * pose.rotation[:, 0] + pose.position
                seen = (along - centre) @ rotation
                beside = np.hypot(seen[:, 0], seen[:, 1]) - RADIUS
                gap = float(np.maximum(beside, np.abs(seen[:, 2]) - HALF_LENGTH).min()) - covers.radius[i]
                if gap < (CLEARANCE if i != cover or s < 0.5 else -1.2 * depth):
                    return False
        return True


def foam_values(foam: Foam, force: float, friction: float) -> dict[str, Any]:
    """The parameters of a post that is pressed with a force, N, at the end of the move."""
    return {
        "driver:world.obstacles.names": ["foam"],
        "driver:world.obstacles.shapes": ["cylinder"],
        "driver:world.obstacles.positions": list(foam.position),
        "driver:world.obstacles.rotations": list(foam.rotation),
        "driver:world.obstacles.sizes": [RADIUS, HALF_LENGTH, 0.0],
        "driver:world.obstacles.stiffness": [force / foam.depth],
        "driver:world.obstacles.damping": [DAMPING],
        "driver:world.obstacles.hardening": [0.0],
        "driver:world.obstacles.friction": [friction],
    }


def _roll_pitch_yaw(rotation: np.ndarray) -> tuple[float, ...]:
    """Of a rotation matrix (3, 3), about fixed x, then y, then z."""
    pitch = -math.asin(min(1.0, max(-1.0, float(rotation[2, 0]))))
    return math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0])
