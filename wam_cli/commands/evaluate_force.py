"""`wam evaluate force`: random forces on random surfaces, true force against commanded."""

import argparse
import sys
from pathlib import Path

from wam_cli.commands import (
    PAGE,
    at_least,
    configuration_of,
    executor_of,
    refuse_overridden,
    require_effect,
    take_configuration,
    take_executor,
    writable_directory,
    writable_file,
)
from wam_description.configuration import option_values
from wam_sim.pieces import default_folder
from wam_sim.progress import Progress
from wam_studies.force_benchmark.evaluation import ForceTrial, evaluate
from wam_studies.force_benchmark.figure import figure
from wam_studies.force_benchmark.page import details, page, report, required
from wam_studies.force_benchmark.results_file import key
from wam_studies.force_benchmark.tasks import SECONDS, draw, task_values

RESULTS = default_folder().parent / "force-benchmark.jsonl"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--seed", type=int, default=1, help="seed of the tasks, default 1")
    parser.add_argument("--tasks", type=int, default=100, help="number of tasks, default 100")
    parser.add_argument(
        "--only", type=int, nargs="+", metavar="NUMBER", help="instead: tasks of these numbers, each in full"
    )
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="time of the whole force in each task, default %(default)g"
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=RESULTS,
        metavar="FILE",
        help="finished tasks, a line each; those in it are not done again; default: %(default)s",
    )
    parser.add_argument("--write", type=Path, help="page to write, for example docs/force-benchmark.md")
    take_configuration(parser)
    take_executor(parser)


def run(given: argparse.Namespace) -> int:
    """Do the tasks; 1 if a required value is missed."""
    at_least("--seed", given.seed, 0)
    at_least("--tasks", given.tasks, 1)
    at_least("--seconds", given.seconds, 1.0)
    for number in given.only or ():
        at_least("--only", number, 0)
    writable_directory("--results", given.results.parent)
    if given.write:
        writable_file("--write", given.write, PAGE)
    trials = _trials(given)
    if given.only:
        print("\n".join(details(given.seed, trial) for trial in trials))
    else:
        print(report(given.seed, _code(given), trials))
    if given.write:
        _write(given, trials)
    return 0 if all(met for _, _, _, met, _ in required(trials)) else 1


def _trials(given: argparse.Namespace) -> list[ForceTrial]:
    require_effect("--set", option_values(given.values))
    numbers, base = given.only or range(given.tasks), configuration_of(given)
    if given.values:
        drawn = [draw(base.shared.arm, given.seed, number) for number in numbers]
        refuse_overridden(given, {name for task in drawn for name in task_values(base, task)}, "each task")
    with executor_of(given, len(numbers)) as found:
        return evaluate(
            base,
            given.seed,
            numbers,
            given.seconds,
            found,
            given.results,
            Progress("tasks", sys.stderr),
        )


def _code(given: argparse.Namespace) -> str:
    return key(configuration_of(given), given.seed, given.seconds).code


def _write(given: argparse.Namespace, trials: list[ForceTrial]) -> None:
    """Write the page, and its figure into a folder of the page's name."""
    file = Path(given.write)
    picture = file.with_suffix("") / "benchmark.png"
    figure(trials, picture)
    seconds = f" --seconds {given.seconds:g}" * (given.seconds != SECONDS)
    repeat = f"wam evaluate force --seed {given.seed} --tasks {given.tasks}{seconds} --write {file}"
    shown = f"{picture.parent.name}/{picture.name}"
    file.write_text(page(trials, given.seed, _code(given), repeat, shown), encoding="utf-8")
