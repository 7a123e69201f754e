"""Pushers of the plant: bodies that the simulator moves so that they press on a moving link."""

import math
from typing import Any

import mujoco
import numpy as np

from wam_description.arm import Arm
from wam_description.parameters import rows
from wam_description.small_matrices import cross


class Pusher:
    """A hand that follows the link and so presses with a constant force.

    Its pose is prescribed; its surface is soft and has friction.  The simulator knows the link's pose of the last
    step and extrapolates it by the link's velocity.

    Parameters
    ----------
    model, data : of MuJoCo.
    arm : for the cover's shape.
    given : its parameters.
    step : of the plant, s.

    Attributes
    ----------
    name : of the body and its geom.
    words : how hard which cover is pushed, and by whom.
    is_pressing : whether it pushes now.
    velocity : (3,), m/s, of its surface in the base frame.
    """

    def __init__(self, model: Any, data: Any, arm: Arm, given: Any, step: float) -> None:
        self.name = given.name
        self.words, self.is_pressing = f"{given.force:.4g} N on {given.cover} by {self.name}", False
        self.velocity = np.zeros(3)
        self._model, self._data, self._step = model, data, step
        mocap = int(model.body(self.name).mocapid[0])
        self._position, self._quaternion = data.mocap_pos[mocap], data.mocap_quat[mocap]
        self._away = model.body(self.name).pos.copy()
        self._is_away = True
        cover = next(one for one in rows(arm.covers) if one.name == given.cover)
        start, end = np.array(cover.start), np.array(cover.end)
        self._slope = (end - start) / (end[0] - start[0])  # of the tube's axis, per position along x
        self._axis = self._slope / np.linalg.norm(self._slope)
        self._origin = start - start[0] * self._slope
        self._site = model.site(f"{given.cover}_frame").id
        self._radius = cover.radius
        self._height = given.size[0 if given.shape == "sphere" else 2]
        self._given = given
        self._motion = np.zeros(6)

    def lead(self, time: float) -> None:
        """Move to the pose of the hand at a time, s since power-up."""
        data, given = self._data, self._given
        since = time - given.begin
        if not given.begin - given.rise <= time <= given.end + given.rise:
            if not self._is_away:
                self._position[:] = self._away
                self._is_away, self.is_pressing = True, False
            return
        self._is_away = False
        depth, sinking = self.depth(time)
        self.is_pressing = depth > 0.0
        force, across = self._directions(given.angle + given.turn * since)
        at = self._origin + (given.position + given.slide * since) * self._slope
        rotation = data.site_xmat[self._site].reshape(3, 3)
        mujoco.mj_objectVelocity(self._model, data, mujoco.mjtObj.mjOBJ_SITE, self._site, self._motion, 0)
        spin, drift = self._motion[:3], self._motion[3:]
        own = sinking * force + given.slide * self._axis + given.turn * self._radius * across
        self.velocity = drift + _cross(spin, rotation @ (at - self._radius * force)) + rotation @ own
        centre = rotation @ (at - (self._radius + self._height - depth) * force)
        carried = drift + _cross(spin, centre)
        self._position[:] = data.site_xpos[self._site] + centre + self._step * carried
        turned = rotation @ np.column_stack((self._axis, across, force))
        turned += self._step * np.cross(spin, turned.T).T
        mujoco.mju_mat2Quat(self._quaternion, turned.ravel())

    def depth(self, time: float) -> tuple[float, float]:
        """Depth of the surface in the link, m, negative before they touch, and its rate, m/s."""
        given = self._given
        coming, leaving = (time - given.begin) / given.rise, (given.end - time) / given.rise
        nearer, way = (coming, 1.0) if coming < leaving else (leaving, -1.0)
        pressed = given.force / given.stiffness
        if nearer >= 1.0:
            return pressed, 0.0
        size = pressed if nearer > 0.0 else -given.clearance
        blend = 0.5 * (1.0 - math.cos(math.pi * nearer))
        speed = 0.5 * math.pi * math.sin(math.pi * abs(nearer)) / given.rise
        return size * blend, way * abs(size) * speed

    def _directions(self, angle: float) -> tuple[np.ndarray, np.ndarray]:
        """Unit vectors of the force, at right angles to the tube, and of the normal of both, in the cover's frame."""
        force = np.array((0.0, math.cos(angle), math.sin(angle)))
        force -= self._axis * (self._axis @ force)
        force /= math.sqrt(force @ force)
        return force, _cross(force, self._axis)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.array(cross(a.tolist(), b.tolist()))
