"""Bags of other robots as columns of joints and wrenches: by `wam_bag`, or by rosbags where the format is another."""

import csv
import importlib
import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import cache, partial
from numbers import Integral
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from mcap.reader import make_reader

from wam_analysis.findings.finding import shown
from wam_analysis.foreign.topic_map import NOTHING_GIVEN, UNITS, TopicMap
from wam_analysis.thresholds import STREAM
from wam_bag.arrays import Numbers, Texts, Times
from wam_bag.bag import Bag, BagError, JointColumns, Messages, WrenchColumns, read
from wam_bag.columns import JOINT_FIELDS as IN_JOINTS
from wam_bag.columns import UNNAMED, joint_columns, joint_names
from wam_bag.contents import contents

JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
JOINT_FIELDS = {"name": "name", "position": "position", "velocity": "velocity", "effort": "effort"}
WRENCH_FIELDS = {"force": "wrench.force", "torque": "wrench.torque"}
CONTROLLER = "control_msgs/msg/JointTrajectoryControllerState"
CONTROLLER_PARTS = {"": ("feedback", "actual"), " command": ("reference", "desired")}  # suffix of the topic: names
COMMAND = "command"
TIME_OF_ROS = "{} has stamps of ROS, in s and ns; --unit stamp is for numbers"
ROSBAGS = (".bag", ".db3")
BILLION = 1_000_000_000


def needs_rosbags(path: Path) -> bool:
    """Whether a bag is of ROS 1 or of SQLite, which rosbags reads."""
    if path.is_file():
        return path.suffix in ROSBAGS
    return any(path.glob("*.db3*"))


def foreign_bag(path: Path, given: TopicMap) -> Bag:
    """The joints and wrenches of a recording, in the units of the map; the type of a command is `COMMAND`.

    Raises
    ------
    BagError
        if it cannot be read, is empty, or needs rosbags, which is not installed.
    ValueError
        if a topic, joint or field of the map is not there.
    """
    if path.suffix == ".csv":
        return table_bag(path, series_of_csv(path), given)
    if needs_rosbags(path):
        bag = _by_rosbags(path, given)
    elif encoded := of_other_encoding(path):
        bag = _by_mcap(path, encoded, given)
    else:
        listed = contents(path).topics
        chosen = [name for name, topic in listed.items() if _is_wanted(name, topic.type, given)]
        bag = read(path, chosen)
        bag = bag._replace(types={name: topic.type for name, topic in listed.items()})
    require_messages(path, bag.counts.values())
    return _analysed(bag, given)


def require_messages(path: Path, counts: Iterable[int]) -> None:
    """Refuse an empty recording.

    Raises
    ------
    BagError
        if no topic has a message.
    """
    if not any(counts):
        raise BagError(f"{path} is empty: it has no message; record again while the nodes publish")


def _analysed(bag: Bag, given: TopicMap) -> Bag:
    """The bag with columns of joints and wrenches alone."""
    missing = [name for name in (*given.topics, *given.commands) if name not in bag.topics]
    if missing:
        listed = ", ".join(sorted(bag.counts)) or "none"
        raise ValueError(f"{bag.path} has no topic {missing[0]}; its topics: {listed}")
    topics: dict[str, Any] = {}
    types = dict(bag.types)
    for name, columns in bag.topics.items():
        for part, found in _mapped(name, bag.types[name], columns, given):
            topics[part] = found
            is_command = part in given.commands or (bag.types[name] == CONTROLLER and part != name)
            types[part] = COMMAND if is_command else bag.types[name]
    joints = sorted({joint for one in topics.values() if isinstance(one, JointColumns) for joint in one.names})
    if unknown := [name for name in given.joints if name not in joints]:
        raise ValueError(f"{bag.path} has no joint {unknown[0]}; its joints: {', '.join(joints) or 'none'}")
    return bag._replace(topics=topics, types=types)


def _is_wanted(topic: str, kind: str, given: TopicMap) -> bool:
    if given.topics:
        return topic in (*given.topics, *given.commands)
    return kind in (JOINTS, WRENCH, CONTROLLER) or topic in given.commands


# tables


def series_of_csv(path: Path) -> dict[str, Numbers]:
    """Columns of a CSV file by their titles; what is no number is NaN.

    Raises
    ------
    BagError
        if it has no column or no row.
    """
    with path.open(newline="", encoding="utf-8-sig") as stream:
        head, *rows = csv.reader(stream)
    if not rows:
        raise BagError(f"{path} has no row below the names of its columns")
    table = np.genfromtxt([",".join(row) for row in rows], delimiter=",", dtype=np.float64, ndmin=2)
    return {name.strip(): table[:, i] for i, name in enumerate(head)}


