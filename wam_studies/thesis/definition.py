"""An experiment as data: its runs, and the function that evaluates them.

`config/experiments/NAME.yaml`, of a whole-arm task `config/tasks/NAME.yaml`, holds title, section, configuration,
evaluation, `include` (sets of values in `config/experiments/sets/`), values, runs with a name, values and the steps of
a scenario, and a sample: the part of a run that is kept in `bags/sample/NAME`, and its evaluation.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from wam_description import yaml_text
from wam_description.configuration import Configuration, packaged
from wam_description.parameters import ParameterError, require

FOLDER = "experiments"
TASKS = "tasks"
SETS = "experiments/sets"
KEYS = ("title", "section", "configuration", "evaluation", "include", "values", "runs", "sample")
RUN_KEYS = ("name", "values", "steps", "stops")
SAMPLE_KEYS = ("run", "shows", "seconds", "topics", "thinned", "evaluation")


class Run(NamedTuple):
    """One recording: values in addition to those of the experiment, and the steps of its scenario."""

    name: str
    values: Mapping[str, Any]
    steps: Sequence[Mapping[str, Any]]
    stops: bool  # whether the driver is expected to stop the arm

    @property
    def seconds(self) -> float:
        """Length of all steps, s."""
        return sum(float(step["seconds"]) for step in self.steps)


class SampleDefinition(NamedTuple):
    """The part of a run that is kept as a sample bag.

    Attributes
    ----------
    run : its name.
    shows : description.
    begin, end : s of the arm's time.
    topics : kept of those recorded; None for all.
    thinned : of a topic, that the first of so many messages is kept.
    evaluation : of the sample, from a mapping with this run only.
    """

    run: str
    shows: str
    begin: float
    end: float
    topics: tuple[str, ...] | None
    thinned: Mapping[str, int]
    evaluation: str


class Experiment(NamedTuple):
    """Runs and their evaluation: `MODULE.FUNCTION` of `wam_studies.thesis` or `PACKAGE.MODULE:FUNCTION`."""

    name: str
    title: str
    section: str
    configuration: str
    evaluation: str
    runs: tuple[Run, ...]
    sample: SampleDefinition | None

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
        known = [*names(), *tasks()]
        require(name in known, f"no experiment is named '{name}'; choose from {', '.join(known)}")
        path = packaged(f"{TASKS if name in tasks() else FOLDER}/{name}")
    tree = _mapping(path)
    _keys(str(path), tree, KEYS, ("title", "section", "configuration", "evaluation", "runs"))
    shared: dict[str, Any] = {}
    for included in tree.get("include", ()):
        shared.update(_mapping(packaged(f"{SETS}/{included}")))
    shared.update(tree.get("values", {}))
    require(isinstance(tree["runs"], list) and bool(tree["runs"]), f"{path}: 'runs' must be a list with at least one")
    runs = tuple(_run(f"{path}, run {i + 1}", body, shared) for i, body in enumerate(tree["runs"]))
    doubled = sorted({run.name for run in runs if sum(run.name == other.name for other in runs) > 1})
    require(not doubled, f"{path}: several runs are named {', '.join(doubled)}")
    title, section, configuration, evaluation = (str(tree[key]) for key in KEYS[:4])
    sample = _sample(str(path), tree["sample"], evaluation, [run.name for run in runs]) if "sample" in tree else None
    return Experiment(path.stem, title, section, configuration, evaluation, runs, sample)


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
    require(isinstance(body, dict), f"{where} is {body!r}; it must be a mapping with name and steps")
    _keys(where, body, RUN_KEYS, ("name", "steps"))
    name = str(body["name"])
    require(name == Path(name).name and name != "..", f"{where}: name is '{name}'; it must be valid for a directory")
    require(
        isinstance(body["steps"], list) and bool(body["steps"]), f"{where}: 'steps' must be a list with at least one"
    )
    return Run(name, {**shared, **body.get("values", {})}, tuple(body["steps"]), bool(body.get("stops", False)))


def _sample(where: str, body: Any, evaluation: str, runs: Sequence[str]) -> SampleDefinition:
    require(isinstance(body, dict), f"{where}: 'sample' is {body!r}; it must be a mapping with run, shows and seconds")
    _keys(f"{where}, sample", body, SAMPLE_KEYS, ("run", "shows", "seconds"))
    name, seconds, topics = str(body["run"]), body["seconds"], body.get("topics")
    require(name in runs, f"{where}, sample: no run is named '{name}'; choose from {', '.join(runs)}")
    require(
        isinstance(seconds, list) and len(seconds) == 2 and 0.0 <= seconds[0] < seconds[1],
        f"{where}, sample: 'seconds' is {seconds!r}; it must be start and end, [0.0, 4.0]",
    )
    chosen = None if topics is None else tuple(map(str, topics))
    begin, end = map(float, seconds)
    thinned = {str(topic): int(each) for topic, each in body.get("thinned", {}).items()}
    require(
        all(each > 0 for each in thinned.values()) and set(thinned) <= set(chosen or thinned),
        f"{where}, sample: 'thinned' is {thinned}; give each of some of the topics a number above 0",
    )
    return SampleDefinition(
        name, str(body["shows"]), begin, end, chosen, thinned, str(body.get("evaluation", evaluation))
    )


def _mapping(path: Path) -> dict[str, Any]:
    try:
        tree = yaml_text.parse(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ParameterError(f"{path} is not YAML: {error}") from error
    require(isinstance(tree, dict), f"{path} is not a mapping of names to values")
    return dict(tree)


def _keys(where: str, body: Mapping[str, Any], allowed: Sequence[str], needed: Sequence[str]) -> None:
    for key in body:
        require(key in allowed, f"{where}: unknown key '{key}'; allowed: {', '.join(allowed)}")
    for key in needed:
        require(key in body, f"{where}: '{key}' is missing")
