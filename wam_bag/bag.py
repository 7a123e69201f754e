"""Bags as named numpy columns, without ROS.

Reads what `wam_bag.bag_writer` and rosbag2 write, whole or in parts: MCAP with messages in CDR, of ROS 1 or in
JSON, a directory of one or several files or a single file, in chunks or not, with indexes or without.

Guaranteed: a value that differs from what was written is returned only if no checksum in the file covers it.
The checksums of chunks, attachments and the summary are checked in what is read, the one over all data if
everything is read.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from mcap.records import Channel

from wam_bag.bag_file import is_selected, opened, parts, type_of
from wam_bag.columns import (
    BoolColumns,
    ClockColumns,
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
from wam_bag.contents import contents
from wam_bag.errors import BagError, Damage
from wam_bag.mcap_file import McapFile
from wam_bag.message_search import NEVER

__all__ = [
    "Bag", "BagError", "BoolColumns", "ClockColumns", "Columns", "JointColumns", "Messages", "PointColumns",
    "TableColumns", "WrenchColumns", "read",
]  # fmt: skip


class _Topics(dict[str, Columns]):
    """Columns by topic; a topic that is not there is answered with those that are."""

    def __missing__(self, topic: str) -> Columns:
        raise KeyError(f"the bag has no topic '{topic}'; its topics: {', '.join(self) or 'none'}")


class Bag(NamedTuple):
    """A bag in memory: columns and type by topic, attachments and metadata records by name.

    `counts` are the messages of every topic in its files, also of topics that were not selected; empty
    in a bag that did not come from files.
    """

    path: Path
    topics: dict[str, Columns]
    types: dict[str, str]
    attachments: dict[str, bytes]
    metadata: dict[str, dict[str, str]]
    counts: Mapping[str, int] = MappingProxyType({})

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
    def first_ns(self) -> int:
        """Log time of the first message that was read, 0 if none was."""
        found = (columns.log_time_ns for columns in self.topics.values())
        return min((int(times.min()) for times in found if len(times)), default=0)


def read(
    path: str | Path,
    topics: Collection[str] | None = None,
    begin_ns: int = 0,
    end_ns: int = NEVER,
    *,
    may_lack: bool = False,
) -> Bag:
    """Read a bag: all of it, or some topics, or some time.

    Chunks of the file without any selected message are not read.

    Parameters
    ----------
    path : bag directory or .mcap file.
    topics : names of the topics to read, one without a leading '/' in every namespace; None reads all.
    begin_ns, end_ns : log times to read, begin_ns <= t < end_ns.
    may_lack : whether selected topics may be missing in the bag.

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
    found = contents(path)
    if not may_lack:
        _require(path, topics, found.topics)
    for file in found.files:
        with opened(file) as mcap:
            if topics is None and begin_ns <= 0 and end_ns >= NEVER:
                mcap.check_all()
            for part in parts(mcap, topics, begin_ns, end_ns):
                collector = _collector(collectors, mcap, part.channel, (begin_ns, end_ns))
                try:
                    collector.add(part.buffer, part.found)
                except Damage as error:
                    raise Damage(f"topic {part.channel.topic}: {error}") from None
            for channel in mcap.channels.values():
                if is_selected(channel.topic, topics):
                    _collector(collectors, mcap, channel, (begin_ns, end_ns))
    columns = _Topics({t: one.columns(f"{path}, topic {t}") for t, one in sorted(collectors.items())})
    types = {topic: one.kind.name for topic, one in collectors.items()}
    counts = {topic: one.messages for topic, one in found.topics.items()}
    return Bag(Path(path), columns, types, found.attachments, found.metadata, counts)


def _collector(collectors: dict[str, Collector], mcap: McapFile, channel: Channel, times: tuple[int, int]) -> Collector:
    """The collector of a topic, made for its first channel."""
    kind = type_of(mcap, channel)
    collector = collectors.setdefault(channel.topic, Collector(kind, *times))
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
