"""The transform between motor space and joint space, (A.5), as the joint side uses it."""

from collections.abc import Sequence

from wam_description.arm import Arm
from wam_description.signals import State
from wam_description.transmission_map import TransmissionMap


class Transform:
    """Motor states to joint states, joint commands to motor commands."""

    def __init__(self, arm: Arm) -> None:
        self._map = TransmissionMap.of(arm)

    def joint_state(self, motors: State) -> State:
        """Joint angles, velocities and torques (n,) that belong to those of the motors, cables taken as rigid."""
        return State(
            self._map.joint_positions(motors.position),
            self._map.joint_velocities(motors.velocity),
            self._map.joint_torques(motors.effort),
        )

    def motor_velocity(self, velocity: Sequence[float]) -> list[float]:
        """Motor velocities (n,), rad/s, for joint velocities; empty stays empty."""
        return self._map.motor_velocities(velocity) if velocity else []

    def motor_effort(self, gravity: Sequence[float], effort: Sequence[float]) -> list[float]:
        """Motor torques (n,), N m, for gravity plus the joint torques `effort`."""
        return self._map.motor_torques([a + b for a, b in zip(gravity, effort, strict=True)])
