"""Runs the benchmarks; each measures its subject and a reference in turns and prints their ratio.

    python benchmarks/bench.py                 # all
    python benchmarks/bench.py speed plant --rounds 3

Speeds differ between computers, and on one computer from hour to hour; the ratio of two quantities measured in turns
in the same run is stable.  Compare ratios only.
"""

import argparse
import importlib
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wam_analysis.table import plain

RESULTS = Path(__file__).resolve().parent / "results"
Measured = Iterator[dict[str, float]]  # of each round, the values by their names


class Row(NamedTuple):
    """A row of a benchmark's table.

    Attributes
    ----------
    name : of a measured value, or of its row.
    reference : the value that it is divided by; '' for the value itself.
    must, aim : of the ratio, or of the value; the smaller the better where the aim is below what must be.
    """

    name: str
    reference: str = ""
    must: float = math.nan
    aim: float = math.nan


class Benchmark(NamedTuple):
    """What is measured, and what is shown of it.

    Attributes
    ----------
    measure : yields the values of one round after the other, of a quick run or of another.
    title : of the table, with the unit of its values.
    rows : of the table.
    rounds : by default; a quick run has one.
    """

    measure: Callable[[bool], Measured]
    title: str
    rows: Sequence[Row]
    rounds: int


def mark(value: float, row: Row) -> str:
    """Which of its two limits a row reaches."""
    if math.isnan(row.must):
        return ""
    sign = 1.0 if row.aim > row.must else -1.0
    limits = (("aim", row.aim), ("must", row.must))
    reached = next((name for name, limit in limits if sign * value >= sign * limit), "below")
    return f"{reached} [{row.must:g}, {row.aim:g}]"


def machine() -> str:
    """Description of this computer, in one line."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    cpu = next((line.partition(":")[2].strip() for line in lines if "model name" in line), platform.machine())
    loop = "inner loop as C" if find_spec("wam_driver.fast_steps") else "plain"
    return f"{os.cpu_count()} cores, {cpu}, {platform.system()}, Python {platform.python_version()}, {loop}"


def run(name: str, benchmark: Benchmark, rounds: int, quick: bool) -> None:
    """Measure the rounds, print the table, keep the medians with their quartiles unless the run is quick."""
    measuring = benchmark.measure(quick)
    found = list(islice(measuring, rounds))
    measuring.close()
    lines, kept = [], {}
    for row in benchmark.rows:
        values = [one[row.name] for one in found]
        references = [one.get(row.reference, 1.0) for one in found]
        ratios = [a / b for a, b in zip(values, references, strict=True)]
        low, median, high = np.quantile(ratios, (0.25, 0.5, 0.75)).tolist()
        kept[row.name] = median, low, high
        middle = [f"{statistics.median(part):.4g}" if row.reference else "" for part in (values, references)]
        lines.append([row.name, *middle, row.reference, f"{median:.3g} ({low:.3g}..{high:.3g})", mark(median, row)])
    head = [benchmark.title, "measured", "reference", "that is", "ratio, or value (middle half)", "[must, aim]"]
    print(f"== {name}\n{machine()}")
    print("\n".join(plain([head], lines, left=(0, 3, 5))), flush=True)
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        about = {"time": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "machine": machine(), "mujoco": version("mujoco")}
        with (RESULTS / f"{name}.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps({**about, "rounds": rounds, **kept}) + "\n")


# name: where it is
BENCHMARKS = {
    "speed": "stack:SPEED",
    "round_trip": "stack:ROUND_TRIP",
    "real_time": "stack:REAL_TIME",
    "bus": "bus:BUS",
    "plant": "simulation:PLANT",
    "compiled": "simulation:COMPILED",
    "parts": "cost:PARTS",
    "estimator": "cost:ESTIMATOR",
    "bag_reading": "bags:BAG_READING",
    "analysis": "bags:ANALYSIS",
}


PLAIN = ("plant",)  # of the tree, in plain Python


def load(name: str) -> Benchmark:
    """The benchmark of a name."""
    module, _, constant = BENCHMARKS[name].partition(":")
    return getattr(importlib.import_module(module), constant)


def main() -> None:
    """Run the benchmarks that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=", ".join(BENCHMARKS))
    parser.add_argument("--rounds", type=int, help="number of measurements")
    parser.add_argument("--quick", action="store_true", help="short test run; nothing is written")
    given = parser.parse_args()
    if unknown := [name for name in given.names if name not in BENCHMARKS]:
        parser.error(f"there is no benchmark {', '.join(unknown)}; there are {', '.join(BENCHMARKS)}")
    names = given.names or list(BENCHMARKS)
    for name in names:
        if len(names) > 1 or (name in PLAIN and not os.environ.get("PYTHONPATH")):  # each in a process of its own
            words = [name, *["--quick"] * given.quick, *(["--rounds", str(given.rounds)] if given.rounds else [])]
            tree = {"PYTHONPATH": str(RESULTS.parents[1])} if name in PLAIN else {}
            subprocess.run([sys.executable, __file__, *words], env={**os.environ, **tree}, check=True)
            continue
        benchmark = load(name)
        run(name, benchmark, given.rounds or (1 if given.quick else benchmark.rounds), given.quick)


if __name__ == "__main__":
    sys.modules["bench"] = sys.modules["__main__"]
    main()
