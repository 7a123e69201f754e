"""`wam report`: the demo report, printed again from the recording."""

import argparse
from pathlib import Path

from wam_analysis.demo_report import report
from wam_cli.commands import exit_code_of, take_arm, writable_picture


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("bag", type=Path, help="directory of the bag")
    parser.add_argument("--picture", type=Path, help="also draw the arm, the forces and the contact positions, PNG")
    take_arm(parser)


def run(given: argparse.Namespace) -> int:
    """Print the report; nothing is written into the directory of the bag.  1 where it has a NO or the run failed."""
    if given.picture:
        writable_picture("--picture", given.picture)
    made = report(given.bag, given.picture, given.namespace or "")
    print(made.text)
    return exit_code_of(made.unmet)
