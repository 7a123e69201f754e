"""How accurately a force was held, and the dynamic range of force control (3.2.1)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


class ForceAccuracy(NamedTuple):
    """Deviation of a held force from the one asked for, N.

    Attributes
    ----------
    bias : mean deviation.
    ripple : half of the range of the force, from its 0.5th to its 99.5th percentile.
    deviation : root mean square deviation.
    smallest : smallest controllable force: what the deviation can hide, |bias| + ripple.
    """

    bias: float
    ripple: float
    deviation: float
    smallest: float


def force_accuracy(asked: Numbers, held: Numbers) -> ForceAccuracy:
    """Accuracy of a force in its steady state.

    Parameters
    ----------
    asked, held : (n,), N, along the same direction; NaN where not known.
    """
    error = (held - asked)[np.isfinite(held) & np.isfinite(asked)]
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
    limited_by : what gives out first.
    smallest : N, worst of what was held.
    ratio : NaN where either is unknown.
    """

    largest: float
    limited_by: str
    smallest: float
    ratio: float


def dynamic_range(largest: float, limited_by: str, held: list[ForceAccuracy]) -> DynamicRange:
    """Dynamic range from the limits and the accuracy of every force that was held.

    Parameters
    ----------
    largest : N; NaN where the limits are not known.
    limited_by : what gives out first.
    held : at least one, else the ratio is NaN.
    """
    known = [one.smallest for one in held if math.isfinite(one.smallest)]
    smallest = max(known, default=math.nan)
    ratio = largest / smallest if known and smallest > 0.0 else math.nan
    return DynamicRange(largest, limited_by, smallest, ratio)
