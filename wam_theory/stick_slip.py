"""Exact motion of the friction node between transmission and contact (figures 5.2 and 5.4).

    J x'' = k_tr (x_m - x) - F_c - b x' - friction,    F_c = k_c x,    x_m' = G_I F_error

The motor is velocity-controlled; friction is F_dynamic against the motion and up to F_static at
rest.  While the sign of the velocity stands, or the node sticks, the model is linear: each such
phase is propagated in closed form (roots of the cubic (5.14), or of the quadratic where x_m moves
at a constant rate), and its end is found on the closed form.  No event can be missed: extremes of
the velocity, divided by its real mode, are known, so its first zero is bracketed between two of
them, and until then x is monotone, which brackets every switch at a position.

Units are free but consistent (N, m, s or N m, rad, s).
"""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_TURN = 2.0 * math.pi
_INF = math.inf
_HUGE = 1e100  # a response beyond it is not followed further


class Kind(StrEnum):
    """What happens at an event."""

    START = "start"
    SLIP = "slip"
    STICK = "stick"
    REVERSE = "reverse"
    SWITCH = "switch"
    SAMPLE = "sample"


class Verdict(StrEnum):
    """What becomes of a step response."""

    SETTLED = "settled"
    LIMIT_CYCLE = "limit cycle"
    DIVERGED = "diverged"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class FrictionNode:
    """Inertia with dry friction between transmission and contact (figure 5.4).

    Parameters
    ----------
    inertia : J_l, kg m^2 (or kg), above zero.
    damping : b, N m s/rad, zero or more.
    transmission_stiffness : k_tr at the node, N m/rad, above zero.
    contact_stiffness : k_c at the node, N m/rad, above zero.
    dynamic_friction : F_dynamic, N m, zero or more.
    static_friction : F_static, N m, at least F_dynamic; equal to it is Coulomb friction.
    unilateral : whether the contact only pushes, F_c = k_c max(x, 0).

    Raises
    ------
    ValueError
        where a value is out of its range.
    """

    inertia: float
    damping: float
    transmission_stiffness: float
    contact_stiffness: float
    dynamic_friction: float
    static_friction: float
    unilateral: bool = False

    def __post_init__(self) -> None:
        """Refuse values out of range; keep the others as Python floats, which are faster than numpy's."""
        _as_floats(self, "inertia", "damping", "transmission_stiffness", "contact_stiffness")
        _as_floats(self, "dynamic_friction", "static_friction")
        for name in ("inertia", "transmission_stiffness", "contact_stiffness"):
            _require(name, getattr(self, name), above=0.0)
        for name in ("damping", "dynamic_friction"):
            _require(name, getattr(self, name), at_least=0.0)
        _require("static_friction", self.static_friction, at_least=self.dynamic_friction)


@dataclass(frozen=True, slots=True)
class ForceLoop:
    """Integral force control through a velocity-controlled motor (5.5).

    F_error is saturated at `error_limit`; at the input of G_I a dead zone then takes `deadband` from
    its magnitude (5.7), so that the motor's speed is continuous in the error.

    Parameters
    ----------
    gain : G_I, rad/s of x_m for one N m of error, above zero.
    error_limit : N m, above the deadband; infinite for none.
    deadband : N m, zero or more.
    sample_period : s, of the zero-order hold; zero for a continuous loop.
    delay_samples : whole periods between a sample and its command; zero answers in the same period.

    Raises
    ------
    ValueError
        where a value is out of its range.
    """

    gain: float
    error_limit: float = _INF
    deadband: float = 0.0
    sample_period: float = 0.0
    delay_samples: int = 0

    def __post_init__(self) -> None:
        """Refuse values out of range; keep the others as Python floats, which are faster than numpy's."""
        _as_floats(self, "gain", "error_limit", "deadband", "sample_period")
        _require("gain", self.gain, above=0.0)
        _require("deadband", self.deadband, at_least=0.0)
        if not self.error_limit > self.deadband:
            raise ValueError(f"error_limit is {self.error_limit}; it must be above the deadband, {self.deadband}")
        _require("sample_period", self.sample_period, at_least=0.0)
        if self.delay_samples < 0 or int(self.delay_samples) != self.delay_samples:
            raise ValueError(f"delay_samples is {self.delay_samples}; it must be a whole number, zero or more")
        if self.delay_samples and not self.sample_period:
            raise ValueError(f"delay_samples is {self.delay_samples}; without a sample_period it must be zero")

    def effective_error(self, error: float) -> float:
        """Error that G_I sees, N m, after saturation and deadband."""
        return math.copysign(max(min(abs(error), self.error_limit) - self.deadband, 0.0), error)


