"""The samples in `bags/`: one small bag of each experiment and task, and an index of their contents.

A sample is cut out of a recording in lockstep.  It has no wall-clock time, so the same code makes the same file.
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml

from wam_analysis.table import markdown
from wam_bag.bag import read
from wam_description.parameters import ParameterError, require
from wam_studies.page import with_section
from wam_studies.thesis.cutting import cut
from wam_studies.thesis.definition import Experiment
from wam_studies.thesis.evaluation import evaluate_sample
from wam_studies.thesis.recording import recording
from wam_studies.thesis.rows import value_text

FOLDER: Final = "sample"
INDEX: Final = "index.yaml"
PAGE: Final = "README.md"
LIMIT: Final = 8_000_000  # bytes of all samples together, part of every clone
FILES: Final = ("metadata.yaml", "*.mcap")
_HEAD = f"# Contents of the bags in {FOLDER}/; written by 'wam experiment --samples make'.\n"
_ALIKE = 1e-9  # rounding of a sum over another array

Shown = dict[str, Any]  # quantity, predicted, measured, unit; is_whole: whether the whole run gives the same values


class Entry(NamedTuple):
    """A sample in the index.

    Attributes
    ----------
    name : of the experiment, and of the directory.
    seconds : start and end, of the arm's time.
    sha256 : by file.
    rows : quantities that it shows.
    """

    name: str
    run: str
    shows: str
    seconds: Sequence[float]
    messages: int
    size: int
    sha256: Mapping[str, str]
    rows: Sequence[Shown]

    @property
    def command(self) -> str:
        """What makes it again."""
        return f"wam experiment {self.name} --samples make"


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
    RecordingError
        if there is a sample of that name.
    """
    sample = experiment.sample
    require(sample is not None, f"experiment {experiment.name} declares no sample; add one to its YAML")
    assert sample is not None  # for mypy
    bag = directory / FOLDER / experiment.name
    cut(whole, bag, sample)
    of_whole = _rows(experiment, whole)
    return Entry(
        experiment.name,
        sample.run,
        sample.shows,
        list(sample.seconds),
        sum(read(bag, ()).counts.values()),
        sum(file.stat().st_size for file in files_of(bag)),
        _hashes(bag),
        [row | {"is_whole": _is_same(row, of_whole.get(name))} for name, row in _rows(experiment, bag).items()],
    )


def _rows(experiment: Experiment, bag: Path) -> dict[str, Shown]:
    """What a sample or a whole run shows, by quantity."""
    found = {}
    for row in evaluate_sample(experiment, recording(bag)).rows:
        predicted, measured = (v if isinstance(v, str) else float(v) for v in (row.predicted, row.measured))
        found[row.quantity] = {
            "quantity": row.quantity, "predicted": predicted, "measured": measured, "unit": row.unit,
        }  # fmt: skip
    return found


def check(experiment: Experiment, entry: Entry, directory: Path) -> list[str]:
    """Differences between a sample and the index, empty without any: hashes, and evaluated rows."""
    bag = directory / FOLDER / entry.name
    if changed := sorted({name for name, _ in _hashes(bag).items() ^ entry.sha256.items()}):
        return [f"{bag}: {', '.join(changed)} differ from the index; restore them, or run '{entry.command}'"]
    rows = evaluate_sample(experiment, recording(bag)).rows
    found = {row.quantity: row._asdict() for row in rows}
    wrong = [f"{bag}: '{row.quantity}' is not within its bound" for row in rows if not row.agrees]
    changed = [row["quantity"] for row in entry.rows if not _is_same(row, found.pop(row["quantity"], None))]
    wrong += [f"{bag}: '{name}' differs from the index; '{entry.command}' writes both again" for name in changed]
    return wrong + [f"{bag}: '{name}' is not in the index; run '{entry.command}'" for name in found]


def files_of(bag: Path) -> list[Path]:
    """The files of a sample."""
    return sorted(file for pattern in FILES for file in bag.glob(pattern))


def _hashes(bag: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(bag)}


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
        entries = [Entry(**body) for body in yaml.safe_load(file.read_text(encoding="utf-8"))["samples"]]
    except (yaml.YAMLError, TypeError, KeyError) as error:
        raise ParameterError(
            f"{file} is not an index of samples ({error}); 'wam experiment --samples make' writes it"
        ) from error
    return {entry.name: entry for entry in entries}


def write_index(directory: Path, entries: Mapping[str, Entry]) -> None:
    """Write the index, and its tables into the page next to it.

    Raises
    ------
    ValueError
        if the page has no section for the tables.
    """
    page, ordered = directory / PAGE, [entries[name] for name in sorted(entries)]
    text = with_section(page, "samples", table(ordered))
    bodies = [entry._asdict() for entry in ordered]
    written = yaml.safe_dump({"samples": bodies}, sort_keys=False, allow_unicode=True, width=1000)
    (directory / INDEX).write_text(_HEAD + written, encoding="utf-8")
    page.write_text(text, encoding="utf-8")


def table(entries: list[Entry]) -> str:
    """Two tables in Markdown: the samples, and their quantities."""
    samples, quantities = [], []
    for entry in entries:
        begin, end = entry.seconds
        (digest,) = (value for name, value in entry.sha256.items() if name.endswith(".mcap"))
        part, size = f"`{entry.run}`, {begin:g} to {end:g} s", f"{entry.size / 1e3:.0f} kB"
        link = f"[{entry.name}]({FOLDER}/{entry.name})"
        samples.append((link, entry.shows, part, str(entry.messages), size, f"`{digest[:16]}…`"))
        for row in entry.rows:
            values = map(value_text, (row["predicted"], row["measured"]))
            same = "the same" if row["is_whole"] else "differs"
            quantities.append((entry.name, row["quantity"], *values, row["unit"], same))
    total = sum(entry.size for entry in entries)
    head = "bag", "shows", "run, part of it", "messages", "size", "sha256 of the `.mcap`"
    return (
        f"\n{markdown(head, samples)}\n{len(entries)} samples, {total / 1e6:.2f} MB together.\n\n"
        f"{markdown(('bag', 'quantity', 'predicted', 'measured', 'unit', 'whole run'), quantities)}\n"
    )


def _is_same(row: Mapping[str, Any], other: Mapping[str, Any] | None) -> bool:
    return other is not None and all(_alike(row[key], other[key]) for key in ("predicted", "measured"))


def _alike(value: float | str, other: float | str) -> bool:
    if isinstance(value, str) or isinstance(other, str):
        return value == other
    unknown = math.isnan(value) and math.isnan(other)
    return unknown or math.isclose(value, other, rel_tol=1e-6, abs_tol=_ALIKE)
