"""Times of messages on one clock: stamps of a clock that was set, never set, or is not that of other topics."""

import math
import re
import warnings
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wam_analysis.findings.finding import shown, times
from wam_analysis.foreign.topic_map import COMMAND, UNITS, TopicMap
from wam_analysis.measures.runs import median_step
from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Index, Times
from wam_bag.bag import Bag, JointColumns, WrenchColumns

BILLION = 1_000_000_000
CLOCK_SET = "the clock of its stamps was changed, or never set; reception times are used"
RECORDER_SET = "the clock of the receptions was set {times}, by up to {size}; the stamps are used"


class Clock(NamedTuple):
    """When the messages of a topic were sent.

    Attributes
    ----------
    times : (n,), ns, on the clock that all topics of the recording share.
    received : (n,), ns, when they were received, by a clock that nobody set meanwhile.
    notes : what is wrong with the stamps or the receptions, and what was done.
    """

    times: Times
    received: Times
    notes: tuple[str, ...]

    @property
    def age(self) -> int:
        """By how much later a message was received than sent, median, ns."""
        return int(np.median(self.received - self.times))


def nanoseconds(label: str, numbers: NDArray[Any], given: TopicMap, received: Times | None = None) -> Times:
    """Times, ns, of numbers in s, in the unit that is given, or in ns since 1970.

    Parameters
    ----------
    label : of the numbers, in errors.
    numbers : (n,).
    received : (n,), ns; None where the messages are in a table.

    Raises
    ------
    ValueError
        if the numbers cannot be in s; it names the unit that is likely.
    """
    if "stamp" not in given.units:
        if np.min(numbers) > STREAM.seconds:
            return numbers.astype(np.int64)
        step = median_step(np.sort(numbers))
        took = 0.0 if received is None else float(np.ptp(received)) / 1e9
        whole = float(np.ptp(numbers))
        is_slower = step >= STREAM.slowest and whole > STREAM.faster * took
        if is_slower or 0.0 < whole < STREAM.quickest * len(numbers):
            likely = min(
                ("ms", "us", "ns", "h", "day"),
                key=lambda unit: abs(math.log(max(UNITS[unit][0] * step, 1e-9) / STREAM.usual)),
            )
            raise ValueError(
                f"{label} increases by {shown(step)} from message to message, so it is hardly in s; give --unit "
                f"stamp={likely}, or another one of s, ms, us, ns, h, day or a factor"
            )
    seconds = given.scaled("stamp")[0] * numbers
    if np.max(seconds) > STREAM.latest:
        raise ValueError(f"{label} reaches {shown(np.max(seconds), 's')}; give --unit stamp=, or times since 1970")
    return np.asarray(np.rint(BILLION * seconds), np.int64)


def dates(texts: Iterable[Any]) -> NDArray[Any]:
    """Times of dates as text, ns since 1970, also of a day with dots or of none; raises ValueError if one is none."""
    with warnings.catch_warnings(action="ignore"):  # that numpy turns times of a zone to UTC
        dotted = [re.sub(r"^(\d\d)\.(\d\d)\.(\d{4})", r"\3-\2-\1", str(one).replace(",", ".")) for one in texts]
        return np.array([re.sub(r"^(\d\d:)", r"1970-01-01T\1", one) for one in dotted], "M8[ns]")


