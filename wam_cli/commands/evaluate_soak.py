"""`wam evaluate soak`: a long run of the nodes, its memory and its losses."""

import argparse
import sys

from wam_cli.options import PAGE, bounded, configuration_of, take_configuration
from wam_sim.progress import Progress
from wam_studies.faults.soak import soak
from wam_studies.page import with_section


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument(
        "--seconds", type=bounded(float, 2.0, unit="s"), default=600.0, help="of the arm's time, default 600"
    )
    parser.add_argument("--write", type=PAGE, help="page to update, for example docs/safety.md")
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Run; 1 if memory grows or messages are lost."""
    found = soak(configuration_of(given), given.seconds, Progress("soak, seconds", sys.stderr))
    text = found.section(f"wam evaluate soak --seconds {given.seconds:g}")
    print(text)
    if given.write:
        given.write.write_text(with_section(given.write, "soak", text, "What was tried"), encoding="utf-8")
    for reason in found.missed:
        print(reason, file=sys.stderr)
    return 1 if found.missed else 0
