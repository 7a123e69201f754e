"""Step responses: rise, settling, overshoot."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.limit_cycle import luck
from wam_analysis.measures.runs import noise, smoothed
from wam_analysis.measures.swings import Swings, swings
from wam_analysis.thresholds import CYCLE, HOLD
from wam_bag.arrays import Numbers


class StepResponse(NamedTuple):
    """Response to a step, in the unit of the signal and in seconds from the step.

    Attributes
    ----------
    final : mean of the steady end; NaN if it still moves one way.
    ripple : half of the range in the steady end.
    rise : from 10 % to 90 % of the way to `final`, s; NaN if it does not get there, or there is no step.
    settling : until the signal stays within the band about `final`, s; infinite if it leaves the band in the
        steady end; NaN if there is no step.
    overshoot : largest excess over `final` as a fraction of the step, less what noise gives, 0 if there is none; NaN
        likewise.
    """

    final: float
    ripple: float
    rise: float = math.nan
    settling: float = math.nan
    overshoot: float = math.nan


def step_response(
    time: Numbers, value: Numbers, begin: float, steady: float, band: float, least: float = 0.0
) -> StepResponse:
    """Rise, settling and overshoot of a recorded step.

    Noise is averaged over as many samples as it takes to bring it well below the band, or over fewer where
    these would be a large part of the rise.

    Parameters
    ----------
    time : (n,), s from the step, rising, at a constant rate; below 0 in a ramp that leads to it.
    value : (n,), the signal.
    begin : value before the step; NaN where it is not known.
    steady : length of the end that counts as steady, s; less where a part of it still moves one way.  What does so to
        the end has no rise and no overshoot, and has not settled.
    band : settling band as a part of the step, for example 0.02.
    least : a change that is not larger is no step.
    """
    tail, is_steady = _end(value[time >= time[-1] - steady], begin, band)
    final, ripple = float(np.mean(tail)), float(np.ptp(tail)) / 2.0
    step = final - begin
    if not abs(step) > least:
        return StepResponse(final, ripple)
    sd = noise(value) / abs(step)
    narrowest, width = (
        min(math.ceil((4.0 * sd / (q * band)) ** 2), len(value) // 50) for q in (CYCLE.step_loudest, CYCLE.step_quiet)
    )
    while True:
        part = (smoothed(value, width) - begin) / step  # 0 before, 1 at the end
        low, high = _crossing(time, part, 0.1), _crossing(time, part, 0.9)
        if width <= narrowest or not high - low < CYCLE.sharp * width * float(time[1] - time[0]):
            break
        width = max(width // 2, narrowest)
    outside = np.flatnonzero(np.abs(part - 1.0) > band)
    if not len(outside):
        settling = 0.0
    elif not is_steady or time[outside[-1]] >= time[-len(tail)]:
        settling = math.inf  # what leaves the band in the steady end has not settled, wherever the recording stops
    else:
        settling = max(_between(time, np.abs(part - 1.0), int(outside[-1]), band), 0.0)
    if not is_steady:
        return StepResponse(math.nan, ripple, settling=settling)
    part = part[: len(part) - width // 2]  # the last means are of fewer samples
    over = float(np.max(part)) - 1.0 - luck(np.max(part) - part, sd / math.sqrt(2 * (width // 2) + 1))
    return StepResponse(final, ripple, high - low, settling, max(over, 0.0))


def _end(tail: Numbers, begin: float, band: float) -> tuple[Numbers, bool]:
    """The part of an end that does not move one way by much of the band, else its last part; whether there is one."""
    change, is_steady = abs(float(np.mean(tail)) - begin), True
    for _ in range(CYCLE.halvings):
        if len(tail) < 2 * CYCLE.halvings:
            break
        means = np.array([np.mean(each) for each in np.array_split(tail, 2 * CYCLE.halvings)])
        moved = abs(float(means[-1] - means[0]))
        sure = 4.0 * noise(tail) * math.sqrt(4.0 * CYCLE.halvings / len(tail))
        if is_steady := moved < CYCLE.one_way * np.ptp(means) or moved < max(CYCLE.at_end * band * change, sure):
            break
        tail = tail[len(tail) // 2 :]
    return tail, is_steady


def force_response(
    time: Numbers, force: Numbers, before: float, commanded: float, size: float
) -> tuple[StepResponse, Swings]:
    """Response of a force, (n,), N, to a command that changes by a size, N, and the swings of its error.

    A response that is smaller than an error which counts as settled is no step.
    """
    error, small = force - commanded, HOLD.loud * size
    band = max(small, 4.0 * noise(error))
    response = step_response(time, force, before, HOLD.steady * float(time[-1]), HOLD.band, small)
    return response, swings(time, error, 2.0 * band, band)


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
