"""Topics without ROS, of a simulation or a replay: each message goes at once to every reaction that takes it."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from struct import Struct
from typing import Any, NamedTuple

from wam_description.defects import Check
from wam_description.interface import Feed, is_packaged
from wam_description.synchroniser import Inlet, OutOfTime
from wam_description.topics import EVERY_NODE, JOINT_STATE, POINT, TABLE, WRENCH, Topic
from wam_description.wiring import Declaration, Outputs, mask


class TopicValue(NamedTuple):
    """One message: time and numbers; the frame where there is one."""

    stamp: int  # ns
    values: tuple[float, ...]
    frame: str = ""


Rows = dict[str, list[TopicValue]]


class Bus:
    """Hands messages on, in the order of the declared nodes.

    Parameters
    ----------
    topics : those that exist, by name.
    """

    def __init__(self, topics: Mapping[str, Topic]) -> None:
        self._routes = {
            name: _Route(_Kept(_ROWS[topic.type], topic.type in _FRAMED) if topic.type in _ROWS else None)
            for name, topic in topics.items()
        }
        self._rows: Rows = {}
        self._outlets: dict[str, _Outlets] = {}  # by node

    def listen(self, topic: str, take: Callable[[int, Any], None]) -> None:
        """Call a function with stamp, ns, and value of each message of a topic."""
        self._routes[topic].takers.append(take)

    def connect(
        self, declaration: Declaration, feeds: Mapping[str, Sequence[Feed]], checks: Mapping[str, Check]
    ) -> None:
        """Connect the reactions of a node; when several take one topic, all work before the first publishes.

        Parameters
        ----------
        declaration : of the node.
        feeds : its reactions to each topic.
        checks : what each output goes through, by topic; see `output_check`.
        """
        outlets = self._outlets[declaration.name] = _Outlets(declaration)
        for name in declaration.outputs:
            outlets[name] = _checked(self._routes.setdefault(name, _Route()).publish, checks.get(name))
        for name in EVERY_NODE:  # each node has its own, so that a listener knows who speaks
            outlets[name] = self._routes.setdefault(of_node(declaration.name, name), _Route()).publish
        # a node of the stack reads what it declares, as the same bits over topics show: it needs no mask
        is_masked = not is_packaged(declaration)
        for topic, found in feeds.items():
            reactions = [(_inlet(feed, topic, is_masked), feed.work) for feed in found]
            self._routes.setdefault(topic, _Route()).takers.append(_taker(reactions, outlets))

    def publish_of(self, node: str, stamp: int, outputs: Outputs) -> None:
        """Publish what a connected node returned elsewhere than in a step, as its steps' outputs are published."""
        for name, output in outputs.items():
            self._outlets[node][name](stamp, output)

    def publish(self, topic: str, stamp: int, value: Any) -> None:
        """Publish a value of a stamp, ns, and what the nodes publish in turn."""
        self._routes[topic].publish(stamp, value)

    def publisher(self, topic: str) -> Callable[[int, Any], None]:
        """What `publish` does on one topic, as a function of stamp and value."""
        return self._routes[topic].publish

    @property
    def rows(self) -> Rows:
        """What was published on each topic of numbers so far; a JointState as position, velocity and effort."""
        for name, route in self._routes.items():
            if route.kept is not None and (rows := route.kept.taken()):
                self._rows.setdefault(name, []).extend(rows)
        return self._rows


def of_node(node: str, topic: str) -> str:
    """The name under which the bus has what a node publishes on a topic of `EVERY_NODE`."""
    return f"{node}: {topic}" if topic in EVERY_NODE else topic


_Row = list[Any]  # stamp and numbers of a message


