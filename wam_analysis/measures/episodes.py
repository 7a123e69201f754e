"""Limit cycles that fill only a part of a recording: found in windows, each with its beginning and end."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.measures.limit_cycle import LimitCycle, limit_cycle
from wam_analysis.measures.runs import smoothed

Numbers = NDArray[np.float64]

SURE = 0.8  # confidence from which a cycle is reported
FEWEST = 5  # cycles of an episode; fewer repeat by chance in one of many windows
BRIEFEST = 64  # samples of a window
SLOWEST = 4  # cycles in a window, slower changes are drift when a cycle is looked for
EDGE = 1.5  # cycles at an end within the recording that are not evaluated: it is not known better


class Episode(NamedTuple):
    """A limit cycle and when it was there, s."""

    begin: float
    end: float
    cycle: LimitCycle


def episodes(time: Numbers, value: Numbers, least: float) -> list[Episode]:
    """Limit cycles in windows of the whole, of half, of a quarter ... of a signal, in the order of time.

    The first window that holds a cycle is extended to where its amplitude at that period falls to half; the cycle is
    then evaluated between these ends.  A motion that decays or grows between them is none.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    value : (n,), without NaN.
    least : peak to peak of the smallest cycle that is reported, above the noise.
    """
    n = length = len(value)
    free = np.ones(n, dtype=np.bool_)
    found: list[Episode] = []
    while length >= min(BRIEFEST, n):
        level = value - smoothed(value, length // SLOWEST)
        for begin in range(0, n - length + 1, max(length // 2, 1)):
            rows = slice(begin, begin + length)
            if not np.all(free[rows]):
                continue
            cycle = _cycle(time[rows], value[rows], least) or _cycle(time[rows], level[rows], least)
            if cycle is None:
                continue
            flat = _without_drift(time, value, cycle.period)
            first, last = _extended(time, flat, rows, cycle.period, free)
            edge = round(EDGE * cycle.period / float(time[1] - time[0]))
            inner = slice(first + edge if first else 0, last - edge if last < n else n)
            inner = inner if inner.stop - inner.start >= length else rows
            period = _refined(time[inner], flat[inner], cycle.period)
            both = [_cycle(time[inner], signal[inner], least, period) for signal in (flat, value)]
            cycle = max(filter(None, both), key=lambda one: round(one.confidence, 2), default=None)
            free[first:last] = False  # also where it decays: its last part is no limit cycle
            if cycle is not None:
                found.append(Episode(float(time[first]), float(time[last - 1]), cycle))
        length //= 2
    return sorted(found, key=lambda episode: episode.begin)


def _cycle(time: Numbers, value: Numbers, least: float, period: float = math.nan) -> LimitCycle | None:
    """The cycle of a window, None where none is sure."""
    if len(value) < 2 or not np.ptp(value) > least:
        return None
    cycle = limit_cycle(time, value, period)
    return cycle if cycle.confidence >= SURE and cycle.cycles >= FEWEST and cycle.peak_to_peak > least else None


def _width(time: Numbers, period: float) -> int:
    """Samples of two periods."""
    return max(2 * round(period / float(time[1] - time[0])), 2)


def _refined(time: Numbers, flat: Numbers, period: float) -> float:
    """The period by the drift of the phase of its first harmonic: an error of it blurs the mean of many cycles."""
    width = _width(time, period)
    turns = flat * np.exp(-2j * np.pi * (time - time[0]) / period)
    phase = np.unwrap(np.angle(np.convolve(turns, np.ones(width) / width, "valid")))
    if len(phase) < width:
        return period
    slope = float(np.polynomial.polynomial.polyfit(time[: len(phase)], phase, 1)[1])
    return 1.0 / (1.0 / period + slope / (2.0 * math.pi))


def _without_drift(time: Numbers, value: Numbers, period: float) -> Numbers:
    """A signal without what changes slowly: less its mean over exactly two periods, of which a cycle has none.

    In the first and the last period the mean goes on as in the next: a window that ends there is not two periods long.
    """
    half = period / float(time[1] - time[0])
    end = math.ceil(half)
    total = np.concatenate([[0.0], np.cumsum(value)])
    middle = np.arange(end, len(value) - end) + 0.5
    ends = (np.interp(middle + way * half, np.arange(len(total)), total) for way in (1.0, -1.0))
    slow = (next(ends) - next(ends)) / (2.0 * half)
    away = np.arange(1, end + 1) / end
    before = slow[0] - away[::-1] * (slow[end] - slow[0])
    after = slow[-1] + away * (slow[-1] - slow[-1 - end])
    flat: Numbers = value - np.concatenate([before, slow, after])
    return flat


def _extended(time: Numbers, flat: Numbers, rows: slice, period: float, free: NDArray[np.bool_]) -> tuple[int, int]:
    """Rows about a window between which the amplitude at a period, averaged over two, is above half of its own."""
    n, width = len(flat), _width(time, period)
    turns = flat * np.exp(-2j * np.pi * (time - time[0]) / period)
    amplitude = np.abs(np.convolve(turns, np.ones(width) / width, "same"))
    inside = amplitude[rows][width // 2 : -(width // 2)]
    weak = np.flatnonzero((amplitude < 0.5 * float(np.median(inside))) | ~free)
    weak = weak[(weak >= width) & (weak < n - width)]  # nearer to the ends the mean is incomplete
    middle = (rows.start + rows.stop) // 2
    return int(max(weak[weak < middle], default=-1)) + 1, int(min(weak[weak > middle], default=n))
