"""Constant forces that were commanded in a run, by themselves or in a task, each within one step of the scenario."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import held_of, intervals, step_at, value_changes
from wam_analysis.thresholds import HOLD
from wam_bag.arrays import Numbers
from wam_control.force.contact_place import pinned_position
from wam_control.force.task import TaskCommand, task_of
from wam_description.arm import Arm
from wam_description.parameters import ParameterError
from wam_description.signals import ForceCommand
from wam_sim.reactions import BRIEF, STEADY, RecordedReaction, RecordedStep, of_force_loop, within
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


def tasks_of(run: RecordedRun, arm: Arm | None) -> list[RecordedTask]:
    """Each task of a run; none if the arm is not known."""
    columns = run.table("task_command")
    if columns is None or arm is None:
        return []
    every = list(tables(columns))
    changes = np.array([one != before for before, one in pairwise(map(str, every))], np.bool_)
    found = []
    for row, begin, end in intervals(columns.stamp_ns, changes, held_of(run, "task_command")):
        with suppress(ParameterError):  # refused when it was commanded, too
            if (task := task_of(every[row], arm)) is not None:
                found.append((task, begin, end))
    return found


def task_forces(tasks: Iterable[RecordedTask]) -> Iterator[Hold]:
    """The forces at points of links in some tasks, in the order of time."""
    for task, begin, end in tasks:
        forces = [(i, axis) for i, axis in enumerate(task.axes) if axis.is_force and axis.cover and axis.value]
        for i, axis in forces:
            position = math.nan if axis.position is None else axis.position
            number = i if len(forces) > 1 else -1
            yield Hold(begin, end, task.frame, np.array(axis.direction) * axis.value, axis.cover, position, number)


def holds_of(
    run: RecordedRun, steps: Sequence[RecordedStep], tasks: Sequence[Hold], reactions: Sequence[RecordedReaction]
) -> tuple[Hold, ...]:
    """Intervals with one commanded force, in the order of time."""
    starts, holds = [step.begin for step in steps], dict[str, Hold]()
    parts = [
        one._replace(begin=begin, end=end)
        for one in (*_commanded(run), *tasks)
        for begin, end in pairwise([one.begin, *(at for at in starts if one.begin < at < one.end), one.end])
    ]
    long = [one for one in parts if one.commanded > HOLD.equal_force and one.end - one.begin >= HOLD.shortest * 1e9]
    for hold in sorted(long, key=lambda one: (one.begin, one.axis)):
        name = step_at(steps, (hold.begin + hold.end) // 2) or f"{hold.commanded:.3g} N"
        name += f", axis {hold.axis + 1}" * (hold.axis >= 0)
        name = name if name not in holds else f"{name} at {hold.begin / 1e9:.1f} s"
        own = within(of_force_loop(reactions), hold.begin, hold.end)
        holds[name] = hold._replace(name=name, reactions=own)
    return tuple(holds.values())


def _commanded(run: RecordedRun) -> Iterator[Hold]:
    """Those of force_command, without names."""
    commands = run.wrench("force_command")
    if commands is None:
        return
    frames = np.array(commands.frames)
    changed = value_changes(commands.force) | (frames[1:] != frames[:-1])
    for row, begin, end in intervals(commands.stamp_ns, changed, held_of(run, "force_command")):
        force, torque = (each[row] for each in (commands.force, commands.torque))
        command = ForceCommand(str(frames[row]), tuple(force.tolist()), tuple(torque.tolist()))
        _, position = pinned_position(command) or ("", math.nan)
        yield Hold(begin, end, command.frame, force, position=position)
