"""Accuracy of a held force."""

import math
from typing import NamedTuple

import numpy as np

from wam_bag.arrays import Numbers


class ForceAccuracy(NamedTuple):
    """Deviation of a held force from the one commanded, N.

    Attributes
    ----------
    bias : mean deviation.
    ripple : half of the range of the force, from its 0.5th to its 99.5th percentile.
    smallest : smallest controllable force: |bias| + ripple.
    """

    bias: float
    ripple: float
    smallest: float


def force_accuracy(commanded: float, held: Numbers) -> ForceAccuracy:
    """Accuracy of a force in its steady state.

    Parameters
    ----------
    commanded, held : N, and (n,), N, along the same direction; NaN if not known.
    """
    error = held[np.isfinite(held)] - commanded
    if not len(error):
        return ForceAccuracy(math.nan, math.nan, math.nan)
    bias = float(np.mean(error))
    low, high = (float(p) for p in np.percentile(error, [0.5, 99.5]))
    ripple = (high - low) / 2.0
    return ForceAccuracy(bias, ripple, abs(bias) + ripple)
