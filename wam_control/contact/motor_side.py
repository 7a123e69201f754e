"""Samples of the motors as those of the joints, with the nominal friction on the way and how certain it is."""

import math
from typing import NamedTuple

import numpy as np

from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.shaft_friction import ShaftFriction
from wam_control.contact.thresholds import CONTACT
from wam_control.contact.velocity_fit import VelocityFit
from wam_description.arm import Arm
from wam_description.model import ArmModel
from wam_description.rigid_body import Array
from wam_description.signals import State
from wam_description.small_matrices import solution


class JointSample(NamedTuple):
    """State of the joints and torque of the motors at them, (n,); friction, (n,), N m, and signals of the shafts.

    `friction` and `signals` are empty on the link side, which lies behind the friction; `dt` in s since the one before.
    """

    q: list[float]
    qd: list[float]
    tau: list[float]
    friction: list[float]
    signals: Array
    dt: float


class LinkMotion(NamedTuple):
    """Links that move as the motors drive them through their cables: M q'' = t, t = K (e + b e'), e' = q_m' - q'.

    The motion of the motors shows it without any torque, so that their friction does not count.  What else stretches
    the cables, such as weights, changes slowly.

    Attributes
    ----------
    velocity, momentum : (n,), q', rad/s, and M q', N m s, with pulleys.
    torque : (n,), K e, of the cables at the joints, N m.
    """

    velocity: Array
    momentum: Array
    torque: Array


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
    parameters, has_dither : as given.
    map : between motors and joints.
    velocity : of the motors.
    friction : of motors, then joints.
    rotors, pulleys : (n, n), their inertia at the joints, kg m^2.
    """

    def __init__(self, arm: Arm, parameters: ObserverParameters, has_dither: bool, model: ArmModel | None) -> None:
        self.map = arm.transmission
        self._squared = np.square(self.map.joint_from_motor)
        self.rotors, self.pulleys, self._stiffness = arm.rotors, arm.pulleys, arm.stiffness
        self.friction = ShaftFriction(arm, parameters, model)
        self.velocity = VelocityFit(len(self._squared), parameters.motor_rest_velocity)
        self.parameters, self.has_dither = parameters, has_dither
        self._torque: Array | None = None

    def reset(self) -> None:
        """Forget all samples."""
        self._torque = None
        self.friction.reset()
        self.velocity.reset()

    def expect(self) -> None:
        """Let the friction know how certain the velocities are."""
        sd = np.array(self.velocity.sd)
        self.friction.expect(np.concatenate((sd, np.sqrt(self._squared.dot(sd * sd)))))

    def carries_nothing(self, state: State) -> bool:
        """Whether brakes or stiction hold the motors, which are at rest without current."""
        return not any(state.effort) and max(map(abs, state.velocity)) < self.parameters.motor_rest_velocity

    def take(self, state: State, dt: float) -> JointSample | None:
        """Take a state of the motors `dt` seconds after the one before; None while velocities are not known."""
        fitted = self.velocity.take(state, dt)
        if fitted is None:
            return None
        (theta, thetad, tau_motor), dt = fitted
        q, qd = self.map.joint_motion(theta), self.map.joint_motion(thetad)
        # with dither a shaft stops at both ends of each swing, held there by the external torque
        keep = 0.0 if self.has_dither else math.exp(-dt / self.parameters.friction_memory)
        motion, n = self.friction.of(np.array([*thetad, *qd]), keep, dt), len(theta)
        at_shafts: list[float] = motion.friction.tolist()
        through = self.map.joint_torques(at_shafts[:n])
        friction = [a + b for a, b in zip(through, at_shafts[n:], strict=True)]
        tau = self.map.joint_torques(tau_motor)
        transmitted = [each - f for each, f in zip([*tau_motor, *tau], [*at_shafts[:n], *through], strict=True)]
        torque = np.array(tau_motor)
        change = torque - (torque if self._torque is None else self._torque)
        signals = np.concatenate(
            (
                motion.by_distance.ravel(),
                np.abs(motion.sliding),
                motion.resting,
                motion.slow,
                np.abs(transmitted) * motion.sliding,
                change / dt,
            )
        )
        self._torque = torque
        return JointSample(q, qd, tau, friction, signals, dt)

    def links(self, inertia: Array, driven: Array, before: LinkMotion | None, dt: float) -> LinkMotion:
        """Motion of the links, `dt` seconds after the one before, in an implicit step.

        Parameters
        ----------
        inertia : (n, n), of links and pulleys, kg m^2.
        driven : velocity of the motors at the joints, (n,), rad/s.
        before : None for links that move as the motors do.
        """
        if before is None:
            return LinkMotion(driven, inertia.dot(driven), np.zeros(len(driven)))
        lasts = dt + CONTACT.cable_damping
        given, held = before.momentum + dt * before.torque, dt * lasts * self._stiffness
        velocity = solution(inertia + held, given + held.dot(driven))
        momentum = inertia.dot(velocity)
        return LinkMotion(velocity, momentum, before.torque + (momentum - given) / lasts)
