"""Runs are recorded into bags and measured: of an experiment or task by its evaluation, of a scenario by its analysis.

Both also with many parameter sets.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from wam_analysis.findings.analysis import analyse
from wam_bag.errors import BagError, RecordingError
from wam_control.task.scenario import ScenarioStep, load_for, require_playable
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError
from wam_description.wiring import raised
from wam_sim.simulated_bag import record
from wam_sim.sweep import Values
from wam_studies.thesis.definition import Experiment, configured
from wam_studies.thesis.evaluation import LOWERED, evaluate
from wam_studies.thesis.rows import Result, of_finding


class ExperimentCase(NamedTuple):
    """An experiment, and the directory of its bags; without one they last until they are evaluated."""

    experiment: Experiment
    directory: str = ""


class ScenarioCase(NamedTuple):
    """A scenario and the configuration by which it is played."""

    configuration: Configuration
    steps: tuple[ScenarioStep, ...]


class MeasuredCase(NamedTuple):
    """The result of an experiment or a scenario, or why there is none."""

    failure: str
    result: Result = Result((), ())


def measure(case: ExperimentCase) -> MeasuredCase:
    """Record every run of an experiment and evaluate the bags."""
    experiment, kept = case

    def evaluated(directory: Path) -> MeasuredCase:
        for run in experiment.runs:
            configuration, bag = configured(experiment, run, directory), directory / run.name
            record(configuration, load_for(configuration, f"{bag}.yaml"), bag)
        return MeasuredCase("", evaluate(experiment, directory))

    found = _measured(evaluated, kept)
    # the curves of many sets would be too much to keep
    return found if kept else found._replace(result=found.result._replace(panels=()))


def measure_scenario(case: ScenarioCase) -> MeasuredCase:
    """Record a scenario and analyse the bag: the numbers of all sections, and what they name as wrong."""

    def analysed(directory: Path) -> MeasuredCase:
        require_playable("the scenario", case.steps, case.configuration)
        record(case.configuration, case.steps, directory / "run")
        recording, sections = analyse(directory / "run", lambda doing: None)
        lowered = recording.admitted[1]
        reported = [LOWERED.format(lowered)] * bool(lowered) + [one for section in sections for one in section.problems]
        rows = [of_finding(one) for section in sections for one in section.findings]
        return MeasuredCase(recording.failure, Result(rows, (), (), tuple(reported)))

    return _measured(analysed)


def _measured(work: Callable[[Path], MeasuredCase], kept: str = "") -> MeasuredCase:
    """Do what makes bags in a directory, in lockstep without ROS; what fails is a failure of this case alone."""
    with nullcontext(kept) if kept else TemporaryDirectory(prefix="wam_measured_") as directory:
        try:
            return work(Path(directory))
        except (ParameterError, BagError, RecordingError) as error:
            return MeasuredCase(str(error) if kept else str(error).replace(f"{directory}/", ""))
        except Exception as error:
            return MeasuredCase(f"unexpected {raised(error)}")


def swept(experiment: Experiment, sets: Iterable[Values]) -> list[ExperimentCase]:
    """The experiment with each of these parameter sets in place of its own values.

    Raises
    ------
    ParameterError
        where its configuration has no such parameter.
    """
    base = Configuration.load(packaged(experiment.configuration))
    cases = []
    for values in sets:
        base.with_values(values)  # refuses unknown names before anything runs
        runs = tuple(run._replace(values={**run.values, **values}) for run in experiment.runs)
        cases.append(ExperimentCase(experiment._replace(runs=runs)))
    return cases


def swept_scenario(
    configuration: Configuration, steps: Sequence[ScenarioStep], sets: Iterable[Values]
) -> list[ScenarioCase]:
    """The scenario with each of these parameter sets.

    Raises
    ------
    ParameterError
        where the configuration has no such parameter.
    """
    return [ScenarioCase(configuration.with_values(values), tuple(steps)) for values in sets]
