"""A bag prepared for analysis: its run, parameters, signals and the constant forces that were commanded."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.demo_summary import DemoSummary, failure_of, summary_of
from wam_analysis.held_messages import rows_before_gaps
from wam_analysis.recorded import PredictionParameters, prediction_parameters
from wam_analysis.thresholds import HOLD
from wam_bag.bag import Bag, JointColumns
from wam_bag.losses import CUT
from wam_sim.reactions import BRIEF, STEADY, RecordedReaction, of_force_loop, within
from wam_sim.recording import RecordedRun, recorded_run

Numbers = NDArray[np.float64]
Times = NDArray[np.int64]


class Hold(NamedTuple):
    """A constant commanded force.

    Attributes
    ----------
    name : of the scenario's step, or the force.
    begin, end : ns.
    frame : of the force.
    force : (3,), N, of the arm on the world, in that frame.
    commanded : its magnitude, N.
    disturbed : whether the scenario pushed the arm meanwhile.
    cover : on which a task commands it, '' where none does.
    axis : of a task with several forces, from 0; -1 where it is the only force.
    reactions : what the force loop did meanwhile instead of what was commanded.
    """

    name: str
    begin: int
    end: int
    frame: str
    force: Numbers
    commanded: float
    disturbed: bool
    cover: str = ""
    axis: int = -1
    reactions: tuple[RecordedReaction, ...] = ()

    @property
    def is_short(self) -> bool:
        """Whether the force was commanded too briefly for a steady state."""
        return self.end - self.begin < STEADY * 1e9

    @property
    def is_refused(self) -> bool:
        """Whether the force was not controlled in the end: there is nothing to measure of it."""
        return any(one.holds and one.end >= self.end - BRIEF for one in self.reactions)


class AnalysedRun(NamedTuple):
    """What the analyses take from a bag: its run, forces and contacts over time, parameters, and held forces.

    `is_foreign` is whether it is a recording of another robot.
    """

    run: RecordedRun
    summary: DemoSummary
    parameters: PredictionParameters
    holds: tuple[Hold, ...]
    is_foreign: bool = False

    @property
    def bag(self) -> Bag:
        """The bag of the run."""
        return self.run.bag

    @property
    def namespace(self) -> str:
        """Of the arm."""
        return self.run.namespace

    def lacking(self, *names: str) -> tuple[str, ...]:
        """Those of some topics that were not recorded."""
        refused = {one.topic for one in self.run.refused}
        return tuple(
            name
            for name in names
            if name not in refused
            and not ((columns := self.bag.topics.get(f"{self.namespace}/{name}")) and len(columns.log_time_ns))
        )

    @property
    def is_part(self) -> bool:
        """Whether it was cut out of a longer recording."""
        return CUT in self.bag.metadata

    @property
    def failure(self) -> str:
        """Why the run failed or that it was cut off; '' where it did not, or had no scenario and no fault."""
        return failure_of(self.run)

    @property
    def mode(self) -> str:
        """'lockstep', 'realtime' or 'unknown'."""
        return self.summary.loop.mode


def analysed_run(bag: Bag, namespace: str = "") -> AnalysedRun:
    """Prepare a bag for the analyses, whatever is in it; `namespace` as for `recorded_run`."""
    run = recorded_run(bag, namespace)
    summary = summary_of(run)
    return AnalysedRun(run, summary, prediction_parameters(run.parameters), _holds(run, summary))


def _holds(run: RecordedRun, summary: DemoSummary) -> tuple[Hold, ...]:
    """Intervals with one commanded force, within one step of the scenario."""
    holds: list[Hold] = []
    for hold in sorted((*_forces(run, summary), *_forces_of_tasks(summary)), key=lambda one: (one.begin, one.axis)):
        name = next((step.name for step in summary.steps if step.begin <= (hold.begin + hold.end) // 2 < step.end), "")
        taken = [hold.name for hold in holds]
        name = (name or f"{hold.commanded:.3g} N") + f", axis {hold.axis + 1}" * (hold.axis >= 0)
        name = name if name not in taken else f"{name} ({hold.begin / 1e9:.1f} s)"
        pushed = summary.traces.during(hold.begin, hold.end) & summary.traces.push.acts
        reactions = within(of_force_loop(summary.reactions), hold.begin, hold.end)
        holds.append(hold._replace(name=name, disturbed=bool(np.any(pushed)), reactions=reactions))
    return tuple(holds)


def _forces(run: RecordedRun, summary: DemoSummary) -> Iterator[Hold]:
    """Those of force_command, without names."""
    commands = run.wrench("force_command")
    if commands is None:
        return
    frames = np.array(commands.frames)
    changed = np.any(np.abs(np.diff(commands.force, axis=0)) > HOLD.equal_force, axis=1) | (frames[1:] != frames[:-1])
    steps = np.searchsorted(commands.stamp_ns, [step.begin for step in summary.steps])
    gaps = (rows_before_gaps(commands.stamp_ns) + 1).tolist()
    inner = {*(np.flatnonzero(changed) + 1).tolist(), *steps.tolist(), *gaps} - {0, len(frames)}
    bounds = [0, *sorted(inner), len(frames)]
    period = int(np.median(np.diff(commands.stamp_ns))) if len(frames) > 1 else 0
    for a, b in itertools.pairwise(bounds):
        force = commands.force[a]
        commanded = float(np.linalg.norm(force))
        begin, end = int(commands.stamp_ns[a]), int(commands.stamp_ns[b - 1]) + period
        if commanded > HOLD.equal_force and end - begin >= HOLD.shortest * 1e9:
            yield Hold("", begin, end, str(frames[a]), force, commanded, False)


def _forces_of_tasks(summary: DemoSummary) -> Iterator[Hold]:
    """Those of tasks, without names."""
    starts = [step.begin for step in summary.steps]
    for task in summary.tasks:
        commanded = float(np.linalg.norm(task.force))
        bounds = [task.begin, *(at for at in starts if task.begin < at < task.end), task.end]
        for begin, end in itertools.pairwise(bounds):
            if commanded > HOLD.equal_force and end - begin >= HOLD.shortest * 1e9:
                axis = -1 if task.is_only else task.number
                yield Hold("", begin, end, task.frame, task.force, commanded, False, task.cover, axis)


def at_stamps(columns: JointColumns, stamps: Times) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Whether there is a message with each of some stamps, and its row; columns must be sorted by stamp."""
    row = np.minimum(np.searchsorted(columns.stamp_ns, stamps), len(columns.stamp_ns) - 1)
    return columns.stamp_ns[row] == stamps, row


def by_names(columns: JointColumns, field: str, names: tuple[str, ...]) -> Numbers | None:
    """Columns of a field in the order of some names, (k, n); None if a name is missing."""
    values: Numbers = getattr(columns, field)
    if not values.shape[1] or any(name not in columns.names for name in names):
        return None
    order = [columns.names.index(name) for name in names]
    return values if order == list(range(values.shape[1])) else values[:, order]
