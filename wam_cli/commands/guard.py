"""`wam guard`: the stability guard validated by Monte Carlo simulation."""

import argparse
import sys

from wam_cli.commands import at_least
from wam_experiments.stability.guard_validation import Trial, exact_trials, table, testbed_trials


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--sets", type=int, default=200, help="random sets for the exact integrator; default: 200")
    parser.add_argument("--testbed", type=int, default=40, help="random sets for the testbed in MuJoCo; default: 40")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random sets; default: 1")


def run(given: argparse.Namespace) -> int:
    """Print the two tables; 1 where a set was accepted that diverges."""
    at_least("--sets", given.sets, 1)
    at_least("--testbed", given.testbed, 1)
    at_least("--seed", given.seed, 0)
    bad = 0
    for name, trials in (
        ("one friction node, exact integrator", exact_trials(given.seed, given.sets)),
        ("testbed in MuJoCo behind its velocity loop", testbed_trials(given.seed, given.testbed)),
    ):
        found = table(trials, _show)
        bad += found.accepted_and_diverged
        sys.stderr.write("\n")
        print(f"{name}\n{found.text()}\n")
    return int(bad > 0)


def _show(trial: Trial) -> None:
    """Show the progress: one character per set."""
    sys.stderr.write("." if trial.is_accepted else "-")
    sys.stderr.flush()
