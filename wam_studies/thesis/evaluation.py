"""From the bags of an experiment to its result."""

import importlib
from collections.abc import Callable
from pathlib import Path

from wam_bag.bag import BagError
from wam_bag.losses import CUT
from wam_description.configuration import shaped_like
from wam_description.event import Code
from wam_description.parameters import ParameterError
from wam_studies.thesis.definition import Experiment, Run
from wam_studies.thesis.recording import Recording, Runs, recording
from wam_studies.thesis.rows import Comparison, Result, plain

Evaluation = Callable[[Runs], Result]
LOWERED = "the guard lowered it; used: {}"


def evaluate(experiment: Experiment, directory: Path) -> Result:
    """Evaluate an experiment from its bags only.

    Parameters
    ----------
    directory : of the bags, each with the name of its run; or the bag of an experiment with one run; or the sample
        bag of the experiment.

    Raises
    ------
    BagError
        if a bag is missing, cannot be read or is of another run, or a run was not played to its end.
    """
    if (directory / "metadata.yaml").is_file() and CUT in (recorded := recording(directory)).bag.metadata:
        return evaluate_sample(experiment, recorded)
    bags = {run.name: directory / run.name for run in experiment.runs}
    if len(bags) == 1 and (directory / "metadata.yaml").is_file():
        bags = dict.fromkeys(bags, directory)
    missing = [name for name, bag in bags.items() if not bag.is_dir()]
    if missing:
        raise BagError(f"{directory} has no bag of {', '.join(missing)}; run 'wam experiment {experiment.name}'")
    recordings = {name: recording(bag) for name, bag in bags.items()}
    for run in experiment.runs:
        _require_own(experiment, run, recordings[run.name])
        _require_whole(experiment, run, recordings[run.name])
    return _evaluate(experiment, recordings)


def _require_whole(experiment: Experiment, run: Run, recorded: Recording) -> None:
    """Refuse a run that was interrupted, unless the driver is expected to stop it."""
    names = [str(step["name"]) for step in run.steps]
    if (recorded.outcome == Code.DONE and len(recorded.steps) >= len(names)) or (run.stops and recorded.fault):
        return
    started = [step.name for step in recorded.steps]
    if recorded.outcome in names:  # the last status of the scenario is the step that was running
        started.append(recorded.outcome)
    step = started[-1] if started else names[0]
    because = f" ({recorded.fault or recorded.outcome})" if recorded.outcome not in (*names, Code.DONE, "") else ""
    finished = max(len(started) - 1, 0)
    raise BagError(
        f"{recorded.bag.path}: run '{run.name}' ended in step '{step}', {finished} of {len(names)} steps "
        f"finished{because}; the evaluation needs all of them: repeat 'wam experiment {experiment.name}'"
    )


def _require_own(experiment: Experiment, run: Run, recorded: Recording) -> None:
    """Refuse the bag of another run: of another scenario, or with other values."""
    nodes, steps = recorded.parameters.nodes, [str(step["name"]) for step in run.steps]
    different = [step.name for step in recorded.steps if step.name not in steps]
    for key, value in run.values.items():
        node, _, name = key.rpartition(":")
        present = nodes.get(node or "scenario", {}).get(name)
        different += [key] * (name != "nodes" and present != shaped_like(present, value))
    script = str(nodes.get("scenario", {}).get("script", "unknown"))
    if different or not (recorded.steps or Path(script).stem == run.name):
        found = ", different: ".join([f"its scenario is {script}", *different[:1]])
        raise BagError(
            f"{recorded.bag.path} is no recording of run '{run.name}' of {experiment.name}: {found}; "
            f"give a bag of 'wam experiment {experiment.name}'"
        )


def evaluate_sample(experiment: Experiment, recorded: Recording) -> Result:
    """Evaluate the sample of an experiment.

    Parameters
    ----------
    recorded : the sample, or the whole run.

    Raises
    ------
    BagError
        if the experiment has no sample.
    """
    if experiment.sample is None:
        raise BagError(f"experiment {experiment.name} declares no sample; give the bags of its runs")
    _require_own(experiment, experiment.run(experiment.sample.run), recorded)
    return _evaluate(experiment, {experiment.sample.run: recorded})


def _evaluate(experiment: Experiment, recordings: Runs) -> Result:
    result = function_of(experiment.evaluation)(recordings)
    runs = [(run, recordings[run.name]) for run in experiment.runs if run.name in recordings]
    stops = [_stop(run, found) for run, found in runs if run.stops or found.fault]
    reported = tuple(
        f"{name.replace('_', ' ')}: {text}"
        for name, run in recordings.items()
        for text in (
            LOWERED.format(run.lowered) * bool(run.lowered),
            f"the driver stopped the arm at {run.fault_time:.2f} s: {run.fault}" * bool(run.fault),
        )
        if text
    )
    return result._replace(rows=[*result.rows, *stops], reported=reported)


def _stop(run: Run, recorded: Recording) -> Comparison:
    predicted, measured = ("stops the arm" if stops else "does not stop" for stops in (run.stops, bool(recorded.fault)))
    return Comparison(f"{run.name.replace('_', ' ')}, driver", predicted, measured)


def function_of(evaluation: str) -> Evaluation:
    """The function of a name: ``cables.creeping``, or ``my_package.my_module:function`` outside of this package.

    Raises
    ------
    ParameterError
        if there is no such function.
    """
    module, _, function = evaluation.partition(":" if ":" in evaluation else ".")
    path = module if ":" in evaluation else f"wam_studies.thesis.{module}"
    try:
        found: Evaluation = getattr(importlib.import_module(path), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise ParameterError(
            f"evaluation is '{evaluation}' ({error}); it must be MODULE.FUNCTION of wam_studies.thesis, "
            "or PACKAGE.MODULE:FUNCTION"
        ) from error
    return found


def text(experiment: Experiment, result: Result) -> str:
    """The result as plain text."""
    verdict = f"{'all' if result.agrees else 'NOT all'} quantities of this table are within their bounds"
    remarks = "".join(f"\n{remark}" for remark in (*result.remarks, *result.reported))
    return f"{experiment.title} (section {experiment.section})\n\n{plain(result.rows)}\n{remarks}\n{verdict}"
