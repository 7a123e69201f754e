"""Lines in the spectrum of a recorded signal: what oscillates at a frequency of its own, above its neighbourhood."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

BRIEFEST = 64  # samples
FIRST = 5  # lowest frequency, in 1/duration: below it a drift is no line
NEIGHBOURS = 8, 24  # bins on each side at least and at most, half of the frequency, from which the noise is known
GAMMA = 0.5772  # of Euler: the mean logarithm of the power of noise is so much below that of its mean
SURE = 25.0  # power of a line over that of the noise, less the logarithm of the number of bins
CLEAR = 0.05  # of the largest line: smaller ones are not reported


class SpectralLine(NamedTuple):
    """An oscillation: frequency, Hz, and amplitude, half of its peak to peak, in the unit of the signal."""

    frequency: float
    amplitude: float


def spectral_lines(time: Numbers, value: Numbers, most: int) -> list[SpectralLine]:
    """The strongest lines of a spectrum, the strongest first.

    A line is a maximum of the Hann periodogram that noise does not explain whose power is a power of the frequency
    among the neighbours, so that drift is none.  Its frequency is that of a parabola through the logarithms of three
    bins.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    value : (n,), without NaN.
    most : lines that are returned at most.
    """
    n = len(value)
    if n < BRIEFEST or not np.ptp(value) > 0.0:
        return []
    steps = np.linspace(-1.0, 1.0, n)
    flat = value - np.polynomial.polynomial.polyval(steps, np.polynomial.polynomial.polyfit(steps, value, 1))
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(n) + 0.5) / n)
    amplitude = np.abs(np.fft.rfft(flat * window)) / (0.5 * float(window.sum()))
    power = amplitude**2
    inner = power[1:-1]
    peaks = np.flatnonzero((inner > power[:-2]) & (inner >= power[2:])) + 1
    found: list[SpectralLine] = []
    width = float(time[-1] - time[0]) * n / (n - 1)
    for k in peaks[np.argsort(-power[peaks])].tolist():
        if k < FIRST or len(found) == most or (found and amplitude[k] < CLEAR * found[0].amplitude):
            continue
        if power[k] < (math.log(n / 2) + SURE) * _noise(power, k):
            continue
        a, b, c = (math.log(max(float(amplitude[k + i]), 1e-300)) for i in (-1, 0, 1))
        shift = 0.5 * (a - c) / (a - 2.0 * b + c)
        frequency = (k + shift) / width
        turns = np.exp(-2j * np.pi * frequency * (time - time[0]))
        found.append(SpectralLine(frequency, float(2.0 * np.abs(np.sum(flat * window * turns)) / window.sum())))
    return found


def _noise(power: Numbers, k: int) -> float:
    """Level of the noise at a bin: of a line through the logarithms of power and frequency of its neighbours.

    The mean of the nearest bins is taken if it is higher, as next to the hump of a transient.
    """
    reach = min(max(k // 2, NEIGHBOURS[0]), NEIGHBOURS[1])
    rows = np.r_[max(k - reach, 1) : k - 2, k + 3 : min(k + reach + 1, len(power))]
    line = np.polynomial.polynomial.polyfit(np.log(rows / k), np.log(np.maximum(power[rows], 1e-300)), 1)
    near = np.r_[max(k - 4, 1) : k - 2, k + 3 : min(k + 5, len(power))]
    return max(math.exp(float(line[0]) + GAMMA), float(np.mean(power[near])))
