"""The table: one row per degradation, counts first."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

from wam_analysis.table import markdown
from wam_studies.contact_robustness.replay import SECOND_WITHIN, SURE, MassOutcome, ReplayScore, TouchOutcome
from wam_studies.scores import quantile

NEAR = 0.2  # of a force: 5 N are 4 to 6 N
SMALL_SD = 0.02
FORCES = (0.0, 7.5, 15.0, 30.0, 80.0)  # N, between the rows by force
MASSES = (0.1, 0.2, 0.5, 1.0)  # kg, between the rows by mass
Scores = Sequence[ReplayScore]


class ScoreColumn(NamedTuple):
    """A column: its head, and its text for the scores of one degradation."""

    head: str
    of: Callable[[Scores], str]


def outcomes(scores: Scores, *kinds: str) -> list[TouchOutcome]:
    """Contacts in motion, of some kinds or of all."""
    every = [one for score in scores for one in score.outcomes if one.moving]
    return [one for one in every if not kinds or one.kind in kinds]


def percent(hits: int, count: int) -> str:
    """A share as text."""
    return f"{100.0 * hits / count:.0f} ({count})" if count else "none"


def alarms(scores: Scores) -> str:
    """False alarms per minute without contact."""
    seconds = sum(score.free_seconds for score in scores)
    return f"{60.0 * sum(len(score.alarms) for score in scores) / seconds:.1f}" if seconds else "none"


def near(found: Sequence[TouchOutcome], force: float) -> list[TouchOutcome]:
    """Contacts of about this force, N."""
    return [one for one in found if abs(one.force - force) <= NEAR * force]


def fast(scores: Scores) -> str:
    """Contacts of 5 N on the outer link that are detected within 30 ms."""
    times = [one.latency for one in near(outcomes(scores, "outer"), 5.0) if not math.isnan(one.latency)]
    return percent(sum(time <= 0.03 + 1e-9 for time in times), len(times))


def position(level: float, forces: Sequence[float] = (5.0, 10.0, 20.0)) -> Callable[[Scores], str]:
    """Quantiles of the position error on the outer link, cm, at each force."""

    def of(scores: Scores) -> str:
        values = [
            quantile([one.error for one in near(outcomes(scores, "outer"), force)], level).value for force in forces
        ]
        return " / ".join("-" if math.isnan(value) else f"{100.0 * value:.1f}" for value in values)

    return of


def small(scores: Scores) -> str:
    """Contacts on the outer link with a stated standard deviation below 2 cm."""
    found = outcomes(scores, "outer")
    return percent(sum(one.position_sd < SMALL_SD for one in found), len(found))


def calibration(scores: Scores) -> str:
    """68 % quantile of position error over stated sd, right link."""
    found = [one for one in outcomes(scores, "outer") if one.position_sd > 0.0 and math.isfinite(one.error)]
    value = quantile([one.error / one.position_sd for one in found], 0.683).value
    return "none" if math.isnan(value) else f"{value:.1f}"


def covered(*kinds: str) -> Callable[[Scores], str]:
    """Detected contacts that the 90 % set holds."""

    def of(scores: Scores) -> str:
        return _covered(outcomes(scores, *kinds))

    return of


def length(scores: Scores) -> str:
    """Length of the 90 % set, median and 95 %, cm."""
    sizes = [one.set_length for one in outcomes(scores) if one.detected]
    return " / ".join(f"{100.0 * quantile(sizes, level).value:.0f}" for level in (0.5, 0.95)) if sizes else "none"


def wrong(least: float, *kinds: str) -> Callable[[Scores], str]:
    """Wrong links among the detected contacts with at least a probability."""

    def of(scores: Scores) -> str:
        return _wrong(outcomes(scores, *kinds), least)

    return of


def inner(scores: Scores) -> str:
    """Contacts of 10 N on the inner link that are detected within 200 ms."""
    found = near(outcomes(scores, "inner"), 10.0)
    return percent(sum(one.latency <= 0.2 + 1e-9 or math.isnan(one.latency) for one in found), len(found))


def second(*kinds: str) -> Callable[[Scores], str]:
    """Second contacts that are reported in time."""

    def of(scores: Scores) -> str:
        found = [one.latency for score in scores for one in score.second if not kinds or one.kind in kinds]
        return percent(sum(time <= SECOND_WITHIN for time in found), len(found))

    return of


def second_latency(scores: Scores) -> str:
    """Median of the time in which second contacts are reported, of those that are, ms."""
    times = [one.latency for score in scores for one in score.second if math.isfinite(one.latency)]
    return f"{1e3 * quantile(times, 0.5).value:.0f}" if times else "none"


def false_changes(scores: Scores) -> str:
    """Second contacts that are reported while there is one, per minute of it, and their number."""
    minutes = sum(score.steady_seconds for score in scores) / 60.0
    changes = sum(score.changes for score in scores)
    return f"{changes / minutes:.1f} ({changes} in {minutes:.1f} min)" if minutes else "none"


def start(scores: Scores) -> str:
    """Contacts in which an estimator starts, detected within 0.3 s: with its model's errors known, and without."""
    found = [pair for score in scores for pair in score.started]
    return " / ".join(percent(sum(pair[k] for pair in found), len(found)) for k in (0, 1))


