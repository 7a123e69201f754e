"""A slip in closed form, and the exact time of its end.

While the sign of the velocity is constant the model of `friction_model` is linear: x(t) follows from the
roots of the cubic (5.14), or of the quadratic if x_m moves at a constant rate.  No event can be missed:
the extremes of the velocity divided by its real mode are known and bracket its first zero; until then x is
monotone, which brackets every switch at a position.
"""

import math
from typing import NamedTuple

_TURN = 2.0 * math.pi
_INF = math.inf


class Roots(NamedTuple):
    """Real root, and the pair alpha +- sqrt(square); width = sqrt(abs(square))."""

    real: float
    alpha: float
    square: float
    width: float
    apart: float  # (real - alpha)^2 - square


def cubic_roots(c2: float, c1: float, c0: float) -> Roots:
    """Roots of s^3 + c2 s^2 + c1 s + c0, c0 > 0; of three real ones `real` is the outlying one.

    At a triple root c0 is changed by a factor 1 + 1e-12: the modal form needs distinct roots.

    Parameters
    ----------
    c2, c1, c0 : coefficients.
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
    return Roots(real, alpha, square, math.sqrt(abs(square)), (real - alpha) ** 2 - square)


def quadratic_roots(c1: float, c0: float) -> Roots:
    """Roots of s (s^2 + c1 s + c0): a node between a motor at constant speed and its springs.

    Parameters
    ----------
    c1, c0 : coefficients.
    """
    alpha = -c1 / 2.0
    square = alpha * alpha - c0
    if abs(square) < 1e-14 * c0:
        square = 0.0
    return Roots(0.0, alpha, square, math.sqrt(abs(square)), c0)


class Arc(NamedTuple):
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


class Zone(NamedTuple):
    """A range of x with one contact and one control law."""

    roots: Roots
    linear: bool  # x_m' = gain k_c (target - x), else x_m' = rate
    target: float
    rate: float
    contact: float  # k_c, 0 out of contact
    ramp: float  # steady v of the node for x_m' = 1


def arc_from(zone: Zone, rate: float, x: float, v: float, acceleration: float) -> Arc:
    """Closed form of a slip from its initial state.

    Parameters
    ----------
    zone : of the start.
    rate : of x_m, unless the zone is linear.
    x, v, acceleration : at the start.
    """
    lam, alpha, square, width, apart = zone.roots
    if zone.linear:
        xi = x - zone.target
        real = (acceleration - 2.0 * alpha * v + (alpha * alpha - square) * xi) / apart
        b = xi - real
        c = v - lam * real - alpha * b
        return Arc(
            lam, alpha, square, width, zone.target, 0.0, real, b, c, lam * real, alpha * b + c, alpha * c + square * b
        )
    ramp = zone.ramp * rate
    p = v - ramp
    q = acceleration - alpha * p
    b = (alpha * p - q) / (alpha * alpha - square)
    return Arc(0.0, alpha, square, width, x - b, ramp, 0.0, b, p - alpha * b, ramp, p, q)


def _pair(alpha: float, square: float, width: float, t: float) -> tuple[float, float]:
    """e^(alpha t) c(t) and e^(alpha t) s(t) of `Arc`."""
    if square < 0.0:
        e = math.exp(alpha * t)
        return e * math.cos(width * t), e * math.sin(width * t) / width
    angle = width * t
    if angle < 1.0:
        e = math.exp(alpha * t)
        return e * math.cosh(angle), e * (math.sinh(angle) / width if width else t)
    fast, slow = math.exp((alpha + width) * t), math.exp((alpha - width) * t)
    return (fast + slow) / 2.0, (fast - slow) / (2.0 * width)


def state_after(arc: Arc, t: float) -> tuple[float, float, float]:
    """x, v and acceleration of an arc after time t, s."""
    lam, alpha, square, width, centre, ramp, real, b, c, velocity_real, p, q = arc
    cos, sin = _pair(alpha, square, width, t)
    e = math.exp(lam * t)
    return (
        centre + ramp * t + real * e + b * cos + c * sin,
        velocity_real * e + p * cos + q * sin,
        lam * velocity_real * e + (alpha * p + q) * cos + (alpha * q + square * p) * sin,
    )


def first_stop(arc: Arc, sign: int, from_rest: bool, horizon: float = _INF) -> float:
    """First zero of v, which has this sign at the start, s; infinite without one.

    Beyond the horizon the result is only known to be beyond it.

    Parameters
    ----------
    arc : of the slip.
    sign : of the motion.
    from_rest : whether v is zero at the start.
    horizon : s.

    Notes
    -----
    The minima of g = sign v e^(-lam t) = sign a + e^(beta t) R cos(w t - phi) are one turn apart, and the
    least or the first negative one is known: the zero lies between it and the preceding maximum.
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
        since -= _TURN  # from rest v can only rise: this is the minimum itself
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
    """Zero of a + e^(beta t) A cos(w t - phi), which falls from low to high, by Newton within the bracket."""
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


def _first_stop_overdamped(arc: Arc, sign: int, from_rest: bool, horizon: float) -> float:
    """As `first_stop` for real roots: v e^(-lam t) has at most one extreme, in closed form."""
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


def crossing(arc: Arc, sign: int, position: float, end: float) -> float:
    """Time at which x, monotone in direction sign until end, reaches the position; infinite if never.

    Parameters
    ----------
    arc : of the slip.
    sign : of the motion.
    position : x at the crossing.
    end : of the slip, s.
    """
    if end == _INF:
        if not arc.ramp and sign * (arc.centre - position) <= 0.0:
            return _INF
        end = 1.0 / arc.width if arc.width else 1.0 / abs(arc.alpha)
        while sign * (state_after(arc, end)[0] - position) < 0.0:
            end *= 2.0
            if end > 1e300:
                return _INF
    reached, begun = state_after(arc, end)[0], arc.centre + arc.real + arc.b
    if sign * (reached - position) < 0.0:
        return _INF
    low, high = 0.0, end
    t = end * (position - begun) / (reached - begun) if reached != begun else end
    close = 1e-13 * end
    for _ in range(200):
        x, v, a = state_after(arc, t)
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
