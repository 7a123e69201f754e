"""Section about the topics of another robot's recording, and what was done to their raw values."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from wam_analysis.findings.finding import Section, counted, shown, times, when
from wam_analysis.foreign.clocks import clocks
from wam_analysis.foreign.pieces import pieces
from wam_analysis.foreign.source import Source, Treated, Treatment
from wam_analysis.foreign.topic_map import QUANTITIES, UNITS, TopicMap
from wam_analysis.recording import AnalysedRecording
from wam_analysis.thresholds import SHAFT
from wam_bag.bag import Bag, Columns, JointColumns, WrenchColumns
from wam_bag.limits import READING_LIMITS

UNUSUAL = {  # values in the unit of ROS that few robots reach
    "position": 4.0 * math.pi, "velocity": 4.0 * math.pi, "effort": 400.0, "force": 1e4, "torque": 1e3,
}  # fmt: skip


def topics_section(recording: AnalysedRecording) -> Section:
    """What is in another robot's recording, and what was done to its raw values."""
    bag, mixed, given, found = recording.bag, recording.mixed, recording.given, recording.analysed
    sentences = [
        line for name, columns in sorted(bag.topics.items()) for line in _topic(name, columns, bag.counts.get(name, 0))
    ]
    wrong = [*(f"INCOMPLETE: {line}" for line in recording.lost), *in_words(found)]
    wrong += [f"{name}: {note}." for name, clock in clocks(bag).items() for note in clock.notes]
    wrong += [
        f"{topic}: values jump back and forth from message to message, as if two publishers, or rows of two joints, "
        f"took turns; the topic is not analysed ({', '.join(one.label for one in mixed if one.topic == topic)})."
        for topic in dict.fromkeys(one.topic for one in mixed)
    ]
    for name, columns in bag.topics.items():
        if isinstance(columns, JointColumns):
            wrong += [f"{name}: {counted(n, 'message')} with {what}." for what, n in columns.irregular.items()]
        wrong += _too_large(name, given, [one for one in found if one.topic == name])
    wrong += _fast(found, given)
    if topics := ", ".join(dict.fromkeys(one.topic for one in found if one.is_command)):
        sentences.append(f"Taken as commands: {topics}.")
    measured = {one.name for one in found if not one.is_command}
    if unknown := [one.label for one in found if one.is_command and one.name not in measured]:
        sentences.append(
            f"Nothing measured is named {', '.join(unknown)}; where a command has no names, give --joint for each."
        )
    sentences += [f"{text}." for one in found if not (one.is_command or one.is_joint) and (text := frame_change(one))]
    if computed := [one.label for one in found if _lacks_velocity(one)]:
        sentences.append(f"The velocity is computed from the position: {', '.join(computed)}.")
    sentences += [*wrong, *_alike(found), *unread(bag)]
    return Section("happened", "What happened", sentences, wrong=wrong)


def frame_change(source: Source) -> str:
    """That a wrench which is not zero goes over to its frame from another one, '' if it does not."""
    at = source.time[source.arrives & np.any(np.column_stack([*source.values.values()]), axis=1)]
    return f"{source.topic} changes to the frame {source.frame or 'without a name'} {when(at)}" if len(at) else ""


def _topic(name: str, columns: Columns, count: int) -> Iterator[str]:
    """What a topic of so many messages holds, of 0 where their number is that of its rows."""
    if isinstance(columns, JointColumns) and len(columns.stamp_ns):
        has = np.isfinite(np.hstack([columns.position, columns.velocity, columns.effort]))
        number = len(columns.names)
        rows = np.count_nonzero(np.any(has, axis=1)) or len(has)  # a table has rows of other topics
        messages = int(min(count or rows, rows))  # a trajectory has many
        yield f"{name}: {counted(messages, 'message')}; joints: {', '.join(columns.names)}."
        if none := [joint for i, joint in enumerate(columns.names) if not np.any(has[:, i::number])]:
            yield f"{name}: {', '.join(none)} without a number for position, velocity or effort."
    elif isinstance(columns, WrenchColumns) and len(columns.stamp_ns):
        largest = _largest(np.sqrt(np.nansum(columns.force**2, axis=1)))
        known = np.isfinite(columns.force).any(axis=1)
        what = f"up to {shown(largest, 'N')}" if known.any() else "none of which is a number"
        yield f"{name}: {np.count_nonzero(known) or len(columns.force)} forces, {what}."


