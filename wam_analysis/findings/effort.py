"""Section about friction and inertia of the joints of another robot, from their effort."""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np

from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.findings.stick_slip import contradiction, rest_speed
from wam_analysis.foreign.pieces import Piece, pieces, rests
from wam_analysis.foreign.source import Source
from wam_analysis.measures.friction import UNKNOWN, Friction, FrictionNumber, identify_friction
from wam_analysis.measures.runs import smoothed
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import CYCLE, SHAFT
from wam_bag.arrays import Mask, Numbers
from wam_bag.columns import JOINT_FIELDS

RECORD = (
    "To identify friction, record position and effort of each joint at 50 Hz or more, in motion to both sides, slow "
    "and fast, for some ten seconds, while nothing touches the arm."
)
FIT = (
    "The fit explains the effort by friction, inertia, weight, spring, drag (velocity squared) and, where they fit "
    "better, a delay, and a change of friction near rest. The standard errors include what it does not explain."
)
NO_FRICTION = "No friction is identified."


def effort_section(recording: AnalysedRecording) -> Section:
    """Friction and inertia of the joints of another robot."""
    states = recording.states
    sentences, findings, alone = [], [], []
    doubts, wrong = list[str](), list[str]()
    moving = [one for one in states if one.is_joint and not rests(one)]
    driven = {one.name for one in moving if _acts(one)}
    for one in moving:
        if unlike := contradiction(one) or limited(one):
            wrong.append(f"{one.label}: {unlike}, so friction and inertia are not computed.")
            continue
        found, lag = friction(one)
        effort, speed = one.units["effort"], one.units.get("velocity", "rad/s").partition("/")[0]
        every = (
            ("dry friction", effort, found.dynamic),
            ("viscous friction", f"{effort} s/{speed}", found.viscous),
            ("inertia", "kg m2" if effort == "N m" else f"{effort} s2/{speed}", found.inertia),
        )
        if not _is_known(found):
            if driven and ("effort" in one.values or one.name not in driven) and one.values.keys() != {"effort"}:
                which = wrong if found.dynamic.is_negative else doubts
                which.append(f"{one.label}: friction is not identified: {_lacking(one, every, found.unexplained)}.")
            continue
        numbers = [number for number in every if number[2].is_sure]
        findings += [
            Finding(f"{one.label}: {what}", unit, known.value, error=known.error) for what, unit, known in numbers
        ]
        missing = [what for what, _, known in every if not (math.isnan(known.value) or known.is_sure)]
        remarks = [_stated(numbers), f"unexplained: {100.0 * found.unexplained:.2f} % of the effort (rms)"]
        if math.isnan(found.inertia.value):
            alone.append(one.label)
        if math.isfinite(found.static.value):
            remarks.append(f"at the slowest speed, dry friction is about {shown(found.static.value, effort)}")
        remarks += [f"not identifiable: {', '.join(missing)}"] * bool(missing)
        if lag > 0.0 or (lag and found.inertia.is_sure):  # an inertia that is not known looks like a lead
            remarks.append(f"the effort is {shown(abs(lag), 's')} {'behind' if lag > 0.0 else 'before'} the motion")
        sentences.append(f"{one.label}: {'; '.join(remarks)}.")
    if not driven and (still := [one.label for one in moving if "effort" in one.values]):
        doubts.append(f"{', '.join(still)}: the effort never changes.")
    doubts += [RECORD] * bool(doubts or not (sentences or wrong))
    if alone:
        doubts.append(
            f"{', '.join(alone)} moved at one frequency: inertia cannot be separated from weight, nor viscous "
            "friction from a delay of the effort."
        )
    stated = (FIT if sentences else NO_FRICTION, *sentences, *doubts, *wrong)
    return Section("friction", "Friction", stated, findings, sentences, wrong)


def _acts(source: Source) -> bool:
    """Whether an effort was recorded that changes."""
    effort = source.known("effort")
    return bool(np.any(effort != effort[:1]))