class Event(NamedTuple):
    """State at the beginning of a phase.

    `sign` is the direction of motion in the phase, 0 while stuck; `contact_force` is F_c, N m.
    """

    time: float
    kind: Kind
    sign: int
    x: float
    v: float
    x_m: float
    contact_force: float


class Motion(NamedTuple):
    """Sampled trajectory: arrays of the shape of the times."""

    x: NDArray[np.float64]
    v: NDArray[np.float64]
    x_m: NDArray[np.float64]
    contact_force: NDArray[np.float64]


class Outcome(NamedTuple):
    """Verdict on a step response, and the settled cycle of F_c.

    `peak_to_peak` (N m) and `period` (s) are NaN unless it is a limit cycle; `time` is that of the
    last of the `events` looked at.
    """

    verdict: Verdict
    peak_to_peak: float
    period: float
    time: float
    events: int


class HalfCycle(NamedTuple):
    """One slip from breakaway to the next standstill, error 1 at breakaway, time in sqrt(J/(k_tr + k_c)).

    Where the node only creeps towards F_des, `duration` is infinite and the rest is 0.
    """

    error: float
    acceleration: float
    duration: float


class Staircase(NamedTuple):
    """Jumps of an inertialess node: times (n,) s, contact force after each (n,) N m, and its spring force (n,) N m."""

    times: NDArray[np.float64]
    contact_forces: NDArray[np.float64]
    spring_forces: NDArray[np.float64]


def _as_floats(instance: object, *names: str) -> None:
    """Turn fields of a frozen instance into floats."""
    for name in names:
        object.__setattr__(instance, name, float(getattr(instance, name)))


def _require(name: str, value: float, above: float | None = None, at_least: float | None = None) -> None:
    """Refuse a value that is not finite or not in its range."""
    if above is not None and not above < value < _INF:
        raise ValueError(f"{name} is {value}; it must be finite and above {above:g}")
    if at_least is not None and not at_least <= value < _INF:
        raise ValueError(f"{name} is {value}; it must be finite and at least {at_least:g}")


# ---------------------------------------------------------------------------------- closed forms
class _Roots(NamedTuple):
    """Real root, and the pair alpha +- sqrt(square); width = sqrt(abs(square))."""

    real: float
    alpha: float
    square: float
    width: float
    apart: float  # (real - alpha)^2 - square


def _cubic_roots(c2: float, c1: float, c0: float) -> _Roots:
    """Roots of s^3 + c2 s^2 + c1 s + c0, c0 > 0; of three real ones the one that stands apart is `real`.

    At a triple root c0 is moved by 1e-12 of itself: the modal form needs distinct roots.
    """
    shift = -c2 / 3.0
    p = c1 - c2 * c2 / 3.0
    q = (2.0 * c2 * c2 / 27.0 - c1 / 3.0) * c2 + c0
    if abs(p) < 1e-8 * c1 and abs(q) < 1e-12 * c0:
        p, q = 0.0, 1e-12 * c0
    discriminant = q * q / 4.0 + p * p * p / 27.0
    if discriminant > 0.0:
        u = math.cbrt(abs(q) / 2.0 + math.sqrt(discriminant))
        y = math.copysign(u - p / (3.0 * u), -q)
    else:
        radius = math.sqrt(-p / 3.0)
        cosine = min(1.0, abs(q) / (2.0 * radius**3)) if radius else 0.0
        y = math.copysign(2.0 * radius * math.cos(math.acos(cosine) / 3.0), -q)
    real = shift + y
    for _ in range(3):
        slope = (3.0 * real + 2.0 * c2) * real + c1
        if slope * slope < 1e-6 * c1 * c1:
            break
        real -= (((real + c2) * real + c1) * real + c0) / slope
    alpha = -(c2 + real) / 2.0
    square = alpha * alpha + c0 / real
    return _Roots(real, alpha, square, math.sqrt(abs(square)), (real - alpha) ** 2 - square)


