"""A bag cut out of another one: some of its time, some of its topics, all that explains them."""

import struct
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from wam_analysis.bag_file import files, is_asked, opened
from wam_ros.bag_metadata import (
    LIBRARY,
    FileSummary,
    bag_information,
    profiles,
    topic_information,
    write_metadata,
    yaml_text,
)
from wam_ros.mcap_file import DATA, NEVER, Batch, McapFile, log_times
from wam_ros.mcap_records import HEAD, Attachment, BagError, Channel, Damage, Schema
from wam_ros.mcap_writer import McapWriter

CHUNK_SIZE: Final = 4 * 2**20  # bytes; large ones compress better, and a cut bag is small
LEVEL: Final = 19  # of zstd: the strongest that needs no more memory to read
OWN: Final = "rosbag2"  # metadata record that describes the file it is in, and so is written anew
CUT: Final = "cut"  # metadata record that says what was taken
LATCHED: Final = ("transient_local", 1)
_HEAD = struct.Struct("<2xIQQ")  # sequence, log and publish time in a message record


class Message(NamedTuple):
    """A message as it lies in a bag; times in ns."""

    log_time: int
    channel: int
    sequence: int
    publish_time: int
    data: bytes


class Cut(NamedTuple):
    """What is taken: log times ``begin_ns <= t < end_ns``; topics named as for `wam_analysis.bag.read`, None is all."""

    begin_ns: int = 0
    end_ns: int = NEVER
    topics: Collection[str] | None = None


def cut(source: Path, target: Path, part: Cut) -> Path:
    """Write a bag that holds a part of another one.

    Messages, stamps, log times, sequence numbers, definitions, attachments and metadata records are those of the
    source.  Of latched topics everything before the part is kept as well, at its own time: it is what held when the
    part begins.  Messages are in the order of log time, topic and sequence, in chunks of a fixed size, all else in that
    of its names, so that equal content gives an equal file.

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
        where the source cannot be read, lacks a topic, or has no message in the part.
    FileExistsError
        where there is something at the target.
    """
    taken = _read(source, part)
    if lacking := [name for name in part.topics or () if not any(is_asked(topic, [name]) for topic in taken.channels)]:
        raise BagError(f"{source} has no topic {', '.join(lacking)}; what it has: 'wam bag info {source}'")
    if not any(part.begin_ns <= message.log_time < part.end_ns for message in taken.messages):
        raise BagError(
            f"{source} has nothing from {part.begin_ns} to {part.end_ns} ns; when it was: 'wam bag info {source}'"
        )
    target.mkdir(parents=True)
    file = target / f"{target.name}_0.mcap"
    with file.open("xb", buffering=0) as stream:
        information = _write(McapWriter(stream, LIBRARY, CHUNK_SIZE, LEVEL), file.name, taken, part)
    write_metadata(target, information)
    return file


class _Taken(NamedTuple):
    """What is taken from a bag: definitions by topic, messages with the place of their topic there, what is beside."""

    channels: dict[str, tuple[Channel, Schema]]
    messages: list[Message]
    attachments: dict[str, Attachment]
    metadata: dict[str, dict[str, str]]


def _read(source: Path, part: Cut) -> _Taken:
    taken = _Taken({}, [], {}, {})
    for path in files(source):
        with opened(path) as file:
            file.check_all()
            for batch in file.batches(None, 0, NEVER):
                _take(file, batch, part, taken)
            for channel in file.channels.values():
                _place(file, channel, part, taken)
            taken.attachments.update({item.name: item for item in file.attached()})
            taken.metadata.update({name: values for name, values in file.metadata().items() if name != OWN})
    return taken


def _take(file: McapFile, batch: Batch, part: Cut, taken: _Taken) -> None:
    """The messages of a batch that are asked for."""
    for number, found in batch.found.items():
        if number not in file.channels:
            raise Damage(f"a message is on channel {number}, which is not defined")
        place = _place(file, file.channels[number], part, taken)
        if place is None:
            continue
        times = log_times(batch.buffer, found.offsets)
        begin = 0 if _is_latched(file.channels[number]) else part.begin_ns
        for i in np.flatnonzero((times >= begin) & (times < part.end_ns)).tolist():
            start, size = int(found.offsets[i]), int(found.sizes[i])
            sequence, log_time, publish_time = _HEAD.unpack_from(batch.buffer.data, start + HEAD.size)
            data = batch.buffer[start + DATA : start + DATA + size].tobytes()
            taken.messages.append(Message(log_time, place, sequence, publish_time, data))


def _place(file: McapFile, channel: Channel, part: Cut, taken: _Taken) -> int | None:
    """The place of a topic among those taken, None where it is not asked for."""
    if not is_asked(channel.topic, part.topics):
        return None
    if channel.schema not in file.schemas:
        raise Damage(f"topic {channel.topic} has no schema")
    schema = file.schemas[channel.schema]
    if taken.channels.setdefault(channel.topic, (channel, schema))[1] != schema:
        raise Damage(f"topic {channel.topic} is of several types")
    return list(taken.channels).index(channel.topic)


def _is_latched(channel: Channel) -> bool:
    """Whether publishers keep their last message for who comes later; rosbag2 writes the policy as word or number."""
    offered = profiles(channel.metadata.get("offered_qos_profiles", ""))
    return any(profile.get("durability") in LATCHED for profile in offered)


def _write(writer: McapWriter, name: str, taken: _Taken, part: Cut) -> dict[str, Any]:
    """Fill and finish a file; returns what metadata.yaml is to say."""
    schemas: dict[str, int] = {}
    numbers: dict[str, int] = {}
    # by name: a source may hold its topics in any order
    for topic, (channel, schema) in sorted(taken.channels.items()):
        if schema.name not in schemas:
            schemas[schema.name] = writer.schema(schema.name, schema.encoding, schema.data)
        numbers[topic] = writer.channel(topic, channel.encoding, schemas[schema.name], channel.metadata)
    number_of = [numbers[topic] for topic in taken.channels]
    renumbered = (message._replace(channel=number_of[message.channel]) for message in taken.messages)
    for message in sorted(renumbered):
        writer.add(message.channel, message.log_time, message.publish_time, message.sequence, message.data)
    writer.flush()
    for _, attachment in sorted(taken.attachments.items()):
        writer.attach(attachment.name, attachment.media_type, attachment.data, attachment.times)
    topics = "*" if part.topics is None else " ".join(part.topics)
    said = {"begin_ns": str(part.begin_ns), "end_ns": str(part.end_ns), "topics": topics}
    for title, values in sorted({**taken.metadata, CUT: said}.items()):
        writer.metadata(title, dict(sorted(values.items())))
    information = bag_information(
        [FileSummary(name, writer.first, writer.last, sum(writer.counts.values()))],
        [topic_information(*taken.channels[topic]) for topic in numbers],
        [writer.counts.get(number, 0) for number in numbers.values()],
    )
    writer.metadata(OWN, {"serialized_metadata": yaml_text(information).strip()})
    writer.finish()
    return information
