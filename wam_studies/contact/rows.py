"""The rows and tables of contact estimation, with what is required of them: of the arm as stated, and of others."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_studies.contact.drives import IDENTIFIED_ARM
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
    by_group,
    events,
    exact,
    grouped,
    named,
    percent,
    quantile,
    rms,
    share,
)

STATED_ARM, MIX, ALONE = "as stated", "realistic mix", "any degradation alone"
IDENTIFIED_MIX = f"{MIX}, identified"
NOTE = """Numbers in brackets are counts.  Contacts of one arm share its errors, so intervals are rather too narrow."""

Contacts = Sequence[ContactOutcome]
Scores = Sequence[ContactScore]
Allowed = tuple[Bound, Bound]  # required and target values
# required and target values that several rows have
ALARMS: Allowed = ((0.0, 1.0 / 60.0), (0.0, 0.1 / 60.0))  # 1/s
ALARMS_OF_MIX: Allowed = ((0.0, 3.0 / 60.0), (0.0, 0.3 / 60.0))
FREE: Allowed = (ANY, ANY)
COVERED: Allowed = ((0.85, 0.97), (0.87, 0.95))
SURE_AND_WRONG: Allowed = ((0.0, 0.01), (0.0, 0.003))
MEDIANS = {5.0: (0.03, 0.02), 10.0: (0.02, 0.01), 20.0: (0.013, 0.008)}  # m by force, N
QUANTILES = {0.5: "median error", 0.95: "95 % quantile of the error"}
TORQUES = {"wam": ((0.25, 0.35, 0.15, 0.12), (0.10, 0.15, 0.06, 0.05))}  # N m, of each joint


class PositionLimits(NamedTuple):
    """What is required of contacts on the outer link, and aimed at.

    Attributes
    ----------
    detection : share of those of 5 N that are detected in so many s.
    errors : m, by level of the quantile, then by force, N.
    small : share of those with a small standard deviation.
    """

    detection: Mapping[float, Allowed]
    errors: Mapping[float, Mapping[float, tuple[float, float]]]
    small: Allowed


STATED = PositionLimits({0.06: ((0.95, 1.0), ANY), 0.03: (ANY, (0.99, 1.0))}, {0.5: MEDIANS}, (ANY, (0.5, 1.0)))
IDENTIFIED = PositionLimits(
    {0.03: ((0.97, 1.0), (0.99, 1.0))},
    {
        0.5: {5.0: (0.018, 0.008), 10.0: (0.012, 0.005), 20.0: (0.008, 0.004)},
        0.95: {5.0: (0.07, 0.04), 10.0: (0.05, 0.03), 20.0: (0.03, 0.02)},
    },
    ((0.45, 1.0), (0.7, 1.0)),
)


def share_of(hits: Sequence[bool]) -> Interval:
    """The share of hits."""
    return share(sum(hits), len(hits))


def near(found: Contacts, force: float) -> list[ContactOutcome]:
    """Contacts of about this force, N."""
    return [one for one in found if abs(one.force - force) <= EVALUATION.near * force]


def detected_within(found: Contacts, seconds: float, or_before: bool = False) -> Interval:
    """Contacts detected in time; of those that began in a detection, whether they count."""
    times = [one.latency for one in found if or_before or not math.isnan(one.latency)]
    return share_of([math.isnan(time) or time <= seconds + 1e-9 for time in times])


def error_of(found: Contacts, level: float = 0.5) -> Interval:
    """A quantile of the position error, m."""
    return quantile([one.error for one in found], level)


def has_small_sd(found: Contacts) -> Interval:
    """Contacts with a small standard deviation of the position."""
    return share_of([one.position_sd < EVALUATION.small_sd for one in found])


def wrong_link(found: Contacts, least: float = 0.0) -> Interval:
    """Wrong links of detected contacts with at least a probability."""
    return share_of([not one.right_link for one in found if one.detected and one.probability >= least])


def covered(found: Contacts) -> Interval:
    """Detected contacts whose position is in the 90 % set."""
    return share_of([one.in_set for one in found if one.detected])


def rough(found: Contacts) -> list[ContactOutcome]:
    """Strong contacts with the greatest friction."""
    low, high = EVALUATION.rough_force
    return [one for one in found if abs(one.friction - RANGES.rough) < 1e-9 and low <= one.force <= high]


def position_rows(links: str, found: Contacts, limits: PositionLimits) -> Iterator[Row]:
    """Detection and position of contacts on some links."""
    for seconds, allowed in limits.detection.items():
        name = f"5 N on the {links} detected within {1e3 * seconds:.0f} ms"
        yield percent(name, detected_within(near(found, 5.0), seconds), *allowed)
    for level, by_force in limits.errors.items():
        for force, ends in by_force.items():
            name = f"position on the {links} at {force:.0f} N, {QUANTILES[level]}"
            yield _error_row(name, near(found, force), level, *ends)
    yield percent("contacts with a reported sd below 2 cm", has_small_sd(found), *limits.small)


def _error_row(name: str, found: Contacts, level: float, *ends: float) -> Row:
    """A quantile of the position error with its greatest required and target values, m."""
    return Row(name, error_of(found, level), "cm", 100.0, *((0.0, end) for end in ends))


def link_rows(
    found: Contacts, wrong: Allowed = FREE, sets: Allowed = FREE, rough_sets: Allowed = FREE
) -> Iterator[Row]:
    """Links and 90 % sets of all contacts."""
    yield percent("wrong link", wrong_link(found), *wrong)
    yield percent("wrong link with a probability above 0.95", wrong_link(found, EVALUATION.sure), *SURE_AND_WRONG)
    yield percent("90 % set contains the truth", covered(found), *sets)
    yield percent("90 % set contains the truth at 20 N, mu 0.8", covered(rough(found)), *rough_sets)


def in_groups(scores: Scores, *groups: str) -> list[ContactScore]:
    """The scores that belong to one of these groups."""
    return [score for score in scores if score.group in groups]


def outcomes(scores: Scores) -> list[ContactOutcome]:
    """Contacts during which the arm moved at the start and at the evaluation."""
    return [one for score in scores for one in score.outcomes if one.moving]


def of_kind(found: Contacts, kind: str) -> list[ContactOutcome]:
    """Contacts of a kind."""
    return [one for one in found if one.kind == kind]


@cache
def outer_covers(arm: Arm) -> tuple[str, ...]:
    """The covers along which a position can be measured: not all joint axes meet at their start."""
    body, covers = RigidBody(arm), arm.covers
    found = (name for name in covers.names if body.moves(name, covers.on_axis(name, 0.0)))
    return tuple(found) or covers.names[-1:]


def on_outer_link(scores: Scores, arm: Arm) -> list[ContactOutcome]:
    """Contacts in motion on the covers along which a position can be measured."""
    return [contact for contact in outcomes(in_groups(scores, "moving")) if contact.cover in outer_covers(arm)]


def stated_rows(scores: Scores, arm: Arm) -> Iterator[Row]:
    """What is required on the arm as the estimator's model states it."""
    names = arm.joints.names
    limits = TORQUES.get(arm.name, ((math.inf,) * len(names),) * 2)
    for when, state, *groups in (("in motion", "moving", "moving", "free"), ("at rest, dithered", "still", "dither")):
        parts = [score.torques for score in in_groups(scores, *groups)]
        counts: list[int] = [getattr(part, f"{state}_count") for part in parts]
        for i, (name, *ends) in enumerate(zip(names, *limits, strict=True)):
            found = rms([getattr(part, state)[i] for part in parts], counts)
            required, target = ((0.0, end) if math.isfinite(end) else ANY for end in ends)
            yield Row(f"external torque {when}, rms, {name}", found, "N m", 1.0, required, target)
    quiet = false_alarms(in_groups(scores, "free"))
    yield Row("false alarms in free motion with pauses", quiet, "", 1.0, NONE_AT_ALL, NONE_AT_ALL, EVALUATION.quiet)
    links, outer = " or ".join(outer_covers(arm)).replace("_", " "), on_outer_link(scores, arm)
    yield from position_rows(links, outer, STATED)
    small = [one for one in outer if one.position_sd < EVALUATION.small_sd]
    for level, most in ((0.5, 0.01), (0.95, 0.035)):
        yield _error_row(f"position with a reported sd below 2 cm, {QUANTILES[level]}", small, level, most)
    wrong, sets = ((0.0, 0.05), (0.0, 0.02)), (0.85, 0.97)
    yield from link_rows(outcomes(in_groups(scores, "moving")), wrong, (sets, ANY), (ANY, sets))


