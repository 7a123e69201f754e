"""`wam demo`: the demonstration from start to report."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from wam_bag.errors import BagError
from wam_cli.commands import configuration_of, take_configuration, writable_directory
from wam_cli.commands.live import page_beside, take_page
from wam_cli.commands.up import import_nodes, runs_apart, take_time, timed
from wam_ros.bring_up import start
from wam_ros.network import move_to_free_domain
from wam_ros.program import end_at_once_on_signals
from wam_ros.run import NAMESPACE, Stop

LONGEST_START = 120.0  # s, until all nodes are connected, on a machine that is busy


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    take_time(parser)
    parser.add_argument("--name", default="", help="name of the bag; default: demo, date and time")
    take_page(parser, default=None)
    take_configuration(parser)


def run(given: argparse.Namespace) -> int:
    """Play, record, report."""
    base = timed(configuration_of(given), given)
    name = given.name or f"demo_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
    configuration = base.with_values({"nodes": [*base.shared.nodes, "scenario", "recorder"], "recorder:name": name})
    directory = Path(str(configuration.sections["recorder"]["directory"]))
    writable_directory("recorder:directory in the file of --config, or run it elsewhere", directory)
    bag = directory / name
    end_at_once_on_signals()
    import_nodes(configuration, given)
    stop = Stop()
    if moved := move_to_free_domain(NAMESPACE):
        print(moved, flush=True)
    late = time.monotonic() + LONGEST_START
    with (
        page_beside(given, NAMESPACE) as close_page,
        start(configuration, runs_apart(configuration, given), lambda: stop.is_set) as stack,
    ):
        driver: Any = getattr(stack, "nodes", {}).get("driver")

        def is_over(ended: dict[str, int]) -> bool:
            return stop.is_set or bool(ended) or (time.monotonic() > late and bool(getattr(driver, "awaited", "")))

        ended = stack.wait(is_over)
        failures = stack.failures
        if not ended and not stop.is_set:
            failures = [f"not ready within {LONGEST_START:g} s: {driver.awaited}"]
        close_page()
    if stack.bag_failure:
        failures = [*failures, stack.bag_failure]
    if stop.is_set:
        print(f"stopped; what was recorded until then is in {bag}" if bag.exists() else "stopped before anything moved")
        return 130
    end_at_once_on_signals()  # the bag is closed
    told = _report(bag, bool(failures))
    if failures:
        print(f"the demonstration failed: {', '.join(failures)}", file=sys.stderr)
        print(f"next: {_next(configuration.shared.timing.mode, bag if told else None)}", file=sys.stderr)
        return 1
    return 0


def _report(bag: Path, failed: bool) -> bool:
    """Print the report; of a demonstration that failed, as far as there is one."""
    from wam_analysis.demo_report import report  # imports matplotlib: not before the nodes

    try:
        print(report(bag), flush=True)
    except (BagError, OSError) as error:
        if not failed:
            raise
        print(f"no report: {error}", file=sys.stderr)
        return False
    return True


def _next(mode: str, bag: Path | None) -> str:
    """What the user can do after a failure."""
    if mode == "realtime":
        return "wam demo    # without --realtime: lockstep waits for a busy machine"
    if bag:
        return f"wam analyse {bag}"
    return "end what else runs in this ROS domain, or set another ROS_DOMAIN_ID; then wam demo"
