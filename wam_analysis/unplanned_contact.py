"""Contacts while neither a force nor a task is commanded and nothing pushes: harder than the configuration allows."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.command_gaps import CommandGap
from wam_analysis.demo_traces import NAN, Mask, Numbers, Times, Traces
from wam_analysis.held_messages import held_rows
from wam_analysis.thresholds import TOUCH
from wam_bag.bag import BagError, TableColumns
from wam_control.force.force_loop_parameters import ForceLoopParameters
from wam_control.task.scenario import FORCE_LOOP
from wam_sim.recording import RecordedRun, RecordedStep

LIMIT = "limits.contact_force"


class HardContact(NamedTuple):
    """The hardest moment of the unplanned contacts in a step.

    Attributes
    ----------
    step : name of the step, '' outside of a scenario.
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
        during = f"{self.step}: " * bool(self.step)
        return (
            f"{during}TOO HARD: a contact with {self.force:.3g} N ({self.source}, at {self.seconds:.2f} s) while "
            f"no force was commanded; allowed: {LIMIT}, {self.allowed:g} N."
        )


class UnplannedContacts(NamedTuple):
    """Those that were too hard, one for each step and for the time before and after; and what is not known of others.

    Attributes
    ----------
    hard : in the order of time.
    unknown : why it is not known whether contacts were too hard, '' where it is.
    """

    hard: tuple[HardContact, ...]
    unknown: str

    @property
    def sentences(self) -> tuple[str, ...]:
        """What was too hard, and what is not known."""
        unknown = f"Whether a contact without a commanded force was too hard is not known: {self.unknown}."
        return (*(one.sentence for one in self.hard), *[unknown][: bool(self.unknown)])


def unplanned_contacts(
    run: RecordedRun, traces: Traces, steps: Sequence[RecordedStep], gaps: Sequence[CommandGap]
) -> UnplannedContacts:
    """Those of all the time that was recorded; with the true force where it is known in a step, else the estimated.

    Within gaps of a command it is not known what was planned.
    """
    found: list[HardContact] = []
    unknown: list[str] = []
    everywhere = _lacking(run)
    is_planned, allowed = _planned(run, traces), _allowed(run, traces)
    for name, begin, end in _parts(traces, steps):
        rows = begin + np.flatnonzero(~is_planned[begin:end])
        source, signal = "true", traces.true
        if not np.any(signal.is_known[rows]):
            source, signal = "estimated", traces.estimated
        rows = rows[signal.acts[rows]]
        if np.any(np.isnan(allowed[rows])):
            unknown.append(f"{LIMIT} of the force loop was not recorded, or cannot be read")
        rows = rows[signal.size[rows] > allowed[rows]]
        for lacking, part in _by_what_is_lacking(traces.stamp[rows], everywhere, gaps):
            if not np.any(part):
                continue
            hardest = int(rows[part][np.argmax(signal.size[rows[part]])])
            seconds = (int(traces.stamp[hardest]) - traces.zero) / 1e9
            hard = HardContact(name, seconds, float(signal.size[hardest]), float(allowed[hardest]), source)
            if lacking:
                unknown.append(f"one had {hard.force:.3g} N, and what may have been commanded then was not recorded "
                               f"({', '.join(lacking)})")  # fmt: skip
            else:
                found.append(hard)
    return UnplannedContacts(tuple(found), "; ".join(dict.fromkeys(unknown)))


def _lacking(run: RecordedRun) -> list[str]:
    """Topics of commands that were not recorded; the arm itself has no disturbance."""
    names = ["force_command", "task_command", *["sim/disturbance"][: run.is_simulated]]
    return [name for name in names if f"{run.namespace}/{name}" not in run.bag.topics]


def _by_what_is_lacking(
    stamps: Times, everywhere: Sequence[str], gaps: Sequence[CommandGap]
) -> list[tuple[list[str], Mask]]:
    """Commands that were not recorded, and the stamps at which they were not; the last is where none is lacking."""
    within = {topic: np.full(len(stamps), True) for topic in everywhere}
    for gap in gaps:
        within[gap.topic] = within.get(gap.topic, np.full(len(stamps), False)) | gap.covers(stamps, TOUCH.after_command)
    lacks = np.any([*within.values(), np.full(len(stamps), False)], axis=0)
    return [([topic for topic, part in within.items() if np.any(part)], lacks), ([], ~lacks)]


def _parts(traces: Traces, steps: Sequence[RecordedStep]) -> list[tuple[str, int, int]]:
    """Name and rows [begin, end) of the time before the steps, of each and of that after them."""
    bounds = np.searchsorted(traces.stamp, [step.begin for step in steps] + [step.end for step in steps[-1:]]).tolist()
    names = ["", *(step.name for step in steps), *[""][: len(steps)]]
    return list(zip(names, [0, *bounds], [*bounds, len(traces.stamp)], strict=True))


def _allowed(run: RecordedRun, traces: Traces) -> Numbers:
    """The largest force that the configuration allows at each instant, (k,), N; NaN where it cannot be read."""
    allowed = np.full(len(traces.stamp), NAN)
    parameters = run.parameters
    for begin, settings in [(0, {}), *run.live_values(FORCE_LOOP)]:
        parameters = parameters.with_values(settings)
        try:
            limit = parameters.part(FORCE_LOOP, ForceLoopParameters).limits.contact_force
        except BagError:
            limit = NAN
        allowed[traces.stamp >= begin] = limit
    return allowed


def _planned(run: RecordedRun, traces: Traces) -> Mask:
    """Whether a force, a push or a task is commanded, or was until shortly before, (k,)."""
    acts = traces.commanded.acts | traces.push.acts | _of_task(run, traces)
    if not np.any(acts):
        return acts
    last = np.maximum.accumulate(np.where(acts, traces.stamp, 0))
    planned: Mask = (last > 0) & (traces.stamp - last <= TOUCH.after_command)
    return planned


def _of_task(run: RecordedRun, traces: Traces) -> Mask:
    """Whether a task is commanded, (k,): one with axes."""
    columns = run.bag.topics.get(f"{run.namespace}/task_command")
    if not isinstance(columns, TableColumns) or not len(columns.stamp_ns):
        return np.zeros(len(traces.stamp), bool)
    row, known = held_rows(columns.stamp_ns, traces.stamp)
    commanded: Mask = known & np.isin(row, columns.message)
    return commanded
