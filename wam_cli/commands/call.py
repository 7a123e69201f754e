"""`wam call`: one service of a running stack, called."""

import argparse
import sys

from wam_cli.commands import namespace
from wam_ros.call import call

REQUESTS = {  # node, service, and the value where it is a switch
    "enable": ("driver", "enable", True),
    "disable": ("driver", "enable", False),
    "estop": ("driver", "estop", None),
    "reset_fault": ("driver", "reset_fault", None),
    "reset": ("driver", "reset", None),
    "tare": ("force_loop", "tare", None),
}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("request", choices=tuple(REQUESTS))
    parser.add_argument("--namespace", type=namespace, default="wam", help="namespace of the stack; default: wam")


def run(given: argparse.Namespace) -> int:
    """Call the service and print its answer."""
    node, service, switch = REQUESTS[given.request]
    answer = call(f"/{given.namespace}/{node}/{service}", switch)
    print(answer.message, file=sys.stdout if answer.success else sys.stderr)
    return 0 if answer.success else 1
