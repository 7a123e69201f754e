"""Whether a recorded response settles, cycles or diverges, from its late peaks."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import require_usable
from wam_analysis.thresholds import CYCLE
from wam_bag.arrays import Numbers
from wam_theory.verdicts import Verdict


class Stability(NamedTuple):
    """The verdict and its basis.

    Attributes
    ----------
    verdict : see `Verdict`.
    growth : factor from one half cycle to the next at the end; NaN if there are too few.
    """

    verdict: Verdict
    growth: float


def stability(error: Numbers, tolerance: float) -> Stability:
    """Evaluate the error of a response.

    The first half cycles are the transient of the step; the verdict is the trend of the last half of
    those that follow, in the logarithm of the peaks.

    Parameters
    ----------
    error : (n,), of the response, at a constant rate, from the step on.
    tolerance : error that is settled, above the noise.

    Raises
    ------
    ValueError
        if `tolerance` is not above zero or the error is not finite.
    """
    require_usable("error", error, tolerance=tolerance)
    peaks = half_cycle_peaks(error, tolerance)
    quiet = len(error) > 4 and bool(np.all(np.abs(error[-max(len(error) // 5, 2) :]) <= tolerance))
    if quiet:
        return Stability(Verdict.SETTLED, math.nan)
    late = peaks[CYCLE.transient :]
    if len(late) < CYCLE.peaks:
        return Stability(Verdict.UNDECIDED, math.nan)
    late = late[-max(len(late) // 2 + 1, CYCLE.peaks) :]
    slope, error_of_slope = trend(np.log(late))
    sure = abs(slope) / error_of_slope if error_of_slope > 0.0 else math.inf
    last = trend(np.log(late[-max(len(late) // 2, CYCLE.peaks) :]))[0]
    if slope > CYCLE.steady_growth and sure > 2.0:
        verdict = Verdict.DIVERGED
    elif abs(last) <= CYCLE.steady_growth or sure <= 2.0 or (slope < 0.0 and last > CYCLE.flattened * slope):
        verdict = Verdict.LIMIT_CYCLE
    else:
        verdict = Verdict.SETTLED
    return Stability(verdict, math.exp(slope))


def half_cycle_peaks(error: Numbers, tolerance: float) -> Numbers:
    """Largest |error| between two changes of its sign, (k,), the last half cycle left out.

    Parameters
    ----------
    error : (n,).
    tolerance : an error this small has no sign; noise makes no half cycles.
    """
    signed = np.flatnonzero(np.abs(error) > tolerance)
    if not len(signed):
        return np.empty(0)
    changes = np.flatnonzero(np.diff(np.sign(error[signed])))
    begins = np.concatenate(([0], signed[changes + 1]))
    result: Numbers = np.maximum.reduceat(np.abs(error), begins).astype(np.float64)
    return result[:-1]


def trend(values: Numbers) -> tuple[float, float]:
    """Slope per step of a line through values, (n,), and its standard error."""
    steps = np.arange(len(values)) - (len(values) - 1) / 2.0
    square = float(steps @ steps)
    slope = float(steps @ values) / square
    rest = values - np.mean(values) - slope * steps
    return slope, math.sqrt(float(rest @ rest) / max(len(values) - 2, 1) / square)
