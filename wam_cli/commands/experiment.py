"""`wam experiment`: experiments of the thesis, run over topics in lockstep, recorded, evaluated; their sample bags."""

import argparse
import contextlib
import shutil
import sys
import time
from pathlib import Path

from wam_cli.options import PAGE, writable_directory
from wam_ros.process_signals import Stop
from wam_studies.experiment_runs import record
from wam_studies.figures.panels import draw_panels
from wam_studies.thesis.definition import Experiment, Run, load, names, tasks
from wam_studies.thesis.evaluation import evaluate, text
from wam_studies.thesis.page import write
from wam_studies.thesis.rows import Result
from wam_studies.thesis.samples import FOLDER, LIMIT, Entry, check, make, read_index, write_index

PICTURE = "result.png"
SHOWN_EVERY = 0.2  # s
RECORDED = "recorded"  # in the directory of the samples: what they are cut from, by a path that is the same everywhere


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
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
        help="instead: check the sample bags that the index in --directory lists, or record and cut them again; of "
        "experiments and tasks, default all",
    )
    parser.add_argument(
        "--directory", type=Path, default=Path("bags"), help="directory for bags and pictures; default: bags"
    )
    parser.add_argument("--name", default="", help="subdirectory; default: the experiment, date and time")
    parser.add_argument(
        "--write", type=PAGE, metavar="PAGE", help="also write tables and pictures into this documentation page"
    )


def run(given: argparse.Namespace) -> int:
    """Run and evaluate."""
    if given.list:
        for name in names():
            print(f"{name:22} {load(name).title}")
        return 0
    if given.samples:
        return _samples(given)
    if bool(given.experiment) == given.all:
        raise ValueError("name an experiment, or give --all; --list prints the names")
    writable_directory(str(given.directory))
    results: dict[str, tuple[Experiment, Result, Path]] = {}
    chosen = names() if given.all else given.experiment
    is_one = len(chosen) == 1 and not given.all
    for number, experiment in enumerate(map(load, chosen), 1):
        if given.evaluate:
            directory = given.evaluate if is_one else given.evaluate / experiment.name
            picture = given.directory / f"{experiment.name}.png"
        else:
            name = given.name or f"{experiment.name}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
            directory = given.directory / (name if is_one or not given.name else f"{name}/{experiment.name}")
            picture = directory / PICTURE
            if not _record(experiment, directory, "" if is_one else f"{number}/{len(chosen)} "):
                return 130
        result = evaluate(experiment, directory)
        drawn = ""
        if result.panels:
            picture.parent.mkdir(parents=True, exist_ok=True)
            draw_panels(result.panels, picture, 2, f"{experiment.title} (section {experiment.section})")
            drawn = f"picture  {picture}\n"
        print(f"{text(experiment, result)}\nbags     {directory}\n{drawn}", flush=True)
        results[experiment.name] = (experiment, result, picture)
    if given.write:
        write(given.write, list(results.values()))
    return 0 if all(result.agrees for _, result, _ in results.values()) else 1


def _record(experiment: Experiment, directory: Path, place: str) -> bool:
    """Record every run; False where it was interrupted."""
    stop = Stop()
    for i, each in enumerate(experiment.runs):
        play(experiment, each, directory, f"{place}{experiment.name} {i + 1}/{len(experiment.runs)} {each.name}", stop)
        if stop.is_set:
            print(f"stopped; what was recorded until then is in {directory}")
            return False
    return True


def play(experiment: Experiment, each: Run, directory: Path, label: str, stop: Stop) -> None:
    """Record one run, with its progress."""
    shown = [0.0]

    def is_stopped(seconds: float) -> bool:
        now = time.monotonic()
        if now >= shown[0]:
            shown[0] = now + SHOWN_EVERY
            _show(f"{label}: {seconds:5.1f} of {each.seconds:.1f} s")
        return stop.is_set

    played = record(experiment, each, directory, is_stopped)
    ended = f"stopped by the driver: {played.fault}" if played.fault else "done" if played.is_done else "stopped"
    _show(f"{label}: {ended}", end="\n")


def _show(words: str, end: str = "") -> None:
    """Show the progress: in one line on a terminal, otherwise only the end."""
    if sys.stderr.isatty():
        print(f"\r\033[K{words}", end=end, file=sys.stderr, flush=True)
    elif end:
        print(words, file=sys.stderr, flush=True)


def _samples(given: argparse.Namespace) -> int:
    """Check the samples, or record them; 0 if every sample is as the index lists it."""
    folder = given.directory
    every = [load(name) for name in given.experiment or [*names(), *tasks()]]
    chosen = [experiment for experiment in every if given.experiment or experiment.sample is not None]
    if given.samples == "make" and not _make(chosen, folder):
        return 130
    entries = read_index(folder)
    wrong = []
    for experiment in chosen:
        if experiment.name not in entries:
            wrong.append(
                f"{folder} lists no sample of {experiment.name}; 'wam experiment {experiment.name} --samples make'"
            )
            continue
        entry = entries[experiment.name]
        found = check(experiment, entry, folder)
        wrong += found
        print(_stated(entry, folder, not found))
    size = sum(entry.size for entry in entries.values())
    if size >= LIMIT:
        wrong.append(f"the samples have {size} bytes together; {LIMIT} are allowed: cut less in their experiments")
    print("\n".join(wrong) if wrong else f"every sample is as the index lists it, {size / 1e6:.2f} MB together")
    return 1 if wrong else 0


def _make(chosen: list[Experiment], folder: Path) -> bool:
    """Record, cut and list; False if it was interrupted."""
    stop = Stop()
    entries = read_index(folder)
    for experiment in chosen:
        if experiment.sample is None:
            raise ValueError(f"experiment {experiment.name} declares no sample; add one to its YAML")
        recorded = folder / RECORDED / experiment.name
        shutil.rmtree(recorded, ignore_errors=True)
        play(experiment, experiment.run(experiment.sample.run), recorded, experiment.name, stop)
        if stop.is_set:
            return False
        shutil.rmtree(folder / FOLDER / experiment.name, ignore_errors=True)
        entries[experiment.name] = make(experiment, recorded / experiment.sample.run, folder)
        shutil.rmtree(recorded)
        write_index(folder, entries)
    with contextlib.suppress(OSError):  # where another one's recording was left in it
        (folder / RECORDED).rmdir()
    return True


def _stated(entry: Entry, folder: Path, is_right: bool) -> str:
    begin, end = entry.seconds
    word = "ok   " if is_right else "WRONG"
    bag = folder / FOLDER / entry.name
    return f"{word} {bag}  {entry.size / 1e3:.0f} kB, {begin:g} to {end:g} s\n      {entry.shows}"
