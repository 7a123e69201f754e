"""The rows and tables of contact estimation, with what is required of them: of the arm as stated, and of others."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_studies.contact.outcomes import EVALUATION, ContactOutcome, ContactScore, MassOutcome
from wam_studies.contact.scenarios import RANGES
from wam_studies.contact.touches import PICKING_UP
from wam_studies.scores import (
    ANY,
    NONE,
    NONE_AT_ALL,
    Bound,
    Interval,
    Row,
    ScoreTable,
    events,
    exact,
    quantile,
    rms,
    share,
)

IN_MOTION = ("moving", "free")
DITHERED = "at rest, dithered"
IDENTIFIED_ARM = "identified"  # group of the drives of an arm that was identified before

Contacts = Sequence[ContactOutcome]
Scores = Sequence[ContactScore]
Allowed = tuple[Bound, Bound]  # required and target values
FREE: Final[Allowed] = (ANY, ANY)


def _up_to(required: float, target: float) -> Allowed:
    return (0.0, required), (0.0, target)


def _from(required: float, target: float) -> Allowed:
    return (required, 1.0), (target, 1.0)


@dataclass(frozen=True)
class ContactLimits:
    """What counts as a row, and what is required of it.

    The limits of positions are by force, N, in m; those of torques by joint, N m, by name of the arm.
    """

    near: float = 0.2  # of a force: 5 N are 4 to 6 N
    small_sd: float = 0.02  # m
    rough_force: tuple[float, float] = (12.0, 28.0)  # N, of contacts with the greatest friction
    quiet: tuple[float, float] = (120.0, 600.0)  # s that show no false alarm, required and target
    in_time: Mapping[float, Allowed] = field(default_factory=dict)  # share of 5 N detected within s
    median: Mapping[float, Allowed] = field(default_factory=dict)  # error of the position
    largest: Mapping[float, Allowed] = field(default_factory=dict)  # 95 % quantile of it
    small: Allowed = FREE  # share of contacts with a small sd
    median_of_small: Allowed = FREE  # error of these
    largest_of_small: Allowed = FREE
    wrong: Allowed = FREE  # share of wrong links
    wrong_and_sure: Allowed = FREE  # of those with a probability above `sure`
    covered: Allowed = FREE  # share of the 90 % sets that contain the truth
    covered_rough: Allowed = FREE  # at 20 N with the greatest friction


STATED = ContactLimits(
    in_time={0.06: ((0.95, 1.0), ANY), 0.03: (ANY, (0.99, 1.0))},
    median={5.0: _up_to(0.03, 0.02), 10.0: _up_to(0.02, 0.01), 20.0: _up_to(0.013, 0.008)},
    small=(ANY, (0.5, 1.0)),
    median_of_small=((0.0, 0.01), ANY),
    largest_of_small=((0.0, 0.035), ANY),
    wrong=_up_to(0.05, 0.02),
    wrong_and_sure=_up_to(0.01, 0.003),
    covered=((0.85, 0.97), ANY),
    covered_rough=(ANY, (0.85, 0.97)),
)
IDENTIFIED_MIX = ContactLimits(
    in_time={0.03: _from(0.97, 0.99)},
    median={5.0: _up_to(0.018, 0.008), 10.0: _up_to(0.012, 0.005), 20.0: _up_to(0.008, 0.004)},
    largest={5.0: _up_to(0.07, 0.04), 10.0: _up_to(0.05, 0.03), 20.0: _up_to(0.03, 0.02)},
    small=_from(0.45, 0.7),
)
EVERY_ARM = ContactLimits(wrong_and_sure=_up_to(0.01, 0.003), covered_rough=_from(0.85, 0.88))
TORQUES = {"wam": ((0.25, 0.35, 0.15, 0.12), (0.10, 0.15, 0.06, 0.05))}  # N m, required and target of each joint


def percent(name: str, found: Interval, allowed: Allowed = FREE) -> Row:
    """A share in percent."""
    return Row(name, found, "%", 100.0, *allowed)


def centimetres(name: str, found: Interval, allowed: Allowed = FREE) -> Row:
    """An error of a position."""
    return Row(name, found, "cm", 100.0, *allowed)


def share_of(hits: Sequence[bool]) -> Interval:
    """The share of hits."""
    return share(sum(hits), len(hits))


def near(found: Contacts, force: float) -> list[ContactOutcome]:
    """Contacts of about this force, N."""
    return [one for one in found if abs(one.force - force) <= STATED.near * force]


def detected_within(found: Contacts, seconds: float, or_before: bool = False) -> Interval:
    """Contacts detected in time; of those that began in a detection, whether they count."""
    times = [one.latency for one in found if or_before or not math.isnan(one.latency)]
    return share_of([math.isnan(time) or time <= seconds + 1e-9 for time in times])


def error_of(found: Contacts, level: float = 0.5) -> Interval:
    """A quantile of the position error, m."""
    return quantile([one.error for one in found], level)


def small_sd(found: Contacts) -> list[ContactOutcome]:
    """Contacts with a small standard deviation of the position."""
    return [one for one in found if one.position_sd < STATED.small_sd]


def wrong_link(found: Contacts, least: float = 0.0) -> Interval:
    """Wrong links of detected contacts with at least a probability."""
    return share_of([not one.right_link for one in found if one.detected and one.probability >= least])


def covered(found: Contacts) -> Interval:
    """Detected contacts whose position is in the 90 % set."""
    return share_of([one.in_set for one in found if one.detected])


def rough(found: Contacts) -> list[ContactOutcome]:
    """Strong contacts with the greatest friction."""
    low, high = STATED.rough_force
    return [one for one in found if abs(one.friction - RANGES.rough) < 1e-9 and low <= one.force <= high]


def position_rows(links: str, limits: ContactLimits, found: Contacts) -> Iterator[Row]:
    """Detection and position of contacts on links along which it can be measured."""
    for seconds, allowed in limits.in_time.items():
        name = f"5 N on the {links} detected within {1e3 * seconds:.0f} ms"
        yield percent(name, detected_within(near(found, 5.0), seconds), allowed)
    for force, allowed in limits.median.items():
        name = f"position on the {links} at {force:.0f} N, median error"
        yield centimetres(name, error_of(near(found, force)), allowed)
    for force, allowed in limits.largest.items():
        name = f"position on the {links} at {force:.0f} N, 95 % quantile of the error"
        yield centimetres(name, error_of(near(found, force), 0.95), allowed)
    small, name = small_sd(found), "position with a reported sd below 2 cm"
    if limits.median_of_small != FREE:
        yield centimetres(f"{name}, median error", error_of(small), limits.median_of_small)
        yield centimetres(f"{name}, 95 % quantile of the error", error_of(small, 0.95), limits.largest_of_small)
    yield percent("contacts with a reported sd below 2 cm", share(len(small), len(found)), limits.small)


def link_rows(limits: ContactLimits, found: Contacts) -> Iterator[Row]:
    """Links and 90 % sets of all contacts."""
    yield percent("wrong link", wrong_link(found), limits.wrong)
    yield percent("wrong link with a probability above 0.95", wrong_link(found, EVALUATION.sure), limits.wrong_and_sure)
    yield percent("90 % set contains the truth", covered(found), limits.covered)
    yield percent("90 % set contains the truth at 20 N, mu 0.8", covered(rough(found)), limits.covered_rough)


def in_groups(scores: Scores, *groups: str) -> list[ContactScore]:
    """Scores of some groups."""
    return [score for score in scores if score.group in groups]


def contacts_of(scores: Scores, group: str = "moving") -> list[ContactOutcome]:
    """Contacts of a group; in motion, those during which the arm moved at the start and at the evaluation."""
    every = [one for score in in_groups(scores, group) for one in score.outcomes]
    return [one for one in every if group != "moving" or one.moving]


@cache
def outer_covers(arm: Arm) -> tuple[str, ...]:
    """The covers along which a position can be measured: not all joint axes meet at their start."""
    body, covers = RigidBody(arm), arm.covers
    found = (name for name in covers.names if body.moves(name, (0.0, *covers.aside(name, 0.0))))
    return tuple(found) or covers.names[-1:]


def outer_links(arm: Arm) -> str:
    """These in words."""
    return " or ".join(outer_covers(arm)).replace("_", " ")


def on_outer_link(scores: Scores, arm: Arm, group: str = "moving") -> list[ContactOutcome]:
    """Contacts of a group on the covers along which a position can be measured."""
    return [contact for contact in contacts_of(scores, group) if contact.cover in outer_covers(arm)]


def stated_rows(scores: Scores, arm: Arm) -> Iterator[Row]:
    """What is required on the arm as the estimator's model states it."""
    limits = TORQUES.get(arm.name, ((math.inf,) * len(arm.joints.names),) * 2)
    for when, groups, state in (("in motion", IN_MOTION, "moving"), (DITHERED, ("dither",), "still")):
        for row, *ends in zip(torque_rows(scores, arm, when, groups, state), *limits, strict=True):
            required, target = ((0.0, end) if math.isfinite(end) else ANY for end in ends)
            yield row._replace(required=required, target=target)
    quiet = false_alarms(in_groups(scores, "free"))
    yield Row("false alarms in free motion with stops", quiet, "", 1.0, NONE_AT_ALL, NONE_AT_ALL, STATED.quiet)
    yield from position_rows(outer_links(arm), STATED, on_outer_link(scores, arm))
    yield from link_rows(STATED, contacts_of(scores))


