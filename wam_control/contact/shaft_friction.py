"""Nominal friction of shafts as a function of their motion, and where it is uncertain."""

import math
from typing import NamedTuple

import numpy as np

from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.arm import Arm
from wam_description.model import ArmModel
from wam_description.rigid_body import Array

# one of each equal part of a distribution that is uniform in the logarithm; shortest first
LOG_DISTANCES = np.log(CONTACT.shortest_presliding) + math.log(
    CONTACT.longest_presliding / CONTACT.shortest_presliding
) * ((np.arange(CONTACT.presliding_count) + 0.5) / CONTACT.presliding_count)
EQUAL = np.full(len(LOG_DISTANCES), 1.0 / len(LOG_DISTANCES))  # weights of a mean
# change of a mean over presliding distances per change of ln d, and the variance of ln d
_APART = LOG_DISTANCES - LOG_DISTANCES.mean()
DISTANCE_VARIANCE = float(np.square(_APART).mean())
DISTANCE_WEIGHTS = _APART / np.square(_APART).sum()


class ShaftMotion(NamedTuple):
    """Nominal friction of n shafts and how they move.

    Attributes
    ----------
    friction : (n,), N m, against the motion.
    by_distance : (n, k), signed fraction of Coulomb friction that acts, for each presliding distance.
    sliding : (n,), its mean.
    resting : (n,), how far the friction of each shaft is that of one long at rest, 0..1.
    slow : (n,), fraction of `shape_uncertainty` that counts.
    """

    friction: Array
    by_distance: Array
    sliding: Array
    resting: Array
    slow: Array


class ShaftFriction:
    """Friction of the motors, then of the joints, by their motion.

    f = k (F s + b v).  The fraction s follows a motion dx as s' = sgn(dx) + (s - sgn(dx)) exp(-|dx| / d) (Dahl 1968):
    after a reversal, and after a stop, friction builds up over a presliding distance d.  How long that is nobody knows:
    s is computed for several distances, which are equally likely.  At rest s is forgotten.  k is the friction scale.
    F = F_d + (F_s - F_d) exp(-(v / v_s)^2) of an identified arm.  Of others F = F_d, since the static friction may act
    at rest alone; up to some v_s, F is uncertain by the difference.

    Parameters
    ----------
    arm : with its friction as modelled.
    parameters : the uncertainty of the model.
    model : with the Stribeck velocities v_s; None where they are not known.

    Attributes
    ----------
    dynamic, static : (n,), N m, nominal F_d and F_s.
    is_identified : whether the model is that of a recording.
    """

    def __init__(self, arm: Arm, parameters: ObserverParameters, model: ArmModel | None) -> None:
        scale, motors, joints = parameters.friction_scale, arm.motors, arm.joints
        count = len(motors.names)
        self.dynamic = scale * np.array([*motors.dynamic_friction, *joints.dynamic_friction])
        self.static = scale * np.array([*motors.static_friction, *joints.static_friction])
        self._viscous = scale * np.array([*motors.viscous_friction, *joints.viscous_friction])
        self._rest_velocity = np.repeat((parameters.motor_rest_velocity, parameters.joint_rest_velocity), count)
        self._stribeck = CONTACT.usual_stribeck * self._rest_velocity
        if model is not None:
            self._stribeck = np.array([*model.motors.stribeck_velocity, *model.joints.stribeck_velocity])
        self.is_identified = model is not None and model.is_identified
        self._slow = self._stribeck * CONTACT.slow * (1.0 if self.is_identified else CONTACT.assumed_stribeck)
        self._rise = self.is_identified * (self.static - self.dynamic)
        self._per_distance = np.outer(1.0 / self._rest_velocity, np.exp(-LOG_DISTANCES))
        self._rest = self._rest_velocity
        # numpy takes arrays of one shape several times faster than it broadcasts them
        self._each = np.arange(2 * count).repeat(len(EQUAL)).reshape(-1, len(EQUAL))
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._sliding = np.zeros_like(self._per_distance)
        self._resting = np.ones_like(self._per_distance)

    def expect(self, velocity_sd: Array) -> None:
        """Take the standard deviations of the velocities, (n,), rad/s: a shaft slower than them may be at rest."""
        self._rest = np.maximum(self._rest_velocity, CONTACT.rest_noise * velocity_sd)

    def of(self, velocity: Array, keep: float, dt: float) -> ShaftMotion:
        """Friction at velocities, (n,), rad/s, of a period of `dt` seconds.

        `keep` is the part of s that a shaft at rest keeps in this period; 0 with a dither.
        """
        speed, each = np.abs(velocity), self._each
        moving = np.minimum(1.0, speed / self._rest)
        remembered = (1.0 - (1.0 - keep) * (1.0 - moving))[each]
        way = np.sign(velocity)[each]
        if keep:
            left = np.exp((-dt * speed)[each] * self._per_distance)
        else:  # a dither swings a shaft beyond any presliding
            left, way = np.zeros_like(way), moving[each] * way
        self._sliding = way + (remembered * self._sliding - way) * left
        self._resting = np.maximum(left * self._resting, (1.0 - moving * moving)[each])
        sliding = self._sliding.dot(EQUAL)
        turned = velocity / self._stribeck
        level = self.dynamic + self._rise * np.exp(-turned * turned)
        return ShaftMotion(
            level * sliding + self._viscous * velocity,
            self._sliding,
            sliding,
            np.sqrt((self._resting * self._resting).dot(EQUAL)),
            moving * np.exp(-speed / self._slow),
        )
