"""Finished tasks in a file, one line each: a benchmark that was stopped goes on from it.

A line has the hash of the code and configuration that it is a result of; lines of other code, other seeds or other
tasks are left alone and not used.
"""

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from wam_description.configuration import Configuration
from wam_sim.pieces import sources
from wam_studies.force_benchmark.outcome import TaskEnd, TaskResult
from wam_studies.force_benchmark.tasks import Task

MEASURED = ("description", "theory", "driver", "control", "sim")  # packages that a result depends on
BEGIN = '{"code": '  # of every line
HERE = ("surfaces", "tasks", "trial", "outcome")  # and modules of this one


class ResultKey(NamedTuple):
    """What a result belongs to: hash of code and configuration, seed, s of the whole force."""

    code: str
    seed: int
    seconds: float


def key(configuration: Configuration, seed: int, seconds: float) -> ResultKey:
    """The key of results that this code and configuration give now."""
    digest = hashlib.sha256(configuration.text.encode())
    for package in MEASURED:
        digest.update(sources(f"wam_{package}").encode())
    for module in HERE:
        digest.update(Path(__file__).with_name(f"{module}.py").read_bytes())
    return ResultKey(digest.hexdigest()[:12], seed, seconds)


def read(file: Path, wanted: ResultKey) -> dict[int, TaskResult]:
    """Results of a key by number of the task; {} where there is no file.

    Raises
    ------
    ValueError
        names the first line that is no result.
    """
    found = {}
    for number, line in enumerate(_whole_lines(file), start=1):
        try:
            tree = json.loads(line)
            if ResultKey(tree["code"], tree["seed"], tree["seconds"]) == wanted:
                found[int(tree["number"])] = _result(tree["result"])
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{file}, line {number} is no result of a task; give another file as --results") from error
    return found


@contextmanager
def opened(file: Path) -> Iterator[TextIO]:
    """The file, made if needed, to append lines to it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    whole = "".join(f"{line}\n" for line in _whole_lines(file))
    if file.exists() and file.read_text(encoding="utf-8") != whole:
        file.write_text(whole, encoding="utf-8")
    with file.open("a", encoding="utf-8") as stream:
        yield stream


def _whole_lines(file: Path) -> list[str]:
    """Lines of the file, without a last one that was cut off when the program was ended."""
    text = file.read_text(encoding="utf-8") if file.exists() else ""
    lines = text.splitlines()
    return lines[:-1] if lines and lines[-1].startswith(BEGIN) and not text.endswith("\n") else lines


def append(stream: TextIO, of: ResultKey, number: int, task: Task, result: TaskResult) -> None:
    """Write the line of a finished task."""
    tree = {**of._asdict(), "number": number, "task": _plain(task), "result": result._asdict()}
    stream.write(json.dumps(tree) + "\n")
    stream.flush()


def _result(tree: Any) -> TaskResult:
    return TaskResult(**{**tree, "outcome": TaskEnd(tree["outcome"])})


def _plain(value: Any) -> Any:
    """NamedTuples as mappings."""
    return {name: _plain(item) for name, item in value._asdict().items()} if hasattr(value, "_asdict") else value
