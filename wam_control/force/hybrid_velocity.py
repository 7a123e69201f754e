"""Joint velocities of hybrid control [Raibert 81]: force along its direction, posture in the complement."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.force.force_axis import ForceAxis
from wam_control.force.thresholds import FORCE

Array = NDArray[np.float64]


def posture_velocity(
    posture: Sequence[float], q: Sequence[float], gain: float, limit: float, rate: Sequence[float] | None = None
) -> list[float]:
    """Joint velocities (n,), rad/s, towards a posture (n,), rad, at `gain` 1/s and at most `limit` rad/s.

    `rate` (n,), rad/s, is the velocity of a posture that moves.
    """
    if rate is not None:
        return [min(max(r + gain * (a - b), -limit), limit) for a, b, r in zip(posture, q, rate, strict=True)]
    return [min(max(gain * (a - b), -limit), limit) for a, b in zip(posture, q, strict=True)]


def hybrid_velocity(posture: Sequence[float], axis: ForceAxis, speed: float, limit: float) -> list[float]:
    """Joint velocities (n,), rad/s, that move the point of action along the force.

    Parameters
    ----------
    posture : velocities towards the posture (n,), rad/s; only their part without motion along the force is used.
    axis : of the force; it has a lever.
    speed : commanded along the force, m/s.
    limit : largest joint speed due to the force, rad/s.
    """
    held, lever = np.array(posture), axis.lever
    force = axis.move * speed
    fastest = float(np.abs(force).max())
    if fastest > limit:
        force *= limit / fastest
    result: list[float] = (force + held - lever * (float(lever @ held) / float(lever @ lever))).tolist()
    return result


def followed(posture: Array, jacobian: Array, force: float, gain: float) -> Array:
    """Velocities towards a posture (n,), rad/s, at which the force stays right: slower where the link slides fast.

    Parameters
    ----------
    posture : velocities (n,), rad/s, without motion along the force.
    jacobian : (3, n), m/rad, of where the link presses.
    force, gain : commanded, N, and speed along it per error, m/s/N.
    """
    slide = FORCE.slide_slope * float(np.linalg.norm(jacobian @ posture))
    most = gain * FORCE.tolerance * force
    return posture * (most / slide) if slide > most else posture
