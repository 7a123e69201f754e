"""Whether a motion settles, cycles or diverges: from its last swings, from one turning point to the next.

They also show the few, slow cycles that no autocorrelation finds.
"""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.thresholds import CYCLE, SHAFT
from wam_bag.arrays import Numbers, Rows
from wam_theory.verdicts import Verdict


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
    peak_to_peak: float = math.nan
    period: float = math.nan
    growth: float = math.nan
    number: int = 0


def swings(time: Numbers, value: Numbers, least: float, band: float = 0.0) -> Swings:
    """Evaluate the swings of a signal, or of the error of a response.

    Parameters
    ----------
    time : (n,), s.
    value : (n,), without NaN.
    least : a smaller change is no swing; above the noise.
    band : an error that stays within it in the last fifth has settled; 0 for a signal that is none.
    """
    if band and np.all(np.abs(value[-max(len(value) // 5, 2) :]) <= band):
        return Swings(Verdict.SETTLED)
    rows = turning_points(value, least)
    sizes, lengths = np.abs(np.diff(value[rows])), np.diff(time[rows])
    if len(sizes) < CYCLE.swings:
        return Swings(Verdict.UNDECIDED, number=len(sizes))
    late = sizes[-max(len(sizes) // 2, CYCLE.swings) :]
    line, covariance = np.polyfit(np.arange(len(late)), np.log(late), 1, cov=True)
    slope, error = float(line[0]), math.sqrt(covariance[0, 0])
    ended = float(time[-1] - time[rows[-1]]) > CYCLE.quiet * float(np.max(lengths[-CYCLE.swings :]))
    changes = abs(slope) * (len(late) - 1) > CYCLE.swings_alike and abs(slope) > SHAFT.sigmas * error
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
    low = high = way = 0
    samples = value.tolist()
    for k, sample in enumerate(samples):
        low = k if sample < samples[low] else low
        high = k if sample > samples[high] else high
        if way >= 0 and sample < samples[high] - least:
            found += [high][:way]  # where it was before the first turn is not known
            way, low = -1, k
        elif way <= 0 and sample > samples[low] + least:
            found += [low][:-way]
            way, high = 1, k
    return np.array(found, dtype=np.int64)
