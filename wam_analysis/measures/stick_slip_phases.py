"""Stick and slip in a recorded velocity."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.measures.runs import runs, without_short

Numbers = NDArray[np.float64]
Rows = NDArray[np.int64]


class Phases(NamedTuple):
    """Alternating phases of rest and of motion.

    Attributes
    ----------
    sticks, slips : (k, 2), rows [begin, end) of each.
    directions : (slips,), sign of the mean velocity of each slip.
    stuck : fraction of the time at rest.
    reversals : slips in the opposite direction of the one before.
    """

    sticks: Rows
    slips: Rows
    directions: Numbers
    stuck: float
    reversals: int


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
    if not rest > 0.0:
        raise ValueError(f"rest is {rest!r}; it must be above zero, above the noise of the velocity")
    if not np.all(np.isfinite(velocity)):
        raise ValueError("the velocity has values that are not finite; leave them out")
    still = without_short(np.abs(velocity) <= rest, shortest)
    sticks, slips = runs(still), runs(~still)
    directions = np.array([np.sign(np.mean(velocity[a:b])) for a, b in slips], dtype=np.float64)
    return Phases(
        sticks=sticks,
        slips=slips,
        directions=directions,
        stuck=float(np.mean(still)) if len(still) else 0.0,
        reversals=int(np.sum(directions[1:] * directions[:-1] < 0.0)),
    )
