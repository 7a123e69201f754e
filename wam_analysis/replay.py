"""Recorded inputs through the same machine again, its outputs against the recorded ones, without ROS.

In lockstep the outputs are the same bit for bit as long as machine and parameters are; a changed one is
judged by what it makes of old recordings.  In realtime a node took what was newest when it worked, which
a recording knows only roughly: there the differences are counted and measured.

Compared are the topics of numbers; in_contact, hypotheses and markers follow from the same estimate.
"""

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from wam_analysis.bag import Bag, BagError, Columns, JointColumns, PointColumns, WrenchColumns, read
from wam_analysis.bag_file import mode_of
from wam_analysis.direct import Row
from wam_analysis.replay_wirings import WIRINGS, WITH_STAMP, Step
from wam_description.arm import Shared, seconds
from wam_description.configuration import PARAMETERS, Configuration
from wam_description.parameters import ParameterError, build_part, flatten
from wam_description.signals import State
from wam_ros.bag_losses import PARAMETERS as ATTACHED
from wam_ros.bag_losses import losses
from wam_ros.lockstep import Gate
from wam_ros.topics import BY_NAME

_AXES = ("x", "y", "z")


class Difference(NamedTuple):
    """Where replayed and recorded first differ."""

    stamp: int  # ns
    field: str
    recorded: float | str
    replayed: float | str


class Compared(NamedTuple):
    """One topic: messages on both sides, those that differ, the first of them and the largest difference.

    `unit` is that of the largest difference; `alone` the stamp (ns) of the first message that was only recorded,
    None where there is none.
    """

    topic: str
    compared: int
    only_recorded: int
    only_replayed: int
    different: int
    first: Difference | None
    largest: float
    unit: str
    alone: int | None

    @property
    def is_same(self) -> bool:
        """Whether there is no difference at all."""
        return not (self.only_recorded or self.only_replayed or self.different)


class Gap(NamedTuple):
    """Stamps of an input between which messages are missing, ns, and how many periods that are."""

    topic: str
    begin: int
    end: int
    missing: int


class Replay(NamedTuple):
    """A replay: mode of the recording, how each topic of the node came out, gaps in its inputs, what the bag lacks."""

    node: str
    mode: str
    topics: tuple[Compared, ...]
    gaps: tuple[Gap, ...]
    lost: tuple[str, ...]

    @property
    def is_same(self) -> bool:
        """Whether every topic is the same bit for bit."""
        return all(topic.is_same for topic in self.topics)


def replay(path: str | Path, node: str, configuration: Configuration | None = None) -> Replay:
    """Feed the recorded inputs of a node through its machine and compare what comes out.

    Parameters
    ----------
    path : bag; of several arms in it the first is taken.
    node : one of `WIRINGS`.
    configuration : values to use instead of those in the bag.

    Raises
    ------
    BagError
        where the bag has not what is needed.
    ParameterError
        where the values do not fit, or the node is none that can be replayed.
    """
    if node not in WIRINGS:
        raise ParameterError(f"no node '{node}' can be replayed; nodes: {', '.join(WIRINGS)}")
    outputs = tuple(topic.name for topic in BY_NAME.values() if node in topic.publisher and topic.name in _COMPARED)
    inputs = [topic.name for topic in BY_NAME.values() if node in topic.subscribers and _is_numbers(topic.type)]
    bag = read(path, [*inputs, *outputs], may_lack=True)
    namespace = _namespace(bag, node, [*inputs, *outputs])
    shared, own = _parameters(bag, namespace, node, configuration)
    steps = WIRINGS[node].steps(shared, own)
    missing = [step.trigger for step in steps if f"{namespace}/{step.trigger}" not in bag.topics]
    if missing:
        raise BagError(f"{path} lacks the topic {missing[0]}, without which {node} does nothing")
    said = _run(bag, namespace, shared, steps, inputs)
    names = {"joint": list(shared.arm.joints.names), "motor": list(shared.arm.motors.names)}
    compared = []
    for topic in outputs:
        columns = bag.topics.get(f"{namespace}/{topic}")
        recorded = _rows(columns, names[_side(topic)]) if columns is not None else []
        compared.append(_compare(topic, recorded, said.get(topic, []), names[_side(topic)], _units(topic, columns)))
    mode = mode_of(bag.metadata, bag.attachments.get(ATTACHED))
    mode = shared.timing.mode if mode == "unknown" else mode
    gaps = tuple(gap for topic in inputs for gap in _gaps(topic, bag.topics.get(f"{namespace}/{topic}")))
    lost = losses(bag.path, bag.metadata, bag.attachments, bag.counts).said(bag.first_ns)
    return Replay(node, mode, tuple(compared), gaps, tuple(lost))