def table_bag(path: Path, series: Mapping[str, Any], given: TopicMap = NOTHING_GIVEN) -> Bag:
    """A recording of a table with 'time', s, and columns as position.JOINT, velocity.JOINT, effort.JOINT or force.x.

    Parameters
    ----------
    series : columns by title, (k,), such as a DataFrame; a map gives other titles of a quantity, and of the time as its
        stamp.

    Raises
    ------
    ValueError
        if it has no time, or nothing that can be analysed.
    """
    found = {str(name): np.asarray(series[name], np.float64) for name in series}
    clock = given.fields.get("stamp", "time")
    if clock not in found:
        raise ValueError(f"{path} has no column '{clock}'; name the column of the time with --map stamp=COLUMN")
    seconds = given.scaled("stamp")[0] * found[clock]
    times = np.rint(BILLION * seconds).astype(np.int64)
    parts: dict[str, dict[str, Numbers]] = {}
    for quantity in (*IN_JOINTS, "force", "torque"):
        title, factor = given.fields.get(quantity, quantity), given.scaled(quantity)[0]
        named = {n.removeprefix(title).removeprefix("."): n for n in found if f"{n}.".startswith(f"{title}.")}
        parts[quantity] = {name: factor * found[column] for name, column in named.items()}
    nothing = np.full(len(times), "", object)
    topics: dict[str, Any] = {}
    joints = tuple(dict.fromkeys(name for q in IN_JOINTS for name in parts[q]))
    if joints:
        blank = np.full(len(times), math.nan)
        p, v, e = (np.column_stack([parts[q].get(n, blank) for n in joints]) for q in IN_JOINTS)
        topics["joints"] = JointColumns(times, times, nothing, joint_names(joints, 0), p, v, e)
    if parts["force"] or parts["torque"]:
        vectors = [np.column_stack([parts[q].get(axis, 0.0 * times) for axis in "xyz"]) for q in ("force", "torque")]
        topics["wrench"] = WrenchColumns(times, times, nothing, *vectors)
    if not topics:
        raise ValueError(
            f"{path} has the columns {', '.join(found)}; rename them, for example position.JOINT, or use --map"
        )
    counts = dict.fromkeys(topics, len(times))
    return Bag(path, topics, dict.fromkeys(topics, "table"), {}, {}, counts)


# other formats


def _by_rosbags(path: Path, given: TopicMap) -> Bag:
    try:
        highlevel: Any = importlib.import_module("rosbags.highlevel")
        typesys: Any = importlib.import_module("rosbags.typesys")
    except ImportError:
        raise BagError(f"{path} is not an MCAP file; rosbags reads it: pip install 'wam_stack[rosbags]'") from None
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)  # where the bag defines no types
    try:
        with highlevel.AnyReader([path], default_typestore=store) as reader:
            kinds = {one.topic: one.msgtype for one in reader.connections}
            counts = {topic: found.msgcount for topic, found in reader.topics.items()}
            some = [one for one in reader.connections if _is_wanted(one.topic, one.msgtype, given)]
            read = reader.messages(some) if some else ()
            decoded = ((one.topic, time, reader.deserialize(data, one.msgtype)) for one, time, data in read)
            return _bag_of(path, kinds, counts, decoded)
    except highlevel.AnyReaderError as error:
        raise BagError(f"{path} cannot be read by rosbags: {error}") from None


def of_other_encoding(path: Path) -> list[Path]:
    """The MCAP files with messages that are not CDR, JSON or those of ROS 1; none where all are CDR."""
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path] if path.suffix == ".mcap" else []
    return files if any(_has_other_encoding(file) for file in files) else []


def _has_other_encoding(file: Path) -> bool:
    try:
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
    except Exception:  # a broken file is explained by the reader of the stack
        return False
    return summary is not None and any(one.message_encoding in ("json", "ros1") for one in summary.channels.values())


def _by_mcap(path: Path, files: Sequence[Path], given: TopicMap) -> Bag:
    with ExitStack() as stack:
        readers = [make_reader(stack.enter_context(file.open("rb"))) for file in files]
        kinds: dict[str, str] = {}
        counts = Counter[str]()
        for summary in (one for reader in readers if (one := reader.get_summary()) is not None):
            numbers = summary.statistics.channel_message_counts if summary.statistics else {}
            for channel in summary.channels.values():
                schema = summary.schemas.get(channel.schema_id)
                kinds[channel.topic] = _ros2_name(schema.name) if schema else ""
                counts[channel.topic] += numbers.get(channel.id, 0)
        wanted = [topic for topic, kind in kinds.items() if _is_wanted(topic, kind, given)]
        decoder = cache(partial(_decoder, path))

        def decoded() -> Iterator[tuple[str, int, Any]]:
            for schema, channel, message in (one for each in readers for one in each.iter_messages(topics=wanted)):
                decode = decoder(channel.message_encoding, kinds[channel.topic], schema.data if schema else b"")
                yield channel.topic, message.log_time, decode(message.data)

        return _bag_of(path, kinds, counts, decoded())


