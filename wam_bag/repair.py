"""Bags repaired: files that were not closed, or are damaged, written again from what can be read of them."""

import os
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema

from wam_bag import safe_yaml
from wam_bag.bag_file import refuse_compressed
from wam_bag.bag_writer import CHUNK_SIZE, release
from wam_bag.errors import BROKEN, BagError, Damage, TooLargeError
from wam_bag.losses import REPAIRED, FileLosses, Hole
from wam_bag.mcap_file import McapFile, MessageCounts, RecordExtent
from wam_bag.mcap_records import HEAD, message, parsed
from wam_bag.mcap_writer import Entries, McapWriter
from wam_bag.message_search import MessageBatch, log_times
from wam_bag.metadata import LIBRARY, FileSummary, bag_information, topic_information, write_metadata

UNFINISHED: Final = ".repaired"  # suffix of a file while it is written
_INDEX_HEAD: Final = struct.Struct("<HI")  # of a message index: channel, bytes of the entries


class Repaired(NamedTuple):
    """Result for one file: its messages now, their first log time (ns), what is lost; None if the file was whole."""

    name: str
    messages: int
    first: int
    losses: FileLosses | None

    @property
    def was_whole(self) -> bool:
        """Whether nothing had to be repaired."""
        return self.losses is None


class _Account:
    """What is copied and what is lost while a file is written again."""

    def __init__(self) -> None:
        self.bytes = 0
        self.others = 0
        self.holes: list[Hole] = []
        self.lost: Counter[int] = Counter()  # by channel id
        self.all_known = True
        self.last: int | None = None

    def copied(self, times: Collection[int]) -> None:
        """Messages of these log times were saved; holes that were open end before them."""
        if times:
            self.holes = [hole if hole.end is not None else hole._replace(end=min(times)) for hole in self.holes]
            self.last = max(times) if self.last is None else max(self.last, *times)

    def lose(self, size: int, index: dict[int, list[int]] | None = None) -> None:
        """Bytes could not be read; `index` has the log times of the messages in them by channel id, if it is known."""
        self.bytes += size
        if index and (times := [time for found in index.values() for time in found]):
            self.holes.append(Hole(min(times), max(times), size))
            self.lost.update({channel: len(found) for channel, found in index.items()})
        else:
            self.holes.append(Hole(self.last, None, size))
            self.all_known = False


def repair(path: Path) -> list[Repaired]:
    """Repair a bag: each broken file is written again, then metadata.yaml if it does not fit.

    A file is replaced only when the new one is complete and on disk, so that a repair may be interrupted
    at any time and repeated.

    Parameters
    ----------
    path : bag directory or .mcap file.

    Raises
    ------
    BagError
        if nothing can be saved, or a whole file has a chunk that is too large.
    RecordingError
        if the bag is being recorded.
    """
    if path.is_file():
        return [_repair_file(path)]
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not files:
        refuse_compressed(path)
        raise BagError(f"{path} has no .mcap file; give a bag directory or an .mcap file")
    release(path)
    done = []
    for file in files:
        if file.stat().st_size == 0 and len(files) > 1:
            file.unlink()  # the recorder was killed as it started a new file
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
        counts = _count(path)
        return Repaired(path.name, sum(counts.by_channel.values()), counts.first, None)
    except TooLargeError as error:
        raise BagError(f"{path} cannot be repaired: {error}; nothing was changed") from None
    except BROKEN:
        pass
    new = path.with_name(path.name + UNFINISHED)
    try:
        with McapFile(path) as file, new.open("xb", buffering=0) as stream:
            losses = _Copy(file, McapWriter(stream, LIBRARY, CHUNK_SIZE)).run()
            os.fsync(stream.fileno())
        counts = _count(new)
        new.replace(path)
    except BROKEN as error:
        raise BagError(f"{path} cannot be repaired: {error}; nothing was changed") from None
    finally:
        new.unlink(missing_ok=True)
    return Repaired(path.name, sum(counts.by_channel.values()), counts.first, losses)


def _count(path: Path) -> MessageCounts:
    """Messages of a file that is whole; raises one of the errors of a broken one."""
    with McapFile(path) as file:
        file.open()
        file.check_all()
        found = file.count()
        if file.counts is None or +Counter(file.counts.by_channel) != Counter(found.by_channel):
            raise Damage("its statistics do not match its messages")
        return found


