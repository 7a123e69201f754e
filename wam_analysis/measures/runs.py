"""Intervals in which a condition holds, usual and missing times, and the noise of a signal."""

import math
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Mask, Numbers, Rows, Times


def after_gaps(time: Numbers | Rows) -> Mask:
    """Samples that come so long after the one before that nothing is known between them, (n,).

    Parameters
    ----------
    time : (n,), rising, in any unit.
    """
    steps = np.diff(time)
    late = steps > STREAM.filled * np.median(steps) if len(steps) else np.zeros(0, np.bool_)
    return np.concatenate([np.zeros(min(1, len(time)), np.bool_), late])


def median_step(time: Numbers | Times) -> float:
    """From sample to sample, in the unit of the times, (n,); 0 of a single one."""
    return float(np.median(np.diff(time))) if len(time) > 1 else 0.0


def interpolated(time: Numbers | Times, stamps: Numbers | Times, values: Numbers) -> Numbers:
    """Columns of values, (n, k), on straight lines between the stamps, at some times, (m, k)."""
    return np.column_stack([np.interp(time, stamps, column) for column in values.T])


def summed(value: NDArray[Any]) -> NDArray[Any]:
    """The sum of a signal, (n,), before each sample and after the last, (n + 1,)."""
    return np.concatenate([[0.0], np.cumsum(value)])


