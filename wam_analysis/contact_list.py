"""The contacts of a recording one by one: those that were estimated, the true ones, and how both compare."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from wam_analysis.held_messages import held_rows, step_at
from wam_analysis.measures.runs import runs
from wam_analysis.thresholds import TOUCH
from wam_analysis.traces import HYPOTHESIS, NAN, ForceSignal, Traces, most_probable
from wam_bag.arrays import Mask, Numbers, Texts, Times
from wam_description.event_text import REASONS
from wam_sim.reactions import RecordedStep
from wam_sim.recorded_run import RecordedRun

NO_LINK = "none"
NOT_CERTAIN = "The uncertainty of contacts is not known: contact/hypotheses was not recorded."
NOT_PLACED = "not recorded (contact/point), so it is not known whether a force is a lower bound"
NOT_ESTIMATED = "the estimated contact was not recorded"


CUT = (  # off by the recording, or where the signal is missing and comes again
    ("the recording begins during it", "the estimate is missing before it"),
    ("the recording ends during it", "the estimate is missing after it"),
)


class ListedContact(NamedTuple):
    """An estimated contact, or the part of it in one step of a scenario, or under one command; medians, NaN if unknown.

    Attributes
    ----------
    step : name of the step, '' outside of a scenario.
    begin, end : s of the arm's time; from the start of the recording where that is a system's clock.
    cut : what cuts it off there, '' for nothing.
    link : estimated most of the time.
    lasting : fraction of the time in which that link was estimated.
    probability : of that link.
    position, position_sd : m along the link.
    is_placed : whether positions were recorded.
    force, force_sd : size, N.
    is_lower_bound : whether that is the least force that explains the torques.
    reasons : why the estimate is not to be trusted for most of the time.
    true : the true link, 'none' where nothing was touched, '' where the true contact was not recorded.
    true_position, true_force : m and N; of that link, in the same time.
    latency : s from the last instant without the true contact to this detection; not above zero if the contact was
        reported before, NaN where it cannot be known.
    """

    step: str
    begin: float
    end: float
    cut: tuple[str, str]
    link: str
    lasting: float
    probability: float
    position: float
    position_sd: float
    is_placed: bool
    force: float
    force_sd: float
    is_lower_bound: bool
    reasons: tuple[str, ...]
    true: str
    true_position: float
    true_force: float
    latency: float

    @property
    def is_false(self) -> bool:
        """Whether nothing was touched."""
        return self.true == NO_LINK

    @property
    def position_error(self) -> float:
        """Estimated less true position, m; NaN where either is unknown or the link is another one."""
        return self.position - self.true_position if self.true == self.link else NAN

    @property
    def force_error(self) -> float:
        """Estimated less true size of the force, N; NaN as that of the position, and of what may be a lower bound."""
        is_known = self.true == self.link and self.is_placed and not self.is_lower_bound
        return self.force - self.true_force if is_known else NAN


class TouchedLink(NamedTuple):
    """A true contact, by link and step.

    Attributes
    ----------
    step, begin, end : as of an estimated one.
    link, force : that was touched, and the median force, N.
    right : part of its time in which its link was estimated; NaN if not known.
    is_missed : whether none was estimated during most of it.
    """

    step: str
    begin: float
    end: float
    link: str
    force: float
    right: float
    is_missed: bool

    @property
    def lasts(self) -> bool:
        """Whether it is more than a bounce."""
        return round(1e9 * (self.end - self.begin)) >= TOUCH.bounce

    @property
    def sentence(self) -> str:
        """What was missed, and when."""
        during = f"{self.step}: " * bool(self.step)
        return (
            f"{during}MISSED: a contact of {self.link} with {self.force:.3g} N, {self.begin:.2f} to {self.end:.2f} s."
        )


Certainty = dict[str, Numbers]  # columns of `contact/hypotheses` at each instant; NaN where they are not known


def listed_contacts(run: RecordedRun, traces: Traces, steps: Sequence[RecordedStep]) -> tuple[ListedContact, ...]:
    """All estimated contacts, each cut where another link is estimated and where a step of the scenario ends."""
    certainty = {name: np.full(len(traces.stamp), NAN) for name in HYPOTHESIS}
    if (hypotheses := most_probable(run)) is not None:
        stamps, columns = hypotheses
        row, known = held_rows(stamps, traces.stamp)
        certainty = {name: np.where(known, columns[name][row], NAN) for name in HYPOTHESIS}
    detected = list(_detections(traces))
    return tuple(
        _listed(traces, certainty, steps, begin, end, next((late for row, late in detected if begin <= row < end), NAN))
        for begin, end in _parts(traces.stamp, traces.estimated, steps)
    )


def _detections(traces: Traces) -> Iterator[tuple[int, float]]:
    """Row in which each true contact was detected, and the latency, s.

    It is not known where the contact was there before its recording began, while the estimate is missing, and where
    that of the contact before goes on.
    """
    estimated, last = traces.estimated, 0
    for begin, end in _parts(traces.stamp, traces.true):
        before, last = last, end
        seen = np.flatnonzero(estimated.acts[begin:end])
        if _cut(traces.true, begin, end)[0] or not len(seen):
            continue
        row = begin + int(seen[0])
        if row == begin:
            free = np.flatnonzero(~estimated.acts[:begin])
            row = int(free[-1]) + 1 if len(free) else 0
            if before and row < before:
                continue
        if np.all(estimated.is_known[begin : row + 1]):
            yield row, float(traces.stamp[row] - traces.stamp[begin]) / 1e9 + traces.period


def true_contacts(traces: Traces, steps: Sequence[RecordedStep]) -> tuple[TouchedLink, ...]:
    """The true contacts, by link and step, and what was estimated of each, as far as both were recorded."""
    true, estimated = traces.true, traces.estimated
    found = []
    for begin, end in _parts(traces.stamp, true, steps):
        acting = begin + np.flatnonzero(true.acts[begin:end])
        known = acting[estimated.is_known[acting]]
        same = estimated.acts[known] & (estimated.frame[known] == true.frame[known])
        is_known = bool(np.all(estimated.is_known[begin:end]))
        found.append(
            TouchedLink(
                *time_of(traces, steps, begin, end),
                most(true.frame[acting]),
                median(true.size[acting]),
                float(np.mean(same)) if len(known) else NAN,
                is_known and float(np.mean(estimated.acts[begin:end])) < TOUCH.lasting,
            )
        )
    return tuple(found)


def contact_rows(stamp: Times, acts: Mask) -> list[tuple[int, int]]:
    """Rows [begin, end) of each contact; bounces do not end it."""
    contacts: list[tuple[int, int]] = []
    for begin, end in runs(acts).tolist():
        if contacts and stamp[begin] - stamp[contacts[-1][1] - 1] <= TOUCH.bounce:
            contacts[-1] = (contacts[-1][0], end)
        else:
            contacts.append((begin, end))
    return contacts


def most(names: Texts) -> str:
    """The name that is there most often, NO_LINK without any."""
    return Counter(names.tolist()).most_common(1)[0][0] if len(names) else NO_LINK


def median(values: Numbers) -> float:
    """Median of those that are known, NaN where fewer than `lasting` of all are: they do not stand for the rest."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) >= TOUCH.lasting * len(values) > 0 else NAN


