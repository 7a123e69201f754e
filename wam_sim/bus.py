"""The topics of a simulation: a message goes at once to every reaction that takes it, and its numbers are kept."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from wam_description.defects import Check
from wam_description.interface import Feed, is_packaged
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


class Bus:
    """Hands messages on, in the order of the declared nodes.

    Parameters
    ----------
    topics : those that exist, by name.
    """

    def __init__(self, topics: Mapping[str, Topic]) -> None:
        self._routes = {name: _Route(_Log(), [], _WRITES.get(topic.type)) for name, topic in topics.items()}
        self._rows: Rows = {}

    def listen(self, topic: str, take: Callable[[int, Any], None]) -> None:
        """Call a function with stamp, ns, and value of each message of a topic."""
        self._routes[topic].takers.append((take, _nothing, {}))

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
            outlets[name] = self._routes.setdefault(name, _Route(_Log(), []))
        for name in EVERY_NODE:  # each node has its own, so that a listener knows who speaks
            outlets[name] = self._routes.setdefault(of_node(declaration.name, name), _Route(_Log(), []))
        # a node of the stack reads what it declares, as the same bits over topics show: it needs no mask
        inlet = _inlet if is_packaged(declaration) else _masked_inlet
        for topic, found in feeds.items():
            reactions = [(inlet(feed, topic), _checked(feed.work, checks)) for feed in found]
            if len(reactions) > 1:
                self._routes[topic].takers.append((_together(reactions), _outputs, outlets))
            else:
                self._routes[topic].takers.extend((*reaction, outlets) for reaction in reactions)

    def publish(self, topic: str, stamp: int, value: Any) -> None:
        """Publish a value of a stamp, ns, and what the nodes publish in turn."""
        self._deliver(self._routes[topic], stamp, value)

    def _deliver(self, route: "_Route", stamp: int, value: Any) -> None:
        if (write := route.write) is not None:
            write(route.log, stamp, value)
        for inlet, work, outlets in route.takers:
            for inputs in inlet(stamp, value) or ():
                for name, output in work(inputs).items():
                    self._deliver(outlets[name], inputs.stamp, output)

    @property
    def rows(self) -> Rows:
        """What was published on each topic of numbers so far; a JointState as position, velocity and effort."""
        for name, route in self._routes.items():
            if new := route.log.take():
                self._rows.setdefault(name, []).extend(new)
        return self._rows


def of_node(node: str, topic: str) -> str:
    """The name under which the bus has what a node publishes on a topic of `EVERY_NODE`."""
    return f"{node}: {topic}" if topic in EVERY_NODE else topic


class _Log:
    """The numbers of a topic, one after the other: a tuple for each message would keep the garbage collector busy.

    Attributes
    ----------
    stamps, frames : of the messages.
    numbers : of all of them.
    ends : of the numbers of each message.
    """

    __slots__ = ("ends", "frames", "numbers", "stamps")

    def __init__(self) -> None:
        self.stamps: list[int] = []
        self.frames: list[str] = []
        self.numbers: list[float] = []
        self.ends: list[int] = []

    def end(self, stamp: int, frame: str) -> None:
        """End a message, whose numbers are there."""
        self.stamps.append(stamp)
        self.frames.append(frame)
        self.ends.append(len(self.numbers))

    def take(self) -> list[TopicValue]:
        """The messages since the last call."""
        numbers, begins = tuple(self.numbers), [0, *self.ends]
        each = zip(self.stamps, begins, self.ends, self.frames, strict=False)
        rows = [TopicValue(stamp, numbers[begin:end], frame) for stamp, begin, end, frame in each]
        for kept in (self.stamps, self.frames, self.numbers, self.ends):
            kept.clear()
        return rows


class _Route(NamedTuple):
    """One topic: its messages, who takes them, and what keeps their numbers, where it carries any."""

    log: _Log
    takers: list["_Taker"]
    write: Callable[[_Log, int, Any], None] | None = None


Work = Callable[[Any], Outputs]
# where its inputs go, its step, the topics that it may publish
_Taker = tuple[Callable[[int, Any], Sequence[Any] | None], Work, Mapping[str, _Route]]


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


def _inlet(feed: Feed, topic: str) -> Inlet:
    return feed.synchroniser.inlet(topic)


def _masked_inlet(feed: Feed, topic: str) -> Inlet:
    """What takes of a JointState only what an input declares."""
    inlet, masked = _inlet(feed, topic), mask(feed.arrays)
    return inlet if masked is None else lambda stamp, value: inlet(stamp, masked(value))


def _checked(work: Work, checks: Mapping[str, Check]) -> Work:
    """A step whose unusable outputs are refused."""
    if not checks:
        return work

    def step(inputs: Inputs) -> Outputs:
        outputs = work(inputs)
        for name, output in outputs.items():
            if name in checks:
                checks[name](output)
        return outputs

    return step


def _together(reactions: Sequence[tuple[Inlet, Work]]) -> Callable[[int, Any], list[_Done]]:
    return lambda stamp, value: [
        _Done(inputs.stamp, work(inputs)) for inlet, work in reactions for inputs in inlet(stamp, value)
    ]


def _outputs(done: _Done) -> Outputs:
    return done.outputs


def _nothing(_: Any) -> Outputs:
    return {}


def _write_state(log: _Log, stamp: int, value: State) -> None:
    numbers = log.numbers
    for array in value:
        numbers += array
    log.stamps.append(stamp)
    log.frames.append("")
    log.ends.append(len(numbers))


def _write_wrench(log: _Log, stamp: int, value: Wrench) -> None:
    log.numbers += value.force
    log.numbers += value.torque
    log.end(stamp, value.frame)


def _write_point(log: _Log, stamp: int, value: Point) -> None:
    log.numbers += value.position
    log.end(stamp, value.frame)


def _write_table(log: _Log, stamp: int, value: Table) -> None:
    for row in value.rows:
        log.numbers += row
    log.end(stamp, value.frame)


_WRITES: dict[str, Callable[[_Log, int, Any], None]] = {
    JOINT_STATE: _write_state,
    WRENCH: _write_wrench,
    POINT: _write_point,
    TABLE: _write_table,
}


def flat(topic: Topic, stamp: int, value: Any) -> TopicValue:
    """A value of a topic of numbers as one row."""
    log = _Log()
    _WRITES[topic.type](log, stamp, value)
    return log.take()[0]