def _decoder(path: Path, encoding: str, kind: str, schema: bytes) -> Callable[[bytes], Any]:
    if encoding == "json":
        return lambda data: json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
    try:
        typesys: Any = importlib.import_module("rosbags.typesys")
    except ImportError:
        raise BagError(
            f"{path} has messages in '{encoding}'; rosbags reads them: pip install 'wam_stack[rosbags]'"
        ) from (None)
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_msg(schema.decode(), kind))
    take = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    return lambda data: take(data, kind)


def _ros2_name(kind: str) -> str:
    """The name of a type of ROS 1 as ROS 2 has it."""
    package, slash, name = kind.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else kind


def _bag_of(path: Path, kinds: dict[str, str], counts: dict[str, int], read: Iterable[tuple[str, int, Any]]) -> Bag:
    """A bag of topic, time and message of each message that another reader yields."""
    times: dict[str, list[int]] = {}
    found: dict[str, list[Any]] = {}
    for topic, time, message in read:
        times.setdefault(topic, []).append(time)
        found.setdefault(topic, []).append(message)
    topics: dict[str, Any] = {name: Messages(np.array(times[name], np.int64), found[name]) for name in found}
    return Bag(path, topics, kinds, {}, {}, counts)


# to columns


def _mapped(topic: str, kind: str, columns: Any, given: TopicMap) -> Iterable[tuple[str, JointColumns | WrenchColumns]]:
    """The columns of a topic by name, scaled; those of a controller's state are two: feedback and reference."""
    if isinstance(columns, (JointColumns, WrenchColumns)):
        _refuse_other_fields(topic, kind, given)
    if isinstance(columns, JointColumns):
        named = [given.fields.get(q, q) for q in IN_JOINTS]
        if bad := next((field for field in named if field not in IN_JOINTS), ""):
            raise ValueError(f"{topic} has no field '{bad}'; it has {', '.join(IN_JOINTS)}")
        p, v, e = (given.scaled(q)[0] * getattr(columns, field) for q, field in zip(IN_JOINTS, named, strict=True))
        names = columns.names
        if UNNAMED in columns.irregular and len(given.joints) == len(names):
            names = given.joints
        yield topic, columns._replace(names=names, position=p, velocity=v, effort=e)
    elif isinstance(columns, WrenchColumns):
        force, torque = (given.scaled(q)[0] for q in ("force", "torque"))
        yield topic, columns._replace(force=force * columns.force, torque=torque * columns.torque)
    elif len(columns.log_time_ns) and kind == CONTROLLER and not given.fields:
        for suffix, names in CONTROLLER_PARTS.items():
            part = next((name for name in names if hasattr(columns.messages[0], name)), names[0])
            parts = {"name": "joint_names", "position": f"{part}.positions", "velocity": f"{part}.velocities"}
            yield topic + suffix, _joints(topic, columns, parts, given)
    elif len(columns.log_time_ns):
        known = {JOINTS: JOINT_FIELDS, WRENCH: WRENCH_FIELDS}.get(kind, {}) | dict(given.fields)
        if not known:
            raise ValueError(f"{topic} is of type {kind}; name its fields, for example --map position=FIELD")
        has_joints, has_wrench = any(q in known for q in IN_JOINTS), "force" in known or "torque" in known
        if has_joints:
            yield topic, _joints(topic, columns, known, given)
        if has_wrench:
            yield f"{topic} wrench" if has_joints else topic, _wrench(topic, columns, known, given)


def _refuse_other_fields(topic: str, kind: str, given: TopicMap) -> None:
    """Refuse a map of what a known type has in one place only; position, velocity and effort may be exchanged."""
    if "stamp" in given.units:
        raise ValueError(TIME_OF_ROS.format(topic))
    fields = {"stamp": "header.stamp"} | (JOINT_FIELDS if kind == JOINTS else WRENCH_FIELDS)
    for quantity, field in fields.items():
        if quantity not in IN_JOINTS and given.fields.get(quantity, field) != field:
            raise ValueError(f"{topic} is of type {kind}; its {quantity} is '{field}', not '{given.fields[quantity]}'")


def _at(topic: str, message: Any, path: str) -> Any:
    """What a path names in a message; of a list the path goes into each of its elements."""
    value = message
    for part in path.split("."):
        try:
            value = [getattr(one, part) for one in value] if isinstance(value, list) else getattr(value, part)
        except AttributeError:
            fields = ", ".join(name for name in getattr(message, "__dict__", {}) or getattr(message, "__slots__", ()))
            raise ValueError(f"{topic} has no field '{path}'; its messages have {fields}") from None
    return value


