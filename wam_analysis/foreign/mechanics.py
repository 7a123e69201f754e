"""Stick-slip, friction and inertia of the joints of another robot."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.foreign.sources import Piece, Source, differentiated, pieces, resolution
from wam_analysis.measures.friction import Friction, identify_friction
from wam_analysis.measures.stick_slip_phases import Phases, stick_slip_phases, without_turns
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Mask, Numbers, Rows

WEIGHT, DRAG, FILTER = "weight", "drag", "filter"


class Sticking(NamedTuple):
    """How a joint moved.

    Attributes
    ----------
    stuck : fraction of the time at rest.
    slips : motions between; a motion back and forth is one.
    commanded : fraction of the rest in which it was commanded to move; NaN without a command.
    """

    stuck: float
    slips: int
    commanded: float


def sticking(source: Source, command: Source | None, least: float) -> Sticking | None:
    """Rest and motion of a joint, which is at rest below a least speed; None without a velocity."""
    if rests(source):
        return Sticking(1.0, 0, math.nan)
    still = slips = total = disobeyed = 0
    moved = next((q for q in ("velocity", "position") if q in source.values), "")
    for piece in pieces(source, moved) if moved else ():
        rest = _rest(piece, least)
        period = float(piece.time[1] - piece.time[0])
        phases = stick_slip_phases(piece.values["velocity"], rest, max(1, round(SHAFT.shortest_phase / period)))
        total += len(piece.time)
        if _only_turns(phases, piece.values["velocity"]):
            slips += 1
            lengths = np.diff(phases.sticks, axis=1)
            still += int(np.sum(lengths[lengths > SHAFT.brief * np.median(np.diff(phases.slips, axis=1))]))
            continue
        phases = without_turns(phases, piece.values["velocity"], rest)
        still += round(phases.stuck * len(piece.time))
        slips += len(phases.slips)
        if command is not None:
            moves = np.abs(_commanded_speed(command, piece.time)) > rest
            disobeyed += sum(int(np.sum(moves[a:b])) for a, b in phases.sticks.tolist())
    if not total:
        return None
    return Sticking(still / total, slips, disobeyed / still if command is not None and still else math.nan)


def rests(source: Source) -> bool:
    """Whether a joint never moved, by its position: an encoder may flicker between counts."""
    position = source.only("position").values.get("position", np.zeros(0))
    return len(position) > 0 and float(np.ptp(position)) <= SHAFT.far * resolution(position)


def hidden_motion(source: Source) -> float:
    """How far a joint went that the noise of its velocity shows at rest, rad or m; 0 where it did not move."""
    position = source.only("position").values.get("position", np.zeros(1))
    distance = float(np.ptp(position))
    return distance if distance > SHAFT.far * max(resolution(position), SHAFT.joint_rest) else 0.0


def _only_turns(phases: Phases, velocity: Numbers) -> bool:
    """Whether it is one motion back and forth, which is slow for a moment where it turns."""
    between = phases.sticks[1:-1]
    if len(phases.slips) < 4 or not len(between) or np.mean(_turns(between, velocity)) < SHAFT.turns:
        return False
    rest, motion = (float(np.median(np.diff(rows, axis=1))) for rows in (between, phases.slips))
    return rest < SHAFT.brief * motion


def _turns(sticks: Rows, velocity: Numbers) -> Mask:
    """Whether the motion after each rest goes against the one before it; not all turns of a motion are rests."""
    return velocity[sticks[:, 0] - 1] * velocity[sticks[:, 1]] < 0.0


def _rest(piece: Piece, least: float) -> float:
    return max(least, SHAFT.noisy * piece.noise["velocity"])


def _commanded_speed(command: Source, time: Numbers) -> Numbers:
    speed, position = command.only("velocity"), command.only("position")
    if np.any(speed.values.get("velocity", 0.0)):
        return np.interp(time, speed.time, speed.values["velocity"])
    if len(position.time) < SHAFT.fewest_samples:
        return np.zeros(len(time))
    return np.interp(time, position.time, np.gradient(position.values["position"], position.time))


def velocity_factor(source: Source) -> float:
    """Recorded velocity over the rate of the position, where that moves; NaN where the two agree or it does not move.

    It is 0 where the velocity is zero, and below zero where its sign is swapped.  A joint whose encoder only flickers
    does not move.
    """
    if not {"position", "velocity"} <= source.values.keys():
        return math.nan
    if rests(source):
        return math.nan
    rates, speeds = [], []
    for piece in pieces(source, "position", "velocity"):
        rate, sd = differentiated(piece.time, piece.values["position"])
        moves = np.abs(rate) > max(SHAFT.joint_rest, SHAFT.noisy * sd)
        rates.append(rate[moves])
        speeds.append(piece.values["velocity"][moves])
    rate, speed = (np.concatenate(parts) if parts else np.zeros(0) for parts in (rates, speeds))
    if len(rate) < SHAFT.fewest_samples:
        return math.nan
    factor = float(rate @ speed / (rate @ rate))
    return math.nan if abs(factor - 1.0) <= SHAFT.agree else factor


class FoundFriction(NamedTuple):
    """Friction and inertia of a joint, with what else its effort holds.

    Attributes
    ----------
    friction : with errors that count what the effort may also hold.
    also : what was found in it: of `WEIGHT`, `DRAG` and `FILTER`.
    lag : s, of the effort behind the motion.
    per_lag : how the viscous friction changes where the effort of a motion of one frequency is later, per s; NaN of
        other motions.
    """

    friction: Friction
    also: tuple[str, ...]
    lag: float
    per_lag: float


def friction(source: Source) -> FoundFriction | None:
    """Friction and inertia of a joint that its weight may load; None without effort, velocity or an answer.

    Nor is there one where the recorded velocity is not the rate of the position.

    The effort may also hold the weight of the joint itself, over its angle, a sin q + b cos q, or a drag c v|v|, and
    may lag behind the motion, as where it is filtered, or the motion behind it.  What leaves less of the effort
    unexplained is taken; by what the others would change, the errors are larger.  In a motion of one frequency inertia
    and weight are the same, and the inertia is NaN; so are viscous friction and lag, and no lag is looked for.
    """
    needed = [q for q in ("position", "velocity", "effort") if q in source.values]
    if 2 * len(source.only(*needed).time) < len((loaded := source.only("velocity", "effort")).time):
        source, needed = loaded, ["velocity", "effort"]
    some = [piece for piece in pieces(source, *needed) if {"effort", "velocity"} <= piece.values.keys()]
    if not some or math.isfinite(velocity_factor(source)):
        return None
    period = float(some[0].time[1] - some[0].time[0])
    window = max(SHAFT.window, SHAFT.window_samples * period)
    # samples between two pieces
    apart = 2 * round(window / period) + 2 * math.ceil(SHAFT.longest_effort_lag / period) + 2
    blank = np.full(apart, math.nan)
    joined = {
        q: np.concatenate([part for piece in some for part in (piece.values[q], blank)])
        for q in ("position", "velocity", "effort")
        if q in some[0].values
    }
    velocity, sd = joined["velocity"], max(piece.noise["velocity"] for piece in some)
    columns = {DRAG: (velocity * np.abs(velocity))[:, np.newaxis]}
    if "position" in joined and source.units["position"] == "rad":
        columns[WEIGHT] = np.column_stack([np.sin(joined["position"]), np.cos(joined["position"])])
    rest = max(_rest(piece, SHAFT.joint_rest) for piece in some)
    trial = _Trial(velocity, joined["effort"], columns, rest, window, period)
    width, per_lag = round(window / period), math.nan
    acceleration = _Acceleration.of(velocity, sd, rest, width, period)
    one_frequency = WEIGHT in columns and acceleration.own_part(columns[WEIGHT], width) < SHAFT.apart
    found, also, shift = _best(trial, not one_frequency)
    if (shift or FILTER in also) and {"position", "velocity"} <= source.values.keys():  # or the velocity is filtered
        rates = [part for piece in some for part in (differentiated(piece.time, piece.values["position"])[0], blank)]
        rate = np.concatenate(rates)
        other = trial._replace(velocity=rate, columns=columns | {DRAG: (rate * np.abs(rate))[:, np.newaxis]})
        found, also, shift = min((found, also, shift), _best(other, True), key=lambda one: one[0].residual)
    by_noise = acceleration.share_of_noise() * found.inertia
    found = found._replace(inertia_error=math.hypot(found.inertia_error, by_noise))
    if one_frequency:
        per_lag = (found.viscous - trial.fit(also, 1).viscous) / period
        found = found._replace(inertia=math.nan, inertia_error=math.nan)
    dry, viscous = (found.dynamic, found.dynamic_error), (found.viscous, found.viscous_error)
    numbers = (dry, viscous, (found.inertia, found.inertia_error))
    if not (is_sure(*dry) or is_sure(*viscous)) or any(v < -SHAFT.below_zero * e for v, e in numbers):
        return None
    return FoundFriction(found, also, shift * period, per_lag)


class _Trial(NamedTuple):
    """What friction is identified from; fits with further columns and with the effort shifted."""

    velocity: Numbers
    effort: Numbers
    columns: dict[str, Numbers]
    rest: float
    window: float
    period: float

    def fit(self, also: Sequence[str], shift: int) -> Friction:
        """Friction with the columns of these names, and the effort of `shift` samples later."""
        effort = np.roll(self.effort, -shift)
        every = dict(self.columns)
        if FILTER in also:
            every[FILTER] = np.nan_to_num(-np.gradient(effort, self.period))[:, np.newaxis]
        time = self.period * np.arange(len(effort), dtype=np.float64)
        load = np.hstack([every[name] for name in also]) if also else None
        return identify_friction(time, self.velocity, effort, self.rest, self.window, load=load)

    def lag(self, also: Sequence[str]) -> int:
        """The shift of the effort, samples, that leaves least unexplained."""
        most = math.ceil(SHAFT.longest_effort_lag / self.period)
        step, best = max(1, most // 4), 0
        left = {0: self.fit(also, 0).residual}
        while step:
            for shift in (best - step, best + step):
                if abs(shift) <= most and shift not in left:
                    left[shift] = self.fit(also, shift).residual
            nearest = min(left, key=left.__getitem__)
            step, best = (step if nearest != best and step > 1 else step // 2), nearest
        return best


def _best(trial: _Trial, lags: bool) -> tuple[Friction, tuple[str, ...], int]:
    """The fit with what else explains the effort, with errors that count what was left out; names; shift.

    Parameters
    ----------
    lags : whether the effort may lag.
    """
    also: tuple[str, ...] = ()
    shift = 0
    found = trial.fit(also, shift)
    while True:
        others = [((*also, name), shift) for name in (*trial.columns, *([FILTER] * lags)) if name not in also]
        others += [(also, lag)] if lags and not shift and (lag := trial.lag(also)) else []
        fits = [trial.fit(*other) for other in others]
        least = [SHAFT.better if WEIGHT in {*other[0]} - {*also} else SHAFT.much_better for other in others]
        gains = [(fit.residual / share, i) for i, (fit, share) in enumerate(zip(fits, least, strict=True))]
        if not gains or not min(gains)[0] < found.residual:
            break
        i = min(gains)[1]
        (also, shift), found = others[i], fits[i]
    more = {
        name: [getattr(fit, name) - getattr(found, name) for fit in fits] for name in ("dynamic", "viscous", "inertia")
    }
    found = found._replace(
        dynamic_error=math.hypot(found.dynamic_error, *more["dynamic"]),
        viscous_error=math.hypot(found.viscous_error, *more["viscous"]),
        inertia_error=math.hypot(found.inertia_error, *more["inertia"]),
    )
    return found, also, shift


class _Acceleration(NamedTuple):
    """Averaged acceleration, the variance of its noise, and where the joint moves so that it is complete."""

    value: Numbers
    noise: float
    rows: Mask

    @classmethod
    def of(cls, velocity: Numbers, sd: float, rest: float, width: int, period: float) -> "_Acceleration":
        """That of a velocity with noise of a standard deviation, over two means of `width` samples."""
        kernel = np.repeat([1.0, -1.0], width) / (width**2 * period)
        value = np.convolve(velocity, kernel, "same")
        return cls(value, sd**2 * float(kernel @ kernel), (np.abs(velocity) > rest) & np.isfinite(value))

    def share_of_noise(self) -> float:
        """Share of the power that is noise of the velocity: so much too small is the inertia."""
        whole = float(np.var(self.value[self.rows])) if np.any(self.rows) else 0.0
        return min(self.noise / whole, 1.0) if whole > 0.0 else 1.0

    def own_part(self, weight: Numbers, width: int) -> float:
        """Share, rms, that is not alike the columns of a weight, without the noise of the velocity."""
        rows = self.rows & np.all(np.isfinite(weight), axis=1)
        rows[:width] = rows[-width:] = False  # the mean is incomplete
        if int(np.sum(rows)) < SHAFT.fewest_samples:
            return 0.0
        columns, wanted = np.column_stack([np.ones(int(np.sum(rows))), weight[rows]]), self.value[rows]
        rest = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
        own, whole = float(np.mean(rest**2)) - self.noise, float(np.var(wanted)) - self.noise
        return math.sqrt(own / whole) if 0.0 < own < whole else 0.0


def is_sure(value: float, error: float) -> bool:
    """Whether a number that has to be above zero is identified."""
    return value > 0.0 and error < SHAFT.unsure * value
