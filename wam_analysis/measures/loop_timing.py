"""Regularity of a topic from stamps and reception times."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import usual_steps
from wam_analysis.thresholds import STREAM
from wam_bag.arrays import Numbers, Times


class StampTiming(NamedTuple):
    """Regularity of a topic.

    Attributes
    ----------
    period : between two stamps, median, s.
    slowest : the longest usual one, s, where the rate changes.
    missed : periods without a message.
    longest_gap : between two stamps, s.
    backwards : stamps that are not later than the one before.
    jitter : standard deviation of the intervals between two receptions, s; NaN if they were not recorded.
    worst : longest interval between two receptions, s.
    """

    period: float
    slowest: float
    missed: int
    longest_gap: float
    backwards: int
    jitter: float
    worst: float


def stamp_timing(stamp: Times, received: Times | None) -> StampTiming:
    """Regularity of one topic.

    Parameters
    ----------
    stamp : (n,), ns, as the messages bear it, two at least.
    received : (n,), ns, reception times by the clock of the recorder; None if they have no meaning,
        as in lockstep bags, whose log times are the stamps.
    """
    steps, times = np.diff(stamp), np.unique(stamp)
    periods = usual_steps(np.diff(times).astype(np.float64)) if len(times) > 1 else np.full(1, math.nan)
    jitter = worst = math.nan
    if received is not None:
        intervals: Numbers = np.diff(np.sort(received).astype(np.float64)) / 1e9
        jitter, worst = float(np.std(intervals)), float(np.max(intervals))
    return StampTiming(
        period=float(np.median(np.diff(times))) / 1e9 if len(times) > 1 else math.nan,
        slowest=float(np.max(periods)) / 1e9,
        missed=_missed(times, periods),
        longest_gap=float(np.max(steps)) / 1e9,
        backwards=int(np.sum(steps <= 0)),
        jitter=jitter,
        worst=worst,
    )


def _missed(times: Times, periods: Numbers) -> int:
    """Messages that are missing among rising times: what came late is near the time that it left out."""
    steps = np.diff(times)
    rows = np.flatnonzero(steps > STREAM.changes * periods)
    long, period = steps[rows], periods[rows]
    first = np.searchsorted(times, times[rows] - long)
    last = np.searchsorted(times, times[rows + 1] + long, side="right") - 1
    there = (times[last] - times[first]) / period - (last - first)
    return int(np.sum(np.clip(np.rint(there), 0, np.rint(long / period) - 1)))
