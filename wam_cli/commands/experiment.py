"""`wam experiment`: experiments of the thesis, whose bags are kept; their sample bags."""

import argparse
import contextlib
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from wam_analysis.table import markdown
from wam_bag.bag_name import dated
from wam_cli.options import COUNT, PAGE, writable_directory
from wam_ros.bring_up import Composition
from wam_sim.batch import processes, results
from wam_sim.progress import Progress
from wam_studies.figures.style import draw_panels
from wam_studies.page import kept_rows, section_of, with_section
from wam_studies.thesis import evaluation
from wam_studies.thesis.definition import Experiment, configured, load, names, tasks
from wam_studies.thesis.measurement import ExperimentCase, MeasuredCase, measure
from wam_studies.thesis.rows import PAGE_HEAD, Result, summary
from wam_studies.thesis.samples import FOLDER, INDEX, LIMIT, Entry, check, make, read_index, write_index

PICTURE = "result.png"
SECTION = "experiments"  # of the page
HEAD = ("experiment", "within bounds", "nearest to its bound", *PAGE_HEAD[1:])
RECORDED = "recorded"  # in the directory of the samples: what they are cut from, by a path that is the same everywhere


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam experiment` to its parser."""
    parser.add_argument("experiment", nargs="*", help="names, or paths of YAML files; --list prints the names")
    parser.add_argument("--list", action="store_true", help="print the name of every experiment")
    parser.add_argument("--all", action="store_true", help="run every experiment")
    parser.add_argument(
        "--evaluate",
        type=Path,
        metavar="DIRECTORY",
        help="evaluate the bags in this directory and run nothing; the picture goes to --directory",
    )
    parser.add_argument(
        "--samples",
        choices=("check", "make"),
        help="check: compare the sample bags in --directory with sizes and checksums in index.yaml. make: record them "
        "again. Without names of experiments: all experiments and tasks",
    )
    parser.add_argument(
        "--directory", type=Path, default=Path("bags"), help="directory for bags and pictures; default: bags"
    )
    parser.add_argument(
        "--name", default="", help="subdirectory for the bags; default: name of the experiment, date and time"
    )
    parser.add_argument(
        "--jobs",
        type=COUNT,
        default=os.cpu_count() or 1,
        help="number of processes; default: one for each core",
    )
    parser.add_argument(
        "--write", type=PAGE, metavar="PAGE", help="also write tables and pictures into this documentation page"
    )


def run(given: argparse.Namespace) -> int:
    """Run and evaluate experiments."""
    if given.list:
        for name in names():
            print(f"{name:22} {load(name).title}")
        return 0
    if given.samples:
        return _samples(given)
    if bool(given.experiment) == given.all:
        raise ValueError("name an experiment, or give --all; --list prints the names")
    writable_directory(str(given.directory))
    chosen = list(map(load, names() if given.all else given.experiment))
    cases = [ExperimentCase(one, _directory(given, one, len(chosen) == 1 and not given.all)) for one in chosen]
    if given.evaluate:
        records = [MeasuredCase("", evaluation.evaluate(one, Path(bags))) for one, bags in cases]
    else:
        with processes(min(given.jobs, len(cases))) as executor:
            records = results(measure, cases, executor, report=Progress("experiments", sys.stderr))
    found = []
    for (experiment, directory), (failure, result) in zip(cases, records, strict=True):
        if failure:
            print(f"{experiment.name}: {failure}", file=sys.stderr)
            continue
        picture = given.directory / f"{experiment.name}.png" if given.evaluate else Path(directory, PICTURE)
        drawn = ""
        if result.panels:
            picture.parent.mkdir(parents=True, exist_ok=True)
            draw_panels(result.panels, picture, 2, f"{experiment.title} (section {experiment.section})")
            drawn = f"picture  {picture}\n"
        print(f"{evaluation.text(experiment, result)}\nbags     {directory}\n{drawn}", flush=True)
        found.append((experiment, result, picture))
    if given.write:
        _write(given.write, found)
    return 2 if len(found) < len(records) else int(not all(result.agrees for _, result, _ in found))


def _directory(given: argparse.Namespace, experiment: Experiment, is_one: bool) -> str:
    """Where the bags of an experiment are."""
    if given.evaluate:
        return str(given.evaluate if is_one else given.evaluate / experiment.name)
    name = given.name or dated(experiment.name)
    return str(given.directory / (name if is_one or not given.name else f"{name}/{experiment.name}"))


def _write(page: Path, results: Sequence[tuple[Experiment, Result, Path]]) -> None:
    """Write a row and a picture of each experiment into a page of the documentation, and keep the rows of others.

    The pictures are copied into the folder with the name of the page; a result without panels has none.
    """
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    before = section_of(page, SECTION)
    rows = kept_rows(before)
    pictures = {line.rpartition("/")[2]: line for line in before.splitlines() if line.startswith("![")}
    for experiment, result, picture in results:
        name = f"`{experiment.name}`"
        rows[name] = [name, *summary(result.rows)]
        if result.panels:
            shown = f"{folder.name}/{experiment.name}.png)"
            pictures[shown.rpartition("/")[2]] = f"![{experiment.title}]({shown}"
            shutil.copyfile(picture, folder / f"{experiment.name}.png")
    text = "\n\n".join([markdown(HEAD, list(rows.values())).rstrip(), *pictures.values()])
    page.write_text(with_section(page, SECTION, f"\n{text}", SECTION), encoding="utf-8")


def _samples(given: argparse.Namespace) -> int:
    """Check the samples, or record them; 0 if every sample is as the index lists it."""
    folder = given.directory
    every = [load(name) for name in given.experiment or [*names(), *tasks()]]
    chosen = [experiment for experiment in every if given.experiment or experiment.sample is not None]
    if given.samples == "make":
        _make(chosen, folder)
    entries = read_index(folder)
    wrong = []
    for experiment in chosen:
        if experiment.name not in entries:
            wrong.append(
                f"{folder}/{INDEX} has no sample of {experiment.name}; give its directory with --directory, or record "
                f"it: wam experiment {experiment.name} --samples make"
            )
            continue
        entry = entries[experiment.name]
        found = check(experiment, entry, folder)
        wrong += found
        print(_stated(entry, folder, not found))
    size = sum(entry.size for entry in entries.values())
    if size >= LIMIT:
        wrong.append(f"the samples have {size} bytes together; {LIMIT} are allowed: shorten them in their experiments")
    print("\n".join(wrong) if wrong else f"every sample is as the index lists it, {size / 1e6:.2f} MB together")
    return 1 if wrong else 0


def _make(chosen: list[Experiment], folder: Path) -> None:
    """Record over topics, with all that nodes publish; cut and list."""
    entries = read_index(folder)
    for experiment in chosen:
        if experiment.sample is None:
            raise ValueError(f"experiment {experiment.name} declares no sample; add one to its YAML")
        recorded = folder / RECORDED / experiment.name
        shutil.rmtree(recorded, ignore_errors=True)
        with Composition(configured(experiment, experiment.run(experiment.sample.run), recorded)) as nodes:
            nodes.play()
        shutil.rmtree(folder / FOLDER / experiment.name, ignore_errors=True)
        entries[experiment.name] = make(experiment, recorded / experiment.sample.run, folder)
        shutil.rmtree(recorded)
        write_index(folder, entries)
    with contextlib.suppress(OSError):  # where another one's recording was left in it
        (folder / RECORDED).rmdir()


def _stated(entry: Entry, folder: Path, is_right: bool) -> str:
    begin, end = entry.seconds
    word = "ok   " if is_right else "WRONG"
    bag = folder / FOLDER / entry.name
    return f"{word} {bag}  {entry.size / 1e3:.0f} kB, {begin:g} to {end:g} s\n      {entry.shows}"