def _times(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> Times:
    """Stamps of the messages, ns; times of reception where they have none."""
    path = fields.get("stamp", "header.stamp")
    if "stamp" not in fields and not hasattr(columns.messages[0], "header"):
        return columns.log_time_ns
    if "," in path:
        seconds, parts = (np.array(_integers(topic, columns, field), np.int64) for field in path.split(",", 1))
        return BILLION * seconds + parts
    stamps = [_at(topic, message, path) for message in columns.messages]
    has_unit = "stamp" in given.units
    if hasattr(stamps[0], "sec"):
        if has_unit:
            raise ValueError(TIME_OF_ROS.format(topic))
        nanoseconds = [getattr(one, "nanosec", getattr(one, "nsec", 0)) for one in stamps]
        return np.array([int(one.sec) * BILLION + int(ns) for one, ns in zip(stamps, nanoseconds, strict=True)])
    try:
        is_ns = not has_unit and all(isinstance(one, Integral) for one in stamps) and min(stamps) > STREAM.seconds
        factor = BILLION * given.scaled("stamp")[0]
        found = np.array([one if is_ns else round(float(one) * factor) for one in stamps], np.int64)
    except (TypeError, ValueError, OverflowError):
        unit = "" if has_unit else "; if it is a number not in s, give --unit stamp=UNIT: ms, us, ns or a factor"
        raise ValueError(f"{topic}: the field '{path}' has no times{unit}") from None
    if not (has_unit or is_ns):
        _refuse_other_pace(topic, path, found, columns.log_time_ns)
    return found


def _integers(topic: str, columns: Messages, path: str) -> list[int]:
    return [int(row[0]) for row in _numbers(topic, columns, path)]


def _refuse_other_pace(topic: str, path: str, stamps: Times, received: Times) -> None:
    """Refuse numbers as seconds where the receptions show that they are others."""
    took, numbers = np.ptp(received) / 1e9, np.ptp(stamps) / 1e9
    if took > 0.0 and numbers > STREAM.faster * took:
        nearest = min(("ms", "us", "ns"), key=lambda unit: abs(math.log(UNITS[unit][0] * numbers / took)))
        raise ValueError(
            f"{topic}: the field '{path}' increases by {shown(numbers)} within {shown(took, 's')}, so it is "
            f"not in s; give --unit stamp={nearest}, or another one of s, ms, us, ns or a factor"
        )


def _frames(columns: Messages) -> Texts:
    heads = [getattr(message, "header", None) for message in columns.messages]
    return np.array([str(getattr(head, "frame_id", "")).removeprefix("/") for head in heads], object)


def _numbers(topic: str, columns: Messages, path: str) -> list[Numbers]:
    """The numbers at a path in each message; those of a vector are x, y, z."""
    found = []
    for message in columns.messages:
        value = _at(topic, message, path)
        value = [value.x, value.y, value.z] if hasattr(value, "x") else value
        try:
            found.append(np.atleast_1d(np.asarray(value, np.float64)).ravel())
        except (TypeError, ValueError):
            raise ValueError(f"{topic}: the field '{path}' has no numbers") from None
    return found


def _joints(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> JointColumns:
    taken = {q: _numbers(topic, columns, fields[q]) for q in IN_JOINTS if q in fields}
    times, frames = _times(topic, columns, fields, given), _frames(columns)
    alike: dict[Any, list[int]] = {}  # rows by frame, names and lengths of the fields
    for k, message in enumerate(columns.messages):
        names = tuple(_at(topic, message, fields["name"])) if "name" in fields else ()
        widths = tuple(len(taken[q][k]) if q in taken else 0 for q in IN_JOINTS)
        if not names and len(given.joints) == max(widths):
            names = given.joints
        alike.setdefault((frames[k], names, widths), []).append(k)
    groups = []
    for (frame, names, _), rows in alike.items():
        values = [
            given.scaled(q)[0] * np.array([taken[q][k] if q in taken else () for k in rows], np.float64)
            for q in IN_JOINTS
        ]
        groups.append((np.array(rows), (times[rows], frame, names, values)))
    found = joint_columns(columns.log_time_ns, groups)
    return found if "name" in fields else found._replace(irregular={})


def _wrench(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> WrenchColumns:
    parts = []
    for quantity in ("force", "torque"):
        values = np.zeros((len(columns.messages), 3))
        for k, row in enumerate(_numbers(topic, columns, fields[quantity]) if quantity in fields else ()):
            part = row[3:] if quantity == "torque" and len(row) == 6 else row[:3]
            values[k, : len(part)] = part
        parts.append(given.scaled(quantity)[0] * values)
    return WrenchColumns(columns.log_time_ns, _times(topic, columns, fields, given), _frames(columns), *parts)
