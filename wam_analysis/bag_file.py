"""Bags as they lie on disk: their files found and opened, and refused in words."""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from wam_description.parameters import flatten
from wam_ros.bag_losses import PARAMETERS, RECORDING
from wam_ros.mcap_file import McapFile, NotClosedError
from wam_ros.mcap_records import BROKEN, MAGIC, BagError, Channel, Damage
from wam_ros.message_text import Fields, definitions

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same, in C where it was built
PROFILES = ("ros2", "")  # of MCAP files that are read; some writers name none
_FILE_NAMES = re.compile(r"^  relative_file_paths:.*\n(?:   *(?:-| ).*\n)*", re.MULTILINE)


def files(path: Path) -> list[Path]:
    """The MCAP files of a bag directory, in the order in which they were recorded, or the one file."""
    if path.is_file():
        return [path]
    if not path.exists():
        raise BagError(f"{path} does not exist; give a bag directory or an .mcap file")
    found = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    named = _named_files(path)
    for name in named:
        if not (path / name).is_file():
            raise BagError(
                f"{path} lacks its file {name}; copy the whole directory, or read its .mcap files one by one"
            )
    if forgotten := sorted({file.name for file in found} - set(named)) if named else []:
        raise BagError(
            f"{path} has the file {forgotten[0]}, which its metadata.yaml does not list; "
            f"'wam bag repair {path}' writes it again, or give the file by itself"
        )
    if named:
        return [path / name for name in named]
    if not found:
        raise BagError(f"{path} has no .mcap file; give a bag directory recorded with storage 'mcap'")
    return found


