"""One joint or one wrench of one sender and frame, and what was done to its raw values."""

import math
from collections.abc import Mapping
from enum import StrEnum
from os.path import commonpath
from pathlib import PurePath
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from wam_analysis.foreign.clocks import Clock, clocks
from wam_analysis.foreign.reading import COMMAND
from wam_analysis.foreign.topic_map import TopicMap
from wam_analysis.held_messages import row_at
from wam_analysis.measures.runs import after_gaps, noise, usual_steps
from wam_analysis.thresholds import CYCLE, SHAFT, STREAM
from wam_bag.arrays import Index, Mask, Numbers, Times
from wam_bag.bag import Bag, JointColumns, WrenchColumns
from wam_bag.columns import JOINT_FIELDS

AXES = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


class Treatment(StrEnum):
    """What was found in raw values, and done to them before the analysis, in words."""

    ROUNDED = "the stamps are rounded to {size}; reception times are used"
    # the times of reception are coarse, too
    SPREAD = "the stamps are rounded to {size}; the messages are placed evenly between them"
    REPEATED = "{number} of {of} stamps repeat the one before; reception times are used"
    BETWEEN = "{number} of {of} stamps repeat the one before; the messages are placed evenly between them"
    TWICE = "{number} of {of} stamps came twice; the first message of each is used"
    RELAYED = "{number} of {of} messages repeat the one before at another interval, as by a relay; the others are used"
    WRAPPED = "the {quantity} jumps {times} by {size}; it is unwrapped"
    MOVED_ZERO = "the zero of the {quantity} moves {times}, by up to {size}; this is removed"
    HELD = "{quantity} only repeated in {number} of {of} messages; the others are used"
    UNFILLED = "the {quantity} is 0 in every message although the position moves; the rate of that is used"
    LATE = "the {quantity} is about {size}, as by a filter; the rate of the position is used"
    SCALED = "the {quantity} is {factor:.3g} times the rate of the position; that rate is used"
    FROZEN = "the {quantity} is frozen in motion in {number} of {of} messages, and then jumps on; they are left out"
    SPIKES = "the {quantity} jumps away and back {times}, by up to {size}; the mean of its neighbours is used"
    SPARSE = "{quantity} in only {number} of {of} messages"


class Treated(NamedTuple):
    """What was done to the raw values of a source.

    Attributes
    ----------
    what : the kind.
    quantity : of which, '' for the messages.
    number, of : how many, of all; 0 where it is not stated.
    size : of a wrap, or the largest of the jumps, in the unit of the quantity; s, to which stamps are rounded; of a
        velocity, per rate of the position.
    """

    what: Treatment
    quantity: str
    number: int = 0
    of: int = 0
    size: float = math.nan


class Source(NamedTuple):
    """A joint or a wrench.

    Attributes
    ----------
    label : unique in the recording: the joint where one topic has it, else with the topic and its frame.
    topic, name, frame : where it comes from; `name` is that of the joint, '' for a wrench.
    is_command : whether the values are commanded.
    time : (n,), s from the first stamp of the recording, rising.
    sent, received : (m,), s from the first stamp, all stamps of its sender and when the recorder got them.
    away : (k,), s from the first stamp, rising: stamps of its sender's messages in another frame.
    values : (n,) by quantity: position, velocity, effort, or the axes of the wrench; NaN where a message has none.
    units : by quantity.
    treated : what was done to the raw values.
    velocity_factor : see `velocity_fit`; NaN where the velocity was left out.
    """

    label: str
    topic: str
    name: str
    frame: str
    is_command: bool
    time: Numbers
    sent: Numbers
    received: Numbers
    away: Numbers
    values: dict[str, Numbers]
    units: dict[str, str]
    treated: tuple[Treated, ...]
    velocity_factor: float = math.nan

    def only(self, *quantities: str) -> "Source":
        """The source with those of some quantities that it has, in the messages that have all of them.

        Where they come in turns it is in those that have the last of them.
        """
        values = {q: self.values[q] for q in quantities if q in self.values}
        known = _known(self, values)
        if len(values) > 1 and not np.any(known):
            values |= {q: _between(self.time, values[q]) for q in [*values][:-1]}
            known = _known(self, values)
        return self._replace(time=self.time[known], values={q: v[known] for q, v in values.items()})

    @property
    def is_joint(self) -> bool:
        """Whether it is a joint, not a wrench."""
        return bool(self.name)

    @property
    def arrives(self) -> Mask:
        """Whether the message of its sender before each of its own was in another frame, (n,)."""
        return _last(self.away, self.time) > np.concatenate([[-math.inf], self.time[:-1]])

    def is_away(self, time: Numbers) -> Mask:
        """Whether its sender was in another frame at some times, so that its values are not known."""
        return _last(self.away, time) > _last(self.time, time)

    def shares_frame(self, other: "Source") -> bool:
        """Whether both may be in one frame: they name the same one, or one of them names none."""
        return self.frame == other.frame or not self.frame or not other.frame

    def leaves(self, begin: float) -> float:
        """When its sender goes over to another frame after an instant, s; infinite if it does not."""
        return float(np.min(self.away[self.away > begin], initial=math.inf))


