"""Forces that a task commands, each as long as it was commanded, and what was measured of it."""

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import intervals
from wam_bag.arrays import Numbers, Times
from wam_control.force.task import AxisKind, TaskCommand, task_of
from wam_description.arm import Arm
from wam_description.parameters import ParameterError
from wam_description.signals import Table
from wam_sim.reactions import BRIEF, STEADY, RecordedReaction
from wam_sim.recorded_run import RecordedRun
from wam_sim.replay import tables

RecordedTask = tuple[TaskCommand, int, int]  # with begin and end, ns


class Hold(NamedTuple):
    """A constant commanded force.

    Attributes
    ----------
    begin, end : ns.
    frame : of the force, 'base' or a cover.
    force : (3,), N, of the arm on the world, in that frame.
    cover : on which a task commands it, '' where none does.
    position : where the command pins it, m along its cover; NaN where it does not.
    axis : of a task with several forces, from 0; -1 where it is the only force.
    name : of the scenario's step, or the force.
    disturbed : whether the scenario pushed the arm meanwhile.
    reactions : what the force loop did meanwhile instead of what was commanded.
    """

    begin: int
    end: int
    frame: str
    force: Numbers
    cover: str = ""
    position: float = math.nan
    axis: int = -1
    name: str = ""
    disturbed: bool = False
    reactions: tuple[RecordedReaction, ...] = ()

    @property
    def commanded(self) -> float:
        """Magnitude of the force, N."""
        return float(np.linalg.norm(self.force))

    @property
    def is_short(self) -> bool:
        """Whether the force was commanded too briefly for a steady state."""
        return self.end - self.begin < STEADY * 1e9

    @property
    def is_refused(self) -> bool:
        """Whether the force was not controlled in the end: there is nothing to measure of it."""
        return any(one.holds and one.end >= self.end - BRIEF for one in self.reactions)


def task_forces(tasks: Iterable[RecordedTask]) -> list[Hold]:
    """The forces at points of links in some tasks, in the order of time."""
    return [force for task, begin, end in tasks for force in _of(task, begin, end)]


def tasks_of(run: RecordedRun, arm: Arm | None) -> list[RecordedTask]:
    """Each task of a run; none if the arm is not known."""
    columns = run.table("task_command")
    if columns is None or arm is None:
        return []
    every = list(tables(columns))
    changes = np.array([one != before for before, one in pairwise(map(str, every))], np.bool_)
    found = ((_task(every[row], arm), begin, end) for row, begin, end in intervals(columns.stamp_ns, changes))
    return [(task, begin, end) for task, begin, end in found if task is not None]


def _task(table: Table, arm: Arm) -> TaskCommand | None:
    try:
        return task_of(table, arm)
    except ParameterError:  # refused when it was commanded, too
        return None


def _of(task: TaskCommand, begin: int, end: int) -> list[Hold]:
    forces = [
        (i, axis) for i, axis in enumerate(task.axes) if axis.kind is AxisKind.FORCE and axis.cover and axis.value
    ]
    return [
        Hold(
            begin,
            end,
            task.frame,
            np.array(axis.direction) * axis.value,
            axis.cover,
            math.nan if axis.position is None else axis.position,
            i if len(forces) > 1 else -1,
        )
        for i, axis in forces
    ]


def measured_force(run: RecordedRun, number: int, begin: int, end: int) -> tuple[Times, Numbers]:
    """Stamps, ns, and the force that was measured along an axis of a task, N, between two times."""
    columns = run.table("task_axes")
    if columns is None or "measured" not in columns.columns:
        return np.empty(0, np.int64), np.empty(0)
    place = np.arange(len(columns.message)) - np.searchsorted(columns.message, columns.message)  # within its message
    stamps = columns.row_stamp_ns
    rows = (place == number) & (stamps >= begin) & (stamps < end)
    return stamps[rows], np.asarray(columns.columns["measured"][rows], float)
