"""`wam scorecard`: the arm compared with the requisites of chapter 3."""

import argparse

from wam_cli.commands import configuration_of, take_configuration
from wam_studies.scorecard import report


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Print the table."""
    print(report(configuration_of(given)), end="")
    return 0
