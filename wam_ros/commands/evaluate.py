"""`wam evaluate`: judge a part of the stack by a battery of its own."""

import argparse
import os
import sys
from pathlib import Path

from wam_analysis.contact_battery import Extent, Judgement, judge, scenes
from wam_analysis.contact_battery_page import missed, report
from wam_ros.commands import configuration_of, take_configuration

SEEDS = (1, 2, 3)
PARTS = ("contact",)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("part", choices=PARTS, help="contact: the estimation of contacts on the whole arm")
    parser.add_argument("--seed", type=int, nargs="+", default=list(SEEDS), help="seeds of the battery, default 1 2 3")
    parser.add_argument("--contacts", type=int, default=300, help="contacts in motion for each seed, default 300")
    parser.add_argument("--resting", type=int, default=40, help="contacts at rest for each seed, default 40")
    parser.add_argument("--free", type=float, default=120.0, help="seconds of motion without contact for each seed")
    parser.add_argument("--joint-sensors", action="store_true", help="feel with the joint sensors")
    parser.add_argument("--write", type=Path, help="page to write, for example docs/contact.md")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="at a time, default one a core")
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Judge; 1 where a must is missed."""
    configuration = configuration_of(given)
    arm = configuration.shared.arm
    extent = Extent(given.contacts, given.resting, given.free)
    drawn = {seed: scenes(configuration, seed, extent, given.joint_sensors) for seed in given.seed}
    judgement = Judgement(tuple(given.seed), {seed: [] for seed in given.seed})
    whole = sum(map(len, drawn.values()))
    for number, (seed, scored) in enumerate(judge(configuration, drawn, given.processes), 1):
        judgement.scores[seed].append(scored)
        if sys.stderr.isatty():
            print(f"\r{number} of {whole} scenes", end="" if number < whole else "\n", file=sys.stderr, flush=True)
    text = report(judgement, arm)
    print(text)
    if given.write:
        given.write.write_text(text, encoding="utf-8")
    short = missed(judgement, arm)
    if short:
        print(f"missed: {'; '.join(short)}", file=sys.stderr)
    return 1 if short else 0