def _quadratic_roots(c1: float, c0: float) -> _Roots:
    """Roots of s (s^2 + c1 s + c0): a node between a motor at constant speed and its springs."""
    alpha = -c1 / 2.0
    square = alpha * alpha - c0
    if abs(square) < 1e-14 * c0:
        square = 0.0
    return _Roots(0.0, alpha, square, math.sqrt(abs(square)), c0)


class _Arc(NamedTuple):
    """x(t) = centre + ramp t + real e^(lam t) + e^(alpha t) (B c + C s); v in velocity_real and P, Q.

    c, s are cos(w t), sin(w t)/w for square < 0, 1, t for 0, cosh(w t), sinh(w t)/w above.
    """

    lam: float
    alpha: float
    square: float
    width: float
    centre: float
    ramp: float
    real: float
    b: float
    c: float
    velocity_real: float  # factor of e^(lam t) in v
    p: float
    q: float


class _Zone(NamedTuple):
    """A range of x where contact and law keep their form."""

    roots: _Roots
    linear: bool  # x_m' = gain k_c (target - x), else x_m' = rate
    target: float
    rate: float
    contact: float  # k_c, 0 out of contact
    ramp: float  # v of the node for x_m' = 1, once it follows


def _arc(zone: _Zone, rate: float, x: float, v: float, acceleration: float) -> _Arc:
    """Closed form of a slip from its initial state."""
    lam, alpha, square, width, apart = zone.roots
    if zone.linear:
        xi = x - zone.target
        real = (acceleration - 2.0 * alpha * v + (alpha * alpha - square) * xi) / apart
        b = xi - real
        c = v - lam * real - alpha * b
        return _Arc(
            lam, alpha, square, width, zone.target, 0.0, real, b, c, lam * real, alpha * b + c, alpha * c + square * b
        )
    ramp = zone.ramp * rate
    p = v - ramp
    q = acceleration - alpha * p
    b = (alpha * p - q) / (alpha * alpha - square)
    return _Arc(0.0, alpha, square, width, x - b, ramp, 0.0, b, p - alpha * b, ramp, p, q)


def _pair(alpha: float, square: float, width: float, t: float) -> tuple[float, float]:
    """e^(alpha t) c(t) and e^(alpha t) s(t) of `_Arc`."""
    if square < 0.0:
        e = math.exp(alpha * t)
        return e * math.cos(width * t), e * math.sin(width * t) / width
    angle = width * t
    if angle < 1.0:
        e = math.exp(alpha * t)
        return e * math.cosh(angle), e * (math.sinh(angle) / width if width else t)
    fast, slow = math.exp((alpha + width) * t), math.exp((alpha - width) * t)
    return (fast + slow) / 2.0, (fast - slow) / (2.0 * width)


def _state(arc: _Arc, t: float) -> tuple[float, float, float]:
    """x, v and acceleration after t."""
    lam, alpha, square, width, centre, ramp, real, b, c, velocity_real, p, q = arc
    cos, sin = _pair(alpha, square, width, t)
    e = math.exp(lam * t)
    return (
        centre + ramp * t + real * e + b * cos + c * sin,
        velocity_real * e + p * cos + q * sin,
        lam * velocity_real * e + (alpha * p + q) * cos + (alpha * q + square * p) * sin,
    )


def _first_stop(arc: _Arc, sign: int, from_rest: bool, horizon: float = _INF) -> float:
    """First time at which v, of this sign at first, is zero; infinite where it never is.

    Beyond the horizon any time beyond it will do.

    g = sign v e^(-lam t) = sign a + e^(beta t) R cos(w t - phi) has its minima one turn apart, and
    the least or the first negative one is known: the zero lies between it and the maximum before.
    """
    if arc.square >= 0.0:
        return _first_stop_overdamped(arc, sign, from_rest, horizon)
    _, alpha, _, width, _, _, _, _, _, velocity_real, p, q = arc
    beta = alpha - arc.lam
    a = sign * velocity_real
    q /= width
    amplitude = math.sqrt(p * p + q * q)
    if amplitude == 0.0:
        return _INF
    lag = math.atan(beta / width)
    phase = math.atan2(q, p)
    since = (-phase - lag - (math.pi if sign > 0 else 0.0)) % _TURN  # phase since the last minimum
    if from_rest and since > 0.75 * _TURN:
        since -= _TURN  # at rest it can only rise: this is the minimum itself
    high = (_TURN - since) / width
    if since < math.pi:
        low = (math.pi - since) / width
    elif from_rest:
        return 0.0
    else:
        low = 0.0
    depth = amplitude * width / math.sqrt(beta * beta + width * width)
    if a >= depth * math.exp(min(beta * high, 700.0)):
        if beta <= 0.0:
            return _INF
        turns = max(1, math.ceil((math.log(a / depth) / beta - high) * width / _TURN))
        while a >= depth * math.exp(min(beta * (high + turns * _TURN / width), 700.0)):
            turns += 1
        high += turns * _TURN / width
        low = high - math.pi / width
    cosine = -a / (amplitude * math.exp(min(beta * (low + high) / 2.0, 600.0)))
    t = high - (math.pi + lag - math.acos(min(1.0, max(-1.0, cosine)))) / width
    return _falling_zero((a, sign * amplitude, beta, width, phase), t, low, high)


