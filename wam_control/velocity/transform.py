"""The transform between motor space and joint space, (A.5), as the joint side uses it."""

from collections.abc import Sequence
from dataclasses import dataclass

from wam_description.arm import Arm
from wam_description.parameters import parameter
from wam_description.signals import State


@dataclass(frozen=True)
class TransformParameters:
    """What the transform knows of the cables."""

    creep_correction: bool = parameter(
        "true: joint angles are corrected for the creep of the cables (6.19), which is computed from the motor torques",
    )


class Transform:
    """Motor states to joint states, joint commands to motor commands.

    The creep of each circuit at its motor, rad, along the motor's travel, is the integral of loss tau |d theta|,
    (6.19), section 6.4.3; friction and acceleration of the rotors count as load, elastic stretch is not in it.  It
    starts at zero, so joint angles are right where the motors were referenced.

    Parameters
    ----------
    arm : the arm as the controllers know it.
    creep_correction : as in `TransformParameters`.
    """

    def __init__(self, arm: Arm, creep_correction: bool = False) -> None:
        self._map = arm.transmission
        self._losses = [circuit.loss_per_torque for circuit in arm.circuits] if creep_correction else []
        self._creep = [0.0] * len(self._losses)
        self._before: list[float] = []

    def joint_state(self, motors: State) -> State:
        """Joint angles, velocities and torques (n,) that belong to those of the motors, cables not stretched."""
        theta = angles = motors.position
        if self._losses:
            for i, (angle, before) in enumerate(zip(theta, self._before or theta, strict=True)):
                self._creep[i] += self._losses[i] * abs(angle - before) * motors.effort[i]
            self._before = list(theta)  # the caller may change it
            angles = [angle - crept for angle, crept in zip(theta, self._creep, strict=True)]
        return State(
            self._map.joint_motion(angles),
            self._map.joint_motion(motors.velocity),
            self._map.joint_torques(motors.effort),
        )

    def motor_velocity(self, velocity: Sequence[float]) -> list[float]:
        """Motor velocities (n,), rad/s, for joint velocities; empty stays empty."""
        return self._map.motor_motion(velocity) if velocity else []

    def motor_effort(self, gravity: Sequence[float], effort: Sequence[float]) -> list[float]:
        """Motor torques (n,), N m, for gravity plus the joint torques `effort`."""
        return self._map.motor_torques([a + b for a, b in zip(gravity, effort, strict=True)])
