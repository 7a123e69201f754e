"""Bags of other robots as columns of joints and wrenches: by `wam_bag`, or by rosbags where the format is another."""

import importlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from numbers import Integral
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray

from wam_analysis.findings.finding import shown
from wam_analysis.foreign.topic_map import UNITS, TopicMap
from wam_analysis.thresholds import STREAM
from wam_bag.bag import Bag, BagError, JointColumns, Messages, WrenchColumns, read
from wam_bag.contents import contents

Numbers = NDArray[np.float64]

JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
JOINT_FIELDS = {"name": "name", "position": "position", "velocity": "velocity", "effort": "effort"}
WRENCH_FIELDS = {"force": "wrench.force", "torque": "wrench.torque"}
CONTROLLER = "control_msgs/msg/JointTrajectoryControllerState"
CONTROLLER_PARTS = {"": ("feedback", "actual"), " command": ("reference", "desired")}  # suffix of the topic: names
IN_JOINTS = ("position", "velocity", "effort")
TIME_OF_ROS = "{} has stamps of ROS, in s and ns; --unit stamp is for numbers"
ROSBAGS = (".bag", ".db3")
BILLION = 1_000_000_000


def needs_rosbags(path: Path) -> bool:
    """Whether a bag is of ROS 1 or of SQLite, which rosbags reads."""
    if path.is_file():
        return path.suffix in ROSBAGS
    return any(path.glob("*.db3*"))


def foreign_bag(path: Path, given: TopicMap) -> Bag:
    """The joints and wrenches of a bag, in the units of the map.

    Raises
    ------
    BagError
        if it cannot be read, or needs rosbags, which is not installed.
    ValueError
        if a topic, joint or field of the map is not there.
    """
    if needs_rosbags(path):
        bag = _of(path, _by_rosbags(path), given)
    elif is_of_other_encoding(path):
        bag = _of(path, _by_mcap(path), given)
    else:
        listed = contents(path).topics
        chosen = [name for name, topic in listed.items() if _is_wanted(name, topic.type, given)]
        bag = read(path, chosen)
    missing = [name for name in (*given.topics, *given.commands) if name not in bag.topics]
    if missing:
        raise ValueError(f"{path} has no topic {missing[0]}; its topics: {', '.join(sorted(bag.counts)) or 'none'}")
    topics: dict[str, Any] = {}
    for name, columns in bag.topics.items():
        topics |= dict(_mapped(name, bag.types[name], columns, given))
    joints = sorted({joint for one in topics.values() if isinstance(one, JointColumns) for joint in one.names})
    if unknown := [name for name in given.joints if name not in joints]:
        raise ValueError(f"{path} has no joint {unknown[0]}; its joints: {', '.join(joints) or 'none'}")
    types = {name: JOINTS if isinstance(one, JointColumns) else WRENCH for name, one in topics.items()}
    return bag._replace(topics=topics, types=types)


def _is_wanted(topic: str, kind: str, given: TopicMap) -> bool:
    if given.topics:
        return topic in (*given.topics, *given.commands)
    return kind in (JOINTS, WRENCH, CONTROLLER) or topic in given.commands


# other formats


def _by_rosbags(path: Path) -> Callable[[Callable[[str, str], bool]], Iterator[tuple[str, str, int, Any]]]:
    try:
        highlevel: Any = importlib.import_module("rosbags.highlevel")
        typesys: Any = importlib.import_module("rosbags.typesys")
    except ImportError:
        raise BagError(f"{path} is no MCAP; rosbags reads it: pip install 'wam_stack[rosbags]'") from None

    def messages(is_wanted: Callable[[str, str], bool]) -> Iterator[tuple[str, str, int, Any]]:
        store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)  # where the bag defines no types
        try:
            with highlevel.AnyReader([path], default_typestore=store) as reader:
                some = [one for one in reader.connections if is_wanted(one.topic, one.msgtype)]
                for one in reader.connections:
                    yield one.topic, one.msgtype, 0, None
                for one, time, data in reader.messages(some) if some else ():
                    yield one.topic, one.msgtype, time, reader.deserialize(data, one.msgtype)
        except highlevel.AnyReaderError as error:
            raise BagError(f"{path} cannot be read by rosbags: {error}") from None

    return messages


def is_of_other_encoding(path: Path) -> bool:
    """Whether it is one MCAP file with messages that are not CDR: JSON, or those of ROS 1."""
    if not (path.is_file() and path.suffix == ".mcap"):
        return False
    try:
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
    except Exception:  # a broken file is explained by the reader of the stack
        return False
    return summary is not None and any(one.message_encoding in ("json", "ros1") for one in summary.channels.values())


def _by_mcap(path: Path) -> Callable[[Callable[[str, str], bool]], Iterator[tuple[str, str, int, Any]]]:
    def messages(is_wanted: Callable[[str, str], bool]) -> Iterator[tuple[str, str, int, Any]]:
        with path.open("rb") as stream:
            decoders: dict[int, Callable[[bytes], Any]] = {}
            for schema, channel, message in make_reader(stream).iter_messages():
                kind = _ros2_name(schema.name) if schema else ""
                if channel.id not in decoders:
                    yield channel.topic, kind, 0, None
                    decoders[channel.id] = _decoder(path, channel.message_encoding, kind, schema)
                if is_wanted(channel.topic, kind):
                    yield channel.topic, kind, message.log_time, decoders[channel.id](message.data)

    return messages


