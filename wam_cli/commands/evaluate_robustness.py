"""`wam evaluate robustness`: contact estimation on arms and signals that differ from what the estimator states."""

import argparse

from wam_cli.commands import at_least, batch_of, evaluation_of, take_evaluation
from wam_sim.batch import results
from wam_studies.contact_benchmark.evaluation import evaluate_scenario
from wam_studies.contact_benchmark.timing import reference_time
from wam_studies.contact_robustness import degradations
from wam_studies.contact_robustness.comparison import first_tasks
from wam_studies.contact_robustness.evaluation import (
    SHORTEST,
    RobustnessResult,
    average_update,
    bounds_of,
    drives,
    evaluate,
    friction_trials,
    page,
    report_text,
)
from wam_studies.identification.trial import run_trial

SEEDS = (1, 2, 3)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    take_evaluation(parser, SEEDS, "arms and contacts", "docs/contact-robustness.md")
    names = ", ".join(map(repr, degradations.NAMES)).replace("%", "%%")
    parser.epilog = (
        "One degradation with one seed takes about two minutes of one core; --jobs share them. Progress on stderr "
        "has the time left."
    )
    parser.add_argument("--seconds", type=float, default=110.0, help="length of a recording, default 110")
    parser.add_argument(
        "--only",
        nargs="+",
        default=list(degradations.NAMES),
        metavar="DEGRADATION",
        help=f"of: {names}; default: all, and the first benchmark on the same seeds",
    )


def run(given: argparse.Namespace) -> int:
    """Evaluate and print the tables."""
    at_least("--seconds", given.seconds, SHORTEST)
    configuration = evaluation_of(given)
    chosen = drives(configuration, given.seed, given.only, given.seconds)
    with batch_of(given, max(map(len, chosen))) as batch:
        groups = [evaluate(each, *batch) for each in chosen]
        whole = given.only == list(degradations.NAMES)
        first = results(evaluate_scenario, first_tasks(configuration, given.seed), *batch) if whole else []
        identifications = results(run_trial, friction_trials(configuration, given.seed), *batch)
    wide, second, masses, level, identified = groups
    average, bounds = average_update(configuration, given.seed[0]), bounds_of(configuration, given.seed[0], identified)
    result = RobustnessResult(
        wide, second, masses, level, identified, identifications, average, bounds, reference_time(), first
    )
    text = report_text(result, configuration.shared.arm)
    print(text)
    if given.write:
        seeds = " ".join(map(str, given.seed))
        command = f"wam evaluate robustness --seed {seeds} --seconds {given.seconds:g}"
        if not whole:
            command += " --only " + " ".join(f"'{name}'" for name in given.only)
        command += f" --write {given.write}"
        given.write.write_text(page(text, command), encoding="utf-8")
    return 0
