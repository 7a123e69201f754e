"""An MCAP file opened: every byte of it accounted for, and its messages found in bulk.

Chunks that the summary names are taken from there.  What lies between is walked through record by
record, and so is the whole file where there is no summary.
"""

import os
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from wam_ros import mcap_records as records
from wam_ros.mcap_records import HEAD, Attachment, Bytes, Channel, Chunk, Damage, Schema, Statistics

Offsets = NDArray[np.int64]
BATCH: Final = 16 * 2**20  # bytes that are decoded together
TAIL: Final = 16  # bytes behind the records of a batch, so that a wide look at the last stays inside
WINDOW: Final = 2**18  # bytes read at a time when walking through a file
_INDEX_HEAD: Final = 15  # bytes of a message index record before its entries
_LEAST_MESSAGE: Final = 22  # bytes of a message record's content without data
DATA: Final = HEAD.size + _LEAST_MESSAGE  # bytes of a message record before its data
NEVER: Final = 2**63  # ns; later than every log time


class Loose(NamedTuple):
    """Messages on disk outside chunks: bytes of the file, at most about a batch."""

    start: int
    end: int


class Found(NamedTuple):
    """Messages in a batch, in the order of the file: where their records begin, and bytes of each message."""

    offsets: Offsets
    sizes: Offsets


class Batch(NamedTuple):
    """Some records in memory, until the next batch is taken, and where in them the messages are."""

    buffer: Bytes
    found: dict[int, Found]  # by number of the channel


class NotClosedError(Damage):
    """A file that was not finished."""


