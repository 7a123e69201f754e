"""The rows and tables of contact estimation, with what is required of them: of the arm as stated, and of others."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise, starmap

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
    percent,
    quantile,
    rms,
    share,
)

IDENTIFIED_ARM = "identified"  # group of the drives of an arm that was identified before
STATED_ARM, MIX, ALONE = "as stated", "realistic mix", "any degradation alone"
IDENTIFIED_MIX = f"{MIX}, identified"
NOTE = """Numbers in brackets are counts.  Contacts of one arm share its errors, so intervals are rather too narrow."""

Contacts = Sequence[ContactOutcome]
Scores = Sequence[ContactScore]
Allowed = tuple[Bound, Bound]  # required and target values
# required and target values that several rows have
ALARMS: Allowed = ((0.0, 1.0 / 60.0), (0.0, 0.1 / 60.0))  # 1/s
ALARMS_OF_MIX: Allowed = ((0.0, 3.0 / 60.0), (0.0, 0.3 / 60.0))
COVERED: Allowed = ((0.85, 0.97), (0.87, 0.95))
SURE_AND_WRONG: Allowed = ((0.0, 0.01), (0.0, 0.003))
MEDIANS = {5.0: (0.03, 0.02), 10.0: (0.02, 0.01), 20.0: (0.013, 0.008)}  # m by force, N
TORQUES = {"wam": ((0.25, 0.35, 0.15, 0.12), (0.10, 0.15, 0.06, 0.05))}  # N m, of each joint


def centimetres(name: str, found: Interval, required: Bound, target: Bound = ANY) -> Row:
    """An error of a position."""
    return Row(name, found, "cm", 100.0, required, target)


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


def small_sd(found: Contacts) -> list[ContactOutcome]:
    """Contacts with a small standard deviation of the position."""
    return [one for one in found if one.position_sd < EVALUATION.small_sd]


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


def detection_row(links: str, found: Contacts, seconds: float, required: Bound, target: Bound) -> Row:
    """Contacts detected in time on some links."""
    name = f"5 N on the {links} detected within {1e3 * seconds:.0f} ms"
    return percent(name, detected_within(near(found, 5.0), seconds), required, target)


def error_rows(
    links: str, found: Contacts, name: str, level: float, limits: Mapping[float, tuple[float, float]]
) -> Iterator[Row]:
    """A quantile of the position error on some links by force, N, with its greatest required and target values, m."""
    for force, (required, target) in limits.items():
        title = f"position on the {links} at {force:.0f} N, {name}"
        yield centimetres(title, error_of(near(found, force), level), (0.0, required), (0.0, target))


def small_row(found: Contacts, required: Bound, target: Bound) -> Row:
    """Contacts with a small standard deviation."""
    return percent("contacts with a reported sd below 2 cm", share(len(small_sd(found)), len(found)), required, target)


def link_rows(found: Contacts, wrong: Allowed, sets: Allowed, rough_sets: Allowed) -> Iterator[Row]:
    """Links and 90 % sets of all contacts."""
    yield percent("wrong link", wrong_link(found), *wrong)
    yield percent("wrong link with a probability above 0.95", wrong_link(found, EVALUATION.sure), *SURE_AND_WRONG)
    yield percent("90 % set contains the truth", covered(found), *sets)
    yield percent("90 % set contains the truth at 20 N, mu 0.8", covered(rough(found)), *rough_sets)


def in_groups(scores: Scores, *groups: str) -> list[ContactScore]:
    """Scores of some groups."""
    return [score for score in scores if score.group in groups]


def outcomes(scores: Scores, *kinds: str) -> list[ContactOutcome]:
    """Contacts during which the arm moved at the start and at the evaluation, of some kinds or of all."""
    every = [one for score in scores for one in score.outcomes if one.moving]
    return [one for one in every if not kinds or one.kind in kinds]


@cache
def outer_covers(arm: Arm) -> tuple[str, ...]:
    """The covers along which a position can be measured: not all joint axes meet at their start."""
    body, covers = RigidBody(arm), arm.covers
    found = (name for name in covers.names if body.moves(name, (0.0, *covers.aside(name, 0.0))))
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
    yield Row("false alarms in free motion with stops", quiet, "", 1.0, NONE_AT_ALL, NONE_AT_ALL, EVALUATION.quiet)
    links, outer = " or ".join(outer_covers(arm)).replace("_", " "), on_outer_link(scores, arm)
    yield detection_row(links, outer, 0.06, (0.95, 1.0), ANY)
    yield detection_row(links, outer, 0.03, ANY, (0.99, 1.0))
    yield from error_rows(links, outer, "median error", 0.5, MEDIANS)
    for name, level, most in (("median error", 0.5, 0.01), ("95 % quantile of the error", 0.95, 0.035)):
        found = error_of(small_sd(outer), level)
        yield centimetres(f"position with a reported sd below 2 cm, {name}", found, (0.0, most))
    yield small_row(outer, ANY, (0.5, 1.0))
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


def cell(found: Interval) -> str:
    """A share in percent with its count as text."""
    return f"{100.0 * found.value:.0f} ({found.observed})" if found.observed else "none"


def _lengths(found: Contacts, level: float) -> str:
    errors = [error_of(near(found, force), level).value for force in RANGES.levels]
    return " / ".join("-" if math.isnan(error) else f"{100.0 * error:.1f}" for error in errors)


# columns of tables by degradation: head, and text for the contacts of one
COLUMNS: Mapping[str, Callable[[Contacts], str]] = {
    "5 N within 30 ms, %": lambda found: cell(detected_within(near(found, 5.0), 0.03)),
    "median 5/10/20 N, cm": lambda found: _lengths(found, 0.5),
    "95 %": lambda found: _lengths(found, 0.95),
    "sd < 2 cm, %": lambda found: cell(share(len(small_sd(found)), len(found))),
}
LINK_COLUMNS: Mapping[str, Callable[[Contacts], str]] = {
    "wrong link, %": lambda found: cell(wrong_link(found)),
    "wrong, p > .95, %": lambda found: cell(wrong_link(found, EVALUATION.sure)),
    "90 % set contains the truth, %": lambda found: cell(covered(found)),
    "detected in the end, %": lambda found: cell(detected_within(found, 1e9, True)),
}


# arms and signals that differ from what the estimator states


def by_name(drives: Scores, group: str) -> dict[str, list[ContactScore]]:
    """Scores by degradation of the drives of a group."""
    own = in_groups(drives, group)
    return {name: [one for one in own if one.name == name] for name in dict.fromkeys(one.name for one in own)}


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
    wide, identified = in_groups(drives, "wide"), in_groups(drives, IDENTIFIED_ARM)
    if not wide:
        return
    lasting, both = in_groups(drives, "lasting"), [*wide, *identified]
    alone = {name: own for name, own in by_name(drives, "wide").items() if name not in (STATED_ARM, MIX)}
    if alone:
        name, found = _worst(alone, alarm_rate, ALARMS)
        yield _per_minute(f"false alarms, {ALONE}, the worst: {name}", found, ALARMS)
    mixed = [one for one in wide if one.name == MIX]
    yield _per_minute(f"false alarms, {MIX}", alarm_rate(mixed), ALARMS_OF_MIX)
    yield _per_minute(f"false alarms, {IDENTIFIED_MIX}", alarm_rate(identified), ALARMS_OF_MIX)
    for row in _identified_rows("outer link", outcomes(identified, "outer")):
        yield row._replace(name=f"{row.name}, {IDENTIFIED_MIX}")
    if alone:
        name, found = _worst(alone, lambda scores: covered(outcomes(scores)), COVERED)
        yield percent(f"90 % set contains the truth, {ALONE}, the worst: {name}", found, *COVERED)
    moving = outcomes([*both, *in_groups(drives, "masses")])
    for row in link_rows(moving, (ANY, ANY), (ANY, ANY), ((0.85, 1.0), (0.88, 1.0))):
        yield row._replace(name=f"{row.name}, every arm, masses included")
    in_time = _inner_in_time(both)
    yield percent("10 N on the inner link detected within 200 ms, every arm", in_time, (0.95, 1.0), (0.99, 1.0))
    held = covered([one for score in lasting for one in score.outcomes])
    yield percent("90 % set contains the truth, contacts of 0.2 to 10 s", held, *COVERED)
    wrong = sure_and_wrong([*both, *lasting])
    yield percent("sure of a wrong link, of the time in contact, every arm", wrong, (0.0, 0.005), (0.0, 0.002))


def _identified_rows(links: str, found: Contacts) -> Iterator[Row]:
    yield detection_row(links, found, 0.03, (0.97, 1.0), (0.99, 1.0))
    medians = {5.0: (0.018, 0.008), 10.0: (0.012, 0.005), 20.0: (0.008, 0.004)}
    yield from error_rows(links, found, "median error", 0.5, medians)
    largest = {5.0: (0.07, 0.04), 10.0: (0.05, 0.03), 20.0: (0.03, 0.02)}
    yield from error_rows(links, found, "95 % quantile of the error", 0.95, largest)
    yield small_row(found, (0.45, 1.0), (0.7, 1.0))


def _inner_in_time(scores: Scores) -> Interval:
    """Contacts of 10 N on the inner link that are detected in time or from before."""
    return detected_within(near(outcomes(scores, "inner"), 10.0), EVALUATION.inner_within, or_before=True)


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
    groups = by_name(drives, "wide")
    if not groups:
        return
    groups |= {f"{name}, as configured": own for name, own in by_name(drives, "level").items()}
    groups |= {f"{name}, identified": own for name, own in by_name(drives, IDENTIFIED_ARM).items()}
    yield ScoreTable("Detection by degradation", *_detection(groups), NOTE)
    head = ["degradation", *COLUMNS, *LINK_COLUMNS, ""]
    yield ScoreTable("Position on the outer link by degradation", head, list(starmap(_position, groups.items())))
    yield _kinds(outcomes(in_groups(drives, "wide", "masses")))
    yield _masses([one for score in in_groups(drives, "masses") for one in score.masses])


def _detection(groups: Mapping[str, Scores]) -> tuple[list[str], list[list[str]]]:
    head = ["degradation", "false alarms/min", "", "inner link, 10 N, %", "torque error / stated sd", "warned, %"]
    rows = []
    for name, own in groups.items():
        alarms = _per_minute(name, alarm_rate(own), ALARMS_OF_MIX if name.startswith(MIX) else ALARMS)
        value, _, _, verdict = alarms.cells
        ratio = max(torque_z([score]).value for score in own)
        warned = f"{100.0 * float(np.mean([score.warnings for score in own])):.0f}"
        rows.append([name, value, verdict, cell(_inner_in_time(own)), f"{ratio:.1f}", warned])
    return head, rows


def _position(name: str, own: Scores) -> list[str]:
    found, outer = outcomes(own), outcomes(own, "outer")
    marked = percent(name, covered(found), *COVERED)
    return [name, *(of(outer) for of in COLUMNS.values()), *(of(found) for of in LINK_COLUMNS.values()), marked.verdict]


def _kinds(every: Contacts) -> ScoreTable:
    """By kind of contact, then by force, all degradations together."""
    groups = {kind: [one for one in every if one.kind == kind] for kind in sorted({one.kind for one in every})}
    for low, high in pairwise(EVALUATION.forces):
        groups[f"{low:g} to {high:g} N"] = [one for one in every if low <= one.force < high]
    rows = [[name, *(of(found) for of in LINK_COLUMNS.values())] for name, found in groups.items()]
    return ScoreTable("By kind of contact and by force, all degradations", ["contact", *LINK_COLUMNS], rows)


def _masses(every: Sequence[MassOutcome]) -> ScoreTable:
    """What is reported while the tool carries a mass, by mass."""
    columns = {
        "reported at all, %": "detected",
        "as a payload, %": "named",
        "a wrong link, p > .95, %": "wrong",
        "a contact at the end, %": "lasting",
    }
    groups = {f"{a:g} to {b:g} kg": [m for m in every if a <= m.mass < b] for a, b in pairwise(EVALUATION.masses)}
    rows = [
        [name, *(cell(share_of([getattr(one, field) for one in own])) for field in columns.values())]
        for name, own in {**groups, "all": every}.items()
    ]
    return ScoreTable("Picking up", ["picked up", *columns], rows)
