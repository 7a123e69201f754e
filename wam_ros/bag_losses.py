"""What is not in a bag though it was recorded: holes of a repair, and the recorder's counts against what is there."""

import json
from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import yaml

REPAIRED: Final = "repaired"  # metadata record that a repair leaves; an entry of JSON for each repair of a file
PARAMETERS: Final = "parameters.yaml"  # attachment of the recorder
RECORDING: Final = "recording"  # metadata record of the recorder
CUT: Final = "cut"  # metadata record of a part of a bag
_NAMED: Final = 3  # topics in a sentence
_TIME_OF_DAY: Final = 10**18  # ns; smaller log times are the stamps of lockstep, which begin near 0

Metadata = Mapping[str, Mapping[str, str]]


class Hole(NamedTuple):
    """A part of a file that could not be read: log times between which its messages were, ns, None where open."""

    begin: int | None
    end: int | None
    bytes: int


class FileLosses(NamedTuple):
    """What a repair of a file could not save.

    Attributes
    ----------
    bytes : that could not be read.
    closed : whether the file had been finished; else what came after its end is not known.
    holes : where.
    messages : lost ones by topic, as far as indexes or the file's own count tell.
    all_known : whether these are all.
    others : attachments, metadata records and definitions that were lost.
    """

    bytes: int
    closed: bool
    holes: tuple[Hole, ...]
    messages: dict[str, int]
    all_known: bool
    others: int

    def text(self) -> str:
        """The entry of the metadata record."""
        return json.dumps({**self._asdict(), "holes": [hole._asdict() for hole in self.holes]})


class Losses(NamedTuple):
    """What a bag lacks.

    Attributes
    ----------
    repaired : by file, None where the entry cannot be read.
    missing : messages by topic that the recorder received and that are not in the bag.
    dropped : messages lost on their way to the recorder, by 'topic from publisher'.
    uncounted : whether our recorder ended without its counts.
    """

    repaired: dict[str, FileLosses | None]
    missing: dict[str, int]
    dropped: dict[str, int]
    uncounted: bool

    @property
    def by_topic(self) -> dict[str, int]:
        """Messages that were recorded and are not there, at least."""
        return dict(self._told() | Counter(self.missing))

    @property
    def gone(self) -> int:
        """Their number."""
        return sum(self.by_topic.values())

    def _told(self) -> Counter[str]:
        """What the repairs know of."""
        told = Counter[str]()
        for found in self.repaired.values():
            told.update(found.messages if found else {})
        return told

    def said(self, first: int) -> list[str]:
        """Sentences, none where nothing is known to be lost.

        Parameters
        ----------
        first : first log time in the bag, ns; times of day are told from it.
        """
        lines = [line for name, losses in self.repaired.items() for line in _told(name, losses, first)]
        if Counter(self.missing) - self._told():
            lines.append(f"The recorder received {_counted(self.missing)} that are not in the bag.")
        if self.dropped:
            listed = ", ".join(f"{count} of {where}" for where, count in self.dropped.items())
            lines.append(f"Lost on the way to the recorder: {listed}.")
        if self.uncounted:
            lines.append(
                "The recorder wrote no counts, for it was killed or its disk was full: what else is lost is not known."
            )
        return lines


def losses(path: Path, metadata: Metadata, attachments: Collection[str], counts: Mapping[str, int]) -> Losses:
    """What a bag lacks, by its own records.

    Parameters
    ----------
    path : of the bag, or of one file of it.
    metadata : records by name.
    attachments : their names; those of our recorder say that it is one of ours.
    counts : messages of every topic in it; empty where they are not known, and then nothing is compared.
    """
    repaired = {key: _parsed(value) for key, value in metadata.get(REPAIRED, {}).items()}
    recording = metadata.get(RECORDING, {})
    received, dropped = Counter[str](), dict[str, int]()
    for key, value in recording.items():
        where, _, what = key.rpartition(" ")
        if what == "received":
            received[where.split(" ")[0]] += _number(value)
        elif what == "dropped" and _number(value):
            dropped[where.replace(" ", " from ")] = _number(value)
    is_part = not counts or CUT in metadata or _is_one_of_several(path, metadata)
    if is_part:
        received = Counter()
    missing = {topic: count - counts.get(topic, 0) for topic, count in sorted(received.items())}
    return Losses(
        repaired,
        {topic: count for topic, count in missing.items() if count > 0},
        dropped,
        bool(counts) and PARAMETERS in attachments and not recording,
    )


def _told(name: str, found: FileLosses | None, first: int) -> list[str]:
    if found is None:
        return [f"{name} was repaired; what was lost cannot be read any more."]
    lines = []
    if not found.closed:
        lines.append(f"{name} had not been closed: what came after its last message is not in it, nobody counted it.")
    if not (found.holes or found.messages or found.others):
        return lines
    said = f"{name} was broken and has been repaired: {found.bytes} bytes could not be read"
    if found.messages:
        said += f"; gone are {'' if found.all_known else 'at least '}{_counted(found.messages)}"
    elif found.holes:
        said += "; how many messages these were is not known"
    if found.others:
        said += f"; attachments, metadata records or definitions that are gone: {found.others}"
    lines.insert(0, f"{said}.")
    if found.holes:
        spans = "; ".join(_span(hole, first) for hole in found.holes)
        lines.insert(1, f"{'Holes' if len(found.holes) > 1 else 'A hole'} {spans}.")
    return lines


def _span(hole: Hole, first: int) -> str:
    if hole.begin is None and hole.end is None:
        return f"of {hole.bytes} bytes, no time is known"
    begin = "from the begin" if hole.begin is None else f"from {_seconds(hole.begin, first)}"
    end = "to the end" if hole.end is None else f"to {_seconds(hole.end, first)}"
    return f"{begin} {end}"


def _seconds(stamp: int, first: int) -> str:
    if stamp < _TIME_OF_DAY:
        return f"{stamp / 1e9:.3f} s"
    return f"{(stamp - first) / 1e9:.3f} s after the begin"


def _counted(messages: Mapping[str, int]) -> str:
    most = sorted(messages.items(), key=lambda item: (-item[1], item[0]))
    listed = [f"{count} of {topic}" for topic, count in most[:_NAMED]]
    if others := most[_NAMED:]:
        listed.append(f"{sum(count for _, count in others)} of {len(others)} other topics")
    return f"{sum(messages.values())} messages ({', '.join(listed)})"


def _parsed(text: str) -> FileLosses | None:
    """An entry of the record; None where it is damaged, for metadata records bear no checksum."""
    try:
        values = json.loads(text)
        holes = tuple(Hole(**hole) for hole in values.pop("holes"))
        return FileLosses(**{**values, "holes": holes, "messages": dict(values["messages"])})
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def _number(text: str) -> int:
    return int(text) if text.isdecimal() else 0


def _is_one_of_several(path: Path, metadata: Metadata) -> bool:
    """Whether a single file is looked at of a bag that has more; the recorder counts the whole."""
    if not path.is_file():
        return False
    try:
        said = yaml.safe_load(metadata["rosbag2"]["serialized_metadata"])
        return len(said["relative_file_paths"]) > 1
    except (yaml.YAMLError, LookupError, TypeError, RecursionError):
        return False