class Piece(NamedTuple):
    """A stretch without gaps, at a constant rate.

    Attributes
    ----------
    time : (n,), s.
    values : (n,) by quantity.
    noise : its standard deviation by quantity.
    stamps : (m,), s, where these are irregular, else the same as `time`.
    recorded : (m,) by quantity, the values at the stamps.
    """

    time: Numbers
    values: dict[str, Numbers]
    noise: dict[str, float]
    stamps: Numbers
    recorded: dict[str, Numbers]

    @property
    def period(self) -> float:
        """From sample to sample, s."""
        return float(self.time[1] - self.time[0])


def _known(source: Source, values: Mapping[str, Numbers]) -> Mask:
    """Which messages have all of some values."""
    nothing = np.full(len(source.time), 0.0 if values else math.nan)
    return np.asarray(np.isfinite(np.column_stack([nothing, *values.values()])).all(axis=1), np.bool_)


def _between(time: Numbers, value: Numbers) -> Numbers:
    """A value at all times, on straight lines between those of messages that have it, but not over gaps."""
    rows = np.flatnonzero(np.isfinite(value))
    if not len(rows):
        return value
    after = np.minimum(np.searchsorted(rows, np.arange(len(time))), len(rows) - 1)
    filled = np.interp(time, time[rows], value[rows], math.nan, math.nan)
    return np.where(after_gaps(time[rows])[after] & np.isnan(value), math.nan, filled)


def _last(stamps: Numbers, time: Numbers) -> Numbers:
    """The last of rising stamps at or before each time, minus infinity where there is none."""
    return np.concatenate([[-math.inf], stamps])[np.searchsorted(stamps, time, side="right")]


def sources(bag: Bag, given: TopicMap) -> list[Source]:
    """The joints of a bag, each once for each topic and sender, and the wrenches, each once for each frame, too."""
    found: list[Source] = []
    found_clocks = clocks_of(bag)
    origin = min((int(clock.times.min()) for clock in found_clocks.values()), default=0)
    for topic, columns in _stamped(bag).items():
        is_command = bag.types.get(topic) == COMMAND
        clock, received = found_clocks[topic].times - origin, columns.log_time_ns - origin
        timed: dict[bytes, _Timed] = {}
        parts = _parts(columns)
        nothing = np.full(len(clock), math.nan)
        numbers = {name: np.isfinite(np.column_stack([nothing, *v.values()])).any(axis=1) for name, v in parts.items()}
        masks = {mask.tobytes(): mask for mask in numbers.values()}.values()
        senders = {  # of a joint: it sent all messages with it, or those in some of which alone it comes along
            name: max((one for one in masks if one[known].all()), key=np.count_nonzero)
            for name, known in numbers.items()
            if name
        }
        for frame, own, sent in _frames(columns, clock / 1e9, is_command):
            for name, values in parts.items():
                known, of_sender = numbers[name], sent & senders.get(name, True)
                if (given.joints and name and name not in given.joints) or not np.any(of_sender & own):
                    continue
                one = timed.get(of_sender.tobytes()) or _timed(clock, received, columns, of_sender)
                timed[of_sender.tobytes()] = one
                mine = (own & known if is_command or not name else own)[one.rows]
                rows = one.rows[mine]
                taken = {q: v[rows] for q, v in values.items() if np.isfinite(v[rows]).any()}
                units = {q: given.scaled(q.partition(".")[0])[1] for q in (JOINT_FIELDS if name else AXES)}
                away = np.unique(clock[sent & ~own] / 1e9)
                times = one.time[mine], one.time, received[one.rows] / 1e9
                source = Source(topic, topic, name, frame, is_command, *times, away, taken, units, one.treated)
                if np.count_nonzero(known[rows]) >= (1 if is_command else SHAFT.fewest_samples):
                    found.append(_treated(source))
    return _labelled(found)