def joined_times(seconds: NDArray[Any], rest: NDArray[Any]) -> NDArray[Any]:
    """Times, ns, of whole seconds and a rest, which is less than a second in its unit: ms, us or ns."""
    digits = len(f"{np.nanmax(rest):.0f}")
    return BILLION * seconds + 10 ** (3 * max((9 - digits) // 3, 0)) * rest


def clocks(bag: Bag) -> dict[str, Clock]:
    """The times of each topic of joints and wrenches by name, on the clock of the stamped topic with the most messages.

    What a message was later received than sent is the same for two topics of one clock, up to a second, and no message
    is received before it was sent.  Where it is not, the stamps are shifted by the difference, or those of a clock of
    another rate replaced by what the other clock showed at their reception.
    """
    found = {}
    for topic, columns in sorted(bag.topics.items()):
        least = 1 if bag.types.get(topic) == COMMAND else SHAFT.fewest_samples
        if not isinstance(columns, (JointColumns, WrenchColumns)) or len(columns.stamp_ns) < least:
            continue
        received, notes = _unset(columns.stamp_ns, columns.log_time_ns)
        sent = rising(columns.stamp_ns, received)
        found[topic] = Clock(sent, received, notes + (CLOCK_SET,) * (not np.array_equal(sent, columns.stamp_ns)))
    trust = {topic: (CLOCK_SET not in one.notes, abs(one.age) <= STREAM.late) for topic, one in found.items()}
    first = max(found, key=lambda topic: (*trust[topic], len(found[topic].times)), default="")
    return {topic: clock if topic == first else _compared(clock, found[first], first) for topic, clock in found.items()}


def _compared(clock: Clock, reference: Clock, name: str) -> Clock:
    """A clock by that of a reference, whose messages of some times arrived then."""
    if np.ptp(reference.received) < STREAM.live * np.ptp(reference.times):
        return clock
    order = np.argsort(reference.received, kind="stable")
    late = (reference.received - reference.times)[order]
    apart = clock.received - clock.times - np.interp(clock.received, reference.received[order], late).astype(np.int64)
    shift = int(np.median(apart))
    spread = float(np.quantile(apart, 0.95) - np.quantile(apart, 0.05))
    by, done = (apart, "reception times are used") if spread > STREAM.reset else (shift, "they are shifted by this")
    of = "of another clock" if len(apart) > 1 else "of another clock, or sent before the recording"
    early, usual = sorted((clock.age, reference.age))
    # no message is received before it is sent
    limit = STREAM.ahead if early < -STREAM.ahead <= usual else STREAM.reset
    if max(abs(shift), spread) <= limit:
        if abs(shift) <= STREAM.late or len(apart) < STREAM.fewest:
            return clock
        by, done, of = 0, "they are used", "sent late, or of another clock"
    note = f"stamps {abs(shift) / 1e9:.4g} s {'behind' if shift > 0 else 'ahead of'} those of {name}, as {of}; {done}"
    return clock._replace(times=clock.times + by, notes=clock.notes or (note,))


def _unset(stamps: Times, received: Times) -> tuple[Times, tuple[str, ...]]:
    """Receptions by a clock that went on as the stamps did, and a note where it was set."""
    order = np.argsort(stamps, kind="stable")
    age = (received - stamps)[order]
    if not len(rows := _sets(received[order], stamps[order])):
        return received, ()
    usual = np.array([np.median(part) for part in np.split(age, rows + 1)], np.int64)
    steady = received.copy()
    steady[order] -= np.repeat(usual - usual[0], np.diff([0, *(rows + 1), len(age)]))
    size = shown(float(np.max(np.abs(np.diff(usual)))) / 1e9, "s")
    return steady, (RECORDER_SET.format(times=times(len(rows)), size=size),)


def rising(stamps: Times, received: Times) -> Times:
    """The stamps, or times by reception where the stamps are of a clock that was set, reset or never set.

    A few stamps are replaced by their reception, less the usual delay: those that are years away from it, such as 0,
    and those far from the stamps before and after, as of a first message that waited for the recorder.  The parts of
    a clock that was set are placed by the usual delay, too.
    """
    if len(stamps) < 2:
        return stamps
    period = np.median(np.abs(np.diff(stamps)))  # longer where they are out of order, as of several threads
    keeps_pace = abs(median_step(received) - period) <= STREAM.pace * period
    age = received - stamps
    before, here, after = stamps[:-2], stamps[1:-1], stamps[2:]
    away = np.abs(age) > STREAM.away
    away[0] |= age[0] - age[1] > STREAM.reset
    is_far = np.maximum(before - here, here - after) > STREAM.near * period
    away[1:-1] |= is_far & (after - before > STREAM.changes * period)  # and its own place is empty
    if 2 * np.count_nonzero(away) < len(stamps):
        stamps = np.where(away, received - int(np.median(age[~away])), stamps)
    if keeps_pace and len(rows := _sets(stamps, received)):
        parts = np.split(received - stamps, rows + 1)
        stamps = stamps + np.concatenate([np.full(len(part), int(np.median(part))) for part in parts])
    steps = np.diff(stamps[np.argsort(received, kind="stable")])
    return received if not np.any(steps) or np.any(steps < -STREAM.reset) else stamps


def _sets(stamps: Times, received: Times) -> Index:
    """Rows after which the stamps go back, or skip periods that the receptions do not, and stay as much older or newer.

    A message that was late does so for a moment; delays that change at random do so within their range.  Both clocks go
    on at one pace before and after: one that was never set does not, nor do receptions of messages that had to wait.
    """
    steps = np.diff(stamps)
    skipped = (steps > STREAM.filled * np.median(steps)) & (steps > STREAM.filled * np.diff(received))
    edge = STREAM.near - 1
    rows = edge + np.flatnonzero(((steps < 0) | skipped)[edge:-edge])
    if not len(rows):
        return rows
    windows = sliding_window_view((received - stamps) - (received[0] - stamps[0]), STREAM.near)
    before, after = windows[rows - edge], windows[rows + 1]
    apart = np.maximum(after.min(axis=1) - before.max(axis=1), before.min(axis=1) - after.max(axis=1))
    both = np.stack([steps, np.diff(received)])
    pace = np.mean(sliding_window_view(both, edge, axis=1)[:, [rows - edge, rows + 1]], axis=-1)
    return rows[(2 * apart > np.abs(steps[rows])) & np.all(2 * pace.min(axis=0) > pace.max(axis=0), axis=0)]
