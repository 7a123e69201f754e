"""Times of messages on one clock: stamps of a clock that was set, never set, or is not that of other topics."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wam_analysis.findings.finding import shown
from wam_analysis.foreign.topic_map import UNITS, TopicMap
from wam_analysis.thresholds import STREAM
from wam_bag.arrays import Times
from wam_bag.bag import JointColumns, WrenchColumns

BILLION = 1_000_000_000
CLOCK_SET = "the clock of its stamps was changed, or never set; reception times are used"


class Clock(NamedTuple):
    """When the messages of a topic were sent.

    Attributes
    ----------
    times : (n,), ns, on the clock that all topics of the recording share.
    note : what the stamps are where the times are others; '' where they are the stamps.
    """

    times: Times
    note: str


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
        step = float(np.median(np.diff(np.sort(numbers)))) if len(numbers) > 1 else 0.0
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


def joined_times(seconds: NDArray[Any], rest: NDArray[Any]) -> NDArray[Any]:
    """Times, ns, of whole seconds and a rest, which is less than a second in its unit: ms, us or ns."""
    digits = len(f"{np.nanmax(rest):.0f}")
    return BILLION * seconds + 10 ** (3 * max((9 - digits) // 3, 0)) * rest


def clocks(topics: Mapping[str, JointColumns | WrenchColumns]) -> dict[str, Clock]:
    """The times of each topic, on the clock of the stamped topic with the most messages.

    What a message was later received than sent is the same for two topics of one clock, up to a second.  Where it is
    not, the stamps are shifted by the difference, or those of a clock of another rate replaced by what the other clock
    showed at their reception.
    """
    found = {}
    for topic, columns in topics.items():
        times = rising(columns.stamp_ns, columns.log_time_ns)
        found[topic] = Clock(times, CLOCK_SET * (not np.array_equal(times, columns.stamp_ns)))
    stamped = [topic for topic, clock in found.items() if not clock.note] or list(found)
    first = max(stamped, key=lambda topic: len(found[topic].times), default="")
    for topic, columns in topics.items():
        if topic != first:
            reference = found[first].times, topics[first].log_time_ns
            found[topic] = _compared(found[topic], columns.log_time_ns, *reference, first)
    return found


def _compared(clock: Clock, received: Times, times: Times, arrivals: Times, name: str) -> Clock:
    """A clock by that of a reference, whose messages of some times arrived then."""
    if not len(times) or not len(received) or np.ptp(arrivals) < STREAM.live * np.ptp(times):
        return clock
    order = np.argsort(arrivals, kind="stable")
    begin = arrivals[order[0]]
    age = (arrivals - times)[order]
    there = np.interp((received - begin).astype(float), (arrivals[order] - begin).astype(float), (age - age[0]) * 1.0)
    apart = received - clock.times - age[0] - np.rint(there).astype(np.int64)
    shift = round(float(np.median(apart - apart[0]))) + int(apart[0])
    spread = float(np.quantile(apart, 0.95) - np.quantile(apart, 0.05))
    if max(abs(shift), spread) <= STREAM.reset:
        return clock
    side = "behind" if shift > 0 else "ahead of"
    of = "of another clock" if len(received) > 1 else "of another clock, or sent before the recording"
    note = clock.note or f"stamps {abs(shift) / 1e9:.6g} s {side} those of {name}, as {of}"
    if spread > STREAM.reset:
        return Clock(clock.times + apart, clock.note or f"{note}; reception times are used")
    return Clock(clock.times + shift, clock.note or f"{note}; they are shifted by this")


def rising(stamps: Times, received: Times) -> Times:
    """The stamps, or the times of reception where the stamps are of a clock that was set, reset or never set.

    A few stamps that are years away from their reception, such as 0, are replaced by it, less the usual delay, and so
    is that of a first message that waited for the recorder.
    """
    age = received - stamps
    away = np.abs(age) > STREAM.away
    if 2 * np.count_nonzero(away) < len(stamps):
        stamps = np.where(away, received - int(np.median(age[~away])), stamps)
    steps, arrivals = np.diff(stamps), np.diff(received)
    if not len(steps):
        return stamps
    keeps_pace = abs(np.median(arrivals) - np.median(steps)) <= STREAM.pace * np.median(steps)
    if keeps_pace and steps[0] > arrivals[0] + STREAM.reset:
        return rising(np.concatenate([stamps[1:2] - arrivals[:1], stamps[1:]]), received)
    is_reset = not np.any(steps) or np.any(steps < -STREAM.reset) or (keeps_pace and _is_set(stamps, received))
    return received if is_reset else stamps


def _is_set(stamps: Times, received: Times) -> bool:
    """Whether the stamps go back, or skip periods that the receptions do not, and stay as much older or newer.

    A message that was late does so for a moment; delays that change at random do so within their range.
    """
    steps = np.diff(stamps)
    skipped = (steps > STREAM.filled * np.median(steps)) & (steps > STREAM.filled * np.diff(received))
    rows = np.flatnonzero((steps < 0) | skipped)
    rows = rows[(rows + 1 >= STREAM.near) & (rows + 1 <= len(stamps) - STREAM.near)]
    if not len(rows):
        return False
    windows = sliding_window_view((received - stamps) - (received[0] - stamps[0]), STREAM.near)
    before, after = windows[rows + 1 - STREAM.near], windows[rows + 1]
    apart = np.maximum(np.min(after, axis=1) - np.max(before, axis=1), np.min(before, axis=1) - np.max(after, axis=1))
    return bool(np.any(2 * apart > np.abs(steps[rows])))
