"""Recorded inputs through a node again, its outputs compared with the recorded ones, without ROS.

In lockstep the outputs are equal bit for bit as long as node and parameters are; a changed node is
evaluated by its outputs for old recordings.  In realtime a node took the newest inputs when it worked,
which a recording knows only roughly: there the differences are counted and measured.

Topics of numbers are compared; in_contact and markers follow from the same estimate.
"""

import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wam_bag.bag import Bag, BagError, Columns, JointColumns, Messages, PointColumns, TableColumns, WrenchColumns, read
from wam_bag.losses import losses
from wam_description.arm import Shared
from wam_description.configuration import Configuration
from wam_description.interface import Interface, declared
from wam_description.nodes import NODES
from wam_description.parameters import ParameterError, build_part
from wam_description.parameters import values as values_of
from wam_description.signals import PathPoint, Point, PosturePath, State, Table, Wrench
from wam_description.synchroniser import Inputs
from wam_description.topics import BY_NAME, POINT, STATUS, TABLE, TRAJECTORY, WRENCH, Topic
from wam_description.wiring import Declaration, Outputs
from wam_sim.bus import Bus, TopicValue, flat
from wam_sim.recording import RecordedRun, recorded_run

_AXES = ("x", "y", "z")
NOTHING: Mapping[str, Any] = {}
Numbers = JointColumns | WrenchColumns | PointColumns | TableColumns


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


class Change(NamedTuple):
    """Parameters that a node takes after its step of a stamp, ns, and by which of its methods."""

    after: int
    method: str
    parameters: Any


class Gap(NamedTuple):
    """Stamps of an input between which messages are missing, ns, and how many periods that are."""

    topic: str
    begin: int
    end: int
    missing: int


class ChangedValue(NamedTuple):
    """A parameter, as --set names it, that the replay has with another value than the recording."""

    name: str
    recorded: Any
    used: Any


class Replay(NamedTuple):
    """A replay: mode of the recording, how each topic of the node came out, gaps in its inputs, what the bag lacks.

    `changed` are the parameters of the node that a configuration has otherwise than the recording, its own first,
    `others` a sentence about other arms in the bag.
    """

    node: str
    mode: str
    topics: tuple[Compared, ...]
    gaps: tuple[Gap, ...]
    lost: tuple[str, ...]
    changed: tuple[ChangedValue, ...] = ()
    others: str = ""

    @property
    def is_same(self) -> bool:
        """Whether every topic is the same bit for bit."""
        return all(topic.is_same for topic in self.topics)


OF_THE_RUN = ("timing.real_time_factor", "timing.timeout")  # no node computes with them
REPLAYED = tuple(name for name in NODES if name not in ("driver", "scenario", "recorder"))


