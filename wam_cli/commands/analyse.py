"""`wam analyse`: a recording, measured and compared with theory."""

import argparse
import sys
import time
from pathlib import Path

from wam_analysis.findings.analysis import analyse, analyse_steps
from wam_analysis.findings.text import json_text, text
from wam_cli.options import HTML, JSON, exit_code_of, take_arm, take_topic_map, topic_map_of

STANDARD_OUTPUT = Path("-")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam analyse` to its parser."""
    parser.add_argument(
        "bag", type=Path, help="directory of a bag, or a file: .mcap, .csv; with the package rosbags also .bag, .db3"
    )
    parser.add_argument(
        "--html", type=HTML, metavar="FILE", help="also write one HTML page with pictures; it needs no network"
    )
    parser.add_argument(
        "--json", type=_json, metavar="FILE", help="also write the numbers as JSON; '-' prints JSON instead of the text"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress output")
    parser.add_argument(
        "--steps",
        action="store_true",
        help="print, as 'wam demo', whether each command was carried out; exit code 1 if a result is NO or the run "
        "failed",
    )
    take_arm(parser)
    take_topic_map(parser)


def _json(text: str) -> Path:
    return STANDARD_OUTPUT if text == str(STANDARD_OUTPUT) else JSON(text)


def run(given: argparse.Namespace) -> int:
    """Analyse a recording, print the result and write the requested files."""
    if given.steps:
        return _steps(given)
    mapped = topic_map_of(given)
    begin = time.monotonic()

    def progress(doing: str) -> None:
        if not given.quiet:
            print(f"{time.monotonic() - begin:5.1f} s  {doing}", file=sys.stderr, flush=True)

    analysis = analyse(given.bag, progress, mapped, given.namespace or "")
    if given.json == STANDARD_OUTPUT:
        print(json_text(analysis))
    else:
        print(text(analysis))
        if given.json:
            given.json.write_text(json_text(analysis) + "\n", encoding="utf-8")
            progress(f"wrote {given.json}")
    if given.html:
        from wam_analysis.findings.page import page  # it imports matplotlib

        progress("drawing")
        given.html.write_text(page(analysis), encoding="utf-8")
        progress(f"wrote {given.html}")
    return int(bool(analysis.recording.failure))


def _steps(given: argparse.Namespace) -> int:
    """Print the report of the demonstration again."""
    if given.html or given.json:
        raise ValueError("--steps prints only text; leave out --html and --json")
    found = analyse_steps(given.bag, given.namespace or "")
    print(text(found))
    return exit_code_of(found.unmet)
