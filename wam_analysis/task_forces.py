"""Forces that a task commands, each as long as it was commanded, and what was measured of it."""

from collections.abc import Iterable
from itertools import groupby
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import rows_before_gaps
from wam_bag.arrays import Numbers, Times
from wam_control.force.task import AxisKind, TaskCommand, task_of
from wam_description.arm import Arm
from wam_description.parameters import ParameterError
from wam_description.signals import Table
from wam_sim.recording import RecordedRun
from wam_sim.replay import tables

RecordedTask = tuple[TaskCommand, int, int]  # with begin and end, ns


class TaskForce(NamedTuple):
    """A force of a task.

    Attributes
    ----------
    begin, end : ns.
    number : of its axis, from 0.
    is_only : whether it is the only force of the task.
    cover : on which it acts.
    frame : of the task, 'base' or a cover.
    force : of the arm on the world in that frame (3,), N.
    """

    begin: int
    end: int
    number: int
    is_only: bool
    cover: str
    frame: str
    force: Numbers


def task_forces(tasks: Iterable[RecordedTask]) -> list[TaskForce]:
    """The forces at points of links in some tasks, in the order of time."""
    return [force for task, begin, end in tasks for force in _of(task, begin, end)]


def tasks_of(run: RecordedRun, arm: Arm | None) -> list[RecordedTask]:
    """Each task of a run; none if the arm is not known."""
    columns = run.table("task_command")
    if columns is None or arm is None:
        return []
    stamps = columns.stamp_ns.tolist()
    gaps = rows_before_gaps(columns.stamp_ns)
    stretch = np.searchsorted(gaps, np.arange(len(stamps))).tolist()
    messages = zip(stamps, tables(columns), stretch, strict=True)
    parts = [next(part) for _, part in groupby(messages, lambda one: (str(one[1]), one[2]))]
    lasts = [*(stamps[row] for row in gaps), stamps[-1]]  # of each stretch
    ends = [*(begin for begin, *_ in parts[1:]), stamps[-1]]
    return [
        (task, begin, min(end, lasts[number]))
        for (begin, table, number), end in zip(parts, ends, strict=True)
        if (task := _task(table, arm)) is not None
    ]


def _task(table: Table, arm: Arm) -> TaskCommand | None:
    try:
        return task_of(table, arm)
    except ParameterError:  # refused when it was commanded, too
        return None


def _of(task: TaskCommand, begin: int, end: int) -> list[TaskForce]:
    forces = [
        (i, axis) for i, axis in enumerate(task.axes) if axis.kind is AxisKind.FORCE and axis.cover and axis.value
    ]
    return [
        TaskForce(begin, end, i, len(forces) == 1, axis.cover, task.frame, np.array(axis.direction) * axis.value)
        for i, axis in forces
        if axis.value
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
