"""`wam up`: the nodes, until Ctrl-C."""

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from wam_bag.bag_name import dated
from wam_cli.commands.live import page_next_to
from wam_cli.options import (
    filled,
    processes_of,
    take_configuration,
    take_page,
    take_stack,
    take_time,
    timed,
)
from wam_control.task.scenario import load_for
from wam_description.configuration import Configuration
from wam_description.interface import declared
from wam_description.nodes import ONE
from wam_ros.bring_up import Processes, process_of, require_start, run_together
from wam_ros.process_signals import Stop, end_at_once_on_signals
from wam_ros.run import die_with_parent


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam up` to its parser."""
    take_time(parser)
    parser.add_argument("--scenario", type=filled, help="play this scenario: a YAML file, or demo_scenario")
    parser.add_argument("--record", action="store_true", help="record every topic")
    take_stack(parser)
    parser.add_argument(
        "--log-level",
        choices=("debug", "info", "warn", "error", "fatal"),
        default="info",
        help="lowest severity of the messages that the nodes print; default: %(default)s",
    )
    take_page(parser, default=False)
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Start the nodes and wait for the first to end."""
    die_with_parent()
    end_at_once_on_signals()  # there is nothing to clean up yet
    configuration = timed(given)
    extra = ["scenario"] * bool(given.scenario) + ["recorder"] * given.record
    configuration = configuration.with_nodes(*extra)
    if given.record:
        own = configuration.sections["recorder"]
        name = own["name"] or dated(configuration.shared.arm.name)
        bag = Path(str(own["directory"])) / str(name)
        configuration = configuration.with_values({"recorder:name": name})
    if given.scenario:
        configuration = configuration.with_values({"scenario:script": given.scenario})
        steps = load_for(configuration, given.scenario)  # refused before any node starts
        pushing = next((step.name for step in steps if step.push), "")
        if pushing and not configuration.shared.is_simulated:
            raise ValueError(
                f"{given.scenario}: step '{pushing}' has a push, but the driver of this arm cannot push; leave out the "
                "key push (a real arm can be pushed by hand)"
            )
    ended = run_nodes(configuration, given, Stop(), f"{len(configuration.shared.nodes)} nodes in")
    is_played = False
    for process, code in ended.codes.items():
        is_scenario = "scenario" in process.split(", ")
        is_played |= is_scenario
        who = "the scenario" if is_scenario else process_of(process)
        print(f"{who} has {'failed' if code else 'ended'}, so all nodes were stopped")
    if given.scenario and is_played and not any(ended.codes.values()):
        seen = f"wam analyse {shlex.quote(str(bag))} --steps" if given.record else "play it with --record"
        print(f"to see whether its commands were carried out: {seen}")
    if ended.failure:
        print(f"error: {ended.failure}", file=sys.stderr)
    return max(map(abs, ended.codes.values()), default=0) or int(bool(ended.killed or ended.failure))


class Ended(NamedTuple):
    """How the nodes ended: exit codes by process, unless they were stopped, and why not as they should."""

    codes: Mapping[str, int]
    failure: str  # of the last node, or of the recording
    failures: Sequence[str] = ()  # printed before, where the nodes are several processes
    killed: Sequence[str] = ()


def run_nodes(configuration: Configuration, given: argparse.Namespace, stop: Stop, started: str = "") -> Ended:
    """Run the nodes, and a page next to them, until the first ends.

    Parameters
    ----------
    given : options of `take_time` and `take_page`, namespace and log level.
    started : printed before the names of the processes; '' for nothing.
    """
    processes = processes_of(configuration, given)
    with page_next_to(given, lambda: stop.is_set) as close_page:
        if processes == ONE:
            require_start(configuration, given.namespace)
            if started:
                print(f"{started} this process; Ctrl-C stops them", flush=True)
            nodes = configuration.shared.nodes
            failure = run_together(configuration, nodes, given.namespace, given.log_level, stop, close_page)
            names = ", ".join(declared(entry).name for entry in nodes)
            return Ended({} if stop.is_set else {names: int(bool(failure))}, failure)
        with Processes(configuration, given.namespace, given.log_level, processes) as stack:
            if started and not stop.is_set:
                each = stack.processes
                print(f"{started} {len(each)} processes ({'; '.join(each)}); Ctrl-C stops them", flush=True)
            codes = stack.wait(lambda ended: stop.is_set or bool(ended))
            failures = stack.failures
            for failure in failures:  # before the others end and print what follows from it
                print(f"error: {failure}; the other nodes are stopped now", file=sys.stderr, flush=True)
            close_page()
        return Ended(codes, stack.bag_failure, failures, stack.killed)
