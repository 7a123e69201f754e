"""`wam evaluate faults`: wrong messages, lost nodes, full disks, Ctrl-C."""

import argparse
import logging
import os
import sys
import time
from pathlib import Path

from wam_cli.options import COUNT, PAGE, SEED, bounded, configuration_of, take_configuration
from wam_sim.progress import Progress
from wam_studies.faults import interruptions
from wam_studies.faults.kinds import REPLAYED, kinds
from wam_studies.faults.page import INTERRUPTIONS, faults_section, report
from wam_studies.faults.trials import FaultKind, KindResult, played
from wam_studies.page import section_of, with_section


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    names = list(kinds(Path("/")))
    parser.add_argument("--only", nargs="+", choices=names, metavar="KIND", help=f"some kinds: {', '.join(names)}")
    parser.add_argument("--seed", type=SEED, default=1, help="seed of all trials, default 1")
    parser.add_argument("--first", type=bounded(int), default=0, help="number of the first trial, default 0")
    parser.add_argument("--count", type=COUNT, help="trials of each kind; default: those of the page")
    parser.add_argument("--short", action="store_true", help="a few trials of each kind, half a minute")
    parser.add_argument("--bag", type=Path, default=REPLAYED, help="recording that is replayed, default %(default)s")
    parser.add_argument(
        "--ctrl-c", type=COUNT, metavar="COUNT", help="instead: interrupt so many demonstrations at random moments"
    )
    parser.add_argument("--write", type=PAGE, help="page to update, for example docs/safety.md")
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Play the trials; 1 if any escaped."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")  # nothing broken leaves this machine
    logging.getLogger().setLevel(logging.ERROR)
    results = list(_interrupted(given) if given.ctrl_c is not None else _played(given))
    print(report(results))
    if given.write:
        section = "faults" if given.ctrl_c is None else "interruptions"
        command = f"wam evaluate faults --write {given.write}"
        if given.ctrl_c is not None:
            command += f" --ctrl-c {given.ctrl_c}"
        text = faults_section(results, command, section_of(given.write, section))
        given.write.write_text(with_section(given.write, section, text, "What was tried"), encoding="utf-8")
    return 1 if any(result.escaped for result in results) else 0


def _played(given: argparse.Namespace) -> list[KindResult]:
    configuration = configuration_of(given)
    results = []
    for name, kind in kinds(given.bag).items():
        count = given.count or (kind.short if given.short else kind.full)
        if (given.only and name not in given.only) or not count:
            continue
        progress = Progress(name, sys.stderr)
        results.append(played(kind, configuration, given.seed, given.first, count, time.monotonic, progress))
    return results


def _interrupted(given: argparse.Namespace) -> list[KindResult]:
    kind = FaultKind(
        INTERRUPTIONS,
        "Ctrl-C during `wam demo`",
        "interruptions",
        100,
        0,
        lambda configuration, seed, first, count: interruptions.play(seed, first, count),
    )
    progress = Progress(kind.name, sys.stderr)
    return [played(kind, configuration_of(given), given.seed, given.first, given.ctrl_c, time.monotonic, progress)]
