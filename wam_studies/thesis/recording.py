"""A bag as an experiment sees it: signals over time, parameters of the nodes, steps and outcome, times in s."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from wam_bag.arrays import Numbers, Texts
from wam_bag.bag import Bag, BagError, JointColumns, PointColumns, TableColumns, WrenchColumns, read
from wam_bag.losses import CUT
from wam_description.arm import Shared
from wam_description.signals import ObjectState
from wam_description.world import World
from wam_sim.recorded_parameters import RecordedParameters
from wam_sim.recorded_run import recorded_run

OBJECTS = "sim/objects"
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
    frames: Texts

    def during(self, begin: float, end: float) -> "Forces":
        """The part between two times, s."""
        there = (self.time >= begin) & (self.time < end)
        return Forces._make(values[there] for values in self)

    @property
    def across(self) -> Numbers:
        """Size of the force across the link's axis, (k,) N."""
        return np.hypot(self.force[:, 1], self.force[:, 2])


class Step(NamedTuple):
    """A step that was played, begin and end in s, with the live parameters that it set."""

    name: str
    begin: float
    end: float
    settings: Mapping[str, Any]


class ObjectTrace(NamedTuple):
    """One object at the times (k,) s, in the base frame.

    Attributes
    ----------
    position, velocity : (k, 3), m and m/s.
    angle : (k,), of a door, rad.
    arm_force, arm_torque : (k, 3), of the arm on it, N, and about its position, N m.
    other_force : (k, 3), of obstacles and other objects on it, N.
    """

    time: Numbers
    position: Numbers
    velocity: Numbers
    angle: Numbers
    arm_force: Numbers
    arm_torque: Numbers
    other_force: Numbers

    def during(self, begin: float, end: float) -> "ObjectTrace":
        """The part between two times, s."""
        there = (self.time >= begin) & (self.time < end)
        return ObjectTrace(*(values[there] for values in self))

    def late(self, step: Step, seconds: float) -> "ObjectTrace":
        """The last seconds of a step."""
        return self.during(step.end - seconds, step.end)


class Recording(NamedTuple):
    """A recorded run of an experiment.

    Attributes
    ----------
    parameters : of the nodes, as they were at the start.
    steps : in the order in which they were played; of a bag that was cut only those that are whole in it.
    fault : why the driver stopped, '' where it did not.
    fault_time : s, NaN where it did not.
    outcome : DONE, why the scenario failed, or the step in which the recording ended.
    lowered : what the guard of the force loop lowered, '' where nothing.
    """

    bag: Bag
    namespace: str
    parameters: RecordedParameters
    steps: tuple[Step, ...]
    fault: str
    fault_time: float
    outcome: str
    lowered: str = ""

    @property
    def shared(self) -> Shared:
        """Parameters that every node read."""
        return self.parameters.shared

    def joints(self, topic: str) -> RecordedJoints:
        """Recorded columns of a JointState topic."""
        columns = self.columns(topic, JointColumns)
        return RecordedJoints(columns.stamp_ns / 1e9, columns.position, columns.velocity, columns.effort)

    def forces(self, topic: str) -> Forces:
        """Recorded forces of a WrenchStamped topic."""
        columns = self.columns(topic, WrenchColumns)
        return Forces(columns.stamp_ns / 1e9, columns.force, columns.torque, np.array(columns.frames, object))

    @property
    def world(self) -> World:
        """The world that the run was made in."""
        return self.parameters.part("driver", World, "world.")

    @property
    def objects(self) -> dict[str, ObjectTrace]:
        """Every object by its name; a run whose truth about them was not recorded is refused."""
        table = self.columns(OBJECTS, TableColumns)
        return {name: _trace(table, i) for i, name in enumerate(self.world.objects)}

    def object_states(self, time: float) -> list[ObjectState]:
        """Every object at a time, s, in the order of `World.objects`."""
        table = self.columns(OBJECTS, TableColumns)
        at = int(np.searchsorted(table.stamp_ns, round(time * 1e9)).clip(0, len(table.stamp_ns) - 1))
        there, of = table.message == at, table.columns
        return [ObjectState._make(row) for row in zip(*(of[n][there] for n in ObjectState._fields), strict=True)]

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


def _trace(table: TableColumns, i: int) -> ObjectTrace:
    columns = table.columns
    mine = columns[ObjectState._fields[0]] == float(i)

    def three(name: str) -> Numbers:
        return np.column_stack([columns[name.format(axis)][mine] for axis in "xyz"])

    return ObjectTrace(
        table.row_stamp_ns[mine] / 1e9, three("{}"), three("v{}"), columns["angle"][mine], three("arm_force_{}"),
        three("arm_torque_{}"), three("other_force_{}"),
    )  # fmt: skip


Runs = Mapping[str, Recording]  # of an experiment, by name


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
    stamp, fault = run.faults[0] if run.faults else (np.nan, "")
    outcome = run.outcome or next((step.name for step in run.begun[-1:]), "")
    lowered = "; ".join(sorted({status.facts.get("lowered", "nothing") for status in run.statuses} - {"nothing"}))
    return Recording(run.bag, run.namespace, run.parameters, _whole(steps, begin), fault, stamp / 1e9, outcome, lowered)


def _whole(steps: tuple[Step, ...], begin: float) -> tuple[Step, ...]:
    """Steps that began after a time, s; what those before it have set is set by the first of them."""
    before = [step for step in steps if step.begin < begin]
    found = steps[len(before) :]
    if not before or not found:
        return found
    settings = {key: value for step in (*before, found[0]) for key, value in step.settings.items()}
    return (found[0]._replace(settings=settings), *found[1:])
