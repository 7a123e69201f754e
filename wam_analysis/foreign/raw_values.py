"""A source without wraps, spikes, frozen stretches and jumps of its zero, and what of these it had."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from wam_analysis.foreign.pieces import moved_by, rests, velocity_fit
from wam_analysis.foreign.source import Source, Treated, Treatment
from wam_analysis.held_messages import row_at
from wam_analysis.measures.runs import after_gaps, count, held_over, runs, summed
from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Index, Mask, Numbers


def treated_source(one: Source) -> Source:
    """The source without wraps, jumps of the zero and an unfit velocity, and with what is known of its gaps."""
    one = _without_wraps(_with_gaps(one))
    one = one if one.is_command else _without_jumps(_without_spikes(one))
    factor, unfit = velocity_fit(one)
    if unfit and not one.is_command:
        factor, one = math.nan, one.without("velocity", unfit)
    return one._replace(velocity_factor=factor)


def _with_gaps(one: Source) -> Source:
    """A source without values that a message only repeats, or does not have."""
    for quantity, value in one.values.items():
        others = [np.nan_to_num(other) for name, other in one.values.items() if name != quantity]
        found = {} if one.is_command else {Treatment.ZERO: _not_filled(value, others), Treatment.HELD: held_over(value)}
        found[Treatment.SPARSE] = ~np.isfinite(value)
        for what, mask in found.items():
            if np.any(mask):
                number = int(np.sum(~mask if what is Treatment.SPARSE else mask))
                treated = Treated(what, quantity, number, len(value))
                one = one.with_values({quantity: np.where(mask, math.nan, value)}, treated)
                break
    return one


def _without_wraps(one: Source) -> Source:
    """A source whose position does not wrap."""
    if "position" not in one.values or one.units["position"] != "rad":
        return one
    position = one.values["position"].copy()
    known = np.isfinite(position)
    speed = np.nan_to_num(one.values.get("velocity", np.zeros(len(position))))[known]
    position[known], wraps, turn = _unwrapped(one.time[known], position[known], speed, one.is_command)
    treated = Treated(Treatment.WRAPPED, "position", wraps, size=turn)
    return one.with_values({"position": position}, treated) if wraps else one


def _without_spikes(one: Source) -> Source:
    """A source without single samples that are away from those before and after."""
    at, moves = _jumps(one, STREAM.spikes)
    before, here, after, then = sliding_window_view(np.pad(moves, (1, 2)), len(moves))
    back = at[(here * after < 0.0) & (before == 0.0) & (then == 0.0)]
    for quantity, value in one.values.items():
        # a zero that would move and move back is a single sample, too
        least = SHAFT.joint_rest * (quantity == "position")
        rows = row_at(one.time, back) if least and len(back) else _spikes(value, least)
        if len(rows) and quantity == "velocity" and "position" in one.values:  # what its position does, too, is motion
            steps = np.abs(np.diff(one.values["position"]) / np.diff(one.time))
            rows = rows[~(2.0 * np.maximum(steps[rows - 1], steps[rows]) > np.abs(value[rows]))]
        if len(rows):
            mean, smooth = 0.5 * (value[rows - 1] + value[rows + 1]), value.copy()
            smooth[rows] = mean
            treated = Treated(Treatment.SPIKES, quantity, len(rows), size=np.max(np.abs(value[rows] - mean)))
            one = one.with_values({quantity: smooth}, treated)
    return one


def _without_jumps(one: Source) -> Source:
    """A source without what was frozen before a jump, and without jumps of the zero.

    Of a joint without a velocity, which comes back, or never moves otherwise, nothing shows that it did not move.
    """
    at, moves = _jumps(one)
    shown = one.only("position", "velocity")
    frozen = [(first, after) for after in np.flatnonzero(moves).tolist() if (first := _frozen(shown, after)) < after]
    values = dict[str, Numbers]()
    for first, after in frozen:
        moves[after] = 0.0
        begin, end = row_at(one.time, at[[first, after]])
        for quantity, value in (one.values | values).items():
            if np.all(value[begin:end] == value[begin]):
                values[quantity] = value.copy()
                values[quantity][begin + 1 : end] = math.nan
    if frozen:
        number = sum(after - first - 1 for first, after in frozen)
        one = one.with_values(values, Treated(Treatment.FROZEN, "position", number, len(at)))
    sizes = moves[moves != 0.0]
    comes_back = abs(np.sum(sizes)) < SHAFT.much_better * np.sum(np.abs(sizes))
    if not len(sizes) or ("velocity" not in one.values and comes_back):
        return one
    zero = np.cumsum(moves)[row_at(at, one.time)]
    position = one.values["position"] - zero + np.sort(zero)[len(zero) // 2]  # that of most messages is kept
    if "velocity" in one.values or not rests(one._replace(values={"position": position})):
        treated = Treated(Treatment.MOVED_ZERO, "position", len(sizes), size=max(sizes, key=abs))
        return one.with_values({"position": position}, treated)
    return one


def _frozen(shown: Source, after: int) -> int:
    """First of the rows of one position before a jump by what was moved meanwhile; the jump's where there are none.

    That is moved by the velocity, if it does not repeat, too, or by the positions before and after.
    """
    time, position = shown.time, shown.values["position"]
    velocity = shown.values.get("velocity", np.zeros(len(time)))
    first = int(np.max(np.flatnonzero(np.diff(position[:after])), initial=-1)) + 1
    near = STREAM.around
    if after - first < SHAFT.rest_samples or first < near or after + near >= len(time):
        return after
    rates = [(position[row] - position[row - near]) / (time[row] - time[row - near]) for row in (first, after + near)]
    jump, during = position[after] - position[first], slice(first, after + 1)
    ways = [
        float(np.mean(rates)) * (time[after] - time[first]),
        float(np.sum(moved_by(time[during], velocity[during]))),
    ]
    repeats = velocity[first] != 0.0 and not np.ptp(velocity[first:after])
    return first if repeats or min(abs(jump - way) for way in ways) < SHAFT.much_better * abs(jump) else after


def _not_filled(value: Numbers, around: Sequence[Numbers]) -> Mask:
    """Which samples are 0 because a message had no number: single ones, or all but single ones, far from the others.

    Where all of a message is 0 it is of another sender.
    """
    zero = value == 0.0
    others = np.flatnonzero(~zero & np.isfinite(value))
    nothing = np.zeros(len(value), np.bool_)
    if not 2 * np.count_nonzero(np.any([nothing, *around], axis=0)[zero]) > np.count_nonzero(zero):
        return nothing
    if np.mean(zero) <= STREAM.repeated or len(others) < SHAFT.fewest_samples:
        return nothing
    if min(np.median(np.diff(runs(mask), axis=1)) for mask in (zero, ~zero)) > 1.0:
        return nothing
    near = value[others]
    after = np.searchsorted(others, np.flatnonzero(zero))
    sides = near[np.clip(after - 1, 0, None)], near[np.clip(after, None, len(near) - 1)]
    away = np.where(sides[0] * sides[1] > 0.0, np.fmin(np.abs(sides[0]), np.abs(sides[1])), 0.0)
    least = max(STREAM.zero * count(near), SHAFT.much_better * float(np.median(np.abs(near))))
    return zero if np.median(away) > least else nothing


def _spikes(value: Numbers, least: float) -> Index:
    """Rows of single samples away from both neighbours, by more than all others extend over, and a least way.

    On both sides of the peak of a short pulse the signal moves, too.
    """
    value = np.where(np.isfinite(value), value, math.nan)
    steps = np.diff(value)
    there, back = steps[:-1], -steps[1:]
    away = np.fmax(0.0, np.fmax(np.minimum(there, back), np.minimum(-there, -back)))
    around = np.abs(np.pad(steps, 1))
    away[np.minimum(around[:-3], around[3:]) >= away] = 0.0
    ends = STREAM.repeated, 1.0 - STREAM.repeated
    reach = np.ptp(np.nanquantile(value, ends))
    return np.flatnonzero(away > max(reach, least, STREAM.zero * np.quantile(away, ends[1]))) + 1


def _overflow(position: Numbers) -> float:
    """After what a counter begins again, NaN if it does not: there it jumps against the steps before and after.

    Its other steps are small: those of noise have any size.
    """
    steps = sliding_window_view(np.pad(np.diff(position), 2), 3).T
    sizes, reach = np.abs(steps[1]), np.ptp(position)
    before, jumps, after = steps[:, sizes > STREAM.wraps * reach]
    others = np.count_nonzero(sizes > (1.0 - STREAM.wraps) * reach) - len(jumps)
    is_against = np.maximum(before * jumps, after * jumps) < 0.0
    is_counter = len(jumps) > 0 == others and np.mean(is_against) >= STREAM.evenly
    return float(np.median(np.abs(jumps - 0.5 * (before + after)))) if is_counter else math.nan


def _unwrapped(time: Numbers, position: Numbers, speed: Numbers, is_command: bool) -> tuple[Numbers, int, float]:
    """An angle without its wraps, their number and the turn: it stays within a turn and jumps by more than half.

    One that moves by more than half a turn from message to message does so by its velocity.
    """
    steps, moved = np.diff(position), moved_by(time, speed)
    for turn in (*STREAM.turns, math.nan if is_command else _overflow(position)):  # a command may jump
        wraps = (np.abs(steps) > 0.5 * turn) & ~after_gaps(time)[1:]
        if not np.any(wraps) or np.ptp(position) > STREAM.within * turn:
            continue
        turned = turn * np.rint((moved - steps) / turn)
        is_fast = np.any(np.abs(moved) > 0.5 * turn)
        if is_fast and np.quantile(np.abs(steps + turned - moved), STREAM.evenly) < SHAFT.agree * turn:
            return position + summed(turned), int(np.count_nonzero(turned)), turn
        within = turn - np.median(np.abs(steps[wraps]))  # in a wrap as much as elsewhere
        if within <= STREAM.alike * np.max(np.abs(steps[~wraps]), initial=0.0):
            return np.unwrap(position, period=turn), int(np.sum(wraps)), turn
    return position, 0, math.nan


def _jumps(one: Source, rare: float = STREAM.repeated) -> tuple[Numbers, Numbers]:
    """Times, s, and by how much the zero of the position moved before each: by what the velocity does not explain."""
    shown = one.only("position", "velocity")
    if "position" not in shown.values:
        return np.zeros(0), np.zeros(0)
    velocity = shown.values.get("velocity", np.zeros(1))
    known = velocity if np.any(velocity) else None
    return shown.time, jumps(shown.time, shown.values["position"], SHAFT.joint_rest, known, rare)


def jumps(
    time: Numbers, value: Numbers, least: float, velocity: Numbers | None = None, rare: float = STREAM.repeated
) -> Numbers:
    """By how much a signal jumps before each sample, (n,), 0 where it does not.

    It is what its velocity does not explain, or, where none was recorded, the steps before and after.

    Parameters
    ----------
    time, value, velocity : (n,).
    least : a smaller step is no jump.
    rare : part of the steps that may be jumps.
    """
    result = np.zeros(len(value))
    if len(value) < SHAFT.fewest_samples:
        return result
    steps, waits, finest = np.diff(value), np.diff(time), 0.0
    if velocity is not None:
        moved = moved_by(time, velocity)
        fastest = np.maximum(np.abs(velocity[1:]), np.abs(velocity[:-1]))  # of both: it may turn at once
    else:
        rates = np.pad(steps / waits, STREAM.around, "edge")
        rate = np.median(sliding_window_view(rates, 2 * STREAM.around + 1), axis=1)
        moved, fastest = rate * waits, np.abs(rate)
        finest = count(value)
    rest = steps - moved
    usual = STREAM.zero * max(np.quantile(np.abs(rest), 1.0 - rare), finest)
    is_jump = np.abs(rest) > np.maximum(STREAM.beyond * fastest * waits, max(usual, least))
    result[1:] = np.where(is_jump & ~after_gaps(time)[1:], rest, 0.0)
    return result
