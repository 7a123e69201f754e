"""The joints and wrenches of a bag, each once for each topic and sender."""

import math
from os.path import commonpath
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from wam_analysis.foreign.clocks import clocks
from wam_analysis.foreign.raw_values import treated_source
from wam_analysis.foreign.source import AXES, Source
from wam_analysis.foreign.stamps import Timed, timed_messages
from wam_analysis.foreign.topic_map import COMMAND, TopicMap
from wam_analysis.measures.runs import smallest
from wam_analysis.thresholds import SHAFT, STREAM
from wam_bag.arrays import Mask, Numbers
from wam_bag.bag import Bag, JointColumns, WrenchColumns
from wam_bag.columns import JOINT_FIELDS


def sources(bag: Bag, given: TopicMap) -> list[Source]:
    """The joints of a bag, each once for each topic and sender, and the wrenches, each once for each frame, too."""
    found: list[Source] = []
    found_clocks = clocks(bag)
    origin = min((int(clock.times.min()) for clock in found_clocks.values()), default=0)
    for topic, (sent_at, received_at, _) in found_clocks.items():
        columns: Any = bag.topics[topic]
        is_command = bag.types.get(topic) == COMMAND
        clock, received = sent_at - origin, received_at - origin
        timed: dict[bytes, Timed] = {}
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
                one = timed.get(of_sender.tobytes()) or timed_messages(clock, received, columns, of_sender)
                timed[of_sender.tobytes()] = one
                mine = own[one.rows]
                rows = one.rows[mine]
                taken = {q: v[rows] for q, v in values.items() if np.isfinite(v[rows]).any()}
                units = {q: given.scaled(q.partition(".")[0])[1] for q in (JOINT_FIELDS if name else AXES)}
                away = np.unique(clock[sent & ~own] / 1e9)
                times = one.time[mine], one.time, received[one.rows] / 1e9
                source = Source(topic, topic, name, frame, is_command, *times, away, taken, units, one.treated)
                if np.count_nonzero(known[rows]) >= (1 if is_command else SHAFT.fewest_samples):
                    found.append(treated_source(source))
    first = min((one.sent[0] for one in found), default=0.0)  # times of reception may be later than a coarse stamp
    return _labelled([one.since(first) for one in found])


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

    Messages of another publisher come in addition, sooner than usual: only the stamps distinguish it from a joint that
    toggles or vibrates.  Single wrong values are in the place of right ones.
    """
    for quantity in source.values:
        one = source.only(quantity)
        if len(one.time) < SHAFT.fewest_samples:
            continue
        last, here, then = sliding_window_view(one.values[quantity], 3).T
        twice = np.abs(then - last)
        once = np.minimum(np.abs(here - last), np.abs(then - here))
        finest = smallest(twice, float(np.ptp(here)))
        coarse = max(float(np.median(twice)), finest if finest < math.inf else 0.0)
        away = once > STREAM.zero * np.maximum(twice, coarse)
        shorter, longer = np.sort(sliding_window_view(np.diff(one.time), 2), axis=1).T
        is_more = shorter < (1.0 - STREAM.pace) * np.median(longer)
        if np.mean(away & is_more) > max(STREAM.repeated, np.mean(away)) / 2.0:
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
