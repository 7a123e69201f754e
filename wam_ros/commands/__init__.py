"""The commands of `wam`, a module each: `arguments(parser)` and `run(given)`, which returns the exit code.

Here is what several of them take.
"""

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from wam_analysis.batch import executor
from wam_analysis.progress import Progress
from wam_description.configuration import Configuration, packaged

BASE_CONFIGURATION = "wam"


def take_configuration(parser: argparse.ArgumentParser) -> None:
    """Give a command the option --config."""
    parser.add_argument(
        "--config", default=BASE_CONFIGURATION, help="configuration: a YAML file, or the name of one that is installed"
    )


def configuration_of(given: argparse.Namespace) -> Configuration:
    """The configuration that --config names."""
    name: str = given.config
    return Configuration.load(Path(name) if name.endswith((".yaml", ".yml")) else packaged(name))


class Batch(NamedTuple):
    """What computes a battery, where it keeps what is finished, and who is told."""

    executor: Executor
    folder: Path | None
    report: Progress


def take_batch(parser: argparse.ArgumentParser) -> None:
    """Give a command the options of a long computation."""
    parser.add_argument("--workers", type=int, help="processes; default: one for each core")
    parser.add_argument(
        "--dask", metavar="ADDRESS", help="scheduler of a Dask cluster, for example tcp://10.0.0.1:8786"
    )
    parser.add_argument(
        "--keep",
        type=Path,
        default=Path(".cache/pieces"),
        metavar="DIRECTORY",
        help="finished pieces are kept and looked for here; default: %(default)s",
    )
    parser.add_argument("--fresh", action="store_true", help="compute everything, keep nothing")


@contextmanager
def batch_of(given: argparse.Namespace) -> Iterator[Batch]:
    """What the options of `take_batch` name; progress goes to stderr."""
    if given.workers is not None and given.workers < 1:
        raise ValueError(f"--workers is {given.workers}; it must be at least 1")
    with executor(given.workers, given.dask) as found:
        yield Batch(found, None if given.fresh else given.keep, Progress(given.command, sys.stderr))
