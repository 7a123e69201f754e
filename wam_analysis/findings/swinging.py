"""Whether the force of a hold settles, cycles or diverges; where it was not recorded, what a motor or joint does."""

from typing import NamedTuple

import numpy as np

from wam_analysis.holds import Hold
from wam_analysis.measures.runs import noise
from wam_analysis.measures.swings import Swings, swings
from wam_analysis.thresholds import CYCLE, HOLD, SHAFT
from wam_bag.arrays import Numbers
from wam_bag.bag import JointColumns
from wam_sim.recorded_run import RecordedRun
from wam_theory.verdicts import Verdict


class Swinging(NamedTuple):
    """What swings during a hold: a motor or joint, '' for the force."""

    shaft: str
    swings: Swings


def swinging(run: RecordedRun, hold: Hold, time: Numbers, force: Numbers) -> Swinging | None:
    """The swings of a force, (n,), N; without one those of the motor, or else the joint, that show most about a hold.

    None if nothing was recorded.
    """
    good = np.isfinite(force)
    time, force = time[good], force[good]
    if len(force):
        band = max(HOLD.loud * hold.commanded, 4.0 * noise(force))
        return Swinging("", swings(time, hold.commanded - force, 2.0 * band, band))
    found = []
    for topic in ("motor_states", "joint_sensors", "joint_states"):
        columns = run.joints(topic)
        if columns is None or not columns.position.shape[1]:
            continue
        for i, name in enumerate(columns.names):
            one = _swings(columns, i, hold)
            if one is not None:
                found.append(Swinging(name, one))
        if found:
            break
    order = (Verdict.DIVERGED, Verdict.LIMIT_CYCLE, Verdict.SETTLED, Verdict.UNDECIDED)
    return min(found, key=lambda one: (order.index(one.swings.verdict), -one.swings.number), default=None)


def _swings(columns: JointColumns, i: int, hold: Hold) -> Swings | None:
    a, b = (int(row) for row in np.searchsorted(columns.stamp_ns, [hold.begin, hold.end]))
    value = columns.position[a:b, i]
    if len(value) < SHAFT.fewest_samples or not np.all(np.isfinite(value)):
        return None
    extent = float(np.ptp(value[int((1.0 - CYCLE.late_part) * len(value)) :]))
    if extent < CYCLE.still_shaft:
        return None
    return swings(
        (columns.stamp_ns[a:b] - hold.begin) / 1e9,
        value,
        max(CYCLE.least_swing * extent, CYCLE.loud_swing * noise(value)),
    )
