"""Bags of other robots as columns of joints and wrenches."""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise, takewhile
from typing import Any

import numpy as np

from wam_analysis.foreign.clocks import BILLION, dates, joined_times, nanoseconds
from wam_analysis.foreign.topic_map import COMMAND, COMMANDED, QUANTITIES, TopicMap
from wam_analysis.thresholds import STREAM
from wam_bag.arrays import Numbers, Texts, Times
from wam_bag.bag import Bag, JointColumns, Messages, WrenchColumns, read
from wam_bag.columns import JOINT_FIELDS, UNNAMED, joint_columns
from wam_description.topics import TRAJECTORY

JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
CONTROLLER = "control_msgs/msg/JointTrajectoryControllerState"
INTERFACES = "control_msgs/msg/DynamicJointState"
SENT = " command"  # behind the topic of a message, of what was commanded in it
POINTS = {"feedback": "", "actual": "", "reference": SENT, "desired": SENT}  # of controllers, new and old
OF_POINT = {"position": "positions", "velocity": "velocities", "effort": "effort"}
FIELDS = {  # of the types that are known: suffix of the topic, and fields by quantity
    JOINTS: [("", {"name": "name", "position": "position", "velocity": "velocity", "effort": "effort"})],
    WRENCH: [("", {"force": "wrench.force", "torque": "wrench.torque"})],
    INTERFACES: [("", {"name": "joint_names", **{q: f"interface_values.{q}" for q in JOINT_FIELDS}})],
    CONTROLLER: [
        (suffix, {"name": "joint_names", **{q: f"{point}.{own}" for q, own in OF_POINT.items()}})
        for point, suffix in POINTS.items()
    ],
}
UNORDERED = "points that go back in time, or lack values of others"  # of a trajectory
PATH_STEP, PATH_SAMPLES = 10_000_000, 100_000  # ns between those of a trajectory's path, and how many at most
PARTS_OF_TIME = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"))  # fields of a stamp, in ROS 2, 1 and rosbridge


def foreign_bag(source: Bag, given: TopicMap) -> Bag:
    """The joints and wrenches of a recording, in the units of the map; the type of a command is `COMMAND`.

    Parameters
    ----------
    source : what it holds, without messages.

    Raises
    ------
    BagError
        if it cannot be read.
    ValueError
        if a topic, joint or field of the map is not there.
    """
    kinds = {source.types[name] for name, number in source.counts.items() if number}
    same_again = [] if JOINTS in kinds else [INTERFACES]
    read_as_it_is = {JOINTS, WRENCH, CONTROLLER, TRAJECTORY, *same_again}
    named = (*given.topics, *given.commands)
    chosen = [
        name for name, kind in source.types.items() if name in named or (kind in read_as_it_is and not given.topics)
    ]
    bag = read(source.path, chosen, as_messages=bool(given.fields) or "stamp" in given.units)
    if missing := [name for name in named if name not in bag.topics]:
        listed = ", ".join(sorted(bag.counts)) or "none"
        raise ValueError(f"{bag.path} has no topic {missing[0]}; its topics: {listed}")
    every = [message for one in bag.topics.values() if isinstance(one, Messages) for message in one.messages]
    for path in ",".join(given.fields.values()).split(","):
        if every and path and not _has(every, path):
            _at(", ".join(bag.topics), every[0], path)  # raises what the messages have
    topics: dict[str, Any] = {}
    types = dict(bag.types)
    for name, columns in bag.topics.items():
        for part, found in _mapped(name, bag.types[name], columns, given):
            if part in topics and not any(getattr(found, q).size for q in JOINT_FIELDS):
                continue  # names that a controller of this version leaves empty
            topics[part] = _scaled(found, given)
            kind = bag.types[name]
            is_command = part in given.commands or kind == TRAJECTORY or SENT in part
            types[part] = COMMAND if is_command else kind
    return checked(bag._replace(topics=topics, types=types), given)


