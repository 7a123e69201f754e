"""Recordings made of signals with known answers, with the parameters that an experiment of the package has."""

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from wam_bag.bag import Bag, JointColumns, Messages, WrenchColumns
from wam_description.configuration import SHARED
from wam_sim.recorded_parameters import RecordedParameters
from wam_studies.thesis.definition import Experiment, configured
from wam_studies.thesis.recording import Recording, Step

NAMESPACE = "/wam"


def joints(time: Any, position: Any, velocity: Any = None, effort: Any = None) -> JointColumns:
    """Messages of one joint or motor; what is not given is zero."""

    def column(values: Any) -> Any:
        return np.broadcast_to(0.0 if values is None else values, len(time)).reshape(-1, 1).astype(float)

    stamps = np.round(np.asarray(time) * 1e9).astype(np.int64)
    return JointColumns(stamps, stamps, ("",) * len(time), ("one",), column(position), column(velocity), column(effort))


def forces(time: Any, force: Any, frame: str = "link", torque: Any = (0.0, 0.0, 0.0)) -> WrenchColumns:
    """Messages of a wrench, rows or one for all."""
    stamps = np.round(np.asarray(time) * 1e9).astype(np.int64)
    shape = (len(time), 3)
    return WrenchColumns(
        stamps,
        stamps,
        (frame,) * len(time),
        np.broadcast_to(force, shape).astype(float),
        np.broadcast_to(torque, shape).astype(float),
    )


def recorded(
    experiment: Experiment, number: int, topics: Mapping[str, Any], steps: tuple[Step, ...], folder: Path
) -> Recording:
    """A recording of a run of an experiment, with other signals than it would have."""
    sections = configured(experiment, experiment.runs[number], folder).sections
    parameters = {name: {**sections[SHARED], **own} for name, own in sections.items() if name != SHARED}
    bag = Bag(Path("made"), {f"{NAMESPACE}/{name}": columns for name, columns in topics.items()}, {}, {}, {})
    of_nodes = RecordedParameters("made", parameters, "", "", ())
    return Recording(bag, NAMESPACE, of_nodes, steps, "", float("nan"), "done")


def status(name: str, message: str, level: int = 0, **facts: str) -> SimpleNamespace:
    """A message of the topic status, as it is decoded."""
    return SimpleNamespace(
        name=name,
        message=message,
        level=level,
        values=[SimpleNamespace(key=key, value=value) for key, value in facts.items()],
    )


def said(*messages: SimpleNamespace) -> Messages:
    """The topic status."""
    return Messages(np.zeros(len(messages), dtype=np.int64), messages)
