"""`wam demo`: the demonstration from start to report."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from wam_cli.commands import configuration_of, take_configuration, writable_directory
from wam_ros.bring_up import Composition, Processes
from wam_ros.network import move_to_free_domain
from wam_ros.run import NAMESPACE, Stop


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--lockstep", action="store_true", help="as fast as possible, with the same result every time")
    parser.add_argument("--name", default="", help="name of the bag; default: demo, date and time")
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Play, record, report."""
    stop = Stop()
    base = configuration_of(given)
    name = given.name or f"demo_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
    configuration = base.with_values(
        {
            "nodes": [*base.shared.nodes, "scenario", "recorder"],
            "timing.mode": "lockstep" if given.lockstep else "realtime",
            "recorder:name": name,
        }
    )
    directory = Path(str(configuration.sections["recorder"]["directory"]))
    writable_directory("recorder:directory in the file of --config, or run it elsewhere", directory)
    bag = directory / name
    if moved := move_to_free_domain(NAMESPACE):
        print(moved, flush=True)
    if given.lockstep:
        with Composition(configuration) as composition:
            scenario: Any = composition.nodes["scenario"]
            composition.spin(lambda: stop.is_set or scenario.done)
            failure = scenario.failure
    else:
        with Processes(configuration) as processes:
            ended = processes.wait(lambda ended: stop.is_set or bool(ended))
        failure = ", ".join(f"node {node} ended with code {code}" for node, code in ended.items() if code)
    if stop.is_set:
        print(f"stopped; what was recorded until then is in {bag}" if bag.exists() else "stopped before anything moved")
        return 130
    if failure:
        print(f"the demonstration failed: {failure}", file=sys.stderr)
        return 1
    from wam_analysis.demo_report import (
        report,
    )  # imports matplotlib: not before the nodes

    print(report(bag))
    return 0