def _cut(signal: ForceSignal, begin: int, end: int) -> tuple[str, str]:
    """What cuts off a contact in the rows [begin, end) before and after it, '' for nothing.

    A part of a contact that is followed by another part of it is not cut there.
    """
    known = signal.is_known
    before, after = (
        "" if len(outside) and outside[0] else why[bool(np.any(outside))]
        for outside, why in zip((known[:begin][::-1], known[end:]), CUT, strict=True)
    )
    return before, after


def _parts(stamp: Times, signal: ForceSignal, steps: Sequence[RecordedStep] = ()) -> Iterator[tuple[int, int]]:
    """Rows [begin, end) of each contact, cut where the link changes and where a step begins.

    A change of the link that is shorter than `bounce` is none, and no part at a step is, if its contact is not.
    """
    starts = np.searchsorted(stamp, [step.begin for step in steps]).tolist()
    for begin, end in contact_rows(stamp, signal.acts):
        first = begin
        for last in (*_changes(stamp, signal, begin, end), end):
            for cut in starts:
                if first < cut < last and min(stamp[cut] - stamp[first], stamp[last - 1] - stamp[cut]) >= TOUCH.bounce:
                    yield first, cut
                    first = cut
            yield first, last
            first = last


def _changes(stamp: Times, signal: ForceSignal, begin: int, end: int) -> Iterator[int]:
    """Rows of a contact in which it goes over to another link."""
    link, acting = "", begin + np.flatnonzero(signal.acts[begin:end])
    for name, group in groupby(acting.tolist(), key=lambda row: str(signal.frame[row])):
        rows = list(group)
        if stamp[rows[-1]] - stamp[rows[0]] >= TOUCH.bounce:
            if link and name != link:
                yield rows[0]
            link = name


def _listed(
    traces: Traces, certainty: Certainty, steps: Sequence[RecordedStep], begin: int, end: int, latency: float
) -> ListedContact:
    """What was estimated in some rows, and what was true in those in which a contact was estimated."""
    true, estimated = traces.true, traces.estimated
    rows = begin + np.flatnonzero(estimated.acts[begin:end])
    link = most(estimated.frame[rows])
    own = rows[estimated.frame[rows] == link]
    position, placed = median(estimated.position[own]), own[estimated.is_placed[own]]
    reasons = certainty["reasons"][own]
    bits = reasons[np.isfinite(reasons)].astype(np.int64)
    acting = rows[true.acts[rows]]
    touched = most(true.frame[acting]) if np.any(true.is_known[rows]) else ""
    there = acting[true.frame[acting] == touched]
    return ListedContact(
        *time_of(traces, steps, begin, end),
        _cut(estimated, begin, end),
        link,
        len(own) / max(len(rows), 1),
        median(certainty["probability"][own]),
        position,
        NAN if np.isnan(position) else median(certainty["position_sd"][own]),
        bool(len(placed)),
        median(estimated.size[own]),
        median(certainty["force_sd"][own]),
        float(np.sum(estimated.is_lower_bound[placed])) > TOUCH.lasting * len(placed),
        tuple(text for why, text in REASONS.items() if np.sum(bits & why > 0) > TOUCH.lasting * len(bits)),
        touched,
        median(true.position[there]),
        median(true.size[there]),
        latency,
    )


def time_of(traces: Traces, steps: Sequence[RecordedStep], begin: int, end: int) -> tuple[str, float, float]:
    """The step in which most of some rows is, and both ends, s."""
    first, last = int(traces.stamp[begin]), int(traces.stamp[end - 1])
    return step_at(steps, (first + last) // 2), (first - traces.zero) / 1e9, (last - traces.zero) / 1e9
