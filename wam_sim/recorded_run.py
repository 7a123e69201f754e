"""Contents of a bag as a run: arm, parameters, steps, faults, status and mode; the one reader of all these."""

import ast
from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from wam_bag.arrays import Mask, Times
from wam_bag.bag import Bag, BagError, Columns, JointColumns, Messages, PointColumns, TableColumns, WrenchColumns
from wam_control.task.scenario import FORCE_LOOP
from wam_description.event import Code
from wam_description.signals import NodeStatus
from wam_description.status import CHANGES, ENABLED, parse
from wam_description.topics import TOPICS
from wam_sim.reactions import RecordedReaction, RecordedStep, lasting
from wam_sim.recorded_commands import RefusedCommands, several_runs, taken_commands
from wam_sim.recorded_parameters import RecordedParameters, recorded_parameters

Kind = TypeVar("Kind", JointColumns, WrenchColumns, PointColumns, TableColumns)


class RecordedFault(NamedTuple):
    """A fault of the driver and when it was reported, ns."""

    stamp: int
    reason: str


class RecordedRun(NamedTuple):
    """A recorded run of an arm.

    Attributes
    ----------
    bag : with the commands that the stack took, see `wam_sim.recorded_commands`.
    namespace : of the arm, as '/wam'.
    arms : namespaces of all arms in the bag.
    parameters : of the arm's nodes.
    statuses : in the order of the bag.
    begun : the steps of the scenario; a recording without an outcome ended in the last one.
    outcome : `Code.DONE`, why the scenario failed, or '' if the recording ended before.
    refused : commands that are left out of the bag.
    """

    bag: Bag
    namespace: str
    arms: tuple[str, ...]
    parameters: RecordedParameters
    statuses: tuple[NodeStatus, ...]
    begun: tuple[RecordedStep, ...]
    outcome: str
    refused: tuple[RefusedCommands, ...]

    def __repr__(self) -> str:
        return f"RecordedRun({self.bag!r}, {self.namespace!r}, {len(self.steps)} steps, {self.outcome!r})"

    @property
    def faults(self) -> tuple[RecordedFault, ...]:
        """Those of the driver, each once."""
        found = (RecordedFault(one.stamp, one.fault) for one in self.statuses if one.node == "driver" and one.fault)
        return tuple(dict.fromkeys(found))

    @property
    def steps(self) -> tuple[RecordedStep, ...]:
        """Those that were played to their end."""
        return self.begun if self.outcome else self.begun[:-1]

    @property
    def is_simulated(self) -> bool:
        """Whether the arm was simulated: a driver of another arm is named as 'module:Class' among the nodes.

        Without the parameters, lockstep and the topics of the simulator are evidence of it.
        """
        topics = {*self.bag.topics, *self.bag.counts}
        try:
            has_own = not self.parameters.shared.is_simulated
        except BagError:
            has_own = self.bag.mode != "lockstep"
        return not has_own or any(name.startswith(f"{self.namespace}/sim/") for name in topics)

    @property
    def others(self) -> str:
        """A sentence about the other arms in the bag, '' if there are none."""
        others = [name.strip("/") for name in self.arms if name and name != self.namespace]
        text = f"this is {self.namespace or '/'} alone; other arms in this bag: --namespace {' or '.join(others)}"
        return text if others else ""

    def changes(self, node: str) -> dict[int, Mapping[str, Any]]:
        """Live parameters, by 'node:parameter', that a node reported to have taken after its step of a stamp, ns."""
        # the last report of a stamp has all
        return {one.stamp: _settings(one) for one in self.statuses if one.node == node and CHANGES in one.facts}

    def live_values(self, *nodes: str) -> list[tuple[int, Mapping[str, Any]]]:
        """Live parameters by 'node:parameter' and when they were set, ns, in order: by steps, and by these nodes."""
        found = [(step.begin, step.settings) for step in self.begun]
        found += [change for node in nodes for change in self.changes(node).items()]
        return sorted(found, key=lambda one: one[0])

    def stamped_statuses(self) -> list[tuple[int, NodeStatus]]:
        """Each status and when it was published, ns; where it has no stamp, the newest one that was recorded before it.

        That is one of a joint state or of another status: of a part of a recording only statuses are from before it.
        """
        columns, states = self.columns("status"), self.joints("joint_states")
        if columns is None:
            return [(status.stamp, status) for status in self.statuses]
        logged = columns.log_time_ns.tolist()
        known = [(at, status.stamp) for at, status in zip(logged, self.statuses, strict=True) if status.stamp]
        if states is not None:
            known += zip(states.log_time_ns.tolist(), states.stamp_ns.tolist(), strict=True)
        known.sort()
        times = [at for at, _ in known]
        newest = [max(bisect_right(times, at) - 1, 0) for at in logged]
        return [
            (status.stamp or (known[row][1] if known else 0), status)
            for row, status in zip(newest, self.statuses, strict=True)
        ]

    def reactions(self, end: int) -> tuple[RecordedReaction, ...]:
        """What the force loop and the driver did up to an end, ns, instead of what was commanded; in order of time.

        A push that begins under the brakes is none: they stop the arm with a force that looks like one.
        """
        found = self.stamped_statuses()
        loop = [(stamp, status.events) for stamp, status in found if status.node == FORCE_LOOP]
        faults = [
            (stamp, [one for one in status.events if one.code is Code.FAULT])
            for stamp, status in found
            if status.node == "driver"
        ]
        own = lasting(loop, end)
        braked = self.braked(np.array([one.begin for one in own], np.int64))
        pushed = [one for one, held in zip(own, braked, strict=True) if one.name is not Code.PUSHED or not held]
        return tuple(sorted((*pushed, *lasting(faults, end)), key=lambda one: (one.begin, one.end, one.name)))

    def braked(self, stamps: Times, release: int = 0) -> Mask:
        """Whether the brakes hold at each instant, (k,), and for a time after each release, ns."""
        braked = np.zeros(len(stamps), np.bool_)
        driver = [
            (at, status.mode) for at, status in self.stamped_statuses() if status.node == "driver" and status.mode
        ]
        for since, mode in sorted(driver):
            braked[stamps >= since + release * (mode == ENABLED)] = mode != ENABLED
        return braked

    def lacking(self, *names: str) -> tuple[str, ...]:
        """Those of some topics that were not recorded; of what was refused that is known."""
        refused = {one.topic for one in self.refused}
        found = {name: self.columns(name) for name in names if name not in refused}
        return tuple(name for name, columns in found.items() if columns is None or not len(columns.log_time_ns))

    def columns(self, topic: str) -> Columns | None:
        """Columns of a topic of the arm, None if it was not recorded, or not read."""
        return self.bag.topics.get(f"{self.namespace}/{topic}")

    def joints(self, topic: str) -> JointColumns | None:
        """Columns of a JointState topic of the arm, None if nothing was recorded."""
        return self._columns(topic, JointColumns)

    def wrench(self, topic: str) -> WrenchColumns | None:
        """Columns of a WrenchStamped topic of the arm, None if nothing was recorded."""
        return self._columns(topic, WrenchColumns)

    def points(self, topic: str) -> PointColumns | None:
        """Columns of a PointStamped topic of the arm, None if nothing was recorded."""
        return self._columns(topic, PointColumns)

    def table(self, topic: str) -> TableColumns | None:
        """Columns of a topic of tables of the arm, None if nothing was recorded."""
        return self._columns(topic, TableColumns)

    def _columns(self, topic: str, kind: type[Kind]) -> Kind | None:
        name = f"{self.namespace}/{topic}"
        if name not in self.bag.topics and self.bag.counts.get(name):
            raise LookupError(f"{self.bag.path} has {name}, but it was not read; add it to the topics that are read")
        columns = self.columns(topic)
        return columns if isinstance(columns, kind) and len(columns.stamp_ns) else None


