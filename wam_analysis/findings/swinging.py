"""Cycles of motors and joints under a force that was not recorded."""

import math
from typing import NamedTuple

import numpy as np

from wam_analysis.findings.finding import Finding, shown
from wam_analysis.holds import Hold
from wam_analysis.measures.runs import noise
from wam_analysis.measures.stability import Swings, swings
from wam_analysis.thresholds import CYCLE, SHAFT
from wam_bag.arrays import Numbers
from wam_bag.bag import JointColumns
from wam_sim.recording import RecordedRun
from wam_theory.verdicts import Verdict


class Swinging(NamedTuple):
    """A shaft that swings during a hold."""

    name: str
    swings: Swings


def swinging(run: RecordedRun, hold: Hold) -> Swinging | None:
    """The motor, or else the joint, whose swings show most about a hold; None if none was recorded."""
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


def swinging_words(name: str, found: Swinging) -> str:
    """A sentence on a hold."""
    one, where = found.swings, f"{found.name} (the force was not recorded)"
    size = f"{shown(one.peak_to_peak, 'rad')} peak to peak, period {shown(one.period, 's')}"
    if one.verdict is Verdict.LIMIT_CYCLE:
        return f"{name}: limit cycle, seen on {where}: {size}."
    if one.verdict is Verdict.DIVERGED:
        return f"{name}: DIVERGES, seen on {where}: {shown(100.0 * (one.growth - 1.0))} % per half cycle, last {size}."
    settled = one.verdict is Verdict.SETTLED
    return (
        f"{name}: {where} {'ceases to swing' if settled else 'swings too seldom to decide'}; no limit cycle detected."
    )


def swinging_findings(name: str, found: Swinging) -> list[Finding]:
    """Size, period and growth of the swings of a hold."""
    one = found.swings
    if one.verdict not in (Verdict.LIMIT_CYCLE, Verdict.DIVERGED):
        return []
    return [
        Finding(f"{name}: swing of {found.name}, peak to peak", "rad", one.peak_to_peak),
        Finding(f"{name}: period", "s", one.period),
        Finding(f"{name}: growth per half cycle", "", one.growth, note=f"{one.verdict}; {one.number} swings"),
    ]


def at_the_contact(found: Swinging, motors: tuple[str, ...], motor_per_metre: Numbers) -> float:
    """Swing of a motor as a motion of the contact along the force, m; NaN for a joint."""
    if found.name not in motors:
        return math.nan
    ratio = abs(float(motor_per_metre[motors.index(found.name)]))
    return found.swings.peak_to_peak / ratio if ratio > 0.0 else math.nan
