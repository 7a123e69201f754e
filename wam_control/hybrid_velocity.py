"""Joint velocities of hybrid control [Raibert 81]: force along its direction, posture in the complement."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wam_control.stability_guard import REACH

Array = NDArray[np.float64]


def posture_velocity(posture: Sequence[float], q: Sequence[float], gain: float, limit: float) -> list[float]:
    """Joint velocities (n,), rad/s, towards a posture (n,), rad, at `gain` 1/s and at most `limit` rad/s."""
    return [min(max(gain * (a - b), -limit), limit) for a, b in zip(posture, q, strict=True)]


def hybrid_velocity(posture: Sequence[float], along: Array, speed: float, limit: float) -> list[float]:
    """Joint velocities (n,), rad/s, that move the point of action at `speed` along the force.

    Parameters
    ----------
    posture : velocities towards the posture (n,), rad/s; only their part without motion along the force is used.
    along : velocity along the force per joint velocity (n,), m.
    speed : along the force, m/s.
    limit : largest joint speed due to the force, rad/s.
    """
    held = np.array(posture)
    square = float(along @ along)
    if square <= REACH * REACH:
        return _list(held)
    force = along * (speed / square)
    fastest = float(np.abs(force).max())
    if fastest > limit:  # with a short lever a small speed needs a very fast joint
        force *= limit / fastest
    return _list(force + held - along * (float(along @ held) / square))


def _list(values: Array) -> list[float]:
    result: list[float] = values.tolist()
    return result