class _Timed(NamedTuple):
    """Messages of a sender in the order of their times, s, each once."""

    rows: Index
    time: Numbers
    treated: tuple[Treated, ...]


def _timed(clock: Times, received: Times, columns: JointColumns | WrenchColumns, sent: Mask) -> _Timed:
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
        kept = ~np.all([_held_over(column) for column in numbers.T if np.ptp(column)], axis=0)
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
    if of > SHAFT.fewest_samples and quantum > fine and np.std(waits) < STREAM.paced * np.std(own):
        treated = Treated(Treatment.REPEATED if is_few else Treatment.ROUNDED, "", number, of, quantum / 1e9)
        return _received(rows, stamps, received, treated)
    placed = np.interp(np.arange(of), [*firsts, of], [*stamps[firsts], stamps[-1] + period])
    even = np.linspace(stamps[0], stamps[-1] + period, of, endpoint=False)
    if np.max(np.abs(even - placed)) <= quantum:
        placed = even  # the rate was constant
    is_whole = not number and np.max(steps, initial=0) < STREAM.changes * period
    is_rounded = is_whole and np.max(np.abs(placed - stamps)) > fine
    if not is_rounded and (is_seldom or 2 * np.sum(twice) >= number or stamps[0] == stamps[-1]):
        left_out = of - int(np.sum(kept))
        return _Timed(rows[kept], stamps[kept] / 1e9, (Treated(what, "", left_out, of),) * bool(left_out))
    what = Treatment.BETWEEN if is_few else Treatment.SPREAD
    return _Timed(rows, placed / 1e9, (Treated(what, "", number, of, quantum / 1e9),))


def _quantum(steps: Times) -> int:
    """To what stamps are rounded, ns: all steps are multiples of it; 0 if none is."""
    lengths = np.unique(steps)
    quantum = min((one for one in np.diff(lengths).tolist() if one > STREAM.exact), default=0)
    parts = lengths / max(quantum, 1)
    return quantum * bool(np.all(np.abs(parts - np.rint(parts)) < STREAM.irregular))


def clocks_of(bag: Bag) -> dict[str, Clock]:
    """The times of the topics of joints and wrenches with enough messages, by name."""
    return clocks(_stamped(bag))


def _stamped(bag: Bag) -> dict[str, JointColumns | WrenchColumns]:
    return {
        topic: columns
        for topic, columns in sorted(bag.topics.items())
        if isinstance(columns, (JointColumns, WrenchColumns))
        and len(columns.stamp_ns) >= (1 if bag.types.get(topic) == COMMAND else SHAFT.fewest_samples)
    }


