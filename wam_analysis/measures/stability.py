"""Whether a recorded response settles, cycles or diverges: from late peaks of its error, or from its swings.

Swings go from one turning point to the next: the few, slow cycles that no autocorrelation finds.
"""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import require_usable
from wam_analysis.thresholds import CYCLE
from wam_bag.arrays import Numbers, Rows
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


class Swings(NamedTuple):
    """The last swings of a signal and their trend.

    Attributes
    ----------
    verdict : of the last swings: of one size, growing, shrinking, or undecided.
    peak_to_peak : mean size of the last swings, in the unit of the signal; NaN if there are too few.
    period : of the last two of them, s; NaN likewise.
    growth : factor from one swing to the next; NaN likewise.
    number : of swings in all.
    """

    verdict: Verdict
    peak_to_peak: float
    period: float
    growth: float
    number: int


def swings(time: Numbers, value: Numbers, least: float) -> Swings:
    """Evaluate the swings of a signal.

    Parameters
    ----------
    time : (n,), s.
    value : (n,), without NaN.
    least : a smaller change is no swing; above the noise.

    Raises
    ------
    ValueError
        if `least` is not above zero.
    """
    if not least > 0.0:
        raise ValueError(f"least is {least!r}; it must be above zero, above the noise of the signal")
    rows = turning_points(value, least)
    sizes, lengths = np.abs(np.diff(value[rows])), np.diff(time[rows])
    if len(sizes) < CYCLE.swings:
        return Swings(Verdict.UNDECIDED, math.nan, math.nan, math.nan, len(sizes))
    late = sizes[-max(len(sizes) // 2, CYCLE.swings) :]
    slope, error = trend(np.log(late))
    ended = float(time[-1] - time[rows[-1]]) > CYCLE.quiet * float(np.max(lengths[-CYCLE.swings :]))
    changes = abs(slope) * (len(late) - 1) > CYCLE.swings_alike and abs(slope) > CYCLE.sure_trend * error
    if ended or (changes and slope < 0.0):
        verdict = Verdict.SETTLED
    elif changes:
        verdict = Verdict.DIVERGED
    elif float(np.ptp(late)) <= 2.0 * CYCLE.swings_alike * float(np.mean(late)):
        verdict = Verdict.LIMIT_CYCLE
    else:
        verdict = Verdict.UNDECIDED
    return Swings(verdict, float(np.mean(late)), float(time[rows[-1]] - time[rows[-3]]), math.exp(slope), len(sizes))


def turning_points(value: Numbers, least: float) -> Rows:
    """Rows at which a signal turns by more than `least`, (k,); its first and last samples are none.

    Parameters
    ----------
    value : (n,).
    least : a return by less is no turn.
    """
    found: list[int] = []
    low = high = row = 0
    way = 0
    samples = value.tolist()
    for k, sample in enumerate(samples):
        if way <= 0 and sample < samples[low]:
            low = k
        if way >= 0 and sample > samples[high]:
            high = k
        row = high if way > 0 else low
        if way > 0 and sample < samples[row] - least:
            found.append(row)
            way, low = -1, k
        elif way < 0 and sample > samples[row] + least:
            found.append(row)
            way, high = 1, k
        elif way == 0 and sample > samples[low] + least:
            way, high = 1, k
        elif way == 0 and sample < samples[high] - least:
            way, low = -1, k
    return np.array(found, dtype=np.int64)
