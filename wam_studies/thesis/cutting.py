"""A sample cut out of a recording: some of its time, some of its topics, and everything that explains them."""

from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from mcap.reader import McapReader, make_reader
from mcap.records import Channel, Message, Schema

from wam_bag import safe_yaml
from wam_bag.bag_file import files, is_selected
from wam_bag.errors import BagError, command
from wam_bag.losses import CUT
from wam_bag.mcap_writer import McapWriter
from wam_bag.metadata import LIBRARY, FileSummary, bag_information, profiles, topic_information, write_metadata

CHUNK_SIZE: Final = 4 * 2**20  # bytes; large ones compress better, and a sample is small
LEVEL: Final = 19  # of zstd: the strongest that needs no more memory to read
OWN: Final = "rosbag2"  # metadata record that describes the file it is in, and so is written again
LATCHED: Final = ("transient_local", 1)  # the policy as rosbag2 writes it


class Cut(NamedTuple):
    """What is taken: log times ``begin_ns <= t < end_ns``; topics named as for `wam_bag.bag.read`.

    Of a topic in `thinned`, only the first of so many messages, ``{"sim/joint_states": 10}``.
    """

    begin_ns: int
    end_ns: int
    topics: Collection[str] | None = None
    thinned: Mapping[str, int] = MappingProxyType({})


def cut(source: Path, target: Path, part: Cut) -> Path:
    """Write a bag that holds a part of a recording of this stack.

    Of latched topics everything before the part is kept as well, at its own time: it was valid when the part begins.
    Messages are in the order of log time, topic and sequence, everything else in the order of names, so that equal
    content gives an equal file.

    Parameters
    ----------
    source : bag directory, of one file, or the file.
    target : directory of the new bag.

    Returns
    -------
    Path
        the file in it.

    Raises
    ------
    BagError
        if the source lacks a topic, or has no message in the part.
    FileExistsError
        if the target exists.
    """
    (recorded,) = files(source)
    with recorded.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        channels, taken = _taken(reader, part)
        attachments = sorted(reader.iter_attachments(), key=lambda one: str(one.name))
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    lacking = [name for name in part.topics or () if not any(is_selected(topic, [name]) for topic in channels)]
    if lacking or not any(part.begin_ns <= message.log_time for some in taken.values() for message in some):
        what = f"topic {', '.join(lacking)}" if lacking else f"message from {part.begin_ns} to {part.end_ns} ns"
        raise BagError(f"{source} has no {what}; what it has: {command('wam bag info', source)}")
    metadata[CUT] = {"begin_ns": str(part.begin_ns), "end_ns": str(part.end_ns)}
    metadata[CUT]["topics"] = "*" if part.topics is None else " ".join(part.topics)
    if part.thinned:
        metadata[CUT]["thinned"] = " ".join(f"{name}:{each}" for name, each in part.thinned.items())
    target.mkdir(parents=True)
    file = target / f"{target.name}_0.mcap"
    with file.open("xb", buffering=0) as stream:
        writer = McapWriter(stream, LIBRARY, CHUNK_SIZE, LEVEL)
        ids = _write_messages(writer, channels, taken)
        for attachment in attachments:
            writer.attach(attachment)
        for title in sorted(metadata.keys() - {OWN}):
            writer.metadata(title, dict(sorted(metadata[title].items())))
        information = bag_information(
            [FileSummary(file.name, writer.first, writer.last, sum(writer.counts.values()))],
            [topic_information(*channels[topic]) for topic in ids],
            [writer.counts.get(number, 0) for number in ids.values()],
        )
        writer.metadata(OWN, {"serialized_metadata": safe_yaml.dump(information).strip()})
        writer.finish()
    write_metadata(target, information)
    return file


def _taken(reader: McapReader, part: Cut) -> tuple[dict[str, tuple[Channel, Schema]], dict[str, list[Message]]]:
    """Definitions and messages of the part, by topic."""
    summary = reader.get_summary()
    assert summary  # our recorder writes one
    channels = {
        channel.topic: (channel, summary.schemas[channel.schema_id])
        for channel in summary.channels.values()
        if is_selected(channel.topic, part.topics)
    }
    begins = {topic: 0 if _is_latched(channel) else part.begin_ns for topic, (channel, _) in channels.items()}
    taken: dict[str, list[Message]] = {topic: [] for topic in channels}
    for _, channel, message in reader.iter_messages(list(channels), log_time_order=False):
        if begins[channel.topic] <= message.log_time < part.end_ns:
            taken[channel.topic].append(message)
    for topic in taken:
        for name, each in part.thinned.items():
            taken[topic] = taken[topic][:: each if is_selected(topic, [name]) else 1]
    return channels, taken


def _is_latched(channel: Channel) -> bool:
    """Whether publishers keep their last message for late subscribers."""
    offered: Any = profiles(channel.metadata.get("offered_qos_profiles", ""))
    return any(profile.get("durability") in LATCHED for profile in offered)


def _write_messages(
    writer: McapWriter, channels: Mapping[str, tuple[Channel, Schema]], taken: Mapping[str, list[Message]]
) -> dict[str, int]:
    """Write definitions and messages; the ids of the topics."""
    schemas: dict[str, int] = {}
    ids: dict[str, int] = {}
    for topic, (channel, schema) in sorted(channels.items()):  # a source may have its topics in any order
        if schema.name not in schemas:
            schemas[schema.name] = writer.schema(schema.name, schema.encoding, schema.data)
        ids[topic] = writer.channel(topic, channel.message_encoding, schemas[schema.name], channel.metadata)
    kept = [
        (one.log_time, ids[topic], one.sequence, one.publish_time, one.data)
        for topic, some in taken.items()
        for one in some
    ]
    for log_time, channel_id, sequence, publish_time, data in sorted(kept):
        writer.add(channel_id, log_time, publish_time, sequence, data)
    writer.flush()
    return ids