def _frames(columns: JointColumns | WrenchColumns, time: Numbers, is_command: bool) -> list[tuple[str, Mask, Mask]]:
    """Each frame of a topic, the messages that are known in it, and all of its sender.

    A frame that comes in the place of another one is of the same sender: a joint is the same in both, and so is a
    wrench of zero, which a sender may give in any frame.  One that comes besides is of another sender; of commands that
    are sent now and then it is not known.
    """
    frames = np.char.lstrip(np.asarray(columns.frames, dtype=str), "/")
    masks = {frame: frames == frame for frame in dict.fromkeys(frames.tolist())}
    most = max(masks.values(), key=np.count_nonzero)
    is_seldom = is_command and np.count_nonzero(most) < SHAFT.fewest_samples
    rows = np.flatnonzero(most)
    steps, has_others = np.diff(time[rows]), np.diff(rows) > 1  # besides others: they go on at their period
    if not is_seldom and np.any(has_others) and np.median(steps[has_others]) < STREAM.changes * np.median(steps):
        return [(frame, mask, mask) for frame, mask in masks.items()]
    every = np.ones(len(frames), dtype=bool)
    if isinstance(columns, JointColumns) or len(masks) == 1:
        return [(next(iter(masks)), every, every)]
    nothing = ~np.any(np.nan_to_num(np.hstack([columns.force, columns.torque])), axis=1)
    acting = {frame: mask | nothing for frame, mask in masks.items() if not np.all(nothing[mask])}
    return [(frame, mask, every) for frame, mask in (acting or {next(iter(masks)): every}).items()]


def alternates(source: Source) -> bool:
    """Whether a quantity jumps away and back from message to message, as where two publishers share a topic.

    Two messages away on either side a value is near one of both: at the turn of a fast vibration it is near none.
    """
    for quantity in source.values:
        values = source.only(quantity).values[quantity]
        if len(values) < SHAFT.fewest_samples:
            continue
        before, last, here, then, after = sliding_window_view(values, 5).T
        once = np.minimum(np.abs(here - last), np.abs(then - here))
        near = [
            np.minimum(np.abs(far - here), np.abs(far - next_to)) for far, next_to in ((before, last), (after, then))
        ]
        twice = np.abs(then - last)
        finest = max(
            float(np.median(twice)),
            float(np.min(twice, initial=math.inf, where=twice > 0.0)) if np.any(twice) else 0.0,
            CYCLE.still_shaft / STREAM.zero if quantity == "position" else 0.0,
        )
        away = once > STREAM.zero * np.maximum(np.maximum(*near), np.maximum(twice, finest))
        if np.mean(away) > (STREAM.repeated / 2.0 if quantity == "position" else 0.5):
            return True
    return False


def _parts(columns: JointColumns | WrenchColumns) -> dict[str, dict[str, Numbers]]:
    """Values of each joint by its name, or of the wrench by ''."""
    if isinstance(columns, WrenchColumns):
        return {"": dict(zip(AXES, np.hstack([columns.force, columns.torque]).T, strict=True))}
    quantities = {q: getattr(columns, q) for q in JOINT_FIELDS}
    return {
        name: {q: values[:, i] for q, values in quantities.items() if values.shape[1]}
        for i, name in enumerate(columns.names)
    }


def _received(rows: Index, stamps: Times, received: Times, treated: Treated) -> _Timed:
    """Messages at their times of reception, less what these are later than the stamps at least."""
    arrived = received[rows]
    order = np.argsort(arrived, kind="stable")
    times = arrived[order] - np.min(arrived - stamps)
    kept = np.concatenate([[True], np.diff(times) > 0])
    return _Timed(rows[order][kept], times[kept] / 1e9, (treated,))


def _treated(one: Source) -> Source:
    """The source without wraps and jumps of the zero, and with what is known of its gaps."""
    values, treated = dict(one.values), list(one.treated)
    for quantity, value in values.items():
        if not one.is_command and (number := int(np.sum(held := _held_over(value)))):
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
    ways = [float(np.mean(rates)) * (time[after] - time[first]), float(np.sum(_moved(time[during], velocity[during])))]
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


