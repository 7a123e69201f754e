"""Many tasks on an executor, kept in a file as they are finished."""

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

from wam_description.configuration import Configuration
from wam_sim.batch import Report, results
from wam_studies.force_benchmark.outcome import TaskResult
from wam_studies.force_benchmark.results_file import append, key, opened, read
from wam_studies.force_benchmark.tasks import Task, draw
from wam_studies.force_benchmark.trial import perform


class ForceTrial(NamedTuple):
    """A task of the benchmark and its result."""

    number: int
    task: Task
    result: TaskResult


class _Input(NamedTuple):
    configuration: Configuration
    task: Task
    seconds: float


def _perform(given: _Input) -> TaskResult:
    return perform(*given)


def evaluate(
    configuration: Configuration,
    seed: int,
    numbers: Sequence[int],
    seconds: float,
    executor: Executor,
    file: Path,
    report: Report,
) -> list[ForceTrial]:
    """Tasks of a seed with their results, in order of their numbers.

    Parameters
    ----------
    configuration : under test.
    seed, numbers : of the tasks.
    seconds : of the whole force of each.
    executor : see `wam_sim.batch`.
    file : of finished tasks; those in it are not done again, new ones are added to it.
    report : called with the numbers of finished and of all tasks.
    """
    of = key(configuration, seed, seconds)
    done = read(file, of)
    tasks = {number: draw(configuration.shared.arm, seed, number) for number in numbers}
    left = [number for number in numbers if number not in done]
    before = len(numbers) - len(left)
    with opened(file) as stream:

        def take(i: int, result: TaskResult) -> None:
            append(stream, of, left[i], tasks[left[i]], result)
            done[left[i]] = result

        inputs = [_Input(configuration, tasks[number], seconds) for number in left]
        results(_perform, inputs, executor, None, lambda new, _: report(before + new, len(numbers)), take)
    return [ForceTrial(number, tasks[number], done[number]) for number in numbers]
