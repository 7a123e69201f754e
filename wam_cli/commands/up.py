"""`wam up`: the nodes, until Ctrl-C."""

import argparse
import sys

from wam_cli.commands import configuration_of, take_configuration
from wam_ros.bring_up import Processes
from wam_ros.run import Stop


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--mode", choices=("realtime", "lockstep"), help="timing, instead of that of the configuration")
    parser.add_argument("--scenario", default="", help="play this scenario: a YAML file, or demo_scenario")
    parser.add_argument("--record", action="store_true", help="record every topic")
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Start the processes and wait for the first to end."""
    stop = Stop()
    configuration = configuration_of(given)
    extra = ["scenario"] * bool(given.scenario) + ["recorder"] * given.record
    configuration = configuration.with_values({"nodes": [*configuration.shared.nodes, *extra]})
    if given.mode:
        configuration = configuration.with_values({"timing.mode": given.mode})
    if given.scenario:
        configuration = configuration.with_values({"scenario:script": given.scenario})
    with Processes(configuration) as processes:
        print(f"{len(configuration.shared.nodes)} nodes started; Ctrl-C stops them", flush=True)
        ended = processes.wait(lambda ended: stop.is_set or bool(ended))
    for node, code in ended.items():
        print(f"node {node} ended with code {code}; all were stopped", file=sys.stderr)
    return max([abs(code) for code in ended.values()], default=0) or int(bool(processes.killed))
