"""`wam evaluate identify`: identified against true friction, over plants and seeds."""

import argparse
import sys

from wam_cli.commands import at_least, batch_of, evaluation_of, take_evaluation
from wam_sim.batch import results
from wam_studies.faults.page import with_section
from wam_studies.identification.evaluation import missed, run_trial, table, trials

SEEDS = (1, 2, 3)
SHORTEST = 20.0  # s of motion
SECTION = "identification"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    take_evaluation(parser, SEEDS, "plants and motions", "docs/identify.md")
    parser.add_argument("--seconds", type=float, default=60.0, help="length of each motion, default 60")


def run(given: argparse.Namespace) -> int:
    """Play, identify, compare; 1 if a required value is missed."""
    at_least("--seconds", given.seconds, SHORTEST)
    configuration = evaluation_of(given)
    if given.write:
        with_section(given.write, SECTION, "")  # refuses a page without the section, before the work
    played = trials(configuration, given.seed, given.seconds)
    with batch_of(given, len(played)) as batch:
        found = results(run_trial, played, *batch)
    text, short = table(found), list(missed(found))
    print(text)
    if given.write:
        seeds = " ".join(map(str, given.seed))
        command = f"wam evaluate identify --seed {seeds} --seconds {given.seconds:g} --write {given.write}"
        lines = f"Missed: {'; '.join(short)}." if short else "Every required value is met."
        page = with_section(given.write, SECTION, f"Written by `{command}`.\n\n{text}\n{lines}")
        given.write.write_text(page, encoding="utf-8")
    if short:
        print(f"missed: {'; '.join(short)}", file=sys.stderr)
    return 1 if short else 0
