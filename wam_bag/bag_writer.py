"""A bag written as rosbag2 writes it: MCAP of profile ros2, and metadata.yaml next to it.

No node and no clock of its own: the recorder decides what is written and at what time.
"""

import contextlib
import errno
import fcntl
import math
import os
import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Final, NamedTuple, Self

from mcap.records import Attachment, Channel, Schema

from wam_bag import safe_yaml
from wam_bag.cdr import ExactLength
from wam_bag.definitions import schema, type_hash
from wam_bag.errors import RecordingError, command
from wam_bag.mcap_records import MessageCounts, together
from wam_bag.mcap_writer import FAST, McapWriter
from wam_bag.metadata import LIBRARY, bag_information, topic_information, write_metadata

__all__ = ["WHOLE", "BagWriter", "RecordingError", "Split", "release"]

CHUNK_SIZE: Final = 1024 * 1024  # bytes; the arm fills half of it in half a second, and it compresses to a tenth
FLUSH_PERIOD: Final = 0.5  # s; a killed recorder loses at most this and one timer period
RESERVE: Final = ".reserved"  # file that keeps space for the end of the bag
RESERVED: Final = 8 * 2**20  # bytes of it; an hour of the arm needs two for its indexes


class Split(NamedTuple):
    """When a bag continues in another file; 0 means never.

    Attributes
    ----------
    size : bytes of a file.
    seconds : of log time in a file.
    """

    size: int
    seconds: float


WHOLE: Final = Split(0, 0.0)  # one file


