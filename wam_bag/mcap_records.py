"""Records of an MCAP file by the `mcap` library, with what it leaves out: bounds, checksums and limits.

The format: https://mcap.dev/spec.  A record is its opcode (1 byte), the length of its content (8 bytes) and
its content.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from io import BytesIO
from mmap import mmap
from typing import Any, Final, NamedTuple

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from wam_bag.arrays import Bytes
from wam_bag.errors import Damage, TooLargeError

MAGIC: Final[bytes] = MCAP0_MAGIC
HEAD: Final = struct.Struct("<BQ")  # opcode and length of a record
MESSAGE: Final = struct.Struct("<BQHIQQ")  # start of a message: opcode, length, channel, sequence, log, publish time
FIRST_PRIVATE: Final = 0x80  # opcodes from here on belong to applications and are skipped
FOOTER: Final = struct.Struct("<QQI")  # content: start of the summary, of its offsets, checksum
FOOTER_SIZE: Final = HEAD.size + FOOTER.size
LARGEST: Final = 2**28  # bytes of a chunk, decompressed, or of an attachment
_CLASSES: Final[dict[int, Any]] = {
    Opcode.SCHEMA: records.Schema, Opcode.CHANNEL: records.Channel,
    Opcode.ATTACHMENT: records.Attachment, Opcode.ATTACHMENT_INDEX: records.AttachmentIndex,
    Opcode.CHUNK: records.Chunk, Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.STATISTICS: records.Statistics, Opcode.METADATA: records.Metadata,
    Opcode.METADATA_INDEX: records.MetadataIndex,
}  # fmt: skip


class _Content(ReadDataStream):
    """Content of a record; the library itself takes a short read for a short value."""

    def read(self, length: int) -> bytes:
        """Exactly so many bytes."""
        data: bytes = super().read(length)
        if len(data) != length:
            raise Damage("a record ends early")
        return data


def parsed(opcode: int, content: bytes) -> Any:
    """The record of the library with this content.

    Raises one of `errors.BROKEN` if the content does not fit the opcode, and Damage if the checksum of an
    attachment does not match.
    """
    if opcode == Opcode.ATTACHMENT:
        crc = int.from_bytes(content[-4:], "little")
        if crc and crc != zlib.crc32(content[:-4]):
            raise Damage("an attachment does not match its checksum")
    return _CLASSES[opcode].read(_Content(BytesIO(content)))


def serialized(record: records.McapRecord) -> bytes:
    """A record as it is written to a file."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()  # type: ignore[no-untyped-call]


class MessageCounts(NamedTuple):
    """First and last log time of some messages in ns, 0 if there are none, and their numbers by channel id."""

    first: int = 0
    last: int = 0
    by_channel: Counter[int] = Counter()  # noqa: RUF012 - never changed


def together(parts: Iterable[MessageCounts]) -> MessageCounts:
    """Several counts as one; of several files, channel ids differ."""
    filled = [one for one in parts if any(one.by_channel.values())]
    first, last = min((one.first for one in filled), default=0), max((one.last for one in filled), default=0)
    return MessageCounts(first, last, sum((one.by_channel for one in filled), Counter()))


class RecordExtent(NamedTuple):
    """A record among others: its opcode, first byte and end."""

    opcode: int
    start: int
    end: int


def walk(data: bytes | mmap, start: int, end: int) -> Iterator[RecordExtent]:
    """The records between two places of some bytes."""
    while start < end:
        if start + HEAD.size > end:
            raise Damage(f"a record at byte {start} ends early")
        opcode, length = HEAD.unpack_from(data, start)
        after = start + HEAD.size + length
        if after > end:
            raise Damage(f"the record at byte {start} is longer than what contains it")
        yield RecordExtent(opcode, start, after)
        start = after


class ChunkPlace(NamedTuple):
    """A chunk in a file, or message records outside chunks.

    Attributes
    ----------
    start, end : of its record, bytes.
    indexes_end : of the message indexes behind it; as `end` where they are not known.
    first, last : log times, ns.
    size : decompressed, bytes.
    channels : that have messages in it; none where the file does not list them.
    is_loose : whether it is no chunk.
    """

    start: int
    end: int
    indexes_end: int
    first: int
    last: int
    size: int
    channels: frozenset[int]
    is_loose: bool = False


def chunk_index(content: bytes) -> ChunkPlace:
    """A chunk by its index record."""
    one: records.ChunkIndex = parsed(Opcode.CHUNK_INDEX, content)
    start, end = one.chunk_start_offset, one.chunk_start_offset + one.chunk_length
    channels = frozenset(one.message_index_offsets)
    return checked(
        ChunkPlace(
            start, end, end + one.message_index_length, one.message_start_time, one.message_end_time,
            one.uncompressed_size, channels,
        )
    )  # fmt: skip


def checked(place: ChunkPlace) -> ChunkPlace:
    """The same; raises TooLargeError if it would take too much memory."""
    if place.size > LARGEST:
        raise TooLargeError(
            f"the chunk at byte {place.start} is to hold {place.size} bytes; chunks of at most {LARGEST} are read"
        )
    return place


def decompress(place: ChunkPlace, record: bytes, into: Bytes, zstd: zstandard.ZstdDecompressor) -> None:
    """Decompress a chunk and check it.

    Parameters
    ----------
    place : of the chunk.
    record : the chunk record on disk.
    into : ``place.size`` bytes, which are filled.
    zstd : kept by the caller, because it takes long to create.
    """
    where = f"the chunk at byte {place.start}"
    if record[: HEAD.size] != HEAD.pack(Opcode.CHUNK, len(record) - HEAD.size):
        raise Damage(f"{where} is not where its index has it")
    chunk: records.Chunk = parsed(Opcode.CHUNK, record[HEAD.size :])
    described = chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size
    if described != (place.first, place.last, place.size):
        raise Damage(f"{where} and its index differ")
    data = expanded(chunk, len(into) + 1, zstd)
    if len(data) != len(into):
        raise Damage(f"{where} holds {len(data)} bytes, or more, instead of {len(into)}")
    if chunk.uncompressed_crc and chunk.uncompressed_crc != zlib.crc32(data):
        raise Damage(f"{where} does not match its checksum")
    into.data[:] = data


def expanded(chunk: records.Chunk, most: int, zstd: zstandard.ZstdDecompressor) -> bytes:
    """Its records, at most so many bytes; the library's own decompression allocates what the data ask for."""
    data: bytes = chunk.data
    if chunk.compression == "zstd":
        with zstd.stream_reader(data) as stream:
            data = stream.read(most)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most)
    elif chunk.compression:
        raise Damage(f"a chunk is compressed with {chunk.compression!r}; 'zstd', 'lz4' and none are read")
    return data
