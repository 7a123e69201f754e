"""Recorded inputs through a node again, its outputs compared with the recorded ones, without ROS.

In lockstep the outputs are equal bit for bit as long as node and parameters are; a changed node is
evaluated by its outputs for old recordings.  In realtime a node took the newest inputs when it worked,
which a recording knows only roughly: there the differences are counted and measured.

Topics of numbers are compared; in_contact and markers follow from the same estimate.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from wam_bag.bag import BagError, JointColumns, Messages, PointColumns, TableColumns, WrenchColumns, read
from wam_description.arm import Arm, Shared
from wam_description.configuration import Configuration
from wam_description.defects import owners
from wam_description.interface import Interface, declared
from wam_description.nodes import NODES
from wam_description.parameters import ParameterError, build_part, require
from wam_description.parameters import values as values_of
from wam_description.signals import PathPoint, Point, PosturePath, State, Table, Wrench
from wam_description.topics import BY_NAME, POINT, STATUS, TABLE, WRENCH, Topic
from wam_description.wiring import Declaration, Inputs, Outputs
from wam_sim.bus import NodeBus, Rows, TopicValue, Work, flat
from wam_sim.recorded_run import RecordedRun, recorded_run

# fields of messages with three axes, and their units
_FIELDS = {WRENCH: (("force.", "N"), ("torque.", "N m")), POINT: (("", "m"),)}
NOTHING: Mapping[str, Any] = {}


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


class ChangedValue(NamedTuple):
    """A parameter, as --set names it, that the replay has with another value than the recording."""

    name: str
    recorded: Any
    used: Any


class Replay(NamedTuple):
    """A replay: mode of the recording, how each topic of the node came out, what the bag lacks.

    `changed` are the parameters of the node that a configuration has otherwise than the recording, its own first,
    `others` a sentence about other arms in the bag.
    """

    node: str
    mode: str
    topics: tuple[Compared, ...]
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
    run = recorded_run(bag, namespace)
    was = run.parameters
    # the node gets all that was sent, also what it refused
    run = run._replace(bag=bag, parameters=was.with_options(values))
    _require_types(run, [rows[topic] for topic in (*inputs, *outputs)])
    triggers = (reaction.trigger.topic for reaction in declaration.reactions)
    if missing := next((trigger for trigger in triggers if run.columns(trigger) is None), ""):
        raise BagError(f"{path} lacks the topic {missing}, without which {declaration.name} does nothing")
    shared, own = _parameters(run, declaration, configuration)
    period, recorded = shared.timing.period, was.shared.timing.period if was.nodes else shared.timing.period
    require(period == recorded, f"timing.period is {period:g} s; in a replay it must be {recorded:g} s, as recorded")
    published = _run(run, shared, declaration, own)
    compared = [_compare(run, rows[topic], shared.arm, published.get(topic, [])) for topic in outputs]
    if not any(one.compared or one.only_recorded or one.only_replayed for one in compared):
        raise BagError(
            f"{path}: {declaration.name} publishes nothing from these inputs, and the bag has no message of it: "
            "there is nothing to compare; give a bag with all topics, from the recorder of the stack"
        )
    mode = shared.timing.mode if bag.mode == "unknown" else bag.mode
    lost = bag.losses.sentences(bag.first)
    changed = _changed_values(run, declaration, shared, own) if configuration else ()
    return Replay(declaration.name, mode, tuple(compared), tuple(lost), changed, run.others)


def _require_types(run: RecordedRun, topics: Sequence[Topic]) -> None:
    """Refuse a bag in which a topic has another type than now: it would be missing without a word."""
    for topic in topics:
        name = f"{run.namespace}/{topic.name}"
        if (recorded := run.bag.types.get(name, topic.type)) != topic.type:
            raise BagError(
                f"{run.bag.path}: {name} was recorded as {recorded}; this version has it as {topic.type}: replay "
                "the bag with the version that recorded it"
            )


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


def _changes(run: RecordedRun, node: str, own: Any) -> list[tuple[int, Any]]:
    """Parameters that a node took, after its step of a stamp, ns, as it reported it or as a scenario set it."""
    prefix, present, found = f"{node}:", values_of(own), list[tuple[int, Any]]()
    for after, settings in run.changes(node).items() or [(step.begin - 1, step.settings) for step in run.begun]:
        mine = {key.removeprefix(prefix): value for key, value in settings.items() if key.startswith(prefix)}
        present |= mine
        if mine:
            found.append((after, build_part(type(own), present)))
    return found


def _run(run: RecordedRun, shared: Shared, declaration: Declaration, own: Any) -> Rows:
    changes = _changes(run, declaration.name, own)
    interface, node = Interface(shared, started_by_hand=declaration), declaration.make(shared, own)
    for item in declaration.taken:
        if item.age == "command" and run.columns(item.topic) is None:
            interface.topics.pop(item.topic, None)  # the scenario that was recorded did not have this command

    def changing(work: Work) -> Work:
        def step(inputs: Inputs) -> Outputs:
            while changes and changes[0][0] < inputs.stamp:
                node.tune(changes.pop(0)[1])
            return work(inputs)

        return step

    bus = NodeBus(interface, declaration.outputs)
    bus.connect(declaration, node, changing)
    taken = [topic for topic in declaration.inputs if topic in interface.topics and topic not in declaration.outputs]
    messages: list[tuple[Any, ...]] = []
    for name in taken:
        publish, found = bus.publisher(name), _values(run, interface.topics[name], shared.arm)
        messages += [(logged, publish, stamp, value) for logged, stamp, value in found]
    for _, publish, stamp, value in sorted(messages, key=itemgetter(0)):  # in the order in which they came
        publish(stamp, value)
    return bus.rows


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


def _values(run: RecordedRun, topic: Topic, arm: Arm) -> list[tuple[int, int, Any]]:
    """Log time, stamp and value of each recorded message of a topic, none where it was not recorded."""
    columns, names = run.columns(topic.name), owners(topic, arm)
    found: Iterable[Any]
    if columns is None:
        return []
    logged = columns.log_time_ns.tolist()
    if isinstance(columns, Messages):
        times = [message.header.stamp for message in columns.messages]
        stamps = [time.sec * 1_000_000_000 + time.nanosec for time in times]
        return list(zip(logged, stamps, [_trajectory(message, names) for message in columns.messages], strict=True))
    if isinstance(columns, JointColumns):
        found = map(State, *(_array(columns, field, names) for field in State._fields))
    elif isinstance(columns, WrenchColumns):
        found = map(Wrench, columns.frames, map(tuple, columns.force.tolist()), map(tuple, columns.torque.tolist()))
    elif isinstance(columns, TableColumns):
        found = tables(columns)
    else:
        assert isinstance(columns, PointColumns)
        found = map(Point, columns.frames, map(tuple, columns.point.tolist()))
    return list(zip(logged, columns.stamp_ns.tolist(), found, strict=True))


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


def _labels(run: RecordedRun, topic: Topic, arm: Arm) -> list[tuple[str, str]]:
    """Field and unit of each number of a recorded message, of a table for one row."""
    columns = run.columns(topic.name)
    if topic.type == TABLE:
        return [(column, "") for column in topic.columns]
    if not isinstance(columns, JointColumns):
        return [(f"{field}{axis}", unit) for field, unit in _FIELDS[topic.type] for axis in "xyz"]
    units = zip(State._fields, ("rad", "rad/s", "A" if "current" in topic.name else "N m"), strict=True)
    return [(name, unit) for field, unit in units if getattr(columns, field).shape[1] for name in owners(topic, arm)]


def _compare(run: RecordedRun, topic: Topic, arm: Arm, replayed: Sequence[TopicValue]) -> Compared:
    recorded = [flat(topic, stamp, value) for _, stamp, value in _values(run, topic, arm)]
    known = {row.stamp: row for row in replayed}
    both = [(row, known[row.stamp]) for row in recorded if row.stamp in known]
    labels = _labels(run, topic, arm) if recorded else []
    differing = [one for old, new in both if (one := _differences(topic, old, new, labels))]
    first = differing[0][0][0] if differing else None
    sizes = [(size, unit) for _, size, unit in chain(*differing) if 0.0 < size < math.inf]
    largest, unit = max(sizes, key=itemgetter(0), default=(0.0, ""))
    missing = len(recorded) - len(both)
    alone = next((row.stamp for row in recorded if row.stamp not in known), None)
    more = len(replayed) - len(both)
    return Compared(topic.name, len(both), missing, more, len(differing), first, largest, unit, alone)


def _differences(
    topic: Topic, old: TopicValue, new: TopicValue, labels: Sequence[tuple[str, str]]
) -> list[tuple[Difference, float, str]]:
    """Where two messages differ, by how much and in which unit."""
    if old.frame != new.frame:
        return [(Difference(old.stamp, "frame", old.frame, new.frame), 0.0, "")]
    if len(old.values) != len(new.values):
        return [(Difference(old.stamp, "number of values", len(old.values), len(new.values)), 0.0, "")]
    found = []
    for i, (a, b) in enumerate(zip(old.values, new.values, strict=True)):
        if repr(a) != repr(b):  # to the bit, but for one NaN from another
            row, column = divmod(i, len(labels))
            field, unit = labels[column]
            named = f"row {row}, {field}" if topic.type == TABLE else field
            found.append((Difference(old.stamp, named, a, b), abs(a - b), unit))
    return found