def _too_large(name: str, given: TopicMap, found: Sequence[Source]) -> Iterator[str]:
    """Which values may be in another unit than that of ROS; a velocity that is the rate of a position is in none."""
    for quantity, most in UNUSUAL.items():
        some = [one for one in found if not (quantity in ("position", "velocity") and turns(one))]
        largest = max((_largest(v) for one in some for q, v in one.values.items() if q.startswith(quantity)), default=0)
        is_rate = quantity == "velocity" and any(abs(one.velocity_factor - 1.0) <= SHAFT.agree for one in found)
        if largest > most and quantity not in given.units and not is_rate:
            taken = f"{quantity} reaches {shown(largest, QUANTITIES[quantity][0])}, more than most robots"
            fitting = [each for each in UNITS.items() if each[1][0] < 1.0 and each[1][1] in QUANTITIES[quantity]]
            first = {one: unit for unit, one in reversed(fitting)}  # of its spellings
            units = " or ".join(
                f"--unit {quantity}={unit} (shown in {to})" for (_, to), unit in reversed(first.items())
            )
            yield f"{name}: {taken}. If it was recorded in another unit, give {units}."


def _largest(values: ArrayLike) -> float:
    """Size of the largest value that is a finite number."""
    return float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))


def _fast(found: Sequence[Source], given: TopicMap) -> Iterator[str]:
    """Which joints would move faster than few do, where their velocity was not recorded."""
    for one in found:
        if _lacks_velocity(one) and "position" not in given.units and not turns(one):
            speeds = [np.percentile(np.abs(piece.values["velocity"]), 99.0) for piece in pieces(one, "position")]
            if (most := float(max(speeds, default=0.0))) > UNUSUAL["velocity"]:
                why = "if its position is in deg, give --unit position=deg"
                yield f"{one.label}: moves at up to {shown(most, 'rad/s')}; {why}."


def turns(one: Source) -> bool:
    """Whether a joint is a wheel or the shaft of a motor, or has no end: it turns mostly one way, or over 2 pi."""
    steps = np.diff(one.known("position"))
    is_endless = abs(np.sum(steps)) > SHAFT.much_better * np.sum(np.abs(steps))
    is_endless |= any(each.what is Treatment.WRAPPED and each.size < UNUSUAL["position"] for each in one.treated)
    return bool(is_endless) or any(word in one.name.lower() for word in ("motor", "wheel"))


def _lacks_velocity(one: Source) -> bool:
    """Whether the velocity of a joint is that of its position."""
    return "position" in one.values and "velocity" not in one.values and not one.is_command


def in_words(found: Sequence[Source]) -> list[str]:
    """What was done to raw values, a sentence for all joints of a topic and quantities to which the same was done."""
    alike: dict[tuple[str, Treated], tuple[list[Source], list[str]]] = {}
    for one in found:
        for treated in one.treated:
            those, quantities = alike.setdefault((one.topic, treated._replace(quantity="")), ([], []))
            those += [one] * (one not in those)
            quantities += [treated.quantity] * (treated.quantity not in quantities)
    sentences = []
    for (topic, treated), (those, quantities) in alike.items():
        is_whole = not quantities[0] or 1 < len(those) == sum(one.topic == topic for one in found)
        subject = topic if is_whole else ", ".join(one.label for one in those)
        words = treated.what.format(
            quantity=" and ".join(quantities),
            number=treated.number,
            of=treated.of,
            size=shown(abs(treated.size), those[0].units.get(quantities[0], "s")),
            factor=treated.size,
            times=times(treated.number),
        )
        sentences.append(f"{subject}: {words}.")
    return sentences


def _alike(found: Sequence[Source]) -> list[str]:
    """How to name the command among several topics with the same joints: their values do not show it."""
    if any(one.is_command for one in found):
        return []
    topics: dict[str, dict[str, None]] = {}
    for one in found:
        topics.setdefault(one.name, {})[one.topic] = None
    shared = {tuple(some): joint for joint, some in topics.items() if joint and len(some) > 1}
    return [
        f"{joint} is in {' and '.join(some)}; if one of them is the command, name it with --command."
        for some, joint in shared.items()
    ]


def unread(bag: Bag) -> list[str]:
    """Topics that were not read, and how to."""
    others = {
        name: n for name, n in bag.counts.items() if n and not any(one.split(" ")[0] == name for one in bag.topics)
    }
    if not others:
        return []
    most = sorted(others, key=lambda name: -others[name])[: READING_LIMITS.named]
    listed = ", ".join(f"{name} ({bag.types.get(name, '')})" for name in most) + ", ..." * (len(others) > len(most))
    readable = [name for name in most if name not in bag.unread]
    advice = f"; to analyse them: --topic {readable[0]} --map QUANTITY=FIELD" if readable else ""
    return [f"Not analysed: {sum(others.values())} messages of {listed}{advice}."]
