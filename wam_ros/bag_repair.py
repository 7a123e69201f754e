"""Bags made whole: files that were not closed, or are damaged, written again from what can be read of them."""

import os
import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml

from wam_ros import mcap_records as records
from wam_ros.bag import CHUNK_SIZE, release
from wam_ros.bag_losses import REPAIRED, FileLosses, Hole
from wam_ros.bag_metadata import LIBRARY, FileSummary, bag_information, topic_information, write_metadata
from wam_ros.mcap_file import DATA, Batch, McapFile, log_times
from wam_ros.mcap_records import BROKEN, BagError, Damage
from wam_ros.mcap_writer import McapWriter

UNFINISHED: Final = ".repaired"  # suffix of a file while it is written
_INDEX_HEAD: Final = struct.Struct("<HI")  # of a message index: channel, bytes of the entries
_MESSAGE_HEAD = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<u8"), ("publish_time", "<u8")])


class Repaired(NamedTuple):
    """What became of one file: messages in it now, their first log time (ns), what is gone; None where it was whole."""

    name: str
    messages: int
    first: int
    losses: FileLosses | None

    @property
    def was_whole(self) -> bool:
        """Whether nothing had to be done."""
        return self.losses is None


class _Account:
    """What is copied and what is lost, while a file is written again."""

    def __init__(self) -> None:
        self.bytes = 0
        self.others = 0
        self.holes: list[Hole] = []
        self.lost: Counter[int] = Counter()  # by channel
        self.all_known = True
        self.last: int | None = None

    def copied(self, first: int, last: int) -> None:
        """Messages of these log times were saved; holes that were open end before them."""
        self.holes = [hole if hole.end is not None else hole._replace(end=first) for hole in self.holes]
        self.last = last if self.last is None else max(self.last, last)

    def lose(self, size: int, index: dict[int, list[int]] | None) -> None:
        """Bytes could not be read; `index` has the log times of each channel's messages in them, where it is known."""
        self.bytes += size
        times = [time for found in (index or {}).values() for time in found]
        if times:
            self.holes.append(Hole(min(times), max(times), size))
            self.lost.update({channel: len(found) for channel, found in (index or {}).items()})
        else:
            self.holes.append(Hole(self.last, None, size))
            self.all_known = False


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
        return Repaired(path.name, *_count(path), None)
    except BROKEN:
        pass
    new = path.with_name(path.name + UNFINISHED)
    try:
        with McapFile(path) as file, new.open("xb", buffering=0) as stream:
            losses = _copy(file, McapWriter(stream, LIBRARY, CHUNK_SIZE))
            os.fsync(stream.fileno())
        count, first = _count(new)
        new.replace(path)
    except BROKEN as error:
        raise BagError(f"{path} cannot be repaired: {error}; nothing was changed") from None
    finally:
        new.unlink(missing_ok=True)
    return Repaired(path.name, count, first, losses)


def _count(path: Path) -> tuple[int, int]:
    """Messages of a file that is whole, and the first log time; raises one of the errors of a broken one."""
    with McapFile(path) as file:
        file.open()
        file.check_all()
        found = file.count()
        counts = found.counts
        if file.statistics is None or +Counter(file.statistics.counts) != Counter(counts):
            raise Damage("it does not count its messages rightly")
        return sum(counts.values()), found.first


def _copy(file: McapFile, writer: McapWriter) -> FileLosses:
    """Write what can be read of a file, and a record of what cannot."""
    account = _Account()
    defined: set[tuple[int, int]] = set()
    earlier: dict[str, str] = {}
    position = 0
    for kind, start, stop in list(file.salvage()):  # all of them first: the definitions at the end may be needed
        if position and start > position:
            account.lose(start - position, None)
        position = max(position, stop)
        try:
            if kind == records.METADATA:
                name, values = records.metadata(file.content(start, stop))
                if name == REPAIRED:
                    earlier |= values
                else:
                    writer.flush()
                    writer.metadata(name, values)
            else:
                _copy_record(file, writer, (kind, start, stop), defined, account)
        except BROKEN:
            if kind == records.CHUNK:
                account.lose(stop - start, _index_behind(file, stop))
            elif kind == records.MESSAGE:
                account.lose(stop - start, None)
            else:
                account.bytes += stop - start
                account.others += 1
    if file.data_size() > position and not file.ends_at(position):
        account.lose(file.data_size() - position, None)
    writer.flush()
    losses = _losses(file, writer, account)
    number = sum(key.startswith(file.path.name) for key in earlier)
    key = file.path.name + (f" ({number + 1})" if number else "")
    writer.metadata(REPAIRED, {**earlier, key: losses.text()})
    writer.finish()
    return losses