def replay(
    path: str | Path,
    node: str,
    configuration: Configuration | None = None,
    values: Mapping[str, Any] = NOTHING,
    namespace: str = "",
) -> Replay:
    """Feed the recorded inputs of a node through it and compare its outputs with the recorded ones.

    The driver and the scenario are enabled, paused and answered by services, which no bag holds:
    they cannot be replayed.

    Parameters
    ----------
    path : bag.
    node : one of `REPLAYED`, or 'module:Class' of a node of your own.
    configuration : values to use instead of those in the bag; `nodes`, who runs, remains that of the bag.
    values : to be replaced among those in the bag, by 'node:parameter' or the name of a shared parameter.
    namespace : of the arm, as for `recorded_run`.

    Raises
    ------
    BagError
        where the bag lacks what is needed.
    ParameterError
        where the values do not fit, or the node cannot be replayed.
    """
    if node not in REPLAYED and ":" not in node:
        raise ParameterError(f"node '{node}' cannot be replayed; nodes: {', '.join(REPLAYED)}")
    declaration = declared(node)
    rows = {**BY_NAME, **{topic.name: topic for topic in declaration.topics}}
    outputs = [topic for topic in declaration.outputs if rows[topic].is_numbers]
    inputs = [topic for topic in declaration.inputs if rows[topic].is_replayed]
    bag = read(path, [*inputs, *outputs, STATUS], may_lack=True)
    if not any(name.endswith(f"/{topic}") for name in bag.topics for topic in (*inputs, *outputs)):
        raise BagError(f"{bag.path} has no topic of the node {node}; it has no arm, or another one recorded it")
    run = recorded_run(bag, namespace)
    run = run._replace(parameters=run.parameters.with_options(values))
    namespace = run.namespace
    _require_types(bag, namespace, [rows[topic] for topic in (*inputs, *outputs)])
    shared, own = _parameters(run, declaration, configuration)
    triggers = [reaction.trigger.topic for reaction in declaration.reactions]
    missing = [trigger for trigger in triggers if f"{namespace}/{trigger}" not in bag.topics]
    if missing:
        raise BagError(f"{path} lacks the topic {missing[0]}, without which {declaration.name} does nothing")
    present = (
        configuration.sections.get(declaration.name, {}) if configuration else run.parameters.nodes[declaration.name]
    )
    changes, lost_changes = _changes(run, shared, declaration, present)
    published = _run(bag, namespace, shared, declaration, own, changes)
    names = _names(shared)
    compared = []
    for topic in outputs:
        columns = bag.topics.get(f"{namespace}/{topic}")
        order = names.get(rows[topic].side, [])
        recorded = _rows(rows[topic], columns, order) if columns is not None else []
        compared.append(_compare(rows[topic], recorded, published.get(topic, []), order, _units(topic, columns)))
    if not any(topic.compared or topic.only_recorded or topic.only_replayed for topic in compared):
        raise BagError(
            f"{path}: {declaration.name} publishes nothing from what is recorded, and no message of it is there: "
            "nothing to compare; a bag of the stack's recorder with all topics can be replayed"
        )
    mode = shared.timing.mode if run.mode == "unknown" else run.mode
    gaps = tuple(gap for topic in inputs for gap in _gaps(topic, bag.topics.get(f"{namespace}/{topic}")))
    lost = losses(bag.path, bag.metadata, bag.attachments, bag.counts).sentences(bag.first_ns)
    changed = _changed_values(run, declaration, shared, own) if configuration else ()
    return Replay(declaration.name, mode, tuple(compared), gaps, (*lost, *lost_changes), changed, run.others)


def _require_types(bag: Bag, namespace: str, topics: Sequence[Topic]) -> None:
    """Refuse a bag in which a topic has another type than now: it would be missing without a word."""
    for topic in topics:
        name = f"{namespace}/{topic.name}"
        if (recorded := bag.types.get(name, topic.type)) != topic.type:
            raise BagError(
                f"{bag.path}: {name} was recorded as {recorded}; this version has it as {topic.type}: replay "
                "the bag with the version that recorded it"
            )


def _gaps(topic: str, columns: Columns | None) -> list[Gap]:
    """Where stamps are further apart than a period, which is their median distance."""
    if not isinstance(columns, Numbers) or len(columns.stamp_ns) < 3:
        return []
    steps = np.diff(columns.stamp_ns)
    period = max(int(np.median(steps)), 1)
    missing = np.rint(steps / period).astype(int) - 1
    return [
        Gap(topic, int(columns.stamp_ns[i]), int(columns.stamp_ns[i + 1]), int(missing[i]))
        for i in np.flatnonzero(missing > 0)
    ]


def _parameters(run: RecordedRun, declaration: Declaration, configuration: Configuration | None) -> tuple[Shared, Any]:
    """Shared and own parameters of the node, as recorded or from a configuration; who ran is always as recorded."""
    node, kind = declaration.name, declaration.parameter_class
    if configuration is not None:
        shared = configuration.shared
        if run.parameters.nodes:
            shared = replace(shared, nodes=run.parameters.shared.nodes)
        return shared, configuration.node(node, kind)
    try:
        return run.parameters.shared, run.parameters.part(node, kind)
    except BagError as error:
        raise BagError(f"{error}; give a configuration with --config") from None


def _changed_values(run: RecordedRun, declaration: Declaration, shared: Shared, own: Any) -> tuple[ChangedValue, ...]:
    """What a configuration changes, as far as the bag has parameters of the node."""
    if declaration.name not in run.parameters.nodes:
        return ()
    was_shared, was = _parameters(run, declaration, None)
    both = ((f"{declaration.name}:", was, own), ("", was_shared, shared))
    return tuple(
        ChangedValue(prefix + name, before, after)
        for prefix, old, new in both
        for (name, before), after in zip(values_of(old).items(), values_of(new).values(), strict=True)
        if before != after and name not in OF_THE_RUN
    )


