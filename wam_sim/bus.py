"""The topics of a simulation: a message goes at once to every reaction that takes it, and its numbers are kept."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from wam_description.defects import Check
from wam_description.interface import Feed
from wam_description.signals import Point, State, Table, Wrench
from wam_description.synchroniser import Inlet, Inputs
from wam_description.topics import EVERY_NODE, JOINT_STATE, POINT, TABLE, WRENCH, Topic
from wam_description.wiring import Declaration, Outputs, mask


class TopicValue(NamedTuple):
    """One message: time and numbers; the frame where there is one."""

    stamp: int  # ns
    values: tuple[float, ...]
    frame: str = ""


Rows = dict[str, list[TopicValue]]
Write = Callable[[list[float], Any], str]  # appends the numbers of a value, returns its frame


class Bus:
    """Hands messages on, in the order of the declared nodes.

    Parameters
    ----------
    topics : those that exist, by name.
    """

    def __init__(self, topics: Mapping[str, Topic]) -> None:
        writes = {name: _WRITES.get(topic.type) for name, topic in topics.items()}
        self._routes = {name: _Route(_Log(write) if write else None, [], None) for name, write in writes.items()}
        self._rows: Rows = {}

    def listen(self, topic: str, take: Callable[[int, Any], None]) -> None:
        """Call a function with stamp, ns, and value of each message of a topic."""

        def inlet(stamp: int, value: Any) -> tuple[()]:
            take(stamp, value)
            return ()

        self._routes[topic].takers.append(_Taker(inlet, None, _nothing, {}))

    def connect(
        self, declaration: Declaration, feeds: Mapping[str, Sequence[Feed]], checks: Mapping[str, Check]
    ) -> None:
        """Connect the reactions of a node; when several take one topic, all work before the first publishes.

        Parameters
        ----------
        declaration : of the node.
        feeds : its reactions to each topic.
        checks : what refuses an unusable output, by topic.
        """
        outlets = _Outlets(declaration)
        for name in declaration.outputs:
            route = self._routes.setdefault(name, _Route(None, [], None))
            outlets[name] = route._replace(check=checks.get(name))
        for name in EVERY_NODE:  # each node has its own, so that a listener knows who speaks
            outlets[name] = self._routes.setdefault(of_node(declaration.name, name), _Route(None, [], None))
        for topic, found in feeds.items():
            reactions = [(feed.synchroniser.inlet(topic), mask(feed.arrays), feed.work) for feed in found]
            if len(reactions) > 1:
                self._routes[topic].takers.append(_Taker(_together(reactions), None, _outputs, outlets))
            else:
                self._routes[topic].takers.extend(_Taker(*reaction, outlets) for reaction in reactions)

    def publish(self, topic: str, stamp: int, value: Any) -> None:
        """Publish a value of a stamp, ns, and what the nodes publish in turn."""
        self._deliver(self._routes[topic], stamp, value)

    def _deliver(self, route: "_Route", stamp: int, value: Any) -> None:
        log, takers, _ = route
        if log is not None:
            log.add(stamp, value)
        for inlet, masked, work, outlets in takers:
            for inputs in inlet(stamp, masked(value) if masked else value):
                for name, output in work(inputs).items():
                    outlet = outlets[name]
                    if outlet.check is not None:
                        outlet.check(output)
                    self._deliver(outlet, inputs.stamp, output)

    @property
    def rows(self) -> Rows:
        """What was published on each topic of numbers so far; a JointState as position, velocity and effort."""
        for name, (log, *_) in self._routes.items():
            if log is not None and (new := log.take()):
                self._rows.setdefault(name, []).extend(new)
        return self._rows


def of_node(node: str, topic: str) -> str:
    """The name under which the bus has what a node publishes on a topic of `EVERY_NODE`."""
    return f"{node}: {topic}" if topic in EVERY_NODE else topic


class _Log:
    """The numbers of a topic, one after the other: a tuple for each message would keep the garbage collector busy.

    Parameters
    ----------
    write : of the type of the topic.
    """

    __slots__ = ("_ends", "_frames", "_numbers", "_stamps", "_write")

    def __init__(self, write: Write) -> None:
        self._write = write
        self._clear()

    def _clear(self) -> None:
        self._stamps: list[int] = []
        self._frames: list[str] = []
        self._numbers: list[float] = []
        self._ends: list[int] = []  # of the numbers of each message

    def add(self, stamp: int, value: Any) -> None:
        """Keep the numbers of one message."""
        numbers = self._numbers
        self._frames.append(self._write(numbers, value))
        self._stamps.append(stamp)
        self._ends.append(len(numbers))

    def take(self) -> list[TopicValue]:
        """The messages since the last call."""
        numbers, begins = tuple(self._numbers), [0, *self._ends]
        each = zip(self._stamps, begins, self._ends, self._frames, strict=False)
        rows = [TopicValue(stamp, numbers[begin:end], frame) for stamp, begin, end, frame in each]
        self._clear()
        return rows


class _Route(NamedTuple):
    """One topic: its numbers, where it carries any, who takes it, and what refuses an unusable output."""

    log: _Log | None
    takers: list["_Taker"]
    check: Check | None


class _Taker(NamedTuple):
    """A reaction: where its inputs go, what it takes of a JointState, its step, the topics that it may publish."""

    inlet: Callable[[int, Any], Sequence[Any]]
    masked: Callable[[State], State] | None
    work: Callable[[Any], Outputs]
    outlets: Mapping[str, _Route]


class _Outlets(dict[str, _Route]):
    """The topics that a node declares."""

    def __init__(self, declaration: Declaration) -> None:
        super().__init__()
        self._declaration = declaration

    def __missing__(self, topic: str) -> _Route:
        self._declaration.require_declared({topic: None})
        raise KeyError(topic)


class _Done(NamedTuple):
    """A step that was done before others of the same node."""

    stamp: int
    outputs: Outputs


def _together(
    reactions: Sequence[tuple[Inlet, Callable[[State], State] | None, Callable[[Inputs], Outputs]]],
) -> Callable[[int, Any], list[_Done]]:
    return lambda stamp, value: [
        _Done(inputs.stamp, work(inputs))
        for inlet, masked, work in reactions
        for inputs in inlet(stamp, masked(value) if masked else value)
    ]


def _outputs(done: _Done) -> Outputs:
    return done.outputs


def _nothing(_: Any) -> Outputs:
    return {}


def _write_state(numbers: list[float], value: State) -> str:
    position, velocity, effort = value
    numbers += position
    numbers += velocity
    numbers += effort
    return ""


def _write_wrench(numbers: list[float], value: Wrench) -> str:
    numbers += value.force
    numbers += value.torque
    return value.frame


def _write_point(numbers: list[float], value: Point) -> str:
    numbers += value.position
    return value.frame


def _write_table(numbers: list[float], value: Table) -> str:
    for row in value.rows:
        numbers += row
    return value.frame


_WRITES: dict[str, Write] = {
    JOINT_STATE: _write_state,
    WRENCH: _write_wrench,
    POINT: _write_point,
    TABLE: _write_table,
}


def flat(topic: Topic, stamp: int, value: Any) -> TopicValue:
    """A value of a topic of numbers as one row."""
    numbers: list[float] = []
    frame = _WRITES[topic.type](numbers, value)
    return TopicValue(stamp, tuple(numbers), frame)
