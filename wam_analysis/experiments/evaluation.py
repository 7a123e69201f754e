"""From the bags of an experiment to its result, and to text and picture."""

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path

from wam_analysis.bag import BagError
from wam_analysis.bag_cut import CUT
from wam_analysis.experiments.definition import Experiment, Run
from wam_analysis.experiments.recording import Recording, recording
from wam_analysis.experiments.rows import Result, Row, plain

DONE = "done"  # what the scenario says at its end
Evaluation = Callable[[Mapping[str, Recording]], Result]


def evaluate(experiment: Experiment, directory: Path) -> Result:
    """Judge an experiment from its bags alone.

    Parameters
    ----------
    directory : holds a bag of the name of each run; or the bag of an experiment of one run; or is the sample of the
        experiment, which shows a part of it.

    Raises
    ------
    BagError
        where a bag is missing or cannot be read, or a run was not played to its end.
    """
    if (directory / "metadata.yaml").is_file() and CUT in (recorded := recording(directory)).bag.metadata:
        return judged_sample(experiment, recorded)
    bags = {run.name: directory / run.name for run in experiment.runs}
    if len(bags) == 1 and (directory / "metadata.yaml").is_file():
        bags = dict.fromkeys(bags, directory)
    missing = [name for name, bag in bags.items() if not bag.is_dir()]
    if missing:
        raise BagError(f"{directory} has no bag of {', '.join(missing)}; run 'wam experiment {experiment.name}'")
    recordings = {name: recording(bag) for name, bag in bags.items()}
    for run in experiment.runs:
        _require_whole(experiment, run, recordings[run.name])
    return _judged(experiment, experiment.evaluation, recordings)


def _require_whole(experiment: Experiment, run: Run, recorded: Recording) -> None:
    """Refuse a run that was interrupted; one that the driver is expected to stop ends with that."""
    names = [str(step["name"]) for step in run.steps]
    if (recorded.outcome == DONE and len(recorded.steps) >= len(names)) or (run.stops and recorded.fault):
        return
    begun = [step.name for step in recorded.steps]
    if recorded.outcome in names:  # what the scenario said last is the step that it was in
        begun.append(recorded.outcome)
    step = begun[-1] if begun else names[0]
    because = f" ({recorded.fault or recorded.outcome})" if recorded.outcome not in (*names, DONE, "") else ""
    raise BagError(
        f"{recorded.bag.path}: run '{run.name}' ended in step '{step}', {max(len(begun) - 1, 0)} of {len(names)} steps "
        f"are finished{because}; there is nothing to judge before all are: 'wam experiment {experiment.name}' runs "
        "it again"
    )


def judged_sample(experiment: Experiment, recorded: Recording) -> Result:
    """Judge what the sample of an experiment shows.

    Parameters
    ----------
    recorded : the sample, or the whole run that it is a part of.

    Raises
    ------
    BagError
        where the experiment has no sample.
    """
    if experiment.sample is None:
        raise BagError(f"experiment {experiment.name} declares no sample; give the bags of its runs")
    return _judged(experiment, experiment.sample.evaluation, {experiment.sample.run: recorded})


def _judged(experiment: Experiment, evaluation: str, recordings: Mapping[str, Recording]) -> Result:
    result = function_of(evaluation)(recordings)
    runs = [run for run in experiment.runs if run.name in recordings]
    stops = [_stop(run, recordings[run.name]) for run in runs if run.stops or recordings[run.name].fault]
    remarks = [
        f"{name.replace('_', ' ')}: the driver stopped the arm at {run.fault_time:.2f} s: {run.fault}"
        for name, run in recordings.items()
        if run.fault
    ]
    return Result([*result.rows, *stops], result.panels, (*result.remarks, *remarks))


def _stop(run: Run, recorded: Recording) -> Row:
    predicted, measured = ("stops the arm" if stops else "lets it run" for stops in (run.stops, bool(recorded.fault)))
    return Row(f"{run.name.replace('_', ' ')}, driver", predicted, measured)


def evaluation_of(experiment: Experiment) -> Evaluation:
    """The function that judges an experiment."""
    return function_of(experiment.evaluation)


def function_of(evaluation: str) -> Evaluation:
    """The function of a name, as ``cables.creeping``."""
    module, _, function = evaluation.partition(".")
    found: Evaluation = getattr(importlib.import_module(f"wam_analysis.experiments.{module}"), function)
    return found


def text(experiment: Experiment, result: Result) -> str:
    """What a terminal shows."""
    verdict = "every bound is kept" if result.agrees else "NOT every bound is kept"
    remarks = "".join(f"\n{remark}" for remark in result.remarks)
    return f"{experiment.title} (section {experiment.section})\n\n{plain(result.rows)}\n{remarks}\n{verdict}"
