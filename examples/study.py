"""An example of a study with three cases: the force that the testbed reaches, for each commanded force.

python3 examples/study.py --seeds 1 2 --jobs 2
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from wam_cli.commands.evaluate import program
from wam_control.task.scenario import ScenarioStep
from wam_description.configuration import Configuration
from wam_description.parameters import parameter
from wam_description.signals import ForceCommand
from wam_sim.simulation import Simulation
from wam_studies.harness import Study
from wam_studies.scores import Row, Scores, exact


class Press(NamedTuple):
    """A case: a force that is commanded, N, for some seconds."""

    configuration: Configuration
    force: float
    seconds: float


@dataclass(frozen=True)
class PressStudy(Study[Press, float]):
    """Three forces of 5 to 15 N that are drawn from the seed."""

    title: ClassVar[str] = "forces on the testbed"
    base: ClassVar[str] = "testbed"
    seconds: float = parameter("duration of each force", "s", low=1.0, default=2.0)

    def cases(self, seed: int) -> Iterator[Press]:
        """The presses of a seed."""
        for force in np.random.default_rng(seed).uniform(5.0, 15.0, 3).tolist():
            yield Press(self.configuration, force, self.seconds)

    @staticmethod
    def run(case: Press) -> float:
        """The error of the force at the end; a function of its case alone, so that any process can run it."""
        command = ForceCommand("link", (0.0, -case.force, 0.0))
        steps = [ScenarioStep("release", 0.3, request="enable"), ScenarioStep("press", case.seconds, force=command)]
        run = Simulation(case.configuration, steps)
        run.play()
        return -run.rows["force_measured"][-2].values[1] / case.force - 1.0

    def score(self, records: Sequence[float]) -> Scores:
        """The largest error, with what is required of it."""
        largest = exact(max(map(abs, records)), len(records))
        return Scores([Row("largest error", largest, "%", 100.0, required=(0.0, 0.1), target=(0.0, 0.01))])


if __name__ == "__main__":
    sys.exit(program("press", PressStudy))
