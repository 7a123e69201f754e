"""What the estimator reports without contact: errors of the external torques, and false alarms."""

from typing import NamedTuple

import numpy as np

from wam_studies.contact.contacts import EVALUATION, is_moving, spans
from wam_studies.contact.scenarios import RANGES
from wam_studies.contact.simulation import Played


class TorqueErrors(NamedTuple):
    """Errors of the external torques of one scenario, except near the start and end of contacts.

    Attributes
    ----------
    group : 'moving', 'rest', 'dither' or 'free'.
    moving, still, sliding : (n,), sums of squares, N^2 m^2, over the records in which the arm moves, is at rest, and
        in which every motor slides.
    moving_z : (n,), sum of squared errors over reported variances, moving.
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


def torque_errors(played: Played) -> TorqueErrors:
    """Errors of the external torques of a scenario."""
    records = played.records
    keep = np.ones(len(records), bool)
    stamps = np.array([record.stamp for record in records]) * 1e-9
    for span in spans(records):
        for edge in (stamps[span.first], stamps[span.last]):
            keep &= ~((stamps > edge - 0.02) & (stamps < edge + EVALUATION.edge))
    keep &= stamps > stamps[0] + 0.2  # the observer's own transient
    truth = np.array([record.torques for record in records])
    if played.scenario.group == "dither":  # the estimate is a mean over the dither cycle, so the truth must be, too
        truth = _over_cycle(truth, round(RANGES.dither_cycle / float(stamps[1] - stamps[0])))
    error = np.array([record.external for record in records]) - truth
    moving = np.array([is_moving(record) for record in records])
    sliding = keep & np.array([min(map(abs, record.thetad)) > EVALUATION.sliding for record in records])
    square = error**2
    has_sd = all(record.external_sd for record in records)
    variance = np.array([record.external_sd for record in records]) ** 2 if has_sd else np.full_like(square, np.nan)
    z = square[keep & moving] / variance[keep & moving]
    return TorqueErrors(
        group=played.scenario.group,
        moving=_sums(square[keep & moving]),
        still=_sums(square[keep & ~moving]),
        sliding=_sums(square[sliding]),
        moving_z=_sums(z),
        moving_count=int((keep & moving).sum()),
        still_count=int((keep & ~moving).sum()),
        sliding_count=int(sliding.sum()),
    )


def _over_cycle(rows: np.ndarray, count: int) -> np.ndarray:
    """Mean of the last `count` rows at each."""
    before = np.concatenate((np.repeat(rows[:1], count, axis=0), rows)).cumsum(axis=0)
    mean: np.ndarray = (before[count:] - before[:-count]) / count
    return mean


def _sums(squares: np.ndarray) -> tuple[float, ...]:
    return tuple(squares.sum(axis=0).tolist())


class ContactFreeTime(NamedTuple):
    """Detections without contact.

    Attributes
    ----------
    group : of the scenario.
    seconds : without contact, from `EVALUATION.edge` after the last one.
    alarms : detections that started in that time.
    """

    group: str
    seconds: float
    alarms: int


def contact_free_time(played: Played) -> ContactFreeTime:
    """Time without contact of a scenario, and the false alarms in it."""
    records = played.records
    period = (records[1].stamp - records[0].stamp) * 1e-9
    in_contact = [False] * len(records)
    after = round(EVALUATION.edge / period)
    for span in spans(records):
        for i in range(span.first, min(span.last + 1 + after, len(records))):
            in_contact[i] = True
    starts = [
        i
        for i in range(1, len(records))
        if records[i].in_contact and not in_contact[i] and not (records[i - 1].in_contact and not in_contact[i - 1])
    ]
    # a detection that continues from a true contact ends late, and is no new alarm
    starts = [i for i in starts if not (records[i - 1].in_contact and in_contact[i - 1])]
    return ContactFreeTime(played.scenario.group, period * in_contact.count(False), len(starts))