def checked(bag: Bag, given: TopicMap) -> Bag:
    """The bag; raises ValueError if it has not all joints of the map."""
    joints = sorted({joint for one in bag.topics.values() if isinstance(one, JointColumns) for joint in one.names})
    if unknown := [name for name in given.joints if name not in joints]:
        raise ValueError(f"{bag.path} has no joint {unknown[0]}; its joints: {', '.join(joints) or 'none'}")
    return bag


# to columns


def _scaled(columns: Any, given: TopicMap) -> Any:
    """The columns in the units that are shown, with the given names of joints that have none."""
    scaled = {q: given.scaled(q)[0] * getattr(columns, q) for q in QUANTITIES if hasattr(columns, q)}
    if UNNAMED in getattr(columns, "irregular", ()) and len(given.joints) == len(columns.names):
        columns = _named(columns)._replace(names=given.joints)
    return columns._replace(**scaled)


def _named(columns: JointColumns) -> JointColumns:
    """The columns of joints whose messages need no names."""
    return columns._replace(irregular={what: n for what, n in columns.irregular.items() if what != UNNAMED})


def _mapped(topic: str, kind: str, columns: Any, given: TopicMap) -> Iterable[tuple[str, JointColumns | WrenchColumns]]:
    """The columns of a topic by name; those of a controller's state are two: feedback and reference."""
    if isinstance(columns, (JointColumns, WrenchColumns)):
        yield topic, columns
    elif kind == TRAJECTORY and columns.messages:
        yield topic, _paths(topic, columns, given)
    elif columns.messages:
        for suffix, fields in _fields(kind, columns.messages, given):
            has_joints, has_wrench = any(q in fields for q in JOINT_FIELDS), "force" in fields or "torque" in fields
            if not has_joints and not has_wrench:
                raise ValueError(f"{topic} is of type {kind}; name its fields, for example --map position=FIELD")
            if has_joints:
                yield topic + suffix, _joints(topic, columns, fields, given)
            if has_wrench:
                yield topic + suffix + " wrench" * has_joints, _wrench(topic, columns, fields, given)


def _fields(kind: str, messages: Sequence[Any], given: TopicMap) -> Iterable[tuple[str, Mapping[str, str]]]:
    """Suffixes of a topic, each with the fields by quantity: those that are given, else those of the type."""
    known = [
        (suffix, {q: path for q, path in fields.items() if _has(messages, path)})
        for suffix, fields in FIELDS.get(kind, ())
    ]
    own = [one for one in known if one[1].keys() - {"name"}]
    mapped = {q: path for q, path in given.fields.items() if all(_has(messages, part) for part in path.split(","))}
    sent = {q.removeprefix(COMMANDED): mapped.pop(q) for q in [*mapped] if q.startswith(COMMANDED)}
    if own and mapped:
        (suffix, first), *_ = own
        own = [(suffix, first | {q: path for q, path in mapped.items() if q in (*first, "stamp")})]
    elif not own and (mapped.keys() - {"name", "stamp"} or not sent):  # a message may hold a command alone
        own = [("", mapped)]
    if not sent:
        return own
    _, shared = own[0] if own else ("", mapped)
    return [*own, (SENT, {q: path for q, path in shared.items() if q in ("name", "stamp")} | sent)]


def _has(messages: Iterable[Any], path: str) -> bool:
    """Whether any of some messages has a field: in JSON others may leave it out."""
    for message in messages:
        with suppress(ValueError):
            _at("", message, path)
            return True
    return False


def _at(topic: str, message: Any, path: str) -> Any:
    """What a path names in a message; of a list the path goes into each of its elements."""
    value = message
    for part in path.split("."):
        try:
            value = [_part(one, part) for one in value] if isinstance(value, list) else getattr(value, part)
        except AttributeError:
            fields = ", ".join(getattr(message, "_fields", ()) or vars(message))
            raise ValueError(f"{topic} has no field '{path}'; its messages have {fields}") from None
    return value


def _part(element: Any, name: str) -> Any:
    """A field of an element of a list; of one that names its interfaces the value of this interface, NaN for none."""
    if not hasattr(element, "interface_names") or hasattr(element, name):
        return getattr(element, name)
    return dict(zip(element.interface_names, element.values, strict=False)).get(name, math.nan)


