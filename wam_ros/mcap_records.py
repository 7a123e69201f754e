"""Records of an MCAP file: what their bytes mean, bounds and checksums checked.

The format: https://mcap.dev/spec.  Integers are little-endian; a record is its kind (1 byte), the
length of what follows (8 bytes) and that.
"""

import struct
import zlib
from typing import Final, NamedTuple

import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Entries = NDArray[np.uint64]  # of a message index: log time, offset, log time, offset ...

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")  # kind and length of a record
(HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX,
 STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END) = range(1, 16)  # fmt: skip
FIRST_PRIVATE: Final = 0x80  # kinds from here on are anybody's and skipped
FOOTER_SIZE: Final = HEAD.size + 20
LARGEST_CHUNK: Final = 2**30  # bytes; a larger one is taken for a damaged length
BROKEN: Final = (
    ValueError, struct.error, zstandard.ZstdError, RuntimeError, LookupError, OverflowError, MemoryError,
)  # fmt: skip
"""What reading of a broken file may raise, ours and of the libraries for decompression."""


class BagError(ValueError):
    """A bag that cannot be read; the message names the path and what to do."""


class Damage(ValueError):
    """Something in a file that cannot be; the message says what and where."""


class Schema(NamedTuple):
    """Definition of a message type."""

    name: str
    encoding: str
    data: bytes


class Channel(NamedTuple):
    """A topic as one publisher offers it."""

    topic: str
    encoding: str
    schema: int
    metadata: dict[str, str]


class Chunk(NamedTuple):
    """A chunk on disk, by its index or by itself.

    Attributes
    ----------
    start, end : bytes of the file that the record takes.
    index_end : end of the message indexes that follow it.
    first, last : log times within, ns.
    size : bytes of the records within, uncompressed.
    channels : numbers of the channels within, empty where the file does not say.
    """

    start: int
    end: int
    index_end: int
    first: int
    last: int
    size: int
    channels: frozenset[int]


class Statistics(NamedTuple):
    """What a file says about its messages: first and last log time in ns, and how many a channel has."""

    first: int
    last: int
    counts: dict[int, int]


class Attachment(NamedTuple):
    """A file in the file: name, media type, content, times of log and making in ns."""

    name: str
    media_type: str
    data: bytes
    times: tuple[int, int]


class Content:
    """The content of a record, taken value by value."""

    def __init__(self, data: bytes, what: str) -> None:
        self.data, self.what, self.position = data, what, 0

    def numbers(self, layout: str) -> tuple[int, ...]:
        """Integers as struct describes them."""
        end = self.position + struct.calcsize("<" + layout)
        return struct.unpack("<" + layout, self.raw(end - self.position))

    def raw(self, size: int) -> bytes:
        """So many bytes."""
        end = self.position + size
        if end > len(self.data):
            raise Damage(f"{self.what} ends early")
        taken = self.data[self.position : end]
        self.position = end
        return taken

    def text(self) -> str:
        """A string behind its length."""
        (size,) = self.numbers("I")
        return self.raw(size).decode("utf-8")

    def pairs(self) -> dict[str, str]:
        """A map of strings behind its length in bytes."""
        (size,) = self.numbers("I")
        inner = Content(self.raw(size), self.what)
        found = {}
        while inner.position < size:
            key = inner.text()
            found[key] = inner.text()
        return found


def schema(data: bytes) -> tuple[int, Schema]:
    """Number and schema of a schema record."""
    content = Content(data, "a schema record")
    (number,) = content.numbers("H")
    name, encoding = content.text(), content.text()
    (size,) = content.numbers("I")
    return number, Schema(name, encoding, content.raw(size))


def channel(data: bytes) -> tuple[int, Channel]:
    """Number and channel of a channel record."""
    content = Content(data, "a channel record")
    number, schema_number = content.numbers("HH")
    topic, encoding = content.text(), content.text()
    return number, Channel(topic, encoding, schema_number, content.pairs())