def _falling_zero(wave: tuple[float, float, float, float, float], t: float, low: float, high: float) -> float:
    """Zero of a + e^(beta t) A cos(w t - phi) that falls from low to high: Newton kept in the bracket."""
    a, amplitude, beta, width, phase = wave
    exp, cos, sin = math.exp, math.cos, math.sin
    close = 1e-13 * high
    if not low < t < high:
        t = (low + high) / 2.0
    for step in range(400):
        e = amplitude * exp(min(beta * t, 700.0))
        angle = width * t - phase
        c = cos(angle)
        g = a + e * c
        if g > 0.0:
            low = t
        else:
            high = t
        slope = e * (beta * c - width * sin(angle))
        after = t - g / slope if slope else low
        if not low < after < high or (step > 8 and step % 2):
            after = (low + high) / 2.0
        if abs(after - t) <= close:
            return after
        t = after
    return t


def _first_stop_overdamped(arc: _Arc, sign: int, from_rest: bool, horizon: float) -> float:
    """As `_first_stop` for real roots: v e^(-lam t) has at most one extreme, in closed form."""
    lam, alpha, square, width = arc[:4]
    beta, p, q = alpha - lam, arc.p, arc.q
    slow = max(lam, alpha + width)

    def falls(t: float) -> bool:
        cos, sin = _pair(alpha - slow, square, width, t)
        return sign * (arc.velocity_real * math.exp((lam - slow) * t) + p * cos + q * sin) < 0.0

    rates = [abs(rate) for rate in (beta, beta + width, beta - width) if rate]
    low, high = 0.0, 60.0 / min(rates)
    below = beta * q + square * p
    extreme = -(beta * p + q) / below if below else 0.0  # tanh(width t)/width
    if extreme > 0.0 and extreme * width < 1.0:
        if extreme * width > 1e-9:
            extreme = math.atanh(extreme * width) / width
        if falls(extreme) and not from_rest:
            high = extreme
        else:
            low = extreme
            high += extreme
    if not falls(high):
        return _INF
    while low < (middle := (low + high) / 2.0) < high and low <= horizon:
        if falls(middle):
            high = middle
        else:
            low = middle
    return high


def _crossing(arc: _Arc, sign: int, position: float, end: float) -> float:
    """Time at which x, monotone in direction sign until end, reaches the position; infinite if never."""
    if end == _INF:
        if not arc.ramp and sign * (arc.centre - position) <= 0.0:
            return _INF
        end = 1.0 / arc.width if arc.width else 1.0 / abs(arc.alpha)
        while sign * (_state(arc, end)[0] - position) < 0.0:
            end *= 2.0
            if end > 1e300:
                return _INF
    reached, begun = _state(arc, end)[0], arc.centre + arc.real + arc.b
    if sign * (reached - position) < 0.0:
        return _INF
    low, high = 0.0, end
    t = end * (position - begun) / (reached - begun) if reached != begun else end
    close = 1e-13 * end
    for _ in range(200):
        x, v, a = _state(arc, t)
        gap = sign * (x - position)
        if gap < 0.0:
            low = t
        else:
            high = t
        slope = sign * (v - (x - position) * a / (2.0 * v)) if v else 0.0
        after = t - gap / slope if slope > 0.0 else low
        if not low < after < high:
            after = (low + high) / 2.0
        if abs(after - t) <= close:
            return after
        t = after
    return t