def _named_files(path: Path) -> list[str]:
    """Files that metadata.yaml lists, none where it is missing."""
    file = path / "metadata.yaml"
    if not file.is_file():
        return []
    try:
        text = file.read_text(encoding="utf-8")
        part = _FILE_NAMES.search(text)  # of a long page the only lines that are needed
        names = yaml.safe_load(part[0] if part else text)["relative_file_paths"]
        checked = [str(name) for name in names]
    except (yaml.YAMLError, ValueError, KeyError, TypeError, RecursionError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BagError(f"{file} is damaged ({reason}); 'wam bag repair {path}' writes it again") from None
    for name in checked:
        if not name.endswith(".mcap"):
            raise BagError(f"{path} is recorded as {name}; only storage 'mcap' without compressed files is read")
    return checked


@contextmanager
def opened(path: Path) -> Iterator[McapFile]:
    """An open file of a bag; what goes wrong with it in the context becomes a BagError."""
    try:
        with McapFile(path) as file:
            file.open()
            if file.profile not in PROFILES:
                raise BagError(f"{path} has MCAP profile '{file.profile}'; only bags of ROS 2 ('ros2') are read")
            yield file
    except BagError:
        raise
    except OSError as error:
        raise BagError(f"{path} cannot be read: {error.strerror or error}") from error
    except BROKEN as error:
        raise BagError(_explain(path, error)) from error


def _explain(path: Path, error: Exception) -> str:
    with path.open("rb") as stream:
        start = stream.read(len(MAGIC))
    if not start:
        return f"{path} is empty, nothing was recorded; record again"
    if start != MAGIC:
        return f"{path} is not MCAP; give a bag recorded with storage 'mcap'"
    if isinstance(error, NotClosedError):
        return (
            f"{path} was not closed, the recorder was killed or the copy is not whole; "
            "'wam bag repair' makes it readable up to the break"
        )
    reason = str(error) if isinstance(error, Damage) else f"{type(error).__name__}: {error}"
    return f"{path} is damaged ({reason}); copy it again, or let 'wam bag repair' save what can be read"


class TopicContents(NamedTuple):
    """A topic of a bag: its type and how many messages it has."""

    type: str
    messages: int


class Contents(NamedTuple):
    """What is in a bag, as its files say; no message is read where they do.

    Attributes
    ----------
    path : of the bag, as it was given.
    files : the files.
    first, last : log times, ns; 0 in an empty bag.
    topics : by name.
    attachments : bytes by name.
    mode : 'realtime', 'lockstep' or 'unknown', see `mode_of`.
    metadata : records by name; 'recording' is the recorder's, see docs/bags.md.
    """

    path: Path
    files: list[Path]
    first: int
    last: int
    topics: dict[str, TopicContents]
    attachments: dict[str, int]
    mode: str
    metadata: dict[str, dict[str, str]]


def contents(path: str | Path) -> Contents:
    """What is in a bag; errors are those of `wam_analysis.bag.read`."""
    found = files(Path(path))
    counts: Counter[str] = Counter()
    types: dict[str, str] = {}
    times: list[int] = []
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    for file in found:
        with opened(file) as mcap:
            said = mcap.statistics or mcap.count()
            if any(said.counts.values()):
                times += [said.first, said.last]
            for number, channel in mcap.channels.items():
                counts[channel.topic] += said.counts.get(number, 0)
                schema = mcap.schemas.get(channel.schema)
                types.setdefault(channel.topic, schema.name if schema else "?")
            attachments.update(mcap.attachments())
            merge(metadata, mcap.metadata())
    topics = {topic: TopicContents(types[topic], counts[topic]) for topic in sorted(types)}
    sizes = {name: len(data) for name, data in attachments.items()}
    mode = mode_of(metadata, attachments.get(PARAMETERS))
    return Contents(Path(path), found, min(times, default=0), max(times, default=0), topics, sizes, mode, metadata)


def merge(metadata: dict[str, dict[str, str]], more: Mapping[str, Mapping[str, str]]) -> None:
    """Take the metadata records of another file of a bag: entries of the same record stand side by side."""
    for name, values in more.items():
        metadata.setdefault(name, {}).update(values)


def mode_of(metadata: Mapping[str, Mapping[str, str]], parameters: bytes | None) -> str:
    """'realtime', 'lockstep' or 'unknown': what the recorder says, else what its nodes' parameters say.

    A recorder that was killed left only the parameters.
    """
    said = metadata.get(RECORDING, {}).get("mode")
    if said is not None or parameters is None:
        return said or "unknown"
    try:
        tree = yaml.load(parameters.decode(), LOADER)
        modes = {flatten(node["ros__parameters"]).get("timing.mode") for node in tree.values()}
    except (yaml.YAMLError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return "unknown"
    known = sorted(str(mode) for mode in modes - {None})
    return known[0] if len(known) == 1 else "unknown"


def is_asked(topic: str, topics: Collection[str] | None) -> bool:
    """Whether a topic is among those asked for; one without a leading '/' is meant in every namespace."""
    if topics is None or topic in topics:
        return True
    return any(topic.endswith(f"/{name}") for name in topics if not name.startswith("/"))


def type_of(file: McapFile, channel: Channel) -> tuple[str, dict[str, Fields]]:
    """Type of the messages of a channel and the fields of it and of what it is made of.

    Raises
    ------
    BagError
        where it is not CDR with a ros2msg schema.
    """
    instead = "name the topics to be read, without this one"
    if channel.encoding != "cdr":
        raise BagError(
            f"{file.path} has topic {channel.topic} in encoding '{channel.encoding}'; only 'cdr' is read; {instead}"
        )
    schema = file.schemas.get(channel.schema)
    if schema is None:
        raise BagError(f"{file.path} has topic {channel.topic} without a schema; {instead}")
    if schema.encoding != "ros2msg":
        raise BagError(
            f"{file.path} has the schema of topic {channel.topic} in '{schema.encoding}'; "
            f"only 'ros2msg' is read; {instead}"
        )
    try:
        return schema.name, definitions(schema.name, schema.data)
    except ValueError as error:
        raise BagError(f"{file.path} has topic {channel.topic} with a schema that says nothing: {error}") from None
