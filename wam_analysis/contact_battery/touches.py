"""From records to touches: what truly touched, and what was felt of it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam_analysis.contact_battery.run import Belief, Played, Record
from wam_analysis.contact_battery.scenes import DITHER_CYCLE, Planned
from wam_description.signals import Load

TOUCHED = 0.3  # N; less counts as nothing
GAP = 1  # records without a touch that a contact survives
TOO_MUCH = 25.0  # N; a blow beyond what is judged
SETTLED = 0.2  # s after the touch when the answer is judged
SETTLED_IN_FOAM = 0.12  # s, the same where foam soon stops the arm
SETTLED_AT_REST = 0.4  # s, the same at rest, where a dither has to be averaged
SHORTEST = 0.12  # s; a shorter touch is counted and not judged
EDGE = 0.1  # s after a touch begins or ends in which torques are not judged: the observer lags
MOVING = 0.1  # rad/s of the fastest joint
SLIDING = 1.0  # rad/s of the slowest motor
LEVEL = 0.9  # of the credible set
CELLS = 400  # of a link, for the set that holds the truth


class Touch(NamedTuple):
    """One contact, truth and answer, a line of the judgement.

    Attributes
    ----------
    group, kind : of the scene, and 'push', 'sphere', 'flat' or 'foam', '' for a touch that nobody meant.
    friction : coefficient of the pusher's surface.
    cover, place, force : truth when the answer is judged; m and N.
    moving : whether the arm moved then; `began_moving`, whether it did when the touch began.
    latency : s from the last period without touch to the first alarm; inf where none came, NaN where one
        was there before.
    felt : whether something was felt when the answer is judged.
    link_probability : of the link that was named, NaN where nothing was felt.
    right_link : whether it is the true one.
    error : m, signed, of the place; inf where no place was given, the wrong link or nothing.
    place_sd : m, as stated, NaN where none was.
    credibility : probability of all that is believed more than the truth; 0.9 bounds the 90 % set; 1 if not felt.
    in_set : whether the 90 % set holds the truth: the estimator's own set where it gives one.
    moment_error : N m, of the moment about the link's origin, where the link is right, else NaN.
    moment : N m, size of the true moment.
    least_force : N, the estimated force, a lower bound where the place is unknown.
    """

    group: str
    kind: str
    friction: float
    cover: str
    place: float
    force: float
    moving: bool
    began_moving: bool
    latency: float
    felt: bool
    link_probability: float
    right_link: bool
    error: float
    place_sd: float
    credibility: float
    in_set: bool
    moment_error: float
    moment: float
    least_force: float


class Span(NamedTuple):
    """Records `first` to `last` (included) in which one cover is touched."""

    cover: str
    first: int
    last: int


def size(load: Load) -> float:
    """Size of a load's force, N."""
    return math.hypot(*load.force)


def spans(records: Sequence[Record]) -> list[Span]:
    """Where the simulator says that a cover is touched."""
    found: list[Span] = []
    for i, record in enumerate(records):
        if size(record.load) < TOUCHED:
            continue
        if found and found[-1].cover == record.load.cover and i - found[-1].last <= 1 + GAP:
            found[-1] = found[-1]._replace(last=i)
        else:
            found.append(Span(record.load.cover, i, i))
    return found


def touches(played: Played, lengths: dict[str, float]) -> tuple[list[Touch], int]:
    """Every contact of a scene, and how many were too short or too hard to be judged.

    Parameters
    ----------
    lengths : of the covers, m, by name.
    """
    records, result, unfit = played.records, [], 0
    for span in spans(records):
        first = records[span.first]
        hardest = max(size(record.load) for record in records[span.first : span.last + 1])
        if records[span.last].stamp - first.stamp < SHORTEST * 1e9 or hardest > TOO_MUCH:
            unfit += 1
            continue
        planned = _planned(played.scene.planned, first.stamp * 1e-9)
        kind = planned.kind if planned else ""
        wait = SETTLED_IN_FOAM if kind == "foam" else SETTLED if played.scene.group == "moving" else SETTLED_AT_REST
        due = [i for i in range(span.first, span.last) if records[i].stamp - first.stamp <= wait * 1e9]
        result.append(_judged(played, span, due[-1], planned, lengths))
    return result, unfit


