"""Section about friction and inertia of the joints of another robot, from their effort."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.findings.stick_slip import rest_speed
from wam_analysis.foreign.sources import Piece, Source, differentiated, pieces, rests
from wam_analysis.measures.friction import UNKNOWN, Friction, FrictionNumber, identify_friction
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import SHAFT
from wam_bag.arrays import Mask, Numbers

RECORD = (
    "To identify friction, record position and effort of each joint at 50 Hz or more, in motion to both sides, slow "
    "and fast, for some ten seconds, while nothing touches the arm."
)
BELOW_ZERO = "its dry friction comes out as {}, as if the effort had the other sign, or something else moved the joint."
WEIGHT, DRAG = "weight", "drag"
ALSO = {
    WEIGHT: "the fit includes the joint's weight",
    DRAG: "the fit includes a drag by the square of the velocity",
}


def effort_section(recording: AnalysedRecording) -> Section:
    """Friction and inertia of the joints of another robot."""
    states = recording.states
    sentences, findings, doubts, brief, alone, wrong = [], [], [], [], [], []
    for one in states:
        unlike = contradiction(one)
        wrong += _limited(one)
        wrong += [f"{one.label}: {unlike}, so friction and inertia are not computed."] * bool(unlike)
        whole = friction(one) if one.is_joint and not unlike else None
        found = None if whole is None else whole.friction
        if whole is None or found is None or not whole.is_known:
            if found is not None and found.dynamic.is_negative:
                wrong.append(f"{one.label}: {BELOW_ZERO.format(shown(found.dynamic.value, one.units['effort']))}")
            elif not unlike and {"effort"} < one.values.keys() and not rests(one):
                doubts.append(f"{one.label}: its effort determines neither a dry nor a viscous friction.")
            continue
        effort, speed = one.units["effort"], one.units.get("velocity", "rad/s").partition("/")[0]
        every = (
            ("dry friction", effort, found.dynamic),
            ("viscous friction", f"{effort} s/{speed}", found.viscous),
            ("inertia", "kg m2" if effort == "N m" else f"{effort} s2/{speed}", found.inertia),
        )
        numbers = [number for number in every if number[2].is_sure]
        findings += [
            Finding(f"{one.label}: {what}", unit, known.value, error=known.error) for what, unit, known in numbers
        ]
        unexplained = f"{100.0 * found.unexplained:.2g} % of the effort's rms is unexplained"
        values = [f"{what} {shown(known.value)} +- {shown(known.error, unit)}" for what, unit, known in numbers]
        brief.append(f"{one.label}: {', '.join(values)}; {unexplained}.")
        missing = [what for what, _, known in every if not (math.isnan(known.value) or known.is_sure)]
        remarks = [unexplained]
        if math.isnan(found.inertia.value):
            late = shown(1e-3 * abs(whole.per_lag))
            remarks.append(f"it moved at one frequency, where each ms of delay changes the viscous friction by {late}")
            alone.append(one.label)
        remarks += [f"not identifiable: {', '.join(missing)}"] * bool(missing)
        remarks += [ALSO[name] for name in whole.also]
        way = "behind" if whole.lag > 0.0 else "before"
        remarks += [f"the effort is {shown(abs(whole.lag), 's')} {way} the motion"] * bool(whole.lag)
        sentences.append(f"{one.label}: {'; '.join(remarks)}.")
    if not sentences:
        why = "The friction of the joints cannot be identified: no effort determines a dry or viscous friction."
        return Section("friction", "Friction", (why, RECORD, *doubts, *wrong), wrong=wrong)
    doubts += [RECORD] * bool(doubts)
    assumed = (
        "The effort is explained by friction and inertia. The joint's weight, a drag by the square of the velocity and "
        "a delay are added if they explain more. What is left makes the standard errors larger."
    )
    if alone:
        doubts.append(
            f"{', '.join(alone)} moved at one frequency: inertia cannot be separated from weight, nor viscous "
            "friction from a delay of the effort."
        )
    return Section("friction", "Friction", (assumed, *sentences, *doubts, *wrong), findings, (), brief, wrong)


def _limited(source: Source) -> list[str]:
    """That an effort stays at its bounds for long, which no friction with its noise does."""
    effort = source.only("effort").values.get("effort", np.zeros(0))
    bounds = (float(np.min(effort, initial=math.inf)), float(np.max(effort, initial=-math.inf)))
    share = float(np.mean(np.isin(effort, bounds))) if bounds[0] < bounds[1] else 0.0
    if share < SHAFT.limited:
        return []
    low, high = (shown(bound, source.units["effort"]) for bound in bounds)
    when = f"in {100.0 * share:.0f} % of the messages"
    return [
        f"{source.label}: its effort is exactly {low} or {high} {when}, as if it was limited: its friction is wrong."
    ]


def contradiction(source: Source) -> str:
    """How the recorded velocity is not the rate of the position, '' where the two agree.

    A joint whose encoder only flickers does not move.
    """
    if not {"position", "velocity"} <= source.values.keys() or rests(source):
        return ""
    some = pieces(source, "position", "velocity")
    factor = _velocity_factor(some)
    if math.isfinite(factor):
        return (
            f"the recorded velocity is {factor:.3g} times the rate of the position; one of the two has another unit or "
            "sign"
        )
    unit = source.units["position"]
    for piece in some:
        if (lost := _lost_way(piece)) is not None:
            begin, moved, by = lost
            return (
                f"within {SHAFT.way:g} s from {begin:.4g} s on the position moved by {shown(moved, unit)}, but by the "
                f"recorded velocity by {shown(by, unit)}; an encoder slips or stops, or one of the two is of "
                "something else"
            )
    return ""


def _lost_way(piece: Piece) -> tuple[float, float, float] | None:
    """Where the position moves least as the velocity has it: when, by how much each; None where they agree.

    A velocity that is late differs only as far as it changes meanwhile.
    """
    time, position, velocity = piece.time, piece.values["position"], piece.values["velocity"]
    period = float(time[1] - time[0])
    width = round(SHAFT.way / period)
    if len(time) <= width:
        return None
    way, path = (
        np.concatenate(([0.0], np.cumsum(0.5 * period * (v[1:] + v[:-1])))) for v in (velocity, np.abs(velocity))
    )
    moved, by, far, change = (x[width:] - x[:-width] for x in (position, way, path, velocity))
    allowed = SHAFT.agree * far + SHAFT.longest_effort_lag * np.abs(change) + SHAFT.joint_rest * SHAFT.way
    excess = np.abs(moved - by) - allowed - SHAFT.noisy * piece.noise["position"]
    if np.sum(excess > 0.0) < width // 2:
        return None
    worst = int(np.argmax(excess))
    return float(time[worst]), float(moved[worst]), float(by[worst])


def _velocity_factor(some: Sequence[Piece]) -> float:
    """Recorded velocity over the rate of the position, where that moves; NaN where the two agree or it does not move.

    It is 0 where the velocity is zero, and below zero where its sign is swapped.
    """
    rates, speeds = [], []
    for piece in some:
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
    also : what was found in it: of `WEIGHT` and `DRAG`.
    lag : s, of the effort behind the motion.
    per_lag : how the viscous friction changes where the effort of a motion of one frequency is later, per s; NaN of
        other motions.
    """

    friction: Friction
    also: tuple[str, ...]
    lag: float
    per_lag: float

    @property
    def is_known(self) -> bool:
        """Whether a friction is identified, and nothing comes out below zero, as where the effort holds more."""
        dynamic, viscous, inertia = self.friction.dynamic, self.friction.viscous, self.friction.inertia
        return (dynamic.is_sure or viscous.is_sure) and not any(one.is_negative for one in (dynamic, viscous, inertia))


