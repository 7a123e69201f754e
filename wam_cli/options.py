"""Options that several commands share: types with their bounds, files that are written, and groups."""

import argparse
import math
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from wam_analysis.foreign.topic_map import MAPPED, TopicMap, topic_map
from wam_description.configuration import Configuration, differences, named_file, option_values
from wam_description.nodes import EACH, GROUPED, ONE
from wam_live.thresholds import LIVE
from wam_sim.batch import dask, processes
from wam_sim.pieces import default_file
from wam_sim.progress import Progress

BASE_CONFIGURATION = "wam"
ARM = "wam"  # namespace of a stack, unless another one is given

# types: a text becomes a value, or a reason why not, which argparse prints with the option's name


def bounded(
    kind: type[int] | type[float], low: float = 0, high: float = math.inf, unit: str = ""
) -> Callable[[str], Any]:
    """The type of a finite number within bounds, both of which are allowed."""
    what = "a whole number" if kind is int else "a number" if math.isfinite(low) else "a finite number"
    bounds = f"of at least {low:g}" * math.isfinite(low) if high == math.inf else f"from {low:g} to {high:g}"

    def parse(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not (low <= value <= high and math.isfinite(value)):
            allowed = " ".join(filter(None, (what, bounds))) + f", in {unit}" * bool(unit)
            raise argparse.ArgumentTypeError(f"'{text}' is not allowed; give {allowed}")
        return value

    return parse


COUNT = bounded(int, 1)
SEED = bounded(int, 0)
_PORT = bounded(int, 1, 65535)
_JOBS = bounded(int, 1, 1024)


def namespace(text: str) -> str:
    """The namespace of an arm, as ROS takes it."""
    inner = text.strip("/")
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*", inner):
        raise argparse.ArgumentTypeError(
            f"'{text}' is no namespace; give words of letters, digits and '_' that begin with no digit, joined by '/'"
        )
    return inner


def filled(text: str) -> str:
    """A name or file; an empty one, as that of a variable that is not set, would be as if none was given."""
    if not text.strip():
        raise argparse.ArgumentTypeError("it is empty; give a name or a file, or leave the option out")
    return text


def writable_directory(text: str) -> Path:
    """A directory that can be made or written into."""
    path = Path(text)
    if reason := unwritable(path):
        raise argparse.ArgumentTypeError(f"{reason}; give another directory")
    return path


def unwritable(path: Path) -> str:
    """Why a directory cannot be made or written into; '' where it can."""
    there = next(folder for folder in (path, *path.parents) if folder.exists() or folder == folder.parent)
    if not there.is_dir():
        return f"cannot write into {path}: {there} is no directory"
    if not os.access(there, os.W_OK | os.X_OK):
        return f"cannot write into {path}: no permission to write into {there.absolute()}"
    return ""


def output_file(kind: str, suffixes: Sequence[str], heading: str = "") -> Callable[[str], Path]:
    """The type of a file that is written: refused before the work if it could not be written, or should not be.

    Parameters
    ----------
    kind : what is written, as messages have it.
    suffixes : that it may have, in lower case.
    heading : what the first line of those has that this program wrote; others are not written over.  '' where any may
        be.
    """

    def parse(text: str) -> Path:
        file = Path(text)
        folder, why = file.parent, ""
        if file.suffix.lower() not in suffixes:
            allowed = ", ".join(filter(None, suffixes))
            raise argparse.ArgumentTypeError(f"{file} cannot be {kind}; give a file that ends in {allowed}")
        if file.is_dir():
            why = "it is a directory"
        elif not folder.is_dir():
            why = f"{folder} is no directory"
        elif not os.access(file if file.exists() else folder, os.W_OK):
            why = f"no permission to write {'it' if file.exists() else f'into {folder}'}"
        if why:
            raise argparse.ArgumentTypeError(f"cannot write {file}: {why}; give another file")
        if heading and file.is_file():  # a pipe has no end
            there = file.read_text(encoding="utf-8", errors="replace").strip()
            if there and heading not in there.partition("\n")[0]:
                raise argparse.ArgumentTypeError(f"{file} exists, and this command did not write it; give a new file")
        return file

    return parse


# '' is for devices and pipes, as /dev/stdout
JSON = output_file("JSON", (".json", ".txt", ""))
HTML = output_file("a page of HTML", (".html", ".htm", ""))
PAGE = output_file("a page of the documentation", (".md",))
PICTURE = output_file("a picture", (".png", ".pdf", ".svg", ".jpg", ".eps"))


# groups


def take_configuration(parser: argparse.ArgumentParser, default: str | None = BASE_CONFIGURATION) -> None:
    """Give a command the options --config and --set."""
    known = f"; default: {default}" if default else ""
    parser.add_argument(
        "--config", default=default, help=f"configuration: a YAML file, or the name of a packaged one{known}"
    )
    parser.add_argument(
        "--set",
        dest="values",
        action="append",
        default=[],
        metavar="[NODE:]PARAMETER=VALUE",
        help="change a parameter, e.g. force_loop:force_gain=[0.01] or arm.payload=0.3; may be repeated",
    )


def configuration_of(given: argparse.Namespace) -> Configuration:
    """The configuration that --config names, with the values of --set; prints what a file of your own changes."""
    file = named_file(given.config)
    loaded = Configuration.load(file)
    print(*(f"{line}\n" for line in differences(file, loaded)), sep="", end="", file=sys.stderr, flush=True)
    return loaded.with_values(option_values(given.values)) if given.values else loaded


def refuse_overridden(given: argparse.Namespace, own: Collection[str], what: str) -> None:
    """Refuse a value of --set that would have no effect.

    Parameters
    ----------
    own : parameters, '[node:]parameter', that every run sets itself.
    what : what sets them.
    """
    names = {*own, *(name.rpartition(":")[2] for name in own)}
    for name in option_values(given.values):
        if name in names:
            raise ValueError(f"--set {name} has no effect here: {what} sets it; leave it out")


def require_effect(option: str, names: Iterable[str]) -> None:
    """Refuse parameters that do nothing in runs without ROS."""
    from wam_sim.simulation import WITHOUT_EFFECT

    for name in names:
        if name in WITHOUT_EFFECT:
            raise ValueError(
                f"{option} {name} has no effect in runs without ROS, which are in lockstep and as fast as possible; "
                "leave it out, or play 'wam demo' with each of its values"
            )


def require_option(given: argparse.Namespace, needed: str, *options: str) -> None:
    """Refuse options that do nothing without another one; an option that is not given is None or False."""
    if not _is_given(given, needed):
        for option in options:
            if _is_given(given, option):
                raise ValueError(f"{option} has no effect without {needed}; leave it out, or give {needed}")


def _is_given(given: argparse.Namespace, option: str) -> bool:
    value = getattr(given, option.removeprefix("--").replace("-", "_"))
    return value is not None and value is not False


def take_arm(parser: argparse.ArgumentParser) -> None:
    """Give a command that reads a bag the option --namespace."""
    parser.add_argument(
        "--namespace", type=namespace, help="namespace of the arm in the bag; default: the one with most topics"
    )


def take_stack(parser: argparse.ArgumentParser) -> None:
    """Give a command that starts a stack, or talks to one, the option --namespace."""
    parser.add_argument("--namespace", type=namespace, default=ARM, help="namespace of the arm; default: %(default)s")


def recording_folder(configuration: Configuration, name: str) -> Path:
    """The directory in which the recorder makes a bag of this name; refused where it cannot."""
    folder = Path(str(configuration.sections["recorder"]["directory"]))
    if reason := unwritable(folder):
        raise ValueError(f"{reason}; give another one with --set recorder:directory=DIRECTORY")
    if name and (folder / name).exists():
        raise ValueError(f"bag {folder / name} exists already; give another name with --name, or move that bag away")
    return folder


def take_time(parser: argparse.ArgumentParser) -> None:
    """Give a command the options for how time passes."""
    parser.add_argument(
        "--processes",
        nargs="?",
        const=EACH,
        choices=(EACH, GROUPED),
        help="in which processes the nodes run. each (also without a value): every node in its own. grouped: driver "
        "and velocity loop in one; the recorder, and each node of your own without high_priority, in its own; all "
        "others in one. Default: all in one; in realtime: grouped",
    )
    parser.add_argument(
        "--realtime",
        action="store_true",
        help="let the arm move by the wall clock, also if a command is late, as a real arm does; default: timing.mode",
    )
    parser.add_argument(
        "--real-time-factor",
        type=bounded(float),
        metavar="FACTOR",
        help="speed in lockstep; 1: as the wall clock, 0: as fast as possible; default: timing.real_time_factor",
    )


def timed(given: argparse.Namespace) -> Configuration:
    """`configuration_of`, with what the options set for time."""
    mode = "realtime" if given.realtime else None
    values = {"timing.mode": mode, "timing.real_time_factor": given.real_time_factor}
    timed = configuration_of(given).with_values({name: value for name, value in values.items() if value is not None})
    if given.real_time_factor is not None and timed.shared.timing.mode == "realtime":
        raise ValueError("--real-time-factor is for lockstep; leave out --realtime")
    return timed


def processes_of(configuration: Configuration, given: argparse.Namespace) -> str:
    """How the nodes are distributed to processes: ONE, GROUPED or EACH, of `wam_description.nodes`."""
    return given.processes or (GROUPED if configuration.shared.timing.mode == "realtime" else ONE)


def take_port(parser: argparse.ArgumentParser) -> None:
    """Give a command the option --port."""
    parser.add_argument(
        "--port", type=_PORT, help=f"port of the page on this machine; default: {LIVE.port}, or the next free one"
    )


def take_page(parser: argparse.ArgumentParser, default: bool | None) -> None:
    """Give a command the options --live and --no-live; None: a page where that is possible."""
    parser.add_argument(
        "--live",
        action=argparse.BooleanOptionalAction,
        default=default,
        help="show the arm in the browser; default: "
        + ("no" if default is False else "yes, if ROS and viser are installed"),
    )
    take_port(parser)


def take_batch(parser: argparse.ArgumentParser, name: str) -> None:
    """Give a command of this name the options of a long computation."""
    parser.add_argument("--jobs", type=_JOBS, help="number of processes; default: one for each core")
    parser.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a Dask cluster, for example tcp://10.0.0.1:8786"
    )
    kept = parser.add_mutually_exclusive_group()
    kept.add_argument(
        "--results",
        type=Path,
        default=default_file(name),
        metavar="FILE",
        help="file of finished runs; a run in it is not computed again; default: %(default)s",
    )
    kept.add_argument("--fresh", action="store_true", help="compute every run again and do not keep the results")