# ---------------------------------------------------------------------------------------- phases
class _Model(NamedTuple):
    """Node and loop prepared for one desired force."""

    node: FrictionNode
    loop: ForceLoop
    force: float
    breaks: tuple[float, ...]  # positions where the zone changes, between -inf and inf
    zones: tuple[_Zone, ...]  # zones[i] lies between breaks[i] and breaks[i + 1]
    self_similar: float  # largest error within which a stuck Coulomb response only scales, N m

    def contact_force(self, x: float) -> float:
        return 0.0 if self.node.unilateral and x < 0.0 else self.node.contact_stiffness * x

    def motor(self, zone: _Zone, sign: int, state: tuple[float, float, float]) -> float:
        """x_m from the balance of forces on a slipping node, from x, v and acceleration."""
        x, v, a = state
        node = self.node
        balance = node.inertia * a + node.damping * v + zone.contact * x + sign * node.dynamic_friction
        return x + balance / node.transmission_stiffness


def _model(node: FrictionNode, loop: ForceLoop, force: float) -> _Model:
    """Zones of x, with the roots of each."""
    _require("force", force, at_least=-1e300)
    force = float(force)
    j, b, ktr, kc = node.inertia, node.damping, node.transmission_stiffness, node.contact_stiffness
    cubic = _cubic_roots(b / j, (ktr + kc) / j, loop.gain * ktr * kc / j)
    held = _quadratic_roots(b / j, (ktr + kc) / j)
    free = _quadratic_roots(b / j, ktr / j)
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
        zones.append(_Zone(roots, linear, target, rate, contact, ktr / (ktr + contact)))
    similar = 0.0
    if node.static_friction == node.dynamic_friction > 0.0 and not loop.deadband and not loop.sample_period:
        similar = min(loop.error_limit, abs(force) if node.unilateral and force > 0.0 else _INF)
        similar = 0.0 if node.unilateral and force <= 0.0 else similar
    return _Model(node, loop, force, edges, tuple(zones), similar)


class _Hold:
    """Sampled law: what the motor is told from one sample instant to the next."""

    __slots__ = ("loop", "number", "pipeline", "rate")

    def __init__(self, loop: ForceLoop, error: float) -> None:
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
        """Whether the samples to come change nothing while the error stays."""
        effective = self.loop.effective_error(error)
        return self.rate == self.loop.gain * effective and all(e == effective for e in self.pipeline)

    def skip_to(self, time: float) -> None:
        self.number = max(self.number, math.ceil(time / self.loop.sample_period) - 1)


# time, kind, sign, zone, rate of x_m (unless linear), x, v, x_m, acceleration
_Phase = tuple[float, Kind, int, int, float, float, float, float, float]


def _phases(model: _Model, start: tuple[float, float, float]) -> Iterator[_Phase]:
    """Phases one after the other, until one lasts for ever."""
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
        arc = _arc(zone, rate, x, v, a)
        cause, end = _slip_end(arc, sign, v == 0.0, breaks[i + (sign > 0)], hold.next - t if hold else _INF)
        if end == _INF:
            return
        t += end
        x, v, a = _state(arc, end)
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


def _begin(model: _Model, start: tuple[float, float, float]) -> tuple[int, float, float]:
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


def _slip_end(arc: _Arc, sign: int, from_rest: bool, edge: float, sample: float) -> tuple[Kind, float]:
    """What ends a slip (STICK stands for a standstill), and after what time; infinite if nothing does."""
    cause, end = Kind.STICK, _first_stop(arc, sign, from_rest, sample)
    if sample < end:
        cause, end = Kind.SAMPLE, sample
    if -_INF < edge < _INF:
        switch = _crossing(arc, sign, edge, end)
        if switch <= end < _INF or switch < end:
            return Kind.SWITCH, switch
    return cause, end


