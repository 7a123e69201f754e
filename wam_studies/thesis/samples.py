"""The samples in `bags/`: one small bag of each experiment and task, and an index of their contents.

A sample is cut out of a recording in lockstep.  It has no wall-clock time, so the same code makes the same file.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml

from wam_analysis.table import markdown
from wam_bag.contents import contents
from wam_description.parameters import require
from wam_studies.thesis.cutting import Cut, cut
from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.evaluation import evaluate_sample
from wam_studies.thesis.recording import recording
from wam_studies.thesis.rows import Comparison

FOLDER: Final = "sample"
INDEX: Final = "index.yaml"
PAGE: Final = "README.md"
LIMIT: Final = 8_000_000  # bytes of all samples together, part of every clone
FILES: Final = ("metadata.yaml", "*.mcap")
_BLOCK = re.compile(r"(<!-- samples -->\n).*?(<!-- end -->)", re.DOTALL)
_HEAD = f"# Contents of the bags in {FOLDER}/; written by 'wam experiment --samples make'.\n"
_ALIKE = 1e-9  # rounding of a sum over another array


class Shown(NamedTuple):
    """A quantity of a sample; `is_whole` is whether the whole run gives the same value."""

    quantity: str
    predicted: float | str
    measured: float | str
    unit: str
    is_whole: bool


class Entry(NamedTuple):
    """A sample in the index.

    Attributes
    ----------
    name : of the experiment, and of the directory.
    seconds : start and end, of the arm's time.
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
    """Cut the sample of an experiment out of a recording of its run, and evaluate both.

    Parameters
    ----------
    whole : bag of the run.
    directory : of all bags, as ``bags``.

    Raises
    ------
    ParameterError
        if the experiment declares no sample.
    BagError
        if the recording cannot be read, or has not all topics.
    FileExistsError
        if there is a sample of that name.
    """
    sample = experiment.sample
    require(sample is not None, f"experiment {experiment.name} declares no sample; add one to its YAML")
    assert sample is not None  # for mypy
    bag = directory / FOLDER / experiment.name
    part = Cut(round(1e9 * sample.seconds[0]), round(1e9 * sample.seconds[1]), sample.topics, sample.thinned)
    cut(whole, bag, part)
    of_whole = {row.quantity: row for row in evaluate_sample(experiment, recording(whole)).rows}
    rows = tuple(
        Shown(
            row.quantity, _plain(row.predicted), _plain(row.measured), row.unit, _is_same(row, of_whole)
        )
        for row in evaluate_sample(experiment, recording(bag)).rows
    )  # fmt: skip
    count = sum(topic.messages for topic in contents(bag).topics.values())
    return Entry(
        experiment.name,
        sample.run,
        sample.shows,
        f"wam experiment {experiment.name} --samples make",
        sample.seconds,
        count,
        sum(file.stat().st_size for file in files_of(bag)),
        {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(bag)},
        rows,
    )


def check(experiment: Experiment, entry: Entry, directory: Path) -> list[str]:
    """Differences between a sample and the index, empty without any: hashes, and evaluated rows."""
    bag = directory / FOLDER / entry.name
    present = {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(bag)}
    if present != dict(entry.sha256):
        changed = sorted({name for name, _ in present.items() ^ dict(entry.sha256).items()})
        return [f"{bag}: {', '.join(changed)} differ from the index; restore them, or run '{entry.command}'"]
    found = {row.quantity: row for row in evaluate_sample(experiment, recording(bag)).rows}
    wrong = [f"{bag}: '{row.quantity}' is not within its bound" for row in found.values() if not row.agrees]
    for shown in entry.rows:
        row = found.pop(shown.quantity, None)
        if row is None or not (_alike(row.measured, shown.measured) and _alike(row.predicted, shown.predicted)):
            wrong.append(f"{bag}: '{shown.quantity}' differs from the index; '{entry.command}' writes both again")
    return wrong + [f"{bag}: '{name}' is not in the index; run '{entry.command}'" for name in found]


def files_of(bag: Path) -> list[Path]:
    """The files of a sample."""
    return sorted(file for pattern in FILES for file in bag.glob(pattern))


def read_index(directory: Path) -> dict[str, Entry]:
    """The samples by name; empty without an index.

    Raises
    ------
    ParameterError
        if the file is not an index.
    """
    file = directory / INDEX
    if not file.is_file():
        return {}
    try:
        entries = [_entry(body) for body in yaml.safe_load(file.read_text(encoding="utf-8"))["samples"]]
    except (yaml.YAMLError, TypeError, KeyError, ValueError) as error:
        require(False, f"{file} is not an index of samples ({error}); 'wam experiment --samples make' writes it")
        raise
    return {entry.name: entry for entry in entries}


def write_index(directory: Path, entries: Mapping[str, Entry]) -> None:
    """Write the index, and its tables into the page next to it.

    Raises
    ------
    ValueError
        if the page has no block for the tables.
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
    """Two tables in Markdown: the samples, and their quantities."""
    samples, quantities = [], []
    for entry in entries:
        begin, end = entry.seconds
        (digest,) = (value for name, value in entry.sha256.items() if name.endswith(".mcap"))
        part, size = f"`{entry.run}`, {begin:g} to {end:g} s", f"{entry.size / 1e3:.0f} kB"
        link, command = f"[{entry.name}]({FOLDER}/{entry.name})", f"`{entry.command}`"
        samples.append((link, entry.shows, part, str(entry.messages), size, command, f"`{digest[:16]}…`"))
        for row in entry.rows:
            predicted, measured = (value if isinstance(value, str) else f"{value:.4g}" for value in row[1:3])
            same = "the same" if row.is_whole else "differs"
            quantities.append((entry.name, row.quantity, predicted, measured, row.unit, same))
    total = sum(entry.size for entry in entries)
    head = "bag", "shows", "run, part of it", "messages", "size", "made by", "sha256 of the `.mcap`"
    return (
        f"\n{markdown(head, samples)}\n{len(entries)} samples, {total / 1e6:.2f} MB together.\n\n"
        f"{markdown(('bag', 'quantity', 'predicted', 'measured', 'unit', 'whole run'), quantities)}\n"
    )


def _entry(body: Mapping[str, Any]) -> Entry:
    begin, end = body["seconds"]
    rows = tuple(Shown(**row) for row in body["rows"])
    return Entry(**{**body, "seconds": (float(begin), float(end)), "rows": rows})


def _plain(value: float | str) -> float | str:
    return value if isinstance(value, str) else float(value)


def _is_same(row: Comparison, of_whole: Mapping[str, Comparison]) -> bool:
    other = of_whole.get(row.quantity)
    return other is not None and _alike(row.measured, other.measured) and _alike(row.predicted, other.predicted)


def _alike(value: float | str, other: float | str) -> bool:
    if isinstance(value, str) or isinstance(other, str):
        return value == other
    unknown = math.isnan(value) and math.isnan(other)
    return unknown or math.isclose(value, other, rel_tol=1e-6, abs_tol=_ALIKE)
