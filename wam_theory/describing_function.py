"""The unstable limit cycle of domain II, by describing function and exactly (section 5.5.1).

Above the Routh limit a small motion decays, because friction dissipates more than the loop adds, and a
large one grows; in between lies an unstable periodic motion.  Symbols, shapes
and units as in `linear_loop`; Coulomb friction, integral control, a continuous loop.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wam_theory.arguments import Array, above_zero
from wam_theory.linear_loop import characteristic_polynomial, damping_ratio, gain_ratio, polynomial_at


class UnstableCycle(NamedTuple):
    """An unstable periodic motion about F_des.

    Attributes
    ----------
    force : (...), amplitude (half of the peak to peak) of F_c, N m.
    frequency : (...), rad/s.
    """

    force: Array
    frequency: Array


def friction_to_velocity(
    s: ArrayLike,
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
) -> NDArray[np.complex128]:
    """G(s) of figure 5.6 and (5.16), from the friction force, against the motion, to the velocity of the node.

    s^2 over the denominator of (5.14), rad/s/(N m); figure 5.7 shows its intersection with -1/N(A).

    Parameters
    ----------
    s : complex frequency, rad/s.
    gain, inertia, damping, transmission_stiffness, contact_stiffness : as in
        `linear_loop.characteristic_polynomial`.
    """
    coefficients = characteristic_polynomial(gain, inertia, damping, transmission_stiffness, contact_stiffness)
    frequency, below = polynomial_at(coefficients, s)
    return frequency * frequency / below


def coulomb_describing_function(friction: ArrayLike, amplitude: ArrayLike) -> Array:
    """N(A) of (5.16) for Coulomb friction, N m s/rad: 4 F_friction/(pi A), the fundamental of a square wave.

    Parameters
    ----------
    friction : F_friction, N m, above zero.
    amplitude : A, of the node's velocity, rad/s, above zero.
    """
    f, a = above_zero(friction=friction, amplitude=amplitude)
    return 4.0 * f / (math.pi * a)


def predicted_unstable_cycle(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    friction: ArrayLike,
) -> UnstableCycle:
    """Solution of 1 + G(j omega) N(A) = 0, (5.16), as motion of F_c.

    N(A) replaces the missing damping: b + N(A) = gamma b at omega = sqrt(ks/J_l), so that
    A = 4 F_friction/(pi b (gamma - 1)).  Compared with `unstable_cycle`, for zeta = 0.25, the force is 0.7 %
    too large at gamma = 1.1, 5 % at 1.5, 18 % at 2.0 and 46 % at gamma_III = 2.19, and the frequency 0.03 %,
    1 %, 5 % and 13 %; in domain III a cycle is predicted where none exists.

    Parameters
    ----------
    gain : G_I, rad/s/(N m), above zero.
    inertia, damping : J_l, kg m^2, b, N m s/rad, above zero.
    transmission_stiffness, contact_stiffness : N m/rad, above zero.
    friction : F_friction, N m, above zero.

    Returns
    -------
    UnstableCycle
        force infinite and frequency NaN for gamma of at most 1, where no cycle is predicted.
    """
    (f,) = above_zero(friction=friction)
    gamma = gain_ratio(gain, inertia, damping, transmission_stiffness, contact_stiffness)
    j, b, ktr, kc = (np.asarray(a, dtype=float) for a in (inertia, damping, transmission_stiffness, contact_stiffness))
    gamma, natural, size = np.broadcast_arrays(gamma, np.sqrt((ktr + kc) / j), 4.0 * f * kc / (math.pi * b))
    force = np.divide(size, natural * (gamma - 1.0), out=np.full(gamma.shape, math.inf), where=gamma > 1.0)
    return UnstableCycle(force, np.where(gamma > 1.0, natural, math.nan))


def unstable_cycle(
    gain: ArrayLike,
    inertia: ArrayLike,
    damping: ArrayLike,
    transmission_stiffness: ArrayLike,
    contact_stiffness: ArrayLike,
    friction: ArrayLike,
) -> UnstableCycle:
    """The exact unstable cycle, with all harmonics that (5.16) neglects; not in print.

    With the poles p of (5.14) and D its denominator, the velocity under a square wave of friction of
    half period T is zero at its switches where sum p/D'(p) tanh(p T/2) = 0; its position is
    F sum tanh(p T/2)/D'(p) there.  It reverses without sticking from gamma = 1, where it is infinite, to
    gamma_III, where it becomes the slip from stick to stick of Psi = 1.  The largest step from rest
    that stays stable is larger, because the first slip loses more than the cycle does: 2.0, 1.4 and 1.1
    times this force for zeta = 0.25 and gamma = 1.1, 1.5 and 2.0 (`stick_slip.largest_stable_step`).

    Parameters
    ----------
    gain, inertia, damping, transmission_stiffness, contact_stiffness, friction : as in
        `predicted_unstable_cycle`.

    Returns
    -------
    UnstableCycle
        force infinite and frequency NaN for gamma of at most 1; force 0 and frequency NaN from gamma_III on.
    """
    (f,) = above_zero(friction=friction)
    gamma = gain_ratio(gain, inertia, damping, transmission_stiffness, contact_stiffness)
    zeta = damping_ratio(inertia, damping, transmission_stiffness, contact_stiffness)
    j, ktr, kc = (np.asarray(a, dtype=float) for a in (inertia, transmission_stiffness, contact_stiffness))
    natural, share = np.sqrt((ktr + kc) / j), f * kc / (ktr + kc)
    gamma, zeta, natural, share = np.broadcast_arrays(gamma, zeta, natural, share)
    found = [_cycle(g, z) for g, z in zip(gamma.ravel().tolist(), zeta.ravel().tolist(), strict=True)]
    size, frequency = np.array(found, dtype=float).reshape(-1, 2).T
    return UnstableCycle(size.reshape(gamma.shape) * share, frequency.reshape(gamma.shape) * natural)


def _cycle(gamma: float, zeta: float) -> tuple[float, float]:
    """Size and frequency with J_l = ks = F_friction = 1."""
    if gamma <= 1.0:
        return math.inf, math.nan
    poles = np.roots([1.0, 2.0 * zeta, 1.0, 2.0 * zeta * gamma])
    slopes = (3.0 * poles + 4.0 * zeta) * poles + 1.0

    def sums(half_period: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration just after a switch to motion with positive velocity."""
        modes = np.tanh(poles * half_period / 2.0) / slopes
        x, v, a = (float((modes * poles**k).sum().real) for k in range(3))
        return x, v, a - 1.0

    # above the half period of the growing pair the spring force at the switch falls with the half period; while it
    # exceeds friction the node reverses without sticking, with one zero of the velocity, or none in domain III
    first = math.pi / float(np.abs(poles.imag).max())
    last = _bisect(lambda time: sums(time)[2], first, 2.0 * first)
    if sums(first)[1] * sums(last)[1] > 0.0:
        return 0.0, math.nan
    half_period = _bisect(lambda time: sums(time)[1], first, last)
    return -sums(half_period)[0], math.pi / half_period


def _bisect(value: Callable[[float], float], low: float, high: float) -> float:
    """Zero of a function between low and high, where it has different signs."""
    sign = value(low) > 0.0
    while True:
        middle = (low + high) / 2.0
        if not low < middle < high:
            return middle
        if (value(middle) > 0.0) is sign:
            low = middle
        else:
            high = middle
