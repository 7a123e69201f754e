"""Step responses: rise, settling, overshoot."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.runs import noise, smoothed
from wam_analysis.thresholds import CYCLE
from wam_bag.arrays import Numbers


class StepResponse(NamedTuple):
    """Response to a step, in the unit of the signal and in seconds from the step.

    Attributes
    ----------
    final : mean of the steady end.
    rise : from 10 % to 90 % of the way to `final`, s; NaN if it does not get there.
    settling : until the signal stays within the band about `final`, s; infinite if it leaves the band in the
        steady end.
    overshoot : largest excess over `final` as a fraction of the step, 0 if there is none.
    ripple : half of the range in the steady end.
    rise_error : of `rise`, s: a sample, and the ripple over the slope of the rise.
    """

    final: float
    rise: float
    settling: float
    overshoot: float
    ripple: float
    rise_error: float


def step_response(time: Numbers, value: Numbers, begin: float, steady: float, band: float) -> StepResponse:
    """Rise, settling and overshoot of a recorded step.

    Noise is averaged over as many samples as it takes to bring it well below the band, or over fewer where
    these would be a large part of the rise.

    Parameters
    ----------
    time : (n,), s from the step, rising, at a constant rate.
    value : (n,), the signal.
    begin : value before the step.
    steady : length of the end that counts as steady, s.
    band : settling band as a part of the step, for example 0.02.

    Raises
    ------
    ValueError
        if there are fewer than eight samples or the signal ends where it began.
    """
    if len(time) != len(value) or len(time) < 8:
        raise ValueError(f"a step response of {len(value)} samples at {len(time)} times; at least 8 of both are needed")
    tail = value[time >= time[-1] - steady]
    final = float(np.mean(tail))
    step = final - begin
    if step == 0.0 or not math.isfinite(step):
        raise ValueError(f"the signal ends at {final:g}, where it began; there is no step to evaluate")
    sd = noise(value) / abs(step)
    least, width = (
        min(math.ceil((4.0 * sd / (q * band)) ** 2), len(value) // 50 or 1)
        for q in (CYCLE.step_loudest, CYCLE.step_quiet)
    )
    while True:
        part = (smoothed(value, width) - begin) / step  # 0 before, 1 at the end
        low, high = _crossing(time, part, 0.1), _crossing(time, part, 0.9)
        if width <= least or not high - low < CYCLE.sharp * width * float(time[1] - time[0]):
            break
        width = max(width // 2, least)
    outside = np.flatnonzero(np.abs(part - 1.0) > band)
    if not len(outside):
        settling = 0.0
    elif time[outside[-1]] >= time[-1] - steady:
        settling = math.inf  # what leaves the band in the steady end has not settled, wherever the recording stops
    else:
        settling = _between(time, np.abs(part - 1.0), int(outside[-1]), band)
    ripple = float(np.ptp(tail)) / 2.0
    period = float(time[-1] - time[0]) / (len(time) - 1)
    return StepResponse(
        final=final,
        rise=high - low,
        settling=settling,
        overshoot=max(float(np.max(part)) - 1.0, 0.0),
        ripple=ripple,
        rise_error=math.hypot(period, (high - low) * ripple / (0.8 * abs(step))),
    )


def _crossing(time: Numbers, part: Numbers, level: float) -> float:
    """When the signal first reaches a level, between two samples; NaN if it does not."""
    above = np.flatnonzero(part >= level)
    if not len(above):
        return math.nan
    return float(time[0]) if above[0] == 0 else _between(time, part, int(above[0]) - 1, level)


def _between(time: Numbers, value: Numbers, row: int, level: float) -> float:
    """When the line from sample `row` to the next meets a level."""
    a, b = float(value[row]), float(value[row + 1])
    share = (level - a) / (b - a) if b != a else 0.0
    return float(time[row] + share * (time[row + 1] - time[row]))
