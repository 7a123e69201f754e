"""Stick-slip, friction and inertia of the joints of another robot."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.foreign.sources import FEWEST, Piece, Source, differentiated, pieces, resolution
from wam_analysis.measures.friction import Friction, identify_friction
from wam_analysis.measures.stick_slip_phases import Phases, stick_slip_phases, without_turns

Numbers = NDArray[np.float64]

REST = 0.002  # rad/s or m/s; a slower joint is at rest, unless the noise is larger
NOISY = 6.0  # standard deviations of the noise of a velocity: likewise
FAR = 20.0  # resolutions of a position, or seconds at the speed `REST`: who moves so far has moved
BRIEFEST = 0.01  # s; a shorter stick or slip is chatter
BRIEF = 0.5  # of a slip: a joint whose rests are shorter turns back, and does not stick
TURNS = 0.8  # of the rests of such a joint have motion to the other side behind them
WINDOW = 0.03  # s over which friction is averaged
FEWEST_SAMPLES = 6  # in that window
BETTER = 0.8  # of the rest of a fit: one with the weight of the joint leaves less
APART = 0.1  # of the acceleration that is not alike a weight; below it, inertia and weight cannot be separated
SURE = 0.25  # of a number; with a larger standard error it is not identifiable
AGREE = 0.2  # by which a recorded velocity may differ from the rate of the position
BELOW_ZERO = 3.0  # standard errors: a fit in which one number is so negative holds more than friction


class Sticking(NamedTuple):
    """How a joint moved.

    Attributes
    ----------
    stuck : fraction of the time at rest.
    slips, reversals : motions between, and those against the one before; a motion back and forth is one.
    commanded : fraction of the rest in which it was commanded to move; NaN without a command.
    """

    stuck: float
    slips: int
    reversals: int
    commanded: float


def sticking(source: Source, command: Source | None) -> Sticking | None:
    """Rest and motion of a joint; None without a velocity."""
    still = slips = reversals = total = disobeyed = 0
    for piece in pieces(source):
        if "velocity" not in piece.values:
            return None
        rest = _rest(piece)
        period = float(piece.time[1] - piece.time[0])
        phases = stick_slip_phases(piece.values["velocity"], rest, max(1, round(BRIEFEST / period)))
        total += len(piece.time)
        if _only_turns(phases, piece.values["velocity"]):
            slips += 1
            lengths = np.diff(phases.sticks, axis=1)
            still += int(np.sum(lengths[lengths > BRIEF * np.median(np.diff(phases.slips, axis=1))]))
            continue
        phases = without_turns(phases, piece.values["velocity"], rest)
        still += round(phases.stuck * len(piece.time))
        slips, reversals = slips + len(phases.slips), reversals + phases.reversals
        if command is not None:
            moves = np.abs(_commanded_speed(command, piece.time)) > rest
            disobeyed += sum(int(np.sum(moves[a:b])) for a, b in phases.sticks.tolist())
    if not total:
        return None
    return Sticking(still / total, slips, reversals, disobeyed / still if command is not None and still else math.nan)


def hidden_motion(source: Source) -> float:
    """How far a joint went that the noise of its velocity shows at rest, rad or m; 0 where it did not move."""
    position = source.values.get("position", np.zeros(1))
    distance = float(np.ptp(position))
    return distance if distance > FAR * max(resolution(position), REST) else 0.0


def _only_turns(phases: Phases, velocity: Numbers) -> bool:
    """Whether it is one motion back and forth, which is slow for a moment where it turns."""
    between = phases.sticks[1:-1]
    if len(phases.slips) < 4 or not len(between) or np.mean(_turns(between, velocity)) < TURNS:
        return False
    rest, motion = (float(np.median(np.diff(rows, axis=1))) for rows in (between, phases.slips))
    return rest < BRIEF * motion


def _turns(sticks: NDArray[np.int64], velocity: Numbers) -> NDArray[np.bool_]:
    """Whether the motion after each rest goes against the one before it; not all turns of a motion are rests."""
    opposed: NDArray[np.bool_] = velocity[sticks[:, 0] - 1] * velocity[sticks[:, 1]] < 0.0
    return opposed


def _rest(piece: Piece) -> float:
    return max(REST, NOISY * piece.noise["velocity"])


def _commanded_speed(command: Source, time: Numbers) -> Numbers:
    if "velocity" in command.values and np.any(command.values["velocity"]):
        return np.interp(time, command.time, command.values["velocity"])
    if "position" not in command.values:
        return np.zeros(len(time))
    return np.interp(time, command.time, np.gradient(command.values["position"], command.time))


def velocity_factor(source: Source) -> float:
    """Recorded velocity over the rate of the position, where that moves; NaN where the two agree or it does not move.

    It is 0 where the velocity is zero, and below zero where its sign is swapped.
    """
    if not {"position", "velocity"} <= source.values.keys():
        return math.nan
    rates, speeds = [], []
    for piece in pieces(source):
        rate, sd = differentiated(piece.time, piece.values["position"])
        moves = np.abs(rate) > max(REST, NOISY * sd)
        rates.append(rate[moves])
        speeds.append(piece.values["velocity"][moves])
    rate, speed = (np.concatenate(parts) if parts else np.zeros(0) for parts in (rates, speeds))
    if len(rate) < FEWEST:
        return math.nan
    factor = float(rate @ speed / (rate @ rate))
    return math.nan if abs(factor - 1.0) <= AGREE else factor


def friction(source: Source) -> Friction | None:
    """Friction and inertia of a joint that its weight may load; None without effort, velocity or an answer.

    Nor is there one where the recorded velocity is not the rate of the position.

    The load is that of a weight on the joint itself, over its angle, a sin q + b cos q + c, where this explains the
    effort better than a constant.  Where it does not, the error of the inertia counts what a weight would change.  In a
    motion of one frequency inertia and weight are the same: the inertia is NaN.
    """
    some = [piece for piece in pieces(source) if {"effort", "velocity"} <= piece.values.keys()]
    if not some or math.isfinite(velocity_factor(source)):
        return None
    period = float(some[0].time[1] - some[0].time[0])
    window = max(WINDOW, FEWEST_SAMPLES * period)
    blank = np.full(2 * round(window / period) + 2, math.nan)  # between two pieces
    joined = {
        q: np.concatenate([part for piece in some for part in (piece.values[q], blank)])
        for q in ("position", "velocity", "effort")
        if q in some[0].values
    }
    time = period * np.arange(len(joined["velocity"]), dtype=np.float64)
    rest = max(_rest(piece) for piece in some)
    found = identify_friction(time, joined["velocity"], joined["effort"], rest, window)
    if "position" in joined and source.units["position"] == "rad":
        weight = np.column_stack([np.sin(joined["position"]), np.cos(joined["position"])])
        loaded = identify_friction(time, joined["velocity"], joined["effort"], rest, window, load=weight)
        apart = math.hypot(found.inertia_error, loaded.inertia_error, loaded.inertia - found.inertia)
        is_better = loaded.residual < BETTER * found.residual
        found = loaded if is_better else found._replace(inertia_error=apart)
        sd = max(piece.noise["velocity"] for piece in some)
        moves = np.abs(joined["velocity"]) > rest
        if _own_part(joined["velocity"], weight, moves, sd, period, round(window / period)) < APART:
            found = found._replace(inertia=math.nan, inertia_error=math.nan)
    dry, viscous = (found.dynamic, found.dynamic_error), (found.viscous, found.viscous_error)
    numbers = (dry, viscous, (found.inertia, found.inertia_error))
    if not (is_sure(*dry) or is_sure(*viscous)) or any(v < -BELOW_ZERO * e for v, e in numbers):
        return None
    return found


def _own_part(
    velocity: Numbers, weight: Numbers, moves: NDArray[np.bool_], sd: float, period: float, width: int
) -> float:
    """Share of the acceleration, rms, that is not alike the columns of a weight, without the noise of the velocity."""
    kernel = np.repeat([1.0, -1.0], width) / (width**2 * period)
    acceleration = np.convolve(velocity, kernel, "same")
    rows = moves & np.isfinite(acceleration) & np.all(np.isfinite(weight), axis=1)
    rows[:width] = rows[-width:] = False  # the mean is incomplete
    if int(np.sum(rows)) < FEWEST:
        return 0.0
    columns, wanted = np.column_stack([np.ones(int(np.sum(rows))), weight[rows]]), acceleration[rows]
    rest = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
    by_noise = sd**2 * float(kernel @ kernel)
    own, whole = float(np.mean(rest**2)) - by_noise, float(np.var(wanted)) - by_noise
    return math.sqrt(own / whole) if 0.0 < own < whole else 0.0


def is_sure(value: float, error: float) -> bool:
    """Whether a number that has to be above zero is identified."""
    return value > 0.0 and error < SURE * value
