"""`wam scorecard`: the arm beside what chapter 3 asks of a manipulator."""

import argparse

from wam_analysis.scorecard import report
from wam_ros.commands import configuration_of, take_configuration


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Print the table."""
    print(report(configuration_of(given)), end="")
    return 0
