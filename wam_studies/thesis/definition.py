"""An experiment as data: its runs, and the function that evaluates them.

`config/experiments/NAME.yaml`, of a whole-arm task `config/tasks/NAME.yaml`, holds title, section, configuration,
evaluation, `include` (sets of values in `config/experiments/sets/`), values, runs with a name, values and the steps of
a scenario, and a sample: the part of a run that is kept in `bags/sample/NAME`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import yaml

from wam_control.task.scenario_values import known
from wam_description import yaml_text
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import require

FOLDER = "experiments"
TASKS = "tasks"
SETS = "experiments/sets"
T = TypeVar("T")


class Run(NamedTuple):
    """One recording: values in addition to those of the experiment, and the steps of its scenario."""

    name: str
    steps: Sequence[Mapping[str, Any]]
    values: Mapping[str, Any] = {}
    stops: bool = False  # whether the driver is expected to stop the arm


class SampleDefinition(NamedTuple):
    """The part of a run that is kept as a sample bag.

    Attributes
    ----------
    run : its name.
    shows : description.
    seconds : begin and end, of the arm's time.
    topics : kept of those recorded; None for all.
    thinned : of a topic, that the first of so many messages is kept.
    """

    run: str
    shows: str
    seconds: tuple[float, float]
    topics: tuple[str, ...] | None = None
    thinned: Mapping[str, int] = {}


class Experiment(NamedTuple):
    """Runs and their evaluation: `MODULE.FUNCTION` of `wam_studies.thesis` or `PACKAGE.MODULE:FUNCTION`."""

    title: str
    section: str
    configuration: str
    evaluation: str
    runs: tuple[Run, ...]
    include: tuple[str, ...] = ()
    values: Mapping[str, Any] = {}
    sample: SampleDefinition | None = None
    name: str = ""

    def run(self, name: str) -> Run:
        """The run of a name."""
        return next(run for run in self.runs if run.name == name)


def names() -> list[str]:
    """The experiments that come with the package."""
    return _names(FOLDER)


def tasks() -> list[str]:
    """The whole-arm tasks that come with the package."""
    return _names(TASKS)


def _names(folder: str) -> list[str]:
    return sorted(path.stem for path in (packaged("wam").parent / folder).glob("*.yaml"))


def load(name: str) -> Experiment:
    """Read an experiment.

    Parameters
    ----------
    name : of an experiment or task of the package, or the path of a YAML file.

    Raises
    ------
    ParameterError
        if there is none of this name, or the file is not an experiment.
    """
    if name.endswith(".yaml"):
        path = Path(name)
        require(path.is_file(), f"experiment {path} is not a file")
    else:
        every = [*names(), *tasks()]
        require(name in every, f"no experiment is named '{name}'; choose from {', '.join(every)}")
        path = packaged(f"{TASKS if name in tasks() else FOLDER}/{name}")
    experiment = _built(str(path), yaml_text.read(path, "experiment"), Experiment)
    require(bool(experiment.runs), f"{path}: 'runs' must be a list with at least one")
    sets = [yaml_text.read(packaged(f"{SETS}/{included}"), "set") for included in experiment.include]
    shared = {key: value for values in (*sets, experiment.values) for key, value in values.items()}
    runs = tuple(_run(f"{path}, run {i + 1}", body, shared) for i, body in enumerate(experiment.runs))
    doubled = sorted({run.name for run in runs if sum(run.name == other.name for other in runs) > 1})
    require(not doubled, f"{path}: several runs are named {', '.join(doubled)}")
    sample = None if experiment.sample is None else _sample(f"{path}, sample", experiment.sample, runs)
    return experiment._replace(name=path.stem, section=str(experiment.section), runs=runs, sample=sample)


def configured(experiment: Experiment, run: Run, directory: Path) -> Configuration:
    """The configuration of a run, recorded into `directory`; its steps are written next to the bag.

    Raises
    ------
    ParameterError
        if a value has no parameter or is not allowed.
    """
    base = with_run(Configuration.load(packaged(experiment.configuration)), run, directory)
    return base.with_values(
        {
            "nodes": [*base.shared.nodes, "scenario", "recorder"],
            "timing.mode": "lockstep",
            "timing.real_time_factor": 0.0,
            "recorder:directory": str(directory),
            "recorder:name": run.name,
        }
    )


def with_run(base: Configuration, run: Run, directory: Path) -> Configuration:
    """A configuration with the values of a run, and its steps as the scenario, written to `directory/NAME.yaml`.

    Raises
    ------
    ParameterError
        if a value has no parameter or is not allowed.
    """
    script = directory / f"{run.name}.yaml"
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text(yaml.safe_dump({"steps": list(run.steps)}, sort_keys=False), encoding="utf-8")
    return base.with_values({**run.values, "scenario:script": str(script)})


def _run(where: str, body: Any, shared: Mapping[str, Any]) -> Run:
    run = _built(where, body, Run)
    name = str(run.name)
    require(name == Path(name).name and name != "..", f"{where}: name is '{name}'; it must be valid for a directory")
    require(bool(run.steps), f"{where}: 'steps' must be a list with at least one")
    return run._replace(name=name, values={**shared, **run.values})


def _sample(where: str, body: Any, runs: Sequence[Run]) -> SampleDefinition:
    sample, names = _built(where, body, SampleDefinition), [run.name for run in runs]
    require(sample.run in names, f"{where}: no run is named '{sample.run}'; choose from {', '.join(names)}")
    seconds = list(sample.seconds)
    require(
        len(seconds) == 2 and 0.0 <= seconds[0] < seconds[1],
        f"{where}: 'seconds' is {seconds!r}; it must be start and end, [0.0, 4.0]",
    )
    topics = None if sample.topics is None else tuple(sample.topics)
    require(
        all(each > 0 for each in sample.thinned.values()) and set(sample.thinned) <= set(topics or sample.thinned),
        f"{where}: 'thinned' is {sample.thinned}; give each of some of the topics a number above 0",
    )
    return sample._replace(seconds=(float(seconds[0]), float(seconds[1])), topics=topics)


def _built(where: str, body: Any, kind: type[T]) -> T:
    """A tuple of this kind with the fields that a mapping gives."""
    fields, optional = kind._fields, kind._field_defaults  # type: ignore[attr-defined]
    known(where, body, fields, [key for key in fields if key not in optional])
    return kind(**body)