def _held_over(value: Numbers) -> Mask:
    """Which samples only repeat the one before, where a signal changes in every second message at most, and evenly.

    One that rests, or moves by counts of an encoder, repeats samples, too, but changes by one count.
    """
    steps = np.abs(np.diff(value))
    changed = np.flatnonzero(steps > 0.0) + 1
    apart, sizes = np.diff(changed), steps[changed - 1]
    if len(apart) < SHAFT.fewest_samples or np.any(np.isnan(steps)):
        return np.zeros(len(value), np.bool_)
    often = np.median(apart)
    is_even = np.mean((apart > 1) & (np.abs(apart - often) <= 1.0)) >= STREAM.evenly
    if not is_even or np.median(sizes) < STREAM.counts * np.min(sizes):
        return np.zeros(len(value), np.bool_)
    row = np.arange(len(value))
    since = row - np.concatenate([[0], changed])[np.searchsorted(changed, row, side="right")]
    return since % math.ceil(np.quantile(apart, STREAM.evenly)) > 0


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
    steps, moved = np.diff(position), _moved(time, speed)
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


def _moved(time: Numbers, velocity: Numbers) -> Numbers:
    """By how much a velocity moves a joint from each sample to the next, (n - 1,)."""
    return 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time)


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
        moved = _moved(time, velocity)
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


def _labelled(found: list[Source]) -> list[Source]:
    """Each with a label of its own: as short as it can be."""
    result = []
    for one in found:
        others = [two for two in found if two is not one and two.name == one.name]
        is_alone = not any(two.is_command == one.is_command for two in others)
        label = one.name * is_alone or f"{one.topic} {one.name}".rstrip()
        if any(two.topic == one.topic for two in others):
            label += f" ({one.frame or 'no frame'})"
        result.append(one._replace(label=label))
    return result


def shared_parts(one: Source, other: Source) -> int:
    """How many parts the names of two topics have in common from the beginning."""
    return len(PurePath(commonpath([each.topic.strip("/") for each in (one, other)])).parts)


def pieces(source: Source, *quantities: str) -> list[Piece]:
    """The stretches of a source between gaps, at a constant rate; velocities made from positions if need be.

    Parameters
    ----------
    quantities : which are needed: messages without one of them are left out; all if none is given.
    """
    source = source.only(*(quantities or source.values))
    if len(source.time) < SHAFT.fewest_samples:
        return []
    steps = np.diff(source.time)
    period = float(np.median(steps))
    slow = steps[usual_steps(steps) > STREAM.changes * period]
    period = float(np.median(slow)) if 2.0 * np.sum(slow) > np.sum(steps) else period  # that of most of the time
    inner = (np.flatnonzero(steps > STREAM.filled * period) + 1).tolist()
    found = []
    for begin, end in zip([0, *inner], [*inner, len(source.time)], strict=True):
        time = source.time[begin:end]
        count = round((time[-1] - time[0]) / period) + 1
        if min(len(time), count) < SHAFT.fewest_samples:
            continue
        values = {q: v[begin:end] for q, v in source.values.items()}
        stamps, recorded = time, values
        if np.max(np.abs(np.diff(time) - period)) > STREAM.irregular * period:
            even = np.linspace(time[0], time[-1], count)
            values = {q: np.interp(even, time, v) for q, v in values.items()}
            time = even
        sd = {q: resolution(v) for q, v in values.items()}
        if "position" in values and "velocity" not in values:
            values = dict(values)
            values["velocity"], sd["velocity"] = differentiated(time, values["position"])
        found.append(Piece(time, values, sd, stamps, recorded))
    return found


def resolution(value: Numbers) -> float:
    """Standard deviation of the noise of a signal, or of its rounding to the steps of an encoder.

    What moves by the same in every sample shows no rounding.
    """
    steps = np.diff(value)
    sizes = np.abs(steps[steps != 0.0])
    if not len(sizes):
        return 0.0
    quantum = float(np.min(sizes))
    counts = sizes / quantum
    # from place to place, to stay there, as a gripper does: no flicker of an encoder
    is_step = SHAFT.joint_rest < quantum >= 0.5 * np.ptp(value) and np.std(steps) < np.std(value)
    is_even = is_step or np.ptp(steps) < 0.5 * quantum
    is_rounded = not is_even and np.all(np.abs(counts - np.rint(counts)) < 0.05) and np.median(counts) < 1e3
    return max(noise(value), quantum / math.sqrt(12.0) if is_rounded else 0.0)