def torque_rows(scores: Scores, arm: Arm, when: str, groups: Sequence[str], state: str) -> Iterator[Row]:
    """Errors of the external torque of each joint in some groups; `state` is 'moving' or 'still'."""
    parts = [score.torques for score in in_groups(scores, *groups)]
    counts: list[int] = [getattr(part, f"{state}_count") for part in parts]
    for i, name in enumerate(arm.joints.names):
        found = rms([getattr(part, state)[i] for part in parts], counts)
        yield Row(f"external torque {when}, rms, {name}", found, "N m")


def false_alarms(scores: Scores) -> Interval:
    """Detections that start without contact, and the seconds without."""
    return events(sum(score.alarms for score in scores), sum(score.free_seconds for score in scores))


def torque_z(scores: Scores) -> Interval:
    """Error over stated sd of the external torques in motion."""
    parts = [score.torques for score in scores]
    joints = len(parts[0].moving_z) if parts else 1
    return rms([sum(part.moving_z) for part in parts], [joints * part.moving_count for part in parts])


def cell(found: Interval) -> str:
    """A share in percent with its count as text."""
    return f"{100.0 * found.value:.0f} ({found.observed})" if found.observed else "none"


def _lengths(values: Sequence[Interval]) -> str:
    return " / ".join("-" if math.isnan(one.value) else f"{100.0 * one.value:.1f}" for one in values)


# columns of tables by degradation: head, and text for the contacts of one
COLUMNS: Mapping[str, Callable[[Contacts], str]] = {
    "5 N within 30 ms, %": lambda found: cell(detected_within(near(found, 5.0), 0.03)),
    "median 5/10/20 N, cm": lambda found: _lengths([error_of(near(found, force)) for force in RANGES.levels]),
    "95 %": lambda found: _lengths([error_of(near(found, force), 0.95) for force in RANGES.levels]),
    "sd < 2 cm, %": lambda found: cell(share(len(small_sd(found)), len(found))),
}
LINK_COLUMNS: Mapping[str, Callable[[Contacts], str]] = {
    "wrong link, %": lambda found: cell(wrong_link(found)),
    "wrong, p > .95, %": lambda found: cell(wrong_link(found, EVALUATION.sure)),
    "90 % set contains the truth, %": lambda found: cell(covered(found)),
    "detected in the end, %": lambda found: cell(detected_within(found, 1e9, True)),
}


# arms and signals that differ from what the estimator states

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
