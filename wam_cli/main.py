"""The command line `wam` and the table of its commands."""

import argparse
import contextlib
import difflib
import importlib
import importlib.util
import os
import signal
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any, TextIO

from wam_bag.printable import printable
from wam_description.nodes import installation
from wam_ros.process_signals import SIGNALS, end_at_once_on_signals, ignore_signals

# each command is the module of its name in wam_cli.commands, imported when it is called
COMMANDS = {
    "demo": "play the demonstration or a task, record it, print its report",
    "up": "start the nodes and run them until Ctrl-C",
    "node": "start nodes in one process, with ROS arguments if needed",
    "call": "make a request to a running stack, such as enable or set",
    "live": "show a running stack or a recording in the browser",
    "bag": "record a running stack; print what is in a bag, or repair it",
    "analyse": "analyse a recording and compare it with theory",
    "identify": "identify friction, gravity and inertia from a recording",
    "replay": "run a node on its recorded inputs, compare its outputs",
    "experiment": "run experiments of the thesis and compare them with theory",
    "sweep": "play a scenario with many parameter sets; write table and plot",
    "evaluate": "run a benchmark, such as contact or force; draw the figures",
    "guard": "check whether a force loop is stable, and with what margin",
    "conform": "test whether a driver does what docs/driver.md requires",
    "model": "print the arm as URDF or MJCF, or compare it with the thesis",
}

COMPLETING = "_ARGCOMPLETE"  # set by a shell that asks how a line may go on
# the extras of setup.py, and the modules that come with them
EXTRAS = {
    "ros": (
        "rclpy", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "rcl_interfaces", "rosgraph_msgs",
        "sensor_msgs", "std_msgs", "std_srvs", "visualization_msgs",
    ),
    "live": ("viser",),
    "dask": ("distributed", "dask"),
    "completion": ("argcomplete",),
}  # fmt: skip


class CommandParser(argparse.ArgumentParser):
    """Options of a command; of a word that is none of the choices, the one that was meant is named."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        near = difflib.get_close_matches(str(value), map(str, action.choices or ()), n=1)
        if near and value not in (action.choices or ()):
            raise argparse.ArgumentError(action, f"there is no '{value}'; did you mean '{near[0]}'?")
        super()._check_value(action, value)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exits with 0 on success."""
    if COMPLETING in os.environ:
        _complete()
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        command = _command(words)
        parser = _parser(command)
    except ModuleNotFoundError as error:
        sys.exit(_missing(words[0], error))
    except ImportError as error:
        sys.exit(f"wam {words[0]}: {error}; install what is missing by the package manager of the system")
    if not words:
        parser.print_help()
        sys.exit(0)
    given, rest = parser.parse_known_args(words)
    if rest and not getattr(command, "TAKES_ROS_ARGUMENTS", False):
        given.parser.error(f"unrecognized arguments: {' '.join(rest)}")
    given.ros = rest
    received: list[int] = []

    def interrupt(number: int, frame: object) -> None:
        received.append(number)
        ignore_signals()  # another one would interrupt the clean-up, with locks that nobody releases then
        raise KeyboardInterrupt

    # a signal raises an exception, so that the command cleans up; commands that run nodes handle signals themselves
    before = {number: signal.signal(number, interrupt) for number in SIGNALS}
    try:
        with contextlib.redirect_stdout(_Printable(sys.stdout)):
            code = command.run(given)
        sys.stdout.flush()
    except BaseException as error:
        # the exception may have become another one: that of a module in C whose import was interrupted
        code = 128 + received[0] if received else _ended_by(error, given.command, parser)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    sys.exit(code or 0)


def _ended_by(error: BaseException, command: str, parser: argparse.ArgumentParser) -> int:
    """The exit code of a command that an error ended; prints what the user can do, or raises it again."""
    if isinstance(error, BrokenPipeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the pipe was closed: `wam ... | head`
        return 128 + signal.SIGPIPE
    if isinstance(error, KeyboardInterrupt):  # of a process that computes
        return 128 + signal.SIGINT
    if isinstance(error, ModuleNotFoundError):
        return _missing(command, error)
    if isinstance(error, ValueError | OSError | argparse.ArgumentTypeError):
        from wam_bag.errors import BagError

        parser.exit(
            1 + (isinstance(error, BagError) or command == "analyse"),  # its 1 is of the recorded run
            printable(f"wam {command}: {error}{_hint(error, command)}", kept="\n") + "\n",
        )
    raise error


def _complete() -> None:
    """Answer a shell that asks how a line may go on, and end."""
    import argcomplete

    argcomplete.autocomplete(_parser(_command(os.environ.get("COMP_LINE", "").split()[1:])))


class _Printable:
    """Standard output on which control characters, as those in a topic's name of a bag, are shown and not sent."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text."""
        self._stream.write(printable(text, kept="\n\t\r"))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def program() -> None:
    """Run the command line as this process, which no signal ends with a traceback."""
    end_at_once_on_signals()
    try:
        main()
    finally:
        ignore_signals()


def _command(words: list[str]) -> Any:
    """The module of the command that is called, if there is one."""
    if not words or words[0] not in COMMANDS:
        return None
    return importlib.import_module(f"wam_cli.commands.{words[0]}")


def _missing(command: str, error: ModuleNotFoundError) -> int:
    """Print how to install a module that is missing; raise the error for one of the stack or of Python itself."""
    module = (error.name or "").partition(".")[0]
    ways = {name: f"pip install 'wam_stack[{extra}]'" for extra, modules in EXTRAS.items() for name in modules}
    ways["control_msgs"] = "apt install ros-jazzy-control-msgs"  # of an installation of ROS alone
    if not module or module.startswith("wam_") or module in sys.stdlib_module_names:
        raise error
    needs = f"it needs '{module}', which is not installed; install it with: {ways.get(module) or installation(module)}"
    sys.stderr.write(f"wam {command}: {needs}\n")
    return 1


def _version() -> str:
    """The version that is installed, and how the inner loop is that runs."""
    build = "compiled" if importlib.util.find_spec("wam_driver.fast_steps") else "plain Python"
    try:
        found = version("wam_stack")
    except PackageNotFoundError:
        found = "not installed"
    return f"{found}, inner loop: {build}"


def _hint(error: Exception, command: str) -> str:
    """What the user can do about an error of the system."""
    if not isinstance(error, PermissionError) or error.filename is None:
        return ""
    return f"; run it in a directory that you may write into, or choose one: 'wam {command} --help' lists the options"


def _parser(command: Any) -> argparse.ArgumentParser:
    """All commands with their texts; options only of the one that is called."""
    parser = CommandParser(
        prog="wam",
        description="Force control of the cable-driven MIT/WAM arm, simulated down to its motor shafts.",
        epilog="Start with: wam demo.  With ROS 2 sourced, 'ros2 run wam_stack <node>' starts a single node.",
    )
    parser.add_argument("--version", action="version", version=f"wam_stack {_version()}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, text in COMMANDS.items():
        # an abbreviation would be another option: --name is none of `wam up`, and --namespace is
        own = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False)
        if command is not None and command.__name__.endswith(f".{name}"):
            command.arguments(own)
            own.set_defaults(parser=own)
    return parser


if __name__ == "__main__":
    program()
