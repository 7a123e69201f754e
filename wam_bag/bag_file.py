"""Bags on disk: their files found and opened, their messages selected, and errors in the user's words."""

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import yaml
from mcap.records import Channel

from wam_bag import safe_yaml
from wam_bag.cdr import ENCODINGS, JSON, SCHEMAS, MessageType
from wam_bag.errors import BROKEN, BagError, Damage, NotClosedError, TooLargeError, command
from wam_bag.limits import READING_LIMITS
from wam_bag.mcap_file import BagFile, McapFile
from wam_bag.mcap_records import MAGIC
from wam_bag.message_search import NEVER, MessageBatch
from wam_bag.message_text import definitions, full_name
from wam_bag.rosbags_file import SUFFIXES, RosbagsFile

_FILE_NAMES = re.compile(r"^  relative_file_paths:.*\n(?:   *(?:-| ).*\n)*", re.MULTILINE)
_EACH_MESSAGE = re.compile(r"^  compression_mode: *['\"]?message", re.MULTILINE | re.IGNORECASE)


def files(path: Path) -> list[Path]:
    """The files of a bag directory in the order of recording, or the one file; a directory is for rosbags."""
    if path.is_file():
        return [path]
    if not path.exists():
        raise BagError(f"{path} does not exist; give the directory or the file of a recording")
    text, databases = _description(path), sorted(path.glob("*.db3"))
    if any(path.glob("*.zstd")) or _EACH_MESSAGE.search(text) or (databases and text):
        return [path]
    found = sorted([*path.glob("*.mcap"), *databases], key=lambda file: (len(file.name), file.name))
    named, there = _listed_files(path, text), [file.name for file in found]
    for name in named:
        if name not in there:
            raise BagError(
                f"{path} lacks its file {name}; copy the whole directory, or read its .mcap files one by one"
            )
    if forgotten := [name for name in there if named and name not in named]:
        raise BagError(
            f"{path} has the file {forgotten[0]}, which its metadata.yaml does not list; "
            f"{command('wam bag repair', path)} writes it again, or give the file by itself"
        )
    if not found:
        raise BagError(f"{path} has no .mcap file and no .db3 file; give the directory of a bag")
    return found


def _description(path: Path) -> str:
    """Text of metadata.yaml, '' if it is missing."""
    file = path / "metadata.yaml"
    try:
        if (size := file.stat().st_size) > READING_LIMITS.metadata:
            raise ValueError(f"it has {size} bytes; at most {READING_LIMITS.metadata} are read")
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    except ValueError as error:
        raise _damaged(path, error) from None


def _listed_files(path: Path, text: str) -> list[str]:
    """Files that metadata.yaml lists."""
    try:
        part = _FILE_NAMES.search(text)  # the only lines that are needed of a long file
        return [str(name) for name in safe_yaml.load(part[0] if part else text)["relative_file_paths"]] if text else []
    except (yaml.YAMLError, ValueError, KeyError, TypeError) as error:
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> BagError:
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return BagError(
        f"{path / 'metadata.yaml'} is damaged ({reason}); {command('wam bag repair', path)} writes it again"
    )


@contextmanager
def opened(path: Path) -> Iterator[BagFile]:
    """An open file of a bag; errors of it in the context become a BagError."""
    is_other = path.is_dir() or path.suffix in SUFFIXES
    try:
        with RosbagsFile(path) if is_other else McapFile(path) as file:
            file.open()
            yield file
    except BagError:
        raise
    except OSError as error:
        raise BagError(f"{path} cannot be read: {error.strerror or error}") from error
    except Exception as error:
        if is_other:
            raise BagError(
                f"{path} cannot be read by rosbags: {error}; if it was cut off, repair it by 'rosbag reindex' "
                "(.bag) or 'sqlite3 FILE .recover' (.db3)"
            ) from error
        if isinstance(error, BROKEN):
            raise BagError(_explain(path, error)) from error
        raise


def _explain(path: Path, error: Exception) -> str:
    with path.open("rb") as stream:
        start = stream.read(len(MAGIC))
    if start != MAGIC:
        return f"{path} is not MCAP; give a bag recorded with storage 'mcap'; if it is compressed, give its directory"
    if isinstance(error, NotClosedError):
        return (
            f"{path} was not closed, the recorder was killed or the copy is incomplete; "
            "'wam bag repair' makes it readable up to the break"
        )
    if isinstance(error, TooLargeError):
        return (
            f"{path} is not read: {error}; more would take too much memory. "
            "Record in smaller chunks, or read a part of its time"
        )
    reason = str(error) if isinstance(error, Damage) else f"{type(error).__name__}: {error}"
    return f"{path} is damaged ({reason}); copy it again, or let 'wam bag repair' save what can be read"


def is_selected(topic: str, topics: Collection[str] | None) -> bool:
    """Whether a topic is among the names of a selection; a name without a leading '/' holds in every namespace."""
    if topics is None or topic in topics:
        return True
    return any(topic.endswith(f"/{name}") for name in topics if not name.startswith("/"))


def parts(
    file: BagFile, topics: Collection[str] | None = None, begin: int = 0, end: int = NEVER
) -> Iterator[tuple[Channel, MessageBatch]]:
    """Messages of each selected channel, some megabytes at a time; at the end the file's own counts are checked.

    Parameters
    ----------
    topics : names as for `is_selected`.
    begin, end : log times that are read, ns, begin <= t < end.
    """
    numbers, times = None, (0, NEVER)
    if file.has_all_definitions():  # else any chunk may contain one that is needed
        times = begin, end
        if topics is not None:
            numbers = frozenset(n for n, channel in file.channels.items() if is_selected(channel.topic, topics))
    is_part = begin > 0 or end < NEVER
    for found in file.batches(numbers, *times):
        batch = found.of((found.times >= begin) & (found.times < end)) if is_part else found
        for number in np.flatnonzero(np.bincount(batch.channels)).tolist():
            if number not in file.channels:
                raise Damage(f"a message is on channel {number}, which is not defined")
            if is_selected(file.channels[number].topic, topics):
                yield file.channels[number], batch.of(np.flatnonzero(batch.channels == number))
    if file.counts is None or is_part:
        return
    for number, channel in file.channels.items():
        expected = file.counts.by_channel[number]
        found_in = file.loaded.by_channel[number]
        if is_selected(channel.topic, topics) and found_in != expected:
            raise Damage(f"topic {channel.topic} has {found_in} messages instead of {expected}")


def type_of(file: BagFile, channel: Channel) -> MessageType:
    """Type of the messages of a channel.

    Raises
    ------
    BagError
        if it is neither JSON nor CDR or ROS 1 with a schema that can be read.
    """
    instead = "name the topics to be read, without this one"
    encoding, schema = channel.message_encoding, file.schemas.get(channel.schema_id)
    if encoding == JSON:
        return MessageType(full_name(schema.name) if schema else "", JSON)
    if encoding not in SCHEMAS:
        read = ", ".join(f"'{one}'" for one in ENCODINGS)
        raise BagError(f"{file.path} has topic {channel.topic} in encoding '{encoding}'; {read} are read; {instead}")
    if schema is None or schema.encoding != SCHEMAS[encoding]:
        what = f"a schema in '{schema.encoding}'" if schema else "no schema"
        raise BagError(f"{file.path} has topic {channel.topic} with {what}; '{SCHEMAS[encoding]}' is read; {instead}")
    try:
        name = full_name(schema.name)
        return MessageType(name, encoding, definitions(name, schema.data))
    except ValueError as error:
        raise BagError(f"{file.path} has topic {channel.topic} with a schema that cannot be read: {error}") from None
