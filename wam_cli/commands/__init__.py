"""The commands of `wam`, a module each: `arguments(parser)` and `run(given)`, which returns the exit code.

Here is what several of them take.
"""

import argparse
import math
import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import NamedTuple

from wam_analysis.foreign.topic_map import MAPPED, TopicMap, topic_map
from wam_description.configuration import Configuration, files_of, option_values, packaged
from wam_description.nodes import EACH, GROUPED, ONE
from wam_live.thresholds import LIVE
from wam_sim.batch import executor
from wam_sim.pieces import default_file
from wam_sim.progress import Progress

BASE_CONFIGURATION = "wam"
LAST_PORT = 65535
YAML_SUFFIXES = (".yaml", ".yml")
MOST_JOBS = 1024


def namespace(text: str) -> str:
    """The namespace of an arm, as an option takes it.

    Raises
    ------
    ArgumentTypeError
        where ROS would not take it.
    """
    inner = text.strip("/")
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*", inner):
        raise argparse.ArgumentTypeError(
            f"'{text}' is no namespace; give words of letters, digits and '_' that begin with no digit, joined by '/'"
        )
    return inner


def filled(text: str) -> str:
    """A name or file, as an option takes it.

    Raises
    ------
    ArgumentTypeError
        where it is empty, as that of a variable that is not set; it would be as if the option was not given.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("it is empty; give a name or a file, or leave the option out")
    return text


def exit_code_of(unmet: Sequence[object]) -> int:
    """Print what in a report is not as it should be, if anything; the exit code."""
    if unmet:
        print(f"\nnot as it should be: {'; '.join(str(one) for one in unmet)}")  # `map` is a command here
    return int(bool(unmet))


def port(text: str) -> int:
    """A port of this machine, as an option takes it.

    Raises
    ------
    ArgumentTypeError
        where there is none of that number.
    """
    if not text.isdecimal() or not 1 <= int(text) <= LAST_PORT:
        raise argparse.ArgumentTypeError(f"'{text}' is no port; allowed: 1 to {LAST_PORT}")
    return int(text)


def take_configuration(parser: argparse.ArgumentParser) -> None:
    """Give a command the option --config."""
    parser.add_argument(
        "--config", default=BASE_CONFIGURATION, help="configuration: a YAML file, or the name of one that is installed"
    )
    take_values(parser)


def take_arm(parser: argparse.ArgumentParser) -> None:
    """Give a command that reads a bag the option --namespace."""
    parser.add_argument("--namespace", type=namespace, help="of the arm in the bag; default: that with the most topics")


def take_values(parser: argparse.ArgumentParser) -> None:
    """Give a command the option --set."""
    parser.add_argument(
        "--set",
        dest="values",
        action="append",
        default=[],
        metavar="[NODE:]PARAMETER=VALUE",
        help="change a parameter, e.g. force_loop:force_gain=[0.01] or timing.period=0.002; may be repeated",
    )


def configuration_file(given: argparse.Namespace) -> Path:
    """The file of the configuration that --config names."""
    name: str = given.config
    return Path(name) if name.endswith((".yaml", ".yml")) else packaged(name)


def refuse_source(given: argparse.Namespace, option: str, file: Path, *others: Path) -> None:
    """Refuse, before the work, to write over what it reads: the configuration, one that this builds on, other files.

    Raises
    ------
    ValueError
        which names the file, and what to do.
    """
    configuration, *bases = (one.resolve() for one in files_of(configuration_file(given)))
    if file.resolve() == configuration:
        raise ValueError(f"{option} {file} is the configuration itself; give another file, which may build on it")
    if file.resolve() in bases:
        raise ValueError(f"{option} {file} is a base of the configuration {given.config}; give another file")
    if file.resolve() in [one.resolve() for one in others]:
        raise ValueError(f"{option} {file} is read by this command; give another file")


def configuration_of(given: argparse.Namespace) -> Configuration:
    """The configuration that --config names."""
    loaded = Configuration.load(configuration_file(given))
    values = getattr(given, "values", [])
    return loaded.with_values(option_values(values)) if values else loaded


def refuse_overridden(given: argparse.Namespace, own: Collection[str], what: str) -> None:
    """Refuse a value of --set that would have no effect.

    Parameters
    ----------
    own : parameters, '[node:]parameter', that every evaluation sets itself.
    what : what sets them.

    Raises
    ------
    ValueError
        names the parameter.
    """
    names = {*own, *(name.rpartition(":")[2] for name in own)}
    for name in option_values(given.values):
        if name in names:
            raise ValueError(f"--set {name} has no effect here: {what} sets it; leave it out")


def take_time(parser: argparse.ArgumentParser) -> None:
    """Give a command the options for how time passes."""
    parser.add_argument(
        "--processes",
        nargs="?",
        const=EACH,
        choices=(EACH, GROUPED),
        help="a process for each node, or grouped: for the inner loop, the outer loop and the recorder; default: all "
        "in one process; grouped in realtime",
    )
    parser.add_argument(
        "--realtime",
        action="store_true",
        help="do not wait for commands, as a real driver; default: timing.mode, lockstep",
    )
    parser.add_argument(
        "--real-time-factor",
        type=float,
        metavar="FACTOR",
        help="speed of lockstep: 1 as the wall clock, 0 as fast as it can; default: timing.real_time_factor",
    )
    parser.add_argument("--lockstep", action="store_true", help=argparse.SUPPRESS)  # what factor 0 was called before


def timed(configuration: Configuration, given: argparse.Namespace) -> Configuration:
    """The configuration with what the options set for time.

    Raises
    ------
    ValueError
        where options exclude each other.
    """
    mode = "realtime" if given.realtime else "lockstep" if given.lockstep else getattr(given, "mode", None)
    factor = 0.0 if given.lockstep else given.real_time_factor
    values = {"timing.mode": mode, "timing.real_time_factor": factor}
    timed = configuration.with_values({name: value for name, value in values.items() if value is not None})
    if factor is not None and timed.shared.timing.mode == "realtime":
        raise ValueError("--real-time-factor is for lockstep; leave out --realtime")
    return timed


def processes_of(configuration: Configuration, given: argparse.Namespace) -> str:
    """How the nodes are distributed to processes: ONE, GROUPED or EACH, of `wam_description.nodes`."""
    return given.processes or (GROUPED if configuration.shared.timing.mode == "realtime" else ONE)


def is_paced(configuration: Configuration) -> bool:
    """Whether the nodes leave the processor time to others; not in lockstep as fast as it can."""
    timing = configuration.shared.timing
    return timing.mode == "realtime" or timing.real_time_factor > 0.0


def take_port(parser: argparse.ArgumentParser) -> None:
    """Give a command the option --port."""
    parser.add_argument(
        "--port", type=port, help=f"of the page on this machine; default: {LIVE.port}, or the next one that is free"
    )


def take_page(parser: argparse.ArgumentParser, default: bool | None) -> None:
    """Give a command the options --live and --no-live; None: a page where that is possible."""
    parser.add_argument(
        "--live",
        action=argparse.BooleanOptionalAction,
        default=default,
        help="show the arm in the browser; default: " + ("no" if default is False else "where that is possible"),
    )
    take_port(parser)


class FileKind(NamedTuple):
    """A kind of file that commands write.

    Attributes
    ----------
    name : of one, as messages have it.
    suffixes : that it may have, in lower case.
    heading : how those begin that this program wrote; others are not written over.  '' where any may be.
    """

    name: str
    suffixes: tuple[str, ...]
    heading: str = ""


# '' is for devices and pipes, as /dev/stdout
TABLE = FileKind("a table", (".csv", ".tsv", ".txt", ".dat", ""))
JSON = FileKind("JSON", (".json", ".txt", ""))
HTML = FileKind("a page of HTML", (".html", ".htm", ""))
PAGE = FileKind("a page of the documentation", (".md",))
RERUN = FileKind("a recording for Rerun", (".rrd", ""))


class BatchOptions(NamedTuple):
    """Executor, file of finished pieces, and progress report of a batch."""

    executor: Executor
    file: Path | None
    report: Progress


def take_executor(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of where it computes."""
    parser.add_argument("--jobs", type=int, help="processes; default: one for each core")
    parser.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a Dask cluster, for example tcp://10.0.0.1:8786"
    )


