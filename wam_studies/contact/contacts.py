"""From the records of a scenario to its contacts: the true contact, and what the estimator reported of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wam_description.signals import Load
from wam_studies.contact.scenarios import PlannedContact
from wam_studies.contact.simulation import EstimatedHypothesis, Played, Record


@dataclass(frozen=True)
class EvaluationLimits:
    """Which true contacts count, when an estimate is evaluated, and what counts as motion."""

    least_force: float = 0.3  # N, of a true contact
    gap: int = 1  # records without force within one contact
    greatest_force: float = 25.0  # N; contacts with a greater force are excluded
    settled: float = 0.2  # s from the start of a contact until the estimate is evaluated
    settled_in_foam: float = 0.12  # s, the same in foam, which soon stops the arm
    settled_at_rest: float = 0.4  # s, the same at rest, where the estimate averages over the dither
    shortest: float = 0.12  # s; shorter contacts are excluded
    edge: float = 0.1  # s after the start or end of a contact in which the observer lags
    moving: float = 0.1  # rad/s of the fastest joint
    sliding: float = 1.0  # rad/s of the slowest motor
    level: float = 0.9  # of the credible set
    cells: int = 400  # of a link, to integrate the posterior density


EVALUATION = EvaluationLimits()


class EvaluatedContact(NamedTuple):
    """One contact: the truth, and the estimate a fixed time after its start.

    Attributes
    ----------
    group, kind : of the scenario; 'push', 'sphere', 'flat' or 'foam', '' for a contact that was not planned.
    friction : coefficient of the pusher's surface.
    cover, position, force : true; m and N.
    moving, began_moving : whether the arm moved at the evaluation, and at the start of the contact.
    latency : s from the last period without contact to the detection; inf without detection, NaN if there was a
        detection before the contact.
    detected : whether the estimator reported a contact.
    probability : of the most probable link, NaN if not detected.
    right_link : whether that link is the true one.
    link : that link, '' if not detected.
    error : m, signed, of the position; inf without a position, on the wrong link or if not detected.
    position_sd : m, reported standard deviation, NaN without one.
    credibility : posterior probability of everything more probable than the truth; 0.9 bounds the 90 % set; 1 if not
        detected.
    in_set : whether the 90 % set contains the truth: the estimator's own set if it reports one.
    moment_error : N m, of the moment about the link's origin on the right link, else NaN.
    moment : N m, size of the true moment.
    least_force : N, size of the estimated force, a lower bound where the position is unknown.
    """

    group: str
    kind: str
    friction: float
    cover: str
    position: float
    force: float
    moving: bool
    began_moving: bool
    latency: float
    detected: bool
    probability: float
    right_link: bool
    link: str
    error: float
    position_sd: float
    credibility: float
    in_set: bool
    moment_error: float
    moment: float
    least_force: float


class Span(NamedTuple):
    """Records `first` to `last` (included) of one true contact."""

    cover: str
    first: int
    last: int


def force_of(load: Load) -> float:
    """Size of a load's force, N."""
    return math.hypot(*load.force)


def spans(records: Sequence[Record]) -> list[Span]:
    """True contacts, in order of time."""
    found: list[Span] = []
    for i, record in enumerate(records):
        if force_of(record.load) < EVALUATION.least_force:
            continue
        if found and found[-1].cover == record.load.cover and i - found[-1].last <= 1 + EVALUATION.gap:
            found[-1] = found[-1]._replace(last=i)
        else:
            found.append(Span(record.load.cover, i, i))
    return found


def evaluate_contacts(played: Played, lengths: dict[str, float]) -> tuple[list[EvaluatedContact], int]:
    """Contacts of a scenario, and the number excluded because they were too short or too hard.

    Parameters
    ----------
    lengths : of the covers, m, by name.
    """
    records, result, excluded = played.records, [], 0
    for span in spans(records):
        first = records[span.first]
        hardest = max(force_of(record.load) for record in records[span.first : span.last + 1])
        if records[span.last].stamp - first.stamp < EVALUATION.shortest * 1e9 or hardest > EVALUATION.greatest_force:
            excluded += 1
            continue
        planned = _planned(played.scenario.planned, first.stamp * 1e-9)
        kind = planned.kind if planned else ""
        wait = _wait(kind, played.scenario.group)
        due = [i for i in range(span.first, span.last) if records[i].stamp - first.stamp <= wait * 1e9]
        result.append(_evaluate(played, span, due[-1], planned, lengths))
    return result, excluded


