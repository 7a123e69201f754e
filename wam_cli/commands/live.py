"""`wam live`: the live page of a stack that runs, in a browser."""

import argparse

from wam_live.page import PORT
from wam_ros.run import NAMESPACE, Stop, die_with_parent


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--namespace", default=NAMESPACE, help="of the stack; default: %(default)s")
    parser.add_argument("--port", type=int, default=PORT, help="of the page on this machine; default: %(default)s")
    parser.epilog = "Needs viser: pip install 'wam_stack[live]'.  The page is reachable from this machine alone."


def run(given: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    from wam_live.live_node import LivePage

    die_with_parent()
    stop = Stop()
    page = LivePage(given.namespace.strip("/"), given.port, lambda line: print(line, flush=True))
    page.run(lambda: stop.is_set)
    return 0
