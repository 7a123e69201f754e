"""The problem of one period: joint velocities that do what is commanded as well as the limits allow.

Minimise  |v - p|^2 + W sum_i (r_i.v - s_i)^2 + W sum_j max(0, g_j - t_j.v)^2   for   low <= v <= high,

with every row scaled to length 1.  Rows (r, s) are commanded, one-sided rows (t, g) are least velocities, p is the
posture.  The bounds always hold, so there is always a solution.  W puts the rows far above the posture; rows that
contradict each other share what is left.  An arm that gives way needs a smaller W: a push is often nearly along a row,
and with a large one the arm would move fast across both, to do both.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import quadprog

from wam_control.force.thresholds import FORCE
from wam_control.thresholds import MOTION
from wam_description.rigid_body import Array
from wam_description.small_matrices import inverse, length, outer, solution

# W: weight of a row per weight of the posture
RANK: Final = 1e6  # the posture moves along it by a millionth
PUSHED: Final = 100.0  # of an arm that gives way: it moves no faster than five times the push


class VelocityRow(NamedTuple):
    """A velocity along a direction of the joint space.

    Attributes
    ----------
    along : velocity along it per joint velocity (n,).
    speed : commanded, or the least one of a one-sided row, m/s or rad/s.
    """

    along: Array
    speed: float

    @property
    def size(self) -> float:
        """Length of `along`."""
        return length(self.along)


def solve(
    rows: Sequence[VelocityRow],
    posture: Array,
    least: Sequence[VelocityRow],
    low: Sequence[float],
    high: Sequence[float],
) -> tuple[Array, Array]:
    """The joint velocities of one period (n,), rad/s, with and without the limits; one object where none is active.

    Parameters
    ----------
    rows : commanded.
    posture : velocities of the posture (n,), rad/s.
    least : one-sided rows.
    low, high : bounds (n,), rad/s, low <= high.
    """
    rows, least = _used(rows), _used(least)
    free = unlimited(rows, posture)
    each = zip(low, free.tolist(), high)  # noqa: B905 - as long as each other
    is_inside = all([slowest <= speed <= fastest for slowest, speed, fastest in each])  # noqa: C419 - a list takes half the time
    active = [speed for along, speed in least if along.dot(free) < speed]
    if is_inside and not active:
        return free, free
    rank = PUSHED if max(active, default=0.0) > 0.0 else RANK
    return _limited(rows, posture, least, np.array(low), np.array(high), rank), free


def unlimited(rows: Sequence[VelocityRow], posture: Array) -> Array:
    """The joint velocities (n,), rad/s, without limits; arguments as those of `solve`."""
    rows = _used(rows)
    if len(rows) == 1:  # in closed form, so that one axis has the bits of its law
        along, speed = rows[0]
        return posture + along * ((speed - along.dot(posture)) / along.dot(along))
    return solution(*_normal(rows, posture)) if rows else posture


def _used(rows: Sequence[VelocityRow]) -> list[VelocityRow]:
    """The rows along which something moves."""
    return [row for row in rows if row.size > MOTION.rounding]


def _limited(
    rows: Sequence[VelocityRow],
    posture: Array,
    least: Sequence[VelocityRow],
    low: Array,
    high: Array,
    rank: float,
) -> Array:
    """The same with limits: each one-sided row has a slack of its own."""
    if not rows and not least:  # no joint depends on another
        return np.clip(posture, low, high)
    n, m = len(posture), len(least)
    matrix, right = _normal(rows, posture, rank)
    quadratic = rank * np.eye(n + m)
    quadratic[:n, :n] = matrix
    sides = np.zeros((n + m, 2 * n + m))
    sides[:n, :n], sides[:n, n : 2 * n] = np.eye(n), -np.eye(n)
    for j, row in enumerate(least):
        sides[:n, 2 * n + j], sides[n + j, 2 * n + j] = row.along / row.size, 1.0
    wide = FORCE.rounded_speed  # quadprog takes bounds that are equal for contradictory ones
    bounds = np.concatenate([low - wide, -high - wide, [row.speed / row.size for row in least]])
    found = quadprog.solve_qp(quadratic, np.concatenate([right, np.zeros(m)]), sides, bounds)[0][:n]
    result: Array = np.clip(found, low, high)
    return result


def _normal(rows: Sequence[VelocityRow], posture: Array, rank: float = RANK) -> tuple[Array, Array]:
    """Matrix (n, n) and right side (n,) of the problem without limits."""
    matrix, right = np.eye(len(posture)), posture
    for along, speed in rows:
        weighted = along * (rank / along.dot(along))
        matrix = matrix + outer(weighted, along)
        right = right + speed * weighted
    return matrix, right


def linear(rows: Sequence[Array], n: int) -> tuple[Array, Array]:
    """The solution without limits, v = M s + N p, for the guard: M (n, p) and N (n, n) of rows (n,)."""
    used = [VelocityRow(row, 0.0) for row in rows]
    hold = inverse(_normal(_used(used), np.zeros(n))[0])
    drive = [row.along * (RANK / row.size**2) if row.size > MOTION.rounding else 0.0 * row.along for row in used]
    return hold @ np.array(drive).T, hold
