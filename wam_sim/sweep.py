"""One scenario with many parameter sets: how well each holds the commanded force."""

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wam_control.scenario import ScenarioStep
from wam_description.configuration import Configuration
from wam_description.parameters import ParameterError
from wam_description.wiring import raised
from wam_sim.batch import Report, results
from wam_sim.simulation import Simulation

SETTLED = 0.5  # part of the time of one commanded force, after which the error counts as settled


class Axis(NamedTuple):
    """A parameter of a sweep, as `Configuration.with_values` names it, and its values; a random one has two ends."""

    name: str
    values: tuple[Any, ...]


class SweepPoint(NamedTuple):
    """One run: values of the configuration and the scenario."""

    configuration: Configuration
    steps: tuple[ScenarioStep, ...]


class SweepResult(NamedTuple):
    """What a run gave; the forces are along the commanded direction and true, as only the simulator knows them.

    Attributes
    ----------
    failure : why the scenario failed or the parameters were refused, '' where neither.
    duration : of the arm's time, s.
    force_rms, force_worst : of commanded minus true force in the settled part of each commanded force, N.
    force_peak : largest true force, N.
    """

    failure: str
    duration: float
    force_rms: float
    force_worst: float
    force_peak: float


def grid(axes: Sequence[Axis]) -> list[tuple[Any, ...]]:
    """Every combination of the values."""
    return list(product(*(axis.values for axis in axes)))


def listed(axes: Sequence[Axis]) -> list[tuple[Any, ...]]:
    """The first values together, then the second ones and so on.

    Raises
    ------
    ValueError
        where one axis has more values than another.
    """
    if len({len(axis.values) for axis in axes}) > 1:
        counts = ", ".join(f"{axis.name}: {len(axis.values)}" for axis in axes)
        raise ValueError(f"a list needs as many values of each parameter; given are {counts}")
    return list(zip(*(axis.values for axis in axes), strict=True))


def drawn(axes: Sequence[Axis], count: int, seed: int) -> list[tuple[Any, ...]]:
    """Values drawn at random between the two ends of each axis, by their logarithm where both are above 0.

    Raises
    ------
    ValueError
        where an axis has not two numbers that rise.
    """
    random = np.random.default_rng(seed)
    for name, values in axes:
        if len(values) != 2 or not all(isinstance(v, (int, float)) for v in values) or not values[0] < values[1]:
            raise ValueError(f"{name} has the values {values}; a random sweep needs two numbers, low and high")
    return [
        tuple(
            float(low * (high / low) ** part) if low > 0.0 else float(low + (high - low) * part)
            for part, (_, (low, high)) in zip(random.random(len(axes)), axes, strict=True)
        )
        for _ in range(count)
    ]


def points(
    configuration: Configuration, steps: Sequence[ScenarioStep], axes: Sequence[Axis], sets: Sequence[Sequence[Any]]
) -> list[SweepPoint]:
    """The runs of these parameter sets.

    Raises
    ------
    ParameterError
        where the configuration has no such parameter.
    """
    found = []
    for values in sets:
        named = {axis.name: value for axis, value in zip(axes, values, strict=True)}
        found.append(SweepPoint(configuration.with_values(named), tuple(steps)))
    return found


def outcome(point: SweepPoint) -> SweepResult:
    """Play the scenario and measure; refused parameters are a failure of this run alone."""
    nothing = math.nan
    try:
        run = Simulation(point.configuration, point.steps)
        failure = run.play()
    except ParameterError as error:
        return SweepResult(str(error), 0.0, nothing, nothing, nothing)
    except Exception as error:  # other runs go on
        return SweepResult(f"unexpected {raised(error)}", 0.0, nothing, nothing, nothing)
    return _measured(run, failure)


def _measured(run: Simulation, failure: str) -> SweepResult:
    truth = {row.stamp: row for row in run.rows.get("sim/contact/wrench", [])}
    errors: list[float] = []
    held: list[float] = []
    commanded: tuple[Any, ...] = ()
    for row in run.rows.get("force_command", []):
        force, found = row.values[:3], truth.get(row.stamp)
        size = math.hypot(*force)
        if (row.frame, *row.values) != commanded:
            errors += held[int(SETTLED * len(held)) :]
            held, commanded = [], (row.frame, *row.values)
        if size and found and found.frame == row.frame:
            true = -sum(a * b for a, b in zip(force, found.values, strict=False)) / size
            held.append(size - true)
    errors += held[int(SETTLED * len(held)) :]
    peak = max((math.hypot(*row.values[:3]) for row in truth.values()), default=0.0)
    rms = math.sqrt(sum(e * e for e in errors) / len(errors)) if errors else math.nan
    return SweepResult(failure, run.driver.stamp * 1e-9, rms, max(map(abs, errors), default=math.nan), peak)


def sweep(
    runs: Sequence[SweepPoint], executor: Executor, folder: Path | None = None, report: Report | None = None
) -> list[SweepResult]:
    """The result of each run, in order; finished ones are kept in the folder, see `wam_sim.batch.results`."""
    return results(outcome, runs, executor, folder, report)
