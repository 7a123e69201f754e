"""The messages of a sender in the order of their times."""

from typing import NamedTuple

import numpy as np

from wam_analysis.foreign.source import Treated, Treatment
from wam_analysis.measures.runs import held_over
from wam_analysis.thresholds import STREAM
from wam_bag.arrays import Index, Mask, Numbers, Times
from wam_bag.bag import JointColumns, WrenchColumns


class Timed(NamedTuple):
    """Messages of a sender in the order of their times, s, each once."""

    rows: Index
    time: Numbers
    treated: tuple[Treated, ...]


def timed_messages(clock: Times, received: Times, columns: JointColumns | WrenchColumns, sent: Mask) -> Timed:
    """The messages of a sender with times that rise: by their stamps, or by what is known where these repeat."""
    rows = np.flatnonzero(sent)
    rows = rows[np.argsort(clock[rows], kind="stable")]
    stamps = clock[rows]
    steps, waits = np.diff(stamps), np.diff(received[rows])
    same = steps == 0
    number, of = int(np.sum(same)), len(rows)
    known = np.hstack([v for v in columns if isinstance(v, np.ndarray) and v.ndim > 1])[rows]
    numbers = np.nan_to_num(known)
    changed = np.any((numbers[1:] != numbers[:-1]) & np.isfinite(known[1:]), axis=1)  # a copy may have less
    kept, what = np.concatenate([[True], ~same]), Treatment.TWICE
    is_uneven = len(steps) > 0 and not number and np.std(steps) > STREAM.pace * np.median(steps)
    if is_uneven and 0.0 < np.mean(changed) <= STREAM.relayed:
        kept = ~np.all([held_over(column) for column in numbers.T if np.ptp(column)], axis=0)
        what = Treatment.RELAYED
    twice = same & ~changed
    again = np.count_nonzero(np.diff(same.astype(np.int8), prepend=0) > 0)  # stamps that come more than once
    again *= 2 * np.sum(changed) < np.sum(~same)  # they are no copies where nothing moves
    is_seldom = max(again, np.count_nonzero(same & ~twice)) <= STREAM.repeated * (of - number)
    quantum, is_few = _quantum(steps), 0 < 2 * number < of
    firsts = np.flatnonzero(np.concatenate([[True], ~same]))
    period = (stamps[-1] - stamps[0]) / max(len(firsts) - 1, 1)
    fine = STREAM.irregular * period
    own = steps[~same] if is_seldom else steps
    if quantum > fine and np.std(waits) < STREAM.paced * np.std(own):
        treated = Treated(Treatment.REPEATED if is_few else Treatment.ROUNDED, "", number, of, quantum / 1e9)
        return _received(rows, stamps, received, treated)
    placed = np.interp(np.arange(of), [*firsts, of], [*stamps[firsts], stamps[-1] + period])
    even = np.linspace(stamps[0], stamps[-1] + period, of, endpoint=False)
    if np.max(np.abs(even - placed)) <= quantum:
        placed = even  # the rate was constant
    is_whole = not number and np.max(steps, initial=0) < STREAM.changes * period
    is_rounded = is_whole and np.max(np.abs(placed - stamps)) > fine
    if not is_rounded and (is_seldom or 2 * np.sum(twice) >= number):
        left_out = of - int(np.sum(kept))
        return Timed(rows[kept], stamps[kept] / 1e9, (Treated(what, "", left_out, of),) * bool(left_out))
    what = Treatment.SPREAD if quantum else Treatment.BETWEEN
    return Timed(rows, placed / 1e9, (Treated(what, "", number, of, quantum / 1e9),))


def _quantum(steps: Times) -> int:
    """To what stamps are rounded, ns: all steps are multiples of it; 0 if none is."""
    lengths = np.unique(steps)
    quantum = min((one for one in np.diff(lengths).tolist() if one > STREAM.exact), default=0)
    parts = lengths / max(quantum, 1)
    return quantum * bool(np.all(np.abs(parts - np.rint(parts)) < STREAM.irregular))


def _received(rows: Index, stamps: Times, received: Times, treated: Treated) -> Timed:
    """Messages at their times of reception, less what these are later than the stamps at least."""
    arrived = received[rows]
    order = np.argsort(arrived, kind="stable")
    times = arrived[order] - np.min(arrived - stamps)
    kept = np.concatenate([[True], np.diff(times) > 0])
    return Timed(rows[order][kept], times[kept] / 1e9, (treated,))