@contextmanager
def batch_of(given: argparse.Namespace, pieces: int) -> Iterator[tuple[Executor, Path | None, Progress]]:
    """Executor, file of finished pieces and report to stderr of a batch, with no more processes than pieces."""
    if not given.fresh and (reason := unwritable(given.results.parent)):
        raise ValueError(f"{reason}; give another directory with --results")
    workers = min(given.jobs or os.cpu_count() or 1, pieces)
    with dask(given.dask) if given.dask else processes(workers) as executor:
        progress = Progress(getattr(given, "part", given.command), sys.stderr)
        yield executor, None if given.fresh else given.results, progress


OTHER_ROBOT = (
    ("--topic", "TOPIC", "analyse this topic only; with --map it may have any type"),
    ("--joint", "JOINT", "analyse this joint only; if the messages name no joints: names for them, in order"),
    ("--command", "TOPIC", "topic of the commands; default: the reference in the controller state messages"),
    (
        "--map",
        "QUANTITY=FIELD",
        f"field with a quantity, e.g. effort=current or stamp=sec,nanosec; quantities: {', '.join(MAPPED)}",
    ),
    ("--unit", "QUANTITY=UNIT", "unit of a quantity, e.g. position=deg or effort=mA; or a factor, e.g. effort=0.12"),
)


def take_topic_map(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of what is taken from another robot's recording."""
    other = parser.add_argument_group("for a recording of another robot", "may be repeated:")
    for option, name, text in OTHER_ROBOT:
        dest = f"only_{option[2:]}"  # `command` is that of the program
        other.add_argument(option, dest=dest, action="append", default=[], metavar=name, help=text)


def topic_map_of(given: argparse.Namespace) -> TopicMap:
    """What the options of `take_topic_map` name; errors are those of `topic_map`."""
    return topic_map(given.only_topic, given.only_joint, given.only_command, given.only_map, given.only_unit)


def exit_code_of(unmet: Sequence[object]) -> int:
    """Print what in a report is not as it should be, if anything; the exit code."""
    if unmet:
        print(f"\nchecks failed: {'; '.join(str(one) for one in unmet)}")
    return int(bool(unmet))
