"""The metrics of the benchmark, with the values that are required and those that are aimed at."""

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

from wam_description.arm import Arm
from wam_description.rigid_body import RigidBody
from wam_studies.contact_benchmark.contacts import EvaluatedContact, evaluate_contacts
from wam_studies.contact_benchmark.free_motion import (
    ContactFreeTime,
    TorqueErrors,
    contact_free_time,
    torque_errors,
)
from wam_studies.contact_benchmark.scenarios import KINDS, LEVELS, ROUGH
from wam_studies.contact_benchmark.simulation import Played
from wam_studies.scores import NONE, Interval, events, quantile, rms, share

Bound = tuple[float, float]  # least and greatest allowed value
ANY: Bound = (-math.inf, math.inf)

FREE_REQUIRED, FREE_TARGET = 120.0, 600.0  # s without a false alarm
NEAR = 0.2  # of a force: 5 N are 4 to 6 N
SMALL_SD = 0.02  # m
HIGH_PROBABILITY = 0.95
IN_MOTION = ("moving", "free")
# N m by joint, moving or dithered, by arm: required, target
TORQUE_LIMITS = {"wam": ((0.25, 0.35, 0.15, 0.12), (0.10, 0.15, 0.06, 0.05))}
DITHERED = "at rest, dithered"


class ScenarioScore(NamedTuple):
    """Contribution of one scenario; `not_made` counts the planned contacts that did not happen."""

    name: str
    contacts: list[EvaluatedContact]
    excluded: int
    not_made: int
    torque_errors: TorqueErrors
    contact_free: ContactFreeTime
    failure: str


class Metric(NamedTuple):
    """A row of the table.

    Attributes
    ----------
    name, unit : as text.
    scale : of the value in that unit.
    required, target : allowed values in SI; ANY for none.
    of : the value for some scenarios.
    """

    name: str
    unit: str
    scale: float
    required: Bound
    target: Bound
    of: Callable[[Sequence[ScenarioScore]], Interval]


def percentage(name: str, of: Callable[..., Interval], required: Bound = ANY, target: Bound = ANY) -> Metric:
    """A share in percent."""
    return Metric(name, "%", 100.0, required, target, of)


def position_error(name: str, of: Callable[..., Interval], required: Bound = ANY, target: Bound = ANY) -> Metric:
    """An error of the position in centimetres."""
    return Metric(name, "cm", 100.0, required, target, of)


def score(played: Played, arm: Arm) -> ScenarioScore:
    """Score a scenario."""
    lengths = dict(zip(arm.covers.names, arm.covers.length, strict=True))
    found, excluded = evaluate_contacts(played, lengths)
    not_made = max(0, len(played.scenario.planned) - len(found) - excluded)
    return ScenarioScore(
        played.scenario.name,
        found,
        excluded,
        not_made,
        torque_errors(played),
        contact_free_time(played),
        played.failure,
    )


def contacts_of(scores: Sequence[ScenarioScore], group: str = "moving") -> list[EvaluatedContact]:
    """Contacts of a group; in motion, those during which the arm moved at the start and at the evaluation."""
    every = [contact for scenario in scores for contact in scenario.contacts if contact.group == group]
    return [contact for contact in every if group != "moving" or (contact.moving and contact.began_moving)]


@cache
def outer_covers(arm: Arm) -> tuple[str, ...]:
    """The covers along which a position can be measured: not all joint axes meet at their start."""
    body, covers = RigidBody(arm), arm.covers
    return (
        tuple(name for name in covers.names if body.moves(name, (0.0, *covers.aside(name, 0.0)))) or covers.names[-1:]
    )


def outer_links(arm: Arm) -> str:
    """These in words."""
    return " or ".join(outer_covers(arm)).replace("_", " ")


def on_outer_link(
    scores: Sequence[ScenarioScore], arm: Arm, group: str = "moving", force: float = 0.0
) -> list[EvaluatedContact]:
    """The same on the covers along which a position can be measured, near a force if one is given, N."""
    outer = outer_covers(arm)
    found = [contact for contact in contacts_of(scores, group) if contact.cover in outer]
    return [contact for contact in found if force == 0.0 or abs(contact.force - force) <= NEAR * force]


def _torque_rms(joint: int, groups: Sequence[str], state: str) -> Callable[..., Interval]:
    """Of one joint in some groups; `state` is 'moving', 'still' or 'sliding'."""

    def of(scores: Sequence[ScenarioScore]) -> Interval:
        parts = [scenario.torque_errors for scenario in scores if scenario.torque_errors.group in groups]
        return rms([getattr(part, state)[joint] for part in parts], [getattr(part, f"{state}_count") for part in parts])

    return of