class BagWriter:
    """Writes a new bag directory ``<path>/`` with ``<name>_0.mcap`` and so on and, on closing, ``metadata.yaml``.

    Space for the end of the bag is reserved while it is open: a full disk is reported before anything is
    recorded, and a disk that fills up leaves a bag that is closed and can be read.

    Parameters
    ----------
    path : directory of the bag; refused if it exists.  Missing parents are created.
    split : when it continues in another file.
    chunk_size : bytes of a chunk.
    level : of its compression, 1 to 22.

    Attributes
    ----------
    closed : True if nothing can be written any more.

    Raises
    ------
    RecordingError
        if the bag cannot be created, before anything is recorded.
    """

    def __init__(self, path: Path, split: Split = WHOLE, chunk_size: int = CHUNK_SIZE, level: int = FAST) -> None:
        self.path = path
        self.closed = False
        self._packing = chunk_size, level
        self._largest = split.size or math.inf  # bytes of a file
        self._longest = round(split.seconds * 1e9) or math.inf  # ns in a file
        self._files: dict[str, MessageCounts] = {}  # that are finished
        self._topics: dict[str, tuple[Channel, Schema, ExactLength]] = {}
        self._schemas: dict[str, Schema] = {}
        self._next_flush = 0.0
        self._file_begin: int | None = None
        _make(path)
        try:
            self._reserve = _reserve(path / RESERVE)
            self._open()
        except OSError as error:
            shutil.rmtree(path, ignore_errors=True)
            raise RecordingError(
                f"bag {path} cannot be created: {error.strerror}; "
                f"free {RESERVED >> 20} MiB or more, or give another directory"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_topic(self, name: str, kind: str, qos: Mapping[str, Any]) -> None:
        """Define a topic; once, before its first message.

        Parameters
        ----------
        name : full topic name, with its namespace.
        kind : type, ``package/msg/Type``, one of `definitions`.
        qos : policies that the publishers offer, see `metadata.offered`.
        """
        definition = self._schemas.setdefault(kind, Schema(len(self._schemas) + 1, schema(kind), "ros2msg", kind))
        metadata = {"offered_qos_profiles": safe_yaml.dump([qos]).strip(), "topic_type_hash": type_hash(kind)}
        channel = Channel(len(self._topics) + 1, name, "cdr", metadata, definition.id)
        self._topics[name] = channel, definition, ExactLength(kind)
        self._define(name)

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int, sequence: int) -> None:
        """Write one message.

        Parameters
        ----------
        topic : name given to `add_topic`.
        data : CDR as received; cut to its exact length.
        log_time, publish_time : ns.
        sequence : number that the publisher gave the message.

        Raises
        ------
        RecordingError
            if it cannot be written to disk; the bag is closed then and can be read.
        """
        channel, _, length_of = self._topics[topic]
        data = data[: length_of(data)]
        if self._file_begin is None:
            self._file_begin = log_time
        try:  # not the context manager, which would take as long as all the rest
            if self._writer.position >= self._largest or log_time - self._file_begin >= self._longest:
                self._writer.flush()
                self._finish_file()
                self._file_begin = log_time
                self._open()
            self._writer.add(channel.id, log_time, publish_time, sequence, data)
        except OSError as error:
            self._give_up(error)

    def flush_when_due(self) -> None:
        """Finish the chunk every half second of wall time; without calls, equal messages give equal files."""
        if time.monotonic() >= self._next_flush and not self.closed:
            self._next_flush = time.monotonic() + FLUSH_PERIOD
            with self._closing_on_failure():
                self._writer.flush()

    def check(self) -> None:
        """Look whether what is written still is where the bag is; call it every few tenths of a second.

        Raises
        ------
        RecordingError
            if its file was deleted, moved or replaced; nothing more is written then.
        """
        if self.closed:
            return
        file = self.path / self._file_name()
        held = os.fstat(self._stream.fileno())
        try:
            found = file.stat()
            if (found.st_dev, found.st_ino) == (held.st_dev, held.st_ino):
                return
            what = "is another file now"
        except OSError as error:
            what = f"is gone ({error.strerror})"
        self.closed = True
        self._reserve.close()
        with contextlib.suppress(OSError):
            self._finish_file()  # whole where it was only moved
        self._stream.close()
        raise RecordingError(f"{file.name} {what}: it was deleted or moved while it was recorded")

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file to the bag, without a time, so that equal runs give equal bags."""
        with self._closing_on_failure():
            self._writer.attach(Attachment(0, 0, name, media_type, data))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        with self._closing_on_failure():
            self._writer.metadata(name, values)

    @property
    def written(self) -> int:
        """Messages on disk."""
        return together([*self._files.values(), self._writer.counts]).by_channel.total()

    def close(self) -> None:
        """Finish the bag and write ``metadata.yaml``; nothing happens the second time.

        Raises
        ------
        RecordingError
            if the last messages cannot be written to disk; the bag is closed and can be read.
        """
        if self.closed:
            return
        with self._closing_on_failure():
            self._writer.flush()
        self._finish_bag()

    def _open(self) -> None:
        path = self.path / self._file_name()
        stream = path.open("xb", buffering=0)
        try:
            self._writer = McapWriter(stream, LIBRARY, *self._packing)
        except OSError:
            stream.close()
            path.unlink()
            raise
        self._stream = stream
        for topic in self._topics:
            self._define(topic)

    def _file_name(self) -> str:
        return f"{self.path.name}_{len(self._files)}.mcap"

    def _define(self, topic: str) -> None:
        """Define a topic in the present file."""
        channel, definition, _ = self._topics[topic]
        self._writer.define(definition)
        self._writer.define(channel)

    def _finish_file(self) -> None:
        writer = self._writer
        files = {**self._files, self._file_name(): writer.counts}
        writer.metadata("rosbag2", {"serialized_metadata": safe_yaml.dump(self._information(files)).strip()})
        writer.finish()
        self._stream.close()
        self._files, writer.counts = files, MessageCounts()

    @contextlib.contextmanager
    def _closing_on_failure(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: OSError) -> None:
        """Close the bag with what is on disk, in the space that was reserved for it."""
        reason = error.strerror or str(error)
        is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        reason, hint = (f"the disk is full ({reason})", "; free some space") if is_full else (reason, "")
        try:
            self._finish_bag()
        except OSError as second:
            raise RecordingError(
                f"{reason}, and the bag could not be closed ({second.strerror}){hint}; "
                f"then {command('wam bag repair', self.path)} closes it"
            ) from None
        raise RecordingError(f"{reason}; the bag is closed, what was recorded until then can be read{hint}") from None

    def _finish_bag(self) -> None:
        self.closed = True
        self._reserve.close()
        release(self.path)
        try:
            if not self._stream.closed:
                self._finish_file()
        finally:
            self._stream.close()
        write_metadata(self.path, self._information(self._files))

    def _information(self, files: Mapping[str, MessageCounts]) -> dict[str, Any]:
        records, counts = self._topics.values(), together(files.values()).by_channel
        topics = [topic_information(channel, definition) for channel, definition, _ in records]
        return bag_information(files, topics, [counts[channel.id] for channel, *_ in records])


def _reserve(path: Path) -> BinaryIO:
    """Reserve the space, and take the lock that marks the bag as being recorded."""
    stream = path.open("xb")
    try:
        os.posix_fallocate(stream.fileno(), 0, RESERVED)
        fcntl.flock(stream, fcntl.LOCK_EX)
    except OSError:
        stream.close()
        raise
    return stream


def release(path: Path) -> None:
    """Release the space reserved for the end of a bag.

    Raises
    ------
    RecordingError
        if the bag is being recorded at this moment.
    """
    with contextlib.suppress(FileNotFoundError), (path / RESERVE).open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise RecordingError(f"bag {path} is being recorded; stop the recorder first") from None
        (path / RESERVE).unlink()


def _make(path: Path) -> None:
    try:
        path.mkdir(parents=True)
    except OSError as error:
        if path.exists():
            raise RecordingError(
                f"bag {path} exists already; nothing was written. Give another name or move it away"
            ) from None
        raise RecordingError(
            f"bag {path} cannot be created: {error.strerror}; give a directory that can be written"
        ) from None
