"""The benchmark: generate scenarios, simulate them, score them."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from wam_description.configuration import Configuration
from wam_sim.batch import Report, results
from wam_studies.contact_benchmark.scenarios import BenchmarkScenario, ScenarioGenerator
from wam_studies.contact_benchmark.score import ScenarioScore, score
from wam_studies.contact_benchmark.simulation import play


class BenchmarkExtent(NamedTuple):
    """Size of the benchmark for one seed.

    Attributes
    ----------
    contacts : in motion.
    resting : contacts at rest, and as many again with dither if the velocity loop has it.
    free : s of motion without contact.
    """

    contacts: int
    resting: int
    free: float


class BenchmarkResult(NamedTuple):
    """Scores of every seed."""

    seeds: tuple[int, ...]
    scores: Mapping[int, list[ScenarioScore]]

    @property
    def total(self) -> list[ScenarioScore]:
        """All seeds together."""
        return [scenario for seed in self.seeds for scenario in self.scores[seed]]


def scenarios(
    configuration: Configuration,
    seed: int,
    extent: BenchmarkExtent,
    joint_sensors: bool = False,
    dither: Mapping[str, Any] | None = None,
) -> list[BenchmarkScenario]:
    """The scenarios of one seed.

    Parameters
    ----------
    joint_sensors : whether the estimator uses the joint sensors instead of the motors alone.
    dither : values that switch the dither on at rest, None if the velocity loop has none.
    """
    generator = ScenarioGenerator(configuration, seed, joint_sensors)
    found = generator.contacts(extent.contacts) + generator.free(extent.free) + generator.resting(extent.resting)
    return found + generator.resting(extent.resting, dither) if dither else found


class ScenarioTask(NamedTuple):
    """A scenario and its configuration."""

    configuration: Configuration
    scenario: BenchmarkScenario

    def __str__(self) -> str:
        return self.scenario.name


def evaluate_scenario(task: ScenarioTask) -> ScenarioScore:
    """Simulate a scenario without ROS and score it."""
    return score(play(*task), task.configuration.shared.arm)


def evaluate(
    configuration: Configuration,
    chosen: Sequence[BenchmarkScenario],
    executor: Executor,
    file: Path | None = None,
    report: Report | None = None,
) -> list[ScenarioScore]:
    """Score of each scenario, in order, simulated without ROS; the other arguments are those of `batch.results`."""
    tasks = [ScenarioTask(configuration, scenario) for scenario in chosen]
    return results(evaluate_scenario, tasks, executor, file, report)