def _alarms(is_free_motion: bool) -> Callable[..., Interval]:
    """False alarms in scenarios of free motion, or between the contacts of all others."""

    def of(scores: Sequence[ScenarioScore]) -> Interval:
        parts = [scenario.contact_free for scenario in scores]
        chosen = [part for part in parts if (part.group == "free") is is_free_motion]
        return events(sum(part.alarms for part in chosen), sum(part.seconds for part in chosen))

    return of


def _detected_within(arm: Arm, seconds: float, group: str = "moving", force: float = 5.0) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        contacts = on_outer_link(scores, arm, group, force)
        times = [contact.latency for contact in contacts if not math.isnan(contact.latency)]
        return share(sum(time <= seconds + 1e-9 for time in times), len(times))

    return of


def _position(arm: Arm, force: float = 0.0, group: str = "moving", kind: str = "") -> Callable[..., Interval]:
    """Median error of the position, near a force, of a kind."""

    def of(scores: Sequence[ScenarioScore]) -> Interval:
        contacts = on_outer_link(scores, arm, group, force)
        return quantile([abs(contact.error) for contact in contacts if kind in ("", contact.kind)], 0.5)

    return of


def _position_of_small_sd(arm: Arm, level: float) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        contacts = on_outer_link(scores, arm)
        return quantile([abs(contact.error) for contact in contacts if contact.position_sd < SMALL_SD], level)

    return of


def _share_of_small_sd(arm: Arm) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        found = on_outer_link(scores, arm)
        return share(sum(contact.position_sd < SMALL_SD for contact in found), len(found))

    return of


def _wrong_link(least: float) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        found = [contact for contact in contacts_of(scores) if contact.detected and contact.link_probability >= least]
        return share(sum(not contact.right_link for contact in found), len(found))

    return of


def _share_of_high_probability(scores: Sequence[ScenarioScore]) -> Interval:
    found = [contact for contact in contacts_of(scores) if contact.detected]
    return share(sum(contact.link_probability > HIGH_PROBABILITY for contact in found), len(found))


def _coverage(
    pick: Callable[[EvaluatedContact], bool] = lambda contact: True, group: str = "moving"
) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        found = [contact for contact in contacts_of(scores, group) if contact.detected and pick(contact)]
        return share(sum(contact.in_set for contact in found), len(found))

    return of


def _on_inner_link(scores: Sequence[ScenarioScore], arm: Arm) -> list[EvaluatedContact]:
    """Contacts whose inner link is identified."""
    outer = outer_covers(arm)
    return [contact for contact in contacts_of(scores) if contact.cover not in outer and contact.right_link]


def _moment(arm: Arm) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        return quantile([contact.moment_error / contact.moment for contact in _on_inner_link(scores, arm)], 0.5)

    return of


def _force_bound(arm: Arm) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        inner = _on_inner_link(scores, arm)
        return share(sum(contact.least_force <= contact.force for contact in inner), len(inner))

    return of


def _detected(arm: Arm, group: str, force: float) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        found = on_outer_link(scores, arm, group, force)
        return share(sum(contact.detected for contact in found), len(found))

    return of


def z_scores(scores: Sequence[ScenarioScore], arm: Arm) -> list[float]:
    """Error over reported standard deviation of every estimated position."""
    found = [contact for contact in on_outer_link(scores, arm) if contact.right_link and math.isfinite(contact.error)]
    return [contact.error / contact.position_sd for contact in found if contact.position_sd > 0.0]


def _position_z(arm: Arm) -> Callable[..., Interval]:
    def of(scores: Sequence[ScenarioScore]) -> Interval:
        found = quantile([abs(z) for z in z_scores(scores, arm)], 0.683)
        return found if found.observed else NONE

    return of


def _torque_z(scores: Sequence[ScenarioScore]) -> Interval:
    parts = [scenario.torque_errors for scenario in scores if scenario.torque_errors.group in IN_MOTION]
    joints = len(parts[0].moving_z) if parts else 1
    return rms([sum(part.moving_z) for part in parts], [joints * part.moving_count for part in parts])


def _up_to(limit: float) -> Bound:
    return ANY if math.isinf(limit) else (0.0, limit)