def _stated(numbers: Iterable[tuple[str, str, FrictionNumber]]) -> str:
    """Numbers with their names, units and standard errors."""
    return ", ".join(f"{what} {shown(known.value)} +- {shown(known.error, unit)}" for what, unit, known in numbers)


def _lacking(one: Source, numbers: Sequence[tuple[str, str, FrictionNumber]], unexplained: float) -> str:
    """Which condition of an identified friction is not met."""
    if below := [number for number in numbers if number[2].is_negative]:
        return f"{_stated(below)}, as if the effort had the other sign, or something else moved the joint"
    if "effort" not in one.values:
        return f"no message has all of {', '.join({**one.values, 'effort': 0})}"
    if not _acts(one):
        return "its effort never changes"
    if math.isnan(numbers[0][2].value):
        part = f"it moved in one direction for more than {100.0 * (1.0 - SHAFT.both_ways):g} % of its way"
        return f"{part}, or for fewer than {SHAFT.fewest_samples} samples apart from its reversals"
    finite = _stated([number for number in numbers[:2] if math.isfinite(number[2].error)])
    large = f"the errors are too large{f' ({finite})' * bool(finite)}"
    return f"{large}; the model leaves {shown(100.0 * unexplained, '%')} of the effort unexplained"


def limited(source: Source, quantity: str = "effort") -> str:
    """That a quantity stays at a bound for long, which none with its noise does; '' where it does not.

    One in coarse steps stays at its last step for 2.4 times as long as at the one before, at most, as it turns there.
    """
    value = source.known(quantity)
    levels, numbers = np.unique(value, return_counts=True)
    ends = [(0, 1), (-1, -2)] if len(levels) > 1 else []
    bounds = [levels[at] for at, next_to in ends if levels[at] and numbers[at] > SHAFT.turning_steps * numbers[next_to]]
    share = float(np.mean(np.isin(value, bounds))) if bounds else 0.0  # 0 is off
    if share < SHAFT.limited:
        return ""
    named = " or ".join(shown(bound, source.units[quantity]) for bound in bounds)
    return f"the {quantity} is exactly {named} in {100.0 * share:.0f} % of the messages, as if it was limited"


def _is_known(found: Friction) -> bool:
    """Whether a friction is identified, and nothing comes out below zero, as where the effort holds more."""
    numbers = found.dynamic, found.viscous, found.inertia
    return any(one.is_sure for one in numbers[:2]) and not any(one.is_negative for one in numbers)


def friction(source: Source) -> tuple[Friction, float]:
    """Friction and inertia of a joint that its weight may load, and by how much its effort lags behind the motion, s.

    Nothing is known without effort or velocity.

    The recorded velocity must be the rate of the position, see `contradiction`.

    The effort may also hold the weight of the joint itself, over its angle, a sin q + b cos q, a spring d q, and a drag
    c v|v|, and may lag behind the motion, as where it is filtered, or the motion behind it: a lag that leaves much less
    of the effort unexplained is taken.  In a motion of one frequency inertia and weight are the same, and the
    inertia is NaN; so are viscous friction and lag, and no lag is looked for.

    All is averaged over a short time, or over a long one where a coarse velocity makes that uncertain or hides a lag.
    """
    some = [piece for piece in pieces(source) if {"effort", "velocity"} <= piece.values.keys()]
    if not some:
        return Friction(), 0.0
    period = some[0].period
    shortest = max(SHAFT.window, SHAFT.window_samples * period)
    motions = np.concatenate([_motions(piece.values["velocity"], round(shortest / period)) for piece in some])
    typical = period * float(motions @ motions) / float(np.sum(motions))  # most of the time is in one so long
    widest = max(shortest, min(SHAFT.of_motion * typical, SHAFT.widest_window))
    every = [_friction(source.units["position"], some, window) for window in {shortest, widest}]
    return min(every, key=lambda one: (not one[1], sum(number.relative for number in one[0][1:4])))


