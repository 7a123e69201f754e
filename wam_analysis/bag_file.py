"""MCAP files of ROS 2 as they lie on disk: found, opened, decoded, and refused in words."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

_BROKEN = (
    McapError, struct.error, zstandard.ZstdError, ValueError, IndexError, KeyError, EOFError, MemoryError,
)  # fmt: skip


class BagError(ValueError):
    """A bag that cannot be read; the message names the path and what to do."""


class Decoders:
    """Decodes messages, one decoder a schema text."""

    def __init__(self) -> None:
        self._factory = DecoderFactory()
        self._known: dict[tuple[str, bytes], Callable[[bytes], Any]] = {}

    def __call__(self, schema: Schema | None, channel: Channel, data: bytes) -> Any:
        """The message as an object whose fields are attributes."""
        if schema is None:
            raise ValueError(f"topic {channel.topic} has no schema")
        key = (schema.name, schema.data)
        decode = self._known.get(key)
        if decode is None:
            decode = self._factory.decoder_for(channel.message_encoding, schema)
            if decode is None:
                raise BagError(f"topic {channel.topic} has its schema in '{schema.encoding}'; only ros2msg is read")
            self._known[key] = decode
        return decode(data)


class Opened:
    """An open MCAP file; what goes wrong inside the with block becomes a BagError."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stream = path.open("rb")

    def __enter__(self) -> McapReader:
        try:
            reader = make_reader(self._stream)
            profile = reader.get_header().profile
            if profile != "ros2":
                raise BagError(f"{self._path} has MCAP profile '{profile}'; only bags of ROS 2 ('ros2') are read")
            return reader
        except BaseException as error:
            self._stream.close()
            self._explain(error)
            raise

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._stream.close()
        if error is not None:
            self._explain(error)

    def _explain(self, error: BaseException) -> None:
        if isinstance(error, BagError) or not isinstance(error, _BROKEN):
            return
        with self._path.open("rb") as stream:
            is_mcap = stream.read(5) == b"\x89MCAP"
            size = stream.seek(0, 2)
            stream.seek(max(0, size - 8))
            is_closed = is_mcap and stream.read(5) == b"\x89MCAP"
        if size == 0:
            raise BagError(f"{self._path} is empty, nothing was recorded; record again") from error
        if not is_mcap:
            raise BagError(f"{self._path} is not MCAP; give a bag recorded with storage 'mcap'") from error
        if not is_closed:
            raise BagError(
                f"{self._path} was not closed, the recorder was killed or the copy is not whole; "
                "'mcap recover' of the MCAP tools makes it readable up to the break"
            ) from error
        reason = f"{type(error).__name__}: {error}"
        raise BagError(f"{self._path} is damaged ({reason}); record or copy it again") from error


def files(path: Path) -> list[Path]:
    """The MCAP files of a bag directory, in the order in which they were recorded, or the one file."""
    if path.is_file():
        return [path]
    if not path.exists():
        raise BagError(f"{path} does not exist; give a bag directory or an .mcap file")
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not files:
        raise BagError(f"{path} has no .mcap file; give a bag directory recorded with storage 'mcap'")
    return files


def schemas(reader: McapReader) -> dict[int, Schema]:
    """The schemas of a closed file by their number."""
    summary = reader.get_summary()
    return dict(summary.schemas) if summary else {}


def channels(reader: McapReader, path: Path) -> list[Channel]:
    """The topics of a closed file; refused where one is not in CDR or has no schema."""
    summary = reader.get_summary()
    if summary is None:
        raise EndOfFile
    for channel in summary.channels.values():
        if channel.message_encoding != "cdr":
            encoding = channel.message_encoding
            raise BagError(f"{path} has topic {channel.topic} in encoding '{encoding}'; only 'cdr' is read")
        if channel.schema_id not in summary.schemas:
            raise BagError(f"{path} has topic {channel.topic} without a schema; record it again with one")
    return list(summary.channels.values())