# ---------------------------------------------------------------------------------------- public
@dataclass(frozen=True, slots=True)
class Trajectory:
    """Exact trajectory up to a time: its events, and the state at any time in between."""

    until: float
    ended: bool
    _model: _Model = field(repr=False)
    _phases: tuple[_Phase, ...] = field(repr=False)

    @property
    def events(self) -> list[Event]:
        """Events in order of time; the first is the start."""
        return [
            Event(t, kind, sign, x, v, m, self._model.contact_force(x))
            for t, kind, sign, _, _, x, v, m, _ in self._phases
        ]

    def at(self, times: ArrayLike) -> Motion:
        """Motion at these times.

        Parameters
        ----------
        times : (...) s, from 0 to `until`.

        Raises
        ------
        ValueError
            where a time is outside.
        """
        asked = np.asarray(times, dtype=float)
        if not np.all((asked >= 0.0) & (asked <= self.until)):
            raise ValueError(f"times go from {asked.min()} to {asked.max()}; they must lie in 0 to {self.until}")
        starts = [phase[0] for phase in self._phases]
        states = [self._at(bisect_right(starts, t) - 1, t) for t in asked.ravel().tolist()]
        x, v, m, force = np.array(states, dtype=float).reshape(-1, 4).T
        shape = asked.shape
        return Motion(x.reshape(shape), v.reshape(shape), m.reshape(shape), force.reshape(shape))

    def _at(self, index: int, time: float) -> tuple[float, float, float, float]:
        start, _, sign, i, rate, x, v, m, a = self._phases[index]
        zone, dt = self._model.zones[i], time - start
        m += rate * dt
        if sign:
            x, v, a = _state(_arc(zone, rate, x, v, a), dt)
            if zone.linear:
                m = self._model.motor(zone, sign, (x, v, a))
        return x, v, m, self._model.contact_force(x)


def simulate(
    node: FrictionNode,
    loop: ForceLoop,
    force: float,
    until: float,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    max_events: int = 1_000_000,
) -> Trajectory:
    """Exact response to a step of the desired force at time 0.

    Parameters
    ----------
    node, loop : what is simulated.
    force : F_des, N m.
    until : s, above zero.
    start : x, v, x_m at time 0; by default at rest with unstressed springs.
    max_events : after so many, or once x is beyond 1e100, `until` is where they got to.

    Returns
    -------
    Trajectory
        `ended` says that the last phase lasts for ever (it rests, or creeps to its target).

    Raises
    ------
    ValueError
        where `until`, `start` or `force` is out of range.
    """
    _require("until", until, above=0.0)
    if not all(map(math.isfinite, start)):
        raise ValueError(f"start is {start}; it must be finite")
    model = _model(node, loop, force)
    phases: list[_Phase] = []
    for phase in _phases(model, start):
        if phase[0] > until:
            return Trajectory(until, False, model, tuple(phases))
        phases.append(phase)
        if len(phases) >= max_events or not abs(phase[5]) < _HUGE:
            return Trajectory(phase[0], False, model, tuple(phases))
    return Trajectory(until, True, model, tuple(phases))


def _runaway_size(model: _Model) -> float:
    """Size of the growing pair of modes above which it outgrows every kick that friction can give it.

    Reversing friction by 2 F_dynamic kicks the real mode by `kick` and the pair by `kick_pair`; over
    a half cycle, while the real mode is a tenth of the pair never shorter than 2.8/w, the pair grows
    by more than that, sticks no more, and the real mode stays small.  Infinite where the law is not
    linear throughout or the loop is linearly stable.
    """
    lam, alpha, square, width, apart = model.zones[0].roots
    if len(model.zones) > 1 or not model.zones[0].linear or alpha <= 0.0 or square >= 0.0:
        return _INF
    node = model.node
    kick = 2.0 * node.dynamic_friction / (node.inertia * apart)
    kick_pair = kick * math.hypot(1.0, (alpha - lam) / width)
    sticks = 3.0 * node.static_friction / (node.inertia * (alpha * alpha - square))
    real = 10.0 * kick / -math.expm1(2.8 * lam / width)
    return max(kick_pair / math.expm1(2.8 * alpha / width), real, sticks)


def _runs_away(model: _Model, phase: _Phase, size: float) -> bool:
    """Whether the phase, which begins with a reversal, is the beginning of the end."""
    _, _, _, i, rate, x, v, _, a = phase
    arc = _arc(model.zones[i], rate, x, v, a)
    pair = math.hypot(arc.b, arc.c / arc.width)
    return pair > size and abs(arc.real) < 0.1 * pair