def _changes(
    run: RecordedRun, shared: Shared, declaration: Declaration, values: Mapping[str, Any]
) -> tuple[list[Change], tuple[str, ...]]:
    """What the node took while it ran, as it reported it or as a scenario set it, and what is lost of that."""
    prefix, present, found = f"{declaration.name}:", dict(values), []
    reported = run.changes(declaration.name)
    steps = () if reported else (*run.steps, *([run.unfinished] if run.unfinished else []))
    given = [(one.after, one.settings) for one in reported] + [(step.begin - 1, step.settings) for step in steps]
    group = declaration.shared_group
    for after, settings in given:
        mine = {key.removeprefix(prefix): value for key, value in settings.items() if key.startswith(prefix)}
        if not mine:
            continue
        present |= mine
        if any(not group or not name.startswith(f"{group}.") for name in mine):
            found.append(Change(after, "tune", build_part(declaration.parameter_class, present)))
        if group and any(name.startswith(f"{group}.") for name in mine):
            found.append(Change(after, "retune", build_part(type(getattr(shared, group)), present, f"{group}.")))
    numbers = [one.number for one in reported]
    lost = sum(max(b - a - 1, 0) for a, b in pairwise(numbers))
    return found, ((f"{lost} changes of parameters of {declaration.name} are not in the bag",) if lost else ())


def _run(
    bag: Bag,
    namespace: str,
    shared: Shared,
    declaration: Declaration,
    own: Any,
    changes: list[Change],
) -> dict[str, list[TopicValue]]:
    interface, node = Interface(shared, started_by_hand=declaration), declaration.make(shared, own)
    for item in (item for reaction in declaration.reactions for item in reaction.inputs):
        if item.age == "command" and f"{namespace}/{item.topic}" not in bag.topics:
            interface.topics.pop(item.topic, None)  # the scenario that was recorded did not have this command

    def changing(work: Callable[[Inputs], Outputs]) -> Callable[[Inputs], Outputs]:
        def step(inputs: Inputs) -> Outputs:
            while changes and changes[0].after < inputs.stamp:
                change = changes.pop(0)
                getattr(node, change.method)(change.parameters)
            return work(inputs)

        return step

    feeds = {
        topic: [feed._replace(work=changing(feed.work)) for feed in found]
        for topic, found in interface.feeds(declaration, node).items()
    }
    bus = Bus({name: interface.topics[name] for name in declaration.outputs if name in interface.topics})
    bus.connect(declaration, feeds, interface.checks(declaration))
    recorded = [interface.topics[topic] for topic in feeds if topic not in declaration.outputs]
    for topic, stamp, value in _messages(bag, namespace, recorded, shared):
        bus.publish(topic, stamp, value)
    return bus.rows


def _messages(bag: Bag, namespace: str, inputs: Sequence[Topic], shared: Shared) -> Iterator[tuple[str, int, Any]]:
    """Topic, stamp and value of every input in the order in which they came."""
    names = _names(shared)
    found: list[tuple[int, int, str, int, Any]] = []
    for topic in inputs:
        columns = bag.topics.get(f"{namespace}/{topic.name}")
        if isinstance(columns, Messages) and topic.type == TRAJECTORY:
            for time, message in zip(columns.log_time_ns.tolist(), columns.messages, strict=True):
                stamp = message.header.stamp
                value = _trajectory(message, names["joints"])
                found.append((time, len(found), topic.name, stamp.sec * 1_000_000_000 + stamp.nanosec, value))
        if not isinstance(columns, Numbers):
            continue
        values = _values(columns, names.get(topic.side, []))
        times = columns.log_time_ns.tolist()
        for stamp, time, value in zip(columns.stamp_ns.tolist(), times, values, strict=True):
            found.append((time, len(found), topic.name, stamp, value))
    for _, _, name, stamp, value in sorted(found, key=lambda item: item[:2]):
        yield name, stamp, value


