"""Timing of the loop from stamps and reception times."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.thresholds import STREAM

Times = NDArray[np.int64]
Numbers = NDArray[np.float64]


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


class Latency(NamedTuple):
    """Time from the reception of a message to that of the command with the same stamp, s.

    Attributes
    ----------
    answered : messages that were answered.
    unanswered : messages between the first and the last answered one that were not.
    p50, p99, worst : s.
    """

    answered: int
    unanswered: int
    p50: float
    p99: float
    worst: float


def stamp_timing(stamp: Times, received: Times | None) -> StampTiming:
    """Regularity of one topic.

    Parameters
    ----------
    stamp : (n,), ns, as the messages bear it.
    received : (n,), ns, reception times by the clock of the recorder; None if they have no meaning,
        as in lockstep bags, whose log times are the stamps.
    """
    if len(stamp) < 2:
        return StampTiming(math.nan, 0, math.nan, 0, math.nan, math.nan)
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


def has_lagged(stamp: Times, received: Times) -> bool:
    """Whether messages were received in bursts, so that the times of reception are not those of their arrival.

    Parameters
    ----------
    stamp, received : (n,), ns.
    """
    if len(stamp) < 2:
        return False
    period = float(np.median(np.diff(np.sort(stamp))))
    return float(np.mean(np.diff(np.sort(received)) < round(STREAM.burst * period))) > STREAM.lagged


def latency(stamp: Times, received: Times, answer_stamp: Times, answer_received: Times) -> Latency:
    """Time from a state to the command with its stamp.

    Parameters
    ----------
    stamp, received : (n,), ns, of the states.
    answer_stamp, answer_received : (m,), ns, of the commands; the first answer to a stamp counts.
    """
    _, first_state = np.unique(stamp, return_index=True)
    known, first = np.unique(answer_stamp, return_index=True)
    common, at_state, at_answer = np.intersect1d(stamp[first_state], known, assume_unique=True, return_indices=True)
    if not len(common):
        return Latency(0, 0, math.nan, math.nan, math.nan)
    commanded, given = received[first_state[at_state]], answer_received[first[at_answer]]
    seconds = (given - commanded).astype(np.float64) / 1e9
    between = (stamp[first_state] >= common[0]) & (stamp[first_state] <= common[-1])
    p50, p99 = (float(p) for p in np.percentile(seconds, [50.0, 99.0]))
    return Latency(len(common), int(np.sum(between)) - len(common), p50, p99, float(np.max(seconds)))
