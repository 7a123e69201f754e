"""Lines in the spectrum of a recorded signal: what oscillates at a frequency of its own, above its neighbourhood."""

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyfit, polyval

from wam_analysis.measures.limit_cycle import top
from wam_analysis.thresholds import CYCLE
from wam_bag.arrays import Mask, Numbers


class SpectralLine(NamedTuple):
    """An oscillation: frequency, Hz, and amplitude, half of its peak to peak, in the unit of the signal."""

    frequency: float
    amplitude: float


def spectral_lines(time: Numbers, value: Numbers, stamps: Numbers) -> list[SpectralLine]:
    """The strongest lines of a spectrum, and of those about a line that is the strongest within two octaves.

    The latter are as of a vibration next to a slow motion.  A line is a maximum of the Hann periodogram that noise does
    not explain whose power is a power of the frequency among the neighbours, so that drift is none.  Its frequency is
    that of a parabola through the logarithms of three bins.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    value : (n,), without NaN.
    stamps : (m,), s, when the samples were taken between which the values are on straight lines, or `time`.
    """
    n = len(value)
    if n < CYCLE.window_samples or not np.ptp(value) > 0.0:
        return []
    even, flat, window = np.linspace(time[0], time[-1], n), *_windowed(value)
    amplitude = 4.0 * np.abs(np.fft.rfft(flat)) / n
    levels = np.log(np.maximum(amplitude, 1e-300))
    power, spacing = amplitude**2, (n - 1) / (n * float(time[-1] - time[0]))
    inner = power[1:-1]
    peaks = np.flatnonzero((inner > power[:-2]) & (inner >= power[2:])) + 1
    sure = math.log(n / 2) + CYCLE.sure_line
    found: list[SpectralLine] = []
    # peaks in the order of power; the strongest one near each line; lines that are the strongest near themselves
    seen, groups, heads = list[int](), list[int](), set[int]()
    free = np.ones(len(power), np.bool_)  # of stronger lines, whose power is no noise
    for k in peaks[np.argsort(-power[peaks])].tolist():
        is_clear = not found or (len(found) < CYCLE.lines and amplitude[k] >= CYCLE.clear_line * found[0].amplitude)
        is_drift = k < CYCLE.episode_cycles
        seen.append(k)
        near = next(one for one in seen if k // CYCLE.apart <= one < k * CYCLE.apart)
        is_near = groups.count(near) < CYCLE.lines and amplitude[k] >= CYCLE.clear_line * amplitude[near]
        if not (is_drift or is_clear or near == k or (is_near and near in heads)):
            continue
        if power[k] < sure * _noise(levels, free, k):
            continue
        heads |= {k} & {near}
        free[max(k - CYCLE.lobe, 0) : k + CYCLE.lobe + 1] = False
        if is_drift:
            continue
        groups.append(near)
        frequency = top(levels, k) * spacing
        back = np.exp(-2j * np.pi * frequency * even)
        kept = np.interp(even, stamps, np.exp(2j * np.pi * frequency * stamps))
        found.append(SpectralLine(frequency, 2.0 * float(np.abs(np.sum(flat * back) / np.sum(window * kept * back)))))
    return found


def _windowed(value: Numbers) -> tuple[Numbers, Numbers]:
    """A signal at a constant rate less its line, in a Hann window, and this window, whose mean is a half."""
    n = len(value)
    steps = np.linspace(0.0, 1.0, n)
    flat = value - polyval(steps, polyfit(steps, value, 1))
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(n) + 0.5) / n)
    return flat * window, window


def _noise(levels: Numbers, free: Mask, k: int) -> float:
    """Power of the noise at a bin: of a line through the logarithms of amplitude and frequency of its neighbours.

    The nearest bins have more next to a transient: then it is theirs.
    """
    least, most = CYCLE.neighbours
    reach = min(max(k // 2, least), most)
    rows = np.r_[max(k - reach, 1) : k - 2, k + 3 : min(k + reach + 1, len(levels))]
    rows = rows[free[rows]]
    if len(rows) < 2:
        return math.inf
    line = polyfit(np.log(rows / k), 2.0 * levels[rows], 1)
    nearest = levels[rows[np.abs(rows - k) <= 4]]
    level = max(line[0], 2.0 * np.mean(nearest)) if len(nearest) else line[0]
    return math.exp(float(level) + CYCLE.euler_gamma)
