"""`wam sweep`: a scenario or an experiment with many parameter sets, as a table and a plot."""

import argparse
import csv
import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from wam_analysis.drawing import MEASURED, TRUE
from wam_cli.options import (
    BASE_CONFIGURATION,
    PICTURE,
    SEED,
    TABLE,
    batch_of,
    bounded,
    configuration_of,
    filled,
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
from wam_sim.sweep import MOST_SETS, Axis, SweepResult, drawn, grid, listed, outcome, points
from wam_studies.figures.style import panels
from wam_studies.thesis import definition
from wam_studies.thesis.measurement import ExperimentRecord, measure, swept

SCENARIO = "demo_scenario"
ENDS = r"[-+.\de]+"  # a number, or what may be meant as one
Sets = list[tuple[Any, ...]]
Points = tuple[str, str, str, list[list[float]]]  # label, marker, colour, and the values of each set


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
        help="plot into this PNG, PDF or SVG: the force error, or the results of the experiment, over each parameter",
    )
    take_batch(parser, "sweep")


def run(given: argparse.Namespace) -> int:
    """Run the parameter sets that are not kept from before, write table and plot; 1 where every run failed."""
    require_option(given, "--random", "--seed")
    axes: list[Axis] = given.vary
    _refuse_idle(given, axes)
    seed = 1 if given.seed is None else given.seed
    sets = drawn(axes, given.random, seed) if given.random else listed(axes) if given.list else grid(axes)
    failures, reported = (_of_experiment if given.experiment else _of_scenario)(given, axes, sets)
    failed, doubted = sum(map(bool, failures)), sum(map(bool, reported))
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


def _of_scenario(given: argparse.Namespace, axes: list[Axis], sets: Sets) -> tuple[list[str], list[str]]:
    """Why each set failed, '' where it did not, and what was reported of the others; a row of the table for each."""
    configuration = configuration_of(given)
    runs = points(configuration, load(script_file(given.scenario or SCENARIO), configuration.shared), axes, sets)
    with batch_of(given, len(runs)) as batch:
        is_own = any(":" in entry for entry in configuration.shared.nodes)  # its code may import any file
        found = results(outcome, runs, batch.executor, None if is_own else batch.file, batch.report)
    _write(given.file, axes, SweepResult._fields, [(*v, *result) for v, result in zip(sets, found, strict=True)])
    if given.picture:
        _scenario_figure(given.picture, axes, sets, found)
    return [result.failure for result in found], [result.reported for result in found]


def _of_experiment(given: argparse.Namespace, axes: list[Axis], sets: Sets) -> tuple[list[str], list[str]]:
    """As `_of_scenario`, but a row of the table for each quantity, or the failure."""
    if given.config != BASE_CONFIGURATION or given.values:
        raise ValueError(
            "an experiment has its own configuration; leave out --config and --set, and change its numbers with --vary"
        )
    cases = swept(definition.load(given.experiment), axes, sets)
    with batch_of(given, len(cases)) as batch:
        found = results(measure, cases, *batch)
    rows: list[tuple[Any, ...]] = []
    reported = ["; ".join(one.result.reported) for one in found]
    for values, one, text in zip(sets, found, reported, strict=True):
        rows += [(*values, "", c.quantity, c.predicted, c.measured, c.unit, c.agrees, text) for c in one.result.rows]
        rows += [(*values, one.failure, *[""] * 6)] * bool(one.failure)
    _write(given.file, axes, ("failure", "quantity", "predicted", "measured", "unit", "agrees", "reported"), rows)
    if given.picture:
        _experiment_figure(given.picture, axes, sets, found)
    return [one.failure for one in found], reported


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


def _write(file: Path, axes: list[Axis], fields: Iterable[str], rows: Iterable[tuple[Any, ...]]) -> None:
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow([*(axis.name for axis in axes), *fields])
        writer.writerows(rows)


def _scenario_figure(file: Path, axes: Sequence[Axis], sets: Sets, found: Sequence[SweepResult]) -> None:
    """One panel for each parameter; runs that failed are crosses on the axis."""
    good = [[r.force_rms] if not r.failure and math.isfinite(r.force_rms) else [] for r in found]
    bad = [[0.0] if r.failure else [] for r in found]
    rows = {"rms of the settled force error [N]": [("held", "o", TRUE, good), ("failed", "x", MEASURED, bad)]}
    _draw(file, axes, sets, rows)


def _experiment_figure(file: Path, axes: Sequence[Axis], sets: Sets, found: Sequence[ExperimentRecord]) -> None:
    """One row for each quantity that is a number, one column for each parameter."""
    units = {c.quantity: c.unit for one in found for c in one.result.rows if not isinstance(c.measured, str)}

    def values(quantity: str, role: str) -> list[list[float]]:
        every = [[getattr(c, role) for c in one.result.rows if c.quantity == quantity] for one in found]
        return [[value for value in some if not isinstance(value, str)] for some in every]

    roles = (("predicted", TRUE), ("measured", MEASURED))
    rows = {
        f"{name} [{unit}]": [(role, "o", colour, values(name, role)) for role, colour in roles]
        for name, unit in units.items()
    }
    _draw(file, axes, sets, rows)


def _draw(file: Path, axes: Sequence[Axis], sets: Sets, rows: Mapping[str, Sequence[Points]]) -> None:
    """A panel for each row and each parameter."""
    count = max(len(rows), 1)
    with panels(file, count, len(axes), 3.6 * len(axes), max(3.0, 2.2 * count)) as (_, shown):
        for place, (name, lines) in enumerate(rows.items()):
            for i, axis in enumerate(axes):
                part = shown[place * len(axes) + i]
                column = [row[i] if isinstance(row[i], (int, float)) else str(row[i]) for row in sets]
                for label, marker, colour, found in lines:
                    pairs = [(value, one) for value, some in zip(column, found, strict=True) for one in some]
                    if pairs:
                        across, up = zip(*pairs, strict=True)
                        part.scatter(across, up, s=14, label=label, marker=marker, color=colour)
                part.set(xlabel=axis.name, ylabel=name)
                part.legend()
