"""What the driver watches: each quantity, its limit, and the warning near it."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_description.transmission_map import TransmissionMap

WARNING = 0.9  # of a limit
LEEWAY = 0.05  # rad, by which an arm that was enabled beyond a stop may go on before it is stopped again


class WatchedLimit(NamedTuple):
    """A quantity that is a fault above its limit and a warning near it."""

    quantity: str
    value: float
    limit: float
    unit: str

    @property
    def is_near(self) -> bool:
        """Whether it is worth a warning."""
        return self.value > WARNING * self.limit

    @property
    def warning(self) -> str:
        """The warning, in words."""
        return f"{self.quantity} {self.value:.2f} {self.unit} is near its limit {self.limit:g}"

    @property
    def excess(self) -> str:
        """That the quantity is above its limit, '' while it is not."""
        if self.value <= self.limit:
            return ""
        return f"{self.quantity} {self.value:.2f} {self.unit} is above its limit {self.limit:g}"

    @property
    def fault(self) -> str:
        """Why the driver stops, '' while the quantity is within its limit."""
        return f"{self.excess}; command less" if self.excess else ""


class LimitWatch:
    """Speeds and travel of the arm from its motors, currents, and tensions of the cables, against their limits.

    Parameters
    ----------
    arm : the arm as it is configured.
    elbow_speed_limit, tip_speed_limit : m/s.
    """

    def __init__(self, arm: Arm, elbow_speed_limit: float, tip_speed_limit: float) -> None:
        self._arm = arm
        self._elbow_speed_limit, self._tip_speed_limit = elbow_speed_limit, tip_speed_limit
        self._map = TransmissionMap.of(arm)
        self._body = RigidBody(arm)
        motors, joints = arm.motors, arm.joints
        self._peak = [torque / k for torque, k in zip(motors.peak_torque, motors.torque_constant, strict=True)]
        self._middle = [0.5 * (low + high) for low, high in zip(joints.lower, joints.upper, strict=True)]
        self._half = [0.5 * (high - low) for low, high in zip(joints.lower, joints.upper, strict=True)]
        self._travel = self._half

    def begin(self, theta: Sequence[float]) -> None:
        """The brakes are released at the motor angles theta, (n,), rad: an arm beyond a stop may come back."""
        q = self._map.joint_positions(theta)
        there = [abs(angle - middle) for angle, middle in zip(q, self._middle, strict=True)]
        self._travel = [half if at <= half else at + LEEWAY for at, half in zip(there, self._half, strict=True)]

    def watched(
        self, theta: Sequence[float], thetad: Sequence[float], currents: Sequence[float], tensions: Sequence[float]
    ) -> Iterator[WatchedLimit]:
        """Every quantity with its limit.

        Parameters
        ----------
        theta, thetad : angles, rad, and velocities, rad/s, of the motors, (n,).
        currents : of the motors, A, (n,).
        tensions : largest of each cable since the last check, N, (n,).
        """
        q, qd = self._map.joint_positions(theta), self._map.joint_velocities(thetad)
        yield from self._speeds(q, qd)
        yield from self._travels(q)
        for name, current, limit in zip(self._arm.motors.names, currents, self._peak, strict=True):
            yield WatchedLimit(f"current of {name}", abs(current), limit, "A")
        yield from self.tensions(tensions)

    def tensions(self, tensions: Sequence[float]) -> Iterator[WatchedLimit]:
        """Tension of each cable with its breaking strength, also while the brakes stop the arm; (n,), N."""
        for name, tension, circuit in zip(self._arm.motors.names, tensions, self._arm.circuits, strict=True):
            yield WatchedLimit(f"cable tension of {name}", tension, circuit.breaking_strength, "N")

    def _speeds(self, q: list[float], qd: list[float]) -> Iterator[WatchedLimit]:
        joints = self._arm.joints
        tip = self._body.tool_jacobian(q) @ qd
        for cover, velocity in self._body.start_velocities(q, qd).items():
            yield WatchedLimit(f"speed of the start of {cover}", math.hypot(*velocity), self._elbow_speed_limit, "m/s")
        yield WatchedLimit("speed of the tip", math.hypot(*tip), self._tip_speed_limit, "m/s")
        for name, speed, limit in zip(joints.names, qd, joints.speed_limit, strict=True):
            yield WatchedLimit(f"speed of {name}", abs(speed), limit, "rad/s")

    def _travels(self, q: list[float]) -> Iterator[WatchedLimit]:
        for name, angle, middle, limit in zip(self._arm.joints.names, q, self._middle, self._travel, strict=True):
            yield WatchedLimit(f"travel of {name} from the middle of its range", abs(angle - middle), limit, "rad")
