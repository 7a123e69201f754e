"""The command `wam`: everything of the stack that is started from a shell."""

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Sequence
from typing import Any

from wam_description.parameters import ParameterError

# each command is the module of its name in wam_ros.commands, imported only when it is called
COMMANDS = {
    "demo": "play the demonstration, record it, say how well it went",
    "up": "start the nodes and leave them running until Ctrl-C",
    "node": "start one node by hand, with ROS arguments if need be",
    "call": "ask a running stack: enable, disable, estop, reset_fault, reset, tare",
    "record": "record every topic of a running stack until Ctrl-C",
    "bag": "say what is in a bag, or make a broken one whole",
    "report": "say what a recording of the demonstration shows",
    "analyse": "say what any recording shows, measured beside predicted; page and JSON",
    "view": "look at a recording in the Rerun viewer, or save it for it",
    "replay": "run a node's recorded inputs through it again, compare what comes out",
    "experiment": "run an experiment of the thesis, record it, print predicted against measured",
    "samples": "check the small bags in bags/sample, one of each experiment, or make them anew",
    "figures": "draw the figures of chapters 3 to 6 with the plant's points on them",
    "map": "compute the stability map of figure 5.8: the largest stable step over gamma and zeta",
    "scorecard": "print the arm beside the requisites of chapter 3",
    "plant": "draw the plant's effects beside the theory, print the differences",
    "guard": "hold the stability guard's verdicts against simulation of random sets",
    "evaluate": "judge a part of the stack by a seeded battery: contact",
    "model": "write the arm's model",
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exits with 0 where all went well."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    command: Any = importlib.import_module(f"wam_ros.commands.{words[0]}") if words and words[0] in COMMANDS else None
    parser = _parser(command)
    given, rest = parser.parse_known_args(words)
    if rest and not getattr(command, "TAKES_ROS_ARGUMENTS", False):
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    given.ros = rest
    before = signal.signal(signal.SIGTERM, _end)  # what runs gets to clean up; nodes have a way of their own
    try:
        code = command.run(given)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # whoever read has had enough: `wam ... | head`
        code = 128 + signal.SIGPIPE
    except (ParameterError, ValueError, OSError) as error:
        parser.exit(1, f"wam {given.command}: {error}{_hint(error, given.command)}\n")
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    finally:
        signal.signal(signal.SIGTERM, before)
    sys.exit(code or 0)


def _end(number: int, frame: object) -> None:
    sys.exit(128 + number)


def _hint(error: Exception, command: str) -> str:
    """What to do about an error of the system that does not say it itself."""
    if not isinstance(error, PermissionError) or error.filename is None:
        return ""
    return (
        f"; run it in a directory that you may write into, or name another place: 'wam {command} --help' says by which "
        "option"
    )


def _parser(command: Any) -> argparse.ArgumentParser:
    """All commands with their texts; the arguments only of the one that is called."""
    parser = argparse.ArgumentParser(
        prog="wam",
        description="Force control of the cable-driven MIT/WAM arm, simulated down to its motor shafts.",
        epilog="Start with: wam demo.  With ROS 2 sourced, 'ros2 run wam_stack <node>' works as well.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, text in COMMANDS.items():
        own = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if command is not None and command.__name__.endswith(f".{name}"):
            command.arguments(own)
    return parser


if __name__ == "__main__":
    main()
