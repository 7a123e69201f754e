"""The recorder without ROS: which messages are written with which time, and which were lost on the way."""

import re
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

from wam_bag.bag_writer import BagWriter, RecordingError
from wam_bag.cdr import Reading, stamp_reader
from wam_bag.errors import Damage
from wam_bag.losses import LOST_AT_END, RECORDING, UNFINISHED, losses
from wam_bag.metadata import offered
from wam_bag.printable import printable
from wam_description.status import diagnosed_name
from wam_description.topics import EVERY_NODE, Topic
from wam_ros.limits import RECORDER_LIMITS

_LATEST: Final = 2**63 - 1  # ns; log times of a bag
_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


class Count(NamedTuple):
    """Messages from one publisher of a topic.

    `missed` are the messages it had numbered before the first one received: published before the
    recorder started, or before the first message of a late publisher (latched topics).
    `lost_at_end` are those that it announced and that did not come, nor any behind them.
    """

    topic: str
    publisher: str
    received: int
    dropped: int
    missed: int
    lost_at_end: int = 0


class Numbering:
    """Gaps in the numbers that publishers give their messages, counted from 1 without holes.

    A number that is above none of the known ones starts a new publisher (restarted, or a second one of the same name),
    as does a gap where there is another publisher than before; otherwise the message follows the nearest number before
    it, or the newest publisher's where that is alone, and the messages between the two were lost.

    Parameters
    ----------
    writers : the identities of those that publish at present, none where they are not known; used at a gap alone.
    """

    def __init__(self, writers: Callable[[], Collection[str]] = tuple) -> None:
        self.received = 0
        self.dropped = 0
        self.missed = 0
        self._last: list[int] = []  # of each publisher, the newest first
        self._total = 0  # messages that the newest one has announced
        self._lost_before = 0  # at the end of those before it
        self._writers = writers
        self._known: set[str] = set()

    def add(self, number: int) -> None:
        """Count one message; 0 if its number is not known."""
        self.received += 1
        if not number:
            return
        if self._last and self._last[0] == number - 1:  # one publisher, nothing lost
            self._last[0] = number
            return
        present = set(self._writers())
        is_another = bool(self._known and present - self._known)
        self._known |= present
        followed = self._last[:1] if len(present) == 1 else self._last
        before = [last for last in followed if last < number]
        if is_another or not before:
            self._begin(number)
            return
        nearest = max(before)
        self.dropped += number - nearest - 1
        self._last[self._last.index(nearest)] = number

    def _begin(self, number: int) -> None:
        """Another publisher begins, and what the one before announced is not of it."""
        self._lost_before, self._total = (self.lacking() if self._last else 0), 0
        self.missed += number - 1
        self._last.insert(0, number)
        del self._last[RECORDER_LIMITS.streams :]

    def announce(self, total: int) -> None:
        """Take the number of messages that the publisher has sent; fewer than before are those of another one."""
        if total < self._total:
            self._lost_before = self.lacking()
        self._total = total

    def lacking(self) -> int:
        """Messages that were announced and are missing behind the last one of their publisher.

        A total from before the last message leaves none; those sent before the recorder started are no loss.
        """
        last = self._last[0] if self._last else self.received + self.dropped + self.missed
        return self._lost_before + max(0, self._total - last)


