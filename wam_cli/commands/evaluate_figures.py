"""`wam evaluate figures`: the thesis's figures that carry data."""

import argparse

from wam_cli.options import batch_of, take_batch, writable_directory
from wam_studies.figures.catalogue import FIGURES, file_of, known, numbers, table
from wam_studies.figures.style import draw_panels


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam evaluate figures` to its parser."""
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"figures to draw, of {', '.join(FIGURES)}; default: all"
    )
    parser.add_argument(
        "--to", type=writable_directory, default="docs/figures", help="directory for the figures; default: %(default)s"
    )
    take_batch(parser, "figures")


def run(given: argparse.Namespace) -> int:
    """Compute and draw figures, and print how far the plant is from their lines."""
    names = known(given.names or list(FIGURES))  # before anything is started
    with batch_of(given, len(names)) as batch:
        found = numbers(names, *batch)
    given.to.mkdir(parents=True, exist_ok=True)
    for name, values in found.items():
        draw_panels(values, file_of(name, given.to))
    print(table(found), end="")
    return 0
