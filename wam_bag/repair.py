"""Bags repaired: files that were not closed, or are damaged, written again from what can be read of them."""

import contextlib
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Message

from wam_bag.bag_file import files
from wam_bag.bag_writer import CHUNK_SIZE, release
from wam_bag.errors import BROKEN, BagError, Damage, TooLargeError
from wam_bag.losses import REPAIRED, FileLosses, Hole
from wam_bag.mcap_file import McapFile
from wam_bag.mcap_records import MessageCounts, RecordExtent, parsed
from wam_bag.mcap_writer import McapWriter
from wam_bag.metadata import LIBRARY, bag_information, topic_information, write_metadata

UNFINISHED: Final = ".repaired"  # suffix of a file while it is written


class Repaired(NamedTuple):
    """Result for one file: its messages now, their first log time (ns), what is lost; None if the file was whole."""

    name: str
    messages: int
    first: int
    losses: FileLosses | None


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
    found = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not found or any(path.glob("*.zstd")):  # metadata.yaml would no longer list those
        raise BagError(
            f"{path} does not exist, has no .mcap file, or has compressed ones; give a bag directory or an .mcap file"
        )
    release(path)
    done = []
    for file in found:
        if file.stat().st_size == 0 and len(found) > 1:
            file.unlink()  # the recorder was killed as it started a new file
        else:
            done.append(_repair_file(file))
    names = [result.name for result in done]
    if any(result.losses for result in done) or not _is_listed(path, names):
        write_metadata(path, _information([path / name for name in names]))
    return done


def _repair_file(path: Path) -> Repaired:
    losses: FileLosses | None = None
    try:
        counts = _count(path)
    except BROKEN:
        new = path.with_name(path.name + UNFINISHED)
        try:
            with McapFile(path) as file, new.open("wb", buffering=0) as stream:
                losses = _Copy(file, McapWriter(stream, LIBRARY, CHUNK_SIZE)).run()
                os.fsync(stream.fileno())
            counts = _count(new)
            if losses.holes and not counts.by_channel:
                raise Damage("no message in it can be read")
            new.replace(path)
        except BROKEN as error:
            raise BagError(f"{path} cannot be repaired: {error}; nothing was changed") from None
        finally:
            new.unlink(missing_ok=True)
    return Repaired(path.name, counts.by_channel.total(), counts.first, losses)


def _count(path: Path) -> MessageCounts:
    """Messages of a file that is whole; raises one of the errors of a broken one."""
    with McapFile(path) as file:
        file.open()
        file.check_all()
        for _ in file.batches():
            pass
        if file.counts is None or +file.counts.by_channel != file.loaded.by_channel:
            raise Damage("its statistics do not match its messages")
        return file.loaded


class _Copy:
    """Writes what can be read of a file, and a record of what cannot."""

    def __init__(self, file: McapFile, writer: McapWriter) -> None:
        self._file, self._writer = file, writer
        self._bytes, self._others = 0, 0  # lost
        self._holes: list[Hole] = []
        self._last: int | None = None  # log time of what was copied
        self._earlier: dict[str, str] = {}  # entries of earlier repairs

    def run(self) -> FileLosses:
        """Copy everything; returns what is lost."""
        file, writer = self._file, self._writer
        position = file.data_start()
        for record in list(file.salvage()):  # all of them first: the definitions at the end may be needed
            if record.start > position:
                self._lose(RecordExtent(Opcode.MESSAGE, position, record.start))
            position = max(position, record.end)
            try:
                self._copy(record)
            except (TooLargeError, MemoryError):  # another program, or computer, can read it
                raise
            except BROKEN:
                self._lose(record)
        rest = RecordExtent(Opcode.MESSAGE, position, file.data_size())
        if rest.end > position and not file.is_data_end(position):
            with contextlib.suppress(*BROKEN):
                for record in file.beginning(position):
                    self._copy(record)
                    rest = RecordExtent(Opcode.MESSAGE, record.end, file.size)
            self._lose(rest)
        writer.flush()
        losses = self._losses()
        number = sum(key.startswith(file.path.name) for key in self._earlier)
        key = file.path.name + (f" ({number + 1})" if number else "")
        writer.metadata(REPAIRED, {**self._earlier, key: losses.text()})
        writer.finish()
        return losses

    def _lose(self, record: RecordExtent) -> None:
        """Note what could not be read."""
        size = record.end - record.start
        self._bytes += size
        if record.opcode in (Opcode.CHUNK, Opcode.MESSAGE):
            self._holes.append(Hole(self._last, None, size))
        else:
            self._others += 1

    def _losses(self) -> FileLosses:
        """The losses; by topic if the file has its own count of its messages."""
        file, holes, messages = self._file, self._holes, Counter[str]()
        if holes and file.counts is not None:
            lost = file.counts.by_channel - self._writer.counts.by_channel
            holes = holes if lost else []  # only indexes could not be read
            for number, count in lost.items():
                channel = file.channels.get(number)
                messages[channel.topic if channel else f"channel {number}"] += count
        return FileLosses(self._bytes, file.has_end(), tuple(holes), dict(messages), self._others)

    def _copy(self, record: RecordExtent) -> None:
        file, writer, opcode = self._file, self._writer, record.opcode
        if opcode in (Opcode.CHUNK, Opcode.MESSAGE):
            self._add(file.messages(record))
            if opcode == Opcode.CHUNK:
                writer.flush()  # a chunk stays one
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            file.define(opcode, file.content(record))
        elif opcode == Opcode.ATTACHMENT:
            writer.attach(parsed(opcode, file.content(record)))
        elif opcode == Opcode.METADATA:
            metadata = parsed(opcode, file.content(record))
            if metadata.name == REPAIRED:
                self._earlier |= metadata.metadata
                return
            writer.metadata(metadata.name, metadata.metadata)

    def _add(self, messages: Sequence[Message]) -> None:
        """Write messages; holes that are open end before them."""
        schemas, channels = self._file.schemas, self._file.channels
        for one in messages:
            if one.channel_id not in channels or channels[one.channel_id].schema_id not in schemas:
                raise Damage(f"a message is on channel {one.channel_id}, which is not defined")
        for schema in schemas.values():
            self._writer.define(schema)
        for channel in channels.values():
            self._writer.define(channel)
        for one in messages:
            self._writer.add(one.channel_id, one.log_time, one.publish_time, one.sequence, one.data)
        if times := [one.log_time for one in messages]:
            self._holes = [hole if hole.end is not None else hole._replace(end=min(times)) for hole in self._holes]
            self._last = max(times) if self._last is None else max(self._last, *times)


def _is_listed(path: Path, names: list[str]) -> bool:
    """Whether the metadata.yaml of a bag lists these files."""
    try:
        return (path / "metadata.yaml").exists() and [file.name for file in files(path)] == names
    except BagError:
        return False


def _information(files: list[Path]) -> dict[str, Any]:
    found, topics, counts = dict[str, MessageCounts](), dict[str, dict[str, Any]](), Counter[str]()
    for path in files:
        with McapFile(path) as file:
            file.open()
            one = found[path.name] = file.counts or MessageCounts()
            for number, channel in file.channels.items():
                counts[channel.topic] += one.by_channel[number]
                topics.setdefault(channel.topic, topic_information(channel, file.schemas[channel.schema_id]))
    return bag_information(found, list(topics.values()), [counts[topic] for topic in topics])