def recorded_run(bag: Bag, namespace: str = "") -> RecordedRun:
    """The run in a bag, which may lack anything.

    Parameters
    ----------
    bag : of one arm or of several.
    namespace : of the arm, '' for the one with the most topics.

    Raises
    ------
    BagError
        if the bag has no such arm, or several runs of it.
    """
    found, arms = namespaces(bag)
    chosen = f"/{namespace.strip('/')}" if namespace else found
    if chosen not in (found, *arms):
        raise BagError(f"{bag.path} has no arm in the namespace {chosen}; its arms: {', '.join(arms) or 'none'}")
    namespace = chosen
    parameters = recorded_parameters(bag, namespace)
    statuses = tuple(status_of(message) for message in messages_of(bag, f"{namespace}/status"))
    if namespace in arms and (several := several_runs(bag, namespace)):
        raise BagError(
            f"{bag.path}: {several}; a recorder that goes on while the stack is started again mixes them, and they are "
            "not evaluated together: record each run in a bag of its own"
        )
    bag, refused = taken_commands(bag, namespace, parameters)
    commands = bag.topics.get(f"{namespace}/force_command")
    last = int(commands.stamp_ns[-1]) if isinstance(commands, WrenchColumns) and len(commands.stamp_ns) else 0
    return RecordedRun(bag, namespace, arms, parameters, statuses, *_steps(statuses, last), refused)