class _Channel:
    """One topic on its way into the bag."""

    def __init__(self, topic: Topic, name: str, writers: Callable[[], Mapping[str, str]], arm: str) -> None:
        self.topic = topic
        self.name = name
        self._writers, self._arm = writers, arm
        self.stamp_of = stamp_reader(topic.type)
        self.publishers: OrderedDict[str, Numbering] = OrderedDict()
        self.totals: dict[str, int] = {}  # published by each node that has announced it
        self._first_totals: dict[str, int] = {}
        self._is_shared = topic.name in EVERY_NODE
        self._only_node: str | None = None  # that publishes this topic, once a message has come; '' where several do

    def sender_of(self, data: bytes) -> tuple[str, bool]:
        """The node that sent a message, which rclpy does not report; whether it is of another arm or program.

        On a topic that every node publishes, the message carries the node's name, up to a ':' or '/'.  In /diagnostics,
        which all arms share, that of this arm comes before it; what others send there has stamps of its own.
        """
        if not self._is_shared:
            if self._only_node is None:
                nodes = set(self._writers().values())
                self._only_node = nodes.pop() if len(nodes) == 1 else ""
            return self._only_node, False
        name = _status_name(self.topic.type, data)
        is_foreign = self.topic.type == _DIAGNOSTICS and not name.startswith(self._arm)
        return re.split("[:/]", name.removeprefix(self._arm))[0].strip() or "?", is_foreign

    def announce(self, node: str, total: int) -> None:
        """A node has published so many messages on this topic."""
        self._first_totals.setdefault(node, total)
        self.totals[node] = total
        for numbering in self._numberings(node):
            numbering.announce(total)

    def _numberings(self, node: str) -> list[Numbering]:
        """Those of a node's messages; all of a topic that one node publishes, whose name may not be known."""
        return [found for name, found in self.publishers.items() if not self._is_shared or name == node]

    def lost_at_end(self, node: str) -> int:
        """Messages that a node announced and that are missing behind the last one of it."""
        found = self._numberings(node)
        if not found:  # what was sent before its first report may have been sent before there was a recorder
            return max(0, self.totals[node] - self._first_totals[node])
        return min(numbering.lacking() for numbering in found)

    def numbering(self, publisher: str) -> Numbering:
        """Counts of one publisher; if there are too many, the oldest is dropped."""
        found = self.publishers.get(publisher)
        if found is None:
            if len(self.publishers) >= RECORDER_LIMITS.publishers:
                self.publishers.popitem(last=False)
            found = self.publishers[publisher] = Numbering(
                lambda: [writer for writer, node in self._writers().items() if node == publisher]
            )
            for node, total in self.totals.items():
                if found in self._numberings(node):
                    found.announce(total)
        return found