class _Kept:
    """The numbers of the messages of one topic, each packed, in blocks of messages of one length and frame.

    As objects they would take three times the memory, and drive those in use out of the processor's caches
    (benchmarks/README.md).

    Parameters
    ----------
    row : of a message.
    is_framed : whether messages have a frame.
    """

    __slots__ = ("_blocks", "_count", "_frame", "_is_framed", "_keep", "_pack", "_row")

    def __init__(self, row: Callable[[int, Any], _Row], is_framed: bool) -> None:
        self._row, self._is_framed = row, is_framed
        self._blocks: list[tuple[str, Struct, list[bytes]]] = []
        self._count, self._frame = 0, ""

    def add(self, stamp: int, value: Any) -> None:
        """Keep the numbers of a message."""
        row = self._row(stamp, value)
        if len(row) != self._count or (self._is_framed and value.frame != self._frame):
            self._begin(len(row), value.frame if self._is_framed else "")
        self._keep(self._pack(*row))

    def _begin(self, count: int, frame: str) -> None:
        """Begin a block of messages of so many numbers."""
        layout, messages = Struct(f"q{count - 1}d"), list[bytes]()
        self._blocks.append((frame, layout, messages))
        self._count, self._frame, self._pack, self._keep = count, frame, layout.pack, messages.append

    def taken(self) -> list[TopicValue]:
        """The messages since the last call."""
        blocks, self._blocks, self._count = self._blocks, [], 0
        return [
            TopicValue(stamp, tuple(values), frame)
            for frame, layout, messages in blocks
            for stamp, *values in map(layout.unpack, messages)
        ]


class _Route:
    """One topic.

    Parameters
    ----------
    kept : the numbers of its messages; None of a topic without numbers.

    Attributes
    ----------
    takers : of its messages.
    """

    __slots__ = ("kept", "takers")

    def __init__(self, kept: _Kept | None = None) -> None:
        self.takers: list[_Take] = []
        self.kept = kept

    def publish(self, stamp: int, value: Any) -> None:
        """Keep the numbers of a value of a stamp, ns, and hand it to the takers."""
        if self.kept is not None:
            self.kept.add(stamp, value)
        for take in self.takers:
            take(stamp, value)


_Take = Callable[[int, Any], object]
_Outlet = Callable[[int, Any], None]


class _Outlets(dict[str, _Outlet]):
    """What publishes on the topics that a node declares."""

    def __init__(self, declaration: Declaration) -> None:
        super().__init__()
        self._declaration = declaration

    def __missing__(self, topic: str) -> _Outlet:
        self._declaration.require_declared({topic: None})
        raise KeyError(topic)


def _inlet(feed: Feed, topic: str, is_masked: bool) -> Inlet:
    """Where a reaction takes a topic; masked, it gets of a JointState only what it declares."""
    inlet, masked = feed.synchroniser.inlet(topic), mask(feed.arrays) if is_masked else None
    return inlet if masked is None else lambda stamp, value: inlet(stamp, masked(value))


def _checked(publish: _Outlet, check: Check | None) -> _Outlet:
    """What publishes values as others take them; an unusable one is refused."""
    return publish if check is None else lambda stamp, value: publish(stamp, check(value))


def _taker(reactions: Sequence[tuple[Inlet, Callable[[Any], Outputs]]], outlets: _Outlets) -> _Take:
    """What hands a message to the reactions of a node, and publishes what they answer when all have worked.

    One whose newest state is too old refuses it, as over topics; the driver brakes then and names the node.
    """

    def take(stamp: int, value: Any) -> None:
        done: list[tuple[int, Outputs]] = []
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


_ROWS: dict[str, Callable[[int, Any], _Row]] = {
    JOINT_STATE: lambda stamp, value: [stamp, *value[0], *value[1], *value[2]],
    WRENCH: lambda stamp, value: [stamp, *value.force, *value.torque],
    POINT: lambda stamp, value: [stamp, *value.position],
    TABLE: lambda stamp, value: [stamp, *chain.from_iterable(value.rows)],
}
_FRAMED = {WRENCH, POINT, TABLE}


def flat(topic: Topic, stamp: int, value: Any) -> TopicValue:
    """A value of a topic of numbers as one row."""
    return TopicValue(stamp, tuple(_ROWS[topic.type](stamp, value)[1:]), value.frame if topic.type in _FRAMED else "")
