"""How `wam demo` plays: with ROS nodes, or without ROS as a simulation in this process."""

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

from wam_cli.commands import is_paced, processes_of
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration
from wam_description.nodes import ONE
from wam_ros.process_signals import Stop, end_at_once_on_signals
from wam_sim.simulated_bag import record

PLAIN_LOG = "[{severity}] [{name}]: {message}"  # of ROS, without the wall clock
LONGEST_START = 120.0  # s, until all nodes are connected, on a machine that is busy
WITHOUT_ROS = (
    "ROS is not installed (no rclpy): the same nodes run in this process, with the same numbers, without topics and "
    "live page; for those: pip install 'wam_stack[ros,live]'"
)


class PlayedDemo(NamedTuple):
    """How it ended: why it failed, if it did, and whether somebody stopped it."""

    failures: list[str]
    stopped: bool


def play(configuration: Configuration, steps: list[ScenarioStep], bag: Path, given: argparse.Namespace) -> PlayedDemo:
    """Play the scenario of a configuration and record it into a bag.

    Raises
    ------
    ValueError
        if an option needs the nodes and there is no ROS.
    """
    end_at_once_on_signals()
    try:
        import rclpy  # noqa: F401 - whether there is ROS
    except ModuleNotFoundError:
        return _simulated(configuration, steps, bag, given)
    return _with_nodes(configuration, given)


def _simulated(
    configuration: Configuration, steps: list[ScenarioStep], bag: Path, given: argparse.Namespace
) -> PlayedDemo:
    if processes_of(configuration, given) != ONE or given.live:
        option = "--live" if given.live else "--processes" if given.processes else "--realtime"
        raise ValueError(f"{option} needs ROS; pip install 'wam_stack[ros,live]', or leave it out")
    print(WITHOUT_ROS, flush=True)
    stop = Stop()
    failure = record(configuration, steps, bag, report=_stated, is_stopped=lambda: stop.is_set)
    if failure:
        print(f"error: {failure}", file=sys.stderr, flush=True)
    return PlayedDemo([failure] if failure else [], stop.is_set)


def _stated(seconds: float, step: str) -> None:
    print(f"{seconds:5.1f} s  {step}", flush=True)


def _with_nodes(configuration: Configuration, given: argparse.Namespace) -> PlayedDemo:
    from wam_cli.commands.live import page_next_to
    from wam_cli.commands.up import import_nodes
    from wam_ros.bring_up import start
    from wam_ros.network import move_to_free_domain
    from wam_ros.topics import NAMESPACE

    os.environ.setdefault("RCUTILS_CONSOLE_OUTPUT_FORMAT", PLAIN_LOG)
    import_nodes(configuration, given)
    stop = Stop()
    if moved := move_to_free_domain(NAMESPACE, os.environ):
        print(moved, flush=True)
    late = time.monotonic() + LONGEST_START
    with (
        page_next_to(given, NAMESPACE, is_paced(configuration)) as close_page,
        start(configuration, processes_of(configuration, given), lambda: stop.is_set) as stack,
    ):
        driver: Any = getattr(stack, "nodes", {}).get("driver")

        def is_over(ended: dict[str, int]) -> bool:
            return stop.is_set or bool(ended) or (time.monotonic() > late and bool(getattr(driver, "awaited", "")))

        ended = stack.wait(is_over)
        failures = stack.failures
        if not ended and not stop.is_set:
            failures = [f"not ready within {LONGEST_START:g} s: {driver.awaited}"]
        for failure in failures:  # before the others end and print what follows from it
            print(f"error: {failure}; all others are stopped now", file=sys.stderr, flush=True)
        close_page()
    return PlayedDemo([*failures, *([stack.bag_failure] if stack.bag_failure else [])], stop.is_set)
