"""Stretches of a source at a constant rate: their noise, rests, and velocity, recorded or made from positions."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.foreign.source import Source, Treated, Treatment
from wam_analysis.measures.runs import count, noise, summed, usual_steps
from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Numbers


class Piece(NamedTuple):
    """A stretch without gaps, at a constant rate.

    Attributes
    ----------
    time : (n,), s.
    values : (n,) by quantity.
    noise : its standard deviation by quantity.
    stamps : (m,), s, where these are irregular, else the same as `time`.
    recorded : (m,) by quantity, the values at the stamps.
    """

    time: Numbers
    values: dict[str, Numbers]
    noise: dict[str, float]
    stamps: Numbers
    recorded: dict[str, Numbers]

    @property
    def period(self) -> float:
        """From sample to sample, s."""
        return float(self.time[1] - self.time[0])


def pieces(source: Source, *quantities: str) -> list[Piece]:
    """The stretches of a source between gaps, at a constant rate; velocities made from positions if need be.

    Parameters
    ----------
    quantities : which are needed: messages without one of them are left out; all if none is given.
    """
    source = source.only(*(quantities or source.values))
    if len(source.time) < SHAFT.fewest_samples:
        return []
    steps = np.diff(source.time)
    period = float(np.median(steps))
    slow = steps[usual_steps(steps) > STREAM.changes * period]
    period = float(np.median(slow)) if 2.0 * np.sum(slow) > np.sum(steps) else period  # that of most of the time
    inner = (np.flatnonzero((steps > STREAM.filled * period) & (not source.sends_changes)) + 1).tolist()
    found = []
    for begin, end in zip([0, *inner], [*inner, len(source.time)], strict=True):
        time = source.time[begin:end]
        number = round((time[-1] - time[0]) / period) + 1
        if min(len(time), number) < SHAFT.fewest_samples:
            continue
        values = {q: v[begin:end] for q, v in source.values.items()}
        stamps, recorded = time, values
        if np.max(np.abs(np.diff(time) - period)) > STREAM.irregular * period:
            even = np.linspace(time[0], time[-1], number)
            values = {q: np.interp(even, time, v) for q, v in values.items()}
            time = even
        sd = {q: resolution(v, recorded[q]) for q, v in values.items()}
        if "position" in values and "velocity" not in values:
            values = dict(values)
            values["velocity"], sd["velocity"] = differentiated(time, values["position"], sd["position"])
        found.append(Piece(time, values, sd, stamps, recorded))
    return found


def resolution(value: Numbers, recorded: Numbers | None = None) -> float:
    """Standard deviation of the noise of a signal, or of the rounding of what was recorded to the steps of an encoder.

    What moves by the same in every sample shows no rounding.
    """
    recorded = value if recorded is None else recorded
    steps = np.diff(recorded)
    quantum = count(recorded)
    if quantum == math.inf:
        return 0.0
    counts = np.abs(steps[steps != 0.0]) / quantum
    # from place to place, to stay there, as a gripper does: no flicker of an encoder
    is_step = SHAFT.joint_rest < quantum >= 0.5 * np.ptp(recorded) and np.std(steps) < np.std(recorded)
    is_even = is_step or np.ptp(steps) < 0.5 * quantum
    is_rounded = not is_even and np.all(np.abs(counts - np.rint(counts)) < 0.05) and np.median(counts) < 1e3
    return max(noise(value), quantum / math.sqrt(12.0) if is_rounded else 0.0)


def rests(source: Source) -> bool:
    """Whether a joint never moved, by its position: an encoder may flicker between counts."""
    position = source.known("position")
    if not len(position):
        return False
    sd = resolution(position)
    most = np.ptp(np.percentile(position, (5.0, 95.0)))  # of the time in one place, but for its noise
    flickers = sd > noise(position) and most < 2.5 * count(position)  # by one count to either side
    return bool((flickers or most <= SHAFT.noisy * sd) and np.ptp(position) <= SHAFT.far * sd)


def differentiated(time: Numbers, position: Numbers, noise: float) -> tuple[Numbers, float]:
    """Rate of a position, and its noise: slope of a line through as many samples as it needs, within `widest`.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    position : (n,).
    noise : of the position.
    """
    period = float(time[1] - time[0])
    speed = float(np.percentile(np.abs(np.gradient(position, period)), 95.0))
    sd = noise / period
    half = 1
    while (
        half * period < SHAFT.window / 2.0
        and _of_slope(sd, half) > SHAFT.precise * speed
        and len(position) > 2 * half + 2
    ):
        half += 1
    k = np.arange(half, -half - 1, -1)
    inner = np.convolve(position, k / (float(k @ k) * period), "valid")
    return np.pad(inner, half, "edge"), _of_slope(sd, half)


def velocity_fit(source: Source) -> tuple[float, Treated | None]:
    """Recorded velocity over the rate of the position, and why it is left out, if it has to be.

    The factor is NaN where the position does not move or one of them is lacking, and below zero where the sign is
    swapped.
    """
    parts = [np.zeros((0, 3))]
    shown = source.only("position", "velocity")
    has_both = len(shown.values) == 2 and not rests(source)
    for piece in pieces(shown) if has_both else ():
        width = max(1, round(STREAM.averaged / piece.period))
        while len(piece.time) > width + 1:
            span, least = width * piece.period, SHAFT.noisy * resolution(piece.recorded["position"])
            way, by = ways(piece, width)
            if np.max(np.abs(way)) > 2.0 * least:
                rate = way / span
                moves = np.abs(rate) > max(SHAFT.joint_rest, least / span)
                parts.append(np.column_stack([by / span, rate, np.gradient(rate, piece.period)])[moves])
                break
            width *= 2  # it moves too slowly for its noise
    velocity, rate, change = np.vstack(parts).T
    if len(rate) and not np.any(recorded := shown.values["velocity"]):
        return 0.0, Treated(Treatment.UNFILLED, "velocity")
    if len(rate) < SHAFT.fewest_samples:
        return math.nan, None
    columns = np.column_stack([rate, change])
    now, before = np.linalg.lstsq(columns, velocity, rcond=None)[0]
    kept, lost, slope, left = (
        float(np.linalg.norm(each) / np.linalg.norm(rate))
        for each in (now * rate, before * change, change, velocity - columns @ (now, before))
    )
    factor = math.copysign(math.hypot(kept, lost), now)
    hidden = np.sum(np.diff(recorded) ** 2) / np.sum(recorded**2) / 6.0  # by few samples of a motion
    doubt = SHAFT.late + left + hidden  # of noise and slips, too
    lag = math.atan2(lost, kept) / slope if before < 0.0 < slope else 0.0
    if abs(factor - 1.0) > SHAFT.agree:
        return factor if abs(factor - 1.0) > SHAFT.agree + hidden else math.nan, None  # they contradict each other
    if lost > doubt - SHAFT.much_better * SHAFT.late and lag:
        return factor, Treated(Treatment.LATE, "delay of the velocity", size=lag)
    return factor, Treated(Treatment.SCALED, "velocity", size=factor) if abs(factor - 1.0) > doubt else None


def ways(piece: Piece, width: int) -> tuple[Numbers, Numbers]:
    """By how much a joint moves in so many periods, by its position and by its recorded velocity."""
    position, velocity = piece.values["position"], piece.values["velocity"]
    by = summed(moved_by(piece.time, velocity))
    return position[width:] - position[:-width], by[width:] - by[:-width]


def moved_by(time: Numbers, velocity: Numbers) -> Numbers:
    """By how much a velocity moves a joint from each sample to the next, (n - 1,)."""
    return 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time)


def _of_slope(sd: float, half: int) -> float:
    """Noise of the slope of a line through 2 `half` + 1 samples, for noise per sample interval."""
    return sd / math.sqrt(half * (half + 1) * (2 * half + 1) / 3.0)
