"""How a task has ended: from its true force, not from what the loop measures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from wam_analysis.measures.limit_cycle import limit_cycle
from wam_description.event import OBEYED, Code, Event
from wam_description.event_text import sentence
from wam_description.rigid_body import Array
from wam_studies.force_benchmark.tasks import RANGES, Task


@dataclass(frozen=True)
class OutcomeLimits:
    """When a force counts as right, and what counts as a cycle or as motion."""

    tolerance: float = 0.1  # of the commanded force
    overshoot: float = 1.5  # of the commanded force, to which the impact (3.1) is added
    evaluated: int = 480  # inner periods at the end, whole cycles of the dither
    cycling: int = 2000  # inner periods at the end in which cycles are looked for
    confidence: float = 0.5  # of a cycle that counts
    predicted: float = 0.5  # of the size of a cycle, from which a prediction of the guard reports it
    still: float = 1e-3  # m, motion along the force below which the arm has not moved


OUTCOME = OutcomeLimits()


class TaskEnd(StrEnum):
    """How a task has ended."""

    DONE = "within 10 %"
    REFUSED = "refused with a reason"
    GIVEN_UP = "given up with a reason"
    ENDED = "ended with a reason"
    SILENT = "silent: wrong force that nothing reports"


class TaskTrace(NamedTuple):
    """What the simulator saw of a task.

    Attributes
    ----------
    forces : true force along the commanded direction, N, in each inner period from the command on.
    period : s.
    travel : largest motion of the touched point along the force, m.
    impact : largest force of the first touch by (3.1), N; 0 where nothing was touched.
    event : why the loop or the driver does not do the task, at the end; OBEYED if it does.
    is_stopped : whether the loop holds the arm instead, or the driver is in fault, at the end.
    predicted_cycle : peak to peak of the limit cycle that the guard reports, N.
    """

    forces: Array
    period: float
    travel: float
    impact: float
    event: Event
    is_stopped: bool
    predicted_cycle: float


class TaskResult(NamedTuple):
    """The outcome of a task.

    Attributes
    ----------
    outcome : how it has ended.
    mean, sd, peak : of the true force along the command, N; mean and sd at the end.
    limit : largest true force allowed, N.
    cycle : peak to peak of a limit cycle at the end, N; 0 without one.
    cycle_is_reported : whether the loop reports a reason, or the guard a cycle of this size.
    reason : of a refusal, an end or a warning.
    cause : its code, and the cause where the code has several; '' without a reason.
    is_over : whether the true force was above the largest allowed, or at the end above that of the last command.
    """

    outcome: TaskEnd
    mean: float
    sd: float
    peak: float
    limit: float
    cycle: float
    cycle_is_reported: bool
    reason: str
    cause: str
    is_over: bool

    @property
    def cycles_silently(self) -> bool:
        """Whether there is a limit cycle that nothing reports."""
        return self.cycle > 0.0 and not self.cycle_is_reported


def refused(task: Task, reason: str) -> TaskResult:
    """The result of a task that is refused before the start."""
    limit = OUTCOME.overshoot * task.force
    return TaskResult(TaskEnd.REFUSED, 0.0, 0.0, 0.0, limit, 0.0, False, reason, "parameters", is_over=False)


def evaluated(task: Task, trace: TaskTrace) -> TaskResult:
    """The result of a task that was played."""
    last = trace.forces[-OUTCOME.evaluated :]
    mean, peak = float(last.mean()), float(trace.forces.max())
    largest = max(task.force, task.before, float(trace.forces[0]) if task.approach else 0.0)
    cycle, limit = _cycle(task, trace), OUTCOME.overshoot * largest + trace.impact
    return TaskResult(
        outcome=_outcome(task, trace, mean, peak),
        mean=mean,
        sd=float(last.std()),
        peak=peak,
        limit=limit,
        cycle=cycle,
        cycle_is_reported=trace.event != OBEYED or trace.predicted_cycle >= OUTCOME.predicted * cycle > 0.0,
        reason=sentence(trace.event),
        cause=f"{trace.event.code} {trace.event.cause}".strip() if trace.event != OBEYED else "",
        is_over=peak > limit or mean > OUTCOME.overshoot * task.force + trace.impact,
    )


def worst(results: Sequence[TaskResult]) -> TaskResult:
    """The result of a task of several forces: that of the force that counts as the greatest failure."""
    order = list(TaskEnd)
    return max(results, key=lambda one: (one.is_over + one.cycles_silently, order.index(one.outcome)))


def _outcome(task: Task, trace: TaskTrace, mean: float, peak: float) -> TaskEnd:
    if trace.is_stopped and trace.travel < OUTCOME.still and peak == 0.0:
        return TaskEnd.REFUSED
    if abs(mean - task.force) <= OUTCOME.tolerance * task.force and not trace.is_stopped:
        return TaskEnd.DONE
    # the first command was obeyed, the second one is declined
    is_below = mean <= (1.0 + OUTCOME.tolerance) * task.force
    is_declined = task.before and peak <= OUTCOME.overshoot * task.before and is_below
    if trace.is_stopped and trace.event.code is not Code.FAULT and (peak <= task.force or is_declined):
        return TaskEnd.GIVEN_UP
    return TaskEnd.ENDED if trace.event != OBEYED else TaskEnd.SILENT


def _cycle(task: Task, trace: TaskTrace) -> float:
    """Peak to peak of a limit cycle above the tolerance, N, else 0; the dither is averaged out."""
    forces: Array = trace.forces[-OUTCOME.cycling :]
    if trace.is_stopped or len(forces) < OUTCOME.cycling:
        return 0.0
    if task.is_dithered:
        cycle = RANGES.dither_cycle
        forces = np.convolve(forces, np.full(cycle, 1.0 / cycle), "valid").astype(np.float64)
    time: Array = trace.period * np.arange(len(forces), dtype=np.float64)
    found = limit_cycle(time, forces)
    is_cycle = found.confidence > OUTCOME.confidence and found.peak_to_peak > OUTCOME.tolerance * task.force
    return found.peak_to_peak if is_cycle and math.isfinite(found.peak_to_peak) else 0.0