def usual_steps(steps: Numbers | Times) -> Numbers:
    """The usual step about each, (n,): that of all, or of the steps about it where these are even, as at another rate.

    Where many are missing the mean is longer than a period; where none is near it, as in packets, NaN.
    """
    number, size = max(len(steps) // STREAM.steps, 1), min(len(steps), STREAM.steps)
    parts = steps[: number * size].reshape(number, size)
    near = np.rint(steps / np.median(np.mean(parts, axis=1))) == 1.0
    usual = np.median(steps[near]) if np.any(near) else math.nan
    usual = np.median(steps[np.rint(steps / usual) == 1.0]) if np.any(near) else usual
    own = np.median(parts, axis=1, keepdims=True)
    is_even = np.mean(np.abs(parts - own) <= STREAM.pace * own, axis=1) >= STREAM.evenly
    near = np.pad(np.where(is_even, own[:, 0], usual), 1, "edge")
    slowest = np.max(sliding_window_view(near, 3), axis=1)
    return slowest[np.minimum(np.arange(len(steps)) // STREAM.steps, number - 1)]


def missed(times: Times, periods: Numbers) -> float:
    """Messages that are missing among rising times: what came late is near the time that it left out.

    NaN where most steps are no multiple of the period, so that there is none.

    Parameters
    ----------
    times : (n,), ns.
    periods : (n - 1,), the usual steps about each, see `usual_steps`.
    """
    steps = np.diff(times)
    parts = steps / periods
    whole = np.maximum(np.rint(parts), 1.0)
    if np.count_nonzero(np.abs(parts - whole) <= STREAM.pace) < STREAM.regular * len(parts):
        return math.nan
    rows = np.flatnonzero(parts > STREAM.changes)
    long, period = steps[rows], periods[rows]
    first = np.searchsorted(times, times[rows] - long)
    last = np.searchsorted(times, times[rows + 1] + long, side="right") - 1
    there = (times[last] - times[first]) / period - (last - first)
    return float(np.sum(np.clip(np.rint(there), 0, whole[rows] - 1.0)))


def runs(mask: Mask) -> Rows:
    """Rows [begin, end) of each interval that is true, (k, 2).

    Parameters
    ----------
    mask : (n,).
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return edges.reshape(-1, 2).astype(np.int64)


def without_short(mask: Mask, shortest: int) -> Mask:
    """The mask with every interval, true or false, of fewer samples than `shortest` merged into its neighbours.

    The shortest is merged first, so that a burst of bounces does not absorb its neighbours.  The first and
    the last interval have one neighbour only and are kept.

    Parameters
    ----------
    mask : (n,).
    shortest : samples.
    """
    kept = mask.copy()
    for length in range(1, shortest):
        while True:
            bounds = np.flatnonzero(np.diff(kept)) + 1
            short = np.flatnonzero(np.diff(bounds) <= length)
            if not len(short):
                break
            row = np.arange(len(short))  # of neighbours that are short, every other one
            first = np.maximum.accumulate(np.where(np.diff(short, prepend=-2) > 1, row, 0))
            merged = short[(row - first) % 2 == 0]
            turns = np.zeros(len(kept), np.bool_)
            turns[bounds[merged]] = turns[bounds[merged + 1]] = True
            kept ^= np.logical_xor.accumulate(turns)
    return kept


def at_rest(velocity: Numbers, rest: float, shortest: int) -> Mask:
    """Whether a shaft sticks or slips at each sample, (n,).

    Parameters
    ----------
    velocity : (n,), rad/s or m/s, at a constant rate.
    rest : speed up to which it is at rest, above the sensor's noise.
    shortest : samples that a rest or a motion lasts at least; shorter ones are merged into their neighbours.
    """
    return without_short(np.abs(velocity) <= rest, shortest)


def stays(value: Numbers, reach: float, rows: int) -> Mask:
    """Samples to which a signal came in a stretch that stays within a reach for at least so many steps, (n,)."""
    if len(value) <= rows:
        return np.full(len(value), np.ptp(value) <= reach)
    still = np.ptp(sliding_window_view(value, rows + 1), axis=1) <= reach
    total = np.cumsum(np.pad(still, (rows, rows - 1)))
    steps = total[rows:] > total[:-rows]
    return np.concatenate((steps[:1], steps))


def without_turns(
    still: Mask,
    velocity: Numbers,
    rest: float,
    position: Numbers | None = None,
    hidden: float = 0.0,
    period: float = 1.0,
) -> Mask:
    """The rests without those in which a smooth motion only turns back or is slow, as a slow sine does.

    Such a motion passes through the speeds of rest evenly, or does not come near zero; a shaft that sticks is at zero
    for most of the time, and then leaves its place faster than a parabola would.  Nor does it rest where its position
    moves faster, as where slow velocities are recorded as zero.

    Parameters
    ----------
    still : (n,), see `at_rest`.
    velocity : (n,), rad/s or m/s.
    rest : speed up to which it was counted as at rest.
    position, hidden : (n,), and how far a turn is hidden by its noise; None for the way of the velocity.
    period : s from sample to sample.
    """
    at = np.cumsum(velocity) * period if position is None else position

    def sticks(begin: int, end: int) -> bool:
        if np.ptp(np.percentile(at[begin:end], (5.0, 95.0))) > rest * period * (end - begin) + hidden:
            return False
        if not begin or end == len(velocity):
            return end - begin >= SHAFT.rest_samples
        quiet = begin + np.flatnonzero(np.abs(velocity[begin:end]) <= SHAFT.passing * rest)
        if len(quiet) < SHAFT.rest_samples:
            return False
        first, last = quiet[[0, -1]]
        count = last - first
        is_longer = np.any(still[max(begin - count, 0) : begin]) and np.any(still[end : end + count])
        if is_longer or not count <= first <= last < len(at) - count:  # it rests for longer than it moves
            return 2 * len(quiet) >= end - begin
        ways = [np.ptp(at[first - count : first + 1]), np.ptp(at[last : last + count + 1])]
        inside = np.ptp(np.percentile(at[first : last + 1], (5.0, 95.0)))
        return bool(max(ways) > SHAFT.turn * max(inside, hidden))

    kept = np.zeros_like(still)
    for begin, end in runs(still).tolist():
        kept[begin:end] = sticks(begin, end)
    return kept


def count(value: Numbers) -> float:
    """The smallest change from sample to sample, as a count of an encoder; rounding apart, infinite without one."""
    return smallest(np.diff(value), float(np.ptp(value))) if len(value) else math.inf


def smallest(changes: Numbers, reach: float) -> float:
    """The size of the smallest change of a signal of some reach that is no rounding; infinite without one."""
    sizes = np.abs(changes)
    return float(np.min(sizes[sizes > STREAM.rounding * reach], initial=math.inf))


def held_over(value: Numbers) -> Mask:
    """Which samples only repeat the one before, where a signal changes in every second message at most, and evenly.

    One that rests, or moves by counts of an encoder, repeats samples, too, but changes by one count.
    """
    steps = np.abs(np.diff(value))
    changed = np.flatnonzero(steps > 0.0) + 1
    apart, sizes = np.diff(changed), steps[changed - 1]
    if len(apart) < SHAFT.fewest_samples or np.any(np.isnan(steps)):
        return np.zeros(len(value), np.bool_)
    often = np.median(apart)
    is_even = np.mean((apart > 1) & (np.abs(apart - often) <= 1.0)) >= STREAM.evenly
    if not is_even or np.median(sizes) < STREAM.counts * np.min(sizes):
        return np.zeros(len(value), np.bool_)
    row = np.arange(len(value))
    since = row - np.concatenate([[0], changed])[np.searchsorted(changed, row, side="right")]
    return since % math.ceil(np.quantile(apart, STREAM.evenly)) > 0


def noise(value: Numbers) -> float:
    """Standard deviation of the noise of a signal, from its second and higher differences, or its spectrum.

    Robust against jumps, since it is a median of absolute differences; smooth motion adds nothing. With few samples in
    a period, as of a vibration, these are of the motion, but most of the spectrum is not.

    Parameters
    ----------
    value : (n,), at a constant rate.
    """
    n = len(value)
    if n < 3:
        return 0.0
    sizes = [np.median(np.abs(np.diff(value, m))) / math.sqrt(math.comb(2 * m, m)) for m in (2, 4, 6, 8) if m < n]
    fast = 1 << (n - 1).bit_length()  # of a length with large prime factors, the transform takes many times as long
    spectrum = np.abs(np.fft.rfft(np.hanning(n) * (value - np.mean(value)), fast))
    # of white noise, the median of the power is log(2) of its mean
    return float(min(min(sizes) / 0.6745, np.median(spectrum) / math.sqrt(0.375 * n * math.log(2.0))))


def smoothed(value: Numbers, width: int) -> Numbers:
    """Centred moving mean, narrower towards both ends, (n,).

    Parameters
    ----------
    value : (n,).
    width : samples; the next odd number is taken.
    """
    half = min(width // 2, (len(value) - 1) // 2)
    if half <= 0:
        return value.astype(np.float64)
    total = summed(value)
    row = np.arange(len(value))
    reach = np.minimum(half, np.minimum(row, len(value) - 1 - row))
    return (total[row + reach + 1] - total[row - reach]) / (2 * reach + 1)
