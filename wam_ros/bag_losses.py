"""What is not in a bag though it was recorded: holes of a repair, and the recorder's counts against what is there."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

import yaml

REPAIRED: Final = "repaired"  # metadata record that a repair leaves; an entry of JSON for each repair of a file
RECORDING: Final = "recording"  # metadata record of the recorder
CUT: Final = "cut"  # metadata record of a part of a bag
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
    """

    repaired: dict[str, FileLosses | None]
    missing: dict[str, int]
    dropped: dict[str, int]

    @property
    def gone(self) -> int:
        """Messages that were recorded and are not there, at least."""
        told = Counter[str]()
        for losses in self.repaired.values():
            told.update(losses.messages if losses else {})
        return sum((told | Counter(self.missing)).values())

    def said(self, first: int) -> list[str]:
        """Sentences, none where nothing is known to be lost.

        Parameters
        ----------
        first : first log time in the bag, ns; times of day are told from it.
        """
        lines = [line for name, losses in self.repaired.items() for line in _told(name, losses, first)]
        if self.missing:
            lines.append(f"The recorder received {_counted(self.missing)} that are not in the bag.")
        if self.dropped:
            listed = ", ".join(f"{count} of {where}" for where, count in self.dropped.items())
            lines.append(f"Lost on the way to the recorder: {listed}.")
        return lines


def losses(path: Path, metadata: Metadata, counts: Mapping[str, int]) -> Losses:
    """What a bag lacks, by its own records.

    Parameters
    ----------
    path : of the bag, or of one file of it.
    metadata : records by name.
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
    if not counts or CUT in metadata or _is_one_of_several(path, metadata):
        received = Counter()
    missing = {topic: count - counts.get(topic, 0) for topic, count in sorted(received.items())}
    return Losses(repaired, {topic: count for topic, count in missing.items() if count > 0}, dropped)


def _told(name: str, found: FileLosses | None, first: int) -> list[str]:
    if found is None:
        return [f"{name} was repaired; what was lost cannot be read any more."]
    said = f"{name} was broken and has been repaired: {found.bytes} bytes could not be read"
    if found.messages:
        said += f"; gone are {'' if found.all_known else 'at least '}{_counted(found.messages)}"
    elif found.holes and not found.all_known:
        said += "; how many messages these were is not known"
    else:
        said += "; no message is known to be gone"
    if found.others:
        said += f"; {found.others} attachments, metadata records or definitions are gone"
    lines = [f"{said}."]
    if found.holes:
        lines.append(
            f"{'Holes' if len(found.holes) > 1 else 'A hole'} {'; '.join(_span(h, first) for h in found.holes)}."
        )
    if not found.closed:
        lines.append(
            f"{name} had not been closed: what came after its last message is not in it, and nobody counted it."
        )
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
    listed = ", ".join(f"{count} of {topic}" for topic, count in sorted(messages.items()))
    return f"{sum(messages.values())} messages ({listed})"


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