def _friction(unit: str, some: Sequence[Piece], window: float) -> tuple[Friction, float]:
    """The same from the pieces of a joint, its position in a unit, averaged over a window, s."""
    period = some[0].period
    most = math.ceil(CYCLE.longest_lag / period)
    width = round(window / period)
    apart = 2 * (width + most + 1)  # samples between two pieces
    blank = np.full(apart, math.nan)
    joined = {
        q: np.concatenate([part for piece in some for part in (piece.values[q], blank)])
        for q in JOINT_FIELDS
        if q in some[0].values
    }
    velocity, sd = joined["velocity"], max(piece.noise["velocity"] for piece in some)
    way = [joined[q] for q in ("position",) if q in joined]
    weight = [*way, *(of(q) for q in way for of in (np.sin, np.cos) if unit == "rad")]  # or spring
    loads = np.column_stack([velocity * np.abs(velocity), *weight])  # with a drag
    rest = max(rest_speed(piece, SHAFT.joint_rest) for piece in some)
    time = period * np.arange(len(velocity), dtype=np.float64)

    def fit(shift: int, use: Mask | None = None, loads: Numbers = loads) -> Friction:
        """Friction with the effort of `shift` samples later, from the samples that may be used, all by default."""
        return identify_friction(time, velocity, np.roll(joined["effort"], -shift), rest, window, use, loads)

    own, noise, curve = _own_acceleration(velocity, sd, loads[:, 1:], rest, width, period)
    one_frequency = bool(weight) and own < SHAFT.apart
    most *= not one_frequency
    tried = np.arange(len(velocity)) < SHAFT.tried_samples  # enough to choose among so many
    law, spread = _stribeck(
        velocity, lambda columns: fit(0, tried, np.column_stack([loads, columns])), fit(0, tried).residual
    )
    if law is not None:
        fit = partial(fit, loads=np.column_stack([loads, law]))
    found, shift = _best(fit, most)
    # where the effort is filtered, its step at a reversal is no delay; nor is one over a way before it slides
    near = math.ceil(SHAFT.filtered * SHAFT.longest_effort_lag / period)
    use = np.all([np.sign(velocity) == np.sign(np.roll(velocity, way)) for way in (near, -near)], axis=0)
    settled = fit(shift, use)
    if _is_known(settled) and (shift or settled.dynamic.error < found.dynamic.error):
        fit = partial(fit, use=use)
        found, shift = _best(fit, most, shift)
    if shift:  # known to a sample
        dynamic, viscous, inertia = map(_between, found[1:4], fit(shift - 1)[1:4], fit(shift + 1)[1:4])
        found = found._replace(dynamic=dynamic, viscous=viscous, inertia=inertia)
    doubt = noise + curve * (shift * period) ** 2  # of a delay, a filter takes so much of what is in phase
    doubts = np.hypot(spread, (0.0, 0.0, doubt * found.inertia.value))
    dynamic, viscous, inertia = (
        one._replace(error=math.hypot(one.error, more)) for one, more in zip(found[1:4], doubts.tolist(), strict=True)
    )
    static = UNKNOWN
    if law is not None:
        seen = smoothed(1.0 * (np.abs(velocity) > rest), 2 * width) == 1.0  # by the average
        slowest = int(np.argmin(np.where(seen, np.abs(velocity), math.inf)))
        static = FrictionNumber(dynamic.value + float(np.sign(velocity[slowest]) * law[slowest] @ found.factors[-2:]))
    return Friction(static, dynamic, viscous, UNKNOWN if one_frequency else inertia, *found[4:]), shift * period


def _rise(velocity: Numbers, speed: float, power: float) -> Numbers:
    """Rise or fall of dry friction towards rest by the law of Stribeck, and its change with the speed of the law."""
    part = np.minimum((np.abs(velocity) / speed) ** power, 30.0)  # beyond, nothing is left
    return np.column_stack([np.sign(velocity) * np.exp(-part), np.sign(velocity) * part * np.exp(-part)])


