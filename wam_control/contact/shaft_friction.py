"""Nominal friction of shafts as a function of their motion, and where it is uncertain."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wam_control.contact.observer_parameters import ObserverParameters
from wam_control.contact.thresholds import CONTACT
from wam_description.parts import Joints, Motors

LONGEST = 6.0 * CONTACT.steep_angle


class ShaftMotion(NamedTuple):
    """Nominal friction of n shafts and how they move.

    Attributes
    ----------
    friction : (n,), N m, against the motion.
    sliding : (n,), signed fraction of Coulomb friction that acts.
    resting : (n,), how far each shaft is at rest, 0..1.
    shape : (n,), fraction of `shape_uncertainty` that counts: slow, or just reversed.
    """

    friction: list[float]
    sliding: list[float]
    resting: list[float]
    shape: list[float]


class ShaftFriction:
    """Friction of shafts by their velocities.

    f = k (F (s + (1 - |s|) h) + b v), s = v / v_rest within -1..1, h the sign of the last full motion, which decays:
    the friction on a shaft that has just stopped still acts as it did, that on a shaft long at rest is unknown.  k is
    the friction scale.  F = F_d + (F_s - F_d) exp(-(v / v_s)^2) of an identified arm; of others F_d, as friction that
    rises at rest alone is as usual, and the difference is uncertain up to some v_s.

    Parameters
    ----------
    shafts : with their friction as modelled.
    parameters : the uncertainty of the model.
    rest_velocity : rad/s, above which Coulomb friction is full.
    stribeck : (n,), Stribeck velocity v_s of each, rad/s; empty where it is not known.
    is_identified : whether the friction towards zero speed was identified.

    Attributes
    ----------
    dynamic, static : (n,), N m, nominal F_d and F_s.
    """

    def __init__(
        self,
        shafts: Motors | Joints,
        parameters: ObserverParameters,
        rest_velocity: float,
        stribeck: Sequence[float] = (),
        is_identified: bool = False,
    ) -> None:
        scale = parameters.friction_scale
        self.dynamic = [scale * f for f in shafts.dynamic_friction]
        self.static = [scale * f for f in shafts.static_friction]
        self._viscous = [scale * b for b in shafts.viscous_friction]
        self._rest_velocity = rest_velocity
        self._stribeck = stribeck or [CONTACT.usual_stribeck * rest_velocity] * len(self.dynamic)
        self._slow = CONTACT.slow if is_identified else CONTACT.slow * CONTACT.assumed_stribeck
        self._rise = [is_identified * (s - d) for s, d in zip(self.static, self.dynamic, strict=True)]
        self._rest = [rest_velocity] * len(self.dynamic)
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._held = [0.0] * len(self.dynamic)
        self._travel = [0.0] * len(self.dynamic)

    def expect(self, velocity_sd: Sequence[float]) -> None:
        """Take the standard deviations of the velocities, (n,), rad/s: a shaft slower than them may be at rest."""
        self._rest = [max(self._rest_velocity, CONTACT.rest_noise * sd) for sd in velocity_sd]

    def of(self, velocity: Sequence[float], keep: float, dt: float) -> ShaftMotion:
        """Friction at velocities, (n,), rad/s, of a period of `dt` seconds.

        `keep` is the decay of the memory in it, 0 for none: with a dither.
        """
        friction, sliding, resting, shape, held, travel = [], [], [], [], self._held, self._travel
        slowest = self._rest_velocity
        for i, v in enumerate(velocity):
            share = v / self._rest[i]
            if share >= 1.0 or share <= -1.0:
                held[i] = share = 1.0 if share > 0.0 else -1.0
                # counted in the direction of the motion
                travel[i] = travel[i] + v * dt if travel[i] * v >= 0.0 else v * dt
            else:
                held[i] *= keep
            fraction, level, turned = abs(share), self.dynamic[i], abs(v) / self._stribeck[i]
            if self._rise[i] and turned < LONGEST:
                level += self._rise[i] * math.exp(-turned * turned)
            friction.append(level * (share + (1.0 - fraction) * held[i]) + self._viscous[i] * v)
            sliding.append(share)
            resting.append(1.0 - share * share)
            slow, since = turned / self._slow, abs(travel[i]) / slowest
            if travel[i] * v < 0.0 < keep:
                since = 0.0  # it turns back; a dither ends each of its swings in that way
            uncertain = math.exp(-slow) if slow < LONGEST else 0.0
            if since < LONGEST:
                uncertain = max(
                    uncertain,
                    CONTACT.steep_shape * math.exp(-since / CONTACT.steep_angle)
                    + CONTACT.shallow_shape * math.exp(-since / CONTACT.shallow_angle),
                )
            shape.append(fraction * uncertain)
        return ShaftMotion(friction, sliding, resting, shape)
