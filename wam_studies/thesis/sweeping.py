"""The runs of experiments and tasks, also with many parameter sets: cases for a batch, without ROS."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from wam_bag.bag import BagError
from wam_control.task import scenario
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.wiring import raised
from wam_sim.simulated_bag import record
from wam_sim.sweep import Axis
from wam_studies.thesis.definition import Experiment, Run, configured
from wam_studies.thesis.evaluation import evaluate
from wam_studies.thesis.rows import Comparison


class SweptRun(NamedTuple):
    """A run of an experiment, and the directory of its bag."""

    experiment: Experiment
    run: Run
    directory: str


class ExperimentPoint(NamedTuple):
    """All runs of an experiment, with these values in place of their own."""

    experiment: Experiment
    values: tuple[tuple[str, Any], ...]


class ExperimentOutcome(NamedTuple):
    """The rows of the evaluation, or why there are none."""

    failure: str
    rows: tuple[Comparison, ...]


def points(experiment: Experiment, axes: Sequence[Axis], sets: Sequence[Sequence[Any]]) -> list[ExperimentPoint]:
    """The experiment with each of these parameter sets.

    Raises
    ------
    ParameterError
        where its configuration has no such parameter.
    """
    base = Configuration.load(packaged(experiment.configuration))
    named = [{axis.name: value for axis, value in zip(axes, values, strict=True)} for values in sets]
    for values in named:
        base.with_values(values)  # refuses unknown names before anything runs
    return [ExperimentPoint(experiment, tuple(values.items())) for values in named]


def record_run(case: SweptRun) -> str:
    """Record a run into a bag of its name, in lockstep without ROS; why it ended early, '' if it did not."""
    configuration = configured(case.experiment, case.run, Path(case.directory))
    steps = scenario.load_for(configuration, f"{case.directory}/{case.run.name}.yaml")
    return record(configuration, steps, Path(case.directory, case.run.name))


def outcome(point: ExperimentPoint) -> ExperimentOutcome:
    """Record every run and evaluate the bags; what is refused or does not end is a failure of this set alone."""
    experiment = point.experiment
    runs = tuple(run._replace(values={**run.values, **dict(point.values)}) for run in experiment.runs)
    experiment = experiment._replace(runs=runs)
    with TemporaryDirectory(prefix="wam_sweep_") as folder:
        try:
            for run in runs:
                record_run(SweptRun(experiment, run, folder))
            rows = evaluate(experiment, Path(folder)).rows
        except (ParameterError, BagError) as error:
            return ExperimentOutcome(str(error).replace(f"{folder}/", ""), ())
        except Exception as error:  # other sets go on
            return ExperimentOutcome(f"unexpected {raised(error)}", ())
    return ExperimentOutcome("", tuple(rows))
