"""`wam report`: the demo report, printed again from the recording."""

import argparse
from pathlib import Path

from wam_analysis.demo_report import report


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("bag", type=Path, help="directory of the bag")


def run(given: argparse.Namespace) -> int:
    """Print the report; a bag without a demonstration is an error, and nothing is written into its directory."""
    print(report(given.bag))
    return 0