class _Copy:
    """Writes what can be read of a file, and a record of what cannot."""

    def __init__(self, file: McapFile, writer: McapWriter) -> None:
        self._file, self._writer = file, writer
        self._account = _Account()
        self._defined: set[tuple[type, int]] = set()
        self._earlier: dict[str, str] = {}  # entries of earlier repairs

    def run(self) -> FileLosses:
        """Copy everything; returns what is lost."""
        file, writer, account = self._file, self._writer, self._account
        position = 0
        for record in list(file.salvage()):  # all of them first: the definitions at the end may be needed
            if position and record.start > position:
                account.lose(record.start - position)
            position = max(position, record.end)
            try:
                self._copy(record)
            except BROKEN:
                size = record.end - record.start
                if record.opcode == Opcode.CHUNK:
                    account.lose(size, self._times_of_lost_chunk(record.end))
                elif record.opcode == Opcode.MESSAGE:
                    account.lose(size)
                else:
                    account.bytes += size
                    account.others += 1
        if file.data_size() > position and not file.is_data_end(position):
            account.lose(file.data_size() - position)
        writer.flush()
        losses = self._losses()
        number = sum(key.startswith(file.path.name) for key in self._earlier)
        key = file.path.name + (f" ({number + 1})" if number else "")
        writer.metadata(REPAIRED, {**self._earlier, key: losses.text()})
        writer.finish()
        return losses

    def _losses(self) -> FileLosses:
        """The losses by topic; compared with the file's own count of its messages, if there is one."""
        file, account = self._file, self._account
        lost, all_known, holes = account.lost, account.all_known, account.holes
        if holes and file.counts is not None:
            lost, all_known = Counter(file.counts.by_channel) - Counter(self._writer.counts), True
            holes = holes if lost else []  # only indexes could not be read
        messages: Counter[str] = Counter()
        for number, count in lost.items():
            channel = file.channels.get(number)
            messages[channel.topic if channel else f"channel {number}"] += count
        return FileLosses(account.bytes, file.has_end(), tuple(holes), dict(messages), all_known, account.others)

    def _times_of_lost_chunk(self, position: int) -> dict[int, list[int]]:
        """Log times of the messages of a chunk by channel id, as far as the indexes behind it can be read."""
        found: dict[int, list[int]] = {}
        try:
            while True:
                record = self._file.record_at(position)
                entries = record.end - record.start - HEAD.size - _INDEX_HEAD.size
                if record.opcode != Opcode.MESSAGE_INDEX or entries < 0 or entries % 16:
                    return found
                content = self._file.content(record)
                channel, _ = _INDEX_HEAD.unpack_from(content)
                found[channel] = np.frombuffer(content, "<u8", offset=_INDEX_HEAD.size)[::2].tolist()
                position = record.end
        except BROKEN:
            return found

    def _copy(self, record: RecordExtent) -> None:
        file, writer, opcode = self._file, self._writer, record.opcode
        if opcode == Opcode.CHUNK:
            self._copy_chunk(record)
        elif opcode == Opcode.MESSAGE:
            self._copy_message(message(file.content(record)))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            file.define(opcode, file.content(record))
        elif opcode == Opcode.ATTACHMENT:
            attachment = parsed(opcode, file.content(record))
            writer.flush()
            writer.attach(attachment)
        elif opcode == Opcode.METADATA:
            metadata = parsed(opcode, file.content(record))
            if metadata.name == REPAIRED:
                self._earlier |= metadata.metadata
                return
            writer.flush()
            writer.metadata(metadata.name, metadata.metadata)

    def _copy_chunk(self, record: RecordExtent) -> None:
        batch = self._file.chunk(record)
        self._check_defined(batch.found)
        self._writer.flush()
        self._define(is_new=False)
        entries = dict(_entries(batch))
        self._writer.add_chunk(parsed(Opcode.CHUNK, self._file.content(record)), entries)
        self._account.copied([int(time) for found in entries.values() for time in (found[::2].min(), found[::2].max())])

    def _copy_message(self, copied: Message) -> None:
        self._check_defined([copied.channel_id])
        self._define(is_new=True)
        self._writer.add(copied.channel_id, copied.log_time, copied.publish_time, copied.sequence, copied.data)
        self._account.copied([copied.log_time])

    def _define(self, is_new: bool) -> None:
        schemas, channels = self._file.schemas, self._file.channels
        if len(self._defined) == len(schemas) + len(channels):
            return
        definitions: list[Schema | Channel] = [*schemas.values(), *channels.values()]
        for definition in definitions:
            key = type(definition), definition.id
            if key not in self._defined:
                self._writer.define(definition, is_new)
                self._defined.add(key)

    def _check_defined(self, channels: Collection[int]) -> None:
        for channel in channels:
            if channel not in self._file.channels or self._file.channels[channel].schema_id not in self._file.schemas:
                raise Damage(f"messages are on channel {channel}, which is not defined")


def _entries(batch: MessageBatch) -> Iterator[tuple[int, Entries]]:
    for channel, found in batch.found.items():
        times = log_times(batch.buffer, found)
        yield channel, np.column_stack([times, found.offsets]).astype("<u8").ravel()


def _listed(path: Path) -> list[str]:
    """Files that a metadata.yaml lists; none if it cannot be read."""
    try:
        text = path.read_text(encoding="utf-8")
        return list(safe_yaml.load(text)["rosbag2_bagfile_information"]["relative_file_paths"])
    except (OSError, yaml.YAMLError, ValueError, LookupError, TypeError):
        return []


def _information(files: list[Path]) -> dict[str, Any]:
    summaries, topics, counts = [], dict[str, dict[str, Any]](), Counter[str]()
    for path in files:
        with McapFile(path) as file:
            file.open()
            found = file.counts or MessageCounts(0, 0, {})
            summaries.append(FileSummary(path.name, found.first, found.last, sum(found.by_channel.values())))
            for number, channel in file.channels.items():
                counts[channel.topic] += found.by_channel.get(number, 0)
                topics.setdefault(channel.topic, topic_information(channel, file.schemas[channel.schema_id]))
    return bag_information(summaries, list(topics.values()), [counts[topic] for topic in topics])