def assess(
    node: FrictionNode,
    loop: ForceLoop,
    force: float,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tolerance: float = 1e-9,
    max_events: int = 200_000,
) -> Outcome:
    """What becomes of a step response.

    Settled: it rests or creeps to its target for ever; or, with Coulomb friction alone, a slip from
    stick to stick has reduced the error, after which the response only repeats itself smaller
    ((5.17): exact, because a slip from breakaway is proportional to its error); or eight standstills
    in a row stayed within 1e-7 of the step.  Limit cycle: twelve standstills or fewer repeat in place
    and time to `tolerance`.  Diverged: above 1e4 times the step and the friction, or, in a loop
    without limit, deadband or hold, once the growing modes outgrow whatever friction can take.

    Parameters
    ----------
    node, loop : what is simulated.
    force : F_des, N m.
    start : x, v, x_m at time 0.
    tolerance : relative, of the repetition.
    max_events : looked at; if nothing is clear by then and the standstills of the last quarter span
        what those of the quarter before did, to 2 %, it is a (not strictly periodic) limit cycle.
    """
    model = _model(node, loop, force)
    stiffness = node.contact_stiffness
    force = model.force
    scale = max(abs(force - model.contact_force(float(start[0]))), node.static_friction, 1e-300)
    runaway = _runaway_size(model)
    turns: list[tuple[float, float]] = []  # time and F_c of each standstill
    slipping: float = math.nan  # error at breakaway of the slip under way
    count, t = 0, 0.0
    creeping, crept_from = 0, math.nan  # samples since the last standstill, F_c then or 64 samples ago
    for phase in _phases(model, start):
        count += 1
        t, kind, x = phase[0], phase[1], phase[5]
        error = abs(force - stiffness * x)
        if error > 1e4 * scale or count > max_events:
            break
        if kind is Kind.SLIP:
            slipping = error
        elif kind is Kind.SAMPLE:
            creeping += 1
            if creeping % 64 == 0:
                if abs(stiffness * x - crept_from) < 1e-9 * scale:
                    return Outcome(Verdict.SETTLED, math.nan, math.nan, t, count)
                crept_from = stiffness * x
        elif kind is Kind.STICK or kind is Kind.REVERSE:
            creeping, crept_from = 0, math.nan
            turns.append((t, model.contact_force(x)))
            if kind is Kind.STICK and error < slipping <= model.self_similar:
                return Outcome(Verdict.SETTLED, math.nan, math.nan, t, count)
            if kind is Kind.REVERSE and runaway < _INF and _runs_away(model, phase, runaway):
                return Outcome(Verdict.DIVERGED, math.nan, math.nan, t, count)
            slipping = math.nan
            if len(turns) % 8 == 0 and (found := _cycle(turns, tolerance, scale)):
                return Outcome(*found, t, count)
    else:
        return Outcome(Verdict.SETTLED, math.nan, math.nan, t, count)
    if count <= max_events:
        return Outcome(Verdict.DIVERGED, math.nan, math.nan, t, count)
    return Outcome(*_irregular_cycle(turns, model.force), t, count)


def _cycle(turns: Sequence[tuple[float, float]], tolerance: float, scale: float) -> tuple[Verdict, float, float] | None:
    """Verdict, peak to peak and period, if the last standstills repeat or have become one place."""
    last = [force for _, force in turns[-8:]]
    if max(last) - min(last) < 1e-7 * scale:
        return Verdict.SETTLED, math.nan, math.nan
    for n in range(2, 13):
        if len(turns) < 2 * n + 1:
            return None
        recent = turns[-2 * n - 1 :]
        forces = [force for _, force in recent[n:]]
        span = max(forces) - min(forces)
        period = recent[2 * n][0] - recent[n][0]
        if (
            all(abs(recent[k][1] - recent[k + n][1]) <= tolerance * span for k in range(n, -1, -1))
            and abs(period - (recent[n][0] - recent[0][0])) <= tolerance * period
        ):
            return Verdict.LIMIT_CYCLE, span, period
    return None


def _irregular_cycle(turns: Sequence[tuple[float, float]], force: float) -> tuple[Verdict, float, float]:
    """Verdict from the spans of the last two quarters of the standstills."""
    quarter = len(turns) // 4
    if quarter < 8:
        return Verdict.UNDECIDED, math.nan, math.nan
    before = [f for _, f in turns[-2 * quarter : -quarter]]
    late = [f for _, f in turns[-quarter:]]
    spans = max(before) - min(before), max(late) - min(late)
    if abs(spans[1] - spans[0]) > 0.02 * spans[1]:
        return Verdict.UNDECIDED, math.nan, math.nan
    passes = sum((f1 < force) != (f2 < force) for f1, f2 in pairwise(late))
    period = 2.0 * (turns[-1][0] - turns[-quarter][0]) / passes if passes else math.nan
    return Verdict.LIMIT_CYCLE, spans[1], period