def _stribeck(
    velocity: Numbers, fitted: Callable[[Numbers], Friction], without: float
) -> tuple[Numbers | None, Numbers]:
    """Columns of the law with which a fit leaves clearly less than without one, None for none.

    The change with its speed is linear only where it is not larger than the rise, or the fall.
    Then by how much dry friction, viscous friction and inertia scatter between all laws with which it leaves as little.
    """
    speeds = np.geomspace(*SHAFT.stribeck) * max(float(np.nanpercentile(np.abs(velocity), 95.0)), SHAFT.joint_rest)
    laws = [_rise(velocity, speed, power) for power in (1.0, 2.0) for speed in speeds.tolist()]
    fits = [fitted(law) for law in laws]
    rests = np.array([fit.residual if abs(fit.factors[-1]) <= abs(fit.factors[-2]) else math.inf for fit in fits])
    if not np.min(rests) < SHAFT.better * without:
        return None, np.zeros(3)
    alike = [fit[1:4] for fit, rest in zip(fits, rests, strict=True) if SHAFT.better * rest <= np.min(rests)]
    return laws[int(np.argmin(rests))], np.std([[one.value for one in numbers] for numbers in alike], axis=0)


def _motions(velocity: Numbers, width: int) -> Numbers:
    """Samples of each motion in one direction, (k,), by the mean of a velocity over so many."""
    turns = np.flatnonzero(np.diff(np.sign(smoothed(velocity, width)))) + 1
    return np.diff([0, *turns, len(velocity)]).astype(np.float64)


def _between(one: FrictionNumber, before: FrictionNumber, after: FrictionNumber) -> FrictionNumber:
    """A number whose error is also half of what it differs by between two fits."""
    return FrictionNumber(one.value, math.hypot(one.error, 0.5 * (after.value - before.value)))


def _best(fit: Callable[[int], Friction], most: int, seen: int = 0) -> tuple[Friction, int]:
    """The fit with the shift of the effort, samples, that leaves least unexplained; else 0, or the shift that was seen.

    It must leave much less than that does, or clearly less, and hardly anything.
    """
    step, best = max(1, most // 4), seen
    fits = {seen: fit(seen)}
    while step:
        for shift in (best - step, best + step):
            if abs(shift) <= most and shift not in fits:
                fits[shift] = fit(shift)
        nearest = min(fits, key=lambda shift: fits[shift].residual)
        step, best = (step if nearest != best and step > 1 else step // 2), nearest
    is_left = fits[best].residual > SHAFT.late * abs(fits[best].dynamic.value)
    share = SHAFT.much_better if is_left else SHAFT.better
    best = best if fits[best].residual < share * fits[seen].residual else seen
    return fits[best], best


def _own_acceleration(
    velocity: Numbers, sd: float, load: Numbers, rest: float, width: int, period: float
) -> tuple[float, float, float]:
    """Share, rms, of the averaged acceleration that is not alike the columns of a load, and the noise in its power.

    By the share of the noise of the velocity, of a standard deviation, an inertia is too small.  Then the mean square
    of the frequency of the acceleration, 1/s^2.
    """
    kernel = np.repeat([1.0, -1.0], width) / (width**2 * period)
    acceleration = np.convolve(velocity, kernel, "same")
    rows = (np.abs(velocity) > rest) & np.isfinite(acceleration) & np.all(np.isfinite(load), axis=1)
    rows[:width] = rows[-width:] = False  # the mean is incomplete
    if np.count_nonzero(rows) < SHAFT.fewest_samples or not np.any(acceleration[rows]):
        return 0.0, 1.0, 0.0
    curve = np.nansum(np.convolve(acceleration, kernel, "same")[rows] ** 2) / np.sum(acceleration[rows] ** 2)
    columns, wanted = np.column_stack([np.ones(np.count_nonzero(rows)), load[rows]]), acceleration[rows]
    rest_of_it = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
    noise, power = sd**2 * float(kernel @ kernel), float(np.mean(rest_of_it**2))
    own, whole = power - noise, float(np.var(wanted)) - noise
    share = math.sqrt(own / whole) if 0.0 < own < whole else 0.0
    return share, min(noise / power, 1.0) if power > 0.0 else 1.0, curve
