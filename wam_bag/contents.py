"""What is in a bag: topics, times, attachments, the mode of the recording; without reading its messages."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from wam_bag import safe_yaml
from wam_bag.bag_file import files, opened
from wam_bag.losses import PARAMETERS, RECORDING
from wam_bag.message_text import full_name


class TopicContents(NamedTuple):
    """A topic of a bag: its type and how many messages it has."""

    type: str
    messages: int


class Contents(NamedTuple):
    """What is in a bag by the summaries of its files; messages are read only if a file has no summary.

    Attributes
    ----------
    path : of the bag, as it was given.
    files : the files.
    first, last : log times, ns; 0 in an empty bag.
    topics : by name.
    attachments : their content by name; of one name the last one, and of parameters those of all nodes.
    mode : 'realtime', 'lockstep' or 'unknown', see `mode_of`.
    metadata : records by name; 'recording' is the recorder's, see docs/bags.md.
    """

    path: Path
    files: list[Path]
    first: int
    last: int
    topics: dict[str, TopicContents]
    attachments: dict[str, bytes]
    mode: str
    metadata: dict[str, dict[str, str]]


def contents(path: str | Path) -> Contents:
    """What is in a bag; errors are those of `wam_bag.bag.read`."""
    found = files(Path(path))
    counts: Counter[str] = Counter()
    types: dict[str, str] = {}
    times: list[int] = []
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    for file in found:
        with opened(file) as mcap:
            found_in = mcap.counts or mcap.count()
            if any(found_in.by_channel.values()):
                times += [found_in.first, found_in.last]
            for number, channel in mcap.channels.items():
                counts[channel.topic] += found_in.by_channel.get(number, 0)
                schema = mcap.schemas.get(channel.schema_id)
                types.setdefault(channel.topic, full_name(schema.name) if schema else "?")
            for item in mcap.attachments():
                is_more = item.name == PARAMETERS and item.name in attachments
                attachments[item.name] = _with_nodes_of(attachments[item.name], item.data) if is_more else item.data
            for name, values in mcap.metadata().items():
                metadata.setdefault(name, {}).update(values)
    topics = {topic: TopicContents(types[topic], counts[topic]) for topic in sorted(types)}
    mode, first, last = mode_of(metadata, attachments.get(PARAMETERS)), min(times, default=0), max(times, default=0)
    return Contents(Path(path), found, first, last, topics, attachments, mode, metadata)


def _with_nodes_of(before: bytes, after: bytes) -> bytes:
    """The later parameters with those of nodes that only the earlier ones have, unless one of them is unreadable.

    A recorder attaches them again when it knows those of more nodes, and a tool that merges bags takes those of each.
    """
    try:
        nodes, known = safe_yaml.load(after), safe_yaml.load(before)
    except (yaml.YAMLError, UnicodeDecodeError):
        return after
    if not (isinstance(nodes, dict) and isinstance(known, dict) and known.keys() - nodes.keys()):
        return after
    return safe_yaml.dump({**known, **nodes}).encode()


def mode_of(metadata: Mapping[str, Mapping[str, str]], parameters: bytes | None) -> str:
    """'realtime', 'lockstep' or 'unknown': by the recorder's metadata, else by the parameters of its nodes.

    A recorder that was killed left only the parameters.
    """
    recorded = metadata.get(RECORDING, {}).get("mode")
    if recorded is not None or parameters is None:
        return recorded or "unknown"
    try:
        modes = {_timing_mode(node["ros__parameters"]) for node in safe_yaml.load(parameters).values()}
    except (yaml.YAMLError, ValueError, LookupError, TypeError, AttributeError):
        return "unknown"
    known = sorted(str(mode) for mode in modes - {None})
    return known[0] if len(known) == 1 else "unknown"


def _timing_mode(parameters: Mapping[str, Any]) -> Any:
    return parameters.get("timing", {}).get("mode", parameters.get("timing.mode"))