def _decoder(path: Path, encoding: str, kind: str, schema: Any) -> Callable[[bytes], Any]:
    if encoding == "json":
        return lambda data: json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
    try:
        typesys: Any = importlib.import_module("rosbags.typesys")
    except ImportError:
        raise BagError(
            f"{path} has messages in '{encoding}'; rosbags reads them: pip install 'wam_stack[rosbags]'"
        ) from (None)
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_msg(schema.data.decode(), kind))
    take = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    return lambda data: take(data, kind)


def _ros2_name(kind: str) -> str:
    """The name of a type of ROS 1 as ROS 2 has it."""
    package, slash, name = kind.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else kind


def _of(path: Path, messages: Any, given: TopicMap) -> Bag:
    """A bag of what another reader yields: topic, type, time and message, or no message for a topic that is there."""
    kinds: dict[str, str] = {}
    times: dict[str, list[int]] = {}
    found: dict[str, list[Any]] = {}
    for topic, kind, time, message in messages(lambda topic, kind: _is_wanted(topic, kind, given)):
        kinds[topic] = kind
        if message is not None:
            times.setdefault(topic, []).append(time)
            found.setdefault(topic, []).append(message)
    topics: dict[str, Any] = {name: Messages(np.array(times[name], np.int64), found[name]) for name in found}
    counts = {name: len(found.get(name, [])) for name in kinds}
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
        fields = [given.scaled(q)[0] * getattr(columns, field) for q, field in zip(IN_JOINTS, named, strict=True)]
        yield topic, JointColumns(*columns[:4], *fields)
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


def _times(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> NDArray[np.int64]:
    """Stamps of the messages, ns; times of reception where they have none."""
    path = fields.get("stamp", "header.stamp")
    if "stamp" not in fields and not hasattr(columns.messages[0], "header"):
        return columns.log_time_ns
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
        unit = "" if has_unit else "; of a number in other than s, --unit stamp=UNIT names it: ms, us, ns or a factor"
        raise ValueError(f"{topic}: the field '{path}' has no times{unit}") from None
    if not (has_unit or is_ns):
        _refuse_other_pace(topic, path, found, columns.log_time_ns)
    return found


def _refuse_other_pace(topic: str, path: str, stamps: NDArray[np.int64], received: NDArray[np.int64]) -> None:
    """Refuse numbers as seconds where the receptions show that they are others."""
    took, numbers = np.ptp(received) / 1e9, np.ptp(stamps) / 1e9
    if took > 0.0 and numbers > STREAM.faster * took:
        nearest = min(("ms", "us", "ns"), key=lambda unit: abs(math.log(UNITS[unit][0] * numbers / took)))
        raise ValueError(
            f"{topic}: the field '{path}' goes on by {shown(numbers)} while {shown(took, 's')} were recorded, so it is "
            f"not in s; give --unit stamp={nearest}, or another one of s, ms, us, ns or a factor"
        )


def _frames(columns: Messages) -> NDArray[np.object_]:
    heads = [getattr(message, "header", None) for message in columns.messages]
    return np.array([str(getattr(head, "frame_id", "")) for head in heads], object)


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
    most = max(len(row) for rows in taken.values() for row in rows)
    unnamed = list(given.joints) if len(given.joints) == most else [f"joint{i + 1}" for i in range(most)]
    named = [list(_at(topic, m, fields["name"])) for m in columns.messages] if "name" in fields else []
    own = [names or unnamed for names in named] if named else [unnamed] * len(columns.messages)
    names = tuple(dict.fromkeys(name for some in {tuple(some): None for some in own} for name in some))
    place = {name: i for i, name in enumerate(names)}
    arrays = []
    for quantity in IN_JOINTS:
        rows = taken.get(quantity, [])
        array = np.full((len(columns.messages), len(names) if any(map(len, rows)) else 0), np.nan)
        for k, (some, row) in enumerate(zip(own, rows, strict=False)):
            for name, value in zip(some, row, strict=False):
                array[k, place[name]] = value
        arrays.append(given.scaled(quantity)[0] * array)
    return JointColumns(columns.log_time_ns, _times(topic, columns, fields, given), _frames(columns), names, *arrays)


def _wrench(topic: str, columns: Messages, fields: Mapping[str, str], given: TopicMap) -> WrenchColumns:
    parts = []
    for quantity in ("force", "torque"):
        values = np.zeros((len(columns.messages), 3))
        for k, row in enumerate(_numbers(topic, columns, fields[quantity]) if quantity in fields else ()):
            part = row[3:] if quantity == "torque" and len(row) == 6 else row[:3]
            values[k, : len(part)] = part
        parts.append(given.scaled(quantity)[0] * values)
    return WrenchColumns(columns.log_time_ns, _times(topic, columns, fields, given), _frames(columns), *parts)