def friction(source: Source) -> FoundFriction | None:
    """Friction and inertia of a joint that its weight may load; None without effort or velocity.

    The recorded velocity must be the rate of the position, see `contradiction`.

    The effort may also hold the weight of the joint itself, over its angle, a sin q + b cos q, or a drag c v|v|, and
    may lag behind the motion, as where it is filtered, or the motion behind it.  What leaves less of the effort
    unexplained is taken; by what the others would change, the errors are larger.  In a motion of one frequency inertia
    and weight are the same, and the inertia is NaN; so are viscous friction and lag, and no lag is looked for.
    """
    needed = [q for q in ("position", "velocity", "effort") if q in source.values]
    if 2 * len(source.only(*needed).time) < len((loaded := source.only("velocity", "effort")).time):
        source, needed = loaded, ["velocity", "effort"]
    some = [piece for piece in pieces(source, *needed) if {"effort", "velocity"} <= piece.values.keys()]
    if not some:
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
    rest = max(rest_speed(piece, SHAFT.joint_rest) for piece in some)
    trial = _Trial(velocity, joined["effort"], columns, rest, window, period)
    width, per_lag = round(window / period), math.nan
    acceleration = _Acceleration.of(velocity, sd, rest, width, period)
    one_frequency = WEIGHT in columns and acceleration.own_part(columns[WEIGHT], width) < SHAFT.apart
    found, also, shift = _best(trial, not one_frequency)
    if shift and {"position", "velocity"} <= source.values.keys():  # or the velocity is filtered
        rates = [part for piece in some for part in (differentiated(piece.time, piece.values["position"])[0], blank)]
        rate = np.concatenate(rates)
        other = trial._replace(velocity=rate, columns=columns | {DRAG: (rate * np.abs(rate))[:, np.newaxis]})
        found, also, shift = min((found, also, shift), _best(other, True), key=lambda one: one[0].residual)
    inertia = _less_certain(found.inertia, [acceleration.share_of_noise() * found.inertia.value])
    if one_frequency:
        per_lag, inertia = (found.viscous.value - trial.fit(also, 1).viscous.value) / period, UNKNOWN
    return FoundFriction(found._replace(inertia=inertia), also, shift * period, per_lag)


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
        time = self.period * np.arange(len(effort), dtype=np.float64)
        load = np.hstack([self.columns[name] for name in also]) if also else None
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
        others = [((*also, name), shift) for name in trial.columns if name not in also]
        others += [(also, lag)] if lags and not shift and (lag := trial.lag(also)) else []
        fits = [trial.fit(*other) for other in others]
        least = [SHAFT.better if WEIGHT in {*other[0]} - {*also} else SHAFT.much_better for other in others]
        gains = [(fit.residual / share, i) for i, (fit, share) in enumerate(zip(fits, least, strict=True))]
        if not gains or not min(gains)[0] < found.residual:
            break
        i = min(gains)[1]
        (also, shift), found = others[i], fits[i]
    doubted: dict[str, Any] = {
        name: _less_certain(own := getattr(found, name), [getattr(fit, name).value - own.value for fit in fits])
        for name in ("dynamic", "viscous", "inertia")
    }
    return found._replace(**doubted), also, shift


def _less_certain(known: FrictionNumber, more: Sequence[float]) -> FrictionNumber:
    """A number with further errors."""
    return known._replace(error=math.hypot(known.error, *more))


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
        if np.count_nonzero(rows) < SHAFT.fewest_samples:
            return 0.0
        columns, wanted = np.column_stack([np.ones(np.count_nonzero(rows)), weight[rows]]), self.value[rows]
        rest = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
        own, whole = float(np.mean(rest**2)) - self.noise, float(np.var(wanted)) - self.noise
        return math.sqrt(own / whole) if 0.0 < own < whole else 0.0
