"""Successive phases of stick and slip, each from the closed form of the last one.

The motor is velocity-controlled; friction is F_dynamic against the motion and up to F_static at rest.
While the sign of the velocity is constant, or the node sticks, the model is linear.
"""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

from wam_theory.friction_model import FrictionNode, IntegralLoop, require
from wam_theory.slip_arc import Arc, Zone, arc_from, crossing, cubic_roots, first_stop, quadratic_roots, state_after

_INF = math.inf


class Kind(StrEnum):
    """Kind of an event."""

    START = "start"
    SLIP = "slip"
    STICK = "stick"
    REVERSE = "reverse"
    SWITCH = "switch"
    SAMPLE = "sample"


class Model(NamedTuple):
    """Node and loop for one desired force."""

    node: FrictionNode
    loop: IntegralLoop
    force: float
    breaks: tuple[float, ...]  # positions where the zone changes, between -inf and inf
    zones: tuple[Zone, ...]  # zones[i] lies between breaks[i] and breaks[i + 1]
    self_similar: float  # largest error up to which a stuck Coulomb response scales with the error, N m

    def contact_force(self, x: float) -> float:
        """F_c at x, N m."""
        return 0.0 if self.node.unilateral and x < 0.0 else self.node.contact_stiffness * x

    def motor(self, zone: Zone, sign: int, state: tuple[float, float, float]) -> float:
        """x_m from the balance of forces on a slipping node, from x, v and acceleration."""
        x, v, a = state
        node = self.node
        balance = node.inertia * a + node.damping * v + zone.contact * x + sign * node.dynamic_friction
        return x + balance / node.transmission_stiffness


def prepared(node: FrictionNode, loop: IntegralLoop, force: float) -> Model:
    """Node and loop for one desired force: zones of x, with the roots of each.

    Parameters
    ----------
    node, loop : to simulate.
    force : F_des, N m.
    """
    require("force", force, at_least=-1e300)
    force = float(force)
    j, b, ktr, kc = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    cubic = cubic_roots(b / j, (ktr + kc) / j, loop.gain * ktr * kc / j)
    held = quadratic_roots(b / j, (ktr + kc) / j)
    free = quadratic_roots(b / j, ktr / j)
    errors = set()
    if not loop.sample_period:
        errors = {e for level in (loop.error_limit, loop.deadband) for e in (level, -level) if 0.0 < level < _INF}
    breaks = {(force - e) / kc for e in errors}
    if node.unilateral:
        breaks = {x for x in breaks if x > 0.0} | {0.0}
    edges = (-_INF, *sorted(breaks), _INF)
    zones = []
    for left, right in pairwise(edges):
        contact = 0.0 if node.unilateral and right <= 0.0 else kc
        inside = (
            max(left, min(right, 0.0) - 1.0 - 2.0 * abs(force) / kc),
            min(right, max(left, 0.0) + 1.0 + 2.0 * abs(force) / kc),
        )
        error = force - contact * sum(inside) / 2.0
        linear = bool(contact) and not loop.sample_period and loop.deadband <= abs(error) <= loop.error_limit
        target = (force - math.copysign(loop.deadband, error)) / kc
        rate = 0.0 if loop.sample_period else loop.gain * loop.effective_error(error)
        roots = cubic if linear else held if contact else free
        zones.append(Zone(roots, linear, target, rate, contact, ktr / (ktr + contact)))
    similar = 0.0
    if node.static_friction == node.dynamic_friction > 0.0 and not loop.deadband and not loop.sample_period:
        similar = min(loop.error_limit, abs(force) if node.unilateral and force > 0.0 else _INF)
        similar = 0.0 if node.unilateral and force <= 0.0 else similar
    return Model(node, loop, force, edges, tuple(zones), similar)


class _Hold:
    """Sampled law: the motor command, constant between two samples."""

    __slots__ = ("loop", "number", "pipeline", "rate")

    def __init__(self, loop: IntegralLoop, error: float) -> None:
        self.loop = loop
        self.pipeline = deque([0.0] * loop.delay_samples)
        self.number = -1
        self.rate = 0.0
        self.sample(error)

    def sample(self, error: float) -> None:
        self.pipeline.append(self.loop.effective_error(error))
        self.rate = self.loop.gain * self.pipeline.popleft()
        self.number += 1

    @property
    def next(self) -> float:
        return (self.number + 1) * self.loop.sample_period

    def steady(self, error: float) -> bool:
        """Whether further samples change nothing at this error."""
        effective = self.loop.effective_error(error)
        return self.rate == self.loop.gain * effective and all(e == effective for e in self.pipeline)

    def skip_to(self, time: float) -> None:
        self.number = max(self.number, math.ceil(time / self.loop.sample_period) - 1)


