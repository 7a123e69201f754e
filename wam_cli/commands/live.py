"""`wam live`: a running stack or a recording in the browser; and a running stack for other programs of ROS."""

import argparse
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

from wam_cli.options import ARM, namespace, take_port
from wam_description.arm import Shared
from wam_description.parameters import build_part
from wam_live.page import NoPageError, free_port, needing_viser, obstacle, port_is_free, url
from wam_ros.priority import set_priority
from wam_ros.process_signals import Stop, end_at_once_on_signals

PATIENCE: Final = 1.0  # s, in which a page ends by itself
LATE: Final = 30.0  # s, for which a stack waits for its page
NICENESS: Final = 15  # of a page next to a stack: drawing waits, where the nodes would
NEEDS = (
    "The page needs viser: pip install 'wam_stack[live]'. It can be opened on this computer only. "
    "--trajectories needs control_msgs, from a ROS installation."
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam live` to its parser."""
    parser.add_argument("bag", nargs="?", type=Path, help="show this recording instead of a running stack")
    where = "namespace of the stack, default: wam; or of the arm in the bag, default: the one with most topics"
    parser.add_argument("--namespace", type=namespace, help=where)
    take_port(parser)
    parser.add_argument(
        "--trajectories",
        action="store_true",
        help="instead of a page, serve the action FollowJointTrajectory, for example for MoveIt",
    )
    parser.epilog = NEEDS


def run(given: argparse.Namespace) -> int:
    """Show a running stack or a bag in the browser until Ctrl-C."""
    if given.bag is not None and given.trajectories:
        raise ValueError("--trajectories is for a running stack; leave out the bag")
    end_at_once_on_signals()  # an exception amid the imports would be swallowed by one of the libraries
    if given.bag is not None:
        return _recording(given)
    from wam_ros.run import die_with_parent  # a recording is shown without ROS

    given.namespace = given.namespace or ARM
    die_with_parent()
    if given.trajectories:
        _trajectories(given)
    else:
        _page(given)
    return 0


def _page(given: argparse.Namespace) -> None:
    from wam_ros.run import PARENT

    with needing_viser():
        from wam_live.live_page import LivePage
    stop = Stop()
    page = LivePage(given.namespace, free_port(given.port, _print), _print)
    if PARENT in os.environ:  # from now on the stack comes first
        set_priority(0, NICENESS)
    page.run(lambda: stop.is_set)


def _trajectories(given: argparse.Namespace) -> None:
    from wam_live.trajectory_action import TrajectoryServer
    from wam_ros.client import StackClient

    stop = Stop()
    with StackClient(given.namespace, "trajectory_action") as client:
        if found := client.await_driver(lambda: stop.is_set):
            client.shared = build_part(Shared, found["driver"])
            with TrajectoryServer(client, _print):
                while not stop.is_set:
                    client.spin_once(0.1)


def _recording(given: argparse.Namespace) -> int:
    """Play a recording in the browser."""
    with needing_viser():
        from wam_live.playback import play
    port = free_port(given.port, _print)
    from wam_analysis.recording import AnalysedRecording
    from wam_bag.bag import read

    found = AnalysedRecording(read(given.bag), given.namespace or "")
    if found.run.others:  # of several arms in a bag, this one is named
        _print(found.run.others)
    stop = Stop()
    play(found, port, lambda: stop.is_set, _print)
    return 0


@contextmanager
def page_next_to(given: argparse.Namespace, is_stopped: Callable[[], bool]) -> Iterator[Callable[[], None]]:
    """The page of a stack that is about to start, as its options set it; yields what ends it.

    It waits until the page can be opened.  End the page before the stack, which at its end waits for its listeners.

    Parameters
    ----------
    given : options of `take_page`, and the namespace of the stack.
    is_stopped : whether to wait no longer.

    Raises
    ------
    NoPageError
        if a page is required and there can be none.
    """
    with ExitStack() as ending:
        if given.live is not False:
            _start_page(given, is_stopped, ending)
        yield ending.close


def _start_page(given: argparse.Namespace, is_stopped: Callable[[], bool], ending: ExitStack) -> None:
    port = free_port(given.port, _print)
    if reason := obstacle(port):
        if given.live:
            raise NoPageError(reason)
        _print(f"no live page: {reason}")
        return
    from wam_ros.bring_up import CommandProcess

    # a process of its own can neither delay nor fail the stack
    page = CommandProcess(["live", "--port", str(port), "--namespace", given.namespace], stdin=subprocess.DEVNULL)
    ending.callback(_end, page)
    late = time.monotonic() + LATE
    while page.poll() is None and port_is_free(port) and not is_stopped():
        if time.monotonic() > late:
            _print(f"the live page is still starting; it will be at {url(port)}")
            return
        time.sleep(0.05)


def _end(page: Any) -> None:
    """End the process of a page; report one that has ended before."""
    if page.poll() is not None:
        _print("the live page ended too early; it printed the reason above")
    else:
        page.close(PATIENCE)


def _print(line: str) -> None:
    print(line, flush=True)
