"""Efficiency of a transmission (3.2.4)."""

import math
from typing import NamedTuple

import numpy as np

from wam_bag.arrays import Numbers


class Efficiency(NamedTuple):
    """Work that was put in and got out while power flowed one way, J."""

    put: float
    got: float

    @property
    def ratio(self) -> float:
        """NaN where no power flowed."""
        return self.got / self.put if self.put > 0.0 else math.nan


def efficiency(time: Numbers, put: Numbers, got: Numbers) -> Efficiency:
    """Efficiency as work got out over work put in, 3.2.4, of the samples in which both powers are positive.

    Parameters
    ----------
    time : (n,), s.
    put, got : (n,), power at either side in one direction, W, less that which accelerates a rotor.

    Notes
    -----
    Of a gap that is longer than the median period nothing is known: it holds no work.
    """
    dt = np.diff(time, append=time[-1:])
    if len(time) > 1:
        dt = np.minimum(dt, np.median(dt[:-1]))
        dt[-1] = dt[-2]
    onward = (put > 0.0) & (got > 0.0)
    return Efficiency(float(put[onward] @ dt[onward]), float(got[onward] @ dt[onward]))
