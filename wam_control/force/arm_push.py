"""What pushes the arm, wherever it does, and the motion that gives way to it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.force.thresholds import FORCE
from wam_description.rigid_body import RigidBody

Array = NDArray[np.float64]


class ArmPush(NamedTuple):
    """What pushes the arm.

    Attributes
    ----------
    torques, torque_sd : of the world on the joints (n,), N m, and the standard deviation of each.
    position : cover and position, m, where it pushes; None where that is not known, and the tool is assumed.
    allowed : N, up to which the arm does not give way.
    gain : speed of the tool per force above it, m/s/N: near the base the arm is stiffer and moves less.
    is_estimated : whether the position is that of an estimated contact, as far out as it may be.
    """

    torques: Array
    torque_sd: Array
    position: tuple[str, float] | None
    allowed: float
    gain: float
    is_estimated: bool = False

    def least(self, body: RigidBody, q: Sequence[float], above: float = 0.0) -> float:
        """Smallest force, N, that explains the torques there, less what is uncertain of them.

        One that is certainly not `above` this, N, is returned as 0: the singular values, squared, of the Jacobian have
        their mean below the largest.
        """
        size = self._size
        if not size:
            return 0.0
        jacobian = self.jacobian(body, q)
        flat = jacobian.ravel(order="K")
        if above and size <= above * math.sqrt(flat.dot(flat)) / math.sqrt(3.0):
            return 0.0
        return size / self._lever(jacobian)

    def correction(
        self, body: RigidBody, q: Sequence[float], velocity: Sequence[float], force: float, fastest: float
    ) -> Array:
        """What joint velocities (n,), rad/s, lack so that they go against a push no faster than its force law.

        The law is a speed per force below the allowed one; above it the arm gives way, each joint by at most
        `fastest`, rad/s.  `force`, N, is that of the push.
        """
        size = float(np.linalg.norm(self.torques))
        if not size:
            return np.zeros_like(self.torques)
        along = self.torques / size
        law = min(self.gain * (force - self.allowed) / self._lever(body.tool_jacobian(q)), fastest)
        missing: Array = along * max(law - float(along @ velocity), 0.0)
        return missing

    def jacobian(self, body: RigidBody, q: Sequence[float]) -> Array:
        """Velocity of the pushed point per joint velocity (3, n), m/rad."""
        if self.position is None:
            return body.tool_jacobian(q)
        cover, position = self.position
        return body.point_jacobian(q, cover, (position, 0.0, 0.0))

    @property
    def _size(self) -> float:
        """Size of the torques, N m, less what is uncertain of them."""
        size, sd = math.sqrt(self.torques.dot(self.torques)), math.sqrt(self.torque_sd.dot(self.torque_sd))
        return max(size - FORCE.certain * sd, 0.0)

    def _lever(self, jacobian: Array) -> float:
        """Largest torque per force, m."""
        return max(math.sqrt(float(np.linalg.eigvalsh(jacobian @ jacobian.T)[-1])), FORCE.shortest_lever)
