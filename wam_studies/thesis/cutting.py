"""A sample cut out of a recording: some of its time, some of its topics, and everything that explains them."""

from collections import defaultdict
from pathlib import Path
from typing import Any, Final

from mcap.reader import make_reader
from mcap.records import Message

from wam_bag.bag_file import files, is_selected
from wam_bag.bag_writer import WHOLE, BagWriter
from wam_bag.errors import BagError, command
from wam_bag.losses import CUT
from wam_bag.metadata import profiles
from wam_studies.thesis.definition import SampleDefinition

PACKING: Final = (4 * 2**20, 19)  # the strongest level that needs no more memory to read
OWN: Final = "rosbag2"  # metadata record that describes the file it is in, and so is written again


def cut(source: Path, target: Path, sample: SampleDefinition) -> None:
    """Write a bag that holds a part of a recording of this stack.

    Of latched topics everything before the part is kept as well, at its own time: it was valid when the part begins.
    Messages are in the order of log time, topic and sequence, everything else in the order of names, so that equal
    content gives an equal file.

    Parameters
    ----------
    source : bag directory, of one file, or the file.
    target : directory of the new bag.
    sample : times, topics as for `wam_bag.bag.read`, and those of which only the first of so many messages is kept.

    Raises
    ------
    BagError
        if the source lacks a topic, or has no message in the part.
    RecordingError
        if the target exists.
    """
    begin, end = (round(1e9 * seconds) for seconds in sample.seconds)
    (recorded,) = files(source)
    taken: dict[str, list[Message]] = defaultdict(list)
    with recorded.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary  # our recorder writes one
        topics = dict[str, tuple[str, Any]]()
        for channel in summary.channels.values():
            if is_selected(channel.topic, sample.topics):
                (offered,) = profiles(channel.metadata["offered_qos_profiles"])
                topics[channel.topic] = summary.schemas[channel.schema_id].name, offered
        for _, channel, message in reader.iter_messages(list(topics), log_time_order=False):
            is_latched = topics[channel.topic][1]["durability"] == "transient_local"
            if (0 if is_latched else begin) <= message.log_time < end:
                taken[channel.topic].append(message)
        attachments = sorted(reader.iter_attachments(), key=lambda one: str(one.name))
        metadata = {record.name: record.metadata for record in reader.iter_metadata() if record.name != OWN}
    lacking = [name for name in sample.topics or () if not any(is_selected(topic, [name]) for topic in topics)]
    if lacking or not any(begin <= message.log_time for some in taken.values() for message in some):
        what = f"topic {', '.join(lacking)}" if lacking else f"message from {begin} to {end} ns"
        raise BagError(f"{source} has no {what}; what it has: {command('wam bag info', source)}")
    metadata[CUT] = {"begin_ns": str(begin), "end_ns": str(end), "topics": " ".join(sample.topics or "*")}
    if sample.thinned:
        metadata[CUT]["thinned"] = " ".join(f"{name}:{each}" for name, each in sample.thinned.items())
    with BagWriter(target, WHOLE, *PACKING) as bag:
        kept = []
        for topic in sorted(topics):  # a source may have its topics in any order
            bag.add_topic(topic, *topics[topic])
            each = next((each for name, each in sample.thinned.items() if is_selected(topic, [name])), 1)
            kept += [(m.log_time, topic, m.sequence, m.publish_time, m.data) for m in taken[topic][::each]]
        for log_time, topic, sequence, publish_time, data in sorted(kept):
            bag.write(topic, data, log_time, publish_time, sequence)
        for attachment in attachments:
            bag.attach(attachment.name, attachment.media_type, attachment.data)
        for title in sorted(metadata):
            bag.metadata(title, dict(sorted(metadata[title].items())))