# time, kind, sign, zone, rate of x_m (unless linear), x, v, x_m, acceleration
Phase = tuple[float, Kind, int, int, float, float, float, float, float]


def phases_of(model: Model, start: tuple[float, float, float]) -> Iterator[Phase]:
    """Successive phases, until one lasts indefinitely.

    Parameters
    ----------
    model : of `prepared`.
    start : x, v, x_m at time 0.
    """
    node, breaks, j, dynamic = model.node, model.breaks, model.node.inertia, model.node.dynamic_friction
    x, v, m = map(float, start)
    t, kind = 0.0, Kind.START
    i = bisect_right(breaks, x) - 1
    hold = _Hold(model.loop, model.force - model.contact_force(x)) if model.loop.sample_period else None
    sign, spring, a = _begin(model, start)
    while True:
        zone = model.zones[i]
        rate = hold.rate if hold else zone.rate
        if not sign:
            if zone.linear:
                rate = model.loop.gain * zone.contact * (zone.target - x)
            yield t, kind, 0, i, rate, x, 0.0, m, 0.0
            wait = _wait(node, rate, spring)
            if hold and t + wait >= hold.next and not hold.steady(model.force - zone.contact * x):
                m += rate * (hold.next - t)
                spring += node.transmission_stiffness * rate * (hold.next - t)
                t, kind = hold.next, Kind.SAMPLE
                hold.sample(model.force - zone.contact * x)
                continue
            if wait == _INF:
                return
            t += wait
            if hold:
                hold.skip_to(t)
            sign, kind = (1 if rate > 0.0 else -1), Kind.SLIP
            m = x + (zone.contact * x + sign * node.static_friction) / node.transmission_stiffness
            a = sign * (node.static_friction - dynamic) / j
            continue
        yield t, kind, sign, i, rate, x, v, m, a
        arc = arc_from(zone, rate, x, v, a)
        cause, end = _slip_end(arc, sign, v == 0.0, breaks[i + (sign > 0)], hold.next - t if hold else _INF)
        if end == _INF:
            return
        t += end
        x, v, a = state_after(arc, end)
        m = model.motor(zone, sign, (x, v, a)) if zone.linear else m + rate * end
        kind = cause
        if cause is Kind.STICK:
            v, spring = 0.0, sign * min(j * a * sign + dynamic, node.static_friction)
            if sign * spring >= -node.static_friction:
                sign = 0
            else:
                sign, kind = -sign, Kind.REVERSE
                a = (spring - sign * dynamic) / j
        elif cause is Kind.SWITCH:
            x, v = breaks[i + (sign > 0)], sign * abs(v)
            i += sign
        elif hold:
            t = hold.next
            hold.sample(model.force - zone.contact * x)


def _begin(model: Model, start: tuple[float, float, float]) -> tuple[int, float, float]:
    """Sign of the motion in the first phase, net spring force, and acceleration of a slip."""
    x, v, m = start
    node = model.node
    spring = node.transmission_stiffness * (m - x) - model.contact_force(x)
    moving = v or (0.0 if abs(spring) <= node.static_friction else spring)
    sign = int(math.copysign(1.0, moving)) if moving else 0
    return sign, spring, (spring - node.damping * v - sign * node.dynamic_friction) / node.inertia


def _wait(node: FrictionNode, rate: float, spring: float) -> float:
    """Time to breakaway, (5.3), while x_m moves at this rate."""
    if not rate:
        return _INF
    return max(0.0, (math.copysign(node.static_friction, rate) - spring) / (node.transmission_stiffness * rate))


def _slip_end(arc: Arc, sign: int, from_rest: bool, edge: float, sample: float) -> tuple[Kind, float]:
    """Event that ends a slip (STICK for any standstill), and its time, s; infinite without one."""
    cause, end = Kind.STICK, first_stop(arc, sign, from_rest, sample)
    if sample < end:
        cause, end = Kind.SAMPLE, sample
    if -_INF < edge < _INF:
        switch = crossing(arc, sign, edge, end)
        if switch <= end < _INF or switch < end:
            return Kind.SWITCH, switch
    return cause, end
