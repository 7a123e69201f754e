"""What is required of contact estimation on arms that differ from what it states, and what was measured, row by row."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.table import markdown
from wam_studies.contact_benchmark.page import MET, bound_text, mark, number
from wam_studies.contact_benchmark.score import ANY, Bound
from wam_studies.contact_robustness.replay import SECOND_WITHIN, SURE, ReplayScore, TouchOutcome
from wam_studies.contact_robustness.rows import SMALL_SD, Scores, near, outcomes
from wam_studies.identification.trial import IdentificationResult
from wam_studies.scores import NONE, Interval, counted, events, quantile, rms, share

STATED, MIX = "as stated", "realistic mix"
COVERAGE: Bound = (0.85, 0.97)
USUAL = 0.91  # the middle of it
ROUGH, STRONG, WITHIN = 0.8, 20.0, 8.0  # friction coefficient; N
POSITIONS = (  # level, its name; force, N; what the issue had, required and target, cm
    (0.5, "median", ((5.0, "1.8", 1.8, 0.8), (10.0, "1.4", 1.2, 0.5), (20.0, "0.4", 0.8, 0.4))),
    (0.95, "95 %", ((5.0, "8.6", 7.0, 4.0), (10.0, "6.6", 5.0, 3.0), (20.0, "3.0", 3.0, 2.0))),
)
STARTS = (("warm", 0.97, 0.99), ("cold", 0.85, 0.95))


class RequiredRow(NamedTuple):
    """A row: quantity, unit, its scale, what an earlier edition had, what is allowed, what was measured and of what."""

    name: str
    unit: str
    scale: float
    before: str
    must: Bound
    aim: Bound
    found: Interval
    of: str

    @property
    def measured(self) -> list[str]:
        """Value, interval, number of observations, mark."""
        found, scale = self.found, self.scale
        span = "" if found.low == found.high else f"{number(found.low, scale)} to {number(found.high, scale)}"
        assessed = mark(self.must, ANY, found)
        assessed = mark(self.must, self.aim, found) if assessed == MET else assessed
        assessed = counted(assessed, found.observed) if span else assessed  # a mean over a whole run is one observation
        return [number(found.value, scale), span, str(found.observed), assessed]

    @property
    def is_missed(self) -> bool:
        """Whether what was measured is outside what is required."""
        return self.found.observed > 0 and not self.must[0] <= self.found.value <= self.must[1]

    @property
    def cells(self) -> list[str]:
        """The row as text."""
        bounds = [bound_text(bound, self.scale) for bound in (self.must, self.aim)]
        return [self.name, self.unit, self.before, *bounds, *self.measured, self.of]


def false_alarms(scores: Scores) -> Interval:
    """Detections without contact per second; observed: seconds without contact."""
    return _per_second(sum(len(score.alarms) for score in scores), sum(score.free_seconds for score in scores))


def false_changes(scores: Scores) -> Interval:
    """Second contacts that are reported while there is one, per second of it; observed: these seconds."""
    return _per_second(sum(score.changes for score in scores), sum(score.steady_seconds for score in scores))


def coverage(scores: Scores) -> Interval:
    """Detected contacts in motion whose position is in the 90 % set."""
    return _share([one.in_set for one in outcomes(scores) if one.detected])


def contacts_needed() -> int:
    """Contacts from which on the 95 % interval of the usual share lies within the required one."""
    spans = ((n, share(round(USUAL * n), n)) for n in range(10, 10000))
    return next(n for n, span in spans if span.low >= COVERAGE[0] and span.high <= COVERAGE[1])


def seconds_needed() -> float:
    """Seconds without contact and without an alarm that show fewer than one alarm a minute."""
    return 60.0 * events(0, 1.0).high


def required_rows(
    wide: Mapping[str, Scores],
    second: Mapping[str, Scores],
    masses: Mapping[str, Scores],
    identified: Scores,
    identifications: Sequence[IdentificationResult],
    average: float,
) -> list[RequiredRow]:
    """The rows of the requirement.

    Parameters
    ----------
    wide, second, masses : scores by degradation, of the contacts of every kind, of those for second contacts, of
        masses that are picked up.
    identified : scores of the realistic mix after an identification.
    identifications : of plants with every error of friction.
    average : s, of a whole update over the periods.
    """
    both = [*(score for own in wide.values() for score in own), *identified]
    seconds = [score for own in second.values() for score in own]
    alone = {name: own for name, own in wide.items() if name not in (STATED, MIX)}
    realistic = f"{MIX}, identified"
    outer, moving = outcomes(identified, "outer"), outcomes(both)
    masses_moving = outcomes([score for own in masses.values() for score in own])
    return [
        _worst("false alarms per minute, any degradation alone", "1/min", 60.0, "up to 687", _to(1 / 60),
               _to(0.1 / 60), alone, false_alarms),
        *(RequiredRow("the same, realistic mix", "1/min", 60.0, "155", _to(0.05), _to(0.005), false_alarms(own), of)
          for own, of in ((wide.get(MIX, ()), MIX), (identified, realistic))),
        _percent("5 N detected within 30 ms", "92", 0.97, 0.99, _within(near(outer, 5.0), 0.03), realistic),
        *(RequiredRow(f"position on the outer link, moving, {force:g} N, {title}", "cm", 100.0, before,
                      _to(must / 100.0), _to(aim / 100.0), quantile([one.error for one in near(outer, force)], level),
                      realistic)
          for level, title, limits in POSITIONS for force, before, must, aim in limits),
        _percent("contacts with a reported sd below 2 cm", "35", 0.45, 0.7,
                 [one.position_sd < SMALL_SD for one in outer], realistic),
        _worst("90 % set contains the truth, any degradation alone", "%", 100.0, "52 to 99", COVERAGE, (0.87, 0.95),
               alone, coverage),
        _percent("90 % set contains the truth at 20 N, mu 0.8", "78", 0.85, 0.88,
                 [one.in_set for one in moving
                  if one.detected and one.friction == ROUGH and abs(one.force - STRONG) <= WITHIN], "all"),
        RequiredRow("wrong link where p > 0.95, tip, elbow, masses included", "%", 100.0, "26 of 26", _to(0.01),
                    _to(0.003), _share([not one.right_link for one in [*moving, *masses_moving]
                                        if one.detected and one.probability > SURE]), "all"),
        _percent("inner link, 10 N moving, detected in 200 ms", "89", 0.95, 0.99,
                 _within(near(outcomes(both, "inner"), 10.0), 0.2, True), "all"),
        _percent("second contact detected within 250 ms", "12 to 38", 0.5, 0.8,
                 [one.latency <= SECOND_WITHIN for score in seconds for one in score.second], "all"),
        RequiredRow("false second contacts per minute of a single one", "1/min", 60.0, "", _to(1 / 60), ANY,
                    false_changes(seconds), "all"),
        *(_percent(f"start in contact, {start}", "97", must, aim,
                   [pair[k] for score in identified for pair in score.started], realistic)
          for k, (start, must, aim) in enumerate(STARTS)),
        *_friction(identifications),
        RequiredRow("whole update, average over periods", "us", 1e6, "35", _to(70e-6), _to(40e-6),
                    Interval(average, average, average, 1), "in contact, this computer"),
    ]  # fmt: skip


def _friction(results: Sequence[IdentificationResult]) -> list[RequiredRow]:
    largest = max((float(np.abs(result.level).max()) for result in results), default=math.nan)
    count = sum(len(result.level) for result in results)
    runs = [result.level / result.level_sd for result in results]
    ratio = rms([float(run @ run) for run in runs], [len(run) for run in runs])
    of, name = "plants with every error", "identified friction per motor and direction"
    return [
        RequiredRow(f"{name}, largest error", "%", 100.0, "0.3 to 12", _to(0.04), _to(0.02),
                    Interval(largest, largest, largest, count), of),
        RequiredRow(f"{name}, error / stated, rms", "", 1.0, "none stated", (0.5, 2.0), ANY, ratio, of),
    ]  # fmt: skip


def required_table(rows: Sequence[RequiredRow]) -> str:
    """Markdown table of the requirement."""
    head = ("quantity", "unit", "first version", "required", "target", "measured", "95 %", "n", "", "of")
    return markdown(head, [row.cells for row in rows])


def alone_table(groups: Mapping[str, Sequence[ReplayScore]]) -> str:
    """Markdown table of false alarms and of the 90 % set, a row for each degradation."""
    rows = []
    for name, own in groups.items():
        most = _to((3.0 if name == MIX else 1.0) / 60.0)
        alarms = RequiredRow(name, "", 60.0, "", most, ANY, false_alarms(own), "")
        held = RequiredRow(name, "", 100.0, "", COVERAGE, ANY, coverage(own), "")
        rows.append([name, *alarms.measured, *held.measured])
    head = ("degradation", "false alarms/min", "95 %", "s", "", "90 % set contains the truth, %", "95 %", "n", "")
    return markdown(head, rows)


def _worst(
    name: str,
    unit: str,
    scale: float,
    before: str,
    must: Bound,
    aim: Bound,
    groups: Mapping[str, Scores],
    of: Callable[[Scores], Interval],
) -> RequiredRow:
    """The row of the degradation whose value is the farthest from what is required, or the least far within it."""

    def excess(which: str) -> float:
        value = of(groups[which]).value
        below = must[0] - value if must[0] else -math.inf  # none of what should be none is not the worst
        return -math.inf if math.isnan(value) else max(below, value - must[1])

    worst = max(groups, key=excess, default="")
    found = of(groups[worst]) if worst else NONE
    return RequiredRow(name, unit, scale, before, must, aim, found, f"the worst: {worst}")


def _percent(name: str, before: str, must: float, aim: float, hits: Sequence[bool], of: str) -> RequiredRow:
    return RequiredRow(name, "%", 100.0, before, (must, 1.0), (aim, 1.0), _share(hits), of)


def _share(hits: Sequence[bool]) -> Interval:
    return share(sum(hits), len(hits))


def _within(found: Sequence[TouchOutcome], limit: float, or_before: bool = False) -> list[bool]:
    """Whether contacts were detected in time; of those that began in a detection, whether they count."""
    counted = [one.latency for one in found if or_before or not math.isnan(one.latency)]
    return [math.isnan(latency) or latency <= limit + 1e-9 for latency in counted]


def _per_second(count: int, seconds: float) -> Interval:
    found = events(count, seconds)
    if not found.observed:
        return found
    return Interval(found.value / seconds, found.low / seconds, found.high / seconds, found.observed)


def _to(greatest: float) -> Bound:
    return 0.0, greatest
