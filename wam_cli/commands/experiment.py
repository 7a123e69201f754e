"""`wam experiment`: an experiment of the thesis, run over topics in lockstep, recorded, evaluated from its bags."""

import argparse
import sys
import time
from pathlib import Path

from wam_cli.commands import PAGE, writable_directory, writable_file
from wam_ros.process_signals import Stop
from wam_studies.experiment_runs import record
from wam_studies.thesis.definition import Experiment, Run, load, names
from wam_studies.thesis.evaluation import evaluate, text
from wam_studies.thesis.figure import draw
from wam_studies.thesis.page import write
from wam_studies.thesis.rows import Result

PICTURE = "result.png"
SHOWN_EVERY = 0.2  # s


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("experiment", nargs="?", help="name, or path of a YAML file; --list prints the names")
    parser.add_argument("--list", action="store_true", help="print the name of every experiment")
    parser.add_argument("--all", action="store_true", help="run every experiment")
    parser.add_argument(
        "--evaluate",
        metavar="DIRECTORY",
        help="evaluate the bags in this directory and run nothing; the picture goes to --directory",
    )
    parser.add_argument("--directory", default="bags", help="directory for bags and pictures; default: bags")
    parser.add_argument("--name", default="", help="subdirectory; default: the experiment, date and time")
    parser.add_argument("--write", metavar="PAGE", help="also write tables and pictures into this documentation page")


def run(given: argparse.Namespace) -> int:
    """Run and evaluate."""
    if given.list:
        for name in names():
            print(f"{name:22} {load(name).title}")
        return 0
    if bool(given.experiment) == given.all:
        raise ValueError("name one experiment, or give --all; --list prints the names")
    writable_directory("--directory", Path(given.directory))
    if given.write:
        writable_file("--write", Path(given.write), PAGE)
    results: dict[str, tuple[Experiment, Result, Path]] = {}
    chosen = names() if given.all else [given.experiment]
    for number, experiment in enumerate(map(load, chosen), 1):
        if given.evaluate:
            directory = Path(given.evaluate) / experiment.name if given.all else Path(given.evaluate)
            picture = Path(given.directory) / f"{experiment.name}.png"
        else:
            name = given.name or f"{experiment.name}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
            directory = Path(given.directory) / (f"{name}/{experiment.name}" if given.all and given.name else name)
            picture = directory / PICTURE
            if not _record(experiment, directory, f"{number}/{len(chosen)} " if given.all else ""):
                return 130
        result = evaluate(experiment, directory)
        drawn = ""
        if result.panels:
            picture.parent.mkdir(parents=True, exist_ok=True)
            draw(experiment, result, picture)
            drawn = f"picture  {picture}\n"
        print(f"{text(experiment, result)}\nbags     {directory}\n{drawn}", flush=True)
        results[experiment.name] = (experiment, result, picture)
    if given.write:
        write(Path(given.write), list(results.values()))
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
