"""The table of the battery: what must be met, what is aimed at, what was measured."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from wam_analysis.contact_battery.run import Played
from wam_analysis.contact_battery.scenes import KINDS, LEVELS
from wam_analysis.contact_battery.statistics import NONE, Figure, events, quantile, rms, share
from wam_analysis.contact_battery.touches import Quiet, Residual, Touch, quiet, residual, touches
from wam_description.arm import Arm

Triple = tuple[float, float, float]
Bound = tuple[float, float]  # least and greatest allowed value
ANY: Bound = (-math.inf, math.inf)

FREE_MUST, FREE_STRETCH = 120.0, 600.0  # s without a false alarm
NEAR = 0.2  # of a force: 5 N are 4 to 6 N
SURE_SD = 0.02  # m
SURE_LINK = 0.95
IN_MOTION = ("moving", "free")
ROUGH = 0.8  # coefficient of friction of the hardest contacts
TORQUE_MUST, TORQUE_AIM = (0.25, 0.35, 0.15, 0.12), (0.10, 0.15, 0.06, 0.05)  # N m, of each joint, moving or dithered
DITHERED = "at rest, dithered"


class SceneScore(NamedTuple):
    """What one scene adds to the table."""

    name: str
    touches: list[Touch]
    unfit: int
    missed: int
    residual: Residual
    quiet: Quiet
    failure: str


class Row(NamedTuple):
    """A line of the table.

    Attributes
    ----------
    name, unit : in words.
    scale : of the value in that unit.
    must, stretch : allowed values in SI; ANY where nothing is asked.
    of : the number of a set of scenes.
    """

    name: str
    unit: str
    scale: float
    must: Bound
    stretch: Bound
    of: Callable[[Sequence[SceneScore]], Figure]


def score(played: Played, arm: Arm) -> SceneScore:
    """Judge a scene."""
    lengths = dict(zip(arm.covers.names, arm.covers.length, strict=True))
    found, unfit = touches(played, lengths)
    missed = max(0, len(played.scene.planned) - len(found) - unfit)
    return SceneScore(played.scene.name, found, unfit, missed, residual(played), quiet(played), played.failure)


def touched(scores: Sequence[SceneScore], group: str = "moving") -> list[Touch]:
    """Contacts of a group; in motion those that began and were judged while the arm moved."""
    every = [touch for scene in scores for touch in scene.touches if touch.group == group]
    return [touch for touch in every if group != "moving" or (touch.moving and touch.began_moving)]


def outer(scores: Sequence[SceneScore], arm: Arm, group: str = "moving", force: float = 0.0) -> list[Touch]:
    """The same on the last link, near a force where one is given."""
    last = arm.covers.names[-1]
    found = [touch for touch in touched(scores, group) if touch.cover == last]
    return [touch for touch in found if force == 0.0 or abs(touch.force - force) <= NEAR * force]


def _torque_rms(joint: int, groups: Sequence[str], state: str) -> Callable[..., Figure]:
    """Of one joint in some groups; `state` is 'moving', 'still' or 'sliding'."""

    def of(scores: Sequence[SceneScore]) -> Figure:
        parts = [scene.residual for scene in scores if scene.residual.group in groups]
        return rms([getattr(part, state)[joint] for part in parts], [getattr(part, f"{state}_count") for part in parts])

    return of


def false_alarms(scores: Sequence[SceneScore]) -> Figure:
    """Alarms in free motion."""
    parts = [scene.quiet for scene in scores if scene.quiet.group == "free"]
    return events(sum(part.alarms for part in parts), sum(part.seconds for part in parts))


def _between(scores: Sequence[SceneScore]) -> Figure:
    parts = [scene.quiet for scene in scores if scene.quiet.group != "free"]
    return events(sum(part.alarms for part in parts), sum(part.seconds for part in parts))


def _within(arm: Arm, seconds: float, group: str = "moving", force: float = 5.0) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        times = [touch.latency for touch in outer(scores, arm, group, force) if not math.isnan(touch.latency)]
        return share(sum(time <= seconds + 1e-9 for time in times), len(times))

    return of


def _place(arm: Arm, force: float, level: float = 0.5, group: str = "moving") -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        return quantile([abs(touch.error) for touch in outer(scores, arm, group, force)], level)

    return of


def _sure(arm: Arm, level: float) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        return quantile([abs(touch.error) for touch in outer(scores, arm) if touch.place_sd < SURE_SD], level)

    return of


def _sure_share(arm: Arm) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        found = outer(scores, arm)
        return share(sum(touch.place_sd < SURE_SD for touch in found), len(found))

    return of


def _wrong_link(least: float) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        found = [touch for touch in touched(scores) if touch.felt and touch.link_probability >= least]
        return share(sum(not touch.right_link for touch in found), len(found))

    return of


def _sure_link_share(scores: Sequence[SceneScore]) -> Figure:
    found = [touch for touch in touched(scores) if touch.felt]
    return share(sum(touch.link_probability > SURE_LINK for touch in found), len(found))


def _coverage(pick: Callable[[Touch], bool], group: str = "moving") -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        found = [touch for touch in touched(scores, group) if touch.felt and pick(touch)]
        return share(sum(touch.in_set for touch in found), len(found))

    return of


def _moment(arm: Arm) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        inner = [touch for touch in touched(scores) if touch.cover != arm.covers.names[-1] and touch.right_link]
        return quantile([touch.moment_error / touch.moment for touch in inner], 0.5)

    return of


def _bound_holds(arm: Arm) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        inner = [touch for touch in touched(scores) if touch.cover != arm.covers.names[-1] and touch.right_link]
        return share(sum(touch.least_force <= touch.force for touch in inner), len(inner))

    return of


def _felt(arm: Arm, group: str, force: float) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        found = outer(scores, arm, group, force)
        return share(sum(touch.felt for touch in found), len(found))

    return of


def _by_kind(arm: Arm, kind: str) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        return quantile([abs(touch.error) for touch in outer(scores, arm) if touch.kind == kind], 0.5)

    return of


def z_scores(scores: Sequence[SceneScore], arm: Arm) -> list[float]:
    """Error per stated spread of every place that was given."""
    found = [touch for touch in outer(scores, arm) if touch.right_link and math.isfinite(touch.error)]
    return [touch.error / touch.place_sd for touch in found if touch.place_sd > 0.0]


def _spread_of_z(arm: Arm) -> Callable[..., Figure]:
    def of(scores: Sequence[SceneScore]) -> Figure:
        found = quantile([abs(z) for z in z_scores(scores, arm)], 0.683)
        return found if found.observed else NONE

    return of


def _torque_z(scores: Sequence[SceneScore]) -> Figure:
    parts = [scene.residual for scene in scores if scene.residual.group in ("moving", "free")]
    joints = len(parts[0].moving_z) if parts else 1
    return rms([sum(part.moving_z) for part in parts], [joints * part.moving_count for part in parts])


def asked(arm: Arm) -> list[Row]:
    """The rows of the table that must be met."""
    last = arm.covers.names[-1]
    rows = [
        Row(f"external torque {words}, rms, {name}", "N m", 1.0, (0.0, must), (0.0, aim), _torque_rms(i, groups, state))
        for words, groups, state in (("in motion", IN_MOTION, "moving"), (DITHERED, ("dither",), "still"))
        for i, (name, must, aim) in enumerate(zip(arm.joints.names, TORQUE_MUST, TORQUE_AIM, strict=True))
    ]
    rows.append(Row("false alarms in free motion with stops", "", 1.0, (0.0, 0.0), (0.0, 0.0), false_alarms))
    for seconds, must, aim in ((0.06, (0.95, 1.0), ANY), (0.03, ANY, (0.99, 1.0))):
        name = f"5 N on the outer link felt within {1e3 * seconds:.0f} ms"
        rows.append(Row(name, "%", 100.0, must, aim, _within(arm, seconds)))
    for force, must_cm, aim_cm in ((5.0, 3.0, 2.0), (10.0, 2.0, 1.0), (20.0, 1.3, 0.8)):
        name = f"place on the outer link at {force:.0f} N, median error"
        rows.append(Row(name, "cm", 100.0, (0.0, must_cm / 100.0), (0.0, aim_cm / 100.0), _place(arm, force)))
    return [
        *rows,
        Row("place where its stated sd is below 2 cm, median error", "cm", 100.0, (0.0, 0.01), ANY, _sure(arm, 0.5)),
        Row("place where its stated sd is below 2 cm, 95 %", "cm", 100.0, (0.0, 0.035), ANY, _sure(arm, 0.95)),
        Row("contacts with a stated sd below 2 cm", "%", 100.0, ANY, (0.5, 1.0), _sure_share(arm)),
        Row("wrong link", "%", 100.0, (0.0, 0.05), (0.0, 0.02), _wrong_link(0.0)),
        Row("wrong link where its probability is above 0.95", "%", 100.0, (0.0, 0.01), (0.0, 0.003), _wrong_link(0.95)),
        Row("90 % set holds the truth", "%", 100.0, (0.85, 0.97), ANY, _coverage(lambda touch: True)),
        Row(
            "90 % set holds the truth at 20 N, mu 0.8",
            "%",
            100.0,
            ANY,
            (0.85, 0.97),
            _coverage(lambda touch: touch.friction >= ROUGH - 1e-9 and abs(touch.force - 20.0) <= 8.0),
        ),
        Row("90 % set holds the truth, outer link", "%", 100.0, ANY, ANY, _coverage(lambda t: t.cover == last)),
    ]


def stated(arm: Arm) -> list[Row]:
    """The rows that say more, of which nothing is asked."""
    rows = [
        Row("link named with a probability above 0.95", "%", 100.0, ANY, ANY, _sure_link_share),
        Row("inner link: error of the moment, per moment, median", "%", 100.0, ANY, ANY, _moment(arm)),
        Row("inner link: force is at least what is stated", "%", 100.0, ANY, ANY, _bound_holds(arm)),
        Row("place: 68 % of the errors are below so many stated sd", "", 1.0, ANY, ANY, _spread_of_z(arm)),
        Row("torque: rms error per stated sd, in motion", "", 1.0, ANY, ANY, _torque_z),
        Row("false alarms between contacts", "", 1.0, ANY, ANY, _between),
    ]
    for i, name in enumerate(arm.joints.names):
        quantity = f"external torque where every motor slides, rms, {name}"
        rows.append(Row(quantity, "N m", 1.0, ANY, ANY, _torque_rms(i, IN_MOTION, "sliding")))
    for i, name in enumerate(arm.joints.names):
        rows.append(
            Row(f"external torque at rest, rms, {name}", "N m", 1.0, ANY, ANY, _torque_rms(i, ("rest",), "still"))
        )
    for group, words in (("rest", "at rest"), ("dither", DITHERED)):
        rows += _at_rest(arm, group, words)
    return rows + [
        Row(f"place on the outer link, {kind}, median error", "cm", 100.0, ANY, ANY, _by_kind(arm, kind))
        for kind in KINDS
    ]


def _at_rest(arm: Arm, group: str, words: str) -> list[Row]:
    rows = []
    for force in LEVELS:
        name = f"{force:.0f} N on the outer link"
        place = _place(arm, force, group=group)
        rows.append(Row(f"{name} felt {words}", "%", 100.0, ANY, ANY, _felt(arm, group, force)))
        rows.append(Row(f"place, {name} {words}, median error", "cm", 100.0, ANY, ANY, place))
    coverage = _coverage(lambda touch: True, group)
    return [*rows, Row(f"90 % set holds the truth {words}", "%", 100.0, ANY, ANY, coverage)]
