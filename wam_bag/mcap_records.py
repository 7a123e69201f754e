"""Records of an MCAP file by the `mcap` library, with what it leaves out: bounds, checksums and limits.

The format: https://mcap.dev/spec.  A record is its opcode (1 byte), the length of its content (8 bytes) and
its content.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import Any, Final

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex
from mcap.writer import MCAP0_MAGIC

from wam_bag.arrays import Bytes
from wam_bag.errors import Damage, TooLargeError

MAGIC: Final[bytes] = MCAP0_MAGIC
HEAD: Final = struct.Struct("<BQ")  # opcode and length of a record
FIRST_PRIVATE: Final = 0x80  # opcodes from here on belong to applications and are skipped
FOOTER_SIZE: Final = HEAD.size + 20
LARGEST_CHUNK: Final = 2**28  # bytes, decompressed
LARGEST_ATTACHMENT: Final = 2**28  # bytes
_CLASSES: Final[dict[int, Any]] = {
    Opcode.HEADER: records.Header, Opcode.FOOTER: records.Footer, Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel, Opcode.CHUNK: records.Chunk, Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.ATTACHMENT: records.Attachment, Opcode.ATTACHMENT_INDEX: records.AttachmentIndex,
    Opcode.STATISTICS: records.Statistics, Opcode.METADATA: records.Metadata,
    Opcode.METADATA_INDEX: records.MetadataIndex, Opcode.DATA_END: records.DataEnd,
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


def message(content: bytes) -> records.Message:
    """A message record."""
    return records.Message.read(_Content(BytesIO(content)), len(content))


def serialized(*items: records.McapRecord) -> bytes:
    """Records as they are written to a file."""
    builder = RecordBuilder()
    for item in items:
        item.write(builder)
    return builder.end()  # type: ignore[no-untyped-call]


def walk(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and end of each record in some bytes."""
    position, size = 0, len(data)
    while position < size:
        if position + HEAD.size > size:
            raise Damage("a record ends early")
        opcode, length = HEAD.unpack_from(data, position)
        end = position + HEAD.size + length
        if end > size:
            raise Damage("a record is longer than what contains it")
        yield opcode, position, end
        position = end


def chunk_of(start: int, end: int, head: bytes) -> ChunkIndex:
    """Index of a chunk without message indexes, from the place of its record and the first bytes of its content."""
    first, last, size = struct.unpack_from("<QQQ", head)
    return _checked(ChunkIndex(end - start, start, "", 0, last, 0, {}, first, size))


def chunk_index(content: bytes) -> ChunkIndex:
    """A chunk index record."""
    return _checked(parsed(Opcode.CHUNK_INDEX, content))


def _checked(index: ChunkIndex) -> ChunkIndex:
    if index.uncompressed_size > LARGEST_CHUNK:
        raise TooLargeError(
            f"the chunk at byte {index.chunk_start_offset} is to hold {index.uncompressed_size} bytes; "
            f"chunks of at most {LARGEST_CHUNK} are read"
        )
    return index


def decompress(index: ChunkIndex, record: bytes, into: Bytes, zstd: zstandard.ZstdDecompressor) -> None:
    """Decompress a chunk and check it.

    Parameters
    ----------
    index : of the chunk.
    record : the chunk record on disk.
    into : ``index.uncompressed_size`` bytes, which are filled.
    zstd : kept by the caller, because it takes long to create.
    """
    where = f"the chunk at byte {index.chunk_start_offset}"
    if len(record) != index.chunk_length or HEAD.unpack_from(record) != (Opcode.CHUNK, len(record) - HEAD.size):
        raise Damage(f"{where} is not where its index has it")
    chunk: Chunk = parsed(Opcode.CHUNK, record[HEAD.size :])
    expected = index.message_start_time, index.message_end_time, index.uncompressed_size
    if (chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size) != expected:
        raise Damage(f"{where} and its index differ")
    data = _decompressed(chunk, len(into) + 1, zstd)
    if len(data) != len(into):
        raise Damage(f"{where} holds {len(data)} bytes, or more, instead of {len(into)}")
    if chunk.uncompressed_crc and chunk.uncompressed_crc != zlib.crc32(data):
        raise Damage(f"{where} does not match its checksum")
    into.data[:] = data


def _decompressed(chunk: Chunk, most: int, zstd: zstandard.ZstdDecompressor) -> bytes:
    """So many bytes of a chunk at most; the library's own decompression allocates what the data ask for."""
    if chunk.compression == "":
        return chunk.data
    if chunk.compression == "zstd":
        with zstd.stream_reader(chunk.data) as stream:
            return stream.read(most)
    if chunk.compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=most)
    raise Damage(f"a chunk is compressed with '{chunk.compression}'; 'zstd', 'lz4' and none are read")
