"""A bag as an experiment sees it: signals over time, parameters of the nodes, steps and outcome, times in s."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from wam_bag.arrays import Numbers
from wam_bag.bag import Bag, BagError, JointColumns, PointColumns, TableColumns, WrenchColumns, read
from wam_bag.losses import CUT
from wam_description.arm import Shared
from wam_sim.recorded_parameters import RecordedParameters
from wam_sim.recording import recorded_run

T = TypeVar("T")


class RecordedJoints(NamedTuple):
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

    def during(self, begin: float, end: float) -> "Forces":
        """The part between two times, s."""
        there = (self.time >= begin) & (self.time < end)
        frames = tuple(np.array(self.frames, dtype=str)[there].tolist())
        return Forces(self.time[there], self.force[there], self.torque[there], frames)

    @property
    def across(self) -> Numbers:
        """Size across the link's axis, (k,) N."""
        found: Numbers = np.hypot(self.force[:, 1], self.force[:, 2])
        return found


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
    parameters : of the nodes, as they were at the start.
    steps : in the order in which they were played; of a bag that was cut only those that are whole in it.
    fault : why the driver stopped, '' where it did not.
    fault_time : s, NaN where it did not.
    outcome : DONE, why the scenario failed, or the step in which the recording ended.
    """

    bag: Bag
    namespace: str
    parameters: RecordedParameters
    steps: tuple[Step, ...]
    fault: str
    fault_time: float
    outcome: str

    @property
    def shared(self) -> Shared:
        """What every node read."""
        return self.parameters.shared

    def node(self, name: str, cls: type[T]) -> T:
        """The parameters of one node, at the start."""
        return self.parameters.part(name, cls)

    def part(self, name: str, prefix: str, cls: type[T]) -> T:
        """A part of a node's parameters, as ``part('driver', 'world.springs', Springs)``, whatever else it has."""
        return self.parameters.part(name, cls, f"{prefix}.")

    def joints(self, topic: str) -> RecordedJoints:
        """A JointState topic."""
        columns = self.columns(topic, JointColumns)
        return RecordedJoints(columns.stamp_ns / 1e9, columns.position, columns.velocity, columns.effort)

    def forces(self, topic: str) -> Forces:
        """A WrenchStamped topic."""
        columns = self.columns(topic, WrenchColumns)
        return Forces(columns.stamp_ns / 1e9, columns.force, columns.torque, tuple(columns.frames))

    def table(self, topic: str) -> tuple[Numbers, Mapping[str, Numbers]]:
        """Times (p,) s and columns (p,) of the rows of a table."""
        found = self.columns(topic, TableColumns)
        return found.stamp_ns[found.message] / 1e9, found.columns

    def step(self, name: str) -> Step:
        """The first step of this name that was played."""
        for step in self.steps:
            if step.name == name:
                return step
        raise BagError(f"{self.bag.path}: step '{name}' was not played; steps: {', '.join(s.name for s in self.steps)}")

    def positions(self, topic: str) -> tuple[Numbers, Numbers]:
        """Times (k,) s and positions along the link (k,) m of a topic of contact points."""
        found = self.columns(topic, PointColumns)
        return found.stamp_ns / 1e9, found.point[:, 0]

    def columns(self, topic: str, kind: type[T]) -> T:
        """The columns of a topic.

        Raises
        ------
        BagError
            if there are none of this kind.
        """
        columns = self.bag.topics.get(f"{self.namespace}/{topic}")
        if not isinstance(columns, kind):
            raise BagError(f"{self.bag.path} has no topic '{topic}' of {kind.__name__}; record it")
        return columns


def recording(path: Path) -> Recording:
    """Read a run from its bag, and from nothing else.

    Raises
    ------
    BagError
        if it cannot be read, or has no parameters or no status.
    """
    run = recorded_run(read(path))
    if run.parameters.problem:
        raise BagError(f"{path}: {run.parameters.problem}; was it closed by the recorder?")
    if not run.statuses:
        raise BagError(f"{path} has no topic 'status'; record it")
    steps = tuple(Step(step.name, step.begin / 1e9, step.end / 1e9, step.settings) for step in run.steps)
    begin = int(run.bag.metadata.get(CUT, {}).get("begin_ns", 0)) / 1e9
    stamp, fault = run.faults[0] if run.faults else (0, "")
    outcome = run.unfinished.name if run.unfinished else run.outcome
    fault_time = stamp / 1e9 if fault else float("nan")
    return Recording(run.bag, run.namespace, run.parameters, _whole(steps, begin), fault, fault_time, outcome)


def _whole(steps: tuple[Step, ...], begin: float) -> tuple[Step, ...]:
    """Steps that began after a time, s; what those before it have set is set by the first of them."""
    before = [step for step in steps if step.begin < begin]
    found = steps[len(before) :]
    if not before or not found:
        return found
    settings = {key: value for step in (*before, found[0]) for key, value in step.settings.items()}
    return (found[0]._replace(settings=settings), *found[1:])