def _gaps(topic: str, columns: Columns | None) -> list[Gap]:
    """Where stamps are further apart than a period, which is their median distance."""
    if not isinstance(columns, JointColumns | WrenchColumns | PointColumns) or len(columns.stamp_ns) < 3:
        return []
    steps = np.diff(columns.stamp_ns)
    period = max(int(np.median(steps)), 1)
    missing = np.rint(steps / period).astype(int) - 1
    return [
        Gap(topic, int(columns.stamp_ns[i]), int(columns.stamp_ns[i + 1]), int(missing[i]))
        for i in np.flatnonzero(missing > 0)
    ]


def _is_numbers(kind: str) -> bool:
    return kind.endswith(("/JointState", "/WrenchStamped", "/PointStamped"))


_COMPARED = frozenset(name for name, topic in BY_NAME.items() if _is_numbers(topic.type))


def _side(topic: str) -> str:
    return "motor" if topic.startswith("motor") else "joint"


def _namespace(bag: Bag, node: str, names: Sequence[str]) -> str:
    for topic in bag.topics:
        for name in names:
            if topic.endswith(f"/{name}"):
                return topic.removesuffix(f"/{name}")
    raise BagError(f"{bag.path} has no topic of the node {node}; it has no arm, or another one recorded it")


def _parameters(bag: Bag, namespace: str, node: str, configuration: Configuration | None) -> tuple[Shared, Any]:
    kind = WIRINGS[node].parameters
    if configuration is not None:
        return configuration.shared, configuration.node(node, kind)
    attached = bag.attachments.get(ATTACHED)
    if attached is None:
        raise BagError(f"{bag.path} has no parameters in it; give a configuration with --config")
    try:
        flat = flatten(yaml.safe_load(attached)[f"{namespace}/{node}"][PARAMETERS])
    except (yaml.YAMLError, LookupError, TypeError) as error:
        raise BagError(
            f"{bag.path} has no parameters of {namespace}/{node} ({error}); give a configuration with --config"
        ) from None
    try:
        return build_part(Shared, flat), build_part(kind, flat)
    except ParameterError as error:
        raise ParameterError(f"{bag.path}, parameters of {node}: {error}; give a configuration with --config") from None


def _run(
    bag: Bag, namespace: str, shared: Shared, steps: Sequence[Step], inputs: Sequence[str]
) -> dict[str, list[Row]]:
    gates = [(step, Gate(shared.timing, step.trigger, step.needs), [0]) for step in steps]
    names = {"joint": list(shared.arm.joints.names), "motor": list(shared.arm.motors.names)}
    said: dict[str, list[Row]] = {}
    for topic, stamp, value in _messages(bag, namespace, inputs, names):
        for step, gate, last in gates:
            if topic != step.trigger and topic not in step.needs:
                continue
            for at, taken in gate.put(topic, stamp, value):
                period = shared.timing.outer_period_ns if step.trigger == "joint_states" else shared.timing.period_ns
                dt = at - last[0] if last[0] else period
                last[0] = at
                for name, (numbers, frame) in step.work(at, seconds(dt), taken).items():
                    said.setdefault(name, []).append(Row(at, tuple(numbers), frame))
    return said


def _messages(
    bag: Bag, namespace: str, inputs: Sequence[str], names: Mapping[str, list[str]]
) -> Iterator[tuple[str, int, Any]]:
    """Topic, stamp and value of every input in the order in which they came."""
    found: list[tuple[int, int, str, int, Any]] = []
    for topic in inputs:
        columns = bag.topics.get(f"{namespace}/{topic}")
        if not isinstance(columns, JointColumns | WrenchColumns | PointColumns):
            continue
        values = _values(columns, names[_side(topic)])
        times = columns.log_time_ns.tolist()
        for stamp, time, value in zip(columns.stamp_ns.tolist(), times, values, strict=True):
            found.append((time, len(found), topic, stamp, (stamp, value) if topic in WITH_STAMP else value))
    for _, _, topic, stamp, value in sorted(found, key=lambda item: item[:2]):
        yield topic, stamp, value