def false_alarms(scores: Scores) -> Interval:
    """Detections that start without contact, and the seconds without."""
    return events(sum(score.alarms for score in scores), sum(score.free_seconds for score in scores))


def torque_z(scores: Scores) -> Interval:
    """Error over stated sd of the external torques in motion."""
    parts = [score.torques for score in scores]
    joints = len(parts[0].moving_z) if parts else 1
    return rms([sum(part.moving_z) for part in parts], [joints * part.moving_count for part in parts])


# arms and signals that differ from what the estimator states


def sure_and_wrong(scores: Scores) -> Interval:
    """Part of the time in contact in which another link is reported with certainty; observed: contacts."""
    every = [one for score in scores for one in score.outcomes if one.kind != PICKING_UP]
    seconds = sum(score.contact_seconds for score in scores)
    return exact(sum(one.sure_and_wrong for one in every) / seconds, len(every)) if seconds else NONE


def alarm_rate(scores: Scores) -> Interval:
    """False alarms by second; observed: seconds without contact."""
    found, seconds = false_alarms(scores), sum(score.free_seconds for score in scores)
    return found._replace(**{end: getattr(found, end) / seconds for end in found._fields[:3]}) if seconds else found


def alarms_row(scores: Scores) -> Row:
    """False alarms of arms with one degradation."""
    allowed = ALARMS if scores and scores[0].name != MIX else ALARMS_OF_MIX
    return Row("false alarms", alarm_rate(scores), "1/min", 60.0, *allowed)


