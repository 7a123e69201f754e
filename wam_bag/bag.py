"""Bags as named numpy columns, without ROS.

Reads what `wam_bag.bag_writer` and rosbag2 write, whole or in parts: MCAP with messages in CDR, of ROS 1 or in
JSON, a directory of one or several files or a single file, in chunks or not, with indexes or without; and, by rosbags,
SQLite and bags of ROS 1.

Guaranteed: a value that differs from what was written is returned only if no checksum in the file covers it.
The checksums of chunks, attachments and the summary are checked in what is read, the one over all data if
everything is read.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from mcap.opcode import Opcode
from mcap.records import Channel

from wam_bag import safe_yaml
from wam_bag.bag_file import files, is_selected, opened, parts, type_of
from wam_bag.cdr import ENCODINGS
from wam_bag.columns import (
    BoolColumns,
    Collector,
    Columns,
    JointColumns,
    Messages,
    PointColumns,
    Series,
    TableColumns,
    WrenchColumns,
    series,
)
from wam_bag.errors import BagError, Damage
from wam_bag.losses import PARAMETERS, RECORDING, Losses, losses
from wam_bag.mcap_file import BagFile
from wam_bag.mcap_records import MessageCounts, together
from wam_bag.message_search import NEVER
from wam_bag.message_text import full_name

__all__ = [
    "Bag", "BagError", "BoolColumns", "Columns", "JointColumns", "Messages", "PointColumns",
    "TableColumns", "WrenchColumns", "read",
]  # fmt: skip


class _Topics(dict[str, Columns]):
    """Columns by topic; a topic that is not there is answered with those that are."""

    def __missing__(self, topic: str) -> Columns:
        raise KeyError(f"the bag has no topic '{topic}'; its topics: {', '.join(self) or 'none'}")


class Bag(NamedTuple):
    """A bag in memory: columns by topic, attachments and metadata records by name.

    `types`, `counts`, the messages, and `first` and `last`, log times, ns, are of all that is in its files, also of
    topics that were not selected; the counts are empty in a bag that did not come from files.  `unread` are topics in
    encodings that are not read; their types name these.  Of attachments of one name it has the last one, and of
    parameters those of all nodes; the metadata 'recording' is the recorder's, see docs/bags.md.
    """

    path: Path
    topics: dict[str, Columns]
    types: dict[str, str]
    attachments: dict[str, bytes]
    metadata: dict[str, dict[str, str]]
    counts: Mapping[str, int] = {}
    first: int = 0
    last: int = 0
    unread: frozenset[str] = frozenset()

    def __repr__(self) -> str:
        """Path and counts, not every array."""
        messages = sum(len(columns.log_time_ns) for columns in self.topics.values())
        return f"Bag({str(self.path)!r}, {len(self.topics)} topics, {messages} messages)"

    def series(self, topic: str) -> Series:
        """A topic as named series of equal length, see `wam_bag.columns.series`.

        Parameters
        ----------
        topic : its name; one without a leading '/' is looked for in every namespace, the outermost first.

        Raises
        ------
        BagError
            if the bag has no such topic, or several.
        """
        named = [name for name in self.topics if is_selected(name, [topic])]
        found = [name for name in named if name.count("/") == min(name.count("/") for name in named)]
        if len(found) != 1:
            listed = ", ".join(found or sorted(self.topics)) or "none"
            raise BagError(f"{self.path}: {len(found) or 'no'} topics are named '{topic}'; choose one of {listed}")
        return series(self.topics[found[0]])

    def to_pandas(self, topic: str) -> Any:
        """A topic as a DataFrame with the time, s, as its index; arguments and errors as those of `series`.

        Raises
        ------
        ModuleNotFoundError
            if pandas is not installed.
        """
        try:
            import pandas
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(
                "a DataFrame needs pandas: pip install pandas; Bag.series has the same as arrays", name="pandas"
            ) from error
        return pandas.DataFrame(self.series(topic)).set_index("time")

    @property
    def losses(self) -> Losses:
        """What it lacks of what was published."""
        return losses(self.path, self.metadata, self.attachments, self.counts)

    @property
    def mode(self) -> str:
        """'realtime', 'lockstep' or 'unknown': by the recorder's metadata, else by the parameters of its nodes.

        A recorder that was killed left only the parameters.
        """
        parameters = self.attachments.get(PARAMETERS)
        recorded = self.metadata.get(RECORDING, {}).get("mode")
        if recorded is not None or parameters is None:
            return recorded or "unknown"
        try:
            nodes = [node["ros__parameters"] for node in safe_yaml.load(parameters).values()]
            modes = {node.get("timing", {}).get("mode", node.get("timing.mode")) for node in nodes}
        except (yaml.YAMLError, ValueError, LookupError, TypeError, AttributeError):
            return "unknown"
        known = sorted(str(mode) for mode in modes - {None})
        return known[0] if len(known) == 1 else "unknown"


def read(
    path: str | Path,
    topics: Collection[str] | None = None,
    begin_ns: int = 0,
    end_ns: int = NEVER,
    *,
    may_lack: bool = False,
    as_messages: bool = False,
) -> Bag:
    """Read a bag: all of it, or some topics, or some time.

    Chunks of the file without any selected message are not read; without topics, messages only where a file has no
    summary that counts them.

    Parameters
    ----------
    path : bag directory or .mcap file.
    topics : names of the topics to read, one without a leading '/' in every namespace; None reads all.
    begin_ns, end_ns : log times to read, begin_ns <= t < end_ns.
    may_lack : whether selected topics may be missing in the bag.
    as_messages : whether messages of every type are read as objects, and none as columns.

    Raises
    ------
    BagError
        if it is missing, empty, cut off, damaged or not a ROS 2 bag, or lacks a selected topic.
    ValueError
        if the end is before the start.
    """
    if begin_ns > end_ns:
        raise ValueError(
            f"{path} is to be read from {begin_ns} ns to {end_ns} ns; the end must not be before the start"
        )
    collectors: dict[str, Collector] = {}
    counts, types, every, unread = Counter[str](), dict[str, str](), list[MessageCounts](), set[str]()
    attachments, metadata = dict[str, bytes](), dict[str, dict[str, str]]()
    for one in files(Path(path)):
        with opened(one) as file:
            take = partial(_collector, collectors, file, as_messages)
            if topics is None and begin_ns <= 0 and end_ns >= NEVER:
                file.check_all()
            for channel, batch in parts(file, topics, begin_ns, end_ns):
                collector = take(channel)
                try:
                    collector.add(batch)
                except Damage as error:
                    raise Damage(f"topic {channel.topic}: {error}") from None
            every.append(listed := file.counts or file.loaded)
            for number, channel in file.channels.items():
                counts[channel.topic] += listed.by_channel[number]
                schema = file.schemas.get(channel.schema_id)
                kind = full_name(schema.name) if schema else "?"
                if channel.topic not in types and channel.message_encoding not in ENCODINGS:
                    unread.add(channel.topic)
                    kind += f" in {channel.message_encoding or 'no encoding'}, which is not read"
                types.setdefault(channel.topic, kind)
                if is_selected(channel.topic, topics):
                    take(channel)
            for item in file.records(Opcode.ATTACHMENT):
                before = attachments.get(item.name) if item.name == PARAMETERS else None
                attachments[item.name] = item.data if before is None else with_nodes_of(before, item.data)
            for item in file.records(Opcode.METADATA):
                metadata.setdefault(item.name, {}).update(item.metadata)
    if not may_lack:
        _require(path, topics, types)
    columns = _Topics({t: one.columns(f"{path}, topic {t}") for t, one in sorted(collectors.items())})
    types |= {topic: one.kind.name for topic, one in collectors.items()}
    first, last, _ = together(every)
    return Bag(
        Path(path), columns, dict(sorted(types.items())), attachments, metadata, counts, first, last, frozenset(unread)
    )


def _collector(collectors: dict[str, Collector], file: BagFile, as_messages: bool, channel: Channel) -> Collector:
    """The collector of a topic, made for its first channel."""
    kind = type_of(file, channel)
    collector = collectors.setdefault(channel.topic, Collector(kind, as_messages))
    if collector.kind != kind:
        raise Damage(f"topic {channel.topic} has messages of two types, {collector.kind.name} and {kind.name}")
    return collector


def _require(path: str | Path, selected: Collection[str] | None, present: Collection[str]) -> None:
    for name in selected or ():
        if not any(is_selected(topic, [name]) for topic in present):
            raise BagError(
                f"{path} has no topic '{name}'; its topics: {', '.join(sorted(present)) or 'none'}. "
                "Names may omit the namespace; may_lack=True reads the topics that are there"
            )


# parameters of nodes that a recorder attached


def with_nodes_of(before: bytes, after: bytes) -> bytes:
    """The later parameters with those of nodes that only the earlier ones have, unless one of them is unreadable.

    A recorder attaches them again when it knows those of more nodes, and a tool that merges bags takes those of each.
    """
    try:
        nodes, known = safe_yaml.load(after), safe_yaml.load(before)
    except (yaml.YAMLError, UnicodeDecodeError):
        return after
    if not (isinstance(nodes, dict) and isinstance(known, dict) and known.keys() - nodes.keys()):
        return after
    return safe_yaml.dump({**known, **nodes}).encode()
