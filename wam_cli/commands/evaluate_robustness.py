"""`wam evaluate robustness`: contact estimation on arms and signals that differ from what the estimator states."""

import argparse
from pathlib import Path

from wam_cli.commands import (
    at_least,
    batch_of,
    configuration_of,
    require_seeds,
    take_batch,
    take_configuration,
    take_seeds,
    writable_file,
)
from wam_experiments.contact_robustness import degradations
from wam_experiments.contact_robustness.evaluation import drives, evaluate, page, report_text

SEEDS = (1, 2, 3)
SHORTEST = 10.0  # s, with one contact


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    take_seeds(parser, SEEDS, "arms and contacts")
    parser.add_argument("--seconds", type=float, default=26.0, help="length of a recording, default 26")
    parser.add_argument(
        "--only", nargs="+", default=list(degradations.NAMES), metavar="DEGRADATION", help="default: all"
    )
    parser.add_argument(
        "--recordings", type=Path, metavar="DIRECTORY", help="keep the recordings here, and use those that are here"
    )
    parser.add_argument("--write", type=Path, help="page to write, for example docs/contact-robustness.md")
    parser.add_argument("--before", type=Path, help="page of another version on the same seeds, to put below")
    take_configuration(parser)
    take_batch(parser)


def run(given: argparse.Namespace) -> int:
    """Evaluate and print the tables."""
    at_least("--seconds", given.seconds, SHORTEST)
    require_seeds(given)
    if given.write:
        writable_file("--write", given.write)
    before = given.before.read_text(encoding="utf-8") if given.before else ""
    chosen = drives(configuration_of(given), given.seed, given.only, given.seconds)
    with batch_of(given) as batch:
        text = report_text(*(evaluate(each, *batch, recordings=given.recordings) for each in chosen))
    print(text)
    if given.write:
        seeds = " ".join(map(str, given.seed))
        command = f"wam evaluate robustness --seed {seeds} --seconds {given.seconds:g}"
        if given.only != list(degradations.NAMES):
            command += " --only " + " ".join(f"'{name}'" for name in given.only)
        command += f" --write {given.write}"
        given.write.write_text(page(text, command, before), encoding="utf-8")
    return 0
