"""The objects of a recording over time, from the simulator's truth."""

from typing import NamedTuple

import numpy as np

from wam_bag.bag import TableColumns
from wam_description.signals import ObjectState
from wam_description.world import World
from wam_studies.figures.panels import Numbers
from wam_studies.thesis.recording import Recording, Step

TOPIC = "sim/objects"


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


def world_of(run: Recording) -> World:
    """The world that the run was made in."""
    return run.part("driver", "world", World)


def object_states(run: Recording, time: float) -> list[ObjectState]:
    """Every object at a time, s, in the order of `World.objects`."""
    table = run.columns(TOPIC, TableColumns)
    at = int(np.searchsorted(table.stamp_ns, round(time * 1e9)).clip(0, len(table.stamp_ns) - 1))
    there = table.message == at
    return [ObjectState._make(row) for row in zip(*(table.columns[n][there] for n in ObjectState._fields), strict=True)]


def object_traces(run: Recording) -> dict[str, ObjectTrace]:
    """Every object of a run by its name.

    Raises
    ------
    BagError
        if the truth about the objects was not recorded.
    """
    table = run.columns(TOPIC, TableColumns)
    return {name: _trace(table, i) for i, name in enumerate(world_of(run).objects)}


def _trace(table: TableColumns, i: int) -> ObjectTrace:
    columns = table.columns
    mine = columns[ObjectState._fields[0]] == float(i)

    def three(name: str) -> Numbers:
        return np.column_stack([columns[name.format(axis)][mine] for axis in "xyz"])

    return ObjectTrace(
        table.row_stamp_ns[mine] / 1e9, three("{}"), three("v{}"), columns["angle"][mine], three("arm_force_{}"),
        three("arm_torque_{}"), three("other_force_{}"),
    )  # fmt: skip
