"""A bag cut out of another one: some of its time, some of its topics, and everything that explains them."""

import struct
from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.records import Attachment, Channel, Schema

from wam_bag import safe_yaml
from wam_bag.bag_file import TopicPart, files, is_selected, opened, parts
from wam_bag.contents import add_attachments
from wam_bag.errors import BagError, Damage, command
from wam_bag.mcap_file import McapFile
from wam_bag.mcap_records import HEAD
from wam_bag.mcap_writer import McapWriter
from wam_bag.message_search import NEVER, Found, log_times, messages
from wam_bag.metadata import LIBRARY, FileSummary, bag_information, profiles, topic_information, write_metadata

CHUNK_SIZE: Final = 4 * 2**20  # bytes; large ones compress better, and a cut bag is small
LEVEL: Final = 19  # of zstd: the strongest that needs no more memory to read
OWN: Final = "rosbag2"  # metadata record that describes the file it is in, and so is written again
CUT: Final = "cut"  # metadata record of what was taken
LATCHED: Final = ("transient_local", 1)
_HEAD = struct.Struct("<2xIQQ")  # sequence, log and publish time in a message record


class CutMessage(NamedTuple):
    """A message in a bag; times in ns, the channel by its id."""

    log_time: int
    channel: int
    sequence: int
    publish_time: int
    data: bytes


class Cut(NamedTuple):
    """What is taken: log times ``begin_ns <= t < end_ns``; topics named as for `wam_bag.bag.read`, None for all.

    Of a topic in `thinned`, only the first of so many messages, ``{"sim/joint_states": 10}``.
    """

    begin_ns: int = 0
    end_ns: int = NEVER
    topics: Collection[str] | None = None
    thinned: Mapping[str, int] = MappingProxyType({})


def cut(source: Path, target: Path, part: Cut) -> Path:
    """Write a bag that holds a part of another one.

    Messages, stamps, log times, sequence numbers, definitions, attachments and metadata records are those of the
    source.  Of latched topics everything before the part is kept as well, at its own time: it was valid when the part
    begins.  Messages are in the order of log time, topic and sequence, in chunks of a fixed size, everything else in
    the order of names, so that equal content gives an equal file.

    Parameters
    ----------
    source : bag directory or .mcap file, of one file or several.
    target : directory of the new bag.

    Returns
    -------
    Path
        the file in it.

    Raises
    ------
    BagError
        if the source cannot be read, lacks a topic, or has no message in the part.
    FileExistsError
        if the target exists.
    """
    taken = _read(source, part)
    if lacking := [
        name for name in part.topics or () if not any(is_selected(topic, [name]) for topic in taken.channels)
    ]:
        raise BagError(f"{source} has no topic {', '.join(lacking)}; what it has: {command('wam bag info', source)}")
    times = [message.log_time for some in taken.messages.values() for message in some]
    if not any(part.begin_ns <= time < part.end_ns for time in times):
        raise BagError(
            f"{source} has nothing from {part.begin_ns} to {part.end_ns} ns; "
            f"its times: {command('wam bag info', source)}"
        )
    target.mkdir(parents=True)
    file = target / f"{target.name}_0.mcap"
    with file.open("xb", buffering=0) as stream:
        information = _write(McapWriter(stream, LIBRARY, CHUNK_SIZE, LEVEL), file.name, taken, part)
    write_metadata(target, information)
    return file


class _Taken(NamedTuple):
    """Parts of a bag: definitions by topic, messages by topic, attachments and metadata records by name."""

    channels: dict[str, tuple[Channel, Schema]]
    messages: dict[str, list[CutMessage]]
    attachments: dict[str, Attachment]
    metadata: dict[str, dict[str, str]]


def _read(source: Path, part: Cut) -> _Taken:
    taken = _Taken({}, {}, {}, {})
    for path in files(source):
        with opened(path) as file:
            file.check_all()
            for some in parts(file, part.topics):
                _take(some, part, taken)
            for channel in file.channels.values():
                if is_selected(channel.topic, part.topics):
                    _define(file, channel, taken)
            add_attachments(taken.attachments, file.attachments())
            taken.metadata.update({name: values for name, values in file.metadata().items() if name != OWN})
    return taken


def _take(some: TopicPart, part: Cut, taken: _Taken) -> None:
    """The messages of some that are in the part."""
    times = log_times(some.buffer, some.found)
    begin = 0 if _is_latched(some.channel) else part.begin_ns
    kept = taken.messages.setdefault(some.channel.topic, [])
    rows = np.flatnonzero((times >= begin) & (times < part.end_ns))
    for name, each in part.thinned.items():
        rows = rows[::each] if is_selected(some.channel.topic, [name]) else rows
    found = Found(some.found.offsets[rows], some.found.sizes[rows])
    for start, data in zip(found.offsets.tolist(), messages(some.buffer, found), strict=True):
        sequence, log_time, publish_time = _HEAD.unpack_from(some.buffer.data, start + HEAD.size)
        kept.append(CutMessage(log_time, 0, sequence, publish_time, data))


def _define(file: McapFile, channel: Channel, taken: _Taken) -> None:
    if channel.schema_id not in file.schemas:
        raise Damage(f"topic {channel.topic} has no schema")
    schema = file.schemas[channel.schema_id]
    known = taken.channels.setdefault(channel.topic, (channel, schema))[1]
    if (known.name, known.encoding, known.data) != (schema.name, schema.encoding, schema.data):
        raise Damage(f"topic {channel.topic} is of several types")


def _is_latched(channel: Channel) -> bool:
    """Whether publishers keep their last message for late subscribers; rosbag2 writes the policy as word or number."""
    offered = profiles(channel.metadata.get("offered_qos_profiles", ""))
    return any(profile.get("durability") in LATCHED for profile in offered)


def _write(writer: McapWriter, name: str, taken: _Taken, part: Cut) -> dict[str, Any]:
    """Fill and finish a file; returns the content of metadata.yaml."""
    schemas: dict[str, int] = {}
    ids: dict[str, int] = {}
    # by name: a source may have its topics in any order
    for topic, (channel, schema) in sorted(taken.channels.items()):
        if schema.name not in schemas:
            schemas[schema.name] = writer.schema(schema.name, schema.encoding, schema.data)
        ids[topic] = writer.channel(topic, channel.message_encoding, schemas[schema.name], channel.metadata)
    kept = [message._replace(channel=ids[topic]) for topic, some in taken.messages.items() for message in some]
    for log_time, channel_id, sequence, publish_time, data in sorted(kept):
        writer.add(channel_id, log_time, publish_time, sequence, data)
    writer.flush()
    for _, attachment in sorted(taken.attachments.items()):
        writer.attach(attachment)
    topics = "*" if part.topics is None else " ".join(part.topics)
    record = {"begin_ns": str(part.begin_ns), "end_ns": str(part.end_ns), "topics": topics}
    if part.thinned:
        record["thinned"] = " ".join(f"{name}:{each}" for name, each in part.thinned.items())
    for title, values in sorted({**taken.metadata, CUT: record}.items()):
        writer.metadata(title, dict(sorted(values.items())))
    information = bag_information(
        [FileSummary(name, writer.first, writer.last, sum(writer.counts.values()))],
        [topic_information(*taken.channels[topic]) for topic in ids],
        [writer.counts.get(number, 0) for number in ids.values()],
    )
    writer.metadata(OWN, {"serialized_metadata": safe_yaml.dump(information).strip()})
    writer.finish()
    return information