def _wait(kind: str, group: str) -> float:
    """Time from the start of a contact until its estimate is evaluated, s."""
    if kind == "foam":
        return EVALUATION.settled_in_foam
    return EVALUATION.settled if group == "moving" else EVALUATION.settled_at_rest


def _evaluate(
    played: Played, span: Span, index: int, planned: PlannedContact | None, lengths: dict[str, float]
) -> EvaluatedContact:
    records = played.records
    now, before = records[index], records[max(span.first - 1, 0)]
    load, named = now.load, now.hypotheses[0] if now.hypotheses else None
    truth = load if load.cover else records[index - 1].load
    right = named is not None and named.cover == span.cover
    position_sd = named.position_sd if right and named is not None else math.nan
    has_position = right and named is not None and not math.isnan(named.position)
    error = named.position - truth.position if has_position and named is not None else math.inf
    own = [hypothesis for hypothesis in now.hypotheses if hypothesis.cover == span.cover][:1]
    level = credibility(now.hypotheses, span.cover, truth.position, lengths)
    moment_error = math.dist(own[0].moment, truth.moment) if right else math.nan
    return EvaluatedContact(
        group=played.scenario.group,
        kind=planned.kind if planned else "",
        friction=planned.friction if planned else math.nan,
        cover=span.cover,
        position=truth.position,
        force=force_of(truth),
        moving=is_moving(now),
        began_moving=is_moving(records[span.first]),
        latency=_latency(records, span, before),
        detected=now.in_contact,
        probability=named.probability if named else math.nan,
        right_link=right,
        link=named.cover if named else "",
        error=error,
        position_sd=position_sd,
        credibility=level,
        in_set=_in_set(now.hypotheses, span.cover, truth.position, level),
        moment_error=moment_error,
        moment=math.hypot(*truth.moment),
        least_force=math.hypot(*own[0].force) if own else math.nan,
    )


def is_moving(record: Record) -> bool:
    """Whether a joint truly moves."""
    return max(map(abs, record.qd)) > EVALUATION.moving


def _planned(planned: Sequence[PlannedContact], time: float) -> PlannedContact | None:
    near = [contact for contact in planned if contact.begin - 0.05 <= time <= contact.end]
    return near[0] if near else None


def _latency(records: Sequence[Record], span: Span, before: Record) -> float:
    if before.in_contact:
        return math.nan
    for record in records[span.first : span.last + 1]:
        if record.in_contact:
            return (record.stamp - before.stamp) * 1e-9
    return math.inf


def credibility(
    hypotheses: Sequence[EstimatedHypothesis], cover: str, position: float, lengths: dict[str, float]
) -> float:
    """Posterior probability of all positions more probable than the true one.

    The posterior is a density over the positions on all links: each hypothesis is a normal distribution truncated to
    its link or, without a position, uniform.  The 90 % set of highest density contains the truth if this is at most
    0.9.  Cells as probable as the truth count by half.
    """
    if not hypotheses:
        return 1.0
    density = {name: np.zeros(EVALUATION.cells) for name in lengths}  # per metre
    for hypothesis in hypotheses:
        length = lengths[hypothesis.cover]
        at = (np.arange(EVALUATION.cells) + 0.5) * length / EVALUATION.cells
        if math.isnan(hypothesis.position):
            shape = np.ones(EVALUATION.cells)
        else:
            shape = np.exp(-0.5 * ((at - hypothesis.position) / max(hypothesis.position_sd, 1e-4)) ** 2)
        total = float(shape.sum())
        if total > 0.0:
            density[hypothesis.cover] += hypothesis.probability * shape / (total * length / EVALUATION.cells)
    cell = min(max(int(position / lengths[cover] * EVALUATION.cells), 0), EVALUATION.cells - 1)
    truth = float(density[cover][cell])
    more, same = 0.0, 0.0
    for name, values in density.items():
        width = lengths[name] / EVALUATION.cells
        more += float(values[values > truth * (1.0 + 1e-9)].sum()) * width
        same += float(values[np.abs(values - truth) <= truth * 1e-9].sum()) * width
    return more + 0.5 * same


def _in_set(hypotheses: Sequence[EstimatedHypothesis], cover: str, position: float, level: float) -> bool:
    if all(math.isnan(hypothesis.low) for hypothesis in hypotheses):
        return level <= EVALUATION.level
    return any(hypothesis.cover == cover and hypothesis.low <= position <= hypothesis.high for hypothesis in hypotheses)