def _times(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> Times:
    """Stamps of the messages, ns; times of reception where they have none."""
    path = fields.get("stamp", "header.stamp")
    if "stamp" not in fields and not hasattr(columns.messages[0], "header"):
        return columns.log_time_ns
    if "," in path:
        return joined_times(*np.vstack(_numbers(topic, columns, path)).T.astype(np.int64))
    stamps = [_at(topic, message, path) for message in columns.messages]
    if _whole(stamps[0]) is not None:
        if "stamp" in given.units:
            raise ValueError(f"{topic} has stamps of ROS, in s and ns; --unit stamp is for numbers")
        return np.array([*map(_whole, stamps)], np.int64)
    numbers = np.array(stamps)
    try:
        numbers = numbers if numbers.dtype.kind in "iu" else numbers.astype(np.float64)
    except (TypeError, ValueError):
        try:
            return dates(stamps).astype(np.int64)
        except ValueError:
            raise ValueError(f"{topic}: the field '{path}' has no times") from None
    return nanoseconds(f"{topic}: the field '{path}'", numbers, given, columns.log_time_ns)


def _frames(columns: Messages) -> Texts:
    return np.array([str(getattr(getattr(one, "header", 0), "frame_id", "")) for one in columns.messages], object)


def _numbers(topic: str, columns: Messages, path: str) -> list[Numbers]:
    """The numbers at a path, or at several, in each message, none where it has no such field.

    Those of a vector are x, y, z.
    """
    if not path:
        return [np.zeros(0)] * len(columns.messages)
    if "," in path:
        rows = zip(*(_numbers(topic, columns, part) for part in path.split(",")), strict=True)
        return [np.concatenate(row) for row in rows]
    found = []
    for message in columns.messages:
        value: Any = ()
        with suppress(ValueError):
            value = _at(topic, message, path)
        if parts := {*getattr(value, "_fields", getattr(value, "__dict__", ()))}:
            value = [value.x, value.y, value.z] if parts == {*"xyz"} else ""  # not a quaternion
        try:
            found.append(np.asarray(value, np.float64).ravel())
        except (TypeError, ValueError):
            raise ValueError(f"{topic}: the field '{path}' has no numbers") from None
    return found


def _joints(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> JointColumns:
    taken = [_numbers(topic, columns, fields.get(q, "")) for q in JOINT_FIELDS]
    times, frames = _times(topic, columns, fields, given), _frames(columns)
    alike: dict[Any, list[int]] = {}  # rows by frame, names and lengths of the fields
    for k, message in enumerate(columns.messages):
        widths = tuple(len(numbers[k]) for numbers in taken)
        fitting = given.joints if len(given.joints) == max(widths) else ()
        named = _at(topic, message, fields["name"]) if "name" in fields else fitting
        names = tuple(map(str, np.atleast_1d(named).tolist()))  # a single one, and numbers of motors, too
        if 0 < len(names) < max(widths) and given.fields.items() & fields.items():
            raise ValueError(f"{topic} has {max(widths)} values for {len(names)} names in a message; map other fields")
        alike.setdefault((frames[k], names, widths), []).append(k)
    groups = [
        (np.array(rows), (times[rows], frame, names, [np.array([numbers[k] for k in rows]) for numbers in taken]))
        for (frame, names, _), rows in alike.items()
    ]
    found = joint_columns(columns.log_time_ns, groups)
    return found if "name" in fields else _named(found)


def _paths(topic: str, columns: Messages, given: TopicMap) -> JointColumns:
    """The paths of trajectories, each until the next one begins.

    Each begins where the one before is at that instant.  They are straight between the points, cubic where these have
    velocities, and of the fifth degree where they have accelerations, too, as ros2_control interpolates them.
    """
    begins = _times(topic, columns, {}, given)
    begins = np.where(begins > 0, begins, columns.log_time_ns)  # a stamp of 0 means at once
    age = int(np.median(columns.log_time_ns - begins)) * (len(begins) > 1)
    groups, times, held = list[Any](), [np.zeros(0, np.int64)], dict[tuple[str, ...], list[Numbers]]()
    wrong, (frame, *_) = 0, _frames(columns)
    for message, (begin, end) in zip(columns.messages, pairwise([*begins.tolist(), math.inf]), strict=True):
        points, names = getattr(message, "points", ()), tuple(map(str, getattr(message, "joint_names", ())))
        if not points:
            held = {}  # it cancels
            continue
        # JSON leaves out what is empty or 0
        knots = [begin + (_whole(getattr(point, "time_from_start", None)) or 0) for point in points]
        fields = [[getattr(one, own, ()) for one in points] for own in (*OF_POINT.values(), "accelerations")]
        if np.any(np.diff(knots) < 0) or any(len({*map(len, field)}) > 1 for field in fields):
            wrong += 1
            continue
        values = [np.array(field, np.float64).reshape(len(points), -1) for field in fields]
        before = held.get(names, [])
        if [one.shape[1:] for one in before] == [one.shape[1:] for one in values] and knots[0] > begin:
            knots, values = [begin, *knots], [np.vstack(pair) for pair in zip(before, values, strict=True)]
        last = end if math.isfinite(end) else knots[-1]
        step = max(PATH_STEP, (last - knots[0]) / PATH_SAMPLES)
        at = np.unique([*knots, *np.arange(knots[0], last, step).astype(np.int64)])
        at = at[at < end]
        position, velocity, effort, acceleration = values
        each = ((position, velocity, acceleration), (velocity, acceleration), (effort,), (acceleration,))
        # one of which no beginning is known, and that is replaced before its first point, is at rest there
        stop = np.array([max(last, knots[0])], np.int64)
        taken, left = ([_spline(when, np.array(knots), *one) for one in each] for when in (at, stop))
        held = {names: left}
        groups.append((np.arange(len(at)) + sum(map(len, times)), (at, frame, names, taken[:3])))
        times.append(at)
    # what begins later is planned, if by less than clocks differ
    found = joint_columns(np.concatenate(times) + age * (abs(age) > STREAM.reset), groups)
    return found._replace(irregular={**found.irregular, UNORDERED: wrong}) if wrong else found


def _spline(at: Times, knots: Times, value: Numbers, *rates: Numbers) -> Numbers:
    """Values (k, n) of knots at some instants (m,), ns, (m, n): straight, or with the rates (k, n), 1/s, and theirs."""
    row = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, max(len(knots) - 2, 0))
    after = np.minimum(row + 1, len(knots) - 1)
    wait = (knots[after] - knots[row])[:, np.newaxis]
    part = np.clip((at - knots[row])[:, np.newaxis] / np.maximum(wait, 1), 0.0, 1.0)
    rise, edge = value[after] - value[row], part * (1.0 - part)
    path = value[row] + part * rise
    there = takewhile(lambda rate: rate.shape == value.shape, rates)
    known = [[wait / BILLION * rate[rows] for rows in (row, after)] for rate in there]
    if known:
        first, last = (one - rise for one in known[0])  # off the straight line
        path = path + edge * ((1.0 - part) * first - part * last)
    if len(known) > 1:
        begin, end = (0.5 * wait / BILLION * one for one in known[1])
        path = path + edge**2 * ((1.0 - part) * (begin + 2.0 * first + last) + part * (end - first - 2.0 * last))
    return np.asarray(path, np.float64)


def _whole(stamp: Any) -> int | None:
    """An instant or a duration of ROS, ns; None where it is none."""
    parts = (pair for pair in PARTS_OF_TIME if all(hasattr(stamp, part) for part in pair))
    return next((getattr(stamp, whole) * BILLION + getattr(stamp, rest) for whole, rest in parts), None)


def _wrench(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> WrenchColumns:
    parts = []
    for quantity in ("force", "torque"):
        values = np.full((len(columns.messages), 3), np.nan)
        for k, row in enumerate(_numbers(topic, columns, fields.get(quantity, ""))):
            part = row[3:] if quantity == "torque" and len(row) == 6 else row[:3]
            values[k, : len(part)] = part
        parts.append(values)
    return WrenchColumns(columns.log_time_ns, _times(topic, columns, fields, given), _frames(columns), *parts)