def _values(columns: Columns, names: Sequence[str]) -> list[Any]:
    if isinstance(columns, JointColumns):
        arrays = [_array(columns, field, names) for field in State._fields]
        return [State(*rows) for rows in zip(*arrays, strict=True)]
    if isinstance(columns, WrenchColumns):
        forces, torques = columns.force.tolist(), columns.torque.tolist()
        return [(f, tuple(a), tuple(b)) for f, a, b in zip(columns.frames, forces, torques, strict=True)]
    assert isinstance(columns, PointColumns)
    return columns.point.tolist()


def _array(columns: JointColumns, field: str, names: Sequence[str]) -> list[list[float]]:
    """Numbers of each message in the order of `names`; empty where the message has none."""
    array = getattr(columns, field)
    if not array.shape[1]:
        return [[] for _ in range(len(array))]
    if set(columns.names) != set(names):
        raise BagError(f"recorded are {', '.join(columns.names)}; the configuration has {', '.join(names)}")
    ordered = array[:, [columns.names.index(name) for name in names]]
    return [[] if math.isnan(row[0]) else row for row in ordered.tolist()]


def _rows(columns: Columns, names: Sequence[str]) -> list[Row]:
    """Recorded messages as a machine says them."""
    assert isinstance(columns, JointColumns | WrenchColumns | PointColumns)
    stamps = columns.stamp_ns.tolist()
    if isinstance(columns, JointColumns):
        states = _values(columns, names)
        return [Row(stamp, (*s.position, *s.velocity, *s.effort)) for stamp, s in zip(stamps, states, strict=True)]
    if isinstance(columns, WrenchColumns):
        wrenches = _values(columns, names)
        return [Row(stamp, (*f, *t), frame) for stamp, (frame, f, t) in zip(stamps, wrenches, strict=True)]
    points = zip(stamps, columns.point.tolist(), columns.frames, strict=True)
    return [Row(stamp, tuple(point), frame) for stamp, point, frame in points]


def _compare(
    topic: str, recorded: Sequence[Row], replayed: Sequence[Row], names: Sequence[str], units: Sequence[str]
) -> Compared:
    known = {row.stamp: row for row in replayed}
    both = [(row, known[row.stamp]) for row in recorded if row.stamp in known]
    first, different, largest, unit = None, 0, 0.0, ""
    for old, new in both:
        difference = _difference(topic, old, new, names)
        if difference is None:
            continue
        different += 1
        first = first or difference
        if len(old.values) == len(new.values):
            gaps = [abs(a - b) for a, b in zip(old.values, new.values, strict=True)]
            for i, gap in enumerate(gaps):
                if math.isfinite(gap) and gap > largest:
                    largest, unit = gap, units[i] if len(units) == len(gaps) else ""
    missing = len(recorded) - len(both)
    alone = next((row.stamp for row in recorded if row.stamp not in known), None)
    return Compared(topic, len(both), missing, len(replayed) - len(both), different, first, largest, unit, alone)


def _units(topic: str, columns: Columns | None) -> list[str]:
    """Unit of each number of a message."""
    if isinstance(columns, WrenchColumns):
        return ["N"] * 3 + ["N m"] * 3
    if isinstance(columns, PointColumns):
        return ["m"] * 3
    if not isinstance(columns, JointColumns):
        return []
    units = dict(zip(State._fields, ("rad", "rad/s", "A" if "current" in topic else "N m"), strict=True))
    return [unit for field, unit in units.items() for _ in range(getattr(columns, field).shape[1])]


def _difference(topic: str, old: Row, new: Row, names: Sequence[str]) -> Difference | None:
    if old.frame != new.frame:
        return Difference(old.stamp, "frame", old.frame, new.frame)
    if len(old.values) != len(new.values):
        return Difference(old.stamp, "number of values", len(old.values), len(new.values))
    for i, (a, b) in enumerate(zip(old.values, new.values, strict=True)):
        if struct.pack("d", a) != struct.pack("d", b) and not (math.isnan(a) and math.isnan(b)):
            return Difference(old.stamp, _field(topic, i, names), a, b)
    return None


def _field(topic: str, i: int, names: Sequence[str]) -> str:
    if BY_NAME[topic].type.endswith("/WrenchStamped"):
        return f"{'force' if i < 3 else 'torque'}.{_AXES[i % 3]}"
    return _AXES[i] if BY_NAME[topic].type.endswith("/PointStamped") else names[i % len(names)]