class McapFile:
    """An open file; a context manager.

    Parameters
    ----------
    path : the file.

    Attributes
    ----------
    schemas, channels : by number; those within chunks are known only when these were read.
    statistics : what the file itself says about its messages, None where it says nothing.
    definitions : content of the schema and channel records by kind and number.

    Raises
    ------
    Damage
        here and in every method, where the file is not what it must be.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.statistics: Statistics | None = None
        self.definitions: dict[tuple[int, int], bytes] = {}
        self.profile = ""
        self.is_closed = False
        self._stream = path.open("rb")
        self._size = os.fstat(self._stream.fileno()).st_size
        self._blocks: list[Chunk | Loose] = []
        self._attachments: list[tuple[int, int]] = []
        self._metadata: list[tuple[int, int]] = []
        self._memory = np.empty(0, np.uint8)
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
            where it was not finished: its writer was killed, or the copy is not whole.
        """
        begin = self._read_header()
        if not self.has_end():
            raise NotClosedError("it was not closed")
        parts = self._read_summary()
        position = begin
        for start, end, part in sorted(parts, key=lambda item: item[0]):
            if start < position or end > self._data_end:
                raise Damage(f"its index names bytes {start} to {end}, which belong to something else")
            self._walk(position, start)
            if isinstance(part, Chunk):
                self._blocks.append(part)
            elif part == records.ATTACHMENT:
                self._attachments.append((start, end))
            else:
                self._metadata.append((start, end))
            position = end
        self._walk(position, self._data_end)
        self.is_closed = True

    def count(self) -> Statistics:
        """What the file would say about its messages, found by reading them all."""
        counts: Counter[int] = Counter()
        first, last = NEVER, 0
        for batch in self.batches(None, 0, NEVER):
            for channel, found in batch.found.items():
                times = log_times(batch.buffer, found.offsets)
                counts[channel] += len(times)
                first, last = min(first, int(times.min())), max(last, int(times.max()))
        return Statistics(first if counts else 0, last, dict(counts))

    def salvage(self) -> Iterator[tuple[int, int, int]]:
        """Kind, begin and end of the records of the data that can be told apart in a broken file.

        They are walked through to the first that is none; behind it go on those that a summary names.
        """
        position = self._read_header()
        known = {records.SCHEMA, records.CHANNEL, records.MESSAGE, records.CHUNK, records.MESSAGE_INDEX,
                 records.ATTACHMENT, records.METADATA}  # fmt: skip
        while position + HEAD.size <= self._size:
            kind, length = self.head(position)
            end = position + HEAD.size + length
            if kind not in known or end > self._size:
                break
            yield kind, position, end
            position = end
        try:
            parts = self._read_summary()
        except ValueError:
            return
        for start, end, part in sorted(parts, key=lambda item: item[0]):
            if start >= position and end <= self._size:
                if not isinstance(part, Chunk):
                    yield part, start, end
                    continue
                yield records.CHUNK, start, part.end
                if part.index_end > part.end:
                    yield records.MESSAGE_INDEX, part.end, part.index_end  # all of them

    def data_size(self) -> int:
        """Bytes of the file without its end, as far as it has one."""
        return self._data_end or self._size

    def has_end(self) -> bool:
        """Whether it was finished once: it ends as such a file does."""
        size = len(records.MAGIC)
        return self._size >= size and self._read(self._size - size, size) == records.MAGIC

    def ends_at(self, position: int) -> bool:
        """Whether the record that ends the data stands at a place, so that behind it are no messages."""
        return position + HEAD.size <= self._size and self.head(position) == (records.DATA_END, 4)

    def head(self, position: int) -> tuple[int, int]:
        """Kind of the record at a place, and bytes of its content."""
        kind, length = HEAD.unpack(self._read(position, HEAD.size))
        return int(kind), int(length)

    def content(self, start: int, end: int) -> bytes:
        """Content of the record between two places."""
        return self._read(start + HEAD.size, end - start - HEAD.size)

    def unpacked(self, start: int, end: int) -> Batch:
        """The chunk between two places, checked."""
        content = self.content(start, end)
        chunk = records.chunk(start, end, content[:24])
        if chunk.size > records.LARGEST_CHUNK:
            raise Damage(f"the chunk at byte {start} is to hold {chunk.size} bytes")
        buffer = np.empty(chunk.size + TAIL, np.uint8)
        records.unpack(chunk, self._read(start, end - start), buffer[: chunk.size])
        return Batch(buffer, self._find(buffer[: chunk.size], b""))

    def check_all(self) -> None:
        """Compare the checksum of all data with the one at their end, where there is one."""
        if not self._data_crc:
            return
        crc = 0
        for start in range(0, self._data_end, 2**20):
            crc = zlib.crc32(self._read(start, min(2**20, self._data_end - start)), crc)
        if crc != self._data_crc:
            raise Damage("its data do not match their checksum")

    def attached(self) -> list[Attachment]:
        """The attachments."""
        return [records.attachment(self.content(*extent)) for extent in self._attachments]

    def attachments(self) -> dict[str, bytes]:
        """Content of the attachments by name."""
        return {item.name: item.data for item in self.attached()}

    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata records by name."""
        return dict(records.metadata(self.content(*extent)) for extent in self._metadata)

    def has_all_definitions(self) -> bool:
        """Whether every channel that the file counts, and its schema, is known without reading chunks."""
        if self.statistics is None or not self.statistics.counts.keys() <= self.channels.keys():
            return False
        return {channel.schema for channel in self.channels.values()} <= self.schemas.keys()

    def batches(self, channels: frozenset[int] | None, begin: int, end: int) -> Iterator[Batch]:
        """Records in memory, some megabytes at a time.

        Parameters
        ----------
        channels : numbers of the channels that are asked for, None for all.  Others may come as well.
        begin, end : log times asked for, ns, begin <= t < end.  Others may come as well.
        """
        pending: list[Chunk | Loose] = []
        size = 0
        for block in self._blocks:
            if isinstance(block, Chunk):
                if block.last < begin or block.first >= end:
                    continue
                if channels is not None and block.channels and not (block.channels & channels):
                    continue
            pending.append(block)
            size += _size(block)
            if size >= BATCH:
                yield self._load(pending, size)
                pending, size = [], 0
        if pending:
            yield self._load(pending, size)

    def define(self, kind: int, content: bytes) -> None:
        """Take a schema or channel record; the same number must not mean two things."""
        if kind == records.SCHEMA:
            number, schema = records.schema(content)
            if self.schemas.setdefault(number, schema) != schema:
                raise Damage(f"schema {number} is defined twice, differently")
        else:
            number, channel = records.channel(content)
            if self.channels.setdefault(number, channel) != channel:
                raise Damage(f"channel {number} is defined twice, differently")
        self.definitions[kind, number] = content

    def _read(self, start: int, size: int) -> bytes:
        data = os.pread(self._stream.fileno(), size, start)
        while len(data) < size:
            more = os.pread(self._stream.fileno(), size - len(data), start + len(data))
            if not more:
                raise Damage(f"it ends at byte {start + len(data)}, in the middle of something")
            data += more
        return data

    def _read_header(self) -> int:
        kind, length = HEAD.unpack(self._read(len(records.MAGIC), HEAD.size))
        begin = len(records.MAGIC) + HEAD.size
        if kind != records.HEADER or begin + length > self._size:
            raise Damage("it does not begin with a header")
        content = records.Content(self._read(begin, length), "the header")
        self.profile = content.text()
        return begin + int(length)

    def _read_summary(self) -> list[tuple[int, int, Chunk | int]]:
        """Parts that the summary names: first byte, end, chunk or kind."""
        footer_start = self._size - records.FOOTER_SIZE - len(records.MAGIC)
        footer = records.Content(self._read(max(footer_start, 0), records.FOOTER_SIZE), "the footer")
        if footer.numbers("BQ") != (records.FOOTER, 20):
            raise Damage("it does not end with a footer")
        summary_start, _, crc = footer.numbers("QQI")
        end = summary_start or footer_start
        head = HEAD.size + 4
        if not head < end <= footer_start:
            raise Damage(f"its footer says that the summary begins at byte {summary_start}")
        data_end = records.Content(self._read(end - head, head), "the end of the data")
        if data_end.numbers("BQ") != (records.DATA_END, 4):
            raise Damage("its data do not end where the summary begins")
        (self._data_crc,) = data_end.numbers("I")
        self._data_end = end - head
        if not summary_start:
            return []
        summary = self._read(summary_start, footer_start - summary_start)
        if crc and crc != zlib.crc32(footer.data[:-4], zlib.crc32(summary)):
            raise Damage("its summary does not match its checksum")
        return self._summary_parts(summary)

    def _summary_parts(self, summary: bytes) -> list[tuple[int, int, Chunk | int]]:
        parts: list[tuple[int, int, Chunk | int]] = []
        for kind, start, end in _walk(summary, 0, len(summary)):
            content = summary[start + HEAD.size : end]
            if kind in (records.SCHEMA, records.CHANNEL):
                self.define(kind, content)
            elif kind == records.CHUNK_INDEX:
                chunk = records.chunk_index(content)
                if chunk.size > records.LARGEST_CHUNK:
                    raise Damage(f"the chunk at byte {chunk.start} is to hold {chunk.size} bytes")
                parts.append((chunk.start, chunk.index_end, chunk))
            elif kind in (records.ATTACHMENT_INDEX, records.METADATA_INDEX):
                first, length = records.Content(content, "an index").numbers("QQ")
                part = records.ATTACHMENT if kind == records.ATTACHMENT_INDEX else records.METADATA
                parts.append((first, first + length, part))
            elif kind == records.STATISTICS:
                self.statistics = records.statistics(content)
        return parts

    def _walk(self, start: int, end: int) -> None:
        """Note what stands between two places of the file."""
        loose = start
        while start < end:
            window = self._read(start, min(WINDOW, end - start))
            if len(window) < HEAD.size:
                raise Damage(f"a record at byte {start} ends early")
            inside = 0
            while inside + HEAD.size <= len(window):
                kind, length = HEAD.unpack_from(window, inside)
                here, after = start + inside, start + inside + HEAD.size + length
                if after > end:
                    raise Damage(f"the record at byte {here} is longer than what holds it")
                if kind == records.MESSAGE:
                    if after - loose > BATCH and here > loose:
                        self._blocks.append(Loose(loose, here))
                        loose = here
                else:
                    if here > loose:
                        self._blocks.append(Loose(loose, here))
                    loose = after
                    self._note(kind, here, after)
                inside += HEAD.size + length
            start += min(inside, end - start)
        if end > loose:
            self._blocks.append(Loose(loose, end))

    def _note(self, kind: int, start: int, end: int) -> None:
        if kind in (records.SCHEMA, records.CHANNEL):
            self.define(kind, self.content(start, end))
        elif kind == records.CHUNK:
            head = self._read(start + HEAD.size, min(24, end - start - HEAD.size))
            chunk = records.chunk(start, end, head)
            if chunk.size > records.LARGEST_CHUNK:
                raise Damage(f"the chunk at byte {start} is to hold {chunk.size} bytes")
            self._blocks.append(chunk)
        elif kind == records.ATTACHMENT:
            self._attachments.append((start, end))
        elif kind == records.METADATA:
            self._metadata.append((start, end))
        elif kind != records.MESSAGE_INDEX and kind < records.FIRST_PRIVATE:
            raise Damage(f"a record at byte {start} has kind {kind}, which does not belong there")

    def _load(self, blocks: list[Chunk | Loose], size: int) -> Batch:
        if len(self._memory) < size + TAIL:  # kept, because the system hands out new memory slowly
            self._memory = np.empty(max(size, BATCH) + TAIL, np.uint8)
        buffer = self._memory[: size + TAIL]
        buffer[size:] = 0
        parts: dict[int, list[Found]] = {}
        position = 0
        for block in blocks:
            part = buffer[position : position + _size(block)]
            index = b""
            if isinstance(block, Chunk):
                data = self._read(block.start, block.index_end - block.start)
                records.unpack(block, data[: block.end - block.start], part)
                index = data[block.end - block.start :]
            else:
                part[:] = np.frombuffer(self._read(block.start, block.end - block.start), np.uint8)
            for channel, found in self._find(part, index).items():
                parts.setdefault(channel, []).append(Found(found.offsets + position, found.sizes))
            position += len(part)
        return Batch(buffer, {channel: together(found) for channel, found in parts.items()})

    def _find(self, part: Bytes, index: bytes) -> dict[int, Found]:
        """Places of the messages among the records of a chunk, by channel; definitions are taken."""
        if index and (found := self._find_by_index(part, index)) is not None:
            return found
        data = part.tobytes()
        messages, sizes = [], []
        for kind, start, end in _walk(data, 0, len(data)):
            if kind == records.MESSAGE:
                if end - start < HEAD.size + _LEAST_MESSAGE:
                    raise Damage("a message record ends early")
                messages.append(start)
                sizes.append(end - start - DATA)
            elif kind in (records.SCHEMA, records.CHANNEL):
                self.define(kind, data[start + HEAD.size : end])
            elif kind < records.FIRST_PRIVATE:
                raise Damage(f"a record among messages has kind {kind}, which does not belong there")
        offsets, lengths = np.array(messages, np.int64), np.array(sizes, np.int64)
        channels = at(part, offsets + 9, "<u2")
        return {
            int(number): Found(offsets[channels == number], lengths[channels == number])
            for number in np.unique(channels)
        }

    def _find_by_index(self, part: Bytes, index: bytes) -> dict[int, Found] | None:
        """The same from the message indexes; None where these are not whole or not in order.

        They are whole where the messages they name are different ones and fill all bytes but those of
        the definitions at the beginning.
        """
        begin, size = 0, len(part)
        while begin + HEAD.size <= size and part[begin] in (records.SCHEMA, records.CHANNEL):
            kind, length = HEAD.unpack(part[begin : begin + HEAD.size].tobytes())
            if begin + HEAD.size + length > size:
                return None
            self.define(kind, part[begin + HEAD.size : begin + HEAD.size + length].tobytes())
            begin += HEAD.size + length
        numbers, found = [], []
        position = 0
        while position + _INDEX_HEAD <= len(index):
            kind, length = HEAD.unpack_from(index, position)
            after = position + HEAD.size + length
            if kind != records.MESSAGE_INDEX or after > len(index) or (length - 6) % 16 or length < 6:
                return None
            entries = np.frombuffer(index, "<i8", (length - 6) // 8, position + _INDEX_HEAD)
            if len(entries):
                numbers.append(int.from_bytes(index[position + 9 : position + 11], "little"))
                found.append(entries[1::2])
            position = after
        if not found or len(set(numbers)) != len(numbers):
            return None
        offsets = np.concatenate(found)
        ends = np.cumsum([len(part) for part in found])
        rising = np.diff(offsets) > 0
        rising[ends[:-1] - 1] = True
        if not rising.all() or offsets.min() < begin or offsets.max() > size - HEAD.size - _LEAST_MESSAGE:
            return None
        heads, tails = at(part, offsets, "<u8"), at(part, offsets + 7, "<u4")
        sizes = (heads >> 8).astype(np.int64) - _LEAST_MESSAGE  # of the length only the last byte is in the tail
        expected = np.repeat(np.array(numbers, np.uint32), np.diff(ends, prepend=0)) << 16
        is_whole = (
            (heads & 255 == records.MESSAGE).all()
            and (tails & ~np.uint32(255) == expected).all()
            and (sizes >= 0).all()
            and (offsets + sizes <= size - DATA).all()
            and int(sizes.sum()) + DATA * len(offsets) == size - begin
        )
        if not is_whole:
            return None
        starts = [0, *ends.tolist()]
        return {
            number: Found(offsets[start:end], sizes[start:end])
            for number, (start, end) in zip(numbers, pairwise(starts), strict=True)
        }


def at(buffer: Bytes, offsets: Offsets, dtype: str) -> NDArray[Any]:
    """Numbers of a type that begin at these places of a buffer."""
    kind = np.dtype(dtype)
    view: NDArray[Any] = np.ndarray((len(buffer) - kind.itemsize + 1,), kind, buffer, strides=(1,))
    return view[offsets]


def log_times(buffer: Bytes, offsets: Offsets) -> NDArray[np.int64]:
    """Log times of the messages whose records begin at these places, ns."""
    times = at(buffer, offsets + 15, "<u8")
    if (times >= NEVER).any():
        raise Damage(f"a message has the log time {times.max()} ns")
    return times.astype(np.int64)


def together(found: Sequence[Found]) -> Found:
    """Several one after the other."""
    if len(found) == 1:
        return found[0]
    return Found(np.concatenate([part.offsets for part in found]), np.concatenate([part.sizes for part in found]))


def messages(buffer: Bytes, found: Found) -> list[bytes]:
    """These messages, serialized."""
    starts = found.offsets + DATA
    ends = starts + found.sizes
    return [buffer[start:end].tobytes() for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]


def _size(block: Chunk | Loose) -> int:
    return block.size if isinstance(block, Chunk) else block.end - block.start


def _walk(data: bytes, position: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Kind, begin and end of each record."""
    head = HEAD.unpack_from
    while position < end:
        if position + HEAD.size > end:
            raise Damage("a record ends early")
        kind, length = head(data, position)
        after = position + HEAD.size + length
        if after > end:
            raise Damage("a record is longer than what holds it")
        yield kind, position, after
        position = after
