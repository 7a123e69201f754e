"""Limit cycles that fill only a part of a recording: found in windows, each with its beginning and end."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.limit_cycle import LimitCycle, averaged, limit_cycle
from wam_analysis.measures.runs import runs, smoothed, summed
from wam_analysis.thresholds import CYCLE
from wam_bag.arrays import Mask, Numbers


class Episode(NamedTuple):
    """A limit cycle and when it was there, s."""

    begin: float
    end: float
    cycle: LimitCycle


def episodes(time: Numbers, value: Numbers, least: float) -> list[Episode]:
    """Limit cycles of a signal, in the order of time: in windows, and of all of it but for rests at its ends.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    value : (n,), without NaN.
    least : peak to peak of the smallest cycle that is reported, above the noise.
    """
    found = _in_windows(time, value, least)
    left, enters = (np.flatnonzero(np.abs(value - value[end]) > least) for end in (0, -1))
    if not len(left) or not len(enters) or left[0] >= enters[-1]:
        return found
    moving = slice(max(left[0] - 1, 0), enters[-1] + 2)
    cycle, rested = _cycle(time[moving], value[moving], least), time[-1] - time[moving][-1] + time[moving][0] - time[0]
    # one of at most twice its frequency is the same, or a part of its shape
    faster = [one for one in found if cycle and (2.0 + CYCLE.same_period) * one.cycle.period < cycle.period]
    is_known = cycle and any(one.cycle.period > (1.0 - CYCLE.same_period) * cycle.period for one in found)
    if cycle is None or is_known or rested < CYCLE.same_period * cycle.period:
        return found
    whole = Episode(float(time[moving][0]), float(time[moving][-1]), cycle)
    return sorted([whole, *faster], key=lambda episode: episode.begin)


def _in_windows(time: Numbers, value: Numbers, least: float) -> list[Episode]:
    """Limit cycles in windows of the whole, of half, of a quarter ... of a signal.

    Where a window holds a cycle, the cycle begins and ends where its amplitude at that period falls to half, within the
    window or beyond it, and is evaluated between these ends; where a step disturbs it there, between those at which the
    amplitude is doubled, too.  A motion that decays between them is none, one that grows is one.  There, windows of
    four of its periods and shorter ones may hold a faster one, as a vibration in a slow motion: one that ends within a
    period, or has half of its period, is part of its shape.
    """
    n = length = len(value)
    longest = np.full(n, n)  # window that is looked at
    found: list[Episode] = []
    transients: list[_Transient] = []
    while length >= min(CYCLE.window_samples, n):
        level = value - smoothed(value, length // CYCLE.slowest_cycles)
        for begin in range(0, n - length + 1, max(length // 2, 1)):
            rows = slice(begin, begin + length)
            if np.any(longest[rows] < length):
                continue
            cycle = _cycle(time[rows], value[rows], least) or _cycle(time[rows], level[rows], least, changes=True)
            if cycle is None:
                continue
            flat = without_drift(time, value, cycle.period)
            amplitude = _amplitude(time, flat, cycle.period)
            whole = _width(time, cycle.period) // 2
            size = np.quantile(amplitude[rows][whole:-whole], 0.75)  # the window may have quiet parts and a loud one
            lag = cycle.period / float(time[1] - time[0])
            edge = round(CYCLE.edge * lag)
            for most in (math.inf, 2.0):
                is_part = (amplitude >= 0.5 * size) & (amplitude <= most * size) & (longest >= length)
                first, last = _widest(is_part, rows)
                inner = slice(first + edge if first else 0, last - edge if last < n else n)
                if inner.stop - inner.start < CYCLE.episode_cycles * lag:
                    inner = slice(first, last)  # with its ends within the recording
                both = (_cycle(time[inner], signal[inner], least, cycle.period) for signal in (value, flat))
                better = max(filter(None, both), key=lambda one: one.confidence, default=None)
                slower = np.max(longest[first:last] % n) / CYCLE.slowest_cycles  # lag of one that is there, or 0
                is_shape = last - first < slower or abs(2.0 * lag - slower) < CYCLE.same_period * slower
                changing = None if better or is_shape else _changing(time[inner], flat[inner], cycle.period)
                if better or is_shape or changing:
                    break
            goes_on = better is not None and any(one.goes_on(first, last, better) for one in transients)
            if is_shape or goes_on or changing:
                if changing and changing.growth > 1.0 and changing.cycles >= CYCLE.episode_cycles:
                    found.append(Episode(float(time[first]), float(time[last - 1]), changing))
                transients.append(_Transient(first, last, cycle.period, _width(time, cycle.period)))
                lag = 0.0  # its last part is no limit cycle
            elif better is None and (cycle.cycles < 4 * CYCLE.episode_cycles or cycle.confidence < CYCLE.sure):
                continue
            else:
                if better is None or (most < math.inf and last - first < length):  # it is in all of the window
                    first, last, better = begin, begin + length, cycle
                found.append(Episode(float(time[first]), float(time[last - 1]), better))
            longest[first:last] = CYCLE.slowest_cycles * lag  # a faster one may be there
        length //= 2
    return sorted(found, key=lambda episode: episode.begin)


class _Transient(NamedTuple):
    """Rows of a motion that decays or grows, its period, s, and how many rows from it are near."""

    first: int
    last: int
    period: float
    near: int

    def goes_on(self, first: int, last: int, cycle: LimitCycle) -> bool:
        """Whether a cycle is another part of it: next to it, of the same period, and of a changing size."""
        is_next = first <= self.last + self.near and last >= self.first - self.near
        is_alike = abs(cycle.period / self.period - 1.0) < CYCLE.same_period
        return is_next and is_alike and min(cycle.growth, 1.0 / cycle.growth) < CYCLE.steady


def _cycle(
    time: Numbers, value: Numbers, least: float, period: float = math.nan, changes: bool = False
) -> LimitCycle | None:
    """The cycle of a window, None where none is sure; its size may change."""
    if not np.ptp(value) > least:
        return None
    cycle = limit_cycle(time, value, period)
    is_enough = (1.0 + CYCLE.same_period) * cycle.cycles >= CYCLE.episode_cycles
    sure = cycle.explained if changes else cycle.confidence
    return cycle if sure >= CYCLE.sure and is_enough and cycle.peak_to_peak > least else None


def _width(time: Numbers, period: float) -> int:
    """Samples over which a cycle is averaged."""
    return 2 * round(0.5 * averaged(period / float(time[1] - time[0]), len(time))) or 4


def without_drift(time: Numbers, value: Numbers, period: float) -> Numbers:
    """A signal without what changes slowly: less its mean over exactly two periods, of which a cycle has none.

    Then less that of the rest, as the first mean leaves some of a strong slow motion.  In the first and the last period
    the mean goes on as in the next: a window that ends there is not two periods long.
    """
    lag = period / float(time[1] - time[0])
    half = 0.5 * averaged(lag, len(value)) or lag
    end = math.ceil(half)
    middle = np.arange(end, len(value) - end) + 0.5
    away = np.arange(1, end + 1) / end
    for _ in range(2):
        total = summed(value)
        ends = (np.interp(middle + way * half, np.arange(len(total)), total) for way in (1.0, -1.0))
        slow = (next(ends) - next(ends)) / (2.0 * half)
        before = slow[0] - away[::-1] * (slow[end] - slow[0])
        after = slow[-1] + away * (slow[-1] - slow[-1 - end])
        value = value - np.concatenate([before, slow, after])
    return value


def _amplitude(time: Numbers, flat: Numbers, period: float) -> Numbers:
    """Half of the amplitude at a period, averaged over two, (n,)."""
    width = _width(time, period)
    turns = flat * np.exp(-2j * np.pi * (time - time[0]) / period)
    total, row = summed(turns), np.arange(len(flat))
    low, high = np.maximum(row - width // 2, 0), np.minimum(row + width // 2, len(flat))  # narrower at both ends
    return np.asarray(np.abs(total[high] - total[low]) / (high - low))


def _widest(mask: Mask, rows: slice) -> tuple[int, int]:
    """The rows between which a mask is true, that hold most of a window; the window where it is true nowhere."""
    if not np.any(mask[rows]):
        return rows.start, rows.stop
    parts = runs(mask)
    shared = np.minimum(parts[:, 1], rows.stop) - np.maximum(parts[:, 0], rows.start)
    first, last = parts[int(np.argmax(shared))].tolist()
    return first, last


def _changing(time: Numbers, flat: Numbers, period: float) -> LimitCycle | None:
    """The cycle of a motion that repeats at a period, but decays or grows; None of any other."""
    cycle = limit_cycle(time, flat, period)
    change = 1.0 - min(cycle.growth, 1.0 / cycle.growth) if cycle.growth > 0.0 else 1.0
    is_one = min(cycle.explained, change) > 1.0 - CYCLE.sure and cycle.confidence + change >= CYCLE.sure
    return cycle if is_one else None
