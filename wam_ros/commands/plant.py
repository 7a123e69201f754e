"""`wam plant`: the plant's effects beside the theory."""

import argparse
from pathlib import Path

from wam_analysis.plant_figure import figure
from wam_ros.commands import writable_file


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("file", type=Path, help="picture to write, for example plant.png")


def run(given: argparse.Namespace) -> int:
    """Draw the picture, print the differences."""
    writable_file("FILE", given.file)
    print(figure(given.file))
    return 0
