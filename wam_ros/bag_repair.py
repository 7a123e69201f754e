"""Bags made whole: files that were not closed, or are damaged, written again from what can be read of them."""

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml

from wam_ros import mcap_records as records
from wam_ros.bag import CHUNK_SIZE, release
from wam_ros.bag_metadata import LIBRARY, FileSummary, bag_information, topic_information, write_metadata
from wam_ros.mcap_file import DATA, Batch, McapFile, log_times
from wam_ros.mcap_records import BROKEN, BagError, Damage
from wam_ros.mcap_writer import McapWriter

UNFINISHED: Final = ".repaired"  # suffix of a file while it is written
_MESSAGE_HEAD = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<u8"), ("publish_time", "<u8")])


class Repaired(NamedTuple):
    """What became of one file: whether it was whole, messages in it now, bytes that could not be read."""

    name: str
    was_whole: bool
    messages: int
    lost: int


def repair(path: Path) -> list[Repaired]:
    """Make a bag whole: each broken file is written again, then metadata.yaml where it does not fit.

    A file is replaced only when the new one is complete and on disk, so that this may be interrupted
    at any time and done again.

    Parameters
    ----------
    path : bag directory or .mcap file.

    Raises
    ------
    BagError
        where nothing can be saved.
    RecordingError
        where the bag is being recorded.
    """
    if path.is_file():
        return [_repair_file(path)]
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not files:
        raise BagError(f"{path} has no .mcap file; give a bag directory or an .mcap file")
    release(path)
    done = []
    for file in files:
        if file.stat().st_size == 0 and len(files) > 1:
            file.unlink()  # the recorder was killed just as it went on in a new file
        else:
            done.append(_repair_file(file))
    names = [result.name for result in done]
    if not all(result.was_whole for result in done) or _listed(path / "metadata.yaml") != names:
        write_metadata(path, _information([path / name for name in names]))
    return done


def _repair_file(path: Path) -> Repaired:
    for unfinished in path.parent.glob(f"*{UNFINISHED}"):
        unfinished.unlink()
    try:
        return Repaired(path.name, True, _count(path), 0)
    except BROKEN:
        pass
    new = path.with_name(path.name + UNFINISHED)
    try:
        with McapFile(path) as file, new.open("xb", buffering=0) as stream:
            lost = _copy(file, McapWriter(stream, LIBRARY, CHUNK_SIZE))
            os.fsync(stream.fileno())
        count = _count(new)
        new.replace(path)
    except BROKEN as error:
        raise BagError(f"{path} cannot be repaired: {error}; nothing was changed") from None
    finally:
        new.unlink(missing_ok=True)
    return Repaired(path.name, False, count, lost)


def _count(path: Path) -> int:
    """Messages of a file that is whole; raises one of the errors of a broken one."""
    with McapFile(path) as file:
        file.open()
        file.check_all()
        counts = file.count().counts
        if file.statistics is None or +Counter(file.statistics.counts) != Counter(counts):
            raise Damage("it does not count its messages rightly")
        return sum(counts.values())


def _copy(file: McapFile, writer: McapWriter) -> int:
    """Write what can be read of a file; returns the bytes that cannot."""
    lost = 0
    defined: set[tuple[int, int]] = set()
    extents = list(file.salvage())
    end = max((end for _, _, end in extents), default=0)
    for kind, start, stop in extents:
        try:
            if kind == records.CHUNK:
                _copy_chunk(file, writer, start, stop, defined)
            elif kind == records.ATTACHMENT:
                attachment = records.attachment(file.content(start, stop))
                writer.flush()
                writer.attach(attachment.name, attachment.media_type, attachment.data, attachment.times)
            elif kind == records.METADATA:
                name, values = records.metadata(file.content(start, stop))
                writer.flush()
                writer.metadata(name, values)
            elif kind == records.MESSAGE:
                _copy_message(file, writer, file.content(start, stop), defined)
            elif kind in (records.SCHEMA, records.CHANNEL):
                file.define(kind, file.content(start, stop))
        except BROKEN:
            lost += stop - start
    writer.finish()
    return lost + max(0, file.data_size() - end)


def _copy_chunk(file: McapFile, writer: McapWriter, start: int, end: int, defined: set[tuple[int, int]]) -> None:
    batch = file.unpacked(start, end)
    _check_defined(file, batch.found)
    writer.flush()
    for (kind, number), content in file.definitions.items():
        if (kind, number) not in defined:
            writer.define(kind, content, is_new=False)
            defined.add((kind, number))
    writer.add_chunk(file.content(start, end), dict(_entries(batch)))


def _entries(batch: Batch) -> Iterator[tuple[int, records.Entries]]:
    for channel, found in batch.found.items():
        times = log_times(batch.buffer, found.offsets)
        yield channel, np.column_stack([times, found.offsets]).astype("<u8").ravel()


def _copy_message(file: McapFile, writer: McapWriter, content: bytes, defined: set[tuple[int, int]]) -> None:
    if len(content) < _MESSAGE_HEAD.itemsize:
        raise Damage("a message record ends early")
    channel, sequence, log_time, publish_time = np.frombuffer(content, _MESSAGE_HEAD, 1)[0].tolist()
    _check_defined(file, [channel])
    for key, definition in file.definitions.items():
        if key not in defined:
            writer.define(key[0], definition)
            defined.add(key)
    writer.add(channel, log_time, publish_time, sequence, content[DATA - records.HEAD.size :])


def _check_defined(file: McapFile, channels: Any) -> None:
    for channel in channels:
        if channel not in file.channels or file.channels[channel].schema not in file.schemas:
            raise Damage(f"messages are on channel {channel}, which is not defined")


def _listed(path: Path) -> list[str]:
    """Files that a metadata.yaml lists; none where it says nothing."""
    try:
        return list(
            yaml.safe_load(path.read_text(encoding="utf-8"))["rosbag2_bagfile_information"]["relative_file_paths"]
        )
    except (OSError, yaml.YAMLError, ValueError, LookupError, TypeError, RecursionError):
        return []


def _information(files: list[Path]) -> dict[str, Any]:
    summaries, topics, counts = [], dict[str, dict[str, Any]](), Counter[str]()
    for path in files:
        with McapFile(path) as file:
            file.open()
            said = file.statistics or records.Statistics(0, 0, {})
            summaries.append(FileSummary(path.name, said.first, said.last, sum(said.counts.values())))
            for number, channel in file.channels.items():
                counts[channel.topic] += said.counts.get(number, 0)
                topics.setdefault(channel.topic, topic_information(channel, file.schemas[channel.schema]))
    return bag_information(summaries, list(topics.values()), [counts[topic] for topic in topics])
