"""`wam view`: a recording in the browser, or in the Rerun viewer."""

import argparse
from pathlib import Path

from wam_analysis.findings.analysed_run import AnalysedRun, analysed_run
from wam_analysis.rerun_view import load_rerun, view, viewer
from wam_bag.bag import read
from wam_cli.commands import RERUN, take_arm, take_port, writable_file
from wam_live.page import free_port, needing_viser
from wam_ros.process_signals import Stop


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("bag", type=Path, help="directory of the bag, or its .mcap file")
    take_port(parser)
    take_arm(parser)
    parser.add_argument("--at", type=float, metavar="SECONDS", help="show this time and do not play")
    parser.add_argument("--rerun", action="store_true", help="open the Rerun viewer instead of the page")
    parser.add_argument("--save", type=Path, metavar="FILE", help="write this .rrd file for Rerun and open nothing")
    parser.epilog = "The page needs viser, pip install 'wam_stack[live]'; Rerun needs 'wam_stack[view]'."


def run(given: argparse.Namespace) -> int:
    """Show the bag."""
    if given.save or given.rerun:
        load_rerun()  # before the work
        if given.save:
            writable_file("--save", given.save, RERUN)
        else:
            viewer()
        recording = _recording(given)
        print(f"{given.save or 'viewer'}: {view(recording, given.save)}")
        return 0
    with needing_viser():
        from wam_live.playback import play
    stop = Stop()
    port = free_port(given.port, lambda line: print(line, flush=True))
    play(_recording(given), port, given.at, lambda: stop.is_set, lambda line: print(line, flush=True))
    return 0


def _recording(given: argparse.Namespace) -> AnalysedRun:
    """The run of the arm; of several, it is named."""
    recording = analysed_run(read(given.bag), given.namespace or "")
    if recording.run.others:
        print(recording.run.others, flush=True)
    return recording
