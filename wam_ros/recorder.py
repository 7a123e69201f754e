"""The recorder without ROS: which messages are written with which time, and which were lost on the way."""

import struct
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from typing import Final, NamedTuple

from wam_bag.bag_writer import BagWriter, RecordingError
from wam_bag.message_layout import stamp_reader
from wam_description.topics import Topic

_MOST_STREAMS: Final = 8  # numberings tracked for one topic and publisher
_MOST_PUBLISHERS: Final = 64  # publishers counted separately in one topic
_NODE_STATUS = "diagnostic_msgs/msg/DiagnosticStatus"
_NODE_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


class Count(NamedTuple):
    """Messages from one publisher of a topic.

    `missed` are the messages it had numbered before the first one received: published before the
    recorder started, or before the first message of a late publisher (latched topics).
    """

    topic: str
    publisher: str
    received: int
    dropped: int
    missed: int


class Numbering:
    """Gaps in the numbers that publishers give their messages, counted from 1 without holes.

    A number that is above none of the known ones starts a new publisher (restarted, or a second one of the same name);
    otherwise the message follows the nearest number before it, and the messages between the two were lost.
    """

    def __init__(self) -> None:
        self.received = 0
        self.dropped = 0
        self.missed = 0
        self._last: list[int] = []

    def add(self, number: int) -> None:
        """Count one message; 0 if its number is not known."""
        self.received += 1
        if not number:
            return
        if self._last and self._last[0] == number - 1:  # one publisher, nothing lost
            self._last[0] = number
            return
        before = [last for last in self._last if last < number]
        if not before:
            if not self._last:
                self.missed += number - 1
            self._last.insert(0, number)
            del self._last[_MOST_STREAMS:]
            return
        nearest = max(before)
        self.dropped += number - nearest - 1
        self._last[self._last.index(nearest)] = number


class _Channel:
    """One topic on its way into the bag."""

    def __init__(self, topic: Topic, name: str, sender: Callable[[str], str]) -> None:
        self.topic = topic
        self.name = name
        self.publisher_of = _publisher_reader(topic, partial(sender, name))
        self.stamp_of = stamp_reader(topic.type)
        self.publishers: OrderedDict[str, Numbering] = OrderedDict()

    def numbering(self, publisher: str) -> Numbering:
        """Counts of one publisher; if there are too many, the oldest is dropped."""
        found = self.publishers.get(publisher)
        if found is None:
            if len(self.publishers) >= _MOST_PUBLISHERS:
                self.publishers.popitem(last=False)
            found = self.publishers[publisher] = Numbering()
        return found


class Recorder:
    """Writes every message into the bag and counts it; its memory does not grow with the recording.

    Parameters
    ----------
    bag : open bag; `finish` closes it.
    topics : rows of the interface table, by the full name under which each is recorded.
    mode : 'realtime': log time is the reception and publish time the sending, both of the system
        clock.  'lockstep': both are the stamp in the message, or for a message without one the
        last stamp of the same publisher (0 before its first), so that no wall clock is in the bag.
    qos : what each topic's publishers offer, by full name.
    """

    def __init__(
        self,
        bag: BagWriter,
        topics: Mapping[str, Topic],
        mode: str,
        qos: Mapping[str, object],
        sender: Callable[[str], str],
    ) -> None:
        self.failure = ""
        self._received = 0
        self._bag = bag
        self._lockstep = mode == "lockstep"
        self._stamps: dict[str, int] = {}
        self._channels: dict[str, _Channel] = {}
        for name, topic in topics.items():
            bag.add_topic(name, topic.type, qos[name])
            self._channels[name] = _Channel(topic, name, sender)

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
        publisher = channel.publisher_of(data)
        channel.numbering(publisher).add(number)
        if self._lockstep:
            stamp = channel.stamp_of(data)
            if stamp is None:
                stamp = self._stamps.get(publisher, 0)
            else:
                self._stamps[publisher] = stamp
            received = sent = stamp
        self._received += 1
        if self.failure:
            return
        try:
            self._bag.write(name, data, received, sent, number)
        except RecordingError as error:
            self._fail(error)

    def flush(self) -> None:
        """Write received messages to disk; call it every few tenths of a second."""
        self._try(self._bag.flush_when_due)

    def attach(self, name: str, media_type: str, data: bytes) -> bool:
        """Add a file to the bag; False if it cannot be written."""
        return self._try(lambda: self._bag.attach(name, media_type, data))

    @property
    def lost_at_disk(self) -> int:
        """Messages that were received and are not in the bag, because it could not be written."""
        return self._received - self._bag.written if self.failure else 0

    def counts(self) -> list[Count]:
        """Received and lost messages by topic and publisher."""
        return [
            Count(channel.name, publisher, numbering.received, numbering.dropped, numbering.missed)
            for channel in self._channels.values()
            for publisher, numbering in channel.publishers.items()
        ]

    def dropped(self) -> int:
        """Messages lost on the way to the recorder."""
        return sum(count.dropped for count in self.counts())

    def finish(self) -> None:
        """Write counts and drops into the bag and close it; `failure` gives the reason if that was not possible."""
        values = {"mode": "lockstep" if self._lockstep else "realtime"}
        for count in self.counts():
            key = f"{count.topic} {count.publisher}"
            values[f"{key} received"] = str(count.received)
            values[f"{key} dropped"] = str(count.dropped)
            values[f"{key} missed"] = str(count.missed)
        self._try(lambda: self._bag.metadata("recording", values))
        self._try(self._bag.close)

    def _try(self, write: Callable[[], None]) -> bool:
        if not self.failure:
            try:
                write()
            except RecordingError as error:
                self._fail(error)
        return not self.failure

    def _fail(self, error: RecordingError) -> None:
        self.failure = (
            f"bag {self._bag.path} can no longer be written: {error}; free some space and start a new recording"
        )


def summary(counts: Iterable[Count]) -> str:
    """One line for people: how many messages came and of which topics some were lost."""
    listed = list(counts)
    lost = [f"{c.dropped} of {c.topic} from {c.publisher}" for c in listed if c.dropped]
    total = sum(c.received for c in listed)
    return f"{total} messages, " + ("none lost" if not lost else "lost: " + ", ".join(lost))


def _publisher_reader(topic: Topic, sender: Callable[[], str]) -> Callable[[bytes], str]:
    """A function that finds the node that sent a message, which rclpy does not report.

    Parameters
    ----------
    topic : row of the table of topics; one that every node publishes carries the node's name, up to a ':' or '/'.
    sender : finds the only publisher of any other topic, once a message has come.
    """
    if topic.type == _NODE_STATUS:
        return lambda data: _node_name(data, 5)
    if topic.type == _NODE_DIAGNOSTICS:
        return _first_status_name
    found = cache(sender)
    return lambda data: found()


def _first_status_name(data: bytes) -> str:
    try:
        (frame,) = struct.unpack_from("<I", data, 12)
        position = _aligned(16 + frame)
        (count,) = struct.unpack_from("<I", data, position)
    except struct.error:
        return "?"
    return _node_name(data, position + 5) if count else "?"


def _node_name(data: bytes, position: int) -> str:
    try:
        position = _aligned(position)
        (length,) = struct.unpack_from("<I", data, position)
    except struct.error:
        return "?"
    name = data[position + 4 : position + 3 + length].decode("utf-8", "replace").strip("/")
    return name.split(":")[0].split("/")[0].strip() or "?"


def _aligned(position: int) -> int:
    return position + -position % 4
