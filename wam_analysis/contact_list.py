"""The estimated contacts of a recording one by one, each compared with the true one where that was recorded."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wam_analysis.demo_traces import NAN, ForceSignal, Mask, Names, Numbers, Times, Traces, held_rows
from wam_analysis.measures.runs import runs
from wam_bag.bag import TableColumns
from wam_control.contact_inference import CERTAIN_SECOND, REASONS, SECOND
from wam_sim.recording import RecordedRun, RecordedStep

NO_LINK = "none"
BOUNCE = 100_000_000  # ns; a shorter loss of contact does not end the contact, and no shorter part of one is listed
NOT_CERTAIN = (
    "Without contact/hypotheses it is not known how certain contacts are, nor whether a force is only the least one."
)
NOT_ESTIMATED = "the estimated contact was not recorded"
PLATEAU = 500_000_000  # ns, for which a commanded force is the same
LASTING = 0.5  # of a contact, above which a reason belongs to it; a value known for less of it is unknown
TWO = tuple(2 ** REASONS.index(reason) for reason in (SECOND, CERTAIN_SECOND))
ESTIMATED = ("probability", "position_sd", "force_sd", "is_lower_bound")


class ListedContact(NamedTuple):
    """An estimated contact, or the part of it in one step of a scenario, or under one command; medians, NaN if unknown.

    Attributes
    ----------
    step : name of the step, '' outside of a scenario.
    begin, end : s of the arm's time; from the start of the recording where that is a system's clock.
    began_before, goes_past : whether the contact was there when the recording of the estimate began, and when it ended.
    link : estimated most of the time.
    lasting : fraction of the time in which that link was estimated.
    probability : of that link.
    position, position_sd : m along the link.
    force, force_sd : size, N.
    is_lower_bound : whether that is the least force that explains the torques.
    second : fraction of the time in which a second contact was suspected; NaN without `contact/hypotheses`.
    reasons : why the estimate is not to be trusted for most of the time, a second contact left out.
    true : the true link, 'none' where nothing was touched, '' where the true contact was not recorded.
    true_position, true_force : m and N; of that link, in the same time.
    """

    step: str
    begin: float
    end: float
    began_before: bool
    goes_past: bool
    link: str
    lasting: float
    probability: float
    position: float
    position_sd: float
    force: float
    force_sd: float
    is_lower_bound: bool
    second: float
    reasons: tuple[str, ...]
    true: str
    true_position: float
    true_force: float

    @property
    def position_error(self) -> float:
        """Estimated less true position, m; NaN where either is unknown or the link is another one."""
        return self.position - self.true_position if self.true == self.link else NAN

    @property
    def force_error(self) -> float:
        """Estimated less true size of the force, N; NaN as that of the position, and of a lower bound."""
        return self.force - self.true_force if self.true == self.link and not self.is_lower_bound else NAN


class MissedContact(NamedTuple):
    """A true contact during which none was estimated: step, begin, end and link as above; median force, N."""

    step: str
    begin: float
    end: float
    link: str
    force: float

    @property
    def sentence(self) -> str:
        """What was missed, and when."""
        during = f"{self.step}: " * bool(self.step)
        return (
            f"{during}MISSED: a contact of {self.link} with {self.force:.3g} N, {self.begin:.2f} to {self.end:.2f} s."
        )


class _Certainty(NamedTuple):
    """What is known of the estimate at each instant, from `contact/hypotheses`; NaN and -1 where it is not."""

    numbers: dict[str, Numbers]
    reasons: NDArray[np.int64]


def listed_contacts(run: RecordedRun, traces: Traces, steps: Sequence[RecordedStep]) -> tuple[ListedContact, ...]:
    """All estimated contacts, each cut where another link is estimated and where a step of the scenario ends.

    Without a scenario they are cut where another commanded force begins that lasts.
    """
    certainty = _certainty(run, traces)
    contacts = contact_rows(traces.stamp, traces.estimated.acts)
    of_links = [part for begin, end in contacts for part in _links(traces, begin, end)]
    bounds = [step.begin for step in steps] or _other_commands(traces)
    rows = _cut(traces.stamp, of_links, bounds)
    return tuple(_listed(traces, certainty, steps, begin, end) for begin, end in rows)


def missed_contacts(traces: Traces, steps: Sequence[RecordedStep]) -> tuple[MissedContact, ...]:
    """The true contacts during which none was estimated, as far as both were recorded."""
    true, estimated = traces.true, traces.estimated
    found = []
    for begin, end in contact_rows(traces.stamp, true.acts):
        if np.all(estimated.is_known[begin:end]) and not np.any(estimated.acts[begin:end]):
            acting = begin + np.flatnonzero(true.acts[begin:end])
            force = median(true.size[acting])
            found.append(MissedContact(*_time(traces, steps, begin, end), most(true.frame[acting]), force))
    return tuple(found)


def contact_rows(stamp: Times, acts: Mask) -> list[tuple[int, int]]:
    """Rows [begin, end) of each contact; bounces do not end it."""
    contacts: list[tuple[int, int]] = []
    for begin, end in runs(acts).tolist():
        if contacts and stamp[begin] - stamp[contacts[-1][1] - 1] <= BOUNCE:
            contacts[-1] = (contacts[-1][0], end)
        else:
            contacts.append((begin, end))
    return contacts


def most(names: Names) -> str:
    """The name that is there most often, NO_LINK without any."""
    return Counter(names.tolist()).most_common(1)[0][0] if len(names) else NO_LINK


def median(values: Numbers) -> float:
    """Median of those that are known, NaN where fewer than `LASTING` of all are: they do not stand for the rest."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) >= LASTING * len(values) > 0 else NAN


