"""The runs of an experiment of the thesis on the nodes, in lockstep."""

from collections.abc import Callable
from pathlib import Path

from wam_ros.bring_up import Composition, PlayedScenario
from wam_studies.thesis.definition import Experiment, Run, configured


def record(experiment: Experiment, each: Run, directory: Path, is_stopped: Callable[[float], bool]) -> PlayedScenario:
    """Record one run into a bag of its name in a directory; a function of the arm's time, s, may stop it.

    Raises
    ------
    ValueError
        where the scenario failed for another reason than that the driver protected the arm.
    """
    with Composition(configured(experiment, each, directory)) as composition:
        played = composition.play(is_stopped)
    if played.failure and not played.fault:
        raise ValueError(f"{experiment.name}, {each.name}: {played.failure}")
    return played
