"""Contacts while neither a force nor a task is commanded and nothing pushes: harder than the configuration allows."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import held_of, held_rows, live_numbers, step_at
from wam_analysis.thresholds import TOUCH
from wam_analysis.traces import NAN, Traces
from wam_bag.arrays import Mask
from wam_description.number_text import apart
from wam_sim.reactions import RecordedStep
from wam_sim.recorded_commands import COMMANDS
from wam_sim.recorded_run import RecordedRun

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
            f"{during}TOO HARD: a contact with {apart(self.force, self.allowed, 0)} N ({self.source}, at "
            f"{self.seconds:.2f} s) while no force was commanded; allowed: {LIMIT}, {self.allowed:g} N."
        )


class UnplannedContacts(NamedTuple):
    """Those that were too hard, one for each step and for the time outside; and what is not known of others.

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
        unknown = f"It is not known whether a contact without a commanded force was too hard: {self.unknown}."
        return (*(one.sentence for one in self.hard), *[unknown][: bool(self.unknown)])


def unplanned_contacts(run: RecordedRun, traces: Traces, steps: Sequence[RecordedStep]) -> UnplannedContacts:
    """Those of all the time that was recorded; with the true force where it is known, else the estimated one.

    Where no command comes, nothing is commanded; where the bag lacks messages of one, it is not known what was planned.
    """
    is_true, lacking, allowed = traces.true.is_known, ", ".join(_lacking(run)), np.full(len(traces.stamp), NAN)
    for since, limit in live_numbers(run, LIMIT):
        allowed[traces.stamp >= since] = limit
    size = np.where(is_true, traces.true.size, traces.estimated.size)
    is_free, hard = ~_planned(run, traces) & (size > 0.0), dict[str, HardContact]()
    rows = np.flatnonzero(is_free & (size > allowed))
    for row in rows[np.argsort(-size[rows], kind="stable")].tolist():
        step, seconds = step_at(steps, traces.stamp[row]), (int(traces.stamp[row]) - traces.zero) / 1e9
        source = "true" if is_true[row] else "estimated"
        hard.setdefault(step, HardContact(step, seconds, float(size[row]), float(allowed[row]), source))
    found = sorted(hard.values(), key=lambda one: one.seconds)
    unknown = [f"{LIMIT} of the force loop was not recorded, or cannot be read"] * any(np.isnan(allowed[is_free]))
    if lacking:
        unknown += [
            f"one had {one.force:.3g} N, and what may have been commanded then was not recorded ({lacking})"
            for one in found
        ]
        found = []
    return UnplannedContacts(tuple(found), "; ".join(unknown))


def _lacking(run: RecordedRun) -> list[str]:
    """Commands that were not recorded, or not all of their messages."""
    lost = run.bag.losses.topics
    named = {one: f"{run.namespace}/{one}" for one in (COMMANDS if run.is_simulated else COMMANDS[:2])}
    return [one for one, name in named.items() if name not in run.bag.topics or name in lost]


def _planned(run: RecordedRun, traces: Traces) -> Mask:
    """Whether a force, a push or a task is commanded, or was until shortly before, (k,)."""
    acts = traces.commanded.acts | traces.push.acts
    if (columns := run.table("task_command")) is not None:
        row, known = held_rows(columns.stamp_ns, traces.stamp, held_of(run, "task_command"))
        acts |= known & np.isin(row, columns.message)  # a task with axes
    last = np.maximum.accumulate(np.where(acts, traces.stamp, 0))
    return (last > 0) & (traces.stamp - last <= TOUCH.bounce)
