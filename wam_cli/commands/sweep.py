"""`wam sweep`: a scenario or an experiment with many parameter sets, as a table and a plot."""

import argparse
import csv
import math
import re
import sys
import textwrap
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import yaml

from wam_analysis.drawing import INK, MEASURED, PREDICTED
from wam_cli.options import (
    BASE_CONFIGURATION,
    PICTURE,
    SEED,
    batch_of,
    bounded,
    configuration_of,
    filled,
    output_file,
    refuse_overridden,
    require_effect,
    require_option,
    take_batch,
    take_configuration,
)
from wam_control.task.scenario import load, script_file
from wam_description import yaml_text
from wam_description.configuration import option_values
from wam_description.thresholds import FILES
from wam_sim.batch import results
from wam_sim.sweep import MOST_SETS, Axis, Values, drawn, grid, listed
from wam_studies.figures.style import panels
from wam_studies.thesis import definition
from wam_studies.thesis.measurement import MeasuredCase, measure, measure_scenario, swept, swept_scenario
from wam_studies.thesis.rows import NOTHING, value_text

SCENARIO = "demo_scenario"
WORDED = "failure", "reported", "deviating"  # columns in words, between the values of a set and the quantities
TABLE = output_file("a table", (".csv", ".tsv", ".txt", ".dat", ""), ",".join(WORDED))
ENDS = r"[-+.\de]+"  # a number, or what may be meant as one
PREDICTED_TOO = ", predicted"  # after the title of a quantity
Runs = tuple[Callable[[Any], MeasuredCase], Sequence[Any], bool]  # what measures, the cases, and may results be kept


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `wam sweep` to its parser."""
    parser.add_argument("file", type=TABLE, help="table to write, for example sweep.csv")
    take_configuration(parser)
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--scenario",
        type=filled,
        metavar="NAME",
        help=f"YAML file, or the name of a packaged scenario; default: {SCENARIO}",
    )
    what.add_argument(
        "--experiment",
        type=filled,
        metavar="NAME",
        help="an experiment of the thesis or a whole-arm task, with its own configuration",
    )
    parser.add_argument(
        "--vary",
        action="append",
        required=True,
        type=_axis,
        metavar="NAME=VALUES",
        help="parameter and its values, for example 'force_loop:force_gain=0.005,0.01'; LOW:HIGH:N gives N "
        "logarithmically spaced values; may be repeated",
    )
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument(
        "--list",
        action="store_true",
        help="run 1 takes the first value of each --vary, and so on; default: all combinations",
    )
    kind.add_argument(
        "--random",
        type=bounded(int, 1, MOST_SETS),
        metavar="RUNS",
        help="draw this many random sets; --vary gives the lowest and highest value: log-uniform if both are above 0, "
        "else uniform; whole numbers cannot be drawn",
    )
    parser.add_argument("--seed", type=SEED, help="seed of --random; default: 1")
    parser.add_argument(
        "--picture",
        type=PICTURE,
        help="plot into this PNG, PDF or SVG: the numbers of the whole run over each parameter",
    )
    take_batch(parser, "sweep")


def run(given: argparse.Namespace) -> int:
    """Run the parameter sets that are not kept from before, write table and plot; 1 where every run failed."""
    require_option(given, "--random", "--seed")
    axes: list[Axis] = given.vary
    _refuse_idle(given, axes)
    seed = 1 if given.seed is None else given.seed
    sets = drawn(axes, given.random, seed) if given.random else listed(axes) if given.list else grid(axes)
    function, cases, is_kept = (_of_experiment if given.experiment else _of_scenario)(given, sets)
    with batch_of(given, len(cases)) as (executor, file, report):
        found = results(function, cases, executor, file if is_kept else None, report)
    rows, titles = _table(sets, found)
    _write(given.file, rows)
    if given.picture:  # of a scenario what is of the whole run, and not of one of its steps
        _draw(given.picture, list(sets[0]), rows, [one for one in titles if given.experiment or ": " not in one])
    failures = [one.failure for one in found if one.failure]
    failed, doubted = len(failures), sum(bool(one.result.reported) for one in found)
    doubts = f", {doubted} with a remark (column 'reported')" if doubted else ""
    count, why = f"{len(sets)} set{'s' * (len(sets) != 1)}", " (column 'failure')" * bool(failed)
    print(f"{count}, {failed} failed{why}{doubts}, in {given.file}")
    if failed == len(sets):
        print(f"every set failed; the first: {failures[0]}", file=sys.stderr)
    return int(failed == len(sets))


def _refuse_idle(given: argparse.Namespace, axes: list[Axis]) -> None:
    """Refuse an axis whose values would stand in the table without having been used, and such values of --set."""
    names = [axis.name for axis in axes]
    require_effect("--set", option_values(given.values))
    require_effect("--vary", names)
    refuse_overridden(given, names, "--vary")
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"--vary has {name} {names.count(name)} times; give all its values in one --vary")
        if name.partition(":")[0] in ("scenario", "recorder"):
            raise ValueError(
                f"--vary {name}: a sweep has no such node; leave it out, or give the scenario with --scenario"
            )


def _of_scenario(given: argparse.Namespace, sets: list[Values]) -> Runs:
    """The scenario with each set; that of a node of one's own is not kept, as its code may import any file."""
    configuration = configuration_of(given)
    steps = load(script_file(given.scenario or SCENARIO), configuration.shared)
    is_own = any(":" in entry for entry in configuration.shared.nodes)
    return measure_scenario, swept_scenario(configuration, steps, sets), not is_own