def rests(source: Source) -> bool:
    """Whether a joint never moved, by its position: an encoder may flicker between counts."""
    position = source.only("position").values.get("position", np.zeros(0))
    if not len(position):
        return False
    sd = resolution(position)
    most = np.ptp(np.percentile(position, (5.0, 95.0)))  # of the time in one place, but for its noise
    return bool(most <= SHAFT.noisy * sd and np.ptp(position) <= SHAFT.far * sd)


def differentiated(time: Numbers, position: Numbers) -> tuple[Numbers, float]:
    """Rate of a position, and its noise: slope of a line through as many samples as it needs, within `widest`.

    Parameters
    ----------
    time : (n,), s, at a constant rate.
    position : (n,).
    """
    period = float(time[1] - time[0])
    speed = float(np.percentile(np.abs(np.gradient(position, period)), 95.0))
    sd = resolution(position) / period
    half = 1
    while (
        half * period < STREAM.widest / 2.0
        and _of_slope(sd, half) > STREAM.precise * speed
        and len(position) > 2 * half + 2
    ):
        half += 1
    k = np.arange(half, -half - 1, -1)
    inner = np.convolve(position, k / (float(k @ k) * period), "valid")
    return np.pad(inner, half, "edge"), _of_slope(sd, half)


def velocity_fit(source: Source) -> tuple[float, Treated | None]:
    """Recorded velocity over the rate of the position, and why it is left out, if it has to be.

    The factor is NaN where the position does not move or one of them is lacking, and below zero where the sign is
    swapped.
    """
    parts = [np.zeros((0, 3))]
    shown = source.only("position", "velocity")
    has_both = len(shown.values) == 2 and not rests(source)
    for piece in pieces(shown) if has_both else ():
        width = max(1, round(STREAM.averaged / piece.period))
        if len(piece.time) > width + 1:
            span = width * piece.period
            rate, mean = (way / span for way in ways(piece, width))
            moves = np.abs(rate) > max(SHAFT.joint_rest, SHAFT.noisy * piece.noise["position"] / span)
            parts.append(np.column_stack([mean, rate, np.gradient(rate, piece.period)])[moves])
    velocity, rate, change = np.vstack(parts).T
    if len(rate) and not np.any(recorded := shown.values["velocity"]):
        return 0.0, Treated(Treatment.UNFILLED, "velocity")
    if len(rate) < SHAFT.fewest_samples:
        return math.nan, None
    columns = np.column_stack([rate, change])
    now, before = np.linalg.lstsq(columns, velocity, rcond=None)[0]
    kept, lost, slope, left = (
        float(np.linalg.norm(each) / np.linalg.norm(rate))
        for each in (now * rate, before * change, change, velocity - columns @ (now, before))
    )
    factor = math.copysign(math.hypot(kept, lost), now)
    hidden = np.sum(np.diff(recorded) ** 2) / np.sum(recorded**2) / 6.0  # by few samples of a motion
    doubt = SHAFT.late + left + hidden  # of noise and slips, too
    lag = math.atan2(lost, kept) / slope if before < 0.0 < slope else 0.0
    if abs(factor - 1.0) > SHAFT.agree:
        return factor if abs(factor - 1.0) > SHAFT.agree + hidden else math.nan, None  # they contradict each other
    if lost > doubt and lag > np.median(np.diff(source.time)):
        return factor, Treated(Treatment.LATE, "delay of the velocity", size=lag)
    return factor, Treated(Treatment.SCALED, "velocity", size=factor) if abs(factor - 1.0) > doubt else None


def ways(piece: Piece, width: int) -> tuple[Numbers, Numbers]:
    """By how much a joint moves in so many periods, by its position and by its recorded velocity."""
    position, velocity = piece.values["position"], piece.values["velocity"]
    by = np.concatenate(([0.0], np.cumsum(_moved(piece.time, velocity))))
    return position[width:] - position[:-width], by[width:] - by[:-width]


def _of_slope(sd: float, half: int) -> float:
    """Noise of the slope of a line through 2 `half` + 1 samples, for noise per sample interval."""
    return sd / math.sqrt(half * (half + 1) * (2 * half + 1) / 3.0)