class Recorder:
    """Writes every message into the bag and counts it; its memory does not grow with the recording.

    Parameters
    ----------
    bag : open bag; `finish` closes it.
    topics : rows of the interface table, by the full name under which each is recorded.
    mode : 'realtime': log time is the reception and publish time the sending, both of the system
        clock.  'lockstep': both are the stamp in the message, or for a message without one the
        last stamp of the same publisher, so that no wall clock is in the bag; what another arm or program
        sends on /diagnostics has the newest stamp of all.  Before its first it is
        0 in a recording from the start of the run; in one that begins later it is the first stamp of
        all, and no latched message, which may be older, has an earlier one.
    writers : finds the present publishers of a topic: the node of each, by its identity.
    namespace : of the arm, by which its nodes are named in /diagnostics.
    is_late : whether the recording begins in the middle of the run, whatever the numbers of the messages are.
    """

    def __init__(
        self,
        bag: BagWriter,
        topics: Mapping[str, Topic],
        mode: str,
        writers: Callable[[str], Mapping[str, str]],
        namespace: str,
        is_late: bool,
    ) -> None:
        self.failure, self._is_late = "", is_late
        self._received = 0
        self._bag = bag
        self._lockstep = mode == "lockstep"
        self._stamps: dict[str, int] = {}
        self._newest = 0  # stamp of all, ns
        self._begin = 0  # no log time is before it, ns
        self._held: list[tuple[Any, ...]] | None = []  # for `_write`, until the start is known
        self._channels: dict[str, _Channel] = {}
        for name, topic in topics.items():
            bag.add_topic(name, topic.type, offered(topic.depth, topic.latched))
            self._channels[name] = _Channel(topic, name, partial(writers, name), diagnosed_name(namespace, ""))
        if not self._lockstep or all(topic.latched for topic in topics.values()):
            self._held = None

    def announce(self, node: str, name: str, total: int) -> None:
        """Take the number of messages that a node reports as published on a topic, by its full name."""
        if channel := self._channels.get(name):
            channel.announce(node, total)

    def receive(self, name: str, data: bytes, received: int, sent: int, number: int) -> None:
        """Record one message; a message of a topic that is not recorded is ignored.

        Parameters
        ----------
        name : full topic name.
        data : CDR as received.
        received, sent : system clock, ns.
        number : the publisher's sequence number.
        """
        channel = self._channels.get(name)
        if channel is None:
            return
        publisher, is_foreign = channel.sender_of(data)
        one = channel, publisher, is_foreign, data, received, sent, number
        channel.numbering(publisher).add(0 if is_foreign else number)  # of several nodes, with numbers of their own
        self._received += 1
        if self._held is not None:
            stamp = 0 if channel.topic.latched or is_foreign else channel.stamp_of(data)
            if not stamp and len(self._held) < RECORDER_LIMITS.held:
                self._held.append(one)
                return
            is_start = number <= 1 and not self._is_late  # before the first one of a publisher nothing was
            self._begin_at(0 if is_start else stamp or 0)
        self._write(*one)

    def _begin_at(self, begin: int) -> None:
        """Write what came before the first stamp of a message that is not latched."""
        held, self._held, self._begin, self._newest = self._held or [], None, begin, begin
        for one in held:
            self._write(*one)

    def _write(
        self, channel: _Channel, publisher: str, is_foreign: bool, data: bytes, received: int, sent: int, number: int
    ) -> None:
        if self._lockstep:
            received = sent = self._log_time(channel, publisher, is_foreign, data)
        # anybody can send another stamp
        received, sent = min(max(received, 0), _LATEST), min(max(sent, 0), _LATEST)
        self._try(self._bag.write, channel.name, data, received, sent, number)

    def _log_time(self, channel: _Channel, publisher: str, is_foreign: bool, data: bytes) -> int:
        """The time of a message in lockstep, ns; one without a stamp of this arm came with the newest state."""
        stamp = channel.stamp_of(data)
        if is_foreign or (stamp == 0 and channel.topic.is_numbers):  # numbers without a stamp are sent by hand
            stamp = self._newest
        if stamp is None:
            return max(self._stamps.get(publisher, 0), self._begin)
        self._newest = max(self._newest, stamp)
        self._stamps[publisher] = stamp
        if len(self._stamps) > RECORDER_LIMITS.publishers * len(self._channels):
            del self._stamps[next(iter(self._stamps))]
        return max(stamp, self._begin) if channel.topic.latched else stamp

    def flush(self) -> None:
        """Write received messages to disk and see that they are there; call it every few tenths of a second."""
        self._try(self._bag.flush_when_due)
        self._try(self._bag.check)

    def attach(self, name: str, media_type: str, data: bytes) -> bool:
        """Add a file to the bag; False if it cannot be written."""
        return self._try(self._bag.attach, name, media_type, data)

    @property
    def lost_at_disk(self) -> int:
        """Messages that were received and are not in the bag, because it could not be written."""
        return self._received - self._bag.written if self.failure else 0

    def counts(self) -> list[Count]:
        """Received and lost messages by topic and publisher."""
        return [count for channel in self._channels.values() for count in _counts(channel)]

    def total(self, name: str) -> int:
        """A number of `Count` of all topics and publishers, so far."""
        return sum(getattr(count, name) for count in self.counts())

    def finish(self, unfinished: Sequence[str] = ()) -> None:
        """Write counts and losses into the bag and close it; `failure` gives the reason if that was not possible.

        Parameters
        ----------
        unfinished : nodes that ended without their final count.
        """
        if self._held is not None:
            self._begin_at(0)
        self._try(self._bag.metadata, RECORDING, self._record(unfinished))
        self._try(self._bag.close)

    def summary(self, unfinished: Sequence[str] = ()) -> str:
        """How many messages came, and which were lost, for people."""
        lost = losses(self._bag.path, {RECORDING: self._record(unfinished)}, (), {}).sentences(0)
        return f"{self._received} messages{'' if lost else ', none lost'}{''.join(f'. {one[:-1]}' for one in lost)}"

    def _record(self, unfinished: Sequence[str]) -> dict[str, str]:
        """Counts and losses as the bag has them."""
        values = {"mode": "lockstep" if self._lockstep else "realtime"}
        if unfinished:
            values[UNFINISHED] = ", ".join(unfinished)
        for count in self.counts():
            key = f"{count.topic} {count.publisher}"
            values |= {f"{key} {name}": str(getattr(count, name)) for name in ("received", "dropped", "missed")}
            if count.lost_at_end:
                values[f"{key} {LOST_AT_END}"] = str(count.lost_at_end)
        return values

    def _try(self, write: Callable[..., None], *given: Any) -> bool:
        if not self.failure:
            try:
                write(*given)
            except RecordingError as error:
                self.failure = f"recording into {self._bag.path} has stopped: {error}; then start a new recording"
        return not self.failure


def _counts(channel: _Channel) -> Iterator[Count]:
    """Of one topic by publisher; what was lost at the end counts where the node is known by name, else once."""
    lost = {node: channel.lost_at_end(node) for node in channel.totals}
    for publisher, found in channel.publishers.items():
        at_end = lost.pop(publisher, 0)
        yield Count(channel.name, publisher, found.received, found.dropped, found.missed, at_end)
    for node, count in lost.items():
        if count:
            yield Count(channel.name, node, 0, 0, 0, count)


def _status_name(kind: str, data: bytes) -> str:
    """Name in a status, or in the first of a message of /diagnostics; '' where there is none."""
    try:
        reading = Reading(data)
        if kind == _DIAGNOSTICS:
            reading.skip(8)  # stamp
            reading.text()  # frame
            if not reading.count():
                return ""
        reading.skip(1)  # level
        return printable(reading.text()[: RECORDER_LIMITS.name_length].strip("/"))
    except Damage:
        return ""