def chunk_index(data: bytes) -> Chunk:
    """The chunk that a chunk index record describes."""
    content = Content(data, "a chunk index record")
    first, last, start, length, size = content.numbers("QQQQI")
    numbers = frozenset(number for number, _ in struct.iter_unpack("<HQ", content.raw(size)))
    (index_length,) = content.numbers("Q")
    content.text()
    _, uncompressed = content.numbers("QQ")
    return Chunk(start, start + length, start + length + index_length, first, last, uncompressed, numbers)


def chunk(start: int, end: int, head: bytes) -> Chunk:
    """A chunk as its own record describes it; `head` are the first bytes of its content."""
    first, last, size = Content(head, f"the chunk at byte {start}").numbers("QQQ")
    return Chunk(start, end, end, first, last, size, frozenset())


def statistics(data: bytes) -> Statistics:
    """What a statistics record says."""
    content = Content(data, "the statistics record")
    *_, first, last = content.numbers("QHIIIIQQ")
    (size,) = content.numbers("I")
    return Statistics(first, last, dict(struct.iter_unpack("<HQ", content.raw(size))))


def attachment(data: bytes) -> Attachment:
    """Content of an attachment record; its checksum is checked."""
    content = Content(data, "an attachment")
    log_time, create_time = content.numbers("QQ")
    name, media_type = content.text(), content.text()
    (size,) = content.numbers("Q")
    inside = content.raw(size)
    checked = content.position
    (crc,) = content.numbers("I")
    if crc and crc != zlib.crc32(data[:checked]):
        raise Damage(f"attachment '{name}' does not match its checksum")
    return Attachment(name, media_type, inside, (log_time, create_time))


def metadata(data: bytes) -> tuple[str, dict[str, str]]:
    """Name and values of a metadata record."""
    content = Content(data, "a metadata record")
    name = content.text()
    return name, content.pairs()


def unpack(found: Chunk, record: bytes, into: Bytes) -> None:
    """Write the records of a chunk, uncompressed and checked, into a buffer of their size.

    Parameters
    ----------
    found : the chunk as its index describes it.
    record : its record on disk, with kind and length.
    into : ``found.size`` bytes.
    """
    where = f"the chunk at byte {found.start}"
    if len(record) != found.end - found.start or HEAD.unpack_from(record) != (CHUNK, len(record) - HEAD.size):
        raise Damage(f"{where} is not where its index says")
    content = Content(record, where)
    content.position = HEAD.size
    first, last, size, crc = content.numbers("QQQI")
    if (first, last, size) != (found.first, found.last, found.size):
        raise Damage(f"{where} and its index differ")
    compression = content.text()
    (length,) = content.numbers("Q")
    data = memoryview(record)[content.position :]
    if len(data) != length:
        raise Damage(f"{where} has {len(data)} bytes instead of {length}")
    written = _uncompress(compression, data, into, where)
    if written != size:
        raise Damage(f"{where} holds {written} bytes, or more, instead of {size}")
    if crc and crc != zlib.crc32(into.data):
        raise Damage(f"{where} does not match its checksum")


def _uncompress(compression: str, data: memoryview, into: Bytes, where: str) -> int:
    """Fill `into`; returns how many bytes came, more than fit where there were more."""
    view = into.data
    size = len(view)
    if compression == "":
        view[: len(data)] = data[:size]
        return len(data)
    if compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(data) as stream:
            count = 0
            while count < size and (got := stream.readinto(view[count:])):
                count += got
            return count + len(stream.read(1))
    if compression == "lz4":
        decompressor = lz4.frame.LZ4FrameDecompressor()
        out = decompressor.decompress(data, max_length=size + 1)
        view[: len(out)] = out[:size]
        return len(out)
    raise Damage(f"{where} is compressed with '{compression}'; 'zstd', 'lz4' and none are read")
