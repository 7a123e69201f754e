"""The judge of whole-arm contact estimation: draws scenes, plays them, scores them."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from wam_analysis.contact_battery_run import each, play
from wam_analysis.contact_battery_scenes import Draw, Scene
from wam_analysis.contact_battery_score import SceneScore, score
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


def judged(configuration: Configuration, scene: Scene) -> SceneScore:
    """Play a scene without ROS and score it."""
    return score(play(configuration, scene), configuration.shared.arm)


def judge(
    configuration: Configuration, drawn: Mapping[int, Sequence[Scene]], processes: int
) -> Iterator[tuple[int, SceneScore]]:
    """Play the scenes of every seed, in order; each scene's seed and score as they come."""
    order = [(seed, scene) for seed, own in drawn.items() for scene in own]
    scored = each(partial(judged, configuration), [scene for _, scene in order], processes)
    for (seed, _), scene in zip(order, scored, strict=True):
        yield seed, scene
