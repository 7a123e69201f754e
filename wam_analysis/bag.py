"""Bags as named numpy columns, without ROS.

Reads what `wam_ros.bag` and rosbag2 write, whole or in parts: MCAP of profile ros2 with messages in
CDR, a directory of one or several files or a single file, in chunks or not, with indexes or without.

What is guaranteed: a value that differs from what was written comes out only where the file bears no
checksum over it.  The checksums of chunks, attachments and the summary are checked in what is read,
that over all data when all is read.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.bag_file import files, is_asked, merge, opened, type_of
from wam_analysis.cdr import Decoder
from wam_analysis.columns import (
    BoolColumns,
    ClockColumns,
    Collector,
    Columns,
    JointColumns,
    Messages,
    PointColumns,
    WrenchColumns,
)
from wam_analysis.message_groups import Times
from wam_ros.mcap_file import NEVER, Batch, Found, McapFile, log_times, messages, together
from wam_ros.mcap_records import BagError, Bytes, Damage
from wam_ros.message_text import Fields

__all__ = [
    "Bag", "BagError", "BoolColumns", "ClockColumns", "Columns", "JointColumns", "Messages", "PointColumns", "Raw",
    "WrenchColumns", "raw", "read",
]  # fmt: skip


class Bag(NamedTuple):
    """A bag in memory: columns and type by topic, attachments and metadata records by name.

    `counts` are the messages of every topic in its files, also of those that were not asked for; empty
    in a bag that did not come from files.
    """

    path: Path
    topics: dict[str, Columns]
    types: dict[str, str]
    attachments: dict[str, bytes]
    metadata: dict[str, dict[str, str]]
    counts: Mapping[str, int] = MappingProxyType({})

    @property
    def first_ns(self) -> int:
        """Log time of the first message that was read, 0 where none was."""
        found = (columns.log_time_ns for columns in self.topics.values())
        return min((int(times.min()) for times in found if len(times)), default=0)


class Raw(NamedTuple):
    """Messages of a topic as they were serialized, in the order in which they stand in the files."""

    type: str
    log_time_ns: Times
    data: list[bytes]
    decode: Callable[[bytes], Any]


def read(
    path: str | Path,
    topics: Collection[str] | None = None,
    begin_ns: int = 0,
    end_ns: int = NEVER,
    *,
    may_lack: bool = False,
) -> Bag:
    """Read a bag, the whole of it or some topics or some time.

    Chunks of the file that hold nothing of what is asked for are not read.

    Parameters
    ----------
    path : bag directory or .mcap file.
    topics : names of the topics to read, one without a leading '/' in every namespace; None reads all.
    begin_ns, end_ns : log times to read, begin_ns <= t < end_ns.
    may_lack : whether topics asked for may be missing in the bag.

    Raises
    ------
    BagError
        where it is missing, empty, cut off, damaged or not a ROS 2 bag, or lacks a topic asked for.
    ValueError
        where the time ends before it begins.
    """
    if begin_ns > end_ns:
        raise ValueError(
            f"{path} is to be read from {begin_ns} ns to {end_ns} ns; the end must not be before the begin"
        )
    counts: Counter[str] = Counter()
    types: dict[str, str] = {}
    collectors: dict[str, Collector] = {}
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}

    def collector(topic: str, kind: str, definitions: dict[str, Fields]) -> Collector:
        if topic not in collectors:
            types[topic] = kind
            collectors[topic] = Collector(kind, definitions, begin_ns, end_ns)
        elif not collectors[topic].takes(kind, definitions):
            raise Damage(f"topic {topic} is of type {types[topic]} and of another one")
        return collectors[topic]

    for file in files(Path(path)):
        with opened(file) as mcap:
            if topics is None and begin_ns <= 0 and end_ns >= NEVER:
                mcap.check_all()
            for topic, kind, definitions, buffer, found in _parts(mcap, topics, begin_ns, end_ns):
                collector(topic, kind, definitions).add(buffer, found)
            for channel in mcap.channels.values():
                if is_asked(channel.topic, topics):
                    collector(channel.topic, *type_of(mcap, channel))
            said = (mcap.statistics or mcap.count()).counts
            counts.update({channel.topic: 0 for channel in mcap.channels.values()})
            for number, count in said.items():
                counts[mcap.channels[number].topic] += count
            attachments.update(mcap.attachments())
            merge(metadata, mcap.metadata())
    if not may_lack:
        _check_has(path, topics, counts)
    columns = {topic: found.columns(f"{path}, topic {topic}") for topic, found in sorted(collectors.items())}
    return Bag(Path(path), columns, types, attachments, metadata, dict(counts))


def raw(path: str | Path, topics: Collection[str] | None = None) -> dict[str, Raw]:
    """Serialized messages of a bag by topic; parameters and errors as those of `read`."""
    present: set[str] = set()
    found: dict[str, Raw] = {}
    times: dict[str, list[Times]] = {}
    for file in files(Path(path)):
        with opened(file) as mcap:
            for topic, kind, definitions, buffer, some in _parts(mcap, topics, 0, NEVER):
                decode = Decoder(kind, definitions)
                entry = found.setdefault(topic, Raw(kind, np.empty(0, np.int64), [], decode))
                if entry.type != kind:
                    raise Damage(f"topic {topic} is of type {entry.type} and of {kind}")
                times.setdefault(topic, []).append(log_times(buffer, some.offsets))
                entry.data.extend(messages(buffer, some))
            present |= {channel.topic for channel in mcap.channels.values()}
            for channel in mcap.channels.values():
                if is_asked(channel.topic, topics) and channel.topic not in found:
                    kind, definitions = type_of(mcap, channel)
                    found[channel.topic] = Raw(kind, np.empty(0, np.int64), [], Decoder(kind, definitions))
    _check_has(path, topics, present)
    for topic, parts in times.items():
        found[topic] = found[topic]._replace(log_time_ns=np.concatenate(parts))
    return found


def _check_has(path: str | Path, asked: Collection[str] | None, present: Collection[str]) -> None:
    for name in asked or ():
        if not any(is_asked(topic, [name]) for topic in present):
            raise BagError(
                f"{path} has no topic '{name}'; its topics: {', '.join(sorted(present)) or 'none'}. "
                "Names may stand without namespace; may_lack=True takes what is there"
            )


def _parts(
    mcap: McapFile, topics: Collection[str] | None, begin: int, end: int
) -> Iterator[tuple[str, str, dict[str, Fields], Bytes, Found]]:
    """Messages of each asked topic in each batch; that none is missing is checked at the end."""
    numbers, times = None, (0, NEVER)
    if mcap.has_all_definitions():  # else any chunk may hold one that is needed
        times = begin, end
        if topics is not None:
            numbers = frozenset(number for number, channel in mcap.channels.items() if is_asked(channel.topic, topics))
    types: dict[int, tuple[str, dict[str, Fields]]] = {}
    counts: dict[int, int] = {}
    for batch in mcap.batches(numbers, *times):
        for topic, members in _by_topic(mcap, batch).items():
            if not is_asked(topic, topics):
                continue
            for number, found in members:
                counts[number] = counts.get(number, 0) + len(found.offsets)
                if number not in types:
                    types[number] = type_of(mcap, mcap.channels[number])
            all_found = together([found for _, found in members])
            if len(members) > 1:
                order = np.argsort(all_found.offsets)
                all_found = Found(all_found.offsets[order], all_found.sizes[order])
            yield topic, *types[members[0][0]], batch.buffer, all_found
    if mcap.statistics is None or begin > 0 or end < NEVER:
        return
    for number, channel in mcap.channels.items():
        expected = mcap.statistics.counts.get(number, 0)
        if is_asked(channel.topic, topics) and counts.get(number, 0) != expected:
            raise Damage(f"topic {channel.topic} has {counts.get(number, 0)} messages instead of {expected}")


def _by_topic(mcap: McapFile, batch: Batch) -> dict[str, list[tuple[int, Found]]]:
    topics: dict[str, list[tuple[int, Found]]] = {}
    for number, found in batch.found.items():
        if number not in mcap.channels:
            raise Damage(f"a message is on channel {number}, which is not defined")
        topics.setdefault(mcap.channels[number].topic, []).append((number, found))
    return topics
