"""The samples in `bags/`: one small bag of each experiment, and the index that says what they show.

A sample is cut out of a recording in lockstep.  There is no wall clock in it, so the same code makes the same file.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml

from wam_analysis.bag_cut import Cut, cut
from wam_analysis.bag_file import contents
from wam_analysis.experiments.definition import Experiment
from wam_analysis.experiments.evaluation import judged_sample
from wam_analysis.experiments.recording import recording
from wam_analysis.experiments.rows import Row
from wam_description.parameters import require

FOLDER: Final = "sample"
INDEX: Final = "index.yaml"
PAGE: Final = "README.md"
LIMIT: Final = 5_000_000  # bytes of all samples together: what everybody who clones has to take
FILES: Final = ("metadata.yaml", "*.mcap")
_BLOCK = re.compile(r"(<!-- samples -->\n).*?(<!-- end -->)", re.DOTALL)
_HEAD = f"# What the bags in {FOLDER}/ show; written by 'wam samples --make', checked by 'wam samples'.\n"
_ALIKE = 1e-9  # what a sum over another array may move


class Shown(NamedTuple):
    """A quantity that a sample shows; `is_whole` says whether the whole run gives the same."""

    quantity: str
    predicted: float | str
    measured: float | str
    unit: str
    is_whole: bool


class Entry(NamedTuple):
    """A sample as the index describes it.

    Attributes
    ----------
    name : of the experiment, and of the directory.
    seconds : begin and end, of the arm's time.
    sha256 : by file.
    """

    name: str
    run: str
    shows: str
    command: str
    seconds: tuple[float, float]
    messages: int
    size: int
    sha256: Mapping[str, str]
    rows: tuple[Shown, ...]


def make(experiment: Experiment, whole: Path, directory: Path) -> Entry:
    """Cut the sample of an experiment out of a recording of its run, and judge both.

    Parameters
    ----------
    whole : bag of the run.
    directory : of all bags, as ``bags``.

    Raises
    ------
    ParameterError
        where the experiment declares no sample.
    BagError
        where the recording cannot be read, or a topic is not in it.
    FileExistsError
        where there is a sample of that name.
    """
    sample = experiment.sample
    require(sample is not None, f"experiment {experiment.name} declares no sample; add one to its YAML")
    assert sample is not None  # for mypy
    bag = directory / FOLDER / experiment.name
    part = Cut(round(1e9 * sample.begin), round(1e9 * sample.end), sample.topics)
    cut(whole, bag, part)
    of_whole = {row.quantity: row for row in judged_sample(experiment, recording(whole)).rows}
    rows = tuple(
        Shown(
            row.quantity, _plain(row.predicted), _plain(row.measured), row.unit, _is_same(row, of_whole)
        )
        for row in judged_sample(experiment, recording(bag)).rows
    )  # fmt: skip
    count = sum(topic.messages for topic in contents(bag).topics.values())
    return Entry(
        experiment.name,
        sample.run,
        sample.shows,
        f"wam samples --make {experiment.name}",
        (sample.begin, sample.end),
        count,
        sum(file.stat().st_size for file in files_of(bag)),
        {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(bag)},
        rows,
    )


def check(experiment: Experiment, entry: Entry, directory: Path) -> list[str]:
    """What is wrong with a sample, nothing where it is as the index says: hashes, and rows measured again."""
    bag = directory / FOLDER / entry.name
    present = {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(bag)}
    if present != dict(entry.sha256):
        changed = sorted({name for name, _ in present.items() ^ dict(entry.sha256).items()})
        return [f"{bag}: {', '.join(changed)} not as listed; take it from the repository again, or '{entry.command}'"]
    found = {row.quantity: row for row in judged_sample(experiment, recording(bag)).rows}
    wrong = [f"{bag}: '{row.quantity}' misses its bound" for row in found.values() if not row.agrees]
    for shown in entry.rows:
        row = found.pop(shown.quantity, None)
        if row is None or not (_alike(row.measured, shown.measured) and _alike(row.predicted, shown.predicted)):
            wrong.append(f"{bag}: '{shown.quantity}' is not as listed; '{entry.command}' makes sample and list anew")
    return wrong + [f"{bag}: '{name}' is not listed; '{entry.command}'" for name in found]


def files_of(bag: Path) -> list[Path]:
    """The files that make a sample."""
    return sorted(file for pattern in FILES for file in bag.glob(pattern))


def read_index(directory: Path) -> dict[str, Entry]:
    """The samples by name; none where there is no index.

    Raises
    ------
    ParameterError
        where the index is not built like one.
    """
    file = directory / INDEX
    if not file.is_file():
        return {}
    try:
        entries = [_entry(body) for body in yaml.safe_load(file.read_text(encoding="utf-8"))["samples"]]
    except (yaml.YAMLError, TypeError, KeyError, ValueError) as error:
        require(False, f"{file} is not an index of samples ({error}); 'wam samples --make' writes it")
        raise
    return {entry.name: entry for entry in entries}


def write_index(directory: Path, entries: Mapping[str, Entry]) -> None:
    """Write the index for programs, and the table for people into the page beside it.

    Raises
    ------
    ValueError
        where the page has no place for the table.
    """
    page = directory / PAGE
    text = page.read_text(encoding="utf-8")
    require(_BLOCK.search(text) is not None, f"{page} has no block '<!-- samples -->' ... '<!-- end -->'; add it")
    ordered = [entries[name] for name in sorted(entries)]
    bodies = [
        {
            **entry._asdict(),
            "seconds": list(entry.seconds),
            "sha256": dict(entry.sha256),
            "rows": [row._asdict() for row in entry.rows],
        }
        for entry in ordered
    ]
    written = yaml.safe_dump({"samples": bodies}, sort_keys=False, allow_unicode=True, width=1000)
    (directory / INDEX).write_text(_HEAD + written, encoding="utf-8")
    page.write_text(_BLOCK.sub(lambda found: found[1] + table(ordered) + found[2], text), encoding="utf-8")


def table(entries: list[Entry]) -> str:
    """The samples as a table of Markdown, and one of what they show."""
    lines = [
        "| bag | shows | run, part of it | messages | size | made by | sha256 of the `.mcap` |",
        "|---|---|---|---|---|---|---|",
    ]
    for entry in entries:
        begin, end = entry.seconds
        (digest,) = (value for name, value in entry.sha256.items() if name.endswith(".mcap"))
        part = f"`{entry.run}`, {begin:g} to {end:g} s"
        lines.append(
            f"| [{entry.name}]({FOLDER}/{entry.name}) | {entry.shows} | {part} | {entry.messages} "
            f"| {entry.size / 1e3:.0f} kB | `{entry.command}` | `{digest[:16]}…` |"
        )
    total = sum(entry.size for entry in entries)
    lines += [
        "",
        f"{len(entries)} samples, {total / 1e6:.2f} MB together.",
        "",
        "| bag | quantity | predicted | measured | unit | whole run |",
        "|---|---|---|---|---|---|",
    ]
    for entry in entries:
        for row in entry.rows:
            values = " | ".join(value if isinstance(value, str) else f"{value:.4g}" for value in row[1:3])
            same = "the same" if row.is_whole else "differs"
            lines.append(f"| {entry.name} | {row.quantity} | {values} | {row.unit} | {same} |")
    return "\n" + "\n".join(lines) + "\n\n"


def _entry(body: Mapping[str, Any]) -> Entry:
    begin, end = body["seconds"]
    rows = tuple(Shown(**row) for row in body["rows"])
    return Entry(**{**body, "seconds": (float(begin), float(end)), "rows": rows})


def _plain(value: float | str) -> float | str:
    return value if isinstance(value, str) else float(value)


def _is_same(row: Row, of_whole: Mapping[str, Row]) -> bool:
    other = of_whole.get(row.quantity)
    return other is not None and _alike(row.measured, other.measured) and _alike(row.predicted, other.predicted)


def _alike(value: float | str, other: float | str) -> bool:
    if isinstance(value, str) or isinstance(other, str):
        return value == other
    return math.isclose(value, other, rel_tol=1e-6, abs_tol=_ALIKE)
