"""An MCAP file opened for reading: every byte of it accounted for, its messages in large batches.

Chunks that the summary names are taken from there.  The bytes between them, and the whole file if there is no
summary, are walked through record by record.
"""

import os
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Final, NamedTuple, Self

import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Footer, Message, Schema, Statistics

from wam_bag.errors import Damage, NotClosedError, TooLargeError
from wam_bag.mcap_records import (
    FIRST_PRIVATE,
    FOOTER_SIZE,
    HEAD,
    LARGEST_ATTACHMENT,
    MAGIC,
    chunk_index,
    chunk_of,
    decompress,
    message,
    parsed,
    walk,
)
from wam_bag.message_search import DATA, NEVER, Found, MessageBatch, find, log_times, together

BATCH: Final = 16 * 2**20  # bytes that are decoded together
TAIL: Final = 16  # bytes behind the records of a batch, so that a wide read of the last one stays inside
WINDOW: Final = 2**18  # bytes read at a time when walking through a file
_DATA_END: Final = (Opcode.DATA_END, 4)  # head of the record that ends the data


class Loose(NamedTuple):
    """Message records outside chunks: bytes of the file, about a batch at most."""

    start: int
    end: int


class RecordExtent(NamedTuple):
    """A record in the file."""

    opcode: int
    start: int
    end: int


class MessageCounts(NamedTuple):
    """First and last log time of the messages in ns, 0 if there are none, and messages by channel id."""

    first: int
    last: int
    by_channel: dict[int, int]


