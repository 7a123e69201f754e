"""The judge of whole-arm contact estimation: draws scenes, plays them, scores them."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from wam_analysis.batch import Report, results
from wam_analysis.contact_battery.run import play
from wam_analysis.contact_battery.scenes import Draw, Scene
from wam_analysis.contact_battery.score import SceneScore, score
from wam_description.configuration import Configuration


class Extent(NamedTuple):
    """How much one seed plays.

    Attributes
    ----------
    contacts : in motion.
    resting : at rest, as many again with dither where the velocity loop can.
    free : s of motion without contact.
    """

    contacts: int
    resting: int
    free: float


class Judgement(NamedTuple):
    """What every seed gave."""

    seeds: tuple[int, ...]
    scores: Mapping[int, list[SceneScore]]

    @property
    def total(self) -> list[SceneScore]:
        """All seeds together."""
        return [scene for seed in self.seeds for scene in self.scores[seed]]


def scenes(
    configuration: Configuration,
    seed: int,
    extent: Extent,
    joint_sensors: bool = False,
    dither: Mapping[str, Any] | None = None,
) -> list[Scene]:
    """The scenes of one seed.

    Parameters
    ----------
    joint_sensors : whether the estimator feels with the joint sensors instead of the motors alone.
    dither : values that make the arm dither at rest, None where it cannot.
    """
    draw = Draw(configuration, seed, joint_sensors)
    found = draw.contacts(extent.contacts) + draw.free(extent.free) + draw.resting(extent.resting)
    return found + draw.resting(extent.resting, dither) if dither else found


class Task(NamedTuple):
    """A scene and the configuration that it is played with."""

    configuration: Configuration
    scene: Scene


def judged(task: Task) -> SceneScore:
    """Play a scene without ROS and score it."""
    return score(play(*task), task.configuration.shared.arm)


def judge(
    configuration: Configuration,
    drawn: Sequence[Scene],
    executor: Executor,
    folder: Path | None = None,
    report: Report | None = None,
) -> list[SceneScore]:
    """Play scenes without ROS; the score of each, in order; the rest is that of `batch.results`."""
    return results(judged, [Task(configuration, scene) for scene in drawn], executor, folder, report)
