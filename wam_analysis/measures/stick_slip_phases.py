"""Stick and slip in a recorded velocity."""

from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import runs, without_short
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Mask, Numbers, Rows


class Phases(NamedTuple):
    """Alternating phases of rest and of motion.

    Attributes
    ----------
    sticks, slips : (k, 2), rows [begin, end) of each.
    directions : (slips,), sign of the mean velocity of each slip.
    stuck : fraction of the time at rest.
    """

    sticks: Rows
    slips: Rows
    directions: Numbers
    stuck: float


def stick_slip_phases(velocity: Numbers, rest: float, shortest: int) -> Phases:
    """Split a recording into stick and slip.

    Parameters
    ----------
    velocity : (n,), rad/s or m/s, at a constant rate.
    rest : speed up to which it is at rest, above the sensor's noise.
    shortest : samples that a phase lasts at least; shorter ones are merged into their neighbours.

    Raises
    ------
    ValueError
        if `rest` is not above zero or the velocity is not finite.
    """
    if not (rest > 0.0 and np.all(np.isfinite(velocity))):
        raise ValueError(f"rest is {rest!r}; it must be above the noise of the velocity, which must be finite")
    return _phases(without_short(np.abs(velocity) <= rest, shortest), velocity)


def _phases(still: Mask, velocity: Numbers) -> Phases:
    sticks, slips = runs(still), runs(~still)
    directions = np.array([np.sign(np.mean(velocity[a:b])) for a, b in slips], dtype=np.float64)
    return Phases(sticks, slips, directions, float(np.mean(still)) if len(still) else 0.0)


def without_turns(phases: Phases, velocity: Numbers, rest: float) -> Phases:
    """The phases without the rests in which a smooth motion only turns back or is slow, as a slow sine does.

    Such a motion passes through the speeds of rest evenly, or does not come near zero; a shaft that sticks is at zero
    for most of the time.

    Parameters
    ----------
    phases : of this velocity.
    velocity : (n,), rad/s or m/s.
    rest : speed up to which it was counted as at rest.
    """
    turns = np.array(
        [
            a > 0
            and b < len(velocity)
            and np.percentile(np.abs(velocity[a:b]), 50.0 if velocity[a - 1] * velocity[b] < 0.0 else 5.0)
            > SHAFT.passing * rest
            for a, b in phases.sticks.tolist()
        ],
        dtype=np.bool_,
    )
    return with_sticks(phases.sticks[~turns], velocity)


def with_sticks(sticks: Rows, velocity: Numbers) -> Phases:
    """The phases of a velocity with these sticks alone."""
    still = np.zeros(len(velocity), dtype=np.bool_)
    for a, b in sticks:
        still[a:b] = True
    return _phases(still, velocity)
