"""The rows and tables of contact estimation on arms and signals that differ from what the estimator states."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wam_studies.contact.outcomes import ContactOutcome, ContactScore, MassOutcome
from wam_studies.contact.rows import (
    COLUMNS,
    EVERY_ARM,
    IDENTIFIED_ARM,
    IDENTIFIED_MIX,
    LINK_COLUMNS,
    Allowed,
    Contacts,
    Scores,
    cell,
    covered,
    detected_within,
    false_alarms,
    in_groups,
    link_rows,
    near,
    percent,
    position_rows,
    share_of,
    torque_z,
)
from wam_studies.contact.touches import PICKING_UP
from wam_studies.scores import NONE, Interval, Row, ScoreTable, exact

STATED_ARM, MIX = "as stated", "realistic mix"
ALONE = "any degradation alone"


@dataclass(frozen=True)
class DegradedLimits:
    """What is required of detection on arms that differ from the model; false ones by s."""

    alarms: Allowed = ((0.0, 1.0 / 60.0), (0.0, 0.1 / 60.0))
    alarms_of_mix: Allowed = ((0.0, 3.0 / 60.0), (0.0, 0.3 / 60.0))
    covered: Allowed = ((0.85, 0.97), (0.87, 0.95))
    inner: Allowed = ((0.95, 1.0), (0.99, 1.0))
    inner_within: float = 0.2  # s
    sure_and_wrong: Allowed = ((0.0, 0.005), (0.0, 0.002))  # of the time in contact
    warm: Allowed = ((0.97, 1.0), (0.99, 1.0))
    cold: Allowed = ((0.85, 1.0), (0.95, 1.0))
    forces: tuple[float, ...] = (0.0, 7.5, 15.0, 30.0, 80.0)  # N, between the rows by force
    masses: tuple[float, ...] = (0.1, 0.2, 0.5, 1.0)  # kg, between the rows by mass


DEGRADED = DegradedLimits()
NOTE = """Numbers in brackets are counts.  Contacts of one arm share its errors, so intervals are rather too narrow."""


def groups_of(drives: Scores, group: str) -> dict[str, list[ContactScore]]:
    """Scores by degradation of the drives of a group."""
    own = in_groups(drives, group)
    return {name: [one for one in own if one.name == name] for name in dict.fromkeys(one.name for one in own)}


def outcomes(scores: Scores, *kinds: str) -> list[ContactOutcome]:
    """Contacts in motion, of some kinds or of all."""
    every = [one for score in scores for one in score.outcomes if one.moving]
    return [one for one in every if not kinds or one.kind in kinds]


def _all(groups: Mapping[str, Scores]) -> list[ContactScore]:
    return [score for own in groups.values() for score in own]


def sure_and_wrong(scores: Scores) -> Interval:
    """Part of the time in contact in which another link is reported with certainty; observed: contacts."""
    every = [one for score in scores for one in score.outcomes if one.kind != PICKING_UP]
    seconds = sum(score.contact_seconds for score in scores)
    return exact(sum(one.sure_and_wrong for one in every) / seconds, len(every)) if seconds else NONE


def alarm_rate(scores: Scores) -> Interval:
    """False alarms by second; observed: seconds without contact."""
    found, seconds = false_alarms(scores), sum(score.free_seconds for score in scores)
    return found._replace(**{end: getattr(found, end) / seconds for end in found._fields[:3]}) if seconds else found


def _per_minute(name: str, found: Interval, allowed: Allowed) -> Row:
    return Row(name, found, "1/min", 60.0, *allowed)


def degraded_rows(drives: Scores) -> Iterator[Row]:
    """What is required; none without drives."""
    wide, identified = groups_of(drives, "wide"), _all(groups_of(drives, IDENTIFIED_ARM))
    if not wide:
        return
    lasting, both = _all(groups_of(drives, "lasting")), [*_all(wide), *identified]
    moving, masses = outcomes(both), outcomes(_all(groups_of(drives, "masses")))
    alone = {name: own for name, own in wide.items() if name not in (STATED_ARM, MIX)}
    if alone:
        name, found = _worst(alone, alarm_rate, DEGRADED.alarms)
        yield _per_minute(f"false alarms, {ALONE}, the worst: {name}", found, DEGRADED.alarms)
    yield _per_minute(f"false alarms, {MIX}", alarm_rate(wide.get(MIX, ())), DEGRADED.alarms_of_mix)
    yield _per_minute(f"false alarms, {MIX}, identified", alarm_rate(identified), DEGRADED.alarms_of_mix)
    for row in position_rows("outer link", IDENTIFIED_MIX, outcomes(identified, "outer")):
        yield row._replace(name=f"{row.name}, {MIX}, identified")
    if alone:
        name, found = _worst(alone, _covered_in_motion, DEGRADED.covered)
        yield percent(f"90 % set contains the truth, {ALONE}, the worst: {name}", found, DEGRADED.covered)
    for row in link_rows(EVERY_ARM, [*moving, *masses]):
        yield row._replace(name=f"{row.name}, every arm, masses included")
    inner = near(outcomes(both, "inner"), 10.0)
    in_time = detected_within(inner, DEGRADED.inner_within, or_before=True)
    yield percent("10 N on the inner link detected within 200 ms, every arm", in_time, DEGRADED.inner)
    held = covered([one for score in lasting for one in score.outcomes])
    yield percent("90 % set contains the truth, contacts of 0.2 to 10 s", held, DEGRADED.covered)
    wrong = sure_and_wrong([*both, *lasting])
    yield percent("sure of a wrong link, of the time in contact, every arm", wrong, DEGRADED.sure_and_wrong)
    for k, (start, allowed) in enumerate((("warm", DEGRADED.warm), ("cold", DEGRADED.cold))):
        yield percent(f"start in contact, {start}, {MIX}, identified", _started(identified, k), allowed)


def _covered_in_motion(scores: Scores) -> Interval:
    return covered(outcomes(scores))


def _started(scores: Scores, which: int) -> Interval:
    return share_of([pair[which] for score in scores for pair in score.started])


def _worst(groups: Mapping[str, Scores], of: Callable[[Scores], Interval], allowed: Allowed) -> tuple[str, Interval]:
    """The degradation whose value is the farthest from what is required, or the least far within it."""
    low, high = allowed[0]

    def excess(which: str) -> float:
        value = of(groups[which]).value
        below = low - value if low else -math.inf  # none of what should be none is not the worst
        return -math.inf if math.isnan(value) else max(below, value - high)

    worst = max(groups, key=excess)
    return worst, of(groups[worst])


def degraded_tables(drives: Scores) -> Iterator[ScoreTable]:
    """Tables by degradation, by kind of contact and force, by mass; none without drives."""
    wide = groups_of(drives, "wide")
    if not wide:
        return
    named = {f"{name}, as configured": own for name, own in groups_of(drives, "level").items()}
    named |= {f"{name}, identified": own for name, own in groups_of(drives, IDENTIFIED_ARM).items()}
    yield ScoreTable("Detection by degradation", *_detection({**wide, **named}), NOTE)
    yield ScoreTable("Position on the outer link by degradation", *_positions({**wide, **named}))
    masses = _all(groups_of(drives, "masses"))
    yield _kinds([*_all(wide), *masses])
    yield _masses([one for score in masses for one in score.masses])


def _detection(groups: Mapping[str, Scores]) -> tuple[list[str], list[list[str]]]:
    head = ["degradation", "false alarms/min", "", "inner link, 10 N, %", "torque error / stated sd", "warned, %"]
    rows = []
    for name, own in groups.items():
        limits = DEGRADED.alarms_of_mix if name.startswith(MIX) else DEGRADED.alarms
        alarms = _per_minute(name, alarm_rate(own), limits)
        value, _, _, verdict = alarms.cells
        inner = detected_within(near(outcomes(own, "inner"), 10.0), DEGRADED.inner_within, or_before=True)
        ratio = max((torque_z([score]).value for score in own), default=math.nan)
        warned = f"{100.0 * float(np.mean([score.warnings for score in own])):.0f}"
        started = " / ".join(cell(_started(own, k)) for k in (0, 1))
        rows.append([name, value, verdict, cell(inner), f"{ratio:.1f}", warned, started])
    return [*head, "start in contact, warm / cold, %"], rows


def _positions(groups: Mapping[str, Scores]) -> tuple[list[str], list[list[str]]]:
    rows = []
    for name, own in groups.items():
        marked = percent(name, covered(outcomes(own)), DEGRADED.covered)
        outer = [of(outcomes(own, "outer")) for of in COLUMNS.values()]
        rows.append([name, *outer, *(of(outcomes(own)) for of in LINK_COLUMNS.values()), marked.verdict])
    return ["degradation", *COLUMNS, *LINK_COLUMNS, ""], rows


def _kinds(scores: Scores) -> ScoreTable:
    """By kind of contact, then by force, all degradations together."""
    every = outcomes(scores)
    groups: list[tuple[str, Contacts]] = [
        (kind, [one for one in every if one.kind == kind]) for kind in sorted({one.kind for one in every})
    ]
    for low, high in pairwise(DEGRADED.forces):
        groups.append((f"{low:g} to {high:g} N", [one for one in every if low <= one.force < high]))
    rows = [[name, *(of(found) for of in LINK_COLUMNS.values())] for name, found in groups]
    return ScoreTable("By kind of contact and by force, all degradations", ["contact", *LINK_COLUMNS], rows)


def _masses(every: Sequence[MassOutcome]) -> ScoreTable:
    """What is reported while the tool carries a mass, by mass."""
    columns: tuple[tuple[str, Callable[[MassOutcome], bool]], ...] = (
        ("reported at all, %", lambda one: one.detected),
        ("as a payload, %", lambda one: one.named),
        ("a wrong link, p > .95, %", lambda one: one.wrong),
        ("a contact at the end, %", lambda one: one.lasting),
    )
    groups = [(f"{a:g} to {b:g} kg", [m for m in every if a <= m.mass < b]) for a, b in pairwise(DEGRADED.masses)]
    rows = [
        [name, *(cell(share_of([of(one) for one in own])) for _, of in columns)]
        for name, own in [*groups, ("all", list(every))]
    ]
    return ScoreTable("Picking up", ["picked up", *(head for head, _ in columns)], rows)
