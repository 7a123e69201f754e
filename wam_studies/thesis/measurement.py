"""An experiment or a task is measured: its runs are recorded into bags and evaluated; also with many parameter sets."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from wam_bag.errors import BagError, RecordingError
from wam_control.task.scenario import load_for
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.wiring import raised
from wam_sim.simulated_bag import record
from wam_sim.sweep import Axis
from wam_studies.thesis.definition import Experiment, configured
from wam_studies.thesis.evaluation import evaluate
from wam_studies.thesis.rows import Result


class ExperimentCase(NamedTuple):
    """An experiment, and the directory of its bags; without one they last until they are evaluated."""

    experiment: Experiment
    directory: str = ""


class ExperimentRecord(NamedTuple):
    """The result of an experiment, or why there is none."""

    failure: str
    result: Result = Result((), ())


def measure(case: ExperimentCase) -> ExperimentRecord:
    """Record every run, in lockstep without ROS, and evaluate the bags; what fails is a failure of this case alone."""
    experiment, kept = case
    with nullcontext(kept) if kept else TemporaryDirectory(prefix="wam_experiment_") as directory:
        try:
            for run in experiment.runs:
                configuration, bag = configured(experiment, run, Path(directory)), Path(directory, run.name)
                record(configuration, load_for(configuration, f"{bag}.yaml"), bag)
            result = evaluate(experiment, Path(directory))
        except (ParameterError, BagError, RecordingError) as error:
            return ExperimentRecord(str(error) if kept else str(error).replace(f"{directory}/", ""))
        except Exception as error:
            return ExperimentRecord(f"unexpected {raised(error)}")
    # the curves of many sets would be too much to keep
    return ExperimentRecord("", result if kept else result._replace(panels=()))


def swept(experiment: Experiment, axes: Sequence[Axis], sets: Sequence[Sequence[Any]]) -> list[ExperimentCase]:
    """The experiment with each of these parameter sets in place of its own values.

    Raises
    ------
    ParameterError
        where its configuration has no such parameter.
    """
    base = Configuration.load(packaged(experiment.configuration))
    cases = []
    for values in sets:
        named = {axis.name: value for axis, value in zip(axes, values, strict=True)}
        base.with_values(named)  # refuses unknown names before anything runs
        runs = tuple(run._replace(values={**run.values, **named}) for run in experiment.runs)
        cases.append(ExperimentCase(experiment._replace(runs=runs)))
    return cases
