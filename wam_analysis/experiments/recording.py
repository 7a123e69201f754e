"""A bag as an experiment sees it: signals over time, parameters of the nodes, steps and what was said."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from wam_analysis.bag import Bag, BagError, JointColumns, Messages, WrenchColumns, read
from wam_analysis.bag_cut import CUT
from wam_description.arm import Shared
from wam_description.parameters import build_part, flatten

T = TypeVar("T")
Numbers = NDArray[np.float64]


class Joints(NamedTuple):
    """Times (k,) s and columns (k, n) of a JointState topic."""

    time: Numbers
    position: Numbers
    velocity: Numbers
    effort: Numbers


class Forces(NamedTuple):
    """Times (k,) s, forces (k, 3) N and frames of a WrenchStamped topic."""

    time: Numbers
    force: Numbers
    torque: Numbers
    frames: tuple[str, ...]


class Step(NamedTuple):
    """A step that was played, begin and end in s, with the live parameters that it set."""

    name: str
    begin: float
    end: float
    settings: Mapping[str, Any]


class Recording(NamedTuple):
    """One run.

    Attributes
    ----------
    parameters : flat values of each node, by its name without namespace, as they were at the start.
    steps : in the order in which they were played; of a bag that was cut only those that are whole in it.
    fault : why the driver stopped, '' where it did not.
    fault_time : s, NaN where it did not.
    outcome : last word of the scenario.
    """

    bag: Bag
    namespace: str
    parameters: Mapping[str, Mapping[str, Any]]
    steps: tuple[Step, ...]
    fault: str
    fault_time: float
    outcome: str

    @property
    def shared(self) -> Shared:
        """What every node read."""
        return build_part(Shared, next(iter(self.parameters.values())))

    def node(self, name: str, cls: type[T]) -> T:
        """The parameters of one node, at the start."""
        if name not in self.parameters:
            raise BagError(f"{self.bag.path} has no parameters of node '{name}'; it has: {', '.join(self.parameters)}")
        return build_part(cls, self.parameters[name])

    def part(self, name: str, prefix: str, cls: type[T]) -> T:
        """A part of a node's parameters, as ``part('driver', 'world.springs', Springs)``, whatever else it has."""
        return build_part(cls, self.parameters[name], f"{prefix}.")

    def joints(self, topic: str) -> Joints:
        """A JointState topic."""
        columns = self._columns(topic, JointColumns)
        return Joints(columns.stamp_ns / 1e9, columns.position, columns.velocity, columns.effort)

    def forces(self, topic: str) -> Forces:
        """A WrenchStamped topic."""
        columns = self._columns(topic, WrenchColumns)
        return Forces(columns.stamp_ns / 1e9, columns.force, columns.torque, tuple(columns.frames))

    def step(self, name: str) -> Step:
        """The first step of this name that was played."""
        for step in self.steps:
            if step.name == name:
                return step
        raise BagError(f"{self.bag.path}: step '{name}' was not played; steps: {', '.join(s.name for s in self.steps)}")

    def _columns(self, topic: str, kind: type[T]) -> T:
        columns = self.bag.topics.get(f"{self.namespace}/{topic}")
        if not isinstance(columns, kind):
            raise BagError(f"{self.bag.path} has no topic '{topic}' of {kind.__name__}; record it")
        return columns


def recording(path: Path) -> Recording:
    """Read a run from its bag, and from nothing else.

    Raises
    ------
    BagError
        where it cannot be read or has no parameters.
    """
    bag = read(path)
    if "parameters.yaml" not in bag.attachments:
        raise BagError(f"{path} has no parameters; it was not closed by the recorder")
    tree = yaml.safe_load(bag.attachments["parameters.yaml"])
    parameters = {name.rpartition("/")[2]: flatten(body["ros__parameters"]) for name, body in tree.items()}
    namespace = next(iter(tree)).rpartition("/")[0]
    said = bag.topics.get(f"{namespace}/status")
    if not isinstance(said, Messages):
        raise BagError(f"{path} has no topic 'status'; record it")
    steps, outcome = _steps(tuple(said.messages))
    steps = _whole(steps, int(bag.metadata.get(CUT, {}).get("begin_ns", 0)) / 1e9)
    fault, fault_time = "", float("nan")
    for message in said.messages:
        facts = {item.key: item.value for item in message.values}
        if message.name == "driver" and facts.get("fault") and not fault:
            fault, fault_time = facts["fault"], int(facts["stamp"]) / 1e9
    return Recording(bag, namespace, parameters, steps, fault, fault_time, outcome)


def _whole(steps: tuple[Step, ...], begin: float) -> tuple[Step, ...]:
    """Steps that began after a time, s; what those before it have set is set by the first of them."""
    before = [step for step in steps if step.begin < begin]
    found = steps[len(before) :]
    if not before or not found:
        return found
    settings = {key: value for step in (*before, found[0]) for key, value in step.settings.items()}
    return (found[0]._replace(settings=settings), *found[1:])


def _steps(messages: tuple[Any, ...]) -> tuple[tuple[Step, ...], str]:
    found: list[tuple[str, float, dict[str, Any]]] = []
    end, outcome = 0.0, ""
    for message in messages:
        if message.name != "scenario":
            continue
        facts = {item.key: item.value for item in message.values}
        if "stamp" not in facts:
            continue
        outcome, end = message.message, int(facts["stamp"]) / 1e9
        settings = {key: yaml.safe_load(value) for key, value in facts.items() if ":" in key}
        if found and found[-1][:2] == (outcome, end):  # said again with what it has set
            found[-1][2].update(settings)
        else:
            found.append((outcome, end, settings))
    ends = [*(begin for _, begin, _ in found[1:]), end]
    steps = [Step(name, begin, ends[i], settings) for i, (name, begin, settings) in enumerate(found)]
    return tuple(steps[:-1]), outcome