def _losses(file: McapFile, writer: McapWriter, account: _Account) -> FileLosses:
    """The account told by topic; where the file itself counted its messages, that is what they are compared with."""
    lost, all_known, holes = account.lost, account.all_known, account.holes
    if holes and file.statistics is not None:
        lost, all_known = Counter(file.statistics.counts) - Counter(writer.counts), True
        holes = holes if lost else []  # what could not be read were indexes
    messages: Counter[str] = Counter()
    for number, count in lost.items():
        channel = file.channels.get(number)
        messages[channel.topic if channel else f"channel {number}"] += count
    return FileLosses(account.bytes, file.has_end(), tuple(holes), dict(messages), all_known, account.others)


def _index_behind(file: McapFile, position: int) -> dict[int, list[int]] | None:
    """Log times by channel of the messages of a chunk, from the indexes behind it; None where there are none."""
    found: dict[int, list[int]] = {}
    try:
        while True:
            kind, length = file.head(position)
            if kind != records.MESSAGE_INDEX or length < _INDEX_HEAD.size or (length - _INDEX_HEAD.size) % 16:
                return found or None
            content = file.content(position, position + records.HEAD.size + length)
            channel, _ = _INDEX_HEAD.unpack_from(content)
            found[channel] = np.frombuffer(content, "<u8", offset=_INDEX_HEAD.size)[::2].tolist()
            position += records.HEAD.size + length
    except BROKEN:
        return found or None


def _copy_record(
    file: McapFile,
    writer: McapWriter,
    extent: tuple[int, int, int],
    defined: set[tuple[int, int]],
    account: _Account,
) -> None:
    kind, start, stop = extent
    if kind == records.CHUNK:
        _copy_chunk(file, writer, start, stop, defined, account)
    elif kind == records.ATTACHMENT:
        attachment = records.attachment(file.content(start, stop))
        writer.flush()
        writer.attach(attachment.name, attachment.media_type, attachment.data, attachment.times)
    elif kind == records.MESSAGE:
        account.copied(*_copy_message(file, writer, file.content(start, stop), defined))
    elif kind in (records.SCHEMA, records.CHANNEL):
        file.define(kind, file.content(start, stop))


def _copy_chunk(
    file: McapFile, writer: McapWriter, start: int, end: int, defined: set[tuple[int, int]], account: _Account
) -> None:
    batch = file.unpacked(start, end)
    _check_defined(file, batch.found)
    writer.flush()
    for (kind, number), content in file.definitions.items():
        if (kind, number) not in defined:
            writer.define(kind, content, is_new=False)
            defined.add((kind, number))
    entries = dict(_entries(batch))
    writer.add_chunk(file.content(start, end), entries)
    if times := [int(time) for found in entries.values() for time in (found[::2].min(), found[::2].max())]:
        account.copied(min(times), max(times))


def _entries(batch: Batch) -> Iterator[tuple[int, records.Entries]]:
    for channel, found in batch.found.items():
        times = log_times(batch.buffer, found.offsets)
        yield channel, np.column_stack([times, found.offsets]).astype("<u8").ravel()


def _copy_message(file: McapFile, writer: McapWriter, content: bytes, defined: set[tuple[int, int]]) -> tuple[int, int]:
    """Copy a message; returns its log time twice, as first and last."""
    if len(content) < _MESSAGE_HEAD.itemsize:
        raise Damage("a message record ends early")
    channel, sequence, log_time, publish_time = np.frombuffer(content, _MESSAGE_HEAD, 1)[0].tolist()
    _check_defined(file, [channel])
    for key, definition in file.definitions.items():
        if key not in defined:
            writer.define(key[0], definition)
            defined.add(key)
    writer.add(channel, log_time, publish_time, sequence, content[DATA - records.HEAD.size :])
    return log_time, log_time


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