def torque_z(scores: Scores) -> str:
    """Worst rms of error over stated sd of the torques in free motion."""
    return f"{max((score.torque_z for score in scores), default=math.nan):.1f}"


def warned(scores: Scores) -> str:
    """Share of the contact-free time with a warning, %."""
    return f"{100.0 * sum(score.warnings for score in scores) / max(1, len(scores)):.0f}"


DETECTION = (
    ScoreColumn("false alarms/min", alarms),
    ScoreColumn("5 N within 30 ms, %", fast),
    ScoreColumn("inner link, 10 N, %", inner),
    ScoreColumn("torque error / stated sd", torque_z),
    ScoreColumn("warned, %", warned),
    ScoreColumn("start in contact, warm / cold, %", start),
)
SECOND = (
    ScoreColumn("reported within 250 ms, %", second()),
    ScoreColumn("on the same link", second("second on the same link")),
    ScoreColumn("on the other link", second("second on the other link")),
    ScoreColumn("median, ms", second_latency),
    ScoreColumn("false per minute of one contact", false_changes),
)
POSITION = (
    ScoreColumn("median 5/10/20 N, cm", position(0.5)),
    ScoreColumn("95 %", position(0.95)),
    ScoreColumn("sd < 2 cm, %", small),
    ScoreColumn("error / stated sd", calibration),
    ScoreColumn("90 % set contains the truth, %", covered()),
    ScoreColumn("its length 50/95 %, cm", length),
    ScoreColumn("wrong link, %", wrong(0.0)),
    ScoreColumn("wrong, p > .95, %", wrong(SURE)),
)


def table(columns: Sequence[ScoreColumn], groups: dict[str, list[ReplayScore]]) -> str:
    """Markdown table of some columns, a row per group."""
    heads = ("degradation", *(column.head for column in columns))
    return markdown(heads, [(name, *(column.of(own) for column in columns)) for name, own in groups.items()])


def kinds_table(scores: Scores) -> str:
    """Markdown table by kind of contact, then by force, all degradations together."""
    every = outcomes(scores)
    groups = [(kind, [one for one in every if one.kind == kind]) for kind in sorted({one.kind for one in every})]
    groups += [
        (f"{low:g} to {high:g} N", [one for one in every if low <= one.force < high]) for low, high in pairwise(FORCES)
    ]
    rows = [
        (name, _wrong(found, 0.0), _wrong(found, SURE), _covered(found), _detected(found)) for name, found in groups
    ]
    return markdown(
        ("contact", "wrong link, %", "wrong, p > .95, %", "90 % set contains the truth, %", "detected, %"), rows
    )


def masses_table(scores: Scores) -> str:
    """Markdown table of what is reported while the tool carries a mass, by mass."""
    every = [one for score in scores for one in score.masses]
    groups = [
        *((f"{low:g} to {high:g} kg", [m for m in every if low <= m.mass < high]) for low, high in pairwise(MASSES)),
        ("all", every),
    ]
    columns: tuple[tuple[str, Callable[[MassOutcome], bool]], ...] = (
        ("reported at all, %", lambda one: one.detected),
        ("as a payload, %", lambda one: one.named),
        ("a wrong link, p > .95, %", lambda one: one.wrong),
        ("a contact at the end, %", lambda one: one.lasting),
    )
    rows = [[name, *(percent(sum(map(of, own)), len(own)) for _, of in columns)] for name, own in groups]
    return markdown(("picked up", *(head for head, _ in columns)), rows)


def _covered(found: Sequence[TouchOutcome]) -> str:
    detected = [one.in_set for one in found if one.detected]
    return percent(sum(detected), len(detected))


def _wrong(found: Sequence[TouchOutcome], least: float) -> str:
    likely = [not one.right_link for one in found if one.detected and one.probability > least]
    return percent(sum(likely), len(likely))


def _detected(found: Sequence[TouchOutcome]) -> str:
    return percent(sum(one.latency < math.inf or math.isnan(one.latency) for one in found), len(found))
