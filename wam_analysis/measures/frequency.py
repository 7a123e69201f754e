"""Frequency response of recorded signals, its coherence and bandwidth."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_bag.arrays import Mask, Numbers

Complex = NDArray[np.complex128]


class FrequencyResponse(NamedTuple):
    """Response of an output to an input.

    Attributes
    ----------
    frequency : (k,), Hz, without zero.
    response : (k,), complex, output per input.
    coherence : (k,), 0 to 1: the fraction of the output that the input explains linearly.
    excitation : (k,), power of the input over its largest one.
    segments : number averaged; with a single one the coherence is always 1.
    """

    frequency: Numbers
    response: Complex
    coherence: Numbers
    excitation: Numbers
    segments: int


def frequency_response(
    rate: float, put: Numbers, got: Numbers, segment: int, after_gap: Mask | None = None
) -> FrequencyResponse:
    """Response and coherence by averaging segments (Welch, Hann window, half overlapped).

    Parameters
    ----------
    rate : Hz.
    put, got : (n,), input and output.
    segment : samples of a segment; the frequencies are `rate`/`segment` apart.
    after_gap : (n,), samples before which others are missing; no segment extends over them.  None without any.

    Raises
    ------
    ValueError
        if the recording has less than two segments without a gap or the input is constant.
    """
    n = len(put)
    edges = [0, *([] if after_gap is None else np.flatnonzero(after_gap).tolist()), n]
    if segment < 8 or sum((end - begin) // segment for begin, end in pairwise(edges)) < 2 or len(got) != n:
        raise ValueError(
            f"{n} samples of input, {len(got)} of output; two segments of {segment} (at least 8) are needed"
        )
    hop = segment // 2
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(segment) + 0.5) / segment)
    begins = [at for begin, end in pairwise(edges) for at in range(begin, end - segment + 1, hop)]
    pp, gg, gp = np.zeros(hop + 1), np.zeros(hop + 1), np.zeros(hop + 1, dtype=np.complex128)
    for begin in begins:
        a, b = (np.fft.rfft(window * _level(x[begin : begin + segment]))[: hop + 1] for x in (put, got))
        pp += np.abs(a) ** 2
        gg += np.abs(b) ** 2
        gp += b * np.conj(a)
    if not np.any(pp[1:] > 0.0):
        raise ValueError("the input is constant; there is no response to it")
    floor = 1e-30 * float(np.max(pp)), 1e-30 * float(np.max(gg))
    response = gp / np.maximum(pp, floor[0])
    coherence = np.abs(gp) ** 2 / np.maximum(pp * gg, max(floor[0] * floor[1], 1e-300))
    frequency = np.arange(hop + 1) * rate / segment
    excitation = pp[1:] / np.max(pp[1:])
    return FrequencyResponse(frequency[1:], response[1:], np.clip(coherence[1:], 0.0, 1.0), excitation, len(begins))


def _level(values: Numbers) -> Numbers:
    return values - np.mean(values)


def bandwidth(found: FrequencyResponse, believed: Mask) -> float:
    """Frequency at which the response falls 3 dB below that at the lowest accepted frequency, Hz.

    Parameters
    ----------
    found : the response.
    believed : (k,), the accepted frequencies.

    Returns
    -------
    float
        NaN if no frequency is accepted, infinite if the response does not fall that far.
    """
    rows = np.flatnonzero(believed)
    if not len(rows):
        return float("nan")
    size = np.abs(found.response[rows])
    below = np.flatnonzero(size < size[0] / np.sqrt(2.0))
    return float(found.frequency[rows[below[0]]]) if len(below) else float("inf")
