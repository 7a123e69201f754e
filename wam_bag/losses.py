"""What a bag lacks: holes that a repair left, and messages that the recorder counted and that are not there."""

import json
from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import yaml

from wam_bag import safe_yaml
from wam_bag.limits import READING_LIMITS

REPAIRED: Final = "repaired"  # metadata record of a repair; an entry of JSON for each repair of a file
PARAMETERS: Final = "parameters.yaml"  # attachment of the recorder
RECORDING: Final = "recording"  # metadata record of the recorder
DROPPED, LOST_AT_END = "dropped", "lost_at_end"  # last words of entries of it
UNFINISHED: Final = "no final count"  # entry of it, the names of nodes
CUT: Final = "cut"  # metadata record of a part of a bag
_TIME_OF_DAY: Final = 10**18  # ns; smaller log times are stamps of lockstep, which start near 0

Metadata = Mapping[str, Mapping[str, str]]


class Hole(NamedTuple):
    """A part of a file that could not be read: log times before and behind it, ns, None if there is none."""

    begin: int | None
    end: int | None
    bytes: int


class FileLosses(NamedTuple):
    """What a repair of a file could not save.

    Attributes
    ----------
    bytes : that could not be read.
    closed : whether the file had been finished; else it is not known what was recorded after its end.
    holes : the parts that could not be read.
    messages : number of lost ones by topic, by the file's own count; none where it has none.
    others : attachments, metadata records and definitions that were lost.
    """

    bytes: int
    closed: bool
    holes: tuple[Hole, ...]
    messages: dict[str, int]
    others: int

    def text(self) -> str:
        """The entry of the metadata record."""
        return json.dumps({**self._asdict(), "holes": [hole._asdict() for hole in self.holes]})


class Losses(NamedTuple):
    """What a bag lacks.

    Attributes
    ----------
    repaired : by file, None if the entry cannot be read.
    missing : messages by topic that the recorder received and that are not in the bag.
    dropped : messages lost on their way to the recorder, by 'topic from publisher'.
    at_end : messages that were announced and did not come before the recorder ended, by 'topic from publisher'.
    unfinished : nodes that gave no final count, so that it is not known what is lost of them at the end.
    uncounted : whether the recorder of this project ended without writing its counts.
    """

    repaired: dict[str, FileLosses | None]
    missing: dict[str, int]
    dropped: dict[str, int]
    uncounted: bool
    at_end: Mapping[str, int] = {}
    unfinished: str = ""

    @property
    def topics(self) -> set[str]:
        """Those of which messages are known to be lost."""
        return {key.partition(" ")[0] for key in (*self.by_topic, *self.dropped, *self.at_end)}

    @property
    def by_topic(self) -> dict[str, int]:
        """Messages that were recorded and are lost, at least."""
        return dict(self._lost_in_repairs() | Counter(self.missing))

    @property
    def gone(self) -> int:
        """Their number."""
        return sum(self.by_topic.values())

    def _lost_in_repairs(self) -> Counter[str]:
        lost = Counter[str]()
        for found in self.repaired.values():
            lost.update(found.messages if found else {})
        return lost

    def sentences(self, first: int) -> list[str]:
        """The losses in words; none if nothing is known to be lost.

        Parameters
        ----------
        first : first log time in the bag, ns; log times that are times of day are given relative to it.
        """
        lines = [line for name, losses in self.repaired.items() for line in _sentences(name, losses, first)]
        if Counter(self.missing) - self._lost_in_repairs():
            lines.append(f"The recorder received {_counted(self.missing)} that are not in the bag.")
        for what, lost in (("on the way to the recorder", self.dropped), ("at the end", self.at_end)):
            if lost:
                listed = ", ".join(f"{count} of {where}" for where, count in lost.items())
                lines.append(f"Lost {what}: {listed}.")
        if self.unfinished:
            lines.append(f"Lost at the end: not known for {self.unfinished}, which published no final count.")
        if self.uncounted:
            lines.append(
                "The recorder wrote no counts: it was killed, its disk was full, or another tool wrote this bag. "
                "Further losses are unknown."
            )
        return lines


