"""The messages of a sender in the order of their times."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.foreign.source import Treated, Treatment
from wam_analysis.measures.runs import held_over, usual_steps
from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Index, Mask, Numbers, Times
from wam_bag.bag import JointColumns, WrenchColumns


class Timed(NamedTuple):
    """Messages of a sender in the order of their times, s, each once."""

    rows: Index
    time: Numbers
    treated: tuple[Treated, ...]


def timed_messages(clock: Times, received: Times, columns: JointColumns | WrenchColumns, sent: Mask) -> Timed:
    """The messages of a sender with times that rise: by their stamps, or by what is known where these are coarse.

    What moves shows which times are right: it goes more smoothly by them.  Those of messages that are sampled one by
    one, but stamped in packets, are not: a packet has what was sampled since the one before.
    """
    rows = np.flatnonzero(sent)
    rows = rows[np.argsort(clock[rows], kind="stable")]
    stamps = clock[rows]
    if len(stamps) == 1:
        return Timed(rows, stamps / 1e9, ())
    steps, of = np.diff(stamps), len(rows)
    same, scatter = steps == 0, np.std(steps)
    known = np.hstack([v for v in columns if isinstance(v, np.ndarray) and v.ndim > 1])[rows]
    numbers = np.nan_to_num(known)
    parts = (numbers - numbers[0]) / np.maximum(np.ptp(numbers, axis=0), STREAM.rounding)
    values = np.where(np.isfinite(known), parts, math.nan)
    ways = np.nansum(np.abs(np.diff(values, axis=0)), axis=1)  # a copy may have less
    if np.any(ways) and _sends_changes(steps, ways):
        return Timed(rows, stamps / 1e9, (Treated(Treatment.ON_CHANGE, ""),))
    kept, what = np.append(True, ~same), Treatment.TWICE
    if np.any(ways) and not np.any(same) and scatter > STREAM.pace * np.median(steps):
        kept = ~np.all([held_over(column) for column in numbers.T if np.ptp(column)], axis=0)
        what = Treatment.RELAYED
    left_out = of - int(np.sum(kept))
    used = Timed(rows[kept], stamps[kept] / 1e9, (Treated(what, "", left_out, of),) * bool(left_out))
    by_stamps, by_rows = (_roughness(at, values) for at in (stamps, np.arange(of)))
    if by_stamps < by_rows:
        return used
    packed = of * steps <= STREAM.pace * np.ptp(stamps)
    same = packed if np.count_nonzero(packed) > STREAM.repeated * of else same
    lasts = np.flatnonzero(np.append(~same, True))
    period = np.ptp(stamps) / max(len(lasts) - 1, 1)
    if scatter > STREAM.irregular * period and np.std(np.diff(received[rows])) < SHAFT.much_better * scatter:
        # on their way, messages do not get more even
        placed, what = received[rows] - np.min(received[rows] - stamps), Treatment.RECEIVED
    else:
        placed, what = np.interp(np.arange(of), [-1, *lasts], [stamps[0] - period, *stamps[lasts]]), Treatment.BETWEEN
        even = np.linspace(stamps[0] - period, stamps[-1], of + 1)[1:]
        placed = even if np.max(np.abs(even - placed)) <= period else placed  # the rate was constant
        # two publishers jump, too, but their steps differ more than by rounding
        least = SHAFT.better if scatter < STREAM.pace * period else SHAFT.much_better
        is_right = np.all(steps) and by_rows >= least * by_stamps
        if is_right or np.max(np.abs(placed - stamps)) <= SHAFT.agree * period:
            return used
    order = np.argsort(placed)
    order = order[np.diff(placed[order], prepend=-np.inf) > 0.0]
    return Timed(rows[order], placed[order] / 1e9, (Treated(what, "", int(np.sum(same)), of),))


def _sends_changes(steps: Times, ways: Numbers) -> bool:
    """Whether a sender waits for a change: in its gaps, no value changes as far as usual from message to message."""
    late = steps > STREAM.filled * usual_steps(steps)
    is_often = np.count_nonzero(late) >= STREAM.fewest
    return bool(is_often and np.max(ways[late]) < SHAFT.much_better * np.median(ways[~late]))


def _roughness(times: Numbers | Times, values: Numbers) -> float:
    """How far values, (n, k), are off the straight lines between those before and after."""
    before, here, after = (times[begin : len(times) - 2 + begin] for begin in range(3))
    part = ((here - before) / np.maximum(after - before, 1))[:, np.newaxis]
    return float(np.nansum(np.abs((1.0 - part) * values[:-2] + part * values[2:] - values[1:-1])))
