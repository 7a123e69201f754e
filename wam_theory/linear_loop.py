"""Force control through springs and an inertia without dry friction: error, speed, stability (sections 5.3, 5.5, 5.7).

Symbols: k_tr, k_c the stiffnesses on both sides of the node, ks = k_tr + k_c, K = k_tr k_c/ks,
gamma = J_l G_I K/b, zeta = b/(2 sqrt(J_l ks)).  All arguments broadcast and all results have the
shape they broadcast to; SI with radians, or any consistent units.  Misprints are corrected and named in
the docstring (docs/errata.md).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev, polynomial
from numpy.typing import ArrayLike, NDArray

from wam_theory.arguments import Array, above_zero, finite, zero_or_more
from wam_theory.friction_model import require_whole
from wam_theory.thresholds import SEARCH
from wam_theory.zero_order_hold import zero_order_hold


class SampledMargin(NamedTuple):
    """Smallest gain at which a sampled loop oscillates, and its frequency, rad/s."""

    gain: float
    frequency: float


def series_stiffness(transmission_stiffness: ArrayLike, contact_stiffness: ArrayLike) -> Array:
    """K = k_tr k_c/(k_tr + k_c), N m/rad, of transmission and contact in series.

    Parameters
    ----------
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    """
    ktr, kc = above_zero(transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness)
    return ktr * kc / (ktr + kc)


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
    j, ktr, kc = above_zero(
        inertia=inertia, transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness
    )
    (b,) = zero_or_more(damping=damping)
    return b / (2.0 * np.sqrt((ktr + kc) * j))


def proportional_error(force: ArrayLike, proportional_gain: ArrayLike, stiffness: ArrayLike) -> Array:
    """Steady error of proportional control, N m, (5.1): F_des/(1 + G_P K).  No friction.

    Parameters
    ----------
    force : F_des, N m.
    proportional_gain : G_P, rad/(N m), zero or more.
    stiffness : K, N m/rad, above zero.
    """
    (gain,) = zero_or_more(proportional_gain=proportional_gain)
    (k,) = above_zero(stiffness=stiffness)
    (desired,) = finite(force=force)
    return desired / (1.0 + gain * k)


def integral_time_constant(gain: ArrayLike, stiffness: ArrayLike) -> Array:
    """Time constant of integral control, s, (5.2): 1/(G_I K).

    F_c = F_des (1 - exp(-t/tau)) after a step.  No friction; inertia small by (5.4).

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    stiffness : K, N m/rad, above zero.
    """
    g, k = above_zero(gain=gain, stiffness=stiffness)
    return 1.0 / (g * k)


def closed_loop(
    s: ArrayLike,
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    proportional_gain: ArrayLike = 0.0,
) -> NDArray[np.complex128]:
    """Transfer function F_c/F_des of the linear loop, (5.14).

    (G_I + G_P s) k_tr k_c over the polynomial of `characteristic_polynomial`; the print has G_P/s for
    G_P s.  No dry friction, or during a slip of Coulomb friction that began at rest.

    Parameters
    ----------
    s : complex frequency, rad/s; j omega for a frequency response.
    gain, inertia, damping, transmission_stiffness, contact_stiffness, proportional_gain : as in
        `characteristic_polynomial`.
    """
    polynomial_ = characteristic_polynomial(
        gain, inertia, damping, transmission_stiffness, contact_stiffness, proportional_gain
    )
    frequency, below = polynomial_at(polynomial_, s)
    stiffness = np.asarray(transmission_stiffness, dtype=float) * np.asarray(contact_stiffness, dtype=float)
    feedforward = (np.asarray(gain, dtype=float) + np.asarray(proportional_gain, dtype=float) * frequency) * stiffness
    return feedforward / below


def polynomial_at(coefficients: Array, s: ArrayLike) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """A complex frequency s, rad/s, as an array, and the value there of a polynomial of degree three.

    Parameters
    ----------
    coefficients : (..., 4), as `characteristic_polynomial` returns them.
    s : complex frequency, rad/s.
    """
    c3, c2, c1, c0 = np.moveaxis(coefficients, -1, 0)
    frequency = np.asarray(s, dtype=complex)
    return frequency, ((c3 * frequency + c2) * frequency + c1) * frequency + c0


def characteristic_polynomial(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    proportional_gain: ArrayLike = 0.0,
) -> Array:
    """Denominator of (5.14), highest power first: J_l, b, k_tr + k_c + G_P k_tr k_c, G_I k_tr k_c.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), zero or more.
    inertia : J_l, kg m^2, above zero.
    damping : b, N m s/rad, zero or more.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    proportional_gain : G_P, rad/(N m), zero or more.

    Returns
    -------
    (..., 4), the leading shape is what the arguments broadcast to.
    """
    j, ktr, kc = above_zero(
        inertia=inertia, transmission_stiffness=transmission_stiffness, contact_stiffness=contact_stiffness
    )
    g, b, gp = zero_or_more(gain=gain, damping=damping, proportional_gain=proportional_gain)
    return np.stack(np.broadcast_arrays(j, b, ktr + kc + gp * ktr * kc, g * ktr * kc), axis=-1)


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
    (g,) = above_zero(gain=gain)
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
    j, b, ktr, kc = above_zero(
        inertia=inertia,
        damping=damping,
        transmission_stiffness=transmission_stiffness,
        contact_stiffness=contact_stiffness,
    )
    (gp,) = zero_or_more(proportional_gain=proportional_gain)
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

    The motor's speed is held for a sample period and follows from the sample `delay_samples` periods
    earlier.  With P(z) z^d + g Q(z) the characteristic polynomial of the exactly discretised loop,
    the loop oscillates where Q/(P z^d) is real and negative on the unit circle; its imaginary part is
    sin(theta) times a polynomial in cos(theta), whose roots are all candidates apart from theta = pi.
    It is kept as a Chebyshev series: in powers of the cosine the roots of a long delay are lost.  Where the
    loop is `SEARCH.fast`, the angle vanishes in rounding, and the margin is that of `_fast_margin`.

    Parameters
    ----------
    inertia : J_l, kg m^2, above zero.
    damping : b, N m s/rad, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    sample_period : s, above zero.
    delay_samples : with zero the command follows within the period.
    """
    j, b, ktr, kc, period = (
        float(a)
        for a in above_zero(
            inertia=inertia,
            damping=damping,
            transmission_stiffness=transmission_stiffness,
            contact_stiffness=contact_stiffness,
            sample_period=sample_period,
        )
    )
    require_whole("delay_samples", delay_samples)
    fast = _fast_margin(j, b, ktr, kc, period, int(delay_samples))
    if fast.frequency * period < SEARCH.fast and fast.frequency * period * (delay_samples + 0.5) < SEARCH.short_delay:
        return fast
    p, q = _held_loop(j, b, ktr, kc, period)
    p = np.concatenate([np.zeros(int(delay_samples)), p])
    condition = np.zeros(1)
    for i, qi in enumerate(q):
        for k, pk in enumerate(p):
            if i != k:
                condition = chebyshev.chebadd(condition, math.copysign(1.0, i - k) * qi * pk * _sine_ratio(abs(i - k)))
    roots = chebyshev.chebroots(np.trim_zeros(condition, "b"))
    cosines = [r.real for r in roots if abs(r.imag) < 1e-7 and abs(r.real) < 1.0 - 1e-9]
    best = SampledMargin(math.inf, math.nan)
    for theta in [*map(math.acos, cosines), math.pi]:
        z = complex(math.cos(theta), math.sin(theta))
        gain = -complex(polynomial.polyval(z, p) / polynomial.polyval(z, q)).real
        if 0.0 < gain < best.gain:
            best = SampledMargin(gain, theta / period)
    return best


