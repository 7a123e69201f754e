"""Limit cycles in a recording: amplitude, period and confidence."""

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import after_gaps, noise, summed
from wam_analysis.thresholds import CYCLE
from wam_bag.arrays import Numbers


class LimitCycle(NamedTuple):
    """A periodic motion.

    Attributes
    ----------
    peak_to_peak : of the mean cycle, or most from sample to sample where it alternates, in the unit of the signal; NaN
        if none was found.
    period : s; NaN if none was found.
    cycles : how many the recording holds.
    explained : fraction of the motion that the mean cycle explains.
    confidence : 0 to 1: that, less the relative change of its size from the first half to the second.  It is near 0
        for noise and single transients.
    growth : size of the second half over that of the first; 1 for a limit cycle.
    alternates : whether it does so from sample to sample, so that these never pass its phases: its size is not known.
    """

    peak_to_peak: float
    period: float
    cycles: float
    explained: float
    confidence: float
    growth: float
    alternates: bool = False


NO_CYCLE = LimitCycle(math.nan, math.nan, 0.0, 0.0, 0.0, math.nan)


def limit_cycle(time: Numbers, value: Numbers, period: float = math.nan) -> LimitCycle:
    """Find the cycle that repeats in a signal.

    The period is the lag with the highest autocorrelation, refined by the drift of its phase.  The signal is then
    folded on it, which averages noise and keeps the height of a sawtooth or a jump.  A linear drift is removed,
    together with the first harmonic, which alone looks like a drift, too.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    value : (n,), the signal, without NaN.
    period : s, if it is known better than by the autocorrelation.

    Returns
    -------
    LimitCycle
        with confidence 0 if nothing repeats at least three times, or the times have gaps.
    """
    n = len(value)
    if n < 4 * CYCLE.cycles or float(np.ptp(value)) == 0.0 or np.any(after_gaps(time)):
        return NO_CYCLE
    seconds = float(time[-1] - time[0]) / (n - 1)
    centre, flat = np.linspace(-1.0, 1.0, n), value - np.mean(value)
    level = flat - centre * float(centre @ flat) / float(centre @ centre)
    lag = _period(level) if math.isnan(period) else period / seconds
    if math.isnan(lag):
        return NO_CYCLE
    lag = _refined(level, lag)
    if not averaged(lag, n):
        likeness = max(0.0, -float(level[1:] @ level[:-1]) / float(level @ level))
        most = float(np.percentile(np.abs(np.diff(level)), 95.0))
        return LimitCycle(most, 2.0 * seconds, n / 2.0, likeness, likeness, 1.0, alternates=True)
    phase = np.arange(n) / lag % 1.0
    turn = 2.0 * math.pi * phase
    drift = np.column_stack([centre, np.cos(turn), np.sin(turn), np.ones(n)])
    flat = flat - centre * np.linalg.lstsq(drift, flat, rcond=None)[0][0]
    phases = max(min(CYCLE.phases, n // CYCLE.phase_samples), 2)
    loud = noise(flat)
    folded = _fold(flat, phase, phases, loud)
    if math.isnan(period) and n >= 2 * CYCLE.cycles * lag:
        cells = max(min(phases, int(lag) // 2), 2)  # each has a sample of every cycle
        once, twice = (_fold(flat, np.arange(n) / (k * lag) % 1.0, k * cells, loud).explained for k in (1, 2))
        if 1.0 - twice < (1.0 - CYCLE.sure) * (1.0 - once):  # every other cycle is alike
            return limit_cycle(time, value, 2.0 * lag * seconds)
    half = n // 2
    first, second = (_fold(flat[rows], phase[rows], phases, loud).size for rows in (slice(half), slice(half, n)))
    growth = second / first if first > 0.0 else math.inf
    change = abs(second - first) / max(first, second, 1e-300)
    return LimitCycle(
        peak_to_peak=folded.size,
        period=lag * seconds,
        cycles=n / lag,
        explained=folded.explained,
        confidence=max(0.0, folded.explained - change),
        growth=growth,
    )


def size_of_cycle(time: Numbers, value: Numbers, period: float) -> float:
    """Peak to peak of the mean cycle of a known period, at any times: irregular ones fill every phase.

    Parameters
    ----------
    time : (n,), s.
    value : (n,), the signal without drift.
    period : s.
    """
    phases = max(min(CYCLE.phases, len(value) // CYCLE.phase_samples), 2)
    return _fold(value - np.mean(value), time / period % 1.0, phases, noise(value)).size


def _period(flat: Numbers) -> float:
    """Lag of the first of the highest peaks of the autocorrelation, in samples; NaN for none.

    The peaks of a fast cycle are between the samples: a peak is as high as the cosine through it and its neighbours.
    A faster cycle on top makes many peaks of one: it is the highest of those that are nearer to the first than to
    its double.
    """
    n = len(flat)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(flat, size)) ** 2
    longest = n // CYCLE.cycles + 1
    likeness = np.fft.irfft(power, size)[: n // 2 + 2] / (n - np.arange(n // 2 + 2))
    negative = np.flatnonzero(likeness[:longest] < 0.0)
    if not len(negative):
        return math.nan
    first = int(negative[0])
    fast = 2 * size // 5
    fastest = size / (fast + int(np.argmax(power[fast:])))  # of 2 to 2.5 samples, whose peak is at 2
    if first == 1 and likeness[2] >= CYCLE.correlated * np.max(likeness[first:longest]):
        return fastest
    three = likeness[np.arange(first, longest - 1) + np.arange(3)[:, None]]
    before, peak, after = three
    peaks = np.flatnonzero((peak >= before) & (peak > after) & (before + after > -2.0 * peak))
    if not len(peaks):
        return math.nan
    before, peak, after = three[:, peaks]
    turn = 0.5 * (before + after) / peak
    heights = np.hypot(peak, 0.5 * (after - before) / np.sqrt(np.maximum(1.0 - turn**2, 1e-300)))
    lags = first + 1 + peaks
    high = np.flatnonzero(heights >= CYCLE.correlated * np.max(heights))
    high = high[2 * lags[high] < 3 * lags[high[0]]]
    lag = int(lags[high[np.argmax(heights[high])]])
    return top(likeness, lag) if lag > 2 else fastest


def averaged(lag: float, n: int) -> float:
    """Samples of two cycles, or in which those of a fast one pass its phases; 0 if n do not pass them three times."""
    passed = lag / max(lag - 2.0, 1e-300)
    return max(2.0 * lag, passed) if CYCLE.cycles * passed <= n else 0.0


def _refined(flat: Numbers, lag: float) -> float:
    """The lag by the drift of the phase of its first harmonic: an error of it blurs the mean of many cycles."""
    if not (width := 2 * round(0.5 * averaged(lag, len(flat)))):
        return lag
    turns = flat * np.exp(-2j * np.pi * np.arange(len(flat)) / lag)
    total = summed(turns)
    phase = np.unwrap(np.angle(total[width:] - total[:-width]))
    if len(phase) < width:
        return lag
    slope = float(np.polynomial.polynomial.polyfit(np.arange(len(phase)), phase, 1)[1])
    found = 1.0 / (1.0 / lag + slope / (2.0 * math.pi))
    return found if abs(found / lag - 1.0) < CYCLE.same_period else lag


def top(values: Numbers, row: int) -> float:
    """Where the parabola through a sample and its two neighbours is highest."""
    a, b, c = values[row - 1 : row + 2].tolist()
    return row + 0.5 * (a - c) / (a - 2.0 * b + c)


class _Folded(NamedTuple):
    """Peak to peak of the mean cycle, and the part of the variance that it explains beyond chance."""

    size: float
    explained: float


def _fold(flat: Numbers, phase: Numbers, phases: int, loud: float) -> _Folded:
    """The mean cycle of a signal with a noise of sd `loud`."""
    samples = 1.0 / float(np.median(np.diff(phase) % 1.0))
    if samples < CYCLE.few_samples:
        return _fitted(flat, phase, phases, max(math.ceil(0.5 * samples) - 1, 1))
    cell = np.minimum((phase * phases).astype(np.int64), phases - 1)
    count = np.bincount(cell, minlength=phases)
    shape = np.bincount(cell, flat, phases) / np.maximum(count, 1)
    known = np.flatnonzero(count)
    shape = np.interp(np.arange(phases), known, shape[known], period=phases)
    explained, rest = _explained(flat, shape[cell], len(known))
    seen = shape[count > 0.5 * np.mean(count[known])]  # of few samples a mean is noise
    scatter = math.sqrt(min(rest, loud**2) * len(seen) / len(flat))
    size = float(np.ptp(seen)) - luck(np.max(seen) - seen, scatter) - luck(seen - np.min(seen), scatter)
    return _Folded(max(size, 0.0), explained)


def _fitted(flat: Numbers, phase: Numbers, phases: int, number: int) -> _Folded:
    """The harmonics nearest to a signal with few samples in a cycle, all of which may miss its peak."""
    turn = 2j * math.pi * np.arange(number + 1)
    waves = [np.exp(np.outer(at, turn)) for at in (phase, np.arange(phases) / phases)]
    here, whole = (np.hstack([one.real, one.imag[:, 1:]]) for one in waves)
    parts = np.linalg.lstsq(here, flat)[0]
    return _Folded(float(np.ptp(whole @ parts)), _explained(flat, here @ parts, len(parts))[0])


def _explained(flat: Numbers, fit: Numbers, free: int) -> tuple[float, float]:
    """Part of the variance that a fit of so many numbers explains beyond chance, and the variance of the rest."""
    rest = float(np.sum((flat - fit) ** 2)) / max(len(flat) - free, 1)
    whole = float(np.sum((flat - np.mean(flat)) ** 2)) / max(len(flat) - 1, 1)
    return max(0.0, 1.0 - rest / whole) if whole > 0.0 else 0.0, rest


def luck(below: Numbers, scatter: float) -> float:
    """Part of the highest of the phases on a plateau that is due to noise: the expected largest of so many draws."""
    rivals = np.count_nonzero(below <= 4.0 * scatter)
    return scatter * NormalDist().inv_cdf((rivals - 0.375) / (rivals + 0.25)) if rivals > 1 else 0.0