def required_metrics(arm: Arm) -> list[Metric]:
    """The metrics with required or target values."""
    outer, links = outer_covers(arm), outer_links(arm)
    unlimited = (math.inf,) * len(arm.joints.names)
    torques = zip(arm.joints.names, *TORQUE_LIMITS.get(arm.name, (unlimited, unlimited)), strict=True)
    states = (("in motion", IN_MOTION, "moving"), (DITHERED, ("dither",), "still"))
    joints = list(enumerate(torques))
    metrics = [
        Metric(
            f"external torque {when}, rms, {name}", "N m", 1.0, _up_to(must), _up_to(aim), _torque_rms(i, groups, state)
        )
        for when, groups, state in states
        for i, (name, must, aim) in joints
    ]
    metrics.append(Metric("false alarms in free motion with stops", "", 1.0, (0.0, 0.0), (0.0, 0.0), _alarms(True)))
    for seconds, must, aim in ((0.06, (0.95, 1.0), ANY), (0.03, ANY, (0.99, 1.0))):
        name = f"5 N on the {links} detected within {1e3 * seconds:.0f} ms"
        metrics.append(percentage(name, _detected_within(arm, seconds), must, aim))
    for force, must_cm, aim_cm in ((5.0, 3.0, 2.0), (10.0, 2.0, 1.0), (20.0, 1.3, 0.8)):
        name = f"position on the {links} at {force:.0f} N, median error"
        metrics.append(position_error(name, _position(arm, force), (0.0, must_cm / 100.0), (0.0, aim_cm / 100.0)))
    small_sd = "position with a reported sd below 2 cm"
    rough_and_strong = _coverage(lambda contact: contact.friction >= ROUGH - 1e-9 and abs(contact.force - 20.0) <= 8.0)
    return [
        *metrics,
        position_error(f"{small_sd}, median error", _position_of_small_sd(arm, 0.5), (0.0, 0.01)),
        position_error(f"{small_sd}, 95 % quantile of the error", _position_of_small_sd(arm, 0.95), (0.0, 0.035)),
        percentage("contacts with a reported sd below 2 cm", _share_of_small_sd(arm), ANY, (0.5, 1.0)),
        percentage("wrong link", _wrong_link(0.0), (0.0, 0.05), (0.0, 0.02)),
        percentage(
            "wrong link with a probability above 0.95", _wrong_link(HIGH_PROBABILITY), (0.0, 0.01), (0.0, 0.003)
        ),
        percentage("90 % set contains the truth", _coverage(), (0.85, 0.97)),
        percentage("90 % set contains the truth at 20 N, mu 0.8", rough_and_strong, ANY, (0.85, 0.97)),
        percentage(f"90 % set contains the truth, {links}", _coverage(lambda contact: contact.cover in outer)),
    ]


def further_metrics(arm: Arm) -> list[Metric]:
    """The metrics without required or target values."""
    links = outer_links(arm)
    inner = " or ".join(name for name in arm.covers.names if name not in outer_covers(arm)).replace("_", " ")
    metrics = [
        percentage("link identified with a probability above 0.95", _share_of_high_probability),
        percentage(f"{inner}: relative error of the moment, median", _moment(arm)),
        percentage(f"{inner}: true force is at least the reported bound", _force_bound(arm)),
        Metric("position: 68 % quantile of error over reported sd", "", 1.0, ANY, ANY, _position_z(arm)),
        Metric("torque: rms of error over reported sd, in motion", "", 1.0, ANY, ANY, _torque_z),
        Metric("false alarms between contacts", "", 1.0, ANY, ANY, _alarms(False)),
    ]
    for when, groups, state in (("while every motor slides", IN_MOTION, "sliding"), ("at rest", ("rest",), "still")):
        for i, name in enumerate(arm.joints.names):
            of = _torque_rms(i, groups, state)
            metrics.append(Metric(f"external torque {when}, rms, {name}", "N m", 1.0, ANY, ANY, of))
    for group, when in (("rest", "at rest"), ("dither", DITHERED)):
        for force in LEVELS:
            name = f"{force:.0f} N on the {links}"
            metrics.append(percentage(f"{name} detected {when}", _detected(arm, group, force)))
            metrics.append(position_error(f"position, {name} {when}, median error", _position(arm, force, group)))
        metrics.append(percentage(f"90 % set contains the truth {when}", _coverage(group=group)))
    return metrics + [
        position_error(f"position on the {links}, {kind}, median error", _position(arm, kind=kind)) for kind in KINDS
    ]