def _fast_margin(j: float, b: float, ktr: float, kc: float, period: float, delay_samples: int) -> SampledMargin:
    """Margin of the continuous loop behind the lag of hold and delay, without the aliases of the samples.

    With the lag D = (delay_samples + 1/2) T and sinc the size of the hold, the loop oscillates where
    J w^2 + b w tan(w D) = k_tr + k_c and G_I k_tr k_c sinc(w T/2) cos(w D) = b w^2.
    """
    lag = (delay_samples + 0.5) * period
    low, high = 0.0, min(math.sqrt((ktr + kc) / j), 0.5 * math.pi / lag)
    while low < (middle := 0.5 * (low + high)) < high:
        rises = j * middle * middle + b * middle * math.tan(middle * lag) < ktr + kc
        low, high = (middle, high) if rises else (low, middle)
    size = float(np.sinc(0.5 * high * period / math.pi)) * math.cos(high * lag)
    return SampledMargin(b / ktr * (high * high / kc) / size, high)


def _held_loop(j: float, b: float, ktr: float, kc: float, period: float) -> tuple[Array, Array]:
    """Denominator and numerator in ascending powers of z of F_c over the held speed of x_m."""
    ks = ktr + kc
    rate = np.array([[0.0, 1.0, 0.0], [-ks / j, -b / j, ktr / j], [0.0, 0.0, 0.0]])
    a, inlet = zero_order_hold(rate, np.array([[0.0], [0.0], [1.0]]), period)
    p = np.asarray(np.poly(a), dtype=float)
    # c adj(zI - A) b = det(zI - A + b c) - det(zI - A)
    q = np.asarray(np.poly(a - inlet @ np.array([[kc, 0.0, 0.0]])), dtype=float) - p
    return p[::-1].copy(), q[::-1].copy()


def _sine_ratio(n: int) -> Array:
    """sin(n theta)/sin(theta) as a Chebyshev series in cos(theta), ascending."""
    series = np.zeros(n)
    series[n - 1 :: -2] = 2.0
    if n % 2:
        series[0] = 1.0
    return series
