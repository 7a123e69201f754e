"""An MCAP file opened for reading: every byte of it accounted for, its messages in large batches.

The file is mapped into memory.  Chunks that the summary names are taken from there.  The bytes between them, and the
whole file if there is no summary, are walked through record by record.
"""

import contextlib
import mmap
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema, Statistics

from wam_bag.errors import BagError, Damage, NotClosedError, TooLargeError
from wam_bag.limits import READING_LIMITS
from wam_bag.mcap_records import (
    FIRST_PRIVATE,
    FOOTER,
    FOOTER_SIZE,
    HEAD,
    LARGEST,
    MAGIC,
    MESSAGE,
    ChunkPlace,
    MessageCounts,
    RecordExtent,
    checked,
    chunk_index,
    decompress,
    expanded,
    parsed,
    together,
    walk,
)
from wam_bag.message_search import NEVER, TAIL, MessageBatch, find

BATCH: Final = 16 * 2**20  # bytes that are decoded together
_DATA_END: Final = HEAD.pack(Opcode.DATA_END, 4)  # head of the record that ends the data
_OF_DATA: Final = {
    Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT,
    Opcode.METADATA,
}  # fmt: skip


class BagFile(contextlib.ExitStack):
    """An open file of a bag, or a bag that is no MCAP; a context manager.

    Parameters
    ----------
    path : the file.

    Attributes
    ----------
    schemas, channels : by id; those within chunks are known only when these were read.
    counts : messages as the file itself counts them, None if it does not.
    loaded : the same of the latest `batches`.

    Raises
    ------
    Damage
        and the other errors of `errors.BROKEN`, here and in every method, if the file is not as it must be.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: MessageCounts | None = None
        self.loaded = MessageCounts()

    def open(self) -> None:
        """Find the parts of a closed file."""

    def check_all(self) -> None:
        """Compare the checksum of all data with the one at their end, if there is one."""

    def records(self, opcode: Opcode) -> list[Any]:
        """Its attachments, or its metadata records, in the order of the file."""
        return []

    def batches(
        self, channels: frozenset[int] | None = None, begin: int = 0, end: int = NEVER
    ) -> Iterator[MessageBatch]:
        """Records in memory, some megabytes at a time.

        Parameters
        ----------
        channels : ids of the channels that are needed, None for all.  Others may come as well.
        begin, end : log times that are needed, ns, begin <= t < end.  Others may come as well.
        """
        raise NotImplementedError

    def has_all_definitions(self) -> bool:
        """Whether every channel that the file counts, and its schema, is known without reading chunks."""
        if self.counts is None or not self.counts.by_channel.keys() <= self.channels.keys():
            return False
        return {channel.schema_id for channel in self.channels.values()} <= self.schemas.keys()

    def _taken(self, batch: MessageBatch) -> MessageBatch:
        """The batch, whose messages are counted."""
        if len(times := batch.times):
            messages = Counter(dict(enumerate(np.bincount(batch.channels).tolist())))
            self.loaded = together([self.loaded, MessageCounts(int(times.min()), int(times.max()), messages)])
        return batch


class McapFile(BagFile):
    """A file of MCAP.

    Attributes
    ----------
    size : bytes of the file.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        if not path.stat().st_size:
            raise BagError(f"{path} is empty, nothing was recorded; record again")
        with path.open("rb") as stream:
            self._data: bytes | mmap.mmap = self.enter_context(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))
        self.size = len(self._data)
        self._blocks: list[ChunkPlace] = []
        self._others: list[RecordExtent] = []  # attachments and metadata
        self._zstd = zstandard.ZstdDecompressor()
        self._data_crc = 0
        self._data_end = 0

    def open(self) -> None:
        """Find the parts of a closed file.

        Raises
        ------
        NotClosedError
            if it was not finished: its writer was killed, or the copy is incomplete.
        """
        position = self.data_start()
        if not self.has_end():
            raise NotClosedError("it was not closed")
        chunks, _ = self._read_summary()
        for chunk in sorted(chunks):
            if chunk.start < position or chunk.indexes_end > self._data_end:
                raise Damage(f"its index names bytes {chunk.start} to {chunk.end}, which belong to something else")
            self._take(position, chunk.start)
            self._blocks.append(chunk)
            position = chunk.indexes_end
        self._take(position, self._data_end)

    def salvage(self) -> Iterator[RecordExtent]:
        """Records of the data that can be found in a broken file.

        The file is walked through up to the first bytes that are no record; then follow the records that a
        summary names behind them.
        """
        position = self.data_start()
        places = [position]
        with contextlib.suppress(ValueError):
            chunks, others = self._read_summary()
            places += sorted([*(chunk.start for chunk in chunks), *others])
        for place in places:
            if place < position:
                continue
            with contextlib.suppress(Damage):
                for record in walk(self._data, place, self.size):
                    if record.opcode not in _OF_DATA and record.opcode < FIRST_PRIVATE:
                        break
                    yield record
                    position = record.end

    def beginning(self, position: int) -> Iterator[RecordExtent]:
        """The whole records of a chunk that breaks off at the end; from then on, places are in it, decompressed."""
        if not self.has_end() and self._data[position] == Opcode.CHUNK:
            chunk = Chunk.read(ReadDataStream(BytesIO(self._data[position + HEAD.size :])))
            self._data = expanded(chunk, LARGEST, self._zstd)
            self.size = len(self._data)
            yield from walk(self._data, 0, self.size)

    def data_size(self) -> int:
        """Bytes of the file without its end, if it has one."""
        return self._data_end or self.size

    def has_end(self) -> bool:
        """Whether it was finished once: it ends with the magic bytes."""
        return self._data[-len(MAGIC) :] == MAGIC

    def is_data_end(self, position: int) -> bool:
        """Whether the record at a place ends the data, so that no messages are behind it."""
        return self._data[position : position + HEAD.size] == _DATA_END

    def content(self, record: RecordExtent) -> bytes:
        """Content of a record."""
        return self._data[record.start + HEAD.size : record.end]

    def messages(self, record: RecordExtent) -> list[Message]:
        """The messages of a chunk, or that of a message record, checked, in their order; no indexes are needed."""
        place = self._chunk_at(record) if record.opcode == Opcode.CHUNK else _loose(record.start, record.end)
        batch = self._load([place], place.size)
        heads = [MESSAGE.unpack_from(batch.buffer.data, offset) for offset in batch.offsets.tolist()]
        return [
            Message(channel, log_time, data, publish_time, sequence)
            for (_, _, channel, sequence, log_time, publish_time), data in zip(heads, batch.messages(), strict=True)
        ]

    def check_all(self) -> None:
        """Compare the checksum of all data with the one at their end, if there is one."""
        if not self._data_crc:
            return
        with memoryview(self._data) as data, data[: self._data_end] as covered:
            crc = zlib.crc32(covered)
        if crc != self._data_crc:
            raise Damage("its data do not match their checksum")

    def records(self, opcode: Opcode) -> list[Any]:
        """See `BagFile.records`."""
        found = [one for one in self._others if one.opcode == opcode]
        for _, start, end in found:
            if end - start > LARGEST:
                raise TooLargeError(
                    f"the {opcode.name.lower()} at byte {start} has {end - start} bytes; at most {LARGEST} are read"
                )
        return [parsed(opcode, self.content(record)) for record in found]

    def batches(
        self, channels: frozenset[int] | None = None, begin: int = 0, end: int = NEVER
    ) -> Iterator[MessageBatch]:
        """See `BagFile.batches`."""
        self.loaded = MessageCounts()
        pending: list[ChunkPlace] = []
        size = whole = 0
        wanted = [
            block
            for block in self._blocks
            if block.last >= begin
            and block.first < end
            and (channels is None or (channels and not block.channels) or block.channels & channels)
        ]
        for block in wanted:
            pending.append(block)
            size += block.size
            if size < BATCH and block is not wanted[-1]:
                continue
            whole += size
            if whole > READING_LIMITS.expanded and whole > READING_LIMITS.expansion * self.size:
                raise TooLargeError(
                    f"its {self.size} bytes decompress to more than {READING_LIMITS.expansion} times as many"
                )
            yield self._taken(self._load(pending, size))
            pending, size = [], 0

    def define(self, opcode: int, content: bytes) -> None:
        """Take a schema or channel record; the same id must not mean two things."""
        record = parsed(opcode, content)
        kept = self.schemas if opcode == Opcode.SCHEMA else self.channels
        if kept.setdefault(record.id, record) != record:
            raise Damage(f"{Opcode(opcode).name.lower()} {record.id} is defined twice, differently")

    def data_start(self) -> int:
        """Where the data start, behind the header."""
        header = next(walk(self._data, len(MAGIC), self.size), None)
        if header is None or header.opcode != Opcode.HEADER:
            raise Damage("it does not begin with a header")
        return header.end

    def _read_summary(self) -> tuple[list[ChunkPlace], list[int]]:
        """The chunks that the summary names, and where attachments and metadata records begin."""
        footer_start = self.size - FOOTER_SIZE - len(MAGIC)
        footer = self._data[max(footer_start, 0) : footer_start + FOOTER_SIZE]
        if footer[: HEAD.size] != HEAD.pack(Opcode.FOOTER, FOOTER_SIZE - HEAD.size):
            raise Damage("it does not end with a footer")
        start, _, crc = FOOTER.unpack_from(footer, HEAD.size)
        end = start or footer_start
        data_end = end - HEAD.size - 4
        if not 0 < data_end <= footer_start - HEAD.size - 4:
            raise Damage(f"its footer names byte {start} as the start of the summary")
        if not self.is_data_end(data_end):
            raise Damage("its data do not end where the summary begins")
        self._data_crc = int.from_bytes(self._data[end - 4 : end], "little")
        self._data_end = data_end
        if crc and crc != zlib.crc32(self._data[end : footer_start + FOOTER_SIZE - 4]):
            raise Damage("its summary does not match its checksum")
        chunks, others = [], []
        for record in walk(self._data, end, footer_start):
            opcode, content = record.opcode, self.content(record)
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.define(opcode, content)
            elif opcode == Opcode.CHUNK_INDEX:
                chunks.append(chunk_index(content))
            elif opcode in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
                others.append(parsed(opcode, content).offset)
            elif opcode == Opcode.STATISTICS:
                found: Statistics = parsed(opcode, content)
                self.counts = MessageCounts(
                    found.message_start_time, found.message_end_time, Counter(found.channel_message_counts)
                )
        return chunks, others

    def _take(self, start: int, end: int) -> None:
        """Note the records between two places of the file."""
        for record in walk(self._data, start, end):
            opcode = record.opcode
            if opcode == Opcode.MESSAGE:
                begin, last = record.start, self._blocks[-1] if self._blocks else None
                if last and last.is_loose and last.end == begin and record.end - last.start <= BATCH:
                    begin = self._blocks.pop().start
                self._blocks.append(_loose(begin, record.end))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.define(opcode, self.content(record))
            elif opcode == Opcode.CHUNK:
                self._blocks.append(self._chunk_at(record))
            elif opcode in (Opcode.ATTACHMENT, Opcode.METADATA):
                self._others.append(record)
            elif opcode != Opcode.MESSAGE_INDEX and opcode < FIRST_PRIVATE:
                raise Damage(f"a record at byte {record.start} has opcode {opcode}, which does not belong there")

    def _chunk_at(self, record: RecordExtent) -> ChunkPlace:
        """A chunk without message indexes, from the first bytes of its record."""
        first, last, size = struct.unpack_from("<QQQ", self._data, record.start + HEAD.size)
        return checked(ChunkPlace(record.start, record.end, record.end, first, last, size, frozenset()))

    def _load(self, blocks: list[ChunkPlace], size: int) -> MessageBatch:
        buffer, parts = np.zeros(size + TAIL, np.uint8), [np.empty((4, 0), np.int64)]
        position = 0
        for block in blocks:
            part = buffer[position : position + block.size]
            index = b""
            if block.is_loose:
                part[:] = np.frombuffer(self._data[block.start : block.end], np.uint8)
            else:
                decompress(block, self._data[block.start : block.end], part, self._zstd)
                index = self._data[block.end : block.indexes_end]
            parts.append(find(part, index, self.define, position))
            position += len(part)
        return MessageBatch(buffer, *np.concatenate(parts, axis=1))


def _loose(start: int, end: int) -> ChunkPlace:
    """Message records outside chunks."""
    return ChunkPlace(start, end, end, 0, NEVER, end - start, frozenset(), is_loose=True)
