"""`wam samples`: the small bags in `bags/sample`, one of each experiment and task, checked or recorded again."""

import argparse
import contextlib
import shutil
from pathlib import Path

from wam_cli.commands.experiment import play
from wam_ros.process_signals import Stop
from wam_studies.thesis.definition import Experiment, load, names, tasks
from wam_studies.thesis.samples import FOLDER, LIMIT, Entry, check, make, read_index, write_index

RECORDED = "recorded"  # in the directory of the samples: what they are cut from, by a path that is the same everywhere


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("name", nargs="*", help="experiments and tasks whose samples are checked; default: all")
    parser.add_argument("--make", action="store_true", help="record and cut them again and write the index")
    parser.add_argument(
        "--directory",
        default="bags",
        help="directory of the index; default: bags; its path is in the parameters of a bag",
    )


def run(given: argparse.Namespace) -> int:
    """Check or record; 0 if every sample is as the index lists it."""
    directory = Path(given.directory)
    every = [load(name) for name in given.name or [*names(), *tasks()]]
    chosen = [experiment for experiment in every if given.name or experiment.sample is not None]
    if given.make and not _make(chosen, directory):
        return 130
    entries = read_index(directory)
    wrong = []
    for experiment in chosen:
        if experiment.name not in entries:
            wrong.append(f"{directory} lists no sample of {experiment.name}; 'wam samples --make {experiment.name}'")
            continue
        entry = entries[experiment.name]
        found = check(experiment, entry, directory)
        wrong += found
        print(_stated(entry, directory, not found))
    size = sum(entry.size for entry in entries.values())
    if size >= LIMIT:
        wrong.append(f"the samples have {size} bytes together; {LIMIT} are allowed: cut less in their experiments")
    print("\n".join(wrong) if wrong else f"every sample is as the index lists it, {size / 1e6:.2f} MB together")
    return 1 if wrong else 0


def _make(chosen: list[Experiment], directory: Path) -> bool:
    """Record, cut and list; False if it was interrupted."""
    stop = Stop()
    entries = read_index(directory)
    for experiment in chosen:
        if experiment.sample is None:
            raise ValueError(f"experiment {experiment.name} declares no sample; add one to its YAML")
        recorded = directory / RECORDED / experiment.name
        shutil.rmtree(recorded, ignore_errors=True)
        play(experiment, experiment.run(experiment.sample.run), recorded, experiment.name, stop)
        if stop.is_set:
            return False
        shutil.rmtree(directory / FOLDER / experiment.name, ignore_errors=True)
        entries[experiment.name] = make(experiment, recorded / experiment.sample.run, directory)
        shutil.rmtree(recorded)
        write_index(directory, entries)
    with contextlib.suppress(OSError):  # where another one's recording was left in it
        (directory / RECORDED).rmdir()
    return True


def _stated(entry: Entry, directory: Path, is_right: bool) -> str:
    begin, end = entry.seconds
    word = "ok   " if is_right else "WRONG"
    bag = directory / FOLDER / entry.name
    return f"{word} {bag}  {entry.size / 1e3:.0f} kB, {begin:g} to {end:g} s\n      {entry.shows}"