def largest_stable_step(node: FrictionNode, loop: ForceLoop, rtol: float = 1e-6, largest: float = 1e4) -> float:
    """Largest step of F_des from unstressed rest that does not diverge (domain II of figure 5.8).

    Bisection, which supposes that every smaller step is stable too.

    Parameters
    ----------
    node, loop : what is simulated; the node has friction.
    rtol : relative, of the result.
    largest : steps above this many times F_static are not tried.

    Returns
    -------
    float
        N m; 0 where a step of 1e-3 F_static diverges (domain III), infinite where one of `largest` does not.

    Raises
    ------
    ValueError
        where there is no friction to compare with, or a response stays undecided.
    """
    _require("static_friction", node.static_friction, above=0.0)

    def stable(step: float) -> bool:
        verdict = assess(node, loop, step).verdict
        if verdict is Verdict.UNDECIDED:
            raise ValueError(f"the response to a step of {step} stays undecided; move the gain, {loop.gain}, a little")
        return verdict is not Verdict.DIVERGED

    low, high = 1e-3 * node.static_friction, largest * node.static_friction
    if not stable(low):
        return 0.0
    if stable(high):
        return _INF
    while high > low * (1.0 + rtol):
        middle = math.sqrt(low * high)
        if stable(middle):
            low = middle
        else:
            high = middle
    return low


def half_cycle(gamma: float, zeta: float) -> HalfCycle:
    """One slip from a Coulomb breakaway, in the units of (5.14): error 1, time sqrt(J/(k_tr + k_c)).

    xi''' + 2 zeta xi'' + xi' + 2 zeta gamma xi = 0 from xi = 1, xi' = xi'' = 0 to the first xi' = 0.

    Parameters
    ----------
    gamma : J_l G_I K/b of (5.15), above zero.
    zeta : (5.12), above zero.
    """
    _require("gamma", gamma, above=0.0)
    _require("zeta", zeta, above=0.0)
    zone = _Zone(_cubic_roots(2.0 * zeta, 1.0, 2.0 * zeta * gamma), True, 0.0, 0.0, 1.0, 1.0)
    arc = _arc(zone, 0.0, 1.0, 0.0, 0.0)
    duration = _first_stop(arc, -1, True)
    if duration == _INF:
        return HalfCycle(0.0, 0.0, _INF)
    error, _, acceleration = _state(arc, duration)
    return HalfCycle(error, acceleration, duration)


def inertialess_staircase(node: FrictionNode, gain: float, force: float, jumps: int) -> Staircase:
    """Response of a node whose slip is a jump, the limit of (5.11): a staircase, then the cycle of (5.8), (5.9).

    In a jump the motor stands still and F_c moves by Omega dF k_c/(k_tr + k_c); the node then sticks
    until (5.3) has passed.  From unstressed rest.  The cycle keeps the asymmetry with which it
    begins; only the motor's motion during a slip makes it symmetric.

    Parameters
    ----------
    node : with F_static above F_dynamic; inertia and damping count through zeta (5.12) alone.
    gain : G_I.
    force : F_des, N m.
    jumps : how many; fewer are returned where F_c meets F_des exactly.

    Raises
    ------
    ValueError
        with Coulomb friction, where nothing jumps: the response is (5.2) after the delay (5.3).
    """
    _require("gain", gain, above=0.0)
    difference = node.static_friction - node.dynamic_friction
    if not difference > 0.0:
        raise ValueError(
            f"static_friction is {node.static_friction}, not above dynamic_friction: nothing jumps; "
            "the response is (5.2) after the delay (5.3)"
        )
    ks = node.transmission_stiffness + node.contact_stiffness
    zeta = node.damping / (2.0 * math.sqrt(node.inertia * ks))
    omega = 1.0 + (math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta * zeta)) if zeta < 1.0 else 0.0)
    t, contact, spring = 0.0, 0.0, 0.0
    rows = []
    for _ in range(jumps):
        error = force - contact
        if error == 0.0:
            break
        sign = math.copysign(1.0, error)
        t += (node.static_friction - sign * spring) / (gain * node.transmission_stiffness * abs(error))
        contact += sign * omega * difference * node.contact_stiffness / ks
        spring = sign * (node.static_friction - omega * difference)
        rows.append((t, contact, spring))
    times, contacts, springs = np.array(rows, dtype=float).reshape(-1, 3).T
    return Staircase(times, contacts, springs)
