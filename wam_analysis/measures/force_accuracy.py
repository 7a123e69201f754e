"""Accuracy of a held force, and the dynamic range of force control (3.2.1)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


class ForceAccuracy(NamedTuple):
    """Deviation of a held force from the one commanded, N.

    Attributes
    ----------
    bias : mean deviation.
    ripple : half of the range of the force, from its 0.5th to its 99.5th percentile.
    deviation : root mean square deviation.
    smallest : smallest controllable force: |bias| + ripple.
    """

    bias: float
    ripple: float
    deviation: float
    smallest: float


def force_accuracy(commanded: Numbers, held: Numbers) -> ForceAccuracy:
    """Accuracy of a force in its steady state.

    Parameters
    ----------
    commanded, held : (n,), N, along the same direction; NaN if not known.
    """
    error = (held - commanded)[np.isfinite(held) & np.isfinite(commanded)]
    if not len(error):
        return ForceAccuracy(math.nan, math.nan, math.nan, math.nan)
    bias = float(np.mean(error))
    low, high = (float(p) for p in np.percentile(error, [0.5, 99.5]))
    ripple = (high - low) / 2.0
    return ForceAccuracy(bias, ripple, float(np.sqrt(np.mean(error**2))), abs(bias) + ripple)


class DynamicRange(NamedTuple):
    """Largest over smallest controllable force at a point of contact (3.2.1).

    Attributes
    ----------
    largest : N, by the limits of motors and cables.
    limited_by : the limit.
    smallest : N, worst of the held forces.
    ratio : NaN if either is unknown.
    """

    largest: float
    limited_by: str
    smallest: float
    ratio: float


def dynamic_range(largest: float, limited_by: str, held: list[ForceAccuracy]) -> DynamicRange:
    """Dynamic range from the limits and the accuracy of every held force.

    Parameters
    ----------
    largest : N; NaN if the limits are not known.
    limited_by : the limit.
    held : at least one, else the ratio is NaN.
    """
    known = [one.smallest for one in held if math.isfinite(one.smallest)]
    smallest = max(known, default=math.nan)
    ratio = largest / smallest if known and smallest > 0.0 else math.nan
    return DynamicRange(largest, limited_by, smallest, ratio)
