"""Samples of the motors as those of the joints, with the nominal friction on the way and how certain it is."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import ShaftFriction
from wam_control.contact.velocity_fit import VelocityFit
from wam_description.arm import Arm
from wam_description.model import ArmModel
from wam_description.signals import State
from wam_description.transmission_map import TransmissionMap

Array = NDArray[np.float64]


class JointSample(NamedTuple):
    """State of the joints and torque of the motors at them, (n,); friction, (n,), N m, and signals of the shafts.

    `friction` and `signals` are empty on the link side, which lies behind the friction; `dt` in s since the one before.
    """

    q: list[float]
    qd: list[float]
    tau: list[float]
    friction: list[float]
    signals: list[float]
    dt: float


class MotorSide:
    """Rotors and cables between the motors and the joints.

    Parameters
    ----------
    arm : the arm as modelled.
    parameters : of the observer.
    has_dither : whether the motors swing: then the friction of a shaft that has come to rest is not kept.
    model : the identified model; None for none.

    Attributes
    ----------
    map : between motors and joints.
    motors, joints : their friction.
    inertia : (n, n), of rotors and pulleys at the joints, kg m^2.
    """

    def __init__(self, arm: Arm, parameters: ObserverParameters, has_dither: bool, model: ArmModel | None) -> None:
        self.map = TransmissionMap.of(arm)
        self._squared = np.square(self.map.joint_from_motor)
        self.inertia: Array = self.map.at_joints(arm.motors.inertia) + np.diag(arm.joints.armature)
        is_identified = model is not None and model.is_identified
        at_motors, at_joints = (model.motors, model.joints) if model else (None, None)
        self.motors, self.joints = (
            ShaftFriction(shafts, parameters, rest, at.stribeck_velocity if at else (), is_identified)
            for shafts, rest, at in (
                (arm.motors, parameters.motor_rest_velocity, at_motors),
                (arm.joints, parameters.joint_rest_velocity, at_joints),
            )
        )
        self._velocity = VelocityFit(len(self._squared), parameters.motor_rest_velocity)
        self._parameters, self._has_dither = parameters, has_dither
        self._torque: Sequence[float] = ()

    def reset(self) -> None:
        """Forget all samples."""
        self._torque = ()
        self.motors.reset()
        self.joints.reset()
        self._velocity.reset()

    @property
    def velocity_sd(self) -> list[float]:
        """Standard deviations of the motors' velocities, (n,), rad/s."""
        return self._velocity.sd

    def expect(self) -> None:
        """Let the friction know how certain the velocities are."""
        sd = self._velocity.sd
        self.motors.expect(sd)
        self.joints.expect(np.sqrt(self._squared.dot(np.square(sd))).tolist())

    def carries_nothing(self, state: State) -> bool:
        """Whether brakes or stiction hold the motors, which are at rest without current."""
        return not any(state.effort) and max(map(abs, state.velocity)) < self._parameters.motor_rest_velocity

    def take(self, state: State, dt: float) -> JointSample | None:
        """Take a state of the motors `dt` seconds after the one before; None while velocities are not known."""
        fitted = self._velocity.take(state, dt)
        return None if fitted is None else self._sample(fitted.state, fitted.dt)

    def _sample(self, state: State, dt: float) -> JointSample:
        theta, thetad, tau_motor = state
        q, qd = self.map.joint_positions(theta), self.map.joint_velocities(thetad)
        # with dither a shaft stops at both ends of each swing, held there by the external torque
        keep = 0.0 if self._has_dither else math.exp(-dt / self._parameters.friction_memory)
        motor, joint = self.motors.of(thetad, keep, dt), self.joints.of(qd, keep, dt)
        through = self.map.joint_torques(motor.friction)
        friction = [a + b for a, b in zip(through, joint.friction, strict=True)]
        sliding = motor.sliding + joint.sliding
        tau = self.map.joint_torques(tau_motor)
        transmitted = [each - f for each, f in zip([*tau_motor, *tau], [*motor.friction, *through], strict=True)]
        loaded = [abs(torque) * share for torque, share in zip(transmitted, sliding, strict=True)]
        signals = [
            *sliding,
            *map(abs, sliding),
            *motor.resting,
            *joint.resting,
            *motor.shape,
            *joint.shape,
            *loaded,
            *((torque - before) / dt for torque, before in zip(tau_motor, self._torque or tau_motor, strict=True)),
        ]
        self._torque = tau_motor
        return JointSample(q, qd, tau, friction, signals, dt)
