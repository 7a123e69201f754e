"""Objects of the world that move: obstacles with a given motion, and the truth about every object."""

import math
from typing import Any

import mujoco
import numpy as np

from wam_description.arm import Arm
from wam_description.mjcf_objects import hinge_name
from wam_description.rigid_body import Array
from wam_description.signals import ObjectState
from wam_description.world import World
from wam_driver.loads import contact_force, sides


class MovingObstacle:
    """An obstacle that the plant moves, at + b(t) a sin(2 pi f t), with b from 0 to 1 in the first quarter period.

    Parameters
    ----------
    model, data : of MuJoCo.
    motion : its parameters.

    Attributes
    ----------
    name : of the body and its geom.
    velocity : (3,), m/s, of its surface in the base frame.
    """

    def __init__(self, model: Any, data: Any, motion: Any) -> None:
        self.name = name = motion.obstacle
        self.velocity: Array = np.zeros(3)
        self._position = data.mocap_pos[int(model.body(name).mocapid[0])]
        self._centre = model.body(name).pos.copy()
        self._amplitude = np.array(motion.amplitude)
        self._begin, self._rate = motion.begin, 2.0 * math.pi * motion.frequency

    def lead(self, time: float) -> None:
        """Move to the position at a time, s since power-up."""
        at, speed = self.motion(time)
        self._position[:] = self._centre + at * self._amplitude
        self.velocity = speed * self._amplitude

    def motion(self, time: float) -> tuple[float, float]:
        """Displacement per amplitude, and its rate, 1/s, at a time, s."""
        phase = self._rate * (time - self._begin)
        if phase <= 0.0:
            return 0.0, 0.0
        s = min(phase / (0.5 * math.pi), 1.0)
        blend, slope = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / (0.5 * math.pi)
        sine, cosine = math.sin(phase), math.cos(phase)
        return blend * sine, self._rate * (blend * cosine + slope * sine)


class TrueObjects:
    """Pose, motion and contact forces of the objects of a world, in the order of `World.objects`.

    Parameters
    ----------
    model, data : of MuJoCo.
    arm : its covers.
    world : the objects.
    movers : the obstacles that move, by name.
    """

    def __init__(self, model: Any, data: Any, arm: Arm, world: World, movers: dict[str, MovingObstacle]) -> None:
        self._model, self._data, self._movers = model, data, movers
        self.names = world.objects
        self._index = {model.geom(name).id: i for i, name in enumerate(self.names)}
        self._covers = {model.geom(name).id for name in arm.covers.names}
        self._bodies = [model.body(name).id for name in self.names]
        doors = (door.name for door in world.doors.present)
        self._angles = {name: int(model.joint(hinge_name(name)).qposadr[0]) for name in doors}
        self._motion = np.zeros(6)

    def measure(self) -> list[ObjectState]:
        """The state of every object at the start of the last step."""
        if not self.names:
            return []
        data, wrenches = self._data, np.zeros((2, len(self.names), 6))
        for k, geom, other, sign in sides(data):
            if geom in self._index:
                i, force = self._index[geom], contact_force(self._model, data, k)
                lever = data.contact.pos[k] - data.xpos[self._bodies[i]]
                by = wrenches[int(other in self._covers), i]
                by += sign * np.concatenate([force, np.cross(lever, force)])
        by_others, by_arm = wrenches
        return [self._state(i, name, by_arm[i], by_others[i, :3]) for i, name in enumerate(self.names)]

    def _state(self, i: int, name: str, by_arm: Array, by_others: Array) -> ObjectState:
        data, body = self._data, self._bodies[i]
        w, x, y, z = data.xquat[body].tolist()
        if name in self._movers:
            velocity = self._movers[name].velocity
        else:
            mujoco.mj_objectVelocity(self._model, data, mujoco.mjtObj.mjOBJ_BODY, body, self._motion, 0)
            velocity = self._motion[3:]
        angle = float(data.qpos[self._angles[name]]) if name in self._angles else math.nan
        pose, moves = (*data.xpos[body].tolist(), x, y, z, w), velocity.tolist()
        return ObjectState._make((i, *pose, *moves, angle, *by_arm.tolist(), *by_others.tolist()))