def cut_ends(signal: ForceSignal, begin: int, end: int) -> tuple[bool, bool]:
    """Whether a contact in the rows [begin, end) began before the recording of its signal, and whether it goes past it.

    A part of a contact that is followed by another part of it is not cut there.
    """
    known = signal.is_known
    return bool(begin == 0 or not known[begin - 1]), bool(end == len(known) or not known[end])


def _links(traces: Traces, begin: int, end: int) -> list[tuple[int, int]]:
    """Parts of a contact in each of which another link is estimated; a change shorter than `BOUNCE` is none."""
    acting = begin + np.flatnonzero(traces.estimated.acts[begin:end])
    names = traces.estimated.frame[acting]
    starts, link = [begin], ""
    for first, after in _constant(names[1:] != names[:-1]):
        if traces.stamp[acting[after - 1]] - traces.stamp[acting[first]] < BOUNCE:
            continue
        if link and names[first] != link:
            starts.append(int(acting[first]))
        link = names[first]
    return list(pairwise([*starts, end]))


def _other_commands(traces: Traces) -> list[int]:
    """Stamps from which on the commanded force stays as it is for `PLATEAU`, ns; a ramp belongs to what was before."""
    force, stamp = np.nan_to_num(traces.commanded.force), traces.stamp
    if not len(stamp):
        return []
    constant = _constant(np.any(force[1:] != force[:-1], axis=1))
    return [int(stamp[first]) for first, after in constant if stamp[after - 1] - stamp[first] >= PLATEAU]


def _constant(differs: Mask) -> Iterator[tuple[int, int]]:
    """Rows [first, after) between changes; `differs`: whether each row but the first is another than that before."""
    return pairwise([0, *(1 + np.flatnonzero(differs)).tolist(), len(differs) + 1])


def _cut(stamp: Times, contacts: Sequence[tuple[int, int]], at: Sequence[int]) -> list[tuple[int, int]]:
    """Rows of the parts of contacts between some stamps; none is shorter than `BOUNCE`, if its contact is not."""
    bounds = np.searchsorted(stamp, at).tolist()
    parts: list[tuple[int, int]] = []
    for begin, end in contacts:
        start = begin
        for bound in bounds:
            if begin < bound < end and min(stamp[bound] - stamp[start], stamp[end - 1] - stamp[bound]) >= BOUNCE:
                parts.append((start, bound))
                start = bound
        parts.append((start, end))
    return parts


def _listed(
    traces: Traces, certainty: _Certainty, steps: Sequence[RecordedStep], begin: int, end: int
) -> ListedContact:
    true, estimated = traces.true, traces.estimated
    rows = begin + np.flatnonzero(estimated.acts[begin:end])
    link = most(estimated.frame[rows])
    own = rows[estimated.frame[rows] == link]
    acting = rows[true.acts[rows]]
    is_known = bool(np.any(true.is_known[rows]))
    touched = most(true.frame[acting]) if is_known else ""
    there = acting[true.frame[acting] == touched]
    bits = certainty.reasons[own][certainty.reasons[own] >= 0]
    lasting = {why: float(np.mean(bits >> i & 1)) for i, why in enumerate(REASONS)} if len(bits) else {}
    probability, position_sd, force_sd, lower = (median(certainty.numbers[name][own]) for name in ESTIMATED)
    position = median(estimated.position[own])
    return ListedContact(
        *_time(traces, steps, begin, end),
        *cut_ends(estimated, begin, end),
        link,
        len(own) / len(rows),
        probability,
        position,
        position_sd if not np.isnan(position) else NAN,
        median(estimated.size[own]),
        force_sd,
        lower > LASTING,
        float(np.mean(bits & sum(TWO) > 0)) if len(bits) else NAN,
        tuple(why for why, part in lasting.items() if part > LASTING and why not in (SECOND, CERTAIN_SECOND)),
        touched,
        median(true.position[there]),
        median(true.size[there]),
    )


def _time(traces: Traces, steps: Sequence[RecordedStep], begin: int, end: int) -> tuple[str, float, float]:
    """The step in which most of some rows is, and both ends, s."""
    first, last = int(traces.stamp[begin]), int(traces.stamp[end - 1])
    name = next((step.name for step in steps if step.begin <= (first + last) // 2 < step.end), "")
    return name, (first - traces.zero) / 1e9, (last - traces.zero) / 1e9


def _certainty(run: RecordedRun, traces: Traces) -> _Certainty:
    """Of the most probable hypothesis of each message, which is the contact that is published."""
    numbers = {name: np.full(len(traces.stamp), NAN) for name in ESTIMATED}
    reasons = np.full(len(traces.stamp), -1, np.int64)
    columns = run.bag.topics.get(f"{run.namespace}/contact/hypotheses")
    if isinstance(columns, TableColumns) and len(columns.message) and {*ESTIMATED, "reasons"} <= set(columns.columns):
        _, first = np.unique(columns.message, return_index=True)
        stamps = columns.row_stamp_ns[first]
        row, known = held_rows(stamps, traces.stamp)
        for name in ESTIMATED:
            numbers[name][known] = columns.columns[name][first][row[known]]
        reasons[known] = columns.columns["reasons"][first][row[known]].astype(np.int64)
    return _Certainty(numbers, reasons)
