"""MCAP files written: chunks, indexes, checksums, and a summary at the end.

What has been written is always whole: a chunk goes to disk with its indexes in one piece, and where that
fails, because the disk is full, the file is cut back to what was whole before and can still be finished.
"""

import contextlib
import os
import struct
import zlib
from collections.abc import Mapping
from io import FileIO
from typing import Final, NamedTuple

import numpy as np
import zstandard

from wam_ros import mcap_records as records
from wam_ros.mcap_records import HEAD

_MESSAGE = struct.Struct("<BQHIQQ")  # head of a message record: kind, length, channel, sequence, log and publish time
FAST: Final = 3
_WITHOUT_DATA: Final = _MESSAGE.size - HEAD.size
_GROUPS = (records.SCHEMA, records.CHANNEL, records.STATISTICS, records.CHUNK_INDEX, records.ATTACHMENT_INDEX,
           records.METADATA_INDEX)  # fmt: skip


class Part(NamedTuple):
    """A record of the summary: its kind and its content."""

    kind: int
    content: bytes


class McapWriter:
    """Writes one file.

    Parameters
    ----------
    stream : new file, unbuffered; the caller closes it.
    library : who writes.
    chunk_size : bytes of records in a chunk, about.
    level : of the compression by zstd, 1 to 22; what is recorded while an arm runs needs a fast one.

    Attributes
    ----------
    counts : messages by number of the channel, those in chunks on disk.
    first, last : log times of these, ns; 0 where there are none.
    position : bytes on disk.
    """

    def __init__(self, stream: FileIO, library: str, chunk_size: int, level: int = FAST) -> None:
        self.counts: dict[int, int] = {}
        self.first, self.last = 0, 0
        self.position = 0
        self._stream = stream
        self._chunk_size = chunk_size
        self._crc = 0
        self._parts: list[Part] = []
        self._schemas = self._channels = self._chunks = self._attachments = self._metadata = 0
        self._compressor = zstandard.ZstdCompressor(level)
        self._buffer = bytearray()
        self._index: dict[int, list[int]] = {}
        self._put(records.MAGIC + record(records.HEADER, text("ros2") + text(library)))

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Define a schema; returns its number."""
        self._schemas += 1
        content = struct.pack("<H", self._schemas) + text(name) + text(encoding) + struct.pack("<I", len(data)) + data
        self.define(records.SCHEMA, content)
        return self._schemas

    def channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Define a channel; returns its number."""
        self._channels += 1
        content = struct.pack("<HH", self._channels, schema) + text(topic) + text(encoding) + pairs(metadata)
        self.define(records.CHANNEL, content)
        return self._channels

    def define(self, kind: int, content: bytes, is_new: bool = True) -> None:
        """Take a schema or channel record with its number; one that is not new stands in a chunk already."""
        self._parts.append(Part(kind, content))
        if is_new:
            self._buffer += record(kind, content)

    def add(self, channel: int, log_time: int, publish_time: int, sequence: int, data: bytes) -> None:
        """Add a message to the chunk; the chunk goes to disk when it is full."""
        buffer = self._buffer
        index = self._index.get(channel)
        if index is None:
            index = self._index[channel] = []
        index += (log_time, len(buffer))
        buffer += _MESSAGE.pack(
            records.MESSAGE, _WITHOUT_DATA + len(data), channel, sequence & 0xFFFFFFFF, log_time, publish_time
        )
        buffer += data
        if len(buffer) >= self._chunk_size:
            self.flush()

    def flush(self) -> None:
        """Bring the chunk to disk, if there are messages in it."""
        if not self._index:
            return
        data, index = bytes(self._buffer), self._index
        self._buffer, self._index = bytearray(), {}
        times = [time for entries in index.values() for time in entries[::2]]
        head = struct.pack("<QQQI", min(times), max(times), len(data), zlib.crc32(data))
        compressed = self._compressor.compress(data)
        content = head + text("zstd") + struct.pack("<Q", len(compressed)) + compressed
        self.add_chunk(content, {channel: np.array(entries, "<u8") for channel, entries in index.items()})

    def add_chunk(self, content: bytes, index: Mapping[int, records.Entries]) -> None:
        """Write a whole chunk.

        Parameters
        ----------
        content : of the chunk record.
        index : by channel the log time and the place in the chunk of each message, one after the other.
        """
        first, last, size, _ = struct.unpack_from("<QQQI", content)
        (length,) = struct.unpack_from("<I", content, 28)
        compression = content[28 : 32 + length]
        pieces = [record(records.CHUNK, content)]
        end = len(pieces[0])
        offsets = b""
        for channel, entries in index.items():
            offsets += struct.pack("<HQ", channel, self.position + end)
            packed = entries.tobytes()
            pieces.append(record(records.MESSAGE_INDEX, struct.pack("<HI", channel, len(packed)) + packed))
            end += len(pieces[-1])
        start, chunk_length = self.position, len(pieces[0])
        self._put(b"".join(pieces))
        compressed_size = len(content) - 28 - len(compression) - 8
        self._parts.append(
            Part(
                records.CHUNK_INDEX,
                struct.pack("<QQQQI", first, last, start, chunk_length, len(offsets))
                + offsets
                + struct.pack("<Q", end - chunk_length)
                + compression
                + struct.pack("<QQ", compressed_size, size),
            )
        )
        self._chunks += 1
        self.first = min(self.first, first) if self.counts else first
        self.last = max(self.last, last)
        for channel, entries in index.items():
            self.counts[channel] = self.counts.get(channel, 0) + len(entries) // 2

    def attach(self, name: str, media_type: str, data: bytes, times: tuple[int, int] = (0, 0)) -> None:
        """Write an attachment; `times` are those of its log and of its making, ns."""
        inside = struct.pack("<QQ", *times) + text(name) + text(media_type) + struct.pack("<Q", len(data)) + data
        whole = record(records.ATTACHMENT, inside + struct.pack("<I", zlib.crc32(inside)))
        start = self.position
        self._put(whole)
        index = struct.pack("<QQQQQ", start, len(whole), *times, len(data)) + text(name) + text(media_type)
        self._parts.append(Part(records.ATTACHMENT_INDEX, index))
        self._attachments += 1

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record."""
        whole = record(records.METADATA, text(name) + pairs(values))
        start = self.position
        self._put(whole)
        self._parts.append(Part(records.METADATA_INDEX, struct.pack("<QQ", start, len(whole)) + text(name)))
        self._metadata += 1

    def finish(self) -> None:
        """Write what is still in memory, then the summary."""
        self.flush()
        end = record(records.DATA_END, struct.pack("<I", self._crc))
        summary_start = self.position + len(end)
        summary = self._summary(summary_start)
        offset_start = summary_start + len(summary[0])
        content = struct.pack("<QQ", summary_start, offset_start)
        footer = HEAD.pack(records.FOOTER, len(content) + 4) + content
        crc = zlib.crc32(b"".join([*summary, footer]))
        self._put(b"".join([end, *summary, footer, struct.pack("<I", crc), records.MAGIC]))

    def _summary(self, start: int) -> tuple[bytes, bytes]:
        """Records of the summary, grouped by kind, and where each group is."""
        parts = [*self._parts, Part(records.STATISTICS, self._statistics())]
        body, offsets = b"", b""
        for kind in _GROUPS:
            group = b"".join(record(*part) for part in parts if part.kind == kind)
            if group:
                offsets += record(records.SUMMARY_OFFSET, struct.pack("<BQQ", kind, start + len(body), len(group)))
            body += group
        return body, offsets

    def _statistics(self) -> bytes:
        schemas = sum(part.kind == records.SCHEMA for part in self._parts)
        channels = sum(part.kind == records.CHANNEL for part in self._parts)
        counts = b"".join(struct.pack("<HQ", *item) for item in sorted(self.counts.items()))
        return (
            struct.pack("<QHIIII", sum(self.counts.values()), schemas, channels, self._attachments, self._metadata,
                        self._chunks)
            + struct.pack("<QQI", self.first, self.last, len(counts))
            + counts
        )  # fmt: skip

    def _put(self, data: bytes) -> None:
        """Write all or nothing."""
        view = memoryview(data)
        try:
            while view:
                view = view[self._stream.write(view) :]
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._stream.fileno(), self.position)
                self._stream.seek(self.position)
            raise
        self.position += len(data)
        self._crc = zlib.crc32(data, self._crc)


def record(kind: int, content: bytes) -> bytes:
    """A record: kind, length, content."""
    return HEAD.pack(kind, len(content)) + content


def text(value: str) -> bytes:
    """A string behind its length."""
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def pairs(values: Mapping[str, str]) -> bytes:
    """A map of strings behind its length in bytes."""
    data = b"".join(text(part) for item in values.items() for part in item)
    return struct.pack("<I", len(data)) + data
