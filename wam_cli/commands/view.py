"""`wam view`: a recording in the Rerun viewer."""

import argparse
from pathlib import Path

from wam_analysis.findings.analysed_run import analysed_run
from wam_analysis.rerun_view import load_rerun, view, viewer
from wam_bag.bag import read
from wam_cli.commands import writable_file


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("bag", type=Path, help="directory of the bag, or its .mcap file")
    parser.add_argument("--save", type=Path, metavar="FILE", help="write this .rrd file and do not open the viewer")
    parser.epilog = "Needs Rerun: pip install 'wam_stack[view]'."


def run(given: argparse.Namespace) -> int:
    """Log the bag."""
    load_rerun()  # before the work
    if given.save:
        writable_file("--save", given.save)
    else:
        viewer()
    said = view(analysed_run(read(given.bag)), given.save)
    print(f"{given.save or 'viewer'}: {said}")
    return 0
