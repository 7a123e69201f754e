"""Size and period of the cycle of a simulated signal, which has no noise."""

import math
from typing import NamedTuple

import numpy as np

from wam_bag.arrays import Numbers


class CycleExtent(NamedTuple):
    """Peak to peak, in the unit of the signal, and period, s, of a cycle; NaN if there is none."""

    peak_to_peak: float
    period: float


def last_cycle(time: Numbers, value: Numbers) -> CycleExtent:
    """The last whole cycle of a signal that is known to cycle, from one rising crossing of the middle to the next.

    Unlike `wam_analysis.measures.limit_cycle` it takes every such crossing for a cycle: the signal must have no noise.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    value : (n,), the signal.
    """
    late = value[len(value) // 2 :]
    above = value > 0.5 * (late.max() + late.min())
    rises = np.flatnonzero(above[1:] & ~above[:-1])  # samples before each
    if len(rises) < 2:
        return CycleExtent(math.nan, math.nan)
    begin, end = rises[-2], rises[-1]
    return CycleExtent(float(np.ptp(value[begin : end + 1])), float(time[end] - time[begin]))