def _judged(played: Played, span: Span, index: int, planned: Planned | None, lengths: dict[str, float]) -> Touch:
    records = played.records
    now, before = records[index], records[max(span.first - 1, 0)]
    load, named = now.load, now.beliefs[0] if now.beliefs else None
    truth = load if load.cover else records[index - 1].load
    right = named is not None and named.cover == span.cover
    place_sd = named.place_sd if right and named is not None else math.nan
    error = named.place - truth.place if right and named is not None and not math.isnan(named.place) else math.inf
    own = [belief for belief in now.beliefs if belief.cover == span.cover][:1]
    believed = credibility(now.beliefs, span.cover, truth.place, lengths)
    moment_error = math.dist(own[0].moment, truth.moment) if right else math.nan
    return Touch(
        group=played.scene.group,
        kind=planned.kind if planned else "",
        friction=planned.friction if planned else math.nan,
        cover=span.cover,
        place=truth.place,
        force=size(truth),
        moving=is_moving(now),
        began_moving=is_moving(records[span.first]),
        latency=_latency(records, span, before),
        felt=now.in_contact,
        link_probability=named.probability if named else math.nan,
        right_link=right,
        error=error,
        place_sd=place_sd,
        credibility=believed,
        in_set=_in_set(now.beliefs, span.cover, truth.place, believed),
        moment_error=moment_error,
        moment=math.hypot(*truth.moment),
        least_force=math.hypot(*own[0].force) if own else math.nan,
    )


def is_moving(record: Record) -> bool:
    """Whether a joint truly moves."""
    return max(map(abs, record.qd)) > MOVING


def _planned(planned: Sequence[Planned], time: float) -> Planned | None:
    near = [contact for contact in planned if contact.begin - 0.05 <= time <= contact.end]
    return near[0] if near else None


def _latency(records: Sequence[Record], span: Span, before: Record) -> float:
    if before.in_contact:
        return math.nan
    for record in records[span.first : span.last + 1]:
        if record.in_contact:
            return (record.stamp - before.stamp) * 1e-9
    return math.inf


def credibility(beliefs: Sequence[Belief], cover: str, place: float, lengths: dict[str, float]) -> float:
    """Probability of everything that is believed more strongly than the truth.

    The belief is a density over the places of all links: each hypothesis a normal distribution cut at
    the ends of its link, or, where it has no place, an even one.  The 90 % set of highest density holds
    the truth where this is at most 0.9; of what is believed as strongly as the truth, half counts.
    """
    if not beliefs:
        return 1.0
    density = {name: np.zeros(CELLS) for name in lengths}  # per metre
    for belief in beliefs:
        length = lengths[belief.cover]
        at = (np.arange(CELLS) + 0.5) * length / CELLS
        if math.isnan(belief.place):
            shape = np.ones(CELLS)
        else:
            shape = np.exp(-0.5 * ((at - belief.place) / max(belief.place_sd, 1e-4)) ** 2)
        total = float(shape.sum())
        if total > 0.0:
            density[belief.cover] += belief.probability * shape / (total * length / CELLS)
    cell = min(max(int(place / lengths[cover] * CELLS), 0), CELLS - 1)
    truth = float(density[cover][cell])
    more, same = 0.0, 0.0
    for name, values in density.items():
        width = lengths[name] / CELLS
        more += float(values[values > truth * (1.0 + 1e-9)].sum()) * width
        same += float(values[np.abs(values - truth) <= truth * 1e-9].sum()) * width
    return more + 0.5 * same


