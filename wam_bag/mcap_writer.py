"""MCAP files written: chunks, indexes, checksums, and a summary at the end.

What has been written is always whole: a chunk goes to disk together with its indexes, and if that fails,
because the disk is full, the file is cut back to what was whole before and can still be finished.  The writer
of the `mcap` library cannot do that: after a failed write its statistics, indexes and checksum include what is
not on disk.  So records are those of the library, and when they are written is decided here.
"""

import contextlib
import os
import struct
import zlib
from collections import Counter
from collections.abc import Mapping
from io import FileIO
from typing import Final

import numpy as np
import zstandard
from mcap import records
from mcap.opcode import Opcode

from wam_bag.mcap_records import FOOTER_SIZE, HEAD, MAGIC, MESSAGE, MessageCounts, serialized, together

FAST: Final = 3
_OPCODE: Final = int(Opcode.MESSAGE)  # packed faster than the enumeration
_WITHOUT_DATA: Final = MESSAGE.size - HEAD.size
_INDEX = struct.Struct("<BQHI")  # start of a message index record: opcode, length, channel, bytes of the entries
_GROUPS: Final = (
    Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
)  # fmt: skip


class McapWriter:
    """Writes one file.

    Parameters
    ----------
    stream : new file, unbuffered; the caller closes it.
    library : name of the writing program.
    chunk_size : bytes of records in a chunk, about.
    level : of the zstd compression, 1 to 22; recording a running arm needs a fast one.

    Attributes
    ----------
    counts : of the messages in chunks on disk.
    position : bytes on disk.
    """

    def __init__(self, stream: FileIO, library: str, chunk_size: int, level: int = FAST) -> None:
        self.counts = MessageCounts()
        self.position = 0
        self._stream = stream
        self._chunk_size = chunk_size
        self._crc = 0
        self._groups = {opcode: bytearray() for opcode in _GROUPS}  # of the summary
        self._numbers = dict.fromkeys(_GROUPS, 0)
        self._compressor = zstandard.ZstdCompressor(level)
        self._defined: list[records.Schema | records.Channel] = []
        self._buffer = bytearray()
        self._index: dict[int, list[int]] = {}
        self._put(MAGIC + serialized(records.Header("ros2", library)))

    def define(self, definition: records.Schema | records.Channel) -> None:
        """Take a schema or channel with its id; one that is known already is not written again."""
        if definition in self._defined:
            return
        self._defined.append(definition)
        self._summarize(Opcode.SCHEMA if isinstance(definition, records.Schema) else Opcode.CHANNEL, definition)
        self._buffer += serialized(definition)

    def add(self, channel: int, log_time: int, publish_time: int, sequence: int, data: bytes) -> None:
        """Add a message to the chunk; the chunk goes to disk when it is full."""
        buffer = self._buffer
        head = MESSAGE.pack(_OPCODE, _WITHOUT_DATA + len(data), channel, sequence & 0xFFFFFFFF, log_time, publish_time)
        index = self._index.get(channel)
        if index is None:
            index = self._index[channel] = []
        index += (log_time, len(buffer))
        buffer += head
        buffer += data
        if len(buffer) > self._chunk_size:
            self.flush()

    def flush(self) -> None:
        """Write the chunk to disk, if there are messages in it."""
        if not self._index:
            return
        data, index = bytes(self._buffer), self._index
        self._buffer, self._index = bytearray(), {}
        times = [time for entries in index.values() for time in entries[::2]]
        chunk = records.Chunk(
            "zstd", self._compressor.compress(data), max(times), min(times), zlib.crc32(data), len(data)
        )
        pieces = [serialized(chunk)]
        start, length = self.position, len(pieces[0])
        end = start + length
        offsets = {}
        for channel, entries in index.items():
            offsets[channel] = end
            pieces.append(_INDEX.pack(Opcode.MESSAGE_INDEX, 6 + 8 * len(entries), channel, 8 * len(entries)))
            pieces.append(np.array(entries, "<u8").tobytes())
            end += len(pieces[-2]) + len(pieces[-1])
        self._put(b"".join(pieces))
        first, last = chunk.message_start_time, chunk.message_end_time
        found = records.ChunkIndex(
            length, start, chunk.compression, len(chunk.data), last, end - start - length, offsets, first,
            chunk.uncompressed_size,
        )  # fmt: skip
        self._summarize(Opcode.CHUNK_INDEX, found)
        numbers = Counter({channel: len(entries) // 2 for channel, entries in index.items()})
        self.counts = together([self.counts, MessageCounts(first, last, numbers)])

    def attach(self, attachment: records.Attachment) -> None:
        """Write an attachment, behind the messages before it."""
        self.flush()
        data = serialized(attachment)
        self._put(data)
        index = records.AttachmentIndex(
            self.position - len(data), len(data), attachment.log_time, attachment.create_time, len(attachment.data),
            attachment.name, attachment.media_type,
        )  # fmt: skip
        self._summarize(Opcode.ATTACHMENT_INDEX, index)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record, behind the messages before it."""
        self.flush()
        data = serialized(records.Metadata(name, dict(values)))
        self._put(data)
        self._summarize(Opcode.METADATA_INDEX, records.MetadataIndex(self.position - len(data), len(data), name))

    def finish(self) -> None:
        """Write what is still in memory, then the summary."""
        self.flush()
        end = serialized(records.DataEnd(self._crc))
        summary_start = self.position + len(end)
        statistics = records.Statistics(
            attachment_count=self._numbers[Opcode.ATTACHMENT_INDEX],
            channel_count=self._numbers[Opcode.CHANNEL],
            channel_message_counts=dict(sorted(self.counts.by_channel.items())),
            chunk_count=self._numbers[Opcode.CHUNK_INDEX],
            message_count=self.counts.by_channel.total(),
            message_end_time=self.counts.last,
            message_start_time=self.counts.first,
            metadata_count=self._numbers[Opcode.METADATA_INDEX],
            schema_count=self._numbers[Opcode.SCHEMA],
        )
        self._groups[Opcode.STATISTICS] = bytearray(serialized(statistics))
        body, offsets = b"", b""
        for opcode, group in self._groups.items():
            if group:
                offsets += serialized(records.SummaryOffset(opcode, summary_start + len(body), len(group)))
                body += group
        offset_start = summary_start + len(body)
        crc = zlib.crc32(body + offsets + serialized(records.Footer(summary_start, offset_start, 0))[: FOOTER_SIZE - 4])
        self._put(end + body + offsets + serialized(records.Footer(summary_start, offset_start, crc)) + MAGIC)

    def _summarize(self, opcode: Opcode, record: records.McapRecord) -> None:
        self._groups[opcode] += serialized(record)
        self._numbers[opcode] += 1

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
