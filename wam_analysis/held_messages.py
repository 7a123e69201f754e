"""Messages at other times: which is held, where a topic has none, and joints in the order of some names."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wam_analysis.thresholds import HOLD, STREAM
from wam_bag.arrays import Index, Mask, Numbers, Times
from wam_bag.bag import BagError, JointColumns
from wam_control.task.scenario import FORCE_LOOP
from wam_description.arm import Arm, InputAges
from wam_sim.recorded_commands import COMMANDS
from wam_sim.recorded_run import RecordedRun


def held_of(run: RecordedRun, topic: str) -> int:
    """For how long a message of a topic is held, ns; a command as long as the arm obeyed it, if that is known."""
    with suppress(BagError):
        if topic in COMMANDS:
            return run.parameters.part(FORCE_LOOP, InputAges, "ages.").limit_ns("command")
    return STREAM.held


def live_numbers(run: RecordedRun, name: str) -> list[tuple[int, float]]:
    """Since when, ns, a number of the force loop had each value, from the start on; NaN where it was not recorded."""
    key = f"{FORCE_LOOP}:{name}"
    changes = [(since, values[key]) for since, values in run.live_values(FORCE_LOOP) if key in values]
    every = [(0, run.parameters.nodes.get(FORCE_LOOP, {}).get(name)), *changes]
    return [(since, float(value) if isinstance(value, (int, float)) else np.nan) for since, value in every]


def held_for(stamps: Times, held: int = STREAM.held) -> int:
    """For how long a message of these is held, ns: `held`, or longer where a recording was thinned."""
    return max(held, STREAM.thinned * int(np.median(np.diff(stamps)))) if len(stamps) > STREAM.fewest else held


def held_rows(stamps: Times, base: Times, held: int = STREAM.held) -> tuple[Index, Mask]:
    """Row of the last message at or before each instant, and whether there is one and it is still held."""
    row = row_at(stamps, base)
    age = base - stamps[row]
    return row, (age >= 0) & (age <= held_for(stamps, held))


def value_changes(values: Numbers, least: float = HOLD.equal_force) -> Mask:
    """(n - 1,), whether each command but the first, (n, k), differs from that since the last change: also in a ramp."""
    found, rows = np.zeros(max(len(values) - 1, 0), np.bool_), values.tolist()
    since = rows[0] if rows else []
    for row in np.flatnonzero(np.any(np.diff(values, axis=0) != 0.0, axis=1)).tolist():
        if any(abs(now - before) > least for now, before in zip(rows[row + 1], since, strict=True)):
            found[row], since = True, rows[row + 1]
    return found


def intervals(stamps: Times, changes: Mask, held: int) -> Iterator[tuple[int, int, int]]:
    """Row, begin and end, ns, of each time in which one command comes: until it changes, or does not come any more.

    Parameters
    ----------
    stamps : (n,), ns.
    changes : (n - 1,), whether each message but the first commands something else than the one before.
    held : as for `held_for`.
    """
    steps = np.diff(stamps)
    last = np.append(changes | (steps > held_for(stamps, held)), True)
    period = int(np.median(steps)) if len(steps) else 0
    for first, after in pairwise([0, *(np.flatnonzero(last) + 1).tolist()]):
        yield first, int(stamps[first]), int(stamps[after - 1]) + period


def with_holes(stamps: Times, held: int) -> Times:
    """These and, where none comes for longer than one is held, an instant at which it is not held any more."""
    held = held_for(stamps, held)
    return np.sort(np.concatenate([stamps, stamps[:-1][np.diff(stamps) > held] + held + 1]))


def by_names(columns: JointColumns | None, field: str, names: tuple[str, ...]) -> Numbers | None:
    """Columns of a field in the order of some names, (k, n); None without columns, or if a name is missing."""
    values: Numbers = getattr(columns, field, np.empty((0, 0)))
    if columns is None or not values.shape[1] or any(name not in columns.names for name in names):
        return None
    order = [columns.names.index(name) for name in names]
    return values if order == list(range(values.shape[1])) else values[:, order]


def joint_angles(run: RecordedRun, arm: Arm) -> tuple[Times, Numbers] | None:
    """Stamps, (k,), ns, and angles of the joints, (k, n), rad, of the best topic that has them; None without any."""
    for topic in ("sim/joint_states", "joint_sensors", "joint_states", "motor_states"):
        columns, is_motors = run.joints(topic), topic == "motor_states"
        names = arm.motors.names if is_motors else arm.joints.names
        angles = by_names(columns, "position", names)
        if columns is not None and angles is not None and np.any(good := np.isfinite(angles).all(axis=1)):
            found = angles[good]
            return columns.stamp_ns[good], found @ arm.transmission.joint_from_motor.T if is_motors else found
    return None


def step_at(steps: Sequence[Any], stamp: int) -> str:
    """Name of the step of a scenario, or of the force, at an instant, '' outside."""
    return next((step.name for step in steps if step.begin <= stamp < step.end), "")


def row_at(stamps: NDArray[Any], at: Any) -> Any:
    """Row of the last of some rising stamps at or before each of some instants, 0 where there is none."""
    return np.maximum(np.searchsorted(stamps, at, side="right") - 1, 0)