def _of_experiment(given: argparse.Namespace, sets: list[Values]) -> Runs:
    """The experiment with each set."""
    if given.config != BASE_CONFIGURATION or given.values:
        raise ValueError(
            "an experiment has its own configuration; leave out --config and --set, and change its numbers with --vary"
        )
    return measure, swept(definition.load(given.experiment), sets), True


def _axis(text: str) -> Axis:
    name, equals, values = text.partition("=")
    with suppress(ValueError):
        low, high, count = (kind(end) for kind, end in zip((float, float, int), values.split(":"), strict=True))
        if not (0.0 < low < high < math.inf and count > 1):
            raise argparse.ArgumentTypeError(f"'{values}' is no LOW:HIGH:N with 0 < LOW < HIGH and N of 2 or more")
        if count > MOST_SETS:
            raise argparse.ArgumentTypeError(f"'{values}' has {count} values; at most {MOST_SETS} sets are played")
        return Axis(name, tuple(low * (high / low) ** (i / (count - 1)) for i in range(int(count))))
    if re.fullmatch(rf"{ENDS}:{ENDS}", values.replace(" ", "")):
        raise argparse.ArgumentTypeError(f"'{values}' has no number of values; write {values}:5 for five")
    parsed, reason = [], ""
    try:
        parsed = yaml_text.parse(f"[{values}]")
    except yaml.YAMLError as error:
        reason = f": {getattr(error, 'problem', None) or error}"
    if not (name and equals and parsed):
        raise argparse.ArgumentTypeError(
            f"{text[: FILES.longest_value]!r} is no NAME=VALUES{reason}; write for example "
            "force_loop:force_gain=0.01,0.02 or force_loop:force_gain=0.01:0.1:5"
        )
    return Axis(name, tuple(parsed))


def _table(sets: Sequence[Values], found: Sequence[MeasuredCase]) -> tuple[list[Values], list[str]]:
    """A row for each set: its values, what went wrong, and what is known of each quantity; and the titles of these."""
    rows, titles = [], dict[str, None]()
    for values, (failure, result) in zip(sets, found, strict=True):
        deviating = [one.quantity for one in result.rows if not one.agrees]
        worded = failure, "; ".join(result.reported), "; ".join(deviating)
        row = {**values, **dict(zip(WORDED, worded, strict=True))}
        for one in result.rows:
            known = {one.title: one.measured, one.title + PREDICTED_TOO: one.predicted}
            row |= {title: value for title, value in known.items() if value_text(value) != NOTHING}
            titles[one.title] = None
        rows.append(row)
    return rows, list(titles)


def _write(file: Path, rows: Sequence[Values]) -> None:
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, dict.fromkeys(name for row in rows for name in row), restval="")
        writer.writeheader()
        writer.writerows(rows)


def _draw(file: Path, names: Sequence[str], rows: Sequence[Values], titles: Sequence[str]) -> None:
    """A panel for each number that is known and each parameter; a set that failed is a cross on the axis."""
    numbers = [one for one in titles if any(isinstance(row.get(one), float) for row in rows)] or [""]
    width, height = 3.6 * len(names), max(3.0, 2.2 * len(numbers))
    with panels(file, len(numbers), len(names), width, height) as (_, shown):
        for part, (title, name) in zip(shown, product(numbers, names), strict=True):
            marks = [("measured", "o", MEASURED, title), ("predicted", "o", PREDICTED, title + PREDICTED_TOO)]
            for label, marker, colour, column in (*marks, ("failed", "x", INK, "failure")):
                seen = [(row[name], row[column]) for row in rows if row.get(column) not in (None, "")]
                if seen:
                    across = [value if isinstance(value, (int, float)) else str(value) for value, _ in seen]
                    up = [0.0 if column == "failure" else value for _, value in seen]
                    part.scatter(across, up, s=14, label=label, marker=marker, color=colour)
            part.set(xlabel=name, title="\n".join(textwrap.wrap(title, 50)))
            part.legend()