def losses(path: Path, metadata: Metadata, attachments: Collection[str], counts: Mapping[str, int]) -> Losses:
    """What a bag lacks, by its own records.

    Parameters
    ----------
    path : of the bag, or of one file of it.
    metadata : records by name.
    attachments : their names; the recorder of this project always writes parameters.yaml.
    counts : messages of every topic in it; empty if they are not known, and then nothing is compared.
    """
    repaired = {key: _parsed(value) for key, value in metadata.get(REPAIRED, {}).items()}
    recording = metadata.get(RECORDING, {})
    received = Counter[str]()
    lost: dict[str, dict[str, int]] = {DROPPED: {}, LOST_AT_END: {}}
    for key, value in recording.items():
        where, _, what = key.rpartition(" ")
        if what == "received":
            received[where.split(" ")[0]] += _number(value)
        elif what in lost and _number(value):
            lost[what][where.replace(" ", " from ")] = _number(value)
    is_part = not counts or CUT in metadata or _is_one_of_several(path, metadata)
    if is_part:
        received = Counter()
    return Losses(
        repaired,
        dict(sorted((received - Counter(counts)).items())),
        lost[DROPPED],
        bool(counts) and PARAMETERS in attachments and not recording,
        lost[LOST_AT_END],
        recording.get(UNFINISHED, ""),
    )


def _sentences(name: str, found: FileLosses | None, first: int) -> list[str]:
    if found is None:
        return [f"{name} was repaired; the record of its losses cannot be read."]
    lines = []
    if found.holes or found.messages or found.others:
        line = f"{name} was damaged and has been repaired: {found.bytes} bytes could not be read"
        if found.messages:
            line += f"; lost are {_counted(found.messages)}"
        elif found.holes:
            line += "; it is not known how many messages were lost"
        if found.others:
            line += f"; lost attachments, metadata records or definitions: {found.others}"
        lines.append(f"{line}.")
    if found.holes:
        spans = "; ".join(_span(hole, first) for hole in found.holes)
        lines.append(f"{'Gaps' if len(found.holes) > 1 else 'A gap'} {spans}.")
    if not found.closed:
        lines.append(f"{name} had not been closed: messages after its last one are lost, their number is not known.")
    return lines


def _span(hole: Hole, first: int) -> str:
    if hole.begin is None and hole.end is None:
        return f"of {hole.bytes} bytes at an unknown time"
    begin = "from the start" if hole.begin is None else f"from {_seconds(hole.begin, first)}"
    end = "to the end" if hole.end is None else f"to {_seconds(hole.end, first)}"
    return f"{begin} {end}"


def _seconds(stamp: int, first: int) -> str:
    if stamp < _TIME_OF_DAY:
        return f"{stamp / 1e9:.3f} s"
    return f"{(stamp - first) / 1e9:.3f} s after the start"


def _counted(messages: Mapping[str, int]) -> str:
    most = sorted(messages.items(), key=lambda item: (-item[1], item))
    listed = [f"{count} of {topic}" for topic, count in most[: READING_LIMITS.named]]
    if others := most[READING_LIMITS.named :]:
        listed.append(f"{sum(count for _, count in others)} of {len(others)} other topics")
    return f"{sum(messages.values())} messages ({', '.join(listed)})"


def _parsed(text: str) -> FileLosses | None:
    """An entry of the record; None if it is damaged, because metadata records have no checksum."""
    try:
        values = json.loads(text)
        holes = tuple(Hole(**hole) for hole in values.pop("holes"))
        return FileLosses(**{**values, "holes": holes, "messages": dict(values["messages"])})
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def _number(text: str) -> int:
    return int(text) if text.isdecimal() and len(text) < READING_LIMITS.digits else 0


def _is_one_of_several(path: Path, metadata: Metadata) -> bool:
    """Whether the path is one file of a bag that has more; the recorder counts the whole bag."""
    if not path.is_file():
        return False
    try:
        information = safe_yaml.load(metadata["rosbag2"]["serialized_metadata"])
        return len(information["relative_file_paths"]) > 1
    except (yaml.YAMLError, LookupError, TypeError):
        return False