def inner_row(scores: Scores) -> Row:
    """Contacts of 10 N on the inner link that are detected in time or from before."""
    found = detected_within(near(of_kind(outcomes(scores), "inner"), 10.0), EVALUATION.inner_within, or_before=True)
    return percent("10 N on the inner link detected within 200 ms", found, (0.95, 1.0), (0.99, 1.0))


def outer_rows(scores: Scores) -> Iterator[Row]:
    """Contacts on the outer link of arms that differ."""
    return position_rows("outer link", of_kind(outcomes(scores), "outer"), IDENTIFIED)


def set_row(found: Contacts) -> Row:
    """The 90 % sets of contacts of arms that differ."""
    return percent("90 % set contains the truth", covered(found), *COVERED)


def degraded_rows(drives: Scores) -> Iterator[Row]:
    """What is required; none without drives."""
    wide, identified = in_groups(drives, "wide"), in_groups(drives, IDENTIFIED_ARM)
    if not wide:
        return
    lasting, both = in_groups(drives, "lasting"), [*wide, *identified]
    alone = grouped([one for one in wide if one.name not in (STATED_ARM, MIX)], lambda one: one.name)
    yield from _worst({name: alarms_row(own) for name, own in alone.items()})
    yield from named([alarms_row([one for one in wide if one.name == MIX])], MIX)
    yield from named([alarms_row(identified), *outer_rows(identified)], IDENTIFIED_MIX)
    yield from _worst({name: set_row(outcomes(own)) for name, own in alone.items()})
    moving = outcomes([*both, *in_groups(drives, "masses")])
    links = link_rows(moving, rough_sets=((0.85, 1.0), (0.88, 1.0)))
    yield from named(links, "every arm, masses included")
    yield from named([inner_row(both)], "every arm")
    yield from named([set_row([one for score in lasting for one in score.outcomes])], "contacts of 0.2 to 10 s")
    wrong = sure_and_wrong([*both, *lasting])
    yield percent("contact time with a wrong link, probability > 0.95, every arm", wrong, (0.0, 0.005), (0.0, 0.002))


def _worst(rows: Mapping[str, Row]) -> Iterator[Row]:
    """The row of the degradation that is the farthest from what is required, or the least far within it."""

    def excess(name: str) -> float:
        value, (low, high) = rows[name].found.value, rows[name].required
        below = low - value if low else -math.inf  # none of what should be none is not the worst
        return -math.inf if math.isnan(value) else max(below, value - high)

    if rows:
        worst = max(rows, key=excess)
        yield from named([rows[worst]], f"{ALONE}, the worst: {worst}")


def degraded_tables(drives: Scores) -> Iterator[ScoreTable]:
    """Tables by degradation, by kind of contact and force, by mass; none without drives."""
    ways = {"wide": "", "level": ", as configured", IDENTIFIED_ARM: ", identified"}
    groups = grouped(in_groups(drives, *ways), lambda one: f"{one.name}{ways[one.group]}")
    if not groups:
        return
    yield by_group("By degradation", groups, _rows_of_degradation, NOTE)
    every = outcomes(in_groups(drives, "wide", "masses"))
    kinds = dict(sorted(grouped(every, lambda one: one.kind).items()))
    forces = {f"{a:g} to {b:g} N": [one for one in every if a <= one.force < b] for a, b in pairwise(EVALUATION.forces)}
    yield by_group("By kind of contact and by force, all degradations", kinds | forces, _rows_of_contacts)
    masses = [one for score in in_groups(drives, "masses") for one in score.masses]
    by_mass = {f"{a:g} to {b:g} kg": [m for m in masses if a <= m.mass < b] for a, b in pairwise(EVALUATION.masses)}
    yield by_group("Picking up", {**by_mass, "all": masses}, _rows_of_masses)


def _rows_of_degradation(scores: Scores) -> Iterator[Row]:
    yield from (alarms_row(scores), inner_row(scores))
    yield Row("torque error / stated sd, rms", torque_z(scores))
    yield percent("warned", exact(float(np.mean([score.warnings for score in scores])), len(scores)))
    yield from outer_rows(scores)
    yield from _rows_of_contacts(outcomes(scores))


def _rows_of_contacts(found: Contacts) -> Iterator[Row]:
    yield from link_rows(found)
    yield percent("detected in the end", detected_within(found, 1e9, or_before=True))


def _rows_of_masses(found: Sequence[MassOutcome]) -> Iterator[Row]:
    yield percent("reported at all", share_of([one.detected for one in found]))
    yield percent("as a payload", share_of([one.named for one in found]))
    yield percent("a wrong link, p > 0.95", share_of([one.wrong for one in found]))
    yield percent("a contact at the end", share_of([one.lasting for one in found]))
