"""Declared nodes on the topics of a simulation or a replay, and the numbers of their messages."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from struct import Struct
from typing import Any, NamedTuple

from wam_description.defects import Check
from wam_description.interface import Feed, Interface, is_packaged
from wam_description.message_bus import MessageBus, Publish, Take
from wam_description.signals import mask
from wam_description.synchroniser import Inlet, OutOfTime, Synchroniser
from wam_description.topics import EVERY_NODE, JOINT_STATE, POINT, TABLE, WRENCH, Topic
from wam_description.wiring import Declaration, Inputs, Outputs


class TopicValue(NamedTuple):
    """One message: time and numbers; the frame where there is one."""

    stamp: int  # ns
    values: tuple[float, ...]
    frame: str = ""


Rows = dict[str, list[TopicValue]]
Work = Callable[[Inputs], Outputs]


class NodeBus(MessageBus):
    """Connects declared nodes, in their order.

    Parameters
    ----------
    interface : of the nodes.
    kept : topics whose numbers are kept.
    """

    def __init__(self, interface: Interface, kept: Iterable[str]) -> None:
        super().__init__()
        self._interface = interface
        topics = [interface.topics[name] for name in kept if name in interface.topics]
        self._kept = {topic.name: _Kept(_ROWS[topic.type]) for topic in topics if topic.type in _ROWS}
        for name, numbers in self._kept.items():
            self.listen(name, numbers.add)
        self._rows: Rows = {}
        self._outlets: dict[str, _Outlets] = {}  # by node

    def connect(
        self, declaration: Declaration, node: Any, around: Callable[[Work], Work] = lambda work: work
    ) -> set[Synchroniser]:
        """Connect the reactions of a node; when several take one topic, all work before the first publishes.

        Parameters
        ----------
        declaration, node : of what is connected.
        around : makes what works in place of a step.

        Returns
        -------
        set
            the synchronisers of the node.
        """
        feeds, checks = self._interface.feeds(declaration, node), self._interface.checks(declaration)
        outlets = self._outlets[declaration.name] = _Outlets(declaration)
        for name in declaration.outputs:
            outlets[name] = _checked(self.publisher(name), checks.get(name))
        for name in EVERY_NODE:  # each node has its own, so that a listener knows who speaks
            outlets[name] = self.publisher(of_node(declaration.name, name))
        # a node of the stack reads what it declares, as the same bits over topics show: it needs no mask
        is_masked = not is_packaged(declaration)
        for topic, found in feeds.items():
            reactions = [(_inlet(feed, topic, is_masked), around(feed.work)) for feed in found]
            self.listen(topic, _taker(reactions, outlets))
        return {feed.synchroniser for found in feeds.values() for feed in found}

    def publish_of(self, node: str, stamp: int, outputs: Outputs) -> None:
        """Publish what a connected node returned elsewhere than in a step, as its steps' outputs are published."""
        for name, output in outputs.items():
            self._outlets[node][name](stamp, output)

    @property
    def rows(self) -> Rows:
        """What was published on each topic of numbers so far; a JointState as position, velocity and effort."""
        for name, kept in self._kept.items():
            if rows := kept.taken():
                self._rows.setdefault(name, []).extend(rows)
        return self._rows


def of_node(node: str, topic: str) -> str:
    """The name under which the bus has what a node publishes on a topic of `EVERY_NODE`."""
    return f"{node}: {topic}" if topic in EVERY_NODE else topic


_Row = Callable[[Any, Any], tuple[str, tuple[float, ...]]]  # frame of a message; its stamp, ns, and numbers


class _Kept:
    """The numbers of the messages of one topic, each packed, in blocks of messages of one length and frame.

    As objects they would take three times the memory, and drive those in use out of the processor's caches
    (benchmarks/README.md).

    Parameters
    ----------
    row : of a message.
    """

    __slots__ = ("_blocks", "_count", "_frame", "_keep", "_pack", "_row")

    def __init__(self, row: "_Row") -> None:
        self._row = row
        self._blocks: list[tuple[str, Struct, list[bytes]]] = []
        self._count, self._frame = -1, ""  # of the present block, none so far

    def add(self, stamp: Any, value: Any) -> None:
        """Keep the numbers of a message."""
        frame, numbers = self._row(stamp, value)
        if len(numbers) != self._count or frame != self._frame:
            self._begin(len(numbers), frame)
        self._keep(self._pack(*numbers))

    def _begin(self, count: int, frame: str) -> None:
        """Begin a block of messages of so many numbers with the stamp."""
        layout, messages = Struct(f"q{count - 1}d"), list[bytes]()
        self._blocks.append((frame, layout, messages))
        self._count, self._frame, self._pack, self._keep = count, frame, layout.pack, messages.append

    def taken(self) -> list[TopicValue]:
        """The messages since the last call."""
        blocks, self._blocks, self._count = self._blocks, [], -1
        return [
            TopicValue(stamp, tuple(values), frame)
            for frame, layout, messages in blocks
            for stamp, *values in map(layout.unpack, messages)
        ]


class _Outlets(dict[str, Publish]):
    """What publishes on the topics that a node declares."""

    def __init__(self, declaration: Declaration) -> None:
        super().__init__()
        self._declaration = declaration

    def __missing__(self, topic: str) -> Publish:
        self._declaration.require_declared({topic: None})
        raise KeyError(topic)


def _inlet(feed: Feed, topic: str, is_masked: bool) -> Inlet:
    """Where a reaction takes a topic; masked, it gets of a JointState only what it declares."""
    inlet, masked = feed.synchroniser.inlets[topic], mask(feed.arrays)
    return (lambda stamp, value: inlet(stamp, masked(value))) if is_masked else inlet


def _checked(publish: Publish, check: Check | None) -> Publish:
    """What publishes values as others take them; an unusable one is refused."""
    return publish if check is None else lambda stamp, value: publish(stamp, check(value))


def _taker(reactions: Sequence[tuple[Inlet, Work]], outlets: _Outlets) -> Take:
    """What hands a message to the reactions of a node, and publishes what they answer when all have worked.

    One whose newest state is too old refuses it, as over topics; the driver brakes then and names the node.
    """

    def take(stamp: Any, value: Any) -> None:
        done: list[tuple[Any, Outputs]] = []
        try:
            for inlet, work in reactions:
                for inputs in inlet(stamp, value):
                    done.append((inputs.stamp, work(inputs)))  # noqa: PERF401 - most complete no step
        except OutOfTime:  # the reactions before have worked all the same
            pass
        for at, outputs in done:
            for name, output in outputs.items():
                outlets[name](at, output)

    return take


_ROWS: dict[str, _Row] = {
    JOINT_STATE: lambda stamp, value: ("", (stamp, *value[0], *value[1], *value[2])),
    WRENCH: lambda stamp, value: (value.frame, (stamp, *value.force, *value.torque)),
    POINT: lambda stamp, value: (value.frame, (stamp, *value.position)),
    TABLE: lambda stamp, value: (value.frame, (stamp, *chain.from_iterable(value.rows))),
}


def flat(topic: Topic, stamp: int, value: Any) -> TopicValue:
    """A value of a topic of numbers as one row."""
    frame, numbers = _ROWS[topic.type](stamp, value)
    return TopicValue(stamp, numbers[1:], frame)