def executor_of(given: argparse.Namespace, pieces: int) -> AbstractContextManager[Executor]:
    """What the options of `take_executor` name, with no more processes than pieces."""
    if given.jobs is not None:
        at_least("--jobs", given.jobs, 1, MOST_JOBS)
    return executor(min(given.jobs or os.cpu_count() or 1, pieces), given.dask)


def take_batch(parser: argparse.ArgumentParser, name: str) -> None:
    """Give a command of this name the options of a long computation."""
    take_executor(parser)
    parser.add_argument(
        "--results",
        type=Path,
        default=default_file(name),
        metavar="FILE",
        help="what is finished is kept and looked for here, a line of JSON each; default: %(default)s",
    )
    parser.add_argument("--fresh", action="store_true", help="compute everything, keep nothing")


@contextmanager
def batch_of(given: argparse.Namespace, pieces: int) -> Iterator[BatchOptions]:
    """What the options of `take_batch` name, with no more processes than pieces; progress goes to stderr."""
    if not given.fresh:
        writable_directory("--results", given.results.parent)
    with executor_of(given, pieces) as found:
        progress = Progress(getattr(given, "part", given.command), sys.stderr)
        yield BatchOptions(found, None if given.fresh else given.results, progress)


def take_topic_map(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of what is taken from another robot's recording."""
    other = parser.add_argument_group("a recording of another robot", "each may be repeated")
    for option, name, words in (
        ("--topic", "TOPIC", "analyse this topic only; of any type, with --map"),
        ("--joint", "JOINT", "analyse this joint only; or the names of joints that have none in the messages"),
        ("--command", "TOPIC", "what is commanded; else topics named command, cmd, desired, reference, target, goal"),
        (
            "--map",
            "QUANTITY=FIELD",
            f"field of the messages, as effort=current or position=state.q; {', '.join(MAPPED)}",
        ),
        ("--unit", "QUANTITY=UNIT", "of what was recorded, as position=deg or effort=mA, or a factor as effort=0.12"),
    ):
        dest = f"only_{option[2:]}"  # `command` is that of the program
        other.add_argument(option, dest=dest, action="append", default=[], metavar=name, help=words)


def topic_map_of(given: argparse.Namespace) -> TopicMap:
    """What the options of `take_topic_map` name; errors are those of `topic_map`."""
    return topic_map(given.only_topic, given.only_joint, given.only_command, given.only_map, given.only_unit)


def require_effect(option: str, names: Iterable[str]) -> None:
    """Refuse parameters that do nothing in runs without ROS.

    Raises
    ------
    ValueError
        which names the first one and what to do.
    """
    from wam_sim.simulation import WITHOUT_EFFECT

    for name in names:
        if name in WITHOUT_EFFECT:
            raise ValueError(
                f"{option} {name} has no effect: the runs are in Python without ROS, in lockstep and as fast as they "
                "can; leave it out, and play 'wam demo' with each of its values"
            )


def at_least(option: str, value: float, low: float, high: float = math.inf) -> None:
    """Refuse the value of an option that is too small or too large, or no number.

    Raises
    ------
    ValueError
        which names the option, the value and what is allowed.
    """
    if not value >= low:
        raise ValueError(f"{option} is {value:g}; it must be at least {low:g}")
    if value > high:
        raise ValueError(f"{option} is {value:g}; it must be at most {high:g}")


def writable_file(option: str, file: Path, kind: FileKind, advice: str = "") -> None:
    """Refuse, before the work, a file that could not be written after it, or should not be.

    Parameters
    ----------
    kind : what is written.
    advice : what was meant by a YAML file in the place of another kind.

    Raises
    ------
    ValueError
        with the reason, and what to do.
    """
    _require_place(option, file)
    suffix = file.suffix.lower()
    if suffix not in kind.suffixes:
        allowed = ", ".join(filter(None, kind.suffixes))
        advice = f"; {advice}" if advice and suffix in YAML_SUFFIXES else ""
        raise ValueError(f"{option} {file} would be {kind.name}; give a file that ends in {allowed}{advice}")
    if kind.heading and file.exists():
        text = file.read_text(encoding="utf-8", errors="replace")
        if text.strip() and not text.startswith(kind.heading):
            raise ValueError(f"{option} {file} exists, and this command did not write it; give a new file")


def _require_place(option: str, file: Path) -> None:
    """Refuse a file that could not be written."""
    folder = file.parent
    if file.is_dir():
        why = "it is a directory"
    elif not folder.is_dir():
        why = f"{folder} is no directory"
    elif not os.access(file if file.exists() else folder, os.W_OK):
        why = f"no permission to write {'it' if file.exists() else f'into {folder}'}"
    else:
        return
    raise ValueError(f"cannot write {file}: {why}; give another file as {option}")


def writable_picture(option: str, file: Path) -> None:
    """Refuse, before the work, a picture that could not be written after it, as `writable_file` does other files."""
    from matplotlib.backend_bases import FigureCanvasBase  # slow, and for pictures alone

    _require_place(option, file)
    if file.suffix[1:].lower() not in FigureCanvasBase.get_supported_filetypes():
        raise ValueError(
            f"cannot draw {file}: there is no format '{file.suffix}'; give a .png, .pdf or .svg as {option}"
        )


def writable_directory(option: str, directory: Path) -> None:
    """Refuse, before the work, a directory that could not be made or written into.

    Raises
    ------
    ValueError
        with the reason, and what to do.
    """
    there = next(folder for folder in (directory, *directory.parents) if folder.exists() or folder == folder.parent)
    if not there.is_dir():
        why = f"{there} is no directory"
    elif not os.access(there, os.W_OK | os.X_OK):
        why = f"no permission to write into {there.absolute()}"
    else:
        return
    raise ValueError(f"cannot write into {directory}: {why}; give another directory as {option}")


def new_bag(path: Path) -> Path:
    """The path of a bag that is to be recorded, refused before the work where something is there.

    Raises
    ------
    ValueError
        which names it, and what to do.
    """
    if path.exists():
        raise ValueError(f"bag {path} exists already; give another name as --name, or move it away")
    return path
