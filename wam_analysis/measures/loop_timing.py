"""Regularity of a topic from stamps and reception times."""

import math
from typing import NamedTuple

import numpy as np

from wam_bag.arrays import Numbers, Times


class StampTiming(NamedTuple):
    """Regularity of a topic.

    Attributes
    ----------
    period : between two stamps, median, s.
    missed : periods without a message.
    longest_gap : between two stamps, s.
    backwards : stamps that are not later than the one before.
    jitter : standard deviation of the intervals between two receptions, s; NaN if they were not recorded.
    worst : longest interval between two receptions, s.
    """

    period: float
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
    steps = np.diff(stamp)
    forward = steps[steps > 0]
    period = float(np.median(forward)) if len(forward) else math.nan
    skipped = _skipped(forward / period) if len(forward) else np.zeros(0, dtype=np.int64)
    jitter = worst = math.nan
    if received is not None:
        intervals: Numbers = np.diff(np.sort(received).astype(np.float64)) / 1e9
        jitter, worst = float(np.std(intervals)), float(np.max(intervals))
    return StampTiming(
        period=period / 1e9,
        missed=int(np.sum(skipped)),
        longest_gap=float(np.max(steps)) / 1e9,
        backwards=int(np.sum(steps <= 0)),
        jitter=jitter,
        worst=worst,
    )


def _skipped(steps: Numbers) -> Times:
    """Messages that are missing in each step, (n,), periods.

    A step of less than two periods is that of a late message where the steps about it are shorter by as much.
    """
    single = steps[np.rint(steps) == 1.0]
    steps = (
        steps / float(np.median(single)) if len(single) else steps
    )  # where many are missing the median of all is longer than a period
    skipped = np.maximum(np.rint(steps).astype(np.int64) - 1, 0)
    around = np.convolve(np.pad(steps, 1, "edge"), np.ones(3), "valid")
    skipped[(steps < 2.0) & (around < 3.5)] = 0
    return skipped