class McapFile:
    """An open file; a context manager.

    Parameters
    ----------
    path : the file.

    Attributes
    ----------
    schemas, channels : by id; those within chunks are known only when these were read.
    counts : messages as the file itself counts them, None if it does not.
    size : bytes of the file.

    Raises
    ------
    Damage
        and the other errors of `errors.BROKEN`, here and in every method, if the file is not as it must be.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: MessageCounts | None = None
        self.profile = ""
        self._stream = path.open("rb")
        self.size = self._size = os.fstat(self._stream.fileno()).st_size
        self._blocks: list[ChunkIndex | Loose] = []
        self._attachments: list[RecordExtent] = []
        self._metadata: list[RecordExtent] = []
        self._memory = np.empty(0, np.uint8)
        self._zstd = zstandard.ZstdDecompressor()
        self._data_crc = 0
        self._data_end = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.close()

    def open(self) -> None:
        """Find the parts of a closed file.

        Raises
        ------
        NotClosedError
            if it was not finished: its writer was killed, or the copy is incomplete.
        """
        position = self._read_header()
        if not self.has_end():
            raise NotClosedError("it was not closed")
        for extent, chunk in self._read_summary():
            if extent.start < position or extent.end > self._data_end:
                raise Damage(f"its index names bytes {extent.start} to {extent.end}, which belong to something else")
            self._walk(position, extent.start)
            if chunk:
                self._blocks.append(chunk)
            else:
                self._note(extent)
            position = extent.end
        self._walk(position, self._data_end)

    def count(self) -> MessageCounts:
        """Messages counted by reading them all."""
        counts: Counter[int] = Counter()
        first, last = NEVER, 0
        for batch in self.batches():
            for channel, found in batch.found.items():
                times = log_times(batch.buffer, found)
                counts[channel] += len(times)
                first, last = min(first, int(times.min())), max(last, int(times.max()))
        return MessageCounts(first if counts else 0, last, dict(counts))

    def salvage(self) -> Iterator[RecordExtent]:
        """Records of the data that can be found in a broken file.

        The file is walked through up to the first bytes that are no record; then follow the records that a
        summary names behind them.
        """
        position = self._read_header()
        known = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX,
                 Opcode.ATTACHMENT, Opcode.METADATA}  # fmt: skip
        while position + HEAD.size <= self._size:
            record = self.record_at(position)
            if record.opcode not in known or record.end > self._size:
                break
            yield record
            position = record.end
        try:
            parts = self._read_summary()
        except ValueError:
            return
        for (opcode, start, end), chunk in parts:
            if start >= position and end <= self._size:
                chunk_end = start + chunk.chunk_length if chunk else end
                yield RecordExtent(opcode, start, chunk_end)
                if end > chunk_end:
                    yield RecordExtent(Opcode.MESSAGE_INDEX, chunk_end, end)  # all of them

    def data_size(self) -> int:
        """Bytes of the file without its end, if it has one."""
        return self._data_end or self._size

    def has_end(self) -> bool:
        """Whether it was finished once: it ends with the magic bytes."""
        size = len(MAGIC)
        return self._size >= size and self._read(self._size - size, size) == MAGIC

    def is_data_end(self, position: int) -> bool:
        """Whether the record at a place ends the data, so that no messages are behind it."""
        return position + HEAD.size <= self._size and HEAD.unpack(self._read(position, HEAD.size)) == _DATA_END

    def record_at(self, position: int) -> RecordExtent:
        """The record at a place."""
        opcode, length = HEAD.unpack(self._read(position, HEAD.size))
        return RecordExtent(opcode, position, position + HEAD.size + length)

    def content(self, record: RecordExtent) -> bytes:
        """Content of a record."""
        return self._read(record.start + HEAD.size, record.end - record.start - HEAD.size)

    def messages(self, record: RecordExtent) -> list[Message]:
        """The messages of a chunk record, checked, in their order; its indexes are not needed."""
        index = chunk_of(record.start, record.end, self._read(record.start + HEAD.size, 24))
        buffer, by_channel = self._load([index], index.uncompressed_size)
        found = [
            place
            for some in by_channel.values()
            for place in zip(some.offsets.tolist(), some.sizes.tolist(), strict=True)
        ]
        return [message(buffer[start + HEAD.size : start + DATA + size].tobytes()) for start, size in sorted(found)]

    def check_all(self) -> None:
        """Compare the checksum of all data with the one at their end, if there is one."""
        if not self._data_crc:
            return
        crc = 0
        for start in range(0, self._data_end, 2**20):
            crc = zlib.crc32(self._read(start, min(2**20, self._data_end - start)), crc)
        if crc != self._data_crc:
            raise Damage("its data do not match their checksum")

    def attachments(self) -> list[Attachment]:
        """The attachments in the order of the file."""
        for _, start, end in self._attachments:
            if end - start > LARGEST_ATTACHMENT:
                raise TooLargeError(
                    f"the attachment at byte {start} has {end - start} bytes; at most {LARGEST_ATTACHMENT} are read"
                )
        return [parsed(Opcode.ATTACHMENT, self.content(record)) for record in self._attachments]

    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata records by name; the entries of several of one name are put together, as those of merged bags."""
        found: dict[str, dict[str, str]] = {}
        for record in self._metadata:
            one = parsed(Opcode.METADATA, self.content(record))
            found.setdefault(one.name, {}).update(one.metadata)
        return found

    def has_all_definitions(self) -> bool:
        """Whether every channel that the file counts, and its schema, is known without reading chunks."""
        if self.counts is None or not self.counts.by_channel.keys() <= self.channels.keys():
            return False
        return {channel.schema_id for channel in self.channels.values()} <= self.schemas.keys()

    def batches(
        self, channels: frozenset[int] | None = None, begin: int = 0, end: int = NEVER
    ) -> Iterator[MessageBatch]:
        """Records in memory, some megabytes at a time.

        Parameters
        ----------
        channels : ids of the channels that are needed, None for all.  Others may come as well.
        begin, end : log times that are needed, ns, begin <= t < end.  Others may come as well.
        """
        pending: list[ChunkIndex | Loose] = []
        size = 0
        for block in self._blocks:
            if isinstance(block, ChunkIndex):
                if block.message_end_time < begin or block.message_start_time >= end:
                    continue
                within = block.message_index_offsets.keys()  # empty if the file does not list them
                if channels is not None and within and not within & channels:
                    continue
            pending.append(block)
            size += _size(block)
            if size >= BATCH:
                yield self._load(pending, size)
                pending, size = [], 0
        if pending:
            yield self._load(pending, size)

    def define(self, opcode: int, content: bytes) -> None:
        """Take a schema or channel record; the same id must not mean two things."""
        record = parsed(opcode, content)
        kept = self.schemas if opcode == Opcode.SCHEMA else self.channels
        if kept.setdefault(record.id, record) != record:
            raise Damage(f"{Opcode(opcode).name.lower()} {record.id} is defined twice, differently")

    def _read(self, start: int, size: int) -> bytes:
        if size < 0:
            raise Damage(f"a record at byte {start} is shorter than its head")
        if size > self._size:
            raise Damage(f"a record at byte {start} is to have {size} bytes, more than the file")
        data = os.pread(self._stream.fileno(), size, start)
        while len(data) < size:
            more = os.pread(self._stream.fileno(), size - len(data), start + len(data))
            if not more:
                raise Damage(f"it ends at byte {start + len(data)}, in the middle of something")
            data += more
        return data

    def _read_header(self) -> int:
        """Take the header; returns where the data start."""
        header = self.record_at(len(MAGIC))
        if header.opcode != Opcode.HEADER or header.end > self._size:
            raise Damage("it does not begin with a header")
        self.profile = parsed(Opcode.HEADER, self.content(header)).profile
        return header.end

    def _read_summary(self) -> list[tuple[RecordExtent, ChunkIndex | None]]:
        """Parts of the data that the summary names, in the order of the file; a chunk with its indexes is one."""
        footer_start = self._size - FOOTER_SIZE - len(MAGIC)
        footer_record = self._read(max(footer_start, 0), FOOTER_SIZE)
        if HEAD.unpack_from(footer_record) != (Opcode.FOOTER, FOOTER_SIZE - HEAD.size):
            raise Damage("it does not end with a footer")
        footer: Footer = parsed(Opcode.FOOTER, footer_record[HEAD.size :])
        end = footer.summary_start or footer_start
        data_end = end - HEAD.size - 4
        if not 0 < data_end <= footer_start - HEAD.size - 4:
            raise Damage(f"its footer names byte {footer.summary_start} as the start of the summary")
        if not self.is_data_end(data_end):
            raise Damage("its data do not end where the summary begins")
        self._data_crc = int.from_bytes(self._read(end - 4, 4), "little")
        self._data_end = data_end
        summary = self._read(end, footer_start - end)
        if footer.summary_crc and footer.summary_crc != zlib.crc32(footer_record[:-4], zlib.crc32(summary)):
            raise Damage("its summary does not match its checksum")
        return sorted(self._summary_parts(summary), key=lambda part: part[0].start)

    def _summary_parts(self, summary: bytes) -> Iterator[tuple[RecordExtent, ChunkIndex | None]]:
        for opcode, start, end in walk(summary):
            content = summary[start + HEAD.size : end]
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.define(opcode, content)
            elif opcode == Opcode.CHUNK_INDEX:
                chunk = chunk_index(content)
                yield RecordExtent(Opcode.CHUNK, chunk.chunk_start_offset, _indexes_end(chunk)), chunk
            elif opcode in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
                index = parsed(opcode, content)
                part = Opcode.ATTACHMENT if opcode == Opcode.ATTACHMENT_INDEX else Opcode.METADATA
                yield RecordExtent(part, index.offset, index.offset + index.length), None
            elif opcode == Opcode.STATISTICS:
                found: Statistics = parsed(opcode, content)
                self.counts = MessageCounts(
                    found.message_start_time, found.message_end_time, found.channel_message_counts
                )

    def _walk(self, start: int, end: int) -> None:
        """Note the records between two places of the file."""
        loose = start
        while start < end:
            window = self._read(start, min(WINDOW, end - start))
            if len(window) < HEAD.size:
                raise Damage(f"a record at byte {start} ends early")
            inside = 0
            while inside + HEAD.size <= len(window):
                opcode, length = HEAD.unpack_from(window, inside)
                here, after = start + inside, start + inside + HEAD.size + length
                if after > end:
                    raise Damage(f"the record at byte {here} is longer than what contains it")
                if opcode != Opcode.MESSAGE or after - loose > BATCH:
                    if here > loose:
                        self._blocks.append(Loose(loose, here))
                    loose = here
                if opcode != Opcode.MESSAGE:
                    loose = after
                    self._note(RecordExtent(opcode, here, after))
                inside += HEAD.size + length
            start += min(inside, end - start)
        if end > loose:
            self._blocks.append(Loose(loose, end))

    def _note(self, record: RecordExtent) -> None:
        opcode, start, end = record
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self.define(opcode, self.content(record))
        elif opcode == Opcode.CHUNK:
            self._blocks.append(chunk_of(start, end, self._read(start + HEAD.size, min(24, end - start - HEAD.size))))
        elif opcode == Opcode.ATTACHMENT:
            self._attachments.append(record)
        elif opcode == Opcode.METADATA:
            self._metadata.append(record)
        elif opcode != Opcode.MESSAGE_INDEX and opcode < FIRST_PRIVATE:
            raise Damage(f"a record at byte {start} has opcode {opcode}, which does not belong there")

    def _load(self, blocks: list[ChunkIndex | Loose], size: int) -> MessageBatch:
        if len(self._memory) < size + TAIL:  # kept, because the system hands out new memory slowly
            self._memory = np.empty(max(size, BATCH) + TAIL, np.uint8)
        buffer = self._memory[: size + TAIL]
        buffer[size:] = 0
        parts: dict[int, list[Found]] = {}
        position = 0
        for block in blocks:
            part = buffer[position : position + _size(block)]
            index = b""
            if isinstance(block, ChunkIndex):
                data = self._read(block.chunk_start_offset, _indexes_end(block) - block.chunk_start_offset)
                decompress(block, data[: block.chunk_length], part, self._zstd)
                index = data[block.chunk_length :]
            else:
                part[:] = np.frombuffer(self._read(block.start, block.end - block.start), np.uint8)
            for channel, found in find(part, index, self.define).items():
                parts.setdefault(channel, []).append(Found(found.offsets + position, found.sizes))
            position += len(part)
        return MessageBatch(buffer, {channel: together(found) for channel, found in parts.items()})


def _size(block: ChunkIndex | Loose) -> int:
    return block.uncompressed_size if isinstance(block, ChunkIndex) else block.end - block.start


def _indexes_end(chunk: ChunkIndex) -> int:
    return chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length
