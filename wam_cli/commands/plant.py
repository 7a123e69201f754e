"""`wam plant`: the plant's effects compared with theory."""

import argparse
from pathlib import Path

from wam_cli.commands import writable_picture
from wam_studies.plant.figure import figure


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("file", type=Path, help="picture to write, for example plant.png")


def run(given: argparse.Namespace) -> int:
    """Draw the picture, print the differences."""
    writable_picture("FILE", given.file)
    print(figure(given.file))
    return 0