def _in_set(beliefs: Sequence[Belief], cover: str, place: float, believed: float) -> bool:
    if all(math.isnan(belief.low) for belief in beliefs):
        return believed <= LEVEL
    return any(belief.cover == cover and belief.low <= place <= belief.high for belief in beliefs)


class Residual(NamedTuple):
    """Errors of the external torques of one scene, away from the edges of touches.

    Attributes
    ----------
    group : 'moving', 'rest', 'dither' or 'free'.
    moving, still, sliding : (n,), sums of squares, N^2 m^2, over the records in which the arm moves, does not,
        and in which every motor slides.
    moving_z : (n,), sum of squared errors per stated variance, moving.
    moving_count, still_count, sliding_count : of records.
    """

    group: str
    moving: tuple[float, ...]
    still: tuple[float, ...]
    sliding: tuple[float, ...]
    moving_z: tuple[float, ...]
    moving_count: int
    still_count: int
    sliding_count: int


def residual(played: Played) -> Residual:
    """Errors of the external torques of a scene."""
    records = played.records
    keep = np.ones(len(records), bool)
    stamps = np.array([record.stamp for record in records]) * 1e-9
    for span in spans(records):
        for edge in (stamps[span.first], stamps[span.last]):
            keep &= ~((stamps > edge - 0.02) & (stamps < edge + EDGE))
    keep &= stamps > stamps[0] + 0.2  # the observer's own beginning
    truth = np.array([record.torques for record in records])
    if played.scene.group == "dither":  # a hand that rubs to and fro is felt as it is over a whole cycle, too
        truth = _over_cycle(truth, round(DITHER_CYCLE / float(stamps[1] - stamps[0])))
    error = np.array([record.external for record in records]) - truth
    moving = np.array([is_moving(record) for record in records])
    sliding = keep & np.array([min(map(abs, record.thetad)) > SLIDING for record in records])
    square = error**2
    has_sd = all(record.external_sd for record in records)
    variance = np.array([record.external_sd for record in records]) ** 2 if has_sd else np.full_like(square, np.nan)
    z = square[keep & moving] / variance[keep & moving]
    return Residual(
        group=played.scene.group,
        moving=_row(square[keep & moving]),
        still=_row(square[keep & ~moving]),
        sliding=_row(square[sliding]),
        moving_z=_row(z),
        moving_count=int((keep & moving).sum()),
        still_count=int((keep & ~moving).sum()),
        sliding_count=int(sliding.sum()),
    )


def _over_cycle(rows: np.ndarray, count: int) -> np.ndarray:
    """Mean of the last `count` rows at each."""
    before = np.concatenate((np.repeat(rows[:1], count, axis=0), rows)).cumsum(axis=0)
    mean: np.ndarray = (before[count:] - before[:-count]) / count
    return mean


def _row(squares: np.ndarray) -> tuple[float, ...]:
    return tuple(squares.sum(axis=0).tolist())


class Quiet(NamedTuple):
    """What was felt while nothing touched.

    Attributes
    ----------
    group : of the scene.
    seconds : without touch, `EDGE` after the last one.
    alarms : how often an alarm began in that time.
    """

    group: str
    seconds: float
    alarms: int


def quiet(played: Played) -> Quiet:
    """Alarms of a scene while nothing touched."""
    records = played.records
    period = (records[1].stamp - records[0].stamp) * 1e-9
    touched = [False] * len(records)
    after = round(EDGE / period)
    for span in spans(records):
        for i in range(span.first, min(span.last + 1 + after, len(records))):
            touched[i] = True
    begins = [
        i
        for i in range(1, len(records))
        if records[i].in_contact and not touched[i] and not (records[i - 1].in_contact and not touched[i - 1])
    ]
    # an alarm that goes on from a touch is late, not new
    begins = [i for i in begins if not (records[i - 1].in_contact and touched[i - 1])]
    return Quiet(played.scene.group, period * touched.count(False), len(begins))
