"""The rows of contact estimation, with what is required of them: the same for the arm as stated and for others."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Final

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_studies.contact.outcomes import EVALUATION, ContactOutcome, ContactScore
from wam_studies.contact.scenarios import RANGES
from wam_studies.scores import ANY, NONE_AT_ALL, Bound, Interval, Row, events, quantile, rms, share

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
