"""A source without wraps, spikes, frozen stretches and jumps of its zero, and what of these it had."""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from wam_analysis.foreign.pieces import moved_by, rests, velocity_fit
from wam_analysis.foreign.source import Source, Treated, Treatment
from wam_analysis.held_messages import row_at
from wam_analysis.measures.runs import after_gaps, held_over
from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Index, Numbers


def treated_source(one: Source) -> Source:
    """The source without wraps and jumps of the zero, and with what is known of its gaps."""
    values, treated = dict(one.values), list(one.treated)
    for quantity, value in values.items():
        if not one.is_command and (number := int(np.sum(held := held_over(value)))):
            values[quantity] = np.where(held, math.nan, value)
            treated.append(Treated(Treatment.HELD, quantity, number, len(value)))
        elif (number := int(np.sum(np.isfinite(value)))) < len(value):
            treated.append(Treated(Treatment.SPARSE, quantity, number, len(value)))
    if "position" in values and one.units["position"] == "rad":
        position = values["position"].copy()
        known = np.isfinite(position)
        speed = np.nan_to_num(values.get("velocity", np.zeros(len(position))))[known]
        position[known], wraps, turn = _unwrapped(one.time[known], position[known], speed, one.is_command)
        if wraps:
            values["position"] = position
            treated.append(Treated(Treatment.WRAPPED, "position", wraps, size=turn))
    measured = {} if one.is_command else values
    at, moves = _jumps(one._replace(values=measured))
    back = at[:-1][moves[:-1] * moves[1:] < 0.0]
    for quantity, value in measured.items():
        # a zero that would move and move back is a single sample, too
        least = SHAFT.joint_rest * (quantity == "position")
        rows = row_at(one.time, back) if least and len(back) else _spikes(value, least)
        if len(rows) and quantity == "velocity" and "position" in values:  # what its position does, too, is motion
            steps = np.abs(np.diff(values["position"]) / np.diff(one.time))
            rows = rows[~(2.0 * np.maximum(steps[rows - 1], steps[rows]) > np.abs(value[rows]))]
        if len(rows):
            mean, values[quantity] = 0.5 * (value[rows - 1] + value[rows + 1]), value.copy()
            values[quantity][rows] = mean
            size = np.max(np.abs(value[rows] - mean))
            treated.append(Treated(Treatment.SPIKES, quantity, len(rows), size=size))
    if not one.is_command:
        values, found = _without_jumps(one._replace(values=values))
        treated += found
    factor, unfit = velocity_fit(one._replace(values=values))
    if unfit and not one.is_command:
        del values["velocity"]
        treated.append(unfit)
        factor = math.nan
    return one._replace(values=values, treated=tuple(treated), velocity_factor=factor)


def _without_jumps(one: Source) -> tuple[dict[str, Numbers], list[Treated]]:
    """Values without what was frozen before a jump, and without jumps of the zero; what of these there is.

    Of a joint without a velocity, which comes back, or never moves otherwise, nothing shows that it did not move.
    """
    values, treated = dict(one.values), []
    at, moves = _jumps(one)
    shown = one.only("position", "velocity")
    frozen = [(first, after) for after in np.flatnonzero(moves).tolist() if (first := _frozen(shown, after)) < after]
    for first, after in frozen:
        moves[after] = 0.0
        begin, end = row_at(one.time, at[[first, after]])
        for quantity, value in one.values.items():
            if np.all(value[begin:end] == value[begin]):
                values[quantity] = values[quantity].copy()
                values[quantity][begin + 1 : end] = math.nan
    if frozen:
        number = sum(after - first - 1 for first, after in frozen)
        treated.append(Treated(Treatment.FROZEN, "position", number, len(at)))
    sizes = moves[moves != 0.0]
    comes_back = abs(np.sum(sizes)) < SHAFT.much_better * np.sum(np.abs(sizes))
    if not len(sizes) or ("velocity" not in values and comes_back):
        return values, treated
    position = values["position"] - np.cumsum(moves)[row_at(at, one.time)]
    if "velocity" in values or not rests(one._replace(values={"position": position})):
        values["position"] = position
        treated.append(Treated(Treatment.MOVED_ZERO, "position", len(sizes), size=max(sizes, key=abs)))
    return values, treated


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
    if len(away) < SHAFT.fewest_samples:
        return np.zeros(0, np.int64)
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
            return position + np.concatenate([[0.0], np.cumsum(turned)]), int(np.count_nonzero(turned)), turn
        within = turn - np.median(np.abs(steps[wraps]))  # in a wrap as much as elsewhere
        if within <= STREAM.alike * np.max(np.abs(steps[~wraps]), initial=0.0):
            return np.unwrap(position, period=turn), int(np.sum(wraps)), turn
    return position, 0, math.nan


def _jumps(one: Source) -> tuple[Numbers, Numbers]:
    """Times, s, and by how much the zero of the position moved before each: by what the velocity does not explain."""
    shown = one.only("position", "velocity")
    if "position" not in shown.values:
        return np.zeros(0), np.zeros(0)
    velocity = shown.values.get("velocity", np.zeros(1))
    known = velocity if np.any(velocity) else None
    return shown.time, jumps(shown.time, shown.values["position"], SHAFT.joint_rest, known)


def jumps(time: Numbers, value: Numbers, least: float, velocity: Numbers | None = None) -> Numbers:
    """By how much a signal jumps before each sample, (n,), 0 where it does not.

    It is what its velocity does not explain, or, where none was recorded, the steps before and after.

    Parameters
    ----------
    time, value, velocity : (n,).
    least : a smaller step is no jump.
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
        finest = float(np.min(np.abs(steps[steps != 0.0]), initial=math.inf))  # one count of an encoder
    rest = steps - moved
    usual = STREAM.zero * max(np.quantile(np.abs(rest), 1.0 - STREAM.repeated), finest)
    is_jump = np.abs(rest) > np.maximum(STREAM.beyond * fastest * waits, max(usual, least))
    result[1:] = np.where(is_jump & ~after_gaps(time)[1:], rest, 0.0)
    return result