def _names(shared: Shared) -> dict[str, list[str]]:
    """Names by side, in the order in which a JointState's arrays are compared."""
    return {"joints": list(shared.arm.joints.names), "motors": list(shared.arm.motors.names)}


def _trajectory(message: Any, names: Sequence[str]) -> PosturePath:
    """A recorded trajectory; one that the node refused has no points."""
    if sorted(message.joint_names) != sorted(names):
        return PosturePath(())
    order = [list(message.joint_names).index(name) for name in names]
    points = []
    for point in message.points:
        position, velocity = (
            tuple(float(values[i]) for i in order) if len(values) == len(order) else ()
            for values in (point.positions, point.velocities)
        )
        time = point.time_from_start
        points.append(PathPoint(position, velocity, time.sec + time.nanosec * 1e-9))
    return PosturePath(tuple(points))


def _values(columns: Columns, names: Sequence[str]) -> list[Any]:
    if isinstance(columns, JointColumns):
        arrays = [_array(columns, field, names) for field in State._fields]
        return [State(*rows) for rows in zip(*arrays, strict=True)]
    if isinstance(columns, WrenchColumns):
        forces, torques = columns.force.tolist(), columns.torque.tolist()
        return [Wrench(f, tuple(a), tuple(b)) for f, a, b in zip(columns.frames, forces, torques, strict=True)]
    if isinstance(columns, TableColumns):
        return tables(columns)
    assert isinstance(columns, PointColumns)
    return [Point(f, tuple(p)) for f, p in zip(columns.frames, columns.point.tolist(), strict=True)]


def tables(columns: TableColumns) -> list[Table]:
    """The table of each recorded message; all its columns in the order in which they were recorded."""
    rows: list[list[tuple[float, ...]]] = [[] for _ in columns.stamp_ns]
    numbers = [column.tolist() for column in columns.columns.values()]
    for message, row in zip(columns.message.tolist(), zip(*numbers, strict=True), strict=True):
        rows[message].append(row)
    return [Table(frame, tuple(found)) for frame, found in zip(columns.frames, rows, strict=True)]


def _array(columns: JointColumns, field: str, names: Sequence[str]) -> list[list[float]]:
    """Numbers of each message in the order of `names`; empty where the message has none."""
    array = getattr(columns, field)
    if not array.shape[1]:
        return [[] for _ in range(len(array))]
    if set(columns.names) != set(names):
        raise BagError(f"recorded are {', '.join(columns.names)}; the configuration has {', '.join(names)}")
    ordered = array[:, [columns.names.index(name) for name in names]]
    return [[] if math.isnan(row[0]) else row for row in ordered.tolist()]


def _rows(topic: Topic, columns: Columns, names: Sequence[str]) -> list[TopicValue]:
    """Recorded messages as the simulation keeps them."""
    assert isinstance(columns, Numbers)
    values = _values(columns, names)
    return [flat(topic, stamp, value) for stamp, value in zip(columns.stamp_ns.tolist(), values, strict=True)]


def _compare(
    topic: Topic,
    recorded: Sequence[TopicValue],
    replayed: Sequence[TopicValue],
    names: Sequence[str],
    units: Sequence[str],
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
    return Compared(topic.name, len(both), missing, len(replayed) - len(both), different, first, largest, unit, alone)


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


def _difference(topic: Topic, old: TopicValue, new: TopicValue, names: Sequence[str]) -> Difference | None:
    if old.frame != new.frame:
        return Difference(old.stamp, "frame", old.frame, new.frame)
    if len(old.values) != len(new.values):
        return Difference(old.stamp, "number of values", len(old.values), len(new.values))
    for i, (a, b) in enumerate(zip(old.values, new.values, strict=True)):
        if struct.pack("d", a) != struct.pack("d", b) and not (math.isnan(a) and math.isnan(b)):
            return Difference(old.stamp, _field(topic, i, names), a, b)
    return None


def _field(topic: Topic, i: int, names: Sequence[str]) -> str:
    if topic.type == WRENCH:
        return f"{'force' if i < 3 else 'torque'}.{_AXES[i % 3]}"
    if topic.type == TABLE:
        row, column = divmod(i, len(topic.columns))
        return f"row {row}, {topic.columns[column]}"
    return _AXES[i] if topic.type == POINT else names[i % len(names)]
