"""`wam live`: the live page of a stack that runs, in a browser; and the page of `wam up` and `wam demo`."""

import argparse
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from wam_cli.commands import namespace, take_port
from wam_live.page import NoPageError, free_port, needing_viser, obstacle, port_is_free, url
from wam_ros.priority import set_priority
from wam_ros.process_signals import Stop, end_at_once_on_signals
from wam_ros.run import PARENT, die_with_parent
from wam_ros.topics import NAMESPACE

PATIENCE: Final = 1.0  # s, in which a page ends by itself
LATE: Final = 5.0  # s, after which a page that is not there yet is reported
NICENESS: Final = 15  # of a page next to a stack: drawing waits, where the nodes would


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--namespace", type=namespace, default=NAMESPACE, help="of the stack; default: %(default)s")
    take_port(parser)
    parser.epilog = "Needs viser: pip install 'wam_stack[live]'.  The page is reachable from this machine alone."


@contextmanager
def page_next_to(given: argparse.Namespace, namespace: str, is_paced: bool = True) -> Iterator[Callable[[], None]]:
    """The page of a stack that is about to start, as its options set it; yields what ends it.

    It is to be ended before the stack, which at its end waits for its listeners.

    Parameters
    ----------
    given : options of `take_page`.
    namespace : of the stack.
    is_paced : whether the stack leaves the processor time to others, see `wam_cli.commands.is_paced`.

    Raises
    ------
    NoPageError
        if a page is required and there can be none.
    """
    if given.live is False:
        yield lambda: None
        return
    port = free_port(given.port, _print)
    reason = obstacle(port)
    if reason and given.live:
        raise NoPageError(reason)
    if reason:
        _print(f"no live page: {reason}")
        yield lambda: None
        return
    page = PageProcess(port, namespace)
    page.report_if_late(is_paced)
    try:
        yield page.close
    finally:
        page.close()


class PageProcess:
    """The page as a process of its own, which can neither delay nor fail the stack."""

    def __init__(self, port: int, namespace: str) -> None:
        command = [sys.executable, "-m", "wam_cli.program", "live", "--port", str(port), "--namespace", namespace]
        # a session of its own: Ctrl-C reaches the parent alone
        self._process = subprocess.Popen(
            command, start_new_session=True, stdin=subprocess.DEVNULL, env={**os.environ, PARENT: str(os.getpid())}
        )
        self._port = port
        self._report: threading.Timer | None = None

    def report_if_late(self, is_paced: bool) -> None:
        """Print a line if the page is not there after LATE; `is_paced` as in `page_next_to`."""

        def report() -> None:
            if self._process.poll() is None and (text := lateness(self._port, is_paced)):
                _print(text)

        self._report = threading.Timer(LATE, report)
        self._report.daemon = True
        self._report.start()

    def close(self) -> None:
        """End the page."""
        if self._report is not None:
            self._report.cancel()
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


def lateness(port: int, is_paced: bool) -> str:
    """That the page at a port of this machine is not there yet, and what helps; '' where it is."""
    if not port_is_free(port):
        return ""
    text = f"the live page is still starting, as the nodes come first; it will be at {url(port)}"
    return text if is_paced else f"{text}; the run may end before it: --real-time-factor 1 leaves it the time"


def run(given: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    end_at_once_on_signals()  # an exception amid the imports would be swallowed by one of the libraries
    if PARENT in os.environ:  # the stack comes first
        set_priority(0, NICENESS)
    die_with_parent()
    with needing_viser():
        from wam_live.live_page import LivePage
    stop = Stop()
    page = LivePage(given.namespace, free_port(given.port, _print), _print)
    page.run(lambda: stop.is_set)
    return 0


def _print(line: str) -> None:
    print(line, flush=True)
