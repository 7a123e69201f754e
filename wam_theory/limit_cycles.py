"""Force control against dry friction and compliance (chapter 5), in closed form.

Symbols: k_tr, k_c the stiffnesses on both sides of the friction node, ks = k_tr + k_c, K = k_tr k_c/ks,
gamma = J_l G_I K/b, zeta = b/(2 sqrt(J_l ks)).  All arguments broadcast and all results have the
shape they broadcast to; SI with radians, or any consistent units.  Where the print is in error the
corrected form stands here and the docstring says so.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from wam_theory.half_cycle import half_cycle

Array = NDArray[np.float64]


class SampledMargin(NamedTuple):
    """Smallest gain at which a sampled loop oscillates, and the frequency, rad/s, at which it does."""

    gain: float
    frequency: float


def _above_zero(**arguments: ArrayLike) -> list[Array]:
    """Arguments as arrays, refused where not finite and above zero."""
    return _checked(arguments, lambda a: a > 0.0, "above zero")


def _zero_or_more(**arguments: ArrayLike) -> list[Array]:
    """Arguments as arrays, refused where not finite or below zero."""
    return _checked(arguments, lambda a: a >= 0.0, "zero or more")


def _checked(arguments: dict[str, ArrayLike], allowed: Callable[[Array], NDArray[np.bool_]], what: str) -> list[Array]:
    arrays = []
    for name, value in arguments.items():
        array = np.asarray(value, dtype=float)
        if not np.all(np.isfinite(array) & allowed(array)):
            raise ValueError(f"{name} is {value!r}; it must be finite and {what}")
        arrays.append(array)
    return arrays


# ------------------------------------------------------------------------------- no friction (5.3)
def series_stiffness(transmission_stiffness: ArrayLike, contact_stiffness: ArrayLike) -> Array:
    """K = k_tr k_c/(k_tr + k_c), N m/rad, of transmission and contact, both above zero."""
    ktr, kc = _above_zero(transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness)
    return ktr * kc / (ktr + kc)


def proportional_error(force: ArrayLike, proportional_gain: ArrayLike, stiffness: ArrayLike) -> Array:
    """Steady error of proportional control, N m, (5.1): F_des/(1 + G_P K).  No friction.

    Parameters
    ----------
    force : F_des, N m.
    proportional_gain : G_P, rad/(N m), zero or more.
    stiffness : K, N m/rad, above zero.
    """
    (gain,) = _zero_or_more(proportional_gain=proportional_gain)
    (k,) = _above_zero(stiffness=stiffness)
    return np.asarray(force, dtype=float) / (1.0 + gain * k)


def integral_time_constant(gain: ArrayLike, stiffness: ArrayLike) -> Array:
    """Time constant of integral control, s, (5.2): 1/(G_I K).  No friction, no inertia, (5.4) small.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    stiffness : K, N m/rad, above zero.
    """
    g, k = _above_zero(gain=gain, stiffness=stiffness)
    return 1.0 / (g * k)


# ---------------------------------------------------------------------- nearly inertialess (5.4)
def breakaway_delay(
    gain: ArrayLike,
    transmission_stiffness: ArrayLike,
    static_friction: ArrayLike,
    error: ArrayLike,
    spring_force: ArrayLike = 0.0,
) -> Array:
    """Time that a stuck node waits before it slips, s, (5.3) in general: (F_s - sgn(e) f)/(G_I k_tr |e|).

    The print has f = 0, the first breakaway of an unstressed node.  Exact; infinite for no error.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    transmission_stiffness : k_tr, N m/rad, above zero.
    static_friction : F_static, N m, zero or more.
    error : e = F_des - F_c, N m, constant while stuck.
    spring_force : f = k_tr (x_m - x) - F_c when it stuck, N m, within +-F_static.
    """
    g, ktr = _above_zero(gain=gain, transmission_stiffness=transmission_stiffness)
    (fs,) = _zero_or_more(static_friction=static_friction)
    e, f = np.asarray(error, dtype=float), np.asarray(spring_force, dtype=float)
    if not np.all(np.abs(f) <= fs * (1.0 + 1e-12)):
        raise ValueError(f"spring_force is {spring_force!r}; a stuck node holds at most {static_friction!r}")
    shape = np.broadcast_shapes(g.shape, ktr.shape, fs.shape, e.shape, f.shape)
    distance = np.broadcast_to(fs - np.sign(e) * f, shape)
    speed = np.broadcast_to(g * ktr * np.abs(e), shape)
    return np.divide(distance, speed, out=np.full(shape, math.inf), where=speed > 0.0)


def damping_ratio(
    inertia: ArrayLike, damping: ArrayLike, transmission_stiffness: ArrayLike, contact_stiffness: ArrayLike
) -> Array:
    """Damping ratio zeta = b/(2 sqrt((k_tr + k_c) J_l)), (5.12).

    Parameters
    ----------
    inertia : J_l, kg m^2, above zero.
    damping : b, N m s/rad, zero or more.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    """
    j, ktr, kc = _above_zero(
        inertia=inertia, transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness
    )
    (b,) = _zero_or_more(damping=damping)
    return b / (2.0 * np.sqrt((ktr + kc) * j))


def inertia_number(
    gain: ArrayLike, inertia: ArrayLike, transmission_stiffness: ArrayLike, contact_stiffness: ArrayLike
) -> Array:
    """Left side of (5.4), G_I K sqrt(J_l/ks): speed of the actuator against that of the node.

    Where it is far below 1 the node is nearly inertialess and (5.2), (5.3) describe Coulomb friction.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    inertia : J_l, kg m^2, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    """
    g, j = _above_zero(gain=gain, inertia=inertia)
    k = series_stiffness(transmission_stiffness, contact_stiffness)
    return g * k * np.sqrt(j / (np.asarray(transmission_stiffness) + np.asarray(contact_stiffness)))


def stiction_cycle_number(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
) -> Array:
    """Left side of (5.11), (5.4) over sqrt(1 - zeta^2); infinite from zeta = 1 on.

    Far below 1 the cycle of (5.8), (5.9) is certain and has their size.  Its period takes about 0.2 over
    this number of cycles to get there.

    Parameters
    ----------
    gain, inertia, damping, transmission_stiffness, contact_stiffness : as in `inertia_number`, `damping_ratio`.
    """
    zeta = damping_ratio(inertia, damping, transmission_stiffness, contact_stiffness)
    number = inertia_number(gain, inertia, transmission_stiffness, contact_stiffness)
    below = np.sqrt(np.maximum(1.0 - zeta * zeta, 0.0))
    shape = np.broadcast_shapes(zeta.shape, number.shape)
    return np.divide(number, below, out=np.full(shape, math.inf), where=below > 0.0)


def slip_overshoot(zeta: ArrayLike) -> Array:
    """Omega of (5.10), 1 + exp(-pi zeta/sqrt(1 - zeta^2)): 2 without damping, 1 from zeta = 1 on.

    Not in print: travel of a slip with the motor at rest over that to its equilibrium.

    Parameters
    ----------
    zeta : (5.12), zero or more.
    """
    (z,) = _zero_or_more(zeta=zeta)
    below = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    exponent = np.divide(-math.pi * z, below, out=np.full(z.shape, -math.inf), where=below > 0.0)
    return 1.0 + np.exp(exponent)


def stiction_cycle_force(
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    static_friction: ArrayLike,
    dynamic_friction: ArrayLike,
    zeta: ArrayLike,
) -> Array:
    """Stiction limit cycle of F_c, PEAK TO PEAK, N m, (5.8): Omega dF k_c/(k_tr + k_c).

    The print calls it amplitude.  Where (5.11) is far below 1.

    Parameters
    ----------
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    static_friction, dynamic_friction : N m, zero or more, static at least dynamic.
    zeta : (5.12), zero or more.
    """
    ktr, kc = _above_zero(transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness)
    return slip_overshoot(zeta) * _stiction(static_friction, dynamic_friction) * kc / (ktr + kc)


def stiction_cycle_period(
    gain: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    static_friction: ArrayLike,
    dynamic_friction: ArrayLike,
    zeta: ArrayLike,
) -> Array:
    """Period of the stiction limit cycle, s, (5.9) corrected: 4/(G_I k_tr) ks/k_c (2 F_s/(Omega dF) - 1).

    The print has Omega in front and none inside, which is right for Omega = 1 alone.  Where (5.11) is
    far below 1 and after the cycle has become symmetric.  Infinite with Coulomb friction.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    transmission_stiffness, contact_stiffness, static_friction, dynamic_friction, zeta : as in
        `stiction_cycle_force`.
    """
    g, ktr, kc = _above_zero(
        gain=gain, transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness
    )
    jump = slip_overshoot(zeta) * _stiction(static_friction, dynamic_friction)
    (fs,) = _zero_or_more(static_friction=static_friction)
    shape = np.broadcast_shapes(fs.shape, jump.shape)
    waits = np.divide(2.0 * fs, jump, out=np.full(shape, math.inf), where=jump > 0.0)
    return 4.0 / (g * ktr) * (ktr + kc) / kc * (waits - 1.0)


def _stiction(static_friction: ArrayLike, dynamic_friction: ArrayLike) -> Array:
    """Static less dynamic friction, dF of (5.7), N m."""
    fs, fd = _zero_or_more(static_friction=static_friction, dynamic_friction=dynamic_friction)
    if not np.all(fs >= fd):
        raise ValueError(f"static_friction is {static_friction!r}; it must be at least {dynamic_friction!r}, dynamic")
    return fs - fd


# ----------------------------------------------------------------------------- inertial node (5.5)
def gain_ratio(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    proportional_gain: ArrayLike = 0.0,
) -> Array:
    """gamma, the left side of Routh's criterion (5.15), with G_P (5.23); linearly stable below 1.

    J_l G_I/b over 1/k_tr + 1/k_c + G_P, for a continuous loop.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    inertia : J_l, kg m^2, above zero.
    damping : b, N m s/rad, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    proportional_gain : G_P, rad/(N m), zero or more.
    """
    (g,) = _above_zero(gain=gain)
    return g / routh_gain(inertia, damping, transmission_stiffness, contact_stiffness, proportional_gain)


def routh_gain(
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    proportional_gain: ArrayLike = 0.0,
) -> Array:
    """Largest linearly stable G_I of a continuous loop, rad/s/(N m), from (5.15), (5.23).

    Parameters
    ----------
    inertia, damping, transmission_stiffness, contact_stiffness, proportional_gain : as in `gain_ratio`.
    """
    j, b, ktr, kc = _above_zero(
        inertia=inertia,
        damping=damping,
        transmission_stiffness=transmission_stiffness,
        contact_stiffness=contact_stiffness,
    )
    (gp,) = _zero_or_more(proportional_gain=proportional_gain)
    return b / j * (1.0 / ktr + 1.0 / kc + gp)


def sampled_margin(
    inertia: float,
    damping: float,
    transmission_stiffness: float,
    contact_stiffness: float,
    sample_period: float,
    delay_samples: int = 0,
) -> SampledMargin:
    """Largest linearly stable G_I with a zero-order hold, exactly; not in print.  No friction.

    The motor's speed is held for a sample period and answers the sample taken `delay_samples` periods
    before it.  With P(z) z^d + g Q(z) the characteristic polynomial of the exactly discretised loop,
    the loop oscillates where Q/(P z^d) is real and negative on the unit circle; its imaginary part is
    sin(theta) times a polynomial in cos(theta), whose roots are all the candidates besides theta = pi.

    Parameters
    ----------
    inertia : J_l, kg m^2, above zero.
    damping : b, N m s/rad, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    sample_period : s, above zero.
    delay_samples : zero answers within the period.
    """
    j, b, ktr, kc, period = (
        float(a)
        for a in _above_zero(
            inertia=inertia,
            damping=damping,
            transmission_stiffness=transmission_stiffness,
            contact_stiffness=contact_stiffness,
            sample_period=sample_period,
        )
    )
    if delay_samples < 0 or int(delay_samples) != delay_samples:
        raise ValueError(f"delay_samples is {delay_samples}; it must be a whole number, zero or more")
    p, q = _held_loop(j, b, ktr, kc, period)
    p = np.concatenate([np.zeros(int(delay_samples)), p])
    condition = np.zeros(1)
    for i, qi in enumerate(q):
        for k, pk in enumerate(p):
            if i != k:
                condition = polynomial.polyadd(condition, math.copysign(1.0, i - k) * qi * pk * _sine_ratio(abs(i - k)))
    roots = polynomial.polyroots(np.trim_zeros(condition, "b"))
    cosines = [r.real for r in roots if abs(r.imag) < 1e-7 and abs(r.real) < 1.0 - 1e-9]
    best = SampledMargin(math.inf, math.nan)
    for theta in [*map(math.acos, cosines), math.pi]:
        z = complex(math.cos(theta), math.sin(theta))
        gain = -complex(polynomial.polyval(z, p) / polynomial.polyval(z, q)).real
        if 0.0 < gain < best.gain:
            best = SampledMargin(gain, theta / period)
    return best


def _held_loop(j: float, b: float, ktr: float, kc: float, period: float) -> tuple[Array, Array]:
    """Denominator and numerator in ascending powers of z of F_c over the held speed of x_m."""
    ks = ktr + kc
    step = np.array([[0.0, 1.0, 0.0, 0.0], [-ks / j, -b / j, ktr / j, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0] * 4]) * period
    halvings = max(0, math.ceil(math.log2(max(1.0, float(np.abs(step).sum(axis=1).max())))) + 4)
    term = total = np.eye(4)
    for n in range(1, 16):
        term = term @ step / (n * 2.0**halvings)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    a, inlet = total[:3, :3], total[:3, 3]
    p = np.asarray(np.poly(a), dtype=float)
    # c adj(zI - A) b = det(zI - A + b c) - det(zI - A)
    q = np.asarray(np.poly(a - np.outer(inlet, [kc, 0.0, 0.0])), dtype=float) - p
    return p[::-1].copy(), q[::-1].copy()


def _sine_ratio(n: int) -> Array:
    """sin(n theta)/sin(theta) as a polynomial in cos(theta), ascending."""
    before, now = np.zeros(1), np.ones(1)
    for _ in range(n - 1):
        before, now = now, np.asarray(polynomial.polysub(polynomial.polymulx(2.0 * now), before), dtype=float)
    return now


def psi(gamma: ArrayLike, zeta: ArrayLike) -> Array:
    """Psi of (5.18), the LATER half-cycle amplitude over the EARLIER one, exactly.

    Errors of F_c at the standstill after a slip and at its breakaway, with the sign turned: negative
    where the slip stops short of F_des, 0 where it creeps there for ever (below gamma_a).  Holds with
    Coulomb friction for every slip that begins from stick, whatever the error.  The print has the
    ratio upside down.

    Parameters
    ----------
    gamma : (5.15), above zero.
    zeta : (5.12), above zero.
    """
    g, z = np.broadcast_arrays(*_above_zero(gamma=gamma, zeta=zeta))
    flat = [0.0 - half_cycle(a, b).error for a, b in zip(g.ravel().tolist(), z.ravel().tolist(), strict=True)]
    return np.array(flat, dtype=float).reshape(g.shape)


def gamma_a(zeta: ArrayLike) -> Array:
    """Value of gamma below which a slip creeps to F_des and never stops; not in print.

    1/3 - 8 zeta^2/27, where the real mode of (5.14) is as fast as the pair; above zeta = sqrt(3)/2,
    where the pair first has to become complex, with ((4 zeta^2/3 - 1)/3)^(3/2)/zeta more.

    Parameters
    ----------
    zeta : (5.12), above zero.
    """
    (z,) = _above_zero(zeta=zeta)
    return 1.0 / 3.0 - 8.0 * z * z / 27.0 + np.maximum((4.0 * z * z / 3.0 - 1.0) / 3.0, 0.0) ** 1.5 / z


def gamma_b(zeta: ArrayLike) -> Array:
    """Value of gamma where Psi = 0: above it a slip overshoots F_des, and x_m has the cycle (5.20); not in print.

    From zeta = sqrt(3)/2 on that is gamma_a.  Below zeta = 0.137 it lies above the Routh limit.

    Parameters
    ----------
    zeta : (5.12), above zero.
    """
    (z,) = _above_zero(zeta=zeta)
    return np.where(z < math.sqrt(0.75), _gamma_at(0.0, np.minimum(z, math.sqrt(0.75))), gamma_a(z))


def gamma_3(zeta: ArrayLike) -> Array:
    """Value gamma_III of gamma where Psi = 1: from it on every step diverges (domain III of figure 5.8); not in print.

    Parameters
    ----------
    zeta : (5.12), above zero.
    """
    return _gamma_at(1.0, zeta)


def _gamma_at(ratio: float, zeta: ArrayLike) -> Array:
    """Value of gamma where Psi has a value; Psi rises with gamma above gamma_a."""
    (z,) = _above_zero(zeta=zeta)
    starts = gamma_a(z)
    found = [_root(ratio, a, b) for a, b in zip(starts.ravel().tolist(), z.ravel().tolist(), strict=True)]
    return np.array(found, dtype=float).reshape(z.shape)


def _root(ratio: float, start: float, zeta: float) -> float:
    """Bisect between gamma_a, where the slip creeps, and a gamma where Psi is above the ratio."""

    def excess(gamma: float) -> float:
        slip = half_cycle(gamma, zeta)
        return -1.0 if slip.duration == math.inf else -slip.error - ratio

    low, high = start, 2.0 * start
    while excess(high) <= 0.0:
        low, high = high, 2.0 * high
    while high - low > 4e-16 * high:
        middle = (low + high) / 2.0
        if not low < middle < high:
            break
        if excess(middle) > 0.0:
            high = middle
        else:
            low = middle
    return (low + high) / 2.0


def point_b(zeta: ArrayLike, transmission_stiffness: ArrayLike = 1.0, contact_stiffness: ArrayLike = 1.0) -> Array:
    """F_friction/F_error of point B of figure 5.8: above it a step is friction-dominated up to gamma_III.

    At gamma_III the first slip just ends in stick: J_l |x''| = 2 F_friction there.  Not in print;
    1.356 for zeta = 0.25 and equal stiffnesses.

    Parameters
    ----------
    zeta : (5.12), above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero; their ratio counts.
    """
    ktr, kc = _above_zero(transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness)
    z, share = np.broadcast_arrays(np.asarray(zeta, dtype=float), (ktr + kc) / (2.0 * kc))
    gammas = gamma_3(z)
    flat = [abs(half_cycle(g, d).acceleration) for g, d in zip(gammas.ravel(), z.ravel(), strict=True)]
    return np.array(flat, dtype=float).reshape(z.shape) * share


# -------------------------------------------------------------------- actuator limit cycle (5.5.3)
def actuator_cycle(friction: ArrayLike, transmission_stiffness: ArrayLike, gamma: ArrayLike, zeta: ArrayLike) -> Array:
    """Limit cycle of x_m, PEAK TO PEAK, rad, (5.20): 2 F_friction/k_tr, once F_c has settled.

    Coulomb friction.  The print calls it amplitude and gives no range: it exists where a slip
    overshoots and shrinks, 0 < Psi < 1, gamma_b to gamma_III (from gamma = 1 on only for steps that
    are stable).  Elsewhere the result is 0 (below: one-sided, no cycle) or infinite (above: diverges).

    Parameters
    ----------
    friction : F_friction, N m, zero or more.
    transmission_stiffness : k_tr, N m/rad, above zero.
    gamma, zeta : (5.15), (5.12), above zero.
    """
    (f,) = _zero_or_more(friction=friction)
    (ktr,) = _above_zero(transmission_stiffness=transmission_stiffness)
    ratio = psi(gamma, zeta)
    return np.where(ratio <= 0.0, 0.0, np.where(ratio < 1.0, 2.0 * f / ktr, math.inf))


def actuator_cycle_work(friction: ArrayLike, transmission_stiffness: ArrayLike) -> Array:
    """Work that the actuator cycle dissipates per half cycle, N m, (5.21) corrected: F^2/(2 k_tr).

    What the spring holds at breakaway; twice that is printed, which (5.22) contradicts.

    Parameters
    ----------
    friction : F_friction, N m, zero or more.
    transmission_stiffness : k_tr, N m/rad, above zero.
    """
    (f,) = _zero_or_more(friction=friction)
    (ktr,) = _above_zero(transmission_stiffness=transmission_stiffness)
    return f * f / (2.0 * ktr)


def actuator_cycle_power(gain: ArrayLike, error: ArrayLike, friction: ArrayLike) -> Array:
    """Power of the actuator cycle averaged over a half cycle, W, (5.22): G_I |e| F_friction/4.

    Work (5.21) over the time 2 F_friction/(G_I k_tr |e|) from one breakaway to the other; the slip's
    own time is neglected, which holds once e is small.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    error : e while stuck, N m.
    friction : F_friction, N m, zero or more.
    """
    (g,) = _above_zero(gain=gain)
    (f,) = _zero_or_more(friction=friction)
    return g * np.abs(np.asarray(error, dtype=float)) * f / 4.0
