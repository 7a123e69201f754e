"""Nominal friction of shafts as a function of their motion, and where it is uncertain."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wam_control.observer_parameters import ObserverParameters
from wam_description.arm import Joints, Motors

SLOW = 12.0  # rest velocities: speed up to which the shape of the friction counts (Stribeck)
# of `shape_uncertainty`, and seconds at the rest velocity: angle after a reversal over which it counts (presliding)
REVERSAL = ((2.0, 0.6), (3.2, 0.2))
LONGEST = 6.0 * max(length for _, length in REVERSAL)
FULL = 3.0  # sd of the measured velocity that the rest velocity is at least


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

    f = k (F_d (s + (1 - |s|) h) + b v), s = v / v_rest within -1..1, h the sign of the last full motion, which decays:
    the friction on a shaft that has just stopped still acts as it did, that on a shaft long at rest is unknown.  k is
    the friction scale.

    Attributes
    ----------
    dynamic, static : (n,), N m, nominal F_d and F_s.
    """

    def __init__(self, shafts: Motors | Joints, parameters: ObserverParameters, rest_velocity: float) -> None:
        scale = parameters.friction_scale
        self.dynamic = [scale * f for f in shafts.dynamic_friction]
        self.static = [scale * f for f in shafts.static_friction]
        self._viscous = [scale * b for b in shafts.viscous_friction]
        self._rest_velocity = rest_velocity
        self._rest = [rest_velocity] * len(self.dynamic)
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._held = [0.0] * len(self.dynamic)
        self._travel = [0.0] * len(self.dynamic)

    def expect(self, velocity_sd: Sequence[float]) -> None:
        """Take the standard deviations of the velocities, (n,), rad/s: a shaft slower than them may be at rest."""
        self._rest = [max(self._rest_velocity, FULL * sd) for sd in velocity_sd]

    def of(self, velocity: Sequence[float], keep: float, dt: float) -> ShaftMotion:
        """Friction at velocities, (n,), rad/s; `keep` is the decay of the memory in one period of `dt` seconds."""
        friction, sliding, resting, shape, held, travel = [], [], [], [], self._held, self._travel
        for i, v in enumerate(velocity):
            share = min(1.0, max(-1.0, v / self._rest[i]))
            if share * share == 1.0:
                # counted in the direction of the motion
                travel[i] = travel[i] + v * dt if travel[i] * v >= 0.0 else v * dt
                held[i] = share
            else:
                held[i] *= keep
            friction.append(self.dynamic[i] * (share + (1.0 - abs(share)) * held[i]) + self._viscous[i] * v)
            sliding.append(share)
            resting.append(1.0 - share * share)
            since = abs(travel[i]) / self._rest_velocity
            reversed_ = sum(size * math.exp(-since / length) for size, length in REVERSAL) if since < LONGEST else 0.0
            slow = abs(v) / (SLOW * self._rest_velocity)
            shape.append(abs(share) * max(math.exp(-slow) if slow < LONGEST else 0.0, reversed_))
        return ShaftMotion(friction, sliding, resting, shape)
