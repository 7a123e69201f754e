"""The constant forces that were commanded in a run, each within one step of the scenario."""

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from wam_analysis.held_messages import intervals
from wam_analysis.task_forces import Hold
from wam_analysis.thresholds import HOLD
from wam_analysis.traces import Traces
from wam_control.force.contact_place import pinned_position
from wam_description.signals import ForceCommand
from wam_sim.reactions import RecordedReaction, of_force_loop, within
from wam_sim.recorded_run import RecordedRun, RecordedStep


def holds_of(
    run: RecordedRun,
    steps: Sequence[RecordedStep],
    tasks: Sequence[Hold],
    traces: Traces,
    reactions: Sequence[RecordedReaction],
) -> tuple[Hold, ...]:
    """Intervals with one commanded force, in the order of time."""
    holds: list[Hold] = []
    found = (*_forces(run, steps), *_forces_of_tasks(steps, tasks))
    long = [one for one in found if one.commanded > HOLD.equal_force and one.end - one.begin >= HOLD.shortest * 1e9]
    for hold in sorted(long, key=lambda one: (one.begin, one.axis)):
        name = next((step.name for step in steps if step.begin <= (hold.begin + hold.end) // 2 < step.end), "")
        taken = [hold.name for hold in holds]
        name = (name or f"{hold.commanded:.3g} N") + f", axis {hold.axis + 1}" * (hold.axis >= 0)
        name = name if name not in taken else f"{name} ({hold.begin / 1e9:.1f} s)"
        pushed = traces.during(hold.begin, hold.end) & traces.push.acts
        own = within(of_force_loop(reactions), hold.begin, hold.end)
        holds.append(hold._replace(name=name, disturbed=bool(np.any(pushed)), reactions=own))
    return tuple(holds)


def _forces(run: RecordedRun, steps: Sequence[RecordedStep]) -> Iterator[Hold]:
    """Those of force_command, without names."""
    commands = run.wrench("force_command")
    if commands is None:
        return
    frames = np.array(commands.frames)
    changed = np.any(np.abs(np.diff(commands.force, axis=0)) > HOLD.equal_force, axis=1) | (frames[1:] != frames[:-1])
    starts = np.searchsorted(commands.stamp_ns, [step.begin for step in steps]) - 1
    changed[starts[(starts >= 0) & (starts < len(changed))]] = True
    for row, begin, end in intervals(commands.stamp_ns, changed):
        force, torque = (each[row] for each in (commands.force, commands.torque))
        command = ForceCommand(str(frames[row]), tuple(force.tolist()), tuple(torque.tolist()))
        _, position = pinned_position(command) or ("", math.nan)
        yield Hold(begin, end, command.frame, force, position=position)


def _forces_of_tasks(steps: Sequence[RecordedStep], tasks: Sequence[Hold]) -> Iterator[Hold]:
    """Those of tasks, without names."""
    starts = [step.begin for step in steps]
    for task in tasks:
        bounds = [task.begin, *(at for at in starts if task.begin < at < task.end), task.end]
        for begin, end in itertools.pairwise(bounds):
            yield task._replace(begin=begin, end=end)
