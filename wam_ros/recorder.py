"""The recorder without ROS: what is written at what time, and what was lost on the way."""

import struct
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple

from wam_ros.bag import BagWriter, RecordingError
from wam_ros.message_layout import stamp_reader
from wam_ros.topics import Topic

_MOST_STREAMS: Final = 8  # numberings followed in one topic and publisher
_MOST_PUBLISHERS: Final = 64  # publishers told apart in one topic
_NODE_STATUS = "diagnostic_msgs/msg/DiagnosticStatus"
_NODE_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


class Count(NamedTuple):
    """What came from one publisher of a topic.

    `missed` are the messages it had numbered before the first that came: published before the
    recorder was there, or before a late publisher's first message (latched topics).
    """

    topic: str
    publisher: str
    received: int
    dropped: int
    missed: int


class Numbering:
    """Gaps in the numbers that publishers give their messages, counted from 1 without holes.

    A number that follows none of the known ones begins a publisher (restarted, or a second one of
    the same name); else the message belongs to the nearest number before it, and what lies between
    was lost.
    """

    def __init__(self) -> None:
        self.received = 0
        self.dropped = 0
        self.missed = 0
        self._last: list[int] = []

    def add(self, number: int) -> None:
        """Count one message; 0 where its number is not known."""
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

    def __init__(self, topic: Topic, name: str) -> None:
        self.topic = topic
        self.name = name
        self.publisher_of = _publisher_reader(topic)
        self.stamp_of = stamp_reader(topic.type)
        self.publishers: OrderedDict[str, Numbering] = OrderedDict()

    def numbering(self, publisher: str) -> Numbering:
        """Counts of one publisher; the oldest make room where there are too many."""
        found = self.publishers.get(publisher)
        if found is None:
            if len(self.publishers) >= _MOST_PUBLISHERS:
                self.publishers.popitem(last=False)
            found = self.publishers[publisher] = Numbering()
        return found


class Recorder:
    """Puts every message into the bag and keeps count; its memory does not grow with the recording.

    Parameters
    ----------
    bag : open bag; `finish` closes it.
    topics : rows of the interface table, by the full name under which each is recorded.
    mode : 'realtime': log time is the reception and publish time the sending, both of the system
        clock.  'lockstep': both are the stamp in the message, or for a message without one the
        last stamp of the same publisher (0 before its first), so that no wall clock is in the bag.
    qos : what each topic's publishers offer, by full name.
    """

    def __init__(self, bag: BagWriter, topics: Mapping[str, Topic], mode: str, qos: Mapping[str, object]) -> None:
        self.failure = ""
        self._received = 0
        self._bag = bag
        self._lockstep = mode == "lockstep"
        self._stamps: dict[str, int] = {}
        self._channels: dict[str, _Channel] = {}
        for name, topic in topics.items():
            bag.add_topic(name, topic.type, qos[name])
            self._channels[name] = _Channel(topic, name)

    def receive(self, name: str, data: bytes, received: int, sent: int, number: int) -> None:
        """Record one message; one of a topic that is not recorded is left out.

        Parameters
        ----------
        name : full topic name.
        data : CDR as it came.
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
        """Bring what came onto the disk; call it every few tenths of a second."""
        self._try(self._bag.flush_when_due)

    def attach(self, name: str, media_type: str, data: bytes) -> bool:
        """Put a file into the bag; False where the disk does not take it."""
        return self._try(lambda: self._bag.attach(name, media_type, data))

    @property
    def lost_at_disk(self) -> int:
        """Messages that came and are not in the bag, because it could not be written."""
        return self._received - self._bag.written if self.failure else 0

    def counts(self) -> list[Count]:
        """What came and what was lost, per topic and publisher."""
        return [
            Count(channel.name, publisher, numbering.received, numbering.dropped, numbering.missed)
            for channel in self._channels.values()
            for publisher, numbering in channel.publishers.items()
        ]

    def dropped(self) -> int:
        """Messages lost on the way to the recorder."""
        return sum(count.dropped for count in self.counts())

    def finish(self) -> None:
        """Write counts and drops into the bag and close it; `failure` says where that was not possible."""
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
            f"bag {self._bag.path} cannot be written any more: {error}; free some space and start a new recording"
        )


def summary(counts: Iterable[Count]) -> str:
    """One line for people: how many messages came and where some were lost."""
    listed = list(counts)
    lost = [f"{c.dropped} of {c.topic} from {c.publisher}" for c in listed if c.dropped]
    total = sum(c.received for c in listed)
    return f"{total} messages, " + ("none lost" if not lost else "lost: " + ", ".join(lost))


def _publisher_reader(topic: Topic) -> Callable[[bytes], str]:
    """A function that tells who sent a message; rclpy does not say it.

    A topic of several publishers carries the node's name in its message, up to a ':' or '/'.
    """
    if topic.type == _NODE_STATUS:
        return lambda data: _node_name(data, 5)
    if topic.type == _NODE_DIAGNOSTICS and len(topic.publisher) > 1:
        return _first_status_name
    sender = topic.publisher[0] if topic.publisher else ""  # a program of the user's
    return lambda data: sender


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