def namespaces(bag: Bag) -> tuple[str, tuple[str, ...]]:
    """Namespace of the arm with the most topics, and those of all arms."""
    counts: Counter[str] = Counter()
    for topic in TOPICS:
        if not topic.name.startswith("/"):
            ending = f"/{topic.name}"
            counts.update(name.removesuffix(ending) for name in sorted(bag.topics) if name.endswith(ending))
    arms = tuple(name for name in sorted(counts) if f"{name}/status" in bag.topics)
    return counts.most_common(1)[0][0] if counts else "", arms


def messages_of(bag: Bag, topic: str) -> Sequence[Any]:
    """Decoded messages of a topic that is no column, none if it was not recorded."""
    columns = bag.topics.get(topic)
    return columns.messages if isinstance(columns, Messages) else ()


def status_of(message: Any) -> NodeStatus:
    """The status in a DiagnosticStatus message; the node without its namespace."""
    given = ((item.key, item.value) for item in message.values)
    return parse(str(message.name).rpartition("/")[2], int(message.level), str(message.message), given)


def _steps(statuses: Sequence[NodeStatus], last: int) -> tuple[tuple[RecordedStep, ...], str]:
    """Steps that began, and the outcome.

    Parameters
    ----------
    last : latest stamp that is known of the run, ns.
    """
    begun: list[RecordedStep] = []
    for status in statuses:
        if status.node != "scenario" or not status.stamp:
            continue
        if not status.step:
            return _ended(begun, status.stamp), status.message if status.level else Code.DONE.value
        if begun and begun[-1][:2] == (status.step, status.stamp):  # published again with what it has set
            begun[-1] = begun[-1]._replace(settings={**begun[-1].settings, **_settings(status)})
        else:
            begun.append(RecordedStep(status.step, status.stamp, status.stamp, _settings(status)))
    return _ended(begun, max([last, *(step.begin for step in begun[-1:])])), ""


def _ended(begun: Sequence[RecordedStep], end: int) -> tuple[RecordedStep, ...]:
    """Each step with the start of the next one as its end, the last one with the end that is given, ns."""
    ends = [*(step.begin for step in begun[1:]), end]
    return tuple(step._replace(end=end) for step, end in zip(begun, ends, strict=False))


def _settings(status: NodeStatus) -> dict[str, Any]:
    """Live parameters that a step set, by 'node:parameter'."""
    return {key: _value(text) for key, text in status.facts.items() if ":" in key}


def _value(text: str) -> Any:
    """A value from its text in Python; any other text is a word."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return text
