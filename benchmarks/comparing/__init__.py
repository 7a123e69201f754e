"""Shared by all benchmarks: options, medians with quartiles, the table, the line of JSON.

Speeds differ between computers, and on one computer from hour to hour; the ratio of two quantities measured in turns
in the same run is stable.  Compare ratios only.
"""

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from wam_analysis.table import plain

RESULTS = Path(__file__).resolve().parents[1] / "results"


class Quartiles(NamedTuple):
    """Median and quartiles of some rounds."""

    median: float
    low: float
    high: float

    def __format__(self, spec: str) -> str:
        return f"{self.median:{spec}} ({self.low:{spec}}..{self.high:{spec}})"


def quartiles(values: Sequence[float]) -> Quartiles:
    """Median and quartiles of the rounds."""
    low, median, high = statistics.quantiles(values, n=4, method="inclusive") if len(values) > 1 else [values[0]] * 3
    return Quartiles(median, low, high)


def ratios(values: Sequence[float], references: Sequence[float]) -> Quartiles:
    """Ratio of each round to the reference of the same round."""
    return quartiles([value / reference for value, reference in zip(values, references, strict=True)])


def options(text: str, rounds: int) -> argparse.ArgumentParser:
    """The options of every benchmark: `rounds`, `quick`."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("--rounds", type=int, help=f"number of measurements; default: {rounds}")
    parser.add_argument("--quick", action="store_true", help="short test run; nothing is written")
    return parser


def arguments(text: str, rounds: int, quick_rounds: int) -> argparse.Namespace:
    """What is given on the command line of a benchmark that has no other options."""
    given = options(text, rounds).parse_args()
    given.rounds = given.rounds or (quick_rounds if given.quick else rounds)
    return given


def mark(value: float, must: float, aim: float) -> str:
    """Which of two limits a value reaches; the smaller the better where the aim is below what must be."""
    sign = 1.0 if aim > must else -1.0
    reached = next((name for name, limit in (("aim", aim), ("must", must)) if sign * value >= sign * limit), "below")
    return f"{reached} [{must:g}, {aim:g}]"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as text, first column left-aligned, the others right-aligned."""
    return "\n".join(plain([head], rows))


def machine() -> str:
    """Description of this computer, in one line."""
    cpu = ""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [line.partition(":")[2].strip() for line in info.read_text().splitlines() if "model name" in line]
        cpu = names[0] if names else ""
    python = f"Python {platform.python_version()}"
    edition = "inner loop as C" if find_spec("wam_driver.fast_steps") else "plain"
    return f"{os.cpu_count()} cores, {cpu or platform.machine()}, {platform.system()}, {python}, {edition}"


def save(name: str, given: argparse.Namespace, measured: Mapping[str, Any]) -> None:
    """Append the run to results/`name`.jsonl; a quick run is not kept."""
    if given.quick:
        return
    RESULTS.mkdir(exist_ok=True)
    line = {
        "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "machine": machine(),
        "mujoco": version("mujoco"),
        "rounds": given.rounds,
        **measured,
    }
    with (RESULTS / f"{name}.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")
