"""Contacts while neither a force nor a task is commanded and nothing pushes: harder than the configuration allows."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wam_analysis.demo_traces import Mask, Traces, held_rows
from wam_bag.bag import BagError, TableColumns
from wam_control.force_loop_parameters import ForceLoopParameters
from wam_sim.recording import RecordedRun, RecordedStep

AFTER = 100_000_000  # ns, for which the force of a push or a press may last after its command


class HardContact(NamedTuple):
    """The hardest moment of the unplanned contacts in a step.

    Attributes
    ----------
    step : name of the step.
    seconds : when, s, counted as in `Traces.zero`.
    force, allowed : N, of all that acts, and `limits.contact_force` of the force loop.
    source : 'true', or 'estimated' where the true contact was not recorded.
    """

    step: str
    seconds: float
    force: float
    allowed: float
    source: str

    @property
    def sentence(self) -> str:
        """What was too hard, and when."""
        return (
            f"{self.step}: TOO HARD: a contact with {self.force:.3g} N ({self.source}, at {self.seconds:.2f} s) while "
            f"no force was commanded; allowed: limits.contact_force, {self.allowed:g} N."
        )


def hard_contacts(run: RecordedRun, traces: Traces, steps: Sequence[RecordedStep]) -> tuple[HardContact, ...]:
    """Of each step in which one was harder than allowed; none where the parameters are not known."""
    found, settings = [], dict[str, Any]()
    is_planned = _planned(run, traces)
    for step in steps:
        settings |= step.settings
        try:
            own = run.parameters.with_values(settings).part("force_loop", ForceLoopParameters)
        except BagError:
            return ()
        rows = np.flatnonzero(traces.during(step.begin, step.end) & ~is_planned)
        source, signal = "true", traces.true
        if not np.any(signal.is_known[rows]):
            source, signal = "estimated", traces.estimated
        if not np.any(signal.acts[rows]):
            continue
        hardest = int(rows[np.nanargmax(signal.size[rows])])
        force, allowed = float(signal.size[hardest]), own.limits.contact_force
        if force > allowed:
            seconds = (int(traces.stamp[hardest]) - traces.zero) / 1e9
            found.append(HardContact(step.name, seconds, force, allowed, source))
    return tuple(found)


def _planned(run: RecordedRun, traces: Traces) -> Mask:
    """Whether a force, a push or a task is commanded, or was until shortly before, (k,)."""
    acts = traces.commanded.acts | traces.push.acts | _of_task(run, traces)
    if not np.any(acts):
        return acts
    last = np.maximum.accumulate(np.where(acts, traces.stamp, 0))
    planned: Mask = (last > 0) & (traces.stamp - last <= AFTER)
    return planned


def _of_task(run: RecordedRun, traces: Traces) -> Mask:
    """Whether a task is commanded, (k,): one with axes."""
    columns = run.bag.topics.get(f"{run.namespace}/task_command")
    if not isinstance(columns, TableColumns) or not len(columns.stamp_ns):
        return np.zeros(len(traces.stamp), bool)
    row, known = held_rows(columns.stamp_ns, traces.stamp)
    commanded: Mask = known & np.isin(row, columns.message)
    return commanded
